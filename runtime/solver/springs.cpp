// SPDX-License-Identifier: MIT
#include "runtime/solver/springs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <new>

#include "runtime/geometry/rotation.h"
#include "runtime/interact/picked_point.h"

namespace sinew::internal {
namespace {

/// How far a piece's weight draws its pins from their targets at most where it is too soft to carry it, diagonals.
constexpr double kSagging = 2e-3;

bool isIn(const Field& field, std::uint32_t vertex) {
  return vertex >= field.first_vertex && vertex - field.first_vertex < field.vertex_count;
}

/// Whether the field itself holds a set: its functions and tethers do.
bool isDriven(const Piece& piece, const PinSet& set) {
  if (!piece.state.held || set.source == formats::kNone) return false;
  const Field& field = piece.field();
  for (std::uint32_t j = 0; j < field.driven; j += 4) {
    if (field.functions[j].pin_set == set.source) return true;
  }
  return false;
}

/// phi_j at a picked point.
double valueAt(const Field& field, const PickedPoint& point, std::uint32_t j) {
  double sum = 0;
  for (std::size_t c = 0; c < 4; ++c) {
    if (point.weight[c] != 0) sum += point.weight[c] * double(field.valueAt(point.vertex[c] - field.first_vertex, j));
  }
  return sum;
}

/// The hold by which a set holds the piece; null: springs do.
const Hold* holdOf(const Piece& piece, std::uint32_t set) {
  for (const Hold& hold : piece.holds) {
    if (hold.set == set) return &hold;
  }
  return nullptr;
}

/// Calls visit(vertex, weight, target, set) for each vertex of the piece that springs of one firmness hold; set is the pin set's number
/// or kNone.
template <class Visit>
void forEachHeld(const Body& body, const Piece& piece, const Visit& visit) {
  const Field& field = piece.field();
  for (const Pin& pin : body.pins) {
    if (isIn(field, pin.vertex)) visit(pin.vertex, 1.0, Vector3d(asVector(pin.at).cast<double>()), formats::kNone);
  }
  for (std::uint32_t s = 0; s < body.pin_sets.size(); ++s) {
    const PinSet& set = body.pin_sets[s];
    if (isDriven(piece, set)) continue;
    const Hold* const hold = holdOf(piece, s);
    const std::uint32_t* next = hold != nullptr ? hold->shape->vertices.begin() : nullptr;
    const std::uint32_t* const end = hold != nullptr ? hold->shape->vertices.end() : nullptr;
    for (const PinnedVertex& vertex : set.vertices) {
      if (next != end && vertex.vertex - field.first_vertex == *next) {
        ++next;
        continue;
      }
      if (isIn(field, vertex.vertex)) visit(vertex.vertex, double(vertex.weight), placeOf(set.at, vertex.local), s);
    }
  }
}

/// kappa of a vertex that is held firmly: the field's foundation, and no softer than what carries the weight. 0:
/// nothing is held.
double firmness(const Body& body, const Piece& piece, const SpringStep& step) {
  double held = 0;
  forEachHeld(body, piece, [&held](std::uint32_t, double weight, const Vector3d&, std::uint32_t) { held += weight; });
  if (!(held > 0)) return 0;
  const double carries = step.weight / (kSagging * double(body.package().info().diagonal) * held);
  return std::max(double(step.stiffness) * piece.field().foundation, carries);
}

/// Calls visit(phi, kappa, target, set) for each spring; phi(j) gives the row, set is the pin set's number or kNone.
template <class Visit>
void forEachSpring(const Body& body, const Piece& piece, const SpringStep& step, double firm, const Visit& visit) {
  const Field& field = piece.field();
  forEachHeld(body, piece, [&](std::uint32_t vertex, double weight, const Vector3d& target, std::uint32_t set) {
    const std::uint32_t i = vertex - field.first_vertex;
    visit([&field, i](std::uint32_t j) { return double(field.valueAt(i, j)); }, firm * weight, target, set);
  });
  for (const Pick& pick : body.picks) {
    const PickedPoint point = pickedPoint(body, pick.visual_vertex);
    if (!isIn(field, point.vertex[0])) continue;
    // The mass that a pull of this frequency moves; critically damped: kappa (t - x) - c v, v = (x - x_old) / h.
    const double omega = 2 * M_PI * double(pick.frequency_hz);
    double answer = 0;
    Vector3d old = step.center;
    for (std::uint32_t j = 0; j < field.k; ++j) {
      const double phi = valueAt(field, point, j);
      old += phi * (piece.state.z[j] - double(field.functions[j].one) * step.center);
      if (j >= field.driven) {
        answer += phi * phi / (1 + double(step.stiffness) * double(field.functions[j].stiffness) / (omega * omega));
      }
    }
    if (!(answer > 0)) continue;
    const double kappa = omega * omega / answer, damper = 2 * omega / answer / step.h;
    const Vector3d target = (kappa * reachOf(body, pick, old, kappa) + damper * old) / (kappa + damper);
    visit([&](std::uint32_t j) { return valueAt(field, point, j); }, kappa + damper, target, formats::kNone);
  }
}

/// Sets a hold's targets and its axes: those of the rotation by which its vertices come nearest to the rest shape.
void aim(const Body& body, const PinSet& set, const Field& field, const HoldShape& shape, Hold& hold) {
  const std::size_t held = shape.vertices.size();
  hold.targets.resize(4 * std::size_t(shape.rank));
  Vector3d mean = Vector3d::Zero(), rest_mean = Vector3d::Zero();
  for (const bool summed : {false, true}) {
    Matrix3d moment = Matrix3d::Zero();
    std::size_t i = 0;
    for (const PinnedVertex& vertex : set.vertices) {
      if (i == held || vertex.vertex - field.first_vertex != shape.vertices[i]) continue;
      const Vector3d local = asVector(vertex.local).cast<double>();
      const Vector3d rest = asVector(body.vertices()[vertex.vertex].rest_position).cast<double>();
      moment += (local - mean) * (rest - rest_mean).transpose();
      if (!summed) {
        mean += local;
        rest_mean += rest;
      }
      for (std::uint32_t q = 0; q < shape.rank && summed; ++q) {
        const double weight = shape.weights[held * q + i];
        double* const target = hold.targets.data() + 4 * std::size_t(q);
        target[0] += weight;
        Eigen::Map<Vector3d>(target + 1) += weight * local;
      }
      ++i;
    }
    if (!summed) {
      mean /= double(held);
      rest_mean /= double(held);
      continue;
    }
    const double scale = moment.cwiseAbs().maxCoeff();
    if (!(scale > 0)) continue;
    geometry::Quaternion q = geometry::kIdentityQuaternion;
    geometry::nearestRotation(Matrix3((moment / scale).cast<float>()), q);
    hold.material =
        Eigen::Quaterniond(double(q[0]), double(q[1]), double(q[2]), double(q[3])).normalized().toRotationMatrix();
  }
}

Matrix3d rotationOf(const RigidTransform& at) {
  Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(at.rotation[std::size_t(i)]);
  return rotation;
}

/// Where a hold's patterns are off their targets, in the world. \param z coefficients.
Vector3d offOf(const Hold& hold, const RigidTransform& at, const Field& field, std::uint32_t pattern,
               const Vector3d& center, const ConstCoefficientMap& z) {
  const Vector3d position = asVector(at.position).cast<double>();
  Vector3d off = hold.one(pattern) * (center - position) - rotationOf(at) * hold.arm(pattern);
  const float* const row = hold.shape->rows.data() + std::size_t(field.k) * pattern;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    off += double(row[j]) * (z.row(j).transpose() - double(field.functions[j].one) * center);
  }
  return off;
}

/// What a hold pulls at its patterns. \param off 3 rank: where they are off, in; the pull, out; in the world.
void pullOf(const Hold& hold, float stiffness, const Matrix3d& frame, std::span<Vector3d> off) {
  const std::uint32_t rank = hold.shape->rank, count = 3 * rank;
  std::array<double, 3 * kMostPatterns> way;
  for (std::uint32_t q = 0; q < rank; ++q) Eigen::Map<Vector3d>(way.data() + 3 * q) = frame.transpose() * off[q];
  for (std::uint32_t q = 0; q < rank; ++q) {
    Vector3d pull = Vector3d::Zero();
    for (std::uint32_t a = 0; a < 3; ++a) {
      const float* const row = hold.shape->stiffness.data() + std::size_t(count) * (3 * q + a);
      for (std::uint32_t i = 0; i < count; ++i) pull[int(a)] += double(row[i]) * way[i];
    }
    off[q] = double(stiffness) * (frame * pull);
  }
}

}  // namespace

