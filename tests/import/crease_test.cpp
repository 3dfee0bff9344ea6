// SPDX-License-Identifier: GPL-3.0-or-later
#include <numbers>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

class Crease : public ImportTest {
 protected:
  static VisualMesh read(const std::filesystem::path& file, double degrees) {
    ImportOptions options = testOptions();
    options.crease_degrees = degrees;
    return importFile(file, options);
  }
  static VisualMesh generated(const char* name, double degrees = 60) {
    return read(kAssets / "generated" / name, degrees);
  }
  // Largest angle, degrees, between the normal of a corner and that of its face.
  static double worstAngle(const VisualMesh& mesh) {
    double least = 1;
    for (const Triangle& t : mesh.triangles) {
      const Eigen::Vector3d& a = mesh.positions[t[0]];
      const Eigen::Vector3d n = (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).normalized();
      for (const std::uint32_t v : t) least = std::min(least, n.dot(mesh.normals[v].cast<double>()));
    }
    return std::acos(std::min(least, 1.0)) * 180 / std::numbers::pi;
  }
};

TEST_F(Crease, ACubeIsLitFlatAndABallSmooth) {
  const VisualMesh cube = generated("cube.obj");
  EXPECT_EQ(cube.positions.size(), 24U);
  EXPECT_EQ(cube.welded_positions.size(), 8U);
  EXPECT_LT(worstAngle(cube), 1e-3);
  EXPECT_TRUE(std::is_sorted(cube.source_vertex.begin(), cube.source_vertex.end()));
  EXPECT_EQ(generated("cube.obj", 180).positions.size(), 8U);
  EXPECT_EQ(generated("sphere.obj").positions.size(), 266U);
  EXPECT_EQ(generated("sphere.obj", 1).positions.size(), 288U * 4 - 24 * 2);  // quads and two fans of triangles
}

TEST_F(Crease, NormalsOfTheSourceStay) {
  const auto file = write("wedge.obj",
                          "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvn 1 0 0\n"
                          "f 1//1 3//1 2//1\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const VisualMesh mesh = read(file, 60);
  // Vertices 0 to 2 with the given normal, and three corners each of the other faces but for those they share.
  const auto given = std::count_if(mesh.normals.begin(), mesh.normals.end(),
                                   [](const Eigen::Vector3f& n) { return n == Eigen::Vector3f(0, 0, 1); });
  EXPECT_EQ(given, 3);
  EXPECT_EQ(mesh.positions.size(), 3U + 9U);
}

// A fold that ends within a surface parts its normals at its border only.
TEST_F(Crease, ALoneSharpEdgeSplitsOnlyAtTheBorder) {
  // Five triangles about (1, 0, 1); those at the edge from there to (1, 0, 2) rise to both sides, 70 degrees apart.
  const auto file = write("dart.obj",
                          "v 0 0 0\nv 2 0 0\nv 1 0 1\nv 2 0.7 1.5\nv 0 0.7 1.5\nv 1 0 2\n"
                          "f 1 3 2\nf 2 3 4\nf 4 3 6\nf 6 3 5\nf 5 3 1\n");
  const VisualMesh mesh = read(file, 60);
  std::vector<int> copies(mesh.source_vertex_count, 0);
  for (const std::uint32_t v : mesh.source_vertex) ++copies[v];
  EXPECT_EQ(copies, (std::vector<int>{1, 1, 1, 1, 1, 2}));
}

TEST_F(Crease, SidesOfASheetGivenTwiceAreLitEachForItself) {
  const auto file = write("sheet.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 4 3 2 1\n");
  const VisualMesh mesh = read(file, 60);
  EXPECT_EQ(mesh.positions.size(), 8U);
  EXPECT_LT(worstAngle(mesh), 1e-3);
}

}  // namespace
}  // namespace sinew::tools
