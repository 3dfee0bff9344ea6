// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>
#include <string>

#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::testing {

inline constexpr std::array kMethods = {tools::TetrahedraMethod::automatic, tools::TetrahedraMethod::grid,
                                        tools::TetrahedraMethod::stuffing, tools::TetrahedraMethod::delaunay};

inline std::string name(tools::TetrahedraMethod method) {
  return std::array{"auto", "grid", "stuffing", "delaunay", "shell"}[std::size_t(method)];
}

inline tools::PhysicalMesh fill(const tools::VisualMesh& mesh, tools::TetrahedraMethod method, std::uint32_t vertices) {
  tools::Progress progress(false);
  tools::TetrahedraOptions options;
  options.method = method;
  options.target_vertices = vertices;
  return tools::tetrahedralize(mesh, tools::analyzeTopology(mesh), options, progress);
}

inline geometry::TetMesh bodyMesh(const tools::PhysicalMesh& mesh, const tools::PhysicalPiece& body) {
  geometry::TetMesh one;
  for (std::uint32_t v = 0; v < body.vertex_count; ++v) one.positions.push_back(mesh.positions[body.first_vertex + v]);
  for (std::uint32_t t = 0; t < body.tetrahedron_count; ++t) {
    auto tetrahedron = mesh.tetrahedra[body.first_tetrahedron + t];
    for (auto& v : tetrahedron) v -= body.first_vertex;
    one.tetrahedra.push_back(tetrahedron);
  }
  return one;
}

/// Of the space that tetrahedra take: copies in one place count once.
inline double spaceTaken(const geometry::TetMesh& mesh) {
  std::set<std::array<std::array<double, 3>, 4>> seen;
  double volume = 0;
  for (const auto& t : mesh.tetrahedra) {
    std::array<std::array<double, 3>, 4> corners{};
    for (std::size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d& x = mesh.positions[t[k]];
      corners[k] = {x.x(), x.y(), x.z()};
    }
    std::sort(corners.begin(), corners.end());
    if (seen.insert(corners).second) volume += geometry::volume(mesh, t);
  }
  return volume;
}

/// What every result holds, whatever was asked: runs that tile the arrays, positive tetrahedra over used vertices, one
/// piece a body, the angles of the method, the quality it claims, fills that add up.
inline void checkPhysicalMesh(const tools::PhysicalMesh& mesh, const std::string& what) {
  std::uint32_t vertex = 0, tetrahedron = 0;
  ASSERT_FALSE(mesh.pieces.empty()) << what;
  ASSERT_EQ(mesh.fill.size(), mesh.tetrahedra.size()) << what;
  double smallest = 180;
  for (const auto& body : mesh.pieces) {
    ASSERT_EQ(body.first_vertex, vertex) << what;
    ASSERT_EQ(body.first_tetrahedron, tetrahedron) << what;
    vertex += body.vertex_count;
    tetrahedron += body.tetrahedron_count;
    ASSERT_LE(vertex, mesh.positions.size()) << what;
    ASSERT_LE(tetrahedron, mesh.tetrahedra.size()) << what;
    const geometry::TetMesh one = bodyMesh(mesh, body);
    std::vector<char> used(one.positions.size(), 0);
    double body_smallest = 180;
    for (const auto& t : one.tetrahedra) {
      for (const std::uint32_t v : t) {
        ASSERT_LT(v, one.positions.size()) << what;
        used[v] = 1;
      }
      ASSERT_GT(geometry::volume(one, t), 0) << what;
      const auto& x = one.positions;
      body_smallest = std::min(body_smallest, geometry::dihedralRange(x[t[0]], x[t[1]], x[t[2]], x[t[3]])[0]);
    }
    smallest = std::min(smallest, body_smallest);
    EXPECT_EQ(std::count(used.begin(), used.end(), char(0)), 0) << what;
    // A joint without a face turns without strain. Grids may hold what touches at a corner, shells are cut at folds.
    const bool follows =
        body.method == tools::TetrahedraMethod::stuffing || body.method == tools::TetrahedraMethod::delaunay;
    const auto by = follows ? geometry::JoinedBy::faces : geometry::JoinedBy::vertices;
    std::vector<std::uint32_t> component;
    EXPECT_EQ(geometry::connectedComponents(one, by, component), 1U) << what;
    EXPECT_NEAR(spaceTaken(one), body.volume, 1e-6 * body.volume) << what;
    using enum tools::TetrahedraMethod;
    const double least = body.method == grid ? 30 : body.method == stuffing ? 8.9 : body.method == shell ? 0.1 : 10;
    EXPECT_NE(body.method, automatic) << what;
    EXPECT_GE(body_smallest, least) << what << " by " << name(body.method);
  }
  EXPECT_EQ(vertex, mesh.positions.size()) << what;
  EXPECT_EQ(tetrahedron, mesh.tetrahedra.size()) << what;
  EXPECT_EQ(mesh.quality.inverted, 0U) << what;
  EXPECT_NEAR(mesh.quality.min_dihedral_deg, smallest, 1e-6) << what;
  for (const double f : mesh.fill) {
    EXPECT_GT(f, 0) << what;
    EXPECT_TRUE(std::isfinite(f)) << what;
  }
  // Masses add up to the source's, whatever the cage.
  for (const auto& body : mesh.pieces) {
    double filled = 0;
    const geometry::TetMesh one = bodyMesh(mesh, body);
    for (std::uint32_t t = 0; t < body.tetrahedron_count; ++t) {
      filled += geometry::volume(one, one.tetrahedra[t]) * mesh.fill[body.first_tetrahedron + t];
    }
    // A sheet has no volume of its own: each of its cells weighs, copies too.
    const double expected = body.source_volume > 0 ? body.source_volume : geometry::volume(one);
    EXPECT_NEAR(filled, expected, 1e-6 * expected) << what;
  }
}

inline const tools::Finding* findingOf(const tools::PhysicalMesh& mesh, const std::string& id) {
  for (const auto& f : mesh.findings) {
    if (f.id == id) return &f;
  }
  return nullptr;
}

}  // namespace sinew::testing
