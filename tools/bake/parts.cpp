// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/geometry/rounded.h"
#include "runtime/geometry/triangle_bvh.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// A loose part of which a selection holds this much of the area belongs to it, one of which it holds less than the rest
// of it by accident.
constexpr double kMostOfPart = 0.5;
constexpr double kStray = 0.02;
// Physical vertices that carry a part less than this do not count.
constexpr double kLeastCarrier = 0.02;
// Fewer make a part nod with every tetrahedron: the ring around them carries it too.
constexpr std::size_t kFewCarriers = 12;
// More say no more of a rigid motion, and each costs as much as any membership.
constexpr std::size_t kMostCarriers = 64;
// Of the largest weight: what carries less is left out first.
constexpr double kFirmCarrier = 0.5;

double areaOf(const VisualMesh& mesh, std::uint32_t triangle) {
  const Triangle& t = mesh.triangles[triangle];
  const auto& x = mesh.positions;
  return (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm() / 2;
}

// Share of each loose part's area that a selection holds, 0..1.
std::vector<double> heldShares(const VisualWeights& weights, const VisualMesh& mesh, const Topology& topology) {
  std::vector<double> shares;
  for (const SurfacePart& part : topology.parts) {
    double area = 0;
    double inside = 0;
    for (const std::uint32_t t : part.triangles) {
      const double a = areaOf(mesh, t);
      area += a;
      for (const std::uint32_t v : mesh.triangles[t]) inside += a / 3 * weights[v];
    }
    shares.push_back(area > 0 ? inside / area : 0);
  }
  return shares;
}

// Of many carriers, keeps the farthest apart.
void thinOut(ClusterSource& host, const std::vector<Vector3d>& positions) {
  if (host.vertices.size() <= kMostCarriers) return;
  const double firm = kFirmCarrier * *std::max_element(host.weights.begin(), host.weights.end());
  std::vector<double> distance(host.vertices.size(), std::numeric_limits<double>::infinity());
  const auto light = [&](double w) { return w < firm; };
  if (std::size_t(std::count_if(host.weights.begin(), host.weights.end(), light)) + kMostCarriers <= distance.size()) {
    for (std::size_t i = 0; i < distance.size(); ++i) distance[i] = light(host.weights[i]) ? 0 : distance[i];
  }
  std::vector<std::size_t> chosen;
  while (chosen.size() < kMostCarriers) {
    const auto farthest = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
    if (!(distance[farthest] > 0)) break;
    chosen.push_back(farthest);
    const Vector3d& x = positions[host.vertices[farthest]];
    for (std::size_t i = 0; i < distance.size(); ++i)
      distance[i] = std::min(distance[i], (positions[host.vertices[i]] - x).squaredNorm());
  }
  std::sort(chosen.begin(), chosen.end());
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    host.vertices[i] = host.vertices[chosen[i]];
    host.weights[i] = host.weights[chosen[i]];
  }
  host.vertices.resize(chosen.size());
  host.weights.resize(chosen.size());
}

// Which physical vertices carry a part.
ClusterSource carriersOf(const RidingPart& part, const Rider& rider, const WeightTransfer& transfer) {
  const PhysicalMesh& physical = transfer.physical();
  std::vector<double> weights(physical.positions.size(), 0);
  if (!part.host.empty()) weights = transfer(part.host);
  for (const TetrahedronPlace& place : rider.on_host) {
    double sum = 0;
    for (const double w : place.weights) sum += std::max(w, 0.0);
    for (std::size_t k = 0; k < 4; ++k) {
      weights[physical.tetrahedra[place.tetrahedron][k]] += std::max(place.weights[k], 0.0) / sum;
    }
  }
  const PhysicalPiece& piece = physical.pieces[rider.piece];
  const auto begin = weights.begin() + piece.first_vertex;
  const double largest = *std::max_element(begin, begin + piece.vertex_count);
  const auto carries = [&](double weight) { return weight > 0 && weight >= kLeastCarrier * largest; };
  if (std::size_t(std::count_if(begin, begin + piece.vertex_count, carries)) < kFewCarriers) {
    std::vector<double> ring = weights;
    for (std::uint32_t t = piece.first_tetrahedron; t < piece.first_tetrahedron + piece.tetrahedron_count; ++t) {
      const auto& corners = physical.tetrahedra[t];
      double here = 0;
      for (const std::uint32_t v : corners) here = std::max(here, weights[v]);
      for (const std::uint32_t v : corners) ring[v] = std::max(ring[v], here / 4);
    }
    weights = std::move(ring);
  }
  ClusterSource host;
  host.piece = rider.piece;
  host.mode = formats::ClusterMode::rigid;
  host.rider = physical.tetrahedra[rider.tetrahedron][0];
  for (std::uint32_t v = piece.first_vertex; v < piece.first_vertex + piece.vertex_count; ++v) {
    if (!carries(weights[v])) continue;
    host.vertices.push_back(v);
    host.weights.push_back(weights[v]);
  }
  thinOut(host, physical.positions);
  return host;
}

