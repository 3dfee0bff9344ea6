// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/child.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <string_view>
#include <vector>

extern char** environ;

namespace sinew::tools {
namespace {

bool processorHas(std::string_view set) {
#if defined(__x86_64__) && defined(__GNUC__)
  __builtin_cpu_init();
  if (set == "sse42") return __builtin_cpu_supports("sse4.2") != 0;
  if (set == "avx2") return __builtin_cpu_supports("avx2") != 0 && __builtin_cpu_supports("fma") != 0;
  if (set == "avx512") return __builtin_cpu_supports("avx512f") != 0;
#endif
  static_cast<void>(set);
  return false;
}

// Runs a program with one more variable in its environment and returns what it printed; empty where it failed.
std::string outputOf(std::vector<std::string> arguments, const std::string& variable) {
  int ends[2];
  if (pipe(ends) != 0) return {};
  std::vector<char*> argument_list;
  for (std::string& argument : arguments) argument_list.push_back(argument.data());
  argument_list.push_back(nullptr);
  std::string own = variable;
  const std::string_view name(own.data(), own.find('=') + 1);
  std::vector<char*> environment = {own.data()};
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (!std::string_view(*entry).starts_with(name)) environment.push_back(*entry);
  }
  environment.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  posix_spawn_file_actions_addclose(&actions, ends[1]);
  pid_t child = 0;
  const int failed = posix_spawn(&child, argument_list[0], &actions, nullptr, argument_list.data(), environment.data());
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  std::string output;
  if (failed == 0) {
    char buffer[256];
    for (;;) {
      const ssize_t count = read(ends[0], buffer, sizeof buffer);
      if (count <= 0) break;
      output.append(buffer, std::size_t(count));
    }
    int status = 0;
    if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) output.clear();
  }
  close(ends[0]);
  return output;
}

}  // namespace

ChildResult runBenchChild(const BenchOptions& options, const char* instruction_set, unsigned steps) {
  ChildResult result;
  if (!processorHas(instruction_set)) {
    result.reason = "this processor lacks it";
    return result;
  }
  if (options.program.empty()) {
    result.reason = "the program's own file is not known";
    return result;
  }
  std::vector<std::string> arguments = {options.program.string(), "bench", "--child", std::to_string(steps)};
  if (options.quick) arguments.push_back("--quick");
  const std::string output = outputOf(arguments, std::string("SINEW_INSTRUCTION_SET=") + instruction_set);
  unsigned long long hash = 0;
  double microseconds = 0;
  if (std::sscanf(output.c_str(), "%llx %lf", &hash, &microseconds) != 2) {
    result.reason = "the program could not be started again";
    return result;
  }
  result.ran = true;
  result.hash = hash;
  result.step_microseconds = microseconds;
  return result;
}

std::string benchChildLine(unsigned steps, bool quick) {
  char line[64];
  std::snprintf(line, sizeof line, "%016llx %.6g\n", static_cast<unsigned long long>(determinismHash(0, steps)),
                determinismStepMicroseconds(quick));
  return line;
}

}  // namespace sinew::tools
