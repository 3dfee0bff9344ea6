// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/explicit_solid.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Floats: of displacements and of what differs from no rotation, so that small strains are exact.
constexpr std::size_t kLanes = 16;
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));
constexpr std::size_t kGrain = 16;
constexpr int kPowers = 60;
// Margin for power iteration, of the highest frequency; and for stretched tetrahedra: they ring higher.
constexpr double kPowerMargin = 1.05;
// A point that touches within a frame is at most so much faster than the fastest at the frame's begin.
constexpr double kFaster = 2;
// Of the size: so small that a force is linear.
constexpr double kLinear = 1e-4;

// Of linear tetrahedra (4 nodes) and quadratic ones (10: corners, then midway along their edges, which are straight at
// rest): points of quadrature, of equal weight, and the derivatives of the nodes' shape functions there.
constexpr std::array<std::array<std::size_t, 2>, 6> kEdges = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
template <std::size_t kNodes>
struct Element {
  static constexpr std::size_t kPoints = kNodes == 4 ? 1 : 4;
  float derivative[kPoints][kNodes][3] = {};

  constexpr Element() {
    constexpr double kGradient[4][3] = {{-1, -1, -1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // of barycentric coordinates
    for (std::size_t point = 0; point < kPoints; ++point) {
      double at[4] = {};  // Keast's rule of degree 2
      for (std::size_t k = 0; k < 4; ++k) at[k] = k == point ? 0.58541019662496845 : 0.13819660112501052;
      for (int k = 0; k < 3; ++k) {
        for (std::size_t n = 0; n < 4; ++n)
          derivative[point][n][k] = float((kNodes == 4 ? 1 : 4 * at[n] - 1) * kGradient[n][k]);
        for (std::size_t n = 4; n < kNodes; ++n) {
          const std::size_t i = kEdges[n - 4][0], j = kEdges[n - 4][1];
          derivative[point][n][k] = float(4 * (at[i] * kGradient[j][k] + at[j] * kGradient[i][k]));
        }
      }
    }
  }
};

// Sixteen tetrahedra. Padding of the last block has no volume.
template <std::size_t kNodes>
struct alignas(64) Block {
  Lanes inverse[9];                         // of the edges at rest, rows by edge
  Lanes volume, mu, lambda;                 // of a point, m³; Pa
  Lanes turn[Element<kNodes>::kPoints][4];  // rotation as a quaternion w, x, y, z
  std::uint32_t node[kNodes][kLanes];
};

// Forces of the nodes of a block, x, y, z each. Aligned for the widest instructions that a clone may have.
template <std::size_t kNodes>
struct alignas(64) Forces {
  Lanes of[kNodes][3];
};

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__)
#define SINEW_FOR_PROCESSORS __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#else
#define SINEW_FOR_PROCESSORS
#endif

// R - 1.
[[gnu::always_inline]] inline void turnOf(const Lanes (&q)[4], Lanes (&d)[9]) {
  const Lanes &w = q[0], &x = q[1], &y = q[2], &z = q[3];
  d[0] = -2 * (y * y + z * z), d[1] = 2 * (x * y - w * z), d[2] = 2 * (x * z + w * y);
  d[3] = 2 * (x * y + w * z), d[4] = -2 * (x * x + z * z), d[5] = 2 * (y * z - w * x);
  d[6] = 2 * (x * z - w * y), d[7] = 2 * (y * z + w * x), d[8] = -2 * (x * x + y * y);
}

// One step of Newton's method for the rotation R that makes S = RᵀF symmetric: (tr S - S) w = axial(RᵀF - FᵀR).
// \param g F - 1
[[gnu::always_inline]] inline void follow(const Lanes (&g)[9], Lanes (&q)[4]) {
  Lanes d[9];
  turnOf(q, d);
  Lanes a[9];  // RᵀF - 1
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      a[3 * i + j] = g[3 * i + j] + d[3 * j + i] + d[i] * g[j] + d[3 + i] * g[3 + j] + d[6 + i] * g[6 + j];
    }
  }
  const Lanes ax = a[7] - a[5], ay = a[2] - a[6], az = a[3] - a[1];
  const Lanes g00 = 2 + a[4] + a[8], g11 = 2 + a[0] + a[8], g22 = 2 + a[0] + a[4];
  const Lanes g01 = -0.5F * (a[1] + a[3]), g02 = -0.5F * (a[2] + a[6]), g12 = -0.5F * (a[5] + a[7]);
  const Lanes c00 = g11 * g22 - g12 * g12, c01 = g02 * g12 - g01 * g22, c02 = g01 * g12 - g02 * g11;
  const Lanes c11 = g00 * g22 - g02 * g02, c12 = g01 * g02 - g00 * g12, c22 = g00 * g11 - g01 * g01;
  const Lanes determinant = g00 * c00 + g01 * c01 + g02 * c02;
  const Lanes least = Lanes{} + 1e-3F;
  const Lanes half = 0.5F / (determinant > least ? determinant : least);
  const Lanes x = half * (c00 * ax + c01 * ay + c02 * az), y = half * (c01 * ax + c11 * ay + c12 * az),
              z = half * (c02 * ax + c12 * ay + c22 * az);
  const Lanes qw = q[0], qx = q[1], qy = q[2], qz = q[3];
  Lanes n[4] = {qw - qx * x - qy * y - qz * z, qx + qw * x + qy * z - qz * y, qy + qw * y + qz * x - qx * z,
                qz + qw * z + qx * y - qy * x};
  for (int i = 0; i < 2; ++i) {
    const Lanes scale = 1.5F - 0.5F * (n[0] * n[0] + n[1] * n[1] + n[2] * n[2] + n[3] * n[3]);
    for (Lanes& c : n) c *= scale;
  }
  for (int i = 0; i < 4; ++i) q[i] = n[i];
}

