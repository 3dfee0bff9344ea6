// SPDX-License-Identifier: MIT
//
// What bodies do as a whole, summed over their physical vertices.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "sinew/runtime/world.h"

namespace sinew::test {

using Eigen::Vector3d;

struct Motion {
  Vector3d momentum = Vector3d::Zero(), spin = Vector3d::Zero(), center = Vector3d::Zero();
  double mass = 0, energy = 0, speed = 0;
  double low = 1e30, high = -1e30;
};

inline Motion motionOf(const World& world, const std::vector<BodyId>& bodies) {
  Motion result;
  double squared = 0;
  for (const BodyId body : bodies) {
    const auto x = world.positions(body), v = world.velocities(body);
    const auto vertices = world.asset(body).package().physicalVertices();
    for (std::size_t i = 0; i < x.size(); ++i) {
      const Vector3d at = {double(x[i][0]), double(x[i][1]), double(x[i][2])};
      const Vector3d moving = {double(v[i][0]), double(v[i][1]), double(v[i][2])};
      const double m = double(vertices[i].mass);
      result.mass += m;
      result.center += m * at;
      result.momentum += m * moving;
      result.spin += m * at.cross(moving);
      squared += m * moving.squaredNorm();
      result.low = std::min(result.low, at[1]);
      result.high = std::max(result.high, at[1]);
    }
    const BodyEnergy energy = world.energy(body);
    result.energy += energy.kinetic + energy.elastic;
  }
  result.center /= result.mass;
  result.speed = std::sqrt(squared / result.mass);
  return result;
}

/// Without gravity and air.
inline WorldSettings inSpace() {
  WorldSettings settings;
  settings.collisions = true;
  settings.gravity = {0, 0, 0};
  settings.damping = 0;
  return settings;
}

}  // namespace sinew::test
