// SPDX-License-Identifier: MIT
#include "tests/support/box_package.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>

#include "runtime/geometry/pseudo_inverse.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using Eigen::Vector3d;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

Vector3d restOf(const formats::PackageContent& content, std::uint32_t vertex) {
  const auto& x = content.physical_vertices[vertex].rest_position;
  return {double(x[0]), double(x[1]), double(x[2])};
}

Vector9d monomialsOf(const Vector3d& q) {
  Vector9d m;
  m << q[0], q[1], q[2], q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return m;
}

std::array<float, 3> toFloat3(const Vector3d& v) { return {float(v[0]), float(v[1]), float(v[2])}; }

}  // namespace

void computeClusterConstants(formats::PackageContent& content, const std::vector<double>& weights) {
  std::vector<double> total(content.physical_vertices.size(), 0);
  for (std::size_t k = 0; k < weights.size(); ++k) total[content.memberships[k].vertex] += weights[k];
  content.quadratic_moments.clear();
  for (formats::Cluster& cluster : content.clusters) {
    double mass = 0;
    Vector3d center = Vector3d::Zero();
    const std::uint32_t end = cluster.first_member + cluster.member_count;
    for (std::uint32_t k = cluster.first_member; k < end; ++k) {
      formats::Membership& member = content.memberships[k];
      const double share = weights[k] / total[member.vertex];
      const double mu = double(content.physical_vertices[member.vertex].mass) * share;
      member.share = float(share);
      member.mu = float(mu);
      mass += mu;
      center += mu * restOf(content, member.vertex);
    }
    center /= mass;
    double radius = 0;
    for (std::uint32_t k = cluster.first_member; k < end; ++k) {
      radius = std::max(radius, (restOf(content, content.memberships[k].vertex) - center).norm());
    }
    cluster.radius = radius > 0 ? float(radius) : 1.0F;
    cluster.rest_center = toFloat3(center);
    cluster.mass = float(mass);
    const Vector3d rounded(double(cluster.rest_center[0]), double(cluster.rest_center[1]),
                           double(cluster.rest_center[2]));
    Vector9d mean = Vector9d::Zero();
    for (std::uint32_t k = cluster.first_member; k < end; ++k) {
      formats::Membership& member = content.memberships[k];
      member.mu = float(double(member.mu) / mass);
      mean += double(member.mu) * monomialsOf((restOf(content, member.vertex) - rounded) / double(cluster.radius));
    }
    mean.head<3>().setZero();
    Matrix9d moment = Matrix9d::Zero();
    for (std::uint32_t k = cluster.first_member; k < end; ++k) {
      const formats::Membership& member = content.memberships[k];
      const Vector9d q = monomialsOf((restOf(content, member.vertex) - rounded) / double(cluster.radius)) - mean;
      moment += double(member.mu) * q * q.transpose();
    }
    const Eigen::Matrix3d spread = moment.topLeftCorner<3, 3>();
    const Eigen::Matrix3d a = geometry::pseudoInverse<3>(spread);
    cluster.a_qq = {float(a(0, 0)), float(a(1, 1)), float(a(2, 2)), float(a(0, 1)), float(a(1, 2)), float(a(2, 0))};
    cluster.quadratic = formats::kNone;
    if (cluster.mode == formats::ClusterMode::quadratic) {
      cluster.quadratic = std::uint32_t(content.quadratic_moments.size());
      const Matrix9d inverse = geometry::pseudoInverse<9>(moment);
      formats::QuadraticMoment packed{};
      std::size_t n = 0;
      for (int row = 0; row < 9; ++row) {
        for (int column = 0; column <= row; ++column) packed.a_qq[n++] = float(inverse(row, column));
      }
      content.quadratic_moments.push_back(packed);
    }
  }
}

