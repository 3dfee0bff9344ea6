// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A sheet of (n + 1)^2 vertices, bent by `place(u, v)`, u and v in 0..1. Alternating diagonals, so that no direction
/// is the mesh's own.
template <class Place>
VisualMesh sheet(std::uint32_t n, const Place& place) {
  VisualMesh mesh;
  for (std::uint32_t j = 0; j <= n; ++j) {
    for (std::uint32_t i = 0; i <= n; ++i) mesh.positions.push_back(place(double(i) / n, double(j) / n));
  }
  for (std::uint32_t j = 0; j < n; ++j) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i;
      if ((i + j) % 2 == 0) {
        mesh.triangles.push_back({a, a + 1, a + n + 2});
        mesh.triangles.push_back({a, a + n + 2, a + n + 1});
      } else {
        mesh.triangles.push_back({a, a + 1, a + n + 1});
        mesh.triangles.push_back({a + 1, a + n + 2, a + n + 1});
      }
    }
  }
  mesh.welded_positions = mesh.positions;
  mesh.bounds_min = mesh.bounds_max = mesh.positions[0];
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    mesh.welded.push_back(v);
    mesh.bounds_min = mesh.bounds_min.cwiseMin(mesh.positions[v]);
    mesh.bounds_max = mesh.bounds_max.cwiseMax(mesh.positions[v]);
  }
  mesh.diagonal = (mesh.bounds_max - mesh.bounds_min).norm();
  return mesh;
}

inline VisualMesh flat(std::uint32_t n) {
  return sheet(n, [](double u, double v) { return Eigen::Vector3d(u, v, 0); });
}

}  // namespace sinew::tools
