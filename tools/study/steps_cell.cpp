// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "runtime/geometry/smoothstep.h"
#include "tools/study/packages.h"
#include "tools/study/steps.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::array kMetresAway = {0.0, 1e3, 4e3, 1e4};
// A direction (unit) in which all three coordinates grow: each is rounded.
const Vector3d kAway(0.48, 0.6, 0.64);

constexpr double kSoftHz = 0.5, kStiffHz = 100;
constexpr double kLeastHz = 0.1;  // a body without stiffness is waited for as one of that

// How long a cell runs, s.
constexpr double kRestSeconds = 5, kTumbleSeconds = 10, kReturnSeconds = 3, kSettleSeconds = 20, kWatchSeconds = 2;
constexpr double kPeriods = 10;
constexpr double kMoveSeconds = 1, kHandledSeconds = 4, kAirSeconds = 3;
constexpr float kAir = 5;  // 1/s

constexpr double kSpin = 3;  // rad/s
const Vector3d kSpinAxis(1.0 / 3, 2.0 / 3, 2.0 / 3);
constexpr double kScatter = 0.3;  // diagonals
constexpr double kSlope = 0.3;    // tangent
constexpr float kSlopeFriction = 0.5F;
constexpr double kHeldPart = 0.1;                    // of the height
constexpr double kMovedWay = 0.5, kMovedTurn = 0.5;  // diagonals, rad
constexpr double kEventSeconds = 0.1;
constexpr double kGrasp = 0.05;                  // of the vertices
constexpr double kPullWay = 0.3, kPinWay = 0.1;  // diagonals

Vector3d wideOf(const Vec3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }
Vec3 narrow(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }
Mat3 narrow(const Matrix3d& m) {
  Mat3 result;
  Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(result.data()) = m.cast<float>();
  return result;
}

// The lowest frequency that the package's clusters are authored with.
double authoredHz(const formats::PackageView& package) {
  double hz = std::numeric_limits<double>::infinity();
  for (const formats::Cluster& cluster : package.clusters()) {
    if (cluster.mode != formats::ClusterMode::rigid) hz = std::min(hz, double(cluster.stretch_hz));
  }
  return std::isfinite(hz) ? hz : kStiffHz;  // all rigid
}

bool isFree(StepsScene scene) { return scene < StepsScene::stand; }

class CellRun {
 public:
  CellRun(const StepsCell& cell, const std::vector<StepsBody>& bodies)
      : scene_(StepsScene(cell[4])),
        sequence_(StepsSequence(cell[2])),
        seed_(((std::uint64_t(cell[0]) * 256 + cell[1]) * 256 + cell[2]) * 65536 + std::uint64_t(cell[3]) * 256 +
              cell[4]),
        asset_(bodies[cell[0]].asset),
        package_(asset_->package()),
        diagonal_(double(package_.info().diagonal)),
        lengths_(sequence_, seed_),
        place_(kMetresAway[cell[3]] * kAway) {
    const double authored = authoredHz(package_);
    hz_ = std::max(kLeastHz, authored);
    if (StepsMaterial(cell[1]) != StepsMaterial::usual) {
      hz_ = StepsMaterial(cell[1]) == StepsMaterial::soft ? kSoftHz : kStiffHz;
      body_settings_.stiffness_scale = authored > 0 ? float(hz_ / authored) : 1;
    }
    body_settings_.package_pins = false;
    body_settings_.solver = bodies[cell[0]].solver;
    prepare();
  }

  std::vector<StepsFinding> run() {
    switch (scene_) {
      case StepsScene::stand:
      case StepsScene::slope:
      case StepsScene::hang:
      case StepsScene::move:
        settle();
        break;
      case StepsScene::handled:
        handle();
        break;
      default:
        followFree(scene_ == StepsScene::rest     ? kRestSeconds
                   : scene_ == StepsScene::tumble ? kTumbleSeconds
                                                  : returnSeconds());
    }
    if (lost_ > 0) return {{StepsCriterion::finite, double(lost_), 0}};
    findings_.insert(findings_.begin(), {StepsCriterion::finite, 0, 0});
    return findings_;
  }

