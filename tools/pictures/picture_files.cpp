// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pictures/picture_files.h"

#include <dlfcn.h>

#include "tools/core/error.h"

namespace sinew::tools {

const PictureFiles& pictureFiles() {
  static const PictureFiles& files = []() -> const PictureFiles& {
    // $ORIGIN: the folder of the program (dlopen(3)). It stays open to the end: what it made has its code there.
    void* module = dlopen("$ORIGIN/" SINEW_PICTURE_MODULE, RTLD_NOW | RTLD_LOCAL);
    void* symbol = module == nullptr ? nullptr : dlsym(module, "sinewPictureFiles");
    if (symbol == nullptr) {
      const char* why = dlerror();
      throw ToolError(ExitCode::system, SINEW_PICTURE_MODULE,
                      "cannot be opened (" + std::string(why ? why : "empty") + ")",
                      "Keep it beside the program, and install OpenCV's imgcodecs and videoio.");
    }
    return *reinterpret_cast<const PictureFiles* (*)()>(symbol)();
  }();
  return files;
}

}  // namespace sinew::tools
