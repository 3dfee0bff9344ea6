// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/stability.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <mutex>
#include <numbers>
#include <sstream>

#include "tools/render/text.h"
#include "tools/study/body_measure.h"
#include "tools/study/covering.h"
#include "tools/study/names.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

enum class Start : std::uint8_t {
  rest,
  point,
  line,
  plane,
  mirrored,
  inside_out,
  stretched,
  scatter_1e_6,
  scatter_1e_3,
  scatter_1,
  scatter_1e3,
  scatter_1e6,
  fast_random,
  fast_opposed,
  fast_spin,
  thrown,
  lost_vertex,
};
enum class Before : std::uint8_t { nothing, pinned, pressed, hold, infinite_mass, matrix, constrained_fit };
enum class Matter : std::uint8_t { plain, damped, plastic, active };

constexpr std::array kSteps = {1e-5F, 1e-3F, 1.0F / 240, 1.0F / 60, 0.1F, 1.0F};
constexpr std::array kFrequencies = {0.0F, 0.1F, 1.0F, 10.0F, 100.0F, 1e3F, 1e5F};
constexpr std::array kMassRatios = {1.0, 1e3, 1e6};
constexpr std::array<std::uint32_t, 3> kPasses = {1, 4, 16};
// The part that a pass keeps of a deformation, for StiffnessModel::per_step: from none that returns to rigid.
constexpr std::array kPerStepBetas = {1.0F, 0.999F, 0.99F, 0.9F, 0.5F, 0.1F, 0.0F};
constexpr std::array kSizes = {1.0, 1e-6, 1e-3, 1e3, 1e6};
constexpr std::size_t kLimitCount = 7, kVolumeCount = 3, kModelCount = 3;
const std::vector<formats::CurvePoint> kCurve = {{3.1F, 3.1F}, {4, 3.3F}, {10, 3.4F}};
constexpr float kPlasticYield = 0.05F, kPlasticCreep = 5, kPlasticLimit = 0.1F;
constexpr float kClusterDamping = 5;          // 1/s
constexpr float kClusterDampingRatio = 0.1F;  // of critical, at most: what creeps takes hours to judge
constexpr float kContraction = 0.5F;

// ---- limits (docs/stability.md) ----
constexpr double kShapeLimit = 1e-3;      // diagonals
constexpr double kMomentumLimit = 1e-4;   // of Σ m |v| (linear), Σ m |d| |v| (angular)
constexpr double kEnergyLimit = 2;        // times the least since the release
constexpr double kEnergyUnjudged = 1e-3;  // of the energy at the release: less is not judged
constexpr double kReturnSeconds = 2;      // of simulated time
constexpr double kReturnPeriods = 5;
constexpr double kCreepTimes = 8;       // e^-8 = 3e-4
constexpr double kBeforeSeconds = 0.5;  // pinned or pressed
constexpr float kBrake = 20;            // 1/s: air that stops a spin
constexpr double kSpinStretch = 1e-4;   // a spin that stretches a body further than this is braked
constexpr double kFarAway = 100;        // diagonals from the origin
constexpr float kPress = 1e4F * 9.81F;  // m/s^2
constexpr float kFinishingStep = 1.0F / 60, kLongestFinishingStep = 1;
constexpr double kFinishingSteps = 5000;  // of a body that takes hours to return: its steps are longer

constexpr double kUlp = 0x1p-23;
constexpr double kGoalRounding = 4e-7;  // of a body's size: what tests hold kernels to

template <class Levels>
std::vector<std::string> numbers(const Levels& levels) {
  std::vector<std::string> result;
  for (const auto level : levels) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", double(level));
    result.emplace_back(text);
  }
  return result;
}

template <class Enum>
std::vector<std::string> namesOf(std::size_t count) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < count; ++i) names.emplace_back(nameOf(Enum(i)));
  return names;
}

struct CellSetup {
  Start start;
  float step;
  float frequency_hz;
  std::uint32_t passes;
  StudyBody body;
  Before before;
  StudyPackageOptions package;
  Matter matter;
  std::uint64_t seed = 0;
};

// Of Matter::damped, 1/s.
float clusterDamping(float frequency_hz) {
  if (frequency_hz == 0) return kClusterDamping;
  return std::min(kClusterDamping, 4 * std::numbers::pi_v<float> * kClusterDampingRatio * frequency_hz);
}

