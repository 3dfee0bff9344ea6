// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/bake_job.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "tools/author/json_text.h"
#include "tools/bake/findings_json.h"
#include "tools/core/error.h"

extern char** environ;

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFolderName = "sinew_studio_";

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// What findingsJson() writes.
std::vector<Finding> findingsOf(const nlohmann::ordered_json& report) {
  std::vector<Finding> findings;
  if (!report.contains("findings")) return findings;
  for (const auto& entry : report["findings"]) {
    Finding& finding = findings.emplace_back();
    finding.id = entry.value("id", "");
    const std::string severity = entry.value("severity", "");
    finding.severity = severity == "error"     ? Severity::error
                       : severity == "warning" ? Severity::warning
                                               : Severity::info;
    finding.message = entry.value("message", "");
    finding.count = entry.value("count", std::uint64_t{0});
    finding.place_kind = entry.value("place_kind", "");
    finding.place = entry.value("place", "");
    finding.cure = entry.value("cure", "");
    if (entry.contains("places")) finding.places = entry["places"].get<std::vector<std::uint32_t>>();
  }
  return findings;
}

// Whether the fields of a piece are a draft's.
bool isDraftOf(const nlohmann::ordered_json& report) {
  if (!report.contains("fields") || !report["fields"].is_array()) return false;
  const auto& pieces = report["fields"];
  return std::any_of(pieces.begin(), pieces.end(), [](const auto& piece) { return piece.value("draft", false); });
}

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

BakeJob::BakeJob() {
  std::error_code error;
  removeLeftFolders(fs::temp_directory_path(error));
  const std::string own = std::string(kFolderName) + std::to_string(getpid()) + "_XXXXXX";
  std::string name = (fs::temp_directory_path(error) / own).string();
  if (error || mkdtemp(name.data()) == nullptr) {
    throw ToolError(ExitCode::system, name, "no folder for packages can be made",
                    "Free some space there, or set TMPDIR to a folder you may write in.");
  }
  folder_ = name;
}

BakeJob::~BakeJob() {
  cancel();
  std::error_code error;
  fs::remove_all(folder_, error);
}

void BakeJob::start(const fs::path& recipe) {
  cancel();
  recipe_ = recipe;
  run(true);
}

void BakeJob::run(bool draft) {
  const std::string base = (folder_ / std::to_string(++number_)).string();
  target_ = base + ".sinew";
  std::vector<std::string> words = {"sinew",    "bake",         recipe_.string(),   "-o", target_.string(),
                                    "--report", base + ".json", "--progress-lines", "-q"};
  if (draft) words.emplace_back("--draft");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC | O_NONBLOCK) != 0) {
    state_ = State::failed;
    error_ = "the system has no pipe left. Close other programs.";
    return;
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
    state_ = State::failed;
    error_ = "the bake could not be started. Close other programs.";
    return;
  }
  pipe_ = ends[0];
  text_.clear();
  error_.clear();
  stage_ = "start";
  fraction_ = 0;
  started_ = now();
  state_ = State::running;
}

void BakeJob::cancel() {
  if (pid_ > 0) {
    kill(pid_, SIGTERM);  // its own child ends with it, and half-written files go
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    state_ = State::idle;
  }
  if (pipe_ >= 0) close(pipe_);
  pipe_ = -1;
}

void BakeJob::takeLines() {
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

void BakeJob::poll() {
  if (pid_ <= 0) return;
  takeLines();
  int status = 0;
  if (waitpid(pid_, &status, WNOHANG) != pid_) return;
  pid_ = -1;
  takeLines();
  close(std::exchange(pipe_, -1));
  finish(status);
}

void BakeJob::finish(int status) {
  seconds_ = now() - started_;
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    state_ = State::failed;
    if (error_.empty())
      error_ = WIFSIGNALED(status) ? "the bake ended by a signal. Memory may have run out: lower tetrahedra.vertices."
                                   : "the bake failed without a word. Please report it with the file.";
    return;
  }
  auto loaded = Asset::load(target_.string());
  if (!loaded) {
    state_ = State::failed;
    error_ = loaded.reason();
    return;
  }
  is_draft_ = false;
  try {
    const JsonText report = JsonText::read(fs::path(target_).replace_extension(".json").string());
    findings_ = findingsOf(report.json());
    is_draft_ = isDraftOf(report.json());
  } catch (const std::exception& error) {
    error_ = error.what();
  }
  std::error_code error;
  if (!package_.empty()) fs::remove(package_, error);
  package_ = target_;
  asset_ = *loaded;
  state_ = State::done;
  ++done_;
  if (is_draft_) run(false);
}

}  // namespace sinew::tools
