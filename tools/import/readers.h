// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/import/raw_scene.h"

/// The readers run in the child process. Each turns a whole file into a RawScene or throws ReadError (std::bad_alloc
/// where memory ends). OBJ, PLY, STL, OFF and glTF are read here and not by assimp, because assimp loses what the rest
/// of the program stands on: OBJ vertex numbers and second group names, double precision, PLY strips, glTF custom
/// attributes, extras and quantized positions; and it crashes on broken ones.
namespace sinew::tools {

/// A complaint about a word that is no number; of a decimal comma the cure says so.
/// \param of what has it, empty = the file.
/// \param place where it stands, in brackets, with a blank before it; may be empty.
ReadError noNumber(const std::string& of, std::string_view word, const std::string& place);

/// Likely format of a mesh file's text: "PLY", "OFF", "OBJ", "STL"; empty where it cannot be told.
std::string formatOfText(std::string_view text);
/// A complaint about a file that is named as `named` and looks like `other`.
ReadError looksLike(const std::string& other, const std::string& named);

/// The first 40 letters as UTF-8, which a message may quote; what is no text is `?`.
std::string quotable(std::string_view text);
/// Lines that nobody can read and that were left out.
/// \param of where they stand, as " of the header"; may be empty.
/// \param whose as "a PLY can say".
/// \param first the first of them, with its place.
Finding skippedLines(const char* id, std::uint64_t count, const std::string& of, const std::string& whose,
                     const std::string& first, const std::string& remark);

/// Bytes behind the last thing that a binary file promises.
/// \param things what would be missing if the file were read wrongly: "triangles".
Finding trailingBytes(std::uint64_t count, const std::string& last, const std::string& things);

/// Brings colours to 0..1 where any number is 2 or more: then all are of 0..255.
void colorsFromBytes(std::vector<std::array<float, 4>>& colors);

/// A file that lies beside the source (material library, glTF buffer): as written, else its last name in the folder,
/// else the same without regard to case. Empty optional where it cannot be read.
/// \param limit in bytes; a larger file counts as unreadable.
std::optional<std::string> readCompanionFile(const std::filesystem::path& folder, const std::string& name,
                                             std::uint64_t limit);

/// \param folder where material libraries lie.
/// \param stem names what the file leaves without a name.
RawScene readObj(std::string_view text, const std::filesystem::path& folder, const std::string& stem);
/// ASCII and binary of both byte orders; faces, tristrips; colours, normals, UVs, wedge UVs; other scalars as
/// attributes.
RawScene readPly(std::string_view bytes, const std::string& stem);
/// ASCII and binary; three source vertices a triangle; facet normals are left out, as they say nothing new.
RawScene readStl(std::string_view bytes, const std::string& stem);
/// OFF with C, N, ST prefixes, text only.
RawScene readOff(std::string_view text, const std::string& stem);
/// glTF 2.0, text or GLB.
RawScene readGltf(std::string_view bytes, const std::filesystem::path& folder);
/// FBX, DAE and OGRE through assimp.
RawScene readWithAssimp(const std::filesystem::path& file, const std::string& format);

}  // namespace sinew::tools
