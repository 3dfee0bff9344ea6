// SPDX-License-Identifier: MIT
#include "runtime/cut/fields.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Of the largest: combinations of functions of less squared norm on the part are none, for the parent's values are
/// floats. Moments of less are those of a flat piece.
constexpr double kIndependent = 1e-6, kFlat = 1e-12;
/// Energy samples by function.
constexpr double kSamples = 4;
/// Contact points on a section at least: its corners, for it to stand on.
constexpr std::size_t kLeastSectionPoints = 8;
/// Of the largest: eigenvalues of modes that nothing resists.
constexpr double kNoStiffness = 1e-9;

struct Sample {
  Vector3d at;
  double volume = 0, mu = 0, lambda = 0;
  std::uint32_t cluster = formats::kNone;  // of the part
  MatrixXd gradients;                      // k x 3, of the part's functions before they are turned
};

/// Places as floats about the first of them, side by side: distances of all to one.
class Places {
 public:
  explicit Places(std::size_t count) : x_(count), y_(count), z_(count) {}
  void set(std::size_t i, const Vector3d& at) {
    if (i == 0) origin_ = at;
    x_[i] = float(at[0] - origin_[0]);
    y_[i] = float(at[1] - origin_[1]);
    z_[i] = float(at[2] - origin_[2]);
  }
  void squaredDistances(const Vector3d& to, std::vector<float>& out) const {
    const Vector3d from = to - origin_;
    const float px = float(from[0]), py = float(from[1]), pz = float(from[2]);
    const float *const x = x_.data(), *const y = y_.data(), *const z = z_.data();
    float* const d = out.data();
    for (std::size_t i = 0; i < out.size(); ++i) {
      d[i] = (x[i] - px) * (x[i] - px) + (y[i] - py) * (y[i] - py) + (z[i] - pz) * (z[i] - pz);
    }
  }

 private:
  Vector3d origin_ = Vector3d::Zero();
  std::vector<float> x_, y_, z_;
};

/// Blocks of eight rows: element j of block b holds column j of rows 8 b .. 8 b + 7.
void appendBlocks(const MatrixXd& rows, std::vector<formats::Lanes>& to) {
  for (Index block = 0; 8 * block < rows.rows(); ++block) {
    const Index count = std::min<Index>(8, rows.rows() - 8 * block);
    for (Index j = 0; j < rows.cols(); ++j) {
      formats::Lanes lanes = {};
      for (Index lane = 0; lane < count; ++lane) lanes[std::size_t(lane)] = float(rows(8 * block + lane, j));
      to.push_back(lanes);
    }
  }
}

class CutField {
 public:
  CutField(const formats::PackageView& package, const Sides& sides, const PartMesh& mesh, const PartPiece& piece,
           const Nearest& nearest, const std::vector<std::uint32_t>& clusters, const std::vector<std::uint32_t>& label,
           std::uint32_t part, formats::PackageContent& content)
      : package_(package),
        sides_(sides),
        mesh_(mesh),
        piece_(piece),
        nearest_(nearest),
        clusters_(clusters),
        label_(label),
        part_(part),
        content_(content) {
    for (const formats::Field& f : package.fields()) {
      if (f.piece == piece.source && f.held == 0) parent_ = &f;
    }
    k_ = Index(parent_->function_count);
    readVertices();
    findFunctions();
    findSamples();
    turn();
    findPoints();
    append();
    appendFibres();
  }

 private:
  double parentValue(std::uint32_t vertex, Index j) const {
    const std::uint32_t i = vertex - package_.pieces()[piece_.source].first_vertex;
    const std::size_t block = std::size_t(parent_->first_value) + std::size_t(k_) * (i / 8) + std::size_t(j);
    return double(package_.fieldValues()[block][i % 8]);
  }

  void readVertices() {
    const Index n = piece_.count;
    rest_.resize(n, 3);
    mass_.resize(n);
    parent_values_.resize(n, k_);
    local_.assign(package_.physicalVertices().size(), formats::kNone);
    for (Index i = 0; i < n; ++i) {
      const std::size_t at = std::size_t(piece_.first) + std::size_t(i);
      const std::uint32_t v = mesh_.vertices[at];
      local_[v] = std::uint32_t(i);
      rest_.row(i) = asVector(package_.physicalVertices()[v].rest_position).transpose();
      mass_[i] = double(mesh_.masses[at]);
      for (Index j = 0; j < k_; ++j) parent_values_(i, j) = parentValue(v, j);
    }
  }

