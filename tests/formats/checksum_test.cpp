// SPDX-License-Identifier: MIT
#include "sinew/formats/checksum.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>
#include <vector>

namespace sinew::formats {
namespace {

std::vector<std::byte> counting(std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = std::byte(i * 131 % 251);
  return bytes;
}

TEST(Checksum, IsXxh3) {
  // The empty input's value as the xxHash specification gives it.
  EXPECT_EQ(checksum({}), 0x2d06800538d394c2U);
}

// The file is also what the Python reader's own XXH3 is tested with, and what docs/package-format.md points to.
TEST(Checksum, MatchesTheValuesOfEveryLengthClass) {
  std::ifstream file(std::string(SINEW_GOLDEN) + "/xxh3.txt");
  std::size_t size = 0, lines = 0;
  std::string value;
  while (file >> std::dec >> size >> value) {
    char text[17];
    std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(checksum(counting(size))));
    EXPECT_EQ(text, value) << "of " << size << " bytes";
    ++lines;
  }
  EXPECT_GT(lines, 250U);
}

TEST(Checksum, OfTwoRunsIsThatOfTheirConcatenation) {
  for (const std::size_t size : {0U, 1U, 64U, 128U, 240U, 241U, 1024U, 1025U, 5000U}) {
    const std::vector<std::byte> bytes = counting(size);
    const std::span<const std::byte> all{bytes};
    for (std::size_t cut = 0; cut <= size; cut += 61) {
      EXPECT_EQ(checksum(all.first(cut), all.subspan(cut)), checksum(all)) << size << " cut at " << cut;
    }
  }
}

}  // namespace
}  // namespace sinew::formats
