// SPDX-License-Identifier: MIT
#include "runtime/contact/touch.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

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
/// Looks along a point's way in a step, so that work is bounded at any speed. Half a grid cell each, as where less is
/// not seen: up to 128 cells a step, four lengths of a piece of 32 cells, there are as many as that takes.
constexpr float kMostTraced = 256;
/// Rounds in which a crossing is looked for: as many halvings as floats have digits.
constexpr int kCrossing = 24;
/// A distance that is not known.
constexpr float kFar = std::numeric_limits<float>::max();
/// Functions of a field at most (FieldRange::function_count).
constexpr std::size_t kMostFunctions = 1024;
/// Steps of a way out, each as long as the surface is far: along a side that is s away, a way of length L takes L / s.
/// Beside the margin, 0.002 diagonals, so many reach an eighth of a diagonal.
constexpr int kLeaving = 64;
/// Points that are looked at together.
constexpr int kBlock = 8;
/// Ways out of each piece that are looked at, points of each that are to come out, and the cosine of ways that count as
/// one: 2.6 degrees apart, which over a way as long as the piece is less than contact points are apart.
constexpr std::size_t kWays = 8, kProbes = 64;
constexpr float kAlike = 0.999F;
/// So near points of one piece are, of the distance between neighbours, where its surface may touch itself.
constexpr float kNeighbours = 1.5F;

Vector3f sumOf(const float* row, const float* coefficients, std::uint32_t k) {
  return sumOfRows(row, coefficients, k).matrix().head<3>();
}

void setRow(const Field& field, const MaterialPoint& at, float* row) {
  std::array<const float*, 4> values;
  for (std::size_t c = 0; c < 4; ++c) values[c] = field.valuesAt(at.vertex[c] - field.first_vertex);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    row[j] = (at.weight[0] * values[0][8 * j] + at.weight[1] * values[1][8 * j]) +
             (at.weight[2] * values[2][8 * j] + at.weight[3] * values[3][8 * j]);
  }
}

/// Places of a piece's vertices in one shape of it, as they are asked for: what touches asks for the same few again.
class Corners {
 public:
  /// \param shape coefficients, k x 4.
  Corners(const TouchingPiece& piece, const float* shape) : piece_(piece), shape_(shape) {
    vertices_.fill(formats::kNone);
  }

  Vector3f placeOf(const MaterialPoint& at) {
    Eigen::Array4f sum = at.weight[0] * place(at.vertex[0]);
    for (std::size_t c = 1; c < 4; ++c) sum += at.weight[c] * place(at.vertex[c]);
    return sum.matrix().head<3>();
  }

  /// Deformation gradient of the tetrahedron that has a material point, which the piece's map has located.
  Matrix3f gradientAt(const MaterialPoint& at) {
    const Eigen::Array4f last = place(at.vertex[3]);
    Matrix3f sides;
    for (std::size_t c = 0; c < 3; ++c) sides.col(int(c)) = (place(at.vertex[c]) - last).matrix().head<3>();
    return sides * piece_.map->restSidesInverse(at);
  }

 private:
  const Eigen::Array4f& place(std::uint32_t vertex) {
    const std::size_t slot = vertex % kSlots;
    if (vertices_[slot] == vertex) return places_[slot];
    const Field& field = *piece_.field;
    const float* const values = field.valuesAt(vertex - field.first_vertex);
    Eigen::Array4f sum = Eigen::Array4f::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) sum += values[8 * j] * Eigen::Array4f::Map(shape_ + 4 * j);
    vertices_[slot] = vertex;
    return places_[slot] = sum;
  }

  static constexpr std::size_t kSlots = 64;
  const TouchingPiece& piece_;
  const float* shape_;
  std::array<std::uint32_t, kSlots> vertices_;
  std::array<Eigen::Array4f, kSlots> places_;
};

/// Takes back ways of the bent body to its rest shape: (F^T F + e^2 I)^-1 F^T. The inverse of F would take a way across
/// what lies pressed flat as far as it likes; this one lengthens none by more than 1 / 2e (Tikhonov 1963).
Matrix3f boundedInverse(const Matrix3f& gradient) {
  constexpr float kFlat = 0.01F;  // e: a stretch below which a body counts as flat
  const Matrix3f square = gradient.transpose() * gradient + kFlat * kFlat * Matrix3f::Identity();
  return square.inverse() * gradient.transpose();
}

/// det(F) F^-T, which turns normals of surfaces as F bends these, flat or not.
Matrix3f cofactorOf(const Matrix3f& f) {
  Matrix3f result;
  for (int i = 0; i < 3; ++i) result.col(i) = f.col((i + 1) % 3).cross(f.col((i + 2) % 3));
  return result;
}

