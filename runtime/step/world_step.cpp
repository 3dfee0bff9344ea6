// SPDX-License-Identifier: MIT
//
// One step of the world. This file alone knows the order of phases; each phase is a kernel or a function of the file
// that its section of docs/method.md names.
#include "runtime/step/world_step.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/clusters/goal.h"
#include "runtime/clusters/match.h"
#include "runtime/clusters/pins.h"
#include "runtime/contact/ground.h"
#include "runtime/contact/solve.h"
#include "runtime/interact/pick.h"
#include "runtime/kernels/kernels.h"
#include "runtime/step/spin.h"

namespace sinew::internal {
namespace {

// Weight of a support in the rigid motion of its part, in masses of the part.
constexpr double kAnchorMass = 10;

// A turn within one pass that the rounding of a match may cause, radians.
constexpr double kRoundingTurn = 2e-7;

// A turn of a part within one pass from which its momentum is set right twice, radians.
constexpr double kLargeTurn = 0.1;

// A step is divided no finer than this, s: floats do not resolve what a shorter pass moves. A box of 2 Hz in passes of
// 1.6e-5 s swung further every period, one in 6.5e-5 s lost its swing.
constexpr float kShortestPass = 2e-4F;

// Clusters that share vertices and are turned against each other by more than 120 degrees are tangled: |w| of the
// quaternion between them.
constexpr float kTangled = 0.5F;
constexpr float kTangledPeriods = 0.5F;

// Fastest decay of deformations, 1/s. Neighbours pass a push on by moving: stopped at once, a long chain of stiff
// clusters would creep back.
constexpr double kFastestDamping = 40;

// Passes this much longer than those of the last step: all spins are looked at again.
constexpr float kLongerPass = 1.25F;

// Bodies with at least so many chunks of vertices are worth several jobs; the others are a job each.
constexpr std::size_t kLargeBody = 8;

// Runs work(begin, end) over 0..count, in parallel where there is a job system. Only a reference is captured, which
// std::function stores in place: no allocation.
template <class Work>
void forRange(JobSystem* jobs, std::size_t count, std::uint32_t grain, const Work& work) {
  if (jobs == nullptr || count <= grain) {
    work(0U, std::uint32_t(count));
    return;
  }
  jobs->parallelFor(std::uint32_t(count), grain, [&work](std::uint32_t begin, std::uint32_t end) { work(begin, end); });
}

// Adds the time since the last call to a phase; does nothing without a place for it.
class PhaseClock {
 public:
  explicit PhaseClock(StepTimes* times) : times_(times) {
    if (times_ != nullptr) last_ = std::chrono::steady_clock::now();
  }
  void finish(StepPhase phase) {
    if (times_ == nullptr) return;
    const auto now = std::chrono::steady_clock::now();
    (*times_)[phase] += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  StepTimes* times_;
  std::chrono::steady_clock::time_point last_;
};

bool mayHaveRows(const Body& body, const WorldSettings& settings) {
  return settings.ground.enabled || !body.pins.empty() || !body.picks.empty() || !body.pin_sets.empty();
}

// One body's passes of one step.
class BodyStep {
 public:
  BodyStep(Body& body, const WorldSettings& settings, JobSystem* jobs, float pass_seconds, StepTimes* times)
      : body_(body), rest_(body.rest()), settings_(settings), jobs_(jobs), h_(pass_seconds), clock_(times) {}