  LongRun runLong(std::uint32_t minutes) {
    LongRun result;
    std::vector<Vec3> before(state().positions.begin(), state().positions.end());
    for (std::uint32_t minute = 0; minute < minutes && lost_ == 0; ++minute) {
      LongRun::Minute entry;
      advance(
          59, [](double) {}, [](double) {});
      advance(
          1, [](double) {},
          [&](double) {
            for (const PartMotion& part : motionOf(package_, state())) {
              entry.speed = std::max(entry.speed, part.speed() / diagonal_);
            }
          });
      if (lost_ > 0) break;
      double mass = 0, sum = 0;
      Vector3d way = Vector3d::Zero();
      for (std::size_t v = 0; v < before.size(); ++v) {
        const auto m = double(package_.physicalVertices()[v].mass);
        const Vector3d moved = wideOf(state().positions[v]) - wideOf(before[v]);
        mass += m;
        way += m * moved;
        sum += m * moved.squaredNorm();
      }
      entry.drift = way.norm() / mass / diagonal_;
      entry.moved = std::sqrt(sum / mass) / diagonal_;
      result.minutes.push_back(entry);
      before.assign(state().positions.begin(), state().positions.end());
    }
    result.finite = lost_ == 0;
    return result;
  }

 private:
  BodyState state() const { return stateOf(world_, body_); }
  double returnSeconds() const { return kReturnSeconds + kPeriods / hz_; }

  void add(const Vector3d& position, const Matrix3d& rotation) {
    body_settings_.position = narrow(position);
    body_settings_.rotation = narrow(rotation);
    const auto added = world_.addBody(asset_, body_settings_);
    // Only a want of memory, or of kernels for this processor, can be the reason.
    if (!added) throw std::runtime_error(added.reason());
    body_ = *added;
  }

  std::vector<Vec3> drawn() const {
    std::vector<Vec3> points(package_.visualPositions().size());
    if (!points.empty()) {
      world_.visualVertices(body_, {points[0].data(), sizeof(Vec3), std::uint32_t(points.size())}, {});
    }
    return points;
  }

  void prepare() {
    WorldSettings& settings = world_.settings();
    if (isFree(scene_) || scene_ == StepsScene::handled) {
      settings.gravity = {0, 0, 0};
      settings.damping = 0;
    }
    if (isFree(scene_) && scene_ != StepsScene::rest) {
      // The state is made at the origin, and goes to its place as a whole: rounded there it would be another shape.
      add(Vector3d::Zero(), Matrix3d::Identity());
      setStart();
      if (!place_.isZero()) world_.teleport(body_, narrow(Matrix3d(Matrix3d::Identity())), narrow(place_));
      return;
    }
    Matrix3d rotation = Matrix3d::Identity();
    if (scene_ == StepsScene::slope) rotation = Eigen::AngleAxisd(std::atan(kSlope), Vector3d::UnitZ());
    if (scene_ == StepsScene::hang || scene_ == StepsScene::move) rotation = upright();
    add(place_, rotation);
    if (scene_ == StepsScene::stand || scene_ == StepsScene::slope) {
      GroundPlane& ground = settings.ground;
      ground.enabled = true;
      if (scene_ == StepsScene::slope) {
        ground.normal = narrow(Vector3d(rotation * Vector3d::UnitY()));
        ground.friction = kSlopeFriction;
      }
      const double lowest =
          std::min(lowestAlong(state().positions, ground.normal), lowestAlong(drawn(), ground.normal));
      ground.offset = std::nextafter(float(lowest), -std::numeric_limits<float>::infinity());
    }
    if (scene_ == StepsScene::hang || scene_ == StepsScene::move) hold();
  }

  // Turns the longest axis to y.
  Matrix3d upright() const {
    Eigen::AlignedBox3d box;
    for (const auto& vertex : package_.physicalVertices()) box.extend(wideOf(vertex.rest_position));
    Matrix3d rotation = Matrix3d::Identity();
    const Vector3d size = box.sizes();
    if (size[0] > size[1] && size[0] >= size[2]) {
      rotation << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    } else if (size[2] > size[1]) {
      rotation << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    }
    return rotation;
  }

