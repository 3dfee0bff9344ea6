// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/budget.h"

#include <algorithm>
#include <charconv>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "tools/author/json_text.h"
#include "tools/bench/answers.h"
#include "tools/core/atomic_file.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using nlohmann::ordered_json;

// Numbers of functions that are tried first, each about a fifth above the one before.
constexpr std::array<std::uint32_t, 21> kLadder = {8,  10, 12, 14, 16,  20,  24,  28,  32,  40, 48,
                                                   56, 64, 80, 96, 112, 128, 160, 192, 224, 256};
// Functions of the yardstick that errors are measured with; the most of the ladder where bakes near these are searched.
constexpr std::uint32_t kYardstick = 128;
// An error asked for that needs the finer one.
constexpr double kFineError = 0.03;
// A coarser mesh that is off by so much more with the same functions does not come nearer by what it saves in time.
constexpr double kWorth = 1.5;
// Other programs slow a measurement by less than this factor; no budget of time.
constexpr double kSurelyMore = 3, kForever = 1e300;
// Beyond so many times the budget no more functions are tried.
constexpr double kFarOver = 2;
// A time this near to its budget is not searched further.
constexpr double kNear = 0.9;

std::optional<double> leadingNumber(std::string_view text, std::string_view& unit) {
  double value = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), value);
  if (read.ec != std::errc() || !std::isfinite(value) || !(value > 0)) return std::nullopt;
  unit = text.substr(std::size_t(read.ptr - text.data()));
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  return value;
}

// Times of packages by their checksum, kept from one run to the next.
class Costs {
 public:
  explicit Costs(std::filesystem::path file) : file_(std::move(file)) {
    if (file_.empty() || !std::filesystem::exists(file_)) return;
    json_ = JsonText::read(file_.string()).json();
    if (!json_.is_object()) json_ = {{"", nullptr}};
    for (const auto& [key, times] : json_.items()) {
      const bool good = times.is_object() && times.contains("step") && times.contains("drawn") &&
                        times["step"].is_number() && times["drawn"].is_number();
      if (!good) {
        throw ToolError(ExitCode::bad_input, file_.string(), "'" + key + "' has no step and drawn, microseconds",
                        "It is no file of --cost-file: give another name.");
      }
    }
  }

  /// \param most microseconds: what takes longer is measured twice more, since other programs only slow it. Times of
  /// the file stay.
  FrameCost of(const std::shared_ptr<const Asset>& asset, FrameScene scene, double most) {
    char key[20];
    std::snprintf(key, sizeof key, "%016" PRIx64, asset->checksum());
    if (json_.contains(key)) return {json_[key]["step"].get<double>(), json_[key]["drawn"].get<double>()};
    FrameCost cost = measureFrame(asset, scene);
    for (int more = 0; more < 2 && cost.all() > most && cost.all() < kSurelyMore * most; ++more) {
      const FrameCost again = measureFrame(asset, scene);
      cost = {std::min(cost.step, again.step), std::min(cost.drawn, again.drawn)};
    }
    json_[key] = {{"step", cost.step}, {"drawn", cost.drawn}};
    if (!file_.empty()) writeFileAtomically(file_, json_.dump(2) + "\n");
    return cost;
  }

 private:
  std::filesystem::path file_;
  ordered_json json_ = ordered_json::object();
};

// Measure of errors: the recipe's own mesh with many functions, and its own error.
struct Yardstick {
  Answers answers;
  double own_error = 0;
};

double staticErrorOf(const formats::PackageView& package) {
  double error = 0;
  for (const formats::Field& field : package.fields()) error = std::max(error, double(field.static_error));
  return error;
}

// Bakes of one mesh by their number of functions.
class Search {
 public:
  Search(Recipe recipe, const Budget& budget, Costs& costs, StageCache* cache, std::optional<Yardstick>& yardstick)
      : recipe_(std::move(recipe)), budget_(budget), costs_(costs), cache_(cache), yardstick_(yardstick) {}

  const BudgetTry& tried(std::uint32_t functions) {
    const auto known = tries_.find(functions);
    if (known != tries_.end()) return known->second.first;
    Recipe recipe = recipe_;
    recipe.settings.field.functions = functions;
    Progress progress(false);
    BakeResult result = bake(recipe, progress, cache_);
    const auto asset = Asset::fromMemory(result.package);
    if (!asset) {
      throw ToolError(ExitCode::system, recipe.source.string(), "the baked package does not load: " + asset.reason(),
                      "This is a fault of sinew: please report it with the file.");
    }
    const formats::PackageView& package = (*asset)->package();
    if (package.fields().empty()) {
      throw ToolError(ExitCode::bad_input, recipe.source.string(), "it gets no fields, which a budget is about",
                      "Bake it without a budget, and see what the bake says of its fields.");
    }
    scene_ = usualScene(**asset);
    BudgetTry made{functions, std::uint32_t(package.physicalVertices().size()), result.package.size(),
                   costs_.of(*asset, scene_, budget_.microseconds.value_or(kForever)), staticErrorOf(package)};
    if (yardstick_) made.error = errorOf(package);
    return tries_.emplace(functions, std::pair(made, std::move(result))).first->second.first;
  }

