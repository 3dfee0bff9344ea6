// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/crowds.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <map>

#include "runtime/geometry/sets.h"

namespace sinew::tools {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;
using geometry::Triangle;

std::vector<Triangle> withoutCrowds(std::span<const Vector3d> positions, std::vector<Triangle> triangles) {
  std::vector<std::uint32_t> faces(positions.size(), 0);
  for (const Triangle& t : triangles) {
    for (const std::uint32_t v : t) ++faces[v];
  }
  // The rim of each hub: edges opposite to it.
  std::map<std::uint32_t, std::vector<std::array<std::uint32_t, 2>>> rims;
  for (const Triangle& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (faces[t[i]] > kCrowd) rims[t[i]].push_back({t[(i + 1) % 3], t[(i + 2) % 3]});
    }
  }
  if (rims.empty()) return triangles;
  geometry::Sets sets(positions.size());
  std::vector<AlignedBox3d> box(positions.begin(), positions.end());  // of each set
  for (const auto& [hub, rim] : rims) {
    double length = 0;
    for (const auto& edge : rim) length += (positions[edge[1]] - positions[edge[0]]).norm();
    const double reach = length / kCrowd;
    for (const auto& edge : rim) {
      const std::uint32_t a = sets.find(edge[0]), b = sets.find(edge[1]);
      // Hubs stay: another one's rim is no reason to move them.
      if (a == b || faces[edge[0]] > kCrowd || faces[edge[1]] > kCrowd) continue;
      const AlignedBox3d both = box[a].merged(box[b]);
      if (both.diagonal().norm() > reach) continue;
      sets.join(a, b);
      box[sets.find(a)] = both;
    }
  }
  for (Triangle& t : triangles) {
    for (std::uint32_t& v : t) v = sets.find(v);
  }
  std::erase_if(triangles, [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  return triangles;
}

}  // namespace sinew::tools
