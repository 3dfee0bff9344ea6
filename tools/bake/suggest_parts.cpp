// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/suggest_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/geometry/triangle_bvh.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kMostParts = 256;
constexpr std::size_t kMostLines = 8;
// A part of at most this part of the host's area rides on it.
constexpr double kSmall = 0.2;
// Farther than this of its own diagonal from the host's surface, a part is a piece of its own.
constexpr double kFar = 0.5;
// It may stick out of the host's box by this much of its own diagonal.
constexpr double kSticksOut = 1.0;
// Twice the volume over the area, of the diagonal: what is thinner is a sheet, which bends with its host. Of an open
// part the volume says little.
constexpr double kSheet = 0.02, kOpenSheet = 0.08;

Eigen::AlignedBox3d boxOf(const VisualMesh& mesh, const SurfacePart& part) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t t : part.triangles) {
    for (const std::uint32_t p : mesh.weldedTriangle(t)) box.extend(mesh.welded_positions[p]);
  }
  return box;
}

bool sticksOut(const Eigen::AlignedBox3d& box, const Eigen::AlignedBox3d& host) {
  const double most = kSticksOut * box.diagonal().norm();
  const Vector3d out = (host.min() - box.min()).cwiseMax(box.max() - host.max());
  return out.maxCoeff() > most;
}

// The selection that holds exactly a part's triangles, as JSON, and a name for it.
struct Named {
  std::string name, from;
};

Named nameOf(const VisualMesh& mesh, const Topology& topology, std::uint32_t number) {
  const std::vector<std::uint32_t>& triangles = topology.parts[number].triangles;
  for (const GroupSource& group : mesh.groups) {
    if (group.triangles == triangles) return {group.name, R"({"group": ")" + group.name + "\"}"};
  }
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    if (sub.triangle_count != triangles.size() || sub.first_triangle != triangles.front() || sub.node.empty()) continue;
    return {sub.node, R"({"object": ")" + sub.node + "\"}"};
  }
  return {"part" + std::to_string(number), "{\"part\": " + std::to_string(number) + "}"};
}

}  // namespace

std::vector<Finding> suggestParts(const VisualMesh& mesh, const Topology& topology) {
  const std::size_t count = topology.parts.size();
  if (count < 2 || count > kMostParts) return {};
  const auto largest = std::max_element(topology.parts.begin(), topology.parts.end(),
                                        [](const SurfacePart& a, const SurfacePart& b) { return a.area < b.area; });
  const Eigen::AlignedBox3d host_box = boxOf(mesh, *largest);
  std::vector<Triangle> surface;
  for (const std::uint32_t t : largest->triangles) surface.push_back(mesh.weldedTriangle(t));
  const geometry::TriangleBvh host(mesh.welded_positions, surface);
  Finding finding;
  std::vector<std::string> names;
  std::string lines;
  for (std::uint32_t p = 0; p < count; ++p) {
    const SurfacePart& part = topology.parts[p];
    // Turned inwards it is a cavity.
    if (&part == &*largest || !(part.area > 0) || part.area > kSmall * largest->area ||
        (part.closed && part.signed_volume < 0)) {
      continue;
    }
    const Eigen::AlignedBox3d box = boxOf(mesh, part);
    const double diagonal = box.diagonal().norm();
    if (sticksOut(box, host_box)) continue;
    const bool close = std::all_of(part.triangles.begin(), part.triangles.end(), [&](std::uint32_t t) {
      return host.closest(mesh.welded_positions[mesh.weldedTriangle(t)[0]], kFar * diagonal).triangle != formats::kNone;
    });
    if (!close) continue;
    const Named named = nameOf(mesh, topology, p);
    names.push_back(named.name);
    if (finding.places.size() < Finding::kMaxPlaces) finding.places.push_back(mesh.triangle_face[part.triangles[0]]);
    if (names.size() > kMostLines) continue;
    const bool sheet = !(2 * std::abs(part.signed_volume) / part.area > (part.closed ? kSheet : kOpenSheet) * diagonal);
    lines += (lines.empty() ? "" : ", ") + (R"({"name": ")" + named.name + R"(", "from": )" + named.from) +
             R"(, "attach": ")" + (sheet ? "follow" : "rigid") + "\"}";
  }
  if (names.empty()) return {};
  finding.id = "loose-parts-ride";
  finding.severity = Severity::info;
  finding.count = names.size();
  finding.message = std::to_string(names.size()) +
                    (names.size() == 1 ? " loose part lies in or close to" : " loose parts lie in or close to") +
                    " a larger one; filled with tetrahedra they deform with it";
  finding.place_kind = "face";
  for (std::size_t i = 0; i < std::min(names.size(), kMostLines); ++i) finding.place += (i == 0 ? "" : ", ") + names[i];
  if (names.size() > kMostLines) finding.place += ", ...";
  finding.cure = "Should they keep their shape, or only follow the surface, write into the recipe: \"parts\": [" +
                 lines + (names.size() > kMostLines ? ", ..." : "") + "].";
  return {finding};
}

}  // namespace sinew::tools
