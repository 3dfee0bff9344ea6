// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/settings.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <span>
#include <sstream>

#include "tools/author/json_text.h"
#include "tools/author/needs.h"
#include "tools/core/error.h"
#include "tools/core/text.h"
#include "tools/core/units.h"

namespace sinew::tools {
namespace {

// How clusters are laid out over a body: of all of them, so no cluster has its own.
constexpr std::array<std::string_view, 4> kLayoutKeys = {"clusters.method", "clusters.grid", "clusters.size",
                                                         "clusters.soften_metres"};

// A setting used only if another has a given value.
struct Dependence {
  std::string_view key, needs_key, needs_value;
};
constexpr std::array<Dependence, 10> kDependences = {{{"clusters.grid", "clusters.method", "grid"},
                                                      {"clusters.size", "clusters.method", "kmeans"},
                                                      {"clusters.bend_hz", "clusters.mode", "quadratic"},
                                                      {"clusters.twist_hz", "clusters.mode", "quadratic"},
                                                      {"clusters.stretch_hz", "clusters.stiffness", "frequency"},
                                                      {"clusters.per_step_beta", "clusters.stiffness", "per_step"},
                                                      {"clusters.young", "clusters.stiffness", "elastic"},
                                                      {"clusters.poisson", "clusters.stiffness", "elastic"},
                                                      {"clusters.limit_norm_max", "clusters.limit", "soft"},
                                                      {"clusters.limit_curve", "clusters.limit", "curve"}}};

// A number without a sign, as a regular expression.
const std::string kPositive = "([0-9]+\\.?[0-9]*|\\.[0-9]+)([eE][+-]?[0-9]+)?";

std::optional<double> parseNumber(std::string_view text) {
  double value = 0;
  const char* end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

bool legalCurve(const std::string& text) {
  const auto points = curvePoints(text);
  return text.empty() || !points.empty();
}

Settings::Number numberIn(double& value, const Range<double>& legal) { return {&value, legal.least, legal.most}; }

[[noreturn]] void badValue(const Settings::Declaration& d, std::string_view text) {
  throw ToolError(ExitCode::usage, "", "setting " + std::string(d.key) + " cannot be '" + std::string(text) + "'",
                  "Legal: " + legalText(d) + ".");
}

bool setFromText(Settings& settings, const Settings::Declaration& d, std::string_view text) {
  struct Visitor {
    Settings& settings;
    std::string_view text;
    bool operator()(const Settings::Number& t) const {
      const auto value = parseNumber(text);
      if (!value || *value < t.minimum || *value > t.maximum) return false;
      *t.value = *value;
      return true;
    }
    bool operator()(const Settings::AutoNumber& t) const {
      const auto value = parseNumber(text);
      if (text != "auto" && (!value || *value < 0 || *value > t.maximum)) return false;
      *t.value = value;
      return true;
    }
    bool operator()(const Settings::Count& t) const {
      const auto value = parseNumber(text);
      if (!value || *value != std::floor(*value) || *value < t.minimum || *value > t.maximum) return false;
      *t.value = static_cast<std::uint32_t>(*value);
      return true;
    }
    bool operator()(const Settings::Flag& t) const {
      const bool yes = text == "true" || text == "on" || text == "yes" || text == "1";
      const bool no = text == "false" || text == "off" || text == "no" || text == "0";
      if (yes || no) *t.value = yes;
      return yes || no;
    }
    bool operator()(const Settings::Choice& t) const {
      for (std::size_t i = 0; i < t.names.size(); ++i) {
        if (t.names[i] == text) {
          t.set(settings, int(i));
          return true;
        }
      }
      return false;
    }
    bool operator()(const Settings::Text& t) const {
      if (!t.legal(std::string(text))) return false;
      *t.value = text;
      return true;
    }
    bool operator()(const Settings::Grid& t) {
      if (text == "auto") {
        *t.value = {0, 0, 0};
        return true;
      }
      if (!text.empty() && text.front() == '[' && text.back() == ']') text = text.substr(1, text.size() - 2);
      std::array<std::uint32_t, 3> grid{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t comma = text.find(',');
        if ((comma == std::string_view::npos) != (axis == 2)) return false;
        std::string_view part = text.substr(0, comma);
        while (!part.empty() && part.front() == ' ') part.remove_prefix(1);
        while (!part.empty() && part.back() == ' ') part.remove_suffix(1);
        const auto value = parseNumber(part);
        if (!value || *value != std::floor(*value) || *value < 1 || *value > t.maximum) return false;
        grid[axis] = static_cast<std::uint32_t>(*value);
        if (axis < 2) text = text.substr(comma + 1);
      }
      *t.value = grid;
      return true;
    }
  };
  Visitor visitor{settings, text};
  return std::visit(visitor, d.type);
}

std::string textOf(const nlohmann::ordered_json& value) {
  return value.is_string() ? value.get<std::string>() : value.dump();
}

// Whether a recipe's value has the type that the schema says.
bool hasType(const Settings::Declaration& d, const nlohmann::ordered_json& value) {
  struct Visitor {
    const nlohmann::ordered_json& value;
    bool operator()(const Settings::Number&) const { return value.is_number(); }
    bool operator()(const Settings::AutoNumber&) const { return value == "auto" || value.is_number(); }
    bool operator()(const Settings::Count&) const { return value.is_number(); }
    bool operator()(const Settings::Flag&) const { return value.is_boolean(); }
    bool operator()(const Settings::Choice&) const { return value.is_string(); }
    bool operator()(const Settings::Text& t) const {
      return value.is_string() || (t.metres_per_unit && value.is_number());
    }
    bool operator()(const Settings::Grid&) const { return value == "auto" || value.is_array(); }
  };
  return std::visit(Visitor{value}, d.type);
}

const Settings::Declaration& declarationOf(std::span<const Settings::Declaration> all, std::string_view key) {
  const auto at = std::find_if(all.begin(), all.end(), [&](const auto& d) { return d.key == key; });
  if (at != all.end()) return *at;
  if (key.ends_with("material")) {
    throw ToolError(ExitCode::usage, "", "a material is no setting: it stands for several",
                    "Set it in a recipe: sinew author RECIPE set clusters.material=NAME, or CLUSTER.material=NAME.");
  }
  std::vector<std::string> keys;
  for (const Settings::Declaration& d : all) keys.emplace_back(d.key);
  const auto last_part = std::find_if(
      keys.begin(), keys.end(), [end = "." + std::string(key)](const std::string& k) { return k.ends_with(end); });
  throw ToolError(ExitCode::usage, "", "there is no setting '" + std::string(key) + "'",
                  "Did you mean " + (last_part != keys.end() ? *last_part : nearestName(key, keys)) +
                      "? All settings: sinew help settings.");
}

nlohmann::ordered_json settingJson(const Settings& settings, const Settings::Declaration& d) {
  if (const auto* number = std::get_if<Settings::Number>(&d.type)) return *number->value;
  if (const auto* optional = std::get_if<Settings::AutoNumber>(&d.type); optional != nullptr && *optional->value) {
    return **optional->value;
  }
  if (const auto* count = std::get_if<Settings::Count>(&d.type)) return *count->value;
  if (const auto* flag = std::get_if<Settings::Flag>(&d.type)) return *flag->value;
  return valueText(settings, d);
}

}  // namespace

std::vector<formats::CurvePoint> curvePoints(std::string_view text) {
  std::vector<formats::CurvePoint> points;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size()), colon = text.find(':');
    if (colon == std::string_view::npos || colon > comma) return {};
    const auto norm = parseNumber(text.substr(0, colon));
    const auto response = parseNumber(text.substr(colon + 1, comma - colon - 1));
    if (!norm || !response || *norm < 3 || *norm > 1e6 || *response < 3 || *response > *norm) return {};
    const formats::CurvePoint point{float(*norm), float(*response)};
    const bool fits = points.empty() ? point.response == point.norm
                                     : point.norm > points.back().norm && point.response >= points.back().response;
    if (!fits) return {};
    points.push_back(point);
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  if (points.size() < 2) return {};
  return points;
}

std::vector<Settings::Declaration> Settings::declarations(Settings& s) {
  using formats::ClusterMode;
  std::vector<Declaration> all = {
      {"import.unit", "", "Unit of length of the source; auto: as the file says, else metres.",
       Text{&s.import.unit, isImportUnit, "auto | " + lengthUnitNames(" | ") + " | metres per unit",
            "^(auto|" + lengthUnitNames("|") + "|\\+?" + kPositive + ")$", true}},
      {"import.up", "", "Which axis of the source points up; auto: as the file says, else y.",
       Text{&s.import.up, isImportUp, "auto | y | z", "^(auto|y|z)$"}},
      {"import.front", "",
       "Which axis of the source points to the front, for cameras and captions; auto: z, or -y where z is up.",
       Text{&s.import.front, isImportFront, "auto | x | -x | y | -y | z | -z", "^(auto|-?[xyz])$"}},
      {"import.weld", "diagonals", "Positions closer than this are one point; 0 welds exactly equal ones only.",
       numberIn(s.import.weld_tolerance, ImportOptions::kWeld)},
      {"import.crease", "degrees",
       "Without normals in the source: edges whose faces differ by more are hard; 180 makes all smooth.",
       numberIn(s.import.crease_degrees, ImportOptions::kCrease)},
      {"import.keep_stray", "",
       "Keep stray faces: at most 1 % of the area, 20 times further from the middle than all the rest. They then set "
       "the diagonal; otherwise they are left out, with a warning.",
       Flag{&s.import.keep_stray}},
      {"import.memory_mb", "MB", "Bound on the memory of the process that reads the source.",
       Count{&s.import.memory_megabytes, ImportOptions::kMegabytes.least, ImportOptions::kMegabytes.most}},
      {"import.seconds", "s",
       "Bound on the processor time of the process that reads the source; four times that on the clock.",
       numberIn(s.import.seconds, ImportOptions::kSeconds)},
      {"tetrahedra.method", "",
       "How the solid is filled: stuffing follows the surface, grid is a cage of boxes that loses nothing, delaunay "
       "fits best and is slow, shell is a skin over an open surface; auto takes shell for sheets that enclose nothing, "
       "else stuffing where it loses nothing, else grid.",
       Choice{{"auto", "grid", "stuffing", "delaunay", "shell"},
              [](const Settings& x) { return int(x.tetrahedra.method); },
              [](Settings& x, int v) { x.tetrahedra.method = TetrahedraMethod(v); }}},
      {"tetrahedra.vertices", "", "Physical vertices wanted, over all pieces; more cost more and bend finer.",
       Count{&s.tetrahedra.target_vertices, 8, 1000000}},
      {"tetrahedra.thickness", "m",
       "Thickness of a shell; 0 = half of the mean edge of its tetrahedra. Shortened at creases.",
       Number{&s.tetrahedra.shell_thickness, 0, 1e6}},
      {"tetrahedra.join", "diagonals",
       "Parts closer than this move as one piece; others are separate pieces, but small ones close to a much larger "
       "one go with it.",
       Number{&s.tetrahedra.join_distance, 0, 1}},
      {"clusters.grid", "", "Boxes along x, y and z that each piece is cut into; auto chooses by size and shape.",
       Grid{&s.clusters.grid, 64}},
      {"clusters.overlap", "m",
       "How far a cluster reaches into its neighbours, so that materials blend. auto: half a box of a grid, else 1.5 "
       "edges of the tetrahedra. 0: a recipe's clusters as they were painted.",
       AutoNumber{&s.clusters.overlap, 1e6}},
      {"clusters.method", "",
       "How clusters are made where the recipe has none: boxes along the axes, or regions of equal size that follow "
       "the shape (k-means).",
       Choice{{"grid", "kmeans"},
              [](const Settings& x) { return int(x.clusters.method); },
              [](Settings& x, int v) { x.clusters.method = ClusterMethod(v); }}},
      {"clusters.size", "m", "Of kmeans: how wide a cluster is; 0 chooses by the number of physical vertices.",
       Number{&s.clusters.size, 0, 1e6}},
      {"clusters.soften_metres", "m",
       "Width, along the body, over which a recipe's clusters blend wherever their weights jump between neighbouring "
       "vertices; 0: weights stay as they are.",
       Number{&s.clusters.soften_metres, 0, 1e6}},
      {"clusters.mode", "",
       "rigid: a bone; vertices that belong to it alone are held firm. linear: stretch_hz alone counts. quadratic: the "
       "lowest of the three frequencies counts. With attachment.method=clusters and with --solver report, quadratic "
       "clusters also bend and twist.",
       Choice{{"rigid", "linear", "quadratic"},
              [](const Settings& x) { return int(x.clusters.mode); },
              [](Settings& x, int v) { x.clusters.mode = ClusterMode(v); }}},
      {"clusters.alpha", "",
       "Only --solver report with stiffness per_step: part of the way to its goal that a vertex goes in a step.",
       Number{&s.clusters.alpha, 0, 1}},
      {"clusters.stretch_hz", "Hz",
       "Frequency of stretch and shear: higher is stiffer. The lowest mode of a piece rings at its lowest frequency; "
       "clusters stand to each other as theirs squared.",
       Number{&s.clusters.stretch_hz, 0, 1e5}},
      {"clusters.bend_hz", "Hz",
       "Of quadratic clusters: frequency of bending; one thinner than a seventh of its length takes stretch_hz.",
       Number{&s.clusters.bend_hz, 0, 1e5}},
      {"clusters.twist_hz", "Hz",
       "Of quadratic clusters: frequency of twisting; one thinner than a seventh of its length takes stretch_hz.",
       Number{&s.clusters.twist_hz, 0, 1e5}},
      {"clusters.stiffness", "",
       "Where the stiffness comes from: the three frequencies; per_step_beta, as the frequency of which a step of 1/60 "
       "s keeps that part (--solver report: every step keeps it); or the modulus of an elastic solid.",
       Choice{{"frequency", "per_step", "elastic"},
              [](const Settings& x) { return int(x.clusters.stiffness); },
              [](Settings& x, int v) { x.clusters.stiffness = formats::StiffnessModel(v); }}},
      {"clusters.per_step_beta", "", "Of per_step: part of a deformation that a step of 1/60 s keeps; 0 is rigid.",
       Number{&s.clusters.per_step_beta, 0, 1}},
      {"clusters.young", "Pa",
       "Of elastic: Young's modulus; fat 1e4, muscle 1e5, rubber 1e6. What is taller than E over density times "
       "gravity (a metre at 1e4) cannot carry itself.",
       Number{&s.clusters.young, 0, 1e12}},
      {"clusters.poisson", "",
       "Of elastic: Poisson's ratio; towards 0.5 a body thins as it is stretched. Above 0.49 it counts as 0.49.",
       Number{&s.clusters.poisson, 0, 0.499}},
      {"clusters.damping", "1/s", "Decay of motion that is not rigid, besides the world's.",
       Number{&s.clusters.damping, 0, 1e5}},
      {"clusters.limit", "",
       "A bound beyond which a cluster is much stiffer: on each principal stretch; on the lengths of the rest axes "
       "(rows); or on the squared norm of the deformation (frobenius, the same as frobenius_cheap; soft; curve).",
       Choice{{"none", "rows", "frobenius", "frobenius_cheap", "soft", "principal", "curve"},
              [](const Settings& x) { return int(x.clusters.limit); },
              [](Settings& x, int v) { x.clusters.limit = formats::LimitMethod(v); }}},
      {"clusters.limit_min", "", "Of principal: least stretch.", Number{&s.clusters.limit_min, 0.05, 1}},
      {"clusters.limit_max", "", "Of principal and rows: stretch beyond which it resists twenty times as firmly.",
       Number{&s.clusters.limit_max, 1, 20}},
      {"clusters.limit_norm", "",
       "Of frobenius, frobenius_cheap and soft: squared norm from which they act; 3 is rest.",
       Number{&s.clusters.limit_norm, 3, 1000}},
      {"clusters.limit_norm_max", "", "Of soft: squared norm that is never reached.",
       Number{&s.clusters.limit_norm_max, 3, 1000}},
      {"clusters.limit_curve", "", "Of curve: points of squared norm and response, ascending, the first on phi:phi.",
       Text{&s.clusters.limit_curve, legalCurve, "phi:f,phi:f,... with 3 <= f <= phi, or empty",
            "^(" + kPositive + ":" + kPositive + "(," + kPositive + ":" + kPositive + ")+,?)?$"}},
      {"clusters.volume", "",
       "Whether a cluster without its own modulus keeps its volume: cube_root and principal make Poisson's ratio 0.4, "
       "none 0.3; auto takes principal for solids, none for sheets. --solver report scales the match to its volume at "
       "rest.",
       Choice{{"auto", "none", "cube_root", "principal"},
              [](const Settings& x) { return x.clusters.volume ? int(*x.clusters.volume) + 1 : 0; },
              [](Settings& x, int v) {
                x.clusters.volume.reset();
                if (v > 0) x.clusters.volume = formats::VolumeMethod(v - 1);
              }}},
      {"clusters.plastic_yield", "", "Deformation from which some of it becomes permanent; 0.1 is 10 % of stretch.",
       Number{&s.clusters.plastic_yield, 0, 10}},
      {"clusters.plastic_creep", "1/s", "How fast it becomes permanent; 0 = never.",
       Number{&s.clusters.plastic_creep, 0, 1e5}},
      {"clusters.plastic_limit", "", "Most deformation that becomes permanent.",
       Number{&s.clusters.plastic_limit, 0, 10}},
      {"material.density", "kg/m^3", "Density of the masses; water is 1000.", Number{&s.material.density, 1e-3, 1e5}},
      {"field.functions", "",
       "Functions that a piece moves in: more bend finer and cost more. 0: only --solver report moves the package.",
       Count{&s.field.functions, 0, 256}},
      {"field.levels", "",
       "Levels of detail beside the whole, for bodies far away: each has half the functions of the one before, no "
       "fewer "
       "than eight (BodySettings::level).",
       Count{&s.field.levels, 0, 4}},
      {"field.samples", "", "Samples of the elastic energy for each function.", Number{&s.field.samples, 1, 100}},
      {"field.points", "", "Points of each piece's surface that may touch something.", Count{&s.field.points, 0, 4096}},
      {"field.residual_modes", "",
       "Shapes beside the functions in which places that a game holds give way: more are more exact and take memory, 6 "
       "bytes a vertex each. 0: springs of one firmness hold.",
       Count{&s.field.residual_modes, 0, 256}},
      {"field.distances", "",
       "Cells along the longest side of each piece's grid of distances, by which other bodies touch it. Where it is "
       "thin they are smaller, as far as a grid takes no more nodes than a cube's. 0: others pass through.",
       Count{&s.field.distances, 0, 200}},
      {"attachment.method", "",
       "How visual vertices follow: in their tetrahedron (exact contacts and pins), or by blended transforms of "
       "clusters (smoothest).",
       Choice{{"barycentric", "clusters"},
              [](const Settings& x) { return int(x.attachment.method); },
              [](Settings& x, int v) { x.attachment.method = AttachmentMethod(v); }}},
      {"package.needs", "",
       "What a game wants of the package, separated by commas; sections that serve none of it are left out, and "
       "without exact numbers have 16 bits. auto: the others, or all that is seen and felt, less what nobody would "
       "miss. "
       "Names: sinew bake --help.",
       Text{&s.package.needs, [](const std::string& text) { return Needs::parse(text).has_value(); },
            "all | none | auto | " + Needs::names(" | "),
            "^(all|none|(auto|" + Needs::names("|") + ")( *, *(auto|" + Needs::names("|") + "))*)$"}},
  };
  for (Declaration& d : all) {
    d.of_cluster = d.key.starts_with(kClusterPrefix) &&
                   std::find(kLayoutKeys.begin(), kLayoutKeys.end(), d.key) == kLayoutKeys.end();
    const auto* need =
        std::find_if(kDependences.begin(), kDependences.end(), [&](const Dependence& n) { return n.key == d.key; });
    if (need == kDependences.end()) continue;
    d.needs_key = need->needs_key;
    d.needs_value = need->needs_value;
  }
  return all;
}

void Settings::set(std::string_view key, std::string_view text) {
  const auto all = declarations(*this);
  const Declaration& d = declarationOf(all, key);
  if (!setFromText(*this, d, text)) badValue(d, text);
}

void Settings::setJson(std::string_view key, const nlohmann::ordered_json& value) {
  const auto all = declarations(*this);
  const Declaration& d = declarationOf(all, key);
  if (!hasType(d, value)) badValue(d, value.dump());
  if (!setFromText(*this, d, textOf(value))) badValue(d, textOf(value));
}

nlohmann::ordered_json Settings::recipeValue(std::string_view key) const {
  Settings copy = *this;
  const auto all = declarations(copy);
  const Declaration& d = declarationOf(all, key);
  if (const auto* grid = std::get_if<Grid>(&d.type); grid != nullptr && (*grid->value)[0] != 0) return *grid->value;
  return settingJson(copy, d);
}

void Settings::assign(std::string_view assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string_view::npos) {
    throw ToolError(ExitCode::usage, "", "--set wants KEY=VALUE, not '" + std::string(assignment) + "'",
                    "All settings: sinew help settings.");
  }
  set(assignment.substr(0, equals), assignment.substr(equals + 1));
}

