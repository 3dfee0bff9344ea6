// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bodies that have an answer of their own, baked the ordinary way from a generated surface: a beam on a wall against
// Timoshenko's, a hung box against its own weight, a ball on a thin neck against finite elements; and how the beam
// swings when it is let go.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tools/study/held_body.h"

namespace sinew::tools {

enum class BeamBody : std::uint8_t {
  beam,  ///< 1 x 0.2 x 0.2 m, its face at the low end of x held, 10 MPa, g = 9.81 m/s² down
  box,   ///< 1 m, its upper face held, 1 MPa, g = 9.81 m/s² down
  neck,  ///< a ball of radius 0.25 m on a cylinder of radius 0.05 m, 0.3 m long, its lowest 3 cm held; 1 MPa, gravity
         ///< sideways, as strong as moves finite elements by 5 % of the diagonal (rms)
};

std::string_view nameOf(BeamBody body);

/// One body at rest. The material is what the package says, where it says one, else what the bake was asked for.
struct BeamCase {
  BeamBody body = BeamBody::beam;
  double poisson = 0;         ///< 0..0.499
  double rate_hz = 60;        ///< steps a second
  bool package_pins = false;  ///< held by pins of the recipe, baked in; else by World::addPinSet
};

struct BeamResult {
  BeamCase given;
  std::uint32_t vertices = 0, held = 0;
  ElasticMaterial material;
  double gravity = 0;        ///< m/s²
  double sag = 0;            ///< of the far face (of the highest point of `neck`), along gravity, metres
  double elements = 0;       ///< the same by finite elements on the package's tetrahedra, the same vertices held
  double theory = 0;         ///< the same of Timoshenko's beam, or of a hung box without lateral strain; 0: none known
  HeldScore score;           ///< against finite elements
  double rest_seconds = -1;  ///< negative: it did not come to rest in 20 s
  double speed = 0;          ///< rms at the end, diagonals/s
  double microseconds = 0;   ///< median processor time of a step, one thread
};

/// The body's package, baked in a temporary folder with the settings of an elastic solid as this bake knows them.
/// Throws ToolError where it cannot be baked.
std::shared_ptr<const Asset> beamPackage(BeamBody body, double poisson, bool pins, double damping);

BeamResult measureBeam(const BeamCase& one);
/// Every body, Poisson's ratio 0 and 0.3, steps, and way of holding.
std::vector<BeamCase> beamCases();

/// The beam let go: held at its face by World::addPinSet, at rest under a tenth of its weight, then without gravity.
struct SwingCase {
  double rate_hz = 60;         ///< steps a second
  double damping = 0;          ///< authored at the bake (clusters.damping), 1/s
  bool world_damping = false;  ///< the world's own damping as it is by default; else none from the release on
};

struct SwingResult {
  SwingCase given;
  double elements_hz = 0;     ///< lowest frequency by finite elements on the package's tetrahedra
  double frequency_hz = 0;    ///< by zero crossings of the free face; 0 where there are less than three
  double damping_ratio = 0;   ///< by the logarithmic decrement of its turning points; meaningless without a frequency
  double authored_ratio = 0;  ///< of motion whose velocity decays as exp(-damping t), at elements_hz: damping / 4 pi f
  double end = 0;             ///< largest displacement of the free face in the last second of four, of the first one
};

SwingResult measureSwing(const SwingCase& one);
std::vector<SwingCase> swingCases();

/// A free motion about 0 by its zero crossings and turning points.
struct Swing {
  double frequency_hz = 0;  ///< 0 where there are less than three crossings
  double damping_ratio = 0;
};
/// \param way one sample a step, at least one. \param seconds of a step.
Swing swingOf(const std::vector<double>& way, double seconds);

nlohmann::ordered_json beamJson(const std::vector<BeamResult>& beams, const std::vector<SwingResult>& swings);
std::string beamText(const std::vector<BeamResult>& beams, const std::vector<SwingResult>& swings);

}  // namespace sinew::tools
