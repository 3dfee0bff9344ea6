// SPDX-License-Identifier: MIT
#include "runtime/contact/collider_points.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/clusters/algebra.h"
#include "runtime/contact/firmness.h"

namespace sinew::internal {
namespace {

using Eigen::Vector3f;

/// Of a collider's points kMostOwn at most push a piece; a new one begins while fewer than kBeginning are before it, so
/// that those at the edge of touching do not come and go.
constexpr std::uint32_t kMostOwn = 32, kBeginning = 24;
/// Widest gap between points of a surface, of the root of the area that one stands for.
constexpr double kGap = 1.5;
/// What a piece's own points may let in between them, diagonals: r - (r^2 - (gap / 2)^2)^1/2 of isNarrow(), and
/// (gap / 2) tan(turn / 2) of an edge. A quarter of what the drawn surface is lifted out by (kPressedIn).
constexpr double kLetIn = 0.005;
/// Numbers along one edge of a box, around a capsule, along what a piece sees of an edge of a triangle.
constexpr std::uint32_t kOnSide = 1U << 27, kOnRing = 64, kOnEdge = 32;

/// How a piece's own points lie.
struct Spacing {
  double apart;  ///< root of the area that one stands for, m
  double gap;    ///< widest between them, m
  double deep;   ///< what they let in without a point beside it, m
};

Spacing spacingOf(const Field& field, double diagonal) { return {field.apart, kGap * field.apart, kLetIn * diagonal}; }

struct ColliderPoint {
  std::uint32_t number;  ///< on its collider, less than kColliderPoint
  Vector3d at;           ///< in its coordinates, m
};

/// What fits through a gap, or lies r - (r^2 - (gap / 2)^2)^1/2 deep in the plane of the points around it.
bool isNarrow(double radius, const Spacing& s) {
  const double half = 0.5 * s.gap;
  return !(radius > half) || radius - std::sqrt(radius * radius - half * half) > s.deep;
}

/// Spiral of n points (Swinbank, Purser 2006), or the centre.
template <class Visit>
void forEachOnSphere(double radius, const Spacing& s, const Visit& visit) {
  const auto n = std::uint32_t(std::ceil(4 * M_PI * radius * radius / (s.apart * s.apart)));
  for (std::uint32_t i = 0; i < n; ++i) {
    const double y = n > 1 ? 1 - (2 * i + 1) / double(n) : 0, turn = M_PI * (3 - std::sqrt(5.0)) * i;
    const double across = n > 1 ? std::sqrt(1 - y * y) : 0;
    visit(i, radius * Vector3d(across * std::cos(turn), y, across * std::sin(turn)));
  }
}

/// Rings and both tips, or the axis.
template <class Visit>
void forEachOnCapsule(double radius, double half, const Spacing& s, const Eigen::AlignedBox3d& box,
                      const Visit& visit) {
  const double turn = 2 * M_PI * radius / s.apart;
  const auto around = turn > 1 ? std::max(3U, std::uint32_t(std::ceil(turn))) : 1;
  const double end = around > 1 ? half : half + radius, rings = std::max(1.0, std::ceil(2 * end / s.apart));
  const auto ringAt = [&](double y) { return std::clamp((y + end) / (2 * end) * rings, 0.0, rings); };
  const auto last = std::uint32_t(ringAt(box.max().y()));
  for (auto i = std::uint32_t(std::ceil(ringAt(box.min().y()))); i <= last; ++i) {
    const double y = end * (2 * i / rings - 1);
    for (std::uint32_t k = 0; k < around; ++k) {
      const double angle = 2 * M_PI * k / around, r = around > 1 ? radius : 0;
      visit(kOnRing * (i + 1) + k, Vector3d(r * std::cos(angle), y, r * std::sin(angle)));
    }
  }
  if (around == 1) return;
  visit(0, Vector3d(0, -half - radius, 0));
  visit(1, Vector3d(0, half + radius, 0));
}

/// Edges, those with their corners that are along the longest axis. What is thin across an edge has one in its middle.
template <class Visit>
void forEachOnBox(const Vector3d& half, const Spacing& s, const Eigen::AlignedBox3d& box, const Visit& visit) {
  int longest = 0;
  half.maxCoeff(&longest);
  const auto isThin = [&](int axis) { return 2 * half[axis] < 0.5 * s.apart; };
  for (int axis = 0; axis < 3; ++axis) {
    const int b = (axis + 1) % 3, c = (axis + 2) % 3;
    const double length = 2 * half[axis], parts = std::max(1.0, std::ceil(length / s.apart));
    if (axis != longest && isThin(axis)) continue;
    const auto placeAt = [&](double x) { return std::clamp((x + half[axis]) / length * parts, 0.0, parts); };
    const auto sidesOf = [&](int a) { return isThin(a) ? 1U : 2U; };
    for (std::uint32_t side = 0; side < 4; ++side) {
      if (side % 2 >= sidesOf(b) || side / 2 >= sidesOf(c)) continue;
      Vector3d at;
      at[b] = sidesOf(b) == 1 ? 0 : (side % 2 == 0 ? -1 : 1) * half[b];
      at[c] = sidesOf(c) == 1 ? 0 : (side / 2 == 0 ? -1 : 1) * half[c];
      if (at[b] < box.min()[b] || at[b] > box.max()[b] || at[c] < box.min()[c] || at[c] > box.max()[c]) continue;
      const auto last = std::uint32_t(placeAt(box.max()[axis]));
      for (auto i = std::uint32_t(std::ceil(placeAt(box.min()[axis]))); i <= last; ++i) {
        if (axis != longest && (i == 0 || i == std::uint32_t(parts))) continue;
        at[axis] = half[axis] * (2 * i / parts - 1);
        visit((std::uint32_t(axis) * 4 + side) * kOnSide + i, at);
      }
    }
  }
}

/// Edges at which a plane of points beside a gap lies deep: gap / 2 tan(turn / 2).
template <class Visit>
void forEachOnTriangles(const Shape& shape, const Spacing& s, const Eigen::AlignedBox3d& box, const Visit& visit) {
  shape.forEachRidge(box, 2 * s.deep / s.gap, [&](const Corners& corners, std::uint32_t triangle, std::uint32_t e) {
    const Vector3d from = corners.at[e], way = corners.at[(e + 1) % 3] - from;
    double first = 0, last = 1;  // parts of the way between which it is in the box
    for (int c = 0; c < 3; ++c) {
      const double low = box.min()[c] - from[c], high = box.max()[c] - from[c];
      if (way[c] == 0) {
        if (low > 0 || high < 0) last = -1;
        continue;
      }
      first = std::max(first, std::min(low / way[c], high / way[c]));
      last = std::min(last, std::max(low / way[c], high / way[c]));
    }
    if (first > last) return;
    const double parts = std::max(1.0, std::ceil(way.norm() / s.apart));
    for (auto i = std::uint32_t(std::ceil(first * parts)); i <= std::uint32_t(last * parts); ++i)
      visit((3 * triangle + e) * kOnEdge + i % kOnEdge, Vector3d(from + i / parts * way));
  });
}

/// Calls visit(number, place) for the points of a shape; those that are far outside a box may be left out. All in its
/// coordinates.
template <class Visit>
void forEachPoint(const Shape& shape, const Spacing& s, const Eigen::AlignedBox3d& box, const Visit& visit) {
  // Cells smaller than points are apart are roughness, no shape that these could find.
  if (shape.isPlane() || (shape.isHeightField() && shape.cell() < s.apart)) return;
  if (shape.hasTriangles()) {
    forEachOnTriangles(shape, s, box, visit);
  } else if (shape.isBox()) {
    forEachOnBox(shape.half(), s, box, visit);
  } else if (isNarrow(shape.radius(), s)) {
    shape.half().y() > 0 ? forEachOnCapsule(shape.radius(), shape.half().y(), s, box, visit)
                         : forEachOnSphere(shape.radius(), s, visit);
  }
}

/// A box of the world in the coordinates of a collider in this step.
Eigen::AlignedBox3d localBox(const Collider& collider, const Eigen::AlignedBox3d& box) {
  Eigen::AlignedBox3d local;
  for (const Pose* pose : {&collider.pose_before, &collider.pose}) {
    const Vector3d middle = pose->toLocal(box.center()),
                   half = pose->rotation.transpose().cwiseAbs() * (0.5 * box.sizes());
    local.extend(Eigen::AlignedBox3d(middle - half, middle + half));
  }
  return local;
}

/// What a piece may meet in a step: places in its box, and of these those near its surface.
struct Reach {
  const TouchingPiece& piece;
  Vector3d travel;  ///< of its centre in the step, backwards, m
  double around;    ///< how far beyond its points it reaches, m
  Eigen::AlignedBox3d box;

