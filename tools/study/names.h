// SPDX-License-Identifier: GPL-3.0-or-later
//
// The names that recipes have for what studies vary.
#pragma once

#include <string_view>

#include "sinew/formats/sections.h"
#include "sinew/runtime/world.h"

namespace sinew::tools {

std::string_view nameOf(formats::ClusterMode mode);
std::string_view nameOf(formats::StiffnessModel model);
std::string_view nameOf(formats::LimitMethod limit);
std::string_view nameOf(formats::VolumeMethod volume);
std::string_view nameOf(PinMethod method);

}  // namespace sinew::tools
