// SPDX-License-Identifier: MIT
//
// The fields of a part: its parent's, restricted to it where it was cut, as they are where not.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/cut/parts.h"
#include "sinew/formats/writer.h"

namespace sinew::cutting {

/// A point of the section that may touch.
struct SectionPoint {
  Vector3d rest;  ///< m
  Hung hung;      ///< tetrahedron of PartMesh
};

/// A part's share of a piece.
struct PartPiece {
  std::uint32_t source = 0;                                    ///< piece of the package
  std::uint32_t piece = 0;                                     ///< of the part's package
  std::uint32_t first = 0, count = 0;                          ///< of PartMesh::vertices
  std::uint32_t first_tetrahedron = 0, tetrahedron_count = 0;  ///< of PartMesh::tetrahedra
  std::vector<SectionPoint> section;
  double section_area = 0;  ///< m^2
};

/// Vertices of a piece that are nearest, at rest, to what a field of its parent's has: they tell on which part it is.
struct Nearest {
  std::vector<std::uint32_t> of_sample;  ///< by pack, eight each
  std::vector<std::uint32_t> of_point;
};
Nearest findNearest(const formats::PackageView& package, const formats::Field& field);

struct FieldInput {
  const formats::PackageView& package;
  const Sides& sides;
  const PartMesh& mesh;
  const PartPiece& piece;
  const std::vector<Nearest>& nearest;         ///< by field of the package; of pieces that are not cut empty
  const std::vector<std::uint32_t>& clusters;  ///< of the package to those of the part; kNone: the part has none of it
  const std::vector<std::uint32_t>& pin_sets;  ///< the same
  /// Of each vertex of the package on the part's side: the part that has it (Partition::part_of).
  std::span<const std::uint32_t> label;
  std::uint32_t part = 0;        ///< this one
  const std::vector<Gap>& gaps;  ///< Partition::gaps

  bool isOwn(std::uint32_t vertex) const { return label[vertex] == part; }
};

/// Appends the fields of a piece that was cut, with their fibres: the free one, and the held one where the part has pin
/// sets of it and its tethers are known by vertex.
void addCutFields(const FieldInput& input, formats::PackageContent& content);

/// Appends the fields of a piece that the plane does not meet, as they are.
void addWholeFields(const FieldInput& input, formats::PackageContent& content);

}  // namespace sinew::cutting
