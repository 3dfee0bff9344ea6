// SPDX-License-Identifier: MIT
#include "runtime/contact/shapes.h"

#include <bit>
#include <cmath>
#include <limits>

#include "runtime/geometry/triangle.h"

namespace sinew::internal {
namespace {

using formats::kNone;
using formats::Triangle;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kMostHullPoints = 1024, kMostTriangles = 1U << 24, kMostColumns = 4096, kLeaf = 4;
/// Floats' rounding of a place, of the size.
constexpr double kRounding = 3e-7;

Vector3d wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

bool isLength(float value) { return value > 0 && value <= formats::kMostMetres; }
bool isPlace(const Vec3& v) {
  return std::abs(v[0]) <= formats::kMostMetres && std::abs(v[1]) <= formats::kMostMetres &&
         std::abs(v[2]) <= formats::kMostMetres;
}

/// Numbers that sort as the floats do.
std::uint32_t ordered(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  return bits >> 31 != 0 ? ~bits : bits | 0x80000000U;
}

/// Keys of a few words, for what is found again by sorting (Fowler, Noll, Vo 1991).
std::uint64_t keyOf(std::span<const std::uint32_t> words, std::uint32_t number) {
  std::uint32_t hash = 2166136261U;
  for (const std::uint32_t word : words) {
    for (int shift = 0; shift < 32; shift += 8) hash = (hash ^ (word >> shift & 255U)) * 16777619U;
  }
  return std::uint64_t(hash) << 32 | number;
}

std::uint64_t keyOfPlace(const Vec3& at, std::uint32_t number) {
  std::uint32_t words[3];
  for (std::size_t c = 0; c < 3; ++c) words[c] = std::bit_cast<std::uint32_t>(at[c] + 0.0F);  // 0 and -0 are the same
  return keyOf(words, number);
}

/// The convex hull by points added one after the other: faces that see a point give way to those from their rim to it.
/// Points that stand out by less than floats round are left inside. \return false: all lie in one plane.
bool makeHull(std::span<const Vec3> points, Array<Triangle>& faces) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(wide(p));
  const double rounding = kRounding * box.diagonal().norm();
  const auto farthest = [&](const auto& measure) {
    std::uint32_t best = 0;
    double most = -1;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      if (const double value = measure(wide(points[i])); value > most) best = i, most = value;
    }
    return most > rounding ? best : kNone;
  };
  std::uint32_t first[4] = {};
  const auto at = [&](std::uint32_t i) { return wide(points[first[i]]); };
  const Vector3d middle = box.center();
  first[0] = farthest([&](const Vector3d& p) { return (p - middle).norm(); });
  if (first[0] == kNone) return false;
  first[1] = farthest([&](const Vector3d& p) { return (p - at(0)).norm(); });
  if (first[1] == kNone) return false;
  const Vector3d along = (at(1) - at(0)).normalized();
  first[2] = farthest([&](const Vector3d& p) { return along.cross(p - at(0)).norm(); });
  if (first[2] == kNone) return false;
  const Vector3d across = along.cross(at(2) - at(0)).normalized();
  first[3] = farthest([&](const Vector3d& p) { return std::abs(across.dot(p - at(0))); });
  if (first[3] == kNone) return false;
  if (across.dot(at(3) - at(0)) > 0) std::swap(first[1], first[2]);
  faces.push_back({first[0], first[1], first[2]});
  faces.push_back({first[0], first[3], first[1]});
  faces.push_back({first[1], first[3], first[2]});
  faces.push_back({first[2], first[3], first[0]});
  Array<std::uint8_t> seen(faces.memory());
  Array<Triangle> rim(faces.memory());
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    const auto height = [&](const Triangle& f) {
      const Vector3d a = wide(points[f[0]]);
      return (wide(points[f[1]]) - a).cross(wide(points[f[2]]) - a).normalized().dot(wide(points[p]) - a);
    };
    double highest = 0;
    for (const Triangle& face : faces) highest = std::max(highest, height(face));
    if (highest <= rounding) continue;
    // A face in a plane with the point goes too: no face is a needle.
    seen.resize(faces.size());
    for (std::size_t f = 0; f < faces.size(); ++f) seen[f] = height(faces[f]) > -rounding ? 1 : 0;
    rim.clear();
    for (std::size_t f = 0; f < faces.size(); ++f) {
      for (std::uint32_t e = 0; e < 3 && seen[f] != 0; ++e) {
        const std::uint32_t a = faces[f][e], b = faces[f][(e + 1) % 3];
        for (std::size_t g = 0; g < faces.size(); ++g) {
          const Triangle& other = faces[g];
          const bool behind =
              (other[0] == b && other[1] == a) || (other[1] == b && other[2] == a) || (other[2] == b && other[0] == a);
          if (behind && seen[g] == 0) rim.push_back({a, b, p});
        }
      }
    }
    std::size_t left = 0;
    for (std::size_t f = 0; f < faces.size(); ++f) {
      if (seen[f] == 0) faces[left++] = faces[f];
    }
    faces.truncate(left);
    for (const Triangle& face : rim) faces.push_back(face);
  }
  return true;
}

