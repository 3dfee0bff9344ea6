// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/finite_elements.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vectors = std::vector<Vector3d>;

constexpr int kMostIterations = 200;
constexpr int kMostGradients = 2000;
// Of the right-hand side: the system changes with the next rotations anyway.
constexpr double kLinearTolerance = 1e-3;

Matrix3d edges(const Vectors& x, const std::array<std::uint32_t, 4>& t) {
  Matrix3d m;
  for (int k = 0; k < 3; ++k) m.col(k) = x[t[std::size_t(k) + 1]] - x[t[0]];
  return m;
}

// The proper rotation nearest to F: Newton's iteration for the polar factor, or the SVD where F is not upright.
Matrix3d rotationOf(const Matrix3d& f) {
  if (f.determinant() > 1e-3) {
    Matrix3d q = f;
    for (int i = 0; i < 30; ++i) {
      const Matrix3d next = 0.5 * (q + q.inverse().transpose());
      const bool done = (next - q).cwiseAbs().maxCoeff() < 1e-13;
      q = next;
      if (done) return q;
    }
  }
  const Eigen::JacobiSVD<Matrix3d> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) = -u.col(2);
  return u * svd.matrixV().transpose();
}

// Forces and their derivative, tetrahedron by tetrahedron: no matrix is put together.
class Elasticity {
 public:
  Elasticity(const ElasticSolid& solid, double poisson)
      : solid_(solid),
        mu_(0.5 / (1 + poisson)),
        lambda_(poisson / ((1 + poisson) * (1 - 2 * poisson))),
        inverse_(solid.tetrahedra.size()),
        rotation_(solid.tetrahedra.size(), Matrix3d::Identity()),
        volume_(solid.tetrahedra.size()) {
    for (std::size_t t = 0; t < solid.tetrahedra.size(); ++t) {
      const Matrix3d e = edges(solid.rest, solid.tetrahedra[t]);
      inverse_[t] = e.inverse();
      volume_[t] = e.determinant() / 6;
    }
  }

  // Minus the gradient of the energy, 0 where prescribed; takes the rotations of x.
  void forces(const Vectors& x, Vectors& out) {
    std::fill(out.begin(), out.end(), Vector3d::Zero());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Matrix3d f = edges(x, solid_.tetrahedra[t]) * inverse_[t];
      rotation_[t] = rotationOf(f);
      add(t, -1, stress(rotation_[t].transpose() * f - Matrix3d::Identity()), out);
    }
    mask(out);
  }

  // The derivative times a direction, the rotations held.
  void apply(const Vectors& direction, Vectors& out) const {
    std::fill(out.begin(), out.end(), Vector3d::Zero());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Matrix3d df = edges(direction, solid_.tetrahedra[t]) * inverse_[t];
      add(t, 1, stress(rotation_[t].transpose() * df), out);
    }
    mask(out);
  }

  // Inverse of the derivative's diagonal blocks.
  std::vector<Matrix3d> preconditioner() const {
    std::vector<Matrix3d> blocks(solid_.rest.size(), Matrix3d::Zero());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      for (int a = 0; a < 4; ++a) {
        const Vector3d g = rotation_[t] * gradient(t, a);
        blocks[solid_.tetrahedra[t][std::size_t(a)]] +=
            volume_[t] * ((lambda_ + mu_) * g * g.transpose() + mu_ * g.squaredNorm() * Matrix3d::Identity());
      }
    }
    for (std::size_t v = 0; v < blocks.size(); ++v) {
      if (!solid_.prescribed[v]) blocks[v] = blocks[v].inverse().eval();
    }
    return blocks;
  }

 private:
  Matrix3d stress(const Matrix3d& strain) const {
    return mu_ * (strain + strain.transpose()) + lambda_ * strain.trace() * Matrix3d::Identity();
  }
  Vector3d gradient(std::size_t t, int a) const {
    return a > 0 ? Vector3d(inverse_[t].row(a - 1).transpose()) : Vector3d(-inverse_[t].colwise().sum().transpose());
  }
  void add(std::size_t t, double sign, const Matrix3d& stress, Vectors& out) const {
    const Matrix3d forces = sign * volume_[t] * rotation_[t] * stress * inverse_[t].transpose();
    for (int k = 0; k < 3; ++k) out[solid_.tetrahedra[t][std::size_t(k) + 1]] += forces.col(k);
    out[solid_.tetrahedra[t][0]] -= forces.rowwise().sum();
  }
  void mask(Vectors& out) const {
    for (std::size_t v = 0; v < out.size(); ++v) {
      if (solid_.prescribed[v]) out[v].setZero();
    }
  }

  const ElasticSolid& solid_;
  double mu_, lambda_;  // of a Young's modulus of 1
  std::vector<Matrix3d> inverse_, rotation_;
  std::vector<double> volume_;
};

double dot(const Vectors& a, const Vectors& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].dot(b[i]);
  return sum;
}

// Conjugate gradients for derivative * x = b, from x = 0.
Vectors solve(const Elasticity& elasticity, const std::vector<Matrix3d>& inverse_blocks, const Vectors& b,
              const std::vector<std::optional<Vector3d>>& prescribed) {
  Vectors x(b.size(), Vector3d::Zero()), r = b, z(b.size()), q(b.size());
  const auto precondition = [&] {
    for (std::size_t v = 0; v < r.size(); ++v) {
      z[v] = prescribed[v] ? Vector3d(Vector3d::Zero()) : Vector3d(inverse_blocks[v] * r[v]);
    }
  };
  precondition();
  Vectors p = z;
  double rho = dot(r, z);
  const double enough = kLinearTolerance * kLinearTolerance * rho;
  for (int i = 0; i < kMostGradients && rho > enough; ++i) {
    elasticity.apply(p, q);
    const double alpha = rho / dot(p, q);
    for (std::size_t v = 0; v < x.size(); ++v) {
      x[v] += alpha * p[v];
      r[v] -= alpha * q[v];
    }
    precondition();
    const double next = dot(r, z);
    for (std::size_t v = 0; v < x.size(); ++v) p[v] = z[v] + next / rho * p[v];
    rho = next;
  }
  return x;
}

}  // namespace

