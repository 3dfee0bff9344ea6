// SPDX-License-Identifier: GPL-3.0-or-later
//
// How hard a pen presses, which GLFW 3.3 does not tell.
#pragma once

#include <memory>

namespace sinew::tools {

/// Pens of an X server (of Wayland: XWayland's). Without one all reads as a mouse.
class Pen {
 public:
  Pen();
  ~Pen();
  /// 0..1; 1 where no pen touches. \param begins a stroke begins: pens that came since are found. A round trip to the
  /// server for each pen.
  double pressure(bool begins);

 private:
  struct Devices;
  std::unique_ptr<Devices> devices_;
};

}  // namespace sinew::tools
