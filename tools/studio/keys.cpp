// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/keys.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>

namespace sinew::tools {
namespace {

// Held down, these go on.
bool repeats(int key) {
  return key == GLFW_KEY_N || key == GLFW_KEY_B || key == GLFW_KEY_LEFT_BRACKET || key == GLFW_KEY_RIGHT_BRACKET;
}

Keys* keysOf(GLFWwindow* window) { return static_cast<Keys*>(glfwGetWindowUserPointer(window)); }

}  // namespace

Keys::Keys(GLFWwindow* window) : window_(window) {
  glfwSetWindowUserPointer(window, this);
  // A tap shorter than a frame would be lost if keys were only looked at once a frame.
  glfwSetKeyCallback(window, [](GLFWwindow* from, int key, int, int action, int mods) {
    Keys* keys = keysOf(from);
    if (keys == nullptr || action == GLFW_RELEASE || (action == GLFW_REPEAT && !repeats(key))) return;
    keys->press({key, (mods & GLFW_MOD_CONTROL) != 0, (mods & GLFW_MOD_SHIFT) != 0});
  });
  glfwSetDropCallback(window, [](GLFWwindow* from, int count, const char** files) {
    Keys* keys = keysOf(from);
    for (int i = 0; keys != nullptr && i < count; ++i) keys->drop(files[i]);
  });
}
Keys::~Keys() { glfwSetWindowUserPointer(window_, nullptr); }

}  // namespace sinew::tools