nlohmann::ordered_json Settings::toJson() const {
  Settings copy = *this;
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (const Declaration& d : declarations(copy)) json[std::string(d.key)] = settingJson(copy, d);
  return json;
}

nlohmann::ordered_json typedSetting(std::string_view key, nlohmann::ordered_json value) {
  Settings trial;
  try {
    trial.setJson(key, value);
    return value;
  } catch (const ToolError&) {
  }
  try {
    trial.set(key, textOf(value));
  } catch (const ToolError&) {
    return value;  // told where it is read
  }
  return trial.recipeValue(key);
}

std::string legalText(const Settings::Declaration& d) {
  struct Visitor {
    std::string operator()(const Settings::Number& t) const {
      return exactText(t.minimum) + " .. " + exactText(t.maximum);
    }
    std::string operator()(const Settings::AutoNumber& t) const { return "auto | 0 .. " + exactText(t.maximum); }
    std::string operator()(const Settings::Count& t) const {
      return std::to_string(t.minimum) + " .. " + std::to_string(t.maximum);
    }
    std::string operator()(const Settings::Flag&) const { return "true | false"; }
    std::string operator()(const Settings::Choice& t) const {
      std::string text;
      for (const auto& name : t.names) text += (text.empty() ? "" : " | ") + std::string(name);
      return text;
    }
    std::string operator()(const Settings::Text& t) const { return std::string(t.form); }
    std::string operator()(const Settings::Grid& t) const {
      return "auto | [nx,ny,nz], each 1 .. " + std::to_string(t.maximum);
    }
  };
  return std::visit(Visitor{}, d.type);
}

