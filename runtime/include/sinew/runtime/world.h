// SPDX-License-Identifier: MIT
//
// The whole of a simulation: load an Asset, add bodies of it to a World, step, read visual vertices.
// samples/hello_runtime shows it in one page.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <memory_resource>
#include <optional>
#include <span>
#include <string_view>

#include "sinew/runtime/asset.h"
#include "sinew/runtime/collider.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/log.h"
#include "sinew/runtime/output.h"
#include "sinew/runtime/query.h"
#include "sinew/runtime/result.h"
#include "sinew/runtime/settings.h"

namespace sinew {

namespace internal {
struct WorldAccess;
}

/// Names a body of one world; never reused within it.
struct BodyId {
  std::uint32_t value = formats::kNone;
  bool operator==(const BodyId&) const = default;
};

/// Names a pick (a spring between a point of a body and a target).
struct PickId {
  std::uint32_t value = formats::kNone;
  bool operator==(const PickId&) const = default;
};

/// How a pick pulls.
struct PickSettings {
  /// Of the spring for the part of the body that it moves (docs/method.md): it grows with that mass. 0.1 .. 100,
  /// critically damped.
  float frequency_hz = 4;
  /// N, what the spring pulls with at most however far its target is; 0: 50 times the body's weight on Earth; infinity:
  /// no bound.
  float most_force = 0;
};

/// A pick as it is now.
struct PickState {
  BodyId body;
  BodyPoint at;
  Vec3 point = {0, 0, 0}, target = {0, 0, 0};  ///< where that lies, and where it is pulled to, metres, world
  bool locked = false;
};

/// The mean motion of a body's mass.
struct BodyMotion {
  Vec3 center = {0, 0, 0};            ///< of mass, metres, world
  Vec3 velocity = {0, 0, 0};          ///< m/s
  Vec3 angular_velocity = {0, 0, 0};  ///< rad/s: angular momentum about the centre over the inertia as it lies
  float mass = 0;                     ///< kg
};

/// A body's role in its world.
enum class Activity : std::uint32_t {
  active = 0,
  paused = 1,    ///< it stands where it is as if it were rock: others touch it, queries find it
  disabled = 2,  ///< it stands, and neither touches nor is found; it can be drawn
};

/// Energy of a body, joule.
struct BodyEnergy {
  double kinetic = 0;
  double elastic = 0;  ///< that its shape stores; 0 where the report's solver moves it, which has none
};

/// Names a pin set of one world; never reused within it.
struct PinSetId {
  std::uint32_t value = formats::kNone;
  bool operator==(const PinSetId&) const = default;
};

/// Resources of a world from its creation to its end. All outlive the world.
struct WorldResources {
  /// Where all state of the world and its bodies lives; null: std::pmr::get_default_resource(). Must be safe to call
  /// from several threads if worlds that share it are, or calls on one world. Assets have their own.
  std::pmr::memory_resource* memory = nullptr;
  JobSystem* jobs = nullptr;  ///< null: everything runs in the calling thread
  LogSink* log = nullptr;     ///< null: silent
};

/// Outputs of a body's visual mesh, for World::visualVertices() of several.
struct BodyOutput {
  BodyId body;
  VisualOutput output;
};

/// Bodies that step together.
///
/// Threads: a call that changes a world, or energy(), must not overlap any other on it, from whatever thread. Other
/// const calls may run side by side in several threads (WorldResources::memory and LogSink must then be safe to call
/// from these), but drawing calls must not overlap state calls. Drawing calls show bodies as they are drawn:
/// visualVertices(), visualSubMesh(), visualBounds(), nearestPoint(), casts, overlaps(). State calls tell of them after
/// the last step: positions(), velocities(), motion(), placeOf(), pickAlong(), pickState(), physicalBounds(),
/// rigidMotion(), clusterFrame(), saved states and snapshots. Of two calls that break this, the later one is refused:
/// it tells the log, does nothing and returns what it returns for an unknown body. A call waits only for one that shows
/// the same body. Not guarded are settings(), asset() and reading through a returned reference or span, which is valid
/// until the next call that changes the world. Callbacks (memory, jobs, log) must not call the world.
/// Different worlds are independent, and may share assets. Same input, same state, bit for bit, for any job system.
/// Failures: no call throws, once there is a world. A call with an unknown body (or vertex, pick, sub-mesh) does
/// nothing and tells the log sink; a call that runs out of memory as well, and leaves the world as it was (step: in a
/// state that may be stepped on). step() allocates nothing from the second one on, unless bodies, pins or picks came in
/// between, or more touches than before (WorldSettings::collisions).
class SINEW_API World {
 public:
  /// A world without bodies, or why there is none: a value of the settings out of its range, no memory. Never throws.
  static Result<World> create(const WorldSettings& settings, const WorldResources& resources) noexcept;
  /// The same for programs that use exceptions: std::bad_alloc where memory runs out.
  explicit World(const WorldSettings& settings = {}, JobSystem* jobs = nullptr);
  World(const WorldSettings& settings, const WorldResources& resources);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  /// To be changed between other calls: nothing guards them.
  WorldSettings& settings();
  const WorldSettings& settings() const;

