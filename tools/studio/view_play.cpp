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

void Play::grab(std::uint32_t vertex) {
  const Eigen::Vector3f& at = shape_.positions[vertex];
  std::uint32_t own = vertex;
  std::size_t body = 0;
  for (; body + 1 < shape_.assets.size(); ++body) {
    const auto count = static_cast<std::uint32_t>(shape_.assets[body]->package().visualPositions().size());
    if (own < count) break;
    own -= count;
  }
  grabbed_ = {vertex, at, at, scene_->world().pick(scene_->bodies()[body], own, {at.x(), at.y(), at.z()}, kPickHz)};
}

void Play::moveGrab(const Eigen::Vector3f& target) {
  grabbed_->target = target;
  scene_->world().movePick(grabbed_->pick, {target.x(), target.y(), target.z()});
}

void Play::release() {
  if (grabbed_) scene_->world().releasePick(grabbed_->pick);
  grabbed_.reset();
}

}  // namespace sinew::tools
