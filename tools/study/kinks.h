// SPDX-License-Identifier: GPL-3.0-or-later
//
// Does a surface that is smooth at rest stay smooth? The largest angle between neighbouring faces at the end of a
// scene against that at rest; the report's bent bar (its figure 9) is samples/gallery/l_bar.
#pragma once

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/render/image.h"
#include "tools/render/picture.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

struct KinkOptions {
  SceneChoice scene = SceneKind::stretch;  ///< played once, 60 steps a second, to its end
  const SolverFactory* solver = nullptr;   ///< as BodySettings::solver
  std::uint32_t iterations = 0;            ///< WorldSettings::iterations; 0: the scene's own
  std::string mask;                        ///< only faces all of whose vertices weigh more than one half; empty: all
  std::array<std::string, 2> arms;  ///< masks of two limbs, straight at rest, whose angle is measured; empty: none
};

/// The sharpest place of a surface.
struct Kink {
  double degrees = 0;  ///< largest angle between the normals of two faces that share an edge
  std::array<double, 3> place = {0, 0,
                                 0};  ///< middle of that edge at rest, metres, as `sinew inspect` shows the source
};

struct KinkResult {
  std::string name;  ///< as it was given
  Kink rest, posed;
  double ratio = 0;                             ///< posed to rest
  std::optional<double> rest_bend, posed_bend;  ///< degrees between the arms' axes: 0 = straight on
  Shape rest_shape, posed_shape;
  std::shared_ptr<const Asset> asset;
};

/// Plays the scene and measures the visual surface before and after. Faces that meet in one place of the source share
/// an edge, also across a seam. \param name for results and messages. Throws ToolError(bad_input) where the package
/// lacks a mask, or has no two neighbouring faces there.
KinkResult measureKinks(std::shared_ptr<const Asset> asset, const std::string& name, const KinkOptions& options);

nlohmann::ordered_json kinksJson(const std::vector<KinkResult>& results, const KinkOptions& options);
std::string kinksText(const std::vector<KinkResult>& results);

/// The first one at rest, then all as posed, side by side. Needs a current OpenGL context.
Image kinksPicture(const std::vector<KinkResult>& results, const KinkOptions& options);

}  // namespace sinew::tools
