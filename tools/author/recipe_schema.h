// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>

namespace sinew::tools {

/// docs/recipe.schema.json: JSON Schema, draft 2020-12, for editors.
nlohmann::ordered_json recipeSchema();

}  // namespace sinew::tools
