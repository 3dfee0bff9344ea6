// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace sinew::tools {

/// docs/recipe-format.md.
std::string recipeMarkdown();

}  // namespace sinew::tools
