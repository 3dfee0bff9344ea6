// SPDX-License-Identifier: MIT
#include "runtime/solver/holds.h"

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

/// Of Holds::by_point: three a held point, rounded up to eight.
std::size_t columnsOf(std::size_t held) { return (3 * held + 7) / 8 * 8; }

/// Numbers that makeHolds() needs beside its result. \param m scalar functions of held vertices
std::size_t scratchOf(std::size_t r, std::size_t held, std::size_t m) {
  return r * (r + 3 * held + 3 * m) + held * (m + 1);
}

/// The lower triangle becomes its Cholesky factor; columns are r apart. Eigen's own takes memory of its own at this
/// size. \pre its eigenvalues are at least 1
void factorize(double* a, std::uint32_t r) {
  for (std::uint32_t j = 0; j < r; ++j) {
    double* const column = a + std::size_t(r) * j;
    for (std::uint32_t i = 0; i < j; ++i) {
      const double* const before = a + std::size_t(r) * i;
      Column(column + j, r - j) -= before[j] * Eigen::Map<const Eigen::VectorXd>(before + j, r - j);
    }
    Column(column + j, r - j) *= 1 / std::sqrt(std::max(column[j], 1.0));
  }
}

/// x becomes L^-T x.
void solveUpper(const double* factor, std::uint32_t r, double* x) {
  for (std::uint32_t i = r; i-- > 0;) {
    const double* const column = factor + std::size_t(r) * i;
    const std::uint32_t left = r - i - 1;
    x[i] = (x[i] - Eigen::Map<const Eigen::VectorXd>(column + i + 1, left).dot(Column(x + i + 1, left))) / column[i];
  }
}

/// x becomes L^-1 x.
void solveLower(const double* factor, std::uint32_t r, double* x) {
  for (std::uint32_t i = 0; i < r; ++i) {
    const double* const column = factor + std::size_t(r) * i;
    x[i] /= column[i];
    const std::uint32_t left = r - i - 1;
    Column(x + i + 1, left) -= x[i] * Eigen::Map<const Eigen::VectorXd>(column + i + 1, left);
  }
}

/// Where a held point is at rest.
Vector3d restOf(const Body& body, const HeldPoint& held) {
  Vector3d at = Vector3d::Zero();
  for (std::size_t c = 0; c < held.at.weight.size() && held.at.weight[c] != 0; ++c) {
    at += held.at.weight[c] * asVector(body.vertices()[held.at.vertex[c]].rest_position).cast<double>();
  }
  return at;
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
  std::size_t held = 0;
  for (const Pin& pin : body.pins) held += isIn(field, pin.vertex) ? 1U : 0U;
  for (const PinSet& set : body.pin_sets) {
    for (const PinnedVertex& vertex : set.vertices) held += isIn(field, vertex.vertex) ? 1U : 0U;
  }
  for (const Pick& pick : body.picks) held += isIn(field, pick.point.vertex[0]) ? 1U : 0U;
  if (held == 0) return;
  held = std::bit_ceil(held);  // pins come one by one
  const std::size_t sets = body.pin_sets.size(), rows = 3 * std::size_t(field.k) + 12 * sets + field.residual_modes;
  piece.holds.sets.reserve(sets);
  piece.holds.by_function.reserve(rows * field.stride);
  piece.holds.by_point.reserve(rows * columnsOf(held));
  for (HoldWays* ways : {&piece.ways, &body.ways}) {
    ways->of_functions.reserve(field.stride);
    ways->of_points.reserve(columnsOf(held));
  }
  piece.holds.scratch = scratchOf(field.residual_modes, held, field.k + 4 * sets);
}

void reserveHolds(const Piece& piece, MinimizeScratch& scratch) {
  if (scratch.holds.size() < piece.holds.scratch) scratch.holds.resize(piece.holds.scratch);
}

