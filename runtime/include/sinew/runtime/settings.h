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

/// How a pin set holds its vertices where the report's solver moves the body (sinew/runtime/report.h). Fields hold all
/// sets alike.
enum class PinMethod : std::uint32_t {
  hold = 0,             ///< vertices are put in their places (Henriques 2006, §4.3.1)
  infinite_mass = 1,    ///< and weigh infinitely in the match (§4.3.2)
  matrix = 2,           ///< and the goals are made to pass through them (§4.3.3)
  constrained_fit = 3,  ///< the same as hold
};

/// Force and torque of a pin set on the owner of its transform: the mean over the last step, N and N m about the
/// transform's position. Opposite to those on the body.
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
  float restitution = 0;             ///< as ColliderSettings::restitution, 0..1
};

/// Runs a loop in parallel; the default runs it in the caller's thread. An engine passes its own job system in.
class JobSystem {
 public:
  virtual ~JobSystem() = default;
  /// Calls body(begin, end) over disjoint ranges that cover 0..count, possibly at the same time, and returns when all
  /// are done. \param grain smallest range worth a job of its own.
  virtual void parallelFor(std::uint32_t count, std::uint32_t grain,
                           const std::function<void(std::uint32_t begin, std::uint32_t end)>& body) = 0;
  /// About how many jobs run at the same time: scratch memory is kept for that many bodies, and more threads find
  /// nothing to do.
  virtual std::uint32_t concurrency() const { return 16; }
};

/// Settings of a world; each may be changed between two steps.
struct WorldSettings {
  Vec3 gravity = {0.0F, -9.81F, 0.0F};  ///< m/s^2
  GroundPlane ground;
  /// Whether bodies touch each other (docs/method.md §4). Needs packages with distance grids (section DIST,
  /// `field.distances`). Touches are no part of a saved state: friction starts anew when it is restored.
  bool collisions = false;
  bool report_contacts = false;  ///< whether World::contacts() is kept
  /// Time at rest after which a body falls asleep with all that it touches; asleep it costs nothing until something
  /// touches, changes or moves it. Over this time it has moved by less than 1e-3 diagonals a second (docs/method.md
  /// §3). s, 0..1e4; 0: never.
  float sleep_seconds = 0;
  /// Bound on the work of a step, 1..16: a piece takes at most twice as many iterations, four times where it touches
  /// colliders alone, fewer once it has settled. No stiffness: that does not depend on it (docs/method.md §3).
  std::uint32_t iterations = 4;
  /// Rate at which all velocity decays, as in air: v *= exp(-damping h). 1/s, 0..1e4.
  float damping = 0.2F;
  /// Inner friction: damping of all motion of a piece that is not rigid, and of contacts, as a ratio to critical
  /// damping. A swing keeps exp(-2 pi ratio) of itself in a period. 0..1
  float deformation_damping_ratio = 0.25F;
  /// Rate at which rotation decays of a piece that stands, leans, or hangs on pins or picks, so that soft bodies do not
  /// roll or swing for ever. 1/s, 0..1e4; 0 where balls are to roll.
  float support_damping = 4.0F;
  /// Length of the substeps that World::advance() takes. s, 1e-5..1
  float substep_seconds = 1.0F / 60;
  /// Most substeps of one call of World::advance(), 1..1000. The rest of a longer frame is left out: a world that is
  /// too slow then runs slow, and does not fall behind further and further.
  std::uint32_t most_substeps = 8;
  Vec3 wind = {0, 0, 0};     ///< velocity of the air, m/s, that bodies with a BodySettings::drag are in
  float air_density = 1.2F;  ///< kg/m^3, 0..1e4
};

/// Makes the solvers of one kind: see BodySettings::solver.
class SolverFactory;

/// Place, surface, layers and solver of a body, given when it is added.
struct BodySettings {
  Vec3 position = {0.0F, 0.0F,
                   0.0F};  ///< metres, added to the rest positions (and to the package's origin, which is dropped)
  Mat3 rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1};  ///< proper rotation about the package's origin, applied before position
  float stiffness_scale = 1.0F;                 ///< multiplies all frequencies, 0..1e6
  bool keep_previous = false;  ///< keeps the positions before each step, for VisualOutput::previous_positions; costs
                               ///< 12 bytes a physical vertex and their copy
  float friction = -1;         ///< Coulomb coefficient, 0..1e4: two that touch have the geometric mean of theirs; below
                               ///< 0: the collider's, or the ground's
  std::uint32_t layers = 1;    ///< bits, as ColliderSettings::layers. The ground is in layer 1 and touches all
  std::uint32_t touches = 0xFFFFFFFFU;
  /// Its surface touches itself, and its pieces touch each other, but for what they touch at rest. Costs a search in
  /// each step (docs/runtime.md). Bodies in fields only.
  bool self_contact = false;
  float gravity_scale = 1;  ///< times the world's gravity, -1e4..1e4
  /// How much the air drags at each part of the surface: force -1/2 density drag area |u| u, u the velocity against the
  /// wind, N (docs/method.md). A ball of drag coefficient c has c / 4. 0..1e4; 0: not at all. Bodies in fields only.
  float drag = 0;
  float support_damping = -1;  ///< WorldSettings::support_damping of this body, 0..1e4 1/s; below 0: the world's
  /// Level of detail: how often the functions of its package are halved (field.levels of the bake); more than the
  /// package has is its coarsest. Another one holds from the next step on, of what sleeps from when it wakes; what it
  /// takes of the shape is drawn on for 0.3 s, less and less. Bodies in fields only.
  std::uint32_t level = 0;
  bool package_pins = true;  ///< the body starts held by the pin sets of its package (World::pinSet)
  /// Solver of the body; null: one energy for each piece (docs/method.md). The other one is reportSolver() of
  /// sinew/runtime/report.h. Outlives the body.
  const SolverFactory* solver = nullptr;
};

}  // namespace sinew
