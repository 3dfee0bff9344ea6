// SPDX-License-Identifier: MIT
#include "runtime/cut/clusters.h"

#include <Eigen/Dense>
#include <algorithm>
#include <utility>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/symmetric_eigen.h"

namespace sinew::cutting {
namespace {

using formats::kNone;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

Vector9d monomialsOf(const Vector3d& q) {
  Vector9d m;
  m << q[0], q[1], q[2], q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return m;
}

/// As geometry::pseudoInverse(), whose code is small and, of nine rows, ten times slower.
Eigen::MatrixXd pseudoInverse(const Eigen::MatrixXd& moment) {
  const geometry::SymmetricEigen eigen = geometry::symmetricEigen(moment);
  const double least = geometry::kMomentCutoff * std::max(0.0, eigen.values[eigen.values.size() - 1]);
  const Eigen::VectorXd inverse = (eigen.values.array() > least).select(eigen.values.cwiseInverse(), 0.0);
  return eigen.vectors * inverse.asDiagonal() * eigen.vectors.transpose();
}

class Clusters {
 public:
  Clusters(const Cut& cut, const PartMesh& mesh, const std::vector<PartPiece>& pieces,
           const std::vector<std::uint32_t>& local, formats::PackageContent& content)
      : cut_(cut), package_(cut.package), mesh_(mesh), pieces_(pieces), local_(local), out_(content) {}

  std::vector<std::uint32_t> run() {
    clusters_.assign(package_.clusters().size(), kNone);
    out_.curve_points.assign(package_.curvePoints().begin(), package_.curvePoints().end());
    out_.channels.assign(package_.channels().begin(), package_.channels().end());
    for (const PartPiece& piece : pieces_) {
      const formats::PieceRange& range = package_.pieces()[piece.source];
      const auto first = std::uint32_t(out_.clusters.size());
      for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c)
        addCluster(c, piece);
      out_.pieces.push_back({piece.first, piece.count, piece.first_tetrahedron, piece.tetrahedron_count, first,
                             std::uint32_t(out_.clusters.size()) - first, range.name});
    }
    return std::move(clusters_);
  }

 private:
  void addCluster(std::uint32_t c, const PartPiece& piece) {
    const formats::Cluster& from = package_.clusters()[c];
    const auto members = package_.memberships().subspan(from.first_member, from.member_count);
    std::uint32_t rider = kNone;
    for (std::uint32_t p = 0; p < package_.parts().size(); ++p) {
      if (package_.parts()[p].cluster == c) rider = p;
    }
    formats::Cluster made = from;
    made.piece = piece.piece;
    made.first_member = std::uint32_t(out_.memberships.size());
    made.quadratic = kNone;
    double mass = 0, shared = 0;
    Vector3d center = Vector3d::Zero();
    std::vector<double> mu;
    for (const formats::Membership& m : members) {
      // All copies of a vertex.
      for (std::uint32_t v = firstOf(m.vertex); v < mesh_.vertices.size() && mesh_.vertices[v] == m.vertex; ++v) {
        const double own = double(mesh_.masses[v]) / double(package_.physicalVertices()[m.vertex].mass);
        // Carriers keep their weights; an accessory's own four vertices have none.
        const double weight = rider != kNone ? double(m.mu) * own : double(mesh_.masses[v]) * double(m.share);
        mu.push_back(weight);
        mass += weight;
        shared += double(mesh_.masses[v]) * double(m.share);
        center += weight * restOf(v);
        out_.memberships.push_back({v, 0, m.share});
      }
    }
    if (mu.empty()) return;
    if (!(mass > 0)) {
      // Members without weight of their own: alike.
      std::fill(mu.begin(), mu.end(), 1.0);
      mass = double(mu.size());
      center.setZero();
      for (std::size_t i = 0; i < mu.size(); ++i) center += restOf(out_.memberships[made.first_member + i].vertex);
    }
    center /= mass;
    made.member_count = std::uint32_t(mu.size());
    made.rest_center = asFloats(center);
    center = asVector(made.rest_center);
    made.mass = rider != kNone ? std::min(from.mass, float(totalMass())) : std::max(1e-37F, float(shared));
    const bool whole = cut_.piece_is_whole[piece.source] != 0;
    double radius = 0;
    for (std::size_t i = 0; i < mu.size(); ++i) {
      formats::Membership& m = out_.memberships[made.first_member + i];
      m.mu = float(mu[i] / mass);
      if (m.mu > 0 || rider == kNone) radius = std::max(radius, (restOf(m.vertex) - center).norm());
    }
    made.radius = radius > 1e-9 * double(package_.info().diagonal) ? float(radius) : 1.0F;
    if (whole) {
      // As it was, bit for bit.
      made = from;
      made.piece = piece.piece;
      made.first_member = std::uint32_t(out_.memberships.size() - mu.size());
      for (std::size_t i = 0; i < mu.size(); ++i) out_.memberships[made.first_member + i].mu = members[i].mu;
      if (from.mode == formats::ClusterMode::quadratic) {
        made.quadratic = std::uint32_t(out_.quadratic_moments.size());
        out_.quadratic_moments.push_back(package_.quadraticMoments()[from.quadratic]);
      }
    } else {
      setMoments(from, made);
    }
    clusters_[c] = std::uint32_t(out_.clusters.size());
    out_.clusters.push_back(made);
    if (!package_.mechanics().empty()) out_.mechanics.push_back(package_.mechanics()[c]);
  }

