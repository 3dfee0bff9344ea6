// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/tetrahedralize.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/geometry/winding_number.h"
#include "tests/geometry/shapes.h"
#include "tests/support/obj_reader.h"
#include "tests/tetrahedralize/check.h"
#include "tools/core/error.h"
#include "tools/tetrahedralize/fill.h"
#include "tools/tetrahedralize/pieces.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::checkPhysicalMesh;
using testing::fill;
using testing::findingOf;
using testing::kMethods;
using testing::Surface;
using enum TetrahedraMethod;

VisualMesh visual(const Surface& surface) {
  std::vector<std::vector<std::uint32_t>> faces;
  for (const auto& t : surface.triangles) faces.push_back({t[0], t[1], t[2]});
  return testing::makeMesh(surface.positions, faces);
}

// A flat-ish patch of n x n quads that bulges by `height`.
Surface patch(double size, double height, std::uint32_t n) {
  Surface s;
  for (std::uint32_t j = 0; j <= n; ++j) {
    for (std::uint32_t i = 0; i <= n; ++i) {
      const double u = double(i) / n - 0.5, v = double(j) / n - 0.5;
      s.positions.emplace_back(u * size, height * (1 - 2 * u * u - 2 * v * v), v * size);
    }
  }
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i;
      s.triangles.push_back({a, a + n + 1, a + n + 2});
      s.triangles.push_back({a, a + n + 2, a + 1});
    }
  }
  return s;
}

double ratio(const PhysicalMesh& mesh) {
  double volume = 0, source = 0;
  for (const auto& body : mesh.pieces) {
    volume += body.volume;
    source += body.source_volume;
  }
  return volume / source;
}

Surface hollowSphere() {
  Surface s = testing::sphere(1, 24), inner = testing::sphere(0.6, 18);
  inner.reverse();
  s.append(inner);
  return s;
}

TEST(Tetrahedralize, ClosedShapesByEveryMethod) {
  const std::vector<std::pair<std::string, Surface>> shapes = {{"ball", testing::sphere(1, 24)},
                                                               {"torus", testing::torus(1, 0.4, 40)},
                                                               {"box", testing::box({1, 1, 1}, 6)},
                                                               {"beam", testing::box({4, 1, 1}, 8)},
                                                               {"blob", testing::blob(3, 30)}};
  for (const auto& [name, surface] : shapes) {
    for (const TetrahedraMethod method : kMethods) {
      const std::string what = name + " " + testing::name(method);
      const PhysicalMesh mesh = fill(visual(surface), method, 800);
      checkPhysicalMesh(mesh, what);
      ASSERT_EQ(mesh.pieces.size(), 1U) << what;
      EXPECT_NEAR(double(mesh.positions.size()), 800, 240) << what;
      EXPECT_NEAR(mesh.pieces[0].source_volume, surface.volume(), 1e-9 * surface.volume()) << what;
      if (method != automatic) {
        EXPECT_EQ(mesh.pieces[0].method, method) << what;
      }
      if (method != grid) {
        EXPECT_NEAR(ratio(mesh), 1, 0.06) << what;
      }
      EXPECT_GE(ratio(mesh), 0.94) << what;
    }
  }
}

TEST(Tetrahedralize, TargetsAreMetOverTwoDecades) {
  for (const TetrahedraMethod method : {grid, stuffing}) {
    for (const std::uint32_t target : {60U, 300U, 1500U, 6000U}) {
      const PhysicalMesh mesh = fill(visual(testing::blob(5, 30)), method, target);
      EXPECT_NEAR(double(mesh.positions.size()) / target, 1, 0.3) << testing::name(method) << " " << target;
    }
  }
}

