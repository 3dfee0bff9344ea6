// SPDX-License-Identifier: GPL-3.0-or-later
//
// A verb of this program in a process of its own: it can be stopped at any moment, and nothing that befalls it harms
// the window.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sinew::tools {

class ChildJob {
 public:
  enum class Ended : std::uint8_t { no, done, failed };

  ChildJob() = default;
  ~ChildJob() { cancel(); }
  ChildJob(const ChildJob&) = delete;
  ChildJob& operator=(const ChildJob&) = delete;

  /// Starts `sinew WORDS`, which tell their stages by --progress-lines. One that runs is stopped. \param what it is, in
  /// messages: "the bake". \param cure of one that a signal ends. \return false: error() says why
  bool start(std::vector<std::string> words, const std::string& what, const std::string& cure);
  void cancel();
  /// Looks how far it is, and whether it has ended since the last call. To be called once a frame; costs a system call
  /// or two.
  Ended poll();

  bool isRunning() const { return pid_ > 0; }
  const std::string& stage() const { return stage_; }
  float fraction() const { return fraction_; }         ///< of the stage, 0..1
  double seconds() const { return seconds_; }          ///< of the last one that ended
  const std::string& error() const { return error_; }  ///< of one that failed: its line

 private:
  void takeLines();

  pid_t pid_ = -1;
  int pipe_ = -1;
  std::string what_, cure_, text_, stage_, error_;
  float fraction_ = 0;
  double started_ = 0, seconds_ = 0;
};

/// A folder of this process in the system's place for temporary files, for what children write; it goes with this.
class JobFolder {
 public:
  /// Throws ToolError(system) where none can be made.
  JobFolder();
  ~JobFolder();
  JobFolder(const JobFolder&) = delete;
  JobFolder& operator=(const JobFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace sinew::tools