  // After a state from outside: where the parts are. Steps carry the centres on.
  void findCenters() {
    std::atomic<bool> lost = false;
    forChunks([&](VertexChunk& chunk) {
      chunk.center = {};
      for (std::uint32_t i = chunk.begin; i < chunk.end; ++i) {
        if (!stateIsUsable(body_.x[i], body_.v[i])) {
          lost = true;
          continue;
        }
        const double m = double(rest_.masses[i]);
        chunk.center[0] += m;
        for (std::size_t k = 0; k < 3; ++k) {
          chunk.center[1 + k] += m * double(body_.x[i][k]);
          chunk.center[4 + k] += m * double(body_.v[i][k]);
        }
      }
    });
    for (Part& part : body_.parts) {
      std::array<double, 7> sum = {};
      for (std::uint32_t i = 0; i < part.chunk_count; ++i) {
        for (std::size_t k = 0; k < 7; ++k) sum[k] += body_.chunks[part.first_chunk + i].center[k];
      }
      if (!(sum[0] > 0)) continue;  // all lost: where the part was
      part.reference = roundedToFloat(Eigen::Vector3d(sum[1], sum[2], sum[3]) / sum[0]);
      part.moving = roundedToFloat(Eigen::Vector3d(sum[4], sum[5], sum[6]) / sum[0]);
    }
    for (Part& part : body_.parts) part.spin.setZero();
    body_.centers_known = !lost;
    if (lost) return;  // spins are looked at when all vertices are there again
    forChunks([&](VertexChunk& chunk) { sumMotion(chunk, body_.x, 0.0F); });
    for (Part& part : body_.parts) {
      const MotionSums now = partSums(part);
      const RigidMotionSolver solver(now, part.reference);
      const Eigen::Vector3d angular = now.angular - solver.offset().cross(now.momentum);
      if (angular.allFinite()) setSpinAside(solver, angular, double(h_), part.spin);
    }
  }

  // Takes the spin that is faster than passes can follow out of the velocities, before the first pass of a step, or
  // gives it back behind the last.
  void moveSpin(double sign) {
    const auto spins = [](const Part& part) { return !part.spin.isZero(0); };
    if (std::none_of(body_.parts.begin(), body_.parts.end(), spins)) return;
    forChunks([&](VertexChunk& chunk) {
      if (spins(body_.parts[chunk.part])) sumMotion(chunk, body_.x, 0.0F);
    });
    for (Part& part : body_.parts) {
      if (!spins(part)) continue;
      const RigidMotionSolver solver(partSums(part), part.reference);
      part.lacking = {solver.center(), Eigen::Vector3d::Zero(), sign * solver.turning(part.spin)};
    }
    forChunks([&](VertexChunk& chunk) {
      const Part& part = body_.parts[chunk.part];
      if (spins(part)) kernel_.add_motion({vertexRange(chunk), part.lacking.forKernels()});
    });
  }

  // Each cluster of a body that was turned inside out may be well, and its neighbours half a turn away from it: that
  // stays for good. Once a step is enough to see it; what passes by in less than half a period is not stuck.
  void compareOverlaps(float seconds) {
    for (Part& part : body_.parts) part.turned = false;
    for (const auto& [a, b] : rest_.overlaps) {
      const ClusterBlock& first = body_.blocks[a / 8];
      const ClusterBlock& second = body_.blocks[b / 8];
      if ((first.lost[a % 8] | second.lost[b % 8]) != 0) continue;
      float cosine = 0;
      for (std::size_t k = 0; k < 4; ++k) cosine += first.rotation[k][a % 8] * second.rotation[k][b % 8];
      if (std::abs(cosine) < kTangled) partOfCluster(a).turned = true;
    }
    for (std::size_t i = 0; i < body_.parts.size(); ++i) {
      Part& part = body_.parts[i];
      for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
        const ClusterBlock& block = body_.blocks[c / 8];
        part.turned |= part.cluster_count > 1 && block.lost[c % 8] != 0 && block.astray[c % 8] == 0;
      }
      part.turned_seconds = part.turned && part.free ? part.turned_seconds + seconds : 0.0F;
      part.tangled |= part.turned_seconds * body_.stiffness->slowest_hz[i] > kTangledPeriods;
    }
  }

  void pass(std::uint32_t passes_left) {
    predict();
    placePins(body_, h_, passes_left);
    clock_.finish(kPredict);

    // Moments of the predicted positions: all that matching wants to know of the vertices. Nearly always nothing
    // stands between moments and goals, and a block of clusters goes through all at once, its members still in cache.
    const bool rows_are_possible = mayHaveRows(body_, settings_);
    forBlocks([&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t b = begin; b < end; ++b) moments(b);
      if (!rows_are_possible) matchAndAsk(begin, end);
    });
    clock_.finish(kMoments);

