// SPDX-License-Identifier: GPL-3.0-or-later
//
// Loose parts that ride along without tetrahedra of their own: eyeballs, teeth, lashes, buttons (recipe key `parts`).
#pragma once

#include <string>
#include <vector>

#include "sinew/formats/writer.h"
#include "tools/attach/attach.h"
#include "tools/author/recipe.h"
#include "tools/author/weights.h"
#include "tools/bake/authored.h"

namespace sinew::tools {

/// A part of the recipe on its source.
struct RidingPart {
  std::string name;
  bool rigid = true;
  std::vector<std::uint32_t> triangles;  ///< of its loose parts, ascending
  std::vector<std::uint32_t> vertices;   ///< visual, ascending
  VisualWeights host;                    ///< what carries it; empty: what is nearest
};

/// Per visual vertex, whether it is of a loose part that rides along: one of which some part's selection holds at least
/// half, by area. Empty without parts.
std::vector<std::uint8_t> ridingVertices(std::span<const VisualWeights> parts, const VisualMesh& mesh,
                                         const Topology& topology);

/// The loose parts that each part of the recipe names. Throws ToolError(bad_input) with line and cure where one holds
/// no loose part, where two hold the same, or where nothing is left to be filled.
std::vector<RidingPart> findParts(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh,
                                  const Topology& topology, std::vector<Finding>& findings);

/// The mesh without the triangles of the parts. Vertices and points stay, with their numbers; so do the bounds.
VisualMesh withoutParts(const VisualMesh& mesh, const std::vector<RidingPart>& parts);

/// Gives the vertices of parts that follow the tetrahedron of the nearest point of the host's surface.
/// \param host the mesh without parts; \param places in and out, per visual vertex.
void followHost(const std::vector<RidingPart>& parts, const VisualMesh& host, const PhysicalMesh& physical,
                std::vector<TetrahedronPlace>& places);

/// Carrier of a rigid part: four light vertices of a tetrahedron around it.
struct Rider {
  std::uint32_t part = 0;                 ///< of the parts
  std::uint32_t piece = 0;                ///< that carries it
  std::uint32_t tetrahedron = 0;          ///< of the physical mesh, behind the piece's own
  std::vector<TetrahedronPlace> on_host;  ///< where the nearest carries it: of its vertices, on the host
};

/// Gives each rigid part its tetrahedron, behind those of the piece that carries it, and hangs its vertices there.
/// \param host the mesh without parts; \param physical, places in and out: numbered as in the package from here on.
std::vector<Rider> joinRigidParts(const std::vector<RidingPart>& parts, const VisualMesh& host, PhysicalMesh& physical,
                                  std::vector<TetrahedronPlace>& places);

/// The rigid cluster of each rider: matched to the vertices of the host that carry the part, it moves only the rider's
/// four. So a part moves exactly as the best-fitting rigid motion of its host, the host does not feel it, and the
/// runtime knows nothing of parts.
std::vector<ClusterSource> riderClusters(const std::vector<RidingPart>& parts, const std::vector<Rider>& riders,
                                         const WeightTransfer& transfer);

/// Records the parts (sections PART, PRTV). \param clusters of the content, in order.
void addParts(const std::vector<RidingPart>& parts, const std::vector<Rider>& riders,
              std::span<const ClusterSource> clusters, const PhysicalMesh& physical, formats::PackageContent& content);

}  // namespace sinew::tools