// g g' of the runtime's measure of volume (docs/method.md §3). \param j J - 1
[[gnu::always_inline]] inline void setPressure(const Lanes& j, Lanes& result) {
  for (std::size_t i = 0; i < kLanes; ++i) {
    const float beyond = j[i] > 0 ? j[i] : j[i] < -1 ? -1 - j[i] : 0;  // of 1, of 0
    const float root = std::sqrt(1 + beyond), fourth = std::sqrt(root);
    const float g = 4 * beyond / ((root + 1) * (fourth + 1)), slope = 1 / (root * fourth);
    result[i] = j[i] > 0 ? g * slope : j[i] < -1 ? -(1 + g) * slope : j[i];
  }
}

// Of `count` blocks. \param u displacement by node: x, y, z.
template <std::size_t kNodes>
[[gnu::always_inline]] inline void forcesOf(Block<kNodes>* blocks, std::size_t count, ElasticLaw law, const double* u,
                                            Forces<kNodes>* out) {
  static constexpr Element<kNodes> kElement;
  for (std::size_t b = 0; b < count; ++b) {
    Block<kNodes>& block = blocks[b];
    Lanes node[kNodes][3] = {};
    for (std::size_t k = 0; k < kNodes; ++k) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        const double* at = u + 3 * std::size_t(block.node[k][lane]);
        for (std::size_t i = 0; i < 3; ++i) node[k][i][lane] = float(at[i]);
      }
    }
    Lanes force[kNodes][3] = {};
    for (std::size_t point = 0; point < Element<kNodes>::kPoints; ++point) {
      const auto& derivative = kElement.derivative[point];
      Lanes g[9];  // F - 1
      for (int row = 0; row < 3; ++row) {
        Lanes d[3] = {};
        for (std::size_t n = 0; n < kNodes; ++n) {
          for (int k = 0; k < 3; ++k) d[k] += node[n][row] * derivative[n][k];
        }
        for (int c = 0; c < 3; ++c) {
          g[3 * row + c] = d[0] * block.inverse[c] + d[1] * block.inverse[3 + c] + d[2] * block.inverse[6 + c];
        }
      }
      // Cofactors of F less 1, and J - 1.
      const Lanes e[9] = {g[4] + g[8] + g[4] * g[8] - g[5] * g[7], g[5] * g[6] - g[3] * g[8] - g[3],
                          g[3] * g[7] - g[4] * g[6] - g[6],        g[2] * g[7] - g[1] * g[8] - g[1],
                          g[0] + g[8] + g[0] * g[8] - g[2] * g[6], g[1] * g[6] - g[0] * g[7] - g[7],
                          g[1] * g[5] - g[2] * g[4] - g[2],        g[2] * g[3] - g[0] * g[5] - g[5],
                          g[0] + g[4] + g[0] * g[4] - g[1] * g[3]};
      const Lanes j = g[0] + e[0] + g[0] * e[0] + g[1] * e[1] + g[2] * e[2];
      Lanes p[9];
      if (law == ElasticLaw::neo_hookean) {
        // mu/2 (tr FᵀF - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)²
        const Lanes pressure = (block.lambda + block.mu) * j;
        for (int i = 0; i < 9; ++i) {
          p[i] = block.mu * (g[i] - e[i]) + pressure * (i % 4 == 0 ? 1 + e[i] : e[i]);
        }
      } else {
        follow(g, block.turn[point]);
        Lanes d[9];
        turnOf(block.turn[point], d);
        for (int i = 0; i < 9; ++i) p[i] = 2 * block.mu * (g[i] - d[i]);
        if (law == ElasticLaw::corotated) {
          Lanes trace = g[0] + g[4] + g[8] + d[0] + d[4] + d[8];  // of RᵀF - 1
          for (int i = 0; i < 9; ++i) trace += d[i] * g[i];
          for (int i = 0; i < 9; ++i) p[i] += block.lambda * trace * (i % 4 == 0 ? 1 + d[i] : d[i]);
        } else {
          Lanes pressure;
          setPressure(j, pressure);
          pressure *= block.lambda;
          for (int i = 0; i < 9; ++i) p[i] += pressure * (i % 4 == 0 ? 1 + e[i] : e[i]);
        }
      }
      for (int row = 0; row < 3; ++row) {
        for (int k = 0; k < 3; ++k) {
          const Lanes h =
              -block.volume * (p[3 * row] * block.inverse[3 * k] + p[3 * row + 1] * block.inverse[3 * k + 1] +
                               p[3 * row + 2] * block.inverse[3 * k + 2]);
          for (std::size_t n = 0; n < kNodes; ++n) force[n][row] += h * derivative[n][k];
        }
      }
    }
    for (std::size_t n = 0; n < kNodes; ++n) {
      for (int row = 0; row < 3; ++row) out[b].of[n][row] = force[n][row];
    }
  }
}
SINEW_FOR_PROCESSORS void forcesOfAll(Block<4>* blocks, std::size_t count, ElasticLaw law, const double* u,
                                      Forces<4>* out) {
  forcesOf<4>(blocks, count, law, u, out);
}
SINEW_FOR_PROCESSORS void forcesOfAll(Block<10>* blocks, std::size_t count, ElasticLaw law, const double* u,
                                      Forces<10>* out) {
  forcesOf<10>(blocks, count, law, u, out);
}

