// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <CLI/CLI.hpp>

namespace sinew::tools {

inline constexpr const char* kBenchSentence = "Measure this machine and what the runtime costs on it";
inline constexpr const char* kStudySentence = "Measure the method itself";

/// One file per verb: each adds its subcommand with its options to the program and sets `exit_code` from its callback
/// (ToolError is caught in main). Results go to stdout, everything else to stderr.
void addAuthorVerb(CLI::App& app, int& exit_code);
void addBakeVerb(CLI::App& app, int& exit_code);
void addCheckVerb(CLI::App& app, int& exit_code);
void addInspectVerb(CLI::App& app, int& exit_code);
void addSimulateVerb(CLI::App& app, int& exit_code);
void addRenderVerb(CLI::App& app, int& exit_code);
void addViewVerb(CLI::App& app, int& exit_code);
void addStudioVerb(CLI::App& app, int& exit_code);
void addBenchVerb(CLI::App& app, int& exit_code);
void addStudyVerb(CLI::App& app, int& exit_code);
void addHelpVerb(CLI::App& app, int& exit_code);
/// `bench` and `study` of the program beside this one.
void addMeasureVerbs(CLI::App& app, int& exit_code);

}  // namespace sinew::tools
