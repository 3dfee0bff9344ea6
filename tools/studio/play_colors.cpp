// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/play_colors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "tools/core/text.h"
#include "tools/studio/studio_state.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3f;

constexpr std::array<float, 3> kGrey = {0.36F, 0.37F, 0.39F};
constexpr float kMostStretch = 2;         // ratio at the ends of the scale, and one over it
constexpr float kMostVolume = 1.5F;       // the same
constexpr float kMostSpeed = 3;           // diagonals per second
constexpr float kMostAttachment = 0.02F;  // diagonals

Vector3f vectorOf(const Vec3& x) { return {x[0], x[1], x[2]}; }

float volumeOf(const std::array<Vector3f, 4>& x) { return (x[1] - x[0]).cross(x[2] - x[0]).dot(x[3] - x[0]) / 6; }

// The principal stretch of a triangle that is farther from 1, by ratio.
float stretchOf(const std::array<Vector3f, 3>& rest, const std::array<Vector3f, 3>& now) {
  const Vector3f a = rest[1] - rest[0], b = rest[2] - rest[0];
  const float length = a.norm();
  if (!(length > 0)) return 1;
  const float along = a.dot(b) / length;
  const float across = (b - a * (along / length)).norm();
  if (!(across > 1e-6F * length)) return 1;
  // Columns of F in the triangle's plane: images of its two unit axes.
  const Vector3f u = (now[1] - now[0]) / length;
  const Vector3f v = (now[2] - now[0] - u * along) / across;
  const float uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const float middle = 0.5F * (uu + vv), root = std::sqrt(0.25F * (uu - vv) * (uu - vv) + uv * uv);
  const float high = std::sqrt(middle + root), low = std::sqrt(std::max(middle - root, 1e-12F));
  return high * low > 1 ? high : low;
}

}  // namespace

std::span<const std::string> playColorNames() {
  static const std::array<std::string, 5> names = {"The model's own", "Stretch", "Volume", "Speed", "Attachment error"};
  return names;
}

std::array<float, 3> divergingColor(float share) {
  constexpr std::array<float, 3> kBelow = {0.02F, 0.18F, 0.62F}, kAbove = {0.85F, 0.28F, 0.01F};
  const float t = std::clamp(share, -1.0F, 1.0F);
  return t < 0 ? mixed(kGrey, kBelow, -t) : mixed(kGrey, kAbove, t);
}

const PlayColors::Rest& PlayColors::restOf(const std::shared_ptr<const Asset>& asset) {
  Rest& rest = rest_[asset.get()];
  if (rest.asset == asset) return rest;
  rest = {asset, {}, {}};
  const formats::PackageView& package = asset->package();
  const auto physical = package.physicalVertices();
  const auto at = [&](std::uint32_t v) { return vectorOf(physical[v].rest_position); };
  for (const formats::Tetrahedron& t : package.tetrahedra())
    rest.volumes.push_back(volumeOf({at(t.vertex[0]), at(t.vertex[1]), at(t.vertex[2]), at(t.vertex[3])}));
  for (const formats::BarycentricAttachment& from : package.barycentric()) {
    const formats::Tetrahedron& t = package.tetrahedra()[from.tetrahedron];
    const auto& w = from.weight;
    rest.places.push_back({t.vertex, {w[0], w[1], w[2], 1 - w[0] - w[1] - w[2]}});
  }
  if (!rest.places.empty() || physical.empty()) return rest;
  // Attached to clusters: the physical vertex that is nearest at rest.
  for (const auto& x : package.visualPositions()) {
    std::uint32_t nearest = 0;
    float best = std::numeric_limits<float>::infinity();
    for (std::uint32_t v = 0; v < physical.size(); ++v) {
      const float d = (at(v) - Vector3f(x[0], x[1], x[2])).squaredNorm();
      if (d < best) best = d, nearest = v;
    }
    rest.places.push_back({{nearest, nearest, nearest, nearest}, {1, 0, 0, 0}});
  }
  return rest;
}

