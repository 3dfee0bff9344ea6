// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string_view>

namespace sinew {

enum class LogSeverity : std::uint32_t {
  info = 0,
  warning = 1,  ///< a vertex was put right, or a setting out of range
  error = 2,    ///< a call was refused, or memory ran out
};

/// Receives the messages of a world, one line each.
class LogSink {
 public:
  virtual ~LogSink() = default;
  /// Called in the thread that called the world, during that call: it must not call the world. \param line without line
  /// end; copy it to keep it. Exceptions thrown here are swallowed.
  virtual void write(LogSeverity severity, std::string_view line) = 0;
};

}  // namespace sinew
