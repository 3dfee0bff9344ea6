// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>

namespace sinew::formats {

/// The name of a section, four times \xHH at most.
struct SectionName {
  explicit SectionName(std::uint32_t id);
  char text[17];
};

/// The reason why bytes are refused. Reasons are put together by printf's formats, by these few functions: text built
/// at each of the hundred places that can refuse was half of the reader's code. All return false.
class Refusal {
 public:
  [[gnu::format(printf, 2, 3)]] bool operator()(const char* format, ...);
  bool operator()(std::uint32_t section, const char* what);
  bool operator()(std::uint32_t section, std::size_t element, const char* what);
  [[gnu::format(printf, 3, 4)]] bool section(std::uint32_t section, const char* format, ...);

  const char* reason() const { return reason_; }

 private:
  char reason_[320] = "";
};

}  // namespace sinew::formats
