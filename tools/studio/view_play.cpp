// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_play.h"

#include <algorithm>
#include <chrono>
#include <utility>

namespace sinew::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kStepSeconds = 1.0 / 60;
constexpr int kMostStepsPerFrame = 4;  // a slow machine shows slow motion instead of falling ever further behind
constexpr float kPickHz = 10;
constexpr float kFarDiagonals = 1e3F, kNearDiagonals = 0.02F;  // of what a ray meets; of a pick beside it

}  // namespace

Play::Play(std::shared_ptr<const Asset> asset, const ViewOptions& options)
    : asset_(std::move(asset)), options_(options) {
  start(options.scene);
}

void Play::start(const SceneChoice& scene) {
  release();
  const bool same = scene_.has_value() && scene_->options().scene == scene;
  SceneOptions options;
  options.scene = scene;
  options.others = options_.others;
  options.solver = options_.solver;
  options.step_seconds = static_cast<float>(kStepSeconds);
  options.stiffness_scale = settings.stiffness;
  std::vector<std::optional<float>> held;  // by hand: that outlives a scene
  if (scene_.has_value()) {
    for (std::uint32_t c = 0; c < scene_->channelInputs().size(); ++c) {
      held.push_back(scene_->isHeld(c) ? std::optional(scene_->channelInputs()[c]) : std::nullopt);
    }
  }
  scene_.emplace(asset_, options);
  for (std::uint32_t c = 0; c < held.size(); ++c) scene_->holdChannel(c, held[c]);
  base_gravity_ = scene_->world().settings().gravity;
  if (!same) {
    const WorldSettings& world = scene_->world().settings();
    settings.iterations = static_cast<int>(world.iterations);
    settings.damping = world.damping;
    settings.deformation_damping = world.deformation_damping_ratio;
    settings.gravity = 1;
  }
  applySettings();
  owed_seconds_ = 0;
  captureShape(*scene_, shape_);
  is_new = is_new || !same;
}

bool Play::swap(std::shared_ptr<const Asset> asset) {
  const std::optional<Grab> held = grabbed_;
  const std::size_t vertices = shape_.body_vertices;
  release();
  const Scene before = std::move(*scene_);
  scene_.reset();
  asset_ = std::move(asset);
  const bool was_new = is_new;
  const PlaySettings kept = settings;
  start(before.options().scene);
  const bool goes_on = scene_->continueFrom(before);
  is_new = was_new;
  settings = kept;
  applySettings();
  captureShape(*scene_, shape_);
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
  scene_->step();
  const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  step_milliseconds_ += (ms - step_milliseconds_) * 0.1;
  ++steps_;
}

void Play::advance(double elapsed) {
  for (; single_steps_ > 0; --single_steps_) stepOnce();
  if (playing) {
    owed_seconds_ = std::min(owed_seconds_ + elapsed, kMostStepsPerFrame * kStepSeconds);
    while (owed_seconds_ >= kStepSeconds) {
      stepOnce();
      owed_seconds_ -= kStepSeconds;
    }
  }
  captureShape(*scene_, shape_);
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
