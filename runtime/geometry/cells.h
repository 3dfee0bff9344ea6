// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

namespace sinew::geometry {

/// Cells of an activated cluster: the stretch along its fibre is summed by the mean of each.
inline constexpr std::size_t kFibreCells = 16;

/// The cell of each place: all of them, halved by volume across where the cell of the longest extent is longest, until
/// there are `most` or each has one place. \param volumes one a place, > 0.
inline std::vector<std::uint32_t> cellsOf(std::span<const Eigen::Vector3d> places, std::span<const double> volumes,
                                          std::size_t most) {
  struct Cell {
    std::vector<std::size_t> places;
    Eigen::Vector3d extent;
  };
  const auto cellOf = [&](std::vector<std::size_t> of) {
    Eigen::AlignedBox3d box;
    for (const std::size_t i : of) box.extend(places[i]);
    return Cell{std::move(of), box.sizes()};
  };
  std::vector<std::size_t> all(places.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::vector<Cell> cells = {cellOf(std::move(all))};
  while (cells.size() < std::min(most, places.size())) {
    Cell& widest = *std::max_element(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) {
      if ((a.places.size() > 1) != (b.places.size() > 1)) return b.places.size() > 1;
      return a.extent.maxCoeff() < b.extent.maxCoeff();
    });
    Eigen::Index axis = 0;
    widest.extent.maxCoeff(&axis);
    std::vector<std::size_t> low = std::move(widest.places);
    std::stable_sort(low.begin(), low.end(),
                     [&](std::size_t a, std::size_t b) { return places[a][axis] < places[b][axis]; });
    double volume = 0, part = 0;
    for (const std::size_t i : low) volume += volumes[i];
    std::size_t count = 0;
    while (count + 1 < low.size() && (count == 0 || part < 0.5 * volume)) part += volumes[low[count++]];
    std::vector<std::size_t> high(low.begin() + std::ptrdiff_t(count), low.end());
    low.resize(count);
    widest = cellOf(std::move(low));
    cells.push_back(cellOf(std::move(high)));
  }
  std::vector<std::uint32_t> result(places.size());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (const std::size_t i : cells[c].places) result[i] = std::uint32_t(c);
  }
  return result;
}

}  // namespace sinew::geometry