  Reach(const TouchingPiece& seen, const ContactStep& step)
      : piece(seen),
        travel(seen.center_before.cast<double>()),
        around(double(seen.stirring) + double(seen.map->bulge()) + step.fall.norm() + kMargin * step.diagonal),
        box(seen.center + seen.low.cast<double>() + travel.cwiseMin(0) - Vector3d::Constant(around),
            seen.center + seen.high.cast<double>() + travel.cwiseMax(0) + Vector3d::Constant(around)) {}

  /// Whether what moves from one place to another one in the step may touch.
  bool has(const Vector3d& before, const Vector3d& now) const {
    if (!box.contains(now) && !box.contains(before)) return false;
    const Vector3f rest = piece.turn.transpose() * (now - piece.center).cast<float>() + piece.rest_center;
    const double way = (before - now - travel).norm();
    return double(piece.map->distance(rest)) <= around + 2 * double(piece.bent) + way;
  }
};

/// A collider as a piece that stands: 1, x, y, z are its functions, its pose their coefficients.
class ColliderPiece {
 public:
  /// Takes the points that a piece may meet, as far as there is room.
  ColliderPiece(const Collider& collider, const Spacing& s, const Reach& reach, std::uint32_t room)
      : collider_(collider) {
    const Eigen::AlignedBox3d local = localBox(collider, reach.box);
    forEachPoint(collider.shape, s, local, [&](std::uint32_t number, const Vector3d& at) {
      if (count_ == room || !local.contains(at)) return;
      if (!reach.has(collider.pose_before.toWorld(at), collider.pose.toWorld(at))) return;
      // A corner of triangles has a place on each of its edges.
      for (std::uint32_t i = 0; i < count_; ++i) {
        if (points_[i].at == at) return;
      }
      points_[count_++] = {number, at};
    });
    std::sort(points_.begin(), points_.begin() + count_,
              [](const ColliderPoint& a, const ColliderPoint& b) { return a.number < b.number; });
  }

