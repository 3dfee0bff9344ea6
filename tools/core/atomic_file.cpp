// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/core/atomic_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

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

constexpr std::string_view kRandom = "XXXXXX";

// Removes what other runs left beside a file: it has the name of one beside it, and nobody holds its lock.
void removeAbandoned(const std::filesystem::path& folder, const std::string& prefix, const std::string& suffix) {
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (name.size() != prefix.size() + kRandom.size() + suffix.size()) continue;
    if (!name.starts_with(prefix) || !name.ends_with(suffix)) continue;
    const int descriptor = open(it->path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (descriptor < 0) continue;
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) unlink(it->path().c_str());
    close(descriptor);
  }
}

}  // namespace

FileBeside::FileBeside(const std::filesystem::path& file) : file_(file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  const std::string prefix = "." + file.filename().string() + ".tmp", suffix = file.extension().string();
  removeAbandoned(folder, prefix, suffix);
  path_ = (folder / (prefix + std::string(kRandom) + suffix)).string();
  descriptor_ = mkostemps(path_.data(), int(suffix.size()), O_CLOEXEC);
  if (descriptor_ < 0) fail(file_, "cannot create a file beside it", errno);
  flock(descriptor_, LOCK_EX | LOCK_NB);
}

FileBeside::~FileBeside() {
  if (!path_.empty()) unlink(path_.c_str());
  close(descriptor_);
}

void FileBeside::putInPlace() {
  const mode_t mask = umask(0);
  umask(mask);
  if (fchmod(descriptor_, 0666 & ~mask) != 0 || fsync(descriptor_) != 0) fail(file_, "cannot finish writing", errno);
  if (rename(path_.c_str(), file_.c_str()) != 0) fail(file_, "cannot put it in its place", errno);
  path_.clear();
}

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
  FileBeside beside(file);
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t written = write(beside.descriptor(), bytes.data() + done, bytes.size() - done);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) fail(file, "cannot write", errno);
    done += std::size_t(written);
  }
  beside.putInPlace();
}

void writeFileAtomically(const std::filesystem::path& file, std::string_view text) {
  writeFileAtomically(file, std::as_bytes(std::span(text.data(), text.size())));
}

}  // namespace sinew::tools
