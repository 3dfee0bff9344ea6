// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/play_contacts.h"

#include <array>
#include <cstdint>
#include <span>

#include "runtime/geometry/box_tree.h"
#include "runtime/geometry/triangle.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kTouchDiagonals = 0.003F;   // nearer than this touches
constexpr std::size_t kMostTouches = 4000;  // vertices that are looked at: about 4 ms

// A vertex that is looked at.
struct Looked {
  std::size_t vertex;  // of the shape
  std::size_t body;    // of the scene
  std::size_t own;     // of the body's package
  bool touches = false;
};

std::vector<Looked> lookedAt(const Shape& shape) {
  std::vector<Looked> looked;
  const std::size_t stride = shape.body_vertices / kMostTouches + 1;
  std::size_t body = 0, first = 0;
  for (std::size_t v = 0; v < shape.body_vertices; v += stride) {
    for (std::size_t count; v - first >= (count = shape.assets[body]->package().visualPositions().size()); ++body)
      first += count;
    looked.push_back({v, body, v - first});
  }
  return looked;
}

void touchColliders(const Play& play, float radius, std::vector<Looked>& looked) {
  QueryFilter filter;
  filter.bodies = false;
  QueryObject found;
  for (Looked& at : looked) {
    const Vector3f& x = play.shape().positions[at.vertex];
    at.touches = play.scene().world().overlaps({x.x(), x.y(), x.z()}, radius, {&found, 1}, filter) > 0;
  }
}

// Touches of vertices with a body's drawn triangles. Of its own they touch what they face, and what is farther at
// rest than it could be said to touch there: neighbours along the surface stay near whatever the body does.
void touchBody(const Play& play, std::size_t body, double radius, const geometry::BoxTree& tree,
               std::vector<Looked>& looked) {
  const Shape& shape = play.shape();
  const formats::PackageView& package = shape.assets[body]->package();
  const bool touches_itself = play.scene().world().bodySettings(play.scene().bodies()[body]).self_contact;
  std::size_t first = 0;
  for (std::size_t b = 0; b < body; ++b) first += shape.assets[b]->package().visualPositions().size();
  const auto restOf = [&](std::size_t v) { return Eigen::Map<const Vector3f>(&package.visualPositions()[v][0]); };
  const auto distance = [](const Vector3d& p, const std::array<Vector3d, 3>& t) {
    return (geometry::closestPointOnTriangle(p, t[0], t[1], t[2]) - p).norm();
  };
  for (const auto& triangle : package.visualTriangles()) {
    std::array<Vector3d, 3> now, rest;
    Eigen::AlignedBox3d box;
    for (std::size_t k = 0; k < 3; ++k) {
      now[k] = shape.positions[first + triangle[k]].cast<double>();
      rest[k] = restOf(triangle[k]).cast<double>();
      box.extend(now[k]);
    }
    const Eigen::AlignedBox3d room(box.min().array() - radius, box.max().array() + radius);
    const Vector3d normal = (now[1] - now[0]).cross(now[2] - now[0]);
    tree.descend([&](const auto& node, std::uint32_t) { return node.box.intersects(room); },
                 [&](std::uint32_t place) {
                   Looked& at = looked[tree.order()[place]];
                   if (at.touches || (at.body == body && !touches_itself)) return;
                   const Vector3d x = shape.positions[at.vertex].cast<double>();
                   if (!(distance(x, now) < radius)) return;
                   at.touches = at.body != body || (normal.dot(shape.normals[at.vertex].cast<double>()) < 0 &&
                                                    distance(restOf(at.own).cast<double>(), rest) > 2 * radius);
                 });
  }
}

}  // namespace

std::vector<Vector3f> contactsOf(const Play& play) {
  const Shape& shape = play.shape();
  const float radius = kTouchDiagonals * play.diagonal();
  std::vector<Looked> looked = lookedAt(shape);
  touchColliders(play, radius, looked);
  if (play.scene().world().settings().collisions) {
    const auto place = [&](std::uint32_t i) -> Vector3d { return shape.positions[looked[i].vertex].cast<double>(); };
    const auto box = [&](std::uint32_t i) { return Eigen::AlignedBox3d(place(i)); };
    const geometry::BoxTree tree(std::uint32_t(looked.size()), box, place, place, 8);
    for (std::size_t body = 0; body < shape.assets.size(); ++body) touchBody(play, body, double(radius), tree, looked);
  }
  std::vector<Vector3f> touching;
  for (const Looked& at : looked) {
    if (at.touches) touching.push_back(shape.positions[at.vertex]);
  }
  return touching;
}

}  // namespace sinew::tools
