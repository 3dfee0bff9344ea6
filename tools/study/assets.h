// SPDX-License-Identifier: GPL-3.0-or-later
//
// The judge of accuracy: packages as they are baked, held, loaded and brought to rest by the runtime, against quadratic
// finite elements on their own tetrahedra.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/study/held_body.h"

namespace sinew::tools {

/// How a body is held and loaded. Heights and lengths are of the physical vertices that are kept.
enum class HoldScene : std::uint8_t {
  hang,        ///< its top tenth is held, gravity down
  lean,        ///< its lowest tenth is held, gravity sideways, along x
  cantilever,  ///< the rear quarter of the longest horizontal axis is held, gravity down
  press,       ///< the lowest and the highest tenth are held, the highest one moves down by 20 % of the height
  squeeze,     ///< the same by 5 %: before most bodies buckle
  twist,       ///< both end tenths of the longest axis are held, one turns by 60 degrees about it
  pins,        ///< the package's own pin sets hold it from the start, gravity down
};
inline constexpr std::size_t kHoldSceneCount = 7;

std::string_view nameOf(HoldScene scene);
/// The scene of a name; nothing where there is none.
std::optional<HoldScene> holdSceneOf(std::string_view name);

/// Bounds of the vertices that are kept, metres.
struct SolidExtent {
  Eigen::Vector3d low, high;
};
SolidExtent extentOf(const PackageSolid& solid);

/// Load case of a scene. Gravity has a strength of 1 m/s². No regions where the scene does not exist for the body:
/// `pins` without pin sets. \param extent what heights and lengths are shares of: the solid's own, or another's of the
/// same source.
HeldCase heldCase(const PackageSolid& solid, const formats::PackageView& package, HoldScene scene,
                  const SolidExtent& extent);
inline HeldCase heldCase(const PackageSolid& solid, const formats::PackageView& package, HoldScene scene) {
  return heldCase(solid, package, scene, extentOf(solid));
}

struct AssetsOptions {
  std::vector<HoldScene> scenes = {HoldScene::hang,  HoldScene::lean,    HoldScene::cantilever,
                                   HoldScene::press, HoldScene::squeeze, HoldScene::twist};
  /// Gravity is as strong as makes the reference's rms displacement this share of the diagonal, 1e-6..0.5. Scenes that
  /// move what they hold have no gravity and are played once.
  std::vector<double> targets = {0.05, 0.01};
  std::optional<double> young;            ///< Pa: in place of the package's own
  std::optional<double> poisson;          ///< in place of the package's own, 0..0.499
  const SolverFactory* solver = nullptr;  ///< null: its fields
  double rate_hz = 60;                    ///< steps a second
  double seconds = 20;                    ///< simulated at most
  double rest_speed = 1e-5;               ///< rms speed of a body at rest, diagonals/s
};

/// One package in one scene.
struct AssetsRow {
  std::string package;
  HoldScene scene = HoldScene::hang;
  double target = 0;                                ///< of AssetsOptions::targets; 0: what is held moves
  bool exists = true;                               ///< false: nothing is held in this scene; the rest is empty
  PieceMaterial material;                           ///< of the first piece that is compared
  double gravity = 0;                               ///< m/s²
  double reference_rms = 0, reference_largest = 0;  ///< displacement, diagonals
  std::uint32_t reference_tetrahedra = 0;
  std::uint32_t left_out = 0;            ///< tetrahedra that are not joined by faces to the rest of their piece
  std::uint32_t pieces_idle = 0;         ///< pieces that no region holds: not compared
  std::uint32_t held = 0, compared = 0;  ///< vertices
  std::uint32_t held_in_part = 0;        ///< by pin weights below 1 (PPIN), in `pins`: free in the reference
  bool stable = false, on_target = true;
  double residual = 0;
  HeldScore score;
  double rest_seconds = -1;  ///< negative: it did not come to rest
  double speed = 0;          ///< rms at the end, diagonals/s
  double microseconds = 0;   ///< median processor time of a step, one thread
  bool finite = true;
};

struct NamedAsset {
  std::string name;
  std::shared_ptr<const Asset> asset;
};

/// Every package in every scene at every target, in this order. Throws ToolError(bad_input) where a package has no
/// tetrahedra.
std::vector<AssetsRow> measureAssets(const std::vector<NamedAsset>& assets, const AssetsOptions& options,
                                     const std::function<void(double)>& progress);

nlohmann::ordered_json assetsJson(const std::vector<AssetsRow>& rows, const AssetsOptions& options);
std::string assetsText(const std::vector<AssetsRow>& rows);

}  // namespace sinew::tools