// The piece whose surface has most of a part's host, by area; of a part without host, most of the part's vertices.
std::uint32_t carrierOf(const RidingPart& part, const VisualMesh& host, const PhysicalMesh& physical,
                        const std::vector<TetrahedronPlace>& places) {
  std::vector<double> carried(physical.pieces.size(), 0);
  const auto add = [&](std::uint32_t v, double weight) { carried[physical.pieceOf(places[v].tetrahedron)] += weight; };
  if (part.host.empty()) {
    for (const std::uint32_t v : part.vertices) add(v, 1);
  } else {
    for (std::uint32_t t = 0; t < host.triangles.size(); ++t) {
      for (const std::uint32_t v : host.triangles[t]) add(v, areaOf(host, t) * part.host[v]);
    }
  }
  return std::uint32_t(std::max_element(carried.begin(), carried.end()) - carried.begin());
}

// A regular tetrahedron, positively oriented, whose sphere is that of the part's box; on floats.
std::array<Vector3d, 4> tetrahedronAround(const RidingPart& part, const VisualMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t v : part.vertices) box.extend(mesh.positions[v]);
  const double s = std::max(box.diagonal().norm() / 2, 1e-4 * mesh.diagonal) / std::sqrt(3.0);
  const std::array<Vector3d, 4> corners = {Vector3d(s, s, s), Vector3d(-s, s, -s), Vector3d(s, -s, -s),
                                           Vector3d(-s, -s, s)};
  std::array<Vector3d, 4> rounded;
  for (std::size_t k = 0; k < 4; ++k) rounded[k] = geometry::roundedToFloat(box.center() + corners[k]);
  return rounded;
}

}  // namespace

std::vector<std::uint8_t> ridingVertices(std::span<const VisualWeights> parts, const VisualMesh& mesh,
                                         const Topology& topology) {
  std::vector<std::uint8_t> rides(parts.empty() ? 0 : mesh.positions.size(), 0);
  for (const VisualWeights& part : parts) {
    const std::vector<double> shares = heldShares(part, mesh, topology);
    for (std::size_t p = 0; p < shares.size(); ++p) {
      if (shares[p] < kMostOfPart) continue;
      for (const std::uint32_t t : topology.parts[p].triangles) {
        for (const std::uint32_t v : mesh.triangles[t]) rides[v] = 1;
      }
    }
  }
  return rides;
}

