// SPDX-License-Identifier: MIT
#include "runtime/cut/fields.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "runtime/cut/functions.h"
#include "runtime/cut/jumps.h"
#include "runtime/cut/places.h"
#include "runtime/cut/samples.h"
#include "runtime/cut/tethers.h"
#include "runtime/geometry/cells.h"
#include "runtime/geometry/symmetric_eigen.h"

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Contact points on a section at least, for it to stand on, and at most.
constexpr std::size_t kLeastSectionPoints = 8;
constexpr double kMostSectionPoints = 1e3;
/// Of the largest: eigenvalues of modes that nothing resists.
constexpr double kNoStiffness = 1e-9;
/// Of the stiffness of the least affine shape: functions of less are none. A neck of a tenth of a body's width has
/// 1e-2.
constexpr double kSlack = 1e-3;
/// Functions of a part at most, or as many as its parent has: each slit adds some.
constexpr Eigen::Index kMostFunctions = 96;

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
  /// \param pin_sets of the package to those of the part that drive functions here.
  CutField(const FieldInput& input, std::uint32_t field, const std::vector<std::uint32_t>& pin_sets,
           formats::PackageContent& content)
      : input_(input),
        package_(input.package),
        index_(field),
        parent_(input.package, input.package.fields()[field]),
        nearest_(input.nearest[field]),
        content_(content),
        around_(input),
        slopes_(input, parent_values_) {
    readVertices();
    addJumps();
    functions_ = restrictFunctions(parent_, parent_values_, rest_, mass_, pin_sets);
  }

  /// \return false where the part cannot have the field.
  bool append() {
    if (functions_.free() == 0) return false;
    std::optional<MatrixXd> tethers = partTethers(input_, index_, parent_, functions_, parent_values_, local_);
    if (!tethers) return false;
    samples_ = findSamples(input_, parent_, nearest_, functions_, slopes_, around_, jumps_);
    turn(*tethers);
    values_ = functions_.valuesFrom(rest_, parent_values_);
    findPoints();
    formats::Field field = header();
    appendFunctions(field);
    appendSamples();
    appendBlocks(values_, content_.field_values);
    for (const formats::Float3& place : places_) content_.field_points.push_back({place, float(area_)});
    if (!places_.empty()) appendBlocks(point_values_, content_.field_point_values);
    appendModes();
    content_.fields.push_back(field);
    appendFibres();
    appendTethers(*tethers);
    return true;
  }

 private:
  void readVertices() {
    const PartPiece& piece = input_.piece;
    rest_.resize(piece.count, 3);
    mass_.resize(piece.count);
    parent_values_.resize(piece.count, parent_.count());
    local_.assign(package_.physicalVertices().size(), formats::kNone);
    for (Index i = 0; i < Index(piece.count); ++i) {
      const std::size_t at = std::size_t(piece.first) + std::size_t(i);
      const std::uint32_t v = input_.mesh.vertices[at];
      if (local_[v] == formats::kNone || input_.mesh.own[at] != 0) local_[v] = std::uint32_t(i);
      rest_.row(i) = asVector(package_.physicalVertices()[v].rest_position).transpose();
      mass_[i] = double(input_.mesh.masses[at]);
      for (Index j = 0; j < parent_.own(); ++j) parent_values_(i, j) = parent_.valueAt(v, j);
    }
  }

  void addJumps() {
    jumps_ = findJumps(input_, parent_);
    const auto added = Index(jumps_.phi.size());
    parent_.add(added);
    parent_values_.conservativeResize(Eigen::NoChange, parent_.count());
    for (Index i = 0; i < added; ++i) {
      parent_values_.col(parent_.own() + i) = jumps_.psi.cwiseProduct(parent_values_.col(jumps_.phi[std::size_t(i)]));
    }
  }

  /// What of the functions beyond the affine ones, which are first, resists: free x these, the softest of many. Along a
  /// body no shape that is not affine has much less energy than the least affine one (Poincare's inequality); what has
  /// moves corners that have hardly a volume, and nothing would hold these.
  MatrixXd resisting(const MatrixXd& energy) const {
    const Index n = energy.rows(), affine = functions_.affine, others = n - affine;
    const Index rigid = functions_.driven == 0 ? 1 : 0;
    if (others == 0 || affine <= rigid) return MatrixXd::Identity(n, n);
    const double least = geometry::symmetricEigen(energy.topLeftCorner(affine, affine)).values[rigid];
    const geometry::SymmetricEigen beyond = geometry::symmetricEigen(energy.bottomRightCorner(others, others));
    Index slack = 0;
    while (slack < others && !(beyond.values[slack] > kSlack * least)) ++slack;
    const Index most = std::max<Index>(kMostFunctions, parent_.own()) - functions_.driven - affine;
    const Index count = std::clamp<Index>(others - slack, 0, std::max<Index>(most, 0));
    MatrixXd kept = MatrixXd::Zero(n, affine + count);
    kept.topLeftCorner(affine, affine).setIdentity();
    kept.bottomRightCorner(others, count) = beyond.vectors.middleCols(slack, count);
    return kept;
  }

  /// Makes the functions that are not driven diagonalize sum V (2 mu + lambda) grad grad^T; then the modes.
  void turn(MatrixXd& tethers) {
    const Index driven = functions_.driven, before = functions_.free();
    const MatrixXd whole = stiffnessOf(samples_);
    MatrixXd energy = whole.bottomRightCorner(before, before);
    MatrixXd held = energy;
    if (tethers.size() > 0) held += tethers.bottomRightCorner(before, before);
    const MatrixXd kept = resisting(held);
    energy = (kept.transpose() * energy * kept).eval();
    const geometry::SymmetricEigen eigen = geometry::symmetricEigen(energy);
    const MatrixXd q = kept * eigen.vectors;
    const Index n = q.cols();
    functions_.turn(q);
    stiffness_ = VectorXd::Zero(functions_.count());
    stiffness_.tail(n) = eigen.values.cwiseMax(0.0);
    samples_.gradients.middleRows(driven, n) = (q.transpose() * samples_.gradients.bottomRows(before)).eval();
    samples_.gradients.conservativeResize(driven + n, Eigen::NoChange);
    if (tethers.size() > 0) {
      tethers.middleRows(driven, n) = (q.transpose() * tethers.bottomRows(before)).eval();
      tethers.middleCols(driven, n) = (tethers.rightCols(before) * q).eval();
      tethers.conservativeResize(driven + n, driven + n);
    }
    modes_ = findModes(samples_, tethers, driven);
  }

  /// The parent's points on the part, in their order, then places on the section, each as far as can be from those
  /// before it.
  void findPoints() {
    const formats::Field& field = parent_.field();
    if (field.point_count == 0) return;
    const auto points = package_.fieldPoints().subspan(field.first_point, field.point_count);
    std::vector<Vector3d> at;
    std::vector<VectorXd> of_parent;
    const auto add = [&](const Vector3d& place, VectorXd values) {
      places_.push_back({float(place[0]), float(place[1]), float(place[2])});
      at.push_back(place);
      of_parent.push_back(std::move(values));
    };
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      if (!input_.isOwn(nearest_.of_point[i])) continue;
      VectorXd values = parent_.valuesAt(i);
      if (jumps_.psi.size() > 0) {
        const std::uint32_t t = around_.at(nearest_.of_point[i], asVector(points[i].at));
        const double psi = t == formats::kNone ? 0 : jumps_.at(input_, t);
        for (std::size_t j = 0; j < jumps_.phi.size(); ++j) {
          values[parent_.own() + Index(j)] = psi * values[jumps_.phi[j]];
        }
      }
      add(asVector(points[i].at), std::move(values));
    }
    area_ = double(points[0].area);
    const std::vector<SectionPoint>& section = input_.piece.section;
    const double by_area = std::min(kMostSectionPoints, input_.piece.section_area / area_);
    const std::size_t wanted = std::min(section.size(), std::max(kLeastSectionPoints, std::size_t(by_area)));
    std::vector<double> distance(section.size(), std::numeric_limits<double>::infinity());
    std::size_t next = 0;
    for (std::size_t made = 0; made < wanted; ++made) {
      const SectionPoint& point = section[next];
      add(point.rest, parentAt(point.hung));
      for (std::size_t i = 0; i < distance.size(); ++i) {
        distance[i] = std::min(distance[i], (section[i].rest - point.rest).squaredNorm());
      }
      next = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
      if (!(distance[next] > 0)) break;
    }
    Eigen::MatrixX3d rests(Index(at.size()), 3);
    MatrixXd values(Index(at.size()), parent_.count());
    for (std::size_t i = 0; i < at.size(); ++i) {
      rests.row(Index(i)) = at[i].transpose();
      values.row(Index(i)) = of_parent[i].transpose();
    }
    point_values_ = functions_.valuesFrom(rests, values);
  }

  /// The parent's functions where something hangs.
  VectorXd parentAt(const Hung& hung) const {
    const auto row = [&](std::size_t c) {
      return parent_values_.row(Index(input_.mesh.tetrahedra[hung.tetrahedron].corner[c] - input_.piece.first))
          .transpose();
    };
    VectorXd values = VectorXd::Zero(parent_.count());
    double last = 1;
    for (std::size_t c = 0; c < 3; ++c) {
      values += hung.weight[c] * row(c);
      last -= hung.weight[c];
    }
    return values + last * row(3);
  }

  double hertz(Index mode) const { return std::sqrt(modes_.squares[mode]) / (2 * std::numbers::pi); }

  formats::Field header() const {
    formats::Field field = {};
    field.piece = input_.piece.piece;
    field.held = functions_.driven > 0 ? 1 : 0;
    field.function_count = std::uint32_t(functions_.count());
    field.driven_count = std::uint32_t(functions_.driven);
    field.first_function = std::uint32_t(content_.field_functions.size());
    field.first_pack = std::uint32_t(content_.field_packs.size());
    field.pack_count = std::uint32_t((samples_.list.size() + 7) / 8);
    field.first_gradient = std::uint32_t(content_.field_gradients.size());
    field.first_value = std::uint32_t(content_.field_values.size());
    field.first_point = std::uint32_t(content_.field_points.size());
    field.point_count = std::uint32_t(places_.size());
    field.first_point_value = std::uint32_t(content_.field_point_values.size());
    field.first_mode = std::uint32_t(content_.field_modes.size());
    field.static_error = parent_.field().static_error;
    field.least_eigenvalue = parent_.field().least_eigenvalue;
    const Index n = modes_.squares.size();
    Index lowest = 0;
    while (lowest < n && !(modes_.squares[lowest] > kNoStiffness * modes_.squares[n - 1])) ++lowest;
    field.lowest_hz = lowest < n ? float(hertz(lowest)) : 0;
    return field;
  }

  void appendFunctions(const formats::Field& field) {
    content_.field_functions.insert(content_.field_functions.end(), functions_.driver.begin(), functions_.driver.end());
    const VectorXd decay = decayOfVertices();
    for (Index j = functions_.driven; j < Index(field.function_count); ++j) {
      formats::FieldFunction function = {};
      function.stiffness = float(stiffness_[j]);
      // The modes' frequencies, each by what it has of the function.
      double hz = 0;
      for (Index m = 0; m < modes_.squares.size(); ++m) {
        hz += modes_.shapes.col(m).segment<3>(3 * (j - functions_.driven)).squaredNorm() / 3 * hertz(m);
      }
      function.damping_hz = float(hz);
      function.one = float(functions_.one[j]);
      for (int a = 0; a < 3; ++a) function.rest[std::size_t(a)] = float(functions_.rest(j, a));
      function.pin_set = formats::kNone;
      function.decay = float(mass_.cwiseProduct(decay).dot(values_.col(j).cwiseAbs2()));
      content_.field_functions.push_back(function);
    }
  }

  void appendSamples() {
    for (std::size_t first = 0; first < samples_.list.size(); first += 8) {
      const std::size_t count = std::min<std::size_t>(8, samples_.list.size() - first);
      formats::FieldPack pack = {};
      pack.cluster.fill(formats::kNone);
      for (std::size_t lane = 0; lane < count; ++lane) {
        const Sample& sample = samples_.list[first + lane];
        pack.volume[lane] = float(sample.volume);
        pack.mu[lane] = float(sample.mu);
        pack.lambda[lane] = float(sample.lambda);
        pack.cluster[lane] = sample.cluster;
        for (int a = 0; a < 3; ++a) pack.at[std::size_t(a)][lane] = float(sample.at[a]);
      }
      content_.field_packs.push_back(pack);
      for (Index j = 0; j < functions_.count(); ++j) {
        for (Index a = 0; a < 3; ++a) {
          formats::Lanes lanes = {};
          for (std::size_t lane = 0; lane < count; ++lane) {
            lanes[lane] = float(samples_.gradients(j, 3 * Index(first + lane) + a));
          }
          content_.field_gradients.push_back(lanes);
        }
      }
    }
  }

  void appendModes() {
    const Index n = modes_.squares.size();
    for (Index block = 0; 8 * block < n; ++block) {
      for (Index i = -1; i < n; ++i) {
        formats::Lanes lanes = {};
        for (Index lane = 0; lane < 8 && 8 * block + lane < n; ++lane) {
          const Index mode = 8 * block + lane;
          lanes[std::size_t(lane)] = float(i < 0 ? modes_.squares[mode] : modes_.shapes(i, mode));
        }
        content_.field_modes.push_back(lanes);
      }
    }
  }

  void appendTethers(const MatrixXd& tethers) {
    if (tethers.size() == 0) return;
    content_.field_tethers.push_back(
        {std::uint32_t(content_.fields.size() - 1), std::uint32_t(content_.field_tether_values.size())});
    for (Index i = 0; i < tethers.rows(); ++i) {
      for (Index j = 0; j < tethers.cols(); ++j) {
        content_.field_tether_values.push_back(float(tethers(std::max(i, j), std::min(i, j))));
      }
    }
  }

  /// Of the clusters' own damping, by vertex, 1/s.
  VectorXd decayOfVertices() const {
    VectorXd decay = VectorXd::Zero(input_.piece.count);
    if (package_.mechanics().empty()) return decay;
    const formats::PieceRange& range = package_.pieces()[input_.piece.source];
    std::vector<double> decay_of(package_.physicalVertices().size(), 0);
    for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
      const double damping = double(package_.mechanics()[c].damping);
      if (!(damping > 0)) continue;
      const formats::Cluster& cluster = package_.clusters()[c];
      for (const auto& m : package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
        decay_of[m.vertex] += double(m.share) * damping;
      }
    }
    for (Index i = 0; i < decay.size(); ++i)
      decay[i] = decay_of[input_.mesh.vertices[input_.piece.first + std::size_t(i)]];
    return decay;
  }

  /// Fibres of each activated cluster that the part has some of: the mean stretch of its cells, and the parent's
  /// tension by volume.
  void appendFibres() {
    const formats::PieceRange& range = package_.pieces()[input_.piece.source];
    for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
      double tension = 0;
      for (const formats::FieldFibre& fibre : package_.fieldFibres()) {
        if (fibre.field == index_ && fibre.cluster == c) tension += double(fibre.tension);
      }
      if (tension > 0 && input_.clusters[c] != formats::kNone) appendFibre(c, tension);
    }
  }

  void appendFibre(std::uint32_t c, double tension) {
    std::vector<double> share(package_.physicalVertices().size(), 0);
    const formats::Cluster& cluster = package_.clusters()[c];
    for (const auto& m : package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
      share[m.vertex] = double(m.share);
    }
    const auto restOf = [&](std::uint32_t v) { return asVector(package_.physicalVertices()[v].rest_position); };
    const formats::PieceRange& range = package_.pieces()[input_.piece.source];
    double whole = 0;
    for (const formats::Tetrahedron& t :
         package_.tetrahedra().subspan(range.first_tetrahedron, range.tetrahedron_count)) {
      Eigen::Matrix3d edges;
      for (int e = 0; e < 3; ++e) edges.col(e) = restOf(t.vertex[std::size_t(e)]) - restOf(t.vertex[3]);
      double mean = 0;
      for (const std::uint32_t v : t.vertex) mean += share[v] / 4;
      whole += mean * std::abs(edges.determinant()) / 6;
    }
    std::vector<std::uint32_t> bits;  // tetrahedra of the part
    std::vector<Vector3d> places;
    std::vector<double> volumes;
    for (std::uint32_t i = 0; i < input_.piece.tetrahedron_count; ++i) {
      const PartTetrahedron& t = input_.mesh.tetrahedra[input_.piece.first_tetrahedron + i];
      const auto& corners = package_.tetrahedra()[t.source].vertex;
      double mean = 0;
      Vector3d center = Vector3d::Zero();
      for (std::size_t n = 0; n < 4; ++n) {
        mean += share[corners[n]] * t.center[n];
        center += t.center[n] * restOf(corners[n]);
      }
      if (!(mean > 0) || !(t.volume > 0)) continue;
      bits.push_back(input_.piece.first_tetrahedron + i);
      places.push_back(center);
      volumes.push_back(mean * t.volume);
    }
    const std::vector<std::uint32_t> cells = geometry::cellsOf(places, volumes, geometry::kFibreCells);
    const Vector3d along = asVector(package_.mechanics()[c].fibre);
    for (std::uint32_t cell = 0; cell < geometry::kFibreCells; ++cell) {
      MatrixXd gradient = MatrixXd::Zero(parent_.count(), 3);
      double here = 0;
      for (std::size_t b = 0; b < bits.size(); ++b) {
        if (cells[b] != cell) continue;
        MatrixXd one = MatrixXd::Zero(parent_.count(), 3);
        const double volume = slopes_.add(input_.mesh.tetrahedra[bits[b]], one);
        if (!(volume > 0)) continue;
        gradient += volumes[b] / volume * one;
        here += volumes[b];
      }
      if (!(here > 0)) continue;
      const VectorXd values = functions_.gradientsFrom(gradient / here) * along;
      content_.field_fibres.push_back({std::uint32_t(content_.fields.size() - 1), input_.clusters[c],
                                       std::uint32_t(content_.field_fibre_values.size()),
                                       float(tension * std::min(1.0, here / whole))});
      for (const double value : values) content_.field_fibre_values.push_back(float(value));
    }
  }

  const FieldInput& input_;
  const formats::PackageView& package_;
  const std::uint32_t index_;
  ParentField parent_;
  const Nearest& nearest_;
  formats::PackageContent& content_;
  std::vector<std::uint32_t> local_;  // of the package's vertices: rows
  Eigen::MatrixX3d rest_;
  VectorXd mass_;
  MatrixXd parent_values_;  // vertices x functions of the parent
  const Around around_;
  Jumps jumps_;
  Slopes slopes_;
  PartFunctions functions_;
  MatrixXd values_;  // vertices x functions
  Samples samples_;
  VectorXd stiffness_;
  Modes modes_;
  std::vector<formats::Float3> places_;
  MatrixXd point_values_;
  double area_ = 1;
};

}  // namespace

