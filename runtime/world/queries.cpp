// SPDX-License-Identifier: MIT
//
// Rays, balls and boxes against bodies as they are drawn, and colliders.
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/geometry/triangle.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;
using internal::Collider;
using internal::Corners;
using internal::Pose;
using internal::Shape;
using internal::Vector3d;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Nearer than this part of its radius a ball touches.
constexpr double kTouches = 1e-4;
/// Steps towards it: each leaves less than a half of the way unless the ball grazes.
constexpr int kSteps = 100;

Vector3d normalOf(const Corners& t) { return (t.at[1] - t.at[0]).cross(t.at[2] - t.at[0]).normalized(); }

double distanceTo(const Corners& t, const Vector3d& p) {
  return (geometry::closestPointOnTriangle(p, t.at[0], t.at[1], t.at[2]) - p).norm();
}

/// Part of a ball's path at which it touches what `distance` measures the distance of its centre to: conservative
/// advancement (Mirtich 1996).
template <class Distance>
double touchOf(const Vector3d& from, const Vector3d& way, double radius, const Distance& distance) {
  const double length = way.norm();
  double part = 0;
  for (int i = 0; i < kSteps && part <= 1; ++i) {
    const double left = distance(Vector3d(from + part * way)) - radius;
    if (left <= kTouches * radius) return part;
    part += left / length;
  }
  return kInfinity;
}

/// Square of the distance of a triangle's box, without Eigen's calls: most are looked at no further.
double boxDistance2(std::span<const Vec3> points, const formats::Triangle& t, const Vec3& place) {
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const float a = points[t[0]][c], b = points[t[1]][c], d = points[t[2]][c], p = place[c];
    const float low = std::min(a, std::min(b, d)), high = std::max(a, std::max(b, d));
    const double way = double(std::max(low, std::min(high, p))) - double(p);
    sum += way * way;
  }
  return sum;
}

/// The sides of a path, a box along it, beyond which points lie: a triangle whose corners share one is not near it
/// (outcodes of Cohen and Sutherland: Newman, Sproull 1979).
class PathSides {
 public:
  PathSides(const Vector3d& from, const Vector3d& way, double radius) {
    constexpr double kRounding = 1e-12;  // relative; sums of three products of doubles are off by 1e-15
    const double length = way.norm(), room = radius + kRounding * (from.norm() + length);
    axis_[0] = way / length;
    axis_[1] = axis_[0].unitOrthogonal();
    axis_[2] = axis_[0].cross(axis_[1]);
    for (int c = 0; c < 3; ++c) {
      const double at = axis_[c].dot(from);
      low_[c] = at - room;
      high_[c] = at + room + (c == 0 ? length : 0);
    }
  }

  void find(std::span<const Vec3> points, internal::Array<std::uint8_t>& sides) const {
    sides.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double x = double(points[i][0]), y = double(points[i][1]), z = double(points[i][2]);
      unsigned side = 0;
      for (int c = 0; c < 3; ++c) {
        const double at = axis_[c][0] * x + axis_[c][1] * y + axis_[c][2] * z;
        side |= (unsigned(at < low_[c]) | unsigned(at > high_[c]) << 1) << 2 * c;
      }
      sides[i] = std::uint8_t(side);
    }
  }

 private:
  Vector3d axis_[3];
  double low_[3], high_[3];
};

/// Solid angle of a triangle over 4 pi (Van Oosterom, Strackee 1983): their sum over a closed surface is 1 inside it.
double windingOf(const Corners& t, const Vector3d& p) {
  const Vector3d a = t.at[0] - p, b = t.at[1] - p, c = t.at[2] - p;
  const double al = a.norm(), bl = b.norm(), cl = c.norm();
  return std::atan2(a.dot(b.cross(c)), al * bl * cl + a.dot(b) * cl + b.dot(c) * al + c.dot(a) * bl) / (2 * M_PI);
}

/// Weights of a triangle's corners of a point in it.
Vec3 weightsOf(const Corners& t, const Vector3d& point) {
  const Vector3d normal = (t.at[1] - t.at[0]).cross(t.at[2] - t.at[0]);
  const auto share = [&](int a, int b) {
    return (t.at[a] - point).cross(t.at[b] - point).dot(normal) / std::max(normal.squaredNorm(), 1e-300);
  };
  const float first = float(share(1, 2)), second = float(share(2, 0));
  return {first, second, 1 - first - second};
}

