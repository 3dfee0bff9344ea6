// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/parts.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/geometry/triangle_bvh.h"
#include "tools/bake/moments.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// A loose part of which a selection holds this much of the area belongs to it, one of which it holds less than the rest
// of it by accident.
constexpr double kMostOfPart = 0.5;
constexpr double kStray = 0.02;
// Physical vertices that carry a part less than this do not count.
constexpr double kLeastCarrier = 0.02;
// Mass of a vertex that carries a rigid part, of the host's lightest one: the host's motion is its own.
constexpr float kRiderMass = 1e-3F;
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

Vector3d wide(const formats::Float3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }
formats::Float3 narrow(const Vector3d& x) { return {float(x[0]), float(x[1]), float(x[2])}; }

// Of many carriers, those that lie farthest apart.
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
  ClusterSource thin = host;
  thin.vertices.clear();
  thin.weights.clear();
  for (const std::size_t i : chosen) {
    thin.vertices.push_back(host.vertices[i]);
    thin.weights.push_back(host.weights[i]);
  }
  host = std::move(thin);
}

// Which physical vertices carry a part, all of one body.
struct Carriers {
  std::uint32_t body = 0;
  ClusterSource host;
};

Carriers carriersOf(const RidingPart& part, const std::vector<TetrahedronPlace>& places,
                    const WeightTransfer& transfer) {
  const PhysicalMesh& physical = transfer.physical();
  std::vector<double> weights(physical.positions.size(), 0);
  if (!part.host.empty()) {
    weights = transfer(part.host);
  } else {
    for (const std::uint32_t v : part.vertices) {
      const TetrahedronPlace& place = places[v];
      double sum = 0;
      for (const double w : place.weights) sum += std::max(w, 0.0);
      for (std::size_t k = 0; k < 4; ++k) {
        weights[physical.tetrahedra[place.tetrahedron][k]] += std::max(place.weights[k], 0.0) / sum;
      }
    }
  }
  Carriers result;
  double most = -1;
  for (std::uint32_t b = 0; b < physical.bodies.size(); ++b) {
    const PhysicalBody& body = physical.bodies[b];
    double sum = 0;
    for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v) sum += weights[v];
    if (sum <= most) continue;
    most = sum;
    result.body = b;
  }
  const PhysicalBody& body = physical.bodies[result.body];
  const auto begin = weights.begin() + body.first_vertex;
  const double largest = *std::max_element(begin, begin + body.vertex_count);
  const auto carries = [&](std::uint32_t v) { return weights[v] > 0 && weights[v] >= kLeastCarrier * largest; };
  std::size_t count = 0;
  for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v)
    count += carries(v) ? 1U : 0U;
  if (count < kFewCarriers) {
    std::vector<double> ring = weights;
    for (std::uint32_t t = body.first_tetrahedron; t < body.first_tetrahedron + body.tetrahedron_count; ++t) {
      const auto& corners = physical.tetrahedra[t];
      double here = 0;
      for (const std::uint32_t v : corners) here = std::max(here, weights[v]);
      for (const std::uint32_t v : corners) ring[v] = std::max(ring[v], here / 4);
    }
    weights = std::move(ring);
  }
  result.host.mode = formats::ClusterMode::rigid;
  result.host.body = result.body;
  for (std::uint32_t v = body.first_vertex; v < body.first_vertex + body.vertex_count; ++v) {
    if (!carries(v)) continue;
    result.host.vertices.push_back(v);
    result.host.weights.push_back(weights[v]);
  }
  thinOut(result.host, physical.positions);
  return result;
}