    if (rows_are_possible) {
      // Rows: what holds, pulls or carries the body, with the forces of the last pass already in the moments.
      collectRows(passes_left);
      beginPinFits(body_);
      clock_.finish(kRows);
      // Match: rotation and goal transform of every cluster. The solver of cluster transforms sits behind this phase
      // and the next: what follows only asks blocks for goals.
      if (body_.rows.empty()) {
        forBlocks([&](std::uint32_t begin, std::uint32_t end) { matchAndAsk(begin, end); });
      } else {
        forBlocks([&](std::uint32_t begin, std::uint32_t end) { matchBlocks(body_, begin, end, h_); });
        clock_.finish(kMatch);
        // Solve: impulses that make the goals satisfy the rows.
        solveRows(body_, h_, {});
        clock_.finish(kSolve);
        forBlocks([&](std::uint32_t begin, std::uint32_t end) {
          for (std::uint32_t b = begin; b < end; ++b) ask(b);
        });
      }
    }
    if (body_.rows.empty()) recoverLost();

    // Goals: vertices follow their clusters; pins and ground have the last word on positions.
    apply(passes_left);
    clock_.finish(kGoals);

    // Settle: damping, momentum, and the new positions for good.
    settle();
    clock_.finish(kSettle);
  }

 private:
  template <class Work>
  void forChunks(const Work& work) {
    forRange(jobs_, body_.chunks.size(), 1, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) work(body_.chunks[i]);
    });
  }
  // Runs work(begin, end) over two blocks of clusters at a time, which kernels may match as one.
  template <class Work>
  void forBlocks(const Work& work) {
    const std::uint32_t count = std::uint32_t(body_.blocks.size());
    forRange(jobs_, (count + 1) / 2, 1, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t pair = begin; pair < end; ++pair) work(2 * pair, std::min(2 * pair + 2, count));
    });
  }

  float* y() { return body_.y.data()->data(); }
  const StiffnessBlock& stiffness(std::uint32_t b) const { return body_.stiffness->blocks[b]; }
  VertexRange vertexRange(const VertexChunk& chunk) {
    return {chunk.begin, chunk.end, body_.x.data()->data(), body_.v.data()->data(), y(), rest_.masses.data()};
  }
  static void setReference(const Part& part, float (&reference)[3], float (&moving)[3]) {
    for (int k = 0; k < 3; ++k) {
      reference[k] = float(part.reference[k]);
      moving[k] = float(part.moving[k]);
    }
  }

  float* slots() { return body_.slots.data()->data(); }
  void moments(std::uint32_t b) {
    kernel_.moments(rest_.blocks[b], rest_.members.data(), y(), body_.blocks[b], slots());
  }
  void ask(std::uint32_t b) {
    kernel_.goals(rest_.blocks[b], rest_.members.data(), stiffness(b), body_.blocks[b], slots());
  }
  void matchAndAsk(std::uint32_t begin, std::uint32_t end) {
    matchBlocks(body_, begin, end, h_);
    for (std::uint32_t b = begin; b < end; ++b) ask(b);
  }

  // Predict: velocities and positions as if every vertex were alone.
  void predict() {
    const float kept = std::exp(-settings_.damping * h_);
    for (Part& part : body_.parts) {
      part.spin *= double(kept);
      part.moving =
          roundedToFloat(double(kept) * (part.moving + double(h_) * asVector(settings_.gravity).cast<double>()));
    }
    forChunks([&](VertexChunk& chunk) {
      PredictArguments a{};
      a.vertices = vertexRange(chunk);
      a.h = h_;
      a.kept = kept;
      for (std::size_t k = 0; k < 3; ++k) a.kick[k] = h_ * settings_.gravity[k];
      setReference(body_.parts[chunk.part], a.reference, a.moving);
      a.repair = [](void* context, std::uint32_t vertex) {
        Body& body = *static_cast<Body*>(context);
        asVector(body.x[vertex]) = body.blendedGoal(vertex);
        body.v[vertex] = body.force[vertex] = {};
      };
      a.context = &body_;
      a.sums = &chunk.sums;
      chunk.repaired += kernel_.predict(a);
    });
    for (Part& part : body_.parts) {
      part.before = partSums(part);
      part.reference = roundedToFloat(part.reference + double(h_) * part.moving);
    }
  }

  MotionSums partSums(const Part& part) const {
    MotionSums sums;
    for (std::uint32_t i = 0; i < part.chunk_count; ++i) sums.add(body_.chunks[part.first_chunk + i].sums);
    return sums;
  }

  void collectRows(std::uint32_t passes_left) {
    body_.rows.clear();
    rows_are_dropped_ = false;
    addPinRows(body_, h_, passes_left);
    if (settings_.ground.enabled) addGroundRows(body_, settings_.ground, h_);
    addPickRows(body_, h_);
    if (body_.rows.empty()) return;
    // What is held may be held out of shape: there the clusters answer, each for itself.
    const auto is_hold = [](const Row& row) { return row.kind == RowKind::hold; };
    const bool held = std::any_of(body_.rows.begin(), body_.rows.end(), is_hold);
    for (const Part& part : body_.parts) findPose(part, held ? std::numeric_limits<double>::infinity() : kAstray);
    bool astray = false;
    for (const ClusterBlock& block : body_.blocks) {
      for (const std::int32_t one : block.astray) astray |= one != 0;
    }
    if (astray) {
      // A part that goes back as one does not answer forces in this pass; vertices stay above the ground without rows,
      // which is no free motion either.
      for (const Row& row : body_.rows) rememberedForce(body_, row) = {};
      rows_are_dropped_ = !body_.rows.empty();
      body_.rows.clear();
      return;
    }
    bringNear(body_, h_);
    warmStartRows(body_);
  }

  // \return whether it is astray.
  bool findPose(const Part& part, double far = kAstray) {
    return updatePartPose(body_.package(), rest_, body_.stiffness->clusters, part.first_cluster, part.cluster_count,
                          body_.blocks, far);
  }

  // Whether all clusters of a part are as good as rigid: together they are one solid, but each would pass a correction
  // on by one neighbour a pass.
  bool isStiff(const Part& part) const { return body_.stiffness->stiff[std::size_t(&part - body_.parts.data())] != 0; }

  Part& partOfCluster(std::uint32_t cluster) {
    const auto begins_behind = [](std::uint32_t index, const Part& part) { return index < part.first_cluster; };
    return *std::prev(std::upper_bound(body_.parts.begin() + 1, body_.parts.end(), cluster, begins_behind));
  }

  void findFreeParts() {
    for (Part& part : body_.parts) part.free = !rows_are_dropped_;
    for (const PinFit& fit : body_.fits) {
      const formats::Cluster& cluster = body_.package().clusters()[fit.cluster()];
      body_.partOf(body_.package().memberships()[cluster.first_member].vertex).free = false;
    }
    for (const Row& row : body_.rows) {
      if (row.point == RowPoint::physical_vertex) {
        body_.partOf(row.index).free = false;
      } else {
        // A pick: which part it pulls is not worth the search; parts beside it only keep plain y and v.
        for (Part& part : body_.parts) part.free = false;
      }
    }
  }

  // Clusters that have lost their orientation or are torn want the pose of their part, which takes all moments of the
  // part: once more for them.
  void recoverLost() {
    for (Part& part : body_.parts) {
      bool lost = false;
      for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
        const ClusterBlock& block = body_.blocks[c / 8];
        lost |= block.lost[c % 8] != 0 || block.limited[c % 8] != 0;
      }
      const bool as_one = part.cluster_count > 1 && (h_ >= kFewPasses || part.uneven || part.tangled || isStiff(part));
      if (!lost && !as_one) continue;
      const std::uint32_t first = part.first_cluster / 8, last = (part.first_cluster + part.cluster_count - 1) / 8;
      // Goals have taken the place of what moments left in the slots; and the pose moves centres.
      for (std::uint32_t b = first; b <= last; ++b) moments(b);
      const bool astray = findPose(part, as_one ? kHardlyAstray : kAstray);
      if (part.tangled) {
        part.tangled = astray;
        for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
          body_.blocks[c / 8].tangled[c % 8] = astray ? -1 : 0;
        }
      }
      matchAndAsk(first, last + 1);
    }
  }

  void apply(std::uint32_t passes_left) {
    const bool held = isHeld();
    findFreeParts();
    const float diagonal = body_.package().info().diagonal;
    forChunks([&](VertexChunk& chunk) {
      const Part& part = body_.parts[chunk.part];
      ApplyArguments a{};
      a.vertices = vertexRange(chunk);
      a.slots = slots();
      a.uses = rest_.use_blocks.data() + chunk.first_use_block;
      a.use_offset = rest_.use_offsets.data();
      a.inverse_h = 1.0F / h_;
      a.ground = settings_.ground.enabled;
      for (std::size_t k = 0; k < 3; ++k) a.normal[k] = settings_.ground.normal[k];
      a.offset = settings_.ground.offset;
      a.recovery = recoveryHeight(diagonal, h_);
      setReference(part, a.reference, a.moving);
      a.sums = part.free ? &chunk.sums : nullptr;
      kernel_.apply(a);
    });
    if (held) holdPins(body_, h_, passes_left);
    finishMatch(body_, h_);
  }

  void sumMotion(VertexChunk& chunk, std::span<const Vec3> at, float anchor_mass) {
    SumArguments a{};
    a.vertices = vertexRange(chunk);
    a.at = at.data()->data();
    a.force = body_.force.data()->data();
    a.anchored = body_.pinned.data();
    a.anchor_mass = anchor_mass;
    setReference(body_.parts[chunk.part], a.reference, a.moving);
    a.sums = &chunk.sums;
    kernel_.sum(a);
  }

  static void add(RigidMotion& motion, const RigidMotion& more) {
    motion.velocity += more.velocity;
    motion.omega += more.omega;
  }

  // What a free part's motion lacks of the momentum that it had before the match.
  static RigidMotion defect(const Part& part, const MotionSums& now, const RigidMotionSolver& solver) {
    const Eigen::Vector3d momentum = part.before.momentum - now.momentum;
    // The match leaves the centre of mass where it is but for rounding: momenta about it are compared.
    const Eigen::Vector3d angular = (part.before.angular - solver.offset().cross(part.before.momentum)) -
                                    (now.angular - solver.offset().cross(now.momentum));
    // Speeds are rounded, so the momentum about the centre is uncertain by this much.
    const double rounding = 2 * 0x1p-23 * now.mass * part.moving.norm() * solver.gyration();
    return solver.correction(momentum, angular, rounding);
  }

  // Deformation damping about the rigid motion of each part. A part that is held or stands on something has the rigid
  // motion that its supports leave it (kAnchorMass): what it does beyond that is deformation, also a bounce on its
  // feet. Free parts get back the momentum that the pass may not have changed: v = (y - x) / h is not what the match,
  // which is free of force and torque at y, would leave (docs/method.md §5).
  void settle() {
    if (isHeld()) {
      forChunks([&](VertexChunk& chunk) {
        const Part& part = body_.parts[chunk.part];
        if (!part.free) sumMotion(chunk, body_.y, float(kAnchorMass * partMass(part)));
      });
    }
    const double kept_turning = std::exp(-double(settings_.support_damping) * double(h_));
    bool any_limited = false;
    for (Part& part : body_.parts) {
      const MotionSums now = partSums(part);
      const RigidMotionSolver solver(now, part.reference);
      part.found = part.wanted = solver.motion(now.momentum, now.angular);
      if (part.free) {
        add(part.wanted, defect(part, now, solver));
        keepSpin(part, solver);
      } else {
        part.spin.setZero();                // what touches it stops what passes cannot follow
        part.wanted.omega *= kept_turning;  // soft things do not roll or swing for ever: turning on a support flexes
      }
      part.found.velocity += part.moving;
      part.wanted.velocity += part.moving;
      // A turn of this size moves the arms that the sums were taken with.
      part.limited = std::max(part.found.omega.norm(), part.wanted.omega.norm()) * double(h_) > kLargeTurn;
      part.stopped = false;
      for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
        part.stopped |= body_.blocks[c / 8].limited[c % 8] != 0;
      }
      part.limited |= part.stopped;
      any_limited |= part.limited && part.free;
    }
    forChunks([&](VertexChunk& chunk) { settle(chunk); });
    if (any_limited) restoreMomentum();
    for (Part& part : body_.parts) {
      // A part that a support stops in a wild spin may be free in the next step: its spin is looked at then.
      const bool wild = !part.free && part.found.omega.norm() * double(h_) > kMostTurn;
      part.reference = roundedToFloat(part.found.center);
      part.moving = roundedToFloat(part.wanted.velocity);
      body_.centers_known &= !wild;
      body_.centers_known &= part.reference.allFinite() && part.moving.allFinite();
    }
  }

  // What the part would turn by too much in the next pass is set aside, or comes back from there.
  void keepSpin(Part& part, const RigidMotionSolver& solver) const {
    const double turn = part.wanted.omega.norm() * double(h_);
    if (part.spin.isZero(0) && !(turn > kMostTurn)) return;
    const Eigen::Vector3d had = part.spin;
    part.wanted.omega = setSpinAside(solver, had + solver.inertia() * part.wanted.omega, double(h_), part.spin);
    part.before.angular += had - part.spin;
  }

  // The inelastic stop took a different part of each vertex's motion, and a large turn moved the arms: gives free parts
  // back what they lost as a whole.
  void restoreMomentum() {
    forChunks([&](VertexChunk& chunk) { sumMotion(chunk, body_.x, 0.0F); });
    for (Part& part : body_.parts) {
      part.limited &= part.free;
      if (!part.limited) continue;
      const MotionSums now = partSums(part);
      part.lacking = defect(part, now, RigidMotionSolver(now, part.reference));
    }
    forChunks([&](VertexChunk& chunk) {
      const Part& part = body_.parts[chunk.part];
      if (part.limited) kernel_.add_motion({vertexRange(chunk), part.lacking.forKernels()});
    });
  }

  void settle(const VertexChunk& chunk) {
    const Part& part = body_.parts[chunk.part];
    SettleArguments a{};
    a.vertices = vertexRange(chunk);
    a.h = h_;
    a.free = part.free;
    // Stiff without limit (clusters all rigid) times no damping at all is none.
    const double ratio = double(settings_.deformation_damping_ratio);
    const double slowest_hz = double(body_.stiffness->slowest_hz[chunk.part]);
    double rate = ratio > 0 ? std::min(4 * std::numbers::pi * ratio * slowest_hz, kFastestDamping) : 0.0;
    // What clusters damp themselves is part of it, or slow chains would creep; but of half of it at most, since it does
    // not damp how they swing about one another.
    rate = std::max(rate - double(body_.stiffness->own_damping[chunk.part]), 0.5 * rate);
    // What stands or hangs tips over and swings as the world's settings say: inner friction would turn that to honey.
    if (!part.free) rate = std::min(rate, double(settings_.support_damping));
    a.lost = float(-std::expm1(-rate * double(h_)));
    const auto copy = [](const Eigen::Vector3d& from, float(&to)[3]) {
      for (int k = 0; k < 3; ++k) to[k] = float(from[k]);
    };
    // What stopped vertices had made of the part's motion stops with them. The others do not answer for it: what is
    // lacking then is given back to all (restoreMomentum).
    const bool stops = part.free && part.stopped;
    const RigidMotion& found = stops ? part.wanted : part.found;
    const Eigen::Vector3d turned = part.wanted.omega - part.found.omega;
    const Eigen::Vector3d change = part.wanted.velocity - part.found.velocity;
    const Eigen::Vector3d rounding = roundedToFloat(part.found.center) - part.found.center;
    copy(part.found.center, a.center);
    copy(found.velocity + found.omega.cross(rounding), a.moving);
    copy(found.omega, a.lost_omega);
    if (!stops) {
      copy(change + turned.cross(rounding), a.change);
      copy(turned, a.change_omega);
    }
    // A real turn of this size would change the angular momentum again by moving the arms; the match's own stays.
    const bool shift_turns = turned.norm() * double(h_) <= kRoundingTurn;
    copy(shift_turns ? change + turned.cross(rounding) : change, a.shift);
    if (shift_turns) copy(turned, a.shift_omega);
    std::array<float, kVerticesPerChunk> vertex_kept;
    if (part.stopped) {
      // What a cluster's guard stopped, it stopped for good.
      for (std::uint32_t i = chunk.begin; i < chunk.end; ++i) {
        float kept = 1.0F;
        for (const ClusterUse& use : rest_.usesOf(i)) {
          if (body_.blocks[use.cluster / 8].limited[use.cluster % 8] != 0) kept = 0.0F;
        }
        vertex_kept[i - chunk.begin] = kept;
      }
      a.vertex_kept = vertex_kept.data();
    }
    kernel_.settle(a);
  }

  bool isHeld() const { return !body_.rows.empty() || !body_.fits.empty() || rows_are_dropped_; }

  // Relative to all vertices of the body, as in the sums.
  double partMass(const Part& part) const {
    double mass = 0;
    for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
      mass += double(body_.package().clusters()[c].mass);
    }
    return mass / double(body_.package().info().total_mass);
  }

  Body& body_;
  const RestConstants& rest_;
  const WorldSettings& settings_;
  JobSystem* jobs_;
  const float h_;
  bool rows_are_dropped_ = false;  ///< in this pass: the body goes back as one
  PhaseClock clock_;
  const Kernels& kernel_ = kernels();
};

