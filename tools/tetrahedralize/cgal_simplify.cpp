// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/cgal_simplify.h"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Edge_collapse_visitor_base.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Bounded_normal_change_filter.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Edge_length_cost.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/optional.hpp>
#include <cmath>
#include <new>
#include <numeric>

#include "tools/tetrahedralize/layer_normal.h"

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
    return mesh_.number_of_vertices() <= vertices_;
  }

 private:
  const Mesh& mesh_;
  std::size_t vertices_;
};

// Appends the unit normals of the faces around a vertex; with `moved`, of faces left when both ends of an edge
// have come there.
void addNormals(const Mesh& mesh, Mesh::Vertex_index v, const std::array<Mesh::Vertex_index, 2>& ends,
                const Kernel::Point_3* moved, std::vector<Eigen::Vector3d>& normals) {
  for (const auto h : mesh.halfedges_around_target(mesh.halfedge(v))) {
    if (mesh.is_border(h)) continue;
    std::array<Eigen::Vector3d, 3> x;
    int at_ends = 0;
    auto side = h;
    for (Eigen::Vector3d& corner : x) {
      const Mesh::Vertex_index u = mesh.target(side);
      const bool end = u == ends[0] || u == ends[1];
      at_ends += end ? 1 : 0;
      const Kernel::Point_3& p = end && moved != nullptr ? *moved : mesh.point(u);
      corner = {p.x(), p.y(), p.z()};
      side = mesh.next(side);
    }
    if (moved != nullptr && at_ends == 2) continue;
    const Eigen::Vector3d n = (x[1] - x[0]).cross(x[2] - x[0]);
    if (n.squaredNorm() > 0) normals.push_back(n.normalized());
  }
}

constexpr double kFolded = 360;

// Cache of the faces around a vertex, until one changes: a collapse asks again for every edge near it, about
// forty, but changes the faces of about eight vertices.
class Surroundings {
 public:
  explicit Surroundings(const Mesh& mesh) : mesh_(mesh), known_(mesh.number_of_vertices()) {}
  // The angle between the normals of two faces that lie far apart (the one farthest from any, and the one farthest from
  // that), degrees; kFolded where the surface folds.
  double creaseTurn(Mesh::Vertex_index v) {
    double& turn = known_[v.idx()].turn;
    if (turn >= 0) return turn;
    look(v);
    double least = 1;
    Eigen::Vector3d from = normals_.empty() ? Eigen::Vector3d::Zero() : normals_.front();
    for (int sweep = 0; sweep < 2 && !normals_.empty(); ++sweep) {
      const auto far = std::min_element(normals_.begin(), normals_.end(),
                                        [&](const auto& a, const auto& b) { return from.dot(a) < from.dot(b); });
      least = from.dot(*far);
      from = *far;
    }
    const bool folds = least < 0 && leansOver(normals_, LayerNormal::kLeastLean);
    return turn = folds ? kFolded : std::acos(std::clamp(least, -1.0, 1.0)) * 57.295779513082321;
  }
  // Whether no normal leaves room for a layer.
  bool leans(Mesh::Vertex_index v) {
    int& leans = known_[v.idx()].leans;
    if (leans >= 0) return leans != 0;
    look(v);
    return (leans = leansOver(normals_, kLean) ? 1 : 0) != 0;
  }
  void forgetAround(Mesh::Vertex_index v) {
    known_[v.idx()] = {};
    for (const auto u : mesh_.vertices_around_target(mesh_.halfedge(v))) known_[u.idx()] = {};
  }
  // More room than a layer of prisms needs at least (LayerNormal::kLeastLean): they are thin and lean there. Two faces
  // at 30 degrees to each other have 0.259.
  static constexpr double kLean = 0.25;

 private:
  void look(Mesh::Vertex_index v) {
    normals_.clear();
    addNormals(mesh_, v, {v, v}, nullptr, normals_);
  }
  struct Known {
    double turn = -1;
    int leans = -1;
  };
  const Mesh& mesh_;
  std::vector<Known> known_;              // by vertex; negative: not looked at
  std::vector<Eigen::Vector3d> normals_;  // scratch
};

