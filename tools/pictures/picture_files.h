// SPDX-License-Identifier: GPL-3.0-or-later
//
// The one door to OpenCV's codecs. They come with two hundred shared libraries, which the dynamic linker needs a fifth
// of a second for: they lie behind a module beside the program, opened at the first call.
#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/videoio.hpp>
#include <vector>

namespace sinew::tools {

/// Of cv::VideoWriter and cv::VideoCapture only what is virtual can be called: the program does not link their library.
class PictureFiles {
 public:
  virtual ~PictureFiles() = default;
  /// The picture as its file stores it (cv::IMREAD_UNCHANGED); empty where the bytes are none. Broken ones may throw.
  /// \param bytes one row of CV_8U
  virtual cv::Mat decode(const cv::Mat& bytes) const = 0;
  /// \param compression 0..9
  virtual std::vector<unsigned char> encodePng(const cv::Mat& bgr, int compression) const = 0;
  /// A new H.264 file, silent about what fails: ask isOpened().
  virtual std::unique_ptr<cv::VideoWriter> writeVideo(const std::filesystem::path& file, double frames_per_second,
                                                      cv::Size size) const = 0;
  virtual std::unique_ptr<cv::VideoCapture> readVideo(const std::filesystem::path& file) const = 0;
};

/// Throws ToolError(system) where the module or a library that it needs is missing.
const PictureFiles& pictureFiles();

}  // namespace sinew::tools
