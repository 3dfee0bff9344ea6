// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/steps_measure.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tools/attach/attach.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const double kRoot3 = std::sqrt(3.0);

Vector3d wide(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

struct PartShape {
  double mass = 0, diagonal = 0;
  Vector3d centre = Vector3d::Zero();
};

PartShape restOf(const formats::PackageView& package, const formats::PieceRange& part) {
  PartShape shape;
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const auto& vertex : package.physicalVertices().subspan(part.first_vertex, part.vertex_count)) {
    const Vector3d x = wide(vertex.rest_position);
    shape.mass += double(vertex.mass);
    shape.centre += double(vertex.mass) * x;
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  shape.centre /= shape.mass;
  shape.diagonal = (high - low).norm();
  return shape;
}

// Root mean square over the mass of what is left when the best rigid motion is removed.
double shapeError(const formats::PackageView& package, const formats::PieceRange& part, const PartShape& rest,
                  std::span<const Vec3> positions) {
  const auto vertices = package.physicalVertices();
  const std::uint32_t end = part.first_vertex + part.vertex_count;
  Vector3d centre = Vector3d::Zero();
  for (std::uint32_t v = part.first_vertex; v < end; ++v) centre += double(vertices[v].mass) * wide(positions[v]);
  centre /= rest.mass;
  Matrix3d covariance = Matrix3d::Zero();
  for (std::uint32_t v = part.first_vertex; v < end; ++v) {
    covariance += double(vertices[v].mass) * (wide(positions[v]) - centre) *
                  (wide(vertices[v].rest_position) - rest.centre).transpose();
  }
  const Eigen::JacobiSVD<Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Matrix3d rotation = svd.matrixU() * Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  double sum = 0;
  for (std::uint32_t v = part.first_vertex; v < end; ++v) {
    const Vector3d pose = rotation * (wide(vertices[v].rest_position) - rest.centre);
    sum += double(vertices[v].mass) * (wide(positions[v]) - centre - pose).squaredNorm();
  }
  return std::sqrt(sum / rest.mass);
}

// The one that is worse over its limit.
const StepsFinding& worse(const StepsFinding& one, const StepsFinding& other) {
  return other.ratio() > one.ratio() ? other : one;
}

}  // namespace

std::string_view nameOf(StepsCriterion criterion) {
  return std::array<std::string_view, kStepsCriterionCount>{
      "finite", "momentum", "angular", "centre", "energy", "shape", "speed", "ground", "creep"}[std::size_t(criterion)];
}

std::string_view unitOf(StepsCriterion criterion) {
  return std::array<std::string_view, kStepsCriterionCount>{
      "vertices", "kg m/s", "kg m^2/s", "m", "J", "m", "m/s", "m", "m/s"}[std::size_t(criterion)];
}

double StepsFinding::ratio() const {
  if (!std::isfinite(value)) return std::numeric_limits<double>::infinity();
  if (value <= 0) return 0;
  return limit > 0 ? value / limit : std::numeric_limits<double>::infinity();
}

double coordinateRounding(std::span<const Vec3> positions) {
  double reach = 0;
  for (const Vec3& x : positions) {
    for (const float coordinate : x) reach = std::max(reach, std::abs(double(coordinate)));
  }
  return 0x1p-24 * reach;
}

double PartMotion::speed() const { return std::sqrt(2 * kinetic / mass); }

std::vector<PartMotion> motionOf(const formats::PackageView& package, const BodyState& state) {
  std::vector<PartMotion> parts;
  for (const formats::PieceRange& body : package.pieces()) {
    PartMotion part;
    const std::uint32_t end = body.first_vertex + body.vertex_count;
    for (std::uint32_t v = body.first_vertex; v < end; ++v) {
      const auto m = double(package.physicalVertices()[v].mass);
      part.mass += m;
      part.centre += m * wide(state.positions[v]);
    }
    part.centre /= part.mass;
    for (std::uint32_t v = body.first_vertex; v < end; ++v) {
      const auto m = double(package.physicalVertices()[v].mass);
      const Vector3d arm = wide(state.positions[v]) - part.centre, velocity = wide(state.velocities[v]);
      part.momentum += m * velocity;
      part.angular += m * arm.cross(velocity);
      part.momentum_scale += m * velocity.norm();
      part.angular_scale += m * arm.norm() * velocity.norm();
      part.kinetic += 0.5 * m * velocity.squaredNorm();
    }
    parts.push_back(part);
  }
  return parts;
}

std::uint32_t notFinite(const BodyState& state) {
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < state.positions.size(); ++v) {
    count += wide(state.positions[v]).allFinite() && wide(state.velocities[v]).allFinite() ? 0U : 1U;
  }
  return count;
}

