// SPDX-License-Identifier: GPL-3.0-or-later
#include <random>

#include "tests/import/import_fixture.h"
#include "tools/import/triangulate.h"
#include "tools/import/weld.h"

namespace sinew::tools {
namespace {

class Generated : public ImportTest {};

VisualMesh generated(const std::string& name) { return importFile(kAssets / "generated" / name); }

TEST_F(Generated, VolumesAndCounts) {
  const struct {
    const char* name;
    std::uint32_t vertices, faces;
    double volume;
    double tolerance;
  } kTruth[] = {{"cube.obj", 8, 6, 1, 1e-12},
                {"l_bar.obj", 176, 174, 0.117, 1e-12},
                {"beam.obj", 290, 288, 4, 1e-12},
                {"slab.obj", 3362, 3360, 0.04, 1e-12},
                {"sphere.obj", 266, 288, 4.070552360820172, 1e-9},
                // Its quads are not flat: the volume depends on their diagonals, the truth cuts them by fans.
                {"torus.obj", 512, 512, 1.7201164965198983, 0.01},
                {"capsule.obj", 554, 576, 2.0655792254422147, 1e-9},
                {"hollow_sphere.obj", 532, 576, 3.191313050883037, 1e-9},
                {"chain.obj", 1536, 1536, 2.2934886620265247, 0.01},
                {"bad_flipped.obj", 98, 96, 1, 1e-12},
                {"bad_inside_out.obj", 266, 288, 4.070552360820172, 1e-9},
                {"bad_unreferenced.obj", 100, 96, 1, 1e-12},
                {"bad_far.obj", 98, 96, 1, 1e-9},
                {"bad_tiny.obj", 98, 96, 1e-15, 1e-24},
                {"bad_near_duplicate.obj", 384, 96, 1, 1e-5},
                {"bad_zero_area.obj", 98, 98, 1, 1e-12}};
  for (const auto& truth : kTruth) {
    SCOPED_TRACE(truth.name);
    const VisualMesh mesh = generated(truth.name);
    EXPECT_EQ(mesh.source_vertex_count, truth.vertices);
    EXPECT_EQ(mesh.source_face_count, truth.faces);
    EXPECT_NEAR(volumeOf(mesh), truth.volume, truth.tolerance);
  }
}

TEST_F(Generated, WeldedCounts) {
  EXPECT_EQ(generated("cube_soup.stl").welded_positions.size(), 386U);
  EXPECT_EQ(generated("bad_near_duplicate.obj").welded_positions.size(), 98U);
  EXPECT_EQ(generated("bad_tiny.obj").welded_positions.size(), 98U);
  EXPECT_EQ(generated("bad_far.obj").welded_positions.size(), 98U);
}

TEST_F(Generated, RepairsAreReportedWithFaces) {
  EXPECT_EQ(findingOf(generated("bad_flipped.obj"), "flipped-faces")->places,
            (std::vector<std::uint32_t>{0, 7, 14, 21, 28, 35, 42, 49, 56, 63, 70, 77, 84, 91}));
  EXPECT_EQ(findingOf(generated("bad_inside_out.obj"), "inside-out-part")->count, 288U);
  EXPECT_EQ(findingOf(generated("bad_zero_area.obj"), "repeated-index-faces")->places,
            (std::vector<std::uint32_t>{96, 97}));
  EXPECT_EQ(findingOf(generated("bad_unreferenced.obj"), "unreferenced-vertices")->places,
            (std::vector<std::uint32_t>{98, 99}));
  EXPECT_NE(findingOf(generated("bad_tiny.obj"), "implausible-size"), nullptr);
  expectRefusal(kAssets / "generated/bad_nan.obj", "vertex 0 (line 3)");
}

TEST_F(Generated, CleanMeshesAreLeftAlone) {
  for (const char* name : {"cube.obj", "l_bar.obj", "beam.obj", "slab.obj", "skin_patch.obj", "sphere.obj", "torus.obj",
                           "capsule.obj", "two_spheres.obj", "chain.obj"}) {
    SCOPED_TRACE(name);
    const VisualMesh mesh = generated(name);
    for (const char* id : {"flipped-faces", "inside-out-part", "cavity", "welded-vertices", "unreferenced-vertices",
                           "repeated-index-faces"})
      EXPECT_EQ(findingOf(mesh, id), nullptr) << id;
  }
}

TEST_F(Generated, TheWallOfACavityKeepsFacingIt) {
  const VisualMesh mesh = generated("hollow_sphere.obj");
  EXPECT_EQ(findingOf(mesh, "inside-out-part"), nullptr);
  EXPECT_EQ(findingOf(mesh, "cavity")->count, 1U);
}

/// Text of hollow_sphere.obj with the faces of the chosen shells reversed.
std::string shells(bool turn_outer, bool turn_inner) {
  std::ifstream in(kAssets / "generated/hollow_sphere.obj");
  std::string out;
  std::string line;
  while (std::getline(in, line)) {
    if (line.rfind("f ", 0) == 0) {
      std::istringstream words(line.substr(2));
      std::vector<int> face;
      for (int v = 0; words >> v;) face.push_back(v);
      if (face[0] <= 266 ? turn_outer : turn_inner) std::reverse(face.begin(), face.end());
      line = "f";
      for (int v : face) line += " " + std::to_string(v);
    }
    out += line + "\n";
  }
  return out;
}

TEST_F(Generated, NestedPartsTurnWithTheirContainer) {
  const double outer = 4.070552360820172;
  const double cavity = 3.191313050883037;
  // Both turned: the whole file is inside out, the cavity stays one.
  VisualMesh mesh = importFile(write("both.obj", shells(true, true)));
  EXPECT_NEAR(volumeOf(mesh), cavity, 1e-9);
  EXPECT_EQ(findingOf(mesh, "inside-out-part")->count, 576U);
  // The inner one faces outward: a body within a body.
  mesh = importFile(write("inner.obj", shells(false, true)));
  EXPECT_NEAR(volumeOf(mesh), 2 * outer - cavity, 1e-9);
  EXPECT_EQ(findingOf(mesh, "inside-out-part"), nullptr);
  // Outer inward, inner inward: in that file's way of winding both are bodies.
  mesh = importFile(write("outer.obj", shells(true, false)));
  EXPECT_NEAR(volumeOf(mesh), 2 * outer - cavity, 1e-9);
}

TEST_F(Generated, ThreadsAndOrderDoNotMatter) {
  const VisualMesh a = generated("bad_flipped.obj");
  const VisualMesh b = generated("bad_flipped.obj");
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.normals, b.normals);
}

TEST_F(Generated, ComputedNormalsPointOutwardAndAreSmooth) {
  const VisualMesh mesh = generated("sphere.obj");
  EXPECT_FALSE(mesh.had_normals);
  for (std::size_t v = 0; v < mesh.positions.size(); ++v)
    EXPECT_GT(mesh.normals[v].cast<double>().dot(mesh.positions[v].normalized()), 0.99);
}

TEST(Weld, MergesWithinTheToleranceOnly) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> jitter(-1, 1);
  for (const double scale : {1e-5, 1.0, 1e6}) {
    for (const Eigen::Vector3d& offset : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e6, -1e6, 3e5)}) {
      if (scale < 1 && !offset.isZero()) continue;  // beyond what double precision holds
      const double tolerance = 1e-6 * scale;
      std::vector<Eigen::Vector3d> points;
      for (int i = 0; i < 500; ++i) {
        const Eigen::Vector3d base = offset + scale * Eigen::Vector3d(i % 10, i / 10 % 10, i / 100);
        for (int k = 0; k < 4; ++k)
          points.push_back(base + 0.28 * tolerance * Eigen::Vector3d(jitter(random), jitter(random), jitter(random)));
      }
      const Weld weld = weldPositions(points, tolerance);
      EXPECT_EQ(weld.points.size(), 500U);
      for (std::size_t i = 0; i < points.size(); ++i)
        EXPECT_LE((weld.points[weld.of[i]] - points[i]).norm(), tolerance);
    }
  }
}