// With p the rows of P and d those of D at the held vertices, A = 1 + sum p p^T / d = L L^T and Y = L^-1 (p / d):
// S = 1 / D - Y^T Y (Woodbury). Rows of functions psi are Psi^T S = psi / d - (Y psi)^T Y, those of the modes
// P^T S = L^-T Y.
void makeHolds(const Body& body, Piece& piece, float stiffness, MinimizeScratch& scratch) {
  const Field& field = piece.field();
  Holds& holds = piece.holds;
  const std::uint32_t r = field.residual_modes, k = field.k;
  holds.count = 0;
  holds.stiffness = stiffness;
  holds.sets.clear();
  if (r == 0) return;
  forEachHeld(body, piece, [&holds](const HeldPoint& held) {
    ++holds.count;
    if (held.set != formats::kNone && (holds.sets.empty() || holds.sets.back() != held.set)) {
      holds.sets.push_back(held.set);
    }
  });
  if (holds.count == 0) return;
  const std::uint32_t count = holds.count, m = k + 4 * std::uint32_t(holds.sets.size());
  double *const a = scratch.holds.data(), *const y = a + std::size_t(r) * r, *const z = y + std::size_t(r) * 3 * count,
                *const firm = z + std::size_t(r) * 3 * m, *const psi = firm + count;
  std::fill(a, firm, 0.0);
  std::fill_n(psi, std::size_t(m) * count, 0.0);
  const auto columnOf = [r](double* of, std::size_t i) { return Column(of + r * i, r); };
  const auto psiOf = [psi, m](std::uint32_t h, std::uint32_t i) { return psi[std::size_t(m) * h + i]; };
  // Psi, 1 / d, p / d in the place of Y, and A.
  for (std::uint32_t i = 0; i < r; ++i) a[(std::size_t(r) + 1) * i] = 1;
  std::uint32_t h = 0, at_set = 0;
  forEachHeld(body, piece, [&](const HeldPoint& held) {
    double* const own = psi + std::size_t(m) * h;
    for (std::uint32_t j = 0; j < k; ++j) own[j] = valueAt(field, held.at, j);
    if (held.set != formats::kNone) {
      while (holds.sets[at_set] != held.set) ++at_set;
      double* const of_set = own + k + std::size_t{4} * at_set;
      of_set[0] = 1;
      for (std::size_t c = 0; c < 3; ++c) of_set[1 + c] = double(held.local[c]);
    }
    // A pick is a spring in series with what its point lacks, the finger as wide as a mode.
    firm[h] = held.pick != nullptr
                  ? springOf(piece, *held.pick, stiffness).kappa / double(stiffness)
                  : held.weight / double(field.residual_locals[held.at.vertex[0] - field.first_vertex]);
    forEachVertex(field, held.at, [&](double weight, const auto& value) {
      for (std::uint32_t c = 0; c < 3; ++c) {
        Column p = columnOf(y, 3 * std::size_t(h) + c);
        for (std::uint32_t i = 0; i < r; ++i) p[i] += weight * value(c, i);
      }
    });
    for (std::uint32_t c = 0; c < 3; ++c) {
      Column p = columnOf(y, 3 * std::size_t(h) + c);
      for (std::uint32_t i = 0; i < r; ++i) columnOf(a, i).tail(r - i) += firm[h] * p[i] * p.tail(r - i);
      p *= firm[h];
    }
    ++h;
  });
  factorize(a, r);
  for (std::size_t i = 0; i < 3 * std::size_t(count); ++i) solveLower(a, r, y + r * i);
  for (h = 0; h < count; ++h) {
    for (std::uint32_t i = 0; i < m; ++i) {
      if (psiOf(h, i) == 0) continue;
      for (std::uint32_t c = 0; c < 3; ++c) columnOf(z, 3 * i + c) += psiOf(h, i) * columnOf(y, 3 * h + c);
    }
  }
  const std::size_t columns = columnsOf(count), rows = 3 * std::size_t(m) + r;
  holds.by_point.resize(rows * columns);
  std::fill(holds.by_point.begin(), holds.by_point.end(), 0.0F);
  holds.by_function.resize(rows * field.stride);
  std::fill(holds.by_function.begin(), holds.by_function.end(), 0.0F);
  const auto entry = [&](std::uint32_t i, std::uint32_t j) -> float& {
    return holds.by_function[std::size_t(field.stride) * i + j];
  };
  for (std::uint32_t i = 0; i < 3 * m; ++i) {
    for (std::uint32_t j = 0; j < 3 * count; ++j) {
      const double direct = i % 3 == j % 3 ? firm[j / 3] * psiOf(j / 3, i / 3) : 0;
      holds.by_point[columns * i + j] = float(direct - columnOf(z, i).dot(columnOf(y, j)));
    }
  }
  for (std::uint32_t i = 0; i < m; ++i) {
    for (std::uint32_t j = 0; j < std::min(i + 1, k); ++j) {
      double direct = 0;
      for (h = 0; h < count; ++h) direct += firm[h] * psiOf(h, i) * psiOf(h, j);
      for (std::uint32_t c = 0; c < 9; ++c) {
        const std::uint32_t row = 3 * i + c / 3, column = 3 * j + c % 3;
        const double less = columnOf(z, row).dot(columnOf(z, column));
        entry(row, column) = float((c / 3 == c % 3 ? direct : 0) - less);
        if (i < k) entry(column, row) = entry(row, column);
      }
    }
  }
  for (std::uint32_t j = 0; j < 3 * count; ++j) {
    solveUpper(a, r, y + std::size_t(r) * j);
    for (std::uint32_t i = 0; i < r; ++i) holds.by_point[columns * (3 * m + i) + j] = float(columnOf(y, j)[i]);
  }
  for (std::uint32_t j = 0; j < 3 * k; ++j) {
    solveUpper(a, r, z + std::size_t(r) * j);
    for (std::uint32_t i = 0; i < r; ++i) entry(3 * m + i, j) = float(columnOf(z, j)[i]);
  }
}

