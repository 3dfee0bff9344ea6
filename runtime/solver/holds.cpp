// SPDX-License-Identifier: MIT
#include "runtime/solver/holds.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "runtime/geometry/rotation.h"
#include "runtime/interact/picked_point.h"
#include "runtime/kernels/kernels.h"
#include "runtime/solver/minimize.h"

namespace sinew::internal {
namespace {

/// Of the spread of held vertices (and squared, of the diagonal): what leaves a direction of their rotation open.
constexpr double kOpen = 1e-3;

using Column = Eigen::Map<Eigen::VectorXd>;

/// Of Holds::by_hold.
std::size_t columnsOf(std::size_t sets, std::size_t single) { return (12 * sets + 3 * single + 1 + 7) / 8 * 8; }

/// Points that makeHolds() adds at once.
constexpr std::uint32_t kBatch = 16;

/// Of the columns of its matrices.
std::size_t strideOf(std::size_t r) { return (r + 7) / 8 * 8; }

/// Numbers that makeHolds() needs beside its result. \param answered, m scalar functions, of the field and sets, of all
std::size_t scratchOf(std::size_t r, std::size_t answered, std::size_t m) {
  const std::size_t stride = strideOf(r);
  return stride * (r + 3 * m + 1 + 3 * kBatch) + m * (m + 3 + 1) + kBatch * (answered + std::max(answered, r));
}

/// The same of makePickHolds().
std::size_t scratchOfPicks(std::size_t r, std::size_t k, std::size_t picks) {
  return 3 * strideOf(r) * picks + strideOf(picks) * (3 * picks + 2 * k) + picks;
}

/// The lower triangle becomes its Cholesky factor; columns are strideOf(r) apart. Eigen's own takes memory of its own
/// at this size. \pre its eigenvalues are at least 1
void factorize(double* a, std::uint32_t r) {
  for (std::uint32_t j = 0; j < r; ++j) {
    double* const column = a + strideOf(r) * j;
    for (std::uint32_t i = 0; i < j; ++i) {
      const double* const before = a + strideOf(r) * i;
      Column(column + j, r - j) -= before[j] * Eigen::Map<const Eigen::VectorXd>(before + j, r - j);
    }
    Column(column + j, r - j) *= 1 / std::sqrt(std::max(column[j], 1.0));
  }
}

/// x becomes L^-T x.
void solveUpper(const double* factor, std::uint32_t r, double* x) {
  for (std::uint32_t i = r; i-- > 0;) {
    const double* const column = factor + strideOf(r) * i;
    const std::uint32_t left = r - i - 1;
    x[i] = (x[i] - Eigen::Map<const Eigen::VectorXd>(column + i + 1, left).dot(Column(x + i + 1, left))) / column[i];
  }
}

/// x becomes L^-1 x.
void solveLower(const double* factor, std::uint32_t r, double* x) {
  for (std::uint32_t i = 0; i < r; ++i) {
    const double* const column = factor + strideOf(r) * i;
    x[i] /= column[i];
    const std::uint32_t left = r - i - 1;
    Column(x + i + 1, left) -= x[i] * Eigen::Map<const Eigen::VectorXd>(column + i + 1, left);
  }
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

PickSpring springOf(const Piece& piece, const Pick& pick, float stiffness) {
  const Field& field = piece.field();
  const double omega = 2 * M_PI * double(pick.frequency_hz);
  double answer = 0;
  for (std::uint32_t j = field.driven; j < field.k; ++j) {
    const double phi = valueAt(field, pick.point, j);
    answer += phi * phi / (1 + double(stiffness) * double(field.functions[j].stiffness) / (omega * omega));
  }
  return answer > 0 ? PickSpring{omega * omega / answer, 2 * omega / answer} : PickSpring{};
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
  for (const Pick& pick : body.picks) single += isIn(field, pick.point.vertex[0]) ? 1U : 0U;
  if (single == 0 && !held) return;
  single = std::bit_ceil(single);  // pins come one by one
  const std::size_t sets = body.pin_sets.size(), rows = 3 * std::size_t(field.k) + 12 * sets + field.residual_modes;
  piece.holds.sets.reserve(sets);
  piece.holds.by_function.reserve(rows * field.stride);
  piece.holds.by_hold.reserve(rows * columnsOf(sets, single));
  piece.holds.give.reserve(single * single);
  for (HoldWays* ways : {&piece.ways, &body.ways}) {
    ways->of_functions.reserve(field.stride);
    ways->of_holds.reserve(columnsOf(sets, single));
    ways->pulls.reserve(2 * single);
  }
  piece.holds.scratch = std::max(scratchOf(field.residual_modes, field.k + 4 * sets, field.k + 4 * sets + single),
                                 scratchOfPicks(field.residual_modes, field.k, single));
}

void reserveHolds(const Piece& piece, MinimizeScratch& scratch) {
  if (scratch.holds.size() < piece.holds.scratch) scratch.holds.resize(piece.holds.scratch);
}

namespace {

// What picks alone hold turns freely, and S turns with it: an S that is not alike in all directions would turn the
// piece by what no energy pays. So points give way to each other by the mean over directions, tr(p_a p_b^T) / 3, and S
// = (C + 1 / kappa)^-1 is a number for each pair: forces turn nothing, sum C_ab f_a x f_b = 0. With F = kappa, F^1/2 C
// F^1/2 + 1 = L L^T.
void makePickHolds(const Body& body, Piece& piece, float stiffness, MinimizeScratch& scratch) {
  const Field& field = piece.field();
  Holds& holds = piece.holds;
  const std::uint32_t r = field.residual_modes, k = field.k, n = holds.single, m = k + n;
  const std::size_t modes_apart = strideOf(r), apart = strideOf(n);
  double *const p = scratch.holds.data(), *const factor = p + modes_apart * 3 * n, *const psi = factor + apart * n,
                *const forces = psi + apart * m, *const firm = forces + apart * m;
  std::fill(p, firm + n, 0.0);
  holds.give.resize(std::size_t(n) * n);
  std::uint32_t a = 0;
  forEachHeld(body, piece, [&](const HeldPoint& held) {
    firm[a] = std::sqrt(springOf(piece, *held.pick, stiffness).kappa / double(stiffness));
    for (std::uint32_t j = 0; j < k; ++j) psi[apart * j + a] = valueAt(field, held.at, j);
    psi[apart * (k + a) + a] = 1;
    forEachVertex(field, held.at, [&](double weight, const auto& value) {
      for (std::uint32_t axis = 0; axis < 3; ++axis) {
        for (std::uint32_t i = 0; i < r; ++i) p[modes_apart * (3 * a + axis) + i] += weight * value(axis, i);
      }
    });
    const Eigen::Map<const Eigen::VectorXd> own(p + modes_apart * 3 * a, Eigen::Index(3 * modes_apart));
    for (std::uint32_t b = 0; b <= a; ++b) {
      const Eigen::Map<const Eigen::VectorXd> other(p + modes_apart * 3 * b, Eigen::Index(3 * modes_apart));
      const double give = own.dot(other) / 3;
      holds.give[std::size_t(n) * a + b] = holds.give[std::size_t(n) * b + a] = give;
      factor[apart * b + a] = firm[a] * firm[b] * give + (a == b ? 1 : 0);
    }
    ++a;
  });
  factorize(factor, n);
  for (std::uint32_t j = 0; j < m; ++j) {
    double* const f = forces + apart * j;
    for (std::uint32_t i = 0; i < n; ++i) f[i] = firm[i] * psi[apart * j + i];
    solveLower(factor, n, f);
    solveUpper(factor, n, f);
    for (std::uint32_t i = 0; i < n; ++i) f[i] *= firm[i];
  }
  const std::size_t columns = columnsOf(0, n), rows = 3 * std::size_t(k) + r;
  holds.by_hold.resize(rows * columns);
  std::fill(holds.by_hold.begin(), holds.by_hold.end(), 0.0F);
  holds.by_function.resize(rows * field.stride);
  std::fill(holds.by_function.begin(), holds.by_function.end(), 0.0F);
  for (std::uint32_t j = 0; j < m; ++j) {
    const Column force(forces + apart * j, n);
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      const auto entry = [&](std::size_t row) -> float& {
        return j < k ? holds.by_function[field.stride * row + 3 * j + axis]
                     : holds.by_hold[columns * row + 3 * (j - k) + axis];
      };
      for (std::uint32_t i = 0; i < k; ++i) entry(3 * i + axis) = float(Column(psi + apart * i, n).dot(force));
      for (std::uint32_t i = 0; i < r; ++i) {
        double sum = 0;
        for (std::uint32_t b = 0; b < n; ++b) sum += p[modes_apart * (3 * b + axis) + i] * force[b];
        entry(3 * k + i) = float(sum);
      }
    }
  }
}

}  // namespace

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
  holds.give.clear();
  if (r == 0) return;
  std::uint32_t picked = 0;
  forEachHeld(body, piece, [&](const HeldPoint& held) {
    ++holds.count;
    if (held.pick != nullptr) ++picked;
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
  if (picked == holds.count) return makePickHolds(body, piece, stiffness, scratch);
  const auto sets = std::uint32_t(holds.sets.size());
  const std::uint32_t answered = k + 4 * sets, m = answered + holds.single;
  const std::size_t stride = strideOf(r);
  double *const a = scratch.holds.data(), *const z = a + stride * r, *const modes = z + stride * (3 * m + 1),
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
  forEachHeld(body, piece, [&](const HeldPoint& held) {
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
    // A pick is a spring in series with what its point lacks, the finger as wide as a mode.
    firm[batched] = held.pick != nullptr
                        ? springOf(piece, *held.pick, stiffness).kappa / double(stiffness)
                        : held.weight / double(field.residual_locals[held.at.vertex[0] - field.first_vertex]);
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
        const auto answer = float(direct - columnOf(z, row).dot(columnOf(z, column)));
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
}

void findAmplitudes(const Piece& piece, const HoldWays& ways, Array<float>& amplitudes) {
  const std::uint32_t r = piece.field().residual_modes;
  const std::size_t first = piece.holds.by_function.size() / piece.field().stride - r;
  for (std::uint32_t m = 0; m < r; ++m) amplitudes[m] = -float(answerOf(piece.holds, ways, first + m));
}

// Forces are f = D^-1 (b - P P^T f), and the amplitudes a = -P^T f.
std::uint32_t takePicks(const Body& body, const Piece& piece, const HoldWays& ways, Array<float>& amplitudes,
                        Array<float>& of_picks) {
  const Field& field = piece.field();
  const Holds& holds = piece.holds;
  std::size_t at = 12 * holds.sets.size();
  for (const Pin& pin : body.pins) at += isIn(field, pin.vertex) ? 3U : 0U;
  const std::size_t end = 12 * holds.sets.size() + 3 * std::size_t(holds.single);
  const auto picks = std::uint32_t((end - at) / 3);
  if (picks == 0) return 0;
  if (picks == holds.count) {
    std::copy_n(amplitudes.begin(), field.residual_modes, of_picks.begin());
    std::fill_n(amplitudes.begin(), field.residual_modes, 0.0F);
    return picks;
  }
  std::fill(of_picks.begin(), of_picks.end(), 0.0F);
  for (const Pick& pick : body.picks) {
    if (!isIn(field, pick.point.vertex[0]) || at == end) continue;
    Vector3d off = Eigen::Map<const Eigen::Vector3f>(ways.of_holds.data() + at).cast<double>();
    at += 3;
    for (std::uint32_t j = 0; j < field.k; ++j) {
      off += valueAt(field, pick.point, j) * Eigen::Map<const Vector3d>(ways.of_functions.data() + std::size_t{3} * j);
    }
    const auto forEachAxis = [&](const auto& visit) {
      forEachVertex(field, pick.point, [&](double weight, const auto& value) {
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
          for (std::uint32_t m = 0; m < field.residual_modes; ++m) visit(axis, m, weight * value(axis, m));
        }
      });
    };
    forEachAxis([&](std::uint32_t axis, std::uint32_t m, double p) { off[int(axis)] += p * double(amplitudes[m]); });
    const Vector3d force = springOf(piece, pick, holds.stiffness).kappa / double(holds.stiffness) * off;
    forEachAxis([&](std::uint32_t axis, std::uint32_t m, double p) { of_picks[m] -= float(p * force[int(axis)]); });
  }
  for (std::uint32_t m = 0; m < field.residual_modes; ++m) amplitudes[m] -= of_picks[m];
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

namespace {

/// Pulls f of picks that alone hold a piece, each toward its own target from where its point has given way to all, and
/// no larger than it may be: f_a = min(1, most / |f|) (t_a - x_a - sum_{b != a} C_ab f_b) / (C_aa + 1 / kappa), found
/// one after the other (Gauss, Seidel). Pulls bounded without the others' share would turn the piece for ever.
/// \param[in,out] ways pulls: places x. \return whether one is at its bound.
bool findPulls(const Body& body, const Piece& piece, float stiffness, HoldWays& ways) {
  constexpr int kSweeps = 32;
  constexpr double kNear = 1e-7;  // of the largest pull
  const std::uint32_t n = piece.holds.single;
  const auto give = [&](std::uint32_t a, std::uint32_t b) {
    return piece.holds.give[std::size_t(n) * a + b] / double(stiffness);
  };
  bool bounded = false;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double change = 0, largest = 0;
    std::uint32_t a = 0;
    bounded = false;
    for (const Pick& pick : body.picks) {
      if (!isIn(piece.field(), pick.point.vertex[0])) continue;
      Vector3d way = asVector(pick.target).cast<double>() - ways.pulls[2 * a];
      for (std::uint32_t b = 0; b < n; ++b) {
        if (b != a) way -= give(a, b) * ways.pulls[2 * b + 1];
      }
      Vector3d pull = way / (give(a, a) + 1 / springOf(piece, pick, stiffness).kappa);
      const double most = mostForceOf(body, pick), length = pull.norm();
      if (length > most) pull *= most / length, bounded = true;
      change = std::max(change, (pull - ways.pulls[2 * a + 1]).norm());
      largest = std::max(largest, pull.norm());
      ways.pulls[2 * a + 1] = pull;
      ++a;
    }
    if (!(change > kNear * largest)) break;
  }
  return bounded;
}

}  // namespace

void findWays(const Body& body, const Piece& piece, const ConstCoefficientMap& z, const RigidPlace& place, double part,
              float stiffness, HoldWays& ways) {
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
  const bool alone = !piece.holds.give.empty();
  ways.pulls.clear();
  for (const Pick& pick : body.picks) {
    if (!isIn(field, pick.point.vertex[0])) continue;
    Vector3d way = Vector3d::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) {
      way += valueAt(field, pick.point, j) * Eigen::Map<const Vector3d>(ways.of_functions.data() + 3 * j);
    }
    if (alone) {
      ways.pulls.push_back(place.turned * (restOf(body, pick.point) + way) + place.moved);
      ways.pulls.push_back(Vector3d::Zero());
      continue;
    }
    const double kappa = springOf(piece, pick, stiffness).kappa;
    const double firm = kappa / (1 + kappa * ownCompliance(field, pick.point) / double(stiffness));
    const Vector3d at_place = place.turned * restOf(body, pick.point) + place.moved;
    add(Vector3d(back * (at_place - reachOf(body, pick, at_place + place.turned * way, firm))));
  }
  if (alone) {
    const bool bounded = findPulls(body, piece, stiffness, ways);
    std::uint32_t a = 0;
    for (const Pick& pick : body.picks) {
      if (!isIn(field, pick.point.vertex[0])) continue;
      Vector3d target = asVector(pick.target).cast<double>();
      if (bounded) {  // nearer: from there the springs pull so
        target = ways.pulls[2 * a] + ways.pulls[2 * a + 1] / springOf(piece, pick, stiffness).kappa;
        for (std::uint32_t b = 0; b < piece.holds.single; ++b) {
          target +=
              piece.holds.give[std::size_t(piece.holds.single) * a + b] / double(stiffness) * ways.pulls[2 * b + 1];
        }
      }
      add(Vector3d(back * (place.turned * restOf(body, pick.point) + place.moved - target)));
      ++a;
    }
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