  /// Takes bakes of this mesh as what errors are measured against: finer ones where such are searched.
  void setYardstick() {
    const bool fine = budget_.error ? *budget_.error < kFineError : fits(kYardstick);
    const std::uint32_t functions = fine ? kLadder.back() : kYardstick;
    const double own_error = tried(functions).error;
    const auto asset = *Asset::fromMemory(tries_.at(functions).second.package);
    if (asset->package().barycentric().empty()) return;
    yardstick_.emplace(Yardstick{Answers(asset->package()), own_error});
    for (auto& [k, made] : tries_) made.first.error = errorOf((*Asset::fromMemory(made.second.package))->package());
  }

  bool fits(std::uint32_t functions) {
    const BudgetTry& made = tried(functions);
    return (!budget_.microseconds || made.frame.all() <= *budget_.microseconds) &&
           (!budget_.bytes || made.bytes <= *budget_.bytes);
  }

  /// The most functions that fit. \return nothing where no number does.
  std::optional<std::uint32_t> most() {
    if (!fits(kLadder.front())) return std::nullopt;
    std::size_t low = 0, high = kLadder.size();
    while (high - low > 1) {
      const std::size_t middle = (low + high) / 2;
      (fits(kLadder[middle]) ? low : high) = middle;
    }
    // More functions do not always take longer: contacts and iterations go other ways.
    for (std::size_t above = low + 1; budget_.microseconds && above < kLadder.size(); ++above) {
      if (fits(kLadder[above])) low = above;
      if (tried(kLadder[above]).frame.all() > kFarOver * *budget_.microseconds) break;
    }
    high = low + 1;
    std::uint32_t best = kLadder[low], over = high < kLadder.size() ? kLadder[high] : best + 1;
    while (over - best > 1 && !isNear(best)) {
      const std::uint32_t middle = (best + over) / 2;
      (fits(middle) ? best : over) = middle;
    }
    return best;
  }

  /// The fewest functions within the error. \return nothing where none is.
  std::optional<std::uint32_t> fewest() {
    const auto* const found = std::partition_point(kLadder.begin(), kLadder.end(), [&](std::uint32_t functions) {
      return tried(functions).error > *budget_.error;
    });
    return found == kLadder.end() ? std::nullopt : std::optional(*found);
  }

  BudgetResult take(std::uint32_t functions) {
    // Costs of the next steps down and up.
    const auto at = std::lower_bound(kLadder.begin(), kLadder.end(), functions);
    if (at != kLadder.begin()) tried(*(at - 1));
    const auto above = at != kLadder.end() && *at == functions ? at + 1 : at;
    if (above != kLadder.end()) tried(*above);
    BudgetResult result;
    for (const auto& [k, made] : tries_) result.tries.push_back(made.first);
    result.chosen = tried(functions);
    result.bake = std::move(tries_.at(functions).second);
    result.scene = scene_;
    return result;
  }

 private:
  double errorOf(const formats::PackageView& package) const {
    return std::hypot(yardstick_->answers.errorOf(package), yardstick_->own_error);
  }

  bool isNear(std::uint32_t functions) {
    const BudgetTry& made = tried(functions);
    return (budget_.microseconds && made.frame.all() >= kNear * *budget_.microseconds) ||
           (budget_.bytes && double(made.bytes) >= kNear * double(*budget_.bytes));
  }

  Recipe recipe_;
  const Budget& budget_;
  Costs& costs_;
  StageCache* cache_;
  std::optional<Yardstick>& yardstick_;
  FrameScene scene_ = FrameScene::air;
  std::map<std::uint32_t, std::pair<BudgetTry, BakeResult>> tries_;
};

ordered_json tryJson(const BudgetTry& made) {
  return {{"functions", made.functions}, {"physical_vertices", made.vertices},
          {"step_us", made.frame.step},  {"drawn_us", made.frame.drawn},
          {"bytes", made.bytes},         {"error", made.error}};
}

std::string figures(const BudgetTry& made) { return budgetFigures(tryJson(made)); }

}  // namespace

