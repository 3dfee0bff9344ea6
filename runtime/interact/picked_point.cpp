// SPDX-License-Identifier: MIT
#include "runtime/interact/picked_point.h"

#include <algorithm>

namespace sinew::internal {
namespace {

void add(const Body& body, std::uint32_t visual_vertex, double part, PickedPoint& point, std::size_t& count) {
  const formats::PackageView& package = body.package();
  const auto put = [&](std::uint32_t vertex, double weight) {
    if (part * weight == 0) return;
    point.vertex[count] = vertex;
    point.weight[count++] = part * weight;
  };
  if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& at = package.barycentric()[visual_vertex];
    const std::array<std::uint32_t, 4>& corner = package.tetrahedra()[at.tetrahedron].vertex;
    double left = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      put(corner[c], double(at.weight[c]));
      left -= double(at.weight[c]);
    }
    put(corner[3], left);
    return;
  }
  // Hung on clusters: the physical vertex that lies nearest.
  const auto distance = [&](const formats::PhysicalVertex& vertex) {
    return (asVector(vertex.rest_position) - asVector(package.visualPositions()[visual_vertex])).squaredNorm();
  };
  const auto nearest = std::min_element(body.vertices().begin(), body.vertices().end(),
                                        [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
  put(std::uint32_t(nearest - body.vertices().begin()), 1);
}

}  // namespace

PickedPoint pickedPoint(const Body& body, const BodyPoint& at) {
  PickedPoint point;
  std::size_t count = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const double part = double(at.weight[c]);
    if (part == 0) continue;
    if (at.physical != 0) {
      point.vertex[count] = at.vertex[c];
      point.weight[count++] = part;
    } else {
      add(body, at.vertex[c], part, point, count);
    }
  }
  // A triangle between pieces: its nearest corner.
  const auto piece_of = [&](std::uint32_t vertex) {
    const auto pieces = body.package().pieces();
    const auto begins_after = [](std::uint32_t v, const formats::PieceRange& piece) { return v < piece.first_vertex; };
    return std::upper_bound(pieces.begin(), pieces.end(), vertex, begins_after);
  };
  const bool split = std::any_of(point.vertex.begin(), point.vertex.begin() + std::ptrdiff_t(count),
                                 [&](std::uint32_t v) { return piece_of(v) != piece_of(point.vertex[0]); });
  if (split && std::count(at.weight.begin(), at.weight.end(), 0.0F) < 2) {
    const auto corner = std::size_t(std::max_element(at.weight.begin(), at.weight.end()) - at.weight.begin());
    return pickedPoint(body, {{at.vertex[corner], 0, 0}, {1, 0, 0}, at.physical});
  }
  return point;
}

}  // namespace sinew::internal
