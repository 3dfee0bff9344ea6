// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_play.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#include "tools/scene/scene_state.h"

namespace sinew::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMostFrameSeconds = 4.0 / 60;  // a slow machine shows slow motion instead of falling further behind
constexpr float kPickHz = 10;
constexpr float kBallDiagonals = 6;                            // per second, how fast what the hand moves follows it
constexpr float kFarDiagonals = 1e3F, kNearDiagonals = 0.02F;  // of what a ray meets; of a pick beside it

}  // namespace

double millisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

Play::Play(std::shared_ptr<const Asset> asset, const ViewOptions& options)
    : asset_(std::move(asset)), options_(options) {
  begin(options.scene);
}

void Play::start(const SceneChoice& scene) {
  message_.clear();
  try {
    begin(scene);
  } catch (const std::exception& error) {
    message_ = error.what();
  }
}

void Play::begin(const SceneChoice& scene) {
  const bool same = scene_.has_value() && scene_->options().scene == scene;
  SceneOptions options;
  options.scene = scene;
  options.others = options_.others;
  options.solver = options_.solver;
  options.step_seconds = same ? settings.step_seconds : float(scene.stepSeconds());
  options.stiffness_scale = settings.stiffness;
  std::vector<std::optional<float>> held;  // by hand: that outlives a scene
  if (scene_.has_value()) {
    for (std::uint32_t c = 0; c < scene_->channelInputs().size(); ++c) {
      held.push_back(scene_->isHeld(c) ? std::optional(scene_->channelInputs()[c]) : std::nullopt);
    }
  }
  Scene started(asset_, options);
  release();
  endPush();
  scene_.emplace(std::move(started));
  for (std::uint32_t c = 0; c < held.size(); ++c) scene_->holdChannel(c, held[c]);
  placed_.enter(*scene_);
  base_gravity_ = scene_->world().settings().gravity;
  base_ground_ = scene.script ? -package().info().origin[1] : 0;
  if (!same) {
    const WorldSettings& world = scene_->world().settings();
    settings.ground = world.ground.enabled;
    settings.ground_height = world.ground.enabled ? float(double(world.ground.offset) - base_ground_) : 0;
    settings.iterations = static_cast<int>(world.iterations);
    settings.damping = world.damping;
    settings.deformation_damping = world.deformation_damping_ratio;
    settings.gravity = 1;
    settings.step_seconds = options.step_seconds;
  }
  applySettings();
  owed_seconds_ = 0;
  capture();
  findTargets();
  timeline_.clear();
  remember();
  is_new = is_new || !same;
}

bool Play::swap(std::shared_ptr<const Asset> asset) {
  const std::optional<Grab> held = grabbed_;
  const std::size_t vertices = shape_.body_vertices;
  release();
  endPush();
  Scene before = std::move(*scene_);
  scene_.reset();
  const std::shared_ptr<const Asset> old = std::exchange(asset_, std::move(asset));
  const bool was_new = is_new;
  const PlaySettings kept = settings;
  try {
    begin(before.options().scene);
  } catch (...) {
    asset_ = old;
    scene_.emplace(std::move(before));
    throw;
  }
  const bool goes_on = scene_->continueFrom(before);
  is_new = was_new;
  settings = kept;
  applySettings();
  capture();
  timeline_.clear();
  remember();
  if (goes_on && held && shape_.body_vertices == vertices) {
    grab(held->vertex);
    moveGrab(held->target);
    grabbed_->start = held->start;
  }
  return goes_on;
}

void Play::applySettings() {
  WorldSettings& world = scene_->world().settings();
  for (std::size_t k = 0; k < 3; ++k) world.gravity[k] = base_gravity_[k] * settings.gravity;
  world.ground.enabled = settings.ground;
  world.ground.offset = float(double(settings.ground_height) + base_ground_);
  scene_->setStepSeconds(settings.step_seconds);
  world.iterations = static_cast<std::uint32_t>(settings.iterations);
  world.damping = settings.damping;
  world.deformation_damping_ratio = settings.deformation_damping;
}

void Play::stepPaused() {
  playing = false;
  ++single_steps_;
}

void Play::stepOnce() {
  const auto start = Clock::now();
  try {
    scene_->step();
  } catch (const std::exception& error) {
    message_ = error.what();
    playing = false;
    return;
  }
  FrameTimes::add(times.step, millisecondsSince(start));
  remember();
  ++steps_;
}

void Play::remember() { timeline_.add({scene_->save(), grabbed_ ? grabbed_->pick : PickId{}, ball_, placed_.marks()}); }