  // By the upper end of each part.
  void hold() {
    std::vector<std::uint32_t> held;
    const auto x = state().positions;
    held_at_.position = {0, 0, 0};
    for (const formats::PieceRange& part : package_.pieces()) {
      const auto own = x.subspan(part.first_vertex, part.vertex_count);
      const auto lower = [](const Vec3& one, const Vec3& other) { return one[1] < other[1]; };
      const auto [low, high] = std::minmax_element(own.begin(), own.end(), lower);
      const double level = double((*high)[1]) - kHeldPart * (double((*high)[1]) - double((*low)[1]));
      for (std::uint32_t v = part.first_vertex; v < part.first_vertex + part.vertex_count; ++v) {
        if (double(x[v][1]) >= level) held.push_back(v);
      }
    }
    Vector3d centre = Vector3d::Zero();
    for (const std::uint32_t v : held) centre += wideOf(x[v]) / double(held.size());
    held_at_.position = narrow(centre);
    const auto set = world_.addPinSet(body_, held, held_at_);
    if (!set) throw std::runtime_error(set.reason());
    set_ = *set;
  }

  void setStart() {
    std::vector<Vec3> x(state().positions.begin(), state().positions.end()), v(x.size(), Vec3{0, 0, 0});
    for (const formats::PieceRange& part : package_.pieces()) {
      // Each part by itself: parts do not act on one another.
      Vector3d centre = Vector3d::Zero();
      Eigen::AlignedBox3d box;
      double mass = 0, extent = 0;
      const std::uint32_t end = part.first_vertex + part.vertex_count;
      for (std::uint32_t i = part.first_vertex; i < end; ++i) {
        const auto m = double(package_.physicalVertices()[i].mass);
        mass += m;
        centre += m * wideOf(x[i]);
        box.extend(wideOf(x[i]));
      }
      centre /= mass;
      const double diagonal = box.sizes().norm();
      for (std::uint32_t i = part.first_vertex; i < end; ++i) {
        extent = std::max(extent, (wideOf(x[i]) - centre).norm());
      }
      for (std::uint32_t i = part.first_vertex; i < end; ++i) {
        const Vector3d d = wideOf(x[i]) - centre;
        v[i] = scene_ == StepsScene::tumble ? narrow(Vector3d(kSpin * kSpinAxis.cross(d))) : Vec3{0, 0, 0};
        if (scene_ != StepsScene::tumble) x[i] = narrow(Vector3d(centre + startOf(d, extent, diagonal, i)));
      }
    }
    world_.setState(body_, x, v);
  }

  Vector3d startOf(const Vector3d& d, double extent, double diagonal, std::uint32_t vertex) const {
    switch (scene_) {
      case StepsScene::scattered:
        return d + kScatter * diagonal * direction(vertex);
      case StepsScene::mirrored:
        return {-d[0], d[1], d[2]};
      case StepsScene::inside_out:
        return d.norm() > 0 ? Vector3d(d.normalized() * (d.norm() - extent)) : d;
      case StepsScene::flat:
        return {d[0], 0, d[2]};
      case StepsScene::line:
        return {d[0], 0, 0};
      case StepsScene::point:
        return Vector3d::Zero();
      default:
        return d;
    }
  }

  // Evenly over the sphere.
  Vector3d direction(std::uint64_t index) const {
    const double z = 2 * chance(seed_, 2 * index) - 1, turn = 2 * std::numbers::pi * chance(seed_, 2 * index + 1);
    const double r = std::sqrt(1 - z * z);
    return {r * std::cos(turn), r * std::sin(turn), z};
  }

  // Steps until so much time has passed. \param before is called with the time at the end of the step that comes, from
  // the beginning of this call; \param after with the length of the step that was.
  template <class Before, class After>
  void advance(double seconds, const Before& before, const After& after) {
    for (double time = 0; time < seconds;) {
      const float h = lengths_.next();
      before(time + double(h));
      world_.step(h);
      time += double(h);
      lost_ = notFinite(state()) + world_.repairedVertices(body_);
      if (lost_ > 0) return;
      after(double(h));
    }
  }

