// SPDX-License-Identifier: GPL-3.0-or-later
//
// The one table of what can be chosen by a key or in the menu. Keys, menu, tooltips and the page of help are made of
// it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/studio/keys.h"

namespace sinew::tools {

enum class Command : std::uint8_t {
  open_file,
  save_scene,
  film,
  turntable,
  export_package,
  screenshot,
  undo,
  redo,
  bake,
  stiffen,
  play,
  step,
  step_back,
  restart,
  lock,
  let_go,
  pull,
  push,
  cut,
  target,
  fit,
  front,
  side,
  top,
  physical,
  clusters,
  contacts,
  section,
  smaller,
  larger,
  symmetric,
  help,
  scene,  ///< the first of nine
  scene_last = scene + 8
};

/// Where a key means something: letters of the source's tabs and of the scene's are apart.
enum class Place : std::uint8_t { everywhere, document, source, scene };

struct Shortcut {
  Command command;
  const char* menu;
  const char* name;
  int key = 0;  ///< GLFW_KEY_...; 0: the menu alone
  bool control = false, shift = false;
  Place place = Place::everywhere;
};

/// In the order of the menus. Scenes 1 to 9 are one entry.
std::span<const Shortcut> shortcuts();
/// Command of a press here; nothing: no shortcut. \param is_source whether the source's tabs are open, else the scene's
std::optional<Command> commandOf(const Keys::Press& press, bool has_document, bool is_source);
/// Whether a shortcut can be chosen here.
bool isPossible(const Shortcut& shortcut, bool has_document, bool is_source);
/// "Ctrl+Shift+Z"; empty where it has no key.
std::string keysText(const Shortcut& shortcut);
/// A name with its keys, for a tooltip: "Undo   (Ctrl+Z)".
std::string nameWithKeys(Command command);

/// A tooltip of the control that was drawn last: what it does, with its keys.
void tip(Command command);

/// Commands given in a frame.
using Commands = std::vector<Command>;

}  // namespace sinew::tools
