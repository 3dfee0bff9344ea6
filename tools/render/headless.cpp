// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/headless.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <array>
#include <cstdio>
#include <string>

#include "tools/core/error.h"

namespace sinew::tools {

namespace {

[[noreturn]] void fail(const char* what) {
  std::array<char, 16> code{};
  std::snprintf(code.data(), code.size(), "EGL 0x%04x", static_cast<unsigned>(eglGetError()));
  throw ToolError(ExitCode::system, "",
                  std::string("pictures cannot be drawn here: ") + what + " (" + code.data() + ")",
                  "Install Mesa's EGL and its software renderer (Debian: libegl1 libgl1-mesa-dri).");
}

}  // namespace

HeadlessContext::HeadlessContext() {
  if (!epoxy_has_egl_extension(EGL_NO_DISPLAY, "EGL_MESA_platform_surfaceless")) {
    fail("EGL has no platform that works without a display (EGL_MESA_platform_surfaceless)");
  }
  EGLDisplay display = eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display == EGL_NO_DISPLAY) fail("EGL gives no display");
  if (eglInitialize(display, nullptr, nullptr) != EGL_TRUE) fail("EGL does not start");
  display_ = display;
  if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE) {
    eglTerminate(display);
    fail("EGL has no OpenGL");
  }
  const std::array<EGLint, 9> attributes = {
      EGL_CONTEXT_MAJOR_VERSION,           3,       EGL_CONTEXT_MINOR_VERSION, 3, EGL_CONTEXT_OPENGL_PROFILE_MASK,
      EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT, EGL_NONE};
  EGLContext context = eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes.data());
  if (context == EGL_NO_CONTEXT) {
    eglTerminate(display);
    fail("there is no OpenGL 3.3 core context");
  }
  context_ = context;
  if (eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context) != EGL_TRUE) {
    eglDestroyContext(display, context);
    eglTerminate(display);
    fail("the OpenGL context cannot be used without a surface");
  }
}

HeadlessContext::~HeadlessContext() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
  eglTerminate(display_);
}

}  // namespace sinew::tools