TEST(Tetrahedralize, LinkedRingsStayThreeBodies) {
  Surface chain = testing::torus(1, 0.25, 24);
  Surface upright = testing::torus(1, 0.25, 24);
  for (auto& p : upright.positions) p = Vector3d(p.x() + 1.3, p.z(), -p.y());
  chain.append(upright);
  chain.append(testing::torus(1, 0.25, 24), {2.6, 0, 0});
  for (const std::uint32_t target : {150U, 1500U}) {
    for (const TetrahedraMethod method : kMethods) {
      const PhysicalMesh mesh = fill(visual(chain), method, target);
      checkPhysicalMesh(mesh, "chain");
      EXPECT_EQ(mesh.pieces.size(), 3U);
      EXPECT_EQ(mesh.part_piece, (std::vector<std::uint32_t>{0, 1, 2}));
    }
  }
}

TEST(Tetrahedralize, CavityStaysEmpty) {
  for (const TetrahedraMethod method : kMethods) {
    const PhysicalMesh mesh = fill(visual(hollowSphere()), method, 1500);
    checkPhysicalMesh(mesh, testing::name(method));
    ASSERT_EQ(mesh.pieces.size(), 1U);
    EXPECT_EQ(mesh.pieces[0].parts.size(), 2U);
    double nearest = 1e300;
    for (const auto& t : mesh.tetrahedra) {
      Vector3d middle = Vector3d::Zero();
      for (const auto v : t) middle += mesh.positions[v] / 4;
      nearest = std::min(nearest, middle.norm());
    }
    EXPECT_GT(nearest, 0.35) << testing::name(method);
    if (method != grid) {
      EXPECT_GT(nearest, 0.55) << testing::name(method);
      EXPECT_NEAR(ratio(mesh), 1, 0.06) << testing::name(method);
    }
  }
}

TEST(Tetrahedralize, BallInACavityIsItsOwnBodyAndInSolidIsNot) {
  Surface cavity = hollowSphere();
  cavity.append(testing::sphere(0.3, 12));
  EXPECT_EQ(fill(visual(cavity), automatic, 800).pieces.size(), 2U);
  Surface solid = testing::sphere(1, 24);
  solid.append(testing::sphere(0.3, 12));
  const PhysicalMesh mesh = fill(visual(solid), automatic, 800);
  ASSERT_EQ(mesh.pieces.size(), 1U);
  EXPECT_EQ(mesh.pieces[0].parts.size(), 2U);
  EXPECT_NEAR(ratio(mesh), 1, 0.06);
}

TEST(Tetrahedralize, OverlappingPartsAreFilledOnce) {
  Surface two = testing::sphere(1, 20);
  two.append(testing::sphere(1, 20), {1.2, 0.03, 0.02});
  // Union of two unit balls at distance d, less what flat triangles cut off.
  const double d = Vector3d(1.2, 0.03, 0.02).norm(), pi = std::acos(-1.0);
  const double lens = pi * (4 + d) * (2 - d) * (2 - d) / 12;
  const double expected = (8 * pi / 3 - lens) * testing::sphere(1, 20).volume() / (4 * pi / 3);
  for (const TetrahedraMethod method : kMethods) {
    const PhysicalMesh mesh = fill(visual(two), method, 1200);
    checkPhysicalMesh(mesh, testing::name(method));
    ASSERT_EQ(mesh.pieces.size(), 1U);
    EXPECT_NEAR(mesh.pieces[0].source_volume / expected, 1, 0.01);
    if (method != grid) {
      EXPECT_NEAR(ratio(mesh), 1, 0.06) << testing::name(method);
    }
    // Every tetrahedron is inside the other's complement: the border's volume is the sum of volumes.
    const geometry::TetMesh one = testing::bodyMesh(mesh, mesh.pieces[0]);
    double border = 0;
    for (const auto& f : geometry::boundaryFaces(one)) {
      border += one.positions[f[0]].dot(one.positions[f[1]].cross(one.positions[f[2]])) / 6;
    }
    EXPECT_NEAR(border, geometry::volume(one), 1e-9);
  }
}

TEST(Tetrahedralize, PartsApartAreBodiesPartsNearAreOne) {
  for (const double gap : {0.0005, 0.2}) {
    Surface two = testing::box({1, 1, 1}, 4);
    two.append(testing::box({1, 1, 1}, 4), {1 + gap, 0, 0});
    const PhysicalMesh mesh = fill(visual(two), automatic, 800);
    checkPhysicalMesh(mesh, "two boxes");
    EXPECT_EQ(mesh.pieces.size(), gap < 0.01 ? 1U : 2U);
    EXPECT_NEAR(ratio(mesh), 1, 0.06);
  }
}