void findHolds(Body& body) noexcept {
  for (Piece& piece : body.pieces) {
    piece.holds.clear();
    piece.springs_firm = -1;
    piece.system.h = 0;
    const Field& field = piece.field();
    for (std::uint32_t s = 0; s < body.pin_sets.size(); ++s) {
      const PinSet& set = body.pin_sets[s];
      if (isDriven(piece, set)) continue;
      try {
        Array<std::uint32_t> vertices(body.pin_sets.memory());
        for (const PinnedVertex& vertex : set.vertices) {
          if (vertex.weight == 1 && isIn(field, vertex.vertex)) vertices.push_back(vertex.vertex - field.first_vertex);
        }
        if (vertices.empty()) continue;
        auto shape = body.asset->holdShapes().find(body.package(), field, {vertices.data(), vertices.size()});
        if (shape->rank == 0) continue;
        Hold hold(body.pin_sets.memory());
        hold.set = s;
        aim(body, set, field, *shape, hold);
        hold.shape = std::move(shape);
        piece.holds.push_back(std::move(hold));
      } catch (const std::bad_alloc&) {
        continue;
      }
    }
  }
}

void tetherPull(const Field& field, const SpringStep& step, const ConstCoefficientMap& z, std::span<Vector3d> pull) {
  std::fill(pull.begin(), pull.end(), Vector3d::Zero());
  if (field.tethers == nullptr) return;
  // The matrix is symmetric: its row i is what coefficient i pulls.
  for (std::uint32_t i = 0; i < field.k; ++i) {
    const float* const row = field.tethers + std::size_t(field.k) * i;
    const Vector3d arm = double(step.stiffness) * (z.row(i).transpose() - double(field.functions[i].one) * step.center);
    for (std::size_t j = 0; j < pull.size(); ++j) pull[j] += double(row[j]) * arm;
  }
}

