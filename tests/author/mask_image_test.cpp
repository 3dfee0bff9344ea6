// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/mask_image.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

class MaskFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(testing::TempDir()) /
              (std::string("sinew_mask_") + testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path save(const cv::Mat& image, const char* name) {
    auto file = folder_ / name;
    cv::imwrite(file.string(), image);
    return file;
  }
  std::filesystem::path folder_;
};

TEST_F(MaskFile, ReadsDepthsAndChannels) {
  cv::Mat color(4, 4, CV_8UC3, cv::Scalar(51, 102, 204));  // blue, green, red
  const auto file = save(color, "c.png");
  const auto value = [&](const char* channel) { return readMaskImage(file, {.channel = channel}).values[5]; };
  EXPECT_NEAR(value("r"), 0.8, 1e-6);
  EXPECT_NEAR(value("g"), 0.4, 1e-6);
  EXPECT_NEAR(value("b"), 0.2, 1e-6);
  EXPECT_NEAR(value("luminance"), 0.2126 * 0.8 + 0.7152 * 0.4 + 0.0722 * 0.2, 1e-6);
  EXPECT_THROW(value("a"), ToolError);
  EXPECT_NEAR(readMaskImage(save(cv::Mat(2, 2, CV_16UC1, cv::Scalar(13107)), "d.png"), {}).values[0], 0.2, 1e-6);
  EXPECT_NEAR(readMaskImage(save(cv::Mat(2, 2, CV_32FC1, cv::Scalar(0.375)), "e.exr"), {}).values[0], 0.375, 1e-6);
  EXPECT_EQ(readMaskImage(file, {.key = {{0.8, 0.4, 0.2}}, .tolerance = 0.01}).values[0], 1);
  EXPECT_EQ(readMaskImage(file, {.key = {{0.4, 0.4, 0.2}}, .tolerance = 0.3}).values[0], 0);
  EXPECT_THROW(readMaskImage(folder_ / "none.png", {}), ToolError);
}

TEST_F(MaskFile, ReadsTheKindsOfTextures) {
  // Two texels of true colour: red, and a fifth of it.
  std::ofstream(folder_ / "m.tga", std::ios::binary)
      << std::string("\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x18\0\0\0\xff\0\0\x33", 24);
  const MaskImage mask = readMaskImage(folder_ / "m.tga", {.channel = "r"});
  ASSERT_EQ(mask.values.size(), 2U);
  EXPECT_NEAR(mask.values[0], 1, 1e-6);
  EXPECT_NEAR(mask.values[1], 0.2, 1e-6);
}

TEST_F(MaskFile, ClosesHolesRemovesSpecksAndFeathers) {
  cv::Mat image(64, 64, CV_8UC1, cv::Scalar(0));
  image(cv::Rect(20, 20, 24, 24)).setTo(255);
  image.at<std::uint8_t>(30, 30) = 0;      // a hole
  image(cv::Rect(5, 5, 2, 2)).setTo(255);  // a speck
  const auto file = save(image, "m.png");
  const auto at = [](const MaskImage& mask, std::size_t x, std::size_t y) { return mask.values[y * 64 + x]; };
  const MaskImage plain = readMaskImage(file, {.threshold = 0.5});
  EXPECT_EQ(at(plain, 30, 30), 0);
  EXPECT_EQ(at(plain, 5, 5), 1);
  const MaskImage clean = readMaskImage(file, {.threshold = 0.5, .close = 2, .specks = 10});
  EXPECT_EQ(at(clean, 30, 30), 1);
  EXPECT_EQ(at(clean, 5, 5), 0);
  EXPECT_EQ(at(clean, 19, 30), 0);
  EXPECT_EQ(at(clean, 20, 30), 1);
  const MaskImage soft = readMaskImage(file, {.threshold = 0.5, .specks = 10, .feather = 8});
  EXPECT_NEAR((at(soft, 19, 32) + at(soft, 20, 32)) / 2, 0.5, 0.02);
  EXPECT_LT(at(soft, 14, 32), 0.05);
  EXPECT_GT(at(soft, 25, 32), 0.95);
}

TEST_F(MaskFile, SpotsThatMeetAcrossTheEdgeAreOne) {
  cv::Mat image(32, 32, CV_8UC1, cv::Scalar(0));
  image(cv::Rect(0, 10, 3, 4)).setTo(255);
  image(cv::Rect(29, 10, 3, 4)).setTo(255);
  const MaskImage mask = readMaskImage(save(image, "s.png"), {.specks = 20});
  EXPECT_EQ(mask.values[10 * 32], 1);  // 12 texels here, 24 with the other side
}

TEST_F(MaskFile, SamplesBilinearlyVUpAndRepeated) {
  cv::Mat image(2, 2, CV_8UC1, cv::Scalar(0));
  image.at<std::uint8_t>(0, 1) = 255;  // top right
  const MaskImage mask = readMaskImage(save(image, "b.png"), {});
  EXPECT_NEAR(mask.sample(0.75, 0.75), 1, 1e-6);
  EXPECT_NEAR(mask.sample(0.75, 0.25), 0, 1e-6);
  EXPECT_NEAR(mask.sample(0.5, 0.75), 0.5, 1e-6);
  EXPECT_NEAR(mask.sample(0.5, 0.5), 0.25, 1e-6);
  EXPECT_NEAR(mask.sample(-0.25, 3.75), 1, 1e-6);
  EXPECT_NEAR(mask.sample(1.0, 0.75), 0.5, 1e-6);  // halfway to the repeated left texel
}

// Refused by what the file declares, before it is unpacked; in the program's own words and no library's.
TEST_F(MaskFile, BrokenPicturesAreRefusedInOneLine) {
  const auto refusal = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    testing::internal::CaptureStderr();
    std::string message;
    try {
      readMaskImage(folder_ / name, {});
    } catch (const ToolError& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input);
      message = error.what();
    }
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
    return message;
  };
  const std::string head("\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16);
  EXPECT_NE(refusal("bomb.png", head + std::string("\0\1\x86\xa0\0\1\x86\xa0\x8\6\0\0\0", 13)).find("100000 x 100000"),
            std::string::npos);
  EXPECT_NE(refusal("broken.png", head + std::string("\0\0\0\4\0\0\0\4\x7f\x7f\0\0\0\0\0\0\0", 17)).find("no picture"),
            std::string::npos);
  const std::string exr("\x76\x2f\x31\x01\2\0\0\0dataWindow\0box2i\0\x10\0\0\0", 29);
  EXPECT_NE(refusal("bomb.exr", exr + std::string("\xff\xff\xff\xff\0\0\0\0\xfe\xff\xff\x7f\3\0\0\0", 16))
                .find("2147483648 x 4"),
            std::string::npos);
  EXPECT_NE(refusal("empty.png", "").find("no picture"), std::string::npos);
  const std::string pipe = (folder_ / "pipe.png").string();
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROW(readMaskImage(pipe, {}), ToolError);  // does not wait for a writer
}

}  // namespace
}  // namespace sinew::tools
