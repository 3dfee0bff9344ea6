// SPDX-License-Identifier: GPL-3.0-or-later
#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tools/cli/verb.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

constexpr const char* kProgram = "sinew-measure";

// Becomes the program beside this one that has the verb.
[[noreturn]] void becomeMeasure(std::vector<std::string> words) {
  std::error_code ignored;
  const std::string program =
      std::filesystem::read_symlink("/proc/self/exe", ignored).replace_filename(kProgram).string();
  words.insert(words.begin(), program);
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  execv(program.c_str(), arguments.data());
  throw ToolError(ExitCode::system, program, "the program that measures is not there",
                  "Build it: cmake --build --preset release --target sinew-measure.");
}

void addVerb(CLI::App& app, const std::string& name, const std::string& what) {
  CLI::App* verb = app.add_subcommand(name, what);
  verb->prefix_command();
  verb->set_help_flag();
  verb->footer("All of it: sinew " + name + " --help");
  verb->callback([verb, name] {
    std::vector<std::string> words = verb->remaining();
    words.insert(words.begin(), name);
    becomeMeasure(std::move(words));
  });
}

}  // namespace

void addMeasureVerbs(CLI::App& app, int&) {
  addVerb(app, "bench", kBenchSentence);
  addVerb(app, "study", kStudySentence);
}

}  // namespace sinew::tools
