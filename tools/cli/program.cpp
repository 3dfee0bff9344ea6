// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/program.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/version.h"
#include "tools/author/json_text.h"
#include "tools/core/error.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

int fail(const std::string& line, ExitCode code) {
  // One line, whatever a file name or a library put into it.
  std::string clean;
  for (char c : line) clean += static_cast<unsigned char>(c) < 32 || c == 127 ? ' ' : c;
  std::cerr << "sinew: " << clean << "\n";
  return int(code);
}

// What to write for an option that none of the verbs on the command line has; nothing where each is known.
std::string unknownOption(const CLI::App& app) {
  std::string verbs;
  std::vector<std::string> names;  // without dashes
  std::vector<const CLI::Option*> options;
  for (const CLI::App* at = &app; at != nullptr;) {
    verbs += (verbs.empty() ? "" : " ") + at->get_name();
    for (const CLI::Option* option : at->get_options()) {
      for (const auto* const list : {&option->get_snames(), &option->get_lnames()}) {
        names.insert(names.end(), list->begin(), list->end());
        options.resize(names.size(), option);
      }
    }
    const std::vector<const CLI::App*> chosen =
        at->get_subcommands([](const CLI::App* verb) { return verb->parsed(); });
    at = chosen.empty() ? nullptr : chosen.front();
  }
  for (const std::string& word : app.remaining(true)) {
    const std::size_t first = word.find_first_not_of('-');
    if (first == 0 || first == std::string::npos || !std::isalpha(static_cast<unsigned char>(word[first]))) continue;
    const std::string name = word.substr(first, word.find('=') - first);
    const std::string nearest = nearestName(name, names);
    const auto at = std::size_t(std::find(names.begin(), names.end(), nearest) - names.begin());
    return "there is no option '" + word.substr(0, word.find('=')) + "'. Did you mean " +
           options[at]->get_name(false, true) + "? All options: " + verbs + " --help.";
  }
  return {};
}

int runVerb(int argument_count, char** arguments, std::initializer_list<AddVerb*> verbs) {
  CLI::App app(
      "sinew: turns an artist's mesh into a soft body. A first try: sinew bake mesh.obj -o mesh.sinew && sinew view "
      "mesh.sinew",
      "sinew");
  app.set_version_flag("--version", std::string("sinew ") + sinew::formats::kSoftwareVersion);
  app.require_subcommand(1);
  int exit_code = int(ExitCode::done);
  for (AddVerb* const add : verbs) add(app, exit_code);
  if (argument_count > 1 && !std::string_view(arguments[1]).starts_with('-')) {
    std::vector<std::string> names;
    for (const CLI::App* verb : app.get_subcommands({})) names.push_back(verb->get_name());
    if (std::find(names.begin(), names.end(), arguments[1]) == names.end()) {
      return fail("there is no verb '" + std::string(arguments[1]) + "'. Did you mean " +
                      nearestName(arguments[1], names) + "? All verbs: sinew --help.",
                  ExitCode::usage);
    }
  }
  try {
    app.parse(argument_count, arguments);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == int(CLI::ExitCodes::Success)) {
      app.exit(error);
      return int(ExitCode::done);
    }
    const std::string unknown = unknownOption(app);
    return fail(unknown.empty() ? std::string(error.what()) + ". Try: sinew --help" : unknown, ExitCode::usage);
  } catch (const ToolError& error) {
    return fail(error.what(), error.code());
  } catch (const std::bad_alloc&) {
    return fail("out of memory. Close other programs, or lower tetrahedra.vertices.", ExitCode::system);
  } catch (const std::exception& error) {
    return fail(std::string("unexpected fault: ") + error.what() + ". Please report it with the file.",
                ExitCode::system);
  }
  return exit_code;
}

// Of both libraries: std::cout is not sure to hear what befalls the bytes that it hands on.
bool outputIsWritten() {
  std::cout.flush();
  return std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
}

}  // namespace

int runProgram(int argument_count, char** arguments, std::initializer_list<AddVerb*> verbs) {
  if (argument_count > 1 && std::string_view(arguments[1]) == "--import-worker") {
    return runImportWorker(argument_count, arguments);
  }
  const int exit_code = runVerb(argument_count, arguments, verbs);
  const bool refused = exit_code != int(ExitCode::done) && exit_code != int(ExitCode::findings);
  if (refused || outputIsWritten()) return exit_code;
  return fail("standard output: could not be written whole. Make room where it goes, or send it elsewhere.",
              ExitCode::system);
}

}  // namespace sinew::tools
