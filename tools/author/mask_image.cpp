// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/mask_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <span>

#include "tools/core/error.h"
#include "tools/core/read_file.h"
#include "tools/pictures/decode_picture.h"

namespace sinew::tools {
namespace {

constexpr int kLargestSide = 16384;
constexpr std::uint64_t kMostMegabytes = 1024;

[[noreturn]] void bad(const std::filesystem::path& file, const std::string& what, const std::string& cure) {
  throw ToolError(ExitCode::bad_input, file.string(), what, cure);
}

cv::Mat load(const std::filesystem::path& file) {
  const std::string bytes = readWholeFile(file, kMostMegabytes);
  const auto requireSize = [&](std::int64_t width, std::int64_t height) {
    if (width <= kLargestSide && height <= kLargestSide) return;
    bad(file, "is too large for a mask (" + std::to_string(width) + " x " + std::to_string(height) + " texels)",
        "Scale it down to " + std::to_string(kLargestSide) + " a side or less; 2048 is plenty.");
  };
  // Before it is unpacked: a small file can declare more texels than there is memory.
  const auto declared = declaredSize(std::as_bytes(std::span(bytes)));
  requireSize(declared[0], declared[1]);
  const cv::Mat image = decodePicture(std::as_bytes(std::span(bytes)));
  if (image.empty()) bad(file, "is no picture that can be read", "Save it as PNG or EXR.");
  requireSize(image.cols, image.rows);
  const double full = image.depth() == CV_8U ? 255 : image.depth() == CV_16U ? 65535 : 1;
  cv::Mat floats;
  image.convertTo(floats, CV_32F, 1 / full);
  return floats;
}

// Stored as blue, green, red, alpha, or grey.
cv::Mat channelOf(const cv::Mat& image, const std::string& channel, const std::filesystem::path& file) {
  const int count = image.channels();
  cv::Mat out;
  if (channel == "a") {
    if (count != 4 && count != 2) bad(file, "has no alpha channel", "Choose channel r, g, b or luminance.");
    cv::extractChannel(image, out, count - 1);
  } else if (count <= 2) {
    cv::extractChannel(image, out, 0);
  } else if (channel == "luminance") {
    cv::Mat weights = (cv::Mat_<float>(1, count));
    weights.setTo(0);
    weights.at<float>(0, 0) = 0.0722F;
    weights.at<float>(0, 1) = 0.7152F;
    weights.at<float>(0, 2) = 0.2126F;
    cv::transform(image, out, weights);
  } else {
    cv::extractChannel(image, out, channel == "b" ? 0 : channel == "g" ? 1 : 2);
  }
  return out;
}

cv::Mat keyed(const cv::Mat& image, const std::array<double, 3>& key, double tolerance) {
  const int count = image.channels();
  cv::Mat out(image.size(), CV_32F);
  for (int y = 0; y < image.rows; ++y) {
    const float* row = image.ptr<float>(y);
    for (int x = 0; x < image.cols; ++x) {
      double squared = 0;
      for (int c = 0; c < 3; ++c) {
        const double value = double(row[x * count + (count >= 3 ? 2 - c : 0)]);
        squared += (value - key[std::size_t(c)]) * (value - key[std::size_t(c)]);
      }
      out.at<float>(y, x) = std::sqrt(squared) <= tolerance ? 1.0F : 0.0F;
    }
  }
  return out;
}

// Spots above one half of fewer texels than `least`, counted over four neighbours and over the picture's edges.
void removeSpecks(cv::Mat& mask, int least) {
  cv::Mat binary;
  cv::compare(mask, 0.5, binary, cv::CMP_GE);
  cv::Mat labels;
  const int count = cv::connectedComponents(binary, labels, 4);
  // Spots that meet across the edge of the repeated picture are one.
  std::vector<int> root(std::size_t(count), 0);
  for (int i = 0; i < count; ++i) root[std::size_t(i)] = i;
  const auto find = [&](int i) {
    while (root[std::size_t(i)] != i) i = root[std::size_t(i)];
    return i;
  };
  const auto join = [&](int a, int b) {
    if (a != 0 && b != 0) root[std::size_t(std::max(find(a), find(b)))] = std::min(find(a), find(b));
  };
  for (int y = 0; y < labels.rows; ++y) join(labels.at<int>(y, 0), labels.at<int>(y, labels.cols - 1));
  for (int x = 0; x < labels.cols; ++x) join(labels.at<int>(0, x), labels.at<int>(labels.rows - 1, x));
  std::vector<int> area(std::size_t(count), 0);
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) ++area[std::size_t(find(labels.at<int>(y, x)))];
  }
  for (int y = 0; y < labels.rows; ++y) {
    for (int x = 0; x < labels.cols; ++x) {
      const int label = find(labels.at<int>(y, x));
      if (label != 0 && area[std::size_t(label)] < least) mask.at<float>(y, x) = 0;
    }
  }
}