  /// Adds an instance of a package, at rest. A package with several separate pieces (BODY) is one Body here; they fall
  /// independently. Fails where settings are no numbers, the package has no fields (only BodySettings::solver of the
  /// report moves such), memory runs out, or this build lacks kernels for the processor.
  Result<BodyId> addBody(std::shared_ptr<const Asset> asset, const BodySettings& settings = {});
  /// Its picks and pins go with it; the id is never used again.
  void removeBody(BodyId body);
  bool contains(BodyId body) const;
  /// Back to the state in which it was added; pins and picks are let go, and the package's pin sets hold as at the
  /// start, with new ids.
  void resetBody(BodyId body);

  /// Whether it rests and is not stepped (WorldSettings::sleep_seconds). Every call that changes a body or what it may
  /// touch wakes it, with all that fell asleep with it.
  bool isAsleep(BodyId body) const;
  void wake(BodyId body);

  /// Moves a body as it is: x becomes rotation x + translation; velocities, pins' and picks' targets, previous
  /// positions and all memory of forces turn along, so that it goes on as if it had always been there. \param rotation
  /// proper, within 1e-3 (made exact). \param translation metres, finite.
  void teleport(BodyId body, const Mat3& rotation, Vec3 translation);
  /// Teleports a body by the rigid motion that takes what its pins and pin sets hold nearest to where their targets
  /// would have it: after a jump of the skeleton. What bones have moved against one another is left for the next step.
  void snapToPins(BodyId body);

  /// The state of a body as bytes: all that its further motion depends on but the world's settings. Restored into a
  /// body of the same package, in any world with the same settings, it goes on bit for bit as the saved one did. For
  /// one version of the library: not a file format.
  std::size_t stateBytes(BodyId body) const;
  /// \param bytes at least stateBytes(). \return bytes written, 0 where `bytes` is too small.
  std::size_t saveState(BodyId body, std::span<std::byte> bytes) const;
  /// Picks come back with their ids, or with new ones (see picks()) where another body of this world has them.
  /// \return bytes used, or why the body was left as it was.
  Result<std::size_t> restoreState(BodyId body, std::span<const std::byte> bytes);

  /// \pre contains(body), and no call that changes the world overlaps.
  const Asset& asset(BodyId body) const;

  /// The bodies, colliders (without the ground) and pin sets there are into `ids`, as many as fit, oldest first.
  /// \return how many there are.
  std::size_t bodies(std::span<BodyId> ids) const;
  std::size_t colliders(std::span<ColliderId> ids) const;
  std::size_t pinSets(BodyId body, std::span<PinSetId> ids) const;

  /// The state of all of it as bytes: settings, bodies, colliders with their shapes, touches, what frames have left
  /// over, ids. Later steps are the same bit for bit where it is restored. For one version of the library.
  std::size_t snapshotBytes() const;
  /// \param bytes at least snapshotBytes(). \return bytes written, 0 where `bytes` is too small.
  std::size_t saveSnapshot(std::span<std::byte> bytes) const;
  /// Makes this world, or a new one, the one that was saved: bodies and colliders that came since go, removed ones
  /// come back with their ids, and ids given since are given again. \param assets of bodies that this world has not,
  /// in any order; such bodies move in fields. \return bytes used, or why the world was left as it was.
  Result<std::size_t> restoreSnapshot(std::span<const std::byte> bytes,
                                      std::span<const std::shared_ptr<const Asset>> assets = {});

