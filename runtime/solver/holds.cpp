// SPDX-License-Identifier: MIT
#include "runtime/solver/holds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "runtime/geometry/rotation.h"
#include "runtime/interact/picked_point.h"
#include "runtime/kernels/kernels.h"
#include "runtime/solver/dense.h"
#include "runtime/solver/held_modes.h"
#include "runtime/solver/minimize.h"

namespace sinew::internal {
namespace {

/// Of the spread of held vertices (and squared, of the diagonal): what leaves a direction of their rotation open.
constexpr double kOpen = 1e-3;

/// Of Holds::by_hold.
std::size_t columnsOf(std::size_t sets, std::size_t single) { return (12 * sets + 3 * single + 1 + 7) / 8 * 8; }

/// Points that makeHolds() adds at once.
constexpr std::uint32_t kBatch = 16;

/// Numbers that makeHolds() needs beside its result. \param answered, m scalar functions, of the field and sets, of all
std::size_t scratchOf(std::size_t r, std::size_t answered, std::size_t m) {
  const std::size_t stride = strideOf(r);
  return stride * (r + 3 * m + 1 + 3 * kBatch) + m * (m + 3 + 1) + kBatch * (answered + std::max(answered, r));
}

Vector3d restOf(const Body& body, std::uint32_t vertex) {
  return asVector(body.vertices()[vertex].rest_position).cast<double>();
}

Vector3d restOf(const Body& body, const PickedPoint& point) {
  Vector3d at = Vector3d::Zero();
  for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
    at += point.weight[c] * restOf(body, point.vertex[c]);
  }
  return at;
}

/// Where a pin wants its vertex. \param part of the last step that has passed, 0..1
Vector3d targetOf(const Pin& pin, double part) {
  const Vector3d at_end = asVector(pin.at).cast<double>();
  return part < 1 ? Vector3d((1 - part) * asVector(pin.before).cast<double>() + part * at_end) : at_end;
}

/// \param part of the last step that has passed, 0..1
RigidPlace placeOfSet(const PinSet& set, double part) {
  const RigidTransform at = part < 1 ? between(set.before, set.at, part) : set.at;
  return {asMatrix(at.rotation).cast<double>(), asVector(at.position).cast<double>()};
}

/// \pre its number alone is set
void findShape(const Body& body, const Field& field, Holds::Set& set) {
  const auto forEach = [&](const auto& visit) {
    for (const PinnedVertex& pinned : body.pin_sets[set.number].vertices) {
      if (!(pinned.weight > 0) || !isIn(field, pinned.vertex)) continue;
      visit(double(pinned.weight), asVector(pinned.local).cast<double>(), restOf(body, pinned.vertex));
    }
  };
  forEach([&](double weight, const Vector3d& local, const Vector3d& rest) {
    set.weight += weight;
    set.local_mean += weight * local;
    set.rest_mean += weight * rest;
  });
  set.local_mean /= set.weight;
  set.rest_mean /= set.weight;
  forEach([&](double weight, const Vector3d& local, const Vector3d& rest) {
    const Vector3d arm = rest - set.rest_mean;
    set.moment += weight * (local - set.local_mean) * arm.transpose();
    set.spread += weight * arm.squaredNorm();
  });
  const Matrix3d open = kOpen * set.spread * Matrix3d::Identity();
  if (set.spread > 0) set.turned = geometry::nearestRotation(Matrix3d(set.moment.transpose() + open));
}

/// Calls visit(weight, value) for each vertex of a point; value(c, m) is an axis of one of its residual modes.
template <class Visit>
void forEachVertex(const Field& field, const PickedPoint& point, const Visit& visit) {
  const std::uint32_t r = field.residual_modes;
  for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
    if (!isIn(field, point.vertex[c])) continue;
    const std::uint32_t v = point.vertex[c] - field.first_vertex;
    const std::int16_t* const of_vertex = field.residual + std::size_t{24} * r * (v / 8) + v % 8;
    visit(point.weight[c] * double(field.residual_scale), [of_vertex, r](std::uint32_t axis, std::uint32_t m) {
      return double(of_vertex[8 * (std::size_t(r) * axis + m)]);
    });
  }
}

}  // namespace

double valueAt(const Field& field, const PickedPoint& point, std::uint32_t j) {
  double sum = 0;
  for (std::size_t c = 0; c < point.weight.size() && point.weight[c] != 0; ++c) {
    if (!isIn(field, point.vertex[c])) continue;
    sum += point.weight[c] * double(field.valueAt(point.vertex[c] - field.first_vertex, j));
  }
  return sum;
}

