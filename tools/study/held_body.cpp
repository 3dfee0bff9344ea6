// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/held_body.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <map>
#include <numeric>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Vectors = std::vector<Vector3d>;

constexpr double kTolerance = 1e-7;
constexpr int kMotionParts = 8;
constexpr double kOnTarget = 2e-3;
constexpr int kMostGravities = 16;
constexpr double kRestSeconds = 0.1;
// Of the diagonal: points nearer to a line than that do not keep a piece from turning about it.
constexpr double kInLine = 1e-3;

Vector3d point(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// Written for a package that may have fields, and for a reader that may not know them yet.
template <class View>
bool fieldMaterial(const View& package, std::uint32_t piece, PieceMaterial& out) {
  if constexpr (requires { package.fieldPacks().front().volume; }) {
    for (const auto& field : package.fields()) {
      if (field.piece != piece) continue;
      double volume = 0, mu = 0, lambda = 0;
      for (std::uint32_t p = field.first_pack; p < field.first_pack + field.pack_count; ++p) {
        const auto& pack = package.fieldPacks()[p];
        for (std::size_t lane = 0; lane < pack.volume.size(); ++lane) {
          const auto v = double(pack.volume[lane]), m = double(pack.mu[lane]), l = double(pack.lambda[lane]);
          if (v <= 0 || m <= 0) continue;
          volume += v;
          mu += v * m;
          lambda += v * l;
          const double young = m * (3 * l + 2 * m) / (l + m);
          out.softest = out.stiffest == 0 ? young : std::min(out.softest, young);
          out.stiffest = std::max(out.stiffest, young);
        }
      }
      if (volume <= 0) continue;
      mu /= volume;
      lambda /= volume;
      out.material = {mu * (3 * lambda + 2 * mu) / (lambda + mu), 0.5 * lambda / (lambda + mu)};
      out.source = StiffnessSource::field;
      return true;
    }
  }
  return false;
}

bool clusterMaterial(const formats::PackageView& package, std::uint32_t piece, PieceMaterial& out) {
  const formats::PieceRange& body = package.pieces()[piece];
  if (package.mechanics().empty() || body.cluster_count == 0) return false;
  double mass = 0, young = 0, poisson = 0;
  out.softest = 1e300;
  for (std::uint32_t c = body.first_cluster; c < body.first_cluster + body.cluster_count; ++c) {
    const formats::ClusterMechanics& mechanics = package.mechanics()[c];
    if (mechanics.stiffness != formats::StiffnessModel::elastic || mechanics.young <= 0) return false;
    const auto m = double(package.clusters()[c].mass);
    mass += m;
    young += m * double(mechanics.young);
    poisson += m * double(mechanics.poisson);
    out.softest = std::min(out.softest, double(mechanics.young));
    out.stiffest = std::max(out.stiffest, double(mechanics.young));
  }
  if (mass <= 0) return false;
  out.material = {young / mass, poisson / mass};
  out.source = StiffnessSource::clusters;
  return true;
}

// Whether points keep a body from turning: three of them are in no line.
bool holds(const Vectors& points, double diagonal) {
  if (points.size() < 3) return false;
  const auto furthest = [&](const auto& distance) {
    return *std::max_element(points.begin(), points.end(),
                             [&](const Vector3d& a, const Vector3d& b) { return distance(a) < distance(b); });
  };
  const Vector3d& a = points.front();
  const Vector3d b = furthest([&](const Vector3d& x) { return (x - a).norm(); });
  if ((b - a).norm() < kInLine * diagonal) return false;
  const Vector3d along = (b - a).normalized();
  const auto off = [&](const Vector3d& x) { return (x - a).cross(along).norm(); };
  return off(furthest(off)) > kInLine * diagonal;
}

// The finite elements of the held pieces, numbered from 0.
struct Problem {
  ElasticSolid solid;
  ElasticLoad load;                    // materials; forces of a gravity of 1
  std::vector<double> masses;          // by node of `solid`
  std::vector<std::uint32_t> package;  // number in the package of each of its first vertices
  Vector3d down;                       // unit, or zero
  std::vector<const HeldRegion*> region;

  void place(double part) {
    for (std::size_t v = 0; v < package.size(); ++v) {
      if (region[v] != nullptr) solid.prescribed[v] = region[v]->at(solid.rest[v], part);
    }
  }
  void pull(double gravity) {
    load.forces.clear();
    if (down.squaredNorm() == 0) return;
    for (const double m : masses) load.forces.push_back(gravity * m * down);
  }
  double rms(const Vectors& x) const {
    double sum = 0, count = 0;
    for (std::size_t v = 0; v < package.size(); ++v) {
      if (region[v] != nullptr) continue;
      sum += (x[v] - solid.rest[v]).squaredNorm();
      ++count;
    }
    return std::sqrt(sum / std::max(1.0, count));
  }
  void makeQuadratic(Vectors& shape) {
    solid = quadratic(solid, &shape);
    masses = nodalMasses(solid, masses);
  }
};

// Gravity for a displacement, found from below along the path from rest: the secant in logarithms, kept in brackets.
Equilibrium solveForTarget(Problem& problem, double target, double scale, double& gravity, bool& on_target) {
  struct Try {
    double gravity, rms;
    Vectors shape;
  };
  const auto solve = [&](double g, const Vectors& start) {
    problem.pull(g);
    return equilibrium(problem.solid, problem.load, start, kTolerance);
  };
  // So weak that the answer is linear.
  gravity = 1e-6 * scale;
  Equilibrium found = solve(gravity, {});
  Try low{gravity, problem.rms(found.positions), found.positions};
  double high = 0, power = 1;
  for (int i = 0; i < kMostGravities; ++i) {
    const double aim = i == 0 ? 0.2 * target : target;
    double next = low.gravity * std::pow(aim / low.rms, power);
    // Not too far at once, or it may jump to another rest.
    if (i > 0) next = std::min(next, 2.5 * low.gravity);
    if (high > 0 && (next >= high || next <= low.gravity)) next = std::sqrt(low.gravity * high);
    Vectors start = low.shape;
    if (i == 0) {
      for (std::size_t v = 0; v < start.size(); ++v) {
        start[v] += (next / low.gravity - 1) * (start[v] - problem.solid.rest[v]);
      }
    }
    found = solve(next, start);
    gravity = next;
    const double rms = problem.rms(found.positions);
    on_target = std::abs(rms / target - 1) < kOnTarget;
    if (on_target) break;
    if (std::abs(std::log(rms / low.rms)) > 1e-6 && std::abs(std::log(next / low.gravity)) > 1e-9) {
      power = std::clamp(std::log(next / low.gravity) / std::log(rms / low.rms), 0.2, 4.0);
    }
    if (rms < target) {
      low = {next, rms, found.positions};
    } else {
      high = high > 0 ? std::min(high, next) : next;
    }
  }
  return found;
}

}  // namespace