/// Nearest point of a segment on the y axis.
Vector3d onSegment(const Vector3d& p, double half) { return {0, std::clamp(p.y(), -half, half), 0}; }

NearPlace nearRound(const Vector3d& p, double half, double radius) {
  const Vector3d arm = p - onSegment(p, half);
  const double length = arm.norm();
  return {length - radius, length > 0 ? Vector3d(arm / length) : Vector3d::UnitX()};
}

NearPlace nearBox(const Vector3d& p, const Vector3d& half) {
  const Vector3d off = p.cwiseAbs() - half;
  const Vector3d outside = off.cwiseMax(0);
  const double distance = outside.norm();
  Vector3d normal = Vector3d::Zero();
  if (distance > 0) {
    normal = outside / distance;
  } else {
    int axis = 0;
    off.maxCoeff(&axis);
    normal[axis] = 1;
  }
  for (int c = 0; c < 3; ++c) normal[c] = std::copysign(normal[c], p[c]);
  return {distance > 0 ? distance : off.maxCoeff(), normal};
}

/// The lower root of a t^2 + 2 b t + c where the path goes in; infinity where there is none.
double lowerRoot(double a, double b, double c) {
  const double root2 = b * b - a * c;
  if (!(a > 0) || !(b < 0) || root2 < 0) return kInfinity;
  return c / (-b + std::sqrt(root2));
}

/// \pre `from` is outside.
double entryOfRound(const Vector3d& from, const Vector3d& way, double half, double radius) {
  double best = kInfinity;
  for (const double end : {-half, half}) {
    const Vector3d arm = from - Vector3d(0, end, 0);
    best = std::min(best, lowerRoot(way.squaredNorm(), arm.dot(way), arm.squaredNorm() - radius * radius));
  }
  const double side = lowerRoot(way.x() * way.x() + way.z() * way.z(), way.x() * from.x() + way.z() * from.z(),
                                from.x() * from.x() + from.z() * from.z() - radius * radius);
  // Beyond the ends a path may begin in the cylinder, which it went into before.
  if (side >= 0 && std::isfinite(side) && std::abs(from.y() + side * way.y()) <= half) best = std::min(best, side);
  return best;
}

}  // namespace

