// SPDX-License-Identifier: MIT
#include "tests/support/field_content.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace sinew::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr std::size_t kMostPoints = 96;

Vector3d wide(const formats::Float3& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

Eigen::RowVectorXd monomialsAt(const Vector3d& q) {
  Eigen::RowVectorXd m(10);
  m << 1, q[0], q[1], q[2], q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return m;
}

// d/dq of the monomials, a row each.
MatrixXd gradientsAt(const Vector3d& q) {
  MatrixXd g = MatrixXd::Zero(10, 3);
  g.middleRows<3>(1).setIdentity();
  g.middleRows<3>(4).diagonal() = 2 * q;
  g.row(7) << q[1], q[0], 0;
  g.row(8) << 0, q[2], q[1];
  g.row(9) << q[2], 0, q[0];
  return g;
}

void appendLanes(const MatrixXd& rows, std::vector<formats::Lanes>& to) {
  for (Eigen::Index block = 0; 8 * block < rows.rows(); ++block) {
    for (Eigen::Index j = 0; j < rows.cols(); ++j) {
      formats::Lanes lanes = {};
      for (Eigen::Index lane = 0; lane < std::min<Eigen::Index>(8, rows.rows() - 8 * block); ++lane) {
        lanes[std::size_t(lane)] = float(rows(8 * block + lane, j));
      }
      to.push_back(lanes);
    }
  }
}

struct Sample {
  double volume;
  Vector3d at;
  MatrixXd gradients;  // k x 3
};

class BodyField {
 public:
  BodyField(formats::PackageContent& content, std::uint32_t body)
      : content_(content), body_(content.pieces[body]), index_(body) {
    findBasis();
    findMaterial();
    findSamples();
    diagonalize();
  }

  void append() {
    const Eigen::Index k = basis_.cols();
    formats::Field field = {};
    field.piece = index_;
    field.function_count = std::uint32_t(k);
    field.first_function = std::uint32_t(content_.field_functions.size());
    field.first_pack = std::uint32_t(content_.field_packs.size());
    field.pack_count = std::uint32_t((samples_.size() + 7) / 8);
    field.first_gradient = std::uint32_t(content_.field_gradients.size());
    field.first_value = std::uint32_t(content_.field_values.size());
    field.first_point = std::uint32_t(content_.field_points.size());
    field.first_point_value = std::uint32_t(content_.field_point_values.size());
    field.first_mode = std::uint32_t(content_.field_modes.size());
    field.least_eigenvalue = 1;
    const MatrixXd values = monomials_ * basis_;
    for (Eigen::Index j = 0; j < k; ++j) {
      const Eigen::VectorXd weighed = masses_.cwiseProduct(values.col(j));
      const Vector3d rest = positions_.transpose() * weighed;
      formats::FieldFunction function = {};
      function.stiffness = float(stiffness_[j]);
      function.damping_hz = float(std::sqrt(stiffness_[j]) / (2 * std::numbers::pi));
      function.one = float(weighed.sum());
      function.rest = {float(rest[0]), float(rest[1]), float(rest[2])};
      function.pin_set = formats::kNone;
      content_.field_functions.push_back(function);
    }
    for (std::size_t first = 0; first < samples_.size(); first += 8) {
      const std::size_t count = std::min<std::size_t>(8, samples_.size() - first);
      formats::FieldPack pack = {};
      pack.cluster.fill(formats::kNone);
      MatrixXd gradients = MatrixXd::Zero(Eigen::Index(count), 3 * k);
      for (std::size_t s = 0; s < count; ++s) {
        const Sample& sample = samples_[first + s];
        pack.volume[s] = float(sample.volume);
        pack.mu[s] = float(mu_);
        pack.lambda[s] = float(lambda_);
        for (int a = 0; a < 3; ++a) {
          pack.at[std::size_t(a)][s] = float(sample.at[a]);
          for (Eigen::Index j = 0; j < k; ++j) gradients(Eigen::Index(s), 3 * j + a) = sample.gradients(j, a);
        }
      }
      content_.field_packs.push_back(pack);
      appendLanes(gradients, content_.field_gradients);
    }
    appendLanes(values, content_.field_values);
    appendPoints(field);
    appendModes(field);
    content_.fields.push_back(field);
  }

 private:
  Vector3d local(const Vector3d& x) const { return (x - center_) / size_; }

  // Columns of `basis_`: combinations of monomials that are orthonormal under the masses; those that the body's
  // vertices cannot tell apart are left out.
  void findBasis() {
    const Eigen::Index n = body_.vertex_count;
    positions_.resize(n, 3);
    masses_.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const formats::PhysicalVertex& vertex = content_.physical_vertices[body_.first_vertex + std::uint32_t(i)];
      positions_.row(i) = wide(vertex.rest_position).transpose();
      masses_[i] = double(vertex.mass);
    }
    center_ = positions_.transpose() * masses_ / masses_.sum();
    const Vector3d sides = (positions_.colwise().maxCoeff() - positions_.colwise().minCoeff()).transpose();
    size_ = sides.maxCoeff();
    monomials_.resize(n, 10);
    for (Eigen::Index i = 0; i < n; ++i) monomials_.row(i) = monomialsAt(local(positions_.row(i).transpose()));
    basis_.resize(10, 0);
    for (Eigen::Index m = 0; m < 10; ++m) {
      Eigen::VectorXd column = Eigen::VectorXd::Unit(10, m);
      const auto normOf = [&] { return std::sqrt((monomials_ * column).cwiseAbs2().dot(masses_)); };
      const double before = normOf();
      for (int round = 0; round < 2; ++round) {
        const Eigen::VectorXd along =
            (monomials_ * basis_).transpose() * masses_.cwiseProduct((monomials_ * column).eval());
        column -= basis_ * along;
      }
      const double after = normOf();
      if (!(after > 1e-4 * before)) continue;
      basis_.conservativeResize(10, basis_.cols() + 1);
      basis_.rightCols<1>() = column / after;
    }
  }

  void findMaterial() {
    const formats::Cluster& cluster = content_.clusters[body_.first_cluster];
    double young = 0, poisson = 0.3;
    if (!content_.mechanics.empty() &&
        content_.mechanics[body_.first_cluster].stiffness == formats::StiffnessModel::elastic) {
      young = double(content_.mechanics[body_.first_cluster].young);
      poisson = double(content_.mechanics[body_.first_cluster].poisson);
    } else {
      const double hz = cluster.mode == formats::ClusterMode::rigid ? 100 : double(cluster.stretch_hz);
      young = double(content_.info.density) * std::pow(2 * size_ * std::clamp(hz, 1e-3, 1e5), 2);
    }
    mu_ = young / (2 * (1 + poisson));
    lambda_ = young * poisson / ((1 + poisson) * (1 - 2 * poisson));
  }

  void findSamples() {
    for (std::uint32_t t = 0; t < body_.tetrahedron_count; ++t) {
      const auto& corners = content_.tetrahedra[body_.first_tetrahedron + t].vertex;
      std::array<Vector3d, 4> x;
      for (std::size_t c = 0; c < 4; ++c) x[c] = wide(content_.physical_vertices[corners[c]].rest_position);
      const Vector3d middle = (x[0] + x[1] + x[2] + x[3]) / 4;
      const double volume = std::abs((x[1] - x[0]).cross(x[2] - x[0]).dot(x[3] - x[0])) / 6;
      samples_.push_back({volume, middle, basis_.transpose() * gradientsAt(local(middle)) / size_});
    }
  }

  void diagonalize() {
    const Eigen::Index k = basis_.cols();
    MatrixXd w = MatrixXd::Zero(k, k);
    for (const Sample& s : samples_) w += s.volume * (2 * mu_ + lambda_) * s.gradients * s.gradients.transpose();
    const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(w);
    basis_ = (basis_ * solver.eigenvectors()).eval();
    for (Sample& s : samples_) s.gradients = (solver.eigenvectors().transpose() * s.gradients).eval();
    stiffness_ = solver.eigenvalues().cwiseMax(0);
  }

  // Visual vertices of the body, each as far as can be from those before it.
  void appendPoints(formats::Field& field) {
    std::vector<Vector3d> candidates;
    for (std::size_t v = 0; v < content_.visual_positions.size(); ++v) {
      const bool hung = !content_.barycentric.empty();
      const std::uint32_t t = hung ? content_.barycentric[v].tetrahedron : body_.first_tetrahedron;
      if (t - body_.first_tetrahedron < body_.tetrahedron_count)
        candidates.push_back(wide(content_.visual_positions[v]));
    }
    std::vector<double> distance(candidates.size(), std::numeric_limits<double>::infinity());
    std::vector<Vector3d> points;
    std::size_t next = 0;
    while (points.size() < std::min(kMostPoints, candidates.size())) {
      points.push_back(candidates[next]);
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        distance[i] = std::min(distance[i], (candidates[i] - points.back()).squaredNorm());
      }
      next = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
      if (!(distance[next] > 0)) break;
    }
    MatrixXd values(Eigen::Index(points.size()), basis_.cols());
    const float area = float(6 * size_ * size_ / double(std::max<std::size_t>(1, points.size())));
    for (std::size_t i = 0; i < points.size(); ++i) {
      values.row(Eigen::Index(i)) = monomialsAt(local(points[i])) * basis_;
      content_.field_points.push_back({{float(points[i][0]), float(points[i][1]), float(points[i][2])}, area});
    }
    field.point_count = std::uint32_t(points.size());
    appendLanes(values, content_.field_point_values);
  }

  // Modes of the rest stiffness, by eight: squared frequencies, then the coefficients of unknown 3 j + axis.
  void appendModes(formats::Field& field) {
    const Eigen::Index n = 3 * basis_.cols();
    MatrixXd stiffness = MatrixXd::Zero(n, n);
    for (const Sample& s : samples_) {
      for (Eigen::Index i = 0; i < n; ++i) {
        for (Eigen::Index j = 0; j <= i; ++j) {
          const Eigen::Index a = i % 3, b = j % 3;
          const auto gi = s.gradients.row(i / 3), gj = s.gradients.row(j / 3);
          const double shear = (a == b ? gi.dot(gj) : 0.0) + gi[b] * gj[a];
          stiffness(i, j) += s.volume * (mu_ * shear + lambda_ * gi[a] * gj[b]);
        }
      }
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(stiffness);  // of the lower triangle
    for (Eigen::Index first = 0; first < n; first += 8) {
      const Eigen::Index count = std::min<Eigen::Index>(8, n - first);
      MatrixXd rows(count, n + 1);
      rows.col(0) = modes.eigenvalues().segment(first, count).cwiseMax(0);
      rows.rightCols(n) = modes.eigenvectors().middleCols(first, count).transpose();
      appendLanes(rows, content_.field_modes);
    }
    field.lowest_hz =
        float(std::sqrt(std::max(0.0, modes.eigenvalues()[std::min<Eigen::Index>(6, n - 1)])) / (2 * std::numbers::pi));
  }

  formats::PackageContent& content_;
  const formats::PieceRange body_;
  const std::uint32_t index_;
  MatrixXd positions_, monomials_, basis_;
  Eigen::VectorXd masses_, stiffness_;
  Vector3d center_ = Vector3d::Zero();
  double size_ = 1, mu_ = 0, lambda_ = 0;
  std::vector<Sample> samples_;
};

}  // namespace