// The middle of an edge; but a corner of the border or a vertex of a crease stays, and what hangs on the border by one
// end is drawn onto it. Nothing where the surface would be pinched together between two borders, or at a vertex that is
// to be kept.
class KeepOutline {
 public:
  KeepOutline(std::span<const char> keep, Surroundings& around, bool& selected)
      : keep_(keep), around_(&around), selected_(&selected) {}
  template <typename Profile>
  boost::optional<Kernel::Point_3> operator()(const Profile& profile) const {
    // CGAL asks for a place with every cost too, of some forty edges at each collapse; a length has no use for it.
    if (!*selected_) return boost::none;
    *selected_ = false;
    const Mesh& mesh = profile.surface_mesh();
    const auto v0 = profile.v0(), v1 = profile.v1();
    if (!keep_.empty() && (keep_[v0.idx()] != 0 || keep_[v1.idx()] != 0)) return boost::none;
    const bool border0 = mesh.is_border(v0, true), border1 = mesh.is_border(v1, true);
    const bool along = mesh.is_border(mesh.edge(profile.v0_v1()));
    if (border0 && border1 && !along) return boost::none;
    if (border0 != border1) return border0 ? profile.p0() : profile.p1();
    const double crease0 = around_->creaseTurn(v0), crease1 = around_->creaseTurn(v1);
    if ((crease0 == kFolded) != (crease1 == kFolded)) return crease0 == kFolded ? profile.p1() : profile.p0();
    const double sharp0 = along ? borderTurn(mesh, v0) : crease0, sharp1 = along ? borderTurn(mesh, v1) : crease1;
    if (std::max(sharp0, sharp1) > kSharp && std::abs(sharp0 - sharp1) > kSharp / 2) {
      return sharp0 > sharp1 ? profile.p0() : profile.p1();
    }
    return CGAL::midpoint(profile.p0(), profile.p1());
  }

 private:
  static constexpr double kSharp = 30;  // degrees
  static double angle(const Kernel::Vector_3& a, const Kernel::Vector_3& b) {
    const double lengths = std::sqrt(a.squared_length() * b.squared_length());
    return lengths > 0 ? std::acos(std::clamp(a * b / lengths, -1.0, 1.0)) * 57.295779513082321 : 0;
  }
  // How far the border turns at a vertex.
  static double borderTurn(const Mesh& mesh, Mesh::Vertex_index v) {
    for (const auto h : mesh.halfedges_around_target(mesh.halfedge(v))) {
      if (!mesh.is_border(h)) continue;
      return angle(mesh.point(v) - mesh.point(mesh.source(h)), mesh.point(mesh.target(mesh.next(h))) - mesh.point(v));
    }
    return 0;
  }
  std::span<const char> keep_;
  Surroundings* around_;
  bool* selected_;
};

// No collapse that adds to the vertices at which the surface folds, counted over the merged vertex and its neighbours,
// nor one that turns a face over without merging such a vertex away.
class NoNewFold {
 public:
  explicit NoNewFold(Surroundings& around) : around_(&around) {}
  template <typename Profile>
  boost::optional<Kernel::Point_3> operator()(const Profile& profile,
                                              const boost::optional<Kernel::Point_3>& placement) const {
    if (!placement) return placement;
    const bool turns = !turned_(profile, placement);
    const Mesh& mesh = profile.surface_mesh();
    const std::array<Mesh::Vertex_index, 2> ends = {profile.v0(), profile.v1()};
    normals_.clear();
    for (const Mesh::Vertex_index v : ends) addNormals(mesh, v, ends, &*placement, normals_);
    int after = leansOver(normals_, Surroundings::kLean) ? 1 : 0;
    for (const Mesh::Vertex_index v : profile.link()) {
      normals_.clear();
      addNormals(mesh, v, ends, &*placement, normals_);
      after += leansOver(normals_, Surroundings::kLean) ? 1 : 0;
    }
    if (after == 0 && !turns) return placement;
    int before = 0;
    for (const Mesh::Vertex_index v : ends) before += around_->leans(v) ? 1 : 0;
    for (const Mesh::Vertex_index v : profile.link()) before += around_->leans(v) ? 1 : 0;
    return after < before || (after == before && !turns) ? placement : boost::none;
  }

 private:
  simplification::Bounded_normal_change_filter<> turned_;
  Surroundings* around_;
  mutable std::vector<Eigen::Vector3d> normals_;  // scratch
};

struct Follow : simplification::Edge_collapse_visitor_base<Mesh> {
  Follow(std::vector<std::uint32_t>& into, Surroundings& around, bool& selected)
      : into_(&into), around_(&around), selected_(&selected) {}
  void OnSelected(const Profile& /*profile*/, const boost::optional<double>& /*cost*/, std::size_t /*initial*/,
                  std::size_t /*current*/) {
    *selected_ = true;
  }
  void OnCollapsed(const Profile& profile, Mesh::Vertex_index vertex) {
    (*into_)[profile.v0().idx()] = vertex.idx();
    (*into_)[profile.v1().idx()] = vertex.idx();
    around_->forgetAround(vertex);
  }

 private:
  std::vector<std::uint32_t>* into_;
  Surroundings* around_;
  bool* selected_;  // an edge, of which the next place asked for is
};

}  // namespace

SimplifiedSurface simplifySurface(const PlainSurface& surface, std::uint32_t vertices, std::span<const char> keep,
                                  std::string& reason) {
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
      Surroundings around(mesh);
      bool selected = false;
      simplification::edge_collapse(mesh, StopAtVertices(mesh, vertices),
                                    CGAL::parameters::visitor(Follow(into, around, selected))
                                        .get_cost(simplification::Edge_length_cost<Mesh>())
                                        .get_placement(KeepOutline(keep, around, selected))
                                        .filter(NoNewFold(around)));
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
