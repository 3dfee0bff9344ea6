// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_window.h"

#include <cstdlib>

#include "tools/core/command_line.h"
#include "tools/core/error.h"
#include "tools/studio/studio_window.h"

namespace sinew::tools {

namespace {

// Throws ToolError(system) that says how to go on where there is no display to open a window on.
void requireDisplay(const Opened& opened) {
  const auto given = [](const char* name) {
    const char* value = std::getenv(name);
    return value != nullptr && *value != '\0';
  };
  if (given("DISPLAY")) return;
  const std::string package = opened.asset ? opened.file : "OUT.sinew";
  const std::string draw = commandLine({"sinew", "render", package, "-o", "picture.png"});
  const std::string bake = opened.asset ? "" : commandLine({"sinew", "bake", opened.file, "-o", package}) + " && ";
  const char* const wayland = given("WAYLAND_DISPLAY") ? "; Xwayland gives one" : "";
  throw ToolError(ExitCode::system, opened.file,
                  std::string("there is no display to open a window on (DISPLAY is not set") + wayland + ")",
                  "Draw without one: " + bake + draw + ". Over ssh, ssh -X passes a display on.");
}

}  // namespace

void runStudioWindow(const Opened& opened, const StudioOptions& options) {
  requireDisplay(opened);
  StudioWindow(opened, options).run();
}

}  // namespace sinew::tools
