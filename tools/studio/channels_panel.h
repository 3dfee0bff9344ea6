// SPDX-License-Identifier: GPL-3.0-or-later
//
// A slider for each input of the package: what a game would drive.
#pragma once

#include <string>

#include "tools/studio/view_play.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class ChannelsPanel {
 public:
  void draw(Widgets& widgets, Play& play);

 private:
  std::string filter_;
  bool both_sides_ = true;
};

}  // namespace sinew::tools
