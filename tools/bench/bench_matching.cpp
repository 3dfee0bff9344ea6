// SPDX-License-Identifier: GPL-3.0-or-later
//
// Matching, all phases (moments, rotation and F, goals, blending), a membership: the runtime's kernels against their
// bound and the Eigen reference, for each instruction set; and whether they agree.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "sinew/runtime/world.h"
#include "tests/benchmarks/eigen_reference.h"
#include "tools/bench/bench.h"
#include "tools/bench/bounds.h"
#include "tools/bench/fused_kernels.h"
#include "tools/bench/kernel_body.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr unsigned kSteps = 8;       // in a sample
constexpr float kKept = 0.5F;        // beta: half of a deformation stays
constexpr double kAgreement = 2e-5;  // of the body's size

struct Shape {
  std::array<std::uint32_t, 3> side;   // of a cluster, points
  std::array<std::uint32_t, 3> boxes;  // about 4,096 memberships in all: within L2
  double memberships = 1;
};
constexpr Shape kShapes[] = {{{2, 2, 2}, {8, 8, 8}},
                             {{4, 4, 2}, {8, 4, 4}},
                             {{4, 4, 4}, {4, 4, 4}},
                             {{6, 6, 6}, {3, 3, 2}},
                             {{4, 4, 4}, {3, 3, 3}, 2.5}};

using Path = std::vector<std::vector<Vec3>>;

// Positions of a body that moves on by its velocities, step by step.
Path makePath(const Asset& asset) {
  const MovingState state = movingState(asset);
  Path path;
  for (unsigned i = 0; i <= kSteps; ++i) {
    path.push_back(state.positions);
    for (std::size_t v = 0; v < state.positions.size(); ++v) {
      for (std::size_t k = 0; k < 3; ++k) path[i][v][k] += float(i) * kStep * state.velocities[v][k];
    }
  }
  return path;
}

double largestDistance(std::span<const Vec3> a, std::span<const Vec3> b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const double distance = std::abs(double(a[i][k]) - double(b[i][k]));
      if (!(distance <= largest)) largest = distance;  // keeps a NaN
    }
  }
  return largest;
}

// Largest distance of the runtime's match from the reference's, of the body's size: one pass from a body at rest in
// space that is turned, bent and twisted, through the public interface. Every cluster keeps the same part of its
// deformation. (Rigid ones would go back together, as one solid.)
template <int N>
double disagreement(LatticeOptions lattice, float kept) {
  lattice.per_step_beta = kept;
  const LatticeBody body = makeLattice(lattice);
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  settings.iterations = 1;
  settings.damping = 0;
  settings.deformation_damping_ratio = settings.support_damping = 0;
  World world(settings);
  const auto id = world.addBody(body.asset);
  const MovingState state = movingState(*body.asset);
  world.setState(*id, state.positions, {});
  world.step(kStep);
  std::vector<Vec3> goals(body.vertices);
  benchmarks::EigenReference<N> reference(body.asset->package(), kept);
  reference.match(state.positions, goals, benchmarks::RotationMethod::svd);
  return largestDistance(world.positions(*id), goals);
}

// The same of one table of kernels.
template <int N>
double kernelDisagreement(const LatticeBody& body, const internal::Kernels& kernels) {
  const MovingState state = movingState(*body.asset);
  KernelBody kernel_body(body.asset->package(), kKept);
  kernel_body.setPositions(state.positions);
  kernel_body.all(kernels);
  std::vector<Vec3> goals(body.vertices);
  benchmarks::EigenReference<N> reference(body.asset->package(), kKept);
  reference.match(state.positions, goals, benchmarks::RotationMethod::svd);
  return largestDistance(kernel_body.positions(), goals);
}

// Seconds of one call of work(y) along the path; the first call is not counted, so that the others start from the
// rotation of the step before. \param clock the wall's for what takes microseconds, since reading the thread's takes a
// fifth of one; the thread's for what takes longer.
template <class Prepare, class Call>
double sampleOfPath(const Path& path, ClockKind clock, const Prepare& prepare, const Call& call) {
  double seconds = 0;
  for (unsigned i = 0; i <= kSteps; ++i) {
    prepare(path[i]);
    const double before = clockSeconds(clock);
    call(path[i]);
    if (i > 0) seconds += clockSeconds(clock) - before;
  }
  return seconds / kSteps;
}

void emitAgreement(const BenchContext& context, const std::string& name, double distance) {
  BenchLine line = lineOf(name, "of the size");
  line.value = distance;
  line.limit = "<= 2e-5";
  line.margin = distance > 0 ? kAgreement / distance : 2;
  if (std::isnan(distance)) line.margin = 0.5;
  context.emit(line);
}

