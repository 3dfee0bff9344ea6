// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/findings_json.h"

#include <algorithm>

namespace sinew::tools {
namespace {

constexpr std::array<const char*, 3> kSeverityNames = {"info", "warning", "error"};

const char* severityName(Severity severity) { return kSeverityNames[std::size_t(severity)]; }

}  // namespace

nlohmann::ordered_json findingsJson(std::span<const Finding> findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    list.push_back({{"id", f.id},
                    {"severity", severityName(f.severity)},
                    {"message", f.message},
                    {"count", f.count},
                    {"place_kind", f.place_kind},
                    {"places", f.places},
                    {"place", f.place},
                    {"cure", f.cure}});
  }
  return list;
}

void printFindings(std::ostream& out, std::span<const Finding> findings, bool all) {
  for (const Severity severity : {Severity::error, Severity::warning, Severity::info}) {
    if (severity == Severity::info && !all) continue;
    for (const Finding& f : findings) {
      if (f.severity != severity) continue;
      out << severityName(severity) << ": " << f.message << " [" << f.id << "]\n";
      std::string place = f.place;
      if (!f.places.empty()) {
        place += (place.empty() ? "" : "; ") + f.place_kind;
        const std::size_t shown = std::min<std::size_t>(f.places.size(), 8);
        for (std::size_t i = 0; i < shown; ++i) place += (i == 0 ? " " : ", ") + std::to_string(f.places[i]);
        if (f.count > shown) place += ", ...";
      }
      if (!place.empty()) out << "  where: " << place << "\n";
      if (!f.cure.empty()) out << "  cure:  " << f.cure << "\n";
    }
  }
}

}  // namespace sinew::tools
