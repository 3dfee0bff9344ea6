// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/finite_elements.h"

#include <Eigen/Eigenvalues>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
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

using SparseMatrix = Eigen::SparseMatrix<double>;
using Eigen::VectorXd;

// Unknowns up to which a system is factorized; beyond, conjugate gradients are faster and need less memory.
constexpr Eigen::Index kMostFactorized = 40000;
constexpr double kGradientTolerance = 1e-8;
constexpr int kMostHalvings = 40;
constexpr int kMostInverse = 200;
// Share of 2 mu that replaces negative eigenvalues of a tetrahedron.
constexpr double kLeastStiffness = 1e-8;

// Energy, forces and second derivative of a loaded solid, the latter as one matrix over the free vertices.
class LoadedSolid {
 public:
  LoadedSolid(const ElasticSolid& solid, const ElasticLoad& load) : solid_(solid), load_(load) {
    const std::size_t count = solid.tetrahedra.size();
    gradients_.resize(count);
    volume_.resize(count);
    mu_.resize(count);
    lambda_.resize(count);
    states_.resize(count);
    for (std::size_t t = 0; t < count; ++t) {
      const Matrix3d e = edges(solid.rest, solid.tetrahedra[t]);
      const Matrix3d inverse = e.inverse();
      volume_[t] = e.determinant() / 6;
      for (int k = 0; k < 3; ++k) gradients_[t].col(k + 1) = inverse.row(k).transpose();
      gradients_[t].col(0) = -inverse.colwise().sum().transpose();
      const ElasticMaterial& m = load.materials[load.materials.size() > 1 ? t : 0];
      mu_[t] = 0.5 * m.young / (1 + m.poisson);
      lambda_[t] = m.young * m.poisson / ((1 + m.poisson) * (1 - 2 * m.poisson));
    }
    number_.assign(solid.rest.size(), -1);
    for (std::size_t v = 0; v < solid.rest.size(); ++v) {
      if (!solid.prescribed[v]) number_[v] = free_++;
    }
    makePattern();
  }

