// SPDX-License-Identifier: GPL-3.0-or-later
//
// The window's memory from one session to the next.
#pragma once

#include <filesystem>

#include "tools/studio/camera_mouse.h"

namespace sinew::tools {

struct Preferences {
  Navigation navigation = Navigation::usual;
};

/// $XDG_CONFIG_HOME/sinew/studio.json, else below ~/.config; empty where neither is known.
std::filesystem::path preferencesFile();
/// Those of the file; what cannot be read there is as it was at first.
Preferences readPreferences();
/// Writes them, whole or not at all, beside what else the file says. \return whether that could be done
bool writePreferences(const Preferences& preferences);

}  // namespace sinew::tools
