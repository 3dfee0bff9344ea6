// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/finite_elements.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "sinew/formats/sections.h"
#include "tools/study/sparse_cholesky.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vectors = std::vector<Vector3d>;

constexpr int kMostIterations = 200;
constexpr int kMostGradients = 2000;
// Of the right-hand side: the system changes with the next rotations anyway.
constexpr double kLinearTolerance = 1e-3;

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
      const Matrix3d e = edgesOf(solid.rest, solid.tetrahedra[t]);
      inverse_[t] = e.inverse();
      volume_[t] = e.determinant() / 6;
    }
  }

  // Minus the gradient of the energy, 0 where prescribed; takes the rotations of x.
  void forces(const Vectors& x, Vectors& out) {
    std::fill(out.begin(), out.end(), Vector3d::Zero());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Matrix3d f = edgesOf(x, solid_.tetrahedra[t]) * inverse_[t];
      rotation_[t] = rotationOf(f);
      add(t, -1, stress(rotation_[t].transpose() * f - Matrix3d::Identity()), out);
    }
    mask(out);
  }

  // The derivative times a direction, the rotations held.
  void apply(const Vectors& direction, Vectors& out) const {
    std::fill(out.begin(), out.end(), Vector3d::Zero());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Matrix3d df = edgesOf(direction, solid_.tetrahedra[t]) * inverse_[t];
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

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kMostHalvings = 40;
constexpr int kMostDoublings = 6;
constexpr int kMostInverse = 200;
// Share of 2 mu that replaces negative eigenvalues of a point.
constexpr double kLeastStiffness = 1e-8;
// Newton's iteration for an ElasticTarget: trust region of the strength, as a factor, and relative error of the rms
// displacement at its end.
constexpr double kMostStronger = 1.5;
constexpr double kTargetTolerance = 1e-6;

// Gradients of shape functions at the points of quadrature, which have equal weight.
template <std::size_t kNodes>
struct Points {
  static constexpr std::size_t kCount = kNodes == 4 ? 1 : 4;
  using Gradients = Eigen::Matrix<double, 3, int(kNodes)>;

  // \param linear of barycentric coordinates, 1/m
  static Gradients gradients(const Eigen::Matrix<double, 3, 4>& linear, std::size_t point) {
    if constexpr (kNodes == 4) {
      return linear;
    } else {
      // Keast's rule of degree 2.
      std::array<double, 4> at{};
      for (std::size_t k = 0; k < 4; ++k) at[k] = k == point ? 0.58541019662496845 : 0.13819660112501052;
      Gradients result;
      for (std::size_t k = 0; k < 4; ++k) result.col(int(k)) = (4 * at[k] - 1) * linear.col(int(k));
      for (std::size_t e = 0; e < 6; ++e) {
        const auto [i, j] = kTetrahedronEdges[e];
        result.col(int(4 + e)) = 4 * (at[i] * linear.col(int(j)) + at[j] * linear.col(int(i)));
      }
      return result;
    }
  }
};

// Energy, forces and second derivative of a loaded solid, the latter as one matrix over the free nodes.
class LoadedSolid {
 public:
  virtual ~LoadedSolid() = default;
  Eigen::Index unknowns() const { return 3 * Eigen::Index(free_); }
  // Of the elastic energy; the load's is work().
  virtual double energy(const Vectors& x) const = 0;
  // Minus its gradient by free node; takes the state for matrix() and times().
  virtual VectorXd forces(const Vectors& x) = 0;
  // Its second derivative. \param positive negative eigenvalues of points at 0.
  virtual const std::vector<Matrix3d>& matrix(bool positive) = 0;
  // The second derivative (positive) times a direction of all nodes, by free node.
  virtual VectorXd times(const Vectors& direction) const = 0;

  const BlockPattern& pattern() const { return pattern_; }
  VectorXd load() const {
    VectorXd out = VectorXd::Zero(unknowns());
    for (std::size_t v = 0; v < load_.forces.size(); ++v) addTo(v, load_.forces[v], out);
    return out;
  }
  double work(const Vectors& x) const {
    double sum = 0;
    for (std::size_t v = 0; v < load_.forces.size(); ++v) sum += load_.forces[v].dot(x[v] - solid_.rest[v]);
    return sum;
  }
  void move(const VectorXd& by, double factor, Vectors& x) const {
    for (std::size_t v = 0; v < x.size(); ++v) {
      if (number_[v] >= 0) x[v] += factor * by.segment<3>(3 * number_[v]);
    }
  }
  int number(std::size_t node) const { return number_[node]; }

 protected:
  LoadedSolid(const ElasticSolid& solid, const ElasticLoad& load) : solid_(solid), load_(load) {
    number_.assign(solid.rest.size(), -1);
    for (std::size_t v = 0; v < solid.rest.size(); ++v) {
      if (!solid.prescribed[v]) number_[v] = free_++;
    }
  }
  void addTo(std::size_t node, const Vector3d& what, VectorXd& out) const {
    if (number_[node] >= 0) out.segment<3>(3 * number_[node]) += what;
  }

  const ElasticSolid& solid_;
  const ElasticLoad& load_;
  std::vector<int> number_;  // of the free nodes; -1 of prescribed ones
  int free_ = 0;
  BlockPattern pattern_;
};

template <std::size_t kNodes>
class LoadedElements : public LoadedSolid {
 public:
  LoadedElements(const ElasticSolid& solid, const ElasticLoad& load) : LoadedSolid(solid, load) {
    elements_.resize(solid.tetrahedra.size());
    for (std::size_t t = 0; t < elements_.size(); ++t) {
      Element& element = elements_[t];
      for (std::size_t k = 0; k < 4; ++k) element.node[k] = solid.tetrahedra[t][k];
      for (std::size_t k = 4; k < kNodes; ++k) element.node[k] = solid.middles[t][k - 4];
      const Matrix3d e = edgesOf(solid.rest, solid.tetrahedra[t]);
      const Matrix3d inverse = e.inverse();
      Eigen::Matrix<double, 3, 4> linear;
      for (int k = 0; k < 3; ++k) linear.col(k + 1) = inverse.row(k).transpose();
      linear.col(0) = -inverse.colwise().sum().transpose();
      const ElasticMaterial& m = load.materials[load.materials.size() > 1 ? t : 0];
      element.mu = 0.5 * m.young / (1 + m.poisson);
      element.lambda = m.young * m.poisson / ((1 + m.poisson) * (1 - 2 * m.poisson));
      element.volume = e.determinant() / 6 / double(kPoints);
      for (std::size_t p = 0; p < kPoints; ++p) {
        element.points[p].gradients = Points<kNodes>::gradients(linear, p);
      }
    }
    makePattern();
  }

  double energy(const Vectors& x) const override {
    double sum = 0;
    for (const Element& element : elements_) {
      for (const Point& point : element.points) {
        const Matrix3d f = deformation(element, point, x);
        const Matrix3d s = rotationOf(f).transpose() * f;
        const double trace = s.trace() - 3;
        sum += element.volume *
               (element.mu * (s - Matrix3d::Identity()).squaredNorm() + 0.5 * element.lambda * trace * trace);
      }
    }
    return sum;
  }
  VectorXd forces(const Vectors& x) override {
    VectorXd out = VectorXd::Zero(unknowns());
    for (Element& element : elements_) {
      for (Point& point : element.points) {
        const Matrix3d f = deformation(element, point, x);
        point.take(f);
        const Matrix3d stress =
            2 * element.mu * (f - point.rotation) + element.lambda * (point.stretch.sum() - 3) * point.rotation;
        for (std::size_t a = 0; a < kNodes; ++a) {
          addTo(element.node[a], Vector3d(-element.volume * stress * point.gradients.col(int(a))), out);
        }
      }
    }
    return out;
  }
  const std::vector<Matrix3d>& matrix(bool positive) override {
    std::fill(blocks_.begin(), blocks_.end(), Matrix3d::Zero());
    for (std::size_t t = 0; t < elements_.size(); ++t) {
      const Blocks blocks = blocksOf(elements_[t], positive);
      for (std::size_t i = 0; i < kNodes * kNodes; ++i) {
        if (slots_[t][i] != formats::kNone) blocks_[slots_[t][i]] += blocks[i];
      }
    }
    return blocks_;
  }
  VectorXd times(const Vectors& direction) const override {
    VectorXd out = VectorXd::Zero(unknowns());
    for (const Element& element : elements_) {
      const Blocks blocks = blocksOf(element, true);
      for (std::size_t a = 0; a < kNodes; ++a) {
        Vector3d sum = Vector3d::Zero();
        for (std::size_t b = 0; b < kNodes; ++b) sum += blocks[kNodes * a + b] * direction[element.node[b]];
        addTo(element.node[a], sum, out);
      }
    }
    return out;
  }

 private:
  static constexpr std::size_t kPoints = Points<kNodes>::kCount;
  using Blocks = std::array<Matrix3d, kNodes * kNodes>;
  struct Point {
    typename Points<kNodes>::Gradients gradients;
    Matrix3d rotation;
    Vector3d stretch;
    std::array<Matrix3d, 3> turns;

    void take(const Matrix3d& f) {
      rotation = rotationOf(f);
      const Matrix3d s = rotation.transpose() * f;
      const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(0.5 * (s + s.transpose()));
      stretch = eigen.eigenvalues();
      const Matrix3d u = rotation * eigen.eigenvectors();
      for (int k = 0; k < 3; ++k) {
        // The three ways of turning, |Q| = 1: about each axis of the stretch.
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        turns[std::size_t(k)] =
            (u.col(j) * eigen.eigenvectors().col(i).transpose() - u.col(i) * eigen.eigenvectors().col(j).transpose()) /
            std::numbers::sqrt2;
      }
    }
  };
  struct Element {
    std::array<std::uint32_t, kNodes> node{};
    double volume = 0, mu = 0, lambda = 0;  // of a point
    std::array<Point, kPoints> points;
  };

  static Matrix3d deformation(const Element& element, const Point& point, const Vectors& x) {
    Matrix3d f = x[element.node[0]] * point.gradients.col(0).transpose();
    for (std::size_t a = 1; a < kNodes; ++a) f += x[element.node[a]] * point.gradients.col(int(a)).transpose();
    return f;
  }
  static Blocks blocksOf(const Element& element, bool positive) {
    Blocks blocks;
    blocks.fill(Matrix3d::Zero());
    for (const Point& point : element.points) {
      std::array<typename Points<kNodes>::Gradients, 3> turned;
      std::array<double, 3> more{};
      for (int k = 0; k < 3; ++k) {
        const double sum = point.stretch[(k + 1) % 3] + point.stretch[(k + 2) % 3];
        const double stress = element.lambda * (point.stretch.sum() - 3) - 2 * element.mu;
        double value = std::abs(sum) < 1e-9 ? -1e300 : 2 * stress / sum;
        if (positive || std::abs(sum) < 1e-9) value = std::max(value, 2 * (kLeastStiffness - 1) * element.mu);
        more[std::size_t(k)] = element.volume * value;
        turned[std::size_t(k)] = point.turns[std::size_t(k)] * point.gradients;
      }
      const typename Points<kNodes>::Gradients rotated = point.rotation * point.gradients;
      const Eigen::Matrix<double, int(kNodes), int(kNodes)> along =
          2 * element.mu * element.volume * point.gradients.transpose() * point.gradients;
      for (int a = 0; a < int(kNodes); ++a) {
        for (int b = a; b < int(kNodes); ++b) {
          Matrix3d& block = blocks[kNodes * std::size_t(a) + std::size_t(b)];
          block += element.lambda * element.volume * rotated.col(a) * rotated.col(b).transpose();
          block.diagonal().array() += along(a, b);
          for (std::size_t k = 0; k < 3; ++k) {
            block += more[k] * turned[k].col(a) * turned[k].col(b).transpose();
          }
        }
      }
    }
    for (std::size_t a = 0; a < kNodes; ++a) {
      for (std::size_t b = 0; b < a; ++b) blocks[kNodes * a + b] = blocks[kNodes * b + a].transpose();
    }
    return blocks;
  }
  void makePattern() {
    std::vector<std::uint64_t> places;
    for (const Element& element : elements_) {
      for (const std::uint32_t a : element.node) {
        for (const std::uint32_t b : element.node) {
          const int row = number_[a], column = number_[b];
          if (column >= 0 && row >= column) places.push_back((std::uint64_t(column) << 32) | std::uint32_t(row));
        }
      }
    }
    std::sort(places.begin(), places.end());
    places.erase(std::unique(places.begin(), places.end()), places.end());
    for (const std::uint64_t place : places) {
      while (pattern_.columns() <= place >> 32) pattern_.first.push_back(pattern_.row.size());
      pattern_.row.push_back(std::uint32_t(place));
      pattern_.first.back() = pattern_.row.size();
    }
    blocks_.resize(places.size());
    slots_.resize(elements_.size());
    for (std::size_t t = 0; t < elements_.size(); ++t) {
      for (std::size_t a = 0; a < kNodes; ++a) {
        for (std::size_t b = 0; b < kNodes; ++b) {
          const int row = number_[elements_[t].node[a]], column = number_[elements_[t].node[b]];
          std::uint32_t& slot = slots_[t][kNodes * a + b];
          slot = formats::kNone;
          if (column < 0 || row < column) continue;
          const std::uint64_t place = (std::uint64_t(column) << 32) | std::uint32_t(row);
          slot = std::uint32_t(std::lower_bound(places.begin(), places.end(), place) - places.begin());
        }
      }
    }
  }

  std::vector<Element> elements_;
  std::vector<Matrix3d> blocks_;
  std::vector<std::array<std::uint32_t, kNodes * kNodes>> slots_;
};

std::unique_ptr<LoadedSolid> loadedSolid(const ElasticSolid& solid, const ElasticLoad& load) {
  if (solid.middles.empty()) return std::make_unique<LoadedElements<4>>(solid, load);
  return std::make_unique<LoadedElements<10>>(solid, load);
}

// Displacement of a target's nodes.
double rmsOf(const ElasticTarget& target, const Vectors& x, const Vectors& rest) {
  double sum = 0;
  for (const std::uint32_t v : target.nodes) sum += (x[v] - rest[v]).squaredNorm();
  return std::sqrt(sum / double(target.nodes.size()));
}

// By what a load becomes stronger such that a step leads to a target. \param own the step by free node. \param more
// what it is longer by when the load is stronger by 1.
double strongerFor(const ElasticTarget& target, const LoadedSolid& loaded, const Vectors& x, const Vectors& rest,
                   const VectorXd& own, const VectorXd& more) {
  double a = 0, b = 0, c = 0;  // a by² + 2 b by + c = 0
  for (const std::uint32_t v : target.nodes) {
    Vector3d there = x[v] - rest[v], way = Vector3d::Zero();
    if (const int number = loaded.number(v); number >= 0) {
      there += own.segment<3>(3 * number);
      way = more.segment<3>(3 * number);
    }
    a += way.squaredNorm();
    b += there.dot(way);
    c += there.squaredNorm() - target.rms * target.rms;
  }
  const double square = b * b - a * c;
  if (square <= 0) return -b / a;
  return b < 0 ? -c / (b - std::sqrt(square)) : -c / (b + std::sqrt(square));
}

}  // namespace

