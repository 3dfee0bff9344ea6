// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "runtime/world/body.h"

namespace sinew::internal {

/// The point of a body that a visual vertex is attached to: weights of physical vertices.
struct PickedPoint {
  std::array<std::uint32_t, 4> vertex = {};
  std::array<double, 4> weight = {};
};

inline PickedPoint pickedPoint(const Body& body, std::uint32_t visual_vertex) {
  const formats::PackageView& package = body.package();
  PickedPoint point;
  if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& at = package.barycentric()[visual_vertex];
    point.vertex = package.tetrahedra()[at.tetrahedron].vertex;
    point.weight = {double(at.weight[0]), double(at.weight[1]), double(at.weight[2]), 1};
    for (std::size_t c = 0; c < 3; ++c) point.weight[3] -= point.weight[c];
    return point;
  }
  // Hung on clusters: the physical vertex that lies nearest.
  const auto distance = [&](const formats::PhysicalVertex& vertex) {
    return (asVector(vertex.rest_position) - asVector(package.visualPositions()[visual_vertex])).squaredNorm();
  };
  const auto nearest = std::min_element(body.vertices().begin(), body.vertices().end(),
                                        [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
  point.vertex.fill(std::uint32_t(nearest - body.vertices().begin()));
  point.weight[0] = 1;
  return point;
}

/// Where the spring of a pick pulls from `at`: its target, or nearer where `firm` (N/m) would pull with more than its
/// largest force.
inline Eigen::Vector3d reachOf(const Body& body, const Pick& pick, const Eigen::Vector3d& at, double firm) {
  // What a pick that names no force pulls with, of the body's weight on Earth.
  constexpr double kWeights = 50, kEarth = 9.81;
  const double most =
      pick.most_force > 0 ? double(pick.most_force) : kWeights * kEarth * double(body.package().info().total_mass);
  const Eigen::Vector3d way = asVector(pick.target).cast<double>() - at;
  const double length = way.norm();
  return firm * length > most ? Eigen::Vector3d(at + most / (firm * length) * way) : at + way;
}

}  // namespace sinew::internal