namespace {

/// Mean compliance in the three directions of a point in the residual modes, m/N; 0 where they are not known.
double ownCompliance(const Field& field, const PickedPoint& point) {
  double sum = 0;
  for (std::uint32_t m = 0; m < field.residual_modes; ++m) {
    Vector3d mode = Vector3d::Zero();
    forEachVertex(field, point, [&](double weight, const auto& value) {
      mode += weight * Vector3d(value(0, m), value(1, m), value(2, m));
    });
    sum += mode.squaredNorm();
  }
  return sum / 3;
}

}  // namespace

PickSpring springOf(const Piece& piece, const Pick& pick, float stiffness) {
  const Field& field = piece.field();
  const double omega = 2 * M_PI * double(pick.frequency_hz);
  double answer = 0;
  for (std::uint32_t j = field.driven; j < field.k; ++j) {
    const double phi = valueAt(field, pick.point, j);
    answer += phi * phi / (1 + double(stiffness) * double(field.functions[j].stiffness) / (omega * omega));
  }
  if (!(answer > 0)) return {};
  const double kappa = omega * omega / answer;
  return {kappa / (1 + kappa * ownCompliance(field, pick.point) / double(stiffness)), 2 * omega / answer};
}

bool isDriven(const Piece& piece, const PinSet& set) {
  if (!piece.state.held || set.source == formats::kNone) return false;
  const Field& field = piece.field();
  for (std::uint32_t j = 0; j < field.driven; j += 4) {
    if (field.functions[j].pin_set == set.source) return true;
  }
  return false;
}

void reserveHolds(Body& body, Piece& piece) {
  const Field& field = *piece.free;
  if (field.residual_modes == 0) return;
  std::size_t single = 0;
  bool held = false;
  for (const Pin& pin : body.pins) single += isIn(field, pin.vertex) ? 1U : 0U;
  for (const PinSet& set : body.pin_sets) {
    for (const PinnedVertex& vertex : set.vertices) held = held || isIn(field, vertex.vertex);
  }
  if (single == 0 && !held) return;
  single = std::bit_ceil(single);  // pins come one by one
  const std::size_t sets = body.pin_sets.size(), rows = 3 * std::size_t(field.k) + 12 * sets + field.residual_modes;
  piece.holds.sets.reserve(sets);
  piece.holds.by_function.reserve(rows * field.stride);
  piece.holds.by_hold.reserve(rows * columnsOf(sets, single));
  for (HoldWays* ways : {&piece.ways, &body.ways}) {
    ways->of_functions.reserve(field.stride);
    ways->of_holds.reserve(columnsOf(sets, single));
  }
  piece.holds.modes.reserve(3 * std::size_t(field.k) * kHeldModes);
  piece.holds.lacking.reserve(kHeldModes);
  piece.holds.scratch = matrixOfHeldModes(field) +
                        std::max(scratchOf(field.residual_modes, field.k + 4 * sets, field.k + 4 * sets + single),
                                 scratchOfHeldModes(field));
}

void reserveHolds(const Piece& piece, MinimizeScratch& scratch) {
  if (scratch.holds.size() < piece.holds.scratch) scratch.holds.resize(piece.holds.scratch);
}

