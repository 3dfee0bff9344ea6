// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/weld.h"

#include <array>
#include <bit>
#include <cmath>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {
namespace {

using Cell = std::array<std::int64_t, 3>;

std::uint64_t mix(std::uint64_t h) {
  h ^= h >> 33;
  h *= 0xff51afd7ed558ccdULL;
  h ^= h >> 33;
  h *= 0xc4ceb9fe1a85ec53ULL;
  return h ^ h >> 33;
}

/// Open table from a cell to the chain of points founded in it.
class CellTable {
 public:
  explicit CellTable(std::size_t expected) : slots_(std::bit_ceil(expected * 2 + 16)) {}

  /// The head of the cell's chain, formats::kNone where it has none yet.
  std::uint32_t find(const Cell& cell) const {
    const Slot& slot = slots_[locate(cell)];
    return slot.head;
  }
  std::uint32_t& head(const Cell& cell) {
    Slot& slot = slots_[locate(cell)];
    slot.cell = cell;
    return slot.head;
  }

 private:
  struct Slot {
    Cell cell{};
    std::uint32_t head = formats::kNone;
  };
  std::size_t locate(const Cell& cell) const {
    const std::size_t mask = slots_.size() - 1;
    std::uint64_t h = 0;
    for (std::int64_t c : cell) h = mix(h ^ std::uint64_t(c));
    std::size_t at = std::size_t(h) & mask;
    while (slots_[at].head != formats::kNone && slots_[at].cell != cell) at = (at + 1) & mask;
    return at;
  }
  std::vector<Slot> slots_;
};

}  // namespace

Weld weldPositions(const std::vector<Eigen::Vector3d>& positions, double tolerance) {
  Weld weld;
  weld.of.resize(positions.size());
  if (positions.empty()) return weld;
  CellTable table(positions.size());
  std::vector<std::uint32_t> next;
  const auto found = [&](std::size_t i, const Cell& cell) {
    const std::uint32_t point = std::uint32_t(weld.points.size());
    std::uint32_t& head = table.head(cell);
    weld.points.push_back(positions[i]);
    next.push_back(head);
    head = point;
    weld.of[i] = point;
  };

  Eigen::Vector3d low = positions[0];
  Eigen::Vector3d high = positions[0];
  for (const Eigen::Vector3d& p : positions) low = low.cwiseMin(p), high = high.cwiseMax(p);
  // Cells are far larger than the tolerance, so a search rarely looks into a second one; and not so small that their
  // numbers overflow.
  const double cell_size = std::max(16 * tolerance, (high - low).maxCoeff() * 1e-9);
  if (!(tolerance > 0) || !(cell_size > 0)) {
    for (std::size_t i = 0; i < positions.size(); ++i) {
      Cell cell{};
      for (int a = 0; a < 3; ++a)
        cell[std::size_t(a)] = std::bit_cast<std::int64_t>(positions[i][a] == 0 ? 0.0 : positions[i][a]);
      const std::uint32_t at = table.find(cell);
      if (at == formats::kNone) {
        found(i, cell);
      } else {
        weld.of[i] = at;
      }
    }
    return weld;
  }
  const auto cellOf = [&](const Eigen::Vector3d& p) {
    Cell cell{};
    for (int a = 0; a < 3; ++a) cell[std::size_t(a)] = std::int64_t(std::floor((p[a] - low[a]) / cell_size));
    return cell;
  };
  const Eigen::Vector3d reach = Eigen::Vector3d::Constant(tolerance);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector3d& p = positions[i];
    const Cell first = cellOf(p - reach);
    const Cell last = cellOf(p + reach);
    std::uint32_t nearest = formats::kNone;
    double nearest_distance = tolerance * tolerance;
    for (std::int64_t z = first[2]; z <= last[2]; ++z)
      for (std::int64_t y = first[1]; y <= last[1]; ++y)
        for (std::int64_t x = first[0]; x <= last[0]; ++x)
          for (std::uint32_t at = table.find({x, y, z}); at != formats::kNone; at = next[at]) {
            const double distance = (weld.points[at] - p).squaredNorm();
            if (distance < nearest_distance || (distance == nearest_distance && at < nearest))
              nearest = at, nearest_distance = distance;
          }
    if (nearest == formats::kNone) {
      found(i, cellOf(p));
    } else {
      weld.of[i] = nearest;
    }
  }
  return weld;
}

}  // namespace sinew::tools
