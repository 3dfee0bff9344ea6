// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <vector>

#include "tools/render/draw_model.h"

namespace sinew::tools {

/// A texture with all its mip levels, finest first, rows from bottom to top (v up).
struct PreparedTexture {
  std::vector<TexturePixels> levels;  ///< empty where the picture could not be decoded
  bool cutout = false;                ///< its alpha says where the surface is (hair cards, lashes, fins)
};

/// Makes the mip levels of a texture so that no seam shows: texels that no triangle uses take the colour of the nearest
/// used ones (coarser levels, pull-push), so nothing bleeds in from the gaps between UV islands. Averages are made in
/// linear light. The alpha counts as a cut-out only where it is nearly two-valued over what triangles use; files often
/// carry other things in it.
PreparedTexture prepareTexture(const DrawModel& model, std::uint32_t texture);

/// Uploads it (sRGB, trilinear, repeating) into an OpenGL texture name.
void uploadTexture(unsigned int name, const PreparedTexture& texture);

}  // namespace sinew::tools