void Play::capture() {
  const auto start = Clock::now();
  captureShape(*scene_, shape_);
  FrameTimes::add(times.surface, millisecondsSince(start));
  if (triangles_of_ == shape_.assets) return;
  triangles_of_ = shape_.assets;
  triangles_.clear();
  std::uint32_t first = 0;
  for (const auto& asset : shape_.assets) {
    for (const auto& t : asset->package().visualTriangles())
      triangles_.push_back({first + t[0], first + t[1], first + t[2]});
    first += static_cast<std::uint32_t>(asset->package().visualPositions().size());
  }
}

void Play::advance(double elapsed) {
  for (; single_steps_ > 0; --single_steps_) stepOnce();
  if (playing) {
    owed_seconds_ = std::min(owed_seconds_ + elapsed * double(settings.speed), kMostFrameSeconds);
    while (owed_seconds_ >= double(settings.step_seconds)) {
      stepOnce();
      owed_seconds_ -= double(settings.step_seconds);
    }
  }
  capture();
}

void Play::goTo(std::size_t moment) {
  playing = false;
  owed_seconds_ = 0;
  release();
  endPush();
  if (moment >= timeline_.size()) return;
  const Timeline::Moment& then = timeline_[moment];
  if (!scene_->restore(then.state)) {
    message_ = "there is no memory to go back. Close other programs.";
    return;
  }
  timeline_.goTo(moment);
  if (!(then.hand == PickId{})) scene_->world().letGoPick(then.hand);
  if (!(then.ball == ColliderId{})) scene_->removeSolid(then.ball);
  placed_.meet(*scene_, then.placed);
  applySettings();
  capture();
}

void Play::stepBack() { goTo(timeline_.at() > 0 ? timeline_.at() - 1 : 0); }

void Play::push(const Eigen::Vector3f& center, float radius) {
  endPush();
  ColliderSettings from;
  from.at.position = {center.x(), center.y(), center.z()};
  from.most_speed = kBallDiagonals * diagonal();
  ball_ = scene_->addSolid(SphereShape{radius}, from);
  pushed_ = center;
}

void Play::movePush(const Eigen::Vector3f& center) {
  if (!pushed_) return;
  pushed_ = center;
  scene_->world().moveCollider(ball_, {{center.x(), center.y(), center.z()}});
}

void Play::endPush() {
  if (!pushed_) return;
  scene_->removeSolid(ball_);
  ball_ = {};
  pushed_.reset();
}

void Play::addSolid(const ColliderShape& shape) {
  Eigen::AlignedBox3f bounds;
  for (const Eigen::Vector3f& p : std::span(shape_.positions).first(shape_.body_vertices)) bounds.extend(p);
  const float size = kSolidDiagonals * diagonal();
  Eigen::Vector3f at = bounds.center();
  at.x() = bounds.max().x() + 2 * size;
  if (placed_.size() > 0) {
    // Above the one before.
    at = Eigen::Vector3f(placed_[placed_.size() - 1].settings.at.position.data());
    at.y() += 3 * size;
  }
  PlacedSolid solid;
  solid.shape = shape;
  solid.settings.at.position = {at.x(), at.y(), at.z()};
  solid.settings.most_speed = kBallDiagonals * diagonal();
  placed_.add(*scene_, solid);
}

void Play::changeSolid(std::size_t i, const PlacedSolid& solid, bool place_alone) {
  placed_.change(*scene_, i, solid,
                 !place_alone ? SolidChange::anew
                 : playing    ? SolidChange::goes
                              : SolidChange::jumps);
}

void Play::findTargets() {
  targets_.clear();
  // Elsewhere pins of the package do not hold, or the scene moves them.
  if (scene_->options().scene.script || scene_->options().scene != SceneKind::rest) return;
  const formats::PackageView& view = package();
  std::vector<float> counts;
  for (const formats::PinSet& set : view.pinSets()) {
    if (set.count == 0) continue;
    const std::string name(view.text(set.target));
    auto found = std::find_if(targets_.begin(), targets_.end(), [&](const Target& t) { return t.name == name; });
    if (found == targets_.end()) {
      targets_.push_back({name, Eigen::Vector3f::Zero()});
      counts.push_back(0);
      found = targets_.end() - 1;
    }
    for (const std::uint32_t v : view.pinSetVertices().subspan(set.first, set.count))
      found->pivot += shape_.physical[v];
    counts[std::size_t(found - targets_.begin())] += float(set.count);
  }
  for (std::size_t t = 0; t < targets_.size(); ++t) targets_[t].pivot /= counts[t];
}

