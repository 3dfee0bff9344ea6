// SPDX-License-Identifier: MIT
//
// A whole simulation on one page: load a package, drop it on the ground, read the vertices an engine would draw.
//   sample_hello_runtime PACKAGE.sinew
#include <chrono>
#include <cstdio>
#include <vector>

#include "sinew/runtime/world.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s PACKAGE.sinew\n", argv[0]);
    return 2;
  }
  // 1. An asset holds what all bodies made from a package share.
  const auto asset = sinew::Asset::load(argv[1]);
  if (!asset) {
    std::fprintf(stderr, "%s\n", asset.reason().c_str());
    return 3;
  }
  const sinew::formats::PackageView& package = (*asset)->package();
  const float diagonal = package.info().diagonal;

  // 2. A world with a ground plane at height 0, and a body half its size above it.
  sinew::WorldSettings settings;
  settings.ground.enabled = true;
  sinew::World world(settings);
  sinew::BodySettings placement;
  placement.position = {0, 0.5F * diagonal - package.info().bounds_min[1], 0};
  const auto body = world.addBody(*asset, placement);
  if (!body) {
    std::fprintf(stderr, "%s\n", body.reason().c_str());
    return 3;
  }

  // 3. Each frame: step, then let the runtime write into the buffers that go to the graphics card.
  std::vector<float> positions(package.visualPositions().size() * 3), normals(positions.size());
  const auto count = std::uint32_t(package.visualPositions().size());
  for (int frame = 1; frame <= 120; ++frame) {
    const auto start = std::chrono::steady_clock::now();
    world.step(1.0F / 60);
    const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - start;
    world.visualVertices(*body, {positions.data(), 12, count}, {normals.data(), 12, count});
    if (frame % 20 != 0 || count == 0) continue;
    std::printf("%.2f s: vertex 0 at (%.4f, %.4f, %.4f) m, normal (%.2f, %.2f, %.2f);", double(frame) / 60,
                double(positions[0]), double(positions[1]), double(positions[2]), double(normals[0]),
                double(normals[1]), double(normals[2]));
    std::printf(" step took %.3f ms\n", taken.count());
  }
  return 0;
}