formats::PackageContent boxContent(const BoxOptions& o) {
  formats::PackageContent content;
  const auto [nx, ny, nz] = o.cells;
  std::map<std::array<std::uint32_t, 3>, std::uint32_t> numbers;
  std::vector<std::array<std::uint32_t, 3>> grid;  // by vertex
  const auto number = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const auto [place, added] = numbers.try_emplace({i, j, k}, std::uint32_t(grid.size()));
    if (added) grid.push_back({i, j, k});
    return place->second;
  };
  const Vector3d step(o.size[0] / nx, o.size[1] / ny, o.size[2] / nz);
  const Vector3d corner(o.center[0] - o.size[0] / 2, o.center[1] - o.size[1] / 2, o.center[2] - o.size[2] / 2);
  const auto position = [&](std::uint32_t v) {
    return Vector3d(corner + Vector3d(grid[v][0], grid[v][1], grid[v][2]).cwiseProduct(step));
  };
  std::map<std::array<std::uint32_t, 3>, formats::Triangle> faces;  // sorted corners -> outward triangle
  const auto add_tetrahedron = [&](std::array<std::uint32_t, 4> t) {
    const Vector3d a = position(t[0]), b = position(t[1]), c = position(t[2]), d = position(t[3]);
    if ((b - a).cross(c - a).dot(d - a) < 0) std::swap(t[2], t[3]);
    content.tetrahedra.push_back({t});
    const formats::Triangle sides[4] = {{t[0], t[2], t[1]}, {t[0], t[1], t[3]}, {t[1], t[2], t[3]}, {t[0], t[3], t[2]}};
    for (const formats::Triangle& side : sides) {
      std::array<std::uint32_t, 3> key = side;
      std::sort(key.begin(), key.end());
      if (!faces.try_emplace(key, side).second) faces.erase(key);
    }
  };
  for (std::uint32_t k = 0; k < nz; ++k) {
    for (std::uint32_t j = 0; j < ny; ++j) {
      for (std::uint32_t i = 0; i < nx; ++i) {
        if (o.keep && !o.keep(i, j, k)) continue;
        std::array<std::uint32_t, 8> v{};
        for (std::uint32_t n = 0; n < 8; ++n) v[n] = number(i + (n & 1U), j + (n >> 1U & 1U), k + (n >> 2U & 1U));
        if ((i + j + k) % 2 == 0) {
          add_tetrahedron({v[0], v[3], v[5], v[6]});
          add_tetrahedron({v[1], v[0], v[3], v[5]});
          add_tetrahedron({v[2], v[0], v[3], v[6]});
          add_tetrahedron({v[4], v[0], v[5], v[6]});
          add_tetrahedron({v[7], v[3], v[5], v[6]});
        } else {
          add_tetrahedron({v[1], v[2], v[4], v[7]});
          add_tetrahedron({v[0], v[1], v[2], v[4]});
          add_tetrahedron({v[3], v[1], v[2], v[7]});
          add_tetrahedron({v[5], v[1], v[4], v[7]});
          add_tetrahedron({v[6], v[2], v[4], v[7]});
        }
      }
    }
  }
  std::vector<double> mass(grid.size(), 0);
  double volume = 0;
  std::vector<std::uint32_t> some_tetrahedron(grid.size(), 0), place_in_it(grid.size(), 0);
  for (std::uint32_t t = 0; t < content.tetrahedra.size(); ++t) {
    const auto& v = content.tetrahedra[t].vertex;
    const Vector3d a = position(v[0]);
    const double part = (position(v[1]) - a).cross(position(v[2]) - a).dot(position(v[3]) - a) / 6;
    volume += part;
    for (std::uint32_t n = 0; n < 4; ++n) {
      mass[v[n]] += part / 4 * o.density;
      some_tetrahedron[v[n]] = t;
      place_in_it[v[n]] = n;
    }
  }
  Vector3d low = Vector3d::Constant(1e30), high = Vector3d::Constant(-1e30);
  for (std::uint32_t v = 0; v < grid.size(); ++v) {
    content.physical_vertices.push_back({toFloat3(position(v)), float(mass[v])});
    low = low.cwiseMin(position(v));
    high = high.cwiseMax(position(v));
  }

  // Clusters: boxes whose weight falls off linearly through the overlap.
  const formats::StringRef name = content.addText("box");
  std::vector<double> weights;
  for (std::uint32_t ck = 0; ck < o.clusters[2]; ++ck) {
    for (std::uint32_t cj = 0; cj < o.clusters[1]; ++cj) {
      for (std::uint32_t ci = 0; ci < o.clusters[0]; ++ci) {
        formats::Cluster cluster{};
        cluster.name = name;
        cluster.mode = o.mode;
        cluster.first_member = std::uint32_t(content.memberships.size());
        cluster.alpha = o.alpha;
        cluster.stretch_hz = o.stretch_hz;
        cluster.bend_hz = o.bend_hz;
        cluster.twist_hz = o.twist_hz;
        const std::array<std::uint32_t, 3> index = {ci, cj, ck};
        for (std::uint32_t v = 0; v < grid.size(); ++v) {
          double weight = 1;
          for (std::size_t axis = 0; axis < 3; ++axis) {
            if (o.clusters[axis] == 1) continue;
            const double width = o.size[axis] / o.clusters[axis];
            const double from_center =
                std::abs(double(grid[v][axis]) * step[Eigen::Index(axis)] - (index[axis] + 0.5) * width);
            const double reach = width * (0.5 + o.overlap);
            weight *= from_center <= reach + 1e-9
                          ? std::max(0.05, std::min(1.0, (reach - from_center) / (o.overlap * width)))
                          : 0;
          }
          if (weight == 0) continue;
          content.memberships.push_back({v, 0, 0});
          weights.push_back(weight);
        }
        cluster.member_count = std::uint32_t(content.memberships.size()) - cluster.first_member;
        if (cluster.member_count > 0) content.clusters.push_back(cluster);
      }
    }
  }
  computeClusterConstants(content, weights);
  content.pieces.push_back({0, std::uint32_t(grid.size()), 0, std::uint32_t(content.tetrahedra.size()), 0,
                            std::uint32_t(content.clusters.size()), name});

  // Visual mesh: the surface, with a normal per vertex averaged by area.
  std::map<std::uint32_t, std::uint32_t> visual;
  std::vector<Vector3d> normals;
  std::vector<std::uint32_t> physical;
  for (const auto& [key, face] : faces) {
    const Vector3d area = (position(face[1]) - position(face[0])).cross(position(face[2]) - position(face[0]));
    formats::Triangle triangle{};
    for (std::size_t n = 0; n < 3; ++n) {
      const auto [place, added] = visual.try_emplace(face[n], std::uint32_t(physical.size()));
      if (added) {
        physical.push_back(face[n]);
        normals.push_back(Vector3d::Zero());
      }
      triangle[n] = place->second;
      normals[place->second] += area;
    }
    content.visual_triangles.push_back(triangle);
  }
  content.sub_meshes.push_back({name, formats::kNone, 0, std::uint32_t(content.visual_triangles.size()), 0});
  for (std::uint32_t i = 0; i < physical.size(); ++i) {
    const std::uint32_t v = physical[i];
    content.visual_positions.push_back(content.physical_vertices[v].rest_position);
    content.visual_normals.push_back(toFloat3(normals[i].normalized()));
    if (o.cluster_attachment) {
      const std::uint32_t first = std::uint32_t(content.cluster_attachments.size());
      for (std::uint32_t c = 0; c < content.clusters.size(); ++c) {
        const formats::Cluster& cluster = content.clusters[c];
        for (std::uint32_t k = 0; k < cluster.member_count; ++k) {
          const formats::Membership& member = content.memberships[cluster.first_member + k];
          if (member.vertex == v) content.cluster_attachments.push_back({c, member.share});
        }
      }
      content.cluster_attachment_ranges.push_back({first, std::uint32_t(content.cluster_attachments.size()) - first});
    } else {
      formats::BarycentricAttachment attachment{some_tetrahedron[v], {0, 0, 0}};
      if (place_in_it[v] < 3) attachment.weight[place_in_it[v]] = 1;
      content.barycentric.push_back(attachment);
    }
  }

  content.info.metres_per_unit = 1;
  content.info.bounds_min = toFloat3(low);
  content.info.bounds_max = toFloat3(high);
  content.info.diagonal = float((high - low).norm());
  content.info.total_mass = float(volume * o.density);
  content.info.density = float(o.density);
  content.info.physical_volume = content.info.source_volume = float(volume);
  content.info.name = name;
  content.info.tool_version = content.info.source_file = content.info.unit_source = name;
  content.info.settings_json = content.addText("{}");
  return content;
}