// Runs a filter that looks `reach` texels far on the picture repeated.
template <class Filter>
void repeated(cv::Mat& mask, int reach, const Filter& filter) {
  cv::Mat wide;
  cv::copyMakeBorder(mask, wide, reach, reach, reach, reach, cv::BORDER_WRAP);
  cv::Mat out;
  filter(wide, out);
  mask = out(cv::Rect(reach, reach, mask.cols, mask.rows)).clone();
}

}  // namespace

double MaskImage::sample(double u, double v) const {
  const double x = (u - std::floor(u)) * width - 0.5;
  const double y = (1 - (v - std::floor(v))) * height - 0.5;
  const auto wrap = [](double i, int n) { return std::size_t((int(i) % n + n) % n); };
  const double fx = x - std::floor(x);
  const double fy = y - std::floor(y);
  const std::size_t x0 = wrap(std::floor(x), width);
  const std::size_t x1 = wrap(std::floor(x) + 1, width);
  const std::size_t y0 = wrap(std::floor(y), height) * std::size_t(width);
  const std::size_t y1 = wrap(std::floor(y) + 1, height) * std::size_t(width);
  return (1 - fy) * ((1 - fx) * double(values[y0 + x0]) + fx * double(values[y0 + x1])) +
         fy * ((1 - fx) * double(values[y1 + x0]) + fx * double(values[y1 + x1]));
}

MaskImage readMaskImage(const std::filesystem::path& file, const MaskImageOptions& options) {
  const cv::Mat image = load(file);
  cv::Mat mask = options.key ? keyed(image, *options.key, options.tolerance) : channelOf(image, options.channel, file);
  cv::patchNaNs(mask, 0);
  cv::min(mask, 1.0, mask);
  cv::max(mask, 0.0, mask);
  if (options.threshold) cv::threshold(mask, mask, *options.threshold - 1e-6, 1, cv::THRESH_BINARY);
  if (options.close > 0) {
    const int size = 2 * options.close + 1;
    const cv::Mat disc = cv::getStructuringElement(cv::MORPH_ELLIPSE, {size, size});
    repeated(mask, 2 * options.close,
             [&](const cv::Mat& in, cv::Mat& out) { cv::morphologyEx(in, out, cv::MORPH_CLOSE, disc); });
  }
  if (options.specks > 0) removeSpecks(mask, options.specks);
  if (options.feather > 0) {
    // A Gaussian makes a ramp from 5 % to 95 % about 3.3 standard deviations wide.
    const double sigma = options.feather / 3.3;
    repeated(mask, int(std::ceil(4 * sigma)) + 1, [&](const cv::Mat& in, cv::Mat& out) {
      cv::GaussianBlur(in, out, {0, 0}, sigma);
    });
  }
  MaskImage result;
  result.width = mask.cols;
  result.height = mask.rows;
  for (int y = 0; y < mask.rows; ++y) {
    result.values.insert(result.values.end(), mask.ptr<float>(y), mask.ptr<float>(y) + mask.cols);
  }
  return result;
}

}  // namespace sinew::tools