std::string budgetFigures(const ordered_json& made) {
  const double step = made["step_us"].get<double>(), drawn = made["drawn_us"].get<double>();
  char text[160];
  std::snprintf(text, sizeof text,
                "%u functions, %u vertices: %.0f us a frame (%.0f step, %.0f drawn), %.0f kB, error %.2g %%",
                made["functions"].get<unsigned>(), made["physical_vertices"].get<unsigned>(), step + drawn, step, drawn,
                made["bytes"].get<double>() / 1000, 100 * made["error"].get<double>());
  return text;
}

std::optional<double> Budget::readTime(std::string_view text) {
  std::string_view unit;
  const auto value = leadingNumber(text, unit);
  if (!value || (unit != "ms" && unit != "us")) return std::nullopt;
  return unit == "ms" ? 1000 * *value : *value;
}

std::optional<std::uint64_t> Budget::readBytes(std::string_view text) {
  std::string_view unit;
  const auto value = leadingNumber(text, unit);
  if (unit.ends_with('B')) unit.remove_suffix(1);
  const double factor = unit == "M" ? 1e6 : unit == "k" ? 1e3 : unit.empty() ? 1 : 0;
  if (!value || factor == 0 || *value * factor < 1 || *value * factor > 1e15) return std::nullopt;
  return std::uint64_t(*value * factor);
}

std::optional<double> Budget::readError(std::string_view text) {
  std::string_view unit;
  const auto value = leadingNumber(text, unit);
  if (!value || (!unit.empty() && unit != "%")) return std::nullopt;
  const double share = unit == "%" ? *value / 100 : *value;
  // "5" means 5 % more likely than 500.
  if (unit.empty() && share > 1) return std::nullopt;
  return share;
}

BudgetResult bakeWithin(const Recipe& recipe, const Budget& budget, const std::filesystem::path& costs,
                        Progress& progress, StageCache* cache) {
  progress.stage("budget");
  Costs known(costs);
  std::optional<Yardstick> yardstick;
  std::optional<BudgetResult> best;
  std::string missed;  // how near it came
  Recipe trial = recipe;
  // Half as many vertices each time, until the mesh gets no coarser.
  for (std::uint32_t vertices = std::numeric_limits<std::uint32_t>::max();;) {
    const bool first = vertices == std::numeric_limits<std::uint32_t>::max();
    Search search(trial, budget, known, cache, yardstick);
    try {
      if (first) search.setYardstick();
      const std::uint32_t made_vertices = search.tried(kLadder.front()).vertices;
      if (made_vertices >= vertices) break;
      vertices = made_vertices;
      if (best && !budget.bytes && search.tried(best->chosen.functions).error > kWorth * best->chosen.error) break;
      const std::optional<std::uint32_t> functions = budget.error ? search.fewest() : search.most();
      if (!functions && budget.error) {
        if (missed.empty()) missed = "no bake comes within this error: " + figures(search.tried(kLadder.back()));
        break;  // fewer vertices are no nearer
      }
      if (!functions) {
        missed = "nothing fits the budget: " + figures(search.tried(kLadder.front()));  // the next mesh is cheaper
      } else if (const BudgetTry& made = search.tried(*functions); !search.fits(*functions)) {
        if (missed.empty()) missed = "what comes within this error exceeds the budget: " + figures(made);
      } else {
        const bool better =
            !best || (budget.error ? made.frame.all() < best->chosen.frame.all() : made.error < best->chosen.error);
        if (!better) break;
        best = search.take(*functions);
        if (!yardstick) break;  // meshes are compared by what hangs on their tetrahedra
      }
    } catch (const ToolError&) {
      if (first) throw;
      break;  // no mesh of so few vertices
    }
    trial.settings.tetrahedra.target_vertices = vertices / 2;
  }
  if (best) return std::move(*best);
  throw ToolError(ExitCode::bad_input, recipe.source.string(), missed,
                  budget.error ? "Allow a larger --max-error, or more time or bytes."
                               : "Allow more; leave out what the game does not want (--needs); or simplify the drawn "
                                 "mesh, which has its part in time and bytes.");
}

ordered_json budgetJson(const Budget& budget, const BudgetResult& result) {
  constexpr std::array<const char*, 3> kScenes = {"in the air", "dropped onto the ground", "held by its pins"};
  ordered_json json;
  if (budget.microseconds) json["microseconds"] = *budget.microseconds;
  if (budget.bytes) json["bytes"] = *budget.bytes;
  if (budget.error) json["error"] = *budget.error;
  json["scene"] = kScenes[std::size_t(result.scene)];
  json["chosen"] = tryJson(result.chosen);
  json["tries"] = ordered_json::array();
  for (const BudgetTry& made : result.tries) json["tries"].push_back(tryJson(made));
  return json;
}

}  // namespace sinew::tools
