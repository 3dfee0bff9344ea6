// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/geometry/tet_mesh.h"
#include "runtime/geometry/triangle.h"
#include "runtime/geometry/triangle_bvh.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Calls `visit(a, b, squared distance)` for triangles of two labels within `distance` of each other, but where
/// `same(a, b)` says that these two labels need no more of them.
template <class Same, class Visit>
void forNearTriangles(std::span<const Eigen::Vector3d> points, std::span<const geometry::Triangle> triangles,
                      std::span<const std::uint32_t> label, double distance, const Same& same, const Visit& visit) {
  const geometry::TriangleBvh bvh(points, triangles);
  const auto& nodes = bvh.nodes();
  // Nodes whose triangles are all of one label can be skipped as a whole.
  std::vector<std::uint32_t> only(nodes.size(), formats::kNone);
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const auto& node = nodes[n];
    if (node.right != 0) {
      only[n] = only[n + 1] == only[node.right] ? only[n + 1] : formats::kNone;
      continue;
    }
    only[n] = label[bvh.order()[node.first]];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (label[bvh.order()[i]] != only[n]) only[n] = formats::kNone;
    }
  }
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const geometry::TriangleBvh::Corners& mine = bvh.corners()[i];
    const std::uint32_t my_label = label[bvh.order()[i]];
    Eigen::AlignedBox3d box(mine[0]);
    box.extend(mine[1]);
    box.extend(mine[2]);
    box.extend(Eigen::Vector3d(box.min() - Eigen::Vector3d::Constant(distance)));
    box.extend(Eigen::Vector3d(box.max() + Eigen::Vector3d::Constant(distance)));
    // Each pair is met from both sides: one is enough.
    bvh.tree().descend(
        [&](const auto& node, std::uint32_t index) {
          return node.first + node.count > i && node.box.intersects(box) &&
                 (only[index] == formats::kNone || !same(only[index], my_label));
        },
        [&](std::uint32_t j) {
          const std::uint32_t other = label[bvh.order()[j]];
          if (j <= i || same(other, my_label)) return;
          const double squared = geometry::squaredDistance(mine, bvh.corners()[j]);
          if (squared <= distance * distance) visit(other, my_label, squared);
        });
  }
}

}  // namespace sinew::tools
