// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_window.h"

#include <cstdlib>

#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/studio/studio_window.h"

namespace sinew::tools {

void requireDisplay(const std::string& package) {
  const auto given = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0';
  };
  if (given("DISPLAY")) return;
  const std::string cure =
      "Draw without a window instead: " + commandLine({"sinew", "render", package, "-o", "picture.png"}) + ".";
  if (given("WAYLAND_DISPLAY"))
    throw ToolError(ExitCode::system, "", "the window needs an X display (DISPLAY is not set; Xwayland gives one)",
                    cure);
  throw ToolError(ExitCode::system, "", "there is no display to open a window on (DISPLAY is not set)", cure);
}

void runStudioWindow(const Opened& opened, const StudioOptions& options) {
  requireDisplay(opened.file);
  StudioWindow(opened, options).run();
}

}  // namespace sinew::tools