  /// 1, X, Y, Z, orthonormal under the masses; then what the parent's functions have beyond them.
  void findFunctions() {
    const double all = mass_.sum();
    center_ = rest_.transpose() * mass_ / all;
    MatrixXd monomials(piece_.count, 4);
    monomials.col(0).setOnes();
    monomials.rightCols(3) = rest_.rowwise() - center_.transpose();
    const double spread = std::sqrt((mass_.transpose() * monomials.rightCols(3).cwiseAbs2()).sum() / all);
    size_ = spread > 0 ? spread : 1;
    monomials.rightCols(3) /= size_;
    const Eigen::Matrix4d moment = monomials.transpose() * mass_.asDiagonal() * monomials;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(moment);
    Index rank = 0;
    while (rank < 4 && eigen.eigenvalues()[3 - rank] > kFlat * eigen.eigenvalues()[3]) ++rank;
    affine_ =
        eigen.eigenvectors().rightCols(rank) * eigen.eigenvalues().tail(rank).cwiseSqrt().cwiseInverse().asDiagonal();
    const MatrixXd of_monomials = affine_.transpose() * moment;  // rank x 4: the monomials' coefficients
    const MatrixXd values = monomials * affine_;
    const MatrixXd weighed = mass_.asDiagonal() * parent_values_;
    overlap_ = values.transpose() * weighed;
    MatrixXd gram = parent_values_.transpose() * weighed;
    const double largest = gram.trace() / double(k_);
    gram -= overlap_.transpose() * overlap_;
    const Eigen::SelfAdjointEigenSolver<MatrixXd> others(gram);
    Index kept = 0;
    const Index most = std::max<Index>(0, std::min<Index>(k_, Index(piece_.count)) - rank);
    while (kept < most && others.eigenvalues()[k_ - 1 - kept] > kIndependent * largest) ++kept;
    combine_ =
        others.eigenvectors().rightCols(kept) * others.eigenvalues().tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
    values_.resize(piece_.count, rank + kept);
    values_ << values, (parent_values_ - values * overlap_) * combine_;
    one_ = VectorXd::Zero(rank + kept);
    one_.head(rank) = of_monomials.col(0);
    rest_of_ = MatrixXd::Zero(rank + kept, 3);
    for (Index a = 0; a < 3; ++a) {
      rest_of_.col(a).head(rank) = center_[a] * of_monomials.col(0) + size_ * of_monomials.col(1 + a);
    }
  }

  /// Gradients of the part's functions from those of the parent's, k x 3.
  MatrixXd gradientsFrom(const MatrixXd& of_parent) const {
    const Index rank = affine_.cols();
    const MatrixXd affine = affine_.bottomRows(3).transpose() / size_;  // rank x 3
    MatrixXd result(values_.cols(), 3);
    result.topRows(rank) = affine;
    result.bottomRows(values_.cols() - rank) = combine_.transpose() * (of_parent - overlap_.transpose() * affine);
    return result;
  }

  Vector3d centerOf(const PartTetrahedron& t) const {
    Vector3d x = Vector3d::Zero();
    for (std::size_t c = 0; c < 4; ++c) x += t.center[c] * restOf(package_.tetrahedra()[t.source].vertex[c]);
    return x;
  }
  Vector3d restOf(std::uint32_t v) const { return asVector(package_.physicalVertices()[v].rest_position); }

  /// Vertices of the package that this piece has on the part's side.
  bool isOwn(std::uint32_t v) const { return local_[v] != formats::kNone && label_[v] == part_; }

