// SPDX-License-Identifier: MIT
#include "runtime/contact/contacts.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "runtime/clusters/algebra.h"
#include "runtime/contact/firmness.h"

namespace sinew::internal {
namespace {

/// Candidates a contact point at most, on average.
constexpr std::size_t kCandidates = 2;

Vector3d velocityOf(const Field& field, std::uint32_t point, const ConstCoefficientMap& v) {
  Vector3d sum = Vector3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) sum += double(field.valueAtPoint(point, j)) * v.row(j).transpose();
  return sum;
}

/// sqrt(mu_a mu_b), or that of the collider alone.
float frictionOf(const BodySettings& body, const Collider& collider) {
  const float own = collider.settings.friction;
  return body.friction >= 0 ? std::sqrt(body.friction * own) : own;
}

class Search {
 public:
  Search(const Piece& piece, const ContactStep& step, const ConstCoefficientMap& y, const Vector3d& center,
         ContactScratch& lent, MinimizeScratch& scratch)
      : piece_(piece),
        field_(piece.field()),
        step_(step),
        y_(y),
        center_(center),
        lent_(lent),
        scratch_(scratch),
        count_(std::uint32_t(field_.points.size())),
        blocks_((count_ + 7) / 8),
        margin_(kMargin * step.diagonal) {}

  void run() {
    bool placed = false;
    for (std::uint32_t c = 0; c < step_.colliders.size(); ++c) {
      const Collider& collider = *step_.colliders[c];
      if (collider.shape.isPlane()) {
        lookAtPlane(c, collider);
        placed = false;
      } else {
        if (!placed) findPlaces();
        placed = true;
        lookAtShape(c, collider);
      }
    }
    choose();
  }

 private:
  bool isFull() const { return lent_.candidates.size() >= kCandidates * count_; }

  void lookAtPlane(std::uint32_t number, const Collider& collider) {
    const NearPlace plane = collider.shape.near(Vector3d::Zero(), 0);
    const std::span<float> heights(lent_.places.data(), 8 * blocks_),
        old_heights(heights.data() + 8 * blocks_, 8 * blocks_);
    const Vector3d normal = collider.pose.rotation * plane.normal,
                   old_normal = collider.pose_before.rotation * plane.normal;
    for (std::uint32_t j = 0; j < field_.k; ++j) {
      const Vector3d arm = y_.row(j).transpose() - field_.oneOf(j) * center_;
      const Vector3d old = piece_.z().row(j).transpose() - field_.oneOf(j) * center_;
      scratch_.x[j] = float(normal.dot(arm));
      scratch_.next[j] = float(old_normal.dot(old));
    }
    kernels().field_heights({field_.k, blocks_, field_.point_values, scratch_.x.data(), heights.data()});
    kernels().field_heights({field_.k, blocks_, field_.point_values, scratch_.next.data(), old_heights.data()});
    const auto marginOf = [&](const Vector3d& n, const Vector3d& position) {
      return float(-plane.distance + n.dot(position) - n.dot(center_) + margin_);
    };
    const float margin = marginOf(normal, collider.pose.position);
    const float old_margin = marginOf(old_normal, collider.pose_before.position);
    for (std::uint32_t p = 0; p < count_ && !isFull(); ++p) {
      const bool near_before = old_heights[p] < old_margin;
      if (!(heights[p] < margin) && !near_before) continue;
      const bool stays = heights[p] < margin + normal.cast<float>().dot(fallOf(p));
      lent_.candidates.push_back({p, number, near_before, stays, plane.normal, -plane.distance});
    }
  }

  /// Places of the points at the prediction and before, relative to the centre.
  void findPlaces() {
    float* const places = lent_.places.data();
    for (std::uint32_t j = 0; j < field_.k; ++j) {
      const double one = field_.oneOf(j);
      for (std::uint32_t c = 0; c < 3; ++c) {
        scratch_.x[4 * j + c] = float(y_(j, c) - one * center_[c]);
        scratch_.next[4 * j + c] = float(piece_.z()(j, c) - one * center_[c]);
      }
    }
    kernels().field_values({field_.k, blocks_, field_.point_values, scratch_.x.data(), places});
    kernels().field_values({field_.k, blocks_, field_.point_values, scratch_.next.data(), places + 24 * blocks_});
  }
  Eigen::Vector3f placeOf(std::uint32_t p, bool before) const {
    const float* const block = lent_.places.data() + 24 * (p / 8 + (before ? blocks_ : 0)) + p % 8;
    return {block[0], block[8], block[16]};
  }

