// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/cli/program.h"
#include "tools/cli/verb.h"

int main(int argument_count, char** arguments) {
  using namespace sinew::tools;
  return runProgram(argument_count, arguments,
                    {addAuthorVerb, addBakeVerb, addCheckVerb, addInspectVerb, addSimulateVerb, addRenderVerb,
                     addViewVerb, addStudioVerb, addMeasureVerbs, addHelpVerb});
}