const char* Shape::faultOf(const ColliderShape& shape) {
  if (const auto* plane = std::get_if<PlaneShape>(&shape)) {
    const bool unit = std::abs(wide(plane->normal).norm() - 1) < 1e-3;
    return unit && std::abs(plane->offset) <= formats::kMostMetres
               ? nullptr
               : "the plane's normal is not a unit vector, or its offset not finite";
  }
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    return isLength(sphere->radius) ? nullptr : "the sphere's radius must be above 0 and finite";
  }
  if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) {
    return isLength(capsule->radius) && isLength(capsule->half_length)
               ? nullptr
               : "the capsule's radius and half length must be above 0 and finite";
  }
  if (const auto* box = std::get_if<BoxShape>(&shape)) {
    const Vec3& half = box->half_size;
    return isLength(half[0]) && isLength(half[1]) && isLength(half[2])
               ? nullptr
               : "the box's half sizes must be above 0 and finite";
  }
  if (const auto* hull = std::get_if<HullShape>(&shape)) {
    if (hull->points.size() < 4 || hull->points.size() > kMostHullPoints) return "a hull needs 4 to 1024 points";
    if (!std::all_of(hull->points.begin(), hull->points.end(), isPlace)) return "a point of the hull is not finite";
    Array<Triangle> faces;
    return makeHull(hull->points, faces) ? nullptr : "the points of the hull all lie in one plane: use a mesh";
  }
  if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
    if (mesh->triangles.empty() || mesh->triangles.size() > kMostTriangles)
      return "a mesh needs 1 to 16777216 triangles";
    if (!std::all_of(mesh->positions.begin(), mesh->positions.end(), isPlace))
      return "a position of the mesh is not finite";
    double area = 0;
    for (const Triangle& t : mesh->triangles) {
      if (std::max({t[0], t[1], t[2]}) >= mesh->positions.size())
        return "a triangle of the mesh names a position that is not there";
      const Vector3d a = wide(mesh->positions[t[0]]);
      area += (wide(mesh->positions[t[1]]) - a).cross(wide(mesh->positions[t[2]]) - a).norm();
    }
    return area > 0 ? nullptr : "the triangles of the mesh have no area";
  }
  const auto& grid = std::get<HeightFieldShape>(shape);
  const std::size_t rows = grid.columns > 0 ? grid.heights.size() / grid.columns : 0;
  if (grid.columns < 2 || grid.columns > kMostColumns || rows < 2 || rows > kMostColumns ||
      rows * grid.columns != grid.heights.size()) {
    return "a height field needs 2 to 4096 columns and rows, and columns times rows heights";
  }
  if (!isLength(grid.cell * float(kMostColumns))) return "the height field's cell must be above 0 and finite";
  const auto sound = [](float h) { return std::abs(h) <= formats::kMostMetres; };
  return std::all_of(grid.heights.begin(), grid.heights.end(), sound) ? nullptr
                                                                      : "a height of the height field is not finite";
}

Shape::Shape(const ColliderShape& shape, std::pmr::memory_resource* memory)
    : heights_(memory), positions_(memory), triangles_(memory), neighbours_(memory), nodes_(memory), ridges_(memory) {
  const auto within = [this](const Vector3d& half) { bounds_ = {-half, half}; };
  if (const auto* plane = std::get_if<PlaneShape>(&shape)) {
    size_ = wide(plane->normal);
    radius_ = double(plane->offset);
    within(Vector3d::Constant(kInfinity));
  } else if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    kind_ = Kind::round;
    convex_ = true;
    radius_ = double(sphere->radius);
    within(Vector3d::Constant(radius_));
  } else if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) {
    kind_ = Kind::round;
    convex_ = true;
    radius_ = double(capsule->radius);
    size_ = {0, double(capsule->half_length), 0};
    within(Vector3d::Constant(radius_) + size_);
  } else if (const auto* box = std::get_if<BoxShape>(&shape)) {
    kind_ = Kind::box;
    convex_ = true;
    size_ = wide(box->half_size);
    within(size_);
  } else if (const auto* grid = std::get_if<HeightFieldShape>(&shape)) {
    kind_ = Kind::grid;
    size_ = Vector3d::Constant(double(grid->cell));
    columns_ = grid->columns;
    rows_ = std::uint32_t(grid->heights.size() / columns_);
    heights_.assign(grid->heights);
    for (std::size_t i = 0; i < heights_.size(); ++i) {  // of two along each axis, whose gradient is no larger
      const auto rise = [&](std::size_t other) { return std::abs(double(heights_[other]) - double(heights_[i])); };
      if (i % columns_ + 1 < columns_) steepest_ = std::max(steepest_, rise(i + 1));
      if (i + columns_ < heights_.size()) steepest_ = std::max(steepest_, rise(i + columns_));
    }
    steepest_ *= std::sqrt(2.0) / size_.x();
    const auto [low, high] = std::minmax_element(heights_.begin(), heights_.end());
    bounds_ = {Vector3d(0, double(*low), 0),
               Vector3d(size_.x() * (columns_ - 1), double(*high), size_.x() * (rows_ - 1))};
  } else if (const auto* hull = std::get_if<HullShape>(&shape)) {
    makeHull(hull->points, triangles_);
    makeMesh(hull->points);
  } else {
    const auto& mesh = std::get<MeshShape>(shape);
    triangles_.assign(mesh.triangles);
    makeMesh(mesh.positions);
  }
}

