// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tab of the brush.
#pragma once

#include <string>

#include "tools/studio/studio_state.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class PaintPanel {
 public:
  void draw(Document& document, StudioState& state, Widgets& widgets);

 private:
  static void edge(Document& document, StudioState& state, Widgets& widgets);
  static void make(Document& document, StudioState& state, Widgets& widgets);
  std::string new_name_;
};

}  // namespace sinew::tools
