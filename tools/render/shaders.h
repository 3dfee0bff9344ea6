// SPDX-License-Identifier: GPL-3.0-or-later
//
// The GLSL of the renderer. Light is computed in linear RGB; the target encodes to sRGB on write.
#pragma once

namespace sinew::tools::shaders {

extern const char* const kMeshVertex;
extern const char* const kMeshFragment;
extern const char* const kDepthVertex;
extern const char* const kDepthFragment;
extern const char* const kScreenVertex;
extern const char* const kBackgroundFragment;
extern const char* const kPresentFragment;
extern const char* const kGroundVertex;
extern const char* const kGroundFragment;
extern const char* const kLineVertex;
extern const char* const kLineFragment;
extern const char* const kDotVertex;
extern const char* const kDotFragment;

}  // namespace sinew::tools::shaders
