// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/child_job.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "tools/core/error.h"

extern char** environ;

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFolderName = "sinew_studio_";

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Folders of studios that were killed: their names have the numbers of processes that are no more.
void removeLeftFolders(const fs::path& temporary) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(temporary, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kFolderName)) continue;
    const long pid = std::strtol(name.c_str() + kFolderName.size(), nullptr, 10);
    if (pid > 0 && kill(pid_t(pid), 0) != 0 && errno == ESRCH) fs::remove_all(entry.path(), error);
  }
}

}  // namespace

JobFolder::JobFolder() {
  std::error_code error;
  removeLeftFolders(fs::temp_directory_path(error));
  const std::string own = std::string(kFolderName) + std::to_string(getpid()) + "_XXXXXX";
  std::string name = (fs::temp_directory_path(error) / own).string();
  if (error || mkdtemp(name.data()) == nullptr) {
    throw ToolError(ExitCode::system, name, "no folder for packages can be made",
                    "Free some space there, or set TMPDIR to a folder you may write in.");
  }
  path_ = name;
}

JobFolder::~JobFolder() {
  std::error_code error;
  fs::remove_all(path_, error);
}

bool ChildJob::start(std::vector<std::string> words, const std::string& what, const std::string& cure) {
  cancel();
  what_ = what;
  cure_ = cure;
  words.insert(words.begin(), "sinew");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
    error_ = "the system has no pipe left. Close other programs.";
    return false;
  }
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  const int failed = posix_spawn(&pid_, "/proc/self/exe", &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (failed != 0) {
    close(ends[0]);
    pid_ = -1;
    error_ = what_ + " could not be started. Close other programs.";
    return false;
  }
  pipe_ = ends[0];
  text_.clear();
  error_.clear();
  stage_ = "start";
  fraction_ = 0;
  started_ = now();
  return true;
}

void ChildJob::cancel() {
  if (pid_ > 0) {
    kill(pid_, SIGTERM);  // its own child ends with it, and half-written files go
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
  }
  if (pipe_ >= 0) close(pipe_);
  pipe_ = -1;
}

void ChildJob::takeLines() {
  std::array<char, 4096> bytes{};
  for (ssize_t n = 0; (n = read(pipe_, bytes.data(), bytes.size())) > 0;) text_.append(bytes.data(), std::size_t(n));
  for (std::size_t end = 0; (end = text_.find('\n')) != std::string::npos; text_.erase(0, end + 1)) {
    const std::string line = text_.substr(0, end);
    if (line.starts_with("sinew: ")) {
      error_ = line.substr(7);
    } else if (const std::size_t space = line.rfind(' '); space != std::string::npos) {
      stage_ = line.substr(0, space);
      fraction_ = std::strtof(line.c_str() + space, nullptr);
    }
  }
}

ChildJob::Ended ChildJob::poll() {
  if (pid_ <= 0) return Ended::no;
  takeLines();
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return Ended::no;
  pid_ = -1;
  takeLines();
  close(std::exchange(pipe_, -1));
  seconds_ = now() - started_;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return Ended::done;
  if (error_.empty())
    error_ = what_ + (WIFSIGNALED(status) ? " ended by a signal. " + cure_
                                          : " failed without a word. Please report it with the file.");
  return Ended::failed;
}

}  // namespace sinew::tools
