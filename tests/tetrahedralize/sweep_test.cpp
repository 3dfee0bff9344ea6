// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every readable OBJ of the bundled assets, and of a wider set of meshes where that is present.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <set>
#include <string>

#include "tests/support/obj_reader.h"
#include "tests/tetrahedralize/check.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

std::vector<std::filesystem::path> filesIn(const std::filesystem::path& root) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
    const auto& path = entry.path();
    if (path.extension() != ".obj" || path.parent_path().filename() == "bad_input") continue;
    if (path.filename() != "bad_nan.obj") files.push_back(path);
  }
  std::sort(files.begin(), files.end());
  return files;
}

void sweep(const std::vector<std::filesystem::path>& files) {
  for (const auto& file : files) {
    const VisualMesh mesh = testing::readObj(file);
    for (const TetrahedraMethod method : {TetrahedraMethod::automatic, TetrahedraMethod::grid}) {
      const std::string what = file.filename().string() + " " + testing::name(method);
      const PhysicalMesh physical = testing::fill(mesh, method, 1000);
      testing::checkPhysicalMesh(physical, what);
      EXPECT_NEAR(double(physical.positions.size()), 1000, 300) << what;
    }
  }
}

TEST(TetrahedralizeSweep, BundledMeshes) {
  const auto files = filesIn(SINEW_TEST_ASSETS);
  EXPECT_GT(files.size(), 20U);
  sweep(files);
}

TEST(TetrahedralizeSweep, WiderSetOfMeshes) {
  if (!std::filesystem::is_directory(SINEW_SHARED_DATA)) {
    std::cout << "no " << SINEW_SHARED_DATA << ": nothing swept\n";
    return;
  }
  std::set<std::string> bundled;
  for (const auto& file : filesIn(SINEW_TEST_ASSETS)) bundled.insert(file.filename().string());
  auto files = filesIn(SINEW_SHARED_DATA);
  std::erase_if(files, [&](const auto& file) { return bundled.contains(file.filename().string()); });
  sweep(files);
}

}  // namespace
}  // namespace sinew::tools
