// SPDX-License-Identifier: GPL-3.0-or-later
//
// A whole step of one body, as a bake makes it of a real mesh: in the air, on the ground, held; by size and by
// clusters; the face with its muscles; beside Bullet's soft body of the same surface.
#include <algorithm>
#include <cmath>
#include <memory>

#include "sinew/runtime/report.h"
#include "sinew/runtime/world.h"
#if SINEW_WITH_BULLET
#include "tests/benchmarks/bullet_soft_body.h"
#endif
#include "tools/bake/leave_out.h"
#include "tools/bench/bench.h"
#include "tools/bench/lattice.h"
#include "tools/bench/meshes.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

constexpr float kStep = 1.0F / 60;
constexpr unsigned kSteps = 60;         // in a sample
constexpr unsigned kStepsToRest = 900;  // after which a dropped body rests
constexpr double kAirMicroseconds = 30, kGroundTimes = 2, kHeldTimes = 1.2, kSizeTimes = 1.1, kUnusedTimes = 1.02;
constexpr double kFaceMicroseconds = 200, kTimesCheaper = 10;

enum class Place { air, falling_on_the_ground, resting, held, hanging };

const char* nameOf(Place place) {
  switch (place) {
    case Place::air:
      return "in the air";
    case Place::falling_on_the_ground:
      return "falling onto the ground";
    case Place::resting:
      return "resting on the ground";
    case Place::held:
      return "held by its pins, swinging";
    case Place::hanging:
      return "held by its pins, at rest";
  }
  return "";
}

bool isHeld(Place place) { return place == Place::held || place == Place::hanging; }
bool isOnGround(Place place) { return place == Place::falling_on_the_ground || place == Place::resting; }

/// A body of a package that has pins, which are let go where the place is another.
class Scene {
 public:
  Scene(const std::shared_ptr<const Asset>& asset, Place place, bool report = false, std::uint32_t level = 0)
      : place_(place) {
    const formats::PackageInfo& info = asset->package().info();
    WorldSettings settings;
    settings.ground.enabled = isOnGround(place);
    const float above = place == Place::falling_on_the_ground ? 0.1F : 1e-3F;
    settings.ground.offset = info.bounds_min[1] - above * info.diagonal;
    world_ = std::make_unique<World>(settings);
    BodySettings body;
    if (report) body.solver = &reportSolver();
    body.level = level;
    id_ = *world_->addBody(asset, body);
    if (!isHeld(place)) {
      const PinSetId pins = world_->pinSet(id_, kBenchPins);
      if (pins != PinSetId{}) world_->removePinSet(pins);
    }
    state_ = movingState(*asset);
    if (place == Place::resting || place == Place::hanging) {
      for (unsigned i = 0; i < kStepsToRest; ++i) world_->step(kStep);
    }
  }
  TimedCall timed() {
    TimedCall call{[this] { world_->step(kStep); }, [] {}, kSteps};
    if (place_ == Place::air) call.prepare = [this] { world_->setState(id_, state_.positions, state_.velocities); };
    if (place_ == Place::held || place_ == Place::falling_on_the_ground) {
      call.prepare = [this] { world_->resetBody(id_); };
    }
    return call;
  }

 private:
  Place place_;
  std::unique_ptr<World> world_;
  BodyId id_;
  MovingState state_;
};

BenchLine stepLine(std::string name, const Asset& asset, const Timing& timing) {
  BenchLine line = lineOf(std::move(name), "us/step");
  line.value = 1e6 * timing.seconds;
  line.spread = timing.spread;
  line.note = sizesOf(asset);
  return line;
}

void compareTo(BenchLine& line, const std::string& name, const TimingPair& pair) {
  line.reference_name = name;
  line.reference = 1e6 * pair.second.seconds;
  line.ratio = pair.ratio;
  line.ratio_spread = pair.spread;
}

/// Held to a multiple of another scene's time.
void emitAgainst(const BenchContext& context, const std::string& name, const std::shared_ptr<const Asset>& asset,
                 Scene& scene, const std::string& other_name, Scene& other, double most, const char* limit) {
  context.emitBest([&] {
    const TimingPair pair = measurePair(scene.timed(), other.timed(), context.timing());
    BenchLine line = stepLine(name, *asset, pair.first);
    compareTo(line, other_name, pair);
    line.limit = limit;
    line.margin = most * pair.ratio;
    return line;
  });
}