namespace {

// With p the rows of P and d those of D at the held points, A = 1 + sum p p^T / d = L L^T and Y = L^-1 (p / d):
// S = 1 / D - Y^T Y (Woodbury). Rows of functions psi are Psi^T S = psi / d - (Y psi)^T Y, those of the modes
// P^T S = L^-T Y. All offsets are sums of functions: of the field's, of 1 and p about its mean for each set, of one for
// each point of no set, and of e.
void makeHolds(const Body& body, Piece& piece, float stiffness, MinimizeScratch& scratch) {
  const Field& field = piece.field();
  Holds& holds = piece.holds;
  const std::uint32_t r = field.residual_modes, k = field.k;
  holds.count = holds.single = 0;
  holds.stiffness = stiffness;
  holds.sets.clear();
  holds.lacking.clear();
  if (r == 0) return;
  forEachPinned(body, piece, [&](const HeldPoint& held) {
    ++holds.count;
    if (held.set == formats::kNone) {
      ++holds.single;
    } else if (holds.sets.empty() || holds.sets.back().number != held.set) {
      Holds::Set set;
      set.number = held.set;
      findShape(body, field, set);
      holds.sets.push_back(set);
    }
  });
  if (holds.count == 0) return;
  const auto sets = std::uint32_t(holds.sets.size());
  const std::uint32_t answered = k + 4 * sets, m = answered + holds.single;
  const std::size_t stride = strideOf(r);
  double *const of_modes = scratch.holds.data(), *const a = of_modes + matrixOfHeldModes(field),
                *const z = a + stride * r, *const modes = z + stride * (3 * m + 1),
                *const gram = modes + stride * 3 * kBatch, *const off = gram + std::size_t(m) * m,
                *const psi = off + std::size_t{3} * m, *const pulls = psi + m,
                *const factors = pulls + kBatch * answered,
                *const end = factors + kBatch * std::size_t(std::max(answered, r));
  std::fill(a, end, 0.0);
  const auto columnOf = [r, stride](double* of, std::size_t i) { return Column(of + stride * i, r); };
  // A, and sums over points of p psi / d in the place of Y psi, of psi psi / d and of psi e / d.
  for (std::uint32_t i = 0; i < r; ++i) a[(stride + 1) * i] = 1;
  std::array<double, kBatch> firm{};
  std::uint32_t batched = 0, at_set = 0, single = 0;
  const auto modesOf = [&](std::uint32_t point, std::uint32_t axis) {
    return modes + stride * (kBatch * axis + point);
  };
  const auto addBatch = [&] {
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const double* const left = modesOf(0, axis);
      for (std::uint32_t i = 0; i < r; ++i) {
        for (std::uint32_t h = 0; h < kBatch; ++h) factors[kBatch * i + h] = firm[h] * left[stride * h + i];
      }
      for (std::uint32_t i = 0; i < r; i += 8) {  // what the lower triangle needs
        kernels().add_product({std::uint32_t(stride) - i, std::min(8U, r - i), kBatch, left + i, factors + kBatch * i,
                               a + (stride + 1) * i, stride, stride});
      }
      kernels().add_product(
          {std::uint32_t(stride), answered, kBatch, left, pulls, z + stride * axis, stride, 3 * stride});
    }
    std::fill_n(modes, stride * 3 * kBatch, 0.0);
    std::fill_n(pulls, kBatch * answered, 0.0);
    firm.fill(0);
    batched = 0;
  };
  forEachPinned(body, piece, [&](const HeldPoint& held) {
    std::fill_n(psi, m, 0.0);
    for (std::uint32_t j = 0; j < k; ++j) psi[j] = valueAt(field, held.at, j);
    std::uint32_t first = answered + single, last = first + 1;  // of its own functions
    Vector3d e = Vector3d::Zero();
    if (held.set != formats::kNone) {
      while (holds.sets[at_set].number != held.set) ++at_set;
      const Holds::Set& set = holds.sets[at_set];
      const Vector3d local = asVector(held.local).cast<double>() - set.local_mean;
      e = restOf(body, held.at) - set.rest_mean - set.turned * local;
      first = k + 4 * at_set;
      last = first + 4;
      Eigen::Map<Vector3d>(psi + first + 1) = local;
    }
    psi[first] = 1;
    firm[batched] = held.weight / double(field.residual_locals[held.at.vertex[0] - field.first_vertex]);
    forEachVertex(field, held.at, [&](double weight, const auto& value) {
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        double* const to = modesOf(batched, axis);
        for (std::uint32_t i = 0; i < r; ++i) to[i] += weight * value(axis, i);
      }
    });
    const auto add = [&](std::uint32_t i) {
      const double pull = firm[batched] * psi[i];
      if (i < answered) pulls[kBatch * i + batched] = pull;
      Column(gram + std::size_t(m) * i, i + 1) += pull * Column(psi, i + 1);
      for (std::uint32_t c = 0; c < 3; ++c) off[3 * i + c] += pull * e[int(c)];
    };
    for (std::uint32_t i = 0; i < k; ++i) add(i);
    for (std::uint32_t i = first; i < last; ++i) add(i);
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const Column p(modesOf(batched, axis), r);
      if (held.set == formats::kNone) columnOf(z, 3 * std::size_t(first) + axis) = firm[batched] * p;
      columnOf(z, 3 * std::size_t(m)) += firm[batched] * e[int(axis)] * p;
    }
    if (held.set == formats::kNone) ++single;
    if (++batched == kBatch) addBatch();
  });
  addBatch();
  factorize(a, r);
  for (std::uint32_t j = 0; j <= 3 * m; ++j) solveLower(a, r, z + stride * j);
  const std::size_t columns = columnsOf(sets, holds.single), rows = 3 * std::size_t(answered) + r;
  holds.by_hold.resize(rows * columns);
  std::fill(holds.by_hold.begin(), holds.by_hold.end(), 0.0F);
  holds.by_function.resize(rows * field.stride);
  std::fill(holds.by_function.begin(), holds.by_function.end(), 0.0F);
  // The field's functions, then the others, then e.
  const auto entry = [&](std::uint32_t i, std::uint32_t j) -> float& {
    return j < 3 * k ? holds.by_function[std::size_t(field.stride) * i + j] : holds.by_hold[columns * i + (j - 3 * k)];
  };
  for (std::uint32_t i = 0; i < m; ++i) {
    for (std::uint32_t j = 0; j < std::min(i + 1, answered); ++j) {
      for (std::uint32_t c = 0; c < 9; ++c) {
        const std::uint32_t row = 3 * i + c / 3, column = 3 * j + c % 3;
        const double direct = c / 3 == c % 3 ? gram[std::size_t(m) * i + j] : 0;
        const double exact = direct - columnOf(z, row).dot(columnOf(z, column));
        if (i < k && row >= column) of_modes[strideOf(3 * std::size_t(k)) * column + row] = exact;
        const auto answer = float(exact);
        entry(column, row) = answer;
        if (i < answered) entry(row, column) = answer;
      }
    }
  }
  for (std::uint32_t i = 0; i < 3 * answered; ++i) {
    entry(i, 3 * m) = float(off[i] - columnOf(z, i).dot(columnOf(z, 3 * std::size_t(m))));
  }
  for (std::uint32_t j = 0; j <= 3 * m; ++j) {
    solveUpper(a, r, z + stride * j);
    for (std::uint32_t i = 0; i < r; ++i) entry(3 * answered + i, j) = float(z[stride * j + i]);
  }
  findHeldModes(field, holds, of_modes, a);
}

}  // namespace