  /// How far a point falls in the prediction. What is held does not fall: where it touches is not to depend on the
  /// length of a step.
  Eigen::Vector3f fallOf(std::uint32_t p) const {
    double part = field_.driven == 0 ? 1 : 0;
    for (std::uint32_t j = field_.driven; field_.driven > 0 && j < field_.k; ++j) {
      part += double(field_.valueAtPoint(p, j)) * field_.oneOf(j);
    }
    return (part * step_.fall).cast<float>();
  }

  void lookAtShape(std::uint32_t number, const Collider& collider) {
    seen_ = 0;
    const Eigen::AlignedBox3d& bounds = collider.bounds();
    const Eigen::AlignedBox3f box((bounds.min() - center_).cast<float>().array() - float(margin_),
                                  (bounds.max() - center_).cast<float>().array() + float(margin_));
    for (std::uint32_t p = 0; p < count_ && !isFull(); ++p) {
      const Eigen::Vector3f now = placeOf(p, false), before = placeOf(p, true), lies = now - fallOf(p);
      const TouchingPoint* const touched = internal::touchedBefore(piece_, collider.id, p);
      Eigen::AlignedBox3f way(now.cwiseMin(before), now.cwiseMax(before));
      way.extend(lies);
      // A touching point may be pressed through a thin shape.
      if (touched == nullptr && !box.intersects(way)) continue;
      const Vector3d from = collider.pose_before.toLocal(center_ + before.cast<double>());
      const Vector3d to = collider.pose.toLocal(center_ + lies.cast<double>());
      if (!lookAtPath(number, collider, p, touched, from, to) &&
          (lies == now ||
           !lookAtPath(number, collider, p, touched, from, collider.pose.toLocal(center_ + now.cast<double>())))) {
        continue;
      }
      Candidate& found = lent_.candidates.back();
      found.stays = found.normal.dot(to) - found.offset < margin_;
    }
  }

