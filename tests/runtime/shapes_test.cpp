// SPDX-License-Identifier: MIT
//
// Shapes of colliders against brute force: distances to samples and triangles, paths followed in small steps.
#include "runtime/contact/shapes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "runtime/geometry/triangle.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;
using formats::Triangle;
using internal::NearPlace;
using internal::PathHit;
using internal::Shape;

constexpr double kFar = std::numeric_limits<double>::infinity();

Vec3 narrow(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }
Vector3d wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Triangle> triangles;
  MeshShape shape() const { return {positions, triangles}; }
};

/// A ball of radius 1 with waves: convex and concave. Each triangle has corners of its own, as unwelded meshes do.
Mesh wavyBall(int n = 12) {
  Mesh mesh;
  const auto at = [n](int i, int j) {
    const double theta = M_PI * i / n, phi = 2 * M_PI * (j % (2 * n)) / (2 * n);
    if (i == 0 || i == n) return narrow({0, i == 0 ? 1.0 : -1.0, 0});
    const double r = 1 + 0.2 * std::sin(3 * theta) * std::cos(4 * phi);
    return narrow(r * Vector3d(std::sin(theta) * std::cos(phi), std::cos(theta), -std::sin(theta) * std::sin(phi)));
  };
  const auto add = [&](Vec3 a, Vec3 b, Vec3 c) {
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {a, b, c});
    mesh.triangles.push_back({first, first + 1, first + 2});
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 2 * n; ++j) {
      if (i > 0) add(at(i, j), at(i + 1, j), at(i, j + 1));
      if (i < n - 1) add(at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
    }
  }
  return mesh;
}

/// Distance to triangles one by one, with the sign of the winding number.
double bruteDistance(const Mesh& mesh, const Vector3d& p) {
  double nearest = kFar, winding = 0;
  for (const Triangle& t : mesh.triangles) {
    const Vector3d a = wide(mesh.positions[t[0]]) - p, b = wide(mesh.positions[t[1]]) - p,
                   c = wide(mesh.positions[t[2]]) - p;
    nearest = std::min(nearest, geometry::closestPointOnTriangle(Vector3d::Zero(), a, b, c).norm());
    winding += 2 * std::atan2(a.dot(b.cross(c)), a.norm() * b.norm() * c.norm() + a.dot(b) * c.norm() +
                                                     b.dot(c) * a.norm() + c.dot(a) * b.norm());
  }
  return winding > 2 * M_PI ? -nearest : nearest;
}

std::vector<float> hills() {
  std::vector<float> heights;
  for (int row = 0; row < 9; ++row) {
    for (int column = 0; column < 11; ++column) heights.push_back(float(0.4 * std::sin(1.3 * column) * std::cos(row)));
  }
  return heights;
}

/// The same surface as triangles.
Mesh meshOf(const std::vector<float>& heights, std::uint32_t columns, float cell) {
  Mesh mesh;
  const auto rows = std::uint32_t(heights.size()) / columns;
  for (std::uint32_t i = 0; i < heights.size(); ++i) {
    mesh.positions.push_back({cell * float(i % columns), heights[i], cell * float(i / columns)});
  }
  for (std::uint32_t i = 0; i + columns < heights.size(); ++i) {
    if (i % columns == columns - 1) continue;
    mesh.triangles.push_back({i, i + columns, i + 1});
    mesh.triangles.push_back({i + 1, i + columns, i + columns + 1});
  }
  EXPECT_EQ(mesh.triangles.size(), 2 * (rows - 1) * (columns - 1));
  return mesh;
}

class Points {
 public:
  Vector3d operator()(double size = 2) {
    std::uniform_real_distribution<double> in(-size, size);
    return {in(random_), in(random_), in(random_)};
  }

 private:
  std::mt19937 random_{7};
};

/// What holds for the distance of any shape: it is that of the place it names, and its slope is the way out.
void expectDistance(const Shape& shape, const Vector3d& p) {
  const NearPlace near = shape.near(p, kFar);
  ASSERT_NEAR(near.normal.norm(), 1, 1e-9);
  const Vector3d surface = p - near.distance * near.normal;
  ASSERT_NEAR(shape.near(surface, kFar).distance, 0, 1e-6) << p.transpose();
}