// A body's nodes: its vertices, and of quadratic tetrahedra one midway along each edge.
template <std::size_t kNodes>
struct Nodes {
  std::vector<Vector3d> rest;
  std::vector<double> masses;
  std::vector<std::int32_t> region;
  std::vector<std::array<std::uint32_t, kNodes>> tetrahedra;
  std::vector<std::optional<std::array<std::pair<std::uint32_t, double>, kNodes>>> probes;

  explicit Nodes(const MotionBody& body) : rest(body.rest), masses(body.masses), region(body.region) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    for (const auto& t : body.tetrahedra) {
      std::array<std::uint32_t, kNodes> nodes{};
      std::copy(t.begin(), t.end(), nodes.begin());
      for (std::size_t n = 4; n < kNodes; ++n) {
        const std::uint32_t a = t[kEdges[n - 4][0]], b = t[kEdges[n - 4][1]];
        const auto [at, fresh] = middles.try_emplace(std::minmax(a, b), std::uint32_t(rest.size()));
        if (fresh) {
          rest.push_back(0.5 * (body.rest[a] + body.rest[b]));
          region.push_back(body.region[a] == body.region[b] ? body.region[a] : -1);
        }
        nodes[n] = at->second;
      }
      tetrahedra.push_back(nodes);
    }
    if constexpr (kNodes > 4) lump(body);
    for (const std::optional<Probe>& probe : body.probes) {
      probes.emplace_back();
      if (!probe) continue;
      auto& points = probes.back().emplace();
      for (std::size_t k = 0; k < 4; ++k) {
        const double w = probe->weight[k];
        points[k] = {probe->vertex[k], kNodes == 4 ? w : w * (2 * w - 1)};
      }
      for (std::size_t n = 4; n < kNodes; ++n) {
        const std::size_t i = kEdges[n - 4][0], j = kEdges[n - 4][1];
        const auto at = middles.find(std::minmax(probe->vertex[i], probe->vertex[j]));
        // Of a crumb that was left out, whose corners others have: nothing is known of it.
        if (at == middles.end()) {
          probes.back().reset();
          break;
        }
        points[n] = {at->second, 4 * probe->weight[i] * probe->weight[j]};
      }
    }
  }

 private:
  // In proportion to the diagonal of the consistent mass (Hinton, Rock, Zienkiewicz 1976): a corner 1/36 of the
  // tetrahedron, a node midway 4/27.
  void lump(const MotionBody& body) {
    std::vector<double> volumes(body.rest.size(), 0);
    std::vector<double> volume;
    for (const auto& t : body.tetrahedra) {
      Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = body.rest[t[std::size_t(k) + 1]] - body.rest[t[0]];
      volume.push_back(edges.determinant() / 6);
      for (const std::uint32_t v : t) volumes[v] += volume.back() / 4;
    }
    masses.assign(rest.size(), 0);
    double before = 0, after = 0;
    for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
      double density = 0;
      for (const std::uint32_t v : body.tetrahedra[t]) density += body.masses[v] / volumes[v] / 4;
      for (std::size_t n = 0; n < kNodes; ++n) {
        masses[tetrahedra[t][n]] += density * volume[t] * (n < 4 ? 1.0 / 36 : 4.0 / 27);
      }
    }
    for (const double m : body.masses) before += m;
    for (const double m : masses) after += m;
    for (double& m : masses) m *= before / after;
  }
};