BodyEnergy energyOf(const World& world, BodyId body, bool has_elastic) {
  BodyEnergy energy;
  for (const PartMotion& part : motionOf(world.asset(body).package(), stateOf(world, body))) {
    energy.kinetic += part.kinetic;
  }
  if (has_elastic) energy.elastic = world.energy(body).elastic;
  return energy;
}

FreeJudge::FreeJudge(const formats::PackageView& package, const BodyState& start, const BodyEnergy& energy, bool moving)
    : package_(&package),
      start_(start.positions.begin(), start.positions.end()),
      before_(start_),
      worst_(kStepsCriterionCount),
      rounding_(coordinateRounding(start.positions)),
      energy_(energy.kinetic + energy.elastic.value_or(0)),
      diagonal_(double(package.info().diagonal)),
      moving_(moving),
      energy_known_(energy.elastic.has_value()) {
  for (const PartMotion& motion : motionOf(package, start)) {
    Part part;
    part.start = motion;
    // That of the rest shape: a body that starts as a point has none.
    const formats::PieceRange& body = package.pieces()[parts_.size()];
    const PartShape rest = restOf(package, body);
    double second = 0;
    for (const auto& vertex : package.physicalVertices().subspan(body.first_vertex, body.vertex_count)) {
      second += double(vertex.mass) * (wide(vertex.rest_position) - rest.centre).squaredNorm();
    }
    part.extent = std::sqrt(second / rest.mass);
    part.scale = std::max(motion.momentum_scale, motion.mass * kRestSpeed * diagonal_);
    part.angular_scale = std::max(motion.angular_scale, motion.mass * kRestSpeed * diagonal_ * part.extent);
    mass_ += motion.mass;
    parts_.push_back(part);
  }
}

void FreeJudge::keep(StepsCriterion criterion, double value, double limit) {
  std::optional<StepsFinding>& worst = worst_[std::size_t(criterion)];
  const StepsFinding found{criterion, value, limit};
  if (!worst || found.ratio() > worst->ratio()) worst = found;
}

std::pair<double, double> FreeJudge::wayOf(const formats::PieceRange& body, const Vector3d& centre,
                                           std::span<const Vec3> now, double rounding) const {
  double way = 0, turned = 0;
  for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v) {
    const Vector3d x = wide(now[v]);
    const double moved = std::max(0.0, (x - wide(before_[v])).norm() - rounding);
    const auto m = double(package_->physicalVertices()[v].mass);
    way += m * moved;
    turned += m * moved * (x - centre).norm();
  }
  return {way, turned};
}

void FreeJudge::observe(const BodyState& now, double seconds) {
  time_ += seconds;
  rounding_ = std::max(rounding_, coordinateRounding(now.positions));
  const double place_rounding = 2 * kRoot3 * rounding_;
  const std::vector<PartMotion> motion = motionOf(*package_, now);
  double kinetic = 0;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    Part& part = parts_[p];
    const PartMotion& m = motion[p];
    kinetic += m.kinetic;
    if (!moving_) {
      keep(StepsCriterion::speed, m.speed(), kRestSpeed * diagonal_);
      continue;
    }
    const auto [way, turned_way] = wayOf(package_->pieces()[p], m.centre, now.positions, place_rounding);
    part.scale = std::max({part.scale, m.momentum_scale, way / seconds});
    part.angular_scale = std::max({part.angular_scale, m.angular_scale, turned_way / seconds});
    part.way += seconds * part.scale / m.mass;
    keep(StepsCriterion::momentum, (m.momentum - part.start.momentum).norm(), kMomentumTolerance * part.scale);
    keep(StepsCriterion::angular, (m.angular - part.start.angular).norm(),
         kMomentumTolerance * part.angular_scale + place_rounding * part.scale);
    keep(StepsCriterion::centre, (m.centre - part.start.centre - time_ * part.start.momentum / m.mass).norm(),
         kMomentumTolerance * part.way + place_rounding);
  }
  before_.assign(now.positions.begin(), now.positions.end());
  if (moving_ && energy_known_) {
    keep(StepsCriterion::energy, kinetic,
         (1 + kEnergyTolerance) * energy_ + 0.5 * mass_ * std::pow(kRestSpeed * diagonal_, 2));
  }
  if (moving_ || time_ < 1) return;
  for (const formats::PieceRange& body : package_->pieces()) {
    double sum = 0, mass = 0;
    for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v) {
      const auto m = double(package_->physicalVertices()[v].mass);
      mass += m;
      sum += m * (wide(now.positions[v]) - wide(start_[v])).squaredNorm();
    }
    keep(StepsCriterion::speed, std::sqrt(sum / mass) / time_, kRestSpeed * diagonal_ + place_rounding / time_);
  }
}