StudyPackageOptions packageOf(const StabilityCell& cell) {
  const auto level = [&](StabilityFactor factor) { return std::size_t(cell[std::size_t(factor)]); };
  StudyPackageOptions options;
  options.mode = formats::ClusterMode(level(StabilityFactor::mode));
  options.frequency_hz = 1;
  options.mass_ratio = kMassRatios[level(StabilityFactor::mass_ratio)];
  options.size = kSizes[level(StabilityFactor::size)];
  const auto matter = Matter(level(StabilityFactor::matter));
  formats::ClusterMechanics m = formats::kPlainMechanics;
  m.stiffness = formats::StiffnessModel(level(StabilityFactor::model));
  m.per_step_beta.fill(kPerStepBetas[level(StabilityFactor::stiffness)]);
  if (m.stiffness == formats::StiffnessModel::elastic) options.elastic_hz = 1;
  m.limit = formats::LimitMethod(level(StabilityFactor::limit));
  if (m.limit == formats::LimitMethod::curve) options.curve = kCurve;
  m.volume = formats::VolumeMethod(level(StabilityFactor::volume));
  if (matter == Matter::damped) m.damping = clusterDamping(kFrequencies[level(StabilityFactor::stiffness)]);
  if (matter == Matter::plastic) {
    m.plastic_yield = kPlasticYield;
    m.plastic_creep = kPlasticCreep;
    m.plastic_limit = kPlasticLimit;
  }
  if (matter == Matter::active) {
    m.fibre = {0.6F, 0.8F, 0};
    m.contraction = kContraction;
  }
  // What asks for nothing of a CMEC record has none.
  const bool plain = m.stiffness == formats::StiffnessModel::frequency && m.limit == formats::LimitMethod::none &&
                     m.volume == formats::VolumeMethod::none && matter == Matter::plain;
  if (!plain) options.mechanics = m;
  return options;
}

CellSetup setupOf(const StabilityCell& cell) {
  CellSetup setup{};
  const auto level = [&](StabilityFactor factor) { return cell[std::size_t(factor)]; };
  setup.start = Start(level(StabilityFactor::start));
  setup.step = kSteps[level(StabilityFactor::step)];
  setup.frequency_hz = kFrequencies[level(StabilityFactor::stiffness)];
  setup.passes = kPasses[level(StabilityFactor::passes)];
  setup.body = StudyBody(level(StabilityFactor::body));
  setup.before = Before(level(StabilityFactor::before));
  setup.package = packageOf(cell);
  setup.matter = Matter(level(StabilityFactor::matter));
  // Factors at their first level leave the chance as it is.
  for (std::size_t f = 0; f < cell.size(); ++f) {
    if (f <= std::size_t(StabilityFactor::before) || cell[f] != 0) {
      setup.seed = setup.seed * 31 + cell[f];
    }
  }
  return setup;
}

Vec3 narrow(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }

Vector3d chanceVector(std::uint64_t seed, std::uint64_t index) {
  return {2 * chance(seed, 3 * index) - 1, 2 * chance(seed, 3 * index + 1) - 1, 2 * chance(seed, 3 * index + 2) - 1};
}

// The start state; centred on the body's centre of mass, so that scatters and speeds leave it near the origin.
void startState(const CellSetup& setup, const Asset& asset, std::span<const Vec3> rest, std::vector<Vec3>& positions,
                std::vector<Vec3>& velocities) {
  const auto vertices = asset.package().physicalVertices();
  const double diagonal = double(asset.package().info().diagonal);
  Vector3d center = Vector3d::Zero();
  double mass = 0, extent = 0;
  for (std::size_t i = 0; i < rest.size(); ++i) {
    center += double(vertices[i].mass) * wide(rest[i]);
    mass += double(vertices[i].mass);
  }
  center /= mass;
  for (const Vec3& x : rest) extent = std::max(extent, (wide(x) - center).norm());
  std::vector<Vector3d> x(rest.size()), v(rest.size(), Vector3d::Zero());
  const auto scatter = [&](double size) {
    Vector3d mean = Vector3d::Zero();
    for (std::size_t i = 0; i < x.size(); ++i) {
      x[i] = 0.5 * size * diagonal * chanceVector(setup.seed, i);
      mean += double(vertices[i].mass) / mass * x[i];
    }
    for (Vector3d& p : x) p -= mean;
  };
  const auto without_drift = [&] {
    Vector3d mean = Vector3d::Zero();
    for (std::size_t i = 0; i < v.size(); ++i) mean += double(vertices[i].mass) / mass * v[i];
    for (Vector3d& u : v) u -= mean;
  };
  const Vector3d axis = (chanceVector(setup.seed, 1000) + Vector3d(1e-3, 2e-3, 3e-3)).normalized();
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vector3d d = wide(rest[i]) - center;
    x[i] = d;
    switch (setup.start) {
      case Start::point:
        x[i].setZero();
        break;
      case Start::line:
        x[i] = axis * axis.dot(d);
        break;
      case Start::plane:
        x[i] = d - axis * axis.dot(d);
        break;
      case Start::mirrored:
        x[i] = d - 2 * axis * axis.dot(d);
        break;
      case Start::inside_out:
        x[i] = d.norm() > 0 ? Vector3d(d.normalized() * (d.norm() - 1.1 * extent)) : d;
        break;
      case Start::stretched:
        x[i] = d + 3 * axis * axis.dot(d);
        break;
      case Start::lost_vertex:
        x[i] = wide(rest[i]);  // the clusters know only where they saw the vertex last
        break;
      case Start::fast_random:
        v[i] = 1e6 * chanceVector(setup.seed, i);
        break;
      case Start::fast_opposed:
        v[i] = (axis.dot(d) > 0 ? -1e6 : 1e6) * axis;
        break;
      case Start::fast_spin:
        v[i] = extent > 0 ? Vector3d(1e6 / extent * axis.cross(d)) : Vector3d::Zero();
        break;
      case Start::thrown:
        v[i] = 1e6 * axis;
        break;
      default:
        break;
    }
  }
  switch (setup.start) {
    case Start::scatter_1e_6:
      scatter(1e-6);
      break;
    case Start::scatter_1e_3:
      scatter(1e-3);
      break;
    case Start::scatter_1:
      scatter(1);
      break;
    case Start::scatter_1e3:
      scatter(1e3);
      break;
    case Start::scatter_1e6:
      scatter(1e6);
      break;
    case Start::fast_random:
    case Start::fast_opposed:
      without_drift();
      break;
    default:
      break;
  }
  positions.clear();
  velocities.clear();
  for (std::size_t i = 0; i < x.size(); ++i) {
    positions.push_back(narrow(x[i]));
    velocities.push_back(narrow(v[i]));
  }
  if (setup.start == Start::lost_vertex) {
    const std::size_t lost = std::size_t(chance(setup.seed, 5) * double(x.size()));
    const float bad =
        chance(setup.seed, 6) < 0.5 ? std::numeric_limits<float>::quiet_NaN() : std::numeric_limits<float>::infinity();
    (chance(setup.seed, 7) < 0.5 ? positions : velocities)[lost][1] = bad;
  }
}

