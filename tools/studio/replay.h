// SPDX-License-Identifier: GPL-3.0-or-later
//
// Input from a file: what mouse and keyboard would do, given to the window where theirs arrives (docs/studio.md).
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
