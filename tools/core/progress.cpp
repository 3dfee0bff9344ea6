// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/core/progress.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

namespace sinew::tools {
namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

double peakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return double(usage.ru_maxrss) / 1024.0;
}

}  // namespace

Progress::Progress(bool show) : show_(show && isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() { close(); }

void Progress::stage(const std::string& name) {
  close();
  name_ = name;
  started_ = now();
  drawn_ = 0;
  child_peak_ = 0;
  open_ = true;
  fraction(0);
}

void Progress::fraction(double done) {
  if ((!show_ && !listener_) || !open_) return;
  const double t = now();
  if (drawn_ != 0 && t - drawn_ < 0.1) return;
  drawn_ = t;
  if (listener_) listener_(name_, std::clamp(done, 0.0, 1.0));
  if (!show_) return;
  std::fprintf(stderr, "\r\033[K%s %3d %%", name_.c_str(), int(std::clamp(done, 0.0, 1.0) * 100));
  std::fflush(stderr);
}

void Progress::childPeak(double megabytes) { child_peak_ = std::max(child_peak_, megabytes); }

void Progress::finish() { close(); }

void Progress::close() {
  if (!open_) return;
  open_ = false;
  costs_.push_back({name_, now() - started_, std::max(peakMegabytes(), child_peak_)});
  if (show_) {
    std::fputs("\r\033[K", stderr);
    std::fflush(stderr);
  }
}

}  // namespace sinew::tools