void Play::moveTarget(std::size_t target, const Eigen::Vector3f& move, const Eigen::Matrix3f& turn) {
  Target& held = targets_[target];
  held.move = move;
  held.turn = turn;
  // Of the rest shape where it was placed: x = turn (placed X - pivot) + pivot + move.
  const RigidTransform& placed = scene_->placement();
  const Eigen::Matrix3f rotation =
      turn * Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(placed.rotation.data());
  const Eigen::Vector3f position = turn * (Eigen::Vector3f(placed.position.data()) - held.pivot) + held.at();
  RigidTransform to;
  Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(to.rotation.data()) = rotation;
  to.position = {position.x(), position.y(), position.z()};
  scene_->world().movePinTarget(scene_->body(), held.name, to);
}

std::vector<SceneScript::Target> Play::scriptTargets() const {
  std::vector<SceneScript::Target> all;
  const auto& origin = package().info().origin;
  for (const Target& target : targets_) {
    const Eigen::AngleAxisf turn(target.turn);
    const Eigen::Vector3f pivot = target.pivot - Eigen::Vector3f(scene_->placement().position.data());
    SceneScript::Target& made = all.emplace_back();
    made.name = target.name;
    SceneScript::TargetKey& key = made.keys.emplace_back();
    key.time = 0;
    key.turn = double(turn.angle());
    for (std::size_t a = 0; a < 3; ++a) {
      made.axis[a] = double(turn.axis()[Eigen::Index(a)]);
      made.point[a] = double(pivot[Eigen::Index(a)]) + origin[a];
      key.move[a] = double(target.move[Eigen::Index(a)]);
    }
  }
  return all;
}

bool Play::cut(const Eigen::Vector3f& point, const Eigen::Vector3f& normal) {
  release();
  message_.clear();
  try {
    // Parts touch each other where the package knows its distances.
    if (!package().distanceGrids().empty()) scene_->world().settings().collisions = true;
    scene_->cut({{point.x(), point.y(), point.z()}, {normal.x(), normal.y(), normal.z()}});
  } catch (const std::exception& error) {
    message_ = error.what();
    return false;
  }
  capture();
  remember();
  return true;
}

std::vector<std::pair<Eigen::Vector3f, Eigen::Vector3f>> lockedPicks(const Play& play) {
  std::vector<std::pair<Eigen::Vector3f, Eigen::Vector3f>> locked;
  const World& world = play.scene().world();
  for (const BodyId body : play.scene().bodies()) {
    std::vector<PickId> picks(world.picks(body, {}));
    world.picks(body, picks);
    for (const PickId pick : picks) {
      const PickState state = world.pickState(pick);
      if (!state.locked) continue;
      locked.emplace_back(Eigen::Vector3f(state.point[0], state.point[1], state.point[2]),
                          Eigen::Vector3f(state.target[0], state.target[1], state.target[2]));
    }
  }
  return locked;
}

bool Play::regrab(const Eigen::Vector3f& from, const Eigen::Vector3f& along) {
  World& world = scene_->world();
  const PickId pick = world.pickAlong({from.x(), from.y(), from.z()}, {along.x(), along.y(), along.z()},
                                      kFarDiagonals * diagonal(), kNearDiagonals * diagonal());
  if (pick == PickId{}) return false;
  world.lockPick(pick, false);
  const PickState state = world.pickState(pick);
  std::uint32_t first = 0;
  for (std::size_t body = 0; scene_->bodies()[body] != state.body; ++body) {
    first += static_cast<std::uint32_t>(shape_.assets[body]->package().visualPositions().size());
  }
  const Eigen::Vector3f target(state.target[0], state.target[1], state.target[2]);
  grabbed_ = {first + state.at.vertex[0], target, target, pick};
  return true;
}

void Play::grab(std::uint32_t vertex) {
  const Eigen::Vector3f& at = shape_.positions[vertex];
  std::uint32_t own = vertex;
  std::size_t body = 0;
  for (; body + 1 < shape_.assets.size(); ++body) {
    const auto count = static_cast<std::uint32_t>(shape_.assets[body]->package().visualPositions().size());
    if (own < count) break;
    own -= count;
  }
  grabbed_ = {vertex, at, at,
              scene_->world().pick(scene_->bodies()[body], BodyPoint::visualVertex(own), {at.x(), at.y(), at.z()},
                                   {.frequency_hz = kPickHz})};
}

void Play::moveGrab(const Eigen::Vector3f& target) {
  grabbed_->target = target;
  scene_->world().movePick(grabbed_->pick, {target.x(), target.y(), target.z()});
}

void Play::release() {
  if (grabbed_) scene_->world().letGoPick(grabbed_->pick);
  grabbed_.reset();
}

void Play::lock() {
  if (grabbed_) scene_->world().lockPick(grabbed_->pick);
}

void Play::releaseAll() {
  grabbed_.reset();
  scene_->world().releasePicks();
}

}  // namespace sinew::tools
