// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/pins.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "sinew/runtime/world.h"
#include "tools/study/body_measure.h"
#include "tools/study/names.h"
#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr double kLength = 1, kThickness = 0.2;  // m
constexpr double kAtRest = 0.05;                 // m/s
constexpr double kSoftHz = 3;
constexpr double kSagSeconds = 6, kReturnSeconds = 4, kPullSeconds = 4;
constexpr float kPull = 0.15F;  // m, upwards
constexpr float kPullHz = 2;
constexpr std::array<double, 4> kRates = {30, 60, 120, 240};

StudyPackageOptions optionsOf(BeamStuff stuff) {
  StudyPackageOptions options;
  options.mode = formats::ClusterMode::quadratic;
  options.frequency_hz = kSoftHz;
  options.surface = true;
  if (stuff == BeamStuff::soft) return options;
  options.mechanics = formats::kPlainMechanics;
  options.mechanics->stiffness = formats::StiffnessModel::elastic;
  options.mechanics->young = 1e6F;
  options.mechanics->poisson = 0.3F;
  options.mechanics->damping = 2;
  if (stuff == BeamStuff::elastic_limits) {
    options.mechanics->limit = formats::LimitMethod::principal;
    options.mechanics->volume = formats::VolumeMethod::principal;
  }
  return options;
}

std::string_view nameOf(BeamStuff stuff) {
  return std::array<std::string_view, 3>{"3 Hz", "elastic", "elastic, limits"}[std::size_t(stuff)];
}

// The vertices of one cross-section, and where they are.
struct Section {
  double area = 0;  ///< over that at rest
  Vector3d center = Vector3d::Zero();
  Vector3d normal = Vector3d::UnitX();
};

class HeldBeam {
 public:
  explicit HeldBeam(const PinsCase& beam) : world_(settingsOf(beam)), step_(float(1 / beam.rate_hz)) {
    BoxBody box;
    box.cells = beam.cells;
    box.size = {kLength, kThickness, kThickness};
    box.center = {kLength / 2, 0, 0};
    box.clusters = {beam.clusters, 1, 1};
    asset_ = boxPackage(box, optionsOf(beam.stuff));
    body_ = *world_.addBody(asset_);
    spacing_ = kLength / beam.cells[0];
    wall_ = sectionVertices(0);
    pins_ = *world_.addPinSet(body_, wall_, {}, beam.method);
  }

  void run(double seconds, bool& finite) {
    for (long i = 0; i < std::lround(seconds / double(step_)); ++i) {
      world_.step(step_);
      finite = finite && BodyMeasure::finite(world_, body_);
    }
  }
  void endGravity() { world_.settings().gravity = {0, 0, 0}; }
  void pullCorner() {
    const auto visual = asset_->package().visualPositions();
    const auto highest = std::max_element(visual.begin(), visual.end(), [](const auto& a, const auto& b) {
      return a[0] + a[1] + a[2] < b[0] + b[1] + b[2] - 1e-5F;
    });
    const Vec3& place = *highest;
    world_.pick(body_, std::uint32_t(highest - visual.begin()), {place[0], place[1] + kPull, place[2]}, kPullHz);
  }

  void measure(PinsResult& result) const {
    result.vertices = std::uint32_t(rest().size());
    const Section end = section(kLength);
    result.sag = -end.center[1];
    for (const Vec3& v : world_.velocities(body_)) result.speed = std::max(result.speed, wide(v).norm());
    result.end_turn_deg = turnOf(end);
    result.wall_turn_deg = turnOf(section(spacing_));
    result.wall_error = largestMove(wall_);
    result.volume = tetrahedraVolume(world_, body_) / (kLength * kThickness * kThickness);
    for (const double part : {0.25, 0.5, 0.75, 1.0}) {
      const double at = std::round(part * kLength / spacing_) * spacing_;
      result.section_change = std::max(result.section_change, std::abs(section(at).area - 1));
    }
    const PinReaction reaction = world_.pinReaction(pins_);
    result.force = wide(reaction.force);
    result.moment = double(reaction.torque[2]);
  }
  double largestMove() const {
    std::vector<std::uint32_t> all(rest().size());
    for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    return largestMove(all);
  }

