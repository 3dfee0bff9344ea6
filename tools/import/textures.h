// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/import/raw_scene.h"
#include "tools/import/visual_mesh.h"
#include "tools/pictures/decode_picture.h"

namespace sinew::tools {

/// A picture larger than this is left out: a texture is bytes from a stranger.
inline constexpr std::uint64_t kMaxTextureBytes = 64U << 20;

/// The finding about a picture that is carried and cannot be drawn, or not as it was meant.
struct PictureRemark {
  PictureState state;
  const char* id;
  const char* message;
};
inline constexpr std::array<PictureRemark, 2> kPictureRemarks = {
    {{PictureState::unread, "texture-not-read",
      "cannot be read whole here: pictures show the material's colour; the package has the bytes as they are"},
     {PictureState::damaged, "texture-damaged",
      "came with damage: pictures show what can be read; the package has the bytes as they are"}}};
inline constexpr const char* kPictureCure = "Open it in a paint program and save it anew as PNG, JPEG or TGA.";

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