TEST(Tetrahedralize, ASlabSurvivesAndItsVolumeIsReported) {
  const PhysicalMesh mesh = fill(visual(testing::box({2, 0.01, 2}, 20)), automatic, 1500);
  checkPhysicalMesh(mesh, "slab");
  EXPECT_NEAR(double(mesh.positions.size()), 1500, 450);
  // It reaches as far as the slab does.
  Eigen::AlignedBox3d box;
  for (const auto& p : mesh.positions) box.extend(p);
  EXPECT_GE(box.sizes().x(), 2 * 0.999);
  EXPECT_GE(box.sizes().z(), 2 * 0.999);
  EXPECT_LT(box.sizes().y(), 0.08);
  const Finding* finding = findingOf(mesh, "tetrahedra-volume");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
}

TEST(Tetrahedralize, ASlabThickEnoughKeepsItsThickness) {
  const PhysicalMesh mesh = fill(visual(testing::box({2, 0.1, 2}, 20)), grid, 600);
  checkPhysicalMesh(mesh, "slab");
  EXPECT_NEAR(ratio(mesh), 1, 1e-6);
  EXPECT_EQ(findingOf(mesh, "tetrahedra-volume"), nullptr);
}

TEST(Tetrahedralize, ReentrantCornerIsNotFilled) {
  Surface bar = testing::box({0.8, 0.3, 0.3}, 6);
  Surface arm = testing::box({0.3, 0.8, 0.3}, 6);
  bar.append(arm, {-0.25, 0.25, 0});
  const double exact = 0.8 * 0.3 * 0.3 + 0.5 * 0.3 * 0.3;
  for (const TetrahedraMethod method : kMethods) {
    const PhysicalMesh mesh = fill(visual(bar), method, 800);
    checkPhysicalMesh(mesh, testing::name(method));
    EXPECT_NEAR(mesh.pieces.at(0).source_volume, exact, 0.02 * exact);
    const geometry::TetMesh one = testing::bodyMesh(mesh, mesh.pieces[0]);
    const geometry::WindingNumber cage(one.positions, geometry::boundaryFaces(one));
    EXPECT_FALSE(cage.inside({0.2, 0.45, 0})) << testing::name(method);
    EXPECT_TRUE(cage.inside({-0.25, 0, 0})) << testing::name(method);
  }
}

TEST(Tetrahedralize, ASkinAloneBecomesALayer) {
  const Surface skin = patch(1, 0.1, 24);
  for (const TetrahedraMethod method : kMethods) {
    const PhysicalMesh mesh = fill(visual(skin), method, 600);
    checkPhysicalMesh(mesh, testing::name(method));
    ASSERT_EQ(mesh.pieces.size(), 1U);
    EXPECT_LT(mesh.pieces[0].source_volume, 0);
    EXPECT_NE(findingOf(mesh, "tetrahedra-method"), nullptr);
    const geometry::TetMesh one = testing::bodyMesh(mesh, mesh.pieces[0]);
    const geometry::WindingNumber cage(one.positions, geometry::boundaryFaces(one));
    for (const auto& p : skin.positions) {
      EXPECT_TRUE(cage.inside(p) || cage.bvh().closest(p).squared_distance < 1e-6);
    }
  }
}

TEST(Tetrahedralize, LooseSheetsFollowTheNearestBody) {
  Surface scene = testing::sphere(1, 20);
  scene.append(testing::sphere(0.5, 14), {4, 0, 0});
  scene.append(patch(0.3, 0, 4), {4, 0.7, 0});  // near the second, touching nothing
  scene.append(patch(0.4, 0, 4), {0, 1, 0});    // pierces the first
  const PhysicalMesh mesh = fill(visual(scene), automatic, 800);
  checkPhysicalMesh(mesh, "sheets");
  ASSERT_EQ(mesh.pieces.size(), 2U);
  EXPECT_EQ(mesh.part_piece, (std::vector<std::uint32_t>{0, 1, 1, 0}));
  EXPECT_NEAR(ratio(mesh), 1, 0.06);
  const Finding* finding = findingOf(mesh, "tetrahedra-loose-sheets");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->count, 1U);
}

