// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/shell.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "runtime/geometry/winding_number.h"
#include "tests/geometry/shapes.h"
#include "tests/support/obj_reader.h"
#include "tests/tetrahedralize/check.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::checkPhysicalMesh;
using testing::fill;
using testing::findingOf;
using enum TetrahedraMethod;

constexpr double kPi = 3.14159265358979323846;

// n x m quads over the unit square; `closed` joins the ends along u.
VisualMesh sheet(const std::function<Vector3d(double, double)>& place, std::uint32_t n, std::uint32_t m, bool closed) {
  std::vector<Vector3d> positions;
  std::vector<std::vector<std::uint32_t>> faces;
  const std::uint32_t row = closed ? n : n + 1;
  for (std::uint32_t j = 0; j <= m; ++j) {
    for (std::uint32_t i = 0; i < row; ++i) positions.push_back(place(double(i) / n, double(j) / m));
  }
  for (std::uint32_t j = 0; j < m; ++j) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t k = (i + 1) % row;
      faces.push_back({j * row + i, j * row + k, (j + 1) * row + k, (j + 1) * row + i});
    }
  }
  return testing::makeMesh(positions, faces);
}

// Two halves of a square that meet at an angle.
VisualMesh crease(double degrees) {
  const double a = degrees * kPi / 180;
  return sheet(
      [a](double u, double v) {
        const double s = 2 * u - 1;
        return s <= 0 ? Vector3d(s, 0, v) : Vector3d(-s * std::cos(a), s * std::sin(a), v);
      },
      20, 10, false);
}

PhysicalMesh shellOf(const VisualMesh& mesh, std::uint32_t vertices, double thickness,
                     const std::function<double(const Vector3d&)>& factor = {}) {
  Progress progress(false);
  TetrahedraOptions options;
  options.method = shell;
  options.target_vertices = vertices;
  options.shell_thickness = thickness;
  for (const Vector3d& p : mesh.welded_positions) {
    if (factor) options.shell_factors.push_back(factor(p));
  }
  return tetrahedralize(mesh, analyzeTopology(mesh), options, progress);
}

VisualMesh asset(const std::string& name) { return testing::readObj(std::filesystem::path(SINEW_TEST_ASSETS) / name); }

// Every point of the surface lies in the skin or within `reach` of it.
void expectCovered(const VisualMesh& mesh, const PhysicalMesh& physical, double reach, const std::string& what) {
  double farthest = 0;
  for (const PhysicalPiece& body : physical.pieces) {
    const geometry::TetMesh one = testing::bodyMesh(physical, body);
    const geometry::WindingNumber cage(one.positions, geometry::boundaryFaces(one));
    if (physical.pieces.size() > 1) return;
    for (const Vector3d& p : mesh.positions) {
      if (!cage.inside(p)) farthest = std::max(farthest, std::sqrt(cage.bvh().closest(p).squared_distance));
    }
  }
  EXPECT_LE(farthest, reach) << what;
}

TEST(Shell, SkinPatchAtSeveralBudgets) {
  const VisualMesh mesh = asset("generated/skin_patch.obj");
  for (const std::uint32_t target : {60U, 200U, 600U, 1500U}) {
    const std::string what = "skin patch " + std::to_string(target);
    const PhysicalMesh physical = fill(mesh, automatic, target);
    checkPhysicalMesh(physical, what);
    ASSERT_EQ(physical.pieces.size(), 1U);
    EXPECT_EQ(physical.pieces[0].method, shell) << what;
    EXPECT_LE(physical.positions.size(), 1.2 * target) << what;
    EXPECT_GE(physical.positions.size(), 0.8 * std::min(target, 1250U)) << what;
    EXPECT_GT(physical.quality.min_dihedral_deg, 5) << what;
    expectCovered(mesh, physical, 0.02, what);
  }
  const Finding* finding = findingOf(fill(mesh, automatic, 600), "tetrahedra-method");
  ASSERT_NE(finding, nullptr);
  EXPECT_NE(finding->message.find("shell"), std::string::npos) << finding->message;
}

TEST(Shell, CoarseningKeepsTheBorder) {
  const VisualMesh mesh = sheet([](double u, double v) { return Vector3d(u, 0, v); }, 30, 30, false);
  const PhysicalMesh physical = shellOf(mesh, 100, 0.02);
  checkPhysicalMesh(physical, "square");
  // All of the square's area, at its thickness.
  EXPECT_NEAR(physical.pieces[0].volume, 0.02, 1e-9);
}

