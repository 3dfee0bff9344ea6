// SPDX-License-Identifier: GPL-3.0-or-later
//
// Bodies that fall into a box and touch each other until they rest.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"
#if SINEW_WITH_BULLET
#include "tests/benchmarks/bullet_heap.h"
#endif
#include "tools/bake/bake.h"
#include "tools/bench/bench.h"
#include "tools/bench/meshes.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
/// Bodies of the largest heap and what its steps may take: a frame.
constexpr std::uint32_t kMany = 1000;
constexpr double kFrame = 1000.0 / 60;
/// A body of a heap stands apart from its neighbours by so much, m; of 1 m cubes.
constexpr float kApart = 1.25F;
/// The first body reaches the ground after so many steps; a heap is watched for so many.
constexpr unsigned kImpact = 20, kWatched = 480;

/// A cube of 1 m as a game would bake one for heaps: few functions, few points.
std::shared_ptr<const Asset> heapCube() {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / ("sinew_bench_cube" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream obj(folder / "cube.obj");
  for (int i = 0; i < 8; ++i)
    obj << "v " << (i & 1) - 0.5 << ' ' << (i >> 1 & 1) - 0.5 << ' ' << (i >> 2) - 0.5 << '\n';
  obj << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
  obj.close();
  Recipe recipe = recipeFor(folder / "cube.obj");
  for (const auto& [name, value] : {std::pair{"tetrahedra.vertices", "27"},
                                    {"field.functions", "12"},
                                    {"field.points", "64"},
                                    {"clusters.stretch_hz", "30"},
                                    {"clusters.bend_hz", "30"},
                                    {"clusters.twist_hz", "30"}}) {
    recipe.settings.set(name, value);
  }
  Progress progress(false);
  auto asset = Asset::fromMemory(bake(recipe, progress).package);
  std::filesystem::remove_all(folder);
  if (!asset) {
    throw ToolError(ExitCode::system, "cube", "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  return *asset;
}

/// Places of a heap's bodies, in layers over a square box.
std::vector<std::array<float, 3>> placesOf(std::uint32_t count, float& half) {
  const auto side = std::uint32_t(std::max(2.0, std::ceil(std::cbrt(count / 2.0))));
  half = 0.5F * float(side) * kApart + 0.2F;
  std::uint32_t state = 1;
  const auto chance = [&state] {
    state = state * 1664525U + 1013904223U;
    return float(state >> 8) * 0x1p-24F - 0.5F;
  };
  std::vector<std::array<float, 3>> places;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto across = [&](std::uint32_t n) {
      return (float(n) + 0.5F - 0.5F * float(side)) * kApart + 0.2F * chance();
    };
    const std::uint32_t layer = i / (side * side);
    const float x = across(i % side), z = across(i / side % side);
    places.push_back({x, 0.7F + 1.3F * float(layer), z});
  }
  return places;
}

struct Heap {
  Heap(const std::shared_ptr<const Asset>& asset, std::uint32_t count, JobSystem* jobs) {
    WorldSettings settings;
    settings.collisions = true;
    settings.ground.enabled = true;
    settings.sleep_seconds = 0.5F;
    world = std::make_unique<World>(settings, jobs);
    float half = 0;
    for (const std::array<float, 3>& place : placesOf(count, half)) {
      BodySettings body;
      body.position = place;
      bodies.push_back(*world->addBody(asset, body));
    }
    for (const float sign : {-1.0F, 1.0F}) {
      ColliderSettings at;
      at.at.position = {sign * (half + 1), 0, 0};
      static_cast<void>(world->addCollider(BoxShape{{1, 100, half + 2}}, at));
      at.at.position = {0, 0, sign * (half + 1)};
      static_cast<void>(world->addCollider(BoxShape{{half + 2, 100, 1}}, at));
    }
  }
  bool rests() const {
    return std::all_of(bodies.begin(), bodies.end(), [&](BodyId id) { return world->isAsleep(id); });
  }
  std::unique_ptr<World> world;
  std::vector<BodyId> bodies;
};

double millisecondsOf(const std::function<void()>& call) {
  const double start = clockSeconds(ClockKind::wall);
  call();
  return 1e3 * (clockSeconds(ClockKind::wall) - start);
}

/// Median step from the first impact until all sleep, and a step of what sleeps.
void heap(const BenchContext& context, const std::shared_ptr<const Asset>& asset, std::uint32_t count) {
  ThreadPool pool(2);
  Heap scene(asset, count, &pool);
  const unsigned watched = context.options.quick ? 2 * kImpact : kWatched;
  std::vector<double> steps;
  unsigned step = 0;
  for (; step < watched && !scene.rests(); ++step) {
    const double taken = millisecondsOf([&] { scene.world->step(kStep); });
    if (step >= kImpact) steps.push_back(taken);
  }
  BenchLine line = lineOf(std::to_string(count) + " cubes in a box, from impact to rest, two threads", "ms/step");
  line.value = quantile(steps, 0.5);
  line.spread = 0.5 * (quantile(steps, 0.75) - quantile(steps, 0.25)) / line.value;
  if (count == kMany) {
    line.limit = "<= 16.7 ms";
    line.margin = kFrame / line.value;
  }
  char text[120];
  if (scene.rests()) {
    std::snprintf(text, sizeof text, "asleep after %.1f s; a step then takes %.4f ms", double(step) * double(kStep),
                  millisecondsOf([&] { scene.world->step(kStep); }));
  } else {
    std::snprintf(text, sizeof text, "awake after %.1f s", double(step) * double(kStep));
  }
  line.note = text + ("; " + sizesOf(*asset));
  context.emit(line);
}

#if SINEW_WITH_BULLET
/// The same heap beside Bullet's, in the first two seconds, on one thread each.
void beside(const BenchContext& context, const std::shared_ptr<const Asset>& asset, std::uint32_t count) {
  Heap scene(asset, count, nullptr);
  const ClosedSurface surface = surfaceOf(*asset);
  float half = 0;
  const auto places = placesOf(count, half);
  benchmarks::BulletHeap bullet(surface.vertices, surface.triangles, places, half, asset->package().info().total_mass);
  std::vector<double> own, other, ratios;
  const unsigned watched = context.options.quick ? 2 * kImpact : 6 * kImpact;
  for (unsigned step = 0; step < watched; ++step) {
    const double mine = millisecondsOf([&] { scene.world->step(kStep); });
    const double peer = millisecondsOf([&] { bullet.step(); });
    if (step < kImpact) continue;
    own.push_back(mine);
    other.push_back(peer);
    ratios.push_back(peer / mine);
  }
  BenchLine line = lineOf(std::to_string(count) + " cubes in a box, the first two seconds, one thread", "ms/step");
  line.value = quantile(own, 0.5);
  line.spread = 0.5 * (quantile(own, 0.75) - quantile(own, 0.25)) / line.value;
  line.reference_name = "Bullet's cluster soft bodies";
  line.reference = quantile(other, 0.5);
  line.reference_is_peer = true;
  line.ratio = quantile(ratios, 0.5);
  line.ratio_spread = 0.5 * (quantile(ratios, 0.75) - quantile(ratios, 0.25)) / line.ratio;
  line.note = std::to_string(surface.vertices.size() / 3) + " vertices, 8 clusters a body at Bullet's";
  context.emit(line);
}
#endif

}  // namespace

void benchTouch(const BenchContext& context) {
  const auto asset = heapCube();
  const std::vector<std::uint32_t> counts = context.options.quick
                                                ? std::vector<std::uint32_t>{8}
                                                : std::vector<std::uint32_t>{125, 250, 500, kMany, 2 * kMany};
  for (const std::uint32_t count : counts) heap(context, asset, count);
#if SINEW_WITH_BULLET
  beside(context, asset, context.options.quick ? 8 : 125);
#endif
}

}  // namespace sinew::tools
