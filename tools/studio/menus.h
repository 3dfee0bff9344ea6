// SPDX-License-Identifier: GPL-3.0-or-later
//
// The menu at the top of the panel, and the page of help: both say what the table of shortcuts says.
#pragma once

#include "tools/studio/camera_mouse.h"
#include "tools/studio/shortcuts.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class Menus {
 public:
  /// In a window that has a menu bar. Choices are added to `commands`.
  void draw(bool has_document, bool is_source, Widgets& widgets, Navigation& navigation, Commands& commands);
  /// The page of help, where it is open.
  void drawHelpPage(Navigation navigation, Widgets& widgets);
  void toggleHelp() { help_ = !help_; }
  bool isHelpOpen() const { return help_; }

 private:
  bool help_ = false;
};

}  // namespace sinew::tools
