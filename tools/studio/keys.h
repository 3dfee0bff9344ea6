// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <utility>
#include <vector>

struct GLFWwindow;

namespace sinew::tools {

/// Keys that went down since the last look.
class Keys {
 public:
  struct Press {
    int key = 0;           ///< GLFW_KEY_...
    bool control = false;  ///< held down with it
    bool shift = false;
  };
  /// Must be called before Dear ImGui installs its own callbacks, which pass events on; and outlive the window's use.
  explicit Keys(GLFWwindow* window);
  ~Keys();
  Keys(const Keys&) = delete;
  Keys& operator=(const Keys&) = delete;
  void press(const Press& key) { presses_.push_back(key); }
  std::vector<Press> take() { return std::exchange(presses_, {}); }
  /// Files that were dropped on the window since the last look.
  void drop(std::string file) { dropped_.push_back(std::move(file)); }
  std::vector<std::string> takeDropped() { return std::exchange(dropped_, {}); }

 private:
  GLFWwindow* window_;
  std::vector<Press> presses_;
  std::vector<std::string> dropped_;
};

}  // namespace sinew::tools
