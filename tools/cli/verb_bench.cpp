// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include "tools/bench/bench.h"
#include "tools/bench/child.h"
#include "tools/cli/verb.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

struct BenchCommand {
  BenchOptions options;
  bool json = false, markdown = false;
  unsigned child_steps = 0;
};

void printMachine(const MachineLimits& machine) {
  std::printf("machine: %.0f GFLOP/s of fused multiply-adds on one thread (%u bits, %s), %.0f on two\n",
              machine.fma_flops / 1e9, machine.fma_bits, machine.instruction_set.c_str(),
              machine.fma_two_threads / 1e9);
  for (const MachineLimits::AtWidth& width : machine.widths) {
    std::printf("         %u bits: %.0f GFLOP/s fused, %.0f with multiplications and additions apart\n", width.bits,
                width.fma / 1e9, width.plain / 1e9);
  }
  for (const CopyBandwidth& copy : machine.copies) {
    std::printf("         copy in %7zu KiB: %6.1f GB/s read and written on one thread, %6.1f on two\n",
                copy.bytes / 1024, copy.one_thread / 1e9, copy.two_threads / 1e9);
  }
}

void printLine(const BenchLine& line) {
  std::printf("%-11s %-52s %9.4g %s", line.group.c_str(), line.name.c_str(), line.value, line.unit.c_str());
  if (line.spread > 0) std::printf(" +-%.0f %%", 100 * line.spread);
  if (line.bound > 0) std::printf(", %.2f x its bound of %.3g", line.value / line.bound, line.bound);
  if (!line.reference_name.empty()) {
    std::printf(", %.2f x +-%.0f %% cheaper than %s (%.4g)", line.ratio, 100 * line.ratio_spread,
                line.reference_name.c_str(), line.reference);
  }
  if (!line.limit.empty()) {
    const auto passed = line.passed();
    std::printf("  [%s: %s%s]", line.limit.c_str(), passed ? (*passed ? "pass" : "MISSED") : "not measured",
                line.attempts > 1 ? (", best of " + std::to_string(line.attempts)).c_str() : "");
  }
  if (!line.note.empty()) std::printf("  (%s)", line.note.c_str());
  std::printf("\n");
  std::fflush(stdout);
}

void runBenchVerb(const BenchCommand& command, int& exit_code) {
  if (command.child_steps > 0) {
    std::cout << benchChildLine(command.child_steps, command.options.quick);
    return;
  }
  BenchOptions options = command.options;
  std::error_code ignored;
  options.program = std::filesystem::read_symlink("/proc/self/exe", ignored);
  const std::filesystem::path models = "tests/assets/models";
  if (options.models.empty() && std::filesystem::is_directory(models, ignored)) options.models = models;
  const BenchReport report = runBench(options, command.json || command.markdown ? nullptr : printLine);
  if (command.json) {
    std::cout << benchJson(report).dump(2) << "\n";
  } else if (command.markdown) {
    std::cout << benchMarkdown(report);
  } else {
    printMachine(report.machine);
  }
  exit_code = int(report.passed() ? ExitCode::done : ExitCode::findings);
}

}  // namespace

void addBenchVerb(CLI::App& app, int& exit_code) {
  auto command = std::make_shared<BenchCommand>();
  CLI::App* verb = app.add_subcommand("bench", kBenchSentence);
  std::string names;
  for (const std::string_view name : benchGroups()) names += (names.empty() ? "" : ", ") + std::string(name);
  verb->add_option("--filter", command->options.filter, "Only groups with this in their name: " + names);
  verb->add_flag("--quick", command->options.quick, "Small sizes and few samples: to see that it runs, not to quote");
  verb->add_flag("--json", command->json, "Print the figures as JSON");
  verb->add_flag("--markdown", command->markdown, "Print the figures as the table of docs/performance.md");
  verb->add_option("--models", command->options.models,
                   "Where tests/assets/models is; else it is looked for under the working folder");
  verb->add_option("--face", command->options.face, "The baked samples/gallery/face, to be measured too");
  verb->add_option("--library", command->options.library, "The shared runtime library to weigh");
  verb->add_option("--child", command->child_steps)->group("");
  verb->callback([command, &exit_code] {
    exit_code = int(ExitCode::done);
    runBenchVerb(*command, exit_code);
  });
}

}  // namespace sinew::tools