  /// The parent's samples that lie on the part, then places as far as can be from those before: each stands for the
  /// tetrahedra that are nearest to it, so that volumes and uniform strains are exact.
  void findSamples() {
    std::vector<std::uint32_t> cells;  // tetrahedra of the part that deform
    std::vector<Vector3d> centers;
    for (std::uint32_t i = 0; i < piece_.tetrahedron_count; ++i) {
      const PartTetrahedron& t = mesh_.tetrahedra[piece_.first_tetrahedron + i];
      if (sides_.rider[package_.tetrahedra()[t.source].vertex[0]] != formats::kNone || !(t.volume > 0)) continue;
      cells.push_back(piece_.first_tetrahedron + i);
      centers.push_back(centerOf(t));
    }
    if (cells.empty()) {
      for (std::uint32_t i = 0; i < piece_.tetrahedron_count; ++i) {
        cells.push_back(piece_.first_tetrahedron + i);
        centers.push_back(centerOf(mesh_.tetrahedra[piece_.first_tetrahedron + i]));
      }
    }
    const std::size_t count = cells.size();
    Places places(count);
    for (std::size_t i = 0; i < count; ++i) places.set(i, centers[i]);
    std::vector<float> distance(count, std::numeric_limits<float>::infinity()), fresh(count);
    std::vector<std::uint32_t> nearest(count, 0);
    const auto take = [&](const Vector3d& at, std::uint32_t sample) {
      places.squaredDistances(at, fresh);
      for (std::size_t i = 0; i < count; ++i) nearest[i] = fresh[i] < distance[i] ? sample : nearest[i];
      for (std::size_t i = 0; i < count; ++i) distance[i] = fresh[i] < distance[i] ? fresh[i] : distance[i];
    };
    readParentSamples();
    for (const Parent& parent : parents_) {
      if (!parent.inside) continue;
      Sample& sample = samples_.emplace_back();
      sample.at = parent.at;
      sample.mu = parent.mu;
      sample.lambda = parent.lambda;
      sample.cluster = parent.cluster;
      sample.gradients = gradientsFrom(parent.gradients);
      take(sample.at, std::uint32_t(samples_.size() - 1));
    }
    const std::size_t wanted =
        std::max(samples_.size(), std::min(count, std::size_t(kSamples * double(values_.cols()))));
    if (samples_.size() < wanted) listTetrahedra();
    if (samples_.empty()) {
      // The middle first: all distances are infinite.
      const Vector3d middle =
          std::accumulate(centers.begin(), centers.end(), Vector3d(Vector3d::Zero())) / double(count);
      std::size_t first = 0;
      for (std::size_t i = 0; i < count; ++i) {
        if ((centers[i] - middle).squaredNorm() < (centers[first] - middle).squaredNorm()) first = i;
      }
      addSample(mesh_.tetrahedra[cells[first]], centers[first]);
      take(centers[first], 0);
    }
    while (samples_.size() < wanted) {
      const auto farthest = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
      if (!(distance[farthest] > 0)) break;
      addSample(mesh_.tetrahedra[cells[farthest]], centers[farthest]);
      take(centers[farthest], std::uint32_t(samples_.size() - 1));
    }
    for (std::size_t i = 0; i < count; ++i) samples_[nearest[i]].volume += mesh_.tetrahedra[cells[i]].volume;
    std::erase_if(samples_, [](const Sample& s) { return !(s.volume > 0); });
    if (samples_.empty()) {
      addSample(mesh_.tetrahedra[cells[0]], centers[0]);
      samples_.back().volume = std::max(1e-30, mesh_.tetrahedra[cells[0]].volume);
    }
  }

  /// The parent's samples, and which of them lie on this part.
  struct Parent {
    Vector3d at;
    double mu, lambda;
    std::uint32_t cluster;
    bool inside = false;
    MatrixXd gradients;
  };
  void readParentSamples() {
    for (std::uint32_t p = 0; p < parent_->pack_count; ++p) {
      const formats::FieldPack& pack = package_.fieldPacks()[parent_->first_pack + p];
      for (std::size_t lane = 0; lane < 8; ++lane) {
        if (!(pack.volume[lane] > 0)) continue;
        Parent& parent = parents_.emplace_back();
        for (int a = 0; a < 3; ++a) parent.at[a] = double(pack.at[std::size_t(a)][lane]);
        parent.mu = double(pack.mu[lane]);
        parent.lambda = double(pack.lambda[lane]);
        parent.cluster = pack.cluster[lane] == formats::kNone ? formats::kNone : clusters_[pack.cluster[lane]];
        // It lies where its nearest vertex does.
        if (!isOwn(nearest_.of_sample[8 * std::size_t(p) + lane])) continue;
        parent.gradients.resize(k_, 3);
        for (Index j = 0; j < k_; ++j) {
          for (Index a = 0; a < 3; ++a) {
            const std::size_t element =
                std::size_t(parent_->first_gradient) + 3 * std::size_t(k_) * p + 3 * std::size_t(j) + std::size_t(a);
            parent.gradients(j, a) = double(package_.fieldGradients()[element][lane]);
          }
        }
        parent.inside = true;
      }
    }
  }

