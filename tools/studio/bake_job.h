// SPDX-License-Identifier: GPL-3.0-or-later
//
// A bake in a process of its own: it can be stopped at any moment, and nothing that befalls it harms the window.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/core/finding.h"
#include "tools/studio/child_job.h"

namespace sinew::tools {

class BakeJob {
 public:
  enum class State : std::uint8_t { idle, running, done, failed };

  /// Bakes a recipe as it is on the disk: `sinew bake --draft`, with the user's stage cache, then the whole where that
  /// was one. Stops a running bake.
  void start(const std::filesystem::path& recipe);
  void cancel();
  /// Looks how far it is. To be called once a frame; costs a system call or two.
  void poll();

  State state() const { return state_; }
  const std::string& stage() const { return child_.stage(); }
  float fraction() const { return child_.fraction(); }  ///< of the stage, 0..1
  double seconds() const { return child_.seconds(); }   ///< of the last one that ended
  const std::string& error() const { return error_; }   ///< of one that failed: its line
  bool isDraft() const { return is_draft_; }            ///< of the last one that was done
  /// The package of the last one that was done; null before.
  const std::shared_ptr<const Asset>& asset() const { return asset_; }
  const std::filesystem::path& package() const { return package_; }
  const std::vector<Finding>& findings() const { return findings_; }  ///< of its report
  std::uint32_t done() const { return done_; }                        ///< how many were done

 private:
  void run(bool draft);
  void finish();

  JobFolder folder_;
  ChildJob child_;  // ends before its folder goes
  std::filesystem::path recipe_, package_, target_;
  std::string error_;
  State state_ = State::idle;
  bool is_draft_ = false;
  std::uint32_t number_ = 0, done_ = 0;
  std::shared_ptr<const Asset> asset_;
  std::vector<Finding> findings_;
};

}  // namespace sinew::tools
