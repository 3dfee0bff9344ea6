// SPDX-License-Identifier: GPL-3.0-or-later
//
// Scenes from files (docs/scenes.md): channels and pin targets by keyframes.
#pragma once

#include <array>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sinew/runtime/collider.h"
#include "sinew/runtime/world.h"
#include "tools/author/json_text.h"
#include "tools/author/needs.h"

namespace sinew::tools {

inline constexpr double kMostGravity = 1000;               ///< m/s²
inline constexpr double kDegree = std::numbers::pi / 180;  ///< radians
inline constexpr double kMostPitch = 89;   ///< degrees, of a camera: straight from above nothing says which way is up
inline constexpr double kMostPlace = 1e6;  ///< m, of coordinates and lengths
/// Of a collider: the least length of its shape, m; the most friction.
inline constexpr double kLeastLength = 1e-9, kMostFriction = 1e4;

/// A scene file's content. Lengths in metres, points in the source's coordinates (as `sinew inspect` shows them).
struct SceneScript {
  struct ChannelKey {
    double time;   ///< s
    double value;  ///< 0..1
  };
  struct Channel {
    std::string name;  ///< one * stands for any letters
    std::vector<ChannelKey> keys;
  };
  struct TargetKey {
    double time;                 ///< s
    double turn;                 ///< rad about the target's axis
    std::array<double, 3> move;  ///< m, after the turn
  };
  struct Target {
    std::string name;
    std::array<double, 3> axis = {1, 0, 0};   ///< unit
    std::array<double, 3> point = {0, 0, 0};  ///< of the axis
    std::vector<TargetKey> keys;
  };
  /// A collider of the bodies. Points of its shape are about `at`.
  struct Solid {
    ColliderShape base;  ///< without what its spans show
    std::vector<Vec3> points;
    std::vector<formats::Triangle> triangles;
    std::vector<float> heights;
    std::array<double, 3> at = {0, 0, 0};
    Target motion;  ///< of what is at `at`; no keys: it stands
    double friction = 0.6, restitution = 0;
    std::array<double, 3> surface_velocity = {};  ///< m/s, along its axes
    ColliderShape shape() const;
  };
  /// One of several bodies, moved from where its source is.
  struct Place {
    std::uint32_t package = 0;  ///< of those given, from 0
    std::array<double, 3> move = {0, 0, 0}, axis = {1, 0, 0}, velocity = {0, 0, 0};
    double turn = 0;  ///< rad about `axis` through the middle of its bounds
  };
  struct Cut {
    double time;                          ///< s
    std::array<double, 3> point, normal;  ///< of the plane
    /// Where it ends: a quadrilateral, which gives point and normal too.
    std::optional<std::array<std::array<double, 3>, 4>> corners = std::nullopt;
  };
  struct VectorKey {
    double time;                  ///< s
    std::array<double, 3> value;  ///< m, N or m/s
  };
  /// A cursor that grabs a point of the surface at its first key, follows its keys, and lets go at the last.
  struct Pick {
    std::array<double, 3> at;                        ///< at rest: the nearest point of the surface is grabbed, or
    std::optional<std::array<double, 3>> direction;  ///< what a ray from `at` meets first
    std::vector<VectorKey> keys;                     ///< how far from where it was grabbed
    double frequency_hz = 4, most_force = 0;         ///< as in PickSettings
    bool lock = false;                               ///< it stays where it is let go
    std::optional<double> release;                   ///< s, of one that is locked
  };
  /// A sphere that follows a cursor, from its first key to its last.
  struct Push {
    double radius = 0, speed = 0, mass = 0;  ///< m, m/s, kg
    std::vector<VectorKey> keys;             ///< places
  };
  /// From a time on, as BodySettings::level, of all bodies.
  struct Level {
    double time;
    std::uint32_t level;
  };
  struct Impulse {
    double time;                              ///< s
    std::optional<std::array<double, 3>> at;  ///< nearest point of the surface as it lies; none: all of the mass
    std::array<double, 3> impulse;            ///< N s
  };
  struct Force {
    std::optional<std::array<double, 3>> at;  ///< nearest point of the surface at the start; none: all of the mass
    std::vector<VectorKey> keys;              ///< N
  };
  struct View {
    double yaw = 0, pitch = 0;                ///< rad; 0, 0 looks along -z; positive moves the eye to +x, up
    std::optional<std::array<double, 3>> at;  ///< middle of the picture; none: the body is fitted in
    double height = 0;                        ///< m, what the picture shows of it; with `at`
  };

  std::string name;              ///< of the file, without folder and extension
  double seconds = 2;            ///< length
  double still = 2;              ///< s, the moment of a single picture
  double gravity = 0;            ///< m/s², downwards, 0..kMostGravity
  std::uint32_t iterations = 0;  ///< as WorldSettings::iterations, 1..16; 0 = the runtime's default
  std::optional<double> damping, deformation_damping_ratio, support_damping;  ///< WorldSettings; none: its defaults
  double stiffness = 1;        ///< as BodySettings::stiffness_scale, of all bodies
  std::optional<double> step;  ///< s, 1e-5..1
  std::vector<Channel> channels;
  std::vector<Target> targets;
  std::vector<Solid> colliders;
  std::optional<double> ground;  ///< m, where it is level
  std::vector<Place> bodies;     ///< none: one, where its source is
  std::vector<Cut> cuts;         ///< in order of time
  std::vector<Pick> picks;
  std::vector<Push> pushes;
  std::vector<Impulse> impulses;  ///< in order of time
  std::vector<Force> forces;
  std::vector<VectorKey> wind;  ///< m/s; empty: still air
  double drag = 0;              ///< as BodySettings::drag
  std::vector<Level> levels;    ///< in order of time; empty: the whole
  bool self_contact = false;    ///< as BodySettings::self_contact
  bool package_pins = true;     ///< as BodySettings::package_pins
  std::optional<View> view;
  JsonText text;  ///< for messages

  /// Throws ToolError(bad_input) naming file, line and cure.
  static SceneScript read(const std::string& file);
};

/// Needs of a scene from its packages, and of drawing them.
Needs neededBy(const SceneScript& script);

/// Smooth between keys, constant before the first and after the last. \param keys times ascending, at least one.
double valueAt(std::span<const SceneScript::ChannelKey> keys, double time);
std::array<double, 3> valueAt(std::span<const SceneScript::VectorKey> keys, double time);
/// Motion of the rest shape (in the package's coordinates) that a target has at a time.
/// \param origin the package's, which its coordinates are relative to.
RigidTransform motionAt(const SceneScript::Target& target, const std::array<double, 3>& origin, double time);

/// A script's channels and targets as a package has them.
struct SceneDrive {
  /// Throws ToolError(bad_input) where the package lacks a channel or a target that the script names.
  SceneDrive(const SceneScript& script, const formats::PackageView& package);
  /// Values of the channels at a time. \param inputs by channel of the package; others are left as they are.
  void readInputs(double time, std::span<float> inputs) const;
  /// Moves the pin targets to where they are to be at a time.
  void moveTargets(World& world, BodyId body, double time) const;

  const SceneScript& script;
  std::array<double, 3> origin;
  struct Use {
    std::uint32_t channel;  ///< of the package
    std::size_t source;     ///< of the script
  };
  std::vector<Use> channels;
};

}  // namespace sinew::tools
