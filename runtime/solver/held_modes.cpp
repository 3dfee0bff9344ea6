// SPDX-License-Identifier: MIT
#include "runtime/solver/held_modes.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/solver/dense.h"

namespace sinew::internal {
namespace {

/// Vectors that modes are found among, and rounds (subspace iteration, Bathe 1971): a mode comes as
/// much nearer in each as its eigenvalue is below the first one that has no vector.
constexpr std::uint32_t kModes = kHeldModes, kVectors = 16;
constexpr int kSubspaceRounds = 6;
/// Added to the matrix, of the free piece's lowest eigenvalue: holds may leave motions open.
constexpr double kShift = 1e-2;

using Small = Eigen::Matrix<double, kVectors, kVectors>;
/// A row of the vectors.
using Row = Eigen::Map<Eigen::Matrix<double, kVectors, 1>>;
using Vector = Eigen::Map<Eigen::VectorXd, 0, Eigen::InnerStride<kVectors>>;

/// Part of a vector that is no rigid motion, weighed by the functions' decay.
double decayOf(const Field& field, const double* mode) {
  Vector3d way = Vector3d::Zero(), twist = way;
  Matrix3d moment = Matrix3d::Zero();
  const auto armOf = [&field](std::uint32_t j) {
    return Vector3d(field.restOf(j) - field.oneOf(j) * field.rest_center);
  };
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Eigen::Map<const Vector3d> at(mode + std::size_t{3} * j);
    way += field.oneOf(j) / field.ones * at;
    twist += armOf(j).cross(at);
    moment += armOf(j) * armOf(j).transpose();
  }
  const Matrix3d inertia = moment.trace() * Matrix3d::Identity() - moment;
  const Vector3d omega = inertia.inverse() * twist;
  double sum = 0;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Eigen::Map<const Vector3d> at(mode + std::size_t{3} * j);
    const Vector3d own = at - field.oneOf(j) * way - omega.cross(armOf(j));
    sum += 4 * M_PI * double(field.functions[j].damping_hz) * own.squaredNorm();
  }
  return sum;
}

}  // namespace

std::size_t scratchOfHeldModes(const Field& field) {
  const std::size_t n = 3 * std::size_t(field.k);
  return n * (strideOf(n) + kVectors);
}

void findHeldModes(const Field& field, Holds& holds, double* scratch) {
  const std::uint32_t n = 3 * field.k;
  holds.modes.clear();
  holds.lacking.clear();
  if (holds.count == 0 || field.driven > 0 || n < kVectors) return;
  const std::size_t stride = strideOf(n);
  double *const a = scratch, *const x = a + stride * n;
  const auto entry = [&](std::size_t i, std::size_t j) {
    return double(field.stiffness[field.stride * i + j]) + double(holds.by_function[field.stride * i + j]);
  };
  const double lowest = 2 * M_PI * field.lowest_hz, shift = kShift * lowest * lowest;
  if (!(shift > 0)) return;
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t i = j; i < n; ++i) a[stride * j + i] = entry(i, j) / shift + (i == j ? 1 : 0);
  }
  factorize(a, n);
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < std::size_t(n) * kVectors; ++i) {
    state = state * 1664525U + 1013904223U;
    x[i] = double(state) / 4294967296.0 - 0.5;
  }
  const auto row = [x](std::size_t i) { return Row(x + kVectors * i); };
  const auto vector = [x, n](std::uint32_t m) { return Vector(x + m, n); };
  for (int round = 0; round < kSubspaceRounds; ++round) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const double* const column = a + stride * j;
      row(j) /= column[j];
      for (std::uint32_t i = j + 1; i < n; ++i) row(i) -= column[i] * row(j);
    }
    for (std::uint32_t j = n; j-- > 0;) {
      const double* const column = a + stride * j;
      for (std::uint32_t i = j + 1; i < n; ++i) row(j) -= column[i] * row(i);
      row(j) /= column[j];
    }
    for (std::uint32_t m = 0; m < kVectors; ++m) {
      for (int twice = 0; twice < 2; ++twice) {
        for (std::uint32_t other = 0; other < m; ++other) {
          vector(m) -= vector(other).dot(vector(m)) * vector(other);
        }
      }
      vector(m) /= vector(m).norm();
    }
  }
  Small form = Small::Zero();
  for (std::uint32_t i = 0; i < n; ++i) {
    Eigen::Matrix<double, kVectors, 1> pull = Eigen::Matrix<double, kVectors, 1>::Zero();
    for (std::uint32_t j = 0; j < n; ++j) pull += entry(i, j) * row(j);
    form += pull * row(i).transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Small> solver(form);
  holds.modes.resize(std::size_t(n) * kModes);
  holds.lacking.resize(kModes);
  for (std::uint32_t m = 0; m < kModes; ++m) {
    double* const mode = holds.modes.begin() + std::size_t(n) * m;
    for (std::uint32_t i = 0; i < n; ++i) mode[i] = row(i).dot(solver.eigenvectors().col(int(m)));
    holds.lacking[m] = std::max(0.0, 2 * std::sqrt(std::max(0.0, solver.eigenvalues()[m])) - decayOf(field, mode));
  }
}

void dampOnHolds(const Field& field, const Holds& holds, const HoldsMotion& motion, double ratio, CoefficientMap v) {
  if (holds.lacking.empty() || !(ratio > 0)) return;
  const std::size_t n = 3 * std::size_t(field.k);
  const Matrix3d turning = (motion.after.turned - motion.before.turned) / motion.h;
  const Vector3d moving = (motion.after.moved - motion.before.moved) / motion.h;
  std::array<double, kModes> amplitudes{};
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d led = turning * field.restOf(j) + field.oneOf(j) * moving;
    const Vector3d local = motion.after.turned.transpose() * (v.row(j).transpose() - led);
    for (std::uint32_t m = 0; m < kModes; ++m) {
      amplitudes[m] += local.dot(Eigen::Map<const Vector3d>(holds.modes.data() + n * m + std::size_t{3} * j));
    }
  }
  for (std::uint32_t m = 0; m < kModes; ++m) amplitudes[m] *= 1 - std::exp(-ratio * holds.lacking[m] * motion.h);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    Vector3d lost = Vector3d::Zero();
    for (std::uint32_t m = 0; m < kModes; ++m) {
      lost += amplitudes[m] * Eigen::Map<const Vector3d>(holds.modes.data() + n * m + std::size_t{3} * j);
    }
    v.row(j) -= (motion.after.turned * lost).transpose();
  }
}

}  // namespace sinew::internal