  /// The settings it has; the default ones for an unknown body.
  const BodySettings& bodySettings(BodyId body) const;
  /// Changes friction, layers, touches, self_contact, gravity_scale, drag, support_damping and level; the others stay
  /// as they were given to addBody(). \return false, and nothing is done, where one is out of range.
  bool setBodySettings(BodyId body, const BodySettings& settings);
  /// Stops a body or lets it go on: from rest where it was stopped and moved, else with the motion that it had; where
  /// its pins have been told to go meanwhile it goes with them first (snapToPins()).
  void setActivity(BodyId body, Activity activity);
  Activity activity(BodyId body) const;

  /// Advances all bodies. \param seconds step length, > 0 and at most 60 (1e-5 .. 1 s is tested); other values do
  /// nothing.
  void step(float seconds);
  /// Advances all bodies by the time of a frame, however long, in substeps of WorldSettings::substep_seconds. What
  /// is left over counts for the next call, and what is drawn (visualVertices(), visualSubMesh(), visualBounds()) lies
  /// between the last two substeps, one substep before the end of the frame, so that nothing stutters and no motion
  /// depends on the rate of frames; drawnPose() is where pin sets and colliders are then. All other calls see the state
  /// after the last substep. Pin sets and pins reach their targets evenly over the substeps
  /// of a call. \param seconds 0 .. 60; other values do nothing. \return substeps taken, perhaps none.
  std::uint32_t advance(float seconds);

  /// Positions (metres, world) and velocities (m/s) of the physical vertices, in the package's order.
  std::span<const Vec3> positions(BodyId body) const;
  std::span<const Vec3> velocities(BodyId body) const;
  /// Vertices of pieces whose state was not finite after the last step, or too far away for numbers (as what falls for
  /// hours without a ground). These pieces came back at rest to where the body was added.
  std::uint32_t repairedVertices(BodyId body) const;
  /// Sets the whole state; sizes must equal the vertex count. Velocities may be empty (zero). The body takes the
  /// nearest shape and motion that its fields can have (docs/method.md): positions() tell which. A vertex not finite or
  /// beyond 1e15 m is put where the others of its piece have it.
  void setState(BodyId body, std::span<const Vec3> positions, std::span<const Vec3> velocities);

  /// Gives a body momentum at a point, or all of its mass alike: its momentum changes by the impulse to rounding, and
  /// its angular momentum by that about the point. Vertices held by package pin sets take none. \param impulse N s.
  void addImpulse(BodyId body, const BodyPoint& at, Vec3 impulse);
  void addImpulse(BodyId body, Vec3 impulse);
  /// A force in the next step, or call of advance() that takes one, at a point that it follows, or on all of the mass
  /// alike; several add up. \param force N, its direction in the world.
  void addForce(BodyId body, const BodyPoint& at, Vec3 force);
  void addForce(BodyId body, Vec3 force);
  BodyMotion motion(BodyId body) const;
  /// Makes this the mean motion of a body; how it deforms, and its pieces move among each other, stays.
  void setVelocity(BodyId body, Vec3 velocity, Vec3 angular_velocity = {0, 0, 0});
  /// The point of the drawn surface that lies nearest to a place (metres, world); all weights 0 where nothing is drawn.
  BodyPoint nearestPoint(BodyId body, Vec3 place) const;
  /// Where a point lies, metres, world.
  Vec3 placeOf(BodyId body, const BodyPoint& at) const;

  /// Holds a physical vertex at a place until unpinned; call again to move it. Ignored for a vertex of a pin set.
  /// \param target metres, world.
  void pin(BodyId body, std::uint32_t vertex, Vec3 target);
  void unpin(BodyId body, std::uint32_t vertex);
  /// Lets go of all pins and pin sets of a body.
  void unpinAll(BodyId body);