/// Where a way out of b reaches its surface. \param distance of `from`. \param way unit. \param[out] place of the
/// surface. \param[out] outward unit normal there. \return false where it does not leave, or leaves where the surface
/// does not face it.
bool leave(const DepthMap& map, const Vector3f& from, float distance, const Vector3f& way, double diagonal,
           Vector3f& place, Vector3f& outward) {
  place = from;
  for (int step = 0; step < kLeaving && distance < 0; ++step) {
    float inside = distance, low = 0, high = std::max(-distance, float(kNear * diagonal));
    const Vector3f last = place;
    place += high * way;
    distance = map.distance(place);
    if (!(distance > 0)) continue;
    // Back to where the surface was crossed: what lies just below and just above it are to find one place. First on
    // both sides of where distances that grow evenly cross it; near edges they do not.
    const float resolved = float(kResolved * diagonal), beside = 0.45F * resolved;
    for (int round = 0; high - low > resolved; ++round) {
      const float crossing = low + inside / (inside - distance) * (high - low), middle = 0.5F * (low + high);
      const float below = round % 2 == 0 ? std::max(low, crossing - beside) : middle,
                  above = round % 2 == 0 ? std::min(high, crossing + beside) : middle;
      const float lower = map.distance(last + below * way), upper = map.distance(last + above * way);
      if (!(lower < 0)) {
        high = below, distance = lower;
        continue;
      }
      low = below, inside = lower;
      (upper < 0 ? low : high) = above;
      (upper < 0 ? inside : distance) = upper;
    }
    place = last + (low + inside / (inside - distance) * (high - low)) * way;
    distance = 0;
  }
  if (distance < 0) return false;
  if (distance > 0) place -= distance * map.outward(place);
  outward = map.outward(place);
  return outward.dot(way) > 0;
}

double firmness(const TouchingPiece& piece, double area, double firmer) {
  return pointFirmness(double(piece.stiffness) * piece.field->young, area, piece.weight, piece.diagonal, firmer);
}

}  // namespace

std::size_t pointFloats(const Field& field) { return 3 * ((field.points.size() + 7) / 8 * 8); }

Range TouchList::add(const TouchList& other) {
  const Range range = {std::uint32_t(touches.size()), std::uint32_t(other.touches.size())};
  const auto first_row = std::uint32_t(rows.size());
  touches.append({other.touches.data(), other.touches.size()});
  rows.append({other.rows.data(), other.rows.size()});
  for (FoundTouch* touch = touches.begin() + range.first; touch != touches.end(); ++touch) {
    touch->row_a += first_row;
    touch->row_b += first_row;
  }
  return range;
}

