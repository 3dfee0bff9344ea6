// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace sinew::tools {

/// Exit codes of the program (design: 0 done, 1 findings of severity error, 2 usage, 3 bad input, 4 the system failed).
enum class ExitCode : int { done = 0, findings = 1, usage = 2, bad_input = 3, system = 4 };

/// A tool's failure. Printed as one line: `sinew: FILE: what is wrong (where). What to do.`
class ToolError : public std::runtime_error {
 public:
  /// \param file the user's file, as they named it; may be empty.
  /// \param what one sentence without a final full stop: what is wrong, with the place in brackets.
  /// \param cure one sentence with a final full stop: what to do.
  ToolError(ExitCode code, const std::string& file, const std::string& what, const std::string& cure)
      : std::runtime_error((file.empty() ? "" : file + ": ") + what + ". " + cure),
        code_(code),
        problem_(what),
        cure_(cure) {}
  ExitCode code() const { return code_; }
  const std::string& problem() const { return problem_; }  ///< `what` as given, without file and cure
  const std::string& cure() const { return cure_; }

 private:
  ExitCode code_;
  std::string problem_, cure_;
};

}  // namespace sinew::tools
