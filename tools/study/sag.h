// SPDX-License-Identifier: GPL-3.0-or-later
//
// How far a beam held by a wall sags, and how that depends on what it should not depend on: step, passes, vertices and
// the number of clusters (docs/method.md §8).
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/study/packages.h"

namespace sinew::tools {

/// One beam of 1 x 0.2 x 0.2 m, 1000 kg/m^3, held at its face x = -0.5 m, g = 9.81 m/s².
struct SagCase {
  std::array<int, 3> cells = {20, 6, 6};
  std::uint32_t clusters = 1;  ///< along the beam
  double rate_hz = 60;         ///< steps a second
  std::uint32_t passes = 4;
  formats::ClusterMode mode = formats::ClusterMode::quadratic;
  double frequency_hz = 40;
};

struct SagResult {
  SagCase beam;
  std::uint32_t vertices = 0;
  double sag = 0;    ///< of the free face's middle after `seconds`, metres
  double drift = 0;  ///< change of the sag in the last second, metres
};

SagResult measureSag(const SagCase& beam, double seconds);

/// The cases of the study: steps, vertices, passes and clusters varied one at a time.
std::vector<SagCase> sagCases();

nlohmann::ordered_json sagJson(const std::vector<SagResult>& results);
std::string sagText(const std::vector<SagResult>& results);

}  // namespace sinew::tools
