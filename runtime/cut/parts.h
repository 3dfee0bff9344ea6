// SPDX-License-Identifier: MIT
//
// The parts of the physical mesh: what hangs together on each side, which tetrahedra and how much of each mass it has.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/cut/section.h"

namespace sinew::cutting {

/// A tetrahedron of a part.
struct PartTetrahedron {
  std::uint32_t source = 0;                  ///< of the package
  std::array<double, 4> center = {};         ///< barycentric: middle of what the part has of it
  double volume = 0;                         ///< m^3 at rest: what the part has of it
  Side side = 0;                             ///< what of it is the part's: 0 all that it has of it, on whichever side
  std::array<std::uint32_t, 4> corner = {};  ///< of PartMesh::vertices
};

/// A face of the section, seen from one side.
struct PartPolygon {
  std::uint32_t polygon = 0;
  Side side = 0;
};

/// A tetrahedron that a slit opens: what its two sides may do apart.
struct Gap {
  std::uint32_t tetrahedron = 0;
  double area = 0;                    ///< m^2 at rest, of the plane in it
  std::array<double, 4> center = {};  ///< of that, barycentric
};

struct PartMesh {
  Side side = 0;                            ///< 0: it lies on both, beside a slit
  std::vector<PartTetrahedron> tetrahedra;  ///< by source. Those that the plane cuts are there for each side, whole
  std::vector<std::uint32_t> vertices;      ///< of the package, ascending: all that these have, a copy for each side
                                            ///< of a slit
  std::vector<float> masses;                ///< kg, of the vertices
  std::vector<std::uint8_t> own;            ///< the vertex lies on the part's side
  std::vector<std::uint32_t> fragments;     ///< of the surface
  std::vector<PartPolygon> polygons;        ///< of the section
};

struct Partition {
  std::vector<PartMesh> parts;
  std::vector<std::uint32_t> part_of;  ///< of vertices, below then above: the part that has it there; none
  std::vector<Gap> gaps;               ///< by tetrahedron, of a plane that ends
  /// Some part was too small: `sides` has it on the other side now, and all is to be done anew.
  bool again = false;
};

/// Fractions of tetrahedra, and their volumes at rest.
struct Shares {
  std::vector<Fraction> fractions;
  std::vector<double> volumes;  ///< m^3
  std::vector<double> total;    ///< by vertex: a quarter of the tetrahedra around it

  /// kg, of what a side has of a tetrahedron.
  double massOf(const formats::PackageView& package, std::uint32_t tetrahedron, Side side) const;
  /// Volume and middle of that.
  void take(Side side, PartTetrahedron& to) const;
};
Shares findShares(const formats::PackageView& package, const Sides& sides);

/// Vertices of no tetrahedron go where the most of their piece is.
void addLoose(const formats::PackageView& package, Partition& partition);
/// Each vertex's mass goes to its copies as the volume around it does; the largest copy takes what rounding leaves.
void shareMasses(const formats::PackageView& package, const Shares& shares, Partition& partition);

/// \param least share of the body's mass that a part has at least. \param last no part is too small any more: what is
/// joins the largest one.
Partition findParts(const formats::PackageView& package, const Surface& surface, const Section& section,
                    const std::vector<Hung>& nodes, double least, bool last, Sides& sides);

/// The same of a plane that ends. A tetrahedron is cut where the middle of the plane in it lies within the outline; a
/// vertex has as many copies as its tetrahedra have sides that hang together (Molino 2004): over faces that the plane
/// passes through, and about the vertex itself. So the slit ends at faces between tetrahedra that are cut and others.
/// Cuts that would leave a part too small, or without a surface, are not made.
Partition openSlit(const formats::PackageView& package, const Surface& surface, const Section& section,
                   const std::vector<Hung>& nodes, double least, const Sides& sides);

}  // namespace sinew::cutting