ColliderShape Shape::source() const {
  const auto narrow = [](const Vector3d& v) { return Vec3{float(v.x()), float(v.y()), float(v.z())}; };
  switch (kind_) {
    case Kind::plane:
      return PlaneShape{narrow(size_), float(radius_)};
    case Kind::box:
      return BoxShape{narrow(size_)};
    case Kind::round:
      if (size_.y() > 0) return CapsuleShape{float(radius_), float(size_.y())};
      return SphereShape{float(radius_)};
    case Kind::grid:
      return HeightFieldShape{{heights_.data(), heights_.size()}, columns_, float(size_.x())};
    case Kind::mesh:
      break;
  }
  return MeshShape{{positions_.data(), positions_.size()}, {triangles_.data(), triangles_.size()}};
}

void Shape::makeMesh(std::span<const Vec3> positions) {
  kind_ = Kind::mesh;
  positions_.assign(positions);
  // Corners at the same place are the same corner.
  Array<std::uint64_t> keys(positions.size(), positions_.memory());
  for (std::uint32_t i = 0; i < positions.size(); ++i) keys[i] = keyOfPlace(positions[i], i);
  sortAscending({keys.data(), keys.size()});
  Array<std::uint32_t> first(positions.size(), positions_.memory());
  for (std::size_t i = 0, run = 0; i < keys.size(); ++i) {
    if (keys[i] >> 32 != keys[run] >> 32) run = i;
    const std::uint32_t own = std::uint32_t(keys[i]);
    first[own] = own;
    for (std::size_t k = run; k < i; ++k) {
      if (positions[std::uint32_t(keys[k])] == positions[own]) {
        first[own] = std::uint32_t(keys[k]);
        break;
      }
    }
  }
  std::size_t kept = 0;
  for (const Triangle t : triangles_) {
    const Triangle welded = {first[t[0]], first[t[1]], first[t[2]]};
    const Vector3d a = wide(positions[t[0]]);
    const double area = (wide(positions[t[1]]) - a).cross(wide(positions[t[2]]) - a).squaredNorm();
    if (area > 0) triangles_[kept++] = welded;
  }
  triangles_.truncate(kept);
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t v : t) bounds_.extend(wide(positions[v]));
  }
  slack_ = float(kRounding * bounds_.min().cwiseAbs().cwiseMax(bounds_.max().cwiseAbs()).maxCoeff());
  makeTree();
  findNeighbours();
  findRidges();
}

