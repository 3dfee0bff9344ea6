// SPDX-License-Identifier: GPL-3.0-or-later
//
// A body that is held and pulled at a point, at rest, in few or many functions and clusters, against finite elements on
// the same tetrahedra. The report's skin patch (its figures 10 and 11) is
// samples/gallery/skin_patch.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/render/image.h"
#include "tools/render/picture.h"

namespace sinew::tools {

struct PullOptions {
  std::vector<std::uint32_t> clusters = {1, 2, 5};  ///< along the longest axis, in proportion along the others, 1..64;
                                                    ///< 0: those of the recipe
  std::vector<std::string> modes = {"quadratic"};   ///< values of clusters.mode
  std::vector<std::uint32_t> functions = {};        ///< values of field.functions, 1..256; empty: the recipe's
  std::vector<std::uint32_t> iterations = {4};      ///< WorldSettings::iterations, 1..16
  const SolverFactory* solver = nullptr;            ///< as BodySettings::solver
  std::uint32_t refinements = 2;                    ///< how often the reference cuts each tetrahedron into eight, 1..4
  std::optional<std::array<double, 3>> pick;        ///< where it is pulled, metres, as `sinew inspect` shows the source
  std::optional<std::array<double, 3>> pull;        ///< how far, metres
  double finger = 0.04;                             ///< radius of what is held there, of the diagonal
  double seconds = 4;                               ///< simulated, 60 steps a second
};

struct PullRow {
  std::array<std::uint32_t, 3> grid = {0, 0, 0};  ///< of clusters; zeros: those of the recipe
  std::string mode;
  std::uint32_t functions = 0;  ///< asked for
  std::uint32_t iterations = 0, clusters = 0, memberships = 0;
  double rms = 0;           ///< distance of the visual vertices from the reference, of its rms displacement
  double max = 0;           ///< the largest one, of its largest displacement
  double drift = 0;         ///< largest motion in the last half second, of the same: not yet at rest
  double microseconds = 0;  ///< median processor time of a step, one thread
  bool best = false;        ///< no other row has a smaller RMS error for less time
  Shape shape;
  std::shared_ptr<const Asset> asset;
};

struct PullStudy {
  std::vector<PullRow> rows;
  Shape reference;
  std::uint32_t reference_tetrahedra = 0;
  double largest = 0;     ///< displacement of the reference, metres
  double rms = 0;         ///< of the reference's displacements, of the largest: the error of a body that does not move
  double change_rms = 0;  ///< of the reference by its last refinement, of the largest displacement
  double change_max = 0;
  double poisson = 0;                  ///< of the reference: clusters.poisson
  std::uint32_t held = 0, pulled = 0;  ///< physical vertices
};

/// Bakes the recipe once for each kind of clusters and number of functions, and pulls each body the same way, without
/// gravity: what the recipe's pins hold stays (where it has none: the under side of a shell, the lowest tenth of a
/// solid), and free vertices within a fingertip of `pick` move by `pull` in the first third of the time. Places are
/// prescribed, not forces, so that all are asked the same and Young's modulus does not matter to the reference. Without
/// `pick`: near the middle of a sheet, else the visual vertex farthest from what is held; without `pull`: 2 % of the
/// diagonal along the normal there. Throws ToolError where the recipe cannot be baked, or nothing free is near the
/// pick.
PullStudy measurePull(const Recipe& recipe, const PullOptions& options, const std::function<void(double)>& progress);

nlohmann::ordered_json pullJson(const PullStudy& study);
std::string pullText(const PullStudy& study);

/// The reference, then the rows; small displacements enlarged, all alike. Needs a current OpenGL context.
Image pullPicture(const PullStudy& study);

}  // namespace sinew::tools