/// Whether points (a triangle's corners, a box's) have a part in a box about the origin: no axis separates them
/// (Gottschalk 1996). \param edges, normals of their convex hull.
bool meetsBox(std::span<const Vector3d> points, std::span<const Vector3d> edges, std::span<const Vector3d> normals,
              const Vector3d& half) {
  const auto separates = [&](const Vector3d& axis) {
    double low = kInfinity, high = -kInfinity;
    for (const Vector3d& p : points) {
      low = std::min(low, axis.dot(p));
      high = std::max(high, axis.dot(p));
    }
    const double reach = half.dot(axis.cwiseAbs());
    return low > reach || high < -reach;
  };
  bool apart = std::any_of(normals.begin(), normals.end(), separates);
  for (int c = 0; c < 3 && !apart; ++c) {
    apart = separates(Vector3d::Unit(c)) || std::any_of(edges.begin(), edges.end(), [&](const Vector3d& e) {
              return separates(Vector3d::Unit(c).cross(e));
            });
  }
  return !apart;
}

/// Shape that overlaps() asks about: a ball about the origin of its own coordinates, or a box.
struct Probe {
  Pose pose;
  Vector3d half = Vector3d::Zero();  ///< of the box
  double radius = 0;                 ///< of the ball; 0: a box

  bool meets(const Corners& t) const {
    if (radius > 0) return distanceTo(t, pose.position) <= radius;
    const Vector3d points[3] = {pose.toLocal(t.at[0]), pose.toLocal(t.at[1]), pose.toLocal(t.at[2])};
    const Vector3d edges[3] = {points[1] - points[0], points[2] - points[1], points[0] - points[2]};
    const Vector3d normal = edges[0].cross(edges[1]);
    return meetsBox(points, edges, {&normal, 1}, half);
  }

  bool meets(const Collider& collider) const {
    const Shape& shape = collider.shape;
    const Pose there(collider.at);
    const Vector3d middle = there.toLocal(pose.position);
    const Eigen::Matrix3d turn = there.rotation.transpose() * pose.rotation;
    const double near = shape.near(middle, radius > 0 ? radius : kInfinity).distance;
    if (near <= radius && shape.isSolid()) return true;
    if (radius > 0) return std::abs(near) <= radius;
    const Vector3d reach = turn.cwiseAbs() * half;
    if (shape.isPlane()) return near <= (turn.transpose() * shape.near(middle, 0).normal).cwiseAbs().dot(half);
    const Eigen::AlignedBox3d box(middle - reach, middle + reach);
    if (!box.intersects(shape.bounds())) return false;
    if (shape.hasTriangles()) {
      bool found = false;
      shape.forEachTriangle(box, [&](const Corners& t, std::uint32_t) {
        found = found || meets(Corners{{there.toWorld(t.at[0]), there.toWorld(t.at[1]), there.toWorld(t.at[2])}});
      });
      return found;
    }
    if (shape.isBox()) {
      Vector3d corners[8], edges[3];
      for (int c = 0; c < 3; ++c) edges[c] = turn.transpose().col(c);
      for (int i = 0; i < 8; ++i) {
        const Vector3d signs(i % 2 != 0 ? 1 : -1, i / 2 % 2 != 0 ? 1 : -1, i / 4 != 0 ? 1 : -1);
        corners[i] = turn.transpose() * (signs.cwiseProduct(shape.half()) - middle);
      }
      return meetsBox(corners, edges, edges, half);
    }
    // A capsule: the distance of a box is convex along its segment.
    const auto off = [&](double y) {
      const Vector3d p = turn.transpose() * (Vector3d(0, y, 0) - middle);
      return (p.cwiseAbs() - half).cwiseMax(0).norm();
    };
    double low = -shape.half().y(), high = shape.half().y();
    for (int i = 0; i < kSteps; ++i) {
      const double a = low + (high - low) / 3, b = high - (high - low) / 3;
      (off(a) <= off(b) ? high : low) = off(a) <= off(b) ? b : a;
    }
    return off(low) <= shape.radius();
  }
};

}  // namespace

void World::Impl::drawInto(const Body& body, internal::Array<Vec3>& drawn) const {
  showDrawn(const_cast<Body&>(body));
  drawn.resize(body.package().visualPositions().size());
  if (drawn.empty()) return;
  const VertexRun all = {0, std::uint32_t(drawn.size())};
  VisualOutput output;
  output.positions = {drawn[0].data(), sizeof(Vec3), all.count};
  draw(body, {&all, 1}, output, jobs);
}

void World::Impl::forEachDrawn(const QueryFilter& filter,
                               const std::function<void(const Body&, std::span<const Vec3>)>& visit) const {
  internal::Array<Vec3> drawn(memory);
  for (const internal::BodyPointer& body : bodies) {
    if (!filter.bodies || (body->settings.layers & filter.layers) == 0) continue;
    if (body->activity == Activity::disabled) continue;
    drawInto(*body, drawn);
    if (!drawn.empty()) visit(*body, {drawn.data(), drawn.size()});
  }
}

