// SPDX-License-Identifier: GPL-3.0-or-later
//
// Costs of a package in bytes and time, and savings by leaving things out of it.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>

#include "sinew/runtime/asset.h"

namespace sinew::tools {

/// Scene of a body while its steps are timed.
enum class FrameScene : std::uint8_t {
  air,     ///< thrown, turning and ringing, with nothing near
  ground,  ///< dropped from a tenth of its diagonal onto level ground: 2 s
  held,    ///< held by all of the package's pins, swinging from rest under gravity: 2 s
};

/// The scene that a package is judged by: held where it has pins, else ground where its points may touch, else air.
FrameScene usualScene(const Asset& asset);

/// Microseconds of processor time of a frame of 1/60 s, one body, one thread.
struct FrameCost {
  double step = 0;   ///< World::step(), mean over the scene, median of several runs
  double drawn = 0;  ///< the visual vertices' positions and normals
  double all() const { return step + drawn; }
};
FrameCost measureFrame(const std::shared_ptr<const Asset>& asset, FrameScene scene);

/// `inspect --cost`: bytes of each section, bytes and microseconds of each need (tools/author/needs.h).
nlohmann::ordered_json packageCost(const std::shared_ptr<const Asset>& asset);

}  // namespace sinew::tools
