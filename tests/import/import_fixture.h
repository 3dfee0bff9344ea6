// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "tools/core/error.h"
#include "tools/import/import.h"

namespace sinew::tools {

inline const std::filesystem::path kAssets = SINEW_TEST_ASSETS;
inline const std::filesystem::path kSamples = SINEW_SAMPLE_ASSETS;

/// A folder of its own for each test, removed after it.
class ImportTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() / ("sinew_import_" + std::string(info->test_suite_name()) + "_" +
                                                        info->name() + "_" + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& name, const std::string& content) const {
    const std::filesystem::path file = folder_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << content;
    return file;
  }
  std::filesystem::path folder_;
};

/// Vertices are as the file has them: computed normals split none (crease_test.cpp has them split).
inline ImportOptions testOptions() {
  ImportOptions options;
  options.worker = SINEW_TEST_IMPORT_WORKER;
  options.crease_degrees = 180;
  return options;
}

inline const Finding* findingOf(const VisualMesh& mesh, const std::string& id) {
  const auto at =
      std::find_if(mesh.findings.begin(), mesh.findings.end(), [&](const Finding& f) { return f.id == id; });
  return at == mesh.findings.end() ? nullptr : &*at;
}

inline const GroupSource* groupOf(const VisualMesh& mesh, const std::string& name) {
  const auto at =
      std::find_if(mesh.groups.begin(), mesh.groups.end(), [&](const GroupSource& g) { return g.name == name; });
  return at == mesh.groups.end() ? nullptr : &*at;
}

inline const AttributeSource* attributeOf(const VisualMesh& mesh, const std::string& name) {
  const auto at = std::find_if(mesh.attributes.begin(), mesh.attributes.end(),
                               [&](const AttributeSource& a) { return a.name == name; });
  return at == mesh.attributes.end() ? nullptr : &*at;
}

/// Divergence theorem about the bounds' centre.
inline double volumeOf(const VisualMesh& mesh) {
  const Eigen::Vector3d centre = (mesh.bounds_min + mesh.bounds_max) / 2;
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    sum += (mesh.positions[t[0]] - centre).dot((mesh.positions[t[1]] - centre).cross(mesh.positions[t[2]] - centre));
  return sum / 6;
}

inline double areaOf(const VisualMesh& mesh) {
  double sum = 0;
  for (const Triangle& t : mesh.triangles)
    sum += (mesh.positions[t[1]] - mesh.positions[t[0]]).cross(mesh.positions[t[2]] - mesh.positions[t[0]]).norm();
  return sum / 2;
}