void addFields(formats::PackageContent& content) {
  for (std::uint32_t body = 0; body < content.pieces.size(); ++body) BodyField(content, body).append();
}

void addResiduals(formats::PackageContent& content) {
  constexpr std::uint32_t kModes = 7;
  for (std::uint32_t f = 0; f < content.fields.size(); ++f) {
    if (content.fields[f].held != 0) continue;
    const formats::PieceRange& piece = content.pieces[content.fields[f].piece];
    const double compliance = 1 / (double(content.info.total_mass) * std::pow(2 * std::numbers::pi * 30, 2));
    content.field_residuals.push_back({f, kModes, std::uint32_t(content.field_residual_values.size()),
                                       std::uint32_t(content.field_residual_locals.size()),
                                       float(std::sqrt(compliance) / 30000)});
    for (std::uint32_t block = 0; block < piece.vertex_count; block += 8) {
      for (std::uint32_t row = 0; row < 3 * kModes; ++row) {
        for (std::uint32_t v = block; v < block + 8; ++v) {
          double value = 0;
          if (v < piece.vertex_count) {
            const auto& at = content.physical_vertices[piece.first_vertex + v].rest_position;
            value = 30000 * std::cos(double(row) + 5 * double(at[0]) + 7 * double(at[row % 3]));
          }
          content.field_residual_values.push_back(std::int16_t(std::lround(value)));
        }
      }
    }
    content.field_residual_locals.insert(content.field_residual_locals.end(), piece.vertex_count, float(compliance));
  }
}

}  // namespace sinew::test