  std::uint32_t count() const { return count_; }
  std::uint32_t numberOf(std::uint32_t point) const { return points_[point].number; }
  Vector3d placeOf(std::uint32_t point) const { return collider_.pose.toWorld(points_[point].at); }

  /// As it meets a piece. \param touching what the step before knew of its points.
  const TouchingPiece& seenBy(const TouchingPiece& other, const ContactStep& step, double apart,
                              std::span<const TouchingPoint> touching) {
    const std::uint32_t blocks = (count_ + 7) / 8;
    for (std::uint32_t i = 0; i < 8 * blocks; ++i) {
      const Vector3d& at = points_[std::min(i, count_ - 1)].at;
      const Vector3f place = (collider_.pose.toWorld(at) - other.center).cast<float>();
      for (int c = 0; c < 3; ++c) {
        places_[8 * blocks * std::size_t(c) + i] = place[c];
        values_[8 * (i / 8 * 4 + std::uint32_t(c) + 1) + i % 8] = float(at[c]);
      }
      values_[8 * (i / 8 * 4) + i % 8] = 1;
      at_[i] = {{float(at[0]), float(at[1]), float(at[2])}, float(apart * apart)};
    }
    const Vector3f way = (collider_.pose_before.position - collider_.pose.position).cast<float>();
    for (std::uint32_t j = 0; j < 4; ++j) {
      const auto set = [&](const Pose& pose, std::array<float, 16>& to) {
        const Vector3d row = j == 0 ? Vector3d(pose.position - other.center) : Vector3d(pose.rotation.col(int(j) - 1));
        for (std::uint32_t c = 0; c < 3; ++c) to[4 * j + c] = float(row[int(c)]);
      };
      set(collider_.pose, base_);
      set(collider_.pose_before, before_);
    }
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    field_.k = 4;
    field_.points = {at_.data(), count_};
    field_.point_values = values_.data();
    field_.young = kInfinity;
    seen_.body = formats::kNone;
    seen_.field = &field_;
    seen_.base = base_.data();
    seen_.before = before_.data();
    seen_.center = other.center;
    seen_.center_before = way;
    seen_.mass = seen_.weight = kInfinity;
    seen_.diagonal = other.diagonal;
    seen_.friction = collider_.settings.friction;
    seen_.firmer = collider_.firmer();
    const Vector3d belt = step.h * asVector(collider_.settings.surface_velocity).cast<double>();
    seen_.belt = (collider_.pose.rotation * belt).cast<float>();
    seen_.damping_ratio = float(step.damping_ratio);
    seen_.points = {places_.data(), 24 * std::size_t(blocks)};
    seen_.low.setConstant(1e30F);
    seen_.high = -seen_.low;
    for (std::uint32_t i = 0; i < count_; ++i) {
      const Vector3f place(places_[i], places_[8 * blocks + i], places_[16 * blocks + i]);
      const Vector3f was = (collider_.pose_before.toWorld(points_[i].at) - other.center).cast<float>();
      seen_.low = seen_.low.cwiseMin(place);
      seen_.high = seen_.high.cwiseMax(place);
      seen_.stirring = std::max(seen_.stirring, (was - place - way).norm());
    }
    std::uint32_t known = 0;
    for (const TouchingPoint& touch : touching) {
      if (touch.collider != collider_.id || touch.point < kColliderPoint || known == kMostOwn) continue;
      const auto* const found =
          std::lower_bound(points_.begin(), points_.begin() + count_, touch.point - kColliderPoint,
                           [](const ColliderPoint& point, std::uint32_t number) { return point.number < number; });
      if (found == points_.begin() + count_ || found->number != touch.point - kColliderPoint) continue;
      TouchMemory& memory = known_[known++];
      memory = {seen_.body,
                seen_.piece,
                other.body,
                other.piece,
                std::uint32_t(found - points_.begin()),
                touch.floor,
                touch.depth,
                std::numeric_limits<float>::infinity(),
                {},
                {},
                0};
      for (std::size_t c = 0; c < 3; ++c) {
        memory.anchor[c] = float(touch.anchor[c]);
        memory.outward[c] = float(touch.normal[c]);
      }
    }
    seen_.known = {known_.data(), known};
    return seen_;
  }

