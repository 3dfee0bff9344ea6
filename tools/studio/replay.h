// SPDX-License-Identifier: GPL-3.0-or-later
//
// Input from a file (--replay): what mouse and keyboard would do, given to the window where theirs arrives.
//
//   {"events": [{"wait": "evaluation"}, {"click": "New mask"}, {"text": "cheeks"}, {"key": "enter"}, {"wait": "bake"}]}
//
// The first key of an event is its kind, others belong to it:
//
//   click, move   on a control by its label, a pixel [x, y], or a place of the source [x, y, z] (m);
//                 "button": "right"
//   stroke        presses, drags over a list of places of the source, lets go
//   drag          a slider, by its label, "to" 0..1 of its length
//   pull          presses the left button on a control, handle, pixel or place, drags "by" [x, y] pixels, holds for
//                 "hold" frames (with "screenshot": a PNG then), lets go
//   orbit         drags with the right button by [x, y] pixels
//   text          types it
//   key           a letter, digit, [ or ], or enter, escape, space, tab, f1, f12; before it control+ or shift+
//   wheel         notches
//   drop          a file on the window
//   wait          frames, or until "evaluation" (weights are those of the recipe), "bake" or "film" has ended
//   screenshot    a PNG of the window
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/author/json_text.h"
#include "tools/studio/keys.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class Replay {
 public:
  /// The window as events see it.
  struct Window {
    const Widgets& widgets;
    Keys& keys;
    std::function<std::optional<Eigen::Vector2f>(const Eigen::Vector3d&)> on_screen;  ///< none: no source yet
    bool is_evaluated = false, is_baked = false, bake_failed = false;
    std::function<void(const std::string&)> screenshot;
    bool is_filming = false;
  };

  /// Reads the events. Throws ToolError(bad_input) naming file, line and cure.
  explicit Replay(const std::string& file);

  /// Puts the mouse and the keys of this frame into Dear ImGui; between the backend's NewFrame() and ImGui's. Throws
  /// ToolError(bad_input) where an event points at what does not come.
  void frame(const Window& window);
  bool isDone() const { return next_ >= text_.json()["events"].size() && steps_.empty(); }

 private:
  struct Step {
    std::optional<Eigen::Vector2f> move;
    int press = -1, release = -1;  // buttons
    float wheel = 0;
    std::string text, picture;
    std::optional<Keys::Press> key;
    int idle = 0;  // frames
  };
  void check() const;
  bool begin(const Window& window);
  void glide(const Eigen::Vector2f& to, int frames);
  void drag(const Eigen::Vector2f& from, const Eigen::Vector2f& to);
  [[noreturn]] void fail(const std::string& what, const std::string& cure) const;

  JsonText text_;
  std::size_t next_ = 0;
  int waited_ = 0;  // frames
  std::vector<Step> steps_;
  Eigen::Vector2f mouse_ = {0, 0};
  std::array<bool, 3> down_ = {};
};

}  // namespace sinew::tools