void Shape::makeTree() {
  struct Job {
    std::uint32_t first, count, parent;  // + 1, of a right child; else 0
  };
  std::pmr::memory_resource* const memory = nodes_.memory();
  Array<Job> jobs(memory);
  Array<std::uint64_t> keys(memory);
  Array<Triangle> sorted(memory);
  jobs.push_back({0, std::uint32_t(triangles_.size()), 0});
  while (!jobs.empty()) {
    const Job job = jobs.back();
    jobs.truncate(jobs.size() - 1);
    if (job.parent != 0) nodes_[job.parent - 1].right = std::uint32_t(nodes_.size());
    const std::uint32_t index = std::uint32_t(nodes_.size());
    const auto sum = [&](std::uint32_t t, int axis) {
      const Triangle& v = triangles_[t];
      const auto c = std::size_t(axis);
      return positions_[v[0]][c] + positions_[v[1]][c] + positions_[v[2]][c];
    };
    Eigen::AlignedBox3f box, centres;
    for (std::uint32_t t = job.first; t < job.first + job.count; ++t) {
      for (const std::uint32_t v : triangles_[t]) box.extend(wide(positions_[v]).cast<float>());
      centres.extend(Eigen::Vector3f(sum(t, 0), sum(t, 1), sum(t, 2)));
    }
    nodes_.push_back({box.min(), box.max(), job.first, job.count, 0, 0});
    if (job.count <= kLeaf) continue;
    int axis = 0;
    centres.sizes().maxCoeff(&axis);
    keys.resize(job.count);
    for (std::uint32_t t = 0; t < job.count; ++t) keys[t] = std::uint64_t(ordered(sum(job.first + t, axis))) << 32 | t;
    sortAscending({keys.data(), keys.size()});
    sorted.clear();
    for (const std::uint64_t key : keys) sorted.push_back(triangles_[job.first + std::uint32_t(key)]);
    std::copy(sorted.begin(), sorted.end(), triangles_.begin() + job.first);
    const std::uint32_t half = job.count / 2;
    jobs.push_back({job.first + half, job.count - half, index + 1});
    jobs.push_back({job.first, half, 0});
  }
}

void Shape::findNeighbours() {
  std::pmr::memory_resource* const memory = nodes_.memory();
  neighbours_.resize(triangles_.size(), {kNone, kNone, kNone});
  Array<std::uint64_t> keys(3 * triangles_.size(), memory);
  const auto from = [&](std::uint32_t edge) { return triangles_[edge / 3][edge % 3]; };
  const auto to = [&](std::uint32_t edge) { return triangles_[edge / 3][(edge % 3 + 1) % 3]; };
  for (std::uint32_t edge = 0; edge < keys.size(); ++edge) {
    const std::uint32_t ends[2] = {std::min(from(edge), to(edge)), std::max(from(edge), to(edge))};
    keys[edge] = keyOf(ends, edge);
  }
  sortAscending({keys.data(), keys.size()});
  for (std::size_t i = 0, run = 0; i < keys.size(); ++i) {
    if (keys[i] >> 32 != keys[run] >> 32) run = i;
    const std::uint32_t edge = std::uint32_t(keys[i]);
    for (std::size_t k = run; k < i; ++k) {
      const std::uint32_t other = std::uint32_t(keys[k]);
      std::uint32_t& behind = neighbours_[other / 3][other % 3];
      if (behind != kNone || from(other) != to(edge) || to(other) != from(edge)) continue;
      behind = edge / 3;
      neighbours_[edge / 3][edge % 3] = other / 3;
      break;
    }
  }
  solid_ = std::all_of(neighbours_.begin(), neighbours_.end(), [](const Triangle& n) {
    return std::max({n[0], n[1], n[2]}) != kNone;
  });
  // As a hull is, whose corners are few.
  convex_ = solid_ && positions_.size() <= kMostHullPoints;
  for (std::uint32_t t = 0; t < triangles_.size() && convex_; ++t) {
    const Corners corners = cornersOf(t);
    const Vector3d normal = Vector3d(corners.at[1] - corners.at[0]).cross(corners.at[2] - corners.at[0]).normalized();
    for (const Vec3& place : positions_) {
      convex_ = convex_ && normal.dot(wide(place) - corners.at[0]) <= 1e-6 * bounds_.diagonal().norm();
    }
  }
}

