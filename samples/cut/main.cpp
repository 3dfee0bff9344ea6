// SPDX-License-Identifier: MIT
//
// Cuts a body in the middle while it falls, lets the parts fall on, and writes each as it lies to an OBJ file:
//   sample_cut PACKAGE [PREFIX [NX NY NZ]]     PREFIX0.obj, PREFIX1.obj, ...; N: the plane's normal, along y without
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "sinew/runtime/cut.h"
#include "sinew/runtime/world.h"

namespace {

bool writeObj(const sinew::World& world, sinew::BodyId body, const std::string& path) {
  const sinew::formats::PackageView& package = world.asset(body).package();
  std::vector<sinew::Vec3> positions(package.visualPositions().size());
  const auto count = std::uint32_t(positions.size());
  world.visualVertices(body, {positions.data()->data(), sizeof(sinew::Vec3), count}, {});
  std::FILE* const file = std::fopen(path.c_str(), "w");
  if (file == nullptr) return false;
  for (const sinew::Vec3& x : positions) std::fprintf(file, "v %g %g %g\n", double(x[0]), double(x[1]), double(x[2]));
  for (const sinew::formats::SubMesh& sub : package.subMeshes()) {
    const std::string name(package.text(sub.name));
    std::fprintf(file, "o %s\n", name.c_str());
    for (const auto& t : package.visualTriangles().subspan(sub.first_triangle, sub.triangle_count)) {
      std::fprintf(file, "f %u %u %u\n", t[0] + 1, t[1] + 1, t[2] + 1);
    }
  }
  return std::fclose(file) == 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 && argc != 3 && argc != 6) {
    std::fprintf(stderr, "usage: sample_cut PACKAGE [PREFIX [NX NY NZ]]\n");
    return 2;
  }
  const auto asset = sinew::Asset::load(argv[1]);
  if (!asset) {
    std::fprintf(stderr, "%s\n", asset.reason().c_str());
    return 1;
  }
  const sinew::formats::PackageInfo& info = (*asset)->package().info();
  sinew::World world(
      {.ground = {.enabled = true, .offset = info.bounds_min[1] - 0.2F * info.diagonal}, .collisions = true});
  const auto body = world.addBody(*asset);
  if (!body) {
    std::fprintf(stderr, "%s\n", body.reason().c_str());
    return 1;
  }
  for (int i = 0; i < 5; ++i) world.step(1.0F / 60);
  sinew::CutPlane plane;
  const sinew::Bounds bounds = world.visualBounds(*body);
  for (std::size_t a = 0; a < 3; ++a) {
    plane.point[a] = 0.5F * (bounds.low[a] + bounds.high[a]);
    if (argc == 6) plane.normal[a] = float(std::atof(argv[3 + a]));
  }
  const auto cut = sinew::cutBody(world, *body, plane);
  if (!cut) {
    std::fprintf(stderr, "%s\n", cut.reason().c_str());
    return 1;
  }
  for (int i = 0; i < 120; ++i) world.step(1.0F / 60);
  for (std::size_t p = 0; p < cut->bodies.size(); ++p) {
    const sinew::CutPart& part = cut->cut.parts[p];
    std::printf("part %zu: %s, %g kg, %g m^3\n", p, part.above ? "above" : "below", part.mass, part.volume);
    if (argc > 2 && !writeObj(world, cut->bodies[p], argv[2] + std::to_string(p) + ".obj")) return 1;
  }
  return 0;
}