// Runs a cell step by step and keeps the measures.
class CellRun {
 public:
  CellRun(const StabilityCell& cell, bool quick)
      : setup_(setupOf(cell)),
        quick_(quick),
        asset_(studyPackage(setup_.body, setup_.package)),
        measure_(*asset_, double(setup_.frequency_hz)),
        world_(worldSettings(setup_)) {
    result_.cell = cell;
    BodySettings settings;
    settings.stiffness_scale = setup_.frequency_hz;
    body_ = *world_.addBody(asset_, settings);
  }

  StabilityResult run() {
    std::vector<Vec3> x, v;
    startState(setup_, *asset_, world_.positions(body_), x, v);
    world_.setState(body_, x, v);
    if (setup_.before != Before::nothing || setup_.matter == Matter::active) hold();
    float finishing = std::max(setup_.step, kFinishingStep);
    double slow = measure_.slowestHz(passSeconds(finishing));
    double free_seconds = returnSeconds(slow);
    if (free_seconds > kFinishingSteps * double(finishing)) {
      finishing = std::clamp(float(free_seconds / kFinishingSteps), finishing, kLongestFinishingStep);
      slow = measure_.slowestHz(passSeconds(finishing));
      free_seconds = returnSeconds(slow);
    }
    const bool returns = slow > 0;
    const std::uint32_t most = quick_ ? 300 : 2000;
    release(setup_.step);
    double done = advance(setup_.step, free_seconds, most);
    // Where floats do not resolve what short passes move, longer ones have to bring the body back.
    const bool resolved = !returns || unresolvedShape(slow) <= kShapeLimit;
    if (done < free_seconds || !resolved) {
      release(finishing);
      advance(finishing, resolved ? free_seconds - done : free_seconds, 1000000);
    }
    if (returns && result_.finite && (spinMatters(finishing) || far())) {
      world_.settings().damping = kBrake;
      measuring_ = false;
      advance(finishing, kReturnSeconds, 1000000);
      world_.settings().damping = 0;
      release(finishing);
      advance(finishing, free_seconds, 1000000);
    }
    if (returns && result_.finite) {
      result_.rest_error = measure_.restError(world_, body_);
      const double limit = kShapeLimit + (setup_.matter == Matter::plastic ? double(kPlasticLimit) : 0.0);
      result_.shape = result_.rest_error / (limit + unresolvedShape(slow));
    }
    if (!result_.finite) result_.shape = result_.energy = result_.momentum = 0;
    return result_;
  }

 private:
  static WorldSettings worldSettings(const CellSetup& setup) {
    WorldSettings settings;
    settings.gravity = {0, 0, 0};
    settings.damping = 0;  // air takes momentum
    settings.iterations = setup.passes;
    return settings;
  }

