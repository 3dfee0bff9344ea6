// SPDX-License-Identifier: GPL-3.0-or-later
//
// The scenes, built in or from a file, that `simulate`, `render`, `view` and the studies share.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/runtime/cut.h"
#include "sinew/runtime/world.h"
#include "tools/scene/scene_script.h"
#include "tools/scene/solid_mesh.h"

namespace sinew::tools {

enum class SceneKind { rest, drop, squash, stretch, hang, stack, pyramid, pile, stairs, cut };

/// Names in the order of the enum: "rest", "drop", "squash", "stretch", "hang", "stack", "pyramid", "pile", "stairs",
/// "cut".
std::span<const std::string_view> sceneNames();
/// Values of --scene, in words.
std::string sceneList();

/// A built-in scene, or one from a file.
struct SceneChoice {
  SceneChoice(SceneKind built_in) : kind(built_in) {}
  SceneKind kind;                             ///< rest where there is a script
  std::shared_ptr<const SceneScript> script;  ///< null: built in

  /// By name, or the file of a name that ends in .json. Throws ToolError.
  static SceneChoice byName(const std::string& name);
  std::string name() const;
  bool takesSeveral() const;   ///< it has bodies of several packages where they are given; others take the first
  double seconds() const;      ///< its own length, s
  double stepSeconds() const;  ///< of a step, s: 1/60 where a file does not say it
  bool operator==(const SceneChoice&) const = default;
};

struct SceneOptions {
  SceneChoice scene = SceneKind::drop;
  /// Packages of a scene's several bodies, beside its first one: taken in turn, or by number in a scene from a file.
  std::vector<std::shared_ptr<const Asset>> others = {};
  float step_seconds = 1.0F / 60;
  std::vector<float> step_sequence = {};  ///< step lengths taken in turn; empty: step_seconds
  std::uint32_t iterations = 0;           ///< as WorldSettings::iterations; 0 = the scene's default
  const SolverFactory* solver = nullptr;  ///< null: its fields
  float stiffness_scale = 1;              ///< multiplies the frequencies of all clusters, 0..1e6
  std::optional<float>
      gravity;  ///< m/s^2 downwards; without it 9.81 diagonals per s^2, so that models of any size behave alike
};

/// A collider of a scene, and what is drawn for it.
struct SceneSolid {
  ColliderId id;
  std::shared_ptr<const SolidMesh> mesh;
};

class SceneState;

/// One body of a package in one scene, or several that touch (stack, pyramid, pile, stairs; bodies of a file; parts of
/// one that is cut). Lengths in a built-in scene are relative to the longest rest diagonal. The package's own pins hold
/// in `rest` and in scenes from files, where the body is where its source is.
class Scene {
 public:
  /// Throws ToolError(bad_input) where a scene from a file does not fit the package, or the solver cannot move it.
  Scene(std::shared_ptr<const Asset> asset, const SceneOptions& options, JobSystem* jobs = nullptr);

  /// Back to the start.
  void reset();
  /// One step: of options().step_seconds, or of the next of the sequence.
  void step();

  /// Length of the next step, s.
  float stepSeconds() const;
  /// Makes all further steps so long, s. \pre options().step_sequence is empty
  void setStepSeconds(float seconds);

  /// Goes on from where another one is, of the same choice and another bake of its package: time, inputs, held
  /// channels, and of each body pose and velocity, as near as its fields can. Vertices that the packages do not share
  /// take the motion of the nearest. \return false, and nothing is done, where their bodies do not correspond.
  bool continueFrom(const Scene& before);

  /// All that its further motion depends on, to go back to; held channels stay as they are.
  SceneState save() const;
  /// Makes this scene what it was when it saved. \return false, and nothing is done, where memory ran out
  bool restore(const SceneState& state);

  /// Cuts all bodies that a plane meets. Throws ToolError(bad_input) where it meets none.
  void cut(const CutPlane& plane);
  /// A collider beside those of the scene, until it is removed or the scene starts again. Throws ToolError(bad_input).
  /// \param mesh null: that of the shape.
  ColliderId addSolid(const ColliderShape& shape, const ColliderSettings& settings,
                      std::shared_ptr<const SolidMesh> mesh = nullptr);
  void removeSolid(ColliderId id);

