// SPDX-License-Identifier: MIT
#include "runtime/contact/plane.h"

#include <algorithm>
#include <cmath>

namespace sinew::internal {
namespace {

/// Points so close to the plane at the prediction are looked at: the minimization may press them in. Diagonals.
constexpr double kMargin = 2e-3;
/// Speed at which what starts inside comes out, diagonals per second.
constexpr double kRecoverySpeed = 1;
/// Depths in kappa = weight / (kFew depth), which bound a point's own E sqrt(area) (docs/method.md §4). Where a piece
/// is too soft to carry its weight, diagonals:
constexpr double kSinking = 2e-3;
/// And at least, where it is stiff: a hundred times what floats resolve of a place. Diagonals.
constexpr double kResolved = 2e-5;
/// Points that are taken to share the weight there; more press in less.
constexpr double kFew = 8;
/// What counts as weight at least, diagonals per second squared.
constexpr double kLeastGravity = 1;

/// About a place near the piece: functions add up to 1 to the digits of floats only.
Vector3d positionOf(const Field& field, std::uint32_t point, const ConstCoefficientMap& z, const Vector3d& center) {
  Vector3d x = center;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    x += double(field.valueAtPoint(point, j)) * (z.row(j).transpose() - double(field.functions[j].one) * center);
  }
  return x;
}

}  // namespace

void findContacts(const Piece& piece, const PlaneStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                  std::span<float> lent, MinimizeScratch& scratch) {
  const Field& field = piece.field();
  scratch.contacts.clear();
  const std::uint32_t count = std::uint32_t(field.points.size()), blocks = (count + 7) / 8;
  if (count == 0) return;
  const Vector3d normal(double(step.plane->normal[0]), double(step.plane->normal[1]), double(step.plane->normal[2]));
  const std::span<float> heights = lent.subspan(0, 8 * blocks), before_heights = lent.subspan(8 * blocks, 8 * blocks);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d arm = y.row(j).transpose() - double(field.functions[j].one) * center;
    const Vector3d old = piece.z().row(j).transpose() - double(field.functions[j].one) * center;
    scratch.x[j] = float(normal.dot(arm));
    scratch.next[j] = float(normal.dot(old));
  }
  kernels().field_heights({field.k, blocks, field.point_values, scratch.x.data(), heights.data()});
  kernels().field_heights({field.k, blocks, field.point_values, scratch.next.data(), before_heights.data()});

  const auto& touching = piece.state.touching;
  const float margin = float(double(step.plane->offset) - normal.dot(center) + kMargin * step.diagonal);
  // Of many those carry that are near before the step, for which do must not depend on its length; then the others.
  const auto isNear = [&](std::uint32_t p) { return heights[p] < margin || before_heights[p] < margin; };
  std::size_t near_before = 0;
  for (std::uint32_t p = 0; p < count; ++p) near_before += before_heights[p] < margin ? 1U : 0U;
  std::size_t known = 0, first = kMostContacts, others = kMostContacts - std::min<std::size_t>(near_before, first);
  for (std::uint32_t p = 0; p < count; ++p) {
    if (!isNear(p)) continue;
    std::size_t& left = before_heights[p] < margin ? first : others;
    if (left == 0) continue;
    --left;
    while (known < touching.size() && touching[known].point < p) ++known;
    const bool touched = known < touching.size() && touching[known].point == p;
    const Vector3d at = positionOf(field, p, y, center), before = positionOf(field, p, piece.z(), center);
    const double gap = normal.dot(at) - double(step.plane->offset);
    const double gap_before = normal.dot(before) - double(step.plane->offset);
    Contact contact = {};
    contact.point = p;
    // What starts inside finds the plane lower, and rising, so that it comes out at a bounded speed.
    const double low = touched ? double(touching[known].floor) : gap_before;
    contact.floor = float(std::min(0.0, low + kRecoverySpeed * step.h * step.diagonal));
    contact.gap = float(gap - double(contact.floor));
    Vector3d anchor = before;
    if (touched) {
      anchor = Eigen::Map<const Vector3d>(touching[known].anchor.data());
    } else if (gap < 0 && gap_before > 0) {
      anchor += gap_before / (gap_before - gap) * (at - before);  // where it touched
    }
    const Vector3d slide = at - anchor;
    contact.slide = (slide - normal.dot(slide) * normal).cast<float>();
    scratch.contacts.push_back(contact);
  }
  // A constant of the point, whatever else touches: else what rests would be a spring that changes.
  const double weight = std::max(step.weight, field.mass * kLeastGravity * step.diagonal) / (kFew * step.diagonal);
  for (std::size_t i = 0; i < scratch.contacts.size(); ++i) {
    Contact& contact = scratch.contacts[i];
    float* const row = scratch.rows.data() + std::size_t(field.k) * i;
    for (std::uint32_t j = 0; j < field.k; ++j) row[j] = field.valueAtPoint(contact.point, j);
    contact.phi = row;
    const double local = double(step.stiffness) * field.young * std::sqrt(double(field.points[contact.point].area));
    contact.kappa = float(std::clamp(local, weight / kSinking, weight / kResolved));
  }
}

void rememberContacts(Piece& piece, const PlaneStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                      const MinimizeScratch& scratch) {
  const Field& field = piece.field();
  const Eigen::Vector3f normal(step.plane->normal[0], step.plane->normal[1], step.plane->normal[2]);
  piece.state.touching.clear();
  for (const Contact& contact : scratch.contacts) {
    Eigen::Vector3f moved = Eigen::Vector3f::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) {
      moved += contact.phi[j] * Eigen::Map<const Eigen::Vector3f>(scratch.d.data() + 4 * j);
    }
    const float rise = normal.dot(moved), gap = contact.gap + rise;
    if (!(gap < 0)) continue;
    const Vector3d at = positionOf(field, contact.point, y, center) + moved.cast<double>();
    Vector3d slide = (contact.slide + (moved - rise * normal)).cast<double>();
    // Friction holds at most its bound: beyond it the point it holds at comes along.
    const double length = slide.norm(), most = double(step.plane->friction) * -double(gap);
    if (length > most) slide *= most / length;
    const Vector3d anchor = at - slide;
    piece.state.touching.push_back({contact.point, contact.floor, {anchor[0], anchor[1], anchor[2]}});
  }
}

}  // namespace sinew::internal
