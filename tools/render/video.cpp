// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/video.h"

#include <unistd.h>

#include <array>
#include <csignal>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "tools/core/error.h"

namespace sinew::tools {

namespace {

// For the signal handler: the path to remove. unlink() and raise() are async-signal-safe.
std::array<char, 4096> g_unfinished{};
constexpr std::array<int, 3> kSignals = {SIGINT, SIGTERM, SIGHUP};

extern "C" void removeUnfinished(int signal_number) {
  if (g_unfinished[0] != '\0') ::unlink(g_unfinished.data());
  std::signal(signal_number, SIG_DFL);
  std::raise(signal_number);
}

}  // namespace

struct VideoFile::Impl {
  std::filesystem::path file, temporary;
  cv::VideoWriter writer;
  std::array<void (*)(int), kSignals.size()> handlers{};

  ~Impl() {
    writer.release();
    std::error_code ignored;
    if (!temporary.empty()) std::filesystem::remove(temporary, ignored);
    g_unfinished[0] = '\0';
    for (std::size_t i = 0; i < kSignals.size(); ++i) std::signal(kSignals[i], handlers[i]);
  }
};

VideoFile::VideoFile(std::filesystem::path file, int width, int height, double frames_per_second)
    : impl_(std::make_unique<Impl>()) {
  impl_->file = std::move(file);
  impl_->temporary = temporaryBeside(impl_->file);
  const std::string name = impl_->temporary.string();
  if (name.size() < g_unfinished.size()) std::memcpy(g_unfinished.data(), name.c_str(), name.size() + 1);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    impl_->handlers[i] = std::signal(kSignals[i], removeUnfinished);
    if (impl_->handlers[i] == SIG_IGN) std::signal(kSignals[i], SIG_IGN);
  }
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try {
    impl_->writer.open(name, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('a', 'v', 'c', '1'), frames_per_second,
                       cv::Size(width, height));
  } catch (const cv::Exception&) {  // judged below
  }
  if (!impl_->writer.isOpened()) {
    throw ToolError(
        ExitCode::system, impl_->file.string(), "the video cannot be started",
        "Check that the folder is writable and that OpenCV's video support has an H.264 encoder, or ask for a .png.");
  }
}

VideoFile::~VideoFile() = default;

void VideoFile::add(const Image& frame) {
  const cv::Mat rgb(frame.height, frame.width, CV_8UC3, const_cast<std::uint8_t*>(frame.rgb.data()));
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  impl_->writer.write(bgr);
}

void VideoFile::finish() {
  impl_->writer.release();
  std::error_code error;
  if (std::filesystem::file_size(impl_->temporary, error) == 0 || error) {
    throw ToolError(ExitCode::system, impl_->file.string(), "the video could not be written",
                    "Check that the disk is not full.");
  }
  replaceFile(std::exchange(impl_->temporary, {}), impl_->file);
}

std::vector<Image> readVideo(const std::filesystem::path& file) {
  std::vector<Image> frames;
  cv::VideoCapture capture(file.string(), cv::CAP_FFMPEG);
  cv::Mat bgr;
  while (capture.isOpened() && capture.read(bgr)) {
    cv::Mat rgb;
    cv::cvtColor(bgr, rgb, cv::COLOR_BGR2RGB);
    Image image;
    image.width = rgb.cols;
    image.height = rgb.rows;
    image.rgb.assign(rgb.datastart, rgb.dataend);
    frames.push_back(std::move(image));
  }
  return frames;
}

}  // namespace sinew::tools
