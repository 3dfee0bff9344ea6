// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "tools/study/error.h"

namespace sinew::tools {

/// A package, or a recipe or source with these settings. Throws ToolError.
ErrorInput errorInput(const std::string& file);

struct ErrorEntry {
  ErrorInput input;
  ErrorOptions options;
};

/// A list of inputs with scenes of their own (docs/error-and-speed.md#a-list).
/// \param options of what an entry does not say
/// Throws ToolError(bad_input), which names file, line and key.
std::vector<ErrorEntry> readErrorList(const std::string& file, const ErrorOptions& options);

}  // namespace sinew::tools
