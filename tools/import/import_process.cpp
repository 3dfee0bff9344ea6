// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <new>
#include <optional>
#include <utility>

#include "tools/core/error.h"
#include "tools/import/worker_protocol.h"

extern char** environ;

namespace sinew::tools {
namespace {

using Clock = std::chrono::steady_clock;
// The child itself is bound in processor time; on the clock a second of that may last so long on a busy machine.
constexpr double kClockSeconds = 4;

struct OutOfTime {};
struct OutOfMemory {};
struct StreamEnded {};
enum class Link { pipe, socket };

class FileDescriptor {
 public:
  explicit FileDescriptor(int fd = -1) : fd_(fd) {}
  ~FileDescriptor() { reset(); }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  int get() const { return fd_; }
  void reset(int fd = -1) {
    if (fd_ >= 0) close(fd_);
    fd_ = fd;
  }

 private:
  int fd_;
};

/// The child; killed and reaped at the latest when this goes.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Waits until `deadline`, then kills. \return the wait status.
  int wait(Clock::time_point deadline, double& peak_megabytes) {
    // The stream has ended by now, so the child is a few instructions from its end and polling costs nothing.
    rusage usage{};
    int status = 0;
    while (true) {
      const bool late = Clock::now() >= deadline;
      if (late) kill(pid_, SIGKILL);
      const pid_t done = wait4(pid_, &status, late ? 0 : WNOHANG, &usage);
      if (done == pid_ || (done < 0 && errno != EINTR)) break;
      usleep(200);
    }
    pid_ = -1;
    peak_megabytes = double(usage.ru_maxrss) / 1024.0;
    return status;
  }
  void kill9() const { kill(pid_, SIGKILL); }

 private:
  pid_t pid_;
};

class PipeSource : public ByteSource {
 public:
  PipeSource(int fd, Clock::time_point deadline, std::uint64_t budget)
      : fd_(fd), deadline_(deadline), budget_(budget) {}

  void read(void* data, std::size_t size) override {
    auto* out = static_cast<std::byte*>(data);
    while (size > 0) {
      if (held_ == used_ && size < buffer_.size()) refill();
      if (held_ != used_) {
        const std::size_t n = std::min(size, held_ - used_);
        std::memcpy(out, buffer_.data() + used_, n);
        used_ += n, out += n, size -= n;
      } else {
        const std::size_t n = receive(out, size);
        out += n, size -= n;
      }
    }
  }
  void until(Clock::time_point deadline) { deadline_ = deadline; }
  void claim(std::uint64_t size) override {
    if (size > budget_) throw OutOfMemory();
    budget_ -= size;
  }

 private:
  void refill() {
    held_ = receive(buffer_.data(), buffer_.size());
    used_ = 0;
  }
  std::size_t receive(std::byte* out, std::size_t size) const {
    while (true) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
      if (left <= 0) throw OutOfTime();
      pollfd wait{fd_, POLLIN, 0};
      const int ready = poll(&wait, 1, int(std::min<std::int64_t>(left, 1000)));
      if (ready < 0 && errno != EINTR) throw StreamEnded();
      if (ready <= 0) continue;
      const ssize_t n = ::read(fd_, out, size);
      if (n > 0) return std::size_t(n);
      if (n == 0) throw StreamEnded();
      if (errno != EINTR && errno != EAGAIN) throw StreamEnded();
    }
  }

  int fd_;
  Clock::time_point deadline_;
  std::uint64_t budget_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(1U << 16);
  std::size_t held_ = 0;
  std::size_t used_ = 0;
};

/// One line of printable text of a bounded length: what the child says is put before the user.
std::string oneLine(const std::string& text) {
  std::string out;
  for (char c : text.substr(0, 600)) out += static_cast<unsigned char>(c) < 32 || c == 127 ? ' ' : c;
  return asUtf8(out);
}

