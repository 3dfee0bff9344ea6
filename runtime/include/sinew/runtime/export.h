// SPDX-License-Identifier: MIT
#pragma once

/// Marks what a shared library shows. All else stays hidden (the library is built with -fvisibility=hidden).
/// SINEW_HIDDEN marks what belongs to such a class and yet is the library's own.
#if defined(_WIN32)
#define SINEW_API
#define SINEW_HIDDEN
#else
#define SINEW_API __attribute__((visibility("default")))
#define SINEW_HIDDEN __attribute__((visibility("hidden")))
#endif