bool isLarge(const Body& body) { return body.pieces.empty() && body.chunks.size() >= kLargeBody; }

// Lends scratch to a body, or takes it back.
void exchange(Body& body, BodyScratch& scratch) {
  body.rows.swap(scratch.rows);
  body.frames.swap(scratch.frames);
  body.responses.swap(scratch.responses);
  body.solver_rows.swap(scratch.solver_rows);
  body.terms.swap(scratch.terms);
  body.answers.swap(scratch.answers);
}

void stepBody(Body& body, BodyScratch& scratch, const WorldSettings& settings, JobSystem* jobs, std::uint32_t passes,
              float pass_seconds, StepTimes* times) {
  body.repaired = 0;
  for (VertexChunk& chunk : body.chunks) chunk.repaired = 0;
  body.take(scratch.pass);
  exchange(body, scratch);
  if (mayHaveRows(body, settings)) {  // within what growScratch() reserved
    body.frames.resize(body.clusterCount());
    body.responses.resize(body.clusterCount());
    body.answers.resize(body.clusterCount());
  }
  BodyStep step(body, settings, jobs, pass_seconds, times);
  // A longer pass may not follow a spin that the last one could.
  if (!body.centers_known || pass_seconds > kLongerPass * body.pass_seconds) step.findCenters();
  body.pass_seconds = pass_seconds;
  step.moveSpin(-1);
  for (std::uint32_t left = passes; left > 0; --left) step.pass(left);
  step.compareOverlaps(float(passes) * pass_seconds);
  step.moveSpin(1);
  for (const VertexChunk& chunk : body.chunks) body.repaired += chunk.repaired;
  body.repaired = std::min(body.repaired, body.vertexCount());  // some in several passes
  body.rows.clear();
  exchange(body, scratch);
  body.giveBack();
  if (body.isLost()) body.recover(scratch.pass);
}

}  // namespace

