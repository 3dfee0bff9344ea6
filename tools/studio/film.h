// SPDX-License-Identifier: GPL-3.0-or-later
//
// A video of what plays, made by `sinew render` in a process of its own.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tools/studio/child_job.h"

namespace sinew::tools {

struct FilmOptions {
  std::string package;     ///< file
  std::string scene;       ///< as --scene takes it; empty: `scene_text`
  std::string scene_text;  ///< of a scene's file
  std::string camera;      ///< as --camera takes it; empty: the scene's own
  double seconds = 0;      ///< length; 0: the scene's own
  double step = 0;         ///< s; 0: the scene's own
  bool turntable = false;
};

class Film {
 public:
  /// Starts to write `file`. One that is being made is given up. Throws ToolError where that cannot be done.
  void start(const FilmOptions& options, const std::string& file);
  void cancel() { child_.cancel(); }
  /// To be called once a frame. \return what is to be said of one that has ended; empty: nothing
  std::string poll();

  bool isRunning() const { return child_.isRunning(); }
  bool hasFailed() const { return failed_; }  ///< the last one that ended
  const ChildJob& child() const { return child_; }

 private:
  std::optional<JobFolder> folder_;  // from the first one on
  ChildJob child_;                   // ends before its folder goes
  std::string file_;
  bool failed_ = false;
};

}  // namespace sinew::tools
