// SPDX-License-Identifier: GPL-3.0-or-later
//
// Files for the windows of `view` and `studio`.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "tools/studio/view_window.h"

namespace sinew::tools {

/// A package, a recipe, or a source with a recipe: `recipe` where it is named, else the one beside the source; it is
/// made where there is none. Throws ToolError.
Opened openForWindow(const std::string& file, const std::string& recipe = "");

/// Options that both windows have.
void addWindowOptions(CLI::App& verb, StudioOptions& options);

}  // namespace sinew::tools
