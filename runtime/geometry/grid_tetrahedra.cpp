// SPDX-License-Identifier: MIT
#include "runtime/geometry/grid_tetrahedra.h"

#include <algorithm>
#include <cmath>
#include <deque>

#include "sinew/formats/sections.h"

namespace sinew::geometry {

using formats::kNone;
namespace {

using Eigen::Vector3d;

// A surface that runs along a box's side by rounding only does not enter it.
constexpr double kEnterDepth = 1e-3;

// Corners of a box as bits x, y, z. Those with an even number of bits and those with an odd number; the four around the
// middle one are named by their odd corner and the three even ones next to it, positive.
constexpr std::array<int, 4> kMiddle = {0, 3, 6, 5};
constexpr std::array<std::array<int, 4>, 4> kOuter = {{{1, 0, 5, 3}, {2, 0, 3, 6}, {4, 0, 6, 5}, {7, 3, 5, 6}}};

std::array<Vector3d, 8> boxCorners(const Vector3d& size) {
  std::array<Vector3d, 8> corners;
  for (int bits = 0; bits < 8; ++bits) {
    corners[std::size_t(bits)] = {(bits & 1) != 0 ? size.x() : 0.0, (bits & 2) != 0 ? size.y() : 0.0,
                                  (bits & 4) != 0 ? size.z() : 0.0};
  }
  return corners;
}

}  // namespace

double boxDihedral(const Vector3d& size) {
  const auto x = boxCorners(size / size.maxCoeff());
  double smallest = 180;
  const auto visit = [&](const std::array<int, 4>& t) {
    smallest = std::min(smallest, dihedralRange(x[std::size_t(t[0])], x[std::size_t(t[1])], x[std::size_t(t[2])],
                                                x[std::size_t(t[3])])[0]);
  };
  visit(kMiddle);
  for (const auto& t : kOuter) visit(t);
  return smallest;
}

CellGrid fitGrid(const Eigen::AlignedBox3d& bounds, double spacing, double min_dihedral_deg) {
  CellGrid grid;
  const Vector3d extent = bounds.sizes();
  for (int axis = 0; axis < 3; ++axis) {
    const double cells = std::max(1.0, std::round(extent[axis] / spacing));
    grid.size[std::size_t(axis)] = int(cells);
    grid.spacing[axis] = extent[axis] / cells;
  }
  // Widen the thinnest axis until the angles allow it: the two wider ones are within 1.5 of `spacing` of each other.
  for (int round = 0; round < 3; ++round) {
    if (grid.spacing.minCoeff() > 0 && boxDihedral(grid.spacing) >= min_dihedral_deg) break;
    int axis = 0;
    grid.spacing.minCoeff(&axis);
    double low = grid.spacing[axis], high = grid.spacing.maxCoeff();
    for (int i = 0; i < 50; ++i) {
      const double middle = (low + high) / 2;
      Vector3d size = grid.spacing;
      size[axis] = middle;
      (boxDihedral(size) >= min_dihedral_deg ? high : low) = middle;
    }
    grid.spacing[axis] = high;
  }
  for (int axis = 0; axis < 3; ++axis) {
    grid.origin[axis] = bounds.center()[axis] - grid.spacing[axis] * grid.size[std::size_t(axis)] / 2;
  }
  grid.kept.assign(std::size_t(grid.size[0]) * std::size_t(grid.size[1]) * std::size_t(grid.size[2]), 0);
  return grid;
}

void keepTouchedCells(CellGrid& grid, const TriangleBvh& surface, const WindingNumber* solid,
                      const ParallelFor& parallel_for) {
  const Vector3d depth = kEnterDepth * grid.spacing;
  const auto for_cells = [&](auto&& visit) {
    parallel_for(grid.kept.size(), 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const int x = int(i % std::size_t(grid.size[0]));
        const int y = int(i / std::size_t(grid.size[0]) % std::size_t(grid.size[1]));
        const int z = int(i / std::size_t(grid.size[0]) / std::size_t(grid.size[1]));
        visit(i, std::array<int, 3>{x, y, z}, grid.box(x, y, z));
      }
    });
  };
  for_cells([&](std::size_t i, const std::array<int, 3>&, const Eigen::AlignedBox3d& box) {
    const Eigen::AlignedBox3d inner(box.min() + depth, box.max() - depth);
    grid.kept[i] = surface.touches(inner) || (solid != nullptr && solid->inside(box.center())) ? 1 : 0;
  });
  // Surface in the side between two boxes enters neither: the one above keeps it, at the top end the one below.
  std::vector<char> added(grid.kept.size(), 0);
  for_cells([&](std::size_t i, const std::array<int, 3>& cell, const Eigen::AlignedBox3d& box) {
    if (grid.kept[i] != 0 || !surface.touches({box.min() - depth, box.max() + depth})) return;
    for (int axis = 0; axis < 3; ++axis) {
      const auto runs_at = [&](double place) {
        Eigen::AlignedBox3d side(box.min() + depth, box.max() - depth);
        side.min()[axis] = place - depth[axis];
        side.max()[axis] = place + depth[axis];
        return surface.touches(side);
      };
      std::array<int, 3> below = cell;
      --below[std::size_t(axis)];
      const bool below_is_kept =
          below[std::size_t(axis)] >= 0 && grid.kept[grid.index(below[0], below[1], below[2])] != 0;
      const bool is_top = cell[std::size_t(axis)] + 1 == grid.size[std::size_t(axis)];
      if ((!below_is_kept && runs_at(box.min()[axis])) || (is_top && runs_at(box.max()[axis]))) added[i] = 1;
    }
  });
  for (std::size_t i = 0; i < added.size(); ++i) grid.kept[i] = char(grid.kept[i] | added[i]);
}

