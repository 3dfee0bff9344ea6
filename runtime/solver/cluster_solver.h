// SPDX-License-Identifier: MIT
//
// The seam between a world and what moves its bodies: one solver for each body. A world holds, draws, saves and lends
// memory; how a body moves is behind this interface.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <memory_resource>
#include <new>
#include <span>
#include <utility>

#include "sinew/runtime/asset.h"
#include "sinew/runtime/settings.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

struct Body;
struct Collider;
struct SolverScratch;
struct PickedPoint;

/// The mean motion of a body.
struct WholeMotion {
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), velocity = Eigen::Vector3d::Zero(),
                  angular_velocity = Eigen::Vector3d::Zero();
};

/// The world of a step's bodies.
struct StepWorld {
  const WorldSettings& settings;
  std::span<const Collider* const> colliders;  ///< ids ascending, the ground first
};

/// Part of Body::x and v asked for: all of it, or the places alone that visual vertices hang on.
enum class Asked : std::uint8_t { all, drawn };

/// Moves one body. Body::x and v are its physical vertices, which refresh() brings up to date; all else that its motion
/// depends on is the solver's own. Only what says so may throw std::bad_alloc.
class BodySolver {
 public:
  virtual ~BodySolver() = default;

  /// Grows scratch to what step() and energy() take of it, and what is the body's own after holds have changed. May
  /// throw.
  virtual void reserve(SolverScratch& scratch) const = 0;
  /// At rest where the body was added; Body::x and v are there already.
  virtual void rest() = 0;
  /// Advances by one step, at whose end pins and pin sets are where `at` says. Sets Body::repaired. \param scratch
  /// reserved for it.
  virtual void step(const StepWorld& world, double seconds, SolverScratch& scratch) = 0;
  /// Brings Body::x and v up to date. \param part of the last step that has passed, 0..1, for what is drawn between
  /// two states; a solver that keeps no earlier state shows the last one.
  virtual void refresh(double part, Asked what) = 0;
  /// Takes Body::x and v, which were set from outside.
  virtual void takeState() = 0;
  /// Pins, pin sets or picks have come or gone. \pre refresh(1, Asked::all)
  virtual void holdsChanged() = 0;
  /// A step of so many seconds begins, on the level of detail that BodySettings::level asks for. May throw.
  virtual void beginStep(double) {}
  /// Where the body is becomes rotation x + translation, and its motion turns along.
  virtual void move(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) = 0;
  /// Body::activation has changed. May throw.
  virtual void activationChanged() = 0;
  /// A cluster's rest shape as it is made permanent and activated (World::clusterRestShape).
  virtual Eigen::Matrix3f restShape(std::uint32_t cluster) const = 0;
  virtual BodyEnergy energy(SolverScratch& scratch) = 0;
  /// Gives it an impulse, N s. \param point no weights: on all of it alike.
  virtual void push(const PickedPoint& point, const Eigen::Vector3d& impulse) = 0;
  virtual WholeMotion motion() const = 0;
  /// Adds a rigid motion: velocities, m/s and rad/s, about a place.
  virtual void addMotion(const Eigen::Vector3d& linear, const Eigen::Vector3d& angular,
                         const Eigen::Vector3d& about) = 0;

  /// Bytes of the motion's state beside Body's own members.
  virtual std::size_t stateBytes() const = 0;
  virtual void save(std::span<std::byte> bytes) const = 0;
  /// Whether these can be restored.
  virtual bool accepts(std::span<const std::byte> bytes) const = 0;
  /// \pre accepts(bytes); Body's own members are restored already.
  virtual void restore(std::span<const std::byte> bytes) = 0;
};

/// Gives a solver back to the memory resource it was made in.
struct SolverRelease {
  std::pmr::memory_resource* memory = nullptr;
  std::size_t bytes = 0, alignment = 1;
  void operator()(BodySolver* solver) const {
    solver->~BodySolver();
    memory->deallocate(solver, bytes, alignment);
  }
};
using SolverPointer = std::unique_ptr<BodySolver, SolverRelease>;

/// A solver of a kind, made in a memory resource. May throw.
template <class Kind, class... Arguments>
SolverPointer makeSolver(std::pmr::memory_resource* memory, Arguments&&... arguments) {
  void* const place = memory->allocate(sizeof(Kind), alignof(Kind));
  try {
    return {new (place) Kind(std::forward<Arguments>(arguments)...),
            SolverRelease{memory, sizeof(Kind), alignof(Kind)}};
  } catch (...) {
    memory->deallocate(place, sizeof(Kind), alignof(Kind));
    throw;
  }
}

/// Moves bodies in the fields of their packages (docs/method.md).
const SolverFactory& coupledSolver();

}  // namespace sinew::internal

namespace sinew {

/// Makes the solvers of one kind: what BodySettings::solver points to.
class SolverFactory {
 public:
  /// Why it cannot move bodies of an asset; null if it can.
  virtual const char* faultOf(const Asset& asset) const = 0;
  /// \param body outlives the solver. \param memory all that the solver keeps comes from there. May throw.
  virtual internal::SolverPointer make(internal::Body& body, std::pmr::memory_resource* memory) const = 0;

 protected:
  ~SolverFactory() = default;
};

}  // namespace sinew
