// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/sag.h"

#include <cmath>
#include <cstdio>

#include "sinew/runtime/world.h"
#include "tools/study/names.h"

namespace sinew::tools {

SagResult measureSag(const SagCase& beam, double seconds) {
  BoxBody box;
  box.cells = beam.cells;
  box.size = {1, 0.2, 0.2};
  box.clusters = {beam.clusters, 1, 1};
  const auto asset = boxPackage(box, {beam.mode, beam.frequency_hz, 1});
  WorldSettings settings;
  settings.iterations = beam.passes;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  const auto vertices = asset->package().physicalVertices();
  std::vector<std::size_t> end;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Vec3& x = vertices[i].rest_position;
    if (x[0] < -0.499F) world.pin(body, std::uint32_t(i), x);
    if (x[0] > 0.499F) end.push_back(i);
  }
  const auto sag = [&] {
    double sum = 0;
    for (const std::size_t i : end) sum += double(vertices[i].rest_position[1]) - double(world.positions(body)[i][1]);
    return sum / double(end.size());
  };
  SagResult result;
  result.beam = beam;
  result.vertices = std::uint32_t(vertices.size());
  const int steps = int(std::lround(seconds * beam.rate_hz)), last_second = int(std::lround(beam.rate_hz));
  double before = 0;
  for (int i = 0; i < steps; ++i) {
    world.step(float(1 / beam.rate_hz));
    if (i + 1 == steps - last_second) before = sag();
  }
  result.sag = sag();
  result.drift = std::abs(result.sag - before);
  return result;
}

std::vector<SagCase> sagCases() {
  std::vector<SagCase> cases;
  SagCase base;
  for (const double rate : {30.0, 60.0, 120.0, 240.0}) {
    SagCase one = base;
    one.rate_hz = rate;
    cases.push_back(one);
  }
  for (const std::array<int, 3>& cells : {std::array<int, 3>{19, 6, 6}, std::array<int, 3>{40, 13, 13}}) {
    SagCase one = base;
    one.cells = cells;
    cases.push_back(one);
  }
  for (const std::uint32_t clusters : {1U, 2U, 4U, 8U}) {
    for (const double rate : {60.0, 240.0}) {
      for (const std::uint32_t passes : {1U, 4U, 16U}) {
        SagCase one = base;
        one.clusters = clusters;
        one.rate_hz = rate;
        one.passes = passes;
        cases.push_back(one);
      }
    }
  }
  return cases;
}

nlohmann::ordered_json sagJson(const std::vector<SagResult>& results) {
  nlohmann::ordered_json json;
  json["study"] = "sag";
  json["cases"] = nlohmann::ordered_json::array();
  for (const SagResult& r : results) {
    json["cases"].push_back({{"clusters", r.beam.clusters},
                             {"rate_hz", r.beam.rate_hz},
                             {"passes", r.beam.passes},
                             {"vertices", r.vertices},
                             {"mode", nameOf(r.beam.mode)},
                             {"frequency_hz", r.beam.frequency_hz},
                             {"sag_metres", r.sag},
                             {"drift_metres", r.drift}});
  }
  return json;
}

std::string sagText(const std::vector<SagResult>& results) {
  std::string text = "clusters  steps/s  passes  vertices   sag, mm  last second, mm\n";
  for (const SagResult& r : results) {
    char line[128];
    std::snprintf(line, sizeof line, "%8u %8.0f %7u %9u %9.2f %12.4f\n", r.beam.clusters, r.beam.rate_hz, r.beam.passes,
                  r.vertices, 1000 * r.sag, 1000 * r.drift);
    text += line;
  }
  return text;
}

}  // namespace sinew::tools
