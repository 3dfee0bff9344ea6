// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/core/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "tools/core/error.h"

namespace sinew::tools {

std::string readWholeFile(const std::filesystem::path& file, std::uint64_t most_megabytes) {
  // O_NONBLOCK: a named pipe must not hold the program before it is refused.
  const int descriptor = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  const auto fail = [&](const std::string& what, const std::string& cure) {
    if (descriptor >= 0) close(descriptor);
    throw ToolError(ExitCode::bad_input, file.string(), what, cure);
  };
  const auto failBySystem = [&] {
    fail(std::string("cannot be read (") + std::strerror(errno) + ")", "Check the name and its permissions.");
  };
  struct stat facts {};
  if (descriptor < 0 || fstat(descriptor, &facts) != 0) failBySystem();
  if (S_ISDIR(facts.st_mode)) fail("is a folder", "Name a file in it.");
  if (!S_ISREG(facts.st_mode)) fail("is no regular file", "Copy it into one.");
  if (std::uint64_t(facts.st_size) > most_megabytes << 20) {
    fail("is larger than " + std::to_string(most_megabytes) + " MB",
         "That is no file that was authored; name another.");
  }
  std::string bytes(std::size_t(facts.st_size), '\0');
  std::size_t held = 0;
  while (held < bytes.size()) {
    const ssize_t count = read(descriptor, bytes.data() + held, bytes.size() - held);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) failBySystem();
    if (count == 0) break;  // it has become shorter
    held += std::size_t(count);
  }
  close(descriptor);
  bytes.resize(held);
  return bytes;
}

}  // namespace sinew::tools
