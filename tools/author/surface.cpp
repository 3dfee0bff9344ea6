// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <queue>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/author/unfold.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Of a triangle's edges: a ray through an edge that two triangles share meets one of them, whatever is rounded.
constexpr double kEdge = 1e-9;
// A mirrored surface that lies further off than this, in diagonals, is no image of itself.
constexpr double kAsymmetric = 0.03;
constexpr std::size_t kSymmetrySamples = 600;
constexpr int kSymmetryRounds = 20;

std::vector<geometry::Triangle> bvhTriangles(const std::vector<Triangle>& triangles) {
  return {triangles.begin(), triangles.end()};
}

}  // namespace

Vector3d mirrored(const Vector3d& x, const Vector3d& point, const Vector3d& normal) {
  return x - 2 * normal.dot(x - point) * normal;
}

Surface::Surface(const VisualMesh& mesh) : mesh_(mesh) {
  triangles_.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) triangles_.push_back(mesh.weldedTriangle(t));
  first_.assign(mesh.welded_positions.size() + 1, 0);
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t p : t) ++first_[p + 1];
  }
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  around_.resize(first_.back());
  std::vector<std::uint32_t> filled(first_.begin(), first_.end() - 1);
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (const std::uint32_t p : triangles_[t]) around_[filled[p]++] = t;
  }
  tree_ = geometry::TriangleBvh(mesh.welded_positions, bvhTriangles(triangles_));
}

std::vector<double> Surface::distances(std::vector<double> start, Front kind) const {
  std::vector<double> distance = std::move(start);
  std::vector<std::uint8_t> done(distance.size(), 0);
  using Entry = std::pair<double, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front;
  for (std::uint32_t p = 0; p < distance.size(); ++p) {
    if (std::isfinite(distance[p])) front.emplace(distance[p], p);
  }
  const auto& x = mesh_.welded_positions;
  const auto offer = [&](std::uint32_t p, double d) {
    if (d < distance[p]) {
      distance[p] = d;
      front.emplace(d, p);
    }
  };
  while (!front.empty()) {
    const auto [d, p] = front.top();
    front.pop();
    if (done[p] != 0 || d > distance[p]) continue;
    done[p] = 1;
    for (std::uint32_t i = first_[p]; i < first_[p + 1]; ++i) {
      const Triangle& t = triangles_[around_[i]];
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t c = t[k];
        if (c == p || done[c] != 0) continue;
        const std::uint32_t other = t[0] != c && t[0] != p ? t[0] : t[1] != c && t[1] != p ? t[1] : t[2];
        double reach = d + (x[c] - x[p]).norm();
        if (other != c && other != p && std::isfinite(distance[other])) {
          reach = std::min(reach, unfoldedDistance(x[p], x[other], x[c], d, distance[other], kind));
        }
        offer(c, reach);
      }
    }
  }
  return distance;
}

std::vector<double> Surface::distancesFrom(std::span<const SurfacePoint> places) const {
  std::vector<double> start(mesh_.welded_positions.size(), kInfinity);
  for (const SurfacePoint& place : places) {
    if (place.triangle == formats::kNone) continue;
    for (const std::uint32_t p : triangles_[place.triangle]) {
      start[p] = std::min(start[p], (mesh_.welded_positions[p] - place.position).norm());
    }
  }
  return distances(std::move(start));
}

std::vector<double> Surface::signedDistances(std::span<const double> weight) const {
  std::vector<double> start(weight.size(), kInfinity);
  const auto& x = mesh_.welded_positions;
  for (const Triangle& t : triangles_) {
    // Where the line enters and leaves the triangle.
    std::array<Vector3d, 2> line;
    std::size_t crossings = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = t[k];
      const std::uint32_t b = t[(k + 1) % 3];
      if ((weight[a] > 0.5) == (weight[b] > 0.5) || crossings == 2) continue;
      const double s = std::clamp((0.5 - weight[a]) / (weight[b] - weight[a]), 0.0, 1.0);
      line[crossings++] = x[a] + s * (x[b] - x[a]);
    }
    if (crossings < 2) continue;
    const Vector3d along = line[1] - line[0];
    for (const std::uint32_t p : t) {
      const double s = std::clamp((x[p] - line[0]).dot(along) / std::max(along.squaredNorm(), 1e-300), 0.0, 1.0);
      start[p] = std::min(start[p], (line[0] + s * along - x[p]).norm());
    }
  }
  std::vector<double> distance = distances(std::move(start), Front::line);
  for (std::size_t p = 0; p < distance.size(); ++p) {
    if (weight[p] > 0.5) distance[p] = -distance[p];
  }
  return distance;
}

