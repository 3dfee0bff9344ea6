// SPDX-License-Identifier: MIT
#include "sinew/runtime/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <string>
#include <vector>

#include "runtime/attach/cluster_frames.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/kernels/kernels.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;

World::Impl::Impl(const WorldSettings& world_settings, const WorldResources& resources)
    : settings(world_settings),
      memory(resources.memory != nullptr ? resources.memory : std::pmr::get_default_resource()),
      jobs(resources.jobs),
      log(resources.log),
      bodies(memory),
      step_scratch(memory),
      together(memory),
      ground(kGroundCollider.value, PlaneShape{}, {}, memory),
      colliders(memory),
      met(memory),
      events(memory),
      contact_sums(memory),
      contacts(memory),
      touched(memory),
      touching(memory),
      touching_before(memory),
      visual(memory) {}

std::pair<Body*, std::size_t> World::Impl::locate(BodyId id) const {
  const auto comes_before = [](const internal::BodyPointer& body, std::uint32_t value) { return body->id < value; };
  const auto place = std::lower_bound(bodies.begin(), bodies.end(), id.value, comes_before);
  const bool there = place != bodies.end() && (*place)->id == id.value;
  return {there ? place->get() : nullptr, std::size_t(place - bodies.begin())};
}

namespace {

// Calls of a kind are counted in bits of their own of World::Impl::present.
constexpr int kCountBits = 12;
constexpr std::uint64_t kCount = (std::uint64_t(1) << kCountBits) - 1;
struct Kind {
  const char* does;
  std::uint64_t one, all;
};
constexpr Kind kind(const char* does, int number) {
  return {does, std::uint64_t(1) << (kCountBits * number), kCount << (kCountBits * number)};
}
// By World::Impl::As.
constexpr Kind kKinds[] = {kind("reads", 0), kind("draws", 1), kind("reads", 2), kind("changes", 3), kind("steps", 4)};
constexpr std::uint64_t kAlone = kKinds[3].all | kKinds[4].all, kAny = ~std::uint64_t(0);
// Of those who are there: whom a call must not meet, by As.
constexpr std::uint64_t kMustNotMeet[] = {kAlone, kAlone | kKinds[2].all, kAlone | kKinds[1].all, kAny, kAny};

// The world whose call this thread is in, which lends its presence.
thread_local const void* lent = nullptr;

}  // namespace

World::Impl::Presence::Presence(const Impl& impl, const char* call, As as) : impl_(impl), call_(call), as_(as) {
  if (lent == &impl) {
    entered_ = true;
    return;
  }
  std::uint64_t there = impl.present.load(std::memory_order_relaxed);
  do {
    for (const Kind& one : kKinds) {
      if ((there & kMustNotMeet[std::size_t(as)] & one.all) != 0) met_ = one.does;
    }
    if (met_ != nullptr) {
      impl.tell(LogSeverity::error,
                "%s: another thread %s this world; nothing was done. Calls on a world must not overlap", call, met_);
      return;
    }
  } while (!impl.present.compare_exchange_weak(there, there + kKinds[std::size_t(as)].one, std::memory_order_acq_rel,
                                               std::memory_order_relaxed));
  entered_ = owns_ = true;
}

World::Impl::Presence::~Presence() {
  if (lends_) lent = lent_before_;
  if (owns_) impl_.present.fetch_sub(kKinds[std::size_t(as_)].one, std::memory_order_release);
}

Error World::Impl::Presence::refusal() const {
  return Error{std::string(call_) + ": another thread " + met_ + " this world"};
}

void World::Impl::Presence::lend() {
  lent_before_ = lent;
  lent = &impl_;
  lends_ = true;
}

Body* World::Impl::Presence::find(BodyId id) const {
  if (!entered_) return nullptr;
  Body* body = impl_.find(id);
  if (body == nullptr) impl_.tell(LogSeverity::error, "%s: there is no body %u in this world", call_, id.value);
  return body;
}

Body* World::Impl::Presence::seen(BodyId id) const {
  Body* body = find(id);
  if (body != nullptr) as_ == As::draws ? impl_.showDrawn(*body) : impl_.showLast(*body);
  return body;
}

std::pair<Body*, std::size_t> World::Impl::Presence::find(PickId id) const {
  if (!entered_) return {nullptr, 0};
  const auto found = impl_.findPick(id);
  if (found.first == nullptr) impl_.tell(LogSeverity::error, "%s: there is no such pick", call_);
  return found;
}

