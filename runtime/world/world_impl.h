// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <atomic>
#include <functional>
#include <memory>
#include <memory_resource>
#include <mutex>
#include <new>
#include <span>
#include <utility>
#include <vector>

#include "runtime/attach/visual.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/step/sleep.h"
#include "runtime/step/world_step.h"
#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew {

inline internal::Vector3d wide(const Vec3& v) { return internal::asVector(v).cast<double>(); }

namespace internal {
/// Finite, orthonormal to 1e-3 and not mirrored.
bool isProper(const Mat3& rotation);
/// The same with a finite position.
bool isProper(const RigidTransform& transform);
/// What is wrong with them, or null.
const char* faultOf(const ColliderSettings& settings);

/// What World::contacts() tells of a pair.
struct ContactSum {
  std::array<std::uint32_t, 3> key;     ///< body, collider, second body
  Vector3d impulse = Vector3d::Zero();  ///< on the body, N s
  Vector3d push = Vector3d::Zero();     ///< the same without friction
  Vector3d place = Vector3d::Zero();    ///< loads times where they push, N s m
  double load = 0;                      ///< along the normals, N s
  float speed = 0;                      ///< BodyContact::speed

  void add(const ContactSum& other);
  BodyContact told() const;
};

/// Why saved bytes cannot be restored into a body; empty if they can.
const char* faultOfState(std::span<const std::byte> bytes, const Body& body);
/// Why settings that may change are refused; null if they are not.
const char* faultOf(const BodySettings& settings);
/// The first value of a world's settings that is out of its range; null where none is.
const char* faultyValue(const WorldSettings& settings);
}  // namespace internal

struct SINEW_HIDDEN World::Impl {
  Impl(const WorldSettings& world_settings, const WorldResources& resources);

  /// A body and its place in `bodies`; (nullptr, its place if it were there) of one that is not in this world.
  std::pair<internal::Body*, std::size_t> locate(BodyId id) const;
  internal::Body* find(BodyId id) const { return locate(id).first; }

  /// x and v of a body as it is drawn; waits for another call that makes them.
  void showDrawn(internal::Body& body) const { show(body, shown, internal::Asked::drawn); }
  /// x and v after the last step; waits in the same way.
  void showLast(internal::Body& body) const { show(body, 1, internal::Asked::all); }
  static void show(internal::Body& body, double part, internal::Asked what) {
    const std::lock_guard lock(body.showing);
    body.solver->refresh(part, what);
  }
  /// Wakes a body whose holds (pins, picks) changed. \pre its x and v, which follow from the last step's holds,
  /// were made before: showLast()
  void holdsChanged(internal::Body& body);

  /// The body and place of a pick; (nullptr, 0) where it was let go.
  std::pair<internal::Body*, std::size_t> findPick(PickId id) const;
  /// The same of a pin set.
  std::pair<internal::Body*, std::size_t> findPinSet(PinSetId id) const;

  /// One line to the log sink, printf-style; no allocation.
  [[gnu::format(printf, 3, 4)]] void tell(LogSeverity severity, const char* format, ...) const;

  /// Tells the log why a call is refused, and hands the reason on.
  [[gnu::format(printf, 2, 3)]] Error refuse(const char* format, ...) const;

  /// Runs work() where memory may run out or a callback of the caller's may throw; tells the log and returns
  /// `otherwise` then.
  template <class Result, class Work>
  Result guarded(const char* call, Result otherwise, const Work& work) const noexcept {
    try {
      return work();
    } catch (const std::bad_alloc&) {
      tell(LogSeverity::error, "%s: out of memory", call);
    } catch (...) {
      tell(LogSeverity::error, "%s: a callback threw an exception", call);
    }
    return otherwise;
  }

  /// Lifts drawn vertices out of colliders: contacts give way by the compliance that a field of few functions lacks.
  void liftFromColliders(const internal::Body& body, std::span<const VertexRun> runs, const StridedFloat3& out) const;
  /// \param with that share the work; null: none. May throw std::bad_alloc.
  void draw(const internal::Body& body, std::span<const VertexRun> runs, const VisualOutput& output,
            JobSystem* with) const;
  /// The same where all is sound and there is memory; else it tells the log.
  void writeVisual(const char* call, const internal::Body& body, std::span<const VertexRun> runs,
                   const VisualOutput& output) const;
  bool isSound(const char* call, const VisualOutput& output) const;

  /// The presence of a public call from its first look at the world to its end. False where it is refused, for one that
  /// it must not meet is there, and the log told.
  class SINEW_API Presence {  // sinew::cut's too
   public:
    /// x and v of bodies are made when asked for, as they are drawn or as the last step left them: those who draw and
    /// those who read do not meet. Whoever changes meets nobody, nor does a step.
    enum class As : std::uint8_t {
      looks,  ///< at all but x and v
      draws,
      reads,
      changes,
      steps,
    };
    Presence(const Impl& impl, const char* call, As as);
    ~Presence();
    Presence(const Presence&) = delete;
    Presence& operator=(const Presence&) = delete;
    explicit operator bool() const { return entered_; }
    Error refusal() const;
    /// Calls that this thread makes on the world until the end of this one are parts of it.
    void lend();

    /// The object of a call: null where it is refused, or, as the log is told, where there is none.
    internal::Body* find(BodyId id) const;
    std::pair<internal::Body*, std::size_t> find(PickId id) const;
    std::pair<internal::Body*, std::size_t> find(PinSetId id) const;
    internal::Collider* find(ColliderId id) const;
    /// The same with its x and v: as it is drawn for who draws, else after the last step.
    internal::Body* seen(BodyId id) const;

