// SPDX-License-Identifier: GPL-3.0-or-later
//
// Which place of an old source each vertex of a new version of it was.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "tools/author/alignment.h"
#include "tools/author/surface.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// How a vertex found its old place.
enum class MatchRule : std::uint8_t {
  same,       ///< it lies there, to 1e-5 of the diagonal
  position,   ///< the nearest surface that looks the same way, within 2 % of the diagonal
  uv,         ///< the place with its UV: it was moved from there
  neighbour,  ///< it is new: as the nearest matched vertex along the surface
  none        ///< it belongs to a new part
};
inline constexpr std::size_t kMatchRules = 5;
/// "same", "position", ...
const char* matchRuleName(MatchRule rule);

struct SourceMatch {
  struct Vertex {
    MatchRule rule = MatchRule::none;
    std::uint32_t triangle = formats::kNone;   ///< of the old mesh; none for rules neighbour and none
    std::array<double, 3> corner = {0, 0, 0};  ///< barycentric
    double distance = 0;                       ///< m, from the old place, of rules same, position and uv
    std::uint32_t neighbour = formats::kNone;  ///< visual vertex of the new mesh, of rule neighbour
  };
  std::vector<Vertex> vertices;  ///< per visual vertex of the new mesh
  bool uvs_kept = false;         ///< both have UVs, and most of them are the same
  double matched = 0;            ///< part of the new surface with a place on the old one, 0..1

  /// Weights of the old mesh's visual vertices, at the new one's.
  std::vector<double> carry(const std::vector<double>& old_weights, const VisualMesh& old_mesh) const;
};

/// Places of the old mesh and of the new one that have the same UV, at most 4,000; none where less than half of the new
/// one's UVs are on the old one.
std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> pairsByUv(const VisualMesh& old_mesh,
                                                                   const VisualMesh& new_mesh);

/// \param to_old where the new mesh stands in the old one's metres.
SourceMatch matchSources(const VisualMesh& old_mesh, const VisualMesh& new_mesh, const Topology& new_topology,
                         const Similarity& to_old);

}  // namespace sinew::tools