void prepareHolds(const Body& body, Piece& piece, float stiffness, MinimizeScratch& scratch) {
  if (piece.springs_firm >= 0 && piece.holds.stiffness == stiffness) return;
  makeHolds(body, piece, stiffness, scratch);
  piece.springs_firm = std::numeric_limits<double>::infinity();
}

void findAmplitudes(const Piece& piece, const HoldWays& ways, Array<float>& amplitudes) {
  const std::uint32_t r = piece.field().residual_modes;
  const std::size_t first = piece.holds.by_function.size() / piece.field().stride - r;
  for (std::uint32_t m = 0; m < r; ++m) amplitudes[m] = -float(answerOf(piece.holds, ways, first + m));
}

std::uint32_t findPickAmplitudes(const Body& body, const Piece& piece, const ConstCoefficientMap& z,
                                 const Matrix3d& turned, Array<float>& amplitudes) {
  const Field& field = piece.field();
  std::fill(amplitudes.begin(), amplitudes.end(), 0.0F);
  std::uint32_t picks = 0;
  for (const Pick& pick : body.picks) {
    if (!isIn(field, pick.point.vertex[0])) continue;
    ++picks;
    Vector3d at = Vector3d::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) at += valueAt(field, pick.point, j) * z.row(j).transpose();
    const double kappa = springOf(piece, pick, piece.holds.stiffness).kappa;
    const Vector3d force = turned.transpose() * (kappa * (reachOf(body, pick, at, kappa) - at));
    forEachVertex(field, pick.point, [&](double weight, const auto& value) {
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        for (std::uint32_t m = 0; m < field.residual_modes; ++m) {
          amplitudes[m] += float(weight * value(axis, m) * force[int(axis)] / double(piece.holds.stiffness));
        }
      }
    });
  }
  return picks;
}

PickWindow::PickWindow(const Body& body, const Piece& piece) : body_(body), field_(piece.field()) {
  Vector3d sum = Vector3d::Zero();
  double squared = 0;
  for (std::uint32_t j = field_.driven; j < field_.k; ++j) {
    const Vector3d rest = asVector(field_.functions[j].rest).cast<double>();
    sum += field_.oneOf(j) * rest;
    squared += rest.squaredNorm();
  }
  reach2_ = 12 * (squared / field_.mass - (sum / field_.mass).squaredNorm()) / std::pow(double(field_.k), 2.0 / 3);
}

float PickWindow::operator()(std::uint32_t vertex) const {
  double most = 0;
  for (const Pick& pick : body_.picks) {
    if (!isIn(field_, pick.point.vertex[0])) continue;
    most = std::max(most, 1 - (restOf(body_, vertex) - restOf(body_, pick.point)).squaredNorm() / reach2_);
  }
  return float(most * most);
}