std::vector<std::string> choicesOf(std::string_view key) {
  Settings settings;
  for (const auto& d : Settings::declarations(settings)) {
    if (d.key != key) continue;
    const auto& names = std::get<Settings::Choice>(d.type).names;
    return {names.begin(), names.end()};
  }
  return {};
}

std::string valueText(const Settings& settings, const Settings::Declaration& d) {
  struct Visitor {
    const Settings& settings;
    std::string operator()(const Settings::Number& t) const { return exactText(*t.value); }
    std::string operator()(const Settings::AutoNumber& t) const { return *t.value ? exactText(**t.value) : "auto"; }
    std::string operator()(const Settings::Count& t) const { return std::to_string(*t.value); }
    std::string operator()(const Settings::Flag& t) const { return *t.value ? "true" : "false"; }
    std::string operator()(const Settings::Choice& t) const {
      return std::string(t.names[std::size_t(t.get(settings))]);
    }
    std::string operator()(const Settings::Text& t) const { return *t.value; }
    std::string operator()(const Settings::Grid& t) const {
      const auto& g = *t.value;
      if (g[0] == 0) return "auto";
      return "[" + std::to_string(g[0]) + "," + std::to_string(g[1]) + "," + std::to_string(g[2]) + "]";
    }
  };
  return std::visit(Visitor{settings}, d.type);
}

std::string settingsMarkdown() {
  Settings defaults;
  std::ostringstream out;
  out << "# Settings of a bake\n\n"
      << "Written by `sinew help settings --markdown` from the declarations in `tools/author/settings.cpp`; a test "
         "compares.\n"
      << "Give them with `--set KEY=VALUE` or in a recipe's `settings`. A length in diagonals is relative to the "
         "bounding box's.\n\n"
      << "| key | default | legal | unit | what it does |\n|---|---|---|---|---|\n";
  for (const auto& d : Settings::declarations(defaults)) {
    std::string legal = legalText(d);
    for (std::size_t at = 0; (at = legal.find('|', at)) != std::string::npos; at += 2) legal.insert(at, "\\");
    out << "| `" << d.key << "` | " << valueText(defaults, d) << " | " << legal << " | " << d.unit << " | "
        << d.sentence << " |\n";
  }
  return out.str();
}

}  // namespace sinew::tools
