// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "tools/author/json_text.h"

namespace sinew::tools {

/// Checks a whole recipe of the present version: types, ranges, unknown keys, kinds. Throws ToolError(bad_input) with
/// line and cure. Does not look at files, names or cycles.
void checkRecipeShape(const JsonText& text);
/// The same of one selection that stands at `pointer`.
void checkSelectionShape(const JsonText& text, const std::string& pointer, const nlohmann::ordered_json& selection);

}  // namespace sinew::tools
