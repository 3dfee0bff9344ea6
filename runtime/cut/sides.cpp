// SPDX-License-Identifier: MIT
#include "runtime/cut/sides.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <unordered_map>

namespace sinew::cutting {
namespace {

/// Of the diagonal: what lies so near to the plane is on it. Floats far from the origin round to more.
constexpr double kNear = 1e-6, kRounding = 4e-7;
/// Of the diagonal: vertices of one place at rest are one point while they are no farther apart than there.
constexpr double kTogether = 1e-5;

std::uint64_t mixed(std::uint64_t a) {
  a ^= a >> 30;
  a *= 0xbf58476d1ce4e5b9U;
  a ^= a >> 27;
  a *= 0x94d049bb133111ebU;
  return a ^ (a >> 31);
}

/// By the identity of the package where it has one, else by equal places at rest.
std::vector<std::uint32_t> restPoints(const formats::PackageView& package) {
  const std::size_t count = package.visualPositions().size();
  std::vector<std::uint32_t> of(count);
  if (!package.visualIdentity().empty()) {
    for (std::size_t i = 0; i < count; ++i) of[i] = package.visualIdentity()[i].welded;
    return of;
  }
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> seen;
  seen.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const formats::Float3& at = package.visualPositions()[i];
    std::array<std::uint32_t, 3> bits = {};
    for (std::size_t c = 0; c < 3; ++c) {
      const float value = at[c] + 0.0F;  // -0 is 0
      std::memcpy(&bits[c], &value, sizeof value);
    }
    std::vector<std::uint32_t>& list = seen[mixed(mixed(mixed(bits[0]) + bits[1]) + bits[2])];
    const auto* const same = std::find_if(list.data(), list.data() + list.size(),
                                          [&](std::uint32_t other) { return package.visualPositions()[other] == at; });
    if (same != list.data() + list.size()) {
      of[i] = *same;
    } else {
      list.push_back(i);
      of[i] = i;
    }
  }
  return of;
}

void weld(const formats::PackageView& package, double diagonal, Sides& sides) {
  const std::vector<std::uint32_t> rest = restPoints(package);
  const std::size_t count = rest.size();
  // The points of one place at rest, as a list.
  std::vector<std::uint32_t> head(count, formats::kNone), next(count, formats::kNone);
  sides.weld.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t point = head[rest[i]];
    for (; point != formats::kNone; point = next[point]) {
      const std::uint32_t other = sides.face[point];
      const double now = (sides.visual_at[i] - sides.visual_at[other]).norm();
      const double before =
          (asVector(package.visualPositions()[i]) - asVector(package.visualPositions()[other])).norm();
      if (now <= before + kTogether * diagonal && sides.visual_rider[i] == sides.visual_rider[other]) break;
    }
    if (point == formats::kNone) {
      point = std::uint32_t(sides.face.size());
      sides.face.push_back(i);
      next[point] = head[rest[i]];
      head[rest[i]] = point;
    }
    sides.weld[i] = point;
  }
}

/// A rigid accessory is not cut: it goes with the larger part of what carries it.
void takeRidersWhole(const formats::PackageView& package, Sides& sides) {
  for (std::uint32_t p = 0; p < package.parts().size(); ++p) {
    const formats::AttachedPart& part = package.parts()[p];
    if (part.cluster == formats::kNone) continue;
    const formats::Cluster& cluster = package.clusters()[part.cluster];
    double above = 0;
    for (const formats::Membership& m : package.memberships().subspan(cluster.first_member, cluster.member_count)) {
      if (!(m.share > 0)) above += double(m.mu) * sides.side[m.vertex];
    }
    const Side side = above >= 0 ? 1 : -1;
    for (std::size_t v = 0; v < sides.rider.size(); ++v) {
      if (sides.rider[v] == p) sides.side[v] = side;
    }
    for (std::size_t v = 0; v < sides.visual_rider.size(); ++v) {
      if (sides.visual_rider[v] == p) sides.visual_side[v] = side;
    }
  }
}

}  // namespace

std::optional<PlaneFrame> frameOf(const CutPlane& plane) {
  PlaneFrame frame;
  frame.point = asVector(plane.point);
  frame.normal = asVector(plane.normal).normalized();
  frame.right = frame.normal.unitOrthogonal();
  frame.up = frame.normal.cross(frame.right);
  if (!plane.corners) return frame;
  Outline& outline = frame.outline.emplace();
  double size = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    outline[i] = frame.flat(asVector((*plane.corners)[i]));
    size = std::max(size, (outline[i] - outline[0]).norm());
  }
  const auto turn = [&](std::size_t i) {
    const Vector2d in = outline[(i + 1) % 4] - outline[i], out = outline[(i + 2) % 4] - outline[(i + 1) % 4];
    return in[0] * out[1] - in[1] * out[0];
  };
  if (turn(0) < 0) std::swap(outline[1], outline[3]);
  for (std::size_t i = 0; i < 4; ++i) {
    if (!(turn(i) > kNear * size * size)) return std::nullopt;
  }
  return frame;
}

bool isWithin(const Outline& outline, const Vector2d& p) {
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector2d along = outline[(i + 1) % 4] - outline[i], to = p - outline[i];
    if (!(along[0] * to[1] - along[1] * to[0] > 0)) return false;
  }
  return true;
}