TEST(Shell, ThicknessIsWhatWasAsked) {
  const double r = 0.3;
  const VisualMesh tube =
      sheet([r](double u, double v) { return Vector3d(r * std::cos(2 * kPi * u), v, r * std::sin(2 * kPi * u)); }, 48,
            16, true);
  const PhysicalMesh physical = shellOf(tube, 4000, 0.01);
  checkPhysicalMesh(physical, "tube");
  EXPECT_NEAR(physical.pieces[0].volume / (2 * kPi * r * 0.01), 1, 0.01);
  EXPECT_LT(physical.pieces[0].source_volume, 0);
  EXPECT_EQ(findingOf(physical, "tetrahedra-volume"), nullptr);
}

// How thick a skin of one body is along the surface's normal at some of its points, as a part of what was asked there.
// Points count whose surroundings, as wide as a coarse triangle, are as flat as cos(10 degrees) and asked for alike.
std::vector<double> measuredThickness(const VisualMesh& mesh, const PhysicalMesh& physical, double thickness,
                                      const std::function<double(const Vector3d&)>& factor, double reach) {
  const geometry::TetMesh one = testing::bodyMesh(physical, physical.pieces[0]);
  const geometry::TriangleBvh cage(one.positions, geometry::boundaryFaces(one));
  std::vector<Vector3d> normals(mesh.positions.size(), Vector3d::Zero());
  for (const auto& t : mesh.triangles) {
    const Vector3d& a = mesh.positions[t[0]];
    const Vector3d n = (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a);
    for (const std::uint32_t v : t) normals[v] += n;
  }
  for (Vector3d& n : normals) n.normalize();
  const Topology topology = analyzeTopology(mesh);
  std::vector<char> border(mesh.positions.size(), 0);
  for (const auto& edge : topology.boundary_edges) border[edge[0]] = border[edge[1]] = 1;
  std::vector<double> ratios;
  for (std::size_t p = 0; p < mesh.positions.size(); ++p) {
    const Vector3d& x = mesh.positions[p];
    bool even = true;
    for (std::size_t q = 0; q < mesh.positions.size() && even; ++q) {
      if ((mesh.positions[q] - x).norm() > reach) continue;
      even = border[q] == 0 && normals[q].dot(normals[p]) > 0.985 &&
             std::abs(factor(mesh.positions[q]) / factor(x) - 1) < 0.02;
    }
    if (!even) continue;
    const double asked = thickness * factor(x);
    std::vector<geometry::TriangleBvh::Crossing> crossings;
    cage.crossings(x - 2 * asked * normals[p], x + 2 * asked * normals[p], crossings);
    if (crossings.size() < 2) {
      ratios.push_back(0);
      continue;
    }
    ratios.push_back(4 * (crossings.back().parameter - crossings.front().parameter));
  }
  return ratios;
}

// 1 below `low` along an axis, `most` above `high`, a smooth ramp between.
std::function<double(const Vector3d&)> ramp(int axis, double low, double high, double most) {
  return [=](const Vector3d& x) {
    const double t = std::clamp((x[axis] - low) / (high - low), 0.0, 1.0);
    return 1 + (most - 1) * t * t * (3 - 2 * t);
  };
}

TEST(Shell, ThicknessFollowsItsFactors) {
  const VisualMesh patch = asset("generated/skin_patch.obj");
  const Vector3d size = patch.bounds_max - patch.bounds_min;
  int axis = 0;
  size.maxCoeff(&axis);
  const double low = patch.bounds_min[axis] + 0.4 * size[axis], high = patch.bounds_min[axis] + 0.6 * size[axis];
  const double thickness = 0.01 * size[axis];
  for (const double most : {3.0, 0.25}) {
    for (const std::uint32_t target : {500U, 4000U}) {
      SCOPED_TRACE(std::to_string(most) + " at " + std::to_string(target));
      const auto factor = ramp(axis, low, high, most);
      const PhysicalMesh physical = shellOf(patch, target, thickness, factor);
      checkPhysicalMesh(physical, "patch");
      const double edge = size[axis] / std::sqrt(target / 2.0);
      const std::vector<double> ratios = measuredThickness(patch, physical, thickness, factor, 1.5 * edge);
      EXPECT_GT(ratios.size(), 100U);
      for (const double ratio : ratios) EXPECT_NEAR(ratio, 1, 0.05);
    }
  }
}

