// SPDX-License-Identifier: GPL-3.0-or-later
//
// Contact sheets and videos of a box package, and what they leave on disk.
#include "tools/render/picture.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tests/support/box_package.h"
#include "tools/core/error.h"
#include "tools/render/headless.h"
#include "tools/render/video.h"

namespace sinew::tools {
namespace {

std::shared_ptr<const Asset> asset() {
  test::BoxOptions options;
  options.clusters = {2, 2, 2};
  return test::boxAsset(options);
}

class Folder {
 public:
  Folder() : path_(std::filesystem::path(::testing::TempDir()) / ("sinew_picture_" + std::to_string(::getpid()))) {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::filesystem::path operator/(const char* name) const { return path_ / name; }
  std::size_t files() const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(path_), std::filesystem::directory_iterator()));
  }

 private:
  std::filesystem::path path_;
};

std::size_t changed(const Image& a, const Image& b, int threshold) {
  std::size_t count = 0;
  for (std::size_t i = 0; i < a.rgb.size(); i += 3) {
    int most = 0;
    for (std::size_t k = 0; k < 3; ++k)
      most = std::max(most, std::abs(static_cast<int>(a.rgb[i + k]) - static_cast<int>(b.rgb[i + k])));
    count += most > threshold ? 1 : 0;
  }
  return count;
}

PictureOptions smallSheet() {
  PictureOptions options;
  options.scenes = {SceneKind::drop};
  options.frames = 3;
  options.seconds = 0.5;
  options.width = 120;
  options.height = 100;
  options.overlay = OverlayName::none;
  return options;
}

TEST(ContactSheet, HasARowPerSceneAndSaysSo) {
  const HeadlessContext context;
  PictureOptions options = smallSheet();
  const Image one = renderContactSheet(asset(), "box", options, {});
  options.scenes = {SceneKind::drop, SceneKind::squash};
  const Image two = renderContactSheet(asset(), "box", options, {});
  EXPECT_EQ(one.width, 2 * 20 + 3 * 120 + 2 * 6);
  EXPECT_EQ(one.width, two.width);
  EXPECT_EQ(two.height - one.height, 100 + 22 + 6);  // a picture, its label, the gap
  options.columns = 2;                               // three pictures wrap into two lines a scene
  const Image wrapped = renderContactSheet(asset(), "box", options, {});
  EXPECT_EQ(wrapped.width, 2 * 20 + 2 * 120 + 6);
  EXPECT_EQ(wrapped.height - two.height, 2 * (100 + 22 + 6));
  // Ink in the title and in the first label.
  const auto dark = [&](int x0, int y0, int x1, int y1) {
    int count = 0;
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) count += one.at(x, y)[0] < 120 ? 1 : 0;
    }
    return count;
  };
  EXPECT_GT(dark(20, 10, 120, 48), 50);
  EXPECT_GT(dark(20, 82, 140, 104), 30);
}

TEST(ContactSheet, CameraLightAndBackgroundAreAsAsked) {
  const HeadlessContext context;
  PictureOptions options = smallSheet();
  options.scenes = {SceneKind::rest};
  options.frames = 2;
  options.camera = Direction{0.3F, 0.2F};
  options.background = std::array{Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 0, 1)};
  const auto draw = [&] { return renderContactSheet(asset(), "box", options, {}); };
  const Image plain = draw();
  // The first picture: red above, blue below.
  const auto pixel = [&](int x, int y) {
    return &plain.rgb[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(plain.width) +
                           static_cast<std::size_t>(x))];
  };
  const std::uint8_t* top = pixel(20 + 3, 20 + 62 + 22 + 3);
  const std::uint8_t* bottom = pixel(20 + 3, 20 + 62 + 22 + 96);
  EXPECT_GT(top[0], 240);
  EXPECT_LT(top[2], 60);
  EXPECT_GT(bottom[2], 240);
  EXPECT_LT(bottom[0], 60);
  // Nothing moves and the camera stands: both pictures are the same; on a turntable they are not.
  const auto halves = [&](const Image& sheet) {
    std::size_t differ = 0;
    for (int y = 20 + 62 + 22; y < 20 + 62 + 22 + 100; ++y) {
      for (int x = 20; x < 20 + 120; ++x) {
        const std::size_t a =
            3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(sheet.width) + static_cast<std::size_t>(x));
        differ += std::abs(static_cast<int>(sheet.rgb[a]) - static_cast<int>(sheet.rgb[a + 3 * 126])) > 8 ? 1U : 0U;
      }
    }
    return differ;
  };
  EXPECT_EQ(halves(plain), 0U);
  options.camera = Direction{0.9F, 0.2F};
  EXPECT_GT(changed(plain, draw(), 8), 100U);
  options.camera = Direction{0.3F, 0.2F};
  options.light = Direction{-1.2F, 0.3F};
  EXPECT_GT(changed(plain, draw(), 8), 100U);
  options.light.reset();
  options.turntable = true;
  options.frames = 3;
  EXPECT_GT(halves(draw()), 50U);
}

