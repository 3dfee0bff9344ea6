// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pictures/decode_picture.h"

#include <fcntl.h>
#include <stb_image.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>
#include <vector>

#include "tools/core/text.h"
#include "tools/pictures/picture_files.h"

namespace sinew::tools {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kPngMagic = "\x89PNG\r\n\x1a\n";

std::string_view asText(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::size_t byteAt(std::string_view text, std::size_t at) { return static_cast<unsigned char>(text[at]); }

std::uint32_t numberAt(std::string_view text, std::size_t at, bool high_first) {
  std::uint32_t value = 0;
  for (std::size_t k = 0; k < 4; ++k) value |= std::uint32_t(byteAt(text, at + k)) << 8 * (high_first ? 3 - k : k);
  return value;
}

// PNG without its ancillary chunks (colour profiles and the like, which are not used), transparency apart. Other
// formats come back as they are, a PNG that is cut off comes back empty.
std::string strippedPng(std::string_view all) {
  if (!all.starts_with(kPngMagic)) return std::string(all);
  std::string kept(kPngMagic);
  for (std::size_t at = kPngMagic.size(); all.size() - at >= 12;) {
    const std::size_t length = numberAt(all, at, true);
    if (length > all.size() - at - 12) return {};
    const std::string_view name = all.substr(at + 4, 4);
    const bool ancillary = (byteAt(name, 0) & 0x20U) != 0;
    if (!ancillary || name == "tRNS") kept += all.substr(at, length + 12);
    at += length + 12;
    if (name == "IEND") return kept;
  }
  return {};
}

// Whether a JPEG goes on to its end marker: libjpeg fills up what is missing and calls it a picture.
bool hasJpegEnd(std::string_view jpeg) {
  for (std::size_t at = 2; at + 1 < jpeg.size();) {
    const std::size_t marker = byteAt(jpeg, at + 1);
    if (byteAt(jpeg, at) != 0xff || marker == 0xff) {
      ++at;
    } else if (marker == 0xd9) {
      return true;
    } else if (marker <= 1 || (marker >= 0xd0 && marker <= 0xd8)) {  // without a length
      at += 2;
    } else {
      if (at + 3 >= jpeg.size()) return false;
      at += 2 + (byteAt(jpeg, at + 2) << 8 | byteAt(jpeg, at + 3));
    }
  }
  return false;
}

// Whether the rows of an uncompressed TGA are there: stb does not look how many bytes of a row came.
bool hasTgaRows(std::string_view tga) {
  if (tga.size() < 18) return false;
  const std::size_t type = byteAt(tga, 2);
  if (type < 1 || type > 3) return true;
  const auto number = [&](std::size_t at) { return byteAt(tga, at) | byteAt(tga, at + 1) << 8; };
  const auto wholeBytes = [&](std::size_t at) { return (byteAt(tga, at) + 7) / 8; };
  const std::size_t palette = tga[1] != 0 ? number(5) * wholeBytes(7) : 0;
  return tga.size() >= 18 + byteAt(tga, 0) + palette + number(12) * number(14) * wholeBytes(16);
}

// Bytes for stb, which takes zeros where they end: remembers whether it wanted more than there are.
class StbSource {
 public:
  explicit StbSource(std::string_view bytes) : left_(bytes) {}
  bool wantedMore() const { return wanted_more_; }
  static stbi_io_callbacks callbacks() {
    return {[](void* self, char* out, int size) { return static_cast<StbSource*>(self)->read(out, std::size_t(size)); },
            [](void* self, int size) { static_cast<StbSource*>(self)->skip(std::size_t(std::max(size, 0))); },
            [](void* self) { return int(static_cast<StbSource*>(self)->left_.empty()); }};
  }

 private:
  static constexpr std::size_t kRefill = 128;  // stb asks for so many as a supply; for any other number it has a need

  int read(char* out, std::size_t size) {
    const std::size_t count = std::min(size, left_.size());
    wanted_more_ = wanted_more_ || count == 0 || (count < size && size != kRefill);
    std::memcpy(out, left_.data(), count);
    left_.remove_prefix(count);
    return int(count);
  }
  void skip(std::size_t size) { left_.remove_prefix(std::min(size, left_.size())); }

  std::string_view left_;
  bool wanted_more_ = false;
};

// For what OpenCV does not read: TGA, GIF, PSD. Not HDR: where one is cut off, stb waits for its runs for ever.
cv::Mat decodeByStb(std::string_view bytes) {
  const std::string mime = pictureMime(std::as_bytes(std::span(bytes)));
  if (mime == "image/vnd.radiance" || (mime.empty() && !hasTgaRows(bytes))) return {};
  StbSource source(bytes);
  const stbi_io_callbacks callbacks = StbSource::callbacks();
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> texels(
      stbi_load_from_callbacks(&callbacks, &source, &width, &height, &channels, 0), stbi_image_free);
  if (!texels || source.wantedMore()) return {};
  const cv::Mat picture(height, width, CV_8UC(channels), texels.get());
  cv::Mat out;
  if (channels == 1) return picture.clone();
  if (channels == 2) {
    const std::array<int, 8> from_to = {0, 0, 0, 1, 0, 2, 1, 3};
    out.create(height, width, CV_8UC4);
    cv::mixChannels(&picture, 1, &out, 1, from_to.data(), 4);
  } else {
    cv::cvtColor(picture, out, channels == 3 ? cv::COLOR_RGB2BGR : cv::COLOR_RGBA2BGRA);
  }
  return out;
}

// Keeps back what the picture libraries print about a broken file: the program says it in one line of its own.
class SilentStderr {
 public:
  SilentStderr() : alone_(mutex()), kept_(memfd_create("stderr", MFD_CLOEXEC)) {
    if (kept_ < 0) return;
    before_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3);
    if (before_ >= 0) dup2(kept_, STDERR_FILENO);
  }
  ~SilentStderr() {
    if (before_ >= 0) {
      dup2(before_, STDERR_FILENO);
      close(before_);
    }
    if (kept_ >= 0) close(kept_);
  }
  // The beginning of what was printed.
  std::string printed() const {
    std::string text(4096, '\0');
    text.resize(std::size_t(std::max<ssize_t>(pread(kept_, text.data(), text.size(), 0), 0)));
    return text;
  }
  SilentStderr(const SilentStderr&) = delete;
  SilentStderr& operator=(const SilentStderr&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex mutex;
    return mutex;
  }
  std::lock_guard<std::mutex> alone_;
  int kept_;
  int before_ = -1;
};

// How libjpeg warns of texels that it lost (jerror.h: JWRN_*), after which it goes on.
bool tellsDamage(std::string_view printed) {
  return printed.find("Corrupt JPEG data") != printed.npos || printed.find("Premature end of JPEG") != printed.npos;
}

// A picture's bytes for decoders; empty where it is cut off as far as its structure tells, or too large. A small file
// can declare more texels than there is memory.
std::string worthDecoding(std::span<const std::byte> bytes) {
  if (bytes.empty() || bytes.size() > std::size_t(std::numeric_limits<int>::max())) return {};
  const auto [width, height] = declaredSize(bytes);
  if (width > 0 && height > kMaxTexels / width) return {};
  if (pictureMime(bytes) == "image/jpeg" && !hasJpegEnd(asText(bytes))) return {};
  return strippedPng(asText(bytes));
}

struct Decoded {
  cv::Mat picture;
  bool damaged = false;
};

Decoded decoded(std::span<const std::byte> bytes) {
  const PictureFiles& codecs = pictureFiles();
  try {
    std::string encoded = worthDecoding(bytes);
    if (encoded.empty()) return {};
    Decoded made;
    try {
      const SilentStderr silent;
      made.picture = codecs.decode(cv::Mat(1, int(encoded.size()), CV_8U, encoded.data()));
      made.damaged = tellsDamage(silent.printed());
    } catch (const std::exception&) {  // not only OpenCV's: OpenEXR throws its own
    }
    if (made.picture.empty()) made.picture = decodeByStb(encoded);
    return std::int64_t(made.picture.total()) <= kMaxTexels ? made : Decoded();
  } catch (const std::exception&) {  // memory may not suffice
    return {};
  }
}

}  // namespace

