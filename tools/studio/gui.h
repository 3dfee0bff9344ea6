// SPDX-License-Identifier: GPL-3.0-or-later
//
// The panel at the left of the window of `sinew view`, and the line of help below.
#pragma once

#include <array>

#include "tools/studio/view_input.h"
#include "tools/studio/widgets.h"

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

class ViewPanel {
 public:
  /// The whole panel of a window that only plays. \param height of the window. \param frame_seconds s, measured
  void draw(const ViewLayout& layout, int height, double frame_seconds, Widgets& widgets, Play& play, Shown& shown);
  // What is in its tabs.
  void channels(Widgets& widgets, Play& play);
  static void sceneControls(float width, double frame_seconds, Widgets& widgets, Play& play, Shown& shown);

 private:
  std::array<char, 64> filter_ = {};
  bool both_sides_ = true;
};

/// Begins the panel at the left; ImGui::End() ends it. \param height of the window
void beginPanel(const ViewLayout& layout, int height);
/// A line along the lower edge of the view. \param width,height of the window
void drawHelp(const ViewLayout& layout, int width, int height, const char* text);
/// \param width,height of the window
void drawViewHelp(const ViewLayout& layout, int width, int height);

}  // namespace sinew::tools
