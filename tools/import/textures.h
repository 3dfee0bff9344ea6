// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/import/raw_scene.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A picture larger than this is left out, and one of more texels is not unpacked: a texture is bytes from a stranger.
inline constexpr std::uint64_t kMaxTextureBytes = 64U << 20;
inline constexpr std::int64_t kMaxTexels = std::int64_t{1} << 28;

/// Red, green, blue, alpha of each texel, rows from top to bottom; empty where there is no picture.
struct Texels {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;
};

/// Unpacks what OpenCV does not read: TGA and GIF. Empty where the bytes are no picture or too large a one.
Texels decodeByStb(std::span<const std::byte> bytes);

/// "image/png", ... by a picture's first bytes; by the name's ending where bytes do not tell (TGA); else empty.
std::string pictureMime(const std::vector<std::byte>& bytes, const std::string& name);

/// A file's name as another file wrote it, with `\` as `/`.
struct CompanionPath {
  explicit CompanionPath(std::string name);
  std::filesystem::path written;
  bool outside = false;  ///< of the writer's folder, so not read: a file someone sent may not have the whole disk read
};

/// `relative` below `folder`, each of its names without regard to case where it does not exist as written.
std::optional<std::filesystem::path> fileBelow(const std::filesystem::path& folder,
                                               const std::filesystem::path& relative);

/// Brings the picture of one texture: embedded bytes as they are; else the file below `folder`, looked for as written
/// (with `\` as `/`), then by its last name in the folder and in its "textures", then the same without regard to case.
/// Nothing outside the folder is read. Adds a finding where the picture is missing, too large or of no known kind.
TextureSource loadTexture(const RawTexture& texture, const std::filesystem::path& folder,
                          std::vector<Finding>& findings);

}  // namespace sinew::tools