bool World::Impl::isRay(const char* call, const Vec3& origin, const Vec3& direction, float distance) const {
  const char* fault = nullptr;
  if (!(std::abs(asVector(direction).norm() - 1) < 1e-3F)) fault = "the direction is no unit vector";
  if (!internal::stateIsUsable(origin, {})) fault = "the origin is not finite, or beyond 1e15 m";
  if (!(distance > 0 && std::isfinite(distance))) fault = "the distance is not above 0 and finite";
  if (fault != nullptr) tell(LogSeverity::error, "%s: %s", call, fault);
  return fault == nullptr;
}

std::optional<CastHit> World::Impl::cast(const char* call, Vec3 origin, double radius, Vec3 direction, float distance,
                                         const QueryFilter& filter) const {
  std::optional<CastHit> best;
  const Presence presence(*this, call, As::draws);
  if (!presence) return best;
  if (!isRay(call, origin, direction, distance)) return best;
  if (!(radius >= 0)) {
    tell(LogSeverity::error, "%s: the radius is not usable", call);
    return best;
  }
  const Vector3d from = wide(origin), way = double(distance) * wide(direction);
  double part = 1;
  const auto take = [&](const QueryObject& object, double at, const Vector3d& point, const Vector3d& normal,
                        std::uint32_t triangle) {
    part = at;
    best = {object,
            float(at * double(distance)),
            asArray(Eigen::Vector3f(point.cast<float>())),
            asArray(Eigen::Vector3f(normal.cast<float>())),
            triangle,
            {}};
  };
  const auto lookAt = [&](const Corners& t, const auto& found) {
    const Vector3d room = Vector3d::Constant(radius);
    Eigen::AlignedBox3d path(from.cwiseMin(from + part * way) - room, from.cwiseMax(from + part * way) + room);
    if (!path.intersects(Eigen::AlignedBox3d(t.at[0]).extend(t.at[1]).extend(t.at[2]))) return;
    const double at = radius > 0 ? touchOf(from, way, radius, [&](const Vector3d& p) { return distanceTo(t, p); })
                                 : internal::entryOf(from, way, t);
    if (at > part || (at == part && best)) return;
    const Vector3d center = from + at * way;
    const Vector3d point = radius > 0 ? geometry::closestPointOnTriangle(center, t.at[0], t.at[1], t.at[2]) : center;
    const Vector3d arm = center - point;
    found(at, point, arm.norm() > 0 && radius > 0 ? Vector3d(arm.normalized()) : normalOf(t));
  };
  return guarded(call, std::optional<CastHit>(), [&] {
    const PathSides path(from, way, radius);
    internal::Array<std::uint8_t> sides(memory);
    forEachDrawn(filter, [&](const Body& body, std::span<const Vec3> drawn) {
      path.find(drawn, sides);
      std::uint32_t number = 0;
      for (const formats::Triangle& t : body.package().visualTriangles()) {
        if ((sides[t[0]] & sides[t[1]] & sides[t[2]]) != 0) {
          ++number;
          continue;
        }
        const Corners corners = {{wide(drawn[t[0]]), wide(drawn[t[1]]), wide(drawn[t[2]])}};
        lookAt(corners, [&](double at, const Vector3d& point, const Vector3d& normal) {
          take({body.id, {}}, at, point, normal, number);
          best->at = {t, weightsOf(corners, point)};
        });
        ++number;
      }
    });
    forEachCollider(filter, [&](const Collider& collider) {
      const Pose pose(collider.at);
      const QueryObject object = {formats::kNone, ColliderId{collider.id}};
      const Vector3d start = pose.toLocal(from), end = pose.toLocal(from + way), along = end - start;
      const Shape& shape = collider.shape;
      if (radius > 0 && shape.hasTriangles()) {
        const Vector3d room = Vector3d::Constant(radius);
        shape.forEachTriangle({start.cwiseMin(end) - room, start.cwiseMax(end) + room},
                              [&](const Corners& t, std::uint32_t) {
                                lookAt({{pose.toWorld(t.at[0]), pose.toWorld(t.at[1]), pose.toWorld(t.at[2])}},
                                       [&](double at, const Vector3d& point, const Vector3d& normal) {
                                         take(object, at, point, normal, formats::kNone);
                                       });
                              });
        return;
      }
      internal::PathHit hit = {kInfinity, Vector3d::UnitY()};
      double depth = 0;
      if (radius > 0) {
        hit.part = touchOf(start, along, radius, [&](const Vector3d& p) { return shape.near(p, kInfinity).distance; });
        if (!(hit.part < part)) return;
        const internal::NearPlace near = shape.near(start + hit.part * along, kInfinity);
        hit.normal = near.normal;
        depth = near.distance;
      } else if (!shape.enters(start, end, hit) || !(hit.part < part)) {
        return;
      }
      const Vector3d normal = pose.rotation * hit.normal;
      take(object, hit.part, from + hit.part * way - depth * normal, normal, formats::kNone);
    });
    return best;
  });
}