   private:
    const Impl& impl_;
    const char* call_;
    As as_;
    bool entered_ = false, owns_ = false, lends_ = false;
    const char* met_ = nullptr;          ///< what who is there does
    const void* lent_before_ = nullptr;  ///< by an outer call
  };
  using As = Presence::As;

  /// The settings with every value legal; the log names each value that was replaced.
  WorldSettings soundSettings(const char* call);
  /// A step begins: what is drawn becomes the previous positions. May throw std::bad_alloc.
  void keepDrawn();
  /// A collider and its place in `colliders`; (nullptr, its place if it were there) of one that is not in this world.
  std::pair<internal::Collider*, std::size_t> locate(ColliderId id);
  /// The collider of a number, the ground's too; null where there is none.
  const internal::Collider* colliderOf(std::uint32_t id) const;
  /// A step, or a call of advance(), begins: nothing has touched in it.
  void forgetTouches();
  /// Reactions and events of a step. May throw std::bad_alloc.
  void gatherTouches(double seconds);
  /// Adds a step's to `contacts`. May throw std::bad_alloc.
  void gatherContacts(double seconds);
  /// Pairs of bodies that push each other, into `touching`.
  void findTouching();
  /// Events of what findTouching() finds, against what it found before. May throw std::bad_alloc.
  void tellTouching();

  /// Visual vertices as they are drawn. May throw.
  void drawInto(const internal::Body& body, internal::Array<Vec3>& drawn) const;
  /// Calls visit with the visual vertices of each body that a filter lets through. May throw.
  void forEachDrawn(const QueryFilter& filter,
                    const std::function<void(const internal::Body&, std::span<const Vec3>)>& visit) const;
  void forEachCollider(const QueryFilter& filter, const std::function<void(const internal::Collider&)>& visit) const;
  /// Whether a ray can be followed; tells why not.
  bool isRay(const char* call, const Vec3& origin, const Vec3& direction, float distance) const;
  /// \param radius of a ball; 0: a ray.
  std::optional<CastHit> cast(const char* call, Vec3 origin, double radius, Vec3 direction, float distance,
                              const QueryFilter& filter) const;
  /// \param radius of a ball; 0: a box of these half sizes.
  std::size_t overlaps(const RigidTransform& at, const Vec3& half, float radius, std::span<QueryObject> out,
                       const QueryFilter& filter) const;

  /// One step, all settings sound. \param share of the way to their targets that holds go. May throw std::bad_alloc.
  void stepOnce(const WorldSettings& sound, double seconds, double share);

  /// To be called whenever a body changes.
  void changed(internal::Body& body) {
    visual.invalidate();
    if (body.activity == Activity::active) {
      internal::wake(bodies, body);
    } else {
      internal::wakeAll(bodies);
    }
  }

  /// To be called where a body is at another place all at once: what it touched there it touches no more.
  void displaced(internal::Body& body) {
    auto& known = together.touching;
    const auto has = [&](const internal::TouchMemory& touch) {
      return touch.body_a == body.id || touch.body_b == body.id;
    };
    known.truncate(std::size_t(std::remove_if(known.begin(), known.end(), has) - known.begin()));
    changed(body);
  }

  /// The body, what holds it and what was drawn of it become r x + t.
  void move(internal::Body& body, const Eigen::Matrix3d& r, const Eigen::Vector3d& t);
  void snapToPins(internal::Body& body);

  /// Whether a point is one of a body; tells the log where it is not.
  bool isOf(const internal::Body& body, const BodyPoint& at, const char* call) const;
  /// Whether an impulse or a force is a number; tells the log where it is not.
  bool isPush(const Vec3& push, const char* call) const;
  void addForce(BodyId id, const BodyPoint* at, const Vec3& force);
  void addImpulse(BodyId id, const BodyPoint* at, const Vec3& impulse);
  /// \param to room for all of it; null: only counts. \return bytes.
  std::size_t writeSnapshot(const World& world, std::byte* to) const;
  /// A step, or a call of advance(), ends: its forces have acted.
  void forgetForces();

  WorldSettings settings;
  WorldSettings acting;  ///< of the last step
  std::pmr::memory_resource* memory;
  JobSystem* jobs;
  LogSink* log;
  internal::BodyList bodies;
  std::uint32_t next_body = 0;  ///< ids are never used again
  internal::StepScratch step_scratch;
  internal::TogetherScratch together;
  std::uint32_t next_pick = 0;
  std::uint32_t next_pin_set = 0;
  std::uint32_t next_collider = kGroundCollider.value + 1;
  internal::Collider ground;
  internal::OwningArray<internal::Collider> colliders;  ///< ids ascending
  internal::Array<const internal::Collider*> met;       ///< by a step: the ground and they
  internal::Array<ContactEvent> events;
  internal::Array<internal::ContactSum> contact_sums;        ///< of the step, or the call of advance(), in order
  internal::Array<BodyContact> contacts;                     ///< the same as World::contacts() tells it
  internal::Array<std::uint32_t> touched;                    ///< scratch
  internal::Array<std::uint64_t> touching, touching_before;  ///< ids of two bodies, the lower one in the high half
  double left_over = 0;             ///< time that advance() was given and no substep has taken yet, s
  double shown = 1;                 ///< part of the last step that is drawn
  std::uint32_t settings_told = 0;  ///< bits of the settings that were told to be out of range
  mutable internal::VisualPool visual;
  mutable std::atomic<std::uint64_t> present{0};  ///< calls, counted by what they do (Presence)
};

/// For what is beside World: the C interface, the library sinew::cut.
struct internal::WorldAccess {
  using Presence = World::Impl::Presence;
  using As = Presence::As;
  static World::Impl& of(const World& world) { return *world.impl_; }
};

}  // namespace sinew