bool hasSprings(const Body& body, const Piece& piece) {
  if (piece.field().tethers != nullptr) return true;
  bool held = false;
  forEachHeld(body, piece, [&held](auto&&...) { held = true; });
  if (held || piece.holds.size() > 0) return true;
  for (const Pick& pick : body.picks) {
    if (isIn(piece.field(), pickedPoint(body, pick.visual_vertex).vertex[0])) return true;
  }
  return false;
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
      pull += row[j] * (y.row(j).transpose() - double(field.functions[j].one) * step.center);
    }
    pull *= kappa;
    for (std::uint32_t j = 0; j < k; ++j) scratch.external[j] += row[j] * pull;
    if (made) return;
    for (std::uint32_t i = 0; i < k; ++i) {
      for (std::uint32_t j = 0; j < k; ++j) piece.springs[std::size_t(k) * i + j] += kappa * row[i] * row[j];
    }
  });
  piece.springs_firm = firm;
  for (Hold& hold : piece.holds) {
    const RigidTransform& at = body.pin_sets[hold.set].at;
    const Matrix3d frame = rotationOf(at) * hold.material;
    for (int i = 0; i < 9; ++i) hold.frame[i] = float(frame.data()[i]);
    std::array<Vector3d, kMostPatterns> pull;
    for (std::uint32_t q = 0; q < hold.shape->rank; ++q) pull[q] = offOf(hold, at, field, q, step.center, y);
    pullOf(hold, step.stiffness, frame, pull);
    for (std::uint32_t q = 0; q < hold.shape->rank; ++q) {
      const float* const weights = hold.shape->rows.data() + std::size_t(k) * q;
      for (std::uint32_t j = 0; j < k; ++j) scratch.external[j] += double(weights[j]) * pull[q];
    }
  }
  for (std::uint32_t j = 0; j < k; ++j) {
    for (std::uint32_t c = 0; c < 3; ++c) scratch.residual[4 * j + c] = float(scratch.external[j][c]);
    scratch.residual[4 * j + 3] = 0;
  }
  for (std::size_t i = 0; i < std::size_t(k) * k; ++i) scratch.springs[i] = float(piece.springs[i]);
}

void addReactions(Body& body, const Piece& piece, const SpringStep& step, std::span<const Vector3d> pull) {
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
        at += phi(j) * (piece.state.z[j] - double(field.functions[j].one) * step.center);
      }
      add(body.pin_sets[set], kappa * (at - target), target);
    };
    forEachSpring(body, piece, step, firm, react);
  }
  for (const Hold& hold : piece.holds) {
    PinSet& set = body.pin_sets[hold.set];
    const Matrix3d rotation = rotationOf(set.at), frame = rotation * hold.material;
    const ConstCoefficientMap z = piece.z();
    std::array<Vector3d, kMostPatterns> pulls;
    for (std::uint32_t q = 0; q < hold.shape->rank; ++q) pulls[q] = offOf(hold, set.at, field, q, step.center, z);
    pullOf(hold, step.stiffness, frame, pulls);
    for (std::uint32_t q = 0; q < hold.shape->rank; ++q) {
      set.force_sum += hold.one(q) * pulls[q];
      set.torque_sum += (rotation * hold.arm(q)).cross(pulls[q]);
    }
  }
  if (pull.empty()) return;
  for (PinSet& set : body.pin_sets) {
    if (!isDriven(piece, set)) continue;
    const Vector3d origin = asVector(set.at.position).cast<double>();
    const Matrix3d rotation = rotationOf(set.at);
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
