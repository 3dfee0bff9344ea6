// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/textures.h"

#include <stb_image.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <memory>
#include <optional>
#include <string_view>

#include "tools/core/text.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

bool isFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Size and shape by the head of a picture; false where it is none that stb knows, or too large a one.
bool headByStb(std::span<const std::byte> bytes, int& width, int& height) {
  int channels = 0;
  if (bytes.size() > kMaxTextureBytes) return false;
  const auto* const data = reinterpret_cast<const stbi_uc*>(bytes.data());
  return stbi_info_from_memory(data, int(bytes.size()), &width, &height, &channels) != 0 &&
         std::int64_t(width) * height <= kMaxTexels;
}

// Whether a picture of a kind can be drawn. TGA and GIF are unpacked to find out, of PNG, JPEG and BMP the head is
// read.
bool canBeDrawn(std::span<const std::byte> bytes, const std::string& mime) {
  if (mime == "image/vnd-ms.dds" || mime == "image/ktx2") return false;
  if (mime == "image/webp" || mime == "image/tiff" || mime == "image/vnd.radiance" || mime == "image/x-exr")
    return true;
  if (mime == "image/x-tga" || mime == "image/gif") return !decodeByStb(bytes).rgba.empty();
  int width = 0, height = 0;
  return headByStb(bytes, width, height);
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

Texels decodeByStb(std::span<const std::byte> bytes) {
  Texels texels;
  if (!headByStb(bytes, texels.width, texels.height)) return {};
  int channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> rgba(
      stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()), int(bytes.size()), &texels.width,
                            &texels.height, &channels, 4),
      stbi_image_free);
  if (!rgba) return {};
  texels.rgba.assign(rgba.get(), rgba.get() + std::size_t(texels.width) * std::size_t(texels.height) * 4);
  return texels;
}

std::string pictureMime(const std::vector<std::byte>& bytes, const std::string& name) {
  const std::string_view head(reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 16));
  const auto begins = [&](std::string_view magic) { return head.starts_with(magic); };
  if (begins("\x89PNG\r\n\x1a\n")) return "image/png";
  if (begins("\xff\xd8\xff")) return "image/jpeg";
  if (begins("GIF8")) return "image/gif";
  if (begins("BM")) return "image/bmp";
  if (begins("RIFF") && head.size() >= 12 && head.substr(8, 4) == "WEBP") return "image/webp";
  if (begins(std::string_view("II*\0", 4)) || begins(std::string_view("MM\0*", 4))) return "image/tiff";
  if (begins("DDS ")) return "image/vnd-ms.dds";
  if (begins("\xabKTX 20\xbb")) return "image/ktx2";
  if (begins("#?RADIANCE")) return "image/vnd.radiance";
  if (begins("v/1\x01")) return "image/x-exr";
  if (lowerCase(name).ends_with(".tga") && bytes.size() > 18) return "image/x-tga";
  return "";
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
  } else if (!canBeDrawn(out.bytes, out.mime)) {
    complain("texture-not-read",
             "the texture " + out.name + " (" + out.mime +
                 ") cannot be read here: pictures show the material's colour; " + "the package carries it as it is",
             "Save it as PNG, JPEG or TGA.");
  }
  return out;
}

}  // namespace sinew::tools
