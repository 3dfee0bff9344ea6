// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// Of what swings; of what comes to rest, be it to be let go or on the ground; of what is let go.
constexpr double kDamping = 1;
constexpr double kDampingToRest = 8, kDampingReleased = 0.5;

Vector3d point(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

ElasticSolid solidOf(const MotionBody& body) {
  ElasticSolid solid;
  solid.rest = body.rest;
  solid.tetrahedra = body.tetrahedra;
  solid.prescribed.resize(body.rest.size());
  return solid;
}

// Triangles cut into n² alike, each a third of its area for each corner: the rule of the linear triangle.
std::vector<ContactSample> pointsOf(const MotionBody& body, const formats::PackageView& package) {
  std::vector<ContactSample> points;
  for (std::uint32_t v = 0; v < body.surface.size(); ++v) points.push_back({{v, v, v}, {1, 0, 0}, 0});
  double volume = 0;
  for (const double v : nodalVolumes(solidOf(body))) volume += v;
  // Edge of the regular tetrahedron of their mean volume.
  const double edge = std::cbrt(6 * std::sqrt(2.0) * volume / double(std::max<std::size_t>(1, body.tetrahedra.size())));
  for (const auto& c : package.visualTriangles()) {
    const std::array<std::uint32_t, 3> corner = {c[0], c[1], c[2]};
    if (!std::all_of(corner.begin(), corner.end(), [&](std::uint32_t v) { return body.probes[v].has_value(); }))
      continue;
    double longest = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      longest = std::max(longest, (body.surface[corner[(k + 1) % 3]] - body.surface[corner[k]]).norm());
    }
    const double area =
        0.5 * (body.surface[c[1]] - body.surface[c[0]]).cross(body.surface[c[2]] - body.surface[c[0]]).norm();
    const int n = std::max(1, int(std::ceil(longest / edge)));
    for (int i = 0; i <= n; ++i) {
      for (int j = 0; i + j <= n; ++j) {
        const std::array<int, 3> at = {i, j, n - i - j};
        const auto zeros = std::count(at.begin(), at.end(), 0);
        // Small triangles that meet there: 6 inside, 3 on an edge, 1 at a corner.
        const double share = area / (3.0 * n * n) * (zeros == 0 ? 6 : zeros == 1 ? 3 : 1);
        if (zeros == 2) {
          points[corner[std::size_t(std::find(at.begin(), at.end(), n) - at.begin())]].area += share;
        } else {
          points.push_back({corner, {double(i) / n, double(j) / n, double(n - i - j) / n}, share});
        }
      }
    }
  }
  std::erase_if(points, [](const ContactSample& p) { return p.area <= 0; });
  return points;
}

}  // namespace

Vector3d MotionScene::gravityAt(double time) const {
  if (push) return gravity + push(time);
  return release && time >= kReleaseSeconds ? Vector3d(Vector3d::Zero()) : gravity;
}

double MotionScene::dampingAt(double time) const {
  if (damping) return *damping;
  if (ground) return kDampingToRest;
  if (!release) return kDamping;
  return time >= kReleaseSeconds ? kDampingReleased : kDampingToRest;
}

Eigen::Isometry3d MotionScene::poseOf(std::size_t region, double time) const {
  if (pose) return pose(region, time);
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  const HeldRegion& held = regions[region];
  result.linear() = Eigen::AngleAxisd(part(time) * held.turn, held.axis).toRotationMatrix();
  result.translation() = held.at(Vector3d::Zero(), part(time));
  return result;
}

HeldCase MotionScene::holds(const PackageSolid& solid, const formats::PackageView& package,
                            const SolidExtent& extent) const {
  HeldCase held;
  held.package_pins = file.script != nullptr && !free;
  return free || held.package_pins ? held : heldCase(solid, package, hold, extent);
}

std::vector<std::uint8_t> MotionScene::pieces(const PackageSolid& solid, const HeldCase& held_case) const {
  return free || file.script != nullptr ? std::vector<std::uint8_t>(solid.pieces, 1) : heldPieces(solid, held_case);
}

