// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/core/atomic_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

// Holds back the signals that people end programs with, so that none leaves a temporary file behind.
class BlockSignals {
 public:
  BlockSignals() {
    sigset_t set;
    sigemptyset(&set);
    for (int s : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE}) sigaddset(&set, s);
    pthread_sigmask(SIG_BLOCK, &set, &before_);
  }
  ~BlockSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  BlockSignals(const BlockSignals&) = delete;
  BlockSignals& operator=(const BlockSignals&) = delete;

 private:
  sigset_t before_{};
};

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, int error) {
  throw ToolError(ExitCode::system, file.string(), what + " (" + std::strerror(error) + ")",
                  "Check the folder, its permissions and the free space.");
}

// Where a symbolic link leads, also to what is not there yet.
std::filesystem::path followed(std::filesystem::path file) {
  std::error_code error;
  constexpr int kMostLinks = 40;
  for (int i = 0; i < kMostLinks && std::filesystem::is_symlink(file, error); ++i) {
    const std::filesystem::path target = std::filesystem::read_symlink(file, error);
    if (error) break;
    file = file.parent_path() / target;  // an absolute target replaces all
  }
  return file;
}

}  // namespace

void requireWritable(const std::filesystem::path& named, std::initializer_list<std::filesystem::path> inputs) {
  if (named.empty()) {
    throw ToolError(ExitCode::usage, "", "the name of the file to write is empty", "Name a file to write.");
  }
  const std::filesystem::path file = followed(named);
  std::error_code error;
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  if (!std::filesystem::is_directory(folder, error)) {
    throw ToolError(ExitCode::usage, file.string(), "the folder " + folder.string() + " does not exist",
                    "Make it first.");
  }
  if (std::filesystem::is_directory(file, error)) {
    throw ToolError(ExitCode::usage, file.string(), "this is a folder", "Name a file to write.");
  }
  if (std::filesystem::exists(file, error) && !std::filesystem::is_regular_file(file, error)) {
    throw ToolError(ExitCode::usage, named.string(), "is no regular file", "Name a file to write.");
  }
  for (const std::filesystem::path& input : inputs) {
    if (!std::filesystem::equivalent(file, input, error) || error) continue;
    throw ToolError(ExitCode::usage, named.string(), "is what is read; writing would destroy it",
                    "Name another file to write.");
  }
  if (access(folder.c_str(), W_OK) != 0) fail(file, "cannot write into " + folder.string(), errno);
}

void writeFileAtomically(const std::filesystem::path& named, std::span<const std::byte> bytes) {
  requireWritable(named);
  const std::filesystem::path file = followed(named);
  const BlockSignals block;
  std::string temporary = (file.parent_path() / ("." + file.filename().string() + ".XXXXXX")).string();
  const int descriptor = mkstemp(temporary.data());
  if (descriptor < 0) fail(file, "cannot create a file beside it", errno);
  const auto abandon = [&](const std::string& what) {
    const int error = errno;
    close(descriptor);
    unlink(temporary.c_str());
    fail(file, what, error);
  };
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = write(descriptor, bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) abandon("cannot write");
    done += std::size_t(written);
  }
  const mode_t mask = umask(0);
  umask(mask);
  if (fchmod(descriptor, 0666 & ~mask) != 0 || fsync(descriptor) != 0) abandon("cannot finish writing");
  if (rename(temporary.c_str(), file.c_str()) != 0) abandon("cannot put it in its place");
  close(descriptor);
}

void writeFileAtomically(const std::filesystem::path& file, std::string_view text) {
  writeFileAtomically(file, std::as_bytes(std::span(text.data(), text.size())));
}

}  // namespace sinew::tools
