// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/stage_cache.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "tests/bake/box_mesh.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

class StageCacheTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("sinew_stages_" + std::to_string(getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::uint64_t bytes() const {
    std::uint64_t sum = 0;
    for (const auto& entry : fs::directory_iterator(folder_)) sum += entry.file_size();
    return sum;
  }
  fs::path folder_;
};

PhysicalMesh someMesh() {
  PhysicalMesh mesh = latticeMesh({2, 3, 4}, 0.5);
  mesh.pieces[0].method = TetrahedraMethod::stuffing;
  mesh.pieces[0].parts = {3, 1};
  mesh.pieces[0].source_volume = 2.5;
  mesh.quality = {10, 120, 0};
  mesh.part_piece = {0, 0, 0, 0};
  mesh.home = {5, formats::kNone};
  Finding finding;
  finding.id = "thin";
  finding.severity = Severity::info;
  finding.message = "a message";
  finding.count = 7;
  finding.place_kind = "face";
  finding.places = {1, 2};
  finding.place = "there";
  finding.cure = "do";
  mesh.findings = {finding};
  return mesh;
}

TEST_F(StageCacheTest, AStageComesBackAsItWas) {
  PhysicalMesh mesh = someMesh();
  StageCache first(folder_);
  first.get("tetrahedra", {1, 2}, [&] { return mesh; });
  StageCache second(folder_);
  const PhysicalMesh back = second.get("tetrahedra", {1, 2}, [] {
    ADD_FAILURE() << "made again";
    return PhysicalMesh{};
  });
  ASSERT_EQ(second.stages().size(), 1U);
  EXPECT_TRUE(second.stages()[0].from_cache);
  EXPECT_EQ(back.positions, mesh.positions);
  EXPECT_EQ(back.tetrahedra, mesh.tetrahedra);
  EXPECT_EQ(back.fill, mesh.fill);
  EXPECT_EQ(back.part_piece, mesh.part_piece);
  EXPECT_EQ(back.home, mesh.home);
  EXPECT_EQ(back.quality.max_dihedral_deg, 120);
  ASSERT_EQ(back.pieces.size(), 1U);
  EXPECT_EQ(back.pieces[0].name, "lattice");
  EXPECT_EQ(back.pieces[0].method, TetrahedraMethod::stuffing);
  EXPECT_EQ(back.pieces[0].parts, mesh.pieces[0].parts);
  EXPECT_EQ(back.pieces[0].source_volume, 2.5);
  ASSERT_EQ(back.findings.size(), 1U);
  EXPECT_EQ(back.findings[0].severity, Severity::info);
  EXPECT_EQ(back.findings[0].places, mesh.findings[0].places);
  EXPECT_EQ(back.findings[0].cure, "do");
}

TEST_F(StageCacheTest, WhatWasNotUsedForLongestGoesFirst) {
  PhysicalMesh mesh = someMesh();
  {
    StageCache cache(folder_);
    cache.get("tetrahedra", {0, 0}, [&] { return mesh; });
  }
  const std::uint64_t one = bytes();
  const std::uint64_t most = one * 4 + one / 2;
  for (std::uint64_t i = 1; i <= 10; ++i) {
    StageCache cache(folder_, most);
    cache.get("tetrahedra", {i, 0}, [&] { return mesh; });
    EXPECT_LE(bytes(), most);
    // The first is asked for again and again: it stays.
    StageCache again(folder_, most);
    again.get("tetrahedra", {0, 0}, [&] { return mesh; });
    EXPECT_TRUE(again.stages()[0].from_cache) << i;
  }
  StageCache late(folder_, most);
  late.get("tetrahedra", {2, 0}, [&] { return mesh; });
  EXPECT_FALSE(late.stages()[0].from_cache);
}

TEST_F(StageCacheTest, TheKeyCountsWhatTheStageReadsAndNothingElse) {
  VisualMesh mesh;
  mesh.positions = mesh.welded_positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.welded = {0, 1, 2};
  mesh.triangles = {{0, 1, 2}};
  mesh.triangle_face = {0};
  mesh.sub_meshes = {{"node", "mesh", 0, 0, 1}};
  mesh.diagonal = 1;
  const TetrahedraOptions options;
  const StageKey key = tetrahedraKey(mesh, options);
  EXPECT_EQ(key, tetrahedraKey(mesh, options));
  {
    VisualMesh other = mesh;
    other.file = "elsewhere.obj";
    other.uvs = {{0, 0}, {1, 0}, {0, 1}};
    other.colors.resize(3);
    other.groups.push_back({"g", {0}, {}});
    EXPECT_EQ(key, tetrahedraKey(other, options));
  }
  const auto differs = [&](const std::function<void(VisualMesh&, TetrahedraOptions&)>& change) {
    VisualMesh other = mesh;
    TetrahedraOptions set = options;
    change(other, set);
    EXPECT_NE(key, tetrahedraKey(other, set));
  };
  differs([](VisualMesh& m, TetrahedraOptions&) { m.positions[1][2] = -0.0; });
  differs([](VisualMesh& m, TetrahedraOptions&) { m.welded_positions[2][1] = 1.5; });
  differs([](VisualMesh& m, TetrahedraOptions&) { m.triangles = {{0, 2, 1}}; });
  differs([](VisualMesh& m, TetrahedraOptions&) { m.sub_meshes[0].node = "other"; });
  differs([](VisualMesh& m, TetrahedraOptions&) { m.weld_tolerance = 1e-9; });
  differs([](VisualMesh& m, TetrahedraOptions&) { m.diagonal = 2; });
  differs([](VisualMesh&, TetrahedraOptions& o) { o.target_vertices = 1501; });
  differs([](VisualMesh&, TetrahedraOptions& o) { o.method = TetrahedraMethod::grid; });
  differs([](VisualMesh&, TetrahedraOptions& o) { o.join_distance = 2e-3; });
  differs([](VisualMesh&, TetrahedraOptions& o) { o.shell_thickness = 0.1; });
  differs([](VisualMesh&, TetrahedraOptions& o) { o.shell_factors = {1, 2, 1}; });
}

}  // namespace
}  // namespace sinew::tools