 private:
  const Collider& collider_;
  std::array<ColliderPoint, kMostLooked> points_;
  std::uint32_t count_ = 0;
  std::array<formats::FieldPoint, kMostLooked> at_;
  std::array<float, 4 * kMostLooked> values_;
  std::array<float, 3 * kMostLooked> places_;
  std::array<float, 16> base_ = {}, before_ = {};
  std::array<TouchMemory, kMostOwn> known_;
  Field field_;
  TouchingPiece seen_;
};

}  // namespace

bool mayMeetPoints(const ContactStep& step, const Field& field, const Vector3d& center, const ContactScratch& scratch) {
  const Spacing s = spacingOf(field, step.diagonal);
  const Eigen::AlignedBox3d box(center - scratch.reach, center + scratch.reach);
  for (const Collider* collider : step.colliders) {
    const Eigen::AlignedBox3d local = localBox(*collider, box);
    bool found = false;
    forEachPoint(collider->shape, s, local,
                 [&](std::uint32_t, const Vector3d& at) { found = found || local.contains(at); });
    if (found) return true;
  }
  return false;
}

void findPointContacts(const Piece& piece, const ContactStep& step, TouchingPiece seen, ContactScratch& lent,
                       MinimizeScratch& scratch) {
  const Field& field = piece.field();
  const Spacing s = spacingOf(field, step.diagonal);
  const Reach reach(seen, step);
  TouchList& list = lent.touches;
  const float own = step.body->friction;
  for (std::uint32_t c = 0; c < step.colliders.size(); ++c) {
    const Collider& collider = *step.colliders[c];
    if (collider.shape.isPlane() || !collider.bounds().intersects(reach.box)) continue;
    ColliderPiece points(collider, s, reach, kMostLooked - std::uint32_t(list.touches.size()));
    if (points.count() == 0) continue;
    seen.friction = own >= 0 ? own : collider.settings.friction;
    const std::size_t first = list.touches.size();
    std::uint32_t pushing = 0;
    findTouches(points.seenBy(seen, step, s.apart, {piece.state.touching.data(), piece.state.touching.size()}), seen, 0,
                1, step.h, list);
    for (std::size_t i = first; i < list.touches.size(); ++i) {
      const FoundTouch& found = list.touches[i];
      const bool begins = !(found.memory.depth > 0);
      if (scratch.contacts.size() == kMostContacts || pushing >= (begins ? kBeginning : kMostOwn)) continue;
      ++pushing;
      // The piece is pushed back.
      Contact contact = {};
      static_cast<Push&>(contact) = found.touch;
      contact.normal = -found.touch.normal;
      contact.slide = -found.touch.slide;
      contact.lag = -found.touch.lag;
      contact.firm = contact.kappa;
      contact.point = kColliderPoint + points.numberOf(found.memory.point);
      contact.collider = c;
      contact.at = points.placeOf(found.memory.point);
      contact.rest = found.place;
      contact.touch = std::uint32_t(i);
      contact.speed = found.memory.speed;
      float* const row = scratch.rows.data() + std::size_t(field.k) * scratch.contacts.size();
      std::copy_n(list.rows.data() + found.row_b, field.k, row);
      contact.phi = row;
      scratch.contacts.push_back(contact);
    }
  }
  std::sort(scratch.contacts.begin(), scratch.contacts.end(), [](const Contact& a, const Contact& b) {
    return a.collider != b.collider ? a.collider < b.collider : a.point < b.point;
  });
}

}  // namespace sinew::internal