  /// A point's path as its collider sees it, which is at rest there. \return whether it touches.
  bool lookAtPath(std::uint32_t number, const Collider& collider, std::uint32_t p, const TouchingPoint* touched,
                  const Vector3d& from, const Vector3d& to) {
    // Springs let points in a little: what touched begins where the surface was.
    Vector3d start = from;
    double height = 0;
    if (touched != nullptr) {
      height = std::min(0.0, double(touched->floor - touched->depth));
      start += (kResolved * step_.diagonal - height) * Eigen::Map<const Vector3d>(touched->normal.data());
    }
    if (touched == nullptr && isClear(to, margin_ + (to - from).norm())) return false;
    Candidate found = {p, number, touched != nullptr, true, Vector3d::Zero(), 0};
    found.from = from;
    // The plane of the last step, as far as the collider reaches.
    const auto staysAt = [&](const Vector3d& place) {
      if (touched == nullptr || !(collider.shape.near(place, margin_).distance < margin_)) return false;
      found.normal = Eigen::Map<const Vector3d>(touched->normal.data());
      found.offset = found.normal.dot(from) - height;
      return true;
    };
    // Along a hollow a point slides into the wall: the plane is that where it gets to, or half-way.
    const auto slide = [&] {
      if (collider.shape.isConvex() || !collider.shape.hasTriangles()) return;
      const Vector3d way = to - start, along = way - found.normal.dot(way) * found.normal;
      if (!(along.norm() > margin_)) return;
      const Vector3d on = start - (found.normal.dot(start) - found.offset) * found.normal;
      for (const double part : {1.0, 0.5}) {
        const Vector3d there = on + part * along;
        const NearPlace place = collider.shape.near(there, along.norm());
        if (!(place.distance < 0 && place.normal.dot(found.normal) > 0)) continue;
        found.normal = place.normal;
        found.offset = place.normal.dot(there) - place.distance;
        return;
      }
    };
    // What began inside a convex collider still comes out, by the way that was chosen for all.
    const bool comes_out =
        touched != nullptr && double(touched->floor) < -margin_ && collider.shape.isConvex() && staysAt(from);
    if (PathHit hit; !comes_out && collider.shape.enters(start, to, hit)) {
      found.normal = hit.normal;
      found.offset = hit.normal.dot(start + hit.part * (to - start));
      slide();
    } else if (!comes_out) {
      const double reach = margin_ + (to - start).norm();
      NearPlace place = collider.shape.near(to, reach);
      if (collider.shape.hasTriangles() && place.distance > 0)
        see(to, std::isfinite(place.distance) ? place.distance : reach);
      // A prediction that goes on as a thin part sprang leads away from what it lies on; and what has touched one side
      // of a thin shape does not leave by the other.
      const bool leads_away =
          !(place.distance < margin_) ||
          (touched != nullptr && place.normal.dot(Eigen::Map<const Vector3d>(touched->normal.data())) < 0);
      if (leads_away && staysAt(start)) {
        slide();
      } else {
        if (!(place.distance < margin_)) return false;
        Vector3d at = to;
        if (touched == nullptr) {  // what began inside leaves from there: the prediction may lie beyond
          const NearPlace before = collider.shape.near(from, reach);
          if (place.distance < 0 && before.distance < -kResolved * step_.diagonal && !collider.shape.isSolid()) {
            return false;  // it came from behind
          }
          if (before.distance < 0) place = before, at = from;
        }
        found.normal = place.normal;
        found.offset = place.normal.dot(at) - place.distance;
        found.inside = touched == nullptr && place.normal.dot(from) < found.offset - margin_;
      }
    }
    found.touched = touched != nullptr;
    found.near_before = found.normal.dot(from) - found.offset < margin_;
    lent_.candidates.push_back(found);
    return true;
  }

  /// Whether a place is farther from the collider than this, by what is known of others: no distance changes by more
  /// than one goes.
  bool isClear(const Vector3d& place, double distance) const {
    const auto all = std::span(clear_).first(std::min(seen_, clear_.size()));
    return std::any_of(all.begin(), all.end(), [&](const Clear& clear) {
      const double left = clear.distance - distance;
      return left > 0 && (place - clear.at).squaredNorm() < left * left;
    });
  }
  void see(const Vector3d& place, double distance) { clear_[seen_++ % clear_.size()] = {place, distance}; }

  /// A piece that begins within a convex collider leaves by one way, the shortest for all points there (the depth of
  /// two convex shapes): by ways of their own, to several sides, they would tear it apart. Points that came in beside
  /// others, pressed there by what is around them, leave as these do.
  void chooseWays() {
    for (std::uint32_t c = 0; c < step_.colliders.size(); ++c) {
      if (!step_.colliders[c]->shape.isConvex()) continue;
      const auto isIt = [c](const Candidate& candidate) { return candidate.collider == c && candidate.inside; };
      const Candidate* best = nullptr;
      double least = 0;
      bool follow = false;
      for (Candidate& candidate : lent_.candidates) {
        if (!isIt(candidate)) continue;
        least = std::numeric_limits<double>::infinity();
        const Candidate* way = nullptr;
        for (const Candidate& other : lent_.candidates) {
          const double depth = other.offset - other.normal.dot(candidate.from);
          if (other.collider == c && other.touched && depth < least) way = &other, least = depth;
        }
        if (way != nullptr) candidate.normal = way->normal, candidate.offset = way->offset, follow = true;
      }
      if (follow) continue;
      least = 0;
      for (const Candidate& way : lent_.candidates) {
        if (!isIt(way)) continue;
        double depth = 0;
        for (const Candidate& other : lent_.candidates) {
          if (isIt(other)) depth = std::max(depth, way.offset - way.normal.dot(other.from));
        }
        if (best == nullptr || depth < least) best = &way, least = depth;
      }
      if (best == nullptr) continue;
      const Candidate chosen = *best;
      for (Candidate& candidate : lent_.candidates) {
        if (isIt(candidate)) candidate.normal = chosen.normal, candidate.offset = chosen.offset;
      }
    }
  }

