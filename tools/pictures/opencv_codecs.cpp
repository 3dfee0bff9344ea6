// SPDX-License-Identifier: GPL-3.0-or-later
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tools/pictures/picture_files.h"

namespace sinew::tools {
namespace {

class OpenCvCodecs final : public PictureFiles {
 public:
  cv::Mat decode(const cv::Mat& bytes) const override { return cv::imdecode(bytes, cv::IMREAD_UNCHANGED); }

  std::vector<unsigned char> encodePng(const cv::Mat& bgr, int compression) const override {
    std::vector<unsigned char> encoded;
    cv::imencode(".png", bgr, encoded, {cv::IMWRITE_PNG_COMPRESSION, compression});
    return encoded;
  }

  std::unique_ptr<cv::VideoWriter> writeVideo(const std::filesystem::path& file, double frames_per_second,
                                              cv::Size size) const override {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    auto writer = std::make_unique<cv::VideoWriter>();
    try {
      writer->open(file.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), frames_per_second, size);
    } catch (const cv::Exception&) {  // isOpened() says it
    }
    return writer;
  }

  std::unique_ptr<cv::VideoCapture> readVideo(const std::filesystem::path& file) const override {
    return std::make_unique<cv::VideoCapture>(file.string(), cv::CAP_FFMPEG);
  }
};

}  // namespace
}  // namespace sinew::tools

extern "C" const sinew::tools::PictureFiles* sinewPictureFiles() {
  static const sinew::tools::OpenCvCodecs codecs;
  return &codecs;
}
