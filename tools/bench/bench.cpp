// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/bench.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

constexpr unsigned kAttempts = 3;

struct Group {
  std::string_view name;
  void (*run)(const BenchContext&);
};
constexpr std::array kGroups = {
    Group{"step", benchStep},       Group{"output", benchOutput},   Group{"linearity", benchLinearity},
    Group{"threads", benchThreads}, Group{"touch", benchTouch},     Group{"determinism", benchDeterminism},
    Group{"memory", benchMemory},   Group{"library", benchLibrary}, Group{"open", benchOpen},
};

}  // namespace

BenchLine lineOf(std::string name, std::string unit) {
  BenchLine line;
  line.name = std::move(name);
  line.unit = std::move(unit);
  return line;
}

bool BenchReport::passed() const {
  return std::none_of(lines.begin(), lines.end(), [](const BenchLine& line) { return line.passed() == false; });
}

std::vector<std::string_view> benchGroups() {
  std::vector<std::string_view> names = {"machine"};
  for (const Group& group : kGroups) names.push_back(group.name);
  return names;
}

TimingOptions BenchContext::timing(ClockKind clock) const {
  return options.quick ? TimingOptions{5e-4, 5e-3, clock} : TimingOptions{2e-3, 0.15, clock};
}

void BenchContext::emitBest(const std::function<BenchLine()>& make) const {
  BenchLine best = make();
  const unsigned attempts = options.quick ? 1 : kAttempts;
  for (unsigned n = 2; n <= attempts && best.passed() == false; ++n) {
    BenchLine again = make();
    if (again.margin > best.margin) best = std::move(again);
    best.attempts = n;
  }
  emit(std::move(best));
}

BenchReport runBench(const BenchOptions& options, const std::function<void(const BenchLine&)>& show) {
  const auto wanted = [&](std::string_view name) { return name.find(options.filter) != std::string_view::npos; };
  const auto names = benchGroups();
  if (std::none_of(names.begin(), names.end(), wanted)) {
    std::string all;
    for (const std::string_view name : names) all += (all.empty() ? "" : ", ") + std::string(name);
    throw ToolError(ExitCode::usage, "", "no group of benchmarks has '" + options.filter + "' in its name",
                    "Groups: " + all + ".");
  }
  BenchReport report;
  report.machine = measureMachine(options.quick);
  for (const Group& group : kGroups) {
    if (!wanted(group.name)) continue;
    const BenchContext context{options, report.machine, [&](BenchLine line) {
                                 line.group = group.name;
                                 if (show) show(line);
                                 report.lines.push_back(std::move(line));
                               }};
    group.run(context);
  }
  return report;
}

nlohmann::ordered_json benchJson(const BenchReport& report) {
  using nlohmann::ordered_json;
  const auto number = [](double value) { return std::isfinite(value) ? ordered_json(value) : ordered_json(nullptr); };
  ordered_json copies = ordered_json::array();
  for (const CopyBandwidth& copy : report.machine.copies) {
    copies.push_back(
        {{"bytes", copy.bytes}, {"one_thread", copy.one_thread / 1e9}, {"two_threads", copy.two_threads / 1e9}});
  }
  ordered_json widths = ordered_json::array();
  for (const MachineLimits::AtWidth& width : report.machine.widths) {
    widths.push_back({{"bits", width.bits}, {"fma", width.fma / 1e9}, {"multiply_and_add", width.plain / 1e9}});
  }
  ordered_json results = ordered_json::array();
  for (const BenchLine& line : report.lines) {
    const std::string name = line.group + "/" + line.name;
    ordered_json entry = {{"name", name},        {"value", number(line.value)},
                          {"unit", line.unit},   {"lower_is_better", line.lower_is_better},
                          {"group", line.group}, {"spread", number(line.spread)}};
    if (line.bound > 0) {
      entry["bound"] = number(line.bound);
      entry["ratio_to_bound"] = number(line.value / line.bound);
    }
    if (!line.reference_name.empty()) {
      entry["reference"] = line.reference_name;
      entry["reference_value"] = number(line.reference);
      entry["times_cheaper"] = number(line.ratio);
      entry["times_cheaper_spread"] = number(line.ratio_spread);
    }
    if (!line.limit.empty()) {
      entry["limit"] = line.limit;
      const auto passed = line.passed();
      entry["passed"] = passed ? ordered_json(*passed) : ordered_json(nullptr);
      entry["attempts"] = line.attempts;
    }
    if (!line.note.empty()) entry["note"] = line.note;
    results.push_back(entry);
    if (line.reference_is_peer) {
      results.push_back({{"name", "peer/" + name + ", " + line.reference_name},
                         {"value", number(line.reference)},
                         {"unit", line.unit},
                         {"lower_is_better", line.lower_is_better},
                         {"group", line.group}});
    }
  }
  return {{"machine",
           {{"instruction_set", report.machine.instruction_set},
            {"fma_bits", report.machine.fma_bits},
            {"fma_gflops", report.machine.fma_flops / 1e9},
            {"fma_gflops_two_threads", report.machine.fma_two_threads / 1e9},
            {"gigaflops_by_width", widths},
            {"copy_gigabytes_per_second", copies}}},
          {"results", results},
          {"passed", report.passed()}};
}

std::string benchMarkdown(const BenchReport& report) {
  const auto number = [](double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", value);
    const double rounded = std::strtod(text, nullptr);
    if (std::abs(rounded) >= 1000) std::snprintf(text, sizeof text, "%.0f", rounded);
    return std::string(std::isfinite(value) ? text : "");
  };
  const MachineLimits& machine = report.machine;
  const auto today = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
  const std::time_t seconds = std::chrono::system_clock::to_time_t(today);
  std::tm date = {};
  gmtime_r(&seconds, &date);
  char head[256];
  std::snprintf(head, sizeof head,
                "%s, %u threads, %s, %.0f GFLOP/s of fused multiply-adds on one thread; %04d-%02d-%02d.\n\n",
                machine.processor.c_str(), machine.processors, machine.instruction_set.c_str(), machine.fma_flops / 1e9,
                date.tm_year + 1900, date.tm_mon + 1, date.tm_mday);
  std::string text = head;
  text += "| group | measured | figure | beside | limit | |\n|---|---|---|---|---|---|\n";
  for (const BenchLine& line : report.lines) {
    std::string beside;
    if (!line.reference_name.empty()) {
      beside = line.reference_name + ": " + number(line.reference) + ", " + number(line.ratio) + " x";
    } else if (line.bound > 0) {
      beside = "bound: " + number(line.bound) + ", " + number(line.value / line.bound) + " x";
    }
    const auto passed = line.passed();
    const char* const verdict = line.limit.empty() ? "" : !passed ? "not measured" : *passed ? "met" : "**missed**";
    text += "| " + line.group + " | " + line.name + " | " + number(line.value) + " " + line.unit + " | " + beside +
            " | " + line.limit + " | " + verdict + " |\n";
  }
  return text;
}

}  // namespace sinew::tools
