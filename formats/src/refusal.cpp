// SPDX-License-Identifier: MIT
#include "refusal.h"

#include <cstdarg>
#include <cstdio>

namespace sinew::formats {

SectionName::SectionName(std::uint32_t id) {
  char* at = text;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    const unsigned byte = (id >> shift) & 0xffU;
    const bool prints = byte > 0x20U && byte < 0x7fU;
    at += std::snprintf(at, 5, prints ? "%c" : "\\x%02x", byte);
  }
}

bool Refusal::operator()(const char* format, ...) {
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(reason_, sizeof reason_, format, arguments);
  va_end(arguments);
  return false;
}

bool Refusal::operator()(std::uint32_t section, const char* what) {
  return (*this)("section %s: %s", SectionName(section).text, what);
}

bool Refusal::operator()(std::uint32_t section, std::size_t element, const char* what) {
  return (*this)("section %s, element %zu: %s", SectionName(section).text, element, what);
}

bool Refusal::section(std::uint32_t section, const char* format, ...) {
  char line[256];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  return (*this)(section, line);
}

}  // namespace sinew::formats
