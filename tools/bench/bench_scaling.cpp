// SPDX-License-Identifier: GPL-3.0-or-later
//
// How the cost of a step grows: with vertices, with bodies, with threads; and that threads and instruction sets do not
// change the state.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tools/bench/bench.h"
#include "tools/bench/bounds.h"
#include "tools/bench/child.h"
#include "tools/bench/lattice.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr double kMostExponent = 1.05;
constexpr double kSpeedup = 1.7;
constexpr std::uint32_t kSpeedupMemberships = 20'000;

// A cube of n points a side in boxes of about five.
LatticeOptions cubeLattice(std::uint32_t side) {
  LatticeOptions lattice;
  lattice.points = {side, side, side};
  const std::uint32_t boxes = std::max(1U, (side + 2) / 5);
  lattice.boxes = {boxes, boxes, boxes};
  return lattice;
}

struct ManyBodies {
  World world;
  MovingState state;
  std::vector<BodyId> ids;
  std::uint32_t vertices = 0;
  Work pass_work;               ///< of all bodies
  std::size_t working_set = 0;  ///< bytes, of all bodies

  ManyBodies(const LatticeBody& body, std::uint32_t count, JobSystem* jobs, std::uint32_t passes = 1)
      : world(settings(passes), jobs) {
    state = movingState(*body.asset);
    for (std::uint32_t i = 0; i < count; ++i) ids.push_back(*world.addBody(body.asset));
    vertices = body.vertices * count;
    const double memberships = body.membershipsPerVertex();
    pass_work = double(vertices) * (memberships * matchingWork(formats::ClusterMode::quadratic,
                                                               double(body.memberships) / body.clusters, memberships) +
                                    kSteppedVertexWork);
    working_set = count * (std::size_t(body.vertices) * 60 + body.memberships * 36ULL);
  }
  static WorldSettings settings(std::uint32_t passes) {
    WorldSettings result;
    result.gravity = {0, 0, 0};
    result.iterations = passes;
    return result;
  }
  void restart() {
    for (const BodyId id : ids) world.setState(id, state.positions, state.velocities);
  }
  TimedCall timed(unsigned calls) {
    return {[this] { world.step(kStep); }, [this] { restart(); }, calls};
  }
};

// Slope of log(cost) over log(size) by least squares.
double exponentOf(const std::vector<double>& sizes, const std::vector<double>& costs) {
  double sx = 0, sy = 0, sxx = 0, sxy = 0;
  const double n = double(sizes.size());
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double x = std::log(sizes[i]), y = std::log(costs[i]);
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
  }
  return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}

// "ns/vertex: 1000: 31.20; 10000: 32.10".
std::string costsOf(const std::vector<double>& sizes, const std::vector<double>& seconds,
                    const std::vector<std::unique_ptr<ManyBodies>>& worlds) {
  std::string result = "ns/vertex:";
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    char text[64];
    std::snprintf(text, sizeof text, " %.0f: %.2f;", sizes[i], 1e9 * seconds[i] / worlds[i]->vertices);
    result += text;
  }
  result.pop_back();
  return result;
}

// Measures the costs of worlds that grow, and emits each and their exponent. The limit is on a step as it is shipped; a
// step of one pass, which has the least work for what it must fetch, is shown beside it.
template <class Make>
void emitExponent(const BenchContext& context, const char* what, std::uint32_t passes, const std::vector<double>& sizes,
                  const Make& make) {
  std::vector<std::unique_ptr<ManyBodies>> worlds;
  std::vector<double> best(sizes.size(), 0);
  std::vector<Timing> timings(sizes.size());
  for (const double size : sizes) worlds.push_back(make(std::uint32_t(size)));
  context.emitBest([&] {
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      const unsigned calls = unsigned(std::clamp(2e5 / worlds[i]->vertices, 1.0, 50.0));
      timings[i] = measure(worlds[i]->timed(calls), context.timing());
      if (best[i] == 0 || timings[i].seconds < best[i]) best[i] = timings[i].seconds;
    }
    BenchLine line = lineOf("exponent over " + std::string(what) + ", " + std::to_string(passes) +
                                (passes == 1 ? " iteration" : " iterations"),
                            "");
    line.value = exponentOf(sizes, best);
    if (passes == WorldSettings{}.iterations) {
      line.limit = "<= 1.05";
      line.margin = kMostExponent / line.value;
    }
    line.note = costsOf(sizes, best, worlds);
    return line;
  });
  if (passes != WorldSettings{}.iterations || worlds.back()->ids.size() > 1) return;
  // What memory alone makes of it: each pass over a body that does not fit a cache fetches it anew. (Of many small
  // bodies only the first pass does.)
  std::vector<double> bounds;
  for (const auto& one : worlds) {
    bounds.push_back(passes * boundSeconds(one->pass_work, context.machine, one->working_set));
  }
  BenchLine line = lineOf("exponent over " + std::string(what) + ", of its bound", "");
  line.value = exponentOf(sizes, bounds);
  line.note = costsOf(sizes, bounds, worlds);
  context.emit(line);
}