std::size_t bridgeCells(CellGrid& grid) {
  const auto& size = grid.size;
  constexpr int kFree = -1;
  std::size_t added = 0;
  const auto neighbours = [&](std::size_t cell, bool faces_only, auto&& visit) {
    const int x = int(cell % std::size_t(size[0])), y = int(cell / std::size_t(size[0]) % std::size_t(size[1])),
              z = int(cell / std::size_t(size[0]) / std::size_t(size[1]));
    for (int dz = -1; dz <= 1; ++dz) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const int steps = std::abs(dx) + std::abs(dy) + std::abs(dz);
          if (steps == 0 || (faces_only && steps != 1)) continue;
          const int nx = x + dx, ny = y + dy, nz = z + dz;
          if (nx < 0 || ny < 0 || nz < 0 || nx >= size[0] || ny >= size[1] || nz >= size[2]) continue;
          visit(grid.index(nx, ny, nz));
        }
      }
    }
  };
  while (true) {
    // The component of the first kept box, then a flood from it through free boxes until another kept box is met.
    const auto first = std::find(grid.kept.begin(), grid.kept.end(), char(1));
    if (first == grid.kept.end()) return added;
    std::vector<int> component(grid.kept.size(), kFree);
    std::deque<std::size_t> queue = {std::size_t(first - grid.kept.begin())};
    component[queue.front()] = 0;
    std::vector<std::size_t> members = {queue.front()};
    while (!queue.empty()) {
      const std::size_t cell = queue.front();
      queue.pop_front();
      neighbours(cell, false, [&](std::size_t n) {
        if (grid.kept[n] == 0 || component[n] == 0) return;
        component[n] = 0;
        members.push_back(n);
        queue.push_back(n);
      });
    }
    if (members.size() == std::size_t(std::count(grid.kept.begin(), grid.kept.end(), char(1)))) return added;
    constexpr std::size_t kStart = ~std::size_t(0);
    std::vector<std::size_t> from(grid.kept.size(), kStart);
    std::sort(members.begin(), members.end());
    queue.assign(members.begin(), members.end());
    std::vector<char> seen(grid.kept.size(), 0);
    for (const std::size_t m : members) seen[m] = 1;
    std::size_t met = kStart;
    while (!queue.empty() && met == kStart) {
      const std::size_t cell = queue.front();
      queue.pop_front();
      neighbours(cell, true, [&](std::size_t n) {
        if (seen[n] != 0 || met != kStart) return;
        seen[n] = 1;
        from[n] = cell;
        if (grid.kept[n] != 0) met = n;
        queue.push_back(n);
      });
    }
    if (met == kStart) return added;  // cannot be: every box of the block is reachable
    for (std::size_t cell = from[met]; cell != kStart && grid.kept[cell] == 0; cell = from[cell]) {
      grid.kept[cell] = 1;
      ++added;
    }
  }
}

TetMesh gridTetrahedra(const CellGrid& grid) {
  TetMesh mesh;
  const std::array<int, 3> points = {grid.size[0] + 1, grid.size[1] + 1, grid.size[2] + 1};
  const std::size_t count = std::size_t(points[0]) * std::size_t(points[1]) * std::size_t(points[2]);
  std::vector<std::uint32_t> number(count, kNone);
  for (int z = 0; z < grid.size[2]; ++z) {
    for (int y = 0; y < grid.size[1]; ++y) {
      for (int x = 0; x < grid.size[0]; ++x) {
        if (grid.kept[grid.index(x, y, z)] == 0) continue;
        const int odd = (x + y + z) & 1;
        const auto vertex = [&](int bits) {
          // In an odd box the pattern is mirrored in x, which turns the tetrahedra round as well.
          bits ^= odd;
          const int px = x + (bits & 1), py = y + (bits >> 1 & 1), pz = z + (bits >> 2 & 1);
          std::uint32_t& n =
              number[(std::size_t(pz) * std::size_t(points[1]) + std::size_t(py)) * std::size_t(points[0]) +
                     std::size_t(px)];
          if (n == kNone) {
            n = static_cast<std::uint32_t>(mesh.positions.size());
            mesh.positions.emplace_back(grid.origin + grid.spacing.cwiseProduct(Vector3d(px, py, pz)));
          }
          return n;
        };
        const auto emit = [&](const std::array<int, 4>& t) {
          Tetrahedron v = {vertex(t[0]), vertex(t[1]), vertex(t[2]), vertex(t[3])};
          if (odd != 0) std::swap(v[2], v[3]);
          mesh.tetrahedra.push_back(v);
        };
        emit(kMiddle);
        for (const auto& t : kOuter) emit(t);
      }
    }
  }
  return mesh;
}

}  // namespace sinew::geometry