// A regular tetrahedron, positively oriented, whose sphere is that of the part's box.
std::array<formats::Float3, 4> tetrahedronAround(const RidingPart& part, const formats::PackageContent& content) {
  Eigen::AlignedBox3d box;
  for (const std::uint32_t v : part.vertices) box.extend(wide(content.visual_positions[v]));
  const Vector3d center = box.center();
  const double reach = std::max(box.diagonal().norm() / 2, 1e-4 * double(content.info.diagonal));
  const double s = reach / std::sqrt(3.0);
  return {narrow(center + Vector3d(s, s, s)), narrow(center + Vector3d(-s, s, -s)),
          narrow(center + Vector3d(s, -s, -s)), narrow(center + Vector3d(-s, -s, s))};
}

// Moves the run of one body apart so that `added` more elements fit behind it; the same for vertices, tetrahedra,
// clusters. Returns where each old element is now.
template <class T>
std::vector<std::uint32_t> spread(std::vector<T>& items, std::vector<formats::BodyRange>& bodies,
                                  std::uint32_t formats::BodyRange::*first, std::uint32_t formats::BodyRange::*count,
                                  const std::vector<std::uint32_t>& added, const T& filler) {
  std::vector<std::uint32_t> now(items.size());
  std::vector<T> moved;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const std::uint32_t begin = bodies[b].*first;
    bodies[b].*first = std::uint32_t(moved.size());
    for (std::uint32_t i = begin; i < begin + bodies[b].*count; ++i) {
      now[i] = std::uint32_t(moved.size());
      moved.push_back(items[i]);
    }
    moved.resize(moved.size() + added[b], filler);
    bodies[b].*count += added[b];
  }
  items = std::move(moved);
  return now;
}

template <class T>
void follow(std::vector<T>& items, const std::vector<std::uint32_t>& now, std::size_t size, T filler) {
  if (items.empty()) return;
  std::vector<T> moved(size, filler);
  for (std::size_t i = 0; i < now.size(); ++i) moved[now[i]] = items[i];
  items = std::move(moved);
}

// A body's number of the next vertex, tetrahedron and cluster to be filled in.
struct Cursor {
  std::uint32_t vertex, tetrahedron, cluster;
};

class PartWriter {
 public:
  PartWriter(const std::vector<RidingPart>& parts, const std::vector<TetrahedronPlace>& places,
             const WeightTransfer& transfer, formats::PackageContent& content)
      : content_(content) {
    const std::vector<formats::BodyRange> before = content.bodies;
    std::vector<std::uint32_t> rigid(content.bodies.size(), 0);
    for (const RidingPart& part : parts) {
      if (!part.rigid) continue;
      carriers_.push_back(carriersOf(part, places, transfer));
      ++rigid[carriers_.back().body];
    }
    if (!carriers_.empty()) makeRoom(rigid);
    for (std::size_t b = 0; b < content.bodies.size(); ++b) {
      const formats::BodyRange& now = content.bodies[b];
      cursors_.push_back({now.first_vertex + before[b].vertex_count,
                          now.first_tetrahedron + before[b].tetrahedron_count,
                          now.first_cluster + before[b].cluster_count});
    }
    std::size_t next = 0;
    for (const RidingPart& part : parts) {
      const std::uint32_t cluster = part.rigid ? carry(part, carriers_[next++]) : formats::kNone;
      content.parts.push_back({content.addText(part.name), cluster, std::uint32_t(content.part_vertices.size()),
                               std::uint32_t(part.vertices.size()), 0});
      content.part_vertices.insert(content.part_vertices.end(), part.vertices.begin(), part.vertices.end());
    }
    if (!carriers_.empty()) joinMemberships();
  }

