// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/shortcuts.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <array>

namespace sinew::tools {
namespace {

constexpr std::array kShortcuts = {
    Shortcut{Command::open_file, "File", "Open ...", GLFW_KEY_O, true},
    Shortcut{Command::save_scene, "File", "Save pose or channels as a scene ...", GLFW_KEY_S, true},
    Shortcut{Command::film, "File", "Video of the scene ..."},
    Shortcut{Command::turntable, "File", "Turntable ..."},
    Shortcut{Command::export_package, "File", "Export the package", GLFW_KEY_E, true, false, Place::document},
    Shortcut{Command::screenshot, "File", "Picture of the window", GLFW_KEY_F12},
    Shortcut{Command::undo, "Edit", "Undo", GLFW_KEY_Z, true, false, Place::document},
    Shortcut{Command::redo, "Edit", "Redo", GLFW_KEY_Z, true, true, Place::document},
    Shortcut{Command::redo, "Edit", "Redo, too", GLFW_KEY_Y, true, false, Place::document},
    Shortcut{Command::bake, "Edit", "Bake now", GLFW_KEY_B, true, false, Place::document},
    Shortcut{Command::stiffen, "Edit", "Slider of stiffness into the recipe", 0, false, false, Place::document},
    Shortcut{Command::smaller, "Paint", "Smaller brush", GLFW_KEY_LEFT_BRACKET, false, false, Place::source},
    Shortcut{Command::larger, "Paint", "Larger brush", GLFW_KEY_RIGHT_BRACKET, false, false, Place::source},
    Shortcut{Command::symmetric, "Paint", "Symmetric", GLFW_KEY_X, false, false, Place::source},
    Shortcut{Command::play, "Play", "Play or pause", GLFW_KEY_SPACE, false, false, Place::scene},
    Shortcut{Command::step, "Play", "Step", GLFW_KEY_N, false, false, Place::scene},
    Shortcut{Command::step_back, "Play", "Step back", GLFW_KEY_B, false, false, Place::scene},
    Shortcut{Command::restart, "Play", "Start again", GLFW_KEY_R, false, false, Place::scene},
    Shortcut{Command::pull, "Play", "Hand pulls", GLFW_KEY_H, false, false, Place::scene},
    Shortcut{Command::push, "Play", "Hand pushes with a ball", GLFW_KEY_J, false, false, Place::scene},
    Shortcut{Command::cut, "Play", "Hand cuts", GLFW_KEY_K, false, false, Place::scene},
    Shortcut{Command::target, "Play", "Hand moves targets of pins", GLFW_KEY_G, false, false, Place::scene},
    Shortcut{Command::lock, "Play", "Lock the pull", GLFW_KEY_L, false, false, Place::scene},
    Shortcut{Command::let_go, "Play", "Let all pulls go", GLFW_KEY_U, false, false, Place::scene},
    Shortcut{Command::fit, "Look", "Fit the picture", GLFW_KEY_F},
    Shortcut{Command::front, "Look", "From the front", GLFW_KEY_KP_1},
    Shortcut{Command::side, "Look", "From the side", GLFW_KEY_KP_3},
    Shortcut{Command::top, "Look", "From above", GLFW_KEY_KP_7},
    Shortcut{Command::physical, "Look", "Physical mesh", GLFW_KEY_P, false, false, Place::scene},
    Shortcut{Command::clusters, "Look", "Clusters", GLFW_KEY_C, false, false, Place::scene},
    Shortcut{Command::contacts, "Look", "Contacts", GLFW_KEY_T, false, false, Place::scene},
    Shortcut{Command::section, "Look", "Cut open", GLFW_KEY_O, false, false, Place::scene},
    Shortcut{Command::help, "Help", "Keys and mouse", GLFW_KEY_F1},
    Shortcut{Command::scene, "Help", "Scenes", GLFW_KEY_1, false, false, Place::scene},
};

std::string keyName(int key) {
  switch (key) {
    case GLFW_KEY_SPACE:
      return "Space";
    case GLFW_KEY_LEFT_BRACKET:
      return "[";
    case GLFW_KEY_RIGHT_BRACKET:
      return "]";
    case GLFW_KEY_1:
      return "1-9";
    default:
      break;
  }
  if (key >= GLFW_KEY_F1 && key <= GLFW_KEY_F25) return "F" + std::to_string(key - GLFW_KEY_F1 + 1);
  if (key >= GLFW_KEY_KP_0 && key <= GLFW_KEY_KP_9) return "Numpad " + std::to_string(key - GLFW_KEY_KP_0);
  return {char(key)};
}

}  // namespace

std::span<const Shortcut> shortcuts() { return kShortcuts; }

bool isPossible(const Shortcut& shortcut, bool has_document, bool is_source) {
  switch (shortcut.place) {
    case Place::everywhere:
      return true;
    case Place::document:
      return has_document;
    case Place::source:
      return is_source;
    case Place::scene:
      return !is_source;
  }
  return false;
}

std::optional<Command> commandOf(const Keys::Press& press, bool has_document, bool is_source) {
  const int digit = press.key - GLFW_KEY_1;
  for (const Shortcut& shortcut : kShortcuts) {
    if (!isPossible(shortcut, has_document, is_source)) continue;
    if (shortcut.control != press.control || (press.control && shortcut.shift != press.shift)) continue;
    if (shortcut.command == Command::scene && digit >= 0 && digit < 9) return Command(int(Command::scene) + digit);
    if (shortcut.key != 0 && shortcut.key == press.key) return shortcut.command;
  }
  return std::nullopt;
}

std::string keysText(const Shortcut& shortcut) {
  if (shortcut.key == 0) return "";
  return std::string(shortcut.control ? "Ctrl+" : "") + (shortcut.shift ? "Shift+" : "") + keyName(shortcut.key);
}

std::string nameWithKeys(Command command) {
  const auto* found =
      std::find_if(kShortcuts.begin(), kShortcuts.end(), [&](const Shortcut& s) { return s.command == command; });
  if (found == kShortcuts.end()) return "";
  const std::string keys = keysText(*found);
  return std::string(found->name) + (keys.empty() ? "" : "   (" + keys + ")");
}

void tip(Command command) {
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", nameWithKeys(command).c_str());
}

}  // namespace sinew::tools
