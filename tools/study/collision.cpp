// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/collision.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <optional>
#include <random>
#include <span>
#include <unordered_map>

#include "runtime/geometry/triangle_bvh.h"
#include "runtime/geometry/winding_number.h"
#include "sinew/runtime/world.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::TriangleBvh;
using geometry::WindingNumber;
using Clock = std::chrono::steady_clock;

constexpr double kStep = 1.0 / 240;
constexpr float kSlack = 0.01F;
/// Pairs less deep count as neither, diagonals.
constexpr double kTouching = 0.002;
/// Points of a body whose leaving tells how far two are apart.
constexpr std::size_t kProbes = 150;
constexpr int kDirections = 48, kHalvings = 7;

Vector3d wide(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

double microsecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::micro>(Clock::now() - start).count();
}

/// A closed surface as it is drawn; what is one place at rest is one point.
struct Surface {
  std::vector<Vector3d> points;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<std::array<std::uint32_t, 2>> edges;
  double diagonal = 0;

  Vector3d normalOf(std::size_t t) const {
    const auto& f = triangles[t];
    return (points[f[1]] - points[f[0]]).cross(points[f[2]] - points[f[0]]).normalized();
  }
};

/// Which of a package's visual vertices are one place at rest, and its triangles and edges between these.
struct Connection {
  std::vector<std::uint32_t> point_of;  ///< by visual vertex
  Surface surface;                      ///< its points are those at rest

  explicit Connection(const formats::PackageView& package) {
    std::map<std::array<float, 3>, std::uint32_t> number;
    for (const auto& at : package.visualPositions()) {
      const auto [place, added] = number.try_emplace(at, std::uint32_t(surface.points.size()));
      if (added) surface.points.push_back(wide(at));
      point_of.push_back(place->second);
    }
    std::map<std::array<std::uint32_t, 2>, bool> edges;
    for (const auto& t : package.visualTriangles()) {
      const std::array<std::uint32_t, 3> f = {point_of[t[0]], point_of[t[1]], point_of[t[2]]};
      if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) continue;
      surface.triangles.push_back(f);
      for (std::size_t k = 0; k < 3; ++k)
        edges[{std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])}] = true;
    }
    for (const auto& [edge, there] : edges) surface.edges.push_back(edge);
    surface.diagonal = double(package.info().diagonal);
  }

  Surface now(const World& world, BodyId body) const {
    std::vector<Vec3> at(point_of.size());
    world.visualVertices(body, {at[0].data(), 12, std::uint32_t(at.size())}, {});
    Surface bent = surface;
    for (std::size_t i = 0; i < at.size(); ++i) bent.points[point_of[i]] = wide(at[i]);
    return bent;
  }
};

/// A method's answer: how far the second body is to go.
using Way = std::optional<Vector3d>;

/// Triangles by cell of a regular grid (Teschner 2003).
class Cells {
 public:
  explicit Cells(const Surface& surface) {
    double length = 0;
    for (const auto& e : surface.edges) length += (surface.points[e[0]] - surface.points[e[1]]).norm();
    size_ = 1.5 * length / double(surface.edges.size());
    for (std::uint32_t t = 0; t < surface.triangles.size(); ++t) {
      Eigen::AlignedBox3d box;
      for (const std::uint32_t v : surface.triangles[t]) box.extend(surface.points[v]);
      forEachCell(box, [&](std::uint64_t key) { cells_[key].push_back(t); });
    }
  }

