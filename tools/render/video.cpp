// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/video.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <fstream>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "tools/core/atomic_file.h"
#include "tools/core/error.h"
#include "tools/pictures/picture_files.h"

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

// Whether the boxes of an mp4 (ISO/IEC 14496-12, 4.2) fill a file and hold media and its index: the encoder does not
// say where the disk took only part of what it wrote.
bool isWhole(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(file, error);
  if (error) return false;
  bool media = false, index = false;
  std::uint64_t at = 0;
  while (at < size) {
    std::array<unsigned char, 16> head{};
    in.seekg(std::streamoff(at));
    in.read(reinterpret_cast<char*>(head.data()), std::streamsize(std::min<std::uint64_t>(head.size(), size - at)));
    const auto number = [&](std::size_t first, std::size_t bytes) {
      std::uint64_t value = 0;
      for (std::size_t i = first; i < first + bytes; ++i) value = value << 8 | head.at(i);
      return value;
    };
    const std::uint64_t length = number(0, 4) == 1 ? number(8, 8) : number(0, 4);
    if (!in || length < 8 || length > size - at) return false;
    const std::string_view name(reinterpret_cast<const char*>(&head[4]), 4);
    media = media || name == "mdat";
    index = index || name == "moov";
    at += length;
  }
  return media && index;
}

std::uint64_t frameCount(const std::filesystem::path& file) {
  const auto capture = pictureFiles().readVideo(file);
  return capture->isOpened() ? std::uint64_t(std::max(0.0, capture->get(cv::CAP_PROP_FRAME_COUNT))) : 0;
}

}  // namespace

struct VideoFile::Impl {
  explicit Impl(std::filesystem::path place) : file(std::move(place)), beside(file) {}
  std::filesystem::path file;
  FileBeside beside;
  std::uint64_t frames = 0;
  std::unique_ptr<cv::VideoWriter> writer;
  std::array<void (*)(int), kSignals.size()> handlers{};

  ~Impl() {
    writer.reset();
    g_unfinished[0] = '\0';
    for (std::size_t i = 0; i < kSignals.size(); ++i) std::signal(kSignals[i], handlers[i]);
  }
};

VideoFile::VideoFile(std::filesystem::path file, int width, int height, double frames_per_second)
    : impl_(std::make_unique<Impl>(std::move(file))) {
  const std::string& name = impl_->beside.path();
  if (name.size() < g_unfinished.size()) std::memcpy(g_unfinished.data(), name.c_str(), name.size() + 1);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    impl_->handlers[i] = std::signal(kSignals[i], removeUnfinished);
    if (impl_->handlers[i] == SIG_IGN) std::signal(kSignals[i], SIG_IGN);
  }
  impl_->writer = pictureFiles().writeVideo(name, frames_per_second, cv::Size(width, height));
  if (!impl_->writer->isOpened()) {
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
  impl_->writer->write(bgr);
  ++impl_->frames;
}

void VideoFile::finish() {
  impl_->writer->release();
  if (!isWhole(impl_->beside.path()) || frameCount(impl_->beside.path()) != impl_->frames) {
    throw ToolError(ExitCode::system, impl_->file.string(), "the video could not be written whole",
                    "Check that the disk is not full.");
  }
  impl_->beside.putInPlace();
}

std::vector<Image> readVideo(const std::filesystem::path& file) {
  std::vector<Image> frames;
  const auto capture = pictureFiles().readVideo(file);
  cv::Mat bgr;
  while (capture->isOpened() && capture->read(bgr)) {
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
