// SPDX-License-Identifier: GPL-3.0-or-later
// The import's child process for tests that run without the sinew program.
#include "tools/import/import.h"

int main(int argument_count, char** arguments) { return sinew::tools::runImportWorker(argument_count, arguments); }