PassScratch& StepScratch::passOf(const Body& body) {
  if (lanes.empty()) addLane();
  lanes[0].pass.reserve(body.vertexCount(), body.rest().members.size());
  return lanes[0].pass;
}

void growScratch(const BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, const JobSystem* jobs) {
  struct Need {
    std::size_t bodies = 0, vertices = 0, members = 0, rows = 0, terms = 0, clusters = 0;
    void add(const Body& body, bool rows_too) {
      ++bodies;
      vertices = std::max<std::size_t>(vertices, body.vertexCount());
      members = std::max(members, body.rest().members.size());
      if (!rows_too) return;
      rows = std::max(rows, body.vertexCount() + body.picks.size());
      terms = std::max(terms, mostTerms(body));
      clusters = std::max<std::size_t>(clusters, body.clusterCount());
    }
  } all, small;
  for (const BodyPointer& body : bodies) {
    const bool rows = mayHaveRows(*body, settings);
    all.add(*body, rows);
    if (!isLarge(*body)) small.add(*body, rows);
  }
  const std::size_t jobs_at_once = jobs != nullptr ? std::clamp<std::size_t>(jobs->concurrency(), 1, 64) : 1;
  const std::size_t lanes = std::max(std::min<std::size_t>(all.bodies, 1), std::min(jobs_at_once, small.bodies));
  while (scratch.lanes.size() < lanes) scratch.addLane();
  for (std::size_t i = 0; i < scratch.lanes.size(); ++i) {
    const Need& need = i == 0 ? all : small;  // large bodies are stepped one at a time
    scratch.lanes[i].pass.reserve(need.vertices, need.members);
    for (const BodyPointer& body : bodies) {
      for (const Piece& piece : body->pieces) scratch.lanes[i].piece.reserve(piece);
    }
    scratch.lanes[i].rows.reserve(need.rows);
    scratch.lanes[i].frames.reserve(need.clusters);
    scratch.lanes[i].responses.reserve(need.clusters);
    scratch.lanes[i].solver_rows.reserve(need.rows);
    scratch.lanes[i].terms.reserve(need.terms);
    scratch.lanes[i].answers.reserve(need.clusters);
  }
}