void emitPlaces(const BenchContext& context, const std::string& mesh, const std::shared_ptr<const Asset>& asset) {
  Scene air(asset, Place::air), falling(asset, Place::falling_on_the_ground), resting(asset, Place::resting),
      held(asset, Place::held), hanging(asset, Place::hanging);
  const auto name = [&](Place place) { return mesh + ", " + nameOf(place); };
  context.emitBest([&] {
    BenchLine line = stepLine(name(Place::air), *asset, measure(air.timed(), context.timing()));
    line.limit = "<= 30 us";
    line.margin = kAirMicroseconds / line.value;
    return line;
  });
  emitAgainst(context, name(Place::resting), asset, resting, "in the air", air, kGroundTimes, "<= 2 x in the air");
  emitAgainst(context, name(Place::held), asset, held, "in the air", air, kHeldTimes, "<= 1.2 x in the air");
  context.emit(stepLine(name(Place::hanging), *asset, measure(hanging.timed(), context.timing())));
  context.emit(stepLine(name(Place::falling_on_the_ground), *asset, measure(falling.timed(), context.timing())));
  Scene report(asset, Place::air, true);
  context.emit(
      stepLine(name(Place::air) + ", by the report's solver", *asset, measure(report.timed(), context.timing())));
}

// Package content that a scene does not use takes no time.
void emitUnused(const BenchContext& context, const std::string& mesh, const std::shared_ptr<const Asset>& asset) {
  const auto least = Asset::fromMemory(packageWith(asset->package(), Needs::none().with(Need::exact)));
  if (!least)
    throw ToolError(ExitCode::system, "", "a package without needs is refused: " + least.reason(),
                    "This is a fault of sinew: please report it.");
  Scene all(asset, Place::air), none(*least, Place::air);
  emitAgainst(context, mesh + ", in the air, with all that a bake has", asset, all, "with no needs", none, kUnusedTimes,
              "<= 1.02 x with no needs");
}

void emitSizes(const BenchContext& context, const std::string& mesh, const std::shared_ptr<const Asset>& small,
               const std::shared_ptr<const Asset>& large, const std::string& vertices) {
  const std::string name = mesh + " of " + vertices + " vertices, ";
  for (const Place place : {Place::air, Place::resting, Place::held}) {
    Scene of_large(large, place), of_small(small, place);
    emitAgainst(context, name + nameOf(place), large, of_large, "the smaller", of_small, kSizeTimes,
                "<= 1.1 x the smaller");
  }
}

void emitLevels(const BenchContext& context, const std::shared_ptr<const Asset>& asset) {
  for (std::uint32_t level = 1; level < asset->levels(); ++level) {
    const std::uint32_t functions = asset->package().allFields()[level].function_count;
    Scene air(asset, Place::air, false, level);
    context.emit(
        stepLine("spot, in the air, level " + std::to_string(level) + " of " + std::to_string(functions) + " functions",
                 *asset, measure(air.timed(), context.timing())));
  }
}

void emitClusters(const BenchContext& context, std::uint32_t vertices) {
  const auto baked = [&](std::uint32_t side) {
    return bakeMesh(context.options.models, kSpot, {.vertices = vertices, .grid = side});
  };
  const auto one = baked(1);
  Scene of_one(one, Place::air);
  context.emit(stepLine("spot in 1 box, in the air", *one, measure(of_one.timed(), context.timing())));
  for (const std::uint32_t side : {2U, 3U, 4U}) {
    const auto asset = baked(side);
    Scene scene(asset, Place::air);
    emitAgainst(context, "spot in " + std::to_string(side * side * side) + " boxes, in the air", asset, scene,
                "one cluster", of_one, kSizeTimes, "<= 1.1 x one cluster");
  }
}

