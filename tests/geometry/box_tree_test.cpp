// SPDX-License-Identifier: MIT
#include "runtime/geometry/box_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

namespace sinew::geometry {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// Boxes of all sizes, some of them points, some in one place.
std::vector<AlignedBox3d> someBoxes(std::uint32_t count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-1, 1), size(0, 0.2);
  std::vector<AlignedBox3d> boxes;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vector3d low(place(random), place(random), place(random));
    const Vector3d extent = i % 3 == 0 ? Vector3d::Zero() : Vector3d(size(random), size(random), size(random));
    boxes.emplace_back(low, Vector3d(low + extent));
    if (i % 7 == 6) boxes.back() = boxes[i - 5];
  }
  return boxes;
}

BoxTree treeOf(const std::vector<AlignedBox3d>& boxes, std::uint32_t leaf) {
  const auto box = [&](std::uint32_t i) { return boxes[i]; };
  return {std::uint32_t(boxes.size()), box, [&](std::uint32_t i) -> Vector3d { return boxes[i].center(); }, box, leaf};
}

TEST(BoxTree, DescendsToWhatABruteSearchFinds) {
  for (const std::uint32_t count : {0U, 1U, 2U, 9U, 500U}) {
    const std::vector<AlignedBox3d> boxes = someBoxes(count);
    const BoxTree tree = treeOf(boxes, 4);
    EXPECT_EQ(tree.empty(), count == 0);
    for (const AlignedBox3d& asked : someBoxes(60)) {
      std::vector<std::uint32_t> found, wanted;
      tree.descend([&](const BoxTree::Node& node, std::uint32_t) { return node.box.intersects(asked); },
                   [&](std::uint32_t place) {
                     if (boxes[tree.order()[place]].intersects(asked)) found.push_back(tree.order()[place]);
                   });
      for (std::uint32_t i = 0; i < count; ++i)
        if (boxes[i].intersects(asked)) wanted.push_back(i);
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, wanted);
    }
  }
}

TEST(BoxTree, TheNearestIsNearestAndTiesCanGoToTheLowestNumber) {
  const std::vector<AlignedBox3d> boxes = someBoxes(400);
  for (const std::uint32_t leaf : {1U, 4U, 8U}) {
    const BoxTree tree = treeOf(boxes, leaf);
    std::size_t looked_at = 0;
    for (const AlignedBox3d& asked : someBoxes(80)) {
      const Vector3d point = asked.center();
      double bound = std::numeric_limits<double>::infinity();
      std::uint32_t best = 400;
      tree.descendNear(point, bound, [&](std::uint32_t place) {
        const std::uint32_t i = tree.order()[place];
        const double d = boxes[i].squaredExteriorDistance(point);
        ++looked_at;
        if (d < bound || (d == bound && i < best)) bound = d, best = i;
      });
      std::uint32_t wanted = 0;
      for (std::uint32_t i = 1; i < 400; ++i)
        if (boxes[i].squaredExteriorDistance(point) < boxes[wanted].squaredExteriorDistance(point)) wanted = i;
      EXPECT_EQ(best, wanted);
    }
    EXPECT_LT(looked_at, 80U * 400U / 4) << "the tree is of use";
  }
}

TEST(BoxTree, EveryNodeHoldsItsItems) {
  const std::vector<AlignedBox3d> boxes = someBoxes(300);
  const BoxTree tree = treeOf(boxes, 8);
  for (const BoxTree::Node& node : tree.nodes()) {
    AlignedBox3d all;
    for (const std::uint32_t i : tree.itemsOf(node)) all.extend(boxes[i]);
    EXPECT_EQ(all.min(), node.box.min());
    EXPECT_EQ(all.max(), node.box.max());
    EXPECT_TRUE(node.right != 0 || node.count <= 8);
  }
}

}  // namespace
}  // namespace sinew::geometry
