// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace sinew::formats {

/// Version of the package format. A reader refuses a package whose version differs and names both.
inline constexpr std::uint32_t kFormatVersion = 3;

/// Version of this library and its tools, as written into packages and shown by `sinew --version`.
inline constexpr const char* kSoftwareVersion = "0.1.0";

}  // namespace sinew::formats