// Thick brows, thin lids: no tetrahedron turns over, whatever is asked of creases and borders.
TEST(Shell, FactorsOnAHeadDoNotFoldOver) {
  const VisualMesh head = asset("models/makehuman_head.obj");
  for (const double most : {20.0, 0.05}) {
    for (const int axis : {0, 2}) {
      const double middle = (head.bounds_min[axis] + head.bounds_max[axis]) / 2;
      const PhysicalMesh physical = shellOf(head, 3000, 0.02, ramp(axis, middle, middle + 0.1, most));
      EXPECT_EQ(physical.pieces[0].method, shell);
      EXPECT_EQ(physical.quality.inverted, 0U);
      for (const auto& t : physical.tetrahedra) {
        const auto& x = physical.positions;
        EXPECT_GT(geometry::signedVolume6(x[t[0]], x[t[1]], x[t[2]], x[t[3]]), 0);
      }
    }
  }
  // Where no shell is made, the artist hears that nothing came of it.
  Progress progress(false);
  TetrahedraOptions options;
  options.target_vertices = 300;
  options.shell_factors.assign(head.welded_positions.size(), 2);
  const PhysicalMesh solid = tetrahedralize(head, analyzeTopology(head), options, progress);
  EXPECT_NE(findingOf(solid, "thickness-unused"), nullptr);
  EXPECT_EQ(findingOf(shellOf(head, 3000, 0.02, ramp(0, 0, 1, 2)), "thickness-unused"), nullptr);
}

TEST(Shell, SharpCreasesDoNotFoldOver) {
  for (const double degrees : {90.0, 30.0}) {
    for (const double thickness : {0.0, 0.02, 0.3}) {
      for (const std::uint32_t target : {120U, 1000U}) {
        const std::string what = std::to_string(degrees) + " degrees, " + std::to_string(thickness) + " m";
        const PhysicalMesh physical = shellOf(crease(degrees), target, thickness);
        checkPhysicalMesh(physical, what);
        expectCovered(crease(degrees), physical, 1e-6, what);
      }
    }
  }
}

// No normal serves both sides of a fold: the shell is cut apart along it and the sides are tied to one another, at the
// thickness asked elsewhere.
TEST(Shell, FoldsAreCutApart) {
  const VisualMesh folded = crease(4);
  for (const double thickness : {0.001, 0.02, 0.3}) {
    const std::string what = std::to_string(thickness) + " m";
    const PhysicalMesh physical = shellOf(folded, 1000, thickness);
    checkPhysicalMesh(physical, what);
    ASSERT_EQ(physical.pieces.size(), 1U);
    EXPECT_GT(physical.pieces[0].tie_count, 0U) << what;
    const Finding* finding = findingOf(physical, "tetrahedra-fold");
    ASSERT_NE(finding, nullptr) << what;
    EXPECT_NE(finding->message.find("(11 vertices near ("), std::string::npos) << finding->message;
  }
  const PhysicalMesh thin = shellOf(folded, 1000, 0.001);
  const geometry::TetMesh one = testing::bodyMesh(thin, thin.pieces[0]);
  double prisms = 0;
  for (std::size_t t = 0; t < one.tetrahedra.size() - thin.pieces[0].tie_count; ++t) {
    prisms += geometry::volume(one, one.tetrahedra[t]);
  }
  EXPECT_NEAR(prisms / (2 * 0.001), 1, 0.01);
  EXPECT_EQ(findingOf(shellOf(crease(30), 1000, 0.02), "tetrahedra-fold"), nullptr);
}

// An artist's mesh whose triangulated quads fold: neither a thin nor a thick shell of it is refused.
TEST(Shell, TheFoldsOfAModelDoNotRefuseIt) {
  const VisualMesh penguin = asset("models/penguin_control.obj");
  for (const double thickness : {1e-4, 0.01, 0.5}) {
    const PhysicalMesh physical = shellOf(penguin, 9000, thickness);
    EXPECT_EQ(physical.pieces[0].method, shell) << thickness;
    EXPECT_EQ(physical.quality.inverted, 0U) << thickness;
    EXPECT_NE(findingOf(physical, "tetrahedra-fold"), nullptr) << thickness;
  }
}

