// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tab of a scene: which one, its time, the hand, colliders, its settings.
#pragma once

#include "tools/studio/view_play.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class ScenePanel {
 public:
  static void draw(Widgets& widgets, Play& play);

 private:
  static void choice(Widgets& widgets, Play& play);
  static void time(Widgets& widgets, Play& play);
  static void hand(Widgets& widgets, Play& play);
  static void colliders(Widgets& widgets, Play& play);
  static void selected(Widgets& widgets, Play& play, std::size_t i);
  static bool step(Widgets& widgets, float& seconds);
  static void settings(Widgets& widgets, Play& play);
};

}  // namespace sinew::tools
