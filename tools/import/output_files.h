// SPDX-License-Identifier: GPL-3.0-or-later
//
// What is written: under which names, and over which files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <string>
#include <string_view>

namespace sinew::tools {

enum class Output : std::uint8_t { package, picture, picture_or_video, mesh, report, scene, page, times };

/// A chunk of each PNG that sinew writes (PNG 1.2, 3.2 and 4.2.3.1): length, tEXt, keyword and text, CRC.
inline constexpr std::string_view kPictureMark{
    "\0\0\0\x0e"
    "tEXt"
    "Software\0"
    "Sinew"
    "\x05\x6d\x8a\x47",
    26};

/// SOURCE.obj -> SOURCE.sinew
std::string packageName(std::filesystem::path file);

/// Whether a file lies there that holds something and is none of these that sinew wrote (of videos: no MP4).
bool isForeign(Output what, const std::filesystem::path& file);

/// Throws ToolError where `file` cannot be written (requireWritable), its name is that of something else (a package or
/// a report named like a mesh or a picture, a picture that does not end in .png), or isForeign() says that somebody's
/// work lies there. A file that ends in .sinew is a package, a damaged one too. To be called before any work.
void requireOutput(Output what, const std::filesystem::path& file,
                   std::initializer_list<std::filesystem::path> inputs = {});

}  // namespace sinew::tools
