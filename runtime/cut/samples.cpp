// SPDX-License-Identifier: MIT
#include "runtime/cut/samples.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "runtime/cut/places.h"
#include "runtime/geometry/symmetric_eigen.h"
#include "runtime/geometry/tet_mesh.h"

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Samples by function.
constexpr std::size_t kSamples = 4;

class Finder {
 public:
  Finder(const FieldInput& input, const ParentField& parent, const Nearest& nearest, const PartFunctions& functions,
         const Slopes& slopes, const Around& around, const Jumps& jumps)
      : input_(input),
        package_(input.package),
        parent_(parent),
        nearest_(nearest),
        functions_(functions),
        slopes_(slopes),
        around_(around),
        jumps_(jumps) {
    listCells();
    wanted_ = std::min(cells_.size(), kSamples * std::size_t(functions_.count()));
    of_parent_.resize(parent_.count(), 3 * Index(std::max(wanted_, 8 * std::size_t(parent_.field().pack_count)) + 1));
    const bool each = cells_.size() == wanted_ && jumps_.psi.size() == 0;
    listParents(!each);
    if (each) {
      takeCells();
    } else {
      Places places(centers_.size(), jumps_.psi.size() > 0);
      for (std::size_t i = 0; i < centers_.size(); ++i) places.set(i, centers_[i], depthOf(cells_[i]));
      takeParents(places);
      fill(places);
    }
    weigh();
  }

  Samples take() {
    MatrixXd gradients = functions_.gradientsFrom(of_parent_.leftCols(3 * Index(samples_.size())));
    return {std::move(samples_), std::move(gradients)};
  }

 private:
  /// A sample of the parent's, of whichever part.
  struct Material {
    Vector3d at;
    double mu = 0, lambda = 0;
    std::uint32_t cluster = formats::kNone;
  };

  const PartTetrahedron& tetrahedron(std::uint32_t i) const { return input_.mesh.tetrahedra[i]; }
  const std::array<std::uint32_t, 4>& cornersOf(std::uint32_t i) const {
    return package_.tetrahedra()[tetrahedron(i).source].vertex;
  }
  Vector3d restOf(std::uint32_t v) const { return asVector(package_.physicalVertices()[v].rest_position); }

  /// Tetrahedra that deform: an accessory's does not.
  void listCells() {
    const std::uint32_t first = input_.piece.first_tetrahedron, end = first + input_.piece.tetrahedron_count;
    for (const bool any : {false, true}) {
      for (std::uint32_t i = first; i < end; ++i) {
        const bool rides = input_.sides.rider[cornersOf(i)[0]] != formats::kNone;
        if (any || (!rides && tetrahedron(i).volume > 0)) cells_.push_back(i);
      }
      if (!cells_.empty()) break;
    }
    for (const std::uint32_t i : cells_) {
      Vector3d x = Vector3d::Zero();
      for (std::size_t c = 0; c < 4; ++c) x += tetrahedron(i).center[c] * restOf(cornersOf(i)[c]);
      centers_.push_back(x);
    }
    distance_.setConstant(Index(cells_.size()), std::numeric_limits<float>::infinity());
    fresh_.resize(Index(cells_.size()));
    of_cell_.assign(cells_.size(), 0);
  }

  /// \param as_samples those that lie in the part are.
  void listParents(bool as_samples) {
    const formats::Field& field = parent_.field();
    for (std::uint32_t p = 0; p < field.pack_count; ++p) {
      const formats::FieldPack& pack = package_.fieldPacks()[field.first_pack + p];
      for (std::size_t lane = 0; lane < 8; ++lane) {
        if (!(pack.volume[lane] > 0)) continue;
        Material& m = materials_.emplace_back();
        for (int a = 0; a < 3; ++a) m.at[a] = double(pack.at[std::size_t(a)][lane]);
        m.mu = double(pack.mu[lane]);
        m.lambda = double(pack.lambda[lane]);
        m.cluster = pack.cluster[lane] == formats::kNone ? formats::kNone : input_.clusters[pack.cluster[lane]];
        // A sample lies where its nearest vertex does.
        if (!as_samples || !input_.isOwn(nearest_.of_sample[8 * std::size_t(p) + lane])) continue;
        MatrixXd gradients = parent_.gradientsAt(p, lane);
        double depth = 0;
        if (jumps_.psi.size() > 0) {
          const std::uint32_t cell = around_.at(nearest_.of_sample[8 * std::size_t(p) + lane], m.at);
          if (cell == formats::kNone) continue;
          double volume = 0;
          const auto added = parent_.count() - parent_.own();
          gradients.bottomRows(added) = slopes_.meanAt(tetrahedron(cell), around_, volume).bottomRows(added);
          depth = depthOf(cell);
        }
        addSample(m, gradients, depth);
      }
    }
  }