TEST(Weld, ChainsDoNotCollapse) {
  // Points 0.6 of the tolerance apart: each is near the next, but the line must not become one point.
  std::vector<Eigen::Vector3d> line;
  for (int i = 0; i < 100; ++i) line.emplace_back(0.6 * i, 0, 0);
  const Weld weld = weldPositions(line, 1.0);
  EXPECT_EQ(weld.points.size(), 50U);
  for (std::size_t i = 0; i < line.size(); ++i) EXPECT_LE((weld.points[weld.of[i]] - line[i]).norm(), 1.0);
}

TEST(Weld, ZeroToleranceMeansEqual) {
  const Weld weld = weldPositions({{0, 0, 0}, {-0.0, 0, 0}, {1e-300, 0, 0}, {0, 0, 0}}, 0);
  EXPECT_EQ(weld.of, (std::vector<std::uint32_t>{0, 0, 1, 0}));
}

/// Cuts a polygon of the xy plane, tilted in space, and checks area and count.
void expectCut(const std::vector<Eigen::Vector2d>& outline, double area) {
  const Eigen::Matrix3d tilt = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized().toRotationMatrix();
  std::vector<Eigen::Vector3d> corners;
  for (const auto& p : outline) corners.push_back(tilt * Eigen::Vector3d(p.x(), p.y(), 0) + Eigen::Vector3d(3, 2, 1));
  std::vector<Triangle> triangles;
  Triangulator().cut(corners, triangles);
  ASSERT_EQ(triangles.size(), outline.size() - 2);
  double sum = 0;
  const Eigen::Vector3d normal = tilt.col(2);
  for (const Triangle& t : triangles) {
    const double signed_area = (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]).dot(normal) / 2;
    EXPECT_GE(signed_area, -1e-12);
    sum += signed_area;
  }
  EXPECT_NEAR(sum, area, 1e-9);
}