  /// By vertex of the piece: tetrahedra of the part that have it.
  void listTetrahedra() {
    first_of_.assign(std::size_t(piece_.count) + 1, 0);
    const auto forEach = [&](const auto& visit) {
      for (std::uint32_t i = 0; i < piece_.tetrahedron_count; ++i) {
        const std::uint32_t t = piece_.first_tetrahedron + i;
        for (const std::uint32_t v : package_.tetrahedra()[mesh_.tetrahedra[t].source].vertex) visit(local_[v], t);
      }
    };
    forEach([&](std::uint32_t v, std::uint32_t) { ++first_of_[v + 1]; });
    std::partial_sum(first_of_.begin(), first_of_.end(), first_of_.begin());
    around_.resize(first_of_.back());
    std::vector<std::uint32_t> next(first_of_.begin(), first_of_.end() - 1);
    forEach([&](std::uint32_t v, std::uint32_t t) { around_[next[v]++] = t; });
  }

  /// The mean strain of the tetrahedra around the longest edge of one (Liu, Nguyen 2010, as the bake's samples).
  void addSample(const PartTetrahedron& tetrahedron, const Vector3d& at) {
    const auto& corners = package_.tetrahedra()[tetrahedron.source].vertex;
    std::uint32_t a = corners[0], b = corners[1];
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = i + 1; j < 4; ++j) {
        if ((restOf(corners[i]) - restOf(corners[j])).squaredNorm() > (restOf(a) - restOf(b)).squaredNorm()) {
          a = corners[i], b = corners[j];
        }
      }
    }
    MatrixXd gradient = MatrixXd::Zero(k_, 3);
    double volume = 0;
    for (std::uint32_t n = first_of_[local_[a]]; n < first_of_[local_[a] + 1]; ++n) {
      const auto& ring = package_.tetrahedra()[mesh_.tetrahedra[around_[n]].source].vertex;
      if (std::find(ring.begin(), ring.end(), b) != ring.end()) volume += addGradient(ring, 1, gradient);
    }
    if (!(volume > 0)) {
      gradient.setZero();
      volume = addGradient(corners, 1, gradient);
    }
    if (!(volume > 0)) return;
    Sample& sample = samples_.emplace_back();
    sample.at = at;
    sample.gradients = gradientsFrom(gradient / volume);
    const Parent* nearest = &parents_[0];
    for (const Parent& parent : parents_) {
      if ((parent.at - at).squaredNorm() < (nearest->at - at).squaredNorm()) nearest = &parent;
    }
    sample.mu = nearest->mu;
    sample.lambda = nearest->lambda;
    sample.cluster = nearest->cluster;
  }

  /// Adds a tetrahedron's gradients of the parent's functions, times its volume. \return that volume, 0 of a flat one.
  double addGradient(const std::array<std::uint32_t, 4>& corners, double factor, MatrixXd& to) const {
    Eigen::Matrix3d edges;
    for (int c = 0; c < 3; ++c) edges.col(c) = restOf(corners[std::size_t(c)]) - restOf(corners[3]);
    const double volume = std::abs(edges.determinant()) / 6, longest = edges.colwise().norm().maxCoeff();
    if (!(volume > 1e-9 * longest * longest * longest)) return 0;
    const Eigen::Matrix3d slopes = factor * volume * edges.inverse();
    const Index last = local_[corners[3]];
    for (int c = 0; c < 3; ++c) {
      to +=
          (parent_values_.row(local_[corners[std::size_t(c)]]) - parent_values_.row(last)).transpose() * slopes.row(c);
    }
    return volume;
  }

  /// Makes the functions diagonalize sum V (2 mu + lambda) grad grad^T; then the modes.
  void turn() {
    const Index k = values_.cols();
    MatrixXd all(k, 3 * Index(samples_.size()));
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      const Sample& sample = samples_[s];
      all.middleCols<3>(3 * Index(s)) = std::sqrt(sample.volume * (2 * sample.mu + sample.lambda)) * sample.gradients;
    }
    MatrixXd energy = MatrixXd::Zero(k, k);
    energy.selfadjointView<Eigen::Lower>().rankUpdate(all);
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(energy);
    const MatrixXd& q = eigen.eigenvectors();
    stiffness_ = eigen.eigenvalues().cwiseMax(0.0);
    values_ = (values_ * q).eval();
    one_ = (q.transpose() * one_).eval();
    rest_of_ = (q.transpose() * rest_of_).eval();
    for (Sample& sample : samples_) sample.gradients = (q.transpose() * sample.gradients).eval();
    turned_ = q;
    findModes();
  }

  void findModes() {
    const Index k = values_.cols(), n = 3 * k;
    // At rest: K_ij = V (mu (g_i . g_j) 1 + mu g_j g_i^T + lambda g_i g_j^T), by axes: sums over samples of products.
    const auto count = Index(samples_.size());
    std::array<MatrixXd, 3> slope, shear, bulk;
    for (int a = 0; a < 3; ++a) {
      for (MatrixXd* m : {&slope[std::size_t(a)], &shear[std::size_t(a)], &bulk[std::size_t(a)]}) m->resize(k, count);
      for (Index s = 0; s < count; ++s) {
        const Sample& sample = samples_[std::size_t(s)];
        slope[std::size_t(a)].col(s) = sample.gradients.col(a);
        shear[std::size_t(a)].col(s) = sample.volume * sample.mu * sample.gradients.col(a);
        bulk[std::size_t(a)].col(s) = sample.volume * sample.lambda * sample.gradients.col(a);
      }
    }
    MatrixXd energy(n, n), dot = MatrixXd::Zero(k, k);
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        // Axis a of function i with axis b of function j.
        const MatrixXd with_mu = shear[a] * slope[b].transpose(), with_lambda = bulk[a] * slope[b].transpose();
        energy(Eigen::seqN(Index(a), k, 3), Eigen::seqN(Index(b), k, 3)) = with_mu.transpose() + with_lambda;
        if (a == b) dot += with_mu;
      }
    }
    for (Index a = 0; a < 3; ++a) energy(Eigen::seqN(a, k, 3), Eigen::seqN(a, k, 3)) += dot;
    for (Index a = 0; a < 3; ++a) {
      for (Index b = 0; b < a; ++b) {
        energy(Eigen::seqN(b, k, 3), Eigen::seqN(a, k, 3)) =
            energy(Eigen::seqN(a, k, 3), Eigen::seqN(b, k, 3)).transpose().eval();
      }
    }
    const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(energy);
    modes_ = eigen.eigenvectors();
    squares_ = eigen.eigenvalues().cwiseMax(0.0);
  }

  /// The parent's points on the part, and places on the section, each as far as can be from those before it.
  void findPoints() {
    const auto points = package_.fieldPoints().subspan(parent_->first_point, parent_->point_count);
    if (points.empty()) return;
    std::vector<VectorXd> rows;
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      const Vector3d at = asVector(points[i].at);
      if (!isOwn(nearest_.of_point[i])) continue;
      VectorXd parent(k_);
      const std::size_t block = std::size_t(parent_->first_point_value) + std::size_t(k_) * (i / 8);
      for (Index j = 0; j < k_; ++j) {
        parent[j] = double(package_.fieldPointValues()[block + std::size_t(j)][i % 8]);
      }
      places_.push_back(points[i].at);
      rows.push_back(valuesAt(at, parent));
    }
    area_ = double(points[0].area);
    std::vector<double> distance(piece_.section.size(), std::numeric_limits<double>::infinity());
    const std::size_t wanted = std::min<std::size_t>(
        piece_.section.size(), std::max(kLeastSectionPoints, std::size_t(std::min(1e3, piece_.section_area / area_))));
    std::size_t next = 0;
    for (std::size_t made = 0; made < wanted; ++made) {
      const SectionPoint& point = piece_.section[next];
      const auto& corners = package_.tetrahedra()[point.hung.tetrahedron].vertex;
      VectorXd parent = VectorXd::Zero(k_);
      double last = 1;
      for (std::size_t c = 0; c < 3; ++c) {
        parent += point.hung.weight[c] * parent_values_.row(local_[corners[c]]).transpose();
        last -= point.hung.weight[c];
      }
      parent += last * parent_values_.row(local_[corners[3]]).transpose();
      places_.push_back({float(point.rest[0]), float(point.rest[1]), float(point.rest[2])});
      rows.push_back(valuesAt(point.rest, parent));
      for (std::size_t i = 0; i < distance.size(); ++i) {
        distance[i] = std::min(distance[i], (piece_.section[i].rest - point.rest).squaredNorm());
      }
      next = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
      if (!(distance[next] > 0)) break;
    }
    point_values_.resize(Index(rows.size()), values_.cols());
    for (std::size_t i = 0; i < rows.size(); ++i) point_values_.row(Index(i)) = rows[i].transpose();
  }

  /// The part's functions at a place where the parent's are known.
  VectorXd valuesAt(const Vector3d& at, const VectorXd& parent) const {
    Eigen::Vector4d monomials;
    monomials << 1, (at - center_) / size_;
    const VectorXd affine = affine_.transpose() * monomials;
    VectorXd all(values_.cols());
    all << affine, combine_.transpose() * (parent - overlap_.transpose() * affine);
    return turned_.transpose() * all;
  }

  double hertz(Index mode) const { return std::sqrt(squares_[mode]) / (2 * std::numbers::pi); }

  void append() {
    const Index k = values_.cols(), n = 3 * k;
    formats::Field field = {};
    field.piece = piece_.piece;
    field.function_count = std::uint32_t(k);
    field.first_function = std::uint32_t(content_.field_functions.size());
    field.first_pack = std::uint32_t(content_.field_packs.size());
    field.pack_count = std::uint32_t((samples_.size() + 7) / 8);
    field.first_gradient = std::uint32_t(content_.field_gradients.size());
    field.first_value = std::uint32_t(content_.field_values.size());
    field.first_point = std::uint32_t(content_.field_points.size());
    field.point_count = std::uint32_t(places_.size());
    field.first_point_value = std::uint32_t(content_.field_point_values.size());
    field.first_mode = std::uint32_t(content_.field_modes.size());
    field.static_error = parent_->static_error;
    field.least_eigenvalue = parent_->least_eigenvalue;
    Index lowest = 0;
    while (lowest < n && !(squares_[lowest] > kNoStiffness * squares_[n - 1])) ++lowest;
    field.lowest_hz = lowest < n ? float(hertz(lowest)) : 0;

    const VectorXd decay = decayOfVertices();
    for (Index j = 0; j < k; ++j) {
      formats::FieldFunction function = {};
      function.stiffness = float(stiffness_[j]);
      // The modes' frequencies, each by what it has of the function.
      double hz = 0;
      for (Index m = 0; m < n; ++m) hz += modes_.col(m).segment<3>(3 * j).squaredNorm() / 3 * hertz(m);
      function.damping_hz = float(hz);
      function.one = float(one_[j]);
      for (int a = 0; a < 3; ++a) function.rest[std::size_t(a)] = float(rest_of_(j, a));
      function.pin_set = formats::kNone;
      function.decay = float(mass_.cwiseProduct(decay).dot(values_.col(j).cwiseAbs2()));
      content_.field_functions.push_back(function);
    }
    for (std::size_t first = 0; first < samples_.size(); first += 8) {
      const std::size_t count = std::min<std::size_t>(8, samples_.size() - first);
      formats::FieldPack pack = {};
      pack.cluster.fill(formats::kNone);
      for (std::size_t lane = 0; lane < count; ++lane) {
        const Sample& sample = samples_[first + lane];
        pack.volume[lane] = float(sample.volume);
        pack.mu[lane] = float(sample.mu);
        pack.lambda[lane] = float(sample.lambda);
        pack.cluster[lane] = sample.cluster;
        for (int a = 0; a < 3; ++a) pack.at[std::size_t(a)][lane] = float(sample.at[a]);
      }
      content_.field_packs.push_back(pack);
      for (Index j = 0; j < k; ++j) {
        for (Index a = 0; a < 3; ++a) {
          formats::Lanes lanes = {};
          for (std::size_t lane = 0; lane < count; ++lane) lanes[lane] = float(samples_[first + lane].gradients(j, a));
          content_.field_gradients.push_back(lanes);
        }
      }
    }
    appendBlocks(values_, content_.field_values);
    for (const formats::Float3& place : places_) content_.field_points.push_back({place, float(area_)});
    if (!places_.empty()) appendBlocks(point_values_, content_.field_point_values);
    for (Index block = 0; 8 * block < n; ++block) {
      for (Index i = -1; i < n; ++i) {
        formats::Lanes lanes = {};
        for (Index lane = 0; lane < 8 && 8 * block + lane < n; ++lane) {
          const Index mode = 8 * block + lane;
          lanes[std::size_t(lane)] = float(i < 0 ? squares_[mode] : modes_(i, mode));
        }
        content_.field_modes.push_back(lanes);
      }
    }
    content_.fields.push_back(field);
  }

  /// Of the clusters' own damping, by vertex, 1/s.
  VectorXd decayOfVertices() const {
    VectorXd decay = VectorXd::Zero(piece_.count);
    if (package_.mechanics().empty()) return decay;
    const formats::PieceRange& range = package_.pieces()[piece_.source];
    for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
      const double damping = double(package_.mechanics()[c].damping);
      if (!(damping > 0)) continue;
      const formats::Cluster& cluster = package_.clusters()[c];
      for (const auto& m : package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
        if (local_[m.vertex] != formats::kNone) decay[local_[m.vertex]] += double(m.share) * damping;
      }
    }
    return decay;
  }

  /// A fibre of each activated cluster that the part has some of: the mean stretch of that, and the parent's tension by
  /// volume.
  void appendFibres() {
    const auto parent_index = std::uint32_t(parent_ - package_.fields().data());
    const formats::PieceRange& range = package_.pieces()[piece_.source];
    for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
      double tension = 0;
      for (const formats::FieldFibre& fibre : package_.fieldFibres()) {
        if (fibre.field == parent_index && fibre.cluster == c) tension += double(fibre.tension);
      }
      if (!(tension > 0) || clusters_[c] == formats::kNone) continue;
      std::vector<double> share(package_.physicalVertices().size(), 0);
      const formats::Cluster& cluster = package_.clusters()[c];
      for (const auto& m : package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
        share[m.vertex] = double(m.share);
      }
      double whole = 0, here = 0;
      for (std::uint32_t t = range.first_tetrahedron; t < range.first_tetrahedron + range.tetrahedron_count; ++t) {
        const auto& corners = package_.tetrahedra()[t].vertex;
        Eigen::Matrix3d edges;
        for (int e = 0; e < 3; ++e) edges.col(e) = restOf(corners[std::size_t(e)]) - restOf(corners[3]);
        double mean = 0;
        for (const std::uint32_t v : corners) mean += share[v] / 4;
        whole += mean * std::abs(edges.determinant()) / 6;
      }
      MatrixXd gradient = MatrixXd::Zero(k_, 3);
      for (std::uint32_t i = 0; i < piece_.tetrahedron_count; ++i) {
        const PartTetrahedron& t = mesh_.tetrahedra[piece_.first_tetrahedron + i];
        const auto& corners = package_.tetrahedra()[t.source].vertex;
        double mean = 0;
        for (std::size_t n = 0; n < 4; ++n) mean += share[corners[n]] * t.center[n];
        if (!(mean > 0) || !(t.volume > 0)) continue;
        MatrixXd one = MatrixXd::Zero(k_, 3);
        const double volume = addGradient(corners, 1, one);
        if (!(volume > 0)) continue;
        gradient += mean * t.volume / volume * one;
        here += mean * t.volume;
      }
      if (!(here > 0)) continue;
      const Vector3d along = asVector(package_.mechanics()[c].fibre);
      const VectorXd values = turned_.transpose() * (gradientsFrom(gradient / here) * along);
      content_.field_fibres.push_back({std::uint32_t(content_.fields.size() - 1), clusters_[c],
                                       std::uint32_t(content_.field_fibre_values.size()),
                                       float(tension * here / whole)});
      for (const double value : values) content_.field_fibre_values.push_back(float(value));
    }
  }

  const formats::PackageView& package_;
  const Sides& sides_;
  const PartMesh& mesh_;
  const PartPiece& piece_;
  const Nearest& nearest_;
  const std::vector<std::uint32_t>& clusters_;
  const std::vector<std::uint32_t>& label_;
  const std::uint32_t part_;
  formats::PackageContent& content_;

  const formats::Field* parent_ = nullptr;
  Index k_ = 0;
  std::vector<std::uint32_t> local_;  // of the package's vertices
  Eigen::MatrixX3d rest_;
  VectorXd mass_;
  MatrixXd parent_values_;
  Vector3d center_ = Vector3d::Zero();
  double size_ = 1;
  MatrixXd affine_;   // 4 x rank: of 1, (X - center) / size
  MatrixXd overlap_;  // rank x k: of the parent's functions with these
  MatrixXd combine_;  // k x others
  MatrixXd turned_;   // of all
  MatrixXd values_, rest_of_;
  VectorXd one_, stiffness_;
  std::vector<Parent> parents_;
  std::vector<Sample> samples_;
  std::vector<std::uint32_t> first_of_, around_;
  MatrixXd modes_;
  VectorXd squares_;
  std::vector<formats::Float3> places_;
  MatrixXd point_values_;
  double area_ = 1;
};

}  // namespace