void appendBody(formats::PackageContent& content, const formats::PackageContent& other) {
  const std::uint32_t vertices = std::uint32_t(content.physical_vertices.size());
  const std::uint32_t tetrahedra = std::uint32_t(content.tetrahedra.size());
  const std::uint32_t clusters = std::uint32_t(content.clusters.size());
  const std::uint32_t members = std::uint32_t(content.memberships.size());
  const std::uint32_t moments = std::uint32_t(content.quadratic_moments.size());
  const std::uint32_t visual = std::uint32_t(content.visual_positions.size());
  const std::uint32_t triangles = std::uint32_t(content.visual_triangles.size());
  const std::uint32_t pieces = std::uint32_t(content.pieces.size());
  const formats::StringRef name = content.addText("part");
  const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
  append(content.physical_vertices, other.physical_vertices);
  append(content.quadratic_moments, other.quadratic_moments);
  append(content.visual_positions, other.visual_positions);
  append(content.visual_normals, other.visual_normals);
  for (formats::Tetrahedron t : other.tetrahedra) {
    for (std::uint32_t& v : t.vertex) v += vertices;
    content.tetrahedra.push_back(t);
  }
  for (formats::Cluster c : other.clusters) {
    c.name = name;
    c.piece += pieces;
    c.first_member += members;
    if (c.quadratic != formats::kNone) c.quadratic += moments;
    content.clusters.push_back(c);
  }
  for (formats::Membership m : other.memberships) {
    m.vertex += vertices;
    content.memberships.push_back(m);
  }
  for (formats::Triangle t : other.visual_triangles) {
    for (std::uint32_t& v : t) v += visual;
    content.visual_triangles.push_back(t);
  }
  for (formats::SubMesh s : other.sub_meshes) {
    s.name = name;
    s.first_triangle += triangles;
    content.sub_meshes.push_back(s);
  }
  for (formats::BarycentricAttachment a : other.barycentric) {
    a.tetrahedron += tetrahedra;
    content.barycentric.push_back(a);
  }
  for (formats::PieceRange b : other.pieces) {
    b.first_vertex += vertices;
    b.first_tetrahedron += tetrahedra;
    b.first_cluster += clusters;
    b.name = name;
    content.pieces.push_back(b);
  }
  float diagonal2 = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    content.info.bounds_min[k] = std::min(content.info.bounds_min[k], other.info.bounds_min[k]);
    content.info.bounds_max[k] = std::max(content.info.bounds_max[k], other.info.bounds_max[k]);
    const float side = content.info.bounds_max[k] - content.info.bounds_min[k];
    diagonal2 += side * side;
  }
  content.info.diagonal = std::sqrt(diagonal2);
  content.info.total_mass += other.info.total_mass;
}

std::shared_ptr<const Asset> makeAsset(formats::PackageContent content) {
  if (content.fields.empty()) addFields(content);
  return makePlainAsset(content);
}

std::shared_ptr<const Asset> makePlainAsset(const formats::PackageContent& content) {
  const std::vector<std::byte> bytes = formats::writePackage(content);
  auto asset = Asset::fromMemory(bytes);
  if (!asset) {
    ADD_FAILURE() << asset.reason();
    return nullptr;
  }
  return *asset;
}

std::shared_ptr<const Asset> boxAsset(const BoxOptions& options) { return makeAsset(boxContent(options)); }

}  // namespace sinew::test
