// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace sinew::geometry {

using Tetrahedron = std::array<std::uint32_t, 4>;
using Triangle = std::array<std::uint32_t, 3>;

/// Tetrahedra over shared vertices. A tetrahedron (a, b, c, d) is positive when (b-a) x (c-a) . (d-a) > 0.
struct TetMesh {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Tetrahedron> tetrahedra;
};

/// Volume of a tetrahedron that is flat, of its longest edge cubed: functions have no slopes in it.
inline constexpr double kFlat = 1e-9;

/// Six times the signed volume.
inline double signedVolume6(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                            const Eigen::Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a);
}

double volume(const TetMesh& mesh);
double volume(const TetMesh& mesh, const Tetrahedron& tetrahedron);

/// Smallest and largest of the six dihedral angles, degrees. {0, 180} for a tetrahedron with a face of zero area.
std::array<double, 2> dihedralRange(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                    const Eigen::Vector3d& d);

/// Faces that no tetrahedron on the other side matches, seen counter-clockwise from outside, in order of their
/// tetrahedra: together a closed surface. Where tetrahedra lie over one another on one side, the surplus counts.
/// \param tetrahedron_of if not null, receives the tetrahedron of each face.
std::vector<Triangle> boundaryFaces(const TetMesh& mesh, std::vector<std::uint32_t>* tetrahedron_of = nullptr);

/// The link of tetrahedra in a component. Parts that share only a vertex or an edge turn there without strain.
enum class JoinedBy { vertices, faces };

/// Component of each tetrahedron, numbered by first tetrahedron. \return their number.
std::uint32_t connectedComponents(const TetMesh& mesh, JoinedBy joined_by,
                                  std::vector<std::uint32_t>& component_of_tetrahedron);

/// Drops tetrahedra whose `keep` is 0 and vertices that none uses; the order of the rest stays.
TetMesh compact(const TetMesh& mesh, const std::vector<char>& keep);

/// Orders vertices along a Morton curve of their bounding box, and tetrahedra by their smallest vertex: neighbours in
/// space become neighbours in memory.
void sortForLocality(TetMesh& mesh);

}  // namespace sinew::geometry
