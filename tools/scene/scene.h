// SPDX-License-Identifier: GPL-3.0-or-later
//
// The built-in scenes that `simulate`, `render`, `view` and the studies share.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/runtime/world.h"

namespace sinew::tools {

enum class SceneKind { rest, drop, squash, stretch, hang };

/// Names in the order of the enum: "rest", "drop", "squash", "stretch", "hang".
std::span<const std::string_view> sceneNames();
std::optional<SceneKind> sceneByName(std::string_view name);

struct SceneOptions {
  SceneKind kind = SceneKind::drop;
  float step_seconds = 1.0F / 60;
  std::uint32_t iterations = 0;  ///< matching passes; 0 = the scene's default
  float stiffness_scale = 1;     ///< multiplies the frequencies of all clusters, 0..1e6
  std::optional<float>
      gravity;  ///< m/s^2 downwards; without it 9.81 diagonals per s^2, so that models of any size behave alike
};

/// One body of a package in one built-in scene. Lengths in the scene are relative to the rest diagonal.
class Scene {
 public:
  Scene(std::shared_ptr<const Asset> asset, const SceneOptions& options, JobSystem* jobs = nullptr);

  /// Back to the start.
  void reset();
  /// One step of options().step_seconds.
  void step();

  World& world() { return world_; }
  const World& world() const { return world_; }
  BodyId body() const { return body_; }
  const SceneOptions& options() const { return options_; }
  double time() const { return time_; }                              ///< seconds since the start
  bool hasGround() const;                                            ///< a ground plane at y = 0 is there to be drawn
  std::span<const std::uint32_t> pinned() const { return pinned_; }  ///< physical vertices held, for overlays

 private:
  /// Moves what the scene drives; false where the whole body is driven and there is nothing to step.
  bool drive();
  std::shared_ptr<const Asset> asset_;
  SceneOptions options_;
  World world_;
  BodyId body_;
  double time_ = 0;
  std::uint64_t steps_ = 0;
  std::vector<std::uint32_t> pinned_;
  std::vector<Vec3> start_;  // rest positions in the world, where the scene drives vertices from
};

}  // namespace sinew::tools
