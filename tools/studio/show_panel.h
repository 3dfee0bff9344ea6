// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tab of what is drawn of a scene, and of what was measured.
#pragma once

#include "tools/studio/play_colors.h"
#include "tools/studio/view_input.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class ShowPanel {
 public:
  /// \param frame_seconds s, measured
  static void draw(double frame_seconds, const PlayColors& colors, Widgets& widgets, Play& play, Shown& shown);

 private:
  static void scale(const PlayColors& colors, PlayColor what);
  static void section(Widgets& widgets, Section& section);
  static void measured(double frame_seconds, const Play& play);
};

}  // namespace sinew::tools
