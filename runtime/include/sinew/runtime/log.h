// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <string_view>

namespace sinew {

enum class LogSeverity : std::uint32_t {
  info = 0,
  warning = 1,  ///< something was put right: a vertex, a setting out of range
  error = 2,    ///< a call was refused, or memory ran out
};

/// Receives what a world has to say to a person.
class LogSink {
 public:
  virtual ~LogSink() = default;
  /// Called in the thread that called the world, during that call. \param line without line end; copy it to keep it.
  /// What this throws goes no further.
  virtual void write(LogSeverity severity, std::string_view line) = 0;
};

}  // namespace sinew
