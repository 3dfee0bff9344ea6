// SPDX-License-Identifier: MIT
#include "runtime/contact/touch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/clusters/algebra.h"
#include "runtime/contact/firmness.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;

/// Rounds in which a place's material point is found, and how near, diagonals.
constexpr int kRounds = 4;
constexpr double kNear = 2e-4;
/// Steps of a way out, each as long as the surface is far.
constexpr int kLeaving = 16;

Vector3f sumOf(const float* row, const float* coefficients, std::uint32_t k) {
  Vector3f sum = Vector3f::Zero();
  for (std::uint32_t j = 0; j < k; ++j) sum += row[j] * Eigen::Map<const Vector3f>(coefficients + 4 * j);
  return sum;
}

void setRow(const Field& field, const MaterialPoint& at, float* row) {
  for (std::uint32_t j = 0; j < field.k; ++j) {
    row[j] = 0;
    for (std::size_t c = 0; c < 4; ++c) row[j] += at.weight[c] * field.valueAt(at.vertex[c] - field.first_vertex, j);
  }
}

/// Deformation gradient of the tetrahedron that has a material point.
Matrix3f gradientAt(const TouchingPiece& piece, const formats::PackageView& package, const MaterialPoint& at) {
  std::array<Vector3f, 4> now, rest;
  for (std::size_t c = 0; c < 4; ++c) {
    now[c].setZero();
    for (std::uint32_t j = 0; j < piece.field->k; ++j) {
      now[c] += piece.field->valueAt(at.vertex[c] - piece.field->first_vertex, j) *
                Eigen::Map<const Vector3f>(piece.base + 4 * j);
    }
    rest[c] = asVector(package.physicalVertices()[at.vertex[c]].rest_position);
  }
  Matrix3f sides, rest_sides;
  for (int c = 0; c < 3; ++c) {
    sides.col(c) = now[std::size_t(c)] - now[3];
    rest_sides.col(c) = rest[std::size_t(c)] - rest[3];
  }
  return sides * rest_sides.inverse();
}

/// Where a way out of b reaches its surface. \param way unit. \param[out] place of the surface. \param[out] outward
/// unit normal there. \return false where it does not leave, or leaves where the surface does not face it.
bool leave(const DepthMap& map, const Vector3f& from, const Vector3f& way, double diagonal, Vector3f& place,
           Vector3f& outward) {
  place = from;
  float distance = map.distance(place, &outward);
  for (int step = 0; step < kLeaving && distance < 0; ++step) {
    place += std::max(-distance, float(kNear * diagonal)) * way;
    distance = map.distance(place, &outward);
  }
  if (distance < 0 || !(outward.squaredNorm() > 0)) return false;
  outward.normalize();
  place -= distance * outward;
  return outward.dot(way) > 0;
}

double firmness(const TouchingPiece& piece, double area) {
  return pointFirmness(double(piece.stiffness) * piece.field->young, area, piece.weight, piece.diagonal);
}

}  // namespace

std::size_t pointFloats(const Field& field) { return 3 * ((field.points.size() + 7) / 8 * 8); }

void placePoints(TouchingPiece& piece, std::span<float> memory) {
  const Field& field = *piece.field;
  const std::uint32_t blocks = std::uint32_t((field.points.size() + 7) / 8);
  piece.points = memory.subspan(0, 24 * std::size_t(blocks));
  std::array<float, 1024> axis;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::uint32_t j = 0; j < field.k; ++j) axis[j] = piece.base[4 * j + c];
    kernels().field_heights({field.k, blocks, field.point_values, axis.data(), piece.points.data() + 8 * c * blocks});
  }
  piece.low.setConstant(1e30F);
  piece.high = -piece.low;
  float bent2 = 0;
  for (std::uint32_t p = 0; p < field.points.size(); ++p) {
    const Vector3f x(piece.points[p], piece.points[8 * blocks + p], piece.points[16 * blocks + p]);
    piece.low = piece.low.cwiseMin(x);
    piece.high = piece.high.cwiseMax(x);
    bent2 = std::max(bent2, (x - piece.turn * (asVector(field.points[p].at) - piece.rest_center)).squaredNorm());
  }
  piece.bent = std::sqrt(bent2);
}