ElasticSolid refined(const ElasticSolid& solid, std::vector<Vector3d>* shape) {
  ElasticSolid fine;
  fine.rest = solid.rest;
  fine.prescribed = solid.prescribed;
  std::unordered_map<std::uint64_t, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const std::uint64_t key = (std::uint64_t(std::min(a, b)) << 32) | std::max(a, b);
    const auto [at, fresh] = middles.try_emplace(key, std::uint32_t(fine.rest.size()));
    if (fresh) {
      fine.rest.push_back(0.5 * (solid.rest[a] + solid.rest[b]));
      std::optional<Vector3d> held;
      if (solid.prescribed[a] && solid.prescribed[b]) held = 0.5 * (*solid.prescribed[a] + *solid.prescribed[b]);
      fine.prescribed.push_back(held);
      if (shape != nullptr) shape->push_back(0.5 * ((*shape)[a] + (*shape)[b]));
    }
    return at->second;
  };
  const auto add = [&](std::array<std::uint32_t, 4> t) {
    if (edges(fine.rest, t).determinant() < 0) std::swap(t[0], t[1]);
    fine.tetrahedra.push_back(t);
  };
  for (const auto& [a, b, c, d] : solid.tetrahedra) {
    const std::uint32_t ab = middle(a, b), ac = middle(a, c), ad = middle(a, d);
    const std::uint32_t bc = middle(b, c), bd = middle(b, d), cd = middle(c, d);
    add({a, ab, ac, ad});
    add({ab, b, bc, bd});
    add({ac, bc, c, cd});
    add({ad, bd, cd, d});
    // The octahedron in the middle, cut along its shortest diagonal; the other four corners in order around it.
    struct Diagonal {
      std::array<std::uint32_t, 2> ends;
      std::array<std::uint32_t, 4> around;
    };
    const std::array<Diagonal, 3> diagonals = {
        Diagonal{{ab, cd}, {ac, ad, bd, bc}}, {{ac, bd}, {ab, ad, cd, bc}}, {{ad, bc}, {ab, ac, cd, bd}}};
    const auto length = [&](const Diagonal& one) { return (fine.rest[one.ends[0]] - fine.rest[one.ends[1]]).norm(); };
    const Diagonal& cut =
        *std::min_element(diagonals.begin(), diagonals.end(),
                          [&](const auto& one, const auto& other) { return length(one) < length(other); });
    for (std::size_t k = 0; k < 4; ++k) add({cut.ends[0], cut.ends[1], cut.around[k], cut.around[(k + 1) % 4]});
  }
  return fine;
}

Equilibrium equilibrium(const ElasticSolid& solid, std::vector<Vector3d> start, double poisson, double tolerance) {
  Equilibrium result;
  if (start.empty()) start = solid.rest;
  result.positions = std::move(start);
  Vectors& x = result.positions;
  Elasticity elasticity(solid, poisson);
  Vectors f(x.size()), next(x.size());
  // The first step moves what is held; the rest follows by the derivative at the start.
  elasticity.forces(x, f);
  Vectors step(x.size(), Vector3d::Zero());
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (solid.prescribed[v]) step[v] = *solid.prescribed[v] - x[v];
  }
  elasticity.apply(step, next);
  for (std::size_t v = 0; v < x.size(); ++v) f[v] -= next[v];
  Vectors free = solve(elasticity, elasticity.preconditioner(), f, solid.prescribed);
  for (std::size_t v = 0; v < x.size(); ++v) x[v] += step[v] + free[v];
  for (result.iterations = 1; result.iterations < kMostIterations; ++result.iterations) {
    double furthest = 1e-300, change = 0;
    elasticity.forces(x, f);
    free = solve(elasticity, elasticity.preconditioner(), f, solid.prescribed);
    for (std::size_t v = 0; v < x.size(); ++v) {
      x[v] += free[v];
      change = std::max(change, free[v].norm());
      furthest = std::max(furthest, (x[v] - solid.rest[v]).norm());
    }
    result.residual = change / furthest;
    if (result.residual < tolerance) break;
  }
  return result;
}

Vector3d deformedPoint(const ElasticSolid& coarse, const ElasticSolid& fine, int refinements, std::uint32_t tetrahedron,
                       const Eigen::Vector4d& weights, const std::vector<Vector3d>& positions) {
  Vector3d point = Vector3d::Zero();
  for (int k = 0; k < 4; ++k) point += weights[k] * coarse.rest[coarse.tetrahedra[tetrahedron][std::size_t(k)]];
  const std::uint32_t count = 1U << (3 * refinements);
  Eigen::Vector4d best = weights;
  std::uint32_t home = tetrahedron;
  double inside = -1e300;
  for (std::uint32_t child = tetrahedron * count; child < (tetrahedron + 1) * count; ++child) {
    const auto& t = fine.tetrahedra[child];
    const Vector3d w = edges(fine.rest, t).inverse() * (point - fine.rest[t[0]]);
    const Eigen::Vector4d all(1 - w.sum(), w[0], w[1], w[2]);
    if (all.minCoeff() <= inside) continue;
    inside = all.minCoeff();
    best = all;
    home = child;
  }
  Vector3d moved = Vector3d::Zero();
  for (int k = 0; k < 4; ++k) moved += best[k] * positions[fine.tetrahedra[home][std::size_t(k)]];
  return moved;
}

}  // namespace sinew::tools
