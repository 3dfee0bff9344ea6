// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/textures.h"

#include <algorithm>
#include <fstream>
#include <optional>

#include "tools/core/text.h"
#include "tools/pictures/decode_picture.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

bool isFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

}  // namespace

CompanionPath::CompanionPath(std::string name) {
  if (name.starts_with("file://")) name.erase(0, 7);
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.find('\0') != name.npos) name.clear();
  written = fs::path(name).lexically_normal();
  const bool drive = name.size() > 1 && name[1] == ':';
  outside = drive || written.is_absolute() || written.empty() || *written.begin() == "..";
}

std::optional<fs::path> fileBelow(const fs::path& folder, const fs::path& relative) {
  if (relative.empty()) return std::nullopt;
  if (isFile(folder / relative)) return folder / relative;
  fs::path at = folder.empty() ? fs::path(".") : folder;
  for (const fs::path& name : relative) {
    std::error_code error;
    if (fs::exists(at / name, error)) {
      at /= name;
      continue;
    }
    std::vector<fs::path> matches;
    for (fs::directory_iterator it(at, error), end; !error && it != end; it.increment(error))
      if (lowerCase(it->path().filename().string()) == lowerCase(name.string())) matches.push_back(it->path());
    if (matches.empty()) return std::nullopt;
    at = *std::min_element(matches.begin(), matches.end());
  }
  return isFile(at) ? std::optional(at) : std::nullopt;
}

TextureSource loadTexture(const RawTexture& texture, const fs::path& folder, std::vector<Finding>& findings) {
  TextureSource out;
  out.name = texture.name;
  const auto complain = [&](const char* id, const std::string& message, const std::string& cure) {
    findings.push_back({id,
                        Severity::warning,
                        message,
                        1,
                        "",
                        {},
                        asUtf8(texture.path.empty() ? texture.name : texture.path),
                        asUtf8(cure)});
  };
  if (texture.path.empty()) {
    out.bytes = texture.bytes;
  } else {
    const CompanionPath wanted(texture.path);
    const fs::path last = wanted.written.filename();
    std::optional<fs::path> found;
    if (!wanted.outside) found = fileBelow(folder, wanted.written);
    if (!found) found = fileBelow(folder, last);
    if (!found && !last.empty()) found = fileBelow(folder, fs::path("textures") / last);
    if (!found) {
      complain("missing-texture",
               "the texture " + texture.path + " is missing; the material keeps its colour" +
                   (wanted.outside ? " (a place outside the file's folder is not read)" : ""),
               "Put " + (last.empty() ? std::string("the picture") : last.string()) + " beside the file.");
      return out;
    }
    std::error_code error;
    const std::uint64_t size = fs::file_size(*found, error);
    if (error || size > kMaxTextureBytes) {
      complain("texture-too-large", "the texture " + texture.path + " is larger than 64 MB and was left out",
               "Reduce the picture.");
      return out;
    }
    std::ifstream in(*found, std::ios::binary);
    out.bytes.resize(size);
    in.read(reinterpret_cast<char*>(out.bytes.data()), std::streamsize(size));
    if (!in && size > 0) {
      out.bytes.clear();
      complain("missing-texture", "the texture " + texture.path + " cannot be read; the material keeps its colour",
               "Check the file's permissions.");
      return out;
    }
  }
  if (out.bytes.size() > kMaxTextureBytes) {
    out.bytes.clear();
    complain("texture-too-large", "the texture " + out.name + " is larger than 64 MB and was left out",
             "Reduce the picture.");
    return out;
  }
  out.mime = pictureMime(out.bytes, texture.path.empty() ? texture.name : texture.path);
  if (out.mime.empty()) {
    out.bytes.clear();
    complain("unknown-texture", "the texture " + out.name + " is no picture of a known kind and was left out",
             "Save it as PNG or JPEG.");
  }
  return out;
}

}  // namespace sinew::tools