Corners Shape::cornersOf(std::uint32_t triangle) const {
  if (kind_ == Kind::mesh) {
    const Triangle& t = triangles_[triangle];
    return {{wide(positions_[t[0]]), wide(positions_[t[1]]), wide(positions_[t[2]])}};
  }
  const std::uint32_t column = triangle / 2 % (columns_ - 1), row = triangle / 2 / (columns_ - 1);
  const auto corner = [&](std::uint32_t right, std::uint32_t down) {
    const std::uint32_t x = column + right, z = row + down;
    return Vector3d(size_.x() * x, double(heights_[std::size_t(columns_) * z + x]), size_.x() * z);
  };
  if (triangle % 2 == 0) return {{corner(0, 0), corner(0, 1), corner(1, 0)}};
  return {{corner(1, 0), corner(0, 1), corner(1, 1)}};
}

double entryOf(const Vector3d& from, const Vector3d& way, const Corners& t) {
  // At an edge volumes change nothing but their sign from one triangle to the next.
  const Vector3d a = t.at[0] - from, b = t.at[1] - from, c = t.at[2] - from;
  if (way.dot(a.cross(b)) > 0 || way.dot(b.cross(c)) > 0 || way.dot(c.cross(a)) > 0) return kInfinity;
  const Vector3d normal = (b - a).cross(c - a);
  const double down = normal.dot(way), part = normal.dot(a) / down;
  return down < 0 && part >= 0 ? part : kInfinity;
}

namespace {

Vector3d crossOf(const Corners& t) { return (t.at[1] - t.at[0]).cross(t.at[2] - t.at[0]); }

}  // namespace

// The normal whose product with the way from a place of the surface has the sign of the distance (Baerentzen and Aanaes
// 2005): that of the face, the sum of two faces at an edge, the sum by angles about a corner.
Vector3d Shape::pseudoNormal(std::uint32_t triangle, std::uint32_t part, bool& border) const {
  Vector3d own = crossOf(cornersOf(triangle)).normalized();
  border = false;
  if (part == geometry::kTriangleInside) return own;
  if (part >= 3) {
    const std::uint32_t other = neighbours_[triangle][part - 3];
    border = other == kNone;
    return border ? own : (own + crossOf(cornersOf(other)).normalized()).normalized();
  }
  const std::uint32_t vertex = triangles_[triangle][part];
  Vector3d sum = Vector3d::Zero();
  std::uint32_t at = triangle;
  for (std::uint32_t turns = 0; turns <= triangles_.size(); ++turns) {
    std::uint32_t corner = 0;
    while (corner < 2 && triangles_[at][corner] != vertex) ++corner;
    const Corners t = cornersOf(at);
    const Vector3d a = t.at[(corner + 1) % 3] - t.at[corner], b = t.at[(corner + 2) % 3] - t.at[corner];
    sum += std::atan2(a.cross(b).norm(), a.dot(b)) * crossOf(t).normalized();
    at = neighbours_[at][(corner + 2) % 3];
    border = at == kNone;
    if (border || at == triangle) break;
  }
  const double length = sum.norm();
  return border || !(length > 0) ? own : Vector3d(sum / length);
}

// Of a height field the two of a cell have the edges to the cells before, across, and above; across, below, and behind.
std::uint32_t Shape::neighbourOf(std::uint32_t triangle, std::uint32_t edge) const {
  if (kind_ == Kind::mesh) return neighbours_[triangle][edge];
  const std::uint32_t cells = columns_ - 1, cell = triangle / 2, column = cell % cells, row = cell / cells;
  if (triangle % 2 == 0) {
    if (edge == 1) return triangle + 1;
    if (edge == 0) return column == 0 ? kNone : triangle - 1;
    return row == 0 ? kNone : triangle - 2 * cells + 1;
  }
  if (edge == 0) return triangle - 1;
  if (edge == 2) return column + 1 == cells ? kNone : triangle + 1;
  return row + 2 == rows_ ? kNone : triangle + 2 * cells - 1;
}