  // Pinned by three vertices, pressed to a ground, contracted; then free again.
  void hold() {
    const auto x = world_.positions(body_);
    if (setup_.before == Before::pressed) {
      double low = 0;
      for (const Vec3& p : x) {
        if (std::isfinite(p[1])) low = std::min(low, double(p[1]));
      }
      world_.settings().gravity = {0, -kPress, 0};
      world_.settings().ground.enabled = true;
      world_.settings().ground.offset = float(low);
    } else if (setup_.before != Before::nothing) {
      std::vector<std::uint32_t> held;
      for (const std::size_t i : {std::size_t(0), x.size() / 3, x.size() - 1}) {
        const bool again = std::find(held.begin(), held.end(), std::uint32_t(i)) != held.end();
        if (!again && wide(x[i]).allFinite()) held.push_back(std::uint32_t(i));
      }
      if (setup_.before == Before::pinned) {
        for (const std::uint32_t i : held) world_.pin(body_, i, x[i]);
      } else {
        const auto method = PinMethod(std::uint32_t(setup_.before) - std::uint32_t(Before::hold));
        if (!held.empty() && !world_.addPinSet(body_, held, {}, method)) {
          result_.contained = std::numeric_limits<double>::infinity();
        }
      }
    }
    if (setup_.matter == Matter::active) world_.setActivation(body_, 0U, 1);
    measuring_ = false;
    holding_ = true;
    advance(setup_.step, kBeforeSeconds, quick_ ? 100 : 500);
    holding_ = false;
    if (setup_.matter == Matter::active) world_.setActivation(body_, 0U, 0);
    world_.unpinAll(body_);
    world_.settings().gravity = {0, 0, 0};
    world_.settings().ground.enabled = false;
  }

  // Simulated time in which a body whose lowest frequency is `slow` has to be back.
  double returnSeconds(double slow) const {
    if (!(slow > 0) || !std::isfinite(slow)) return kReturnSeconds;
    double seconds = std::max(kReturnSeconds, kReturnPeriods / slow);
    // What its own damping holds back by more than half creeps: e^(-ω² t / d).
    const double omega = 2 * std::numbers::pi * slow;
    const double damping = setup_.matter == Matter::damped ? double(clusterDamping(setup_.frequency_hz)) : 0.0;
    if (damping > 2 * omega) seconds = std::max(seconds, kCreepTimes * damping / (omega * omega));
    return seconds;
  }

  // Deformation, diagonals, that the last passes do not move: one moves a deformation by (2 pi f h)² of itself, which
  // may be less than the rounding of a goal.
  double unresolvedShape(double slow) const {
    const BodyMotion m = measure_.motion(world_, body_);
    const double phase = 2 * std::numbers::pi * slow * pass_seconds_;
    const double moves = std::isfinite(slow) ? phase * phase / (1 + phase * phase) : 1.0;
    const double rounding =
        measure_.roundingGain() * kUlp * (m.reach + m.extent) / double(asset_->package().info().diagonal);
    return 2 * rounding / moves;
  }

  // From here on the body is free: what it has now is what it may not lose or exceed.
  void release(float step) {
    if (!result_.finite) return;
    measuring_ = true;
    pass_seconds_ = passSeconds(step);
    lost_pending_ = setup_.start == Start::lost_vertex && setup_.before == Before::nothing && !lost_done_;
    if (lost_pending_) return;  // what a lost vertex had is not known: measured from the first step on
    startMeasuring();
  }

  void startMeasuring() {
    before_ = measure_.motion(world_, body_);
    momentum_scale_ = before_.momentum_scale;
    angular_scale_ = before_.angular_scale;
    // What the start may turn into motion: its speed, its elastic energy, and what matching sets free at once.
    const BodyMeasure::Potential potential = measure_.potential(world_, body_, pass_seconds_, tangled_);
    tangled_ = potential.tangled;
    energy_ = before_.kinetic + potential.most;
    potential_known_ = !potential.limited;
    released_energy_ = energy_;
    energy_ *= kEnergyLimit;
    // Sums are rounded relative to the fastest motion there may be, which a step can hide.
    const double released = std::sqrt(2 * energy_ * before_.mass);
    momentum_scale_ += released;
    angular_scale_ += released * before_.extent;
    passes_since_release_ = 0;
    momentum_rounding_ = angular_rounding_ = 0;
  }

  double advance(float step, double seconds, std::uint32_t most) {
    const std::uint32_t count = std::clamp<std::uint32_t>(
        std::uint32_t(std::min(1e9, std::ceil(seconds / double(step) * (1 - 1e-6)))), 3U, std::max(most, 3U));
    const std::uint32_t every = std::max(1U, count / 60);
    for (std::uint32_t i = 0; i < count && result_.finite; ++i) {
      world_.step(step);
      result_.finite = BodyMeasure::finite(world_, body_);
      if (!result_.finite) break;
      checkRepair(i == 0);
      passes_since_release_ += double(step) / passSeconds(step);
      if (!holding_) recenter();
      // What is tangled is so until it is back once, also between two measurements.
      if (measuring_ && tangled_) tangled_ = measure_.isTangled(world_, body_, pass_seconds_, true);
      if (measuring_ && (i < 8 || i % every == 0 || i + 1 == count)) measureFree();
    }
    return double(count) * double(step);
  }

  // A lost vertex is counted in the first step and never again, and the others, at rest, stay there.
  void checkRepair(bool first) {
    const std::uint32_t expected = setup_.start == Start::lost_vertex && !lost_done_ && first ? 1 : 0;
    if (world_.repairedVertices(body_) != expected) {
      result_.contained = std::numeric_limits<double>::infinity();
    }
    // A fibre that contracts moves the others by itself.
    if (expected == 1 && setup_.before == Before::nothing && setup_.matter != Matter::active) {
      result_.contained = std::max(result_.contained, measure_.restError(world_, body_) / kShapeLimit);
    }
    if (expected == 1) lost_done_ = true;
    if (lost_pending_) {
      lost_pending_ = false;
      startMeasuring();
    }
  }

