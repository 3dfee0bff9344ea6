// SPDX-License-Identifier: GPL-3.0-or-later
//
// A bake in a process of its own: it can be stopped at any moment, and nothing that befalls it harms the window.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/core/finding.h"

namespace sinew::tools {

class BakeJob {
 public:
  enum class State : std::uint8_t { idle, running, done, failed };

  /// Makes a folder for packages that goes with this. Throws ToolError(system) where none can be made.
  BakeJob();
  ~BakeJob();
  BakeJob(const BakeJob&) = delete;
  BakeJob& operator=(const BakeJob&) = delete;

  /// Bakes a recipe as it is on the disk: `sinew bake --draft`, with the user's stage cache, then the whole where that
  /// was one. What runs is stopped.
  void start(const std::filesystem::path& recipe);
  void cancel();
  /// Looks how far it is. To be called once a frame; costs a system call or two.
  void poll();

  State state() const { return state_; }
  const std::string& stage() const { return stage_; }
  float fraction() const { return fraction_; }         ///< of the stage, 0..1
  double seconds() const { return seconds_; }          ///< of the last one that ended
  const std::string& error() const { return error_; }  ///< of one that failed: its line
  bool isDraft() const { return is_draft_; }           ///< of the last one that was done
  /// The package of the last one that was done; null before.
  const std::shared_ptr<const Asset>& asset() const { return asset_; }
  const std::filesystem::path& package() const { return package_; }
  const std::vector<Finding>& findings() const { return findings_; }  ///< of its report
  std::uint32_t done() const { return done_; }                        ///< how many were done

 private:
  void run(bool draft);
  void takeLines();
  void finish(int status);

  std::filesystem::path folder_, recipe_, package_, target_;
  pid_t pid_ = -1;
  int pipe_ = -1;
  std::string text_, stage_, error_;
  float fraction_ = 0;
  double started_ = 0, seconds_ = 0;
  State state_ = State::idle;
  bool is_draft_ = false;
  std::uint32_t number_ = 0, done_ = 0;
  std::shared_ptr<const Asset> asset_;
  std::vector<Finding> findings_;
};

}  // namespace sinew::tools
