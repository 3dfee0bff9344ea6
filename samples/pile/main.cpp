// SPDX-License-Identifier: MIT
//
// Bodies that touch: a pile falls into a box, sleeps, and is pushed, thrown, blown at, picked, paused and put back.
//   sample_pile PACKAGE.sinew [BODIES]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "sinew/runtime/thread_pool.h"
#include "sinew/runtime/world.h"

int main(int argc, char** argv) {
  const int count = argc > 2 ? std::atoi(argv[2]) : 30;
  const auto asset = argc > 1 ? sinew::Asset::load(argv[1]) : sinew::Error{"usage: sample_pile PACKAGE.sinew [BODIES]"};
  if (!asset || count < 1) {
    std::fprintf(stderr, "%s\n", asset ? "there must be a body" : asset.reason().c_str());
    return 2;
  }
  // 1. A world in which bodies touch each other and fall asleep where they rest, in two threads.
  sinew::ThreadPool pool(2);
  sinew::WorldSettings settings;
  settings.ground.enabled = settings.collisions = settings.report_contacts = true;
  settings.sleep_seconds = 0.5F;
  sinew::World world(settings, &pool);

  // 2. Four walls, and a hand that follows a cursor at its own speed and gives way by its mass.
  const float diagonal = (*asset)->package().info().diagonal;
  const int side = std::max(2, int(std::cbrt(float(count))));
  const float half = 0.6F * diagonal * float(side);
  for (int wall = 0; wall < 4; ++wall) {
    const std::size_t across = wall < 2 ? 0 : 2;
    sinew::BoxShape box{{half + diagonal, 50 * diagonal, half + diagonal}};
    box.half_size[across] = diagonal;
    sinew::ColliderSettings at;
    at.at.position[across] = (wall % 2 == 0 ? 1.0F : -1.0F) * (half + diagonal);
    if (!world.addCollider(box, at)) return 3;
  }
  const float mass = (*asset)->package().info().total_mass;
  const auto hand = world.addCollider(sinew::SphereShape{0.5F * diagonal},
                                      {.at = {{0, 30 * diagonal, 0}}, .most_speed = 20 * diagonal, .mass = 50 * mass});

  // 3. Bodies of one asset share its data: each costs what moves of it.
  std::vector<sinew::BodyId> bodies;
  for (int i = 0; i < count; ++i) {
    sinew::BodySettings place{.drag = 0.1F};
    const auto along = [&](int k) { return 1.1F * diagonal * (float(k) - 0.5F * float(side - 1)); };
    const int layer = i / (side * side);
    place.position = {along(i % side), diagonal * float(1 + layer), along(i / side % side)};
    const float turn = 2.4F * float(i);
    place.rotation = {std::cos(turn), 0, std::sin(turn), 0, 1, 0, -std::sin(turn), 0, std::cos(turn)};
    const auto body = world.addBody(*asset, place);
    if (!body) return 3;
    bodies.push_back(*body);
  }

  // 4. Frames, and what happens in them.
  std::vector<std::byte> snapshot;
  sinew::PickId pick;
  for (int frame = 1; frame <= 900; ++frame) {
    const float y = frame > 300 && frame < 450 ? diagonal : 30 * diagonal;
    world.moveCollider(*hand, {{0, y, 0}});
    if (frame == 450) world.saveSnapshot((snapshot.resize(world.snapshotBytes()), snapshot));
    if (frame == 460) world.addImpulse(bodies[0], world.nearestPoint(bodies[0], {0, 0, 0}), {0, 5 * mass, 0});
    if (frame == 500) pick = world.pickRay({0, 20 * diagonal, 0}, {0, -1, 0}, 30 * diagonal);  // none: nothing is there
    if (frame == 500 && pick != sinew::PickId{}) world.movePick(pick, {0, 5 * diagonal, 0});
    if (frame == 600) world.releasePicks();
    world.settings().wind = {frame > 600 && frame < 660 ? 10.0F : 0.0F, 0, 0};
    if (frame == 700) world.setActivity(bodies[0], sinew::Activity::paused);
    if (frame == 750 && !world.restoreSnapshot(snapshot)) return 3;  // as it was at frame 450
    world.advance(1.0F / 60);
    for (const sinew::BodyContact& hit : world.contacts()) {
      if (hit.collider == *hand && hit.speed > 1) std::printf("%d: %.0f m/s at body %u\n", frame, hit.speed, hit.body);
    }
    const auto sleeping = std::count_if(bodies.begin(), bodies.end(), [&](auto id) { return world.isAsleep(id); });
    if (frame % 150 == 0) std::printf("frame %d: %d of %d asleep\n", frame, int(sleeping), count);
  }
}
