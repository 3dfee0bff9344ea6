// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/cgal_simplify.h"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Edge_collapse_visitor_base.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include <new>
#include <numeric>

namespace sinew::tools {
namespace {

namespace simplification = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Simple_cartesian<double>;
using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;

// Stops at a number of vertices; notes which vertex became which.
class StopAtVertices {
 public:
  StopAtVertices(const Mesh& mesh, std::size_t vertices) : mesh_(mesh), vertices_(vertices) {}
  template <typename Cost, typename Profile, typename Count>
  bool operator()(const Cost& /*cost*/, const Profile& /*profile*/, Count /*initial*/, Count /*current*/) const {
    return mesh_.number_of_vertices() - mesh_.number_of_removed_vertices() <= vertices_;
  }

 private:
  const Mesh& mesh_;
  std::size_t vertices_;
};

struct Follow : simplification::Edge_collapse_visitor_base<Mesh> {
  explicit Follow(std::vector<std::uint32_t>& into) : into_(&into) {}
  void OnCollapsed(const Profile& profile, Mesh::Vertex_index vertex) {
    (*into_)[profile.v0().idx()] = vertex.idx();
    (*into_)[profile.v1().idx()] = vertex.idx();
  }

 private:
  std::vector<std::uint32_t>* into_;
};

}  // namespace

SimplifiedSurface simplifySurface(const PlainSurface& surface, std::uint32_t vertices, std::string& reason) {
  SimplifiedSurface result;
  const CGAL::Failure_behaviour before = CGAL::set_error_behaviour(CGAL::THROW_EXCEPTION);
  try {
    Mesh mesh;
    for (const Eigen::Vector3d& p : surface.positions) mesh.add_vertex(Kernel::Point_3(p.x(), p.y(), p.z()));
    bool manifold = true;
    for (const auto& t : surface.triangles) {
      const auto face = mesh.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]), Mesh::Vertex_index(t[2]));
      manifold = manifold && face != Mesh::null_face();
    }
    if (manifold) {
      std::vector<std::uint32_t> into(surface.positions.size());
      std::iota(into.begin(), into.end(), 0U);
      simplification::edge_collapse(
          mesh, StopAtVertices(mesh, vertices),
          CGAL::parameters::visitor(Follow(into)).filter(simplification::Bounded_normal_change_filter<>()));
      std::vector<std::uint32_t> number(into.size(), 0);
      for (const auto v : mesh.vertices()) {
        const auto& p = mesh.point(v);
        number[v.idx()] = std::uint32_t(result.surface.positions.size());
        result.surface.positions.emplace_back(p.x(), p.y(), p.z());
      }
      for (const auto f : mesh.faces()) {
        std::array<std::uint32_t, 3> triangle{};
        std::size_t i = 0;
        for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) triangle.at(i++) = number[v.idx()];
        result.surface.triangles.push_back(triangle);
      }
      for (std::uint32_t v = 0; v < into.size(); ++v) {
        std::uint32_t at = v;
        while (into[at] != at) at = into[at] = into[into[at]];
        result.vertex_of.push_back(number[at]);
      }
    }
    if (result.surface.triangles.empty()) reason = "its faces cannot be collapsed";
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