Equilibrium equilibrium(const ElasticSolid& solid, std::vector<Vector3d> start, double poisson, double tolerance) {
  Equilibrium result;
  if (start.empty()) start = solid.rest;
  result.positions = std::move(start);
  Vectors& x = result.positions;
  Elasticity elasticity(solid, poisson);
  Vectors f(x.size()), next(x.size());
  // The first step moves held vertices; the others follow by the derivative at the start.
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

Equilibrium equilibrium(const ElasticSolid& solid, const ElasticLoad& load, const std::vector<Vector3d>& start,
                        double tolerance, const ElasticTarget* target) {
  Equilibrium result;
  result.positions = start.empty() ? solid.rest : start;
  Vectors& x = result.positions;
  const std::unique_ptr<LoadedSolid> loaded = loadedSolid(solid, load);
  SparseCholesky solver(loaded->pattern());
  const VectorXd pull = loaded->load();
  VectorXd elastic = loaded->forces(x);
  // Held nodes move first; the others follow by the derivative at the start.
  Vectors step(x.size(), Vector3d::Zero());
  double held = 0;
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (solid.prescribed[v]) step[v] = *solid.prescribed[v] - x[v];
    held = std::max(held, step[v].norm());
  }
  if (held > 0) {
    solver.factorize(loaded->matrix(true));
    const VectorXd free = solver.solve(elastic + pull - loaded->times(step));
    for (std::size_t v = 0; v < x.size(); ++v) x[v] += step[v];
    loaded->move(free, 1, x);
    elastic = loaded->forces(x);
  }
  double energy = loaded->energy(x);
  for (result.iterations = 1; result.iterations < kMostIterations; ++result.iterations) {
    result.stable = solver.factorize(loaded->matrix(false));
    if (!result.stable) solver.factorize(loaded->matrix(true));
    MatrixXd right(pull.size(), target != nullptr ? 2 : 1);
    right.col(0) = elastic + result.strength * pull;
    if (target != nullptr) right.col(1) = pull;
    const MatrixXd steps = solver.solve(right);
    VectorXd direction = steps.col(0);
    if (target != nullptr) {
      const double by = strongerFor(*target, *loaded, x, solid.rest, steps.col(0), steps.col(1)),
                   stronger = std::clamp(result.strength + by, result.strength / kMostStronger,
                                         result.strength * kMostStronger);
      direction += (stronger - result.strength) * steps.col(1);
      result.strength = stronger;
    }
    const double slope = -(elastic + result.strength * pull).dot(direction);
    const double before = energy - result.strength * loaded->work(x);
    Vectors next;
    double factor = 1, found = 0;
    const auto take = [&] {
      next = x;
      loaded->move(direction, factor, next);
      energy = loaded->energy(next);
      found = energy - result.strength * loaded->work(next);
    };
    take();
    for (int i = 0; i < kMostHalvings; ++i) {
      // Differences that are rounding's do not count.
      if (found <= before + 1e-4 * factor * slope + 1e-13 * std::abs(before)) break;
      factor *= 0.5;
      take();
    }
    // Where eigenvalues were left out, steps are short.
    for (int i = 0; !result.stable && factor >= 1 && i < kMostDoublings; ++i) {
      const Vectors shorter = next;
      const double shorter_energy = energy, shorter_found = found;
      factor *= 2;
      take();
      if (found < shorter_found) continue;
      next = shorter;
      energy = shorter_energy;
      break;
    }
    double furthest = 1e-300, change = 0;
    for (std::size_t v = 0; v < x.size(); ++v) {
      change = std::max(change, (next[v] - x[v]).norm());
      furthest = std::max(furthest, (next[v] - solid.rest[v]).norm());
    }
    x = std::move(next);
    elastic = loaded->forces(x);
    result.residual = change / furthest;
    const bool there =
        target == nullptr || std::abs(rmsOf(*target, x, solid.rest) / target->rms - 1) < kTargetTolerance;
    if (result.residual < tolerance && there) break;
  }
  return result;
}

