// SPDX-License-Identifier: MIT
#include "sinew/formats/writer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string_view>

#include "content_sections.h"
#include "packing.h"
#include "section_rules.h"
#include "sinew/formats/checksum.h"
#include "sinew/formats/version.h"

namespace sinew::formats {
namespace {

struct Payload {
  const void* data = nullptr;
  std::size_t count = 0;
};

Payload payloadOf(const PackageContent& content, std::uint32_t id) {
  Payload result;
  if (id == section::info) return {&content.info, 1};
  withSection(content, id, [&](const auto& items) { result = {items.data(), items.size()}; });
  return result;
}

}  // namespace

StringRef PackageContent::addText(std::string_view text) {
  if (text.empty()) return {0, 0};
  // Of many names (a source can have a hundred thousand groups) only the first are searched for parts of themselves.
  constexpr std::size_t kSearched = 65536;
  const std::string_view pool{strings.data(), std::min(strings.size(), kSearched)};
  std::size_t offset = pool.find(text);
  if (offset == std::string_view::npos) {
    const auto known = texts_behind.find(text);
    if (known != texts_behind.end()) return known->second;
    offset = strings.size();
    if (text.size() > std::numeric_limits<std::uint32_t>::max() - offset) {
      throw std::length_error("the texts of a package exceed 4 GiB");
    }
    strings.insert(strings.end(), text.begin(), text.end());
    if (strings.size() > kSearched) {
      texts_behind.emplace(text,
                           StringRef{static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(text.size())});
    }
  }
  return {static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(text.size())};
}

std::vector<std::byte> writePackage(const PackageContent& content, bool packed) {
  std::vector<std::byte> bytes;
  const auto memory = [&bytes](std::size_t count) {
    bytes.resize(count);
    return bytes.data();
  };
  writePackage(content, memory, packed);
  return bytes;
}

void writePackage(const PackageContent& content, const std::function<std::byte*(std::size_t)>& memory, bool packed) {
  struct Part {
    const SectionRule* rule;
    Payload payload;
    std::uint32_t flags, element_bytes;
    std::vector<std::byte> owned;  // of a packed one
  };
  std::vector<Part> parts;
  Header header{};
  header.magic = kMagic;
  header.format_version = kFormatVersion;
  header.header_bytes = sizeof(Header);
  for (const SectionRule& rule : kSectionRules) {
    const Payload plain = payloadOf(content, rule.id);
    if (plain.count == 0) continue;
    header.features |= rule.feature;
    Part& part = parts.emplace_back(Part{&rule, plain, rule.flags, rule.element_bytes, {}});
    if (!packed || !rule.packing.possible()) continue;
    std::uint32_t width = 0;
    part.owned =
        pack(rule.packing, {static_cast<const std::byte*>(plain.data), plain.count * rule.element_bytes}, width);
    if (part.owned.empty()) continue;
    part.payload.data = part.owned.data();
    part.flags |= kSectionPacked;
    part.element_bytes = rule.packing.bytes(width);
  }
  header.section_count = static_cast<std::uint32_t>(parts.size());
  const std::size_t table_bytes = parts.size() * sizeof(SectionEntry);
  std::uint64_t end = alignedSize(sizeof(Header) + table_bytes);
  for (const Part& part : parts) end += alignedSize(part.payload.count * part.element_bytes);
  header.total_bytes = end;

  const std::span<std::byte> all{memory(end), end};
  std::uint64_t offset = alignedSize(sizeof(Header) + table_bytes);
  const auto pad = [all](std::uint64_t behind, std::uint64_t to) {
    std::fill(all.data() + behind, all.data() + to, std::byte{0});
  };
  pad(sizeof(Header) + table_bytes, offset);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& part = parts[i];
    SectionEntry entry{};
    entry.id = part.rule->id;
    entry.flags = part.flags;
    entry.offset = offset;
    entry.bytes = part.payload.count * part.element_bytes;
    entry.element_count = part.payload.count;
    entry.element_bytes = part.element_bytes;
    std::memcpy(all.data() + offset, part.payload.data, entry.bytes);
    pad(offset + entry.bytes, offset + alignedSize(entry.bytes));
    entry.checksum = checksum(all.subspan(offset, alignedSize(entry.bytes)));
    std::memcpy(all.data() + sizeof(Header) + i * sizeof(SectionEntry), &entry, sizeof entry);
    offset += alignedSize(entry.bytes);
  }
  header.checksum = checksum(std::as_bytes(std::span{&header, 1}), all.subspan(sizeof(Header), table_bytes));
  std::memcpy(all.data(), &header, sizeof header);
}

}  // namespace sinew::formats