// Drawers in a chest: bodies that lie a little further apart than what joins them.
TEST(Tetrahedralize, BodiesThatNearlyTouchAreReportedWithWhatJoinsThem) {
  const double diagonal = Vector3d(2, 1, 1).norm();
  for (const double gap : {2e-3, 3.9e-3, 4.3e-3, 0.1}) {
    Surface pair = testing::box({1, 1, 1}, 4);
    pair.append(testing::box({1, 1, 1}, 4), {1 + gap * diagonal, 0, 0});
    const VisualMesh mesh = visual(pair);
    const PhysicalMesh physical = fill(mesh, automatic, 300);
    ASSERT_EQ(physical.pieces.size(), 2U);
    const Finding* finding = findingOf(physical, "near-pieces");
    ASSERT_EQ(finding != nullptr, gap < 4e-3) << gap;
    if (finding == nullptr) continue;
    EXPECT_EQ(finding->severity, Severity::warning);
    EXPECT_EQ(finding->places, (std::vector<std::uint32_t>{0, std::uint32_t(mesh.triangles.size() / 2)}));
    EXPECT_NE(finding->message.find("from mesh 1 to mesh 2"), std::string::npos) << finding->message;
    // What the cure says cures.
    const std::string key = "--set tetrahedra.join=";
    const std::size_t at = finding->cure.find(key);
    ASSERT_NE(at, std::string::npos) << finding->cure;
    TetrahedraOptions options;
    options.target_vertices = 300;
    options.join_distance = std::stod(finding->cure.substr(at + key.size()));
    EXPECT_LT(options.join_distance, 1.15 * gap);
    Progress progress(false);
    EXPECT_EQ(tetrahedralize(mesh, analyzeTopology(mesh), options, progress).pieces.size(), 1U) << finding->cure;
  }
}

// A flag on its pole has no tetrahedra: that is right for a fin, and worth a warning here.
TEST(Tetrahedralize, LargeSheetsDoNotRideAlongUnsaid) {
  for (const double size : {0.1, 1.0}) {
    Surface pole = testing::box({0.1, 3, 0.1}, 6);
    pole.append(patch(size, 0, 8), {0.05 + size / 2, 0, 0});
    const PhysicalMesh mesh = fill(visual(pole), automatic, 300);
    ASSERT_EQ(mesh.pieces.size(), 1U);
    const Finding* finding = findingOf(mesh, "large-sheets");
    ASSERT_EQ(finding != nullptr, size > 0.5) << size;
    if (finding == nullptr) continue;
    EXPECT_EQ(finding->severity, Severity::warning);
    EXPECT_EQ(finding->place, "part 1 of mesh");
    EXPECT_NE(finding->message.find("45 % of the area"), std::string::npos) << finding->message;
  }
}

// A tube about the middle of a body, open at both ends: it adds what it covers, whichever way it faces.
TEST(Tetrahedralize, InvertedCoversDoNotHollowOutTheBody) {
  Surface tube;
  constexpr std::uint32_t kAround = 32;
  for (std::uint32_t j = 0; j < 2; ++j) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const double a = 2 * 3.14159265358979323846 * i / kAround;
      // Its upper rim cuts into the ball.
      tube.positions.emplace_back(1.02 * std::cos(a), j == 0 ? -0.3 : 0.6, 1.02 * std::sin(a));
    }
  }
  for (std::uint32_t i = 0; i < kAround; ++i) {
    const std::uint32_t k = (i + 1) % kAround;
    tube.triangles.push_back({i, kAround + k, k});
    tube.triangles.push_back({i, kAround + i, kAround + k});
  }
  std::array<double, 2> volume{};
  for (const bool inwards : {false, true}) {
    Surface dressed = testing::sphere(1.03, 24);
    if (inwards) tube.reverse();
    dressed.append(tube);
    const PhysicalMesh mesh = fill(visual(dressed), automatic, 800);
    checkPhysicalMesh(mesh, "dressed");
    ASSERT_EQ(mesh.pieces.size(), 1U);
    volume[inwards ? 1 : 0] = mesh.pieces[0].source_volume;
    EXPECT_EQ(findingOf(mesh, "cover-inside-out") != nullptr, inwards);
  }
  EXPECT_GT(volume[0], testing::sphere(1.03, 24).volume());
  EXPECT_EQ(volume[0], volume[1]);
}

