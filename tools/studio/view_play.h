// SPDX-License-Identifier: GPL-3.0-or-later
//
// The scene that `sinew view` plays: its time, its settings, and the hand that holds its body. No window in it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tools/render/picture.h"
#include "tools/scene/scene.h"
#include "tools/studio/timeline.h"
#include "tools/studio/view_window.h"

namespace sinew::tools {

/// User settings; of the built-in scene when it starts.
struct PlaySettings {
  float gravity = 1;  ///< times the scene's
  int iterations = 1;
  float damping = 0, deformation_damping = 0;  ///< as in WorldSettings
  float stiffness = 1;                         ///< BodySettings::stiffness_scale; taken when a scene starts
  float speed = 1;                             ///< of time, 0.02..1
  float step_seconds = 1.0F / 60;              ///< length of a step, 1e-5..1
  bool ground = false;                         ///< there is a level one
  float ground_height = 0;                     ///< m, above where the body's source, or a built-in scene, has 0
};

/// Tool of the left button on the body.
enum class HandTool : std::uint8_t { pull, push, cut, target };

/// Size of a collider that is added, diagonals.
inline constexpr float kSolidDiagonals = 0.1F;

/// Since a time of the steady clock.
double millisecondsSince(std::chrono::steady_clock::time_point start);

/// Where the time of a frame goes, ms, smoothed.
struct FrameTimes {
  double step = 0, surface = 0, colors = 0, draw = 0, panels = 0;
  /// Takes one more value of a phase.
  static void add(double& phase, double milliseconds) { phase += (milliseconds - phase) * 0.1; }
};

class Play {
 public:
  Play(std::shared_ptr<const Asset> asset, const ViewOptions& options);

  /// Starts a scene, which lets the body go. Where it cannot be played, message() says why, and the one before goes on.
  /// Settings stay where it is the scene that runs; channels held by hand stay always.
  void start(const SceneChoice& scene);
  void restart() { start(SceneChoice(scene_->options().scene)); }
  /// Takes another bake of the body, which goes on where this one is: pose, velocity, scene, time, channels, what the
  /// hand holds. \return whether it could; else the scene starts again
  bool swap(std::shared_ptr<const Asset> asset);
  /// Brings `settings` to the world.
  void applySettings();
  /// Steps once in the next advance, and plays no longer.
  void stepPaused();
  /// Goes back, or forward again, to a moment that was; plays no longer. A grip of that moment is let go.
  void goTo(std::size_t moment);
  void stepBack();
  const Timeline& timeline() const { return timeline_; }
  /// \param elapsed s of real time
  void advance(double elapsed);

  /// The hand's grip.
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

  /// Pushes with a ball that follows movePush() until endPush(). \param center, radius metres
  void push(const Eigen::Vector3f& center, float radius);
  void movePush(const Eigen::Vector3f& center);
  void endPush();
  /// Where the ball is told to be, metres; nothing: there is none.
  const std::optional<Eigen::Vector3f>& pushed() const { return pushed_; }

  /// Goal of pins, by the name of the recipe's target. Scenes from files move their own.
  struct Target {
    std::string name;
    Eigen::Vector3f pivot;                               ///< middle of what it holds, at rest in the world, metres
    Eigen::Vector3f move = Eigen::Vector3f::Zero();      ///< metres
    Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();  ///< about the pivot
    Eigen::Vector3f at() const { return pivot + move; }
  };
  const std::vector<Target>& targets() const { return targets_; }
  /// Where they are, as a scene's file has it.
  std::vector<SceneScript::Target> scriptTargets() const;
  void moveTarget(std::size_t target, const Eigen::Vector3f& move, const Eigen::Matrix3f& turn);

  /// Colliders that were placed by hand. They stay when the body is baked again, when another scene starts and when it
  /// goes back.
  const PlacedSolids& placed() const { return placed_; }
  void selectSolid(std::optional<std::size_t> solid) { placed_.selected = solid; }
  /// Adds one beside the body, and selects it. \param shape a box, sphere or capsule
  void addSolid(const ColliderShape& shape);
  /// \param place_alone its shape and surface stay: while the scene plays it goes there and takes bodies along
  void changeSolid(std::size_t i, const PlacedSolid& solid, bool place_alone);
  void removeSolid(std::size_t i) { placed_.remove(*scene_, i); }

  /// Cuts what a plane meets. \return whether it could; else message() says why
  bool cut(const Eigen::Vector3f& point, const Eigen::Vector3f& normal);
  /// The last failure or news; empty: none.
  const std::string& message() const { return message_; }
  void say(const std::string& text) { message_ = text; }

  Scene& scene() { return *scene_; }
  const Scene& scene() const { return *scene_; }
  const Shape& shape() const { return shape_; }
  /// Of all bodies, by the vertices of shape().
  std::span<const std::array<std::uint32_t, 3>> triangles() const { return triangles_; }
  const formats::PackageView& package() const { return asset_->package(); }
  float diagonal() const { return package().info().diagonal; }
  const ViewOptions& options() const { return options_; }
  std::uint32_t steps() const { return steps_; }

  PlaySettings settings;
  HandTool hand = HandTool::pull;
  FrameTimes times;
  bool playing = true;
  bool is_new = true;  ///< another scene has started since whoever looks cleared this

 private:
  void begin(const SceneChoice& scene);
  void stepOnce();
  void remember();
  void findTargets();
  void capture();

  std::shared_ptr<const Asset> asset_;
  ViewOptions options_;
  std::optional<Scene> scene_;
  Shape shape_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::shared_ptr<const Asset>> triangles_of_;
  Vec3 base_gravity_{};
  double base_ground_ = 0;
  std::optional<Grab> grabbed_;
  ColliderId ball_;
  std::optional<Eigen::Vector3f> pushed_;
  std::vector<Target> targets_;
  PlacedSolids placed_;
  Timeline timeline_;
  std::string message_;
  int single_steps_ = 0;
  double owed_seconds_ = 0;
  std::uint32_t steps_ = 0;
};

/// Picks that stay where they were let go: where they hold, and where they pull to, metres.
std::vector<std::pair<Eigen::Vector3f, Eigen::Vector3f>> lockedPicks(const Play& play);

}  // namespace sinew::tools
