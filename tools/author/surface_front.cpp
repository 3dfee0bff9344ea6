// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <functional>
#include <limits>

#include "tools/author/surface.h"
#include "tools/author/unfold.h"

namespace sinew::tools {

SurfaceFront::SurfaceFront(const Surface& surface)
    : surface_(surface), distance_(surface.mesh_.welded_positions.size(), std::numeric_limits<double>::infinity()) {}

void SurfaceFront::clear() {
  for (const std::uint32_t p : reached_) distance_[p] = std::numeric_limits<double>::infinity();
  reached_.clear();
  changed_.clear();
  queue_.clear();
}

void SurfaceFront::offer(std::uint32_t point, double distance) {
  if (distance > limit_ || !(distance < distance_[point])) return;
  if (distance_[point] == std::numeric_limits<double>::infinity()) reached_.push_back(point);
  distance_[point] = distance;
  changed_.push_back(point);
  queue_.emplace_back(distance, point);
  std::push_heap(queue_.begin(), queue_.end(), std::greater<>());
}

void SurfaceFront::add(const SurfacePoint& place, double from, double limit) {
  limit_ = limit;
  if (place.triangle == formats::kNone) return;
  for (const std::uint32_t p : surface_.triangles_[place.triangle])
    offer(p, from + (surface_.mesh_.welded_positions[p] - place.position).norm());
}

bool SurfaceFront::spread(std::size_t most) {
  const auto& x = surface_.mesh_.welded_positions;
  for (std::size_t count = 0; !queue_.empty() && count < most;) {
    std::pop_heap(queue_.begin(), queue_.end(), std::greater<>());
    const auto [d, p] = queue_.back();
    queue_.pop_back();
    if (d > distance_[p]) continue;
    ++count;
    for (std::uint32_t i = surface_.first_[p]; i < surface_.first_[p + 1]; ++i) {
      const Triangle& t = surface_.triangles_[surface_.around_[i]];
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t c = t[k];
        if (c == p || distance_[c] <= d) continue;
        const std::uint32_t other = t[0] != c && t[0] != p ? t[0] : t[1] != c && t[1] != p ? t[1] : t[2];
        double reach = d + (x[c] - x[p]).norm();
        if (other != c && other != p && distance_[other] < std::numeric_limits<double>::infinity())
          reach = std::min(reach, unfoldedDistance(x[p], x[other], x[c], d, distance_[other], Front::point));
        offer(c, reach);
      }
    }
  }
  return queue_.empty();
}

std::vector<std::uint32_t> SurfaceFront::takeChanged() { return std::exchange(changed_, {}); }

}  // namespace sinew::tools
