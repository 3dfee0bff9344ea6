// SPDX-License-Identifier: GPL-3.0-or-later
//
// Keys and mouse in the window of `sinew view`.
#pragma once

#include <array>
#include <optional>

#include "tools/render/camera.h"
#include "tools/studio/camera_mouse.h"
#include "tools/studio/play_colors.h"
#include "tools/studio/section_view.h"
#include "tools/studio/shortcuts.h"
#include "tools/studio/view_layout.h"
#include "tools/studio/view_play.h"

namespace sinew::tools {

/// Drawn parts of the physics.
struct Shown {
  bool physical = false, clusters = false, pinned = true, contacts = false;
  PlayColor color = PlayColor::model;
  Section section;
};

class ViewInput {
 public:
  /// Does what was pressed and moved since the last frame; fits the camera to a new scene.
  void frame(const ViewLayout& layout, Navigation navigation, const Commands& commands, Play& play, Shown& shown);
  Camera& camera() { return camera_; }
  /// Those of the collider that is selected, as the camera stands.
  std::vector<Handle> handles(const Play& play) const;
  /// Rays of the line along which is cut, from the eye; none: none is drawn.
  const std::optional<std::array<Eigen::Vector3f, 2>>& knife() const { return knife_; }

 private:
  void run(Command command, const ViewLayout& layout, Play& play, Shown& shown);
  void mouse(const ViewLayout& layout, Navigation navigation, Play& play);
  bool takeSolid(const ViewLayout& layout, const Play& play);
  bool takeTarget(const Eigen::Vector3f& ray, const Play& play);
  bool takeHold(const Eigen::Vector3f& ray, Play& play);
  void holdOn(const Eigen::Vector3f& ray, bool left, Play& play);
  void fit(const ViewLayout& layout, const Play& play, ViewName view, bool as_scene);

  Camera camera_;
  CameraMouse mouse_;
  Eigen::Vector3f grab_hit_ = Eigen::Vector3f::Zero();     // drawing units
  std::optional<std::size_t> target_;                      // that is held
  Eigen::Vector3f target_move_ = Eigen::Vector3f::Zero();  // metres, when it was taken
  struct HeldSolid {
    std::size_t number;
    PlacedSolid solid;  // when it was taken
    HandleKind kind;
    Eigen::Vector3f from;  // m, where the handle was
  };
  std::optional<HeldSolid> held_solid_;
  float pushed_in_ = 0;  // drawing units, by the wheel
  std::optional<std::array<Eigen::Vector3f, 2>> knife_;
};

}  // namespace sinew::tools