pid_t spawnWorker(const std::filesystem::path& worker, const std::filesystem::path& file, const std::string& format,
                  const ImportOptions& options, int write_end) {
  constexpr int kChildFd = 3;
  std::vector<std::string> words = {worker.string(),
                                    "--import-worker",
                                    file.string(),
                                    format,
                                    std::to_string(kChildFd),
                                    std::to_string(options.memory_megabytes),
                                    std::to_string(options.seconds)};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&actions);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&actions, write_end, kChildFd);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  if (!kSanitized) posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addclosefrom_np(&actions, kChildFd + 1);
  // A caller may block or ignore signals; the child's limits work by them.
  sigset_t none;
  sigset_t defaults;
  sigemptyset(&none);
  sigemptyset(&defaults);
  for (int signal : {SIGXCPU, SIGPIPE, SIGSEGV, SIGABRT, SIGINT, SIGTERM}) sigaddset(&defaults, signal);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, worker.c_str(), &actions, &attributes, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  posix_spawnattr_destroy(&attributes);
  if (error != 0)
    throw ToolError(ExitCode::system, file.string(),
                    "the import worker " + worker.string() + " could not be started (" + std::strerror(error) + ")",
                    "Check the installation.");
  return pid;
}

std::filesystem::path workerOf(const ImportOptions& options) {
  if (!options.worker.empty()) return options.worker;
  std::error_code error;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  return error || !std::filesystem::exists(self, error) ? "/proc/self/exe" : self;  // replaced while it runs
}

Clock::time_point deadlineOf(const ImportOptions& options) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(kClockSeconds * options.seconds));
}

/// \param kind a pipe, or a socket where the worker is told more than its arguments say.
/// \param here this side's end of what is the worker's `FD`.
pid_t startWorker(const std::filesystem::path& file, const std::string& format, const ImportOptions& options, Link kind,
                  FileDescriptor& here) {
  int ends[2] = {-1, -1};
  const int failed =
      kind == Link::pipe ? pipe2(ends, O_CLOEXEC) : socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends);
  if (failed != 0)
    throw ToolError(ExitCode::system, file.string(),
                    std::string("no pipe to the import worker (") + std::strerror(errno) + ")",
                    "Close other programs and try again.");
  here.reset(ends[0]);
  const FileDescriptor there(ends[1]);
  return spawnWorker(workerOf(options), file, format, options, there.get());
}

/// Throws StreamEnded where the worker does not take it, for `seconds` or ever.
void send(int socket, std::span<const std::byte> bytes, double seconds) {
  const timeval patience{time_t(std::ceil(seconds)), 0};
  setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  while (!bytes.empty()) {
    const ssize_t n = ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) throw StreamEnded();
    bytes = bytes.subspan(std::size_t(n));
  }
}

}  // namespace

