// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/gltf_text.h"

namespace sinew::tools {

void unsupportedExtension(const std::string& name, const std::string& path) {
  const bool compressed =
      name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression" || name == "KHR_meshopt_compression";
  throw ReadError("needs the glTF extension " + name + ", which is not supported (at " + path + ")",
                  compressed ? "Export it without mesh compression." : "Export it without that extension.");
}

std::string percentDecoded(std::string_view text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && digit(text[i + 1]) >= 0 && digit(text[i + 2]) >= 0) {
      out += char(digit(text[i + 1]) * 16 + digit(text[i + 2]));
      i += 2;
    } else {
      out += text[i];
    }
  }
  return out;
}

std::optional<std::string> dataUri(std::string_view uri) {
  if (!uri.starts_with("data:")) return std::nullopt;
  const std::size_t comma = uri.find(',');
  if (comma == uri.npos) return std::nullopt;
  const std::string body = percentDecoded(uri.substr(comma + 1));
  if (!uri.substr(0, comma).ends_with(";base64")) return body;
  std::string out;
  out.reserve(body.size() / 4 * 3);
  std::uint32_t bits = 0;
  int held = 0;
  for (char c : body) {
    std::uint32_t six = 0;
    if (c >= 'A' && c <= 'Z') {
      six = std::uint32_t(c - 'A');
    } else if (c >= 'a' && c <= 'z') {
      six = std::uint32_t(c - 'a') + 26;
    } else if (c >= '0' && c <= '9') {
      six = std::uint32_t(c - '0') + 52;
    } else if (c == '+' || c == '-') {
      six = 62;
    } else if (c == '/' || c == '_') {
      six = 63;
    } else if (c == '=') {
      break;
    } else if (c == ' ' || c == '\n' || c == '\r' || c == '\t') {
      continue;  // as from encoders that break lines
    } else {
      return std::nullopt;
    }
    bits = bits << 6 | six;
    held += 6;
    if (held >= 8) {
      held -= 8;
      out += char(bits >> held & 255U);
    }
  }
  return out;
}

bool tooDeep(std::string_view text) {
  std::uint32_t depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      if (c == '"') quoted = false;
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      if (++depth > kMaxDepth) return true;
    } else if ((c == '}' || c == ']') && depth > 0) {
      --depth;
    }
  }
  return false;
}
}  // namespace sinew::tools
