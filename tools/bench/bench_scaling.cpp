// SPDX-License-Identifier: GPL-3.0-or-later
//
// How the cost of a step grows: with vertices, with bodies, with threads; and that threads and instruction sets do not
// change the state.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#include "tools/bench/bench.h"
#include "tools/bench/child.h"
#include "tools/bench/lattice.h"
#include "tools/bench/meshes.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr double kMostExponent = 1.05;
constexpr double kSpeedup = 1.7;
constexpr double kManyBodiesMilliseconds = 10;

// A cube of n points a side in boxes of about five.
LatticeOptions cubeLattice(std::uint32_t side) {
  LatticeOptions lattice;
  lattice.points = {side, side, side};
  const std::uint32_t boxes = std::max(1U, (side + 2) / 5);
  lattice.boxes = {boxes, boxes, boxes};
  return lattice;
}

// As many as the rows of one body in the air have.
constexpr unsigned kAirSteps = 60;
// Of a sample of each size alike: a moving body's first steps cost more than those that follow.
constexpr unsigned kScalingSteps = 6;

struct ManyBodies {
  World world;
  MovingState state;
  std::vector<BodyId> ids;
  std::uint32_t vertices = 0;

  ManyBodies(const std::shared_ptr<const Asset>& asset, std::uint32_t count, JobSystem* jobs,
             std::uint32_t passes = WorldSettings{}.iterations, std::uint32_t level = 0)
      : world(settings(passes), jobs) {
    state = movingState(*asset);
    BodySettings body;
    body.level = level;
    for (std::uint32_t i = 0; i < count; ++i) ids.push_back(*world.addBody(asset, body));
    vertices = std::uint32_t(state.positions.size()) * count;
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
// step of the fewest iterations is shown beside it.
template <class Make>
void emitExponent(const BenchContext& context, const char* what, std::uint32_t passes, const std::vector<double>& sizes,
                  const Make& make) {
  std::vector<std::unique_ptr<ManyBodies>> worlds;
  std::vector<double> best(sizes.size(), 0);
  std::vector<Timing> timings(sizes.size());
  for (const double size : sizes) worlds.push_back(make(std::uint32_t(size)));
  context.emitBest([&] {
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      timings[i] = measure(worlds[i]->timed(kScalingSteps), context.timing());
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

struct Scene {
  std::shared_ptr<const Asset> asset;
  std::unique_ptr<ThreadPool> pool;
  std::unique_ptr<World> world;
  std::vector<BodyId> ids;
};

// A body dropped onto the ground, turning, one of its vertices pinned half way.
Scene determinismScene(unsigned threads) {
  Scene scene;
  if (threads > 0) scene.pool = std::make_unique<ThreadPool>(threads);
  WorldSettings settings;
  settings.ground.enabled = true;
  settings.ground.offset = -0.6F;
  scene.world = std::make_unique<World>(settings, scene.pool.get());
  scene.asset = blockBody(1000).asset;
  // Several, so that there is something to divide.
  for (int i = 0; i < 4; ++i) scene.ids.push_back(*scene.world->addBody(scene.asset));
  const MovingState state = movingState(*scene.asset);
  for (const BodyId id : scene.ids) scene.world->setState(id, state.positions, state.velocities);
  return scene;
}

}  // namespace

std::uint64_t determinismHash(unsigned threads, unsigned steps) {
  const Scene scene = determinismScene(threads);
  for (unsigned i = 0; i < steps; ++i) {
    for (const BodyId id : scene.ids) {
      if (i == steps / 2) scene.world->pin(id, 0, scene.world->positions(id)[0]);
    }
    scene.world->step(kStep);
  }
  std::uint64_t hash = 1469598103934665603ULL;  // FNV-1a
  for (const BodyId id : scene.ids) {
    for (const auto list : {scene.world->positions(id), scene.world->velocities(id)}) {
      for (const std::byte byte : std::as_bytes(list)) hash = (hash ^ std::uint64_t(byte)) * 1099511628211ULL;
    }
  }
  return hash;
}

double determinismStepMicroseconds(bool quick) {
  ManyBodies one(blockBody(1000).asset, 1, nullptr);
  const TimingOptions options = quick ? TimingOptions{5e-4, 5e-3} : TimingOptions{2e-3, 0.15};
  return 1e6 * measure(one.timed(20), options).seconds;
}

void benchLinearity(const BenchContext& context) {
  const std::vector<double> bodies =
      context.options.quick ? std::vector<double>{1, 10, 100} : std::vector<double>{1, 10, 100, 1e3, 1e4};
  const LatticeBody small = makeLattice(cubeLattice(5));
  for (const std::uint32_t passes : {WorldSettings{}.iterations, 1U}) {
    emitExponent(context, "bodies of 125 vertices", passes, bodies, [&](std::uint32_t count) {
      return std::make_unique<ManyBodies>(small.asset, count, nullptr, passes);
    });
  }
}

void benchThreads(const BenchContext& context) {
  const bool quick = context.options.quick;
  ThreadPool two(2);
  const auto measured = [&](const std::string& name, const std::shared_ptr<const Asset>& asset, std::uint32_t count,
                            bool milliseconds, std::uint32_t level = 0) {
    const std::uint32_t iterations = WorldSettings{}.iterations;
    ManyBodies alone(asset, count, nullptr, iterations, level), shared(asset, count, &two, iterations, level);
    const unsigned calls = quick ? 2 : kAirSteps;
    context.emitBest([&] {
      const SpeedupSamples samples = speedupOf(shared.timed(calls), alone.timed(calls), quick);
      const double scale = milliseconds ? 1e3 : 1e6 / count;
      BenchLine line = lineOf(name, milliseconds ? "ms/step" : "us/body");
      line.value = scale * quantile(samples.shared, 0.5);
      line.ratio_spread = samples.spread();
      line.reference_name = "one thread";
      line.reference = scale * quantile(samples.alone, 0.5);
      line.ratio = quantile(samples.ratios, 0.5);
      const bool quiet = samples.quiet >= kFewestQuiet;
      if (milliseconds) {
        line.limit = "<= 10 ms";
        line.margin = kManyBodiesMilliseconds / line.value;
      } else {
        line.limit = ">= 1.7 x one thread";
        if (quiet) line.margin = line.ratio / kSpeedup;
      }
      char text[160];
      std::snprintf(text, sizeof text, "%u of %u samples with the second core free%s", samples.quiet, samples.taken,
                    quiet ? "" : ", too few: these are all samples, by the wall's clock");
      line.note = text;
      return line;
    });
  };
  const LatticeBody small = makeLattice(cubeLattice(10));
  for (const std::uint32_t count : {10U, 100U}) {
    measured(std::to_string(count) + " bodies of 1000 vertices", small.asset, count, false);
  }
  const std::uint32_t many = quick ? 50 : 1000;
  const std::string name = "1000 bodies of 8 linear clusters, in the air";
  if (!context.options.models.empty()) {
    const auto asset = bakeMesh(context.options.models, kSpot,
                                {.vertices = quick ? 300U : 1500U, .grid = 2, .mode = "linear", .levels = 2});
    measured(name, asset, many, true);
    measured(name + ", level 2", asset, many, true, 2);
    return;
  }
  BenchLine line = lineOf(name, "ms/step");
  line.value = std::nan("");
  line.limit = "<= 10 ms";
  line.note = "no meshes: name tests/assets/models with --models";
  context.emit(line);
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
      BenchLine line = lineOf(std::string("step with ") + set, "us/step");
      line.value = child.step_microseconds;
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