  /// \param gradients the parent's.
  void addSample(const Material& m, const MatrixXd& gradients, double depth) {
    of_parent_.middleCols<3>(3 * Index(samples_.size())) = gradients;
    samples_.push_back({m.at, 0, m.mu, m.lambda, m.cluster});
    depths_.push_back(depth);
  }

  /// How far a tetrahedron lies from the slit's other side, m.
  double depthOf(std::uint32_t cell) const { return jumps_.psi.size() > 0 ? jumps_.size * jumps_.at(input_, cell) : 0; }

  /// Few tetrahedra are each a sample: a function that moves one of them alone has its energy.
  void takeCells() {
    for (std::uint32_t cell = 0; cell < cells_.size(); ++cell) {
      MatrixXd gradient = MatrixXd::Zero(parent_.count(), 3);
      const double volume = slopes_.add(tetrahedron(cells_[cell]), gradient);
      if (!(volume > 0)) continue;
      of_cell_[cell] = std::uint32_t(samples_.size());
      addSample(materialAt(cell), gradient / volume, 0);
    }
  }

  /// The nearest one's.
  Material materialAt(std::size_t cell) const {
    Material m = *std::min_element(materials_.begin(), materials_.end(), [&](const Material& one, const Material& two) {
      return (one.at - centers_[cell]).squaredNorm() < (two.at - centers_[cell]).squaredNorm();
    });
    m.at = centers_[cell];
    return m;
  }

  /// Tetrahedra go to a sample where it is nearer than those before.
  void assign(const Places& places, std::uint32_t sample) {
    places.squaredDistances(samples_[sample].at, depths_[sample], fresh_);
    std::uint32_t* const of = of_cell_.data();
    const float *const fresh = fresh_.data(), *const before = distance_.data();
    for (std::size_t i = 0; i < cells_.size(); ++i) of[i] = fresh[i] < before[i] ? sample : of[i];
    distance_ = distance_.min(fresh_);
  }

  void takeParents(const Places& places) {
    for (std::uint32_t s = 0; s < samples_.size(); ++s) assign(places, s);
  }

  void fill(const Places& places) {
    if (samples_.size() >= wanted_) return;
    listSteepness();
    if (samples_.empty()) {
      // The middle first: all distances are infinite.
      const Vector3d middle =
          std::accumulate(centers_.begin(), centers_.end(), Vector3d(Vector3d::Zero())) / double(centers_.size());
      places.squaredDistances(middle, 0, fresh_);
      addMean(firstLargest(-fresh_), places);
    }
    while (samples_.size() < wanted_) {
      const std::size_t farthest =
          steepness_.size() == 0 ? firstLargest(distance_) : firstLargest(distance_ * steepness_);
      if (!(distance_[Index(farthest)] > 0)) break;
      addMean(farthest, places);
    }
  }

