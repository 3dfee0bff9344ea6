// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/import/raw_scene.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A picture larger than this is left out.
inline constexpr std::uint64_t kMaxTextureBytes = 64U << 20;

/// "image/png", ... by a picture's first bytes; by the name's ending where bytes do not tell (TGA); else empty.
std::string pictureMime(const std::vector<std::byte>& bytes, const std::string& name);

/// Brings the picture of one texture: embedded bytes as they are; else the file below `folder`, looked for as written
/// (with `\` as `/`), then by its last name in the folder and in its "textures", then the same without regard to case.
/// Nothing outside the folder is read. Adds a finding where the picture is missing, too large or of no known kind.
TextureSource loadTexture(const RawTexture& texture, const std::filesystem::path& folder,
                          std::vector<Finding>& findings);

}  // namespace sinew::tools
