// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/author/recipe_commands.h"

namespace sinew::tools {

/// Makes a whole recipe stiffer or softer, as one command "stiffen FACTOR": every frequency that it says or takes by
/// default, of all clusters and of each, times the factor; moduli times its square. \param factor 1e-3 .. 1e3
/// \return what differs now
std::vector<RecipeEditor::Change> stiffen(RecipeEditor& editor, double factor);

}  // namespace sinew::tools
