// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>

#include "tools/study/error.h"

namespace sinew::tools {

/// Studies as one HTML page that needs nothing else: what a time buys, by whom; a diagram, a table and pictures of
/// each scene, errors as colour; how it was measured. Needs a current OpenGL context.
std::string errorPage(std::span<const ErrorStudy> studies);

}  // namespace sinew::tools
