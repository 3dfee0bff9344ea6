// SPDX-License-Identifier: MIT
#include "runtime/step/integrate.h"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "runtime/clusters/goal.h"
#include "runtime/contact/ground.h"

namespace sinew::internal {
namespace {

// Beyond these a state counts as lost: floats could no longer square or difference it.
constexpr float kLargestPosition = 1e15F;  // metres
constexpr float kLargestVelocity = 1e17F;  // m/s

// Inertia about an axis below which angular momentum may be rounding, relative to the largest.
constexpr double kLittleInertia = 1e-2;

// A turn within one pass that the rounding of a match may cause, radians.
constexpr double kRoundingTurn = 2e-7;

bool within(const Vec3& v, float limit) {
  return std::abs(v[0]) <= limit && std::abs(v[1]) <= limit && std::abs(v[2]) <= limit;  // false for NaN
}

}  // namespace

bool stateIsUsable(const Vec3& x, const Vec3& v) { return within(x, kLargestPosition) && within(v, kLargestVelocity); }

Vector3 blendedGoal(const Body& body, std::uint32_t vertex) {
  const formats::PackageView& package = body.package();
  const Vector3 rest = asVector(package.physicalVertices()[vertex].rest_position);
  Vector3 goal = Vector3::Zero();
  for (const ClusterUse& use : body.rest().usesOf(vertex)) {
    goal += use.share * clusterGoal(package.clusters()[use.cluster], body.rest().clusters[use.cluster],
                                    body.frames[use.cluster], rest);
  }
  return goal;
}

void MotionSums::add(const MotionSums& other) {
  mass += other.mass;
  first += other.first;
  momentum += other.momentum;
  angular += other.angular;
  second += other.second;
}

MotionSums motionSums(const Body& body, const std::vector<Vec3>& positions, std::uint32_t begin, std::uint32_t end,
                      const Eigen::Vector3d& reference, double anchor_mass) {
  MotionSums sums;
  for (std::uint32_t i = begin; i < end; ++i) {
    const bool anchored = anchor_mass > 0 && (body.pinned[i] != 0 || body.force[i] != Vec3{});
    const double m = double(body.vertices()[i].mass) + (anchored ? anchor_mass : 0.0);
    const Eigen::Vector3d d = asVector(positions[i]).cast<double>() - reference;
    const Eigen::Vector3d mv = m * asVector(body.v[i]).cast<double>();
    sums.mass += m;
    sums.first += m * d;
    sums.momentum += mv;
    sums.angular += d.cross(mv);
    sums.second += (m * d) * d.transpose();
  }
  return sums;
}

RigidMotion rigidMotionOf(const MotionSums& sums, const Eigen::Vector3d& reference, double least_angular) {
  RigidMotion motion;
  const Eigen::Vector3d offset = sums.first / sums.mass;
  motion.center = reference + offset;
  motion.velocity = sums.momentum / sums.mass;
  const Eigen::Vector3d angular = sums.angular - offset.cross(sums.momentum);
  const Eigen::Matrix3d second = sums.second - sums.mass * offset * offset.transpose();
  const Eigen::Matrix3d inertia = second.trace() * Eigen::Matrix3d::Identity() - second;
  const double scale = inertia.cwiseAbs().maxCoeff();
  if (!(scale > 0) || !std::isfinite(scale)) return motion;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(inertia / scale);
  for (int k = 0; k < 3; ++k) {
    if (solver.eigenvalues()[k] < 1e-6) continue;
    const Eigen::Vector3d axis = solver.eigenvectors().col(k);
    const double about = axis.dot(angular);
    if (solver.eigenvalues()[k] < kLittleInertia && std::abs(about) < least_angular) continue;
    motion.omega += axis * (about / (scale * solver.eigenvalues()[k]));
  }
  return motion;
}

std::uint32_t predict(Body& body, const WorldSettings& settings, float h, std::uint32_t begin, std::uint32_t end) {
  const Vector3 kick = h * asVector(settings.gravity);
  const float kept = std::exp(-settings.damping * h);
  std::uint32_t repaired = 0;
  for (std::uint32_t i = begin; i < end; ++i) {
    auto x = asVector(body.x[i]);
    auto v = asVector(body.v[i]);
    if (!stateIsUsable(body.x[i], body.v[i])) {
      x = blendedGoal(body, i);
      v.setZero();
      body.force[i] = {};
      ++repaired;
    }
    v = kept * (v + kick);
    asVector(body.y[i]) = x + h * v;
  }
  return repaired;
}

void applyGoals(Body& body, const GroundPlane& ground, float pass_seconds, std::uint32_t begin, std::uint32_t end) {
  const formats::PackageView& package = body.package();
  const float diagonal = package.info().diagonal;
  for (std::uint32_t i = begin; i < end; ++i) {
    auto y = asVector(body.y[i]);
    const Vector3 start = y;
    const Vector3 rest = asVector(package.physicalVertices()[i].rest_position);
    Vector3 moved = Vector3::Zero();
    for (const ClusterUse& use : body.rest().usesOf(i)) {
      const Vector3 goal = clusterGoal(package.clusters()[use.cluster], body.rest().clusters[use.cluster],
                                       body.frames[use.cluster], rest);
      moved += (use.share * body.stiffness[use.cluster].alpha) * (goal - start);
    }
    if (ground.enabled) {
      // Rows hold the clusters up; what a vertex keeps of its own below the surface is taken here.
      const float below = heightAbove(ground, start + moved);
      const float least = reachableHeight(heightAbove(ground, asVector(body.x[i])), diagonal, pass_seconds);
      if (below < least) moved += (least - below) * asVector(ground.normal);
    }
    // v = (y - x) / h, but from the move: far from the origin the rounding of positions must not become speed.
    asVector(body.v[i]) += moved / pass_seconds;
    y = start + moved;
  }
}

void settleMotion(Body& body, const RigidMotion& found, const RigidMotion& wanted, bool free, float kept,
                  float pass_seconds, std::uint32_t begin, std::uint32_t end) {
  RigidMotion moved_as = wanted;
  // A real turn of this size would change the angular momentum again by moving the arms; the match's own stays.
  if ((wanted.omega - found.omega).norm() * double(pass_seconds) > kRoundingTurn) moved_as.omega = found.omega;
  for (std::uint32_t i = begin; i < end; ++i) {
    const Eigen::Vector3d arm = asVector(body.y[i]).cast<double>() - found.center;
    const Eigen::Vector3d own = asVector(body.v[i]).cast<double>() - (found.velocity + found.omega.cross(arm));
    const Eigen::Vector3d rigid = wanted.velocity + wanted.omega.cross(arm);
    if (free) {
      asVector(body.x[i]) +=
          (double(pass_seconds) * (moved_as.velocity + moved_as.omega.cross(arm) + own)).cast<float>();
    } else {
      body.x[i] = body.y[i];
    }
    float part = kept;
    for (const ClusterUse& use : body.rest().usesOf(i)) part = body.frames[use.cluster].limited ? 0.0F : part;
    asVector(body.v[i]) = (rigid + double(part) * own).cast<float>();
  }
}

void addRigidMotion(Body& body, const RigidMotion& motion, std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t i = begin; i < end; ++i) {
    const Eigen::Vector3d arm = asVector(body.x[i]).cast<double>() - motion.center;
    asVector(body.v[i]) += (motion.velocity + motion.omega.cross(arm)).cast<float>();
  }
}

}  // namespace sinew::internal
