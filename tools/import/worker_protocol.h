// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace sinew::tools {

/// The first byte the worker writes: a scene follows, or two texts (what, cure; each a 32-bit length and bytes).
enum class WorkerAnswer : std::uint8_t { scene = 1, complaint = 2 };

/// In place of a mesh's format: FD is a socket, from which come pictures (a 64-bit length and bytes). Each is answered
/// by one byte, 1 where it can be read, before the next.
inline constexpr const char* kPicturesFormat = "pictures";

inline constexpr int kWorkerUsage = 64;
inline constexpr int kWorkerOutOfMemory = 70;

/// Sanitizers reserve terabytes of address space and speak on stderr: no bound on the one, no silence on the other.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kSanitized = true;
#else
inline constexpr bool kSanitized = false;
#endif

}  // namespace sinew::tools
