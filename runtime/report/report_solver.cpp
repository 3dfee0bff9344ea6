// SPDX-License-Identifier: MIT
//
// The scheme of Henriques 2006 and Müller et al. 2005, as it is there: one match and one explicit step for each step of
// the world. Stiffness depends on the step, clusters are averaged, nothing is guarded but that numbers stay finite.
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>

#include "runtime/interact/picked_point.h"
#include "runtime/report/match.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/step/world_step.h"
#include "sinew/c_api.h"
#include "sinew/runtime/report.h"

namespace sinew::internal {
namespace {

Vector3 placeIn(const RigidTransform& at, const Vec3& local) { return placeOf(at, local).cast<float>(); }

class ReportSolver final : public BodySolver {
 public:
  ReportSolver(Body& body, std::pmr::memory_resource* memory)
      : body_(body), constants_(memory), rotations_(body.clusterCount(), memory), held_(body.vertexCount(), memory) {
    constants_.reserve(body.clusterCount());
    for (std::uint32_t c = 0; c < body.clusterCount(); ++c) constants_.push_back(makeConstants(body, c));
  }

  void reserve(SolverScratch& scratch) const override {
    if (scratch.vertices.size() < body_.vertexCount()) scratch.vertices.resize(body_.vertexCount());
  }
  void rest() override {
    Eigen::Quaternionf turn(rotationOf(body_.settings.rotation));
    for (geometry::Quaternion& q : rotations_) q = {turn.w(), turn.x(), turn.y(), turn.z()};
    holdsChanged();
  }
  void refresh(double, Asked) override {}
  void takeState() override {}
  void holdsChanged() override {
    std::fill(held_.begin(), held_.end(), 0U);
    for (std::uint32_t s = 0; s < body_.pin_sets.size(); ++s) {
      for (const PinnedVertex& vertex : body_.pin_sets[s].vertices) {
        if (vertex.weight >= 1) held_[vertex.vertex] = s + 1;
      }
    }
  }
  void activationChanged() override {}
  void push(const PickedPoint& point, const Eigen::Vector3d& impulse) override { give(point, impulse.cast<float>()); }
  WholeMotion motion() const override { return motionOfVertices(body_); }
  void addMotion(const Eigen::Vector3d& linear, const Eigen::Vector3d& angular, const Eigen::Vector3d& about) override {
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      const Eigen::Vector3d arm = asVector(body_.x[i]).cast<double>() - about;
      if (!isHeld(i)) asVector(body_.v[i]) += (linear + angular.cross(arm)).cast<float>();
    }
  }
  Eigen::Matrix3f restShape(std::uint32_t) const override { return Eigen::Matrix3f::Identity(); }

  void step(const StepWorld& world, double seconds, SolverScratch& scratch) override {
    const WorldSettings& settings = world.settings;
    const float h = float(seconds);
    holdVertices(h);
    // Where clusters overlap, the goals of a vertex are averaged (Müller et al. 2005, cluster based deformation).
    const std::span<Vec3> pull = std::span(scratch.vertices.data(), body_.vertexCount());
    std::fill(pull.begin(), pull.end(), Vec3{});
    for (std::uint32_t c = 0; c < body_.clusterCount(); ++c) pullToGoals(c, pull);
    integrate(settings, h, pull);
    for (const Pick& pick : body_.picks) pullPick(pick, h);
    for (const PointForce& force : body_.forces) give(force.point, h * asVector(force.force));
    const Vector3 gravity = body_.settings.gravity_scale * asVector(settings.gravity);
    react(gravity, h, pull);
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      if (isHeld(i)) continue;
      asVector(body_.x[i]) += h * asVector(body_.v[i]);
      if (settings.ground.enabled) putBack(settings.ground, i);
    }
    holdSoftly(h);
    repair();
  }

