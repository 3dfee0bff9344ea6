// SPDX-License-Identifier: GPL-3.0-or-later
//
// The report's wall beam (its figures 4 to 6) under each method of holding vertices (docs/method.md §10).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "sinew/formats/sections.h"
#include "sinew/runtime/settings.h"

namespace sinew::tools {

/// What the beam is made of: quadratic clusters.
enum class BeamStuff : std::uint8_t {
  soft,            ///< 3 Hz, every class of modes
  elastic,         ///< 1 MPa, Poisson's ratio 0.3, damping 2/s
  elastic_limits,  ///< the same with limit and volume `principal`
};

/// One beam of 1 x 0.2 x 0.2 m, 1000 kg/m³, its face x = 0 held by a pin set.
struct PinsCase {
  PinMethod method = PinMethod::constrained_fit;
  BeamStuff stuff = BeamStuff::soft;
  double rate_hz = 60;  ///< steps a second
  bool pulled = false;  ///< no gravity, a corner of the free end pulled up; else g = 9.81 m/s², which then goes
  std::array<int, 3> cells = {20, 4, 4};
  std::uint32_t clusters = 1;  ///< along the beam
};

struct PinsResult {
  PinsCase beam;
  std::uint32_t vertices = 0;
  double sag = 0;                                   ///< of the free face's middle at rest, metres; up is negative
  double speed = 0;                                 ///< of its fastest vertex then, m/s
  double wall_turn_deg = 0;                         ///< of the first section that is not held
  double end_turn_deg = 0;                          ///< of the free face
  double wall_error = 0;                            ///< largest distance of a held vertex from its place, metres
  double volume = 0;                                ///< over that at rest
  double section_change = 0;                        ///< largest |area / that at rest - 1| of four sections
  double left = 0;                                  ///< largest distance from rest 4 s after gravity went, metres
  Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< on the wall, N
  double moment = 0;                                ///< on the wall, about its middle and z, N m
  bool finite = true;
};

PinsResult measurePins(const PinsCase& beam);

/// Every method with both stuffs, by step and with a pulled corner; then `constrained_fit` by vertices and clusters.
std::vector<PinsCase> pinsCases();

nlohmann::ordered_json pinsJson(const std::vector<PinsResult>& results);
/// The tables of docs/method.md §10. \param results of pinsCases().
std::string pinsText(const std::vector<PinsResult>& results);

}  // namespace sinew::tools
