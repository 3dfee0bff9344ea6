// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/cgal_wrap.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

#include <new>

namespace sinew::tools {

PlainSurface alphaWrap(const PlainSurface& soup, double alpha, double offset, std::string& reason) {
  using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
  using Point = Kernel::Point_3;
  PlainSurface result;
  std::vector<Point> points;
  points.reserve(soup.positions.size());
  for (const Eigen::Vector3d& p : soup.positions) points.emplace_back(p.x(), p.y(), p.z());
  // Triangles without area have no supporting plane; their edges belong to others.
  std::vector<std::array<std::size_t, 3>> faces;
  for (const auto& t : soup.triangles) {
    if (!CGAL::collinear(points[t[0]], points[t[1]], points[t[2]])) faces.push_back({t[0], t[1], t[2]});
  }
  if (faces.empty()) {
    reason = "no triangle has an area";
    return result;
  }
  const CGAL::Failure_behaviour before = CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
  try {
    CGAL::Surface_mesh<Point> wrap;
    CGAL::alpha_wrap_3(points, faces, alpha, offset, wrap);
    for (const auto v : wrap.vertices()) {
      const Point& p = wrap.point(v);
      result.positions.emplace_back(p.x(), p.y(), p.z());
    }
    for (const auto f : wrap.faces()) {
      std::array<std::uint32_t, 3> triangle{};
      std::size_t i = 0;
      for (const auto v : wrap.vertices_around_face(wrap.halfedge(f))) triangle.at(i++) = v.idx();
      result.triangles.push_back(triangle);
    }
    if (result.triangles.empty()) reason = "the wrap is empty";
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