  /// Attaches physical vertices to a rigid transform, at the places that they have now, until the set is removed.
  /// A vertex whose pin weight in the package is 0 is left out; a weight between 0 and 1 makes a softer spring of it.
  /// \param vertices numbers of physical vertices, each at most once and in no other set. \param at where the transform
  /// is now. \return an error that says which argument is wrong.
  Result<PinSetId> addPinSet(BodyId body, std::span<const std::uint32_t> vertices, const RigidTransform& at = {},
                             PinMethod method = PinMethod::constrained_fit);
  /// Moves the transform: reached at the end of the next step, or of the time of the next call of advance(), whose last
  /// step stops before it by what is left over. Ignored where it is not finite or not a proper rotation.
  void movePinSet(PinSetId set, const RigidTransform& to);
  /// Where it is in what is drawn; of an unknown one the identity.
  RigidTransform drawnPose(PinSetId set) const;
  void removePinSet(PinSetId set);
  /// The pin set that the package names so (PSET): a body holds them all from the start, unless its BodySettings say
  /// otherwise. Their transform is that of the rest shape: at {R, t} a vertex is held at R X + t, X in the package's
  /// coordinates, those of the artist's model less PackageInfo::origin. A bone's skinning matrix {R, s}, (bone now) *
  /// (bone at rest)^-1 in the model's coordinates, is {R, s + R origin}. At the start it is where the body was added. A
  /// vertex of several sets is held by the first (a bake leaves it to the firmest alone). \return an unknown id where
  /// there is none, or where it was let go.
  PinSetId pinSet(BodyId body, std::string_view name) const;
  /// movePinSet() for all of the package's pin sets that follow `target` (the recipe's: "world", a bone's name).
  /// \return how many there are.
  std::uint32_t movePinTarget(BodyId body, std::string_view target, const RigidTransform& to);
  /// Force and torque on the transform's owner; zero before the first step and for an unknown set.
  PinReaction pinReaction(PinSetId set) const;

  /// Contracts the fibres that a channel of the package activates. \param value 0 (rest) .. 1, clamped. \return false,
  /// and nothing is done, where the package has no such channel or the value is not a number.
  bool setActivation(BodyId body, std::uint32_t channel, float value);
  bool setActivation(BodyId body, std::string_view channel, float value);

  /// Adds what bodies collide with (docs/runtime.md). \return an error that says which argument is wrong.
  Result<ColliderId> addCollider(const ColliderShape& shape, const ColliderSettings& settings = {});
  /// Moves it, as movePinSet(), so that its speed is known and takes bodies along. For a jump, remove and add it.
  /// Ignored where `to` is not finite or not a proper rotation.
  void moveCollider(ColliderId collider, const RigidTransform& to);
  /// Where it is after the last step: not where it was told to go where it follows slowly or, having a mass, gives way.
  /// An engine's rigid body goes on from here.
  RigidTransform colliderPose(ColliderId collider) const;
  /// Where it is in what is drawn.
  RigidTransform drawnPose(ColliderId collider) const;
  /// Of an unknown one the defaults.
  ColliderSettings colliderSettings(ColliderId collider) const;
  /// Changes all but `at`. \return false, and nothing is done, where one is out of range.
  bool setColliderSettings(ColliderId collider, const ColliderSettings& settings);
  /// Bodies that touched it have an event of the end in the next step.
  void removeCollider(ColliderId collider);
  /// Bodies' impulse on it in the last step, or call of advance(). \param collider kGroundCollider too.
  ColliderReaction colliderReaction(ColliderId collider) const;
  /// Which pairs of a body and a collider, or of bodies, began or ceased to touch in the last step, or call of
  /// advance(), in order; those of bodies that were removed are left out. Valid until the next call that is not const.
  std::span<const ContactEvent> contactEvents() const;
  /// All that pushed a body in the last step, or call of advance(), once for each pair, where it did, how hard and how
  /// fast it came: by bodies, then colliders, then second bodies, which have the higher ids. What sleeps is among them.
  /// Valid until the next call that is not const. \pre WorldSettings::report_contacts; else there are none.
  std::span<const BodyContact> contacts() const;

