// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tab of regions: what the recipe has, what it covers, what is wrong with it.
#pragma once

#include <string>

#include "tools/studio/studio_state.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class RegionsPanel {
 public:
  void draw(Document& document, StudioState& state, Widgets& widgets);

 private:
  void list(const Evaluated& evaluated, StudioState& state, Widgets& widgets);
  void details(Document& document, StudioState& state, Widgets& widgets);
  static void order(Document& document, const Region& region, Widgets& widgets);
  void material(Document& document, const std::string& cluster, Widgets& widgets);
  static void coverage(const Document& document, StudioState& state, Widgets& widgets);
  static void check(const Document& document, StudioState& state, Widgets& widgets);

  std::string name_;  // in the field, until Return
  std::optional<Region> named_;
  float rings_at_ = 0;  // Hz, while it is dragged
  bool rings_at_held_ = false;
  std::uint32_t counted_ = 0;
};

}  // namespace sinew::tools
