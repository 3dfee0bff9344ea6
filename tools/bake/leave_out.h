// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"
#include "tools/author/needs.h"

namespace sinew::tools {

/// Takes out of a package whatever serves none of the needs (Need::exact apart: that is writePackage()'s). The rest
/// moves and looks as before, but that a body without `contact` passes through everything, and so on; normals that are
/// made at run time are those of the surface. Idempotent.
void leaveOut(formats::PackageContent& content, Needs needs);

/// The bytes of a package without what serves none of the needs; of 32-bit numbers where 16 bits are too coarse.
std::vector<std::byte> packageWith(const formats::PackageView& package, Needs needs);

/// How much of what is seen changes without a need, and how much of that nobody sees.
struct SeenChange {
  double most, unseen;
  std::string_view unit;
  bool isUnseen() const { return most <= unseen; }
};

/// \return nothing where it is the game's matter, as of pins. Of clusters: alike ones become one, which the default
/// solver and its drawing do not notice.
std::optional<SeenChange> changeWithout(const formats::PackageView& package, Need need);

/// A need that was left out unseen.
struct LeftUnseen {
  Need need;
  SeenChange change;
  std::uint64_t bytes;  ///< saved, after those before it
};

/// Needs::isAutomatic() carried out: the other needs, or all that is seen and felt where there are no others (so no
/// cut, identity, groups and masks), less the unseen ones. \param authored its clusters are wanted by name
Needs narrowed(Needs needs, const formats::PackageView& package, bool authored, std::vector<LeftUnseen>& left);

/// Largest distance between where two packages of one body draw a visual vertex: at rest, and bent along each function
/// by a tenth of the diagonal (root mean square). Diagonals. \pre the same visual vertices and functions
double drawnDifference(const formats::PackageView& one, const formats::PackageView& other);

/// Largest distance of a visual vertex from where it is attached at rest, diagonals: PackageInfo::max_rest_error.
double restErrorOf(const formats::PackageContent& content);

/// A package of 16-bit numbers.
struct PackedPackage {
  std::vector<std::byte> bytes;
  std::string refusal;  ///< why no reader takes it, instead of bytes
};
/// The error that INFO states is that of the numbers as they are unpacked; `content` states it then too.
PackedPackage packedPackage(formats::PackageContent& content);

}  // namespace sinew::tools