  /// Calls visit(candidates) for each collider that has some: they lie side by side.
  template <class Visit>
  void forEachCollider(const Visit& visit) const {
    const std::span<Candidate> all(lent_.candidates.data(), lent_.candidates.size());
    for (std::size_t first = 0, end = 0; first < all.size(); first = end) {
      while (end < all.size() && all[end].collider == all[first].collider) ++end;
      visit(all.subspan(first, end - first));
    }
  }

  /// Of many those carry first that are near before the step and stay so: which do must not depend on its length. Then
  /// those that come: what rolls leaves the others behind.
  static std::size_t rankOf(const Candidate& candidate) { return !candidate.stays ? 2 : candidate.near_before ? 0 : 1; }

  /// Colliders that have more than their share have as many as one another: what lies on the ground meets walls.
  void choose() {
    chooseWays();
    const auto takenBy = [this](std::size_t share) {
      std::size_t taken = 0;
      forEachCollider([&](std::span<const Candidate> of_one) { taken += std::min(of_one.size(), share); });
      return taken;
    };
    std::size_t share = 0;
    for (std::size_t step = std::bit_floor(std::size_t{kMostCarrying}); step > 0; step /= 2) {
      if (takenBy(share + step) <= kMostCarrying) share += step;
    }
    std::size_t left = kMostCarrying - takenBy(share);
    forEachCollider([&](std::span<Candidate> of_one) {
      std::size_t count = std::min(of_one.size(), share);
      if (count < of_one.size() && left > 0) ++count, --left;
      std::array<std::size_t, 3> of_rank = {};
      for (const Candidate& candidate : of_one) ++of_rank[rankOf(candidate)];
      std::size_t more = count * (kMostContacts - kMostCarrying) / kMostCarrying, none = 0;
      for (std::size_t& some : of_rank) {
        some = std::min(some, count);
        count -= some;
      }
      for (Candidate& candidate : of_one) {
        std::size_t& own = of_rank[rankOf(candidate)];
        std::size_t& allowed = own > 0 ? own : candidate.near_before ? more : none;
        if (allowed == 0) continue;
        --allowed;
        const TouchingPoint* const touched = touchedBefore(candidate);
        candidate.carries = &allowed != &more || (touched != nullptr && touched->depth > 0);
        if (candidate.carries) add(candidate);
      }
    });
    for (std::size_t i = 0; i < scratch_.contacts.size(); ++i) {
      Contact& contact = scratch_.contacts[i];
      float* const row = scratch_.rows.data() + std::size_t(field_.k) * i;
      for (std::uint32_t j = 0; j < field_.k; ++j) row[j] = field_.valueAtPoint(contact.point, j);
      contact.phi = row;
    }
  }

  const TouchingPoint* touchedBefore(const Candidate& candidate) const {
    return internal::touchedBefore(piece_, step_.colliders[candidate.collider]->id, candidate.point);
  }