SurfacePoint Surface::nearest(const Vector3d& place) const {
  const auto hit = tree_.closest(place);
  return {hit.triangle, hit.point, std::sqrt(hit.squared_distance)};
}

SurfacePoint Surface::along(const Vector3d& origin, const Vector3d& direction) const {
  SurfacePoint best;
  best.distance = kInfinity;
  const Vector3d inverse = direction.cwiseInverse();
  const double hair = kEdge * mesh_.diagonal;
  // Where the ray enters a node's box; infinite where it misses it, or the best hit comes first.
  const auto entry = [&](const geometry::BoxTree::Node& node) {
    double near = 0;
    double far = best.distance;
    for (int k = 0; k < 3; ++k) {
      // Wider by a hair: a ray within a side's plane, as one along the middle of a symmetric model, is inside.
      const double a = (node.box.min()[k] - hair - origin[k]) * inverse[k];
      const double b = (node.box.max()[k] + hair - origin[k]) * inverse[k];
      near = std::max(near, std::min(a, b));
      far = std::min(far, std::max(a, b));
    }
    return near <= far ? near : kInfinity;
  };
  const auto& nodes = tree_.nodes();
  if (nodes.empty()) return {};
  std::array<std::uint32_t, 64> stack{};
  std::size_t depth = 1;
  while (depth > 0) {
    const std::uint32_t index = stack[--depth];
    const auto& node = nodes[index];
    if (entry(node) == kInfinity) continue;
    if (node.right != 0) {
      const bool left_first = entry(nodes[index + 1]) <= entry(nodes[node.right]);
      stack[depth++] = left_first ? node.right : index + 1;
      stack[depth++] = left_first ? index + 1 : node.right;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      // Moeller and Trumbore 1997, without culling.
      const auto& c = tree_.corners()[i];
      const Vector3d ab = c[1] - c[0];
      const Vector3d ac = c[2] - c[0];
      const Vector3d p = direction.cross(ac);
      const double determinant = ab.dot(p);
      if (determinant == 0) continue;
      const Vector3d s = origin - c[0];
      const double u = s.dot(p) / determinant;
      if (!(u >= -kEdge && u <= 1 + kEdge)) continue;
      const Vector3d q = s.cross(ab);
      const double v = direction.dot(q) / determinant;
      if (!(v >= -kEdge && u + v <= 1 + kEdge)) continue;
      const double distance = ac.dot(q) / determinant;
      if (distance > 0 && distance < best.distance) best = {tree_.order()[i], origin + distance * direction, distance};
    }
  }
  return best.triangle == formats::kNone ? SurfacePoint{} : best;
}

std::uint32_t Surface::nearestCorner(const SurfacePoint& at) const {
  const Triangle& t = triangles_[at.triangle];
  return *std::min_element(t.begin(), t.end(), [&](std::uint32_t a, std::uint32_t b) {
    return (mesh_.welded_positions[a] - at.position).squaredNorm() <
           (mesh_.welded_positions[b] - at.position).squaredNorm();
  });
}

std::vector<Vector3d> Surface::path(const SurfacePoint& from, const SurfacePoint& to) const {
  if (from.triangle == formats::kNone || to.triangle == formats::kNone) return {};
  const std::vector<double> distance = distancesFrom({&to, 1});
  std::vector<Vector3d> places = {from.position};
  std::uint32_t at = nearestCorner(from);
  if (!std::isfinite(distance[at])) return {};
  while (true) {
    std::uint32_t next = at;
    for (std::uint32_t i = first_[at]; i < first_[at + 1]; ++i) {
      for (const std::uint32_t p : triangles_[around_[i]]) {
        if (distance[p] < distance[next]) next = p;
      }
    }
    if (next == at) break;
    at = next;
    places.push_back(mesh_.welded_positions[at]);
  }
  // The last corner may lie beyond the place.
  if (places.size() > 1) places.pop_back();
  places.push_back(to.position);
  return places;
}