template <std::size_t kNodes>
class Solid {
 public:
  Solid(const MotionBody& body, const Nodes<kNodes>& nodes) : count_(nodes.rest.size()) {
    const std::size_t tetrahedra = body.tetrahedra.size();
    blocks_.resize((tetrahedra + kLanes - 1) / kLanes);
    out_.resize(blocks_.size());
    first_.assign(count_ + 1, 0);
    for (const auto& t : nodes.tetrahedra) {
      for (const std::uint32_t v : t) ++first_[v + 1];
    }
    for (std::size_t v = 0; v < count_; ++v) first_[v + 1] += first_[v];
    places_.resize(first_.back());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t i = 0; i < kLanes * blocks_.size(); ++i) {
      const std::size_t t = std::min(i, tetrahedra - 1), b = i / kLanes, lane = i % kLanes;
      Block<kNodes>& block = blocks_[b];
      const auto& corners = body.tetrahedra[t];
      Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = body.rest[corners[std::size_t(k) + 1]] - body.rest[corners[0]];
      const Matrix3d inverse = edges.inverse();
      for (int k = 0; k < 9; ++k) block.inverse[k][lane] = float(inverse(k / 3, k % 3));
      const ElasticMaterial& m = body.materials[t];
      block.volume[lane] = i < tetrahedra ? float(edges.determinant() / 6 / double(Element<kNodes>::kPoints)) : 0;
      block.mu[lane] = float(0.5 * m.young / (1 + m.poisson));
      block.lambda[lane] = float(m.young * m.poisson / ((1 + m.poisson) * (1 - 2 * m.poisson)));
      for (std::size_t k = 0; k < kNodes; ++k) {
        block.node[k][lane] = nodes.tetrahedra[t][k];
        if (i < tetrahedra) {
          places_[next[block.node[k][lane]]++] = std::uint32_t((3 * (kNodes * b + k)) * kLanes + lane);
        }
      }
    }
    startOver();
  }

  void startOver() {
    for (Block<kNodes>& block : blocks_) {
      for (auto& turn : block.turn) {
        turn[0] = Lanes{} + 1;
        for (int k = 1; k < 4; ++k) turn[k] = Lanes{};
      }
    }
  }

  // \param u displacement by node. \param each called with a node and its elastic force, N.
  template <class Each>
  void forces(const std::vector<double>& u, ElasticLaw law, const Each& each) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks_.size(), kGrain), [&](const auto& range) {
      forcesOfAll(&blocks_[range.begin()], range.size(), law, u.data(), &out_[range.begin()]);
    });
    const auto* values = reinterpret_cast<const float*>(out_.data());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count_, 64 * kGrain), [&](const auto& range) {
      for (std::size_t v = range.begin(); v < range.end(); ++v) {
        Vector3d force = Vector3d::Zero();
        for (std::size_t i = first_[v]; i < first_[v + 1]; ++i) {
          const float* at = values + places_[i];
          force += Vector3d(double(at[0]), double(at[kLanes]), double(at[2 * kLanes]));
        }
        each(v, force);
      }
    });
  }

 private:
  std::size_t count_;
  std::vector<Block<kNodes>> blocks_;
  std::vector<Forces<kNodes>> out_;
  std::vector<std::size_t> first_;     // of each vertex in places_
  std::vector<std::uint32_t> places_;  // where its forces lie in out_
};