std::string_view nameOf(StiffnessSource source) {
  return std::array<std::string_view, 4>{"field", "clusters", "given", "none"}[std::size_t(source)];
}

std::vector<PieceMaterial> materialsOf(const formats::PackageView& package) {
  std::vector<PieceMaterial> materials(package.pieces().size());
  for (std::uint32_t piece = 0; piece < materials.size(); ++piece) {
    PieceMaterial field, clusters;
    if (fieldMaterial(package, piece, field) || clusterMaterial(package, piece, clusters)) {
      materials[piece] = field.source != StiffnessSource::none ? field : clusters;
    }
  }
  return materials;
}

PackageSolid packageSolid(const formats::PackageView& package) {
  PackageSolid solid;
  solid.pieces = std::uint32_t(package.pieces().size());
  solid.diagonal = double(package.info().diagonal);
  for (const formats::PhysicalVertex& v : package.physicalVertices()) {
    solid.rest.push_back(point(v.rest_position));
    solid.masses.push_back(double(v.mass));
  }
  solid.piece.assign(solid.rest.size(), 0);
  solid.kept.assign(solid.rest.size(), 0);
  for (std::uint32_t piece = 0; piece < solid.pieces; ++piece) {
    const formats::PieceRange& body = package.pieces()[piece];
    std::fill_n(solid.piece.begin() + body.first_vertex, body.vertex_count, piece);
    // Sets that are joined by faces: each tetrahedron points to an earlier one of its set.
    std::vector<std::uint32_t> parent(body.tetrahedron_count);
    std::iota(parent.begin(), parent.end(), 0U);
    const auto root = [&](std::uint32_t t) {
      while (parent[t] != t) t = parent[t] = parent[parent[t]];
      return t;
    };
    std::map<std::array<std::uint32_t, 3>, std::uint32_t> faces;
    for (std::uint32_t t = 0; t < body.tetrahedron_count; ++t) {
      const auto& corners = package.tetrahedra()[body.first_tetrahedron + t].vertex;
      for (std::size_t k = 0; k < 4; ++k) {
        std::array<std::uint32_t, 3> face = {corners[(k + 1) % 4], corners[(k + 2) % 4], corners[(k + 3) % 4]};
        std::sort(face.begin(), face.end());
        const auto [at, fresh] = faces.try_emplace(face, t);
        if (fresh) continue;
        const std::uint32_t one = root(t), other = root(at->second);
        parent[std::max(one, other)] = std::min(one, other);
      }
    }
    std::vector<std::uint32_t> count(body.tetrahedron_count, 0);
    for (std::uint32_t t = 0; t < body.tetrahedron_count; ++t) ++count[root(t)];
    if (count.empty()) continue;
    const auto largest = std::uint32_t(std::max_element(count.begin(), count.end()) - count.begin());
    for (std::uint32_t t = 0; t < body.tetrahedron_count; ++t) {
      if (root(t) != largest) {
        ++solid.left_out;
        continue;
      }
      const auto& corners = package.tetrahedra()[body.first_tetrahedron + t].vertex;
      solid.tetrahedra.push_back({corners[0], corners[1], corners[2], corners[3]});
      for (const std::uint32_t v : corners) solid.kept[v] = 1;
    }
  }
  return solid;
}

