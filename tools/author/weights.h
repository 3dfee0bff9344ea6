// SPDX-License-Identifier: GPL-3.0-or-later
//
// From weights on the visual mesh to clusters of physical vertices.
#pragma once

#include <span>
#include <vector>

#include "tools/attach/attach.h"
#include "tools/author/clusters.h"
#include "tools/author/recipe.h"
#include "tools/author/selection.h"
#include "tools/author/tet_graph.h"

namespace sinew::tools {

/// Carries weights from visual to physical vertices. A physical vertex whose tetrahedra hold visual vertices takes
/// their mean, weighted by area and by how much each hangs on it (of large triangles: points all over them); any other
/// (inside the solid) takes that of the nearest such one along the tetrahedra's edges, so nothing jumps a gap.
class WeightTransfer {
 public:
  /// All arguments must outlive it.
  WeightTransfer(const VisualMesh& mesh, const PhysicalMesh& physical, const std::vector<TetrahedronPlace>& places);

  std::vector<double> operator()(std::span<const double> visual) const;
  const TetGraph& graph() const { return graph_; }
  const PhysicalMesh& physical() const { return physical_; }

 private:
  struct Contribution {
    std::uint32_t physical, visual;
    double weight;
  };
  const PhysicalMesh& physical_;
  TetGraph graph_;
  std::vector<Contribution> contributions_;  // by physical vertex, one of each pair
  std::vector<double> total_;                // of contributions, per physical vertex
  std::vector<std::uint32_t> taken_from_;    // per physical vertex: itself, or the nearest that has a contribution
};

/// The settings of a cluster: those of all, and its own.
ClusterOptions optionsOf(const RecipeCluster& cluster, const Settings& settings);

/// Makes clusters of physical vertices of the recipe's: carries weights over, gives what no cluster covers to the
/// nearest one along the tetrahedra, widens each by its overlap (so that neighbours share vertices and hold together),
/// cuts any that ask for it, and splits any that span pieces. Pieces that no cluster touches get automatic ones.
/// Every physical vertex is in a cluster; clusters are ordered by piece, then as in the recipe.
/// \param recipe_clusters with cluster meshes; \param weights one for each.
std::vector<ClusterSource> authoredClusters(const WeightTransfer& transfer,
                                            std::span<const RecipeCluster> recipe_clusters,
                                            std::span<const VisualWeights> weights, const Settings& settings,
                                            std::vector<Finding>& findings);

/// The longest way within a cluster along the tetrahedra, as a unit direction; its sign such that the largest component
/// is positive. Zero for a cluster of one vertex.
Eigen::Vector3d longestAxis(const PhysicalMesh& mesh, const TetGraph& graph, const ClusterSource& cluster);

}  // namespace sinew::tools