double Shape::ridgeOf(std::uint32_t triangle, std::uint32_t edge) const {
  const std::uint32_t other = neighbourOf(triangle, edge);
  if (other == kNone || other < triangle) return 0;
  const Corners corners = cornersOf(triangle);
  const Vector3d here = crossOf(corners).normalized(), there = crossOf(cornersOf(other)).normalized();
  const double sine = here.cross(there).dot((corners.at[(edge + 1) % 3] - corners.at[edge]).normalized());
  return std::max(0.0, sine / (1 + here.dot(there)));
}

void Shape::findRidges() {
  ridges_.resize(triangles_.size());
  for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
    for (std::uint32_t e = 0; e < 3; ++e) ridges_[t][e] = float(ridgeOf(t, e));
  }
  for (std::size_t n = nodes_.size(); n-- > 0;) {  // children come behind
    Node& node = nodes_[n];
    if (node.right != 0) {
      node.ridge = std::max(nodes_[n + 1].ridge, nodes_[node.right].ridge);
      continue;
    }
    for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
      for (const float ridge : ridges_[t]) node.ridge = std::max(node.ridge, ridge);
    }
  }
}

bool Shape::isBelow(const Vector3d& p, double& depth) const {
  if (!(p.x() >= 0 && p.z() >= 0 && p.x() <= bounds_.max().x() && p.z() <= bounds_.max().z())) return false;
  const std::uint32_t column = std::min(std::uint32_t(p.x() / size_.x()), columns_ - 2);
  const std::uint32_t row = std::min(std::uint32_t(p.z() / size_.x()), rows_ - 2);
  const double u = p.x() / size_.x() - column, v = p.z() / size_.x() - row;
  const std::uint32_t triangle = 2 * (row * (columns_ - 1) + column) + (u + v > 1 ? 1U : 0U);
  const Corners t = cornersOf(triangle);
  const Vector3d n = crossOf(t);
  depth = n.dot(t.at[0] - p) / n.y();
  return depth > 0;
}

NearPlace Shape::nearTriangles(const Vector3d& p, double reach) const {
  double depth = 0;
  const bool below = kind_ == Kind::grid && isBelow(p, depth);
  if (below) reach = depth + kRounding * size_.x();
  double best2 = reach * reach;
  std::uint32_t triangle = kNone, part = 0;
  Vector3d place = p;
  const auto look = [&](const Corners& t, std::uint32_t number) {
    std::uint32_t where = 0;
    const Vector3d q = geometry::closestPointOnTriangle(p, t.at[0], t.at[1], t.at[2], &where);
    const double d2 = (q - p).squaredNorm();
    if (d2 > best2 || (d2 == best2 && triangle != kNone)) return;
    best2 = d2, triangle = number, part = where, place = q;
  };
  if (kind_ == Kind::grid) {
    forEachTriangle({p.array() - reach, p.array() + reach}, look);
  } else {
    descendNear(p, best2, [&](std::uint32_t t) { look(cornersOf(t), t); });
  }
  if (triangle == kNone) return {kInfinity, Vector3d::UnitY()};
  bool border = false;
  const double distance = std::sqrt(best2);
  const Vector3d normal =
      kind_ == Kind::grid ? crossOf(cornersOf(triangle)).normalized() : pseudoNormal(triangle, part, border);
  const bool behind = kind_ == Kind::grid ? below : !border && normal.dot(p - place) < 0;
  // Nearer than floats resolve the way there has no direction.
  if (!(distance > double(slack_) * 1e-3)) return {behind ? -distance : distance, normal};
  return {behind ? -distance : distance, (behind ? place - p : p - place) / distance};
}