// The ground under a body: springs that only push, with friction, at points of its surface.
class GroundContact {
 public:
  template <std::size_t kNodes>
  GroundContact(const MotionBody& body, const Nodes<kNodes>& nodes, double penalty)
      : push_(nodes.rest.size(), Vector3d::Zero()) {
    double young = 0;
    Vector3d low = nodes.rest.front(), high = low;
    for (const ElasticMaterial& m : body.materials) young += m.young / double(body.materials.size());
    for (const Vector3d& x : nodes.rest) low = low.cwiseMin(x), high = high.cwiseMax(x);
    const double pressure = penalty * young / (high - low).norm();
    for (const ContactSample& point : body.points) {
      std::map<std::uint32_t, double> weights;
      bool whole = true;
      for (std::size_t k = 0; k < 3; ++k) {
        if (point.weight[k] == 0) continue;
        const auto& probe = nodes.probes[point.vertex[k]];
        whole = whole && probe;
        if (!whole) break;
        for (const auto& [node, w] : *probe) weights[node] += point.weight[k] * w;
      }
      if (!whole) continue;
      Point one;
      one.stiffness = pressure * point.area;
      one.first = std::uint32_t(weights_.size());
      for (const auto& [node, w] : weights) {
        if (w == 0) continue;
        weights_.emplace_back(node, w);
        one.rest += w * nodes.rest[node];
      }
      one.last = std::uint32_t(weights_.size());
      points_.push_back(one);
    }
  }

  // Which points may touch before the next call, at speeds of at most `speed`.
  void look(const MotionGround& ground, const std::vector<double>& u, double speed, double seconds) {
    near_.clear();
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (points_[i].touches || at(points_[i], u)[1] < ground.height + speed * seconds) near_.push_back(i);
    }
  }

  // Forces of the nodes, by node.
  const std::vector<Vector3d>& forces(const MotionGround& ground, const std::vector<double>& u) {
    clear();
    for (const std::uint32_t i : near_) {
      Point& point = points_[i];
      const Vector3d x = at(point, u);
      const double load = point.stiffness * (ground.height - x[1]);
      if (load <= 0) {
        point.touches = false;
        continue;
      }
      if (!point.touches) point.anchor = x;
      point.touches = true;
      Vector3d slide = x - point.anchor;
      slide[1] = 0;
      const double most = ground.friction * load / point.stiffness, length = slide.norm();
      if (length > most) {
        point.anchor += (1 - most / length) * slide;
        slide *= most / length;
      }
      add(point, Vector3d(0, load, 0) - point.stiffness * slide);
    }
    return push_;
  }

  // As if all points touched and none slid: what a step has to be short enough for.
  const std::vector<Vector3d>& stiffest(const std::vector<double>& u) {
    clear();
    for (const Point& point : points_) add(point, -point.stiffness * (at(point, u) - point.rest));
    return push_;
  }

 private:
  struct Point {
    Vector3d rest = Vector3d::Zero(), anchor = Vector3d::Zero();
    double stiffness = 0;  // N/m
    std::uint32_t first = 0, last = 0;
    bool touches = false;
  };

  Vector3d at(const Point& point, const std::vector<double>& u) const {
    Vector3d x = point.rest;
    for (std::uint32_t i = point.first; i < point.last; ++i) {
      const auto& [node, w] = weights_[i];
      x += w * Eigen::Map<const Vector3d>(&u[3 * std::size_t(node)]);
    }
    return x;
  }
  void add(const Point& point, const Vector3d& force) {
    for (std::uint32_t i = point.first; i < point.last; ++i) {
      push_[weights_[i].first] += weights_[i].second * force;
      pushed_.push_back(weights_[i].first);
    }
  }
  void clear() {
    for (const std::uint32_t node : pushed_) push_[node].setZero();
    pushed_.clear();
  }

  std::vector<Point> points_;
  std::vector<std::pair<std::uint32_t, double>> weights_;
  std::vector<std::uint32_t> near_, pushed_;
  std::vector<Vector3d> push_;
};

