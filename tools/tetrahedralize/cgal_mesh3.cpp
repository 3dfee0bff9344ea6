// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/cgal_mesh3.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polyhedral_mesh_domain_3.h>
#include <CGAL/Random.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/make_mesh_3.h>

#include <algorithm>
#include <map>
#include <new>

namespace sinew::tools {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;
using Domain = CGAL::Polyhedral_mesh_domain_3<Surface, Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain, CGAL::Default, CGAL::Sequential_tag>::type;
using Complex = CGAL::Mesh_complex_3_in_triangulation_3<Triangulation>;
using Criteria = CGAL::Mesh_criteria_3<Triangulation>;

bool buildSurface(const PlainSurface& plain, Surface& surface) {
  for (const Eigen::Vector3d& p : plain.positions) surface.add_vertex(Kernel::Point_3(p.x(), p.y(), p.z()));
  for (const auto& t : plain.triangles) {
    const auto face =
        surface.add_face(Surface::Vertex_index(t[0]), Surface::Vertex_index(t[1]), Surface::Vertex_index(t[2]));
    if (face == Surface::null_face()) return false;
  }
  return true;
}

}  // namespace

bool isClosedManifold(const PlainSurface& plain) {
  if (plain.triangles.empty()) return false;
  for (const auto& t : plain.triangles) {
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return false;
  }
  Surface surface;
  if (!buildSurface(plain, surface) || !CGAL::is_closed(surface)) return false;
  // add_face refuses a third face at an edge, but two fans at a point can pass: count each point's fan.
  std::vector<std::size_t> faces_at(plain.positions.size(), 0);
  for (const auto& t : plain.triangles) {
    for (const auto v : t) ++faces_at[v];
  }
  for (const auto v : surface.vertices()) {
    if (faces_at[v.idx()] == 0) continue;
    std::size_t fan = 0;
    for (const auto h : CGAL::halfedges_around_target(surface.halfedge(v), surface)) {
      static_cast<void>(h);
      ++fan;
    }
    if (fan != faces_at[v.idx()]) return false;
  }
  return true;
}

geometry::TetMesh delaunayTetrahedra(const PlainSurface& plain, double cell_size, double facet_distance,
                                     std::string& reason) {
  geometry::TetMesh result;
  const CGAL::Failure_behaviour before = CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
  try {
    Surface surface;
    if (!buildSurface(plain, surface) || !CGAL::is_closed(surface)) {
      reason = "the surface is not closed and manifold";
    } else {
      // Initial points and perturbation draw from these: the same numbers for every piece and every run.
      CGAL::get_default_random() = CGAL::Random(1);
      CGAL::Random random(1);
      const Domain domain(surface, &random);
      namespace params = CGAL::parameters;
      const Criteria criteria(params::facet_angle = 25, params::facet_size = cell_size,
                              params::facet_distance = facet_distance, params::cell_radius_edge_ratio = 2,
                              params::cell_size = cell_size);
      // No time limits: they would make the result depend on the machine.
      Complex complex = CGAL::make_mesh_3<Complex>(domain, criteria, params::no_perturb(), params::no_exude());
      CGAL::perturb_mesh_3(complex, domain, params::time_limit = 0, params::sliver_bound = 14);
      CGAL::exude_mesh_3(complex, params::time_limit = 0, params::sliver_bound = 14);
      std::map<Triangulation::Vertex_handle, std::uint32_t> number;
      const Triangulation& triangulation = complex.triangulation();
      std::vector<char> used;
      for (auto v = triangulation.finite_vertices_begin(); v != triangulation.finite_vertices_end(); ++v) {
        number[v] = static_cast<std::uint32_t>(result.positions.size());
        const auto& p = v->point();
        result.positions.emplace_back(CGAL::to_double(p.x()), CGAL::to_double(p.y()), CGAL::to_double(p.z()));
      }
      for (auto c = complex.cells_in_complex_begin(); c != complex.cells_in_complex_end(); ++c) {
        geometry::Tetrahedron t{};
        for (int i = 0; i < 4; ++i) t[std::size_t(i)] = number.at(c->vertex(i));
        result.tetrahedra.push_back(t);
      }
      result = geometry::compact(result, std::vector<char>(result.tetrahedra.size(), 1));
      if (result.tetrahedra.empty()) reason = "refinement found nothing inside";
    }
  } catch (const std::bad_alloc&) {
    CGAL::set_error_behaviour(before);
    throw;
  } catch (const std::exception& error) {
    result = {};
    reason = error.what();
  }
  CGAL::set_error_behaviour(before);
  return result;
}

}  // namespace sinew::tools
