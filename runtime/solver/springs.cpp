// SPDX-License-Identifier: MIT
#include "runtime/solver/springs.h"

#include <algorithm>
#include <cmath>

#include "runtime/interact/picked_point.h"
#include "runtime/solver/holds.h"

namespace sinew::internal {
namespace {

/// How far a piece's weight draws its pins from their targets at most where it is too soft to carry it, diagonals.
constexpr double kSagging = 2e-3;

bool touches(const Field& field, const PickedPoint& point) { return isIn(field, point.vertex[0]); }

/// kappa of a vertex that is held firmly: the field's foundation, and no softer than what carries the weight. 0:
/// nothing is held.
double firmness(const Body& body, const Piece& piece, const SpringStep& step) {
  double held = 0;
  if (piece.field().residual_modes > 0) return 0;  // holds know better
  forEachPinned(body, piece, [&held](const HeldPoint& point) { held += point.weight; });
  if (!(held > 0)) return 0;
  const double carries = step.weight / (kSagging * double(body.package().info().diagonal) * held);
  return std::max(double(step.stiffness) * piece.field().foundation, carries);
}

/// Calls visit(phi, kappa, target, set) for each spring; phi(j) gives the row, set is the pin set's number or kNone.
template <class Visit>
void forEachSpring(const Body& body, const Piece& piece, const SpringStep& step, double firm, const Visit& visit) {
  const Field& field = piece.field();
  forEachPinned(body, piece, [&](const HeldPoint& held) {
    if (!(firm > 0)) return;
    visit([&field, &held](std::uint32_t j) { return valueAt(field, held.at, j); }, firm * held.weight,
          held.target(body), held.set);
  });
  for (const Pick& pick : body.picks) {
    const PickedPoint& point = pick.point;
    if (!touches(field, point)) continue;
    Vector3d old = step.center, way = Vector3d::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) {
      const double phi = valueAt(field, point, j);
      old += phi * (piece.state.z[j] - field.oneOf(j) * step.center);
      way += phi * step.h * piece.state.v[j];
    }
    const PickSpring spring = springOf(piece, pick, step.stiffness);
    if (!(spring.kappa > 0)) continue;
    // Critically damped: kappa (t - x) - c v, v = (x - old) / h, is one spring to a place between the two. Where that
    // would pull with more than it may, the chord of its energy, linear from there on (Huber 1964), is as firm as it
    // takes from where the point is about to come.
    const double damper = spring.damper / step.h, both = spring.kappa + damper;
    const Vector3d target = (spring.kappa * asVector(pick.target).cast<double>() + damper * old) / both;
    const double most = mostForceOf(body, pick) / (target - old - way).norm();
    visit([&](std::uint32_t j) { return valueAt(field, point, j); }, std::min(both, most), target, formats::kNone);
  }
}

/// Pull of a triple of rows, in the world, N.
Vector3d pullOf(const Piece& piece, const SpringStep& step, std::size_t row) {
  Vector3d pull;
  for (int c = 0; c < 3; ++c) pull[c] = answerOf(piece.holds, piece.ways, row + std::size_t(c));
  return double(step.stiffness) * (piece.holds_turned * pull);
}

RigidPlace placeOfHolds(const Body& body, const Piece& piece, const SpringStep& step) {
  return placeOfHolds(body, piece, 1, {step.turned, step.moved});
}

}  // namespace

void tetherPull(const Field& field, const SpringStep& step, const ConstCoefficientMap& z, std::span<Vector3d> pull) {
  std::fill(pull.begin(), pull.end(), Vector3d::Zero());
  if (field.tethers == nullptr) return;
  // The matrix is symmetric: its row i is what coefficient i pulls.
  for (std::uint32_t i = 0; i < field.k; ++i) {
    const float* const row = field.tethers + std::size_t(field.k) * i;
    const Vector3d arm = double(step.stiffness) * (z.row(i).transpose() - field.oneOf(i) * step.center);
    for (std::size_t j = 0; j < pull.size(); ++j) pull[j] += double(row[j]) * arm;
  }
}

bool hasSprings(const Body& body, const Piece& piece) {
  if (piece.field().tethers != nullptr) return true;
  const Field& field = piece.field();
  const auto holds = [&field](std::uint32_t vertex, float weight) { return weight > 0 && isIn(field, vertex); };
  return std::any_of(body.pins.begin(), body.pins.end(), [&](const Pin& pin) { return holds(pin.vertex, 1); }) ||
         std::any_of(body.picks.begin(), body.picks.end(),
                     [&](const Pick& pick) { return holds(pick.point.vertex[0], 1); }) ||
         std::any_of(body.pin_sets.begin(), body.pin_sets.end(), [&](const PinSet& set) {
           return !isDriven(piece, set) &&
                  std::any_of(set.vertices.begin(), set.vertices.end(),
                              [&](const PinnedVertex& pinned) { return holds(pinned.vertex, pinned.weight); });
         });
}