RigidPlace placeOfHolds(const Body& body, const Piece& piece, double part, const RigidPlace& of_piece) {
  // A set counts as one point, and what it is about that.
  const auto forEach = [&](const auto& visit) {
    for (const Pin& pin : body.pins) {
      if (isIn(piece.field(), pin.vertex)) visit(1.0, restOf(body, pin.vertex), targetOf(pin, part));
    }
    for (const Holds::Set& set : piece.holds.sets) {
      const RigidPlace at = placeOfSet(body.pin_sets[set.number], part);
      visit(set.weight, set.rest_mean, Vector3d(at.turned * set.local_mean + at.moved));
    }
  };
  Vector3d rest_mean = Vector3d::Zero(), mean = Vector3d::Zero();
  double weight = 0;
  forEach([&](double w, const Vector3d& rest, const Vector3d& at) {
    rest_mean += w * rest;
    mean += w * at;
    weight += w;
  });
  if (weight == 0) return of_piece;
  rest_mean /= weight;
  mean /= weight;
  Matrix3d moment = Matrix3d::Zero();
  const double size = kOpen * double(body.package().info().diagonal);
  double spread = size * size;
  forEach([&](double w, const Vector3d& rest, const Vector3d& at) {
    const Vector3d arm = rest - rest_mean;
    moment += w * (at - mean) * arm.transpose();
    spread += w * arm.squaredNorm();
  });
  for (const Holds::Set& set : piece.holds.sets) {
    moment += placeOfSet(body.pin_sets[set.number], part).turned * set.moment;
    spread += set.spread;
  }
  const Matrix3d turned = geometry::nearestRotation(Matrix3d(moment + kOpen * spread * of_piece.turned));
  return {turned, mean - turned * rest_mean};
}

void findWays(const Piece& piece, const ConstCoefficientMap& z, const RigidPlace& place, HoldWays& ways) {
  const Field& field = piece.field();
  ways.of_functions.resize(field.stride);
  std::fill(ways.of_functions.begin(), ways.of_functions.end(), 0.0);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const formats::FieldFunction& function = field.functions[j];
    const Vector3d way = place.turned.transpose() * (z.row(j).transpose() - double(function.one) * place.moved);
    for (std::size_t c = 0; c < 3; ++c) ways.of_functions[3 * j + c] = way[int(c)] - double(function.rest[c]);
  }
}

void findWays(const Body& body, const Piece& piece, const ConstCoefficientMap& z, const RigidPlace& place, double part,
              HoldWays& ways) {
  const Field& field = piece.field();
  findWays(piece, z, place, ways);
  const Matrix3d back = place.turned.transpose();
  const auto add = [&ways](const auto& way) {
    for (const double number : way.reshaped()) ways.of_holds.push_back(float(number));
  };
  ways.of_holds.clear();
  for (const Holds::Set& set : piece.holds.sets) {
    const RigidPlace at = placeOfSet(body.pin_sets[set.number], part);
    add(Vector3d(set.rest_mean + back * (place.moved - at.turned * set.local_mean - at.moved)));
    add(Matrix3d(set.turned - back * at.turned));
  }
  for (const Pin& pin : body.pins) {
    if (!isIn(field, pin.vertex)) continue;
    const Vector3d at_place = place.turned * restOf(body, pin.vertex) + place.moved;
    add(Vector3d(back * (at_place - targetOf(pin, part))));
  }
  ways.of_holds.push_back(1);
  ways.of_holds.resize(columnsOf(piece.holds.sets.size(), piece.holds.single));
}

double answerOf(const Holds& holds, const HoldWays& ways, std::size_t row) {
  using Four = Eigen::Array4f;
  const std::size_t stride = ways.of_functions.size(), columns = ways.of_holds.size();
  const float *const of_functions = holds.by_function.data() + stride * row, *const of_holds =
                                                                                 holds.by_hold.data() + columns * row;
  Eigen::Array4d sum = Eigen::Array4d::Zero();
  for (std::size_t i = 0; i < stride; i += 4) {
    sum += Four::Map(of_functions + i).cast<double>() * Eigen::Array4d::Map(ways.of_functions.data() + i);
  }
  Four even = Four::Zero(), odd = Four::Zero();
  for (std::size_t i = 0; i < columns; i += 8) {
    even += Four::Map(of_holds + i) * Four::Map(ways.of_holds.data() + i);
    odd += Four::Map(of_holds + i + 4) * Four::Map(ways.of_holds.data() + i + 4);
  }
  sum += (even + odd).cast<double>();
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace sinew::internal