  void add(const Candidate& candidate) {
    const Collider& collider = *step_.colliders[candidate.collider];
    const TouchingPoint* const touched = touchedBefore(candidate);
    const Vector3d at = positionOf(field_, candidate.point, y_, center_);
    const Vector3d before = collider.pose_before.toLocal(positionOf(field_, candidate.point, piece_.z(), center_));
    const Vector3d local = collider.pose.toLocal(at), normal = collider.pose.rotation * candidate.normal;
    const double gap = candidate.normal.dot(local) - candidate.offset;
    const double gap_before = candidate.normal.dot(before) - candidate.offset;
    Contact contact = {};
    contact.point = candidate.point;
    contact.collider = candidate.collider;
    contact.at = at;
    contact.rest = Eigen::Map<const Eigen::Vector3f>(field_.points[contact.point].at.data());
    contact.touch = formats::kNone;
    contact.normal = normal.cast<float>();
    contact.friction = frictionOf(*step_.body, collider);
    // A point that starts inside finds the plane lower, and rising, to come out at a bounded speed. One that touched
    // is pressed in no deeper than it was where its plane is another.
    double low = gap_before;
    if (touched != nullptr) {
      low = double(touched->floor);
      if (!collider.shape.isPlane()) low = std::min(low, gap_before + double(touched->depth));
    }
    contact.floor = float(std::min(0.0, low + kRecoverySpeed * step_.h * step_.diagonal));
    const double pressed_in = std::max(0.0, double(contact.floor) - gap_before);
    const double coming = touched == nullptr && gap < 0 ? comingOf(candidate, collider, before, normal) : 0;
    contact.speed = float(std::max(0.0, coming));
    contact.gap = float(gap - double(contact.floor));
    // A constant of the point, whatever else touches: else what rests would be a spring that changes.
    const double weight = std::max(step_.weight, field_.mass * kLeastGravity * step_.diagonal);
    double kappa = pointFirmness(double(step_.stiffness) * field_.young, double(field_.points[contact.point].area),
                                 weight, step_.diagonal, collider.firmer());
    const double damping = pointDamping(kappa, field_.mass, step_.damping_ratio);
    // But what could pass to the other side is stopped in the step in which it arrives.
    if (!collider.shape.isPlane() && coming > 0) {
      const double stops = field_.mass * coming / (step_.h * kFew * step_.diagonal * kPressedIn);
      kappa = std::max(kappa, stops - damping / step_.h);
    }
    contact.kappa = float(kappa);
    Vector3d anchor = before, belt = step_.h * asVector(collider.settings.surface_velocity).cast<double>();
    if (touched != nullptr) {
      anchor = Eigen::Map<const Vector3d>(touched->anchor.data());
    } else if (gap < 0 && gap_before > 0) {
      const double part = gap_before / (gap_before - gap);  // when it touched
      anchor += part * (local - before);
      belt *= 1 - part;
    }
    const Vector3d slide = at - collider.pose.toWorld(anchor + belt);
    contact.slide = (slide - normal.dot(slide) * normal).cast<float>();
    Vector3d slid = touched != nullptr ? Vector3d(collider.pose.rotation * (before - anchor)) : Vector3d::Zero();
    slid -= (normal.dot(slid) + pressed_in) * normal;
    damp(contact, damping, step_.h, slid.cast<float>());
    contact.firm = gap < margin_ ? contact.kappa : 0;
    scratch_.contacts.push_back(contact);
  }

  /// Speed at which a point comes, m/s.
  double comingOf(const Candidate& candidate, const Collider& collider, const Vector3d& before,
                  const Vector3d& normal) const {
    const Vector3d carried = (collider.pose.toWorld(before) - collider.pose_before.toWorld(before)) / step_.h;
    return normal.dot(carried - velocityOf(field_, candidate.point, piece_.v()));
  }

  const Piece& piece_;
  const Field& field_;
  const ContactStep& step_;
  const ConstCoefficientMap& y_;
  const Vector3d& center_;
  ContactScratch& lent_;
  MinimizeScratch& scratch_;
  const std::uint32_t count_, blocks_;
  const double margin_;
  /// A place that no surface of the collider at hand is nearer to, in its coordinates.
  struct Clear {
    Vector3d at;
    double distance;
  };
  std::array<Clear, 16> clear_;
  std::size_t seen_ = 0;
};

}  // namespace

// About a place near the piece: functions add up to 1 to the digits of floats only.
Vector3d positionOf(const Field& field, std::uint32_t point, const ConstCoefficientMap& z, const Vector3d& center) {
  Vector3d x = center;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    x += double(field.valueAtPoint(point, j)) * (z.row(j).transpose() - field.oneOf(j) * center);
  }
  return x;
}

bool areAllPlanes(std::span<const Collider* const> all) {
  return std::all_of(all.begin(), all.end(), [](const Collider* collider) { return collider->shape.isPlane(); });
}

