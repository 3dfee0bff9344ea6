// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/best_side.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tools/render/camera.h"

namespace sinew::tools {
namespace {

constexpr int kPixels = 128;
// Sides in order of liking: the front a little from the right, then further around, then from above and below.
constexpr std::array<float, 12> kYaws = {0.35F, -0.35F, 0.9F, -0.9F, 1.4F, -1.4F, 1.9F, -1.9F, 2.4F, -2.4F, 2.9F, 3.5F};
constexpr std::array<float, 3> kPitches = {0.15F, 0.75F, -0.6F};
// A side is left for another only where that shows so much more.
constexpr double kBetter = 1.1;

}  // namespace

Sides::Sides(std::span<const Eigen::Vector3f> positions, std::span<const Triangle> triangles)
    : triangles_(triangles.begin(), triangles.end()) {
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::max());
  Eigen::Vector3f high = -low;
  for (const Triangle& t : triangles_) {
    for (const std::uint32_t v : t) {
      low = low.cwiseMin(positions[v]);
      high = high.cwiseMax(positions[v]);
    }
  }
  const Eigen::Vector3f middle = (low + high) / 2;
  const float scale = float(kPixels) / std::max((high - low).norm(), std::numeric_limits<float>::min());
  std::vector<float> depth;
  std::vector<std::uint32_t> owner;
  std::vector<std::uint32_t> pixels(triangles_.size());
  for (const float pitch : kPitches) {
    for (const float yaw : kYaws) {
      Camera camera;
      camera.yaw = yaw;
      camera.pitch = pitch;
      // Orthographic, a pixel's middle inside a triangle, the nearest wins.
      depth.assign(std::size_t(kPixels) * kPixels, -std::numeric_limits<float>::infinity());
      owner.assign(depth.size(), formats::kNone);
      const Eigen::Vector3f right = camera.right() * scale;
      const Eigen::Vector3f up = camera.up() * scale;
      const Eigen::Vector3f back = camera.back();
      for (std::uint32_t t = 0; t < triangles_.size(); ++t) {
        std::array<Eigen::Vector3f, 3> p;
        for (std::size_t k = 0; k < 3; ++k) {
          const Eigen::Vector3f x = positions[triangles_[t][k]] - middle;
          p[k] = {right.dot(x) + kPixels / 2.0F, up.dot(x) + kPixels / 2.0F, back.dot(x)};
        }
        const float area =
            (p[1].x() - p[0].x()) * (p[2].y() - p[0].y()) - (p[2].x() - p[0].x()) * (p[1].y() - p[0].y());
        if (area == 0) continue;
        const auto first = [](float a, float b, float c) {
          return std::max(0, int(std::ceil(std::min({a, b, c}) - 0.5F)));
        };
        const auto last = [](float a, float b, float c) {
          return std::min(kPixels - 1, int(std::floor(std::max({a, b, c}) - 0.5F)));
        };
        for (int y = first(p[0].y(), p[1].y(), p[2].y()); y <= last(p[0].y(), p[1].y(), p[2].y()); ++y) {
          for (int x = first(p[0].x(), p[1].x(), p[2].x()); x <= last(p[0].x(), p[1].x(), p[2].x()); ++x) {
            const float px = float(x) + 0.5F, py = float(y) + 0.5F;
            const auto edge = [&](std::size_t a, std::size_t b) {
              return ((p[b].x() - p[a].x()) * (py - p[a].y()) - (p[b].y() - p[a].y()) * (px - p[a].x())) / area;
            };
            const float w0 = edge(1, 2), w1 = edge(2, 0), w2 = edge(0, 1);
            if (w0 < 0 || w1 < 0 || w2 < 0) continue;
            const float z = w0 * p[0].z() + w1 * p[1].z() + w2 * p[2].z();
            const std::size_t at = std::size_t(y) * kPixels + std::size_t(x);
            if (!(z > depth[at])) continue;
            depth[at] = z;
            owner[at] = t;
          }
        }
      }
      std::fill(pixels.begin(), pixels.end(), 0);
      for (const std::uint32_t t : owner) {
        if (t != formats::kNone) ++pixels[t];
      }
      View& view = views_.emplace_back();
      view.side = {yaw, pitch};
      for (std::uint32_t t = 0; t < pixels.size(); ++t) {
        if (pixels[t] > 0) view.seen.emplace_back(t, pixels[t]);
      }
    }
  }
}

Side Sides::best(std::span<const double> weights) const {
  const View* best = views_.data();
  double most = 0;
  for (const View& view : views_) {
    double seen = 0;
    for (const auto& [t, count] : view.seen) {
      const Triangle& corners = triangles_[t];
      seen += count * (weights[corners[0]] + weights[corners[1]] + weights[corners[2]]) / 3;
    }
    if (!(seen > kBetter * most)) continue;
    most = seen;
    best = &view;
  }
  return best->side;
}

}  // namespace sinew::tools