void stepWorld(BodyList& bodies, StepScratch& scratch, const WorldSettings& settings, JobSystem* jobs, float seconds,
               StepTimes* times) {
  if (times != nullptr) times->fill(0);
  const std::uint32_t asked = std::clamp(settings.iterations, 1U, 16U);
  const std::uint32_t passes = std::clamp(std::uint32_t(std::min(16.0F, seconds / kShortestPass)), 1U, asked);
  const float h = seconds / float(passes);
  growScratch(bodies, scratch, settings, jobs);
  for (const BodyPointer& body : bodies) body->stiffness->update(body->package(), body->rest(), h);
  // Large bodies one after the other, all threads on each; small ones side by side, a thread on each.
  for (const BodyPointer& body : bodies) {
    if (isLarge(*body)) stepBody(*body, scratch.lanes[0], settings, jobs, passes, h, times);
  }
  StepTimes* const small_times = jobs == nullptr ? times : nullptr;
  std::atomic<std::size_t> next = 0;
  forRange(jobs, scratch.lanes.size(), 1, [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t lane = begin; lane < end; ++lane) {
      for (std::size_t i = next++; i < bodies.size(); i = next++) {
        if (isLarge(*bodies[i])) continue;
        if (!bodies[i]->pieces.empty()) {
          stepPieces(*bodies[i], settings, double(seconds), scratch.lanes[lane].piece);
          continue;
        }
        stepBody(*bodies[i], scratch.lanes[lane], settings, nullptr, passes, h, small_times);
      }
    }
  });
}

}  // namespace sinew::internal