ElasticState elasticState(const ElasticSolid& solid, const ElasticLoad& load, const std::vector<Vector3d>& positions) {
  const std::unique_ptr<LoadedSolid> loaded = loadedSolid(solid, load);
  ElasticState state;
  const VectorXd forces = loaded->forces(positions) + loaded->load();
  state.energy = loaded->energy(positions) - loaded->work(positions);
  for (std::size_t v = 0; v < positions.size(); ++v) {
    const int number = loaded->number(v);
    state.gradient.push_back(number < 0 ? Vector3d(Vector3d::Zero()) : Vector3d(-forces.segment<3>(3 * number)));
  }
  state.hessian.setZero(loaded->unknowns(), loaded->unknowns());
  const std::vector<Matrix3d>& blocks = loaded->matrix(false);
  const BlockPattern& pattern = loaded->pattern();
  for (std::size_t c = 0; c < pattern.columns(); ++c) {
    for (std::size_t i = pattern.first[c]; i < pattern.first[c + 1]; ++i) {
      const auto row = 3 * Eigen::Index(pattern.row[i]), column = 3 * Eigen::Index(c);
      state.hessian.block<3, 3>(row, column) = blocks[i];
      state.hessian.block<3, 3>(column, row) = blocks[i].transpose();
    }
  }
  return state;
}