  Eigen::Index unknowns() const { return 3 * Eigen::Index(free_); }
  double energy(const Vectors& x) const {
    double sum = 0;
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Matrix3d f = deformation(t, x);
      const Matrix3d s = rotationOf(f).transpose() * f;
      const double trace = s.trace() - 3;
      sum += volume_[t] * (mu_[t] * (s - Matrix3d::Identity()).squaredNorm() + 0.5 * lambda_[t] * trace * trace);
    }
    for (std::size_t v = 0; v < load_.forces.size(); ++v) sum -= load_.forces[v].dot(x[v] - solid_.rest[v]);
    return sum;
  }
  // Minus the energy's gradient by free vertex; takes the state for matrix() and times().
  VectorXd forces(const Vectors& x) {
    VectorXd out = VectorXd::Zero(unknowns());
    for (std::size_t v = 0; v < load_.forces.size(); ++v) addTo(v, load_.forces[v], out);
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      State& state = states_[t];
      const Matrix3d f = deformation(t, x);
      state.rotation = rotationOf(f);
      const Matrix3d s = state.rotation.transpose() * f;
      const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(0.5 * (s + s.transpose()));
      state.stretch = eigen.eigenvalues();
      const Matrix3d u = state.rotation * eigen.eigenvectors();
      for (int k = 0; k < 3; ++k) {
        // The three ways of turning, |Q| = 1: about each axis of the stretch.
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        state.turns[std::size_t(k)] =
            (u.col(j) * eigen.eigenvectors().col(i).transpose() - u.col(i) * eigen.eigenvectors().col(j).transpose()) /
            std::numbers::sqrt2;
      }
      const Matrix3d stress =
          2 * mu_[t] * (f - state.rotation) + lambda_[t] * (state.stretch.sum() - 3) * state.rotation;
      for (int a = 0; a < 4; ++a) {
        addTo(solid_.tetrahedra[t][std::size_t(a)], Vector3d(-volume_[t] * stress * gradients_[t].col(a)), out);
      }
    }
    return out;
  }
  // The second derivative. \param positive negative eigenvalues of tetrahedra at 0.
  const SparseMatrix& matrix(bool positive) {
    std::fill(matrix_.valuePtr(), matrix_.valuePtr() + matrix_.nonZeros(), 0.0);
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Blocks blocks = blocksOf(t, positive);
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) {
          const Slot& slot = slots_[t][4 * a + b];
          if (slot.first < 0) continue;
          for (int column = 0; column < 3; ++column) {
            for (int row = 0; row < 3; ++row) {
              matrix_.valuePtr()[slot.first + column * slot.column + row] += blocks[4 * a + b](row, column);
            }
          }
        }
      }
    }
    return matrix_;
  }
  // The second derivative (positive) times a direction of all vertices, by free vertex.
  VectorXd times(const Vectors& direction) const {
    VectorXd out = VectorXd::Zero(unknowns());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      const Blocks blocks = blocksOf(t, true);
      for (std::size_t a = 0; a < 4; ++a) {
        Vector3d sum = Vector3d::Zero();
        for (std::size_t b = 0; b < 4; ++b) sum += blocks[4 * a + b] * direction[solid_.tetrahedra[t][b]];
        addTo(solid_.tetrahedra[t][a], sum, out);
      }
    }
    return out;
  }
  void move(const VectorXd& by, double factor, Vectors& x) const {
    for (std::size_t v = 0; v < x.size(); ++v) {
      if (number_[v] >= 0) x[v] += factor * by.segment<3>(3 * number_[v]);
    }
  }
  int number(std::size_t vertex) const { return number_[vertex]; }

 private:
  using Blocks = std::array<Matrix3d, 16>;
  struct State {
    Matrix3d rotation;
    Vector3d stretch;
    std::array<Matrix3d, 3> turns;
  };
  // Of a block in the matrix's values: its first, and from column to column. Vertices' columns have whole blocks.
  struct Slot {
    std::ptrdiff_t first = -1, column = 0;
  };

  Matrix3d deformation(std::size_t t, const Vectors& x) const {
    const auto& v = solid_.tetrahedra[t];
    Matrix3d f = x[v[0]] * gradients_[t].col(0).transpose();
    for (int a = 1; a < 4; ++a) f += x[v[std::size_t(a)]] * gradients_[t].col(a).transpose();
    return f;
  }
  void addTo(std::size_t vertex, const Vector3d& what, VectorXd& out) const {
    if (number_[vertex] >= 0) out.segment<3>(3 * number_[vertex]) += what;
  }
  Blocks blocksOf(std::size_t t, bool positive) const {
    const State& state = states_[t];
    Blocks blocks;
    std::array<double, 3> more{};
    for (int k = 0; k < 3; ++k) {
      const double sum = state.stretch[(k + 1) % 3] + state.stretch[(k + 2) % 3];
      const double stress = lambda_[t] * (state.stretch.sum() - 3) - 2 * mu_[t];
      double value = std::abs(sum) < 1e-9 ? -1e300 : 2 * stress / sum;
      if (positive || std::abs(sum) < 1e-9) value = std::max(value, 2 * (kLeastStiffness - 1) * mu_[t]);
      more[std::size_t(k)] = value;
    }
    for (int a = 0; a < 4; ++a) {
      const Vector3d ga = gradients_[t].col(a), ra = state.rotation * ga;
      for (int b = 0; b < 4; ++b) {
        const Vector3d gb = gradients_[t].col(b);
        Matrix3d& block = blocks[4 * std::size_t(a) + std::size_t(b)];
        block = 2 * mu_[t] * ga.dot(gb) * Matrix3d::Identity() + lambda_[t] * ra * (state.rotation * gb).transpose();
        for (std::size_t k = 0; k < 3; ++k) {
          block += more[k] * (state.turns[k] * ga) * (state.turns[k] * gb).transpose();
        }
        block *= volume_[t];
      }
    }
    return blocks;
  }
  void makePattern() {
    std::vector<Eigen::Triplet<double>> entries;
    entries.reserve(volume_.size() * 144);
    for (const auto& tetrahedron : solid_.tetrahedra) {
      for (const std::uint32_t a : tetrahedron) {
        for (const std::uint32_t b : tetrahedron) {
          if (number_[a] < 0 || number_[b] < 0) continue;
          for (int i = 0; i < 9; ++i) entries.emplace_back(3 * number_[a] + i % 3, 3 * number_[b] + i / 3, 0.0);
        }
      }
    }
    matrix_.resize(unknowns(), unknowns());
    matrix_.setFromTriplets(entries.begin(), entries.end());
    slots_.resize(volume_.size());
    for (std::size_t t = 0; t < volume_.size(); ++t) {
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) {
          const int row = number_[solid_.tetrahedra[t][a]], column = number_[solid_.tetrahedra[t][b]];
          if (row < 0 || column < 0) continue;
          const int* outer = matrix_.outerIndexPtr();
          const int* begin = matrix_.innerIndexPtr() + outer[3 * column];
          const int* end = matrix_.innerIndexPtr() + outer[3 * column + 1];
          slots_[t][4 * a + b] = {outer[3 * column] + (std::lower_bound(begin, end, 3 * row) - begin),
                                  outer[3 * column + 1] - outer[3 * column]};
        }
      }
    }
  }

  const ElasticSolid& solid_;
  const ElasticLoad& load_;
  std::vector<Eigen::Matrix<double, 3, 4>> gradients_;
  std::vector<double> volume_, mu_, lambda_;
  std::vector<State> states_;
  std::vector<int> number_;  // of the free vertices; -1 of prescribed ones
  int free_ = 0;
  SparseMatrix matrix_;
  std::vector<std::array<Slot, 16>> slots_;
};