void PlayColors::measure(PlayColor what, const Play& play) {
  const Shape& shape = play.shape();
  values_.assign(shape.body_vertices, what == PlayColor::stretch || what == PlayColor::volume ? 1.0F : 0.0F);
  std::size_t first = 0;
  for (std::size_t b = 0; b < shape.assets.size(); ++b) {
    const Rest& rest = restOf(shape.assets[b]);
    const formats::PackageView& package = shape.assets[b]->package();
    const BodyId body = play.scene().bodies()[b];
    const auto visual = package.visualPositions();
    const auto positions = play.scene().world().positions(body), velocities = play.scene().world().velocities(body);
    const std::span<float> values = std::span(values_).subspan(first, visual.size());
    const std::span<const Vector3f> now = std::span(shape.positions).subspan(first, visual.size());
    first += visual.size();
    std::vector<float> sum(visual.size(), 0), weight(visual.size(), 0);
    if (what == PlayColor::stretch) {
      for (const auto& t : package.visualTriangles()) {
        std::array<Vector3f, 3> before, after;
        for (std::size_t k = 0; k < 3; ++k) {
          before[k] = {visual[t[k]][0], visual[t[k]][1], visual[t[k]][2]};
          after[k] = now[t[k]];
        }
        const float area = (before[1] - before[0]).cross(before[2] - before[0]).norm();
        const float stretch = std::log(std::max(stretchOf(before, after), 1e-3F));
        for (const std::uint32_t v : t) sum[v] += area * stretch, weight[v] += area;
      }
      for (std::size_t v = 0; v < values.size(); ++v) values[v] = weight[v] > 0 ? std::exp(sum[v] / weight[v]) : 1;
      continue;
    }
    if (rest.places.empty()) continue;
    // By physical vertex first.
    std::vector<float> physical(positions.size(), 0);
    if (what == PlayColor::volume) {
      std::vector<float> share(positions.size(), 0);
      for (std::size_t i = 0; i < rest.volumes.size(); ++i) {
        const auto& t = package.tetrahedra()[i].vertex;
        const float volume = volumeOf({vectorOf(positions[t[0]]), vectorOf(positions[t[1]]), vectorOf(positions[t[2]]),
                                       vectorOf(positions[t[3]])});
        for (const std::uint32_t v : t) physical[v] += volume, share[v] += rest.volumes[i];
      }
      for (std::size_t v = 0; v < physical.size(); ++v) physical[v] = share[v] != 0 ? physical[v] / share[v] : 1;
    } else if (what == PlayColor::speed) {
      for (std::size_t v = 0; v < physical.size(); ++v) physical[v] = vectorOf(velocities[v]).norm();
    }
    for (std::size_t v = 0; v < values.size(); ++v) {
      const Place& place = rest.places[v];
      Vector3f attached = Vector3f::Zero();
      float value = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        attached += place.weight[k] * vectorOf(positions[place.vertex[k]]);
        value += place.weight[k] * physical[place.vertex[k]];
      }
      values[v] =
          what == PlayColor::attachment ? (package.barycentric().empty() ? 0 : (now[v] - attached).norm()) : value;
    }
  }
}

const std::vector<std::array<float, 3>>& PlayColors::update(PlayColor what, const Play& play) {
  tints_.clear();
  if (what == PlayColor::model) return tints_;
  measure(what, play);
  tints_.assign(play.shape().positions.size(), kGrey);
  const auto most = [&](float diagonals) { return diagonals * play.diagonal(); };
  switch (what) {
    case PlayColor::stretch:
    case PlayColor::volume: {
      const float end = what == PlayColor::stretch ? kMostStretch : kMostVolume;
      for (std::size_t v = 0; v < values_.size(); ++v)
        tints_[v] = divergingColor(std::log(std::max(values_[v], 1e-3F)) / std::log(end));
      scale_ = {rounded(double(1 / end), 2) + " x", "1", rounded(double(end), 2) + " x"};
      break;
    }
    case PlayColor::speed:
    case PlayColor::attachment: {
      const float end = most(what == PlayColor::speed ? kMostSpeed : kMostAttachment);
      for (std::size_t v = 0; v < values_.size(); ++v) tints_[v] = heatColor(double(values_[v] / end));
      scale_ = {"0", "", rounded(double(end), 4) + (what == PlayColor::speed ? " m/s" : " m")};
      break;
    }
    case PlayColor::model:
      break;
  }
  return tints_;
}

}  // namespace sinew::tools