std::pair<Body*, std::size_t> World::Impl::Presence::find(PinSetId id) const {
  if (!entered_) return {nullptr, 0};
  const auto found = impl_.findPinSet(id);
  if (found.first == nullptr) impl_.tell(LogSeverity::error, "%s: there is no such pin set", call_);
  return found;
}

internal::Collider* World::Impl::Presence::find(ColliderId id) const {
  if (!entered_) return nullptr;
  internal::Collider* const collider = const_cast<Impl&>(impl_).locate(id).first;
  if (collider == nullptr) {
    impl_.tell(LogSeverity::error, "%s: there is no collider %u in this world", call_, id.value);
  }
  return collider;
}

void World::Impl::holdsChanged(Body& body) {
  internal::wake(bodies, body);
  body.solver->holdsChanged();
}

bool internal::isProper(const Mat3& rotation) {
  const Matrix3 m = Eigen::Map<const Matrix3>(rotation.data()), product = m * m.transpose();
  float off2 = 0;
  for (int k = 0; k < 9; ++k) {
    const float off = product.data()[k] - (k % 4 == 0 ? 1.0F : 0.0F);
    off2 += off * off;
  }
  return off2 < 1e-6F && determinantOf(m) > 0;
}

bool internal::isProper(const RigidTransform& transform) {
  return stateIsUsable(transform.position, {}) && isProper(transform.rotation);
}

void World::Impl::tell(LogSeverity severity, const char* format, ...) const {
  if (log == nullptr) return;
  char line[256];
  std::va_list arguments;
  va_start(arguments, format);
  const int length = std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  if (length <= 0) return;
  try {
    log->write(severity, {line, std::min(std::size_t(length), sizeof line - 1)});
  } catch (...) {  // there is nobody left to tell
  }
}

Error World::Impl::refuse(const char* format, ...) const {
  char line[256];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line, sizeof line, format, arguments);
  va_end(arguments);
  tell(LogSeverity::error, "%s", line);
  return Error{line};
}

namespace {

// Whether a body may be at a place, or be pulled there.
bool usable(const Vec3& place) { return internal::stateIsUsable(place, {}); }

// Events a body that a step has room for from the start.
constexpr std::size_t kEvents = 4;

// s, where floats round the fall of a step, g h^2, by the margin of contacts: 2 mm.
constexpr float kLongestStep = 60;

// Whether what rests under some settings rests under others.
bool actsAlike(const WorldSettings& a, const WorldSettings& b) {
  const GroundPlane &one = a.ground, &other = b.ground;
  const bool same_ground = one.enabled == other.enabled && one.normal == other.normal && one.offset == other.offset &&
                           one.friction == other.friction && one.restitution == other.restitution;
  return a.gravity == b.gravity && a.wind == b.wind && a.air_density == b.air_density && same_ground &&
         a.collisions == b.collisions && (a.sleep_seconds > 0) == (b.sleep_seconds > 0);
}

// Settings with every value in range, and a text for each value that was replaced.
struct CheckedSettings {
  WorldSettings settings;
  std::uint32_t wrong = 0;     // a bit each
  const char* name = nullptr;  // of the first one that is wrong
};

CheckedSettings checked(const WorldSettings& given) {
  CheckedSettings result = {given, 0, nullptr};
  std::uint32_t bit = 1;
  const auto check = [&](const char* name, bool sound, auto& value, const auto& instead) {
    if (!sound) {
      value = instead;
      result.wrong |= bit;
      if (result.name == nullptr) result.name = name;
    }
    bit <<= 1;
  };
  WorldSettings& s = result.settings;
  const auto in_range = [&](const char* name, float& value) {
    const float instead = value > 0 ? 1e4F : 0.0F;  // not a number: 0
    check(name, value >= 0 && value <= 1e4F, value, instead);
  };
  check("gravity", usable(s.gravity), s.gravity, Vec3{0, 0, 0});
  check("iterations", s.iterations >= 1 && s.iterations <= 16, s.iterations, std::clamp(s.iterations, 1U, 16U));
  in_range("damping", s.damping);
  const float ratio = s.deformation_damping_ratio;
  check("deformation_damping_ratio", ratio >= 0 && ratio <= 1, s.deformation_damping_ratio, ratio > 1 ? 1.0F : 0.0F);
  in_range("support_damping", s.support_damping);
  in_range("ground.friction", s.ground.friction);
  const float bounce = s.ground.restitution;
  check("ground.restitution", bounce >= 0 && bounce <= 1, s.ground.restitution, bounce > 1 ? 1.0F : 0.0F);
  in_range("sleep_seconds", s.sleep_seconds);
  check("wind", usable(s.wind), s.wind, Vec3{0, 0, 0});
  in_range("air_density", s.air_density);
  const float substep = s.substep_seconds > 1 ? 1.0F : 1e-5F;
  check("substep_seconds", s.substep_seconds >= 1e-5F && s.substep_seconds <= 1, s.substep_seconds, substep);
  check("most_substeps", s.most_substeps >= 1 && s.most_substeps <= 1000, s.most_substeps,
        std::clamp(s.most_substeps, 1U, 1000U));
  if (s.ground.enabled) {
    const float length = asVector(s.ground.normal).norm();
    check("ground.normal", std::abs(length - 1.0F) < 1e-3F && std::isfinite(s.ground.offset), s.ground.enabled, false);
  }
  return result;
}

}  // namespace

