// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/scene_state.h"

namespace sinew::tools {

SceneState Scene::save() const {
  SceneState state;
  state.world_.resize(world_.snapshotBytes());
  world_.saveSnapshot(state.world_);
  state.bodies_ = bodies_;
  state.assets_ = assets_;
  state.next_cut_ = next_cut_;
  state.next_impulse_ = next_impulse_;
  state.hands_ = hands_;
  state.solids_ = solids_;
  state.driven_solids_ = driven_solids_;
  state.pushers_ = pushers_;
  state.held_points_ = held_points_;
  state.time_ = time_;
  state.steps_ = steps_;
  state.step_seconds_ = options_.step_seconds;
  state.even_from_ = even_from_;
  state.even_steps_ = even_steps_;
  state.pinned_ = pinned_;
  state.inputs_ = inputs_;
  return state;
}

bool Scene::restore(const SceneState& state) {
  if (!world_.restoreSnapshot(state.world_, state.assets_)) return false;
  bodies_ = state.bodies_;
  assets_ = state.assets_;
  next_cut_ = state.next_cut_;
  next_impulse_ = state.next_impulse_;
  hands_ = state.hands_;
  solids_ = state.solids_;
  driven_solids_ = state.driven_solids_;
  pushers_ = state.pushers_;
  held_points_ = state.held_points_;
  time_ = state.time_;
  steps_ = state.steps_;
  options_.step_seconds = state.step_seconds_;
  even_from_ = state.even_from_;
  even_steps_ = state.even_steps_;
  pinned_ = state.pinned_;
  inputs_ = state.inputs_;
  return true;
}

}  // namespace sinew::tools