// Tethers and fibres. A tether is a squared frequency of its vertex' mass; at a node midway it is the harmonic mean of
// both ends', as it is held where both are.
class Springs {
 public:
  template <std::size_t kNodes>
  Springs(const MotionBody& body, const Nodes<kNodes>& nodes) {
    if (!body.tethers.empty() || !body.fibres.empty()) force_.resize(nodes.rest.size(), Vector3d::Zero());
    std::vector<std::vector<std::pair<std::uint32_t, double>>> squares(body.rest.size());  // region, 1/s²
    std::uint32_t regions = 0;
    for (const MotionTether& tether : body.tethers) {
      regions = std::max(regions, tether.region + 1);
      squares[tether.vertex].emplace_back(tether.region, tether.stiffness / body.masses[tether.vertex]);
    }
    const auto hang = [&](std::uint32_t node, std::uint32_t region, double square) {
      if (square > 0) tethers_.push_back({node, region, square * nodes.masses[node], nodes.rest[node]});
    };
    const auto squareAt = [&](std::uint32_t v, std::uint32_t region) {
      double sum = body.region[v] == std::int32_t(region) ? std::numeric_limits<double>::infinity() : 0;
      for (const auto& [other, square] : squares[v]) sum += other == region ? square : 0;
      return sum;
    };
    for (std::uint32_t v = 0; v < squares.size(); ++v) {
      for (const auto& [region, square] : squares[v]) hang(v, region, square);
    }
    std::vector<char> seen(nodes.rest.size(), 0);
    for (std::size_t t = 0; t < nodes.tetrahedra.size(); ++t) {
      for (std::size_t n = 4; n < kNodes; ++n) {
        const std::uint32_t node = nodes.tetrahedra[t][n];
        if (std::exchange(seen[node], 1) != 0) continue;
        for (std::uint32_t region = 0; region < regions; ++region) {
          const double one = squareAt(body.tetrahedra[t][kEdges[n - 4][0]], region);
          const double other = squareAt(body.tetrahedra[t][kEdges[n - 4][1]], region);
          if (std::isfinite(one) || std::isfinite(other)) hang(node, region, 2 / (1 / one + 1 / other));
        }
      }
    }
    for (const Tether& tether : tethers_) touched_.push_back(tether.node);
    for (const MotionFibre& fibre : body.fibres) {
      stretch_.emplace_back();
      for (const auto& [t, weight] : fibre.weights) {
        const auto& corners = body.tetrahedra[t];
        Matrix3d edges;
        for (int k = 0; k < 3; ++k) edges.col(k) = body.rest[corners[std::size_t(k) + 1]] - body.rest[corners[0]];
        const Vector3d along = edges.inverse() * fibre.direction;
        const std::array<double, 4> slope = {-along.sum(), along[0], along[1], along[2]};
        // Of quadratic elements the points of Keast's rule of degree 2, which F's square has.
        constexpr std::size_t kPoints = kNodes > 4 ? 4 : 1;
        for (std::size_t point = 0; point < kPoints; ++point) {
          std::array<double, 4> at;
          at.fill(0.1381966011250105);
          at[point] = 0.5854101966249685;
          Stretch part{weight / double(kPoints), fibre.direction, {}};
          for (std::size_t n = 0; n < kNodes; ++n) {
            double value = n < 4 ? slope[n] : 0;
            if (kNodes > 4 && n < 4) value *= 4 * at[n] - 1;
            if (n >= 4) {
              const auto& [one, other] = kEdges[n - 4];
              value = 4 * (at[one] * slope[other] + at[other] * slope[one]);
            }
            part.slope.emplace_back(nodes.tetrahedra[t][n], value);
            touched_.push_back(nodes.tetrahedra[t][n]);
          }
          stretch_.back().push_back(std::move(part));
        }
      }
    }
    std::sort(touched_.begin(), touched_.end());
    touched_.erase(std::unique(touched_.begin(), touched_.end()), touched_.end());
  }