  /// A ray's first hit from outside: objects it begins in are passed over. Costs a body what drawing it does, so ask
  /// for bodies where they are near. \param direction unit. \param distance m, how far the ray goes.
  std::optional<CastHit> rayCast(Vec3 origin, Vec3 direction, float distance, const QueryFilter& filter = {}) const;
  /// The same of a ball, within 1e-4 of its radius. A touch at the start is a hit at once. \param radius m, > 0.
  std::optional<CastHit> sphereCast(Vec3 origin, float radius, Vec3 direction, float distance,
                                    const QueryFilter& filter = {}) const;
  /// Objects that touch or contain a ball or a box, into `found`, as many as fit: bodies by their ids, then colliders.
  /// \param at of the box. \return how many there are.
  std::size_t overlaps(Vec3 center, float radius, std::span<QueryObject> found, const QueryFilter& filter = {}) const;
  std::size_t overlaps(const BoxShape& box, const RigidTransform& at, std::span<QueryObject> found,
                       const QueryFilter& filter = {}) const;

  /// Starts pulling a point of a body towards `target` (metres, world): what a cursor does that has grabbed it.
  PickId pick(BodyId body, const BodyPoint& at, Vec3 target, const PickSettings& settings = {});
  /// The same of a visual vertex.
  PickId pick(BodyId body, std::uint32_t visual_vertex, Vec3 target, float frequency_hz = 4.0F, float most_force = 0);
  /// The same of what a ray meets first, pulled to where it is: rayCast(). Unknown where that is no body.
  PickId pickRay(Vec3 origin, Vec3 direction, float distance, const PickSettings& settings = {},
                 const QueryFilter& filter = {});
  /// The pick whose target or point lies nearest to a ray, within `radius` of it (m): to take it up again, by
  /// movePick(). Unknown where there is none. \param direction unit.
  PickId pickAlong(Vec3 origin, Vec3 direction, float distance, float radius) const;
  void movePick(PickId pick, Vec3 target);
  /// A locked pick stays where letGoPick() leaves it.
  void lockPick(PickId pick, bool locked = true);
  /// A cursor lets go: releases the pick unless it is locked.
  void letGoPick(PickId pick);
  void releasePick(PickId pick);
  /// All picks of a body, or of the world.
  void releasePicks(BodyId body);
  void releasePicks();
  PickState pickState(PickId pick) const;

  /// The ids of a body's picks into `ids`, as many as fit, oldest first. \return how many it has.
  std::size_t picks(BodyId body, std::span<PickId> ids) const;

  /// Writes the deformed visual mesh (docs/report.md §6).
  void visualVertices(BodyId body, const VisualOutput& output) const;
  /// Only the visual vertices that a sub-mesh's triangles use (section VSUB), at their places in the whole mesh.
  void visualSubMesh(BodyId body, std::uint32_t sub_mesh, const VisualOutput& output) const;
  /// The same of several bodies, each at most once: side by side, by the world's job system.
  void visualVertices(std::span<const BodyOutput> outputs) const;
  /// Positions and normals alone.
  void visualVertices(BodyId body, StridedFloat3 positions, StridedFloat3 normals) const {
    visualVertices(body, {positions, normals, {}, {}});
  }

  /// Box around the physical vertices, and around the visual ones. Cheaper by far:
  /// the physical one; it holds the visual mesh too where that lies within the tetrahedra.
  Bounds physicalBounds(BodyId body) const;
  Bounds visualBounds(BodyId body) const;

  /// Kinetic energy of a body, and that stored in its shape: the energy that its steps minimize.
  BodyEnergy energy(BodyId body) const;

  /// Moves the origin: all bodies, targets and the ground are `by` nearer to it. Fields keep every digit.
  /// \param by metres, finite.
  void shiftOrigin(Vec3 by);

  /// Rigid motion that best maps the rest shape onto the current one (mass-weighted): x ~ rotation * X + translation.
  void rigidMotion(BodyId body, Mat3& rotation, Vec3& translation) const;

  /// The transform of a cluster that best fits the current positions, for overlays: its centre (metres, world) and
  /// linear part.
  void clusterFrame(BodyId body, std::uint32_t cluster, Vec3& center, Mat3& linear) const;
  /// Change of a cluster's rest shape by plasticity and activation (docs/method.md): S, of X relative to the
  /// cluster's rest centre. The identity where it has neither, and for an unknown cluster.
  Mat3 clusterRestShape(BodyId body, std::uint32_t cluster) const;

 private:
  friend struct internal::WorldAccess;  // the C interface, the library sinew::cut
  struct Impl;
  struct Release {
    void operator()(Impl* impl) const;
  };
  std::unique_ptr<Impl, Release> impl_;
};

}  // namespace sinew