TEST(ContactSheet, IsTheSameEachTime) {
  const HeadlessContext context;
  EXPECT_EQ(renderContactSheet(asset(), "box", smallSheet(), {}).rgb,
            renderContactSheet(asset(), "box", smallSheet(), {}).rgb);
}

TEST(ContactSheet, OverlaysAndViewsChangeThePicture) {
  const HeadlessContext context;
  PictureOptions options = smallSheet();
  const Image plain = renderContactSheet(asset(), "box", options, {});
  for (const OverlayName overlay : {OverlayName::physical, OverlayName::clusters, OverlayName::all}) {
    options.overlay = overlay;
    EXPECT_GT(changed(plain, renderContactSheet(asset(), "box", options, {}), 20), 500U)
        << overlayNames()[static_cast<std::size_t>(overlay)];
  }
  options = smallSheet();
  options.view = ViewName::top;
  EXPECT_GT(changed(plain, renderContactSheet(asset(), "box", options, {}), 20), 500U);
}

TEST(ContactSheet, BodyIsInEveryPictureOfTheMotion) {
  const HeadlessContext context;
  PictureOptions options = smallSheet();
  options.frames = 5;
  options.seconds = 1.5;
  const Image sheet = renderContactSheet(asset(), "box", options, {});
  for (int k = 0; k < 5; ++k) {
    // The body is clearly darker or warmer than the background somewhere, and never touches the picture's edge: the
    // outermost ring of pixels is background (smooth along each row).
    const int x0 = 20 + k * 126;
    const int y0 = 20 + 62 + 22;
    int steps = 0;
    for (int x = x0 + 1; x < x0 + 120; ++x)
      steps += std::abs(static_cast<int>(sheet.at(x, y0 + 1)[0]) - static_cast<int>(sheet.at(x - 1, y0 + 1)[0])) > 12
                   ? 1
                   : 0;
    EXPECT_EQ(steps, 0) << "top edge of picture " << k;
    int inside = 0;
    for (int y = y0; y < y0 + 100; ++y) {
      for (int x = x0; x < x0 + 120; ++x) {
        const Rgb8 c = sheet.at(x, y);
        inside +=
            static_cast<int>(c[0]) >= static_cast<int>(c[2]) ? 1 : 0;  // clay is warm, background and shadow are cool
      }
    }
    EXPECT_GT(inside, 250) << "picture " << k;
  }
}

TEST(Png, IsWrittenWholeOrNotAtAll) {
  const Folder folder;
  Image image(31, 17, {1, 2, 3});
  image.fillRectangle(3, 4, 5, 6, {200, 100, 50});
  writePng(image, folder / "a.png");
  writePng(image, folder / "a.png");  // over itself
  const Image back = readImage(folder / "a.png");
  EXPECT_EQ(back.width, 31);
  EXPECT_EQ(back.rgb, image.rgb);
  EXPECT_EQ(folder.files(), 1U);
  EXPECT_THROW(writePng(image, folder / "missing/a.png"), ToolError);
  EXPECT_EQ(folder.files(), 1U);
}

TEST(Video, ReadsBackWithEveryFrame) {
  const HeadlessContext context;
  const Folder folder;
  PictureOptions options;
  options.scenes = {SceneKind::drop};
  options.frames = 20;
  options.width = 160;
  options.height = 120;
  renderVideo(asset(), "box", options, folder / "a.mp4", {});
  EXPECT_EQ(folder.files(), 1U);
  const std::vector<Image> frames = readVideo(folder / "a.mp4");
  ASSERT_EQ(frames.size(), 20U);
  for (const Image& frame : frames) {
    EXPECT_EQ(frame.width, 160);
    EXPECT_EQ(frame.height, 120);
  }
  EXPECT_GT(changed(frames.front(), frames.back(), 40), 100U);  // it fell
  // H.264: the sample description box says avc1.
  std::ifstream stream(folder / "a.mp4", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  EXPECT_NE(bytes.find("avc1"), std::string::npos);
}

TEST(Video, LeavesNothingBehindWhereItFails) {
  const Folder folder;
  EXPECT_THROW(VideoFile(folder / "missing/a.mp4", 64, 64, 30), ToolError);
  {
    VideoFile abandoned(folder / "a.mp4", 64, 64, 30);
    abandoned.add(Image(64, 64, {9, 9, 9}));
  }
  EXPECT_EQ(folder.files(), 0U);
}

}  // namespace
}  // namespace sinew::tools