  /// Of psi, squared, of that over the slit's size, and 1.
  void listSteepness() {
    if (jumps_.psi.size() == 0) return;
    steepness_.resize(Index(cells_.size()));
    for (Index i = 0; i < steepness_.size(); ++i) {
      const std::uint32_t cell = cells_[std::size_t(i)];
      const PartTetrahedron& t = tetrahedron(cell);
      Eigen::Matrix3d edges;
      Vector3d rise;
      for (int k = 0; k < 3; ++k) {
        edges.row(k) = (restOf(cornersOf(cell)[std::size_t(k)]) - restOf(cornersOf(cell)[3])).transpose();
        rise[k] =
            jumps_.psi[t.corner[std::size_t(k)] - input_.piece.first] - jumps_.psi[t.corner[3] - input_.piece.first];
      }
      const double slope = jumps_.size * (edges.inverse() * rise).norm();
      steepness_[i] = std::isfinite(slope) ? float(1 + slope * slope) : 1.0F;
    }
  }

  void addMean(std::size_t cell, const Places& places) {
    double volume = 0;
    const MatrixXd gradient = slopes_.meanAt(tetrahedron(cells_[cell]), around_, volume);
    distance_[Index(cell)] = 0;  // it is not asked again
    if (!(volume > 0)) return;
    of_cell_[cell] = std::uint32_t(samples_.size());
    addSample(materialAt(cell), gradient, depthOf(cells_[cell]));
    assign(places, std::uint32_t(samples_.size() - 1));
  }

  void weigh() {
    if (samples_.empty()) {
      // Nothing but flat tetrahedra: what moves affinely.
      Material m = materials_[0];
      m.at = centers_[0];
      addSample(m, MatrixXd::Zero(parent_.count(), 3), 0);
    }
    double all = 0;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      samples_[of_cell_[i]].volume += tetrahedron(cells_[i]).volume;
      all += tetrahedron(cells_[i]).volume;
    }
    if (!(all > 0)) samples_[0].volume = std::numeric_limits<float>::min();
    std::size_t kept = 0;
    for (std::size_t s = 0; s < samples_.size(); ++s) {
      if (!(float(samples_[s].volume) > 0)) continue;
      of_parent_.middleCols<3>(3 * Index(kept)) = of_parent_.middleCols<3>(3 * Index(s)).eval();
      samples_[kept++] = samples_[s];
    }
    samples_.resize(kept);
  }

  const FieldInput& input_;
  const formats::PackageView& package_;
  const ParentField& parent_;
  const Nearest& nearest_;
  const PartFunctions& functions_;
  const Slopes& slopes_;
  const Around& around_;
  const Jumps& jumps_;
  std::vector<std::uint32_t> cells_;  // of the part's tetrahedra
  std::vector<Vector3d> centers_;
  Eigen::ArrayXf distance_, fresh_;     // of the cells, squared: to their samples; scratch
  std::vector<std::uint32_t> of_cell_;  // samples
  std::vector<Material> materials_;
  std::size_t wanted_ = 0;  // samples
  std::vector<Sample> samples_;
  MatrixXd of_parent_;          // gradients of the parent's functions there
  std::vector<double> depths_;  // of samples: as of cells, m
  Eigen::ArrayXf steepness_;    // of cells; none: 1
};

}  // namespace

double Slopes::add(const PartTetrahedron& tetrahedron, MatrixXd& to) const {
  const auto& corners = input_.package.tetrahedra()[tetrahedron.source].vertex;
  Eigen::Matrix3d edges;
  const auto restOf = [&](std::uint32_t v) { return asVector(input_.package.physicalVertices()[v].rest_position); };
  for (int c = 0; c < 3; ++c) edges.col(c) = restOf(corners[std::size_t(c)]) - restOf(corners[3]);
  const double volume = std::abs(edges.determinant()) / 6, longest = edges.colwise().norm().maxCoeff();
  if (!(volume > geometry::kFlat * longest * longest * longest)) return 0;
  const Eigen::Matrix3d slopes = volume * edges.inverse();
  const auto row = [&](std::size_t k) { return values_.row(Index(tetrahedron.corner[k] - input_.piece.first)); };
  for (int c = 0; c < 3; ++c) to += (row(std::size_t(c)) - row(3)).transpose() * slopes.row(c);
  return volume;
}