void World::Impl::forEachCollider(const QueryFilter& filter, const std::function<void(const Collider&)>& visit) const {
  if (!filter.colliders) return;
  if (settings.ground.enabled && (ground.settings.layers & filter.layers) != 0) {
    const Collider plane(kGroundCollider.value, PlaneShape{settings.ground.normal, settings.ground.offset}, {}, memory);
    visit(plane);
  }
  for (const Collider& collider : colliders) {
    if ((collider.settings.layers & filter.layers) != 0) visit(collider);
  }
}

std::optional<CastHit> World::rayCast(Vec3 origin, Vec3 direction, float distance, const QueryFilter& filter) const {
  return impl_->cast("rayCast", origin, 0, direction, distance, filter);
}

std::optional<CastHit> World::sphereCast(Vec3 origin, float radius, Vec3 direction, float distance,
                                         const QueryFilter& filter) const {
  return impl_->cast("sphereCast", origin, double(radius == 0 ? std::numeric_limits<float>::min() : radius), direction,
                     distance, filter);
}

BodyPoint World::nearestPoint(BodyId id, Vec3 place) const {
  BodyPoint nearest;
  nearest.weight = {0, 0, 0};
  const Impl::Presence presence(*impl_, "nearestPoint", Impl::As::draws);
  const Body* const body = presence.find(id);
  if (body == nullptr) return nearest;
  if (!internal::stateIsUsable(place, {})) {
    impl_->tell(LogSeverity::error, "nearestPoint: the place is not finite, or beyond 1e15 m");
    return nearest;
  }
  return impl_->guarded("nearestPoint", nearest, [&] {
    internal::Array<Vec3> drawn(impl_->memory);
    impl_->drawInto(*body, drawn);
    double least = kInfinity;
    for (const formats::Triangle& t : body->package().visualTriangles()) {
      if (boxDistance2({drawn.data(), drawn.size()}, t, place) > least * least) continue;
      const Corners corners = {{wide(drawn[t[0]]), wide(drawn[t[1]]), wide(drawn[t[2]])}};
      const double distance = distanceTo(corners, wide(place));
      if (!(distance < least)) continue;
      least = distance;
      const Vector3d point = geometry::closestPointOnTriangle(wide(place), corners.at[0], corners.at[1], corners.at[2]);
      nearest = {t, weightsOf(corners, point)};
    }
    return nearest;
  });
}

namespace {

/// Writes what is found as long as there is room, and counts all.
class Found {
 public:
  explicit Found(std::span<QueryObject> out) : out_(out) {}
  void add(const QueryObject& object) {
    if (count_ < out_.size()) out_[count_] = object;
    ++count_;
  }
  std::size_t count() const { return count_; }

 private:
  std::span<QueryObject> out_;
  std::size_t count_ = 0;
};

}  // namespace

std::size_t World::overlaps(Vec3 center, float radius, std::span<QueryObject> found, const QueryFilter& filter) const {
  if (!(radius > 0 && std::isfinite(radius) && internal::stateIsUsable(center, {}))) {
    impl_->tell(LogSeverity::error, "overlaps: the centre or radius is not usable");
    return 0;
  }
  return impl_->overlaps({center}, {}, radius, found, filter);
}

std::size_t World::overlaps(const BoxShape& box, const RigidTransform& at, std::span<QueryObject> found,
                            const QueryFilter& filter) const {
  if (Shape::faultOf(box) != nullptr || !internal::isProper(at)) {
    impl_->tell(LogSeverity::error, "overlaps: the box or its transform is not usable");
    return 0;
  }
  return impl_->overlaps(at, box.half_size, 0, found, filter);
}

std::size_t World::Impl::overlaps(const RigidTransform& at, const Vec3& half, float radius, std::span<QueryObject> out,
                                  const QueryFilter& filter) const {
  const Presence presence(*this, "overlaps", As::draws);
  if (!presence) return 0;
  const Probe probe = {Pose(at), wide(half), double(radius)};
  return guarded("overlaps", std::size_t(0), [&] {
    Found found(out);
    forEachDrawn(filter, [&](const Body& body, std::span<const Vec3> drawn) {
      bool meets = false;
      double winding = 0;
      for (const formats::Triangle& t : body.package().visualTriangles()) {
        const Corners corners = {{wide(drawn[t[0]]), wide(drawn[t[1]]), wide(drawn[t[2]])}};
        meets = meets || probe.meets(corners);
        winding += windingOf(corners, probe.pose.position);
      }
      if (meets || winding > 0.5) found.add({body.id, {}});
    });
    forEachCollider(filter, [&](const Collider& collider) {
      if (probe.meets(collider)) found.add({formats::kNone, ColliderId{collider.id}});
    });
    return found.count();
  });
}

}  // namespace sinew