// Turned inwards within the solid it is a cavity: the bag of a mouth, with an opening.
TEST(Tetrahedralize, OpenCavitiesStay) {
  Surface ball = testing::sphere(1, 24), bag = testing::sphere(0.5, 16);
  std::erase_if(bag.triangles, [&](const auto& t) {
    return std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return bag.positions[v].y() > 0.4; });
  });
  bag.reverse();
  const double solid = ball.volume();
  ball.append(bag, {0, 0.4999, 0});
  const PhysicalMesh mesh = fill(visual(ball), automatic, 1500);
  EXPECT_EQ(findingOf(mesh, "cover-inside-out"), nullptr);
  EXPECT_LT(mesh.pieces[0].source_volume, 0.93 * solid);
}

TEST(Tetrahedralize, PatchesThatEncloseSomethingTogether) {
  // A ball cut into two open halves that do not share points, with a fin on it.
  const Surface ball = testing::sphere(1, 20);
  Surface halves;
  Surface upper = ball, lower = ball;
  upper.triangles.clear();
  lower.triangles.clear();
  for (const auto& t : ball.triangles) {
    const double y = ball.positions[t[0]].y() + ball.positions[t[1]].y() + ball.positions[t[2]].y();
    (y > 0 ? upper : lower).triangles.push_back(t);
  }
  halves.append(upper);
  halves.append(lower, {0, -1e-4, 0});
  halves.append(patch(0.8, 0, 6), {1.2, 0, 0});
  const PhysicalMesh mesh = fill(visual(halves), automatic, 800);
  checkPhysicalMesh(mesh, "halves");
  ASSERT_EQ(mesh.pieces.size(), 1U);
  EXPECT_NEAR(mesh.pieces[0].source_volume / ball.volume(), 1, 0.02);
  EXPECT_NEAR(ratio(mesh), 1, 0.08);
}

// An extruded letter L whose sides are cut into three, so that its front and back share no edge with them.
TEST(Tetrahedralize, LidsThatShareNoEdgeBelongToTheSolid) {
  const std::vector<std::array<double, 2>> outline = {{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 4}, {0, 4}};
  for (const bool turned : {false, true}) {
    std::vector<Vector3d> positions;
    std::vector<std::vector<std::uint32_t>> faces;
    for (const double z : {0.4, -0.4}) {
      const auto first = std::uint32_t(positions.size());
      for (const auto& p : outline) positions.emplace_back(p[0], p[1], z);
      // The L as two boxes: 0 1 2 3 and 0 3 4 5.
      for (std::vector<std::uint32_t> face : {std::vector<std::uint32_t>{0, 1, 2, 3}, {0, 3, 4, 5}}) {
        for (std::uint32_t& v : face) v += first;
        if ((z < 0) != turned) std::reverse(face.begin(), face.end());
        faces.push_back(face);
      }
    }
    constexpr int kCuts = 3;
    const auto at = [&](std::size_t i, int k, double z) {
      const auto &p = outline[i], &q = outline[(i + 1) % outline.size()];
      const double t = double(k) / kCuts;
      positions.emplace_back(p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1]), z);
      return std::uint32_t(positions.size() - 1);
    };
    for (std::size_t i = 0; i < outline.size(); ++i) {
      for (int k = 0; k < kCuts; ++k) {
        faces.push_back({at(i, k, 0.4), at(i, k, -0.4), at(i, k + 1, -0.4), at(i, k + 1, 0.4)});
      }
    }
    const PhysicalMesh mesh = fill(testing::makeMesh(positions, faces), automatic, 800);
    checkPhysicalMesh(mesh, "letter");
    ASSERT_EQ(mesh.pieces.size(), 1U);
    EXPECT_NEAR(mesh.pieces[0].source_volume, 6 * 0.8, 0.02 * 6 * 0.8);
    EXPECT_NEAR(mesh.pieces[0].volume, 6 * 0.8, 0.15 * 6 * 0.8);
  }
}

