// SPDX-License-Identifier: MIT
//
// Bodies that touch: a pile falls into a box on two threads, is hit by a ball, and sleeps.
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
  if (argc < 2 || count < 1) {
    std::fprintf(stderr, "usage: %s PACKAGE.sinew [BODIES]\n", argv[0]);
    return 2;
  }
  const auto asset = sinew::Asset::load(argv[1]);
  if (!asset) {
    std::fprintf(stderr, "%s\n", asset.reason().c_str());
    return 3;
  }
  // 1. A world in which bodies touch each other and fall asleep where they rest.
  sinew::ThreadPool pool(2);
  sinew::WorldSettings settings;
  settings.ground.enabled = true;
  settings.collisions = true;
  settings.sleep_seconds = 0.5F;
  sinew::World world(settings, &pool);

  // 2. Four walls, and a ball that an engine moves.
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
  sinew::ColliderSettings ball_at;
  ball_at.at.position = {0, 30 * diagonal, 0};
  const auto ball = world.addCollider(sinew::SphereShape{0.5F * diagonal}, ball_at);

  // 3. Bodies of one asset share its data: each costs what moves of it.
  std::vector<sinew::BodyId> bodies;
  for (int i = 0; i < count; ++i) {
    sinew::BodySettings place;
    const auto along = [&](int k) { return 1.1F * diagonal * (float(k) - 0.5F * float(side - 1)); };
    const int layer = i / (side * side);
    place.position = {along(i % side), diagonal * (1 + float(layer)), along(i / side % side)};
    const float turn = 2.4F * float(i);
    place.rotation = {std::cos(turn), 0, std::sin(turn), 0, 1, 0, -std::sin(turn), 0, std::cos(turn)};
    const auto body = world.addBody(*asset, place);
    if (!body) return 3;
    bodies.push_back(*body);
  }

  // 4. Frames: the ball comes down after five seconds and goes up again.
  for (int frame = 1; frame <= 900; ++frame) {
    const float seconds = float(frame) / 60, phase = std::clamp((seconds - 5) / 4, 0.0F, 1.0F);
    sinew::RigidTransform to = ball_at.at;
    to.position[1] = diagonal * (30 - 29 * std::sin(3.14159F * phase));
    world.moveCollider(*ball, to);
    world.advance(1.0F / 60);
    for (const sinew::ContactEvent& event : world.contactEvents()) {
      if (event.collider == *ball && event.began)
        std::printf("%.2f s: the ball hits body %u\n", double(seconds), event.body);
    }
    if (frame % 150 != 0) continue;
    const auto sleeping =
        std::count_if(bodies.begin(), bodies.end(), [&](sinew::BodyId id) { return world.isAsleep(id); });
    std::printf("%.2f s: %d of %d asleep\n", double(seconds), int(sleeping), count);
  }
  return 0;
}
