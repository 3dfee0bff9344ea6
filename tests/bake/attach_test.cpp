// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/attach/attach.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/bake/box_mesh.h"

namespace sinew::tools {
namespace {

// A visual mesh of loose triangles at given points, every point used, nothing welded.
VisualMesh trianglesAt(const std::vector<Eigen::Vector3d>& points) {
  VisualMesh mesh;
  for (const auto& p : points) {
    const auto first = std::uint32_t(mesh.positions.size());
    for (int k = 0; k < 3; ++k) {
      mesh.positions.push_back(p + 1e-3 * Eigen::Vector3d::Unit(k));
      mesh.welded.push_back(first + std::uint32_t(k));
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  mesh.welded_positions = mesh.positions;
  return mesh;
}

Eigen::Vector3d placeOf(const PhysicalMesh& mesh, const TetrahedronPlace& place) {
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) x += place.weights[k] * mesh.positions[mesh.tetrahedra[place.tetrahedron][k]];
  return x;
}

TEST(Attach, InsideAndOutsidePointsAreReproduced) {
  PhysicalMesh physical = latticeMesh({6, 5, 4}, 0.2);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> range(-0.5, 1.5);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 300; ++i) points.emplace_back(range(random), range(random), range(random));
  const VisualMesh mesh = trianglesAt(points);
  const Topology topology = analyzeTopology(mesh);
  physical.part_piece.assign(topology.parts.size(), 0);
  const auto places = placeVisualVertices(mesh, topology, physical);
  ASSERT_EQ(places.size(), mesh.positions.size());
  for (std::size_t v = 0; v < places.size(); ++v) {
    EXPECT_LT((placeOf(physical, places[v]) - mesh.positions[v]).norm(), 1e-12);
    const Eigen::Vector3d& x = mesh.positions[v];
    const Eigen::Vector3d outside = (-x).cwiseMax(x - Eigen::Vector3d(1.2, 1.0, 0.8)).cwiseMax(0.0);
    EXPECT_NEAR(places[v].distance, outside.norm(), 1e-12);
    if (outside.norm() == 0) {
      for (double w : places[v].weights) EXPECT_GE(w, -1e-9);
    }
  }
}

TEST(Attach, APointNeverHangsOnAnotherBody) {
  // Two bodies side by side; the visual part of the second lies nearer to the first.
  PhysicalMesh physical = latticeMesh({2, 2, 2}, 1);
  const PhysicalMesh other = latticeMesh({2, 2, 2}, 1);
  PhysicalPiece body = other.pieces[0];
  body.first_vertex = std::uint32_t(physical.positions.size());
  body.first_tetrahedron = std::uint32_t(physical.tetrahedra.size());
  for (const auto& x : other.positions) physical.positions.push_back(x + Eigen::Vector3d(10, 0, 0));
  for (auto tet : other.tetrahedra) {
    for (auto& v : tet) v += body.first_vertex;
    physical.tetrahedra.push_back(tet);
  }
  physical.pieces.push_back(body);
  const VisualMesh mesh = trianglesAt({{1, 1, 1}, {3, 1, 1}});
  const Topology topology = analyzeTopology(mesh);
  ASSERT_EQ(topology.parts.size(), 2U);
  physical.part_piece = {0, 1};
  const auto places = placeVisualVertices(mesh, topology, physical);
  for (std::size_t v = 0; v < 3; ++v) EXPECT_LT(places[v].tetrahedron, body.first_tetrahedron);
  for (std::size_t v = 3; v < 6; ++v) EXPECT_GE(places[v].tetrahedron, body.first_tetrahedron);
}

// What lies between a flat tetrahedron and a tall one: the flat one's deformation turns normals by rounding.
TEST(Attach, OfTetrahedraThatHoldAPointTheBroadestCarriesIt) {
  for (const bool flat_first : {true, false}) {
    PhysicalMesh physical;
    physical.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.3, 0.3, 1e-3}, {0.3, 0.3, -1}};
    physical.tetrahedra = {{0, 1, 2, 3}, {0, 2, 1, 4}};
    if (!flat_first) std::swap(physical.tetrahedra[0], physical.tetrahedra[1]);
    PhysicalPiece piece;
    piece.vertex_count = 5;
    piece.tetrahedron_count = 2;
    physical.pieces = {piece};
    VisualMesh mesh;
    mesh.positions = mesh.welded_positions = {{0, 0, 0}, {0.5, 0, 0}, {0.25, 0.25, 0}};
    mesh.welded = {0, 1, 2};
    mesh.triangles = {{0, 1, 2}};
    const Topology topology = analyzeTopology(mesh);
    physical.part_piece.assign(topology.parts.size(), 0);
    for (const TetrahedronPlace& place : placeVisualVertices(mesh, topology, physical)) {
      EXPECT_EQ(place.tetrahedron, flat_first ? 1U : 0U);
    }
  }
}

TEST(Attach, SeamVerticesShareATetrahedron) {
  PhysicalMesh physical = latticeMesh({3, 3, 3}, 1);
  VisualMesh mesh = trianglesAt({{0.5, 0.5, 0.5}, {0.5, 0.5, 0.5}});
  for (std::size_t v = 3; v < 6; ++v) mesh.welded[v] = std::uint32_t(v - 3);
  mesh.welded_positions.resize(3);
  const Topology topology = analyzeTopology(mesh);
  physical.part_piece.assign(topology.parts.size(), 0);
  const auto places = placeVisualVertices(mesh, topology, physical);
  for (std::size_t v = 0; v < 3; ++v) {
    EXPECT_EQ(places[v].tetrahedron, places[v + 3].tetrahedron);
    EXPECT_EQ(places[v].weights, places[v + 3].weights);
  }
}

}  // namespace
}  // namespace sinew::tools