  void followFree(double seconds) {
    BodyEnergy energy = energyOf(world_, body_, body_settings_.solver == nullptr);
    if (scene_ == StepsScene::tumble) energy.elastic = energy.elastic.value_or(0);  // it is not deformed
    FreeJudge judge(package_, state(), energy, scene_ != StepsScene::rest);
    advance(
        seconds, [](double) {}, [&](double h) { judge.observe(state(), h); });
    if (lost_ > 0) return;
    findings_ = judge.findings();
    // Turning stretches a body.
    if (scene_ != StepsScene::tumble) findings_.push_back(shapeOf(package_, state().positions));
  }

  void settle() {
    if (scene_ == StepsScene::move) {
      advance(
          kMoveSeconds, [&](double time) { move(time); }, [](double) {});
      if (lost_ > 0) return;
      move(kMoveSeconds);
    }
    advance(
        kSettleSeconds + kPeriods / hz_, [](double) {}, [](double) {});
    if (lost_ > 0) return;
    std::optional<Vec3> slope;
    if (scene_ == StepsScene::slope) slope = world_.settings().ground.normal;
    RestJudge judge(package_, state(), sequence_ == StepsSequence::constant ? kSteadyRestSpeed : kRestSpeed, slope);
    advance(
        kWatchSeconds, [](double) {}, [&](double h) { judge.observe(state(), h); });
    if (lost_ > 0) return;
    findings_ = judge.findings();
    if (world_.settings().ground.enabled) {
      findings_.push_back(
          groundOf(package_, state().positions, hungPlaces(package_, state().positions), world_.settings().ground));
    }
  }

  // Moves the pin set to where it is at a time: smoothly sideways and about the vertical.
  void move(double time) {
    const double part = geometry::smoothstep(time / kMoveSeconds);
    RigidTransform to;
    to.position = narrow(Vector3d(wideOf(held_at_.position) + part * kMovedWay * diagonal_ * Vector3d::UnitX()));
    to.rotation = narrow(Eigen::AngleAxisd(part * kMovedTurn, Vector3d::UnitY()).toRotationMatrix());
    world_.movePinSet(set_, to);
  }

  void handle() {
    std::uint64_t events = 0;
    double event_time = 0;
    advance(
        kHandledSeconds,
        [&](double time) {
          for (; event_time < time; event_time += 2 * kEventSeconds * chance(seed_ + 1, events)) happen(++events);
        },
        [](double) {});
    if (lost_ > 0) return;
    world_.unpinAll(body_);
    for (const PickId pick : picks_) world_.releasePick(pick);
    world_.settings().damping = kAir;
    advance(
        kAirSeconds, [](double) {}, [](double) {});
    world_.settings().damping = 0;
    if (lost_ > 0) return;
    followFree(returnSeconds());
  }

