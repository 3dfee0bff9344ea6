// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "runtime/geometry/tet_mesh.h"
#include "tools/tetrahedralize/cgal_wrap.h"

namespace sinew::tools {

/// Whether the triangles are one or several closed manifold surfaces: each edge has two faces that run along it in
/// opposite directions, each point one fan. delaunayTetrahedra needs it (and no self-intersection).
bool isClosedManifold(const PlainSurface& surface);

/// Delaunay refinement of the solid within closed surfaces (an inner surface bounds a cavity), then perturbation and
/// sliver exudation (CGAL Mesh_3; Cheng et al. 2000, Tournois et al. 2009). One thread, deterministic.
/// \param surface closed, manifold, without self-intersections; outer surfaces outward.
/// \param cell_size largest circumradius of a tetrahedron and of a face on the surface, metres.
/// \param facet_distance how far the surface may be from its faces, metres.
/// \param reason receives why the result is empty, if it is. Never throws but for lack of memory.
geometry::TetMesh delaunayTetrahedra(const PlainSurface& surface, double cell_size, double facet_distance,
                                     std::string& reason);

}  // namespace sinew::tools
