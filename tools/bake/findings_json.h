// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <ostream>
#include <span>

#include "tools/core/finding.h"

namespace sinew::tools {

/// [{id, severity, message, count, place_kind, places, place, cure}]
nlohmann::ordered_json findingsJson(std::span<const Finding> findings);

/// For people: a paragraph each, warnings and errors first; info only when `all`.
void printFindings(std::ostream& out, std::span<const Finding> findings, bool all);

}  // namespace sinew::tools
