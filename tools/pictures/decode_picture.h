// SPDX-License-Identifier: GPL-3.0-or-later
//
// The one way in which pictures are read: textures, masks, what is drawn and what is checked.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace cv {
class Mat;
}

namespace sinew::tools {

/// A picture of more texels is not unpacked: it is bytes from a stranger.
inline constexpr std::int64_t kMaxTexels = std::int64_t{1} << 28;

/// "image/png", ... by a picture's first bytes; by the name's ending where bytes do not tell (TGA); else empty.
std::string pictureMime(std::span<const std::byte> bytes, const std::string& name = {});

/// Width and height by the head of a picture; {0, 0} where it does not say (TIFF, WebP) or is none.
std::array<std::int64_t, 2> declaredSize(std::span<const std::byte> bytes);

/// The picture as its file stores it: 1 to 4 channels (blue, green, red, alpha), of 8 or 16 bit or float. Empty where
/// the bytes are no picture, are cut off or broken, or have more than kMaxTexels. Prints nothing.
/// Throws ToolError(system) where the codecs cannot be opened.
cv::Mat decodePicture(std::span<const std::byte> bytes);

enum class PictureState : char { unread, whole, damaged };

/// What decodePicture() makes of it; damaged: a JPEG in which texels were lost on the way, read nevertheless.
PictureState pictureState(std::span<const std::byte> bytes);

/// Whether it is whole, tried without opening the codecs (which takes longer than most pictures): false may mean that
/// they are needed, as for JPEG, TIFF, WebP, EXR and HDR.
bool isWholeByStb(std::span<const std::byte> bytes);

}  // namespace sinew::tools
