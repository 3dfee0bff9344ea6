// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <span>

#include "tools/author/recipe.h"
#include "tools/core/finding.h"

namespace sinew::tools {

/// Settings that differ from their defaults without effect: of automatic clusters where all are authored, of authored
/// ones where none is, with a value of its own in every cluster, of a choice that no cluster takes.
/// \param clusters with the source's cluster meshes. \param automatic whether bodies without authored clusters may be
/// left.
std::optional<Finding> unusedSettings(const Settings& settings, std::span<const RecipeCluster> clusters,
                                      bool automatic);

}  // namespace sinew::tools
