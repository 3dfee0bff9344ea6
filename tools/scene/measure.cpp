// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/measure.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <span>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

Vector3d toDouble(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// The separate body that each visual vertex belongs to.
std::vector<std::uint32_t> bodyOfVisual(const formats::PackageView& package) {
  std::vector<std::uint32_t> body(package.visualPositions().size(), 0);
  if (package.pieces().size() == 1) return body;
  const auto bodyOfTetrahedron = [&](std::uint32_t t) {
    std::uint32_t b = 0;
    while (t >= package.pieces()[b].first_tetrahedron + package.pieces()[b].tetrahedron_count) ++b;
    return b;
  };
  for (std::size_t v = 0; v < body.size(); ++v) {
    if (!package.barycentric().empty()) {
      body[v] = bodyOfTetrahedron(package.barycentric()[v].tetrahedron);
    } else if (!package.clusterAttachmentRanges().empty()) {
      body[v] =
          package.clusters()[package.clusterAttachments()[package.clusterAttachmentRanges()[v].first].cluster].piece;
    }
  }
  return body;
}

// Sum of squared distances after the best rigid motion (Umeyama 1991, without scale).
void rigidResidual(const std::vector<Vector3d>& rest, const std::vector<Vector3d>& now, double& squared,
                   double& largest) {
  if (rest.empty()) return;
  Vector3d rest_center = Vector3d::Zero();
  Vector3d center = Vector3d::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    rest_center += rest[i];
    center += now[i];
  }
  rest_center /= double(rest.size());
  center /= double(rest.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < rest.size(); ++i) covariance += (now[i] - center) * (rest[i] - rest_center).transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d rotation = svd.matrixU() * sign * svd.matrixV().transpose();
  for (std::size_t i = 0; i < rest.size(); ++i) {
    const double d = (rotation * (rest[i] - rest_center) + center - now[i]).squaredNorm();
    squared += d;
    largest = std::max(largest, std::sqrt(d));
  }
}

// How far visual vertices that one welded point split into have moved relative to the first of them.
double seamGap(const formats::PackageView& package, const std::vector<Vec3>& visual) {
  std::vector<std::uint32_t> first(visual.size(), formats::kNone);
  double gap = 0;
  for (std::uint32_t v = 0; v < package.visualIdentity().size(); ++v) {
    std::uint32_t& f = first[package.visualIdentity()[v].welded];
    if (f == formats::kNone) {
      f = v;
      continue;
    }
    const Vector3d rest = toDouble(package.visualPositions()[v]) - toDouble(package.visualPositions()[f]);
    gap = std::max(gap, ((toDouble(visual[v]) - toDouble(visual[f])).norm() - rest.norm()));
  }
  return gap;
}

double volume(const formats::PackageView& package, auto&& position) {
  double six = 0;
  for (const auto& tet : package.tetrahedra()) {
    const Vector3d d = position(tet.vertex[3]);
    six -= (position(tet.vertex[0]) - d).cross(position(tet.vertex[1]) - d).dot(position(tet.vertex[2]) - d);
  }
  return six / 6;
}

}  // namespace

std::vector<Vec3> visualPositions(const World& world, BodyId body) {
  std::vector<Vec3> positions(world.asset(body).package().visualPositions().size());
  if (positions.empty()) return positions;
  world.visualVertices(body, {positions[0].data(), sizeof(Vec3), std::uint32_t(positions.size())}, {});
  return positions;
}

double measureVolumeRatio(const World& world, BodyId body) {
  const formats::PackageView& package = world.asset(body).package();
  const auto positions = world.positions(body);
  const double rest =
      volume(package, [&](std::uint32_t v) { return toDouble(package.physicalVertices()[v].rest_position); });
  return rest > 0 ? volume(package, [&](std::uint32_t v) { return toDouble(positions[v]); }) / rest : 1;
}

GroupMeasure measureGroup(const World& world, std::span<const BodyId> bodies) {
  GroupMeasure measure;
  double squares = 0, mass = 0;
  for (const BodyId body : bodies) {
    const auto vertices = world.asset(body).package().physicalVertices();
    const auto positions = world.positions(body), velocities = world.velocities(body);
    for (std::size_t v = 0; v < positions.size(); ++v) {
      squares += double(vertices[v].mass) * toDouble(velocities[v]).squaredNorm();
      mass += double(vertices[v].mass);
      measure.height = std::max(measure.height, double(positions[v][1]));
    }
    measure.asleep += world.isAsleep(body) ? 1U : 0U;
  }
  measure.rms_speed = mass > 0 ? std::sqrt(squares / mass) : 0;
  return measure;
}

BodyMeasure measureBody(const World& world, BodyId body) {
  const formats::PackageView& package = world.asset(body).package();
  const auto positions = world.positions(body);
  const auto velocities = world.velocities(body);
  const auto diagonal = double(package.info().diagonal);
  BodyMeasure measure;
  double momentum_square = 0;
  double mass = 0;
  double lowest = positions.empty() ? 0 : double(positions[0][1]);
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const auto m = double(package.physicalVertices()[v].mass);
    momentum_square += m * toDouble(velocities[v]).squaredNorm();
    mass += m;
    lowest = std::min(lowest, double(positions[v][1]));
    for (std::size_t k = 0; k < 3; ++k) {
      measure.finite = measure.finite && std::isfinite(positions[v][k]) && std::isfinite(velocities[v][k]);
    }
  }
  measure.rms_speed = mass > 0 ? std::sqrt(momentum_square / mass) / diagonal : 0;
  measure.lowest = lowest / diagonal;
  measure.volume_ratio = measureVolumeRatio(world, body);

  const std::vector<Vec3> visual = visualPositions(world, body);
  double lowest_visual = visual.empty() ? lowest : double(visual[0][1]);
  for (const Vec3& x : visual) {
    lowest_visual = std::min(lowest_visual, double(x[1]));
    measure.finite = measure.finite && std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]);
  }
  measure.lowest_visual = lowest_visual / diagonal;
  if (measure.finite && !visual.empty()) {
    const std::vector<std::uint32_t> bodies = bodyOfVisual(package);
    double squared = 0;
    std::vector<Vector3d> rest;
    std::vector<Vector3d> now;
    for (std::uint32_t b = 0; b < package.pieces().size(); ++b) {
      rest.clear();
      now.clear();
      for (std::size_t v = 0; v < visual.size(); ++v) {
        if (bodies[v] != b) continue;
        rest.push_back(toDouble(package.visualPositions()[v]));
        now.push_back(toDouble(visual[v]));
      }
      rigidResidual(rest, now, squared, measure.rest_error_max);
    }
    measure.rest_error_rms = std::sqrt(squared / double(visual.size())) / diagonal;
    measure.rest_error_max /= diagonal;
    measure.seam_gap = seamGap(package, visual) / diagonal;
  }

  XXH3_state_t* state = XXH3_createState();
  XXH3_64bits_reset(state);
  XXH3_64bits_update(state, positions.data(), positions.size_bytes());
  XXH3_64bits_update(state, velocities.data(), velocities.size_bytes());
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(XXH3_64bits_digest(state)));
  XXH3_freeState(state);
  measure.state_hash = text.data();
  return measure;
}

}  // namespace sinew::tools