 private:
  void makeRoom(const std::vector<std::uint32_t>& rigid) {
    formats::PackageContent& c = content_;
    std::vector<std::uint32_t> vertices;
    vertices.reserve(rigid.size());
    for (const std::uint32_t count : rigid) vertices.push_back(4 * count);
    // Members are taken apart cluster by cluster, and put together again at the end.
    for (const formats::Cluster& cluster : c.clusters) {
      const auto begin = c.memberships.begin() + cluster.first_member;
      members_.emplace_back(begin, begin + cluster.member_count);
    }
    using Range = formats::BodyRange;
    std::vector<Range> bodies = c.bodies;
    now_ = spread(c.physical_vertices, bodies, &Range::first_vertex, &Range::vertex_count, vertices, {});
    const auto tetrahedra =
        spread(c.tetrahedra, bodies, &Range::first_tetrahedron, &Range::tetrahedron_count, rigid, {});
    const auto clusters = spread(c.clusters, bodies, &Range::first_cluster, &Range::cluster_count, rigid, {});
    c.bodies = bodies;
    follow(members_, clusters, c.clusters.size(), {});
    follow(c.mechanics, clusters, c.clusters.size(), formats::kPlainMechanics);
    follow(c.vertex_stiffness, now_, c.physical_vertices.size(), 1.0F);
    follow(c.pin_weights, now_, c.physical_vertices.size(), 0.0F);
    for (auto& list : members_) {
      for (formats::Membership& member : list) member.vertex = now_[member.vertex];
    }
    for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
      for (std::uint32_t& v : c.tetrahedra[tetrahedra[t]].vertex) v = now_[v];
    }
    for (std::uint32_t& v : c.pin_set_vertices) v = now_[v];
    for (auto& attachment : c.barycentric) attachment.tetrahedron = tetrahedra[attachment.tetrahedron];
    for (auto& attachment : c.cluster_attachments) attachment.cluster = clusters[attachment.cluster];
  }

  // Returns the part's cluster.
  std::uint32_t carry(const RidingPart& part, Carriers& carriers) {
    formats::PackageContent& c = content_;
    Cursor& cursor = cursors_[carriers.body];
    for (std::uint32_t& v : carriers.host.vertices) v = now_[v];
    float lightest = std::numeric_limits<float>::infinity();
    for (const std::uint32_t v : carriers.host.vertices) lightest = std::min(lightest, c.physical_vertices[v].mass);
    const auto corners = tetrahedronAround(part, c);
    for (std::uint32_t k = 0; k < 4; ++k) c.physical_vertices[cursor.vertex + k] = {corners[k], kRiderMass * lightest};

    ClusterOptions firm;
    firm.mode = formats::ClusterMode::rigid;
    firm.alpha = 1;
    firm.stretch_hz = firm.bend_hz = firm.twist_hz = std::numeric_limits<double>::infinity();
    std::vector<Finding> none;
    ClusterConstants constants = clusterConstants({&carriers.host, 1}, c.physical_vertices, firm, none);
    formats::Cluster cluster = constants.clusters.front();
    cluster.name = c.addText(part.name);
    cluster.mass = 4 * kRiderMass * lightest;
    c.clusters[cursor.cluster] = cluster;
    // Matched to the host, whose vertices it does not move; it moves the four, which do not count in the match.
    std::vector<formats::Membership>& members = members_[cursor.cluster];
    members = std::move(constants.memberships);
    for (formats::Membership& member : members) member.share = 0;
    for (std::uint32_t k = 0; k < 4; ++k) members.push_back({cursor.vertex + k, 0, 1});

    c.tetrahedra[cursor.tetrahedron] = {{cursor.vertex, cursor.vertex + 1, cursor.vertex + 2, cursor.vertex + 3}};
    hang(part, corners, cursor);
    cursor.vertex += 4;
    ++cursor.tetrahedron;
    return cursor.cluster++;
  }

  void hang(const RidingPart& part, const std::array<formats::Float3, 4>& corners, const Cursor& cursor) {
    formats::PackageContent& c = content_;
    if (c.barycentric.empty()) {
      hangOnCluster(part, cursor.cluster);
      return;
    }
    const Vector3d last = wide(corners[3]);
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = wide(corners[std::size_t(k)]) - last;
    const Eigen::Matrix3d inverse = edges.inverse();
    for (const std::uint32_t v : part.vertices) {
      c.barycentric[v] = {cursor.tetrahedron, narrow(inverse * (wide(c.visual_positions[v]) - last))};
    }
  }

  // The runs of all vertices, in order, with one attachment for each of the part's.
  void hangOnCluster(const RidingPart& part, std::uint32_t cluster) {
    std::vector<formats::ClusterAttachment> attachments;
    for (std::uint32_t v = 0; v < content_.cluster_attachment_ranges.size(); ++v) {
      formats::ClusterAttachmentRange& range = content_.cluster_attachment_ranges[v];
      const auto old = content_.cluster_attachments.begin() + range.first;
      const std::uint32_t first = std::uint32_t(attachments.size());
      if (std::binary_search(part.vertices.begin(), part.vertices.end(), v))
        attachments.push_back({cluster, 1});
      else
        attachments.insert(attachments.end(), old, old + range.count);
      range = {first, std::uint32_t(attachments.size()) - first};
    }
    content_.cluster_attachments = std::move(attachments);
  }

  void joinMemberships() {
    content_.memberships.clear();
    for (std::size_t i = 0; i < members_.size(); ++i) {
      content_.clusters[i].first_member = std::uint32_t(content_.memberships.size());
      content_.clusters[i].member_count = std::uint32_t(members_[i].size());
      content_.memberships.insert(content_.memberships.end(), members_[i].begin(), members_[i].end());
    }
  }

  formats::PackageContent& content_;
  std::vector<Carriers> carriers_;  // of the rigid parts
  std::vector<std::uint32_t> now_;  // physical vertices
  std::vector<std::vector<formats::Membership>> members_;
  std::vector<Cursor> cursors_;
};

}  // namespace

