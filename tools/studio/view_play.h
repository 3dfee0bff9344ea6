// SPDX-License-Identifier: GPL-3.0-or-later
//
// The scene that `sinew view` plays: its time, its settings, and the hand that holds its body. No window in it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "tools/render/picture.h"
#include "tools/scene/scene.h"
#include "tools/studio/view_window.h"

namespace sinew::tools {

/// What a person sets; of the built-in scene when it starts.
struct PlaySettings {
  float gravity = 1;  ///< times the scene's
  int iterations = 1;
  float damping = 0, deformation_damping = 0;  ///< as in WorldSettings
  float stiffness = 1;                         ///< BodySettings::stiffness_scale; taken when a scene starts
};

class Play {
 public:
  Play(std::shared_ptr<const Asset> asset, const ViewOptions& options);

  /// Starts a scene, which lets the body go. Settings stay where it is the scene that runs; channels held by hand stay
  /// always.
  void start(const SceneChoice& scene);
  void restart() { start(SceneChoice(scene_->options().scene)); }
  /// Takes another bake of the body, which goes on where this one is: pose, velocity, scene, time, channels, what the
  /// hand holds. \return whether it could; else the scene starts again
  bool swap(std::shared_ptr<const Asset> asset);
  /// Brings `settings` to the world.
  void applySettings();
  /// Steps once in the next advance, and plays no longer.
  void stepPaused();
  /// \param elapsed s of real time
  void advance(double elapsed);

  /// What the hand holds.
  struct Grab {
    std::uint32_t vertex = 0;                                                           ///< visual
    Eigen::Vector3f start = Eigen::Vector3f::Zero(), target = Eigen::Vector3f::Zero();  ///< metres
    PickId pick;
  };
  void grab(std::uint32_t vertex);
  /// Takes up a locked pick beside a ray, where there is one. \param from metres. \param along unit.
  bool regrab(const Eigen::Vector3f& from, const Eigen::Vector3f& along);
  /// \param target metres
  void moveGrab(const Eigen::Vector3f& target);
  /// Lets go; what is locked stays.
  void release();
  void lock();
  void releaseAll();
  const std::optional<Grab>& grabbed() const { return grabbed_; }

  Scene& scene() { return *scene_; }
  const Scene& scene() const { return *scene_; }
  const Shape& shape() const { return shape_; }
  const formats::PackageView& package() const { return asset_->package(); }
  float diagonal() const { return package().info().diagonal; }
  const ViewOptions& options() const { return options_; }
  double stepMilliseconds() const { return step_milliseconds_; }
  std::uint32_t steps() const { return steps_; }

  PlaySettings settings;
  bool playing = true;
  bool is_new = true;  ///< another scene has started since whoever looks cleared this

 private:
  void stepOnce();

  std::shared_ptr<const Asset> asset_;
  ViewOptions options_;
  std::optional<Scene> scene_;
  Shape shape_;
  Vec3 base_gravity_{};
  std::optional<Grab> grabbed_;
  int single_steps_ = 0;
  double owed_seconds_ = 0, step_milliseconds_ = 0;
  std::uint32_t steps_ = 0;
};

}  // namespace sinew::tools