 private:
  static WorldSettings settingsOf(const PinsCase& beam) {
    WorldSettings settings;
    if (beam.pulled) settings.gravity = {0, 0, 0};
    return settings;
  }
  std::span<const formats::PhysicalVertex> rest() const { return asset_->package().physicalVertices(); }

  std::vector<std::uint32_t> sectionVertices(double x) const {
    std::vector<std::uint32_t> result;
    for (std::uint32_t i = 0; i < rest().size(); ++i) {
      if (std::abs(double(rest()[i].rest_position[0]) - x) < 1e-6) result.push_back(i);
    }
    return result;
  }

  // The affine map of the section that fits its vertices best.
  Section section(double x) const {
    const std::vector<std::uint32_t> vertices = sectionVertices(x);
    Section result;
    Vector3d rest_center = Vector3d::Zero();
    for (const std::uint32_t i : vertices) {
      result.center += wide(world_.positions(body_)[i]) / double(vertices.size());
      rest_center += wide(rest()[i].rest_position) / double(vertices.size());
    }
    Eigen::Matrix<double, 3, 2> sides = Eigen::Matrix<double, 3, 2>::Zero();
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const std::uint32_t i : vertices) {
      const Eigen::Vector2d d = (wide(rest()[i].rest_position) - rest_center).tail<2>();
      sides += (wide(world_.positions(body_)[i]) - result.center) * d.transpose();
      spread += d * d.transpose();
    }
    sides = (sides * spread.inverse()).eval();
    const Vector3d area = sides.col(0).cross(sides.col(1));
    result.area = area.norm();
    result.normal = area.normalized();
    return result;
  }
  static double turnOf(const Section& section) {
    return std::acos(std::clamp(section.normal[0], -1.0, 1.0)) * 180 / std::numbers::pi;
  }
  double largestMove(const std::vector<std::uint32_t>& vertices) const {
    double largest = 0;
    for (const std::uint32_t i : vertices) {
      largest = std::max(largest, (wide(world_.positions(body_)[i]) - wide(rest()[i].rest_position)).norm());
    }
    return largest;
  }

  World world_;
  float step_;
  double spacing_ = 0;
  std::shared_ptr<const Asset> asset_;
  BodyId body_;
  PinSetId pins_;
  std::vector<std::uint32_t> wall_;
};

void append(std::string& text, const char* format, auto... values) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, format, values...);
  text += buffer;
}

std::string nameOf(const PinsCase& beam) {
  return std::string(tools::nameOf(beam.method)) + ", " + std::string(nameOf(beam.stuff));
}

}  // namespace

PinsResult measurePins(const PinsCase& beam) {
  PinsResult result;
  result.beam = beam;
  HeldBeam held(beam);
  if (beam.pulled) held.pullCorner();
  held.run(beam.pulled ? kPullSeconds : kSagSeconds, result.finite);
  held.measure(result);
  if (!beam.pulled) {
    held.endGravity();
    held.run(kReturnSeconds, result.finite);
    result.left = held.largestMove();
  }
  return result;
}

std::vector<PinsCase> pinsCases() {
  std::vector<PinsCase> cases;
  for (const BeamStuff stuff : {BeamStuff::soft, BeamStuff::elastic}) {
    for (const PinMethod method :
         {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix, PinMethod::constrained_fit}) {
      for (const double rate : kRates) cases.push_back({method, stuff, rate});
      cases.push_back({method, stuff, 60, true});
    }
  }
  cases.push_back({PinMethod::constrained_fit, BeamStuff::elastic_limits, 60, true});
  for (const std::array<int, 3>& cells : {std::array<int, 3>{14, 8, 8}, std::array<int, 3>{40, 13, 13}}) {
    cases.push_back({PinMethod::constrained_fit, BeamStuff::elastic, 60, false, cells});
  }
  for (const std::uint32_t clusters : {2U, 4U}) {
    for (const double rate : {60.0, 240.0}) {
      cases.push_back({PinMethod::constrained_fit, BeamStuff::elastic, rate, false, {20, 4, 4}, clusters});
    }
  }
  return cases;
}

