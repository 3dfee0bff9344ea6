// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/needs.h"

#include <algorithm>

namespace sinew::tools {

std::optional<Needs> Needs::parse(std::string_view text) {
  if (text == "all") return all();
  Needs needs = none();
  if (text == "none") return needs;
  while (true) {
    const std::size_t comma = text.find(',');
    std::string_view name = text.substr(0, comma);
    while (name.starts_with(' ')) name.remove_prefix(1);
    while (name.ends_with(' ')) name.remove_suffix(1);
    const auto* known = std::find_if(kNeedDeclarations.begin(), kNeedDeclarations.end(),
                                     [&](const NeedDeclaration& d) { return d.name == name; });
    if (name == "auto") {
      needs = needs.with(automatic());
    } else if (known != kNeedDeclarations.end()) {
      needs = needs.with(known->need);
    } else {
      return std::nullopt;
    }
    if (comma == std::string_view::npos) return needs;
    text.remove_prefix(comma + 1);
  }
}

std::string Needs::text() const {
  if (*this == all()) return "all";
  std::string text = isAutomatic() ? "auto" : "";
  for (const NeedDeclaration& d : kNeedDeclarations) {
    if (has(d.need)) text.append(text.empty() ? "" : ",").append(d.name);
  }
  return text.empty() ? "none" : text;
}

std::string Needs::names(std::string_view between, bool sentences) {
  std::string names;
  for (const NeedDeclaration& d : kNeedDeclarations) {
    names.append(names.empty() ? "" : between).append(d.name);
    if (sentences) names.append(" (").append(d.sentence).append(")");
  }
  return names;
}

}  // namespace sinew::tools