// Samples of two threads and of one, in turn. Where others use the machine, only those count that lie between two
// moments at which plain arithmetic ran on both cores at once.
struct SpeedupSamples {
  std::vector<double> alone, shared, ratios;  // of the quiet samples; of all where there are too few
  unsigned taken = 0, quiet = 0;
  double spread() const {
    return 0.5 * (quantile(ratios, 0.75) - quantile(ratios, 0.25)) / std::max(1e-30, quantile(ratios, 0.5));
  }
};
constexpr double kFreeCore = 1.85;  // arithmetic's own speedup above which the second core counts as free
constexpr unsigned kFewestQuiet = 5, kEnoughQuiet = 21;

SpeedupSamples speedupOf(const TimedCall& shared, const TimedCall& alone, bool quick) {
  SpeedupSamples quiet, all;
  const double begin = clockSeconds(ClockKind::wall);
  const double least = quick ? 0.01 : 0.3, most = quick ? 0.02 : 4.0;
  const auto seconds_of = [](const TimedCall& call) {
    call.prepare();
    call.call();  // wakes threads that slept since the last sample
    const double before = clockSeconds(ClockKind::wall);
    for (unsigned i = 0; i < call.calls_per_sample; ++i) call.call();
    return (clockSeconds(ClockKind::wall) - before) / call.calls_per_sample;
  };
  for (double passed = 0; passed < least || (quiet.alone.size() < kEnoughQuiet && passed < most);
       passed = clockSeconds(ClockKind::wall) - begin) {
    const double free_before = measureSecondCore();
    const double with_two = seconds_of(shared);
    const double free_after = measureSecondCore();
    const double with_one = seconds_of(alone);
    const auto add = [&](SpeedupSamples& to) {
      to.alone.push_back(with_one);
      to.shared.push_back(with_two);
      to.ratios.push_back(with_one / with_two);
    };
    add(all);
    if (std::min(free_before, free_after) >= kFreeCore) add(quiet);
  }
  SpeedupSamples& result = quiet.alone.size() >= kFewestQuiet ? quiet : all;
  result.taken = unsigned(all.alone.size());
  result.quiet = unsigned(quiet.alone.size());
  return result;
}

// Runs loops in the caller's thread as two threads would share them, range by range to the one that is done first, and
// counts the time that two would have saved. So the division of work can be judged on a machine whose second core is
// busy; what waking and waiting costs is left out.
class DividedJobs final : public JobSystem {
 public:
  explicit DividedJobs(ClockKind clock) : clock_(clock) {}
  void parallelFor(std::uint32_t count, std::uint32_t grain,
                   const std::function<void(std::uint32_t, std::uint32_t)>& body) override {
    const std::uint32_t size = std::max({1U, grain, count / kRanges});
    double first = 0, second = 0;
    for (std::uint32_t begin = 0; begin < count; begin += size) {
      const double before = clockSeconds(clock_);
      body(begin, std::min(begin + size, count));
      (first <= second ? first : second) += clockSeconds(clock_) - before;
    }
    saved_ += std::min(first, second);
  }
  double takeSaved() { return std::exchange(saved_, 0.0); }