std::vector<StepsFinding> FreeJudge::findings() const {
  std::vector<StepsFinding> found;
  for (const auto& worst : worst_) {
    if (worst) found.push_back(*worst);
  }
  return found;
}

RestJudge::RestJudge(const formats::PackageView& package, const BodyState& start, double speed_limit,
                     std::optional<Vec3> slope)
    : package_(&package),
      start_(start.positions.begin(), start.positions.end()),
      now_(start_),
      fastest_(package.pieces().size(), 0),
      travelled_(package.pieces().size(), Vector3d::Zero()),
      speed_limit_(speed_limit),
      diagonal_(double(package.info().diagonal)) {
  if (slope) slope_ = wide(*slope).normalized();
}

void RestJudge::observe(const BodyState& now, double seconds) {
  time_ += seconds;
  now_.assign(now.positions.begin(), now.positions.end());
  const std::vector<PartMotion> motion = motionOf(*package_, now);
  for (std::size_t p = 0; p < motion.size(); ++p) {
    fastest_[p] = std::max(fastest_[p], motion[p].speed());
    travelled_[p] += seconds * motion[p].momentum / motion[p].mass;
  }
}

std::vector<StepsFinding> RestJudge::findings() const {
  StepsFinding speed{StepsCriterion::speed, 0, speed_limit_ * diagonal_};
  StepsFinding creep{StepsCriterion::creep, 0, kCreepSpeed * diagonal_};
  if (!(time_ > 0)) return {};
  const double rounding = std::max(coordinateRounding(start_), coordinateRounding(now_));
  const double speed_rounding = 2 * kRoot3 * rounding / time_;
  const auto vertices = package_->physicalVertices();
  const auto along = [&](const Vector3d& way) { return (way - *slope_ * slope_->dot(way)).norm(); };
  for (std::size_t p = 0; p < package_->pieces().size(); ++p) {
    const formats::PieceRange& body = package_->pieces()[p];
    double sum = 0, mass = 0;
    Vector3d way = Vector3d::Zero();
    for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v) {
      const Vector3d moved = wide(now_[v]) - wide(start_[v]);
      mass += double(vertices[v].mass);
      way += double(vertices[v].mass) * moved;
      sum += double(vertices[v].mass) * moved.squaredNorm();
    }
    speed = worse(speed, {StepsCriterion::speed, fastest_[p], speed_limit_ * diagonal_});
    speed =
        worse(speed, {StepsCriterion::speed, std::sqrt(sum / mass) / time_, speed_limit_ * diagonal_ + speed_rounding});
    if (!slope_) continue;
    creep = worse(creep, {StepsCriterion::creep, along(travelled_[p]) / time_, kCreepSpeed * diagonal_});
    creep = worse(creep, {StepsCriterion::creep, along(way / mass) / time_, kCreepSpeed * diagonal_ + speed_rounding});
  }
  if (!slope_) return {speed};
  return {speed, creep};
}

StepsFinding shapeOf(const formats::PackageView& package, std::span<const Vec3> positions) {
  const double rounding = kRoot3 * coordinateRounding(positions);
  StepsFinding worst{StepsCriterion::shape, 0, kShapeTolerance * double(package.info().diagonal) + rounding};
  for (const formats::PieceRange& part : package.pieces()) {
    const PartShape rest = restOf(package, part);
    worst = worse(worst, {StepsCriterion::shape, shapeError(package, part, rest, positions),
                          kShapeTolerance * rest.diagonal + rounding});
  }
  return worst;
}

double lowestAlong(std::span<const Vec3> points, const Vec3& normal) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const Vec3& x : points) lowest = std::min(lowest, wide(normal).dot(wide(x)));
  return lowest;
}

std::vector<Vec3> hungPlaces(const formats::PackageView& package, std::span<const Vec3> positions) {
  std::vector<Vec3> places;
  for (const formats::BarycentricAttachment& at : package.barycentric()) {
    places.push_back(
        hungOn(at, package.tetrahedra()[at.tetrahedron], [&](std::uint32_t p) { return positions[p]; }).place);
  }
  return places;
}

StepsFinding groundOf(const formats::PackageView& package, std::span<const Vec3> positions, std::span<const Vec3> drawn,
                      const GroundPlane& ground) {
  const double lowest = lowestAlong(drawn.empty() ? positions : drawn, ground.normal);
  return {StepsCriterion::ground, std::max(0.0, double(ground.offset) - lowest),
          kBelowGround * double(package.info().diagonal) + kRoot3 * coordinateRounding(positions)};
}

}  // namespace sinew::tools
