// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

namespace sinew::tools {

/// A solid of tetrahedra (positive volume) at rest, with the prescribed places of its held nodes. Tetrahedra are linear
/// (4 nodes: vertices) or quadratic (10: one more midway along each edge, which is straight at rest).
struct ElasticSolid {
  std::vector<Eigen::Vector3d> rest;  ///< of all nodes, metres
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;
  std::vector<std::optional<Eigen::Vector3d>> prescribed;  ///< per node: where it is held, metres; nothing: it is free
  /// Of quadratic tetrahedra the nodes of edges 01, 02, 03, 12, 13, 23; empty: they are linear.
  std::vector<std::array<std::uint32_t, 6>> middles;
};

/// Ends of the edges that ElasticSolid::middles goes by.
inline constexpr std::array<std::array<std::size_t, 2>, 6> kTetrahedronEdges = {
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

/// Makes linear tetrahedra quadratic; vertices keep their numbers. A new node is held, midway, where both ends of its
/// edge are.
/// \param shape on return one more position for each new node: midway, too. May be null.
ElasticSolid quadratic(const ElasticSolid& solid, std::vector<Eigen::Vector3d>* shape);

/// Cuts every linear tetrahedron into eight; those of tetrahedron t are 8 t .. 8 t + 7, the old vertices keep their
/// numbers. A new vertex is held, midway, where both ends of its edge are. \param shape on return one more position for
/// each new vertex: midway, too. May be null.
ElasticSolid refined(const ElasticSolid& solid, std::vector<Eigen::Vector3d>* shape);

/// Edges from the first vertex of a tetrahedron, in columns.
Eigen::Matrix3d edgesOf(const std::vector<Eigen::Vector3d>& x, const std::array<std::uint32_t, 4>& tetrahedron);

/// Volume of a solid's tetrahedra at rest by vertex, a quarter each, m³. \param solid linear.
std::vector<double> nodalVolumes(const ElasticSolid& solid);

/// Gravity's masses by node, kg: the integrals of the density times the nodes' shape functions. The density is
/// linear between vertices, such that the sum stays. Of linear tetrahedra it is the masses of the vertices; of
/// quadratic ones that of a vertex is none or less, nearly all is between (a uniform tetrahedron: -1/20 and 1/5).
/// \param vertex_masses kg, one a vertex.
std::vector<double> nodalMasses(const ElasticSolid& solid, const std::vector<double>& vertex_masses);

/// A point of a solid that was refined: where it went. \param coarse the solid before. \param refinements how often.
/// \param weights of the coarse tetrahedron's vertices, sum 1. \param positions of the refined solid's vertices.
Eigen::Vector3d deformedPoint(const ElasticSolid& coarse, const ElasticSolid& fine, int refinements,
                              std::uint32_t tetrahedron, const Eigen::Vector4d& weights,
                              const std::vector<Eigen::Vector3d>& positions);

}  // namespace sinew::tools
