// SPDX-License-Identifier: MIT
//
// One step of the world. This file alone knows the order of phases; each phase is a function of the file that its
// section of docs/method.md names.
#include "runtime/step/world_step.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "runtime/clusters/goal.h"
#include "runtime/clusters/moments.h"
#include "runtime/clusters/pins.h"
#include "runtime/contact/ground.h"
#include "runtime/contact/solve.h"
#include "runtime/interact/pick.h"

namespace sinew::internal {
namespace {

// Weight of a support in the rigid motion of its part, in masses of the part.
constexpr double kAnchorMass = 10;

// Fastest decay of deformations, 1/s. Neighbours pass a push on by moving: stopped at once, a long chain of stiff
// clusters would creep back.
const double kFastestDamping = getenv("KF") ? atof(getenv("KF")) : 40;

// Turn of a part within one pass from which its momentum is set right twice, radians.
constexpr double kLargeTurn = 0.1;

constexpr std::uint32_t kVerticesPerChunk = 512;
constexpr std::uint32_t kMembersPerChunk = 1024;

// Runs work(element) over a list, in parallel where there is a job system. Only a reference is captured, which
// std::function stores in place: no allocation.
template <class Element, class Work>
void forEach(JobSystem* jobs, std::vector<Element>& list, const Work& work) {
  if (jobs == nullptr) {
    for (Element& element : list) work(element);
    return;
  }
  struct Context {
    std::vector<Element>& list;
    const Work& work;
  } context{list, work};
  jobs->parallelFor(std::uint32_t(list.size()), 1, [&context](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) context.work(context.list[i]);
  });
}

// Adds the time since the last call to a phase.
class PhaseClock {
 public:
  explicit PhaseClock(std::array<World::Phase, kStepPhaseCount>& phases) : phases_(phases) {}
  void finish(StepPhase phase) {
    const auto now = std::chrono::steady_clock::now();
    phases_[phase].milliseconds += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  std::array<World::Phase, kStepPhaseCount>& phases_;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

void updateStiffness(Body& body, float pass_seconds) {
  if (body.stiffness_step == pass_seconds) return;
  for (std::uint32_t c = 0; c < body.stiffness.size(); ++c) {
    body.stiffness[c] = clusterStiffness(body.package(), body.rest(), c, body.settings.stiffness_scale, pass_seconds);
  }
  body.stiffness_step = pass_seconds;
}

// The lowest frequency that a part is authored to have, for its damping; classes of modes that are never to return do
// not count.
double slowestFrequency(const Part& part) {
  double slowest = std::numeric_limits<double>::infinity();
  bool deforms = false;
  const auto clusters = part.body->package().clusters().subspan(part.first_cluster, part.cluster_count);
  for (const formats::Cluster& cluster : clusters) {
    if (cluster.mode == formats::ClusterMode::rigid) continue;
    deforms = true;
    const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
    for (const float hz :
         {cluster.stretch_hz, quadratic ? cluster.bend_hz : 0.0F, quadratic ? cluster.twist_hz : 0.0F}) {
      const double scaled = double(hz) * double(part.body->settings.stiffness_scale);
      if (scaled > 0) slowest = std::min(slowest, scaled);
    }
  }
  return deforms && std::isinf(slowest) ? 0.0 : slowest;
}

// Whether some cluster of a body is matched with its part as one.
bool isAstray(const Body& body) {
  return std::any_of(body.frames.begin(), body.frames.end(), [](const ClusterFrame& f) { return f.part_astray; });
}

void collectRows(Body& body, const WorldSettings& settings, float pass_seconds, std::uint32_t passes_left) {
  body.rows.clear();
  addPinRows(body, pass_seconds, passes_left);
  if (settings.ground.enabled) addGroundRows(body, settings.ground, pass_seconds);
  addPickRows(body, pass_seconds);
  if (isAstray(body)) {
    const bool held =
        std::any_of(body.rows.begin(), body.rows.end(), [](const Row& row) { return row.kind == RowKind::hold; });
    if (held) {
      // What is held may be held out of shape: its clusters answer the rows, each for itself.
      for (ClusterFrame& frame : body.frames) frame.part_astray = false;
    } else {
      // A part that goes back as one does not answer forces in this pass; vertices stay above the ground by themselves.
      for (const Row& row : body.rows) body.force[row.index] = {};
      body.rows.clear();
    }
  }
  warmStartRows(body);
}

bool partHasRow(const Part& part) {
  const Body& body = *part.body;
  if (body.rows.empty()) return false;
  const formats::BodyRange& range = body.package().bodies()[part.index];
  return std::any_of(body.rows.begin(), body.rows.end(), [&](const Row& row) {
    if (row.point == RowPoint::physical_vertex) return row.index - range.first_vertex < range.vertex_count;
    return true;  // a pick: which part it pulls is not worth the search; parts beside it only keep plain y and v
  });
}

void matchClusters(ClusterChunk& chunk) {
  Body& body = *chunk.body;
  for (std::uint32_t c = chunk.begin; c < chunk.end; ++c) {
    updateFrame(body.package().clusters()[c], body.rest().clusters[c], body.stiffness[c], body.frames[c]);
  }
}

MotionSums partSums(const StepPlan& plan, const Part& part) {
  MotionSums sums;
  for (std::uint32_t i = 0; i < part.chunk_count; ++i) sums.add(plan.vertices[part.first_chunk + i].sums);
  return sums;
}

enum class SumsOf { predicted, anchored, settled };

void sumMotion(StepPlan& plan, JobSystem* jobs, SumsOf what) {
  forEach(jobs, plan.vertices, [&](VertexChunk& chunk) {
    const Body& body = *chunk.body;
    const Part& part = plan.parts[chunk.part];
    const double anchor = what == SumsOf::anchored && !part.free ? kAnchorMass * part.before.mass : 0.0;
    chunk.sums =
        motionSums(body, what == SumsOf::settled ? body.x : body.y, chunk.begin, chunk.end, part.reference, anchor);
  });
}

// The rigid motion to add to a part of motion `now`, so that it has the momentum of `wanted`, the angular one about its
// own centre: rounding moves the centre, and a fast part's momentum about any fixed point with it.
RigidMotion defectOf(const MotionSums& now, const MotionSums& wanted, const Eigen::Vector3d& reference) {
  const Eigen::Vector3d center_now = now.first / now.mass, center_wanted = wanted.first / wanted.mass;
  MotionSums defect = now;
  defect.momentum = wanted.momentum - now.momentum;
  defect.angular = (wanted.angular - center_wanted.cross(wanted.momentum)) -
                   (now.angular - center_now.cross(now.momentum)) + center_now.cross(defect.momentum);
  // Speeds are rounded, so the momentum about the centre is uncertain by this much.
  const double reach = std::sqrt(std::max(0.0, now.second.trace() / now.mass - center_now.squaredNorm()));
  return rigidMotionOf(defect, reference, 2 * 0x1p-23 * wanted.momentum.norm() * reach);
}

RigidMotion corrected(const RigidMotion& found, const MotionSums& now, const MotionSums& wanted,
                      const Eigen::Vector3d& reference) {
  const RigidMotion defect = defectOf(now, wanted, reference);
  RigidMotion result = found;
  result.velocity += defect.velocity;
  result.omega += defect.omega;
  return result;
}

// Deformation damping about the rigid motion of each part. A part that is held or stands on something has the rigid
// motion that its supports leave it (kAnchorMass): what it does beyond that is deformation, also a bounce on its feet.
// Free parts get back the momentum that the pass may not have changed:
// v = (y - x) / h is not what the match, which is free of force and torque at y, would leave (docs/method.md §5).
void settleMotions(StepPlan& plan, JobSystem* jobs, const WorldSettings& settings, float pass_seconds) {
  const double kept_turning = std::exp(-double(settings.support_damping) * double(pass_seconds));
  sumMotion(plan, jobs, SumsOf::anchored);
  bool any_limited = false;
  for (Part& part : plan.parts) {
    const MotionSums now = partSums(plan, part);
    part.found = rigidMotionOf(now, part.reference);
    part.wanted = part.found;
    if (part.free) part.wanted = corrected(part.found, now, part.before, part.reference);
    // Soft things do not roll or swing for ever: turning on a support flexes it.
    if (!part.free) part.wanted.omega *= kept_turning;
    // A turn of this size moves the arms that the sums were taken with, and its positions are those of a far
    // prediction.
    part.limited = std::max(part.found.omega.norm(), part.wanted.omega.norm()) * double(pass_seconds) > kLargeTurn;
    for (std::uint32_t c = 0; c < part.cluster_count; ++c) {
      part.limited |= part.body->frames[part.first_cluster + c].limited;
    }
    any_limited |= part.limited;
  }
  forEach(jobs, plan.vertices, [&](VertexChunk& chunk) {
    const Part& part = plan.parts[chunk.part];
    const double rate =
        std::min(4 * std::numbers::pi * double(settings.deformation_damping_ratio) * part.slowest_hz, kFastestDamping);
    settleMotion(*chunk.body, part.found, part.wanted, part.free, float(std::exp(-rate * double(pass_seconds))),
                 pass_seconds, chunk.begin, chunk.end);
  });
  if (!any_limited) return;
  // The inelastic stop took a different part of each vertex's motion; give a free part back what it lost as a whole.
  sumMotion(plan, jobs, SumsOf::settled);
  for (Part& part : plan.parts) {
    part.limited &= part.free;
    if (!part.limited) continue;
    part.wanted = defectOf(partSums(plan, part), part.before, part.reference);
  }
  forEach(jobs, plan.vertices, [&](VertexChunk& chunk) {
    const Part& part = plan.parts[chunk.part];
    if (part.limited) addRigidMotion(*chunk.body, part.wanted, chunk.begin, chunk.end);
  });
}

void pass(StepPlan& plan, const WorldSettings& settings, JobSystem* jobs, float h, std::uint32_t passes_left,
          PhaseClock& clock) {
  // Predict: velocities and positions as if every vertex were alone.
  for (Part& part : plan.parts) {
    if (part.cluster_count > 0) part.reference = part.body->frames[part.first_cluster].center.cast<double>();
  }
  forEach(jobs, plan.vertices,
          [&](VertexChunk& chunk) { chunk.repaired += predict(*chunk.body, settings, h, chunk.begin, chunk.end); });
  sumMotion(plan, jobs, SumsOf::predicted);
  for (Part& part : plan.parts) part.before = partSums(plan, part);
  clock.finish(kPredict);

  // Moments of the predicted positions: all that matching wants to know of the vertices.
  forEach(jobs, plan.clusters, [&](ClusterChunk& chunk) {
    Body& body = *chunk.body;
    for (std::uint32_t c = chunk.begin; c < chunk.end; ++c) {
      accumulateMoments(body.package(), body.rest(), c, body.y, body.frames[c]);
    }
  });
  clock.finish(kMoments);

  // Where each part is as a whole, and whether it is so far from its rest shape that it is matched as one.
  forEach(jobs, plan.parts, [](Part& part) {
    updatePartPose(part.body->package(), part.body->rest(), part.first_cluster, part.cluster_count, part.body->frames);
  });

  // Rows: what holds, pulls or carries the body, with the forces of the last pass already in the moments.
  forEach(jobs, plan.bodies, [&](Body* body) { collectRows(*body, settings, h, passes_left); });
  for (Part& part : plan.parts) part.free = !partHasRow(part);
  clock.finish(kRows);

  // Match: rotation and goal transform of every cluster. The solver of cluster transforms sits behind this phase and
  // the next: what follows only asks frames for goals.
  forEach(jobs, plan.clusters, matchClusters);
  clock.finish(kMatch);

  // Solve: impulses that make the goals satisfy the rows.
  forEach(jobs, plan.bodies, [&](Body* body) {
    if (!body->rows.empty()) solveRows(*body, h, {});
  });
  clock.finish(kSolve);

  // Goals: vertices follow their clusters; pins and ground have the last word on positions.
  forEach(jobs, plan.vertices,
          [&](VertexChunk& chunk) { applyGoals(*chunk.body, settings.ground, h, chunk.begin, chunk.end); });
  forEach(jobs, plan.bodies, [&](Body* body) { holdPins(*body, h, passes_left); });
  clock.finish(kGoals);

  // Settle: damping, momentum, and the new positions for good.
  settleMotions(plan, jobs, settings, h);
  clock.finish(kSettle);
}

}  // namespace

void StepPlan::rebuild(const std::vector<std::unique_ptr<Body>>& all) {
  bodies.clear();
  vertices.clear();
  clusters.clear();
  parts.clear();
  for (const std::unique_ptr<Body>& owner : all) {
    Body* body = owner.get();
    if (body == nullptr) continue;
    bodies.push_back(body);
    const formats::PackageView& package = body->package();
    for (const formats::BodyRange& range : package.bodies()) {
      Part part;
      part.body = body;
      part.index = std::uint32_t(&range - package.bodies().data());
      part.first_chunk = std::uint32_t(vertices.size());
      part.first_cluster = range.first_cluster;
      part.cluster_count = range.cluster_count;
      part.slowest_hz = slowestFrequency(part);
      const std::uint32_t index = std::uint32_t(parts.size());
      for (std::uint32_t begin = 0; begin < range.vertex_count; begin += kVerticesPerChunk) {
        const std::uint32_t end = std::min(range.vertex_count, begin + kVerticesPerChunk);
        vertices.push_back({body, index, range.first_vertex + begin, range.first_vertex + end, {}, 0});
      }
      part.chunk_count = std::uint32_t(vertices.size()) - part.first_chunk;
      parts.push_back(part);
    }
    std::uint32_t begin = 0, members = 0;
    const std::uint32_t cluster_count = std::uint32_t(package.clusters().size());
    for (std::uint32_t c = 0; c < cluster_count; ++c) {
      members += package.clusters()[c].member_count;
      if (members >= kMembersPerChunk || c + 1 == cluster_count) {
        clusters.push_back({body, begin, c + 1});
        begin = c + 1;
        members = 0;
      }
    }
  }
}

void stepWorld(StepPlan& plan, const WorldSettings& settings, JobSystem* jobs, float seconds,
               std::array<World::Phase, kStepPhaseCount>& phases) {
  phases = {{{"predict", 0}, {"moments", 0}, {"rows", 0}, {"match", 0}, {"solve", 0}, {"goals", 0}, {"settle", 0}}};
  PhaseClock clock(phases);
  const std::uint32_t passes = std::clamp(settings.iterations, 1U, 16U);
  const float h = seconds / float(passes);
  for (VertexChunk& chunk : plan.vertices) chunk.repaired = 0;
  for (Body* body : plan.bodies) {
    updateStiffness(*body, h);
    body->rows.reserve(body->x.size() + body->picks.size());
    body->responses.resize(body->frames.size());
    body->repaired = 0;
    body->cofactors_fresh = false;
  }
  for (std::uint32_t left = passes; left > 0; --left) pass(plan, settings, jobs, h, left, clock);
  for (const VertexChunk& chunk : plan.vertices) chunk.body->repaired += chunk.repaired;
}

}  // namespace sinew::internal