  // By node; null where there are none.
  const std::vector<Vector3d>* forces(const MotionBody& body, const MotionScene& scene,
                                      const std::vector<Eigen::Isometry3d>& held, const std::vector<double>& u,
                                      double time) {
    if (force_.empty()) return nullptr;
    const auto displacement = [&](std::uint32_t v) { return Eigen::Map<const Vector3d>(&u[3 * std::size_t(v)]); };
    for (const std::uint32_t v : touched_) force_[v].setZero();
    for (const Tether& tether : tethers_) {
      force_[tether.node] +=
          tether.stiffness * (held[tether.region] * tether.rest - tether.rest - displacement(tether.node));
    }
    for (std::size_t i = 0; i < body.fibres.size(); ++i) {
      const double activation = scene.activation(body.fibres[i].channel, time);
      const double tension = body.fibres[i].tension * activation / (1 - activation * body.fibres[i].contraction);
      if (!(tension > 0)) continue;
      for (const Stretch& part : stretch_[i]) {
        Vector3d along = part.rest;
        for (const auto& [v, w] : part.slope) along += w * displacement(v);
        along *= part.weight * tension;
        for (const auto& [v, w] : part.slope) force_[v] -= w * along;
      }
    }
    return &force_;
  }
  // Of a displacement of all tethers, by node: what a step has to be short enough for. Null where there are none.
  const std::vector<Vector3d>* stiffest(const std::vector<double>& u) {
    if (tethers_.empty()) return nullptr;
    for (const std::uint32_t v : touched_) force_[v].setZero();
    for (const Tether& tether : tethers_) {
      force_[tether.node] -= tether.stiffness * Eigen::Map<const Vector3d>(&u[3 * std::size_t(tether.node)]);
    }
    return &force_;
  }

 private:
  struct Tether {
    std::uint32_t node, region;
    double stiffness;  // N/m
    Vector3d rest;
  };
  std::vector<Tether> tethers_;
  std::vector<Vector3d> force_;
  std::vector<std::uint32_t> touched_;
  // The deformation gradient at a point along a fibre: rest, and the sum of slope times displacement.
  struct Stretch {
    double weight;
    Vector3d rest;
    std::vector<std::pair<std::uint32_t, double>> slope;
  };
  std::vector<std::vector<Stretch>> stretch_;  // of each fibre
};

// \param contact may be null
template <std::size_t kNodes>
double longestStep(Solid<kNodes>& solid, const MotionBody& body, const Nodes<kNodes>& nodes, GroundContact* contact) {
  Springs springs(body, nodes);
  const std::size_t count = nodes.rest.size();
  double size = 0;
  for (const Vector3d& x : nodes.rest) size = std::max(size, (x - nodes.rest.front()).norm());
  std::vector<Vector3d> mode(count);
  for (std::size_t v = 0; v < count; ++v) {
    mode[v] = Vector3d(std::sin(1.0 * double(v)), std::sin(2.3 * double(v)), std::cos(3.1 * double(v)));
  }
  double omega2 = 0;
  std::vector<double> u(3 * count);
  for (int i = 0; i < kPowers; ++i) {
    double square = 0;
    for (std::size_t v = 0; v < count; ++v) {
      if (nodes.region[v] >= 0) mode[v].setZero();
      square += mode[v].squaredNorm();
    }
    const double scale = kLinear * size / std::sqrt(square);
    for (std::size_t v = 0; v < count; ++v) {
      Eigen::Map<Vector3d> place(&u[3 * v]);
      place = scale * mode[v];
    }
    solid.startOver();
    const std::vector<Vector3d>* push = contact != nullptr ? &contact->stiffest(u) : nullptr;
    const std::vector<Vector3d>* pull = springs.stiffest(u);
    solid.forces(u, ElasticLaw::corotated, [&](std::size_t v, const Vector3d& elastic) {
      Vector3d force = elastic;
      if (push != nullptr) force += (*push)[v];
      if (pull != nullptr) force += (*pull)[v];
      mode[v] = -force / (scale * nodes.masses[v]);
    });
    double after = 0;
    for (std::size_t v = 0; v < count; ++v) after += nodes.region[v] >= 0 ? 0 : mode[v].squaredNorm();
    omega2 = std::sqrt(after / square);
    for (Vector3d& part : mode) part /= std::sqrt(after);
  }
  solid.startOver();
  return 2 / (kPowerMargin * std::sqrt(omega2));
}

