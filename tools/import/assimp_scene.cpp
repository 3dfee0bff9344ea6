// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/readers.h"

namespace sinew::tools {

RawScene readWithAssimp(const std::filesystem::path&, const std::string& format) {
  throw ReadError("format " + format + " is read in the next step");
}

}  // namespace sinew::tools
