// SPDX-License-Identifier: GPL-3.0-or-later
// A wider set of meshes, where it lies beside the checkout: counts and volumes against its manifest.
#include <nlohmann/json.hpp>

#include "tests/import/import_fixture.h"

namespace sinew::tools {
namespace {

using nlohmann::json;

TEST(Sweep, CountsOfTheManifest) {
  const std::filesystem::path data = SINEW_SHARED_DATA;
  if (!std::filesystem::exists(data / "manifest.json")) GTEST_SKIP() << "no wider set of meshes at " << data;
  std::ifstream in(data / "manifest.json");
  const json manifest = json::parse(in);
  for (const json& entry : manifest) {
    const std::string name = entry["file"];
    SCOPED_TRACE(name);
    ImportOptions options = testOptions();
    options.weld_tolerance = 0;
    options.crease_degrees = 60;
    if (name.ends_with(".fbx")) options.unit = "1";  // the manifest has the file's own units
    const VisualMesh mesh = importFile(data / name, options);
    const std::size_t unreferenced = entry["unreferenced"];
    EXPECT_EQ(mesh.source_vertex_count, entry["vertices"].get<std::size_t>());
    EXPECT_EQ(mesh.welded_positions.size() + unreferenced, entry["welded_vertices"].get<std::size_t>());
    EXPECT_EQ(mesh.unreferenced.size(), unreferenced);
    EXPECT_EQ(mesh.source_face_count, entry["polys"].get<std::size_t>());
    EXPECT_EQ(mesh.triangles.size(), entry["tris"].get<std::size_t>());
    EXPECT_NEAR(mesh.diagonal, entry["diag"].get<double>(), 1e-5 * mesh.diagonal);
    if (entry["watertight"].get<bool>() && entry["ngon"] == 0) {
      const double volume = std::abs(entry["volume"].get<double>());
      EXPECT_NEAR(volumeOf(mesh), volume, 1e-4 * volume);
    }
    EXPECT_EQ(mesh.materials.size(), entry["materials"].get<std::size_t>());
    EXPECT_EQ(!mesh.uvs.empty(), entry["uv"].get<bool>());
    EXPECT_EQ(mesh.had_normals, entry["normals"].get<bool>());
    EXPECT_EQ(!mesh.colors.empty(), entry["vcol"].get<bool>());
    if (!entry["skin"].is_null()) {
      EXPECT_EQ(mesh.joints.size(), entry["skin"]["bones"].get<std::size_t>());
    }
    if (mesh.format == "obj") {
      EXPECT_EQ(mesh.groups.size(), entry["groups"].get<std::size_t>());
    }
  }
}

}  // namespace
}  // namespace sinew::tools