MotionBody motionBody(const formats::PackageView& package, const MotionScene& scene,
                      const std::vector<ElasticMaterial>& materials, const std::optional<SolidExtent>& extent) {
  const PackageSolid solid = packageSolid(package);
  const HeldCase held = scene.holds(solid, package, extent ? *extent : extentOf(solid));
  MotionBody body;
  std::vector<std::int32_t> region(solid.rest.size(), -1), number(solid.rest.size(), -1);
  const std::vector<std::uint8_t> played = scene.pieces(solid, held);
  for (std::size_t i = 0; i < held.regions.size(); ++i) {
    for (const std::uint32_t v : held.regions[i].vertices) region[v] = std::int32_t(i);
  }
  for (std::uint32_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.kept[v] == 0 || played[solid.piece[v]] == 0) continue;
    number[v] = std::int32_t(body.rest.size());
    body.rest.push_back(solid.rest[v]);
    body.masses.push_back(solid.masses[v]);
    body.region.push_back(region[v]);
  }
  for (const auto& t : solid.tetrahedra) {
    if (number[t[0]] < 0) continue;
    std::array<std::uint32_t, 4> own{};
    for (std::size_t k = 0; k < 4; ++k) own[k] = std::uint32_t(number[t[k]]);
    body.tetrahedra.push_back(own);
    const std::uint32_t piece = solid.piece[t[0]];
    body.materials.push_back(materials[std::min<std::size_t>(piece, materials.size() - 1)]);
  }
  addSurface(package, number, body);
  return body;
}

void addSurface(const formats::PackageView& package, const std::vector<std::int32_t>& number, MotionBody& body) {
  for (const auto& a : package.barycentric()) {
    const auto& corners = package.tetrahedra()[a.tetrahedron].vertex;
    Probe probe;
    probe.weight = {double(a.weight[0]), double(a.weight[1]), double(a.weight[2]), 0};
    probe.weight[3] = 1 - probe.weight[0] - probe.weight[1] - probe.weight[2];
    bool whole = true;
    for (std::size_t k = 0; k < 4; ++k) {
      whole = whole && number[corners[k]] >= 0;
      probe.vertex[k] = whole ? std::uint32_t(number[corners[k]]) : 0;
    }
    body.probes.push_back(whole ? std::optional(probe) : std::nullopt);
  }
  for (const auto& x : package.visualPositions()) body.surface.push_back(point(x));
  body.areas.assign(body.surface.size(), 0);
  for (const auto& c : package.visualTriangles()) {
    const double area =
        0.5 * (body.surface[c[1]] - body.surface[c[0]]).cross(body.surface[c[2]] - body.surface[c[0]]).norm();
    for (const std::uint32_t v : c) body.areas[v] += area / 3;
  }
  body.points = pointsOf(body, package);
}

namespace {

// Springs of the same stiffness by volume, which is linear between vertices, and of the same sum.
// \param volumes of the finer vertices, m³
void refineTethers(const MotionBody& body, const ElasticSolid& coarse, const std::vector<double>& volumes,
                   MotionBody& result) {
  std::uint32_t regions = 0;
  for (const MotionTether& tether : body.tethers) regions = std::max(regions, tether.region + 1);
  const std::vector<double> coarse_volumes = nodalVolumes(coarse);
  for (std::uint32_t region = 0; region < regions; ++region) {
    std::vector<Vector3d> by_volume(body.rest.size(), Vector3d::Zero());
    double wanted = 0, sum = 0;
    for (const MotionTether& tether : body.tethers) {
      if (tether.region != region) continue;
      by_volume[tether.vertex][0] += tether.stiffness / coarse_volumes[tether.vertex];
      wanted += tether.stiffness;
    }
    if (wanted == 0) continue;
    (void)refined(coarse, &by_volume);
    const std::size_t first = result.tethers.size();
    for (std::uint32_t v = 0; v < by_volume.size(); ++v) {
      const double stiffness = by_volume[v][0] * volumes[v];
      if (stiffness == 0 || result.region[v] >= 0) continue;
      result.tethers.push_back({v, region, stiffness});
      sum += stiffness;
    }
    for (std::size_t i = first; i < result.tethers.size(); ++i) result.tethers[i].stiffness *= wanted / sum;
  }
}

}  // namespace