  // Something by chance that a hand, a script or a level does to a body.
  void happen(std::uint64_t event) {
    const auto draw = [&](std::uint64_t index) { return chance(seed_ + 2, 16 * event + index); };
    const auto upTo = [&](std::uint64_t index, std::size_t count) {
      return std::min(std::size_t(draw(index) * double(count)), count - 1);
    };
    const auto x = state().positions;
    const Vector3d way = diagonal_ * draw(1) * direction(1000 + event);
    const auto vertex = std::uint32_t(upTo(2, x.size()));
    switch (upTo(0, 6)) {
      case 0: {
        std::vector<std::uint32_t> near(x.size());
        std::iota(near.begin(), near.end(), 0U);
        const auto rest = package_.physicalVertices();
        const auto away = [&](std::uint32_t v) {
          return (wideOf(rest[v].rest_position) - wideOf(rest[vertex].rest_position)).squaredNorm();
        };
        std::sort(near.begin(), near.end(),
                  [&](auto a, auto b) { return std::pair(away(a), a) < std::pair(away(b), b); });
        near.resize(std::max<std::size_t>(1, std::size_t(kGrasp * double(near.size()))));
        const RigidTransform at{.position = x[vertex]};
        // Refused where it shares a vertex with another: then nothing happens.
        const auto set = world_.addPinSet(body_, near, at, PinMethod(upTo(3, 4)));
        if (set) sets_.emplace_back(*set, at);
        break;
      }
      case 1: {
        if (sets_.empty()) break;
        auto& [set, at] = sets_[upTo(3, sets_.size())];
        at.position = narrow(Vector3d(wideOf(at.position) + kPullWay * way));
        at.rotation = narrow(Eigen::AngleAxisd(kMovedTurn * draw(4), direction(2000 + event)).toRotationMatrix());
        world_.movePinSet(set, at);
        break;
      }
      case 2: {
        if (sets_.empty()) break;
        const std::size_t which = upTo(3, sets_.size());
        world_.removePinSet(sets_[which].first);
        sets_.erase(sets_.begin() + std::ptrdiff_t(which));
        break;
      }
      case 3: {
        const std::vector<Vec3> points = drawn();
        if (points.empty()) break;
        const std::size_t v = upTo(2, points.size());
        picks_.push_back(world_.pick(body_, std::uint32_t(v), narrow(Vector3d(wideOf(points[v]) + kPullWay * way))));
        break;
      }
      case 4: {
        if (picks_.empty()) break;
        const std::size_t which = upTo(3, picks_.size());
        world_.releasePick(picks_[which]);
        picks_.erase(picks_.begin() + std::ptrdiff_t(which));
        break;
      }
      default: {
        if (pinned_.size() > 2) {
          world_.unpin(body_, pinned_.front());
          pinned_.erase(pinned_.begin());
          break;
        }
        world_.pin(body_, vertex, narrow(Vector3d(wideOf(x[vertex]) + kPinWay * way)));
        pinned_.push_back(vertex);
      }
    }
  }

  StepsScene scene_;
  StepsSequence sequence_;
  std::uint64_t seed_;
  std::shared_ptr<const Asset> asset_;
  const formats::PackageView& package_;
  double diagonal_, hz_ = 1;
  StepLengths lengths_;
  Vector3d place_;
  BodySettings body_settings_;
  World world_;
  BodyId body_;
  PinSetId set_;
  RigidTransform held_at_;
  std::vector<std::pair<PinSetId, RigidTransform>> sets_;
  std::vector<PickId> picks_;
  std::vector<std::uint32_t> pinned_;
  std::uint32_t lost_ = 0;
  std::vector<StepsFinding> findings_;
};

}  // namespace

float StepLengths::next() {
  const std::uint64_t n = count_++;
  const auto between = [&](double low, double high) { return float(low * std::pow(high / low, chance(seed_, n))); };
  switch (sequence_) {
    case StepsSequence::constant:
      return 1.0F / 60;
    case StepsSequence::alternating:
      return n % 2 == 0 ? 1.0F / 60 : 1.0F / 240;
    case StepsSequence::alternating_far:
      return n % 2 == 0 ? 0.05F : 0.001F;
    case StepsSequence::jitter:
      return between(0.005, 0.05);
    case StepsSequence::hitch:
      return n % 31 == 30 ? 0.5F : 1.0F / 60;
    case StepsSequence::slow_frame:
      return n % 59 == 58 ? 1.0F / 30 : 1.0F / 60;
    case StepsSequence::random:
      return between(1e-5, 1);
  }
  return 1.0F / 60;
}

StepsResult runStepsCell(const StepsCell& cell, const std::vector<StepsBody>& bodies) {
  const auto start = std::chrono::steady_clock::now();
  StepsResult result;
  result.cell = cell;
  result.findings = CellRun(cell, bodies).run();
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return result;
}

LongRun runLongCell(const StepsCell& cell, const std::vector<StepsBody>& bodies, std::uint32_t minutes) {
  LongRun run = CellRun(cell, bodies).runLong(minutes);
  run.cell = cell;
  return run;
}

}  // namespace sinew::tools
