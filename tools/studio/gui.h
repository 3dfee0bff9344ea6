// SPDX-License-Identifier: GPL-3.0-or-later
//
// Dear ImGui: its look, the panel at the left, the line of help below.
#pragma once

#include "tools/studio/view_layout.h"

struct GLFWwindow;

namespace sinew::tools {

/// Dear ImGui from start to end of the window.
class Gui {
 public:
  Gui(GLFWwindow* window, float scale);
  ~Gui();
  Gui(const Gui&) = delete;
  Gui& operator=(const Gui&) = delete;
};

/// Begins the panel at the left; ImGui::End() ends it. \param height of the window
void beginPanel(const ViewLayout& layout, int height);
/// A line along the lower edge of the view. \param width,height of the window
void drawHelp(const ViewLayout& layout, int width, int height, const char* text);

}  // namespace sinew::tools
