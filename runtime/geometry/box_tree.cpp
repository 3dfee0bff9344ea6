// SPDX-License-Identifier: MIT
#include "runtime/geometry/box_tree.h"

namespace sinew::geometry {

void BoxTree::split(std::span<Item> items, const Eigen::AlignedBox3d& bounds) {
  int axis = 0;
  bounds.sizes().maxCoeff(&axis);
  std::nth_element(items.begin(), items.begin() + std::ptrdiff_t(items.size() / 2), items.end(),
                   [axis](const Item& a, const Item& b) {
                     return a.centre[axis] != b.centre[axis] ? a.centre[axis] < b.centre[axis] : a.number < b.number;
                   });
}

}  // namespace sinew::geometry
