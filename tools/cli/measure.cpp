// SPDX-License-Identifier: GPL-3.0-or-later
//
// `sinew bench` and `sinew study`: a program of their own, which making and playing bodies does without.
#include "tools/cli/program.h"
#include "tools/cli/verb.h"

int main(int argument_count, char** arguments) {
  using namespace sinew::tools;
  return runProgram(argument_count, arguments, {addBenchVerb, addStudyVerb});
}