Vector3d HeldRegion::at(const Vector3d& rest, double part) const {
  return about + Eigen::AngleAxisd(part * turn, axis) * (rest - about) + part * shift;
}

std::vector<std::uint8_t> heldPieces(const PackageSolid& solid, const HeldCase& held) {
  std::vector<Vectors> points(solid.pieces);
  for (const HeldRegion& region : held.regions) {
    for (const std::uint32_t v : region.vertices) {
      if (solid.kept[v] != 0) points[solid.piece[v]].push_back(solid.rest[v]);
    }
  }
  std::vector<std::uint8_t> result;
  for (const Vectors& one : points) result.push_back(holds(one, solid.diagonal) ? 1 : 0);
  return result;
}

double threadSeconds() {
  std::timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return double(now.tv_sec) + 1e-9 * double(now.tv_nsec);
}

RigidTransform poseOf(const HeldRegion& region, double part, const Vector3d& offset) {
  HeldRegion placed = region;
  placed.about += offset;
  const Vector3d origin = placed.at(Vector3d::Zero(), part);
  RigidTransform result;
  for (int row = 0; row < 3; ++row) {
    result.position[std::size_t(row)] = float(origin[row]);
    for (int column = 0; column < 3; ++column) {
      result.rotation[3 * std::size_t(row) + std::size_t(column)] =
          float((placed.at(Vector3d::Unit(column), part) - origin)[row]);
    }
  }
  return result;
}

void refuseHold(const std::string& reason) {
  throw ToolError(ExitCode::system, "", "the runtime refuses what is held: " + reason,
                  "This is a fault of the study: please report it.");
}

