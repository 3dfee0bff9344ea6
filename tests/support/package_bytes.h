// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "sinew/formats/package.h"

namespace sinew::test {

/// A 64-byte aligned copy of exactly the given bytes, as PackageView::open() wants them; not a byte more, so that
/// AddressSanitizer sees every read beyond the end.
class AlignedBytes {
 public:
  explicit AlignedBytes(std::span<const std::byte> bytes);
  std::span<std::byte> span() { return {data_.get(), size_}; }
  std::span<const std::byte> span() const { return {data_.get(), size_}; }

 private:
  struct Release {
    void operator()(std::byte* bytes) const;
  };
  std::unique_ptr<std::byte, Release> data_;
  std::size_t size_;
};

/// Why a copy of `bytes` is refused; empty when it opens.
[[nodiscard]] std::string reasonOf(std::span<const std::byte> bytes);

/// Makes all checksums right again after bytes were changed; entries that reach outside the file keep theirs.
void reseal(std::span<std::byte> bytes);

/// The table entry of a section; fails the test when there is none.
[[nodiscard]] formats::SectionEntry entryOf(std::span<const std::byte> bytes, std::uint32_t id);

/// Replaces the table entry of the section that has entry.id (or `id` where the id itself changes). Does not reseal.
void setEntry(std::span<std::byte> bytes, std::uint32_t id, const formats::SectionEntry& entry);

}  // namespace sinew::test