// Solves with the second derivative at the state that was last taken.
class NewtonSolver {
 public:
  explicit NewtonSolver(LoadedSolid& solid) : solid_(solid), factorized_(solid.unknowns() <= kMostFactorized) {}

  bool factorizes() const { return factorized_; }
  // \param whole with the derivative as it is; else with that of positive tetrahedra. \return whether it is positive;
  // true where that is not known.
  bool factorize(bool whole) {
    const SparseMatrix& matrix = solid_.matrix(!whole);
    if (!factorized_) {
      gradients_.setTolerance(kGradientTolerance);
      gradients_.compute(matrix);
      return true;
    }
    if (!analyzed_) direct_.analyzePattern(matrix);
    analyzed_ = true;
    direct_.factorize(matrix);
    return direct_.info() == Eigen::Success && direct_.vectorD().minCoeff() > 0;
  }
  VectorXd solve(const VectorXd& b) const {
    if (factorized_) return direct_.solve(b);
    return gradients_.solve(b);
  }

 private:
  LoadedSolid& solid_;
  bool factorized_, analyzed_ = false;
  Eigen::SimplicialLDLT<SparseMatrix> direct_;
  Eigen::ConjugateGradient<SparseMatrix, Eigen::Lower | Eigen::Upper, Eigen::IncompleteCholesky<double>> gradients_;
};

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
                        double tolerance) {
  Equilibrium result;
  result.positions = start.empty() ? solid.rest : start;
  Vectors& x = result.positions;
  LoadedSolid loaded(solid, load);
  NewtonSolver solver(loaded);
  VectorXd f = loaded.forces(x);
  // Held vertices move first; the others follow by the derivative at the start.
  Vectors step(x.size(), Vector3d::Zero());
  double held = 0;
  for (std::size_t v = 0; v < x.size(); ++v) {
    if (solid.prescribed[v]) step[v] = *solid.prescribed[v] - x[v];
    held = std::max(held, step[v].norm());
  }
  if (held > 0) {
    solver.factorize(false);
    const VectorXd free = solver.solve(f - loaded.times(step));
    for (std::size_t v = 0; v < x.size(); ++v) x[v] += step[v];
    loaded.move(free, 1, x);
    f = loaded.forces(x);
  }
  double energy = loaded.energy(x);
  for (result.iterations = 1; result.iterations < kMostIterations; ++result.iterations) {
    const bool positive = solver.factorize(true);
    result.stable = positive && solver.factorizes();
    VectorXd direction;
    if (positive) direction = solver.solve(f);
    if (!positive || !(f.dot(direction) >= 0)) {
      solver.factorize(false);
      direction = solver.solve(f);
    }
    const double slope = -f.dot(direction);
    Vectors next = x;
    double factor = 1, found = 0;
    for (int halving = 0; halving < kMostHalvings; ++halving, factor *= 0.5) {
      next = x;
      loaded.move(direction, factor, next);
      found = loaded.energy(next);
      // Differences that are rounding's do not count.
      if (found <= energy + 1e-4 * factor * slope + 1e-13 * std::abs(energy)) break;
    }
    double furthest = 1e-300, change = 0;
    for (std::size_t v = 0; v < x.size(); ++v) {
      change = std::max(change, (next[v] - x[v]).norm());
      furthest = std::max(furthest, (next[v] - solid.rest[v]).norm());
    }
    x = std::move(next);
    energy = found;
    f = loaded.forces(x);
    result.residual = change / furthest;
    if (result.residual < tolerance) break;
  }
  return result;
}

double lowestFrequency(const ElasticSolid& solid, const std::vector<ElasticMaterial>& materials,
                       const std::vector<double>& masses) {
  const ElasticLoad load{materials, {}};
  LoadedSolid loaded(solid, load);
  loaded.forces(solid.rest);
  NewtonSolver solver(loaded);
  solver.factorize(true);
  VectorXd mass(loaded.unknowns());
  for (std::size_t v = 0; v < masses.size(); ++v) {
    if (loaded.number(v) >= 0) mass.segment<3>(3 * loaded.number(v)).setConstant(masses[v]);
  }
  // Some push with a part in every mode.
  VectorXd mode(loaded.unknowns());
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

std::vector<double> nodalVolumes(const ElasticSolid& solid) {
  std::vector<double> volumes(solid.rest.size(), 0);
  for (const auto& t : solid.tetrahedra) {
    const double quarter = edges(solid.rest, t).determinant() / 24;
    for (const std::uint32_t v : t) volumes[v] += quarter;
  }
  return volumes;
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