std::vector<RidingPart> findParts(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh,
                                  const Topology& topology, std::vector<Finding>& findings) {
  std::vector<RidingPart> parts;
  std::vector<std::uint32_t> taken(topology.parts.size(), formats::kNone);
  std::size_t left = topology.parts.size();
  for (std::uint32_t p = 0; p < recipe.parts.size(); ++p) {
    const RecipePart& source = recipe.parts[p];
    RidingPart part{source.name, source.rigid, {}, {}, authored.part_hosts[p]};
    double best = 0;
    std::vector<std::uint32_t> cut;
    const std::vector<double> shares = heldShares(authored.parts[p], mesh, topology);
    for (std::uint32_t s = 0; s < topology.parts.size(); ++s) {
      const double fraction = shares[s];
      best = std::max(best, fraction);
      if (fraction > kStray && fraction < 1 - kStray) cut.push_back(topology.parts[s].triangles.front());
      if (fraction < kMostOfPart) continue;
      if (taken[s] != formats::kNone) {
        recipe.text->fail(
            source.from.pointer,
            "part " + source.name + " takes a loose part that part " + recipe.parts[taken[s]].name + " has already",
            "Let each loose part belong to one of them.");
      }
      taken[s] = p;
      --left;
    }
    if (best < kMostOfPart) {
      recipe.text->fail(source.from.pointer,
                        "part " + source.name + " holds no loose part (at most " +
                            std::to_string(int(std::lround(100 * best))) + " % of one)",
                        "Select all of a piece that hangs together by itself; `sinew check` lists them.");
    }
    if (!cut.empty()) {
      std::vector<std::uint32_t> places;
      for (std::size_t i = 0; i < std::min(cut.size(), Finding::kMaxPlaces); ++i)
        places.push_back(mesh.triangle_face[cut[i]]);
      findings.push_back({"part-cut", Severity::warning,
                          "part " + source.name + " selects only some of " +
                              counted(cut.size(), "loose part; it was", "loose parts; they were") +
                              " taken whole, or left, by the larger share",
                          cut.size(), "face", places, "", "Select whole loose parts, as by {\"part\": NUMBER}."});
    }
    parts.push_back(std::move(part));
  }
  if (parts.empty()) return parts;
  if (left == 0) {
    recipe.text->fail("/parts", "the parts are all there is: nothing is left to be filled with tetrahedra",
                      "Leave out what is to be soft.");
  }
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t s = topology.part_of_triangle[t];
    if (s == formats::kNone || taken[s] == formats::kNone) continue;
    RidingPart& part = parts[taken[s]];
    part.triangles.push_back(t);
    part.vertices.insert(part.vertices.end(), mesh.triangles[t].begin(), mesh.triangles[t].end());
  }
  for (RidingPart& part : parts) {
    std::sort(part.vertices.begin(), part.vertices.end());
    part.vertices.erase(std::unique(part.vertices.begin(), part.vertices.end()), part.vertices.end());
  }
  return parts;
}

VisualMesh withoutParts(const VisualMesh& mesh, const std::vector<RidingPart>& parts) {
  VisualMesh host = mesh;
  std::vector<std::uint8_t> leaves(mesh.triangles.size(), 0);
  for (const RidingPart& part : parts) {
    for (const std::uint32_t t : part.triangles) leaves[t] = 1;
  }
  host.triangles.clear();
  host.triangle_face.clear();
  for (SubMeshSource& sub : host.sub_meshes) {
    const auto first = std::uint32_t(host.triangles.size());
    for (std::uint32_t t = sub.first_triangle; t < sub.first_triangle + sub.triangle_count; ++t) {
      if (leaves[t] != 0) continue;
      host.triangles.push_back(mesh.triangles[t]);
      host.triangle_face.push_back(mesh.triangle_face[t]);
    }
    sub.first_triangle = first;
    sub.triangle_count = std::uint32_t(host.triangles.size()) - first;
  }
  return host;
}

void followHost(const std::vector<RidingPart>& parts, const VisualMesh& host, const PhysicalMesh& physical,
                std::vector<TetrahedronPlace>& places) {
  for (const RidingPart& part : parts) {
    if (part.rigid) continue;
    std::vector<Triangle> surface;
    for (const Triangle& t : host.triangles) {
      const bool wanted =
          part.host.empty() || std::all_of(t.begin(), t.end(), [&](std::uint32_t v) { return part.host[v] >= 0.5; });
      if (wanted) surface.push_back(t);
    }
    if (surface.empty()) surface = host.triangles;
    const geometry::TriangleBvh bvh(host.positions, surface);
    for (const std::uint32_t v : part.vertices) {
      const auto hit = bvh.closest(host.positions[v]);
      const Triangle& t = surface[hit.triangle];
      // The corner nearest to the point it sits on: its tetrahedron holds the surface there.
      const std::uint32_t corner = *std::min_element(t.begin(), t.end(), [&](std::uint32_t a, std::uint32_t b) {
        return (host.positions[a] - hit.point).squaredNorm() < (host.positions[b] - hit.point).squaredNorm();
      });
      places[v] = placeIn(places[corner].tetrahedron, host.positions[v], physical);
    }
  }
}

