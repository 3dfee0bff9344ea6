// SPDX-License-Identifier: MIT
#pragma once

/// Marks what a shared library shows. All else stays hidden (the library is built with -fvisibility=hidden).
#if defined(_WIN32)
#define SINEW_API
#else
#define SINEW_API __attribute__((visibility("default")))
#endif