 private:
  static constexpr std::uint32_t kRanges = 16;  // as ThreadPool divides for two
  ClockKind clock_;
  double saved_ = 0;
};

// How many times faster two threads could be by how a step is divided, waking and waiting apart.
Timing dividedSpeedup(const LatticeBody& body, unsigned calls, const TimingOptions& options) {
  // Reading the thread's own clock takes a fifth of a microsecond: too much for the ranges of small steps.
  const ClockKind clock = body.vertices > 20'000 ? ClockKind::thread_cpu : ClockKind::wall;
  DividedJobs jobs(clock);
  ManyBodies bodies(body, 1, &jobs);
  return measureSamples(
      [&] {
        bodies.restart();
        jobs.takeSaved();
        const double before = clockSeconds(clock);
        for (unsigned i = 0; i < calls; ++i) bodies.world.step(kStep);
        const double whole = clockSeconds(clock) - before;
        return whole / (whole - jobs.takeSaved());
      },
      options);
}

struct Scene {
  LatticeBody body;
  std::unique_ptr<ThreadPool> pool;
  std::unique_ptr<World> world;
  BodyId id;
};

// A body of 5,000 vertices dropped onto the ground, turning, one of its vertices pinned half way.
Scene determinismScene(unsigned threads) {
  Scene scene;
  LatticeOptions lattice;
  lattice.points = {20, 25, 10};
  lattice.boxes = {4, 8, 2};
  scene.body = makeLattice(lattice);
  if (threads > 0) scene.pool = std::make_unique<ThreadPool>(threads);
  WorldSettings settings;
  settings.iterations = 2;
  settings.ground.enabled = true;
  settings.ground.offset = -0.6F;
  scene.world = std::make_unique<World>(settings, scene.pool.get());
  scene.id = *scene.world->addBody(scene.body.asset);
  const MovingState state = movingState(*scene.body.asset);
  scene.world->setState(scene.id, state.positions, state.velocities);
  return scene;
}

}  // namespace

std::uint64_t determinismHash(unsigned threads, unsigned steps) {
  const Scene scene = determinismScene(threads);
  for (unsigned i = 0; i < steps; ++i) {
    if (i == steps / 2) scene.world->pin(scene.id, 0, scene.world->positions(scene.id)[0]);
    scene.world->step(kStep);
  }
  std::uint64_t hash = 1469598103934665603ULL;  // FNV-1a
  for (const auto list : {scene.world->positions(scene.id), scene.world->velocities(scene.id)}) {
    for (const std::byte byte : std::as_bytes(list)) hash = (hash ^ std::uint64_t(byte)) * 1099511628211ULL;
  }
  return hash;
}

double determinismStepNanoseconds(bool quick) {
  Scene scene = determinismScene(0);
  scene.world->settings().ground.enabled = false;
  scene.world->settings().gravity = {0, 0, 0};
  scene.world->settings().iterations = 1;
  const MovingState state = movingState(*scene.body.asset);
  const TimedCall call{[&] { scene.world->step(kStep); },
                       [&] { scene.world->setState(scene.id, state.positions, state.velocities); }, 20};
  const TimingOptions options = quick ? TimingOptions{5e-4, 5e-3} : TimingOptions{2e-3, 0.15};
  return 1e9 * measure(call, options).seconds / scene.body.vertices;
}

void benchLinearity(const BenchContext& context) {
  const bool quick = context.options.quick;
  const std::vector<double> vertices = quick ? std::vector<double>{1e3, 1e4} : std::vector<double>{1e3, 1e4, 1e5, 1e6};
  const std::vector<double> bodies =
      quick ? std::vector<double>{1, 10, 100} : std::vector<double>{1, 10, 100, 1e3, 1e4};
  const LatticeBody small = makeLattice(cubeLattice(5));
  for (const std::uint32_t passes : {WorldSettings{}.iterations, 1U}) {
    emitExponent(context, "vertices of a body", passes, vertices, [&](std::uint32_t count) {
      const std::uint32_t side = std::uint32_t(std::lround(std::cbrt(count)));
      return std::make_unique<ManyBodies>(makeLattice(cubeLattice(side)), 1, nullptr, passes);
    });
    emitExponent(context, "bodies of 125 vertices", passes, bodies,
                 [&](std::uint32_t count) { return std::make_unique<ManyBodies>(small, count, nullptr, passes); });
  }
}