// The phases of matching apart, for the table of the instruction set that is chosen.
void emitPhases(const BenchContext& context, const std::string& name, const LatticeBody& body, const Path& path,
                KernelBody& kernel_body, const internal::Kernels& kernels) {
  using Phase = void (KernelBody::*)(const internal::Kernels&);
  struct Named {
    const char* name;
    Phase phase;
  };
  const std::array<Named, 4> phases = {{{"moments", &KernelBody::moments},
                                        {"rotation and F", &KernelBody::match},
                                        {"goals", &KernelBody::goals},
                                        {"blending", &KernelBody::apply}}};
  for (std::size_t wanted = 0; wanted < phases.size(); ++wanted) {
    const auto sample = [&] {
      return sampleOfPath(
          path, ClockKind::wall,
          [&](const std::vector<Vec3>& y) {
            kernel_body.setPositions(y);
            for (std::size_t p = 0; p < wanted; ++p) (kernel_body.*phases[p].phase)(kernels);
          },
          [&](const std::vector<Vec3>&) { (kernel_body.*phases[wanted].phase)(kernels); });
    };
    const bool of_cluster = phases[wanted].phase == &KernelBody::match;
    const Timing timing = measureSamples(sample, context.timing());
    BenchLine line = lineOf(name + ", " + phases[wanted].name, of_cluster ? "ns/cluster" : "ns/membership");
    line.value = 1e9 * timing.seconds / (of_cluster ? body.clusters : body.memberships);
    line.spread = timing.spread;
    context.emit(line);
  }
}

template <int N>
void benchMode(const BenchContext& context) {
  constexpr auto mode = N == 9 ? formats::ClusterMode::quadratic : formats::ClusterMode::linear;
  for (const Shape& shape : kShapes) {
    LatticeOptions lattice;
    lattice.boxes = shape.boxes;
    for (std::size_t a = 0; a < 3; ++a) lattice.points[a] = shape.side[a] * shape.boxes[a];
    lattice.memberships = shape.memberships;
    lattice.mode = mode;
    const LatticeBody body = makeLattice(lattice);
    const bool overlaps = shape.memberships > 1;
    const std::uint32_t size = body.memberships / body.clusters;
    const std::string name =
        (N == 9 ? "quadratic n=" : "linear n=") + std::to_string(size) + (overlaps ? " overlapping" : "");
    const Path path = makePath(*body.asset);

    benchmarks::EigenReference<N> reference(body.asset->package(), kKept);
    std::vector<Vec3> goals(body.vertices);
    const auto plain = [&] {
      return sampleOfPath(
          path, ClockKind::thread_cpu, [](const auto&) {},
          [&](const std::vector<Vec3>& y) { reference.match(y, goals); });
    };
    KernelBody kernel_body(body.asset->package(), kKept);
    const internal::Kernels* kernels = &internal::kernels();
    const auto ours = [&] {
      return sampleOfPath(
          path, ClockKind::wall, [&](const std::vector<Vec3>& y) { kernel_body.setPositions(y); },
          [&](const std::vector<Vec3>&) { kernel_body.all(*kernels); });
    };
    const Work work = matchingWork(mode, size, body.membershipsPerVertex());
    const std::size_t working_set = std::size_t(body.memberships) * 76;
    const auto measured = [&](const std::string& text) {
      const TimingPair pair = measureSamplePairs(ours, plain, context.timing());
      BenchLine line = lineOf(text, "ns/membership");
      line.value = 1e9 * pair.first.seconds / body.memberships;
      line.spread = pair.first.spread;
      line.bound = 1e9 * boundSeconds(work, context.machine, working_set);
      line.reference = 1e9 * pair.second.seconds / body.memberships;
      line.reference_is_peer = true;
      line.reference_name = "Eigen";
      line.ratio = pair.ratio;
      line.ratio_spread = pair.spread;
      return line;
    };
    context.emitBest([&] {
      BenchLine line = measured(name);
      line.margin = 1e9;
      const auto hold = [&](double margin, const std::string& text) {
        line.limit += (line.limit.empty() ? "" : ", ") + text;
        line.margin = std::min(line.margin, margin);
      };
      if (size >= 32) hold(3 * line.bound / line.value, "<= 3 x bound");
      if (size == 8) hold(line.ratio / 6, ">= 6 x Eigen");
      if (size == 64) hold(line.ratio / 4, ">= 4 x Eigen");
      line.note = kernels->name;
      return line;
    });
    emitPhases(context, name, body, path, kernel_body, *kernels);
    for (const char* set : {"sse42", "avx2", "avx512", "portable"}) {
      kernels = internal::kernelsNamed(set);
      if (kernels == nullptr) continue;
      if (std::strcmp(set, internal::kernels().name) != 0) context.emit(measured(name + ", " + set));
      emitAgreement(context, name + ", " + set + ", distance from the reference",
                    kernelDisagreement<N>(body, *kernels));
    }
    if (const internal::Kernels* const fused = fusedKernels()) {
      // Both sides are ours: with equal bits first.
      kernels = &internal::kernels();
      KernelBody other(body.asset->package(), kKept);
      const auto with_fused = [&] {
        return sampleOfPath(
            path, ClockKind::wall, [&](const std::vector<Vec3>& y) { other.setPositions(y); },
            [&](const std::vector<Vec3>&) { other.all(*fused); });
      };
      const TimingPair pair = measureSamplePairs(with_fused, ours, context.timing());
      BenchLine line = lineOf(name + ", multiply-add fused", "ns/membership");
      line.value = 1e9 * pair.first.seconds / body.memberships;
      line.spread = pair.first.spread;
      line.reference = 1e9 * pair.second.seconds / body.memberships;
      line.reference_name = "equal bits";
      line.ratio = pair.ratio;
      line.ratio_spread = pair.spread;
      context.emit(line);
    }
    emitAgreement(context, name + ", a world's step, distance from the reference",
                  std::max(disagreement<N>(lattice, 1), disagreement<N>(lattice, 0.05F)));
  }
}

}  // namespace

void benchMatching(const BenchContext& context) {
  benchMode<3>(context);
  benchMode<9>(context);
}

}  // namespace sinew::tools
