// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/field_host.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <span>

#include "runtime/geometry/pseudo_inverse.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

/// Weight of the whole host in the motion of what rides along, against the cluster's members.
constexpr double kWhole = 1e-3;

}  // namespace

FieldHost::FieldHost(const formats::PackageContent& content, std::uint32_t piece_number)
    : piece(piece_number), range(content.pieces[piece_number]), content_(content) {
  findRiders();
  for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
    if (number_[v] == formats::kNone) continue;
    number_[v] = std::uint32_t(positions.size());
    vertices.push_back(range.first_vertex + v);
    positions.push_back(restOf(range.first_vertex + v));
    masses.push_back(double(content.physical_vertices[range.first_vertex + v].mass));
  }
  for (std::uint32_t t = 0; t < range.tetrahedron_count; ++t) {
    std::array<std::uint32_t, 4> corners = content.tetrahedra[range.first_tetrahedron + t].vertex;
    for (std::uint32_t& v : corners) v = number_[v - range.first_vertex];
    if (std::find(corners.begin(), corners.end(), formats::kNone) == corners.end()) tetrahedra.push_back(corners);
  }
}

void FieldHost::findRiders() {
  number_.assign(range.vertex_count, 0);
  for (const formats::AttachedPart& part : content_.parts) {
    if (part.cluster == formats::kNone) continue;
    const formats::Cluster& cluster = content_.clusters[part.cluster];
    if (cluster.piece != piece) continue;
    riders_.push_back(part.cluster);
    for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
      const formats::Membership& member = content_.memberships[m];
      if (member.share > 0) number_[member.vertex - range.first_vertex] = formats::kNone;
    }
  }
}

Vector3d FieldHost::restOf(std::uint32_t vertex) const {
  const auto& x = content_.physical_vertices[vertex].rest_position;
  return {double(x[0]), double(x[1]), double(x[2])};
}

std::uint32_t FieldHost::numberOf(std::uint32_t vertex) const {
  const bool own = vertex >= range.first_vertex && vertex < range.first_vertex + range.vertex_count;
  return own ? number_[vertex - range.first_vertex] : formats::kNone;
}

bool FieldHost::rides(std::uint32_t cluster) const {
  return std::find(riders_.begin(), riders_.end(), cluster) != riders_.end();
}

std::vector<double> FieldHost::sharesOf(std::uint32_t cluster) const {
  std::vector<double> shares(positions.size(), 0);
  const formats::Cluster& of = content_.clusters[cluster];
  for (std::uint32_t m = of.first_member; m < of.first_member + of.member_count; ++m) {
    const formats::Membership& member = content_.memberships[m];
    const std::uint32_t v = number_[member.vertex - range.first_vertex];
    if (v != formats::kNone) shares[v] += double(member.share);
  }
  return shares;
}

Eigen::Matrix3d FieldHost::edgesOf(std::size_t tetrahedron) const {
  const std::array<std::uint32_t, 4>& corners = tetrahedra[tetrahedron];
  Eigen::Matrix3d edges;
  for (int k = 0; k < 3; ++k) edges.col(k) = positions[corners[std::size_t(k) + 1]] - positions[corners[0]];
  return edges;
}

double FieldHost::volumeOf(std::size_t tetrahedron) const { return std::abs(edgesOf(tetrahedron).determinant()) / 6; }

Eigen::MatrixXd FieldHost::valuesAtAll(const Eigen::MatrixXd& of_host) const {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(range.vertex_count, of_host.cols());
  for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
    if (number_[v] != formats::kNone) all.row(v) = of_host.row(number_[v]);
  }
  for (const std::uint32_t rider : riders_) {
    const formats::Cluster& cluster = content_.clusters[rider];
    const auto members = std::span(content_.memberships).subspan(cluster.first_member, cluster.member_count);
    std::vector<double> weights(range.vertex_count, 0);
    double all_mu = 0, all_mass = 0;
    for (const formats::Membership& member : members) all_mu += double(member.mu);
    for (const double mass : masses) all_mass += mass;
    for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
      if (number_[v] != formats::kNone) weights[v] = kWhole * masses[number_[v]] / all_mass;
    }
    for (const formats::Membership& member : members) {
      weights[member.vertex - range.first_vertex] += double(member.mu) / all_mu;
    }
    Vector3d center = Vector3d::Zero();
    double weight = 0;
    for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
      center += weights[v] * restOf(range.first_vertex + v);
      weight += weights[v];
    }
    center /= weight;
    Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
    for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
      const Vector3d arm = restOf(range.first_vertex + v) - center;
      moment += weights[v] * arm * arm.transpose();
    }
    // The weighed values and their moments: what an affine motion of the host is fitted to.
    const Eigen::Matrix3d inverse = geometry::pseudoInverse<3>(moment);
    Eigen::MatrixX4d parts = Eigen::MatrixX4d::Zero(of_host.rows(), 4);
    for (std::uint32_t v = 0; v < range.vertex_count; ++v) {
      if (!(weights[v] > 0)) continue;
      const Vector3d arm = restOf(range.first_vertex + v) - center;
      parts.row(number_[v]) << weights[v] / weight, weights[v] * arm.transpose() * inverse;
    }
    const Eigen::Matrix4Xd sums = parts.transpose() * of_host;
    for (const formats::Membership& to : members) {
      if (!(to.share > 0)) continue;
      const Vector3d arm = restOf(to.vertex) - center;
      all.row(to.vertex - range.first_vertex) += sums.row(0) + arm.transpose() * sums.bottomRows<3>();
    }
  }
  return all;
}

}  // namespace sinew::tools