void benchThreads(const BenchContext& context) {
  ThreadPool two(2);
  const auto emit = [&](const std::string& name, const LatticeBody& body, std::uint32_t count) {
    const std::uint32_t memberships = body.memberships * count;
    ManyBodies alone(body, count, nullptr), shared(body, count, &two);
    const unsigned calls = unsigned(std::clamp(2e5 / (body.vertices * count), 2.0, 50.0));
    context.emitBest([&] {
      const SpeedupSamples samples = speedupOf(shared.timed(calls), alone.timed(calls), context.options.quick);
      BenchLine line = lineOf(name, "ns/vertex");
      line.value = 1e9 * quantile(samples.shared, 0.5) / alone.vertices;
      line.ratio_spread = samples.spread();
      line.reference_name = "one thread";
      line.reference = 1e9 * quantile(samples.alone, 0.5) / alone.vertices;
      line.ratio = quantile(samples.ratios, 0.5);
      if (memberships >= kSpeedupMemberships) {
        line.limit = ">= 1.7 x one thread";
        if (samples.quiet >= kFewestQuiet) line.margin = line.ratio / kSpeedup;
      }
      char text[160];
      std::snprintf(text, sizeof text, "%u memberships; %u of %u samples with the second core free%s", memberships,
                    samples.quiet, samples.taken,
                    samples.quiet >= kFewestQuiet ? "" : ", too few to judge: these are all samples");
      line.note = text;
      return line;
    });
    if (count > 1) return;  // whole bodies go to whichever thread is free: there is no division to be timed
    const Timing divided = dividedSpeedup(body, calls, context.timing());
    BenchLine line = lineOf(name + ", as its work divides", "x one thread");
    line.lower_is_better = false;
    line.value = divided.seconds;
    line.spread = divided.spread;
    line.note = "two threads without the cost of waking and waiting";
    context.emit(line);
  };
  std::vector<std::uint32_t> sides = {10, 13, 16, 20, 30, 40};
  if (!context.options.quick) sides.push_back(64);
  for (const std::uint32_t side : sides) {
    const LatticeBody body = makeLattice(cubeLattice(side));
    emit("one body of " + std::to_string(body.vertices) + " vertices", body, 1);
  }
  const LatticeBody small = makeLattice(cubeLattice(10));
  for (const std::uint32_t count : {10U, 100U}) emit(std::to_string(count) + " bodies of 1000 vertices", small, count);
}

void benchDeterminism(const BenchContext& context) {
  const unsigned steps = context.options.quick ? 10 : 60;
  const std::uint64_t expected = determinismHash(0, steps);
  const auto text = [](std::uint64_t hash) {
    char digits[24];
    std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
    return std::string(digits);
  };
  const auto emit = [&](const std::string& name, std::uint64_t hash) {
    BenchLine line = lineOf(name, "differing states");
    line.value = hash == expected ? 0 : 1;
    line.limit = "same bits";
    line.margin = hash == expected ? 1 : 0.5;
    line.note = "state " + text(hash) + " after " + std::to_string(steps) + " steps";
    context.emit(line);
  };
  for (const unsigned threads : {1U, 2U, 3U, 8U}) {
    emit(std::to_string(threads) + (threads == 1 ? " thread" : " threads"), determinismHash(threads, steps));
  }
  for (const char* set : {"sse42", "avx2", "avx512"}) {
    const ChildResult child = runBenchChild(context.options, set, steps);
    if (child.ran) {
      emit(std::string("instruction set ") + set, child.hash);
      BenchLine line = lineOf(std::string("step with ") + set, "ns/vertex");
      line.value = child.step_nanoseconds;
      context.emit(line);
    } else {
      BenchLine line = lineOf(std::string("instruction set ") + set, "differing states");
      line.value = std::nan("");
      line.limit = "same bits";
      line.note = child.reason;
      context.emit(line);
    }
  }
}

}  // namespace sinew::tools
