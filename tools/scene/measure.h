// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sinew/runtime/world.h"

namespace sinew::tools {

/// State of a body in numbers. Lengths are relative to the rest bounding-box diagonal.
struct BodyMeasure {
  bool finite = true;         ///< every position and velocity
  double rest_error_rms = 0;  ///< visual vertices from the rest shape, best rigid motion of each separate body removed
  double rest_error_max = 0;
  double rms_speed = 0;      ///< mass-weighted, diagonals per second
  double volume_ratio = 1;   ///< tetrahedra now / at rest
  double lowest = 0;         ///< lowest physical vertex, y
  double lowest_visual = 0;  ///< lowest vertex that is drawn, y: sheets that ride along touch no ground
  double seam_gap = 0;       ///< farthest that visual vertices of one welded point have drifted apart since rest
  std::string state_hash;    ///< XXH3-64 of positions and velocities, 16 hexadecimal digits
};

/// All bodies of a scene together.
struct GroupMeasure {
  double rms_speed = 0;      ///< m/s
  double height = 0;         ///< m, of the highest physical vertex
  std::uint32_t asleep = 0;  ///< bodies
};
GroupMeasure measureGroup(const World& world, std::span<const BodyId> bodies);

BodyMeasure measureBody(const World& world, BodyId body);
/// Only the volume ratio: cheap enough for every step.
double measureVolumeRatio(const World& world, BodyId body);
/// Deformed visual positions, in the package's order.
std::vector<Vec3> visualPositions(const World& world, BodyId body);

}  // namespace sinew::tools