  World& world() { return world_; }
  const World& world() const { return world_; }
  BodyId body() const { return bodies_.front(); }
  std::span<const BodyId> bodies() const { return bodies_; }
  std::span<const std::shared_ptr<const Asset>> assets() const { return assets_; }  ///< of the bodies
  std::span<const SceneSolid> solids() const { return solids_; }                    ///< colliders, as they come and go
  const RigidTransform& placement() const { return placement_; }                    ///< of the body at the start
  /// Places of the world plus this are those of the scene's file, m; 0 without one.
  std::array<double, 3> fileOrigin() const { return script_ ? script_->origin : std::array<double, 3>{}; }
  const SceneOptions& options() const { return options_; }
  double time() const { return time_; }                                   ///< seconds since the start
  bool hasGround() const { return world_.settings().ground.enabled; }     ///< a level ground is there to be drawn
  float groundHeight() const { return world_.settings().ground.offset; }  ///< m
  std::span<const std::uint32_t> pinned() const { return pinned_; }       ///< physical vertices held, for overlays

  /// Gives a channel of the package this input from now on, whatever the scene says; without a value the scene drives
  /// it again. reset() keeps it.
  void holdChannel(std::uint32_t channel, std::optional<float> value);
  bool isHeld(std::uint32_t channel) const { return held_channels_[channel].has_value(); }
  /// Value of each channel of the package, 0..1.
  std::span<const float> channelInputs() const { return inputs_; }

 private:
  friend class SceneState;
  void add(const BodySettings& settings, const std::shared_ptr<const Asset>& asset);
  /// Where the scene has a level ground, m; nothing: it has none.
  std::optional<float> ownGround() const;
  const std::shared_ptr<const Asset>& packageOf(std::size_t number) const {
    return number == 0 ? asset_ : options_.others[number - 1];
  }
  /// Longest rest diagonal of the packages, m.
  float reach() const;
  /// Where a collider that the scene moves is at a time: of the script, or a plate of `squash`.
  RigidTransform drivenAt(std::size_t i, double time) const;
  ColliderId addDriven(std::size_t i, const RigidTransform& at);
  void addScriptBodies(const BodySettings& common);
  /// Colliders of the built-in scenes.
  void addBox();
  void addStairs();
  /// Planes of the scene, in the world.
  void planCuts();
  /// Moves what the scene drives.
  void drive();
  void driveChannels(double time);
  /// Moves a script's hands in the step that ends at a time.
  void driveHands(double time);
  /// The body whose surface lies nearest to a place, and its point there.
  std::pair<BodyId, BodyPoint> nearest(const Vec3& place) const;
  Vec3 placed(const std::array<double, 3>& source) const;
  std::shared_ptr<const Asset> asset_;
  SceneOptions options_;
  std::optional<SceneDrive> script_;
  World world_;
  std::vector<BodyId> bodies_;
  std::vector<std::shared_ptr<const Asset>> assets_;  // of the bodies
  struct Cut {
    double time;  // s
    CutPlane plane;
  };
  std::vector<Cut> cuts_;  // in order of time
  std::size_t next_cut_ = 0, next_impulse_ = 0;
  struct Hand {
    PickId pick;
    Vec3 start = {0, 0, 0};
    bool done = false;
  };
  std::vector<Hand> hands_;  // by pick of the script
  std::vector<SceneSolid> solids_;
  std::vector<ColliderId> driven_solids_;                  // by collider of the script; `squash`: below, above
  std::vector<ColliderId> pushers_;                        // by push of the script; unknown: not there
  std::vector<std::pair<BodyId, BodyPoint>> held_points_;  // by force of the script
  RigidTransform placement_;
  double time_ = 0;
  std::uint64_t steps_ = 0;
  double even_from_ = 0;          // s, since when all steps are as long as the next
  std::uint64_t even_steps_ = 0;  // their number before
  std::vector<std::uint32_t> pinned_;
  std::vector<float> inputs_;                        // by channel of the package
  std::vector<float> wanted_;                        // scratch
  std::vector<std::optional<float>> held_channels_;  // by channel
  std::vector<Vec3> start_;  // rest positions in the world, where the scene drives vertices from
};

}  // namespace sinew::tools