ReferenceShape referenceShape(const PackageSolid& solid, const std::vector<ElasticMaterial>& materials,
                              const HeldCase& held, double target) {
  ReferenceShape reference;
  reference.displacement.assign(solid.rest.size(), Vector3d::Zero());
  reference.gravity = held.gravity;
  std::vector<const HeldRegion*> region(solid.rest.size(), nullptr);
  bool moves = false;
  for (const HeldRegion& one : held.regions) {
    moves = moves || one.moves();
    for (const std::uint32_t v : one.vertices) {
      region[v] = &one;
    }
  }
  const std::vector<std::uint8_t> piece_held = heldPieces(solid, held);
  Problem problem;
  std::vector<std::uint32_t> number(solid.rest.size(), 0);
  for (std::uint32_t v = 0; v < solid.rest.size(); ++v) {
    if (piece_held[solid.piece[v]] == 0) reference.left_out.push_back(v);
    if (solid.kept[v] == 0 || piece_held[solid.piece[v]] == 0) continue;
    number[v] = std::uint32_t(problem.package.size());
    problem.package.push_back(v);
    problem.solid.rest.push_back(solid.rest[v]);
    problem.masses.push_back(solid.masses[v]);
    problem.region.push_back(region[v]);
    if (region[v] == nullptr) reference.compared.push_back(v);
  }
  if (reference.compared.empty()) return reference;
  double softest = 1e300, mass = 0, volume = 0;
  for (const auto& t : solid.tetrahedra) {
    if (piece_held[solid.piece[t[0]]] == 0) continue;
    problem.solid.tetrahedra.push_back({number[t[0]], number[t[1]], number[t[2]], number[t[3]]});
    problem.load.materials.push_back(materials[solid.piece[t[0]]]);
    softest = std::min(softest, problem.load.materials.back().young);
  }
  problem.solid.prescribed.resize(problem.solid.rest.size());
  problem.down = held.gravity.norm() > 0 ? Vector3d(held.gravity.normalized()) : Vector3d(Vector3d::Zero());
  for (const double m : problem.masses) mass += m;
  for (const double v : nodalVolumes(problem.solid)) volume += v;
  Equilibrium found;
  double gravity = held.gravity.norm();
  problem.place(0);
  if (target > 0 && gravity > 0) {
    found = solveForTarget(problem, target, softest / (mass / volume * solid.diagonal), gravity, reference.on_target);
  } else {
    for (int i = 1; i <= kMotionParts; ++i) {
      const double part = double(i) / kMotionParts;
      problem.place(moves ? part : 1);
      problem.pull(part * gravity);
      found = equilibrium(problem.solid, problem.load, found.positions, kTolerance);
    }
  }
  problem.makeQuadratic(found.positions);
  problem.pull(gravity);
  ElasticTarget aim{{}, target};
  for (std::uint32_t v = 0; v < problem.package.size(); ++v) {
    if (problem.region[v] == nullptr) aim.nodes.push_back(v);
  }
  const bool aims = target > 0 && gravity > 0 && reference.on_target;
  found = equilibrium(problem.solid, problem.load, found.positions, kTolerance, aims ? &aim : nullptr);
  gravity *= found.strength;
  if (aims) reference.on_target = std::abs(problem.rms(found.positions) / target - 1) < kOnTarget;
  reference.gravity = gravity * problem.down;
  reference.tetrahedra = std::uint32_t(problem.solid.tetrahedra.size());
  reference.iterations = found.iterations;
  reference.residual = found.residual;
  reference.stable = found.stable;
  reference.rms = problem.rms(found.positions);
  for (std::size_t v = 0; v < problem.package.size(); ++v) {
    const Vector3d way = found.positions[v] - problem.solid.rest[v];
    reference.displacement[problem.package[v]] = way;
    if (problem.region[v] == nullptr) reference.largest = std::max(reference.largest, way.norm());
  }
  return reference;
}