const TouchingPoint* touchedBefore(const Piece& piece, std::uint32_t collider, std::uint32_t point) {
  const auto& touching = piece.state.touching;
  const auto before = [](const TouchingPoint& t, const std::pair<std::uint32_t, std::uint32_t>& key) {
    return std::pair(t.collider, t.point) < key;
  };
  const auto* const found = std::lower_bound(touching.begin(), touching.end(), std::pair(collider, point), before);
  return found != touching.end() && found->collider == collider && found->point == point ? found : nullptr;
}

void ContactScratch::reserve(const Field& field) {
  const std::size_t points = field.points.size(), floats = (points + 7) / 8 * 48;
  if (places.size() < floats) places.resize(floats);
  candidates.reserve(kCandidates * points);
}

void ContactScratch::reserveNear(const Field& field, std::span<const Collider* const> all) {
  near.reserve(all.size());
  if (areAllPlanes(all)) return;
  touches.touches.reserve(kMostLooked);
  touches.rows.reserve(kMostLooked * (4 + std::size_t(field.k)));
}

void findReach(const Field& field, Array<float>& reach) {
  reach.resize(field.k);
  for (std::uint32_t j = 0; j < field.k; ++j) {
    for (std::uint32_t p = 0; p < field.points.size(); ++p) {
      reach[j] = std::max(reach[j], std::abs(field.valueAtPoint(p, j)));
    }
  }
}

void findNear(const Piece& piece, std::span<const Collider* const> all, const ContactStep& step,
              const ConstCoefficientMap& y, const Vector3d& center, ContactScratch& scratch) {
  const Field& field = piece.field();
  scratch.near.clear();
  scratch.reach.setZero();
  if (field.points.empty() || all.empty()) return;
  // |x - c| <= sum_j max |phi_j| |z_j - one_j c|, at the prediction and before.
  Vector3d& reach = scratch.reach;
  reach = Vector3d::Constant(kMargin * step.diagonal) + step.fall.cwiseAbs();
  bool bounded = false;
  for (const Collider* collider : all) {
    const ColliderSettings& other = collider->settings;
    if ((other.layers & step.body->touches) == 0 || (step.body->layers & other.touches) == 0) continue;
    if (!collider->shape.isPlane()) {
      if (!bounded) {
        for (std::uint32_t j = 0; j < field.k; ++j) {
          const Vector3d middle = field.oneOf(j) * center;
          const Vector3d now = y.row(j).transpose() - middle, before = piece.z().row(j).transpose() - middle;
          reach += double(piece.reach()[j]) * now.cwiseAbs().cwiseMax(before.cwiseAbs());
        }
      }
      bounded = true;
      const auto touches = [collider](const TouchingPoint& point) { return point.collider == collider->id; };
      const auto& touching = piece.state.touching;
      if (!collider->bounds().intersects(Eigen::AlignedBox3d(center - reach, center + reach)) &&
          std::none_of(touching.begin(), touching.end(), touches)) {
        continue;
      }
    }
    scratch.near.push_back(collider);
  }
}

void findContacts(const Piece& piece, const ContactStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                  ContactScratch& lent, MinimizeScratch& scratch) {
  scratch.contacts.clear();
  lent.candidates.clear();
  lent.touches.touches.clear();
  lent.touches.rows.clear();
  if (!step.colliders.empty()) Search(piece, step, y, center, lent, scratch).run();
}

void giveWay(const ContactStep& step, std::span<Contact> contacts) {
  for (std::uint32_t c = 0; c < step.colliders.size(); ++c) {
    const Collider& collider = *step.colliders[c];
    if (!(collider.settings.mass > 0)) continue;
    const auto carries = [c](const Contact& contact) { return contact.collider == c && contact.gap < 0; };
    const auto sharing = std::max<std::ptrdiff_t>(1, std::count_if(contacts.begin(), contacts.end(), carries));
    for (Contact& contact : contacts) {
      if (contact.collider != c) continue;
      const double yields =
          double(sharing) * step.h * step.h * collider.inverseMassAt(contact.at, contact.normal.cast<double>());
      contact.kappa = contact.firm = float(1 / (1 / double(contact.kappa) + yields));
    }
  }
}

