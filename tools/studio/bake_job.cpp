// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/bake_job.h"

#include <algorithm>
#include <utility>

#include "tools/author/json_text.h"
#include "tools/bake/findings_json.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

// Inverse of findingsJson().
std::vector<Finding> findingsOf(const nlohmann::ordered_json& report) {
  std::vector<Finding> findings;
  if (!report.contains("findings")) return findings;
  for (const auto& entry : report["findings"]) {
    Finding& finding = findings.emplace_back();
    finding.id = entry.value("id", "");
    const std::string severity = entry.value("severity", "");
    finding.severity = severity == "error"     ? Severity::error
                       : severity == "warning" ? Severity::warning
                                               : Severity::info;
    finding.message = entry.value("message", "");
    finding.count = entry.value("count", std::uint64_t{0});
    finding.place_kind = entry.value("place_kind", "");
    finding.place = entry.value("place", "");
    finding.cure = entry.value("cure", "");
    if (entry.contains("places")) finding.places = entry["places"].get<std::vector<std::uint32_t>>();
  }
  return findings;
}

// Whether the fields of a piece are a draft's.
bool isDraftOf(const nlohmann::ordered_json& report) {
  if (!report.contains("fields") || !report["fields"].is_array()) return false;
  const auto& pieces = report["fields"];
  return std::any_of(pieces.begin(), pieces.end(), [](const auto& piece) { return piece.value("draft", false); });
}

}  // namespace

void BakeJob::start(const fs::path& recipe) {
  recipe_ = recipe;
  run(true);
}

void BakeJob::run(bool draft) {
  const std::string base = (folder_.path() / std::to_string(++number_)).string();
  target_ = base + ".sinew";
  error_.clear();
  std::vector<std::string> words = {"bake",         recipe_.string(),   "-o", target_.string(), "--report",
                                    base + ".json", "--progress-lines", "-q"};
  if (draft) words.emplace_back("--draft");
  const bool started =
      child_.start(std::move(words), "the bake", "Memory may have run out: lower tetrahedra.vertices.");
  state_ = started ? State::running : State::failed;
  if (!started) error_ = child_.error();
}

void BakeJob::cancel() {
  if (child_.isRunning()) state_ = State::idle;
  child_.cancel();
}

void BakeJob::poll() {
  const ChildJob::Ended ended = child_.poll();
  if (ended == ChildJob::Ended::failed) {
    state_ = State::failed;
    error_ = child_.error();
  } else if (ended == ChildJob::Ended::done) {
    finish();
  }
}

void BakeJob::finish() {
  auto loaded = Asset::load(target_.string());
  if (!loaded) {
    state_ = State::failed;
    error_ = loaded.reason();
    return;
  }
  is_draft_ = false;
  try {
    const JsonText report = JsonText::read(fs::path(target_).replace_extension(".json").string());
    findings_ = findingsOf(report.json());
    is_draft_ = isDraftOf(report.json());
  } catch (const std::exception& error) {
    error_ = error.what();
  }
  std::error_code error;
  if (!package_.empty()) fs::remove(package_, error);
  package_ = target_;
  asset_ = *loaded;
  state_ = State::done;
  ++done_;
  if (is_draft_) run(false);
}

}  // namespace sinew::tools
