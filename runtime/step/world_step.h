// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <vector>

#include "runtime/step/integrate.h"
#include "runtime/world/body.h"
#include "sinew/runtime/world.h"

namespace sinew::internal {

/// A run of a body's vertices that one job handles; never spans two parts. Its bounds depend on the package only, so
/// sums over chunks come out the same for any number of threads.
struct VertexChunk {
  Body* body;
  std::uint32_t part;  ///< into StepPlan::parts
  std::uint32_t begin, end;
  MotionSums sums;  ///< scratch
  std::uint32_t repaired = 0;
};

struct ClusterChunk {
  Body* body;
  std::uint32_t begin, end;
};

/// One separate part (BODY record) of one body.
struct Part {
  Body* body = nullptr;
  std::uint32_t index = 0;  ///< into the package's BODY
  std::uint32_t first_chunk = 0, chunk_count = 0;
  std::uint32_t first_cluster = 0, cluster_count = 0;
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();  ///< near the part; sums are taken about it
  MotionSums before;                                    ///< of the predicted motion, later what the pass has to leave
  RigidMotion found, wanted;  ///< of v = (y - x) / h, and with the momentum that it should have
  double slowest_hz = 0;      ///< lowest frequency of its clusters; 0 = none has one, infinite = all are rigid
  bool free = true;           ///< no row of this pass touches the part
  bool limited = false;       ///< a cluster was stopped by the guard in this pass
};

/// The work lists of a world, remade when bodies come or go.
struct StepPlan {
  std::vector<Body*> bodies;
  std::vector<VertexChunk> vertices;
  std::vector<ClusterChunk> clusters;
  std::vector<Part> parts;

  void rebuild(const std::vector<std::unique_ptr<Body>>& all);
};

enum StepPhase : std::uint32_t { kPredict, kMoments, kRows, kMatch, kSolve, kGoals, kSettle, kStepPhaseCount };

/// Advances everything by one step. \param jobs may be null.
void stepWorld(StepPlan& plan, const WorldSettings& settings, JobSystem* jobs, float seconds,
               std::array<World::Phase, kStepPhaseCount>& phases);

}  // namespace sinew::internal
