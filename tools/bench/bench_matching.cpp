// SPDX-License-Identifier: GPL-3.0-or-later
//
// Matching, all phases (moments, rotation and F, goals), a membership: against its bound and the Eigen reference.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "sinew/runtime/world.h"
#include "tests/benchmarks/eigen_reference.h"
#include "tools/bench/bench.h"
#include "tools/bench/bounds.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr unsigned kSteps = 8;  // in a sample

struct Shape {
  std::array<std::uint32_t, 3> side;   // of a cluster, points
  std::array<std::uint32_t, 3> boxes;  // about 4,096 memberships in all: within L2
};
constexpr Shape kShapes[] = {
    {{2, 2, 2}, {8, 8, 8}}, {{4, 4, 2}, {8, 4, 4}}, {{4, 4, 4}, {4, 4, 4}}, {{6, 6, 6}, {3, 3, 2}}};

// Largest distance of two sets of points.
double largestDistance(std::span<const Vec3> a, std::span<const Vec3> b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, std::abs(double(a[i][k]) - double(b[i][k])));
  }
  return largest;
}

WorldSettings plainSettings() {
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  settings.iterations = 1;
  settings.damping = 0;
  settings.deformation_damping = 0;
  return settings;
}

// Largest distance of the runtime's match from the reference's, of the body's size: one pass from a body at rest in
// space that is turned, bent and twisted. Without return to the rest shape (0 Hz) and rigid.
template <int N>
double disagreement(LatticeOptions lattice, double frequency_hz, float kept) {
  lattice.stretch_hz = lattice.bend_hz = lattice.twist_hz = frequency_hz;
  const LatticeBody body = makeLattice(lattice);
  World world(plainSettings());
  const auto id = world.addBody(body.asset);
  const MovingState state = movingState(*body.asset);
  world.setState(*id, state.positions, {});
  world.step(kStep);
  std::vector<Vec3> goals(body.vertices);
  benchmarks::EigenReference<N> reference(body.asset->package(), kept);
  reference.match(state.positions, goals, benchmarks::RotationMethod::svd);
  return largestDistance(world.positions(*id), goals);
}

double matchingMilliseconds(const World& world) {
  double sum = 0;
  for (const World::Phase& phase : world.lastStepPhases()) {
    for (const char* name : {"moments", "match", "goals"}) {
      if (std::strcmp(phase.name, name) == 0) sum += phase.milliseconds;
    }
  }
  return sum;
}

template <int N>
void benchMode(const BenchContext& context) {
  constexpr auto mode = N == 9 ? formats::ClusterMode::quadratic : formats::ClusterMode::linear;
  for (const Shape& shape : kShapes) {
    LatticeOptions lattice;
    lattice.boxes = shape.boxes;
    for (std::size_t a = 0; a < 3; ++a) lattice.points[a] = shape.side[a] * shape.boxes[a];
    lattice.memberships = 1;
    lattice.mode = mode;
    const LatticeBody body = makeLattice(lattice);
    const std::uint32_t size = shape.side[0] * shape.side[1] * shape.side[2];
    const std::string name = (N == 9 ? "quadratic n=" : "linear n=") + std::to_string(size);

    World world(plainSettings());
    const auto id = world.addBody(body.asset);
    const MovingState state = movingState(*body.asset);
    // The positions that the runtime matches in a sample, for the reference.
    std::vector<std::vector<Vec3>> path;
    world.setState(*id, state.positions, state.velocities);
    for (unsigned i = 0; i <= kSteps; ++i) {
      path.emplace_back(world.positions(*id).begin(), world.positions(*id).end());
      world.step(kStep);
    }
    const auto runtime = [&] {
      world.setState(*id, state.positions, state.velocities);
      double milliseconds = 0;
      for (unsigned i = 0; i < kSteps; ++i) {
        world.step(kStep);
        milliseconds += matchingMilliseconds(world);
      }
      return 1e-3 * milliseconds / kSteps;
    };
    std::vector<Vec3> goals(body.vertices);
    benchmarks::EigenReference<N> reference(body.asset->package(), 0.5F);
    const auto plain = [&] {
      reference.match(path[0], goals);
      const double before = clockSeconds(ClockKind::thread_cpu);
      for (unsigned i = 1; i <= kSteps; ++i) reference.match(path[i], goals);
      return (clockSeconds(ClockKind::thread_cpu) - before) / kSteps;
    };
    const Work work = matchingWork(mode, size, 1);
    const std::size_t working_set = std::size_t(body.memberships) * 76;
    context.emitBest([&] {
      const TimingPair pair = measureSamplePairs(runtime, plain, context.timing());
      BenchLine line = lineOf(name, "ns/membership");
      line.value = 1e9 * pair.first.seconds / body.memberships;
      line.spread = pair.spread;
      line.bound = 1e9 * boundSeconds(work, context.machine, working_set);
      line.reference = 1e9 * pair.second.seconds / body.memberships;
      line.reference_name = "Eigen";
      line.ratio = pair.ratio;
      line.margin = 1e9;
      const auto hold = [&](double margin, const std::string& text) {
        line.limit += (line.limit.empty() ? "" : ", ") + text;
        line.margin = std::min(line.margin, margin);
      };
      if (size >= 32) hold(3 * line.bound / line.value, "<= 3 x bound");
      if (size == 8) hold(line.ratio / 6, ">= 6 x Eigen");
      if (size == 64) hold(line.ratio / 4, ">= 4 x Eigen");
      return line;
    });
    BenchLine line = lineOf(name + ", distance from the reference", "of the size");
    line.value = std::max(disagreement<N>(lattice, 0, 1), disagreement<N>(lattice, 1e9, 0));
    line.limit = "<= 2e-5";
    line.margin = 2e-5 / line.value;
    context.emit(line);
  }
}

}  // namespace

void benchMatching(const BenchContext& context) {
  benchMode<3>(context);
  benchMode<9>(context);
}

}  // namespace sinew::tools