std::vector<Vector3d> Surface::pointNormals() const {
  std::vector<Vector3d> normals(mesh_.welded_positions.size(), Vector3d::Zero());
  const auto& x = mesh_.welded_positions;
  for (const Triangle& t : triangles_) {
    const Vector3d n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    for (const std::uint32_t p : t) normals[p] += n;
  }
  for (Vector3d& n : normals) n = n.norm() > 0 ? Vector3d(n.normalized()) : Vector3d(Vector3d::Zero());
  return normals;
}

Vector3d Surface::normal(std::uint32_t triangle) const {
  const Triangle& t = triangles_[triangle];
  const auto& x = mesh_.welded_positions;
  const Vector3d n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
  return n.norm() > 0 ? Vector3d(n.normalized()) : Vector3d::Zero();
}

double Surface::interpolate(const SurfacePoint& at, std::span<const double> weight) const {
  const Triangle& t = triangles_[at.triangle];
  const auto& x = mesh_.welded_positions;
  const Vector3d n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
  if (!(n.squaredNorm() > 0)) return weight[t[0]];
  std::array<double, 3> area{};
  double sum = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    area[k] = std::max(0.0, (x[t[(k + 1) % 3]] - at.position).cross(x[t[(k + 2) % 3]] - at.position).dot(n));
    sum += area[k];
  }
  if (!(sum > 0)) return weight[t[0]];
  return (area[0] * weight[t[0]] + area[1] * weight[t[1]] + area[2] * weight[t[2]]) / sum;
}

double Surface::mirrorError(const Vector3d& point, const Vector3d& normal) const {
  const std::size_t step = std::max<std::size_t>(1, mesh_.welded_positions.size() / kSymmetrySamples);
  double squared = 0;
  std::size_t count = 0;
  for (std::size_t p = 0; p < mesh_.welded_positions.size(); p += step) {
    if (first_[p] == first_[p + 1]) continue;
    squared += tree_.closest(mirrored(mesh_.welded_positions[p], point, normal)).squared_distance;
    ++count;
  }
  return count == 0 ? 0 : std::sqrt(squared / double(count)) / mesh_.diagonal;
}

std::optional<MirrorPlane> Surface::symmetryPlane() const {
  Vector3d center = Vector3d::Zero();
  double area = 0;
  for (const Triangle& t : triangles_) {
    const auto& x = mesh_.welded_positions;
    const double a = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm();
    center += a / 3 * (x[t[0]] + x[t[1]] + x[t[2]]);
    area += a;
  }
  if (!(area > 0)) return std::nullopt;
  center /= area;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Vector3d& x : mesh_.welded_positions) spread += (x - center) * (x - center).transpose();
  const Eigen::MatrixXd axes = geometry::symmetricEigen(spread).vectors;
  std::vector<MirrorPlane> starts;
  const Vector3d middle = 0.5 * (mesh_.bounds_min + mesh_.bounds_max);
  // The x axis first: where several planes are as good, that is the one an artist means.
  for (int k = 0; k < 3; ++k) starts.push_back({middle, Vector3d::Unit(k), 0});
  for (int k = 0; k < 3; ++k) starts.push_back({center, axes.col(k), 0});
  const std::size_t step = std::max<std::size_t>(1, mesh_.welded_positions.size() / kSymmetrySamples);
  std::optional<MirrorPlane> best;
  for (MirrorPlane plane : starts) {
    plane.error = mirrorError(plane.point, plane.normal);
    for (int round = 0; round < kSymmetryRounds; ++round) {
      // The midpoints of point and image lie in the plane, the connections along its normal.
      Vector3d point = Vector3d::Zero();
      Eigen::Matrix3d along = Eigen::Matrix3d::Zero();
      std::vector<Vector3d> middles;
      for (std::size_t p = 0; p < mesh_.welded_positions.size(); p += step) {
        if (first_[p] == first_[p + 1]) continue;
        const Vector3d& x = mesh_.welded_positions[p];
        const Vector3d image = tree_.closest(mirrored(x, plane.point, plane.normal)).point;
        middles.push_back(0.5 * (x + image));
        point += middles.back();
        along += (x - image) * (x - image).transpose();
      }
      point /= double(middles.size());
      const Vector3d normal = geometry::symmetricEigen(along).vectors.col(2);
      const double error = mirrorError(point, normal);
      if (!(error < plane.error * 0.999)) break;
      plane = {point, normal, error};
    }
    if (!best || plane.error < 0.9 * best->error) best = plane;
  }
  if (!best || best->error > kAsymmetric) return std::nullopt;
  return best;
}

}  // namespace sinew::tools
