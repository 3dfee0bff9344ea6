// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <map>

#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

/// Unit cells of a lattice, six tetrahedra each (Kuhn), one body; `keep` says which cells exist.
inline PhysicalMesh latticeMesh(
    std::array<int, 3> cells, double size,
    const std::function<bool(int, int, int)>& keep = [](int, int, int) { return true; }) {
  PhysicalMesh mesh;
  std::map<std::array<int, 3>, std::uint32_t> index;
  const auto vertex = [&](int x, int y, int z) {
    const auto [at, added] = index.try_emplace({x, y, z}, std::uint32_t(mesh.positions.size()));
    if (added) mesh.positions.emplace_back(x * size, y * size, z * size);
    return at->second;
  };
  constexpr std::array<std::array<int, 3>, 6> kOrders = {
      {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};
  for (int x = 0; x < cells[0]; ++x) {
    for (int y = 0; y < cells[1]; ++y) {
      for (int z = 0; z < cells[2]; ++z) {
        if (!keep(x, y, z)) continue;
        for (const auto& order : kOrders) {
          std::array<int, 3> p = {x, y, z};
          std::array<std::uint32_t, 4> tet{};
          tet[0] = vertex(p[0], p[1], p[2]);
          for (std::size_t k = 0; k < 3; ++k) {
            ++p[std::size_t(order[k])];
            tet[k + 1] = vertex(p[0], p[1], p[2]);
          }
          const auto& a = mesh.positions[tet[0]];
          const double six =
              (mesh.positions[tet[1]] - a).cross(mesh.positions[tet[2]] - a).dot(mesh.positions[tet[3]] - a);
          if (six < 0) std::swap(tet[2], tet[3]);
          mesh.tetrahedra.push_back(tet);
        }
      }
    }
  }
  mesh.fill.assign(mesh.tetrahedra.size(), 1.0);
  PhysicalPiece body;
  body.name = "lattice";
  body.vertex_count = std::uint32_t(mesh.positions.size());
  body.tetrahedron_count = std::uint32_t(mesh.tetrahedra.size());
  mesh.pieces.push_back(body);
  return mesh;
}

}  // namespace sinew::tools