  /// Triangles in the cells of a box about some points, ascending.
  std::vector<std::uint32_t> near(const Surface& surface, std::span<const std::uint32_t> points) const {
    Eigen::AlignedBox3d box;
    for (const std::uint32_t v : points) box.extend(surface.points[v]);
    std::vector<std::uint32_t> found;
    forEachCell(box, [&](std::uint64_t key) {
      const auto cell = cells_.find(key);
      if (cell != cells_.end()) found.insert(found.end(), cell->second.begin(), cell->second.end());
    });
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

 private:
  template <class Visit>
  void forEachCell(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    const Eigen::Array3d low = (box.min() / size_).array().floor(), high = (box.max() / size_).array().floor();
    for (double x = low[0]; x <= high[0]; ++x) {
      for (double y = low[1]; y <= high[1]; ++y) {
        for (double z = low[2]; z <= high[2]; ++z) {
          const auto part = [](double v) { return std::uint64_t(std::int64_t(v) + (1 << 20)) & 0x1FFFFFU; };
          visit(part(x) << 42 | part(y) << 21 | part(z));
        }
      }
    }
  }

  double size_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

/// Where a segment crosses a triangle (Moeller, Trumbore 1997).
std::optional<Vector3d> crossing(const Vector3d& from, const Vector3d& to, const Surface& surface, std::uint32_t t) {
  const auto& f = surface.triangles[t];
  const Vector3d &a = surface.points[f[0]], side = surface.points[f[1]] - a, other = surface.points[f[2]] - a;
  const Vector3d way = to - from, p = way.cross(other);
  const double determinant = side.dot(p);
  if (determinant == 0) return {};
  const Vector3d s = from - a, q = s.cross(side);
  const double u = s.dot(p) / determinant, v = way.dot(q) / determinant, along = other.dot(q) / determinant;
  if (u < 0 || v < 0 || u + v > 1 || along < 0 || along > 1) return {};
  return from + along * way;
}

/// B.1: the parity of a ray's crossings tells what is inside; out by the nearest place of the surface.
Way byParity(const Surface& a, const Surface& b) {
  Vector3d way = Vector3d::Zero();
  bool found = false;
  const auto look = [&](const Surface& of, const Surface& in, double sign) {
    const TriangleBvh tree(in.points, in.triangles);
    Eigen::AlignedBox3d box;
    for (const Vector3d& p : in.points) box.extend(p);
    std::vector<TriangleBvh::Crossing> crossings;
    for (const Vector3d& p : of.points) {
      if (!box.contains(p)) continue;
      crossings.clear();
      tree.crossings(p, {box.max()[0] + in.diagonal, p[1], p[2]}, crossings);
      if (crossings.size() % 2 == 0) continue;
      found = true;
      way += sign * (tree.closest(p).point - p);
    }
  };
  look(a, b, -1);
  look(b, a, 1);
  return found ? Way(way) : Way();
}

/// B.2: triangles that cross push each other along their normals, as far as takes one out of the other.
Way byTriangles(const Surface& a, const Surface& b) {
  Vector3d way = Vector3d::Zero();
  bool found = false;
  const Cells cells(b);
  for (std::uint32_t t = 0; t < a.triangles.size(); ++t) {
    const auto& f = a.triangles[t];
    for (const std::uint32_t u : cells.near(a, f)) {
      const auto& g = b.triangles[u];
      bool cross = false;
      for (std::size_t k = 0; k < 3 && !cross; ++k) {
        cross = crossing(a.points[f[k]], a.points[f[(k + 1) % 3]], b, u).has_value() ||
                crossing(b.points[g[k]], b.points[g[(k + 1) % 3]], a, t).has_value();
      }
      if (!cross) continue;
      found = true;
      const Vector3d n_a = a.normalOf(t), n_b = b.normalOf(u), r = n_b - n_a;
      // Each corner's way along r to the other's plane; the farthest of a triangle, the nearer of both.
      double of_a = 0, of_b = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        of_a = std::max(of_a, n_b.dot(b.points[g[0]] - a.points[f[k]]) / n_b.dot(r));
        of_b = std::max(of_b, -n_a.dot(a.points[f[0]] - b.points[g[k]]) / n_a.dot(r));
      }
      const double d = std::min(of_a, of_b);
      if (std::isfinite(d)) way += d * (n_a - n_b);
    }
  }
  return found ? Way(way) : Way();
}

/// B.3: edges that cross triangles tell which of their ends are inside; these and what they enclose go back along
/// their edges (depth spread as Heidelberger 2004).
Way byEdges(const Surface& a, const Surface& b) {
  Vector3d way = Vector3d::Zero();
  bool found = false;
  const auto look = [&](const Surface& of, const Surface& in, double sign) {
    const Cells cells(in);
    std::vector<std::uint8_t> inside(of.points.size(), 0), outside(of.points.size(), 0);
    std::vector<Vector3d> back(of.points.size(), Vector3d::Zero());
    std::vector<double> weight(of.points.size(), 0);
    for (const auto& e : of.edges) {
      for (const std::uint32_t u : cells.near(of, e)) {
        const auto at = crossing(of.points[e[0]], of.points[e[1]], in, u);
        if (!at) continue;
        for (const std::uint32_t v : e) {
          const Vector3d to = *at - of.points[v];
          if (in.normalOf(u).dot(to) <= 0) {
            outside[v] = 1;
            continue;
          }
          inside[v] = 1;
          const double w = 1 / std::max(to.squaredNorm(), 1e-30);
          back[v] += w * to;
          weight[v] += w;
        }
      }
    }
    std::vector<std::vector<std::uint32_t>> neighbours(of.points.size());
    for (const auto& e : of.edges) neighbours[e[0]].push_back(e[1]), neighbours[e[1]].push_back(e[0]);
    std::vector<std::uint32_t> front;
    for (std::uint32_t v = 0; v < of.points.size(); ++v) {
      if (inside[v] == 0 || outside[v] != 0) continue;
      back[v] /= weight[v];
      front.push_back(v);
    }
    std::vector<std::uint8_t> done(of.points.size(), 0);
    for (const std::uint32_t v : front) done[v] = 1;
    while (!front.empty()) {
      std::vector<std::uint32_t> next;
      for (const std::uint32_t v : front) {
        found = true;
        way += sign * back[v];
        for (const std::uint32_t w : neighbours[v]) {
          if (done[w] != 0 || outside[w] != 0) continue;
          done[w] = 1;
          // From what it was reached: as deep as that, and as far as it lies behind it.
          const Vector3d direction = back[v].normalized();
          back[w] = (back[v].norm() + direction.dot(of.points[v] - of.points[w])) * direction;
          next.push_back(w);
        }
      }
      front.swap(next);
    }
  };
  look(a, b, -1);
  look(b, a, 1);
  return found ? Way(way) : Way();
}

Vector3d meanVelocity(const World& world, BodyId body) {
  Vector3d sum = Vector3d::Zero();
  double mass = 0;
  const auto v = world.velocities(body);
  const auto vertices = world.asset(body).package().physicalVertices();
  for (std::size_t i = 0; i < v.size(); ++i) {
    sum += double(vertices[i].mass) * wide(v[i]);
    mass += double(vertices[i].mass);
  }
  return sum / mass;
}

/// Two bodies in a world of their own, bent and placed.
struct Pair {
  World world;
  BodyId a, b;