/// What holds for every mesh that import returns.
inline void checkInvariants(const VisualMesh& mesh) {
  const std::size_t n = mesh.positions.size();
  ASSERT_GT(n, 0U);
  ASSERT_FALSE(mesh.triangles.empty());
  ASSERT_EQ(mesh.normals.size(), n);
  ASSERT_TRUE(mesh.uvs.empty() || mesh.uvs.size() == n);
  ASSERT_TRUE(mesh.colors.empty() || mesh.colors.size() == n);
  ASSERT_TRUE(mesh.skin.empty() || mesh.skin.size() == n);
  ASSERT_EQ(mesh.source_vertex.size(), n);
  ASSERT_EQ(mesh.welded.size(), n);
  ASSERT_EQ(mesh.triangle_face.size(), mesh.triangles.size());
  Eigen::AlignedBox3d box;
  std::vector<bool> used(n, false);
  for (const Triangle& t : mesh.triangles)
    for (std::uint32_t v : t) {
      ASSERT_LT(v, n);
      used[v] = true;
      box.extend(mesh.positions[v]);
    }
  EXPECT_TRUE(std::all_of(used.begin(), used.end(), [](bool u) { return u; })) << "a visual vertex that no face uses";
  EXPECT_EQ(box.min(), mesh.bounds_min);
  EXPECT_EQ(box.max(), mesh.bounds_max);
  std::vector<std::uint8_t> source_seen(mesh.source_vertex_count, 0);
  for (std::size_t v = 0; v < n; ++v) {
    ASSERT_TRUE(mesh.positions[v].allFinite());
    ASSERT_NEAR(double(mesh.normals[v].norm()), 1.0, 1e-5);
    ASSERT_LT(mesh.source_vertex[v], mesh.source_vertex_count);
    source_seen[mesh.source_vertex[v]] = 1;
    ASSERT_LT(mesh.welded[v], mesh.welded_positions.size());
    ASSERT_LE((mesh.welded_positions[mesh.welded[v]] - mesh.positions[v]).norm(), mesh.weld_tolerance * (1 + 1e-9));
  }
  // No source vertex is lost: each is a visual vertex or listed as unreferenced, never both.
  ASSERT_TRUE(std::is_sorted(mesh.unreferenced.begin(), mesh.unreferenced.end()));
  for (std::uint32_t v : mesh.unreferenced) {
    ASSERT_LT(v, mesh.source_vertex_count);
    ASSERT_EQ(source_seen[v], 0);
    source_seen[v] = 1;
  }
  EXPECT_EQ(std::count(source_seen.begin(), source_seen.end(), 1), std::int64_t(mesh.source_vertex_count));
  std::uint32_t covered = 0;
  for (const SourceMeshRange& range : mesh.source_meshes) {
    EXPECT_EQ(range.first_source_vertex, covered);
    covered += range.source_vertex_count;
  }
  EXPECT_EQ(covered, mesh.source_vertex_count);
  std::uint32_t next = 0;
  for (const SubMeshSource& sub : mesh.sub_meshes) {
    EXPECT_EQ(sub.first_triangle, next);
    next += sub.triangle_count;
    EXPECT_TRUE(sub.material == formats::kNone || sub.material < mesh.materials.size());
  }
  EXPECT_EQ(next, mesh.triangles.size());
  for (std::uint32_t f : mesh.triangle_face) ASSERT_LT(f, mesh.source_face_count);
  for (const auto& influences : mesh.skin) {
    if (influences.empty()) continue;
    double sum = 0;
    for (const SkinInfluence& i : influences) {
      ASSERT_LT(i.joint, mesh.joints.size());
      ASSERT_GT(i.weight, 0.0F);
      sum += double(i.weight);
    }
    ASSERT_NEAR(sum, 1.0, 1e-5);
  }
  for (const GroupSource& group : mesh.groups) {
    ASSERT_FALSE(group.triangles.empty());
    ASSERT_TRUE(std::is_sorted(group.triangles.begin(), group.triangles.end()));
    ASSERT_TRUE(std::is_sorted(group.vertices.begin(), group.vertices.end()));
    ASSERT_LT(group.triangles.back(), mesh.triangles.size());
    ASSERT_LT(group.vertices.back(), n);
  }
  for (const AttributeSource& attribute : mesh.attributes) ASSERT_EQ(attribute.values.size(), n * attribute.components);
  for (const MaterialSource& m : mesh.materials)
    ASSERT_TRUE(m.texture == formats::kNone || m.texture < mesh.textures.size());
  for (const Finding& f : mesh.findings) {
    EXPECT_LE(f.places.size(), Finding::kMaxPlaces);
    EXPECT_GT(f.count, 0U) << f.id;
  }
}

inline VisualMesh importFile(const std::filesystem::path& file, const ImportOptions& options = testOptions()) {
  Progress progress(false);
  VisualMesh mesh = importVisualMesh(file, options, progress);
  checkInvariants(mesh);
  return mesh;
}

/// The message with which a file is refused as bad input; fails the test where it is not.
inline std::string refusal(const std::filesystem::path& file, const ImportOptions& options = testOptions(),
                           ExitCode code = ExitCode::bad_input) {
  Progress progress(false);
  try {
    importVisualMesh(file, options, progress);
  } catch (const ToolError& error) {
    EXPECT_EQ(int(error.code()), int(code)) << error.what();
    const std::string text = error.what();
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    EXPECT_TRUE(text.ends_with('.')) << text;
    return text;
  }
  ADD_FAILURE() << file << " was not refused";
  return "";
}

inline void expectRefusal(const std::filesystem::path& file, const std::string& part,
                          const ImportOptions& options = testOptions()) {
  const std::string text = refusal(file, options);
  EXPECT_NE(text.find(part), std::string::npos) << "\"" << text << "\" does not say \"" << part << "\"";
  EXPECT_TRUE(text.starts_with(file.string() + ": ")) << text;
}

}  // namespace sinew::tools