void findAmplitudes(const Piece& piece, const HoldWays& ways, Array<float>& amplitudes) {
  const std::uint32_t r = piece.field().residual_modes;
  const std::size_t first = piece.holds.by_function.size() / piece.field().stride - r;
  for (std::uint32_t m = 0; m < r; ++m) amplitudes[m] = -float(answerOf(piece.holds, ways, first + m));
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

void giveWay(const Field& field, const Array<float>& amplitudes, const Matrix3d& turned, Array<float>& ways, Vec3* x) {
  const std::uint32_t blocks = (field.vertex_count + 7) / 8;
  ways.resize(24 * std::size_t(blocks));
  kernels().residual_values({field.residual_modes, blocks, field.residual, amplitudes.data(), ways.data()});
  const Matrix3 frame = field.residual_scale * turned.cast<float>();
  for (std::uint32_t v = 0; v < field.vertex_count; ++v) {
    const float* const way = ways.data() + std::size_t{24} * (v / 8) + v % 8;
    x[v] = asArray(Vector3(asVector(x[v]) + frame * Vector3(way[0], way[8], way[16])));
  }
}

RigidPlace placeOfHolds(const Body& body, const Piece& piece, double part, const RigidPlace& of_piece) {
  Vector3d rest_mean = Vector3d::Zero(), mean = Vector3d::Zero();
  double weight = 0;
  forEachPinned(body, piece, [&](const HeldPoint& held) {
    rest_mean += held.weight * restOf(body, held);
    mean += held.weight * held.target(body, part);
    weight += held.weight;
  });
  if (weight == 0) return of_piece;
  rest_mean /= weight;
  mean /= weight;
  Matrix3d moment = Matrix3d::Zero();
  const double size = kOpen * double(body.package().info().diagonal);
  double spread = size * size;
  forEachPinned(body, piece, [&](const HeldPoint& held) {
    const Vector3d arm = restOf(body, held) - rest_mean;
    moment += held.weight * (held.target(body, part) - mean) * arm.transpose();
    spread += held.weight * arm.squaredNorm();
  });
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
              float stiffness, HoldWays& ways) {
  const Field& field = piece.field();
  findWays(piece, z, place, ways);
  ways.of_points.clear();
  forEachHeld(body, piece, [&](const HeldPoint& held) {
    const Vector3d at_place = place.turned * restOf(body, held) + place.moved;
    Vector3d target;
    if (held.pick != nullptr) {
      Vector3d way = Vector3d::Zero();
      for (std::uint32_t j = 0; j < field.k; ++j) {
        way += valueAt(field, held.at, j) * Eigen::Map<const Vector3d>(ways.of_functions.data() + 3 * j);
      }
      const double kappa = springOf(piece, *held.pick, stiffness).kappa;
      const double firm = kappa / (1 + kappa * ownCompliance(field, held.at) / double(stiffness));
      target = reachOf(body, *held.pick, at_place + place.turned * way, firm);
    } else {
      target = held.target(body, part);
    }
    const Vector3d off = place.turned.transpose() * (at_place - target);
    for (int c = 0; c < 3; ++c) ways.of_points.push_back(float(off[c]));
  });
  ways.of_points.resize(columnsOf(piece.holds.count));
}

double answerOf(const Holds& holds, const HoldWays& ways, std::size_t row) {
  using Four = Eigen::Array4f;
  const std::size_t stride = ways.of_functions.size(), columns = ways.of_points.size();
  const float *const of_functions = holds.by_function.data() + stride * row, *const of_points =
                                                                                 holds.by_point.data() + columns * row;
  Eigen::Array4d sum = Eigen::Array4d::Zero();
  for (std::size_t i = 0; i < stride; i += 4) {
    sum += Four::Map(of_functions + i).cast<double>() * Eigen::Array4d::Map(ways.of_functions.data() + i);
  }
  Four even = Four::Zero(), odd = Four::Zero();
  for (std::size_t i = 0; i < columns; i += 8) {
    even += Four::Map(of_points + i) * Four::Map(ways.of_points.data() + i);
    odd += Four::Map(of_points + i + 4) * Four::Map(ways.of_points.data() + i + 4);
  }
  sum += (even + odd).cast<double>();
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

}  // namespace sinew::internal