Nearest findNearest(const formats::PackageView& package, const formats::Field& field) {
  Nearest result;
  const formats::PieceRange& range = package.pieces()[field.piece];
  Places places(range.vertex_count);
  for (std::uint32_t i = 0; i < range.vertex_count; ++i) {
    places.set(i, asVector(package.physicalVertices()[range.first_vertex + i].rest_position));
  }
  Eigen::ArrayXf distance(range.vertex_count);
  const auto nearestTo = [&](const Vector3d& at) {
    places.squaredDistances(at, 0, distance);
    return range.first_vertex + std::uint32_t(firstLargest(-distance));
  };
  for (const formats::FieldPack& pack : package.fieldPacks().subspan(field.first_pack, field.pack_count)) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const Vector3d at(double(pack.at[0][lane]), double(pack.at[1][lane]), double(pack.at[2][lane]));
      result.of_sample.push_back(pack.volume[lane] > 0 ? nearestTo(at) : range.first_vertex);
    }
  }
  for (const formats::FieldPoint& point : package.fieldPoints().subspan(field.first_point, field.point_count)) {
    result.of_point.push_back(nearestTo(asVector(point.at)));
  }
  return result;
}

void addCutFields(const FieldInput& input, formats::PackageContent& content) {
  const auto fields = input.package.fields();
  for (std::uint32_t f = 0; f < fields.size(); ++f) {
    if (fields[f].piece != input.piece.source) continue;
    if (fields[f].held == 0) {
      CutField(input, f, std::vector<std::uint32_t>(input.pin_sets.size(), formats::kNone), content).append();
      continue;
    }
    const formats::FieldFunction* const first = &input.package.fieldFunctions()[fields[f].first_function];
    const bool holds = std::any_of(first, first + fields[f].driven_count, [&](const formats::FieldFunction& function) {
      return input.pin_sets[function.pin_set] != formats::kNone;
    });
    if (holds) CutField(input, f, input.pin_sets, content).append();
  }
}

}  // namespace sinew::cutting
