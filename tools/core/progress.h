// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
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
  bool open_ = false;
  double started_ = 0;
  double drawn_ = 0;
  double child_peak_ = 0;
  std::string name_;
  std::vector<StageCost> costs_;
};

}  // namespace sinew::tools