  void measureFree() {
    const BodyMotion now = measure_.motion(world_, body_);
    momentum_scale_ = std::max(momentum_scale_, now.momentum_scale);
    angular_scale_ = std::max(angular_scale_, now.angular_scale);
    // Positions are rounded to a part of their distance from the origin; a step turns that into speed.
    const double rounding = kUlp * (std::max(reached_, now.reach) + now.extent + now.fastest * pass_seconds_);
    const double rounding_speed = rounding / pass_seconds_;
    const double p = (now.momentum - before_.momentum).norm();
    const double l = (now.angular - before_.angular).norm();
    // What was rounded off in a pass stays off, however slow and small the body is by now.
    momentum_rounding_ = std::max(momentum_rounding_, now.mass * rounding_speed);
    angular_rounding_ =
        std::max(angular_rounding_, now.extent * now.mass * rounding_speed + rounding * momentum_scale_);
    const double p_limit = kMomentumLimit * momentum_scale_ + momentum_rounding_;
    const double l_limit = kMomentumLimit * angular_scale_ + angular_rounding_;
    const auto ratio = [](double value, double limit) { return limit > 0 ? value / limit : value > 0 ? 1e30 : 0.0; };
    result_.momentum = std::max({result_.momentum, ratio(p, p_limit), ratio(l, l_limit)});

    // Goals are sums of terms of the size of the rest shape, also where the body has collapsed.
    const double size = std::max(now.extent, 0.5 * double(asset_->package().info().diagonal));
    const double goal_rounding_speed = rounding_speed + kUlp * (size - now.extent) / pass_seconds_;
    // What the rounding of goals adds in each pass may add up: it need not be chance.
    const double added = measure_.roundingGain() * goal_rounding_speed * std::max(4.0, double(passes_since_release_));
    // Goals are off by kGoalRounding of the body, which the search for the potential takes for distances.
    const double off = BodyMeasure::kSearchRounds * std::pow(kGoalRounding * size / pass_seconds_, 2);
    const double ringing = std::pow(4 * measure_.fastestOmega(pass_seconds_) * rounding, 2);
    const double floor = 0.5 * now.mass * (std::pow(added, 2) + off + ringing);
    // What has flowed rests in another shape, and what has no stiffness in any: of it kinetic energy alone is judged,
    // by the energy at the release.
    const bool flows = setup_.matter == Matter::plastic || !(measure_.slowestHz(pass_seconds_) > 0);
    BodyMeasure::Potential potential;
    if (!flows) potential = measure_.potential(world_, body_, pass_seconds_, tangled_);
    tangled_ = potential.tangled;
    // Nor is what lies beyond a limit judged by a potential: stops do not give back what they take. What it has where
    // it first comes within the limits is not to grow from there on.
    if (!potential_known_ && !potential.limited) {
      potential_known_ = true;
      energy_ = std::max(energy_, kEnergyLimit * (now.kinetic + potential.most));
    }
    const double energy = now.kinetic + (potential.limited ? 0 : potential.least);
    if (energy > floor) {
      // What contracts spins up, as a skater does: its shape and its angular momentum leave it no less.
      const double limit = std::max(energy_, kEnergyLimit * now.turning_energy);
      result_.energy = std::max(result_.energy, ratio(energy, limit + floor + kEnergyUnjudged * released_energy_));
    }
    if (!flows && !potential.limited) energy_ = std::min(energy_, kEnergyLimit * (now.kinetic + potential.most));
  }

  // A step is divided no finer than 2e-4 s.
  double passSeconds(float step) const {
    return double(step) / std::clamp(std::floor(double(step) / 2e-4 * (1 + 1e-6)), 1.0, double(setup_.passes));
  }

  // Back to the origin, as an engine moves its own: further out positions are too coarse for a body of this size. One
  // that is itself as large stays.
  void recenter() {
    const BodyMotion now = measure_.motion(world_, body_);
    reached_ = now.reach;
    if (!(now.center.cwiseAbs().maxCoeff() >
          std::max(kFarAway * double(asset_->package().info().diagonal), now.extent)))
      return;
    world_.teleport(body_, {1, 0, 0, 0, 1, 0, 0, 0, 1}, narrow(-now.center));
  }

  // Whether a step takes the body, or leaves it, further than positions can show it.
  bool far() const { return reached_ > kFarAway * double(asset_->package().info().diagonal); }

  // Whether the body still turns so fast that its spin keeps it out of shape.
  bool spinMatters(float step) const {
    const BodyMotion now = measure_.motion(world_, body_);
    const double h = passSeconds(step);
    const double hz = measure_.slowestHz(h);
    const double phase = std::isfinite(hz) ? 2 * std::numbers::pi * hz * h : 1;
    return now.spin * h * std::max(1.0, 1 / phase) > kSpinStretch;
  }

