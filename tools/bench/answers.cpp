// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/answers.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

namespace sinew::tools {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using formats::Field;
using formats::kNone;
using formats::PackageView;

constexpr std::uint32_t kPlaces = 16;
// Of a place's load, of the diagonal: it falls as a Gaussian of this width.
constexpr double kWidth = 0.1;
// Modes below this part of a free piece's lowest frequency are rigid.
constexpr double kRigid = 0.5;

Vector3d wide(const formats::Float3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// The field that a package moves a piece by where its pins hold it, else the free one; null: none.
const Field* fieldOf(const PackageView& package, std::uint32_t piece) {
  const Field* best = nullptr;
  for (const Field& field : package.fields()) {
    if (field.piece == piece && (best == nullptr || field.held != 0)) best = &field;
  }
  return best;
}

std::vector<std::uint32_t> pieceOfTetrahedra(const PackageView& package) {
  std::vector<std::uint32_t> result(package.tetrahedra().size());
  for (std::uint32_t p = 0; p < package.pieces().size(); ++p) {
    const formats::PieceRange& range = package.pieces()[p];
    for (std::uint32_t t = 0; t < range.tetrahedron_count; ++t) result[range.first_tetrahedron + t] = p;
  }
  return result;
}

// The functions of a piece that move freely, at the visual vertices that hang on it.
struct PieceSpace {
  std::vector<std::uint32_t> visual;
  MatrixXd functions;    // visual x k
  VectorXd weight;       // k: what a unit acceleration along an axis does to them
  MatrixXd modes;        // 3k x m, elastic ones
  VectorXd compliance;   // m
  MatrixXd fibre_loads;  // 3k x channels

  // Their coefficients under loads, 3k x c.
  MatrixXd under(const MatrixXd& loads) const {
    return modes * (compliance.asDiagonal() * (modes.transpose() * loads));
  }
};

PieceSpace spaceOf(const PackageView& package, const Field& field, const std::vector<std::uint32_t>& piece_of) {
  PieceSpace space;
  const Index k = field.function_count, driven = field.driven_count, free = k - driven;
  const std::uint32_t first_vertex = package.pieces()[field.piece].first_vertex;
  for (std::uint32_t v = 0; v < package.barycentric().size(); ++v) {
    if (piece_of[package.barycentric()[v].tetrahedron] == field.piece) space.visual.push_back(v);
  }
  space.functions = MatrixXd::Zero(Index(space.visual.size()), free);
  for (Index i = 0; i < Index(space.visual.size()); ++i) {
    const formats::BarycentricAttachment& a = package.barycentric()[space.visual[std::size_t(i)]];
    double last = 1;
    for (std::size_t c = 0; c < 4; ++c) {
      const double weight = c < 3 ? double(a.weight[c]) : last;
      last -= weight;
      const std::uint32_t v = package.tetrahedra()[a.tetrahedron].vertex[c] - first_vertex;
      const formats::Lanes* values =
          package.fieldValues().data() + field.first_value + std::size_t(v / 8) * std::size_t(k);
      for (Index j = 0; j < free; ++j) space.functions(i, j) += weight * double(values[driven + j][v % 8]);
    }
  }
  space.weight.resize(free);
  for (Index j = 0; j < free; ++j) {
    space.weight[j] = double(package.fieldFunctions()[field.first_function + std::size_t(driven + j)].one);
  }
  const formats::Lanes* modes = package.fieldModes().data() + field.first_mode;
  const double rigid = field.held != 0 ? 0 : std::pow(kRigid * 2 * std::numbers::pi * double(field.lowest_hz), 2);
  std::vector<std::pair<Index, double>> elastic;
  for (Index m = 0; m < 3 * free; ++m) {
    const double lambda = double(modes[(m / 8) * (3 * free + 1)][std::size_t(m % 8)]);
    if (lambda > rigid) elastic.emplace_back(m, 1 / lambda);
  }
  space.modes.resize(3 * free, Index(elastic.size()));
  space.compliance.resize(Index(elastic.size()));
  for (Index e = 0; e < Index(elastic.size()); ++e) {
    const auto [m, compliance] = elastic[std::size_t(e)];
    space.compliance[e] = compliance;
    for (Index c = 0; c < 3 * free; ++c) {
      space.modes(c, e) = double(modes[(m / 8) * (3 * free + 1) + 1 + c][std::size_t(m % 8)]);
    }
  }
  space.fibre_loads = MatrixXd::Zero(3 * free, Index(package.channels().size()));
  const auto index = std::uint32_t(&field - package.fields().data());
  for (const formats::FieldFibre& fibre : package.fieldFibres()) {
    if (fibre.field != index) continue;
    const float* slope = package.fieldFibreValues().data() + fibre.first_value;
    Vector3d along = Vector3d::Zero();  // at rest
    for (Index j = 0; j < k; ++j) {
      along += double(slope[j]) * wide(package.fieldFunctions()[field.first_function + std::size_t(j)].rest);
    }
    const std::uint32_t channel = package.mechanics()[fibre.cluster].channel;
    if (channel == kNone || !(along.norm() > 0)) continue;
    for (Index j = 0; j < free; ++j) {
      space.fibre_loads.col(channel).segment<3>(3 * j) -=
          double(fibre.tension) * double(slope[driven + j]) * along.normalized();
    }
  }
  return space;
}

double rootMeanSquare(const VectorXd& values) {
  return values.size() == 0 ? 0 : std::sqrt(values.squaredNorm() / double(values.size()));
}

}  // namespace

Answers::Answers(const PackageView& package) {
  const std::uint32_t count = std::uint32_t(package.visualPositions().size());
  for (const formats::Float3& x : package.visualPositions()) surface_.push_back(wide(x));
  areas_.assign(count, 0);
  for (const formats::Triangle& t : package.visualTriangles()) {
    const double area = 0.5 * (surface_[t[1]] - surface_[t[0]]).cross(surface_[t[2]] - surface_[t[0]]).norm();
    for (const std::uint32_t v : t) areas_[v] += area / 3;
  }
  const std::vector<std::uint32_t> piece_of = pieceOfTetrahedra(package);
  std::vector<std::uint32_t> piece_at(count);
  for (std::uint32_t v = 0; v < count; ++v) piece_at[v] = piece_of[package.barycentric()[v].tetrahedron];
  for (std::uint32_t p = 0; p < package.pieces().size(); ++p) {
    const Field* field = fieldOf(package, p);
    if (field == nullptr) continue;
    if (field->held != 0) {
      held_ = true;
      continue;
    }
    free_.emplace_back();
    for (std::uint32_t v = 0; v < count; ++v) {
      if (piece_at[v] == p) free_.back().push_back(v);
    }
  }
  channels_ = std::uint32_t(package.channels().size());
  // Places, each as far from all others as can be.
  std::vector<double> far(count, std::numeric_limits<double>::infinity());
  const double width = kWidth * double(package.info().diagonal);
  for (std::uint32_t next = 0; places_.size() < std::min(kPlaces, count);) {
    for (std::uint32_t v = 0; v < count; ++v) far[v] = std::min(far[v], (surface_[v] - surface_[next]).norm());
    Place& place = places_.emplace_back(Place{piece_at[next], {}});
    for (std::uint32_t v = 0; v < count; ++v) {
      const double off = (surface_[v] - surface_[next]).norm() / width;
      if (piece_at[v] == place.piece && off < 3) place.vertices.emplace_back(v, areas_[v] * std::exp(-off * off));
    }
    next = std::uint32_t(std::max_element(far.begin(), far.end()) - far.begin());
  }
  answers_ = answersOf(package);
}

MatrixXd Answers::answersOf(const PackageView& package) const {
  const Index places = 3 * Index(places_.size()), weights = held_ ? 3 : 0;
  const Index loads = places + weights + Index(channels_);
  MatrixXd result = MatrixXd::Zero(3 * Index(surface_.size()), loads);
  const std::vector<std::uint32_t> piece_of = pieceOfTetrahedra(package);
  std::vector<Index> row(surface_.size());
  for (std::uint32_t p = 0; p < package.pieces().size(); ++p) {
    const Field* field = fieldOf(package, p);
    if (field == nullptr) continue;
    const PieceSpace space = spaceOf(package, *field, piece_of);
    const Index free = space.functions.cols();
    MatrixXd met = MatrixXd::Zero(3 * free, loads);
    std::fill(row.begin(), row.end(), Index(-1));
    for (Index i = 0; i < Index(space.visual.size()); ++i) row[space.visual[std::size_t(i)]] = i;
    for (Index l = 0; l < places; ++l) {
      for (const auto& [v, part] : places_[std::size_t(l / 3)].vertices) {
        if (row[v] < 0) continue;
        for (Index j = 0; j < free; ++j) met(3 * j + l % 3, l) += part * space.functions(row[v], j);
      }
    }
    for (Index l = 0; l < weights; ++l) {
      for (Index j = 0; j < free; ++j) met(3 * j + l, places + l) = space.weight[j];
    }
    met.rightCols(Index(channels_)) = space.fibre_loads;
    const MatrixXd moved = space.under(met);
    for (Index l = 0; l < loads; ++l) {
      const MatrixXd on = space.functions * Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>>(
                                                moved.col(l).data(), free, 3);
      for (Index i = 0; i < on.rows(); ++i) {
        result.col(l).segment<3>(3 * Index(space.visual[std::size_t(i)])) = on.row(i).transpose();
      }
    }
  }
  takeRigidAway(result);
  return result;
}

// Of what nothing holds, the small rigid motion that leaves the least, by area.
void Answers::takeRigidAway(MatrixXd& answers) const {
  for (const std::vector<std::uint32_t>& piece : free_) {
    const Index n = Index(piece.size());
    Eigen::Matrix<double, Eigen::Dynamic, 6> rigid(3 * n, 6);
    VectorXd area(3 * n);
    MatrixXd moved(3 * n, answers.cols());
    Vector3d centre = Vector3d::Zero();
    for (const std::uint32_t v : piece) centre += surface_[v] / double(n);
    for (Index i = 0; i < n; ++i) {
      const std::uint32_t v = piece[std::size_t(i)];
      const Vector3d arm = surface_[v] - centre;
      rigid.middleRows<3>(3 * i).leftCols<3>().setIdentity();
      for (Index a = 0; a < 3; ++a) rigid.col(3 + a).segment<3>(3 * i) = Vector3d::Unit(a).cross(arm);
      area.segment<3>(3 * i).setConstant(areas_[v]);
      moved.middleRows(3 * i, 3) = answers.middleRows(3 * Index(v), 3);
    }
    const Eigen::Matrix<double, 6, Eigen::Dynamic> weighed = rigid.transpose() * area.asDiagonal();
    const Eigen::Matrix<double, 6, 6> gram = weighed * rigid;
    moved -= rigid * gram.ldlt().solve(weighed * moved);
    for (Index i = 0; i < n; ++i) answers.middleRows(3 * Index(piece[std::size_t(i)]), 3) = moved.middleRows(3 * i, 3);
  }
}

double Answers::errorOf(const PackageView& other) const {
  if (other.barycentric().size() != surface_.size() || other.channels().size() != channels_) {
    return std::numeric_limits<double>::infinity();
  }
  const MatrixXd off = answersOf(other) - answers_;
  VectorXd area(3 * Index(surface_.size()));
  for (Index v = 0; v < Index(surface_.size()); ++v) area.segment<3>(3 * v).setConstant(areas_[std::size_t(v)]);
  const VectorXd size2 = (area.asDiagonal() * answers_.cwiseAbs2()).colwise().sum();
  const VectorXd off2 = (area.asDiagonal() * off.cwiseAbs2()).colwise().sum();
  const VectorXd error = (size2.array() > 0).select(off2.array() / size2.array(), 0.0).sqrt();
  const Index places = 3 * Index(places_.size()), weights = held_ ? 3 : 0;
  double most = std::max(rootMeanSquare(error.head(places)), rootMeanSquare(error.tail(Index(channels_))));
  if (weights > 0) most = std::max(most, error.segment(places, weights).maxCoeff());
  return most;
}

}  // namespace sinew::tools