NearPlace Shape::near(const Vector3d& p, double reach) const {
  switch (kind_) {
    case Kind::plane:
      return {size_.dot(p) - radius_, size_};
    case Kind::round:
      return nearRound(p, size_.y(), radius_);
    case Kind::box:
      return nearBox(p, size_);
    default:
      return nearTriangles(p, solid_ && kind_ == Kind::mesh ? kInfinity : reach);
  }
}

bool Shape::enters(const Vector3d& from, const Vector3d& to, PathHit& hit) const {
  const Vector3d way = to - from;
  hit.part = kInfinity;
  switch (kind_) {
    case Kind::plane: {
      const double before = size_.dot(from) - radius_, after = size_.dot(to) - radius_;
      if (before >= 0 && after < 0) hit = {before / (before - after), size_};
      break;
    }
    case Kind::round: {
      if (nearRound(from, size_.y(), radius_).distance < 0) break;
      hit.part = entryOfRound(from, way, size_.y(), radius_);
      if (hit.part <= 1) hit.normal = nearRound(from + hit.part * way, size_.y(), radius_).normal;
      break;
    }
    case Kind::box: {
      double near = -kInfinity, far = kInfinity;
      int axis = 0;
      for (int c = 0; c < 3; ++c) {
        if (way[c] == 0) {
          if (std::abs(from[c]) >= size_[c]) near = kInfinity;
          continue;
        }
        const double side = std::copysign(size_[c], way[c]);
        const double in = (-side - from[c]) / way[c];
        if (in > near) near = in, axis = c;
        far = std::min(far, (side - from[c]) / way[c]);
      }
      if (!(near >= 0 && near < far)) break;
      hit.part = near;
      hit.normal = std::copysign(1, -way[axis]) * Vector3d::Unit(axis);
      break;
    }
    default: {
      const auto look = [&](const Corners& t, std::uint32_t) {
        const double part = entryOf(from, way, t);
        if (part < hit.part) hit = {part, crossOf(t).normalized()};
      };
      Eigen::AlignedBox3d box(from.cwiseMin(to), from.cwiseMax(to));
      if (kind_ == Kind::mesh) {
        const Eigen::Vector3f start = from.cast<float>(), along = way.cast<float>();
        descend(
            [&](const Node& node) {
              if (!boxOf(node).intersects(Eigen::AlignedBox3f(box.min().cast<float>().array() - slack_,
                                                              box.max().cast<float>().array() + slack_)))
                return false;
              // The box's shadow across the path.
              const Eigen::Vector3f arm = boxOf(node).center() - start, half = 0.5F * boxOf(node).sizes();
              const Eigen::Vector3f off = along.cross(arm).cwiseAbs(), size = along.cwiseAbs();
              const float room = slack_ * size.sum() * 4;
              return off.x() <= size.y() * half.z() + size.z() * half.y() + room &&
                     off.y() <= size.z() * half.x() + size.x() * half.z() + room &&
                     off.z() <= size.x() * half.y() + size.y() * half.x() + room;
            },
            [&](std::uint32_t t) { look(cornersOf(t), t); });
      } else {
        // Row by row, so that a long path does not ask for all cells of its box.
        const double cell = size_.x();
        const auto row_of = [&](double z) { return std::clamp(std::floor(z / cell), -1.0, double(rows_ - 1)); };
        for (double row = row_of(box.min().z()); row <= row_of(box.max().z()); ++row) {
          double low = 0, high = 1;
          if (way.z() != 0) {
            const double a = (row * cell - from.z()) / way.z(), b = ((row + 1) * cell - from.z()) / way.z();
            low = std::max(low, std::min(a, b));
            high = std::min(high, std::max(a, b));
          }
          const Vector3d first = from + low * way, last = from + high * way, room = Vector3d::Constant(1e-9 * cell);
          const Eigen::AlignedBox3d strip(first.cwiseMin(last) - room, first.cwiseMax(last) + room);
          if (low <= high) forEachTriangle(strip, look);
        }
      }
    }
  }
  return hit.part <= 1;
}

}  // namespace sinew::internal