  CellSetup setup_;
  bool quick_;
  std::shared_ptr<const Asset> asset_;
  BodyMeasure measure_;
  World world_;
  BodyId body_;
  StabilityResult result_;
  BodyMotion before_;
  double momentum_scale_ = 0, angular_scale_ = 0;
  double momentum_rounding_ = 0, angular_rounding_ = 0;  // most that a pass since the release may have rounded off
  double energy_ = 0;                                    // what kinetic + elastic energy may not exceed
  double released_energy_ = 0;
  double pass_seconds_ = 0;
  double passes_since_release_ = 0;
  double reached_ = 0;  // largest coordinate after the last step, metres
  bool measuring_ = true, holding_ = false;
  bool lost_pending_ = false, lost_done_ = false;
  bool tangled_ = false;          // BodyMeasure::Potential
  bool potential_known_ = false;  // the body has been within its limits since the release
};

bool selected(const std::string& text, const std::string& only) {
  std::istringstream words(only);
  std::string word;
  while (words >> word) {
    if ((text + " ").find(word + (word.find('=') == std::string::npos ? "" : " ")) == std::string::npos) return false;
  }
  return true;
}

}  // namespace

std::string_view nameOf(StabilityFactor factor) {
  constexpr std::array<std::string_view, kStabilityFactorCount> kNames = {
      "start",  "step",  "stiffness", "mass_ratio", "mode",   "passes", "body",
      "before", "model", "limit",     "volume",     "matter", "size"};
  return kNames[std::size_t(factor)];
}

std::vector<std::string> levelsOf(StabilityFactor factor) {
  switch (factor) {
    case StabilityFactor::start:
      return {"rest",        "point",        "line",         "plane",     "mirrored",    "inside_out",
              "stretched",   "scatter_1e-6", "scatter_1e-3", "scatter_1", "scatter_1e3", "scatter_1e6",
              "fast_random", "fast_opposed", "fast_spin",    "thrown",    "lost_vertex"};
    case StabilityFactor::step:
      return {"1e-05", "0.001", "1/240", "1/60", "0.1", "1"};
    case StabilityFactor::stiffness:
      return numbers(kFrequencies);
    case StabilityFactor::mass_ratio:
      return numbers(kMassRatios);
    case StabilityFactor::mode:
      return {"rigid", "linear", "quadratic"};
    case StabilityFactor::passes:
      return numbers(kPasses);
    case StabilityFactor::body: {
      std::vector<std::string> names;
      for (std::size_t i = 0; i < kStudyBodyCount; ++i) names.emplace_back(nameOf(StudyBody(i)));
      return names;
    }
    case StabilityFactor::before:
      return {"nothing", "pinned", "pressed", "hold", "infinite_mass", "matrix", "constrained_fit"};
    case StabilityFactor::model:
      return namesOf<formats::StiffnessModel>(kModelCount);
    case StabilityFactor::limit:
      return namesOf<formats::LimitMethod>(kLimitCount);
    case StabilityFactor::volume:
      return namesOf<formats::VolumeMethod>(kVolumeCount);
    case StabilityFactor::matter:
      return {"plain", "damped", "plastic", "active"};
    case StabilityFactor::size:
      return numbers(kSizes);
  }
  return {};
}

std::string textOf(const StabilityCell& cell) {
  std::string text;
  for (std::size_t f = 0; f < cell.size(); ++f) {
    text += (f == 0 ? "" : " ") + std::string(nameOf(StabilityFactor(f))) + "=" + levelsOf(StabilityFactor(f))[cell[f]];
  }
  return text;
}

double StabilityResult::worst() const {
  if (!finite) return std::numeric_limits<double>::infinity();
  return std::max({momentum, energy, shape, contained});
}

std::string_view StabilityResult::cause() const {
  if (!finite) return "finite";
  const double w = worst();
  if (w == contained) return "contained";
  if (w == shape) return "shape";
  return w == energy ? "energy" : "momentum";
}

std::vector<StabilityCell> stabilityDesign(bool quick) {
  std::vector<std::uint8_t> levels;
  for (std::size_t f = 0; f < kStabilityFactorCount; ++f) {
    levels.push_back(std::uint8_t(levelsOf(StabilityFactor(f)).size()));
  }
  std::vector<std::vector<std::uint8_t>> product;
  if (!quick) {
    // Start, step, stiffness and mode act on one another: all of them together, on one body.
    for (std::uint8_t start = 0; start < levels[0]; ++start) {
      for (std::uint8_t step = 0; step < levels[1]; ++step) {
        for (std::uint8_t stiffness = 0; stiffness < levels[2]; ++stiffness) {
          for (std::uint8_t mode = 0; mode < levels[4]; ++mode) {
            product.push_back({start, step, stiffness, 0, mode, 1, std::uint8_t(StudyBody::box2), 0, 0, 0, 0, 0, 0});
          }
        }
      }
    }
  }
  std::vector<std::vector<std::uint8_t>> all = coveringDesign(levels, quick ? 2 : 3, product);
  all.insert(all.begin(), product.begin(), product.end());
  std::vector<StabilityCell> cells;
  for (const auto& levels_of_cell : all) {
    StabilityCell cell{};
    std::copy(levels_of_cell.begin(), levels_of_cell.end(), cell.begin());
    cells.push_back(cell);
  }
  return cells;
}

