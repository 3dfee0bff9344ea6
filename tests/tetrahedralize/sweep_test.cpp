// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every readable OBJ of the bundled assets, and of a wider set of meshes where that is present.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iostream>

#include "tests/support/obj_reader.h"
#include "tests/tetrahedralize/check.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

void sweep(const std::filesystem::path& root) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
    const auto& path = entry.path();
    if (path.extension() != ".obj" || path.parent_path().filename() == "bad_input") continue;
    if (path.filename() != "bad_nan.obj") files.push_back(path);
  }
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty()) << root;
  for (const auto& file : files) {
    const VisualMesh mesh = testing::readObj(file);
    for (const TetrahedraMethod method : {TetrahedraMethod::automatic, TetrahedraMethod::grid}) {
      const std::string what = file.filename().string() + " " + testing::name(method);
      const PhysicalMesh physical = testing::fill(mesh, method, 1000);
      testing::checkPhysicalMesh(physical, what);
      EXPECT_NEAR(double(physical.positions.size()), 1000, 300) << what;
      double source = 0;
      for (const auto& body : physical.bodies) source += std::max(body.source_volume, 0.0);
      if (source > 0) {
        EXPECT_NEAR(testing::filledVolume(physical) / source, 1, 0.12) << what;
      }
    }
  }
}

TEST(TetrahedralizeSweep, BundledMeshes) { sweep(SINEW_TEST_ASSETS); }

TEST(TetrahedralizeSweep, WiderSetOfMeshes) {
  if (!std::filesystem::is_directory(SINEW_SHARED_DATA)) {
    std::cout << "no " << SINEW_SHARED_DATA << ": nothing swept\n";
    return;
  }
  sweep(SINEW_SHARED_DATA);
}

}  // namespace
}  // namespace sinew::tools