TEST(Tetrahedralize, HolesDoNotMatterToStuffingAndAreSealedForDelaunay) {
  Surface open = testing::box({1, 1, 1}, 6);
  open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 8);
  for (const TetrahedraMethod method : kMethods) {
    const PhysicalMesh mesh = fill(visual(open), method, 800);
    checkPhysicalMesh(mesh, testing::name(method));
    EXPECT_NEAR(mesh.pieces.at(0).source_volume, 1, 0.05);
    EXPECT_NEAR(ratio(mesh), 1, method == grid ? 0.35 : 0.1) << testing::name(method);
  }
}

// A wrap that goes in through a hole is closed and clean, and hollow: only its volume shows that.
TEST(Tetrahedralize, DelaunayNeverReturnsTheShellOfAWrapThatWentInside) {
  Surface open = testing::box({1, 1, 1}, 10);
  open.triangles.erase(open.triangles.begin(), open.triangles.begin() + 2 * 10 * 7);
  try {
    const PhysicalMesh mesh = fill(visual(open), delaunay, 800);
    checkPhysicalMesh(mesh, "open box");
    EXPECT_GT(ratio(mesh), 0.8);
    const geometry::TetMesh one = testing::bodyMesh(mesh, mesh.pieces[0]);
    EXPECT_TRUE(geometry::WindingNumber(one.positions, geometry::boundaryFaces(one)).inside({0.1, 0, 0}));
  } catch (const ToolError& error) {
    EXPECT_EQ(error.code(), ExitCode::bad_input);
    EXPECT_NE(std::string(error.what()).find("alpha wrap"), std::string::npos) << error.what();
  }
}

TEST(Tetrahedralize, DelaunayRefusesAPlateFarThinnerThanItsCells) {
  try {
    fill(visual(testing::box({2, 0.005, 2}, 10)), delaunay, 500);
    FAIL() << "expected a refusal";
  } catch (const ToolError& error) {
    EXPECT_EQ(error.code(), ExitCode::bad_input);
    EXPECT_NE(std::string(error.what()).find("tetrahedra.method=auto"), std::string::npos) << error.what();
  }
}

TEST(Tetrahedralize, InsideOutTurnedFacesWallsAndFins) {
  const Surface ball = testing::sphere(1, 20);
  Surface reversed = ball;
  reversed.reverse();
  EXPECT_NEAR(ratio(fill(visual(reversed), automatic, 600)), 1, 0.06);

  Surface turned = ball;
  for (std::size_t i = 0; i < turned.triangles.size(); i += 7)
    std::swap(turned.triangles[i][0], turned.triangles[i][1]);
  const PhysicalMesh mesh = fill(visual(turned), automatic, 600);
  EXPECT_NEAR(mesh.pieces.at(0).source_volume, ball.volume(), 0.01);
  EXPECT_NEAR(ratio(mesh), 1, 0.06);

  // A wall across the inside, sharing the points of its rim, and a fin on the outside.
  const std::uint32_t n = 6;
  Surface box = testing::box({1, 1, 1}, n);
  Surface wall = patch(1, 0, n);
  box.append(wall);
  const auto base = static_cast<std::uint32_t>(box.positions.size());
  box.positions.emplace_back(0.9, 0.9, 0.9);
  box.positions.emplace_back(0.5, 0.5, 0.5);
  box.positions.emplace_back(0.5, 0.5, 0.5 - 1.0 / n);
  box.triangles.push_back({base, base + 1, base + 2});
  const PhysicalMesh walled = fill(visual(box), automatic, 600);
  checkPhysicalMesh(walled, "walled");
  ASSERT_EQ(walled.pieces.size(), 1U);
  EXPECT_NEAR(walled.pieces[0].source_volume, 1, 1e-9);
  EXPECT_NEAR(ratio(walled), 1, 0.06);
}