  void setMoments(const formats::Cluster& from, formats::Cluster& made) {
    const Vector3d center = asVector(made.rest_center);
    Vector9d mean = Vector9d::Zero();
    Matrix9d moment = Matrix9d::Zero();
    const bool quadratic = from.mode == formats::ClusterMode::quadratic;
    for (std::uint32_t i = made.first_member; i < made.first_member + made.member_count; ++i) {
      const formats::Membership& m = out_.memberships[i];
      const Vector9d q = monomialsOf((restOf(m.vertex) - center) / double(made.radius));
      mean += double(m.mu) * q;
      if (quadratic) {
        moment += double(m.mu) * q * q.transpose();
      } else {
        moment.topLeftCorner<3, 3>() += double(m.mu) * q.head<3>() * q.head<3>().transpose();
      }
    }
    if (quadratic) {
      moment -= mean * mean.transpose();
    } else {
      moment.topLeftCorner<3, 3>() -= mean.head<3>() * mean.head<3>().transpose();
    }
    const Eigen::Matrix3d spread = moment.topLeftCorner<3, 3>();
    const Eigen::Matrix3d a = pseudoInverse(spread);
    made.a_qq = {float(a(0, 0)), float(a(1, 1)), float(a(2, 2)), float(a(0, 1)), float(a(1, 2)), float(a(2, 0))};
    if (!quadratic) return;
    made.quadratic = std::uint32_t(out_.quadratic_moments.size());
    const Matrix9d inverse = pseudoInverse(moment);
    formats::QuadraticMoment packed{};
    for (int row = 0, n = 0; row < 9; ++row) {
      for (int column = 0; column <= row; ++column, ++n) packed.a_qq[std::size_t(n)] = float(inverse(row, column));
    }
    out_.quadratic_moments.push_back(packed);
  }

  /// Place in the part's list of the first copy of a vertex.
  std::uint32_t firstOf(std::uint32_t vertex) const {
    std::uint32_t v = local_[vertex];
    if (v == kNone) return std::uint32_t(mesh_.vertices.size());
    while (v > 0 && mesh_.vertices[v - 1] == vertex) --v;
    return v;
  }
  Vector3d restOf(std::uint32_t local) const { return asVector(out_.physical_vertices[local].rest_position); }
  double totalMass() const {
    double sum = 0;
    for (const float m : mesh_.masses) sum += double(m);
    return sum;
  }

  const Cut& cut_;
  const formats::PackageView& package_;
  const PartMesh& mesh_;
  const std::vector<PartPiece>& pieces_;
  const std::vector<std::uint32_t>& local_;
  formats::PackageContent& out_;
  std::vector<std::uint32_t> clusters_;  // of the package's
};

}  // namespace

std::vector<std::uint32_t> addClusters(const Cut& cut, const PartMesh& mesh, const std::vector<PartPiece>& pieces,
                                       const std::vector<std::uint32_t>& local, formats::PackageContent& content) {
  return Clusters(cut, mesh, pieces, local, content).run();
}

}  // namespace sinew::cutting