TEST(Triangulate, ConcaveAndDegeneratePolygons) {
  expectCut({{0, 0}, {1, 0}, {1, 1}, {0, 1}}, 1);
  expectCut({{0, 0}, {2, 0}, {0.4, 0.4}, {0, 2}}, 0.8);                            // an arrowhead
  expectCut({{0.4, 0.4}, {0, 2}, {0, 0}, {2, 0}}, 0.8);                            // the same from another corner
  expectCut({{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}, 7);  // a U
  expectCut({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {0, 1}}, 3);                  // points along a side
  expectCut({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}},
            12);  // a hole on a bridge
  std::vector<Eigen::Vector2d> star;
  for (int i = 0; i < 100; ++i) {
    const double r = i % 2 == 0 ? 1 : 0.3;
    star.emplace_back(r * std::cos(i * 0.0628318530717958648), r * std::sin(i * 0.0628318530717958648));
  }
  expectCut(star, 100 * 0.5 * 0.3 * std::sin(0.0628318530717958648));
}

TEST(Triangulate, AnythingEndsInTimeWithTheRightCount) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(-1, 1);
  for (std::size_t n : {std::size_t(5), std::size_t(17), std::size_t(100), std::size_t(20000)}) {
    std::vector<Eigen::Vector3d> corners(n);
    for (auto& c : corners) c = {number(random), number(random), number(random)};
    std::vector<Triangle> triangles;
    Triangulator().cut(corners, triangles);
    EXPECT_EQ(triangles.size(), n - 2);
    std::fill(corners.begin(), corners.end(), Eigen::Vector3d(1, 1, 1));
    triangles.clear();
    Triangulator().cut(corners, triangles);
    EXPECT_EQ(triangles.size(), n - 2);
  }
}

// What was left behind far away is left out, so that it does not set the size of all else.
class Stray : public ImportTest {
 protected:
  static constexpr const char* kCube =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 "
      "7 6\nf 3 4 8 7\nf 4 1 5 8\n";
  static std::string triangle(double x, double size) {
    std::string text;
    for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {size, 0.0}, {0.0, size}}) {
      text += "v " + std::to_string(x + dx) + " " + std::to_string(dy) + " 0\n";
    }
    return text + "f -3 -2 -1\n";
  }
};

TEST_F(Stray, FacesFarAwayAreLeftOutAndNamed) {
  const auto file = write("a.obj", kCube + triangle(1000, 0.1) + triangle(-3000, 0.05));
  const VisualMesh mesh = importFile(file);
  EXPECT_EQ(mesh.triangles.size(), 12U);
  EXPECT_EQ(mesh.source_vertex_count, 14U);
  EXPECT_EQ(mesh.source_face_count, 8U);
  EXPECT_EQ(mesh.unreferenced.size(), 6U);
  EXPECT_NEAR(mesh.diagonal, std::sqrt(3.0), 1e-12);
  const Finding* finding = findingOf(mesh, "stray-faces");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_EQ(finding->places, (std::vector<std::uint32_t>{6, 7}));
  EXPECT_NE(finding->message.find("1 km from the middle"), std::string::npos) << finding->message;
  EXPECT_EQ(findingOf(mesh, "implausible-size"), nullptr);

  ImportOptions options = testOptions();
  options.keep_stray = true;
  const VisualMesh whole = importFile(file, options);
  EXPECT_EQ(whole.triangles.size(), 14U);
  EXPECT_EQ(findingOf(whole, "stray-faces"), nullptr);
  EXPECT_GT(whole.diagonal, 3999);
}

