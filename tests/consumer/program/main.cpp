// SPDX-License-Identifier: MIT
#include <cmath>
#include <cstdio>

#include "sinew/runtime/world.h"

int main(int argc, char** argv) {
  const auto asset = sinew::Asset::load(argc > 1 ? argv[1] : "");
  if (!asset) return std::fprintf(stderr, "%s\n", asset.reason().c_str()), 3;
  sinew::World world;
  const auto body = world.addBody(*asset);
  if (!body) return std::fprintf(stderr, "%s\n", body.reason().c_str()), 3;
  const float start = world.positions(*body)[0][1];
  for (int step = 0; step < 60; ++step) world.step(1.0F / 60);
  const float moved = world.positions(*body)[0][1] - start;
  std::printf("vertex 0 moved by %.4f m\n", double(moved));
  return std::isfinite(moved) ? 0 : 1;
}