Sides findSides(const formats::PackageView& package, std::span<const Vec3> positions, const PlaneFrame& plane) {
  Sides sides;
  sides.plane = plane;
  const double diagonal = double(package.info().diagonal);
  double farthest = 0;
  sides.at.reserve(positions.size());
  for (const Vec3& x : positions) {
    sides.at.push_back(asVector(x));
    farthest = std::max(farthest, sides.at.back().cwiseAbs().maxCoeff());
  }
  sides.near = std::max(kNear * diagonal, kRounding * farthest);
  const auto measure = [&](const Vector3d& at, double& height, Side& side) {
    height = (at - plane.point).dot(plane.normal);
    side = height > sides.near ? Side(1) : height < -sides.near ? Side(-1) : Side(0);
    if (side == 0 && plane.outline) {
      side = 1;
      height = sides.near;
    }
    if (side == 0) height = 0;
  };
  sides.height.resize(sides.at.size());
  sides.side.resize(sides.at.size());
  for (std::size_t v = 0; v < sides.at.size(); ++v) measure(sides.at[v], sides.height[v], sides.side[v]);

  sides.rider.assign(positions.size(), formats::kNone);
  sides.visual_rider.assign(package.visualPositions().size(), formats::kNone);
  for (std::uint32_t p = 0; p < package.parts().size(); ++p) {
    const formats::AttachedPart& part = package.parts()[p];
    if (part.cluster == formats::kNone) continue;
    const formats::Cluster& cluster = package.clusters()[part.cluster];
    for (const formats::Membership& m : package.memberships().subspan(cluster.first_member, cluster.member_count)) {
      if (m.share > 0) sides.rider[m.vertex] = p;
    }
    for (const std::uint32_t v : package.partVertices().subspan(part.first, part.count)) sides.visual_rider[v] = p;
  }

  const std::size_t visual = package.visualPositions().size();
  sides.visual_at.resize(visual);
  for (std::size_t i = 0; i < visual; ++i) {
    const formats::BarycentricAttachment& a = package.barycentric()[i];
    const auto& corners = package.tetrahedra()[a.tetrahedron].vertex;
    Vector3d x = sides.at[corners[3]];
    for (std::size_t k = 0; k < 3; ++k) x += double(a.weight[k]) * (sides.at[corners[k]] - sides.at[corners[3]]);
    sides.visual_at[i] = x;
    // A vertex on an accessory's tetrahedron goes with it.
    if (sides.visual_rider[i] == formats::kNone) sides.visual_rider[i] = sides.rider[corners[0]];
  }
  weld(package, diagonal, sides);
  sides.visual_height.resize(visual);
  sides.visual_side.resize(visual);
  for (std::size_t i = 0; i < visual; ++i) {
    measure(sides.visual_at[sides.face[sides.weld[i]]], sides.visual_height[i], sides.visual_side[i]);
  }
  takeRidersWhole(package, sides);
  return sides;
}

Fraction fractionOf(const std::array<double, 4>& height, const std::array<Side, 4>& side) {
  Fraction result;
  std::array<std::uint32_t, 4> above = {}, below = {};
  std::size_t up = 0, down = 0;
  for (std::uint32_t k = 0; k < 4; ++k) {
    if (side[k] > 0) above[up++] = k;
    if (side[k] < 0) below[down++] = k;
  }
  if (up == 0 || down == 0) {
    const std::size_t whole = up > 0 ? 1 : 0;
    result.volume[whole] = 1;
    result.moments[whole].fill(0.25);
    return result;
  }
  using Point = std::array<double, 4>;  // barycentric
  const auto corner = [](std::uint32_t k) {
    Point p = {};
    p[k] = 1;
    return p;
  };
  const auto between = [&](std::uint32_t a, std::uint32_t b) {
    Point p = {};
    const double t = height[a] / (height[a] - height[b]);
    p[a] = 1 - t;
    p[b] = t;
    return p;
  };
  const auto add = [&](std::size_t to, const Point& a, const Point& b, const Point& c, const Point& d) {
    Eigen::Matrix4d m;
    for (Eigen::Index k = 0; k < 4; ++k) {
      m.col(k) << a[std::size_t(k)], b[std::size_t(k)], c[std::size_t(k)], d[std::size_t(k)];
    }
    const double volume = std::abs(m.determinant());
    result.volume[to] += volume;
    for (std::size_t k = 0; k < 4; ++k) result.moments[to][k] += volume / 4 * (a[k] + b[k] + c[k] + d[k]);
  };
  // The smaller number of corners is cut off by itself; the other side is what is left. Corners on the plane belong to
  // both: they are their own cut.
  const auto cutTo = [&](std::uint32_t a, std::uint32_t other) {
    return side[other] == 0 ? corner(other) : between(a, other);
  };
  const auto leave = [&](std::size_t to) {
    const std::size_t from = 1 - to;
    result.volume[to] = std::max(0.0, 1 - result.volume[from]);
    for (std::size_t k = 0; k < 4; ++k) result.moments[to][k] = std::max(0.0, 0.25 - result.moments[from][k]);
  };
  if (up == 1 || down == 1) {
    const std::size_t to = up == 1 ? 1 : 0;
    const std::uint32_t a = up == 1 ? above[0] : below[0];
    std::array<std::uint32_t, 3> others = {};
    for (std::uint32_t k = 0, n = 0; k < 4; ++k) {
      if (k != a) others[n++] = k;
    }
    add(to, corner(a), cutTo(a, others[0]), cutTo(a, others[1]), cutTo(a, others[2]));
    leave(1 - to);
    return result;
  }
  const std::uint32_t a = above[0], b = above[1], c = below[0], d = below[1];
  const Point a0 = corner(a), a1 = between(a, c), a2 = between(a, d);
  const Point b0 = corner(b), b1 = between(b, c), b2 = between(b, d);
  add(1, a0, a1, a2, b0);
  add(1, a1, a2, b0, b1);
  add(1, a2, b0, b1, b2);
  leave(0);
  return result;
}

}  // namespace sinew::cutting
