// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <memory_resource>
#include <mutex>
#include <span>

#include "runtime/attach/history.h"
#include "runtime/contact/collider.h"
#include "runtime/load/rest_constants.h"
#include "runtime/memory/array.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/solver/piece.h"
#include "sinew/runtime/asset.h"
#include "sinew/runtime/settings.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

/// A physical vertex held at a place.
struct Pin {
  std::uint32_t vertex;
  Vec3 before;  ///< where it was held before the last step, metres, world
  Vec3 at;      ///< where it is held
  Vec3 target;  ///< where it is to be held
};

/// A vertex of a pin set.
struct PinnedVertex {
  std::uint32_t vertex;
  float weight;     ///< 0..1; 1 = exact
  Vec3 local = {};  ///< place in the set's transform, metres
};

/// Vertices attached to a rigid transform.
struct PinSet {
  std::uint32_t id = 0;
  std::uint32_t source = formats::kNone;  ///< element of the package's PSET; none: the game's own
  PinMethod method = PinMethod::constrained_fit;
  RigidTransform before;  ///< where it was before the last step
  RigidTransform at;      ///< where it is
  RigidTransform target;  ///< where it is to go
  Array<PinnedVertex> vertices;
  // Reaction of the last step, a sum over vertices and functions: N, and N m about `at`.
  Eigen::Vector3d force_sum = Eigen::Vector3d::Zero(), torque_sum = Eigen::Vector3d::Zero();

  explicit PinSet(std::pmr::memory_resource* memory) : vertices(memory) {}
  PinSet(PinSet&& other) noexcept = default;
  PinSet& operator=(PinSet&& other) = delete;
  PinSet(const PinSet&) = delete;
  PinSet& operator=(const PinSet&) = delete;
  ~PinSet() = default;
};

/// A point of a body: weights of physical vertices.
struct PickedPoint {
  std::array<std::uint32_t, 12> vertex = {};
  std::array<double, 12> weight = {};  ///< behind the first that is 0 all are
};

/// A spring between a point and a target.
struct Pick {
  std::uint32_t id;
  std::uint32_t locked;  ///< 1: letGoPick() leaves it
  BodyPoint at;
  PickedPoint point;  ///< where `at` is attached
  Vec3 target;
  float frequency_hz;
  float most_force;  ///< N; 0: what reachOf() says (interact/picked_point.h)
};

/// A force that acts in the next step.
struct PointForce {
  PickedPoint point;  ///< no weights: on all of the body alike
  Vec3 force;         ///< N
};