std::vector<RidingPart> findParts(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh,
                                  const Topology& topology, std::vector<Finding>& findings) {
  std::vector<RidingPart> parts;
  std::vector<std::uint32_t> taken(topology.parts.size(), kNoIndex);
  std::size_t left = topology.parts.size();
  for (std::uint32_t p = 0; p < recipe.parts.size(); ++p) {
    const RecipePart& source = recipe.parts[p];
    RidingPart part{source.name, source.rigid, {}, {}, authored.part_hosts[p]};
    double best = 0;
    std::vector<std::uint32_t> cut;
    for (std::uint32_t s = 0; s < topology.parts.size(); ++s) {
      double area = 0;
      double inside = 0;
      for (const std::uint32_t t : topology.parts[s].triangles) {
        const double a = areaOf(mesh, t);
        area += a;
        for (const std::uint32_t v : mesh.triangles[t]) inside += a / 3 * authored.parts[p][v];
      }
      const double fraction = area > 0 ? inside / area : 0;
      best = std::max(best, fraction);
      if (fraction > kStray && fraction < 1 - kStray) cut.push_back(topology.parts[s].triangles.front());
      if (fraction < kMostOfPart) continue;
      if (taken[s] != kNoIndex) {
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
      Finding finding;
      finding.id = "part-cut";
      finding.count = cut.size();
      finding.message = "part " + source.name + " selects only some of " + std::to_string(cut.size()) +
                        (cut.size() == 1 ? " loose part; it was" : " loose parts; they were") +
                        " taken whole, or left, by the larger share";
      finding.place_kind = "face";
      for (const std::uint32_t t : cut) {
        if (finding.places.size() < Finding::kMaxPlaces) finding.places.push_back(mesh.triangle_face[t]);
      }
      finding.cure = "Select whole loose parts, as by {\"part\": NUMBER}.";
      findings.push_back(finding);
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
    if (s == kNoIndex || taken[s] == kNoIndex) continue;
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

void addParts(const std::vector<RidingPart>& parts, const std::vector<TetrahedronPlace>& places,
              const WeightTransfer& transfer, formats::PackageContent& content) {
  if (!parts.empty()) PartWriter(parts, places, transfer, content);
}

}  // namespace sinew::tools
