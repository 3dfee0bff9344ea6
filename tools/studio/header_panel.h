// SPDX-License-Identifier: GPL-3.0-or-later
//
// Header above the tabs: the document, its history, its bake.
#pragma once

#include "tools/studio/document.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class HeaderPanel {
 public:
  void draw(Document& document, Widgets& widgets);
  /// Writes the package beside the recipe; the document says so, or why not.
  static void exportPackage(Document& document);
  /// Asks what is to become of a recipe that two programs have changed.
  static void drawConflict(Document& document, Widgets& widgets);
};

}  // namespace sinew::tools