std::vector<StabilityCell> stabilityChance(std::uint32_t count, std::uint64_t seed) {
  std::vector<StabilityCell> cells(count);
  std::uint64_t drawn = 0;
  for (StabilityCell& cell : cells) {
    for (std::size_t f = 0; f < kStabilityFactorCount; ++f) {
      const std::size_t levels = levelsOf(StabilityFactor(f)).size();
      cell[f] = std::uint8_t(std::min(std::size_t(chance(seed, drawn++) * double(levels)), levels - 1));
    }
  }
  return cells;
}

StabilityResult runStabilityCell(const StabilityCell& cell, bool quick) {
  const auto start = std::chrono::steady_clock::now();
  StabilityResult result = CellRun(cell, quick).run();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

std::vector<StabilityResult> runStability(const StabilityOptions& options) {
  std::vector<StabilityCell> cells =
      options.chance > 0 ? stabilityChance(options.chance, options.seed) : stabilityDesign(options.quick);
  std::erase_if(cells, [&](const StabilityCell& cell) { return !selected(textOf(cell), options.only); });
  std::vector<StabilityResult> results(cells.size());
  std::mutex mutex;
  std::size_t done = 0;
  const auto work = [&](std::size_t i) {
    results[i] = runStabilityCell(cells[i], options.quick);
    const std::lock_guard lock(mutex);
    if (options.progress) options.progress(++done, cells.size());
  };
  tbb::task_arena arena(options.threads == 0 ? tbb::task_arena::automatic : int(options.threads));
  arena.execute([&] { tbb::parallel_for(std::size_t(0), cells.size(), work); });
  return results;
}

ordered_json stabilityJson(const std::vector<StabilityResult>& results, const StabilityOptions& options, bool all) {
  const auto number = [](double value) {
    return std::isfinite(value) ? ordered_json(value) : ordered_json("infinite");
  };
  const auto entry = [&](const StabilityResult& r) {
    ordered_json cell;
    for (std::size_t f = 0; f < r.cell.size(); ++f) {
      cell[std::string(nameOf(StabilityFactor(f)))] = levelsOf(StabilityFactor(f))[r.cell[f]];
    }
    return ordered_json{{"cell", cell},
                        {"passed", r.passed()},
                        {"cause", r.cause()},
                        {"worst", number(r.worst())},
                        {"finite", r.finite},
                        {"momentum", number(r.momentum)},
                        {"energy", number(r.energy)},
                        {"shape", number(r.shape)},
                        {"contained", number(r.contained)},
                        {"rest_error_diagonals", number(r.rest_error)},
                        {"seconds", r.seconds}};
  };
  std::vector<const StabilityResult*> order;
  std::map<std::string, std::size_t> causes;
  std::size_t failed = 0;
  double seconds = 0;
  for (const StabilityResult& r : results) {
    order.push_back(&r);
    seconds += r.seconds;
    if (r.passed()) continue;
    ++failed;
    ++causes[std::string(r.cause())];
  }
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) { return a->worst() > b->worst(); });
  ordered_json json;
  json["study"] = "stability";
  json["design"] = options.chance > 0 ? "chance, seed " + std::to_string(options.seed)
                   : options.quick    ? "pairs"
                                      : "triples and start x step x stiffness x mode";
  json["cells"] = results.size();
  json["failed"] = failed;
  json["failed_by_cause"] = causes;
  json["seconds"] = seconds;
  ordered_json worst = ordered_json::array();
  for (std::size_t i = 0; i < std::min<std::size_t>(order.size(), 10); ++i) worst.push_back(entry(*order[i]));
  json["worst"] = worst;
  if (all) {
    ordered_json cells = ordered_json::array();
    for (const StabilityResult& r : results) cells.push_back(entry(r));
    json["results"] = cells;
  }
  return json;
}