MatrixXd Slopes::meanAt(const PartTetrahedron& tetrahedron, const Around& around, double& volume) const {
  const auto restOf = [&](std::size_t k) {
    const std::uint32_t v = input_.package.tetrahedra()[tetrahedron.source].vertex[k];
    return asVector(input_.package.physicalVertices()[v].rest_position);
  };
  std::size_t a = 0, b = 1;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) {
      if ((restOf(i) - restOf(j)).squaredNorm() > (restOf(a) - restOf(b)).squaredNorm()) a = i, b = j;
    }
  }
  MatrixXd gradient = MatrixXd::Zero(values_.cols(), 3);
  volume = 0;
  for (const std::uint32_t t : around.of(tetrahedron.corner[a] - input_.piece.first)) {
    const PartTetrahedron& ring = input_.mesh.tetrahedra[t];
    if (std::find(ring.corner.begin(), ring.corner.end(), tetrahedron.corner[b]) != ring.corner.end()) {
      volume += add(ring, gradient);
    }
  }
  if (volume > 0) gradient /= volume;
  return gradient;
}

Samples findSamples(const FieldInput& input, const ParentField& parent, const Nearest& nearest,
                    const PartFunctions& functions, const Slopes& slopes, const Around& around, const Jumps& jumps) {
  return Finder(input, parent, nearest, functions, slopes, around, jumps).take();
}

MatrixXd stiffnessOf(const Samples& samples) {
  const Index k = samples.gradients.rows();
  MatrixXd all = samples.gradients;
  for (std::size_t s = 0; s < samples.list.size(); ++s) {
    const Sample& sample = samples.list[s];
    all.middleCols<3>(3 * Index(s)) *= std::sqrt(sample.volume * (2 * sample.mu + sample.lambda));
  }
  MatrixXd energy = MatrixXd::Zero(k, k);
  energy.selfadjointView<Eigen::Lower>().rankUpdate(all);
  return energy.selfadjointView<Eigen::Lower>();
}

Modes findModes(const Samples& samples, const MatrixXd& tethers, Index first) {
  // K_ij = V (mu (g_i . g_j) 1 + mu g_j g_i^T + lambda g_i g_j^T), by axes: sums over samples of products.
  const Index n = samples.gradients.rows() - first, count = Index(samples.list.size());
  VectorXd mu(count), lambda(count);
  for (Index s = 0; s < count; ++s) {
    const Sample& sample = samples.list[std::size_t(s)];
    mu[s] = sample.volume * sample.mu;
    lambda[s] = sample.volume * sample.lambda;
  }
  std::array<MatrixXd, 3> slope, shear, bulk;
  for (std::size_t a = 0; a < 3; ++a) {
    slope[a] = samples.gradients(Eigen::seqN(first, n), Eigen::seqN(Index(a), count, 3));
    shear[a] = slope[a] * mu.asDiagonal();
    bulk[a] = slope[a] * lambda.asDiagonal();
  }
  MatrixXd energy(3 * n, 3 * n), dot = MatrixXd::Zero(n, n);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      // Axis a of function i with axis b of function j.
      const MatrixXd with_mu = shear[a] * slope[b].transpose(), with_lambda = bulk[a] * slope[b].transpose();
      energy(Eigen::seqN(Index(a), n, 3), Eigen::seqN(Index(b), n, 3)) = with_mu.transpose() + with_lambda;
      if (a == b) dot += with_mu;
    }
  }
  if (tethers.size() > 0) dot += tethers.bottomRightCorner(n, n);
  for (Index a = 0; a < 3; ++a) {
    energy(Eigen::seqN(a, n, 3), Eigen::seqN(a, n, 3)) += dot;
    for (Index b = 0; b < a; ++b) {
      energy(Eigen::seqN(b, n, 3), Eigen::seqN(a, n, 3)) =
          energy(Eigen::seqN(a, n, 3), Eigen::seqN(b, n, 3)).transpose().eval();
    }
  }
  const geometry::SymmetricEigen eigen = geometry::symmetricEigen(energy);
  return {eigen.vectors, eigen.values.cwiseMax(0.0)};
}

}  // namespace sinew::cutting
