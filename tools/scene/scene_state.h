// SPDX-License-Identifier: GPL-3.0-or-later
//
// Result of Scene::save().
#pragma once

#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "tools/scene/scene.h"

namespace sinew::tools {

/// A moment of one scene, for that scene alone.
class SceneState {
 public:
  double time() const { return time_; }  ///< s
  /// About what it takes of memory.
  std::size_t bytes() const { return world_.size() + pinned_.size() * sizeof(std::uint32_t) + sizeof(*this); }

 private:
  friend class Scene;
  std::vector<std::byte> world_;
  std::vector<BodyId> bodies_;
  std::vector<std::shared_ptr<const Asset>> assets_;
  std::size_t next_cut_ = 0, next_impulse_ = 0;
  std::vector<Scene::Hand> hands_;
  std::vector<SceneSolid> solids_;
  std::vector<ColliderId> driven_solids_, pushers_;
  std::vector<std::pair<BodyId, BodyPoint>> held_points_;
  double time_ = 0;
  std::uint64_t steps_ = 0;
  float step_seconds_ = 0;
  double even_from_ = 0;
  std::uint64_t even_steps_ = 0;
  std::vector<std::uint32_t> pinned_;
  std::vector<float> inputs_;
};

}  // namespace sinew::tools
