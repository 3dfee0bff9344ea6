// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sinew::geometry {

/// A binary tree of boxes over numbered items, split at the median of their centres. Immutable; any number of threads
/// may ask at once. Build: O(n log n). Its shape depends on boxes and centres alone.
class BoxTree {
 public:
  struct Node {
    Eigen::AlignedBox3d box;
    std::uint32_t first = 0, count = 0;  ///< run of order() below it
    std::uint32_t right = 0;             ///< 0 for a leaf; the left child is the next node
  };

  BoxTree() = default;
  /// Splits across the longest side of the bounds of all spread(i).
  /// \param box box(i) of item i. \param centre centre(i), or any multiple of it. \param leaf most items of a leaf.
  /// \param spread spread(i), a point or a box of item i.
  template <class Box, class Centre, class Spread>
  BoxTree(std::uint32_t count, const Box& box, const Centre& centre, const Spread& spread, std::uint32_t leaf) {
    std::vector<Item> items(count);
    for (std::uint32_t i = 0; i < count; ++i) items[i] = {centre(i), i};
    nodes_.reserve(2 * std::size_t(count / std::max(leaf / 2, 1U)) + 1);
    std::vector<Job> jobs;
    if (count > 0) jobs.push_back({0, count, 0});
    while (!jobs.empty()) {
      const Job job = jobs.back();
      jobs.pop_back();
      const auto index = std::uint32_t(nodes_.size());
      if (job.parent != 0) nodes_[job.parent - 1].right = index;
      nodes_.push_back({{}, job.first, job.count, 0});
      if (job.count <= leaf) continue;
      Eigen::AlignedBox3d bounds;
      for (std::uint32_t i = job.first; i < job.first + job.count; ++i) bounds.extend(spread(items[i].number));
      split(std::span(items).subspan(job.first, job.count), bounds);
      const std::uint32_t half = job.count / 2;
      jobs.push_back({job.first + half, job.count - half, index + 1});
      jobs.push_back({job.first, half, 0});
    }
    order_.reserve(count);
    for (const Item& item : items) order_.push_back(item.number);
    for (std::size_t n = nodes_.size(); n-- > 0;) {
      Node& node = nodes_[n];
      if (node.right != 0) {
        node.box = nodes_[n + 1].box.merged(nodes_[node.right].box);
      } else {
        for (const std::uint32_t i : itemsOf(node)) node.box.extend(box(i));
      }
    }
  }

  bool empty() const { return nodes_.empty(); }
  const std::vector<Node>& nodes() const { return nodes_; }
  /// Numbers of the items, as given, in the tree's order.
  const std::vector<std::uint32_t>& order() const { return order_; }
  std::span<const std::uint32_t> itemsOf(const Node& node) const {
    return std::span(order_).subspan(node.first, node.count);
  }

  /// Calls visit(place in order()) for the items below all nodes that enter(node, its number) lets in.
  template <class Enter, class Visit>
  void descend(const Enter& enter, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::array<std::uint32_t, kStackSize> stack{};
    std::size_t depth = 1;
    while (depth > 0) {
      const std::uint32_t index = stack[--depth];
      const Node& node = nodes_[index];
      if (!enter(node, index)) continue;
      if (node.right == 0) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) visit(i);
        continue;
      }
      stack[depth++] = node.right;
      stack[depth++] = index + 1;
    }
  }
  /// The same for the items whose boxes lie within `squared_bound` of a point, the nearer half first. `visit` may lower
  /// the bound.
  template <class Visit>
  void descendNear(const Eigen::Vector3d& point, const double& squared_bound, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::array<std::uint32_t, kStackSize> stack{};
    std::size_t depth = 1;
    while (depth > 0) {
      const std::uint32_t index = stack[--depth];
      const Node& node = nodes_[index];
      if (node.box.squaredExteriorDistance(point) > squared_bound) continue;
      if (node.right == 0) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i) visit(i);
        continue;
      }
      const std::uint32_t left = index + 1;
      const bool left_nearer =
          nodes_[left].box.squaredExteriorDistance(point) <= nodes_[node.right].box.squaredExteriorDistance(point);
      stack[depth++] = left_nearer ? node.right : left;
      stack[depth++] = left_nearer ? left : node.right;
    }
  }

 private:
  // A tree over n items is at most ceil(log2 n) deep, and each level leaves one node on the stack.
  static constexpr std::size_t kStackSize = 64;
  struct Item {
    Eigen::Vector3d centre;
    std::uint32_t number;
  };
  struct Job {
    std::uint32_t first, count;
    std::uint32_t parent;  // + 1, of a right child; else 0
  };
  // Puts the half with the lower centres, across the longest side of the bounds, before the other.
  static void split(std::span<Item> items, const Eigen::AlignedBox3d& bounds);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;
};

}  // namespace sinew::geometry