  static WorldSettings settings(bool collisions) {
    WorldSettings settings;
    settings.collisions = collisions;
    settings.gravity = {0, 0, 0};
    settings.damping = 0;
    return settings;
  }
  explicit Pair(bool collisions) : world(settings(collisions)) {}
};

struct Placement {
  Eigen::Matrix3d turn;
  Vector3d at;
  Vector3d bend;  ///< of x by y^2, y by z^2, z by x^2, in half diagonals
};

BodyId add(World& world, const StepsBody& body, const Placement& placement) {
  // Slack and slippery: what parts them is the contacts alone, not their springing back.
  BodySettings settings;
  settings.stiffness_scale = kSlack;
  settings.friction = 0;
  const BodyId id = *world.addBody(body.asset, settings);
  const auto x = world.positions(id);
  const double half = 0.5 * double(body.asset->package().info().diagonal);
  std::vector<Vec3> at(x.size());
  const std::vector<Vec3> still(x.size(), Vec3{0, 0, 0});
  Vector3d center = Vector3d::Zero();
  for (const Vec3& v : x) center += wide(v) / double(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vector3d q = (wide(x[i]) - center) / half;
    const Vector3d squared = Vector3d(q[1] * q[1], q[2] * q[2], q[0] * q[0]);
    const Vector3d place = placement.at + placement.turn * (half * (q + placement.bend.cwiseProduct(squared)));
    at[i] = {float(place[0]), float(place[1]), float(place[2])};
  }
  world.setState(id, at, still);
  return id;
}

/// Whether a point of the one lies in the other, the second moved by `way`.
bool overlap(const WindingNumber& in_a, const WindingNumber& in_b, const std::vector<Vector3d>& of_a,
             const std::vector<Vector3d>& of_b, const Vector3d& way) {
  const auto any = [](const WindingNumber& solid, std::vector<Vector3d> points, const Vector3d& by) {
    for (Vector3d& p : points) p += by;
    std::vector<char> inside(points.size());
    solid.inside(points, inside);
    return std::find(inside.begin(), inside.end(), 1) != inside.end();
  };
  return any(in_a, of_b, way) || any(in_b, of_a, -way);
}

std::vector<Vector3d> probesOf(const Surface& surface) {
  std::vector<Vector3d> probes;
  const std::size_t stride = std::max<std::size_t>(1, surface.points.size() / kProbes);
  for (std::size_t i = 0; i < surface.points.size(); i += stride) probes.push_back(surface.points[i]);
  return probes;
}

/// How far the second is to go along a unit way until none of its points is in the first, nor the other way round.
class Parting {
 public:
  Parting(const Surface& a, const Surface& b)
      : in_a_(a.points, a.triangles), in_b_(b.points, b.triangles), of_a_(probesOf(a)), of_b_(probesOf(b)) {}