TEST(Tetrahedralize, SizeAndPlaceDoNotMatter) {
  const Surface blob = testing::blob(2, 24);
  const PhysicalMesh unit = fill(visual(blob), automatic, 600);
  for (const TetrahedraMethod method : kMethods) {
    Surface tiny = blob, far = blob;
    for (auto& p : tiny.positions) p *= 1e-5;
    for (auto& p : far.positions) p += Vector3d(1e6, -1e6, 1e6);
    const PhysicalMesh small = fill(visual(tiny), method, 600), away = fill(visual(far), method, 600);
    checkPhysicalMesh(small, "tiny " + testing::name(method));
    checkPhysicalMesh(away, "far " + testing::name(method));
    EXPECT_NEAR(ratio(small), ratio(away), 0.02);
    if (method == automatic) {
      EXPECT_EQ(small.tetrahedra.size(), unit.tetrahedra.size());
    }
  }
}

TEST(Tetrahedralize, ManyBodiesShareTheTarget) {
  Surface beads;
  for (int i = 0; i < 40; ++i)
    beads.append(testing::sphere(i % 5 == 0 ? 0.4 : 0.1, 8), {double(i % 8), double(i / 8), 0});
  const PhysicalMesh mesh = fill(visual(beads), automatic, 1500);
  checkPhysicalMesh(mesh, "beads");
  EXPECT_EQ(mesh.pieces.size(), 40U);
  EXPECT_NEAR(double(mesh.positions.size()), 1500, 450);
  for (const auto& body : mesh.pieces) EXPECT_GE(body.vertex_count, 8U);
}

TEST(Tetrahedralize, SameBytesForAnyThreadsAndTwice) {
  for (const TetrahedraMethod method : kMethods) {
    const VisualMesh mesh = visual(testing::blob(9, 30));
    const PhysicalMesh first = fill(mesh, method, 700);
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const PhysicalMesh second = fill(mesh, method, 700);
    EXPECT_EQ(first.positions, second.positions) << testing::name(method);
    EXPECT_EQ(first.tetrahedra, second.tetrahedra) << testing::name(method);
    EXPECT_EQ(first.fill, second.fill) << testing::name(method);
  }
}

TEST(Tetrahedralize, TheLatticeOfStuffingIsBoundedHoweverFarAVertexLies) {
  Surface ball = testing::sphere(1, 24);
  ball.positions[100] = {500, 200, 0};
  const VisualMesh mesh = visual(ball);
  const Topology topology = analyzeTopology(mesh);
  const PieceSet set = findPieces(mesh, topology, 1e-3 * mesh.diagonal, geometry::serialFor);
  ASSERT_EQ(set.pieces.size(), 1U);
  // Lattices are only counted: what is not asked is outside.
  std::size_t largest = 0;
  fillWithStuffing(set.pieces[0], 1500, {}, [&](std::size_t count, std::size_t grain, const auto& body) {
    largest = std::max(largest, count);
    if (count < 100000) geometry::serialFor(count, grain, body);
  });
  EXPECT_GT(largest, 1000000U);
  EXPECT_LE(largest, 2000000U);
}

TEST(Tetrahedralize, NothingToFillIsAnError) {
  const VisualMesh mesh = testing::makeMesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}, {0, 0, 1}});
  EXPECT_THROW(fill(mesh, automatic, 100), ToolError);
}

TEST(Tetrahedralize, QualityCountsInvertedAndFlat) {
  const std::vector<Vector3d> x = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0}};
  EXPECT_EQ(measureQuality(x, {{0, 1, 2, 3}}).inverted, 0U);
  EXPECT_EQ(measureQuality(x, {{0, 2, 1, 3}, {0, 1, 2, 4}}).inverted, 2U);
  EXPECT_NEAR(measureQuality(x, {{0, 1, 2, 3}}).min_dihedral_deg, 54.7356, 1e-3);
}

}  // namespace
}  // namespace sinew::tools