  void move(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) override {
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      asVector(body_.x[i]) = (rotation * asVector(body_.x[i]).cast<double>() + translation).cast<float>();
      asVector(body_.v[i]) = (rotation * asVector(body_.v[i]).cast<double>()).cast<float>();
    }
    const Eigen::Quaterniond turn(rotation);
    for (geometry::Quaternion& q : rotations_) {
      const Eigen::Quaterniond old = Eigen::Quaternionf(q[0], q[1], q[2], q[3]).cast<double>();
      const Eigen::Quaternionf now = (turn * old).normalized().cast<float>();
      q = {now.w(), now.x(), now.y(), now.z()};
    }
  }

  BodyEnergy energy(SolverScratch&) override {
    BodyEnergy result;
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      result.kinetic += 0.5 * double(body_.vertices()[i].mass) * double(asVector(body_.v[i]).squaredNorm());
    }
    return result;
  }

  std::size_t stateBytes() const override { return rotations_.size() * sizeof(geometry::Quaternion); }
  void save(std::span<std::byte> bytes) const override {
    if (!bytes.empty()) std::memcpy(bytes.data(), rotations_.data(), bytes.size());
  }
  bool accepts(std::span<const std::byte> bytes) const override {
    if (bytes.size() != stateBytes()) return false;
    for (std::size_t at = 0; at < bytes.size(); at += sizeof(geometry::Quaternion)) {
      geometry::Quaternion q;
      std::memcpy(&q, bytes.data() + at, sizeof q);
      if (!(std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < 1e-3F)) return false;
    }
    return true;
  }
  void restore(std::span<const std::byte> bytes) override {
    if (!bytes.empty()) std::memcpy(rotations_.data(), bytes.data(), bytes.size());
    holdsChanged();
  }

 private:
  static Matrix3 rotationOf(const Mat3& m) { return Eigen::Map<const Matrix3>(m.data()).transpose(); }

  bool isHeld(std::uint32_t vertex) const { return held_[vertex] != 0 || isPinned(vertex); }
  bool isPinned(std::uint32_t vertex) const {
    const auto comes_before = [](const Pin& pin, std::uint32_t v) { return pin.vertex < v; };
    const auto place = std::lower_bound(body_.pins.begin(), body_.pins.end(), vertex, comes_before);
    return place != body_.pins.end() && place->vertex == vertex;
  }

  // Held positions (Henriques 2006, 4.3.1), where they will be at the end of the step.
  void holdVertices(float h) {
    const auto hold = [&](std::uint32_t i, const Vector3& place) {
      asVector(body_.v[i]) = (place - asVector(body_.x[i])) / h;
      asVector(body_.x[i]) = place;
    };
    for (const Pin& pin : body_.pins) hold(pin.vertex, asVector(pin.at));
    for (const PinSet& set : body_.pin_sets) {
      for (const PinnedVertex& vertex : set.vertices) {
        if (vertex.weight >= 1) hold(vertex.vertex, placeIn(set.at, vertex.local));
      }
    }
  }

  // Pinned vertices of weight w < 1 go the part w of the way to their places.
  void holdSoftly(float h) {
    for (const PinSet& set : body_.pin_sets) {
      for (const PinnedVertex& vertex : set.vertices) {
        if (vertex.weight >= 1) continue;
        const Vector3 way = vertex.weight * (placeIn(set.at, vertex.local) - asVector(body_.x[vertex.vertex]));
        asVector(body_.x[vertex.vertex]) += way;
        asVector(body_.v[vertex.vertex]) += way / h;
      }
    }
  }

  // pull += share alpha (g - x).
  void pullToGoals(std::uint32_t c, std::span<Vec3> pull) {
    const formats::PackageView& package = body_.package();
    const formats::Cluster& cluster = package.clusters()[c];
    if (cluster.member_count == 0) return;
    const Goal goal = match(body_, c, constants_[c], held_, rotations_[c]);
    const auto stiffness = package.vertexStiffness();
    for (const formats::Membership& member :
         package.memberships().subspan(cluster.first_member, cluster.member_count)) {
      const std::uint32_t i = member.vertex;
      const Monomials<9> q = restCoordinates(body_, c, body_.vertices()[i].rest_position);
      const Vector3 way = goal.center - asVector(body_.x[i]) + cluster.radius * goal.f.lazyProduct(q);
      const float part = member.share * constants_[c].alpha * (stiffness.empty() ? 1.0F : stiffness[i]);
      asVector(pull[i]) += part * way;
    }
  }

  // v += alpha (g - x) / h + h f / m (Müller et al. 2005, integration); the air takes its part.
  void integrate(const WorldSettings& settings, float h, std::span<const Vec3> pull) {
    const float kept = std::exp(-settings.damping * h);
    const Vector3 gravity = body_.settings.gravity_scale * asVector(settings.gravity);
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      if (!isHeld(i)) asVector(body_.v[i]) = kept * asVector(body_.v[i]) + asVector(pull[i]) / h + h * gravity;
    }
  }

  // The spring of picking (Henriques 2006, 6.1) between a point and a target: of the frequency on the whole body's
  // mass, critically damped, implicit: a stiff one on a light vertex would not stay finite.
  void pullPick(const Pick& pick, float h) {
    const PickedPoint& point = pick.point;
    Vector3 x = Vector3::Zero(), v = Vector3::Zero();
    float mobility = 0;
    for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
      const std::uint32_t i = point.vertex[c];
      const float weight = float(point.weight[c]);
      x += weight * asVector(body_.x[i]);
      v += weight * asVector(body_.v[i]);
      if (!isHeld(i)) mobility += weight * weight / body_.vertices()[i].mass;
    }
    const float omega = 2 * std::numbers::pi_v<float> * pick.frequency_hz, mass = body_.package().info().total_mass;
    const float spring = mass * omega * omega, damper = 2 * mass * omega;
    const Vector3 target = reachOf(body_, pick, x.cast<double>(), double(spring)).cast<float>();
    const Vector3 push = h * (spring * (target - x - h * v) - damper * v) / (1 + mobility * h * (damper + h * spring));
    give(point, push);
  }

  // Held vertices take none of it.
  void give(const PickedPoint& point, const Vector3& impulse) {
    if (point.weight[0] == 0) {
      const Vector3 change = impulse / body_.package().info().total_mass;
      for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
        if (!isHeld(i)) asVector(body_.v[i]) += change;
      }
    }
    for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
      const std::uint32_t i = point.vertex[c];
      if (!isHeld(i)) asVector(body_.v[i]) += float(point.weight[c]) / body_.vertices()[i].mass * impulse;
    }
  }

  // Motion that holding prevents is felt by the owner of the transform.
  void react(const Vector3& gravity, float h, std::span<const Vec3> pull) {
    for (PinSet& set : body_.pin_sets) {
      for (const PinnedVertex& vertex : set.vertices) {
        if (vertex.weight < 1) continue;
        const Vector3 acceleration = asVector(pull[vertex.vertex]) / (h * h) + gravity;
        const Eigen::Vector3d force = double(body_.vertices()[vertex.vertex].mass) * acceleration.cast<double>();
        const Vector3 arm = asVector(body_.x[vertex.vertex]) - asVector(set.at.position);
        set.force_sum += force;
        set.torque_sum += arm.cast<double>().cross(force);
      }
    }
  }

  // A vertex below the ground is put on it; friction takes velocity along it up to the bound of Coulomb's law.
  void putBack(const GroundPlane& ground, std::uint32_t i) {
    const Vector3 normal = asVector(ground.normal);
    auto x = asVector(body_.x[i]);
    auto v = asVector(body_.v[i]);
    const float height = normal.dot(x) - ground.offset;
    if (!(height < 0)) return;
    x -= height * normal;
    const float into = std::min(0.0F, normal.dot(v));
    v -= into * normal;
    const Vector3 along = v - normal.dot(v) * normal;
    const float speed = along.norm();
    if (speed > 0) v -= std::min(1.0F, -ground.friction * into / speed) * along;
  }

  void repair() {
    body_.repaired = 0;
    const Matrix3 rotation = rotationOf(body_.settings.rotation);
    for (std::uint32_t i = 0; i < body_.vertexCount(); ++i) {
      if (stateIsUsable(body_.x[i], body_.v[i])) continue;
      asVector(body_.x[i]) =
          rotation.lazyProduct(asVector(body_.vertices()[i].rest_position)) + asVector(body_.settings.position);
      body_.v[i] = {};
      ++body_.repaired;
    }
  }

  Body& body_;
  Array<ClusterConstants> constants_;
  Array<geometry::Quaternion> rotations_;
  Array<std::uint32_t> held_;  ///< by vertex: 1 + the pin set that holds it exactly, or 0
};

class ReportFactory final : public SolverFactory {
 public:
  const char* faultOf(const Asset&) const override { return nullptr; }
  SolverPointer make(Body& body, std::pmr::memory_resource* memory) const override {
    return makeSolver<ReportSolver>(memory, body, memory);
  }
};

}  // namespace
}  // namespace sinew::internal

const sinew::SolverFactory& sinew::reportSolver() {
  static const internal::ReportFactory factory;
  return factory;
}

const sinew_solver* sinew_report_solver(void) { return reinterpret_cast<const sinew_solver*>(&sinew::reportSolver()); }
