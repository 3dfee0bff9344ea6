// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/defect_picture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "tests/support/obj_reader.h"
#include "tools/render/image.h"

namespace sinew::tools {
namespace {

// Pixels of about a colour.
std::size_t count(const Image& image, Rgb8 color, int y0, int y1) {
  std::size_t n = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int most = 0;
      for (std::size_t k = 0; k < 3; ++k)
        most = std::max(most, std::abs(static_cast<int>(image.at(x, y)[k]) - static_cast<int>(color[k])));
      n += most < 40 ? 1 : 0;
    }
  }
  return n;
}

TEST(DefectPicture, MarksThePlacesOfTheFindings) {
  const VisualMesh mesh = testing::readObj(std::string(SINEW_TEST_ASSETS) + "/generated/bad_hole.obj");
  const std::filesystem::path file =
      std::filesystem::path(::testing::TempDir()) / ("sinew_defects_" + std::to_string(::getpid()) + ".png");
  constexpr Rgb8 kFirst = {213, 40, 24};
  constexpr int kViewsTop = 82;
  constexpr int kViewsEnd = 82 + 340;

  renderDefects(mesh, {}, file);
  const Image clean = readImage(file);
  EXPECT_EQ(count(clean, kFirst, 0, clean.height), 0U);

  Finding faces;
  faces.id = "some-faces";
  faces.message = "three faces";
  faces.count = 3;
  faces.place_kind = "face";
  faces.places = {0, 1, 2, 3, 4, 5, 6, 7};
  renderDefects(mesh, {faces}, file);
  const Image with_faces = readImage(file);
  EXPECT_GT(count(with_faces, kFirst, kViewsTop, kViewsEnd), 200U);
  EXPECT_GT(with_faces.height, clean.height);  // a close-up

  Finding vertices = faces;
  vertices.id = "a-vertex";
  vertices.place_kind = "vertex";
  vertices.places = {5};
  renderDefects(mesh, {vertices}, file);
  EXPECT_GT(count(readImage(file), kFirst, kViewsTop, kViewsEnd), 15U);

  Finding nowhere = faces;  // places that do not exist, or none at all, are no reason to fail
  nowhere.places = {4000000000U};
  Finding placeless;
  placeless.id = "units";
  placeless.severity = Severity::info;
  renderDefects(mesh, {nowhere, placeless}, file);
  EXPECT_EQ(count(readImage(file), kFirst, kViewsTop, kViewsEnd), 0U);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace sinew::tools
