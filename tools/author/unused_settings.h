// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <span>

#include "tools/author/recipe.h"
#include "tools/core/finding.h"

namespace sinew::tools {

/// What settings differ from their defaults and say nothing: those of automatic clusters where all are authored, those
/// of authored ones where none is, those that every cluster has a value of its own for, and those of a choice that no
/// cluster takes.
/// \param clusters with the source's cluster meshes. \param automatic whether bodies without authored clusters may be
/// left.
std::optional<Finding> unusedSettings(const Settings& settings, std::span<const RecipeCluster> clusters,
                                      bool automatic);

}  // namespace sinew::tools
