// SPDX-License-Identifier: MIT
#include "runtime/solver/held_modes.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "runtime/solver/dense.h"

namespace sinew::internal {
namespace {

/// Rounds of simultaneous iteration (Bauer 1957). A mode of eigenvalue l is as much purer in each as l + s is below
/// that of the next, s the shift. Modes of nearly one frequency stay mixed, and decay alike.
constexpr int kModeRounds = 16;
/// The shift s, of the free piece's lowest eigenvalue: the matrix is (H + s) / s, for holds may leave motions open,
/// whose eigenvalue is 0.
constexpr double kShift = 1e-2;

/// Rigid motions, and a row of theirs.
constexpr std::uint32_t kRigid = 6;
using RigidRow = Eigen::Map<Eigen::Matrix<double, kRigid, 1>>;

/// Orthonormal rigid motions of the rest shape. \param[out] rows 3 k
void findRigid(const Field& field, double* rows) {
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const double one = field.oneOf(j);
    const Vector3d arm = field.restOf(j) - one * field.rest_center;
    for (int c = 0; c < 3; ++c) {
      RigidRow row(rows + std::size_t(kRigid) * (3 * j + std::uint32_t(c)));
      row.setZero();
      row[c] = one;
      for (int about = 0; about < 3; ++about) row[3 + about] = Vector3d::Unit(about).cross(arm)[c];
    }
  }
  const auto vector = [&](std::uint32_t m) {
    return Eigen::Map<Eigen::VectorXd, 0, Eigen::InnerStride<kRigid>>(rows + m, Eigen::Index(3) * field.k);
  };
  for (std::uint32_t m = 0; m < kRigid; ++m) {
    for (std::uint32_t other = 0; other < m; ++other) vector(m) -= vector(other).dot(vector(m)) * vector(other);
    vector(m) /= vector(m).norm();
  }
}

/// Of a mode's part that is no rigid motion, weighed by the functions' decay. \param rigid rows of findRigid()
double decayOf(const Field& field, double* rigid, const double* mode) {
  const auto row = [rigid](std::size_t i) { return RigidRow(rigid + kRigid * i); };
  Eigen::Matrix<double, kRigid, 1> share = Eigen::Matrix<double, kRigid, 1>::Zero();
  const std::size_t n = 3 * std::size_t(field.k);
  for (std::size_t i = 0; i < n; ++i) share += mode[i] * row(i);
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double own = mode[i] - share.dot(row(i));
    sum += 4 * M_PI * double(field.functions[i / 3].damping_hz) * own * own;
  }
  return sum;
}

/// K - R (K R)^T - (K R) R^T + R (R^T K R) R^T is added to a lower triangle: the stiffness K, which rigid motions R do
/// not feel to the last digit. \param pulls scratch, as many rows
void addStiffness(const Field& field, double* rigid, double* pulls, double* matrix) {
  const std::uint32_t n = 3 * field.k;
  const auto row = [](double* of, std::size_t i) { return RigidRow(of + kRigid * i); };
  Eigen::Matrix<double, kRigid, kRigid> inner = Eigen::Matrix<double, kRigid, kRigid>::Zero();
  for (std::uint32_t i = 0; i < n; ++i) {
    RigidRow pull = row(pulls, i);
    pull.setZero();
    for (std::uint32_t j = 0; j < n; ++j) {
      pull += double(field.stiffness[std::size_t(field.stride) * i + j]) * row(rigid, j);
    }
    inner += row(rigid, i) * pull.transpose();
  }
  for (std::uint32_t j = 0; j < n; ++j) {
    const Eigen::Matrix<double, kRigid, 1> back = inner * row(rigid, j) - row(pulls, j);
    for (std::uint32_t i = j; i < n; ++i) {
      matrix[strideOf(n) * j + i] += double(field.stiffness[std::size_t(field.stride) * i + j]) +
                                     row(rigid, i).dot(back) - row(pulls, i).dot(row(rigid, j));
    }
  }
}

}  // namespace

std::size_t matrixOfHeldModes(const Field& field) {
  const std::size_t n = 3 * std::size_t(field.k);
  return n * strideOf(n);
}

std::size_t scratchOfHeldModes(const Field& field) { return 3 * std::size_t(field.k) * 2 * kRigid; }

void findHeldModes(const Field& field, Holds& holds, double* matrix, double* scratch) {
  const std::uint32_t n = 3 * field.k;
  holds.modes.clear();
  holds.lacking.clear();
  const double lowest = 2 * M_PI * field.lowest_hz, shift = kShift * lowest * lowest;
  if (field.driven > 0 || n < kHeldModes || !(shift > 0)) return;
  const std::size_t stride = strideOf(n);
  double *const rigid = scratch, *const pulls = rigid + std::size_t(n) * kRigid;
  findRigid(field, rigid);
  addStiffness(field, rigid, pulls, matrix);
  for (std::uint32_t j = 0; j < n; ++j) {
    double* const column = matrix + stride * j;
    Column(column + j, n - j) /= shift;
    column[j] += 1;
  }
  factorize(matrix, n);
  holds.modes.resize(std::size_t(n) * kHeldModes);
  std::uint32_t state = 1;
  for (double& number : holds.modes) {
    state = state * 1664525U + 1013904223U;
    number = double(state) / 4294967296.0 - 0.5;
  }
  const auto mode = [&holds, n](std::uint32_t m) { return Column(holds.modes.data() + std::size_t(n) * m, n); };
  for (int round = 0; round < kModeRounds; ++round) {
    for (std::uint32_t m = 0; m < kHeldModes; ++m) {
      Column own = mode(m);
      solveLower(matrix, n, own.data());
      solveUpper(matrix, n, own.data());
      for (int twice = 0; twice < 2; ++twice) {
        for (std::uint32_t other = 0; other < m; ++other) own -= mode(other).dot(own) * mode(other);
      }
      own /= own.norm();
    }
  }
  holds.lacking.resize(kHeldModes);
  for (std::uint32_t m = 0; m < kHeldModes; ++m) {
    double value = 0;  // x^T A x by the factor: A = L L^T
    for (std::uint32_t j = 0; j < n; ++j) {
      const double sum = ConstColumn(matrix + stride * j + j, n - j).dot(mode(m).tail(n - j));
      value += sum * sum;
    }
    holds.lacking[m] =
        std::max(0.0, 2 * std::sqrt(std::max(0.0, shift * (value - 1))) - decayOf(field, rigid, mode(m).data()));
  }
}

}  // namespace sinew::internal