void placePoints(TouchingPiece& piece) {
  const Field& field = *piece.field;
  const std::uint32_t blocks = std::uint32_t((field.points.size() + 7) / 8);
  std::array<float, kMostFunctions> axis;
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

namespace {

bool comesBefore(const TouchMemory& x, const TouchMemory& y) { return touchOrder(x) < touchOrder(y); }

/// Those that lie between two keys.
std::span<const TouchMemory> touchesBetween(std::span<const TouchMemory> known, const TouchMemory& first,
                                            const TouchMemory& end) {
  const auto begin = std::lower_bound(known.begin(), known.end(), first, comesBefore);
  return {begin, std::lower_bound(begin, known.end(), end, comesBefore)};
}

std::span<const TouchMemory> touchesOf(const TouchingPiece& a, const TouchingPiece& b) {
  return touchesBetween(a.known, {a.body, a.piece, b.body, b.piece, 0, 0, 0, 0, {}, {}, 0},
                        {a.body, a.piece, b.body, b.piece + 1, 0, 0, 0, 0, {}, {}, 0});
}

Eigen::Map<const Vector3f> outwardOf(const TouchMemory& touch) {
  return Eigen::Map<const Vector3f>(touch.outward.data());
}
float pushOf(const TouchMemory& touch) { return std::max(0.0F, touch.depth); }

/// Looks at points of a near b, one after the other.
class TouchSearch {
 public:
  TouchSearch(const TouchingPiece& a, const TouchingPiece& b, double h, TouchList& list)
      : a_(a),
        b_(b),
        h_(h),
        list_(list),
        stride_(a.points.size() / 3),
        margin_(float(kMargin * std::min(a.diagonal, b.diagonal))),
        apart_((a.center - b.center).cast<float>()),
        travel_(b.center_before - a.center_before),
        is_fast_(&a != &b && travel_.norm() + a.stirring + b.stirring > b.map->spacing()),
        fall_(a.fall - b.fall),
        pins_((a.field->driven > 0 && !a.fall.isZero(0)) || (b.field->driven > 0 && !b.fall.isZero(0))),
        low_((b.low + lowFall()).array() - (b.map->bulge() + margin_)),
        high_((b.high + highFall()).array() + (b.map->bulge() + margin_)),
        corners_(b, b.base),
        corners_before_(b, b.before) {}

  /// Anywhere on the way.
  bool areNear() const {
    const float stirring = a_.stirring + b_.stirring;
    const Vector3f low = a_.low + apart_ - travel_.cwiseMax(0.0F), high = a_.high + apart_ - travel_.cwiseMin(0.0F);
    return !((low.array() - stirring) > high_.array()).any() && !((high.array() + stirring) < low_.array()).any();
  }

  /// Takes in what all touches of the step before were.
  void remember() {
    known_ = touchesOf(a_, b_);
    if (isItself()) {
      sortPoints();
      return;
    }
    met_ = !known_.empty() || !touchesOf(b_, a_).empty();
    const bool in_order = std::pair(a_.body, a_.piece) < std::pair(b_.body, b_.piece);
    Vector3f way = in_order ? wayApart(a_, b_) : Vector3f(-wayApart(b_, a_));
    parting_ = !way.isZero(0);
    if (!parting_) {
      // The way that the two pushed each other apart, by how deep they were.
      for (const TouchMemory& touch : known_) way += pushOf(touch) * (b_.turn * outwardOf(touch));
      for (const TouchMemory& touch : touchesOf(b_, a_)) way -= pushOf(touch) * (a_.turn * outwardOf(touch));
    }
    if (way.squaredNorm() > 0) way_ = b_.turn.transpose() * way.normalized();
  }

  /// The way on which a piece leaves another one that it started in, unit; 0: it did not. Of the ways of points of
  /// both, the one on which they are out soonest.
  static Vector3f wayApart(const TouchingPiece& one, const TouchingPiece& other) {
    Vector3f best = Vector3f::Zero();
    float shortest = std::numeric_limits<float>::infinity();
    const auto chooseAmong = [&](const TouchingPiece& from, const TouchingPiece& in, float sign) {
      const auto touches = touchesOf(from, in);
      const auto isParting = [](const TouchMemory& touch) { return touch.parting != 0; };
      const auto count = std::size_t(std::count_if(touches.begin(), touches.end(), isParting));
      std::size_t n = 0;
      for (const TouchMemory& touch : touches) {
        if (!isParting(touch) || n++ % ((count + kWays - 1) / kWays) != 0) continue;
        const Vector3f way = sign * (in.turn * outwardOf(touch));
        if (way.dot(best) > kAlike) continue;
        if (best.isZero(0)) {
          best = way;  // alone it needs no length
          continue;
        }
        if (!std::isfinite(shortest)) shortest = lengthOf(one, other, best, shortest);
        const float length = lengthOf(one, other, way, shortest);
        if (length < shortest) shortest = length, best = way;
      }
    };
    chooseAmong(one, other, 1);
    chooseAmong(other, one, -1);
    return best;
  }

  /// How far the one has to go on a way until no point of either is in the other; what is longer than `most` may be any
  /// such number. Points are spread, the first ones widest.
  static float lengthOf(const TouchingPiece& one, const TouchingPiece& other, const Vector3f& way, float most) {
    float length = 0;
    const auto follow = [&](const TouchingPiece& from, const TouchingPiece& in, const Vector3f& along) {
      if (in.map == nullptr) return;
      const std::size_t stride = from.points.size() / 3, count = std::min(kProbes, from.field->points.size());
      const Vector3f apart = (from.center - in.center).cast<float>(), local = in.turn.transpose() * along;
      const float end = along.cwiseProduct(in.low).cwiseMax(along.cwiseProduct(in.high)).sum() + in.map->bulge();
      const float least = 0.5F * in.map->spacing();
      for (std::size_t p = 0; p < count && length < most; ++p) {
        const Vector3f at = apart + Vector3f(from.points[p], from.points[stride + p], from.points[2 * stride + p]);
        const Vector3f place = in.turn.transpose() * at + in.rest_center;
        // Back from where it is out, by steps as long as the surface is far (Hart 1996).
        for (float t = end - along.dot(at); t > length;) {
          const float distance = in.map->distance(place + t * local);
          if (distance < 0) length = t;
          t -= std::max(distance, least);
        }
      }
    };
    follow(one, other, way);
    follow(other, one, -way);
    return length;
  }

  void lookAll() {
    const auto count = std::uint32_t(a_.field->points.size());
    const bool all = isItself();
    // What is farther from b's box does not reach it within the step.
    const float reach = is_fast_ ? travel_.norm() + a_.stirring + b_.stirring : 0;
    for (std::uint32_t first = 0; first < count; first += kBlock) {
      const Eigen::Array<float, kBlock, 1> outside = outsideBox(first);
      const std::uint32_t end = std::min(count, first + kBlock);
      const bool some = !known_.empty() && known_.front().point < end;
      if (!all && !some && outside.minCoeff() > reach) continue;
      for (std::uint32_t p = first; p < end; ++p) {
        while (!known_.empty() && known_.front().point < p) known_ = known_.subspan(1);
        const TouchMemory* const last = !known_.empty() && known_.front().point == p ? &known_.front() : nullptr;
        if (all || last != nullptr || outside[p - first] <= reach) look(p, last);
      }
    }
  }

  /// Adds the touch of a point, if it is one. An old touch counts at its old place too: a prediction that goes on as a
  /// thin part sprang leads away from what that part lies on. \param last what the step before knew of it, or null
  void look(std::uint32_t p, const TouchMemory* last) {
    const TouchMemory key = {a_.body, a_.piece, b_.body, b_.piece, p, 0, 0, 0, {}, {}, 0};
    const Vector3f at = pointAt(p) + apart_;
    Vector3f place;
    float distance;
    if (isItself()) {
      if (findsItself(p, last, at, place, distance)) add(key, last, false, at, place, distance);
      return;
    }
    if (a_.body == b_.body && b_.map->distance(asVector(a_.field->points[p].at)) < margin_) return;  // as at rest
    const bool pushed = last != nullptr && last->depth > 0;
    const bool entered = !pushed && is_fast_ && enters(at, oldPlaceOf(p), place, distance);
    point_fall_ = fallOf(p, last);
    const Vector3f lies = at - point_fall_;
    // Bent parts of b may overlap where the rigid motion leads: what is known is looked for where it was.
    const auto isStill = [&] {
      place = Eigen::Map<const Vector3f>(last->anchor.data());
      return findsPlaceFrom(lies, place) && isUnderSurface(place, distance);
    };
    const bool near = entered || (last != nullptr && isStill()) || isNear(lies, 1, place, distance) ||
                      (lies != at && isNear(at, 1, place, distance)) ||
                      (last != nullptr && isNear(oldPlaceOf(p), 0, place, distance));
    if (near) add(key, last, entered, at, place, distance);
  }

  bool isItself() const { return &a_ == &b_; }

  /// Bounds of fallOf(), with 0 between them.
  Vector3f lowFall() const {
    return pins_ ? Vector3f(a_.fall.cwiseMin(0.0F) - b_.fall.cwiseMax(0.0F)) : Vector3f(fall_.cwiseMin(0.0F));
  }
  Vector3f highFall() const {
    return pins_ ? Vector3f(a_.fall.cwiseMax(0.0F) - b_.fall.cwiseMin(0.0F)) : Vector3f(fall_.cwiseMax(0.0F));
  }

  /// How far a's point falls against b in the prediction. What is held does not fall: where it touches is not to depend
  /// on the length of a step.
  Vector3f fallOf(std::uint32_t p, const TouchMemory* last) {
    if (!pins_) return fall_;
    const Field &a = *a_.field, &b = *b_.field;
    const auto partOf = [this](const Field& field) {
      float part = 0;
      for (std::uint32_t j = field.driven; j < field.k; ++j) part += row_[j] * float(field.oneOf(j));
      return part;
    };
    for (std::uint32_t j = 0; j < a.k; ++j) row_[j] = a.valueAtPoint(p, j);
    const float part_a = a.driven > 0 ? partOf(a) : 1;
    const Vector3f place = last != nullptr ? Vector3f(Eigen::Map<const Vector3f>(last->anchor.data()))
                                           : Vector3f(b_.turn.transpose() * (pointAt(p) + apart_) + b_.rest_center);
    float part_b = 1;
    if (b.driven > 0 && b_.map->locate(place, material_)) {
      setRow(b, material_, row_.data());
      part_b = partOf(b);
    }
    return part_a * a_.fall - part_b * b_.fall;
  }

  /// How far points lie outside b's box, along the axis along which they do most; not above 0 within.
  Eigen::Array<float, kBlock, 1> outsideBox(std::uint32_t first) const {
    Eigen::Array<float, kBlock, 1> outside = Eigen::Array<float, kBlock, 1>::Constant(-1);
    for (int c = 0; c < 3; ++c) {
      const auto x = Eigen::Array<float, kBlock, 1>::Map(a_.points.data() + stride_ * std::size_t(c) + first);
      outside = outside.max((x + apart_[c]) - high_[c]).max(low_[c] - (x + apart_[c]));
    }
    return outside;
  }

  /// Finds a material point X other than X_p with x(X) = x(X_p): the piece overlaps itself there. \return whether
  /// there is one.
  bool findsItself(std::uint32_t p, const TouchMemory* last, const Vector3f& at, Vector3f& place, float& distance) {
    const Vector3f own = asVector(a_.field->points[p].at);
    const auto found = [&](const Vector3f& from) {
      place = from;
      return findsPlaceFrom(at, place) && (place - own).norm() > margin_ && isUnderSurface(place, distance);
    };
    if (last != nullptr && found(Eigen::Map<const Vector3f>(last->anchor.data()))) return true;
    const std::uint32_t q = facingPoint(p);
    return q != formats::kNone && found(asVector(a_.field->points[q].at));
  }

  /// Newton's method, whose steps end where the tetrahedron no longer changes. Of another piece the rigid motion's
  /// inverse, which is mostly enough, makes the first one.
  bool findsPlaceFrom(const Vector3f& at, Vector3f& place) {
    for (int round = 0; round < 2 * kRounds; ++round) {
      if (!b_.map->locate(place, material_)) return false;
      const Vector3f left_over = at - corners_.placeOf(material_);
      const bool small = isSmall(left_over);
      Matrix3f back = b_.turn.transpose();
      if ((isItself() || (round > 0 && !small)) && !takesBack(back)) return false;
      place += back * left_over;
      if (small) return true;
    }
    return false;
  }

  /// Inverse of b's deformation gradient. \return false where it has none.
  bool takesBack(const Vector3f& place, Matrix3f& back) { return b_.map->locate(place, material_) && takesBack(back); }
  bool takesBack(Matrix3f& back) {
    const Matrix3f gradient = corners_.gradientAt(material_);
    if (!(gradient.determinant() > 0)) return false;
    back = gradient.inverse();
    return back.allFinite();
  }

  Vector3f pointAt(std::uint32_t p) const { return {a_.points[p], a_.points[stride_ + p], a_.points[2 * stride_ + p]}; }

  /// The nearest point of the surface that faces a point and that it is not far behind, or kNone. Neighbours at rest
  /// have to have faced it then.
  std::uint32_t facingPoint(std::uint32_t p) {
    const auto& points = a_.field->points;
    const Vector3f x = pointAt(p), rest = asVector(points[p].at);
    std::uint32_t best = formats::kNone;
    float nearest2 = reach_ * reach_;
    const auto look = [&](std::uint32_t q) {
      const Vector3f way = x - pointAt(q), rest_way = rest - asVector(points[q].at);
      const float reach2 = kNeighbours * kNeighbours * float(points[q].area);
      if (way.squaredNorm() > std::min(nearest2, reach2)) return;
      const Vector3f& normal_q = a_.map->pointNormal(points[q]);
      if (rest_way.squaredNorm() < reach2 &&
          !(rest_way.dot(normal_q) > 0 && a_.map->pointNormal(points[p]).dot(normal_q) < 0)) {
        return;
      }
      if (!(normalAt(p).dot(normalAt(q)) < 0) || way.dot(normalAt(q)) < -0.5F * std::sqrt(reach2)) return;
      nearest2 = way.squaredNorm();
      best = q;
    };
    // Along the longest side points are in order.
    const std::span<const std::uint64_t> order = a_.order;
    const auto begin = std::lower_bound(order.begin(), order.end(), std::uint64_t(sortable(x[axis_] - reach_)) << 32);
    for (auto i = begin; i != order.end() && std::uint32_t(*i >> 32) <= sortable(x[axis_] + reach_); ++i) {
      if (std::uint32_t(*i) != p) look(std::uint32_t(*i));
    }
    return best;
  }

  /// Makes a's points ready for facingPoint().
  void sortPoints() {
    (a_.high - a_.low).maxCoeff(&axis_);
    float largest = 0;
    for (std::uint32_t p = 0; p < a_.field->points.size(); ++p) {
      a_.order[p] = std::uint64_t(sortable(pointAt(p)[axis_])) << 32 | p;
      a_.normals[p].setConstant(2);
      largest = std::max(largest, float(a_.field->points[p].area));
    }
    reach_ = kNeighbours * std::sqrt(largest);
    sortAscending(a_.order);
  }

  /// Of the bent surface, unit, or 0.
  Vector3f normalAt(std::uint32_t p) {
    Vector3f& normal = a_.normals[p];
    if (normal[0] > 1) {  // not known yet
      const Vector3f rest = asVector(a_.field->points[p].at);
      Matrix3f back;
      normal = takesBack(rest, back)
                   ? Vector3f((back.transpose() * a_.map->pointNormal(a_.field->points[p])).normalized())
                   : Vector3f(Vector3f::Zero());
    }
    return normal;
  }

  Vector3f oldPlaceOf(std::uint32_t p) {
    for (std::uint32_t j = 0; j < a_.field->k; ++j) row_[j] = a_.field->valueAtPoint(p, j);
    return sumOf(row_.data(), a_.before, a_.field->k) + apart_;
  }

  /// Whether a point's way in the step leads into b from outside, and where: of what is fast the prediction may lie
  /// beyond b, or nearer to where it would come out. Steps along the way are as long as the surface is far (Hart 1996),
  /// and no shorter than what is seen at all; there are so many at most.
  bool enters(const Vector3f& at, const Vector3f& was, Vector3f& place, float& distance) {
    const Vector3f from = was - b_.center_before, way = at - from;
    const float length = way.norm(), least = std::max(0.5F * b_.map->spacing(), length / kMostTraced);
    float outside = 0;
    for (float t = 0; t <= 1;) {
      const float far = b_.map->distance(b_.turn.transpose() * (from + t * way) + b_.rest_center) - 2 * b_.bent;
      if (!(far > 0) && (distance = depthAt(at, was, t, place)) < 0) {
        if (t == 0) return false;
        cross(at, was, length, outside, t, place, distance);
        return true;
      }
      outside = t;
      if (t == 1) break;
      t = std::min(1.0F, t + std::max(far, least) / length);
    }
    return false;
  }

  /// Where a way crosses b's surface between two parts of the step, one outside and one inside: just inside. By the
  /// false position where the distances on both sides are known (Dowell and Jarratt 1971). \param[in,out] place,
  /// distance inside.
  void cross(const Vector3f& at, const Vector3f& was, float length, float outside, float inside, Vector3f& place,
             float& distance) {
    const float resolved = float(kNear * b_.diagonal);
    float above = kFar, below = distance;
    bool came_in = true;
    for (int round = 0; round < kCrossing && distance < -resolved; ++round) {
      if (!((inside - outside) * length > resolved)) break;
      const float part = above < kFar ? above / (above - below) : 0.5F, t = outside + part * (inside - outside);
      Vector3f there;
      const float depth = depthAt(at, was, t, there);
      const bool comes_in = depth < 0;
      if (comes_in) {
        place = there, inside = t, distance = below = depth;
        if (came_in && above < kFar) above *= 0.5F;
      } else {
        outside = t, above = depth;
        if (!came_in) below *= 0.5F;
      }
      came_in = comes_in;
    }
  }

  /// Distance of a place on a point's way from b's surface, at a part t of the step; kFar: it is not near. \param[out]
  /// place of b's rest shape that is there.
  float depthAt(const Vector3f& at, const Vector3f& was, float t, Vector3f& place) {
    float distance = kFar;
    (void)isNear(was + t * (at - was), t, place, distance);
    return distance;
  }

  /// Whether a place is inside b or hardly outside, at a part t of the step. \param[out] place of b's rest shape that
  /// is there. \param[in,out] distance of it from the surface, where it was looked for.
  bool isNear(const Vector3f& at, float t, Vector3f& place, float& distance) {
    place = b_.turn.transpose() * (at - (1 - t) * b_.center_before) + b_.rest_center;
    if (b_.map->distance(place) > margin_ + 2 * b_.bent) return false;
    for (int round = 0; round < kRounds; ++round) {
      if (!b_.map->locate(place, material_)) return false;
      const Vector3f left_over = at - placeAt(t);
      place += b_.turn.transpose() * left_over;
      if (isSmall(left_over)) break;
    }
    return isUnderSurface(place, distance);
  }

  /// Of the located material point, at a part t of the step.
  Vector3f placeAt(float t) {
    if (t == 1) return corners_.placeOf(material_);
    const Vector3f before = corners_before_.placeOf(material_);
    return t == 0 ? before : Vector3f(before + t * (corners_.placeOf(material_) - before));
  }

  bool isSmall(const Vector3f& left_over) const { return left_over.norm() < float(kNear) * float(b_.diagonal); }

  bool isUnderSurface(const Vector3f& place, float& distance) const {
    distance = b_.map->distance(place);
    return distance <= margin_;
  }

  /// leave() with b.
  bool leaves(const Vector3f& from, float distance, const Vector3f& way, Vector3f& left_at, Vector3f& facing) const {
    return leave(*b_.map, from, distance, way, b_.diagonal, left_at, facing);
  }

  /// \param last what the step before knew of it, or null. \param entered in this step, at `place`.
  void add(const TouchMemory& key, const TouchMemory* last, bool entered, const Vector3f& at, const Vector3f& place,
           float distance) {
    const Field &field_a = *a_.field, &field_b = *b_.field;
    const std::uint32_t p = key.point;
    FoundTouch touch = {};
    const bool known = last != nullptr;
    const bool touched = known && last->depth > 0;
    // What starts inside goes out on one way: of many some would hold each other.
    const bool parts = distance < -margin_ && (parting_ || (!met_ && wasDeep(p)));
    // A point goes out as it came in: at an edge of b the nearest way out is another one in each step, and half of
    // a point that lies beyond the edge is carried still. Of others surfaces that touch face each other: where the
    // nearest way out does not, the way back into a does.
    Vector3f facing, left_at, way = Vector3f::Zero();
    bool leads = false;
    if (parts && parting_) {
      leads = leaves(place, distance, way = way_, left_at, facing);
    } else if (known && !parts) {
      leads = leaveAsBefore(place, distance, way = outwardOf(*last), left_at, facing);
    }
    if (!leads) {
      if (parts || !(distance < -margin_ && leaves(place, distance, way_, left_at, facing))) {
        way = b_.map->outward(place);
        if (way.isZero(0)) return;
        const Vector3f back = entered ? way : wayBack(p, place);
        if (way.dot(back) < 0) way = back;
        if (!leaves(place, distance, way, left_at, facing)) return;
      }
      // A pushed point goes along the normal: out there, where that is a way out.
      way = facing;
      Vector3f nearer, there;
      if (leaves(place, distance, way, nearer, there)) left_at = nearer, facing = there;
    }
    if (parts) facing = way;
    touch.left_at = left_at;
    if (!b_.map->locate(left_at, material_)) return;
    touch.entered = entered;
    touch.gradient = corners_.gradientAt(material_);
    if (!(touch.gradient.determinant() > 0)) touch.gradient = b_.turn;
    const Vector3f normal = cofactorOf(touch.gradient) * facing;
    if (!(normal.squaredNorm() > 0) || !normal.allFinite()) return;
    const Vector3f over = at - corners_.placeOf(material_);
    // The normal turns with b, and so does what lies along it and across: its change is how the two move apart where
    // the point is, not where its way out ends. Forces of a pair at one place turn nothing.
    touch.place = place;
    if (!b_.map->locate(place, material_)) return;
    const std::size_t first = list_.rows.size();
    list_.rows.resize(first + field_a.k + field_b.k);
    touch.row_a = std::uint32_t(first);
    touch.row_b = std::uint32_t(first + field_a.k);
    float *const row_a = list_.rows.data() + first, *const row_b = row_a + field_a.k;
    for (std::uint32_t j = 0; j < field_a.k; ++j) row_a[j] = field_a.valueAtPoint(p, j);
    setRow(field_b, material_, row_b);
    const Vector3f apart_before = sumOf(row_a, a_.before, field_a.k) + apart_ - corners_before_.placeOf(material_);
    const Vector3f motion = at - corners_.placeOf(material_) - apart_before;
    Touch& t = touch.touch;
    t.normal = normal.normalized();
    const float gap = t.normal.dot(over), gap_before = gap - t.normal.dot(motion);
    // A point that starts inside finds the surface where it is, and rising: as far as a step brings it out beyond its
    // load, so that a stuck one is no spring that winds up and a carrier does not sink. One from outside is
    // pressed in no deeper than it was where its way out is another one.
    const double diagonal = std::min(a_.diagonal, b_.diagonal), rise = kRecoverySpeed * h_ * diagonal;
    const bool came_in = !parts && (touched ? last->floor == 0 : gap_before >= 0);
    const double depth = touched ? double(last->depth) : 0;
    const double low = double(gap_before) + (came_in ? depth + rise : std::max(depth, rise));
    t.floor = float(std::min(came_in ? 0.0 : -kResolved * diagonal, low));
    t.gap = gap - t.floor;
    touch.coming = (gap_before - gap) / float(h_);
    const auto across = [&](const Vector3f& v) { return Vector3f(v - t.normal.dot(v) * t.normal); };
    t.friction = std::sqrt(a_.friction * b_.friction);
    t.slide = across(motion + a_.belt);
    Vector3f slid = Vector3f::Zero();  // before the step
    if (touched && b_.map->locate(Eigen::Map<const Vector3f>(last->anchor.data()), material_)) {
      slid = across(at - corners_.placeOf(material_) - motion);
      // A spring and a dashpot across have slid by no more than friction times what those along the normal are pressed
      // in (docs/method.md §4). What comes to more was carried through a shape that lies flat.
      const float length = slid.norm(), most = t.friction * last->depth;
      touch.held = length <= most;
      if (!touch.held) slid *= most / length;
      t.slide += slid;
    } else if (gap < 0 && gap_before > 0) {
      t.slide *= gap / (gap - gap_before);  // since it touched
    }
    touch.before = slid - std::max(0.0F, t.floor - gap_before) * t.normal;
    touch.memory = key;
    touch.memory.parting = parts ? 1 : 0;
    touch.memory.normal = {t.normal[0], t.normal[1], t.normal[2]};
    // Without the fall of this step, which what holds them takes back.
    if (!touched) touch.memory.speed = std::max(0.0F, touch.coming + t.normal.dot(point_fall_) / float(h_));
    if (touched) touch.memory.depth = last->depth, touch.memory.kappa = last->kappa;
    if (touch.held) touch.memory.anchor = last->anchor;
    // The way, not the normal that it has led to: from step to step the two would chase each other where the surface
    // bends as much as the point is deep.
    if (!touched) way = facing;
    touch.memory.outward = {way[0], way[1], way[2]};
    touch.over = over;
    if (isItself()) {  // one row, of what the two points move apart
      for (std::uint32_t j = 0; j < field_a.k; ++j) row_a[j] -= row_b[j], row_b[j] = 0;
    }
    list_.touches.push_back(touch);
  }

  /// Whether a point lay in b before the step.
  bool wasDeep(std::uint32_t p) {
    Vector3f place;
    float distance;
    return isNear(oldPlaceOf(p), 0, place, distance) && distance < -margin_;
  }

  /// The way back into a from one of its points, in b's rest shape; 0: not known.
  Vector3f wayBack(std::uint32_t p, const Vector3f& place) {
    Matrix3f back;
    if (isItself())
      return takesBack(place, back) ? Vector3f(-(back.inverse().transpose() * normalAt(p))) : Vector3f::Zero();
    if (a_.map == nullptr) return Vector3f::Zero();
    return -(b_.turn.transpose() * (a_.turn * a_.map->pointNormal(a_.field->points[p])));
  }

  /// leave(), from below the edge what lies beside it, where that is hardly farther than the nearest way out. \param
  /// distance of `place`.
  bool leaveAsBefore(const Vector3f& place, float distance, const Vector3f& way, Vector3f& left_at,
                     Vector3f& facing) const {
    Vector3f from = place;
    float outside = distance;
    if (distance > 0) {
      const Vector3f outward = b_.map->outward(place);
      from -= (distance + float(kNear * b_.diagonal)) * (outward - outward.dot(way) * way);
      outside = b_.map->distance(from);
    }
    if (!leaves(from, outside, way, left_at, facing)) return false;
    const float length = (left_at - place).norm();
    if (length <= std::abs(distance) + margin_) return true;
    // Near edges distances between nodes are shorter than any way.
    Vector3f nearest, there;
    return leaves(place, distance, b_.map->outward(place), nearest, there) &&
           length <= (nearest - place).norm() + margin_;
  }

 private:
  const TouchingPiece &a_, &b_;
  const double h_;
  std::span<const TouchMemory> known_;  ///< of points that have not been looked at
  TouchList& list_;
  const std::size_t stride_;
  const float margin_;
  const Vector3f apart_, travel_;
  const bool is_fast_;
  const Vector3f fall_;                     ///< of a against b, where pins drive neither
  const bool pins_;                         ///< drive one that falls
  Vector3f point_fall_ = Vector3f::Zero();  ///< fallOf() the point
  const Vector3f low_, high_;
  Corners corners_, corners_before_;  ///< of b at the prediction and before the step
  MaterialPoint material_;            ///< of b, located last
  Vector3f way_ = Vector3f::Zero();   ///< in b's rest shape, unit; 0: not known
  bool parting_ = false;              ///< the two started inside one another, and are still
  bool met_ = true;                   ///< the step before knew of them
  int axis_ = 0;                      ///< of a.order
  float reach_ = 0;                   ///< of neighbours, m
  std::array<float, kMostFunctions> row_;
};

/// A touch so fast that it could pass through is stopped in the step: few points share its momentum within
/// kPressedIn. A stiffened spring's stored energy stays as it was.
/// \param c its dashpot, N s/m.
void stopInTime(double mass, double diagonal, double h, double c, FoundTouch& found) {
  const double needed = mass * double(found.coming) / (h * kFew * diagonal * kPressedIn) - c / h;
  const float kappa_before = found.memory.kappa;
  found.memory.kappa = found.touch.kappa;
  if (!(needed > double(found.touch.kappa))) return;
  found.touch.kappa = found.memory.kappa = float(needed);
  if (!(found.memory.depth > 0) || !(kappa_before < found.touch.kappa)) return;
  const float less = found.memory.depth * (1 - std::sqrt(kappa_before / found.touch.kappa));
  found.touch.floor -= less;
  found.touch.gap += less;
}

}  // namespace

// All points count: a subset would change as bodies sway, and with it the springs
// (docs/decisions/0017-touch-at-rest.md).
void findTouches(const TouchingPiece& a, const TouchingPiece& b, std::uint32_t index_a, std::uint32_t index_b, double h,
                 TouchList& list) {
  if (b.map == nullptr || a.points.empty() || (&a == &b && a.order.empty())) return;
  TouchSearch search(a, b, h, list);
  if (!search.areNear()) return;
  const std::size_t first = list.touches.size();
  search.remember();
  search.lookAll();
  for (std::size_t i = first; i < list.touches.size(); ++i) {
    Touch& touch = list.touches[i].touch;
    touch.a = index_a;
    touch.b = index_b;
    const double area = double(a.field->points[list.touches[i].memory.point].area);
    touch.kappa = float(1 / (1 / firmness(a, area, b.firmer) + 1 / firmness(b, area, a.firmer)));
    const double mass = 1 / (1 / a.mass + 1 / b.mass),
                 c = pointDamping(double(touch.kappa), mass, double(a.damping_ratio));
    stopInTime(mass, std::min(a.diagonal, b.diagonal), h, c, list.touches[i]);
    damp(touch, c, h, list.touches[i].before);
  }
}

std::span<const TouchMemory> touchesOf(std::span<const TouchMemory> touches, std::uint32_t body, std::uint32_t piece) {
  return touchesBetween(touches, {body, piece, 0, 0, 0, 0, 0, 0, {}, {}, 0},
                        {body, piece + 1, 0, 0, 0, 0, 0, 0, {}, {}, 0});
}

TouchMemory rememberTouch(const FoundTouch& found, const Vector3f& moved) {
  const Touch& touch = found.touch;
  const float rise = touch.normal.dot(moved), gap = touch.gap + rise;
  Vector3f slide = touch.slide + (moved - rise * touch.normal);
  TouchMemory memory = found.memory;
  const float lag = touch.normal.dot(touch.lag);
  memory.floor = touch.floor;
  memory.depth = -gap - lag;
  Push push = touch;
  push.way = moved;
  push.pressed = touch.kappa * std::max(0.0F, -gap);
  const Vector3f force = -pushForce(push).pull;
  memory.force = {force[0], force[1], force[2]};
  // Friction holds at most its bound: beyond it the point it holds at comes along.
  const float length = slide.norm(), most = touch.friction * std::max(0.0F, -gap);
  if (found.held && length <= most) return memory;
  if (length > most) slide *= most / length;
  const Vector3f over = found.over + moved;
  const Vector3f anchor =
      found.left_at + boundedInverse(found.gradient) *
                          (over - touch.normal.dot(over) * touch.normal - slide - (touch.lag - lag * touch.normal));
  memory.anchor = {anchor[0], anchor[1], anchor[2]};
  return memory;
}

}  // namespace sinew::internal