MotionBody refined(const MotionBody& body) {
  const ElasticSolid coarse = solidOf(body);
  // A vertex midway is held where both ends are, by the same region; of the density between theirs.
  std::vector<double> volumes = nodalVolumes(coarse);
  std::vector<Vector3d> midway;
  for (std::size_t v = 0; v < body.rest.size(); ++v) {
    midway.emplace_back(body.region[v] >= 0 ? 1 : 0, body.region[v], body.masses[v] / volumes[v]);
  }
  const ElasticSolid fine = refined(coarse, &midway);
  MotionBody result;
  result.rest = fine.rest;
  result.tetrahedra = fine.tetrahedra;
  result.surface = body.surface;
  result.areas = body.areas;
  result.points = body.points;
  for (const ElasticMaterial& m : body.materials) result.materials.insert(result.materials.end(), 8, m);
  volumes = nodalVolumes(fine);
  for (std::size_t v = 0; v < fine.rest.size(); ++v) {
    const bool held = midway[v][0] == 1 && midway[v][1] == std::round(midway[v][1]);
    result.region.push_back(held ? std::int32_t(std::lround(midway[v][1])) : -1);
    result.masses.push_back(midway[v][2] * volumes[v]);
  }
  const double factor = std::accumulate(body.masses.begin(), body.masses.end(), 0.0) /
                        std::accumulate(result.masses.begin(), result.masses.end(), 0.0);
  for (double& m : result.masses) m *= factor;
  for (const MotionFibre& fibre : body.fibres) {
    MotionFibre finer = fibre;
    finer.weights.clear();
    for (const auto& [t, weight] : fibre.weights) {
      for (std::uint32_t child = 8 * t; child < 8 * t + 8; ++child) finer.weights.emplace_back(child, weight / 8);
    }
    result.fibres.push_back(std::move(finer));
  }
  refineTethers(body, coarse, volumes, result);
  // A probe lies in one of the eight that have come of its tetrahedron, found by its corners.
  std::vector<std::array<std::uint32_t, 5>> home;  // corners in order, then the tetrahedron
  for (std::uint32_t t = 0; t < body.tetrahedra.size(); ++t) {
    std::array<std::uint32_t, 5> one{};
    std::copy(body.tetrahedra[t].begin(), body.tetrahedra[t].end(), one.begin());
    std::sort(one.begin(), one.begin() + 4);
    one[4] = t;
    home.push_back(one);
  }
  std::sort(home.begin(), home.end());
  for (const std::optional<Probe>& probe : body.probes) {
    result.probes.emplace_back();
    if (!probe) continue;
    std::array<std::uint32_t, 5> key{};
    std::copy(probe->vertex.begin(), probe->vertex.end(), key.begin());
    std::sort(key.begin(), key.begin() + 4);
    const auto at = std::lower_bound(home.begin(), home.end(), key);
    if (at == home.end() || !std::equal(key.begin(), key.begin() + 4, at->begin())) continue;
    Vector3d x = Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) x += probe->weight[k] * body.rest[probe->vertex[k]];
    double inside = -1e300;
    Probe best;
    for (std::uint32_t child = 8 * (*at)[4]; child < 8 * (*at)[4] + 8; ++child) {
      const auto& t = fine.tetrahedra[child];
      Eigen::Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = fine.rest[t[std::size_t(k) + 1]] - fine.rest[t[0]];
      const Vector3d w = edges.inverse() * (x - fine.rest[t[0]]);
      const double least = std::min(w.minCoeff(), 1 - w.sum());
      if (least <= inside) continue;
      inside = least;
      best = {t, {1 - w.sum(), w[0], w[1], w[2]}};
    }
    result.probes.back() = best;
  }
  return result;
}

std::vector<Eigen::Vector3f> probed(const MotionBody& body, const std::vector<Vector3d>& positions) {
  std::vector<Eigen::Vector3f> result;
  result.reserve(body.probes.size());
  for (std::size_t i = 0; i < body.probes.size(); ++i) {
    Vector3d x = body.surface[i];
    if (const auto& probe = body.probes[i]) {
      x.setZero();
      for (std::size_t k = 0; k < 4; ++k) x += probe->weight[k] * positions[probe->vertex[k]];
    }
    result.push_back(x.cast<float>());
  }
  return result;
}

}  // namespace sinew::tools