/// A path against small steps of the signed distance.
void expectPath(const Shape& shape, const Vector3d& from, const Vector3d& to) {
  PathHit hit = {};
  const bool enters = shape.enters(from, to, hit);
  const int steps = 4000;
  double found = -1, before = shape.near(from, kFar).distance;
  for (int i = 1; i <= steps && found < 0 && before >= 0; ++i) {
    const double now = shape.near(from + (to - from) * i / steps, kFar).distance;
    if (now < 0) found = double(i) / steps;
    before = now;
  }
  if (found < 0) {
    // A path may graze what steps do not see.
    if (!enters || before < 0) return;
    const Vector3d place = from + hit.part * (to - from);
    ASSERT_NEAR(shape.near(place, kFar).distance, 0, 1e-6);
    return;
  }
  ASSERT_TRUE(enters) << from.transpose() << " to " << to.transpose();
  ASSERT_NEAR(shape.near(from + hit.part * (to - from), kFar).distance, 0, 1e-6);
  ASSERT_LE(hit.part, found + 2.0 / steps);
  ASSERT_LE(hit.normal.dot(to - from), 1e-12);
  ASSERT_NEAR(hit.normal.norm(), 1, 1e-9);
}

Shape make(const ColliderShape& shape) {
  EXPECT_EQ(Shape::faultOf(shape), nullptr);
  return {shape, std::pmr::get_default_resource()};
}

TEST(Shapes, DistancesAndPathsAgreeWithBruteForce) {
  const Mesh ball = wavyBall();
  const std::vector<float> heights = hills();
  std::vector<Vec3> hull;
  Points points;
  for (int i = 0; i < 40; ++i) hull.push_back(narrow(points(1)));
  const std::vector<ColliderShape> shapes = {
      PlaneShape{{0, 0, -1}, 0.3F},       SphereShape{0.7F}, CapsuleShape{0.4F, 0.8F},
      BoxShape{{0.3F, 0.9F, 0.6F}},       HullShape{hull},   ball.shape(),
      HeightFieldShape{heights, 11, 0.5F}};
  for (std::size_t s = 0; s < shapes.size(); ++s) {
    SCOPED_TRACE(s);
    const Shape shape = make(shapes[s]);
    const bool grid = s == 6;
    const Vector3d middle = grid ? Vector3d(2.5, 0, 2) : Vector3d(Vector3d::Zero());
    for (int i = 0; i < 400; ++i) {
      const Vector3d p = middle + points();
      if (!grid) expectDistance(shape, p);
      // Of a height field sides and bottom do not count.
      if (!grid || (p - middle).cwiseAbs().maxCoeff() < 1.2) expectPath(shape, p, middle + points(grid ? 1.2 : 2));
    }
  }
}

TEST(Shapes, DistancesAreExact) {
  Points points;
  const Mesh ball = wavyBall();
  const Shape mesh = make(ball.shape());
  EXPECT_TRUE(mesh.isSolid());
  const Shape box = make(BoxShape{{0.3F, 0.9F, 0.6F}}), capsule = make(CapsuleShape{0.4F, 0.8F});
  // The box as a mesh, through the hull of its corners and of points on its edges and faces.
  std::vector<Vec3> corners;
  for (int i = 0; i < 27; ++i) {
    corners.push_back({0.3F * float(i % 3 - 1), 0.9F * float(i / 3 % 3 - 1), 0.6F * float(i / 9 - 1)});
  }
  const Shape hull = make(HullShape{corners});
  EXPECT_TRUE(hull.isSolid());
  for (int i = 0; i < 1000; ++i) {
    const Vector3d p = points(1.5);
    ASSERT_NEAR(mesh.near(p, kFar).distance, bruteDistance(ball, p), 1e-6) << p.transpose();
    ASSERT_NEAR(hull.near(p, kFar).distance, box.near(p, kFar).distance, 1e-6) << p.transpose();
    const double along = std::clamp(p.y(), -0.8, 0.8);
    ASSERT_NEAR(capsule.near(p, kFar).distance, (p - Vector3d(0, along, 0)).norm() - 0.4, 1e-7);
  }
  // Inside a box the nearest face is the way out.
  EXPECT_NEAR(box.near({0.2, 0, 0}, kFar).distance, -0.1, 1e-7);
  EXPECT_GT(box.near({0.2, 0, 0}, kFar).normal.x(), 0.999);
}

