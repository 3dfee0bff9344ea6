// SPDX-License-Identifier: GPL-3.0-or-later
//
// Where the front of a model is: what the artist says in import.front.
#pragma once

#include <string_view>

#include "sinew/formats/package.h"

namespace sinew::tools {

/// The yaw (rad) that a camera looks from the front with. \param front an axis of the source as import.front has it;
/// what is none, or points up or down, is taken for "auto", +z. \param up the source's axis that points up, "y" or "z"
float frontYaw(std::string_view front, std::string_view up);
/// As the settings of its bake say.
float frontYaw(const formats::PackageView& package);

}  // namespace sinew::tools
