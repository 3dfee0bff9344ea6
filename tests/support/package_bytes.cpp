// SPDX-License-Identifier: MIT
#include "tests/support/package_bytes.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>

#include "formats/src/section_rules.h"
#include "sinew/formats/checksum.h"

namespace sinew::test {
namespace {

using formats::Header;
using formats::SectionEntry;

std::size_t entryOffset(std::span<const std::byte> bytes, std::uint32_t id) {
  Header header;
  std::memcpy(&header, bytes.data(), sizeof header);
  for (std::size_t i = 0; i < header.section_count; ++i) {
    SectionEntry entry;
    std::memcpy(&entry, bytes.data() + sizeof header + i * sizeof entry, sizeof entry);
    if (entry.id == id) return sizeof header + i * sizeof entry;
  }
  throw std::out_of_range("no section " + formats::sectionName(id));
}

}  // namespace

AlignedBytes::AlignedBytes(std::span<const std::byte> bytes)
    : data_(static_cast<std::byte*>(::operator new (bytes.size(), std::align_val_t{formats::kSectionAlignment}))),
      size_(bytes.size()) {
  std::copy(bytes.begin(), bytes.end(), data_.get());
}

void AlignedBytes::Release::operator()(std::byte* bytes) const {
  ::operator delete (bytes, std::align_val_t{formats::kSectionAlignment});
}

std::string reasonOf(std::span<const std::byte> bytes) {
  const AlignedBytes copy(bytes);
  formats::PackageView view;
  return formats::PackageView::open(copy.span(), view).reason;
}

void reseal(std::span<std::byte> bytes) {
  if (bytes.size() < sizeof(Header)) return;
  Header header;
  std::memcpy(&header, bytes.data(), sizeof header);
  const std::size_t count =
      std::min<std::size_t>(header.section_count, (bytes.size() - sizeof header) / sizeof(SectionEntry));
  for (std::size_t i = 0; i < count; ++i) {
    SectionEntry entry;
    std::byte* at = bytes.data() + sizeof header + i * sizeof entry;
    std::memcpy(&entry, at, sizeof entry);
    if (entry.offset > bytes.size() || entry.bytes > bytes.size() - entry.offset ||
        formats::alignedSize(entry.bytes) > bytes.size() - entry.offset) {
      continue;
    }
    entry.checksum = formats::checksum(bytes.subspan(entry.offset, formats::alignedSize(entry.bytes)));
    std::memcpy(at, &entry, sizeof entry);
  }
  header.checksum = 0;
  header.checksum = formats::checksum(std::as_bytes(std::span{&header, 1}),
                                      bytes.subspan(sizeof header, count * sizeof(SectionEntry)));
  std::memcpy(bytes.data(), &header, sizeof header);
}

SectionEntry entryOf(std::span<const std::byte> bytes, std::uint32_t id) {
  SectionEntry entry;
  std::memcpy(&entry, bytes.data() + entryOffset(bytes, id), sizeof entry);
  return entry;
}

void setEntry(std::span<std::byte> bytes, std::uint32_t id, const SectionEntry& entry) {
  std::memcpy(bytes.data() + entryOffset(bytes, id), &entry, sizeof entry);
}

}  // namespace sinew::test