template <std::size_t kNodes>
ExplicitRun play(const MotionBody& body, const MotionScene& scene, const ExplicitOptions& options,
                 const std::function<void(double)>& progress) {
  ExplicitRun run;
  run.tetrahedra = std::uint32_t(body.tetrahedra.size());
  const Nodes<kNodes> nodes(body);
  Solid<kNodes> solid(body, nodes);
  std::optional<GroundContact> contact;
  if (scene.ground) contact.emplace(body, nodes, options.penalty);
  const double longest = longestStep(solid, body, nodes, contact ? &*contact : nullptr);
  const auto steps = std::uint32_t(std::ceil(kFrameSeconds / (options.step_share * longest)));
  const double h = run.step_seconds = kFrameSeconds / steps;
  const int frames = int(std::lround(scene.seconds / kFrameSeconds));
  run.work = double(run.tetrahedra) * double(Element<kNodes>::kPoints) * steps * frames;
  if (run.work > options.most_work) return run;
  std::vector<double> u(3 * nodes.rest.size(), 0), v(u);
  std::vector<Eigen::Isometry3d> held(scene.regions.size());
  Springs springs(body, nodes);
  for (int frame = 0; frame < frames && run.motion.finite; ++frame) {
    if (contact) {
      double fastest = scene.gravityAt(frame * kFrameSeconds).norm() * kFrameSeconds;
      for (std::size_t node = 0; node < nodes.rest.size(); ++node) {
        fastest = std::max(fastest, Eigen::Map<const Vector3d>(&v[3 * node]).norm());
      }
      contact->look(*scene.ground, u, kFaster * fastest, kFrameSeconds);
    }
    for (std::uint32_t i = 0; i < steps; ++i) {
      const double now = frame * kFrameSeconds + i * h;
      const Vector3d gravity = scene.gravityAt(now);
      const std::vector<Vector3d>* push = contact ? &contact->forces(*scene.ground, u) : nullptr;
      const double decay = std::exp(-scene.dampingAt(now) * h);
      for (std::size_t r = 0; r < held.size(); ++r) held[r] = scene.poseOf(r, now + h);
      const std::vector<Vector3d>* pull = springs.forces(body, scene, held, u, now + h);
      solid.forces(u, options.law, [&](std::size_t node, const Vector3d& elastic) {
        Eigen::Map<Vector3d> displacement(&u[3 * node]), velocity(&v[3 * node]);
        if (nodes.region[node] >= 0) {
          displacement = held[std::size_t(nodes.region[node])] * nodes.rest[node] - nodes.rest[node];
          return;
        }
        Vector3d force = elastic;
        if (push != nullptr) force += (*push)[node];
        if (pull != nullptr) force += (*pull)[node];
        velocity = decay * (velocity + h * (force / nodes.masses[node] + gravity));
        displacement += h * velocity;
      });
    }
    run.motion.finite = std::all_of(u.begin(), u.end(), [](double c) { return std::isfinite(c); });
    if (!run.motion.finite) break;
    std::vector<Eigen::Vector3f> points;
    for (std::size_t i = 0; i < nodes.probes.size(); ++i) {
      Vector3d at = body.surface[i];
      if (nodes.probes[i]) {
        at.setZero();
        for (const auto& [node, weight] : *nodes.probes[i]) {
          at += weight * (nodes.rest[node] + Eigen::Map<const Vector3d>(&u[3 * node]));
        }
      }
      points.push_back(at.cast<float>());
    }
    run.motion.frames.push_back(std::move(points));
    progress(double(frame + 1) / frames);
  }
  return run;
}

}  // namespace

ExplicitRun playSolid(const MotionBody& body, const MotionScene& scene, const ExplicitOptions& options,
                      const std::function<void(double)>& progress) {
  return options.quadratic ? play<10>(body, scene, options, progress) : play<4>(body, scene, options, progress);
}

}  // namespace sinew::tools