Nearest findNearest(const formats::PackageView& package, std::uint32_t piece) {
  Nearest result;
  const formats::PieceRange& range = package.pieces()[piece];
  Places places(range.vertex_count);
  for (std::uint32_t i = 0; i < range.vertex_count; ++i) {
    places.set(i, asVector(package.physicalVertices()[range.first_vertex + i].rest_position));
  }
  std::vector<float> distance(range.vertex_count);
  const auto nearestTo = [&](const Vector3d& at) {
    places.squaredDistances(at, distance);
    return range.first_vertex + std::uint32_t(std::min_element(distance.begin(), distance.end()) - distance.begin());
  };
  for (const formats::Field& field : package.fields()) {
    if (field.piece != piece || field.held != 0) continue;
    for (const formats::FieldPack& pack : package.fieldPacks().subspan(field.first_pack, field.pack_count)) {
      for (std::size_t lane = 0; lane < 8; ++lane) {
        const Vector3d at(double(pack.at[0][lane]), double(pack.at[1][lane]), double(pack.at[2][lane]));
        result.of_sample.push_back(pack.volume[lane] > 0 ? nearestTo(at) : range.first_vertex);
      }
    }
    for (const formats::FieldPoint& point : package.fieldPoints().subspan(field.first_point, field.point_count)) {
      result.of_point.push_back(nearestTo(asVector(point.at)));
    }
  }
  return result;
}