void prepareSprings(const Body& body, Piece& piece, const SpringStep& step, const ConstCoefficientMap& y,
                    MinimizeScratch& scratch) {
  const Field& field = piece.field();
  const std::uint32_t k = field.k;
  const double firm = firmness(body, piece, step);
  const bool made = piece.springs_firm == firm && body.picks.empty();
  if (!made) {
    piece.springs.resize(std::size_t(k) * k);
    std::fill(piece.springs.begin(), piece.springs.end(), 0.0);
    const std::size_t entries = field.tethers != nullptr ? std::size_t(k) * k : 0;
    for (std::size_t i = 0; i < entries; ++i) piece.springs[i] = double(step.stiffness) * double(field.tethers[i]);
    piece.system.h = 0;
  }
  tetherPull(field, step, y, {scratch.external.data(), k});
  Array<double>& row = piece.row;
  row.resize(k);
  forEachSpring(body, piece, step, firm, [&](const auto& phi, double kappa, const Vector3d& target, std::uint32_t) {
    Vector3d pull = step.center - target;
    for (std::uint32_t j = 0; j < k; ++j) {
      row[j] = phi(j);
      pull += row[j] * (y.row(j).transpose() - field.oneOf(j) * step.center);
    }
    pull *= kappa;
    for (std::uint32_t j = 0; j < k; ++j) scratch.external[j] += row[j] * pull;
    if (made) return;
    for (std::uint32_t i = 0; i < k; ++i) {
      for (std::uint32_t j = 0; j < k; ++j) piece.springs[std::size_t(k) * i + j] += kappa * row[i] * row[j];
    }
  });
  piece.springs_firm = firm;
  if (piece.holds.count > 0) {
    const RigidPlace place = placeOfHolds(body, piece, step);
    piece.holds_turned = place.turned;
    findWays(body, piece, y, place, 1, piece.ways);
    for (std::uint32_t j = 0; j < k; ++j) scratch.external[j] += pullOf(piece, step, 3 * std::size_t(j));
  }
  for (std::uint32_t j = 0; j < k; ++j) {
    const Vector3d pull = step.frame.transpose() * scratch.external[j];
    for (std::uint32_t c = 0; c < 3; ++c) scratch.residual[4 * j + c] = float(pull[int(c)]);
    scratch.residual[4 * j + 3] = 0;
  }
  for (std::size_t i = 0; i < std::size_t(k) * k; ++i) scratch.springs[i] = float(piece.springs[i]);
}

void addReactions(Body& body, Piece& piece, const SpringStep& step, std::span<const Vector3d> pull) {
  const Field& field = piece.field();
  const auto add = [](PinSet& set, const Vector3d& force, const Vector3d& place) {
    set.force_sum += force;
    set.torque_sum += (place - asVector(set.at.position).cast<double>()).cross(force);
  };
  const double firm = firmness(body, piece, step);
  if (firm > 0) {
    const auto react = [&](const auto& phi, double kappa, const Vector3d& target, std::uint32_t set) {
      if (set == formats::kNone) return;
      Vector3d at = step.center;
      for (std::uint32_t j = 0; j < field.k; ++j) {
        at += phi(j) * (piece.state.z[j] - field.oneOf(j) * step.center);
      }
      add(body.pin_sets[set], kappa * (at - target), target);
    };
    forEachSpring(body, piece, step, firm, react);
  }
  if (piece.holds.count > 0) {
    findWays(piece, std::as_const(piece).z(), placeOfHolds(body, piece, step), piece.ways);
    for (std::size_t i = 0; i < piece.holds.sets.size(); ++i) {
      const Holds::Set& held = piece.holds.sets[i];
      PinSet& set = body.pin_sets[held.number];
      const Matrix3d axes = asMatrix(set.at.rotation).cast<double>();
      const std::size_t first = 3 * (std::size_t(field.k) + 4 * i);
      const Vector3d force = pullOf(piece, step, first);
      set.force_sum += force;
      set.torque_sum += (axes * held.local_mean).cross(force);
      for (std::size_t c = 0; c < 3; ++c) {  // the set's axes, which the forces' moments along them pull at
        set.torque_sum += axes.col(int(c)).cross(pullOf(piece, step, first + 3 * (c + 1)));
      }
    }
  }
  if (pull.empty()) return;
  for (PinSet& set : body.pin_sets) {
    if (!isDriven(piece, set)) continue;
    const Vector3d origin = asVector(set.at.position).cast<double>();
    Matrix3d rotation;
    for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(set.at.rotation[std::size_t(i)]);
    for (std::uint32_t j = 0; j < field.driven; ++j) {
      if (field.functions[j].pin_set != set.source) continue;
      // x = ... + phi_j z_j, z = position for the first function, columns of the rotation for the others.
      const std::uint32_t monomial = field.functions[j].monomial;
      if (monomial == 0) {
        add(set, -pull[j], origin);
      } else {
        set.torque_sum -= rotation.col(int(monomial) - 1).cross(pull[j]);
      }
    }
  }
}

}  // namespace sinew::internal
