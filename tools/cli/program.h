// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <CLI/CLI.hpp>
#include <initializer_list>

namespace sinew::tools {

using AddVerb = void(CLI::App& app, int& exit_code);

/// A program of some verbs. \return its exit code.
int runProgram(int argument_count, char** arguments, std::initializer_list<AddVerb*> verbs);

}  // namespace sinew::tools