TEST(Shell, MaskOfAFaceAndFins) {
  // The front of the head, with all that is open in it.
  const VisualMesh head = asset("models/makehuman_head.obj");
  const Topology topology = analyzeTopology(head);
  std::vector<std::vector<std::uint32_t>> faces;
  for (std::size_t t = 0; t < head.triangles.size(); ++t) {
    double z = 0;
    for (const std::uint32_t v : head.triangles[t]) z += head.positions[v].z() / 3;
    if (z > 0.95 && topology.part_of_triangle[t] == 0) {
      faces.push_back({head.triangles[t][0], head.triangles[t][1], head.triangles[t][2]});
    }
  }
  const VisualMesh mask = testing::makeMesh(head.positions, faces);
  for (const std::uint32_t target : {800U, 3000U}) {
    const PhysicalMesh physical = shellOf(mask, target, 0);
    checkPhysicalMesh(physical, "mask");
    EXPECT_EQ(physical.pieces[0].method, shell);
  }

  const VisualMesh fish = asset("models/trout/trout.obj");
  const Topology parts = analyzeTopology(fish);
  faces.clear();
  for (std::size_t t = 0; t < fish.triangles.size(); ++t) {
    const std::uint32_t part = parts.part_of_triangle[t];
    if (part == formats::kNone || parts.parts[part].closed) continue;
    faces.push_back({fish.triangles[t][0], fish.triangles[t][1], fish.triangles[t][2]});
  }
  if (faces.empty()) return;
  checkPhysicalMesh(fill(testing::makeMesh(fish.positions, faces), automatic, 1500), "fins");
}

// Coarsening adds no fold, so that the first attempt serves, at its budget. (Attempts that left fine what folded ended
// at several times of it, or came back to the same folds for minutes.)
TEST(Shell, RoughReliefKeepsToItsBudget) {
  const auto noise = [](double u, double v) {
    return std::fmod(std::abs(std::sin(u * 127.1 + v * 311.7) * 43758.5), 1.0);
  };
  const VisualMesh rough =
      sheet([&](double u, double v) { return Vector3d(u, 0.1 * std::sin(9 * u + 4 * v) + 0.04 * noise(u, v), v); }, 150,
            150, false);
  const PhysicalMesh physical = shellOf(rough, 1000, 0);
  ASSERT_EQ(physical.pieces.size(), 1U);
  EXPECT_EQ(physical.pieces[0].method, shell);
  EXPECT_LE(physical.positions.size(), 1100U);
  EXPECT_EQ(physical.quality.inverted, 0U);
}

// Each collapse at a hub visits all of its faces: no shell, and what is taken instead.
TEST(Shell, HubsBecomeGrid) {
  std::vector<Vector3d> positions = {{0, 0.3, 0}};
  std::vector<std::vector<std::uint32_t>> faces;
  const std::uint32_t n = 3000;
  for (std::uint32_t i = 0; i < n; ++i) {
    positions.emplace_back(std::cos(2 * kPi * i / n), 0, std::sin(2 * kPi * i / n));
    faces.push_back({0, 1 + i, 1 + (i + 1) % n});
  }
  const PhysicalMesh physical = fill(testing::makeMesh(positions, faces), automatic, 400);
  EXPECT_EQ(physical.pieces[0].method, grid);
  const Finding* const method = findingOf(physical, "tetrahedra-method");
  ASSERT_NE(method, nullptr);
  EXPECT_NE(method->message.find("more than 500 faces"), std::string::npos);
}

// Two squares that cross: they share no point, yet are one body.
TEST(Shell, SheetsThatCrossHoldTogether) {
  VisualMesh square = sheet([](double u, double v) { return Vector3d(u - 0.5, 0, v - 0.5); }, 20, 20, false);
  const VisualMesh upright =
      sheet([](double u, double v) { return Vector3d(0.013, u - 0.4, v - 0.45); }, 12, 12, false);
  std::vector<std::vector<std::uint32_t>> faces;
  for (const auto& t : square.triangles) faces.push_back({t[0], t[1], t[2]});
  const auto first = std::uint32_t(square.positions.size());
  for (const auto& t : upright.triangles) faces.push_back({first + t[0], first + t[1], first + t[2]});
  square.positions.insert(square.positions.end(), upright.positions.begin(), upright.positions.end());
  const VisualMesh mesh = testing::makeMesh(square.positions, faces);
  for (const std::uint32_t target : {150U, 2000U}) {
    const PhysicalMesh physical = shellOf(mesh, target, 0.02);
    checkPhysicalMesh(physical, "crossed");
    ASSERT_EQ(physical.pieces.size(), 1U);
    EXPECT_EQ(physical.pieces[0].method, shell);
    // All along the line where they cross, not by one tetrahedron: the skins have three a triangle.
    EXPECT_GT(physical.pieces[0].tie_count, 0U);
    if (target == 2000) {
      EXPECT_GT(physical.tetrahedra.size(), 3 * mesh.triangles.size() + 16);
    }
    ASSERT_NE(findingOf(physical, "tetrahedra-method"), nullptr);
    EXPECT_NE(findingOf(physical, "tetrahedra-method")->message.find("2 parts tied"), std::string::npos);
  }
  // Eyeballs lie in the head without touching it.
  const PhysicalMesh head = shellOf(asset("models/makehuman_head.obj"), 3000, 0.02);
  std::vector<std::uint32_t> component;
  EXPECT_EQ(
      geometry::connectedComponents(testing::bodyMesh(head, head.pieces[0]), geometry::JoinedBy::vertices, component),
      1U);
}