/// State of one body. Constants stay in the asset.
struct Body {
  /// At rest at its place; reset() is due before anything else is asked of it.
  /// \param factory makes the solver. \param memory all that the body keeps comes from there.
  Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings, const SolverFactory& factory,
       std::pmr::memory_resource* memory);

  const formats::PackageView& package() const { return asset->package(); }
  const RestConstants& rest() const { return asset->constants(); }
  std::span<const formats::PhysicalVertex> vertices() const { return package().physicalVertices(); }
  std::uint32_t vertexCount() const { return std::uint32_t(vertices().size()); }
  std::uint32_t clusterCount() const { return std::uint32_t(package().clusters().size()); }
  std::span<const Vec3> positions() const { return {x.data(), vertexCount()}; }

  /// Back to the rest shape at the place it was added; nothing held but by its pin sets.
  void reset();
  /// All of x and v are those of the pieces, at the end of the last step.
  void setCurrent() {
    outdated = false;
    whole = true;
    shown = 1;
  }

  std::uint32_t id = 0;  ///< BodyId
  std::shared_ptr<const Asset> asset;
  BodySettings settings;

  // By physical vertex, and one more: kernels read triples as 16 bytes.
  Array<Vec3> x;  ///< positions, metres, world
  Array<Vec3> v;  ///< velocities, m/s
  Array<std::uint8_t> pinned;

  Array<Pin> pins;  ///< vertices ascending
  Array<Pick> picks;
  Array<PointForce> forces;
  OwningArray<PinSet> pin_sets;
  Array<float> activation;  ///< by channel of the package, 0..1

  /// Of a body that moves in fields (sections FELD): its pieces, in the package's order. x and v are made from their
  /// coefficients when somebody asks.
  OwningArray<Piece> pieces;
  bool outdated = false;                                ///< x and v are not those of the pieces
  bool whole = true;                                    ///< all of them are, not only what drawing asks for
  double shown = 1;                                     ///< part of the last step that x and v show
  Array<float> coefficients, field_values, amplitudes;  // scratch of refresh(), as shape
  Array<Vector3d> shape;
  HoldWays ways;

  // Shape that the last change of level has lost: drawn on for a while.
  double fade_left = 0, fade_before = 0;  ///< how long, s: now, and as the last step began
  Array<Vec3> faded;                      ///< by physical vertex, in the frame of its piece, m

  Array<ColliderTouch> touches;  ///< of the last step that it was awake in, piece by piece
  double touches_in = 0;         ///< its length, s
  Array<std::uint32_t> touched;  ///< colliders that events have said it touches

  double still = 0;                            ///< how long it has rested, s
  std::uint32_t sleeps_with = formats::kNone;  ///< the first body of those it fell asleep with; kNone: it is awake
  bool asleep() const { return sleeps_with != formats::kNone; }
  /// An inactive body is asleep, and nothing wakes it.
  Activity activity = Activity::active;

  std::uint32_t repaired = 0;  ///< vertices whose state was lost in the last step

  History history;  ///< for motion vectors

  std::atomic<bool> listed{false};  ///< among the bodies that a call draws
  std::mutex showing;               ///< held while x and v are made

  SolverPointer solver;  ///< what moves it
};

/// Gives a body back to the memory resource it was made in.
struct BodyRelease {
  std::pmr::memory_resource* memory = nullptr;
  void operator()(Body* body) const {
    body->~Body();
    memory->deallocate(body, sizeof(Body), alignof(Body));
  }
};
using BodyPointer = std::unique_ptr<Body, BodyRelease>;

/// A body at rest, as Body's constructor makes it. May throw.
BodyPointer makeBody(std::shared_ptr<const Asset> asset, const BodySettings& settings, const SolverFactory& factory,
                     std::pmr::memory_resource* memory);

/// Bodies of a world, ids ascending.
using BodyList = OwningArray<BodyPointer>;

/// Rigid motion that best maps the rest shape onto the current one, mass-weighted: x ~ rotation X + position. Vertices
/// that are not usable do not count; where none is, the place where the body was added. \param run of vertices.
RigidTransform rigidMotionOf(const Body& body, VertexRun run);
inline RigidTransform rigidMotionOf(const Body& body) { return rigidMotionOf(body, {0, body.vertexCount()}); }

/// Of its physical vertices.
WholeMotion motionOfVertices(const Body& body);

/// Colliders that the body touched as the last step ended, ids ascending, in place of what `ids` holds. May throw.
void findTouched(const Body& body, Array<std::uint32_t>& ids);

/// Vertices that are not usable move along with the others of their piece, as the rest shape has them. \return how many
/// there are.
std::uint32_t replaceUnusable(Body& body);

/// Largest position (m) and velocity (m/s) of a state that is not lost: the square of more is no float.
inline constexpr float kLargestPosition = formats::kMostMetres, kLargestVelocity = 1e17F;

/// Whether a vertex can be stepped: position and velocity finite and not lost.
inline bool stateIsUsable(const Vec3& x, const Vec3& v) {
  bool usable = true;
  for (std::size_t c = 0; c < 3; ++c) {
    usable &= std::abs(x[c]) <= kLargestPosition && std::abs(v[c]) <= kLargestVelocity;
  }
  return usable;
}

}  // namespace sinew::internal
