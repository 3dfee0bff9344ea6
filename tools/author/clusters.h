// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "sinew/formats/sections.h"
#include "tools/core/finding.h"
#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

/// Members that weigh less than this cost time and change nothing.
inline constexpr double kMinimumWeight = 0.02;

/// How clusters are made where nobody authored any.
enum class ClusterMethod { grid, kmeans };

struct ClusterOptions {
  ClusterMethod method = ClusterMethod::grid;
  std::array<std::uint32_t, 3> grid = {0, 0,
                                       0};  ///< boxes along x, y, z of each piece; all 0 = chosen by size and shape
  /// m, how far a cluster reaches into its neighbours; none = half a box of a grid, else 1.5 edges of the tetrahedra
  std::optional<double> overlap;
  double size = 0;           ///< m, width of a cluster of kmeans; 0 = chosen
  double soften_metres = 0;  ///< m, over which authored clusters blend into each other; 0 = as authored
  formats::ClusterMode mode = formats::ClusterMode::quadratic;
  double alpha = 1.0;        ///< the report's solver: part of the way to the goal in a step
  double stretch_hz = 10.0;  ///< frequency of stretch and shear
  double bend_hz = 10.0;     ///< of bending
  double twist_hz = 10.0;    ///< of twisting
  // Mechanics: docs/method.md; ranges as formats::ClusterMechanics.
  formats::StiffnessModel stiffness = formats::StiffnessModel::frequency;
  double per_step_beta = 0.5;  ///< of per_step: what a step of 1/60 s keeps of a deformation
  double young = 1e5;          ///< Pa, of elastic
  double poisson = 0.3;        ///< of elastic
  double damping = 0;          ///< 1/s, of a cluster's motion that is not rigid
  formats::LimitMethod limit = formats::LimitMethod::principal;
  double limit_min = 0.5;                       ///< least principal stretch
  double limit_max = 1.5;                       ///< largest principal stretch, or length of a row
  double limit_norm = 4;                        ///< squared norm from which frobenius, frobenius_cheap and soft act
  double limit_norm_max = 6;                    ///< what soft never reaches
  std::string limit_curve;                      ///< points "phi:f,phi:f,..." of curve
  std::optional<formats::VolumeMethod> volume;  ///< none = principal for solids, none for sheets
  double plastic_yield = 0.1;                   ///< deformation |S - 1| from which some of it stays
  double plastic_creep = 0;                     ///< 1/s, how fast; 0 = nothing stays
  double plastic_limit = 0.5;                   ///< most that stays
};

/// How far a cluster that is no box of a grid reaches into its neighbours, m. \param mean_edge of its piece's
/// tetrahedra, m.
inline double overlapOf(const ClusterOptions& options, double mean_edge) {
  constexpr double kAutomaticEdges = 1.5;
  return options.overlap.value_or(kAutomaticEdges * mean_edge);
}

/// A named, weighted set of physical vertices: a region with a material of its own.
struct ClusterSource {
  std::string name;
  std::uint32_t piece = 0;
  formats::ClusterMode mode = formats::ClusterMode::linear;
  std::vector<std::uint32_t> vertices;    ///< physical, ascending
  std::vector<double> weights;            ///< w_ic, > 0
  std::optional<ClusterOptions> options;  ///< its own; none = those of all
  std::uint32_t recipe_cluster =
      formats::kNone;  ///< its number in the recipe; none of automatic ones and of accessories
  /// Of an accessory: the first of the four physical vertices that it moves, while it is matched to `vertices`.
  std::uint32_t rider = formats::kNone;
};

/// A finding on the clusters of these names, "3 clusters " + what; none where there are no names.
void reportClusters(std::vector<Finding>& findings, const char* id, const std::vector<std::string>& names,
                    const std::string& what, const std::string& cure, Severity severity);

/// Cuts every piece into a regular grid of overlapping boxes. A box whose vertices fall into several pieces of the
/// tetrahedra becomes one cluster a piece; pieces too small to carry their mode join the neighbour they share most
/// edges with. Every vertex is in at least one cluster; no cluster spans two pieces.
std::vector<ClusterSource> gridClusters(const PhysicalMesh& mesh, const ClusterOptions& options,
                                        std::vector<Finding>& findings);

}  // namespace sinew::tools