namespace {

/// Remembers the points that are in shapes and do not carry: candidates beyond the number, and those that the step's
/// end, not its prediction, led in. \param scratch lends x and next.
void rememberOthers(Piece& piece, const ContactStep& step, const Vector3d& center, ContactScratch& lent,
                    MinimizeScratch& scratch) {
  const Field& field = piece.field();
  if (areAllPlanes(step.colliders)) return;
  const auto isShape = [&](std::uint32_t c) { return !step.colliders[c]->shape.isPlane(); };
  bool may = std::any_of(lent.candidates.begin(), lent.candidates.end(),
                         [&](const Candidate& candidate) { return !candidate.carries && isShape(candidate.collider); });
  double way = 0;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Vector3d now = piece.state.z[j] - field.oneOf(j) * center,
                   before = piece.state.z_before[j] - field.oneOf(j) * center;
    way += double(piece.reach()[j]) * (now - before).norm();
    for (std::uint32_t c = 0; c < 3; ++c) {
      scratch.x[4 * j + c] = float(now[int(c)]);
      scratch.next[4 * j + c] = float(before[int(c)]);
    }
  }
  may = may || way > kMargin * step.diagonal;
  const auto count = std::uint32_t(field.points.size()), blocks = (count + 7) / 8;
  auto& touching = piece.state.touching;
  const Candidate* candidate = lent.candidates.begin();
  bool placed = false;
  for (std::uint32_t c = 0; may && c < step.colliders.size(); ++c) {
    const Collider& collider = *step.colliders[c];
    while (candidate != lent.candidates.end() && candidate->collider < c) ++candidate;
    if (!isShape(c)) continue;
    if (!placed) {
      kernels().field_values({field.k, blocks, field.point_values, scratch.x.data(), lent.places.data()});
      kernels().field_values(
          {field.k, blocks, field.point_values, scratch.next.data(), lent.places.data() + 24 * blocks});
    }
    placed = true;
    for (std::uint32_t p = 0; p < count; ++p) {
      const Candidate* const own =
          candidate != lent.candidates.end() && candidate->collider == c && candidate->point == p ? candidate++
                                                                                                  : nullptr;
      if ((own != nullptr && own->carries) || touching.size() == mostTouching(field)) continue;
      const auto placeOf = [&](const float* places) {
        const float* const at = places + 24 * (p / 8) + p % 8;
        return Vector3d(center + Vector3d(double(at[0]), double(at[8]), double(at[16])));
      };
      const Vector3d now = placeOf(lent.places.data());
      Vector3d normal;
      double height;
      if (own != nullptr) {
        normal = own->normal;
        height = normal.dot(collider.pose.toLocal(now)) - own->offset;
      } else {
        const Vector3d before = placeOf(lent.places.data() + 24 * blocks);
        PathHit hit;
        if (!collider.bounds().intersects(Eigen::AlignedBox3d(now.cwiseMin(before), now.cwiseMax(before)))) continue;
        const Vector3d from = collider.pose_before.toLocal(before), to = collider.pose.toLocal(now);
        if (!collider.shape.enters(from, to, hit)) continue;
        normal = hit.normal;
        height = (1 - hit.part) * normal.dot(to - from);
      }
      if (!(height < 0)) continue;
      const Vector3d at = collider.pose.toLocal(now);
      touching.push_back({p, collider.id, float(height), 0, {at[0], at[1], at[2]}, {normal[0], normal[1], normal[2]}});
    }
  }
  if (!placed) return;
  std::sort(touching.begin(), touching.end(), [](const TouchingPoint& a, const TouchingPoint& b) {
    return a.collider != b.collider ? a.collider < b.collider : a.point < b.point;
  });
}

}  // namespace