TEST(Shell, AClosedSurfaceBecomesHollowWhereAShellIsAsked) {
  const testing::Surface ball = testing::sphere(1, 20);
  std::vector<std::vector<std::uint32_t>> faces;
  for (const auto& t : ball.triangles) faces.push_back({t[0], t[1], t[2]});
  const PhysicalMesh physical = shellOf(testing::makeMesh(ball.positions, faces), 4000, 0.05);
  checkPhysicalMesh(physical, "ball");
  EXPECT_NEAR(physical.pieces[0].volume / (4 * kPi * 0.05), 1, 0.03);
}

// A Moebius band of radius 1.
VisualMesh moebiusBand(double width) {
  std::vector<Vector3d> positions;
  std::vector<std::vector<std::uint32_t>> faces;
  constexpr std::uint32_t kAround = 40, kAcross = 4;
  for (std::uint32_t i = 0; i < kAround; ++i) {
    const double t = 2 * kPi * i / kAround;
    for (std::uint32_t j = 0; j <= kAcross; ++j) {
      const double w = width * (double(j) / kAcross - 0.5);
      positions.emplace_back((1 + w * std::cos(t / 2)) * std::cos(t), w * std::sin(t / 2),
                             (1 + w * std::cos(t / 2)) * std::sin(t));
    }
  }
  for (std::uint32_t i = 0; i < kAround; ++i) {
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      const std::uint32_t a = i * (kAcross + 1) + j;
      if (i + 1 < kAround) {
        faces.push_back({a, a + 1, a + kAcross + 2, a + kAcross + 1});
      } else {
        faces.push_back({a, a + 1, kAcross - j - 1, kAcross - j});
      }
    }
  }
  return testing::makeMesh(positions, faces);
}

// It bounds nothing, however much its turns seem to.
TEST(Shell, OneSidedSheetsAreNoSolidUnderAuto) {
  for (const double width : {0.2, 0.6, 1.6}) {
    const PhysicalMesh physical = testing::fill(moebiusBand(width), TetrahedraMethod::automatic, 600);
    const std::string what = "width " + std::to_string(width);
    ASSERT_EQ(physical.pieces.size(), 1U) << what;
    EXPECT_LT(physical.pieces[0].source_volume, 0) << what;
    const Finding* finding = testing::findingOf(physical, "tetrahedra-method");
    ASSERT_NE(finding, nullptr) << what;
    EXPECT_NE(finding->message.find("only one side"), std::string::npos) << finding->message;
  }
}

TEST(Shell, OneSidedAndBranchingSheetsAreRefusedWithPlaceAndCure) {
  const VisualMesh band = moebiusBand(0.4);
  // Three wings on one edge.
  const VisualMesh wings = testing::makeMesh({{0, 0, 0}, {0, 1, 0}, {1, 0.5, 0}, {-0.5, 0.5, 0.8}, {-0.5, 0.5, -0.8}},
                                             {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}});
  const auto expectRefused = [](const VisualMesh& mesh, const std::string& why) {
    try {
      shellOf(mesh, 600, 0);
      FAIL() << "expected a refusal: " << why;
    } catch (const ToolError& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input);
      const std::string text = error.what();
      EXPECT_NE(text.find(why), std::string::npos) << text;
      EXPECT_NE(text.find(" near ("), std::string::npos) << text;
      EXPECT_NE(text.find("tetrahedra.method=grid"), std::string::npos) << text;
    }
  };
  expectRefused(band, "only one side");
  expectRefused(wings, "edge of 3 faces");
  // Left to itself the bake goes on with cells.
  const PhysicalMesh cells = fill(wings, automatic, 200);
  checkPhysicalMesh(cells, "wings");
  EXPECT_EQ(cells.pieces[0].method, grid);
  ASSERT_NE(findingOf(cells, "tetrahedra-method"), nullptr);
  EXPECT_EQ(findingOf(cells, "tetrahedra-method")->severity, Severity::warning);
}

}  // namespace
}  // namespace sinew::tools
