// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/contact_points.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

/// Parts that a triangle's edges are divided into at most, and places on triangles for each contact point: bounds of
/// the work only.
constexpr double kMostParts = 64;
constexpr std::size_t kMostPlaces = 64;

/// Contact points: so many of the candidates, each as far as can be from those before it. \return their indices.
std::vector<std::size_t> spread(const std::vector<Vector3d>& candidates, std::uint32_t count) {
  std::vector<std::size_t> chosen;
  if (candidates.empty()) return chosen;
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& at : candidates) center += at / double(candidates.size());
  std::vector<double> distance(candidates.size(), std::numeric_limits<double>::infinity());
  std::size_t next = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if ((candidates[i] - center).squaredNorm() > (candidates[next] - center).squaredNorm()) next = i;
  }
  while (chosen.size() < count) {
    chosen.push_back(next);
    const Vector3d& last = candidates[next];
    double most = 0;
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      distance[i] = std::min(distance[i], (candidates[i] - last).squaredNorm());
      if (distance[i] > most) most = distance[i], next = i;
    }
    if (!(most > 0)) break;
  }
  return chosen;
}

double areaOf(const std::array<Vector3d, 3>& corner) {
  return 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm();
}

/// Places inside a triangle (its edges among them) that leave no gap wider than `spacing`.
void addPlacesWithin(const std::array<Vector3d, 3>& corner, double spacing, std::vector<Vector3d>& places) {
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) longest = std::max(longest, (corner[(k + 1) % 3] - corner[k]).norm());
  const int parts = int(std::min(std::ceil(longest / spacing), kMostParts));
  for (int i = 0; i <= parts; ++i) {
    for (int j = 0; i + j <= parts; ++j) {
      if (std::max({i, j, parts - i - j}) == parts) continue;  // the corners are visual vertices
      places.push_back(corner[0] + (double(i) * (corner[1] - corner[0]) + double(j) * (corner[2] - corner[0])) / parts);
    }
  }
}

/// A place in the tetrahedron that holds it, else in the one that it lies least outside of.
void hang(const FieldHost& host, const Vector3d& x, ContactPoint& point) {
  double best = -std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < host.tetrahedra.size(); ++t) {
    const auto& tetrahedron = host.tetrahedra[t];
    const Vector3d weight = host.edgesOf(t).inverse() * (x - host.positions[tetrahedron[0]]);
    const double first = 1 - weight.sum(), least = std::min(first, weight.minCoeff());
    if (!(least > best)) continue;
    best = least;
    for (std::size_t k = 0; k < 4; ++k) {
      point.corner[k] = tetrahedron[k];
      point.weight[k] = k == 0 ? first : weight[int(k) - 1];
    }
  }
}

}  // namespace

ContactPoints contactPoints(const formats::PackageContent& content, const FieldHost& host, std::uint32_t count) {
  const formats::PieceRange& range = host.range;
  ContactPoints result;
  double area = 0;
  if (content.barycentric.empty()) {
    // Hung on clusters: the physical vertices stand for the surface.
    for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
      result.points.push_back(
          {content.physical_vertices[range.first_vertex + v].rest_position, {v, v, v, v}, {1, 0, 0, 0}});
    }
    area = double(content.info.diagonal) * double(content.info.diagonal);
  } else {
    const auto in_piece = [&](std::uint32_t v) {
      const std::uint32_t t = content.barycentric[v].tetrahedron;
      return t >= range.first_tetrahedron && t < range.first_tetrahedron + range.tetrahedron_count;
    };
    // Visual vertices, and places on triangles that are wider than the points lie apart.
    std::vector<char> used(content.visual_positions.size(), 0);
    std::vector<std::array<Vector3d, 3>> triangles;
    for (const auto& triangle : content.visual_triangles) {
      if (!in_piece(triangle[0])) continue;
      std::array<Vector3d, 3>& corner = triangles.emplace_back();
      bool whole = true;
      for (std::size_t k = 0; k < 3; ++k) {
        const auto& x = content.visual_positions[triangle[k]];
        corner[k] = {double(x[0]), double(x[1]), double(x[2])};
        if (in_piece(triangle[k])) {
          used[triangle[k]] = 1;
        } else {
          whole = false;
        }
      }
      area += areaOf(corner);
      if (!whole) triangles.pop_back();
    }
    std::vector<std::uint32_t> vertices;
    std::vector<Vector3d> candidates;
    for (std::uint32_t v = 0; v < used.size(); ++v) {
      if (used[v] == 0) continue;
      vertices.push_back(v);
      const auto& x = content.visual_positions[v];
      candidates.emplace_back(double(x[0]), double(x[1]), double(x[2]));
    }
    const double spacing = std::sqrt(std::max(area, 1e-12) / std::max(1.0, double(count)));
    // Of slivers without number the largest are enough.
    std::stable_sort(triangles.begin(), triangles.end(),
                     [](const auto& a, const auto& b) { return areaOf(a) > areaOf(b); });
    const std::size_t most = vertices.size() + kMostPlaces * count;
    for (const auto& corner : triangles) {
      if (candidates.size() < most) addPlacesWithin(corner, spacing, candidates);
    }
    for (const std::size_t i : spread(candidates, count)) {
      ContactPoint& point = result.points.emplace_back();
      const Vector3d& x = candidates[i];
      point.place = {float(x[0]), float(x[1]), float(x[2])};
      if (i >= vertices.size()) {
        hang(host, x, point);
        continue;
      }
      const formats::BarycentricAttachment& at = content.barycentric[vertices[i]];
      point.corner = content.tetrahedra[at.tetrahedron].vertex;
      double last = 1;
      for (std::size_t k = 0; k < 3; ++k) {
        point.weight[k] = double(at.weight[k]);
        last -= point.weight[k];
      }
      point.weight[3] = last;
      for (std::uint32_t& vertex : point.corner) vertex -= range.first_vertex;
    }
  }
  result.area = std::max(area, 1e-12) / std::max<double>(1, double(result.points.size()));
  return result;
}

}  // namespace sinew::tools