TEST_F(Stray, WhatIsLargeNearOrReachesOutStays) {
  std::string rope;
  for (int i = 0; i < 100; ++i) rope += triangle(1 + i, 1e-3);
  EXPECT_EQ(importFile(write("large.obj", kCube + triangle(1000, 1))).triangles.size(), 13U);
  EXPECT_EQ(importFile(write("near.obj", kCube + triangle(15, 0.1))).triangles.size(), 13U);
  EXPECT_EQ(importFile(write("rope.obj", kCube + rope)).triangles.size(), 112U);
  EXPECT_EQ(importFile(write("two.obj", triangle(0, 1) + triangle(1000, 1))).triangles.size(), 2U);
}

// A closed ball of rings, its numbered vertices moved to where they do not belong.
std::string ballWithout(const std::vector<std::uint32_t>& flung, double far) {
  constexpr int kRings = 8, kAround = 12;
  std::vector<Eigen::Vector3d> points = {{0, 1, 0}, {0, -1, 0}};
  std::string faces;
  const auto at = [&](int ring, int i) { return std::to_string(3 + ring * kAround + i % kAround); };
  for (int ring = 0; ring < kRings; ++ring)
    for (int i = 0; i < kAround; ++i) {
      const double polar = M_PI * (ring + 1) / (kRings + 1), around = 2 * M_PI * i / kAround;
      points.emplace_back(std::sin(polar) * std::sin(around), std::cos(polar), std::sin(polar) * std::cos(around));
      if (ring == 0) faces += "f 1 " + at(0, i) + " " + at(0, i + 1) + "\n";
      if (ring > 0)
        faces += "f " + at(ring - 1, i) + " " + at(ring, i) + " " + at(ring, i + 1) + " " + at(ring - 1, i + 1) + "\n";
      if (ring == kRings - 1) faces += "f 2 " + at(ring, i + 1) + " " + at(ring, i) + "\n";
    }
  for (const std::uint32_t v : flung) points[v] *= far;
  std::string text = "o Ball\n";
  for (const Eigen::Vector3d& p : points)
    text += "v " + std::to_string(p.x()) + " " + std::to_string(p.y()) + " " + std::to_string(p.z()) + "\n";
  return text + faces;
}

class Flung : public ImportTest {};

TEST_F(Flung, AVertexFarOutIsNamedAndNotTakenForTheUnit) {
  VisualMesh mesh = importFile(write("one.obj", ballWithout({40}, 300)));
  const Finding* finding = findingOf(mesh, "flung-vertices");
  ASSERT_NE(finding, nullptr);
  EXPECT_EQ(finding->severity, Severity::warning);
  EXPECT_EQ(finding->places, std::vector<std::uint32_t>{40});
  EXPECT_NE(finding->message.find("(vertex 40 of Ball)"), std::string::npos) << finding->message;
  EXPECT_NE(finding->message.find(" times further out"), std::string::npos) << finding->message;
  EXPECT_EQ(findingOf(mesh, "implausible-size"), nullptr);
  mesh = importFile(write("two.obj", ballWithout({0, 60}, 1000)));
  ASSERT_NE(findingOf(mesh, "flung-vertices"), nullptr);
  EXPECT_EQ(findingOf(mesh, "flung-vertices")->places, (std::vector<std::uint32_t>{0, 60}));
  ImportOptions options = testOptions();
  options.unit = "0.0001";
  mesh = importFile(write("one.obj", ballWithout({40}, 300)), options);
  EXPECT_NE(findingOf(mesh, "flung-vertices"), nullptr);
  EXPECT_NE(findingOf(mesh, "implausible-size"), nullptr) << "all the others are 0.3 mm across";
}

TEST_F(Flung, WhatReachesOutOnPurposeIsNot) {
  EXPECT_EQ(findingOf(importFile(write("none.obj", ballWithout({}, 1))), "flung-vertices"), nullptr);
  EXPECT_EQ(findingOf(importFile(write("spike.obj", ballWithout({40}, 20))), "flung-vertices"), nullptr);
  EXPECT_EQ(findingOf(importFile(write("wall.obj", ballWithout({40, 41}, 300))), "flung-vertices"), nullptr);
}

}  // namespace
}  // namespace sinew::tools
