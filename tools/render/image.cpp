// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tools/core/atomic_file.h"
#include "tools/core/read_file.h"
#include "tools/import/output_files.h"
#include "tools/import/textures.h"
#include "tools/pictures/decode_picture.h"
#include "tools/pictures/picture_files.h"

namespace sinew::tools {

namespace {

std::size_t pixelOffset(const Image& image, int x, int y) {
  return (static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(x)) * 3;
}

}  // namespace

Image::Image(int image_width, int image_height, Rgb8 fill)
    : width(image_width),
      height(image_height),
      rgb(static_cast<std::size_t>(image_width) * static_cast<std::size_t>(image_height) * 3) {
  fillRectangle(0, 0, width, height, fill);
}

Rgb8 Image::at(int x, int y) const {
  const std::size_t i = pixelOffset(*this, x, y);
  return {rgb[i], rgb[i + 1], rgb[i + 2]};
}

void Image::blend(int x, int y, Rgb8 color, float opacity) {
  if (x < 0 || y < 0 || x >= width || y >= height) return;
  const std::size_t i = pixelOffset(*this, x, y);
  for (std::size_t k = 0; k < 3; ++k) {
    const float mixed =
        static_cast<float>(rgb[i + k]) + (static_cast<float>(color[k]) - static_cast<float>(rgb[i + k])) * opacity;
    rgb[i + k] = static_cast<std::uint8_t>(std::clamp(mixed + 0.5F, 0.0F, 255.0F));
  }
}

void Image::fillRectangle(int x, int y, int rectangle_width, int rectangle_height, Rgb8 color) {
  const int x0 = std::max(x, 0);
  const int x1 = std::min(x + rectangle_width, width);
  for (int row = std::max(y, 0); row < std::min(y + rectangle_height, height); ++row) {
    for (int column = x0; column < x1; ++column)
      std::copy(color.begin(), color.end(), &rgb[pixelOffset(*this, column, row)]);
  }
}

void Image::paste(const Image& other, int x, int y) {
  const int x0 = std::max(x, 0);
  const int x1 = std::min(x + other.width, width);
  if (x1 <= x0) return;
  for (int row = std::max(y, 0); row < std::min(y + other.height, height); ++row) {
    std::copy_n(&other.rgb[pixelOffset(other, x0 - x, row - y)], static_cast<std::size_t>(x1 - x0) * 3,
                &rgb[pixelOffset(*this, x0, row)]);
  }
}

TexturePixels decodeTexture(std::span<const std::byte> bytes, int max_size) {
  TexturePixels result;
  if (bytes.empty() || bytes.size() > kMaxTextureBytes) return result;
  try {
    cv::Mat picture = decodePicture(bytes);
    if (picture.empty()) return result;
    if (picture.depth() == CV_16U) {
      picture.convertTo(picture, CV_8U, 1.0 / 257.0);
    } else if (picture.depth() != CV_8U) {
      picture.convertTo(picture, CV_8U, 255.0);
    }
    cv::Mat rgba;
    switch (picture.channels()) {
      case 1:
        cv::cvtColor(picture, rgba, cv::COLOR_GRAY2RGBA);
        break;
      case 3:
        cv::cvtColor(picture, rgba, cv::COLOR_BGR2RGBA);
        break;
      case 4:
        cv::cvtColor(picture, rgba, cv::COLOR_BGRA2RGBA);
        break;
      default:
        return result;
    }
    const int largest = std::max(rgba.cols, rgba.rows);
    if (largest > max_size) {
      const double scale = static_cast<double>(max_size) / largest;
      cv::resize(rgba, rgba, cv::Size(), scale, scale, cv::INTER_AREA);
    }
    result.width = rgba.cols;
    result.height = rgba.rows;
    result.rgba.assign(rgba.datastart, rgba.dataend);
  } catch (const cv::Exception&) {
    result = {};
  }
  return result;
}

std::vector<std::uint8_t> encodedPng(const Image& image) {
  const cv::Mat rgb(image.height, image.width, CV_8UC3, const_cast<std::uint8_t*>(image.rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  return pictureFiles().encodePng(bgr, 4);
}

void writePng(const Image& image, const std::filesystem::path& file) {
  std::vector<std::uint8_t> encoded = encodedPng(image);
  constexpr std::ptrdiff_t kAfterHeader = 8 + 25;  // signature and IHDR
  encoded.insert(encoded.begin() + kAfterHeader, kPictureMark.begin(), kPictureMark.end());
  writeFileAtomically(file, std::as_bytes(std::span(encoded)));
}

Image readImage(const std::filesystem::path& file) {
  const std::string bytes = readWholeFile(file, kMaxTextureBytes >> 20);
  const TexturePixels pixels = decodeTexture(std::as_bytes(std::span(bytes)), 1 << 15);
  Image image(pixels.width, pixels.height);
  for (std::size_t i = 0; i < image.rgb.size(); ++i) image.rgb[i] = pixels.rgba[i / 3 * 4 + i % 3];
  return image;
}

}  // namespace sinew::tools
