// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/limits.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdio>

#include "sinew/runtime/world.h"
#include "tools/study/body_measure.h"
#include "tools/study/names.h"
#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

constexpr float kPush = 200;  // m/s²
constexpr float kStep = 1.0F / 60;
constexpr int kSteps = 240;
constexpr double kFrequencyHz = 2;
constexpr double kRestArea = 6, kRestVolume = 1;  // m², m³

double surfaceArea(const World& world, BodyId body) {
  const formats::PackageView& package = world.asset(body).package();
  double area = 0;
  for (const formats::Triangle& triangle : package.visualTriangles()) {
    std::array<Eigen::Vector3d, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) corner[k] = cornerOf(world, body, triangle[k]);
    area += 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm();
  }
  return area;
}

}  // namespace

LimitsResult measureLimits(const LimitsCase& cube) {
  BoxBody box;
  box.cells = {4, 4, 4};
  StudyPackageOptions options;
  options.mode = cube.mode;
  options.frequency_hz = kFrequencyHz;
  options.mechanics = formats::kPlainMechanics;
  options.mechanics->limit = cube.limit;
  options.mechanics->volume = cube.volume;
  options.surface = true;
  const auto asset = boxPackage(box, options);
  WorldSettings settings;
  settings.gravity = {0, -kPush, 0};
  settings.ground.enabled = true;
  settings.ground.offset = -0.5F;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  LimitsResult result;
  result.cube = cube;
  result.least_volume = result.largest_volume = 1;
  for (int step = 0; step < kSteps; ++step) {
    world.step(kStep);
    result.finite = result.finite && BodyMeasure::finite(world, body);
    const double volume = tetrahedraVolume(world, body) / kRestVolume;
    result.largest_area = std::max(result.largest_area, surfaceArea(world, body) / kRestArea);
    result.least_volume = std::min(result.least_volume, volume);
    result.largest_volume = std::max(result.largest_volume, volume);
  }
  return result;
}

std::vector<LimitsCase> limitsCases() {
  using formats::LimitMethod;
  std::vector<LimitsCase> cases;
  for (const LimitMethod limit : {LimitMethod::none, LimitMethod::rows, LimitMethod::frobenius,
                                  LimitMethod::frobenius_cheap, LimitMethod::soft, LimitMethod::principal}) {
    for (const auto mode : {formats::ClusterMode::linear, formats::ClusterMode::quadratic}) {
      for (const auto volume :
           {formats::VolumeMethod::none, formats::VolumeMethod::cube_root, formats::VolumeMethod::principal}) {
        cases.push_back({mode, limit, volume});
      }
    }
  }
  return cases;
}

nlohmann::ordered_json limitsJson(const std::vector<LimitsResult>& results) {
  nlohmann::ordered_json json;
  json["study"] = "limits";
  json["cases"] = nlohmann::ordered_json::array();
  for (const LimitsResult& r : results) {
    json["cases"].push_back({{"mode", nameOf(r.cube.mode)},
                             {"limit", nameOf(r.cube.limit)},
                             {"volume", nameOf(r.cube.volume)},
                             {"finite", r.finite},
                             {"largest_area_ratio", r.largest_area},
                             {"least_volume_ratio", r.least_volume},
                             {"largest_volume_ratio", r.largest_volume}});
  }
  return json;
}

std::string limitsText(const std::vector<LimitsResult>& results) {
  std::string text =
      "| limit | linear: none | cube_root | principal | quadratic: none | cube_root | principal |\n"
      "|---|---|---|---|---|---|---|\n";
  for (std::size_t i = 0; i < results.size(); ++i) {
    const LimitsResult& r = results[i];
    const bool first = i == 0 || results[i - 1].cube.limit != r.cube.limit;
    const bool last = i + 1 == results.size() || results[i + 1].cube.limit != r.cube.limit;
    if (first) text += "| " + std::string(nameOf(r.cube.limit)) + " |";
    char cell[64];
    std::snprintf(cell, sizeof cell, " %.2f (%.2f..%.2f) |%s", r.largest_area, r.least_volume, r.largest_volume,
                  last ? "\n" : "");
    text += cell;
  }
  return text;
}

}  // namespace sinew::tools