void findTouches(const TouchingPiece& a, const TouchingPiece& b, std::uint32_t index_a, std::uint32_t index_b, double h,
                 std::span<const TouchMemory> known, TouchList& list) {
  if (b.map == nullptr || a.points.empty()) return;
  const Field &field_a = *a.field, &field_b = *b.field;
  const std::size_t stride = a.points.size() / 3;
  const float margin = float(kMargin * std::min(a.diagonal, b.diagonal));
  const Vector3f apart = (a.center - b.center).cast<float>();
  const Vector3f low = b.low.array() - margin, high = b.high.array() + margin;
  if (((a.low + apart).array() > high.array()).any() || ((a.high + apart).array() < low.array()).any()) return;
  const float near = float(kNear) * float(b.diagonal);
  std::array<float, 1024> row;
  TouchMemory key = {a.body, a.piece, b.body, b.piece, 0, 0, {}};
  auto last = std::lower_bound(known.begin(), known.end(), key, [](const TouchMemory& x, const TouchMemory& y) {
    return touchOrder(x) < touchOrder(y);
  });
  std::uint32_t left = kMostTouches;
  for (std::uint32_t p = 0; p < field_a.points.size() && left > 0; ++p) {
    const Vector3f at = Vector3f(a.points[p], a.points[stride + p], a.points[2 * stride + p]) + apart;
    if ((at.array() > high.array()).any() || (at.array() < low.array()).any()) continue;
    Vector3f place = b.turn.transpose() * at + b.rest_center;
    if (b.map->distance(place, nullptr) > margin + 2 * b.bent) continue;
    // The material point of b that is there.
    MaterialPoint material;
    bool found = true;
    for (int round = 0; found && round < kRounds; ++round) {
      found = b.map->locate(place, material);
      if (!found) break;
      setRow(field_b, material, row.data());
      const Vector3f left_over = at - sumOf(row.data(), b.base, field_b.k);
      place += b.turn.transpose() * left_over;
      if (left_over.squaredNorm() < near * near) break;
    }
    if (!found) continue;
    Vector3f outward;
    const float distance = b.map->distance(place, &outward);
    if (distance > margin || !(outward.squaredNorm() > 0)) continue;
    outward.normalize();
    FoundTouch touch = {};
    touch.place = place - distance * outward;
    // Surfaces that touch face each other: where the nearest way out does not, the way back into a does.
    Vector3f facing;
    if (a.map != nullptr) {
      a.map->distance(asVector(field_a.points[p].at), &facing);
      const Vector3f back = -(b.turn.transpose() * (a.turn * facing)).normalized();
      if (outward.dot(back) < 0 && !leave(*b.map, place, back, b.diagonal, touch.place, outward)) continue;
    }
    if (!b.map->locate(touch.place, material)) continue;
    const Matrix3f gradient = gradientAt(b, b.map->package(), material);
    const Vector3f normal =
        gradient.determinant() > 0 ? Vector3f(gradient.inverse().transpose() * outward) : Vector3f(b.turn * outward);
    if (!(normal.squaredNorm() > 0) || !normal.allFinite()) continue;
    const std::size_t first = list.rows.size();
    list.rows.resize(first + field_a.k + field_b.k);
    touch.row_a = std::uint32_t(first);
    touch.row_b = std::uint32_t(first + field_a.k);
    float *const row_a = list.rows.data() + first, *const row_b = row_a + field_a.k;
    for (std::uint32_t j = 0; j < field_a.k; ++j) row_a[j] = field_a.valueAtPoint(p, j);
    setRow(field_b, material, row_b);
    Touch& t = touch.touch;
    t.a = index_a;
    t.b = index_b;
    t.normal = normal.normalized();
    const Vector3f over = at - sumOf(row_b, b.base, field_b.k);
    const Vector3f over_before = sumOf(row_a, a.before, field_a.k) + apart - sumOf(row_b, b.before, field_b.k);
    const float gap = t.normal.dot(over), gap_before = t.normal.dot(over_before);
    key.point = p;
    while (last != known.end() && touchOrder(*last) < touchOrder(key)) ++last;
    const bool touched = last != known.end() && touchOrder(*last) == touchOrder(key);
    // As of a plane: what starts inside finds the surface lower, and rising.
    const double low_before = touched ? double(last->floor) : double(gap_before);
    t.floor = float(std::min(0.0, low_before + kRecoverySpeed * h * std::min(a.diagonal, b.diagonal)));
    t.gap = gap - t.floor;
    Vector3f slide = over - over_before;
    if (touched && b.map->locate(Eigen::Map<const Vector3f>(last->anchor.data()), material)) {
      setRow(field_b, material, row.data());
      slide = at - sumOf(row.data(), b.base, field_b.k);
    } else if (gap < 0 && gap_before > 0) {
      slide *= gap / (gap - gap_before);  // since it touched
    }
    t.slide = slide - t.normal.dot(slide) * t.normal;
    const double area = double(field_a.points[p].area);
    t.kappa = float(1 / (1 / firmness(a, area) + 1 / firmness(b, area)));
    t.friction = std::sqrt(a.friction * b.friction);
    touch.memory = key;
    touch.over = over;
    list.touches.push_back(touch);
    --left;
  }
}

bool rememberTouch(const FoundTouch& found, const TouchingPiece& a, const TouchingPiece& b, const float* d_a,
                   const float* d_b, std::span<const float> rows, TouchMemory& memory) {
  const Touch& touch = found.touch;
  const Vector3f moved =
      sumOf(rows.data() + found.row_a, d_a, a.field->k) - sumOf(rows.data() + found.row_b, d_b, b.field->k);
  const float rise = touch.normal.dot(moved), gap = touch.gap + rise;
  if (!(gap < 0)) return false;
  Vector3f slide = touch.slide + (moved - rise * touch.normal);
  // Friction holds at most its bound: beyond it the point it holds at comes along.
  const float length = slide.norm(), most = touch.friction * -gap;
  if (length > most) slide *= most / length;
  memory = found.memory;
  memory.floor = touch.floor;
  const Vector3f over = found.over + moved;
  const Vector3f anchor = found.place + b.turn.transpose() * (over - touch.normal.dot(over) * touch.normal - slide);
  memory.anchor = {anchor[0], anchor[1], anchor[2]};
  return true;
}

}  // namespace sinew::internal
