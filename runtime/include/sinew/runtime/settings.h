// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string_view>

namespace sinew {

/// A vector: metres, or what the field's name says. Right-handed, y up.
using Vec3 = std::array<float, 3>;

/// Row-major 3x3 matrix.
using Mat3 = std::array<float, 9>;

/// A rigid transform: world = rotation * local + position. Of a bone, or of an engine's rigid body.
struct RigidTransform {
  Vec3 position = {0.0F, 0.0F, 0.0F};           ///< metres
  Mat3 rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< proper rotation
};

/// How a pin set holds its vertices (docs/method.md §10 shows them side by side).
enum class PinMethod : std::uint32_t {
  hold = 0,           ///< vertices are put in their places; the body is pulled along by forces on its goals
  infinite_mass = 1,  ///< vertices weigh infinitely in the match (Henriques 2006, §4.3.2): stiff, stiffer the shorter
                      ///< the pass
  matrix = 2,         ///< the goal is made to pass through them (Henriques 2006, §4.3.3): nothing returns by itself
  constrained_fit = 3,  ///< the match is solved subject to them: exact, and the rest of the body returns as authored
};

/// What a pin set does to its transform's owner: the mean over the last step, N and N m about the transform's position.
/// It is the force on the owner, opposite to that on the body.
struct PinReaction {
  Vec3 force = {0.0F, 0.0F, 0.0F};
  Vec3 torque = {0.0F, 0.0F, 0.0F};
};

/// A plane that bodies rest on: points x with normal . x < offset are inside it.
struct GroundPlane {
  bool enabled = false;
  Vec3 normal = {0.0F, 1.0F, 0.0F};  ///< unit
  float offset = 0.0F;               ///< metres along the normal
  float friction = 0.6F;             ///< Coulomb coefficient, 0..; 0 = ice
};

/// Runs a loop in parallel; the default runs it in the caller's thread. An engine passes its own job system in.
class JobSystem {
 public:
  virtual ~JobSystem() = default;
  /// Calls body(begin, end) over disjoint ranges that cover 0..count, possibly at the same time, and returns when all
  /// are done. \param grain smallest range worth a job of its own.
  virtual void parallelFor(std::uint32_t count, std::uint32_t grain,
                           const std::function<void(std::uint32_t begin, std::uint32_t end)>& body) = 0;
  /// Jobs that may run at the same time, about: scratch memory is kept for so many bodies. More threads than that find
  /// nothing to do where there are only small bodies.
  virtual std::uint32_t concurrency() const { return 16; }
};

/// Settings of a world; each may be changed between two steps.
struct WorldSettings {
  Vec3 gravity = {0.0F, -9.81F, 0.0F};  ///< m/s^2
  GroundPlane ground;
  /// How much work a step may take, 1..16. Bodies with fields: twice as many iterations of their solver at most, fewer
  /// once they have settled; not a stiffness (docs/fields.md). Others: passes that the step is divided into, each of
  /// which predicts, matches and solves contacts.
  std::uint32_t iterations = 4;
  /// Fraction of velocity lost per second to the air, as a rate: v *= exp(-damping h). 1/s, 0..1e4.
  float damping = 0.2F;
  /// Damping of motion that is not the rigid motion of a body part (inner friction), as a ratio to critical damping at
  /// the lowest frequency of the part's clusters: a deformation loses exp(-2 pi ratio) of itself in a period. Faster
  /// modes lose as much in the same time. 0..1; 0.25 brings a body from any deformation back to 1e-3 within five
  /// periods. A part that stands, hangs or leans loses it at no more than support_damping: a beam swings out freely.
  float deformation_damping_ratio = 0.25F;
  /// Rate at which turning on supports decays (a part that stands, hangs or leans): soft things do not roll or swing
  /// for ever. Also the most that their deformations lose. 1/s, 0..1e4.
  float support_damping = 4.0F;
  /// Fills World::lastStepPhases, for profiling; costs up to a microsecond a body.
  bool measure_phases = false;
};

/// What moves a body.
enum class Solver : std::uint32_t {
  coupled = 0,  ///< its fields, one energy for each piece (docs/fields.md); clusters where the package has no fields
  report = 1,   ///< its clusters, matched one by one and averaged (docs/method.md)
};

/// What a body may override of its package when it is added.
struct BodySettings {
  Vec3 position = {0.0F, 0.0F,
                   0.0F};  ///< metres, added to the rest positions (and to the package's origin, which is dropped)
  Mat3 rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< proper rotation about the package's origin, applied before position
  float stiffness_scale = 1.0F;                 ///< multiplies the frequencies of all clusters, 0..1e6
  bool keep_previous = false;  ///< keeps the positions before each step, for VisualOutput::previous_positions; costs
                               ///< 12 bytes a physical vertex and their copy
  bool package_pins = true;    ///< the body starts held by the pin sets of its package (World::pinSet)
  Solver solver = Solver::coupled;
};

}  // namespace sinew
