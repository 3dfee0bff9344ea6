// SPDX-License-Identifier: MIT
//
// The function space of a part: its parent's, restricted to it.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/cut/parts.h"
#include "sinew/formats/writer.h"

namespace sinew::cutting {

/// A point of the section that may touch.
struct SectionPoint {
  Vector3d rest;  ///< m
  Hung hung;      ///< tetrahedron of the package
};

/// What a part has of a piece.
struct PartPiece {
  std::uint32_t source = 0;                                    ///< piece of the package
  std::uint32_t piece = 0;                                     ///< of the part's package
  std::uint32_t first = 0, count = 0;                          ///< of PartMesh::vertices
  std::uint32_t first_tetrahedron = 0, tetrahedron_count = 0;  ///< of PartMesh::tetrahedra
  std::vector<SectionPoint> section;
  double section_area = 0;  ///< m^2
};

/// Vertices of a piece that are nearest, at rest, to what its parent's free field has: they tell on which part it is.
struct Nearest {
  std::vector<std::uint32_t> of_sample;  ///< by pack, eight each
  std::vector<std::uint32_t> of_point;
};
Nearest findNearest(const formats::PackageView& package, std::uint32_t piece);

/// Appends the free field of a piece that was cut, and its fibres. Constants, coordinates and the parent's functions,
/// as far as they are independent on the part, make it: every affine motion is in it exactly, and where the parent is.
/// \param nearest of the piece. \param clusters of the package to those of the part; kNone: the part has none of it.
/// \param label of each vertex of the package on the part's side: the part that has it (Partition::part_of); `part` is
/// this one.
void addCutField(const formats::PackageView& package, const Sides& sides, const PartMesh& mesh, const PartPiece& piece,
                 const Nearest& nearest, const std::vector<std::uint32_t>& clusters,
                 const std::vector<std::uint32_t>& label, std::uint32_t part, formats::PackageContent& content);

/// Appends the fields of a piece that the plane does not meet, as they are.
/// \param pin_sets of the package to those of the part.
void addWholeFields(const formats::PackageView& package, const PartPiece& piece,
                    const std::vector<std::uint32_t>& clusters, const std::vector<std::uint32_t>& pin_sets,
                    formats::PackageContent& content);

}  // namespace sinew::cutting
