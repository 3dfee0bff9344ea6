// SPDX-License-Identifier: MIT
//
// The package of a part.
#pragma once

#include <cstdint>
#include <vector>

#include "runtime/cut/fields.h"
#include "runtime/cut/parts.h"
#include "sinew/formats/writer.h"

namespace sinew::cutting {

/// Findings of a cut.
struct Cut {
  const formats::PackageView& package;
  const CutSettings& settings;
  const Sides& sides;
  const Surface& surface;
  const Section& section;
  const std::vector<Hung>& nodes;
  const Partition& partition;
  std::vector<std::uint8_t> piece_is_whole;  ///< by piece of the package: one part has it, and it is not cut
  std::vector<std::vector<std::uint32_t>> node_tetrahedra;  ///< by distance grid; empty of whole pieces
  std::vector<Nearest> nearest;                             ///< by field; empty of whole pieces
};

struct PartContent {
  formats::PackageContent content;
  std::vector<CutOrigin> visual;
  double volume = 0;     ///< m^3, that the triangles enclose
  double fields_ms = 0;  ///< time that fields took
};

PartContent makeContent(const Cut& cut, std::uint32_t part);

}  // namespace sinew::cutting