RawScene readInChild(const std::filesystem::path& file, const std::string& format, const ImportOptions& options,
                     Progress& progress) {
  const std::string name = file.string();
  const std::string memory_cure = "If the file is sound, allow more with --set import.memory_mb=" +
                                  std::to_string(std::uint64_t(options.memory_megabytes) * 2) + ".";
  const std::string time_cure = "If the file is sound, allow more with --set import.seconds=" +
                                std::to_string(std::int64_t(options.seconds * 4)) + ".";
  const std::string again = "Open it in the program that made it and export it again.";
  const auto bad = [&](const std::string& what, const std::string& cure) {
    return ToolError(ExitCode::bad_input, name, what, cure);
  };
  const std::string too_much =
      "reading it takes more than " + std::to_string(options.memory_megabytes) + " MB of memory";
  const std::string too_long = "reading it takes longer than " + std::to_string(std::int64_t(options.seconds)) + " s";

  const std::filesystem::path worker = workerOf(options);
  const auto deadline = deadlineOf(options);
  FileDescriptor read_end;
  Child child(startWorker(file, format, options, Link::pipe, read_end));

  RawScene scene;
  double peak = 0;
  bool complete = false;
  bool late = false;
  bool large = false;
  std::optional<std::pair<std::string, std::string>> complaint;
  try {
    PipeSource source(read_end.get(), deadline, std::uint64_t(options.memory_megabytes) << 20);
    WorkerAnswer answer{};
    source.read(&answer, sizeof answer);
    if (answer == WorkerAnswer::scene) {
      readRawScene(source, scene);
      complete = true;
    } else if (answer == WorkerAnswer::complaint) {
      std::array<std::string, 2> texts;
      for (std::string& text : texts) {
        std::uint32_t size = 0;
        source.read(&size, sizeof size);
        if (size > 65536) throw StreamEnded();
        text.resize(size);
        source.read(text.data(), size);
      }
      complaint = {oneLine(texts[0]), oneLine(texts[1])};
    }
  } catch (const OutOfTime&) {
    late = true;
  } catch (const OutOfMemory&) {
    large = true;
  } catch (const StreamEnded&) {
  } catch (const std::bad_alloc&) {
    large = true;
  } catch (const std::length_error&) {
    large = true;
  } catch (const std::runtime_error&) {
  }
  if (!complete && !complaint && (late || large)) child.kill9();
  read_end.reset();
  const int status = child.wait(deadline, peak);
  progress.childPeak(peak);
  late =
      late || (!large && !complaint && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL && Clock::now() >= deadline);

  if (late) throw bad(too_long, time_cure);
  if (large) throw bad(too_much, memory_cure);
  if (complaint) throw bad(complaint->first, complaint->second.empty() ? again : complaint->second);
  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    if (signal == SIGXCPU) throw bad(too_long, time_cure);
    if (signal == SIGINT || signal == SIGTERM)
      throw ToolError(ExitCode::system, name, "the import was interrupted", "Run it again.");
    if (signal == SIGKILL) throw bad(too_much + " or was stopped by the system", memory_cure);
    throw bad(
        "its " + format + " reader crashed on it (signal " + std::to_string(signal) + "), so it is damaged or unusual",
        again);
  }
  if (WEXITSTATUS(status) == kWorkerOutOfMemory) throw bad(too_much, memory_cure);
  if (WEXITSTATUS(status) == 127 && !complete)
    throw ToolError(ExitCode::system, name, "the import worker " + worker.string() + " could not be started",
                    "Check the installation.");
  if (!complete || WEXITSTATUS(status) != 0)
    throw bad(
        "its " + format + " reader gave no complete scene (exit code " + std::to_string(WEXITSTATUS(status)) + ")",
        again);
  try {
    validateRawScene(scene);
  } catch (const ReadError& error) {
    throw bad(oneLine(error.what()), error.cure().empty() ? again : error.cure());
  }
  cleanTexts(scene);
  return scene;
}

std::vector<PictureState> pictureStates(std::span<const std::span<const std::byte>> pictures,
                                        const ImportOptions& options) {
  std::vector<PictureState> states(pictures.size(), PictureState::unread);
  // A child goes on behind the picture that brought down the one before.
  for (std::size_t next = 0; next < pictures.size(); ++next) {
    FileDescriptor socket;
    const Child child(startWorker("", kPicturesFormat, options, Link::socket, socket));
    PipeSource source(socket.get(), deadlineOf(options), 0);
    try {
      for (; next < pictures.size(); ++next) {
        const std::uint64_t size = pictures[next].size();
        send(socket.get(), std::as_bytes(std::span(&size, 1)), kClockSeconds * options.seconds);
        send(socket.get(), pictures[next], kClockSeconds * options.seconds);
        source.until(deadlineOf(options));
        char answer = 0;
        source.read(&answer, 1);
        states[next] = answer == char(PictureState::whole)     ? PictureState::whole
                       : answer == char(PictureState::damaged) ? PictureState::damaged
                                                               : PictureState::unread;
      }
    } catch (const OutOfTime&) {
    } catch (const StreamEnded&) {
    }
  }
  return states;
}

}  // namespace sinew::tools
