// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "tools/author/surface.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A duplicate of part of the surface, made by the artist to say what moves as one.
struct ClusterMesh {
  std::string name;                        ///< without CLUSTER_
  std::string object;                      ///< as the source calls it
  bool visual = false;                     ///< it is drawn too
  std::vector<Eigen::Vector3d> positions;  ///< metres, welded
  std::vector<Triangle> triangles;
};

/// Takes the cluster meshes out of a mesh: objects (nodes, meshes, OBJ groups) named CLUSTER_x, and nodes with a
/// property `sinew_cluster` (a name, or true for the node's own name). Those with a property `sinew_visual` that is
/// true stay in the mesh as well; of the others triangles and vertices leave it, so that they are neither drawn nor
/// filled. Their source vertices keep their numbers. Throws ToolError(bad_input) where nothing but cluster meshes is
/// left, or two have one name.
std::vector<ClusterMesh> takeClusterMeshes(VisualMesh& mesh);

struct ClusterMatch {
  std::vector<double> weights;    ///< per visual vertex: 1 where it belongs to the cluster mesh, else 0
  std::size_t unmatched = 0;      ///< vertices of the cluster mesh that lie too far from the surface
  double furthest = 0;            ///< metres: the largest distance of the matched ones
  double furthest_unmatched = 0;  ///< metres
};

/// Finds the visual vertices that a cluster mesh duplicates, by position: a vertex of the cluster mesh takes the visual
/// vertex nearest to it, and a visual vertex on the inside of the cluster mesh's surface belongs to it too, so that
/// duplicates that were smoothed, subdivided or thinned out still match. Faces that look the other way do not count.
/// \param tolerance metres; none: half of the edges there, at most 2 % of the diagonal.
ClusterMatch matchClusterMesh(const VisualMesh& mesh, const Surface& surface, const ClusterMesh& cluster,
                              std::optional<double> tolerance);

}  // namespace sinew::tools