std::string stabilityText(const std::vector<StabilityResult>& results) {
  std::ostringstream text;
  char line[256];
  std::size_t failed = 0;
  double seconds = 0;
  for (const StabilityResult& r : results) {
    failed += r.passed() ? 0U : 1U;
    seconds += r.seconds;
  }
  for (std::size_t f = 0; f < kStabilityFactorCount; ++f) {
    const std::vector<std::string> levels = levelsOf(StabilityFactor(f));
    std::snprintf(line, sizeof line, "%-14s %6s %6s  %8s  %s\n", std::string(nameOf(StabilityFactor(f))).c_str(),
                  "cells", "failed", "worst", "by cause");
    text << line;
    for (std::size_t level = 0; level < levels.size(); ++level) {
      std::size_t cells = 0, bad = 0;
      double worst = 0;
      std::map<std::string, std::size_t> causes;
      for (const StabilityResult& r : results) {
        if (r.cell[f] != level) continue;
        ++cells;
        worst = std::max(worst, r.worst());
        if (r.passed()) continue;
        ++bad;
        ++causes[std::string(r.cause())];
      }
      std::string by_cause;
      for (const auto& [cause, count] : causes) by_cause += " " + cause + " " + std::to_string(count);
      std::snprintf(line, sizeof line, "  %-12s %6zu %6zu  %8.2g %s\n", levels[level].c_str(), cells, bad, worst,
                    by_cause.c_str());
      text << line;
    }
  }
  std::vector<const StabilityResult*> order;
  for (const StabilityResult& r : results) order.push_back(&r);
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) { return a->worst() > b->worst(); });
  text << "worst cells (ratio to the limit)\n";
  for (std::size_t i = 0; i < std::min<std::size_t>(order.size(), 10); ++i) {
    std::snprintf(line, sizeof line, "  %8.3g %-9s ", order[i]->worst(), std::string(order[i]->cause()).c_str());
    text << line << textOf(order[i]->cell) << "\n";
  }
  std::snprintf(line, sizeof line, "%zu cells, %zu failed, %.0f s\n", results.size(), failed, seconds);
  text << line;
  return text.str();
}

Image stabilityPicture(const std::vector<StabilityResult>& results) {
  const std::vector<std::string> rows = levelsOf(StabilityFactor::start);
  struct Column {
    std::size_t factor, level;
    std::string label;
  };
  std::vector<Column> columns;
  constexpr int kCell = 22, kLeft = 120, kTop = 128, kGap = 10, kRight = 50;
  for (std::size_t f = 1; f < kStabilityFactorCount; ++f) {
    const std::vector<std::string> levels = levelsOf(StabilityFactor(f));
    for (std::size_t level = 0; level < levels.size(); ++level) columns.push_back({f, level, levels[level]});
  }
  const int width = kLeft + int(columns.size()) * kCell + int(kStabilityFactorCount) * kGap + kRight;
  const int height = kTop + int(rows.size()) * kCell + 60;
  Image image(width, height);
  const Rgb8 ink = {40, 44, 52};
  // Share of cells that fail: green for none, then yellow at 1 % to red at 30 %.
  const auto color_of = [](double share) -> Rgb8 {
    if (share == 0) return {150, 205, 150};
    const double t = std::clamp(std::log(share / 0.01) / std::log(30.0), 0.0, 1.0);
    return {std::uint8_t(std::lround(250 - 70 * t)), std::uint8_t(std::lround(220 * (1 - t) + 30 * t)),
            std::uint8_t(std::lround(90 - 60 * t))};
  };
  for (std::size_t row = 0; row < rows.size(); ++row) {
    drawText(image, 8, float(kTop + int(row) * kCell + 4), 14, ink, rows[row]);
  }
  int x = kLeft;
  std::size_t factor = 0;
  for (const Column& column : columns) {
    if (column.factor != factor) {
      if (factor != 0) x += kGap;
      factor = column.factor;
      drawText(image, float(x), 8, 15, ink, nameOf(StabilityFactor(factor)));
    }
    // Labels stand upright: drawn to a strip, then turned by a quarter.
    Image strip(96, 16);
    drawText(strip, 2, 1, 13, ink, column.label);
    for (int i = 0; i < strip.width; ++i) {
      for (int j = 0; j < strip.height; ++j) {
        image.blend(x + 3 + j, kTop - 4 - i, strip.at(i, j), 1);
      }
    }
    for (std::size_t row = 0; row < rows.size(); ++row) {
      std::size_t count = 0, bad = 0;
      for (const StabilityResult& r : results) {
        if (r.cell[0] != row || r.cell[column.factor] != column.level) continue;
        ++count;
        bad += r.passed() ? 0U : 1U;
      }
      const int y = kTop + int(row) * kCell;
      if (count > 0) image.fillRectangle(x, y, kCell - 2, kCell - 2, color_of(double(bad) / double(count)));
    }
    x += kCell;
  }
  std::size_t failed = 0;
  for (const StabilityResult& r : results) failed += r.passed() ? 0U : 1U;
  const int legend = kTop + int(rows.size()) * kCell + 16;
  const std::array<std::pair<double, const char*>, 5> shown = {
      {{0, "none"}, {0.01, "1 %"}, {0.05, "5 %"}, {0.1, "10 %"}, {0.3, "30 %"}}};
  int at = kLeft;
  drawText(image, 8, float(legend), 14, ink, "share failing");
  for (const auto& [value, label] : shown) {
    image.fillRectangle(at, legend, kCell - 2, kCell - 2, color_of(value));
    drawText(image, float(at + kCell + 2), float(legend + 2), 14, ink, label);
    at += 110;
  }
  drawText(image, float(at), float(legend + 2), 14, ink,
           std::to_string(results.size()) + " cells, " + std::to_string(failed) + " failed");
  return image;
}

}  // namespace sinew::tools