double lowestFrequency(const ElasticSolid& solid, const std::vector<ElasticMaterial>& materials,
                       const std::vector<double>& masses) {
  const ElasticLoad load{materials, {}};
  const std::unique_ptr<LoadedSolid> loaded = loadedSolid(solid, load);
  loaded->forces(solid.rest);
  SparseCholesky solver(loaded->pattern());
  solver.factorize(loaded->matrix(true));
  VectorXd mass(loaded->unknowns());
  for (std::size_t v = 0; v < masses.size(); ++v) {
    if (loaded->number(v) >= 0) mass.segment<3>(3 * loaded->number(v)).setConstant(masses[v]);
  }
  // Some push with a part in every mode.
  VectorXd mode(loaded->unknowns());
  for (Eigen::Index i = 0; i < mode.size(); ++i) mode[i] = 1 + 0.5 * std::sin(double(i));
  double omega2 = 0;
  for (int i = 0; i < kMostInverse; ++i) {
    const VectorXd weighted = mass.cwiseProduct(mode);
    const VectorXd next = solver.solve(weighted);
    const double quotient = next.dot(weighted) / next.dot(mass.cwiseProduct(next));
    mode = next / next.norm();
    const bool done = std::abs(quotient - omega2) < 1e-9 * quotient;
    omega2 = quotient;
    if (done) break;
  }
  return std::sqrt(omega2) / (2 * std::numbers::pi);
}

}  // namespace sinew::tools