std::vector<Rider> joinRigidParts(const std::vector<RidingPart>& parts, const VisualMesh& host, PhysicalMesh& physical,
                                  std::vector<TetrahedronPlace>& places) {
  std::vector<Rider> riders;
  for (std::uint32_t p = 0; p < parts.size(); ++p) {
    if (!parts[p].rigid) continue;
    riders.push_back({p, carrierOf(parts[p], host, physical, places), 0, {}});
    if (!parts[p].host.empty()) continue;
    for (const std::uint32_t v : parts[p].vertices) riders.back().on_host.push_back(places[v]);
  }
  if (riders.empty()) return riders;
  const PhysicalMesh alone = physical;
  physical.positions.clear();
  physical.tetrahedra.clear();
  physical.fill.clear();
  physical.home.clear();
  std::vector<std::uint32_t> now;  // by the number that a tetrahedron had
  for (std::uint32_t b = 0; b < alone.pieces.size(); ++b) {
    PhysicalPiece& piece = physical.pieces[b];
    const auto first = alone.positions.begin() + piece.first_vertex;
    const std::uint32_t moved = std::uint32_t(physical.positions.size()) - piece.first_vertex;
    piece.first_vertex += moved;
    physical.positions.insert(physical.positions.end(), first, first + piece.vertex_count);
    for (std::uint32_t t = piece.first_tetrahedron; t < piece.first_tetrahedron + piece.tetrahedron_count; ++t) {
      now.push_back(std::uint32_t(physical.tetrahedra.size()));
      physical.tetrahedra.push_back(alone.tetrahedra[t]);
      for (std::uint32_t& v : physical.tetrahedra.back()) v += moved;
      physical.fill.push_back(alone.fill[t]);
    }
    piece.first_tetrahedron = std::uint32_t(physical.tetrahedra.size()) - piece.tetrahedron_count;
    for (Rider& rider : riders) {
      if (rider.piece != b) continue;
      rider.tetrahedron = std::uint32_t(physical.tetrahedra.size());
      const auto v = std::uint32_t(physical.positions.size());
      const std::array<Vector3d, 4> corners = tetrahedronAround(parts[rider.part], host);
      physical.positions.insert(physical.positions.end(), corners.begin(), corners.end());
      physical.tetrahedra.push_back({v, v + 1, v + 2, v + 3});
      physical.fill.push_back(0);
    }
  }
  for (TetrahedronPlace& place : places) place.tetrahedron = now[place.tetrahedron];
  for (Rider& rider : riders) {
    for (TetrahedronPlace& place : rider.on_host) place.tetrahedron = now[place.tetrahedron];
    for (const std::uint32_t v : parts[rider.part].vertices) {
      places[v] = placeIn(rider.tetrahedron, host.positions[v], physical);
      places[v].distance = 0;  // of a part no vertex is far from what carries it
    }
  }
  return riders;
}

std::vector<ClusterSource> riderClusters(const std::vector<RidingPart>& parts, const std::vector<Rider>& riders,
                                         const WeightTransfer& transfer) {
  ClusterOptions firm;
  firm.stretch_hz = firm.bend_hz = firm.twist_hz = std::numeric_limits<double>::infinity();
  firm.limit = formats::LimitMethod::none;
  firm.volume = formats::VolumeMethod::none;
  std::vector<ClusterSource> clusters;
  for (const Rider& rider : riders) {
    clusters.push_back(carriersOf(parts[rider.part], rider, transfer));
    clusters.back().options = firm;
  }
  return clusters;
}

void addParts(const std::vector<RidingPart>& parts, const std::vector<Rider>& riders,
              std::span<const ClusterSource> clusters, const PhysicalMesh& physical, formats::PackageContent& content) {
  for (const RidingPart& part : parts) {
    content.parts.push_back({content.addText(part.name), formats::kNone, std::uint32_t(content.part_vertices.size()),
                             std::uint32_t(part.vertices.size()), 0});
    content.part_vertices.insert(content.part_vertices.end(), part.vertices.begin(), part.vertices.end());
  }
  for (const Rider& rider : riders) {
    const auto moves = [&](const ClusterSource& c) { return c.rider == physical.tetrahedra[rider.tetrahedron][0]; };
    formats::AttachedPart& part = content.parts[rider.part];
    part.cluster = std::uint32_t(std::find_if(clusters.begin(), clusters.end(), moves) - clusters.begin());
    content.clusters[part.cluster].name = part.name;
  }
}

}  // namespace sinew::tools
