// SPDX-License-Identifier: GPL-3.0-or-later
//
// Controls of the panels, which can be found again by their names: tests and replays press what they name.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace sinew::tools {

class Widgets {
 public:
  struct Box {
    float left = 0, top = 0, right = 0, bottom = 0;  ///< window coordinates
    int scroll = 0;                  ///< 0: it can be seen; 1, -1: it is below, above of what its panel shows
    float wheel_x = 0, wheel_y = 0;  ///< a place where the wheel scrolls to it
  };

  /// Forgets those of the last frame.
  void beginFrame();
  /// Names the control that was drawn last.
  void mark(const std::string& name);
  /// Names a place of the view, in window coordinates.
  void place(const std::string& name, float x, float y) { boxes_[name] = {x, y, x, y, 0, x, y}; }
  std::optional<Box> find(const std::string& name) const;

  // Each draws a control that fills the width (or `width`) and is named by its label; of "Name##of the mask" only
  // "Name" is shown, and "Name of the mask" is what it is found by.
  bool button(const std::string& label, float width = -1, bool enabled = true);
  bool checkbox(const std::string& label, bool& value, bool enabled = true);
  bool radio(const std::string& label, bool active);
  bool selectable(const std::string& label, bool selected);
  /// Label at the left of the slider, its value at the right. \return whether it has another value
  bool slider(const std::string& label, float& value, float low, float high, const char* format, bool logarithmic);
  bool whole(const std::string& label, int& value, int low, int high);
  /// Whether the slider that was drawn last has just been let go with another value.
  bool wasLeft() const { return was_left_; }
  /// Whether it is being dragged.
  bool isHeld() const { return is_held_; }
  /// Label beside the field. \return whether it was edited and left, by Return or a click elsewhere
  bool text(const std::string& label, std::string& value, const char* hint = "");
  bool combo(const std::string& label, std::string& value, std::span<const std::string> choices);

 private:
  std::map<std::string, Box> boxes_;
  bool was_left_ = false;
  bool is_held_ = false;
};

/// A line above a group of controls.
void heading(const char* text);
/// Lines in grey, as wide as there is room.
void note(const std::string& text);

}  // namespace sinew::tools