void addCutField(const formats::PackageView& package, const Sides& sides, const PartMesh& mesh, const PartPiece& piece,
                 const Nearest& nearest, const std::vector<std::uint32_t>& clusters,
                 const std::vector<std::uint32_t>& label, std::uint32_t part, formats::PackageContent& content) {
  CutField(package, sides, mesh, piece, nearest, clusters, label, part, content);
}

void addWholeFields(const formats::PackageView& package, const PartPiece& piece,
                    const std::vector<std::uint32_t>& clusters, const std::vector<std::uint32_t>& pin_sets,
                    formats::PackageContent& content) {
  const auto append = [](auto& to, const auto& from, std::size_t first, std::size_t count) {
    to.insert(to.end(), from.begin() + std::ptrdiff_t(first), from.begin() + std::ptrdiff_t(first + count));
  };
  for (std::uint32_t f = 0; f < package.fields().size(); ++f) {
    formats::Field field = package.fields()[f];
    if (field.piece != piece.source) continue;
    const std::size_t k = field.function_count, unknowns = 3 * (k - field.driven_count);
    const formats::Field from = field;
    field.piece = piece.piece;
    field.first_function = std::uint32_t(content.field_functions.size());
    field.first_pack = std::uint32_t(content.field_packs.size());
    field.first_gradient = std::uint32_t(content.field_gradients.size());
    field.first_value = std::uint32_t(content.field_values.size());
    field.first_point = std::uint32_t(content.field_points.size());
    field.first_point_value = std::uint32_t(content.field_point_values.size());
    field.first_mode = std::uint32_t(content.field_modes.size());
    append(content.field_functions, package.fieldFunctions(), from.first_function, k);
    for (std::size_t j = 0; j < k; ++j) {
      formats::FieldFunction& function = content.field_functions[field.first_function + j];
      if (function.pin_set != formats::kNone) function.pin_set = pin_sets[function.pin_set];
    }
    append(content.field_packs, package.fieldPacks(), from.first_pack, from.pack_count);
    for (std::size_t p = 0; p < from.pack_count; ++p) {
      for (std::uint32_t& c : content.field_packs[field.first_pack + p].cluster) {
        if (c != formats::kNone) c = clusters[c];
      }
    }
    append(content.field_gradients, package.fieldGradients(), from.first_gradient, 3 * k * from.pack_count);
    append(content.field_values, package.fieldValues(), from.first_value, k * ((std::size_t(piece.count) + 7) / 8));
    append(content.field_points, package.fieldPoints(), from.first_point, from.point_count);
    append(content.field_point_values, package.fieldPointValues(), from.first_point_value,
           k * ((std::size_t(from.point_count) + 7) / 8));
    append(content.field_modes, package.fieldModes(), from.first_mode, (unknowns + 1) * ((unknowns + 7) / 8));
    const auto index = std::uint32_t(content.fields.size());
    for (const formats::FieldFibre& fibre : package.fieldFibres()) {
      if (fibre.field != f) continue;
      content.field_fibres.push_back(
          {index, clusters[fibre.cluster], std::uint32_t(content.field_fibre_values.size()), fibre.tension});
      append(content.field_fibre_values, package.fieldFibreValues(), fibre.first_value, k);
    }
    for (const formats::FieldTethers& tethers : package.fieldTethers()) {
      if (tethers.field != f) continue;
      content.field_tethers.push_back({index, std::uint32_t(content.field_tether_values.size())});
      append(content.field_tether_values, package.fieldTetherValues(), tethers.first_value, k * k);
    }
    content.fields.push_back(field);
  }
}

}  // namespace sinew::cutting