  bool overlapping() const { return overlap(in_a_, in_b_, of_a_, of_b_, Vector3d::Zero()); }

  double along(const Vector3d& way) const {
    double least = 1e300, most = -1e300;
    for (const Vector3d& p : of_a_) most = std::max(most, p.dot(way));
    for (const Vector3d& p : of_b_) least = std::min(least, p.dot(way));
    double low = 0, high = std::max(most - least, 0.0);
    for (int i = 0; i < kHalvings; ++i) {
      const double middle = 0.5 * (low + high);
      (overlap(in_a_, in_b_, of_a_, of_b_, middle * way) ? low : high) = middle;
    }
    return high;
  }

  double shortest() const {
    double least = 1e300;
    for (int i = 0; i < kDirections; ++i) {  // a spiral over the sphere
      const double z = 1 - (2 * i + 1.0) / kDirections, r = std::sqrt(1 - z * z),
                   turn = i * M_PI * (3 - std::sqrt(5.0));
      least = std::min(least, along({r * std::cos(turn), r * std::sin(turn), z}));
    }
    return least;
  }

 private:
  WindingNumber in_a_, in_b_;
  std::vector<Vector3d> of_a_, of_b_;
};

double medianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

double CollisionResult::deepest(const CollisionMethod& method) const {
  double depth = 0;
  for (std::size_t bin = 0; bin < kDepthBins; ++bin) {
    if (10 * method.right[bin] < 9 * at_depth[bin]) break;
    if (at_depth[bin] > 0) depth = kDepthBin * double(bin + 1);
  }
  return depth;
}

CollisionResult measureCollisions(const std::vector<StepsBody>& bodies, const CollisionOptions& options) {
  std::vector<Connection> connections;
  for (const StepsBody& body : bodies) connections.emplace_back(body.asset->package());
  std::mt19937 chance(options.seed);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto anyTurn = [&]() -> Eigen::Matrix3d {
    Eigen::Quaterniond q(unit(chance), unit(chance), unit(chance), unit(chance));
    return q.normalized().toRotationMatrix();
  };
  CollisionResult result;
  result.methods = {{"distances at rest", 0, 0, 0, {}, 0},
                    {"ray parity (B.1)", 0, 0, 0, {}, 0},
                    {"triangle/triangle (B.2)", 0, 0, 0, {}, 0},
                    {"edge/triangle (B.3)", 0, 0, 0, {}, 0}};
  std::array<std::vector<double>, 4> times;
  for (std::uint32_t i = 0; i < options.pairs; ++i) {
    if (options.progress) options.progress(double(i) / options.pairs);
    const std::size_t one = chance() % bodies.size(), other = chance() % bodies.size();
    const double reach = 0.5 * (connections[one].surface.diagonal + connections[other].surface.diagonal);
    const auto anyBend = [&] { return Vector3d(0.3 * unit(chance), 0.3 * unit(chance), 0.3 * unit(chance)); };
    Placement first = {anyTurn(), Vector3d::Zero(), anyBend()}, second = {anyTurn(), {}, anyBend()};
    second.at = reach * std::abs(unit(chance)) * (anyTurn() * Vector3d::UnitX());
    std::array<std::optional<Pair>, 2> pairs;
    std::array<double, 2> took = {0, 0};
    for (const bool collisions : {false, true}) {
      Pair& pair = pairs[collisions ? 1 : 0].emplace(collisions);
      pair.a = add(pair.world, bodies[one], first);
      pair.b = add(pair.world, bodies[other], second);
    }
    const Surface a = connections[one].now(pairs[1]->world, pairs[1]->a),
                  b = connections[other].now(pairs[1]->world, pairs[1]->b);
    std::array<Way, 4> ways;
    for (const std::size_t collisions : {0U, 1U}) {
      const Clock::time_point start = Clock::now();
      pairs[collisions]->world.step(float(kStep));
      took[collisions] = microsecondsSince(start);
    }
    Vector3d pushed = Vector3d::Zero();
    for (const std::size_t collisions : {0U, 1U}) {
      const Pair& pair = *pairs[collisions];
      pushed = meanVelocity(pair.world, pair.b) - meanVelocity(pair.world, pair.a) - pushed;
    }
    if (!pairs[1]->world.contactEvents().empty()) ways[0] = pushed;
    std::array<double, 4> time = {std::max(0.0, took[1] - took[0]), 0, 0, 0};
    const std::array<Way (*)(const Surface&, const Surface&), 3> others = {byParity, byTriangles, byEdges};
    for (std::size_t m = 0; m < others.size(); ++m) {
      const Clock::time_point start = Clock::now();
      ways[m + 1] = others[m](a, b);
      time[m + 1] = microsecondsSince(start);
    }
    const Parting parting(a, b);
    const double diagonal = std::min(a.diagonal, b.diagonal);
    const bool overlapping = parting.overlapping();
    const double depth = overlapping ? parting.shortest() / diagonal : 0;
    if (!overlapping && byTriangles(a, b)) continue;  // only edges cross
    if (overlapping && depth < kTouching) continue;
    const auto bin = std::min(std::size_t(depth / kDepthBin), kDepthBins - 1);
    ++(overlapping ? result.overlapping : result.apart);
    if (overlapping) ++result.at_depth[bin];
    for (std::size_t m = 0; m < ways.size(); ++m) {
      CollisionMethod& method = result.methods[m];
      if (overlapping) times[m].push_back(time[m]);
      if (!overlapping) {
        method.false_contacts += ways[m] ? 1U : 0U;
      } else if (!ways[m]) {
        ++method.missed;
      } else if (!(ways[m]->norm() > 0) ||
                 parting.along(ways[m]->normalized()) > 2 * depth * diagonal + 0.01 * diagonal) {
        ++method.wrong;
      } else {
        ++method.right[bin];
      }
    }
  }
  for (std::size_t m = 0; m < times.size(); ++m) result.methods[m].microseconds = medianOf(times[m]);
  return result;
}

nlohmann::ordered_json collisionJson(const CollisionResult& result, const CollisionOptions& options) {
  nlohmann::ordered_json json = {{"study", "collision"},
                                 {"seed", options.seed},
                                 {"overlapping", result.overlapping},
                                 {"apart", result.apart},
                                 {"overlapping_by_depth", result.at_depth}};
  for (const CollisionMethod& m : result.methods) {
    json["methods"].push_back({{"name", m.name},
                               {"missed", m.missed},
                               {"false", m.false_contacts},
                               {"wrong_way", m.wrong},
                               {"right_by_depth", m.right},
                               {"right_to_diagonals", result.deepest(m)},
                               {"microseconds", m.microseconds}});
  }
  return json;
}

std::string collisionText(const CollisionResult& result) {
  std::array<char, 256> line{};
  std::snprintf(line.data(), line.size(), "%-24s %7s %7s %10s %15s %10s\n", "", "missed", "false", "wrong way",
                "right down to", "us a pair");
  std::string text = line.data();
  for (const CollisionMethod& m : result.methods) {
    std::snprintf(line.data(), line.size(), "%-24s %7u %7u %10u %14.0f%% %10.0f\n", m.name.c_str(), m.missed,
                  m.false_contacts, m.wrong, 100 * result.deepest(m), m.microseconds);
    text += line.data();
  }
  return text + std::to_string(result.overlapping) + " pairs overlap, " + std::to_string(result.apart) +
         " are apart. Right: nine of ten are parted on a way of at most twice the shortest; in percent of a "
         "diagonal.\n";
}

}  // namespace sinew::tools
