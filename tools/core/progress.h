// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace sinew::tools {

/// Seconds and peak resident memory of one stage, for reports.
struct StageCost {
  std::string name;
  double seconds = 0;
  double peak_megabytes = 0;  ///< of the process (and for "import" of the child) up to the end of the stage
};

/// Follows the stages of a long job: shows them on a terminal's stderr (never when piped) and records what each cost.
class Progress {
 public:
  explicit Progress(bool show);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Calls `listener` with the stage and 0..1 within it, where a bar would be drawn. To be set before the first stage.
  void tell(std::function<void(const std::string& stage, double done)> listener) { listener_ = std::move(listener); }

  /// Ends the stage before, starts the next.
  void stage(const std::string& name);
  /// 0..1 within the stage; cheap to call often.
  void fraction(double done);
  /// Replaces the recorded peak of the running stage (used for child processes).
  void childPeak(double megabytes);
  void finish();
  const std::vector<StageCost>& costs() const { return costs_; }

 private:
  void close();
  bool show_;
  std::function<void(const std::string&, double)> listener_;
  bool open_ = false;
  double started_ = 0;
  double drawn_ = 0;
  double child_peak_ = 0;
  std::string name_;
  std::vector<StageCost> costs_;
};

}  // namespace sinew::tools
