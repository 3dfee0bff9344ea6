// SPDX-License-Identifier: GPL-3.0-or-later
//
// Deformed output: 100,000 visual vertices into the caller's buffers, right after a step.
#include "sinew/runtime/world.h"
#include "tools/bench/bench.h"
#include "tools/bench/bounds.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {

void benchOutput(const BenchContext& context) {
  const LatticeBody& body = blockBody(context.options.quick ? 10'000 : 100'000);
  const double functions = body.asset->package().fields()[0].function_count;
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  World world(settings);
  const auto id = world.addBody(body.asset);
  const MovingState state = movingState(*body.asset);
  world.setState(*id, state.positions, state.velocities);
  std::vector<Vec3> positions(body.visual_vertices), normals(body.visual_vertices);
  const StridedFloat3 to_positions{positions[0].data(), sizeof(Vec3), body.visual_vertices};
  const StridedFloat3 to_normals{normals[0].data(), sizeof(Vec3), body.visual_vertices};

  const auto emit = [&](const char* name, const StridedFloat3& normal_target, const Work& work, double limit) {
    // A step before each call: what the output derives from the physical vertices is then part of its cost.
    const TimedCall call{[&] { world.visualVertices(*id, to_positions, normal_target); },
                         [&] { world.step(1.0F / 600); }, 1};
    const std::size_t working_set = std::size_t(body.visual_vertices) * (normal_target.data == nullptr ? 28 : 52) +
                                    body.vertices * std::size_t(4 * functions + 64);
    const Work all = work + (double(body.vertices) / body.visual_vertices) * fieldVertexWork(functions);
    context.emitBest([&] {
      const Timing timing = measure(call, context.timing());
      BenchLine line = lineOf(name, "ns/visual vertex");
      line.value = 1e9 * timing.seconds / body.visual_vertices;
      line.spread = timing.spread;
      line.bound = 1e9 * boundSeconds(all, context.machine, working_set);
      line.limit = limit == 2 ? "<= 2 x bound" : "<= 4 x bound";
      line.margin = limit * line.bound / line.value;
      line.note =
          std::to_string(body.visual_vertices) + " visual vertices, " + std::to_string(body.vertices) + " physical";
      return line;
    });
  };
  emit("positions", {}, kVisualPositionWork, 2);
  emit("positions and normals", to_normals, kVisualPositionWork + kVisualNormalWork, 4);
}

}  // namespace sinew::tools