void World::Release::operator()(Impl* impl) const {
  std::pmr::memory_resource* memory = impl->memory;
  impl->~Impl();
  memory->deallocate(impl, sizeof(Impl), alignof(Impl));
}

World::World(const WorldSettings& settings, const WorldResources& resources) {
  std::pmr::memory_resource* memory = resources.memory != nullptr ? resources.memory : std::pmr::get_default_resource();
  void* place = memory->allocate(sizeof(Impl), alignof(Impl));
  try {
    impl_.reset(new (place) Impl(settings, resources));
  } catch (...) {
    memory->deallocate(place, sizeof(Impl), alignof(Impl));
    throw;
  }
}
World::World(const WorldSettings& settings, JobSystem* jobs)
    : World(settings, WorldResources{nullptr, jobs, nullptr}) {}
Result<World> World::create(const WorldSettings& settings, const WorldResources& resources) noexcept {
  try {
    if (const char* value = internal::faultyValue(settings)) {
      return Error{std::string("create: WorldSettings::") + value + " is out of range"};
    }
    return World(settings, resources);
  } catch (...) {
    return Error{"out of memory"};  // short enough to lie in the string itself
  }
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

WorldSettings& World::settings() { return impl_->settings; }
const WorldSettings& World::settings() const { return impl_->settings; }

const char* internal::faultyValue(const WorldSettings& settings) { return checked(settings).name; }

const char* internal::faultOf(const BodySettings& settings) {
  if (!(settings.friction <= 1e4F)) return "BodySettings::friction must be at most 1e4";
  if (!(std::abs(settings.gravity_scale) <= 1e4F)) return "BodySettings::gravity_scale must be -1e4 to 1e4";
  if (!(settings.drag >= 0 && settings.drag <= 1e4F)) return "BodySettings::drag must be 0 to 1e4";
  if (!(settings.support_damping <= 1e4F)) return "BodySettings::support_damping must be at most 1e4";
  return nullptr;
}

namespace {

// Why a body cannot be added; null if it can.
const char* faultOf(const Asset* asset, const BodySettings& settings) {
  if (asset == nullptr) return "addBody: no asset";
  if (!internal::kernelsRun()) return "addBody: this build has no kernels for this processor";
  if (!usable(settings.position)) return "addBody: BodySettings::position is not finite, or beyond 1e15 m";
  if (!internal::isProper(settings.rotation)) return "addBody: BodySettings::rotation is not a proper rotation";
  if (!(settings.stiffness_scale >= 0 && settings.stiffness_scale <= 1e6F)) {
    return "addBody: BodySettings::stiffness_scale must be 0 to 1e6";
  }
  return nullptr;
}

const SolverFactory& solverOf(const BodySettings& settings) {
  return settings.solver != nullptr ? *settings.solver : internal::coupledSolver();
}

}  // namespace

Result<BodyId> World::addBody(std::shared_ptr<const Asset> asset, const BodySettings& settings) {
  const Impl::Presence presence(*impl_, "addBody", Impl::As::changes);
  if (!presence) return presence.refusal();
  if (const char* fault = faultOf(asset.get(), settings)) return Error{fault};
  if (const char* fault = internal::faultOf(settings)) return impl_->refuse("addBody: %s", fault);
  if (const char* fault = solverOf(settings).faultOf(*asset)) return Error{fault};
  return impl_->guarded("addBody", Result<BodyId>(Error{"addBody: out of memory"}), [&]() -> Result<BodyId> {
    // All that can fail comes before the body is in its place.
    std::pmr::memory_resource* memory = impl_->memory;
    internal::BodyPointer body = internal::makeBody(std::move(asset), settings, solverOf(settings), memory);
    internal::setPackagePins(*body, impl_->next_pin_set);
    body->reset();
    keepHistory(*body);
    body->id = impl_->next_body;
    impl_->bodies.push_back(std::move(body));
    return BodyId{impl_->next_body++};
  });
}

void World::removeBody(BodyId id) {
  const Impl::Presence presence(*impl_, "removeBody", Impl::As::changes);
  if (presence.find(id) == nullptr) return;
  const auto [body, place] = impl_->locate(id);
  impl_->changed(*body);
  impl_->bodies.erase(place);
}

bool World::contains(BodyId id) const {
  const Impl::Presence presence(*impl_, "contains", Impl::As::looks);
  return presence && impl_->find(id) != nullptr;
}

void World::resetBody(BodyId id) {
  Impl::Presence presence(*impl_, "resetBody", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return;
  presence.lend();
  setActivity(id, Activity::active);
  // All that can fail comes first.
  impl_->guarded("resetBody", false, [&] {
    internal::setPackagePins(*body, impl_->next_pin_set);
    body->reset();
    keepHistory(*body);
    impl_->displaced(*body);
    return true;
  });
}

const BodySettings& World::bodySettings(BodyId id) const {
  static const BodySettings none;
  const Impl::Presence presence(*impl_, "bodySettings", Impl::As::looks);
  const Body* body = presence.find(id);
  return body != nullptr ? body->settings : none;
}

bool World::setBodySettings(BodyId id, const BodySettings& settings) {
  const Impl::Presence presence(*impl_, "setBodySettings", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return false;
  if (const char* fault = internal::faultOf(settings)) {
    impl_->tell(LogSeverity::error, "setBodySettings: %s", fault);
    return false;
  }
  BodySettings& had = body->settings;
  had.level = settings.level;
  if (had.friction == settings.friction && had.layers == settings.layers && had.touches == settings.touches &&
      had.self_contact == settings.self_contact && had.gravity_scale == settings.gravity_scale &&
      had.drag == settings.drag && had.support_damping == settings.support_damping) {
    return true;  // what sleeps sleeps on
  }
  impl_->changed(*body);
  // A two-step formula does not reach across another weight.
  if (body->settings.gravity_scale != settings.gravity_scale) body->solver->addMotion({0, 0, 0}, {0, 0, 0}, {0, 0, 0});
  body->settings.friction = settings.friction;
  body->settings.layers = settings.layers;
  body->settings.touches = settings.touches;
  body->settings.self_contact = settings.self_contact;
  body->settings.gravity_scale = settings.gravity_scale;
  body->settings.drag = settings.drag;
  body->settings.support_damping = settings.support_damping;
  return true;
}

bool World::isAsleep(BodyId id) const {
  const Impl::Presence presence(*impl_, "isAsleep", Impl::As::looks);
  const Body* body = presence.find(id);
  return body != nullptr && body->asleep() && body->activity == Activity::active;
}

void World::wake(BodyId id) {
  const Impl::Presence presence(*impl_, "wake", Impl::As::changes);
  if (Body* body = presence.find(id)) internal::wake(impl_->bodies, *body);
}

const Asset& World::asset(BodyId id) const { return *impl_->find(id)->asset; }

WorldSettings World::Impl::soundSettings(const char* call) {
  const CheckedSettings sound = checked(settings);
  if (sound.wrong != settings_told && sound.wrong != 0) {
    tell(LogSeverity::warning, "%s: WorldSettings::%s is out of range; the nearest legal value is used", call,
         sound.name);
  }
  settings_told = sound.wrong;
  return sound.settings;
}

void World::Impl::keepDrawn() {
  visual.invalidate();
  for (const internal::BodyPointer& body : bodies) {
    if (body->settings.keep_previous) body->solver->refresh(shown, internal::Asked::all);
    keepHistory(*body);
  }
}

void World::Impl::stepOnce(const WorldSettings& sound, double seconds, double share) {
  if (!actsAlike(sound, acting)) internal::wakeAll(bodies);
  acting = sound;
  for (internal::Collider& collider : colliders) {
    collider.move(share, seconds);
    if (collider.takesAlong()) internal::wakeIn(bodies, collider.bounds());
  }
  met.clear();
  met.reserve(colliders.size() + 1);
  touched.reserve(colliders.size() + 1);
  events.reserve(kEvents * bodies.size());
  if (sound.ground.enabled) {
    ground.shape = internal::Shape(PlaneShape{sound.ground.normal, sound.ground.offset}, memory);
    ground.settings.friction = sound.ground.friction;
    ground.settings.restitution = sound.ground.restitution;
    met.push_back(&ground);
  }
  for (const internal::Collider& collider : colliders) met.push_back(&collider);
  const bool awake = !std::all_of(bodies.begin(), bodies.end(), [](const auto& body) { return body->asleep(); });
  internal::stepWorld(bodies, step_scratch, together, {sound, {met.data(), met.size()}}, jobs, seconds, share);
  for (internal::Collider& collider : colliders) {
    collider.impulse_before = collider.impulse;
    collider.torque_before = collider.torque;
  }
  gatherTouches(seconds);
  if (awake) tellTouching();
  if (sound.report_contacts) gatherContacts(seconds);
  for (internal::Collider& collider : colliders) {
    collider.giveWay(collider.impulse - collider.impulse_before, collider.torque - collider.torque_before, seconds,
                     seconds / share - seconds);
  }
  for (const internal::BodyPointer& body : bodies) {
    if (body->repaired == 0) continue;
    tell(LogSeverity::warning,
         "step: body %u: the state of %u vert%s was lost (not finite, or beyond 1e15 m) and was put right", body->id,
         body->repaired, body->repaired == 1 ? "ex" : "ices");
  }
}

void World::step(float seconds) {
  if (!(seconds > 0 && seconds <= kLongestStep)) {
    impl_->tell(LogSeverity::error, "step: %g is not a length of time; nothing was done", double(seconds));
    return;
  }
  const Impl::Presence presence(*impl_, "step", Impl::As::steps);
  if (!presence) return;
  const WorldSettings settings = impl_->soundSettings("step");
  impl_->guarded("step", false, [&] {
    impl_->keepDrawn();
    impl_->forgetTouches();
    impl_->shown = 1;
    impl_->stepOnce(settings, double(seconds), 1);
    impl_->forgetForces();
    return true;
  });
}

std::uint32_t World::advance(float seconds) {
  if (!(seconds >= 0 && seconds <= kLongestStep)) {
    impl_->tell(LogSeverity::error, "advance: %g is not a length of time; nothing was done", double(seconds));
    return 0;
  }
  const Impl::Presence presence(*impl_, "advance", Impl::As::steps);
  if (!presence) return 0;
  const WorldSettings settings = impl_->soundSettings("advance");
  const double h = double(settings.substep_seconds), time = impl_->left_over + double(seconds);
  // Frames of the length of a substep each hold one, however their sum is rounded.
  const double whole = std::floor(time / h + 1e-6);
  const std::uint32_t steps = std::uint32_t(std::min(whole, double(settings.most_substeps)));
  return impl_->guarded("advance", 0U, [&] {
    impl_->keepDrawn();
    impl_->forgetTouches();
    impl_->left_over = std::max(0.0, time - whole * h);
    // Targets are for the end of the call: the last step stops before them by what is left over.
    const double lasting = steps * h + impl_->left_over;
    for (std::uint32_t i = 0; i < steps; ++i) impl_->stepOnce(settings, h, std::min(1.0, h / (lasting - i * h)));
    if (steps > 0) impl_->forgetForces();
    impl_->shown = impl_->left_over / h;
    return steps;
  });
}

std::span<const Vec3> World::positions(BodyId id) const {
  const Impl::Presence presence(*impl_, "positions", Impl::As::reads);
  const Body* body = presence.seen(id);
  return body != nullptr ? std::span<const Vec3>(body->x.data(), body->vertexCount()) : std::span<const Vec3>();
}

std::span<const Vec3> World::velocities(BodyId id) const {
  const Impl::Presence presence(*impl_, "velocities", Impl::As::reads);
  const Body* body = presence.seen(id);
  return body != nullptr ? std::span<const Vec3>(body->v.data(), body->vertexCount()) : std::span<const Vec3>();
}

std::uint32_t World::repairedVertices(BodyId id) const {
  const Impl::Presence presence(*impl_, "repairedVertices", Impl::As::looks);
  const Body* body = presence.find(id);
  return body != nullptr ? body->repaired : 0;
}

void World::setState(BodyId id, std::span<const Vec3> positions, std::span<const Vec3> velocities) {
  const Impl::Presence presence(*impl_, "setState", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return;
  const std::size_t count = body->vertices().size();
  if (positions.size() != count || (!velocities.empty() && velocities.size() != count)) {
    impl_->tell(LogSeverity::error, "setState: %zu positions and %zu velocities for a body of %zu vertices",
                positions.size(), velocities.size(), count);
    return;
  }
  std::copy(positions.begin(), positions.end(), body->x.begin());
  if (velocities.empty()) {
    std::fill(body->v.begin(), body->v.end(), Vec3{});
  } else {
    std::copy(velocities.begin(), velocities.end(), body->v.begin());
  }
  if (const std::uint32_t lost = internal::replaceUnusable(*body); lost > 0) {
    impl_->tell(LogSeverity::warning, "setState: body %u: the state of %u vert%s is not finite, or beyond 1e15 m",
                id.value, lost, lost == 1 ? "ex" : "ices");
  }
  body->solver->takeState();
  keepHistory(*body);
  impl_->displaced(*body);
}

BodyEnergy World::energy(BodyId id) const {
  const Impl::Presence presence(*impl_, "energy", Impl::As::changes);
  Body* body = presence.seen(id);
  if (body == nullptr) return {};
  return impl_->guarded("energy", BodyEnergy{}, [&] {
    internal::SolverScratch scratch(impl_->memory);
    body->solver->reserve(scratch);
    return body->solver->energy(scratch);
  });
}

void World::shiftOrigin(Vec3 by) {
  if (!usable(by)) {
    impl_->tell(LogSeverity::error, "shiftOrigin: not finite, or beyond 1e15 m");
    return;
  }
  Impl::Presence presence(*impl_, "shiftOrigin", Impl::As::changes);
  if (!presence) return;
  // Nothing moves against anything else: what sleeps sleeps on.
  const Eigen::Vector3d way = -asVector(by).cast<double>();
  for (const internal::BodyPointer& body : impl_->bodies) {
    impl_->move(*body, Eigen::Matrix3d::Identity(), way);
    for (internal::Piece& piece : body->pieces) piece.box.translate(way);
  }
  impl_->visual.invalidate();
  for (internal::Collider& collider : impl_->colliders) collider.shift(-asVector(by));
  for (GroundPlane* ground : {&impl_->settings.ground, &impl_->acting.ground}) {
    ground->offset -= asVector(ground->normal).dot(asVector(by));
  }
}

void World::rigidMotion(BodyId id, Mat3& rotation, Vec3& translation) const {
  rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  translation = {};
  const Impl::Presence presence(*impl_, "rigidMotion", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body == nullptr) return;
  const RigidTransform motion = internal::rigidMotionOf(*body);
  rotation = motion.rotation;
  translation = motion.position;
}

void World::clusterFrame(BodyId id, std::uint32_t cluster, Vec3& center, Mat3& linear) const {
  const Impl::Presence presence(*impl_, "clusterFrame", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body == nullptr) return;
  if (cluster >= body->clusterCount()) {
    impl_->tell(LogSeverity::error, "clusterFrame: body %u has no cluster %u", id.value, cluster);
    return;
  }
  const auto rest = impl_->guarded("clusterFrame", std::span<const internal::ClusterRest>(),
                                   [body] { return body->asset->clusterConstants(); });
  if (rest.empty()) return;
  const internal::ClusterFrame frame = internal::fitCluster(body->package(), rest, body->positions(), cluster);
  center = asArray(frame.center);
  for (int k = 0; k < 9; ++k) linear[std::size_t(k)] = frame.f(k / 3, k % 3);
}

Mat3 World::clusterRestShape(BodyId id, std::uint32_t cluster) const {
  Mat3 result = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Impl::Presence presence(*impl_, "clusterRestShape", Impl::As::looks);
  const Body* body = presence.find(id);
  if (body == nullptr) return result;
  if (cluster >= body->clusterCount()) {
    impl_->tell(LogSeverity::error, "clusterRestShape: body %u has no cluster %u", id.value, cluster);
  } else {
    Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(result.data()) = body->solver->restShape(cluster);
  }
  return result;
}

}  // namespace sinew
