// SPDX-License-Identifier: MIT
//
// Random planes over packages, each result checked: cut_lane PLANES PACKAGE... Prints a line for each package and for
// each fault, with processor time (and the stages by the clock); exit 1 where there is one. With --steps N the parts of
// every tenth cut are bodies and step so often. With --slits the planes end in quadrilaterals.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>

#include "sinew/runtime/world.h"
#include "tests/cut/cut_checks.h"

namespace {

using namespace sinew;

struct Totals {
  std::uint32_t cuts = 0, refused = 0, faults = 0, rough = 0, open = 0;
  double volume = 0, mass = 0;
  std::vector<double> ms;
};

/// Bends a body: cuts are made of bodies that are not at rest.
std::vector<Vec3> bent(const Asset& asset, std::uint32_t how) {
  std::vector<Vec3> positions = test::restOf(asset);
  if (how % 3 == 0) return positions;
  const float size = asset.package().info().diagonal, turn = how % 3 == 1 ? 0.6F : 1.5F;
  for (Vec3& x : positions) {
    const float angle = turn * x[1] / size, c = std::cos(angle), s = std::sin(angle);
    x = {c * x[0] - s * x[2], x[1] + 0.1F * x[0], s * x[0] + c * x[2]};
  }
  return positions;
}

/// \return what is wrong; empty: nothing.
std::string stepParts(const std::shared_ptr<const Asset>& asset, const CutPlane& plane, int steps) {
  World world({.ground = {.enabled = true, .offset = asset->package().info().bounds_min[1]}});
  const auto body = world.addBody(asset);
  if (!body) return body.reason();
  const auto cut = cutBody(world, *body, plane);
  if (!cut) return {};
  const auto sizeOf = [&world](BodyId id) {
    const Bounds box = world.visualBounds(id);
    return std::hypot(double(box.high[0] - box.low[0]), double(box.high[1] - box.low[1]),
                      double(box.high[2] - box.low[2]));
  };
  std::vector<double> sizes;
  for (const BodyId id : cut->bodies) sizes.push_back(sizeOf(id));
  for (int i = 0; i < steps; ++i) world.step(1.0F / 60);
  for (std::size_t part = 0; part < cut->bodies.size(); ++part) {
    const BodyId id = cut->bodies[part];
    const double grown = sizeOf(id) / sizes[part];
    if (grown > 2) return "part " + std::to_string(part) + " is " + std::to_string(grown) + " times as large as it was";
    if (world.repairedVertices(id) > 0) return "a part was lost";
    double fastest = 0;
    for (const Vec3& v : world.velocities(id)) {
      for (const float c : v) {
        if (!std::isfinite(c)) return "a part is not finite";
        fastest = std::max(fastest, std::abs(double(c)));
      }
    }
    if (fastest > 100) return "a part flies at " + std::to_string(fastest) + " m/s";
  }
  return {};
}

/// A plane that cuts off hardly more than a corner.
CutPlane crumbOf(const std::vector<Vec3>& positions, CutPlane plane, float depth) {
  const Vec3& n = plane.normal;
  const auto along = [&n](const Vec3& x) { return x[0] * n[0] + x[1] * n[1] + x[2] * n[2]; };
  const Vec3 last = *std::max_element(positions.begin(), positions.end(),
                                      [&](const Vec3& x, const Vec3& y) { return along(x) < along(y); });
  const float length = std::sqrt(along(n));
  for (std::size_t c = 0; c < 3; ++c) plane.point[c] = last[c] - depth / length * n[c];
  return plane;
}

}  // namespace

int main(int argc, char** argv) {
  int steps = 0, first = 1;
  if (argc > 2 && std::strcmp(argv[1], "--steps") == 0) steps = std::atoi(argv[2]), first = 3;
  const bool slits = argc > first && std::strcmp(argv[first], "--slits") == 0;
  first += slits ? 1 : 0;
  if (argc < first + 2) {
    std::fprintf(stderr, "usage: cut_lane [--steps N] [--slits] PLANES PACKAGE...\n");
    return 2;
  }
  const int planes = std::atoi(argv[first]);
  bool good = true;
  for (int i = first + 1; i < argc; ++i) {
    const auto asset = Asset::load(argv[i]);
    if (!asset) {
      std::printf("%s: %s\n", argv[i], asset.reason().c_str());
      continue;
    }
    Totals totals;
    std::string reason;
    CutTimes times;
    std::uint32_t severed = 0;
    for (int p = 0; p < planes; ++p) {
      const std::vector<Vec3> positions = bent(**asset, std::uint32_t(p));
      const auto random = slits ? test::randomSlit : test::randomPlane;
      const CutPlane plane = random(positions, std::uint64_t(p) * 977 + 13);
      const std::clock_t start = std::clock();
      const auto cut = cutAsset(**asset, positions, plane);
      const double milliseconds = 1e3 * double(std::clock() - start) / CLOCKS_PER_SEC;
      if (!cut) {
        ++totals.refused;
        reason = cut.reason();
        if (reason.starts_with("a part is no package"))
          std::printf("%s: plane %d: %s\n", argv[i], p, reason.c_str()), ++totals.faults;
        continue;
      }
      ++totals.cuts;
      test::CutErrors errors;
      std::string fault = test::faultOfCut(**asset, *cut, errors, slits ? 1 : 2);
      if (fault.empty() && steps > 0 && p % 10 == 0)
        fault = stepParts(*asset, random(test::restOf(**asset), std::uint64_t(p)), steps);
      if (fault.empty() && steps > 0 && !slits && p % 2 == 1) {
        const std::vector<Vec3> rest = test::restOf(**asset);
        const float depth = 0.002F * float(1 + p / 2 % 20) * (*asset)->package().info().diagonal;
        fault = stepParts(*asset, crumbOf(rest, random(rest, std::uint64_t(p)), depth), steps);
      }
      severed += cut->parts.size() > 1 ? 1U : 0U;
      totals.rough += cut->rough_loops > 0 ? 1U : 0U;
      totals.open += cut->open_edges > 0 ? 1U : 0U;
      totals.volume = std::max(totals.volume, errors.volume);
      totals.mass = std::max(totals.mass, errors.mass);
      const CutTimes& t = cut->times;
      totals.ms.push_back(milliseconds);
      times.sides += t.sides, times.surface += t.surface, times.section += t.section, times.parts += t.parts;
      times.fields += t.fields, times.packages += t.packages;
      if (fault.empty()) continue;
      ++totals.faults;
      std::printf("%s: plane %d (%g %g %g, %g %g %g): %s\n", argv[i], p, double(plane.point[0]), double(plane.point[1]),
                  double(plane.point[2]), double(plane.normal[0]), double(plane.normal[1]), double(plane.normal[2]),
                  fault.c_str());
    }
    std::sort(totals.ms.begin(), totals.ms.end());
    const double n = std::max(1.0, double(totals.cuts));
    std::printf(
        "%s: %u cut, %u severed, %u refused, %u faults, %u rough, %u open; volume %.1e, mass %.1e; median %.2f ms "
        "(sides %.2f, "
        "surface "
        "%.2f, section %.2f, parts %.2f, fields %.2f, packages %.2f)%s%s\n",
        argv[i], totals.cuts, severed, totals.refused, totals.faults, totals.rough, totals.open, totals.volume,
        totals.mass, totals.ms.empty() ? 0 : totals.ms[totals.ms.size() / 2], times.sides / n, times.surface / n,
        times.section / n, times.parts / n, times.fields / n, times.packages / n, reason.empty() ? "" : "; ",
        reason.c_str());
    good = good && totals.faults == 0;
  }
  return good ? 0 : 1;
}