std::string pictureMime(std::span<const std::byte> bytes, const std::string& name) {
  const std::string_view head = asText(bytes).substr(0, 16);
  const auto begins = [&](std::string_view magic) { return head.starts_with(magic); };
  if (begins(kPngMagic)) return "image/png";
  if (begins("\xff\xd8\xff")) return "image/jpeg";
  if (begins("GIF87a") || begins("GIF89a")) return "image/gif";
  if (begins("BM")) return "image/bmp";
  if (begins("RIFF") && head.substr(std::min<std::size_t>(head.size(), 8), 4) == "WEBP") return "image/webp";
  if (begins("II*\0"sv) || begins("MM\0*"sv)) return "image/tiff";
  if (begins("DDS ")) return "image/vnd-ms.dds";
  if (begins("\xabKTX 20\xbb")) return "image/ktx2";
  if (begins("#?RADIANCE") || begins("#?RGBE")) return "image/vnd.radiance";
  if (begins("v/1\x01")) return "image/x-exr";
  if (begins("8BPS")) return "image/vnd.adobe.photoshop";
  if (lowerCase(name).ends_with(".tga") && bytes.size() > 18) return "image/x-tga";
  return "";
}

std::array<std::int64_t, 2> declaredSize(std::span<const std::byte> bytes) {
  const std::string_view text = asText(bytes);
  if (text.starts_with("v/1\x01")) {
    constexpr std::string_view kWindow = "dataWindow\0box2i\0"sv;
    const std::size_t at = text.find(kWindow);
    if (at == text.npos || text.size() < at + kWindow.size() + 20) return {0, 0};
    const auto corner = [&](std::size_t i) {
      return std::int64_t(std::int32_t(numberAt(text, at + kWindow.size() + 4 + 4 * i, false)));
    };
    return {corner(2) - corner(0) + 1, corner(3) - corner(1) + 1};
  }
  if (text.starts_with(kPngMagic) && text.size() >= 24) return {numberAt(text, 16, true), numberAt(text, 20, true)};
  int width = 0, height = 0, channels = 0;
  const auto size = int(std::min<std::size_t>(bytes.size(), std::numeric_limits<int>::max()));
  const auto* const data = reinterpret_cast<const stbi_uc*>(bytes.data());
  if (stbi_info_from_memory(data, size, &width, &height, &channels) == 0) return {0, 0};
  return {width, height};
}

cv::Mat decodePicture(std::span<const std::byte> bytes) { return decoded(bytes).picture; }

PictureState pictureState(std::span<const std::byte> bytes) {
  const Decoded made = decoded(bytes);
  return made.picture.empty() ? PictureState::unread : made.damaged ? PictureState::damaged : PictureState::whole;
}

bool isWholeByStb(std::span<const std::byte> bytes) {
  try {
    const std::string encoded = worthDecoding(bytes);
    // Of a JPEG only libjpeg says what is damaged.
    return !encoded.empty() && pictureMime(bytes) != "image/jpeg" && !decodeByStb(encoded).empty();
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace sinew::tools