PlayedShape playHeld(const std::shared_ptr<const Asset>& asset, const PackageSolid& solid, const HeldCase& held,
                     const ReferenceShape& reference, const PlayOptions& options) {
  WorldSettings settings = options.settings;
  for (std::size_t k = 0; k < 3; ++k) settings.gravity[k] = float(reference.gravity[Eigen::Index(k)]);
  World world(settings);
  BodySettings body_settings;
  body_settings.package_pins = held.package_pins;
  body_settings.solver = options.solver;
  const auto added = world.addBody(asset, body_settings);
  if (!added) refuseHold(added.reason());
  const BodyId body = *added;
  const std::vector<Vec3> start(world.positions(body).begin(), world.positions(body).end());
  std::vector<std::uint8_t> taken(start.size(), 0);
  std::vector<PinSetId> sets;
  const auto hold = [&](const std::vector<std::uint32_t>& vertices) {
    const auto set = world.addPinSet(body, vertices);
    if (!set) refuseHold(set.reason());
    return *set;
  };
  for (const HeldRegion& region : held.regions) {
    if (!held.package_pins) sets.push_back(hold(region.vertices));
    for (const std::uint32_t v : region.vertices) taken[v] = 1;
  }
  std::vector<std::uint32_t> idle;
  for (const std::uint32_t v : reference.left_out) {
    if (taken[v] == 0) idle.push_back(v);
  }
  if (!idle.empty()) hold(idle);
  const bool moves = std::any_of(held.regions.begin(), held.regions.end(), [](const auto& r) { return r.moves(); });
  const Vector3d offset = point(start.front()) - solid.rest.front();
  PlayedShape played;
  std::vector<double> times;
  const int steps = std::max(1, int(std::lround(options.seconds * options.rate_hz)));
  const int quiet_steps = std::max(1, int(std::lround(kRestSeconds * options.rate_hz)));
  int quiet = 0;
  for (int step = 1; step <= steps && played.rest_seconds < 0 && played.finite; ++step) {
    const double now = step / options.rate_hz, part = std::min(1.0, now / kMotionSeconds);
    for (std::size_t i = 0; i < sets.size(); ++i) {
      if (held.regions[i].moves()) world.movePinSet(sets[i], poseOf(held.regions[i], part, offset));
    }
    const double begin = threadSeconds();
    world.step(float(1 / options.rate_hz));
    times.push_back(threadSeconds() - begin);
    double square = 0;
    for (const std::uint32_t v : reference.compared) square += point(world.velocities(body)[v]).squaredNorm();
    played.speed = std::sqrt(square / double(std::max<std::size_t>(1, reference.compared.size())));
    played.finite = std::isfinite(played.speed);
    quiet = played.speed < options.rest_speed && (!moves || part >= 1) ? quiet + 1 : 0;
    if (quiet == quiet_steps) played.rest_seconds = (step - quiet + 1) / options.rate_hz;
  }
  std::nth_element(times.begin(), times.begin() + std::ptrdiff_t(times.size() / 2), times.end());
  played.microseconds = 1e6 * times[times.size() / 2];
  for (std::size_t v = 0; v < start.size(); ++v) {
    played.displacement.push_back(point(world.positions(body)[v]) - point(start[v]));
    played.finite = played.finite && played.displacement.back().allFinite();
  }
  return played;
}

HeldScore scoreOf(std::span<const std::uint32_t> vertices, const Vectors& played, const Vectors& reference) {
  double off = 0, all = 0, together = 0, furthest_off = 0, furthest = 0;
  for (const std::uint32_t v : vertices) {
    off += (played[v] - reference[v]).squaredNorm();
    all += reference[v].squaredNorm();
    together += played[v].dot(reference[v]);
    furthest_off = std::max(furthest_off, (played[v] - reference[v]).norm());
    furthest = std::max(furthest, reference[v].norm());
  }
  return {std::sqrt(off / all), furthest_off / furthest, together / all};
}

}  // namespace sinew::tools