nlohmann::ordered_json pinsJson(const std::vector<PinsResult>& results) {
  nlohmann::ordered_json json;
  json["study"] = "pins";
  json["cases"] = nlohmann::ordered_json::array();
  for (const PinsResult& r : results) {
    nlohmann::ordered_json one = {{"method", tools::nameOf(r.beam.method)},
                                  {"stiffness", nameOf(r.beam.stuff)},
                                  {"rate_hz", r.beam.rate_hz},
                                  {"corner_pulled", r.beam.pulled},
                                  {"vertices", r.vertices},
                                  {"clusters", r.beam.clusters},
                                  {"finite", r.finite},
                                  {"sag_metres", r.sag},
                                  {"speed_metres_per_second", r.speed},
                                  {"wall_section_turned_deg", r.wall_turn_deg},
                                  {"end_turned_deg", r.end_turn_deg},
                                  {"wall_error_metres", r.wall_error},
                                  {"volume_ratio", r.volume},
                                  {"section_area_change", r.section_change},
                                  {"force_newtons", {r.force[0], r.force[1], r.force[2]}},
                                  {"moment_newton_metres", r.moment}};
    if (!r.beam.pulled) one["left_after_gravity_metres"] = r.left;
    json["cases"].push_back(one);
  }
  return json;
}

std::string pinsText(const std::vector<PinsResult>& results) {
  const PinsCase usual;
  const auto is_usual = [&](const PinsResult& r) { return r.beam.cells == usual.cells && r.beam.clusters == 1; };
  std::string text =
      "| method, stiffness | sag at 30 / 60 / 120 / 240 steps/s, m | section at the wall, the end turned, deg | volume "
      "| wall error, m | left 4 s after gravity goes, m |\n|---|---|---|---|---|---|\n";
  for (const PinsResult& r : results) {
    if (!is_usual(r) || r.beam.pulled) continue;
    if (r.beam.rate_hz == kRates.front()) text += "| " + nameOf(r.beam) + " |";
    // Where a beam does not come to rest its sag is that of a moment.
    if (r.speed < kAtRest) {
      append(text, " %.4f", r.sag);
    } else {
      text += " moves";
    }
    text += r.beam.rate_hz == kRates.back() ? " |" : " /";
    if (r.beam.rate_hz != kRates.back()) continue;
    // The other columns are of 60 steps a second.
    const auto at60 = std::find_if(results.begin(), results.end(), [&](const PinsResult& other) {
      return is_usual(other) && !other.beam.pulled && other.beam.method == r.beam.method &&
             other.beam.stuff == r.beam.stuff && other.beam.rate_hz == usual.rate_hz;
    });
    append(text, " %.1f, %.1f | %.3f | %.2g | %.0e |\n", at60->wall_turn_deg, at60->end_turn_deg, at60->volume,
           at60->wall_error, at60->left);
  }
  text +=
      "\n| corner pulled: method, stiffness | end up by, m | section at the wall, the end turned, deg | largest change "
      "of a section's area | change of volume | wall error, m |\n|---|---|---|---|---|---|\n";
  for (const PinsResult& r : results) {
    if (!r.beam.pulled) continue;
    text += "| " + nameOf(r.beam) + " |";
    append(text, " %.3f | %.1f, %.1f | %.1f %% | %.1f %% | %.2g |\n", -r.sag, r.wall_turn_deg, r.end_turn_deg,
           100 * r.section_change, 100 * std::abs(r.volume - 1), r.wall_error);
  }
  text += "\n| constrained_fit, elastic: vertices | clusters | steps/s | sag, m |\n|---|---|---|---|\n";
  for (const PinsResult& r : results) {
    if (is_usual(r)) continue;
    append(text, "| %u | %u | %.0f | %.3f |\n", r.vertices, r.beam.clusters, r.beam.rate_hz, r.sag);
  }
  return text;
}

}  // namespace sinew::tools
