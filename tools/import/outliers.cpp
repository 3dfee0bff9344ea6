// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/outliers.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "tools/core/finding.h"

namespace sinew::tools {
namespace {

// Faces of at most this part of the area, this many times further from the middle than all the others, are stray: what
// was left behind in the file. With them every length that is a part of the diagonal would be theirs.
constexpr double kStrayArea = 0.01;
constexpr double kStrayDistance = 20;
// Vertices this many times further from the middle than all the others, each alone in its faces, are flung: a slip of
// the hand, where a cone has an apex.
constexpr double kFlungDistance = 50;

}  // namespace

StrayFaces findStrayFaces(const RawScene& scene, const std::vector<Eigen::Vector3d>& points,
                          const std::vector<std::uint32_t>& first_point) {
  struct Reach {
    std::uint32_t face;
    double area;
    Eigen::Vector3d middle;
    double nearest, furthest;
  };
  std::vector<Reach> faces;
  const auto for_faces = [&](auto&& visit) {
    std::uint32_t face = 0;
    for (std::size_t m = 0; m < scene.meshes.size(); ++m) {
      const RawMesh& raw = scene.meshes[m];
      std::size_t corner = 0;
      for (const std::uint32_t size : raw.face_size) {
        const auto at = [&, corner](std::uint32_t c) -> const Eigen::Vector3d& {
          return points[first_point[m] + raw.vertex_point[raw.corners[corner + c]]];
        };
        if (size >= 3) visit(face, size, at);
        corner += size;
        ++face;
      }
    }
  };
  for_faces([&](std::uint32_t face, std::uint32_t size, const auto& at) {
    Reach reach{face, 0, at(0) / size, 0, 0};
    for (std::uint32_t c = 1; c < size; ++c) {
      reach.middle += at(c) / size;
      if (c + 1 < size) reach.area += (at(c) - at(0)).cross(at(c + 1) - at(0)).norm() / 2;
    }
    faces.push_back(reach);
  });
  double area = 0;
  for (const Reach& r : faces) area += r.area;
  if (faces.size() < 2 || !(area > 0) || !std::isfinite(area)) return {};
  Eigen::Vector3d middle;  // half of the area lies on either side of it
  for (int axis = 0; axis < 3; ++axis) {
    std::sort(faces.begin(), faces.end(), [&](const Reach& a, const Reach& b) {
      return a.middle[axis] != b.middle[axis] ? a.middle[axis] < b.middle[axis] : a.face < b.face;
    });
    double sum = 0;
    for (const Reach& r : faces) {
      middle[axis] = r.middle[axis];
      if ((sum += r.area) >= area / 2) break;
    }
  }
  std::sort(faces.begin(), faces.end(), [](const Reach& a, const Reach& b) { return a.face < b.face; });
  std::size_t next = 0;
  for_faces([&](std::uint32_t /*face*/, std::uint32_t size, const auto& at) {
    Reach& reach = faces[next++];
    reach.nearest = std::numeric_limits<double>::infinity();
    for (std::uint32_t c = 0; c < size; ++c) {
      const double distance = (at(c) - middle).norm();
      reach.nearest = std::min(reach.nearest, distance);
      reach.furthest = std::max(reach.furthest, distance);
    }
  });
  std::sort(faces.begin(), faces.end(), [](const Reach& a, const Reach& b) {
    return a.nearest != b.nearest ? a.nearest < b.nearest : a.face < b.face;
  });
  double within = 0, furthest = 0;
  std::size_t kept = 0;
  for (; kept < faces.size(); ++kept) {
    const Reach& r = faces[kept];
    if (furthest > 0 && r.nearest > kStrayDistance * furthest && within >= (1 - kStrayArea) * area) break;
    within += r.area;
    furthest = std::max(furthest, r.furthest);
  }
  if (kept == faces.size()) return {};
  StrayFaces stray;
  stray.distance = faces[kept].nearest;
  stray.reach = furthest;
  for (std::size_t i = kept; i < faces.size(); ++i) stray.faces.push_back(faces[i].face);
  std::sort(stray.faces.begin(), stray.faces.end());
  return stray;
}

std::vector<std::uint32_t> findFlungVertices(const std::vector<Eigen::Vector3d>& x,
                                             const std::vector<Triangle>& triangles) {
  const std::size_t most = std::min(x.size() / 4, Finding::kMaxPlaces);
  if (most == 0) return {};
  Eigen::Vector3d middle;  // half of the vertices lie on either side of it
  std::vector<double> distance(x.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t v = 0; v < x.size(); ++v) distance[v] = x[v][axis];
    std::nth_element(distance.begin(), distance.begin() + std::ptrdiff_t(x.size() / 2), distance.end());
    middle[axis] = distance[x.size() / 2];
  }
  for (std::size_t v = 0; v < x.size(); ++v) distance[v] = (x[v] - middle).norm();
  std::vector<std::uint32_t> order(x.size());
  std::iota(order.begin(), order.end(), 0U);
  std::partial_sort(
      order.begin(), order.begin() + std::ptrdiff_t(most + 1), order.end(),
      [&](std::uint32_t a, std::uint32_t b) { return distance[a] != distance[b] ? distance[a] > distance[b] : a < b; });
  std::size_t count = most;
  while (count > 0 &&
         !(distance[order[count]] > 0 && distance[order[count - 1]] > kFlungDistance * distance[order[count]]))
    --count;
  order.resize(count);
  std::sort(order.begin(), order.end());
  const auto isFlung = [&](std::uint32_t v) { return std::binary_search(order.begin(), order.end(), v); };
  for (const Triangle& t : triangles)
    for (std::size_t k = 0; k < 3 && count > 0; ++k) {
      const std::uint32_t a = t[k], b = t[(k + 1) % 3];
      if (isFlung(a) && isFlung(b) && x[a] != x[b]) return {};  // a far wall
    }
  return order;
}

}  // namespace sinew::tools
