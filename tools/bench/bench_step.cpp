// SPDX-License-Identifier: GPL-3.0-or-later
//
// A whole step of the body that the limits name, a vertex: against its bound and Bullet's cluster soft body.
#include <cmath>
#include <memory>

#include "sinew/runtime/world.h"
#if SINEW_WITH_BULLET
#include "tests/benchmarks/bullet_soft_body.h"
#endif
#include "tools/bench/bench.h"
#include "tools/bench/bounds.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr unsigned kSteps = 20;  // in a sample
constexpr double kTimesCheaper = 10;

// 5,000 vertices, 64 clusters, about 2.5 memberships a vertex.
LatticeOptions stepLattice() {
  LatticeOptions lattice;
  lattice.points = {20, 25, 10};
  lattice.boxes = {4, 8, 2};
  lattice.limits = true;
  return lattice;
}

BenchLine stepLine(const BenchContext& context, const LatticeBody& body, const Timing& timing) {
  BenchLine line;
  line.unit = "ns/vertex";
  line.value = 1e9 * timing.seconds / body.vertices;
  line.spread = timing.spread;
  const double memberships = body.membershipsPerVertex();
  const Work work = memberships * matchingWork(formats::ClusterMode::quadratic,
                                               double(body.memberships) / body.clusters, memberships) +
                    kSteppedVertexWork;
  line.bound = 1e9 * boundSeconds(work, context.machine, std::size_t(body.vertices) * 60 + body.memberships * 36ULL);
  line.note = std::to_string(body.vertices) + " vertices, " + std::to_string(body.clusters) + " clusters, " +
              std::to_string(body.memberships) + " memberships";
  return line;
}

}  // namespace

void benchStep(const BenchContext& context) {
  const LatticeBody body = makeLattice(stepLattice());
  const MovingState state = movingState(*body.asset);
  struct Scene {
    WorldSettings settings;
    std::unique_ptr<World> world;
    BodyId id;
  };
  const auto make_scene = [&](std::uint32_t iterations, bool ground) {
    Scene scene;
    scene.settings.iterations = iterations;
    scene.settings.ground.enabled = ground;
    scene.settings.ground.offset = ground ? -0.5F : 0.0F;
    scene.world = std::make_unique<World>(scene.settings);
    scene.id = *scene.world->addBody(body.asset);
    return scene;
  };
  const auto timed = [&](Scene& scene) {
    return TimedCall{[&scene] { scene.world->step(kStep); },
                     [&] { scene.world->setState(scene.id, state.positions, state.velocities); }, kSteps};
  };
  Scene single = make_scene(1, false);
#if SINEW_WITH_BULLET
  const auto compare = [&](bool moving) {
    benchmarks::BulletSoftBody bullet(30, 64, moving);
    const TimedCall other{[&] { bullet.step(); }, [&] { bullet.restart(); }, kSteps};
    context.emitBest([&] {
      const TimingPair pair = measurePair(timed(single), other, context.timing());
      BenchLine line = stepLine(context, body, pair.first);
      line.name = std::string("quadratic, 1 iteration, Bullet ") + (moving ? "falling and turning" : "at rest");
      line.ratio_spread = pair.spread;
      line.reference_is_peer = true;
      line.reference_name = "Bullet " + benchmarks::BulletSoftBody::version();
      line.reference = 1e9 * pair.second.seconds / bullet.vertices();
      line.ratio = pair.ratio * body.vertices / bullet.vertices();
      line.limit = ">= 10 x cheaper than Bullet";
      line.margin = line.ratio / kTimesCheaper;
      line.note += "; Bullet: " + std::to_string(bullet.vertices()) + " vertices, " +
                   std::to_string(bullet.memberships()) + " memberships";
      if (!bullet.isSound()) {
        line.note += "; Bullet's body flew apart, so this compares nothing";
        line.margin = 0;
      }
      return line;
    });
  };
  compare(false);
  compare(true);
#else
  BenchLine line = stepLine(context, body, measure(timed(single), context.timing()));
  line.name = "quadratic, 1 iteration";
  line.limit = ">= 10 x cheaper than Bullet";
  line.note += "; built without Bullet (libbullet-dev), so nothing is compared";
  context.emit(line);
#endif
  for (const std::uint32_t iterations : {1U, 4U}) {
    for (const bool ground : {false, true}) {
      Scene scene = make_scene(iterations, ground);
      BenchLine plain = stepLine(context, body, measure(timed(scene), context.timing()));
      plain.name = std::string(ground ? "on the ground" : "free") + ", " + std::to_string(iterations) +
                   (iterations == 1 ? " iteration" : " iterations");
      plain.bound = ground ? 0 : plain.bound * iterations;
      context.emit(plain);
    }
  }
}

}  // namespace sinew::tools
