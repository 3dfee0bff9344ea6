// SPDX-License-Identifier: GPL-3.0-or-later
//
// Asks for the name of a file.
#pragma once

#include <functional>
#include <string>

#include "tools/studio/widgets.h"

namespace sinew::tools {

class PathDialog {
 public:
  /// Opens it. \param verb of the button that confirms. \param use takes the name; what it throws is shown, and the
  /// dialog stays. \param more controls below the name; may be empty
  void open(const std::string& title, const std::string& verb, const std::string& path,
            const std::function<void(const std::string&)>& use, const std::function<void(Widgets&)>& more = {});
  /// Its question is about something that is no more.
  void close() { is_open_ = false; }
  void draw(Widgets& widgets);

 private:
  void fill(Widgets& widgets);

  std::string title_, verb_, path_, error_;
  std::function<void(const std::string&)> use_;
  std::function<void(Widgets&)> more_;
  bool is_open_ = false;
};

}  // namespace sinew::tools