void emitPeers([[maybe_unused]] const BenchContext& context, [[maybe_unused]] const BenchMesh& mesh,
               [[maybe_unused]] const std::shared_ptr<const Asset>& asset) {
#if SINEW_WITH_BULLET
  const ClosedSurface surface = surfaceOf(*asset);
  const formats::PackageInfo& info = asset->package().info();
  std::vector<std::uint8_t> pinned(surface.vertices.size() / 3);
  for (std::size_t i = 0; i < pinned.size(); ++i) {
    double beyond = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double at = double(surface.vertices[3 * i + c]) + info.origin[c];
      beyond += (at - mesh.pin_from[c]) * mesh.pin_normal[c];
    }
    pinned[i] = beyond >= 0 ? 1 : 0;
  }
  for (const Place place : {Place::air, Place::resting, Place::held}) {
    benchmarks::BulletSoftBody::Scene other;
    other.ground = isOnGround(place);
    other.moving = place == Place::air;
    other.total_mass = info.total_mass;
    if (isHeld(place)) other.held = pinned;
    benchmarks::BulletSoftBody bullet(surface.vertices, surface.triangles, other);
    if (place == Place::resting) {
      for (unsigned i = 0; i < kStepsToRest; ++i) bullet.step();
    }
    TimedCall bullet_call{[&] { bullet.step(); }, [] {}, kSteps};
    if (place != Place::resting) bullet_call.prepare = [&] { bullet.restart(); };
    Scene scene(asset, place);
    context.emitBest([&] {
      const TimingPair pair = measurePair(scene.timed(), bullet_call, context.timing());
      BenchLine line = stepLine(std::string(mesh.name) + ", " + nameOf(place) + ", beside Bullet", *asset, pair.first);
      compareTo(line, "Bullet " + benchmarks::BulletSoftBody::version(), pair);
      line.reference_is_peer = true;
      line.limit = ">= 10 x cheaper than Bullet";
      line.margin = line.ratio / kTimesCheaper;
      line.note +=
          "; Bullet: " + std::to_string(bullet.vertices()) + " vertices, " + std::to_string(bullet.links()) + " links";
      if (!bullet.isSound()) line.note += "; Bullet's body did not stay whole";
      return line;
    });
  }
#endif
}

void emitFace(const BenchContext& context) {
  auto opened = Asset::load(context.options.face.string());
  if (!opened) {
    throw ToolError(ExitCode::bad_input, context.options.face.string(), "the package does not open: " + opened.reason(),
                    "Bake samples/gallery/face/recipe.json anew.");
  }
  const std::shared_ptr<const Asset> asset = *opened;
  for (const std::uint32_t iterations : {WorldSettings{}.iterations, 1U}) {
    WorldSettings settings;
    settings.iterations = iterations;
    World world(settings);
    const BodyId id = *world.addBody(asset);
    unsigned frame = 0;
    // As samples/gallery/face/smile.json, again and again.
    const TimedCall call{[&] {
                           const float part = float(0.5 - 0.5 * std::cos(0.1 * frame++));
                           const auto channels = asset->package().channels();
                           for (std::uint32_t c = 0; c < channels.size(); ++c) {
                             const std::string_view name = asset->package().text(channels[c].name);
                             const bool full = name.starts_with("zygomaticus_major") || name.starts_with("risorius");
                             const bool some =
                                 name.starts_with("zygomaticus_minor") || name.starts_with("levator_anguli_oris");
                             if (full || some) world.setActivation(id, c, full ? part : 0.2F * part);
                           }
                           world.step(kStep);
                         },
                         [] {}, kSteps};
    context.emitBest([&] {
      BenchLine line = stepLine(iterations == 1 ? "face, smiling, 1 iteration" : "face, smiling", *asset,
                                measure(call, context.timing()));
      if (iterations > 1) {
        line.limit = "<= 200 us";
        line.margin = kFaceMicroseconds / line.value;
      }
      return line;
    });
  }
}

void emitMissing(const BenchContext& context, const char* name, const char* limit, const char* why) {
  BenchLine line = lineOf(name, "us/step");
  line.value = std::nan("");
  line.limit = limit;
  line.note = why;
  context.emit(line);
}

}  // namespace

void benchStep(const BenchContext& context) {
  const bool quick = context.options.quick;
  const std::filesystem::path& models = context.options.models;
  if (models.empty()) {
    emitMissing(context, "spot, in the air", "<= 30 us", "no meshes: name tests/assets/models with --models");
  } else {
    const std::uint32_t small = quick ? 300 : 1500, large = quick ? 900 : 8000;
    for (const BenchMesh& mesh : {kSpot, kHead}) {
      const auto baked = [&](std::uint32_t vertices) {
        return bakeMesh(models, mesh, {.vertices = vertices, .pinned = true});
      };
      const auto asset = baked(small);
      emitPlaces(context, mesh.name, asset);
      emitUnused(context, mesh.name, asset);
      emitPeers(context, mesh, asset);
      if (!quick || mesh.name == kSpot.name) emitSizes(context, mesh.name, asset, baked(large), std::to_string(large));
    }
    emitClusters(context, small);
    emitLevels(context, bakeMesh(models, kSpot, {.vertices = small, .levels = 2}));
  }
  if (context.options.face.empty()) {
    emitMissing(context, "face, smiling", "<= 200 us", "no package: bake samples/gallery/face and name it with --face");
  } else {
    emitFace(context);
  }
}

}  // namespace sinew::tools
