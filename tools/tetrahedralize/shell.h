// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/tetrahedralize/fill.h"

namespace sinew::tools {

/// How a shell went for a piece, for the report.
struct ShellOutcome {
  std::string reason;               ///< why the result is empty, if it is
  std::uint32_t triangle = 0;       ///< of the piece, where that shows, or one of the folds
  double thickness = 0;             ///< mean, metres
  std::uint32_t thinned = 0;        ///< vertices at which creases left no room for the whole thickness
  std::uint32_t cut = 0;            ///< vertices at which the surface folds back onto itself: it is cut apart there
  std::uint32_t parts = 0;          ///< that share no vertex; tied to one another
  std::vector<std::uint32_t> home;  ///< per position of the piece: a tetrahedron beside it
};

/// A skin: a layer of prisms, half of its thickness to either side of the piece's surface, each split into three
/// tetrahedra along diagonals that neighbours share. A surface of more than half of `target_vertices` points is
/// coarsened first. Two vertices a point, offset along the normal that is farthest from edge-on to all faces around
/// (Aubry & Loehner 2008); where prisms would turn over, at creases and borders, the offset is shortened. Each part of
/// a surface in several (a mask and the horn stuck through it) has a skin of its own, tied by further tetrahedra to
/// what lies nearest, along where they cross or come closest. Empty where the surface has an edge of more than two
/// faces, one side only, points where fans meet or that have more than 500 faces, or more than a thousand parts.
/// \param thickness metres; 0: half of the mean edge of the coarsened surface. \param factors on that at
/// each position of the piece, > 0; a vertex of the coarsened surface has its sources' mean. Empty: 1
/// everywhere. \param rounding metres by which a coordinate may move later: no tetrahedron turns over by that.
FilledPiece fillWithShell(const SolidPiece& piece, std::uint32_t target_vertices, double thickness,
                          std::span<const double> factors, double rounding, ShellOutcome& outcome);

}  // namespace sinew::tools
