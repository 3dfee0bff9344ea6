// SPDX-License-Identifier: MIT
//
// What tests of motion measure on a body: sums in double over its physical vertices.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "sinew/runtime/world.h"

namespace sinew::test {

inline Eigen::Vector3d wide(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

struct Motion {
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  ///< about the origin
  double kinetic = 0;
};

inline Motion motionOf(const World& world, BodyId body) {
  Motion m;
  const auto vertices = world.asset(body).package().physicalVertices();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double mass = double(vertices[i].mass);
    const Eigen::Vector3d x = wide(world.positions(body)[i]), v = wide(world.velocities(body)[i]);
    m.mass += mass;
    m.center += mass * x;
    m.momentum += mass * v;
    m.angular += mass * x.cross(v);
    m.kinetic += 0.5 * mass * v.squaredNorm();
  }
  m.center /= m.mass;
  return m;
}

/// Root mean square speed in diagonals per second.
inline double rmsSpeed(const World& world, BodyId body) {
  const Motion m = motionOf(world, body);
  return std::sqrt(2 * m.kinetic / m.mass) / double(world.asset(body).package().info().diagonal);
}

struct RestError {
  double rms = 0, max = 0;
};

/// Distance of the physical vertices from the rest shape, best rigid motion (SVD in double) removed, in diagonals.
inline RestError restError(const World& world, BodyId body) {
  const auto vertices = world.asset(body).package().physicalVertices();
  double mass = 0;
  Eigen::Vector3d c = Eigen::Vector3d::Zero(), c0 = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    mass += double(vertices[i].mass);
    c += double(vertices[i].mass) * wide(world.positions(body)[i]);
    c0 += double(vertices[i].mass) * wide(vertices[i].rest_position);
  }
  c /= mass;
  c0 /= mass;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    a += double(vertices[i].mass) * (wide(world.positions(body)[i]) - c) *
         (wide(vertices[i].rest_position) - c0).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d r = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  RestError error;
  const double diagonal = double(world.asset(body).package().info().diagonal);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const double e =
        (wide(world.positions(body)[i]) - c - r * (wide(vertices[i].rest_position) - c0)).norm() / diagonal;
    error.rms += e * e / double(vertices.size());
    error.max = std::max(error.max, e);
  }
  error.rms = std::sqrt(error.rms);
  return error;
}

inline double lowestPoint(const World& world, BodyId body) {
  double low = 1e300;
  for (const Vec3& x : world.positions(body)) low = std::min(low, double(x[1]));
  return low;
}

/// The same of the vertices that are drawn: contacts give way a little, and what touches is drawn on the ground.
inline double lowestDrawn(const World& world, BodyId body) {
  std::vector<Vec3> x(world.asset(body).package().visualPositions().size());
  world.visualVertices(body, {x[0].data(), 12, std::uint32_t(x.size())}, {});
  double low = 1e300;
  for (const Vec3& p : x) low = std::min(low, double(p[1]));
  return low;
}

inline bool allFinite(const World& world, BodyId body) {
  for (const Vec3& x : world.positions(body)) {
    if (!wide(x).allFinite()) return false;
  }
  for (const Vec3& v : world.velocities(body)) {
    if (!wide(v).allFinite()) return false;
  }
  return true;
}

inline void run(World& world, double seconds, float h = 1.0F / 60) {
  for (double t = 0; t < seconds - 1e-9; t += double(h)) world.step(h);
}

inline WorldSettings weightless() {
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  return settings;
}

}  // namespace sinew::test