void rememberContacts(Piece& piece, const ContactStep& step, const Vector3d& center, ContactScratch& lent,
                      double seconds, const Vector3d* given, const Objective& objective,
                      Array<ColliderTouch>& touches) {
  const MinimizeScratch& scratch = *objective.scratch;
  piece.state.touching.clear();
  const std::size_t first = touches.size();
  for (Contact contact : scratch.contacts) {
    const Eigen::Vector3f moved = contact.way = objective.wayOf(contact.phi, scratch.d.data());
    const float rise = contact.normal.dot(moved), lag = contact.normal.dot(contact.lag);
    const float gap = std::min(0.0F, contact.gap + rise), height = contact.floor + contact.gap + rise;
    const Collider& collider = *step.colliders[contact.collider];
    Vector3d at = contact.at;
    const bool pushes = contact.gap + lag + rise < 0;
    // What still is in a shape leaves by the way by which it came in.
    if (!pushes && (!(height < 0) || collider.shape.isPlane() || contact.touch != formats::kNone)) continue;
    if (contact.touch != formats::kNone) {
      const TouchMemory memory = rememberTouch(lent.touches.touches[contact.touch], -moved);
      piece.state.touching.push_back(
          {contact.point,
           collider.id,
           memory.floor,
           memory.depth,
           {double(memory.anchor[0]), double(memory.anchor[1]), double(memory.anchor[2])},
           {double(memory.outward[0]), double(memory.outward[1]), double(memory.outward[2])}});
    } else {
      at += moved.cast<double>();
      Vector3d slide = (contact.slide + (moved - rise * contact.normal)).cast<double>();
      // Friction holds at most its bound: beyond it the point it holds at comes along.
      const double length = slide.norm(), most = double(contact.friction) * -double(gap);
      if (length > most) slide *= most / length;
      const Vector3d anchor = collider.pose.toLocal(at - slide - (contact.lag - lag * contact.normal).cast<double>());
      const Vector3d normal = collider.pose.rotation.transpose() * contact.normal.cast<double>();
      piece.state.touching.push_back({contact.point,
                                      collider.id,
                                      pushes ? contact.floor : height,
                                      pushes ? -(contact.gap + lag + rise) : 0,
                                      {anchor[0], anchor[1], anchor[2]},
                                      {normal[0], normal[1], normal[2]}});
    }
    if (!(gap < 0)) continue;  // damped, it springs back by itself
    if (touches.size() == first || touches.back().collider != collider.id) {
      const Vector3d none = Vector3d::Zero();
      touches.push_back({collider.id, none, none, none, 0, none, 0});
    }
    const Vector3d impulse = seconds * pushForce(contact).pull.cast<double>();
    const double load = double(contact.kappa) * -double(gap);
    ColliderTouch& touch = touches.back();
    touch.impulse += impulse;
    touch.push += seconds * load * contact.normal.cast<double>();
    touch.torque += (at - collider.pose.position).cross(impulse);
    touch.place += load * (at - collider.pose.position);
    touch.load += load;
    touch.speed = std::max(touch.speed, contact.speed);
  }
  rememberOthers(piece, step, center, lent, *objective.scratch);
  if (given == nullptr || scratch.contacts.empty()) return;
  if (touches.size() == first) {
    // A contact that pressed while minimizing may not press at its end.
    const auto deeper = [](const Contact& a, const Contact& b) { return a.gap < b.gap; };
    const Contact& deepest = *std::min_element(scratch.contacts.begin(), scratch.contacts.end(), deeper);
    const Collider& collider = *step.colliders[deepest.collider];
    const Vector3d place = deepest.at - collider.pose.position;
    touches.push_back({collider.id, Vector3d::Zero(), Vector3d::Zero(), place, 1, Vector3d::Zero(), 0});
  }
  // Momentum that minimizing left, by load.
  Vector3d left = *given;
  double load = 0;
  for (std::size_t i = first; i < touches.size(); ++i) {
    left -= touches[i].impulse;
    load += touches[i].load;
  }
  for (std::size_t i = first; i < touches.size(); ++i) {
    touches[i].impulse += touches[i].load / load * left;
    touches[i].torque += (touches[i].place / load).cross(left);
  }
}

}  // namespace sinew::internal