TEST(Shapes, AHeightFieldIsItsTriangles) {
  const std::vector<float> heights = hills();
  const Mesh mesh = meshOf(heights, 11, 0.5F);
  const Shape grid = make(HeightFieldShape{heights, 11, 0.5F}), sheet = make(mesh.shape());
  EXPECT_TRUE(grid.isSolid());
  EXPECT_FALSE(sheet.isSolid());
  Points points;
  for (int i = 0; i < 1000; ++i) {
    const Vector3d p = Vector3d(2.5, 0, 2) + points(1.2), to = p - Vector3d(0.3, 2, 0.2);
    ASSERT_NEAR(grid.near(p, kFar).distance, sheet.near(p, kFar).distance, 1e-6) << p.transpose();
    PathHit a = {}, b = {};
    ASSERT_EQ(grid.enters(p, to, a), sheet.enters(p, to, b)) << p.transpose();
    if (a.part <= 1) {
      ASSERT_NEAR(a.part, b.part, 1e-9);
    }
  }
}

// Beyond an end of a capsule a path may lie in the cylinder between its ends, which it went into long before.
TEST(Shapes, PathsBesideACapsulesEndsDoNotEnter) {
  const Shape capsule = make(CapsuleShape{20, 5});
  for (const double side : {-1.0, 1.0}) {
    PathHit hit;
    EXPECT_FALSE(capsule.enters({0.1, side * 25.01, 0}, {0.099, side * 25.0112, 0}, hit));
    ASSERT_TRUE(capsule.enters({0.1, side * 25.01, 0}, {0.099, side * 24.99, 0}, hit));
    EXPECT_GT(hit.part, 0);
    EXPECT_GT(side * hit.normal[1], 0.99);
  }
}

TEST(Shapes, ASheetHasNothingBehindItsRim) {
  const Mesh sheet = {{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 0, 1}}, {{0, 1, 2}, {2, 1, 3}}};
  const Shape shape = make(sheet.shape());
  EXPECT_NEAR(shape.near({0.5, 0.2, 0.5}, 1).distance, 0.2, 1e-9);
  EXPECT_NEAR(shape.near({0.5, -0.2, 0.5}, 1).distance, -0.2, 1e-9);
  EXPECT_GT(shape.near({1.1, -0.2, 0.5}, 1).distance, 0.2);
  EXPECT_FALSE(std::isfinite(shape.near({0.5, 3, 0.5}, 1).distance));
  PathHit hit = {};
  EXPECT_TRUE(shape.enters({0.5, 1, 0.5}, {0.5, -1, 0.5}, hit));  // on the edge between the two
  EXPECT_NEAR(hit.part, 0.5, 1e-9);
  EXPECT_FALSE(shape.enters({0.5, -1, 0.5}, {0.5, 1, 0.5}, hit));
}

TEST(Shapes, NoPathLeaksThroughEdgesAndCorners) {
  const Mesh ball = wavyBall(6);
  const Shape shape = make(ball.shape());
  for (std::size_t v = 0; v < ball.positions.size(); ++v) {
    const Vector3d corner = wide(ball.positions[v]);
    const Vector3d edge = 0.5 * (corner + wide(ball.positions[v - v % 3 + (v + 1) % 3]));
    PathHit hit = {};
    EXPECT_TRUE(shape.enters(3 * corner, 0.2 * corner, hit)) << v;
    EXPECT_TRUE(shape.enters(3 * edge, 0.2 * edge, hit)) << v;
  }
}

TEST(Shapes, FaultsAreNamed) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<Vec3> flat = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}, few = {{0, 0, 0}}, lost = {{nan, 0, 0}};
  const std::vector<Triangle> one = {{0, 1, 2}}, wrong = {{0, 1, 4}}, thin = {{0, 1, 1}};
  const std::vector<float> heights(6), broken = {0, 0, 0, nan};
  for (const ColliderShape& shape : std::vector<ColliderShape>{
           PlaneShape{{0, 2, 0}, 0}, PlaneShape{{0, 1, 0}, nan}, SphereShape{0}, SphereShape{nan}, CapsuleShape{1, -1},
           BoxShape{{1, 0, 1}}, HullShape{few}, HullShape{flat}, MeshShape{flat, {}}, MeshShape{flat, wrong},
           MeshShape{flat, thin}, MeshShape{lost, one}, HeightFieldShape{heights, 4, 1},
           HeightFieldShape{heights, 0, 1}, HeightFieldShape{heights, 3, 0}, HeightFieldShape{broken, 2, 1}}) {
    EXPECT_NE(Shape::faultOf(shape), nullptr) << shape.index();
  }
}

}  // namespace
}  // namespace sinew::test
