// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/fields.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/tet_mesh.h"
#include "tools/author/pins.h"
#include "tools/bake/distances.h"
#include "tools/field/field.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

/// Frequencies beyond these times the lowest of a piece stiffen nothing that can be seen; what is rigid stiffens more.
constexpr double kStiffest = 30, kSoftest = 1e-2, kRigid = 90;
/// Parts that a triangle's edges are divided into at most, and places on triangles for each contact point: bounds of
/// the work only.
constexpr double kMostParts = 64;
constexpr std::size_t kMostPlaces = 64;
/// Parts that a fibre is cut into at most.
constexpr double kMostSegments = 8;
/// Weight of the whole host in the motion of what rides along, against the cluster's members.
constexpr double kWhole = 1e-3;
/// Radius squared over the mean square of one coordinate in a ball: what a tether of stiffness E V / radius^2 lacks to
/// the energy of a stretch.
constexpr double kTether = 5;
/// Tension of a fibre that what surrounds it holds, against what shortens it alone.
constexpr double kStrongest = 20;
/// Poisson's ratio of what keeps its volume, where no modulus is given.
constexpr double kVolumeKept = 0.4, kVolumeFree = 0.3;

/// The material of a cluster: frequencies are relative to the piece, moduli are pascals.
struct Material {
  double hz = 0;     ///< the lowest that its settings name; 0 where young counts
  double young = 0;  ///< Pa
  double poisson = 0.3;
};

Material materialOf(const formats::PackageContent& content, std::size_t c) {
  const formats::Cluster& cluster = content.clusters[c];
  const formats::ClusterMechanics& mechanics =
      content.mechanics.empty() ? formats::kPlainMechanics : content.mechanics[c];
  Material material;
  material.poisson = mechanics.volume == formats::VolumeMethod::none ? kVolumeFree : kVolumeKept;
  if (mechanics.stiffness == formats::StiffnessModel::elastic) {
    material.young = std::max(1e-3, double(mechanics.young));
    material.poisson = double(mechanics.poisson);
    return material;
  }
  std::array<double, 3> class_hz = {double(cluster.stretch_hz), double(cluster.bend_hz), double(cluster.twist_hz)};
  if (mechanics.stiffness == formats::StiffnessModel::per_step) {
    // What a step of 1/60 s keeps of a deformation, beta = 1 / (1 + (2 pi f h)^2), as a frequency.
    for (std::size_t i = 0; i < 3; ++i) {
      const double beta = std::max(1e-9, double(mechanics.per_step_beta[i]));
      class_hz[i] = std::sqrt((1 - beta) / beta) * 60 / (2 * std::numbers::pi);
    }
  }
  double hz = class_hz[0];
  if (cluster.mode == formats::ClusterMode::quadratic) hz = std::min({hz, class_hz[1], class_hz[2]});
  if (cluster.mode == formats::ClusterMode::rigid) hz = std::numeric_limits<double>::infinity();
  material.hz = std::clamp(hz, 1e-3, 1e5);
  return material;
}

/// Whether samples in a cluster have limits or plasticity.
bool hasLaws(const formats::ClusterMechanics& mechanics) {
  return mechanics.limit != formats::LimitMethod::none || mechanics.plastic_creep > 0;
}

/// Contact points: so many of the candidates, each as far as can be from those before it. \return their indices.
std::vector<std::size_t> spread(const std::vector<Vector3d>& candidates, std::uint32_t count) {
  std::vector<std::size_t> chosen;
  if (candidates.empty()) return chosen;
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& at : candidates) center += at / double(candidates.size());
  std::vector<double> distance(candidates.size(), std::numeric_limits<double>::infinity());
  std::size_t next = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if ((candidates[i] - center).squaredNorm() > (candidates[next] - center).squaredNorm()) next = i;
  }
  while (chosen.size() < count) {
    chosen.push_back(next);
    const Vector3d& last = candidates[next];
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      distance[i] = std::min(distance[i], (candidates[i] - last).squaredNorm());
    }
    next = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
    if (!(distance[next] > 0)) break;
  }
  return chosen;
}

/// Tension that holds a bar so much shorter, of what it would be in proportion: under Psi of docs/method.md, sides
/// free.
double hardening(double contraction, double poisson) {
  const double mu = 0.5 / (1 + poisson), lambda = poisson / ((1 + poisson) * (1 - 2 * poisson));
  const double along = 1 - contraction;
  // Sides are between those of rest and those that keep the volume.
  double low = 1, high = 1 / std::sqrt(along);
  for (int round = 0; round < 60; ++round) {
    const double across = 0.5 * (low + high);
    const double push = 2 * mu * (across - 1) + lambda * (along * across * across - 1) * along * across;
    (push < 0 ? low : high) = across;
  }
  const double across = 0.5 * (low + high);
  const double stress = 2 * mu * contraction + lambda * (1 - along * across * across) * across * across;
  return contraction > 0 ? stress / contraction : 1;
}

/// A point of the surface: weights of vertices of the piece.
struct Point {
  std::array<std::uint32_t, 4> corner = {};
  std::array<double, 4> weight = {};
};

double areaOf(const std::array<Vector3d, 3>& corner) {
  return 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm();
}

/// Places inside a triangle (its edges among them) that leave no gap wider than `spacing`.
void addPlacesWithin(const std::array<Vector3d, 3>& corner, double spacing, std::vector<Vector3d>& places) {
  double longest = 0;
  for (std::size_t k = 0; k < 3; ++k) longest = std::max(longest, (corner[(k + 1) % 3] - corner[k]).norm());
  const int parts = int(std::min(std::ceil(longest / spacing), kMostParts));
  for (int i = 0; i <= parts; ++i) {
    for (int j = 0; i + j <= parts; ++j) {
      if (std::max({i, j, parts - i - j}) == parts) continue;  // the corners are visual vertices
      places.push_back(corner[0] + (double(i) * (corner[1] - corner[0]) + double(j) * (corner[2] - corner[0])) / parts);
    }
  }
}

/// Blocks of eight rows: element j of block b holds column j of rows 8 b .. 8 b + 7.
void appendBlocks(const Eigen::MatrixXd& rows, std::vector<formats::Lanes>& to) {
  for (Eigen::Index block = 0; 8 * block < rows.rows(); ++block) {
    for (Eigen::Index j = 0; j < rows.cols(); ++j) {
      formats::Lanes lanes = {};
      for (Eigen::Index lane = 0; lane < 8 && 8 * block + lane < rows.rows(); ++lane) {
        lanes[std::size_t(lane)] = float(rows(8 * block + lane, j));
      }
      to.push_back(lanes);
    }
  }
}

/// The modes of the sampled rest stiffness: eigenvalues, and eigenvectors as columns. Unknown 3 j + axis is function
/// driven + j.
std::pair<Eigen::VectorXd, Eigen::MatrixXd> modesOf(const FieldSpace& space) {
  const Eigen::Index n = space.values.cols() - Eigen::Index(space.driven_count);
  Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(3 * n, 3 * n);
  for (const FieldSample& sample : space.samples) {
    const Eigen::MatrixX3d g = sample.gradients.bottomRows(n);
    // Strain of a unit of each unknown: xx, yy, zz, and the shears times sqrt(2).
    Eigen::MatrixXd strain = Eigen::MatrixXd::Zero(6, 3 * n);
    const double half = std::sqrt(0.5);
    for (Eigen::Index j = 0; j < n; ++j) {
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const Eigen::Index next = (axis + 1) % 3, column = 3 * j + axis;
        strain(axis, column) = g(j, axis);
        strain(3 + axis, column) += half * g(j, next);
        strain(3 + axis, 3 * j + next) += half * g(j, axis);
      }
    }
    const Eigen::RowVectorXd trace = strain.topRows<3>().colwise().sum();
    stiffness.selfadjointView<Eigen::Lower>().rankUpdate(strain.transpose(), 2 * sample.volume * sample.mu);
    stiffness.selfadjointView<Eigen::Lower>().rankUpdate(trace.transpose(), sample.volume * sample.lambda);
  }
  if (n == 0) return {};  // pins hold all of it
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(stiffness);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

class PieceFields {
 public:
  PieceFields(const Settings& settings, std::uint32_t piece, formats::PackageContent& content)
      : content_(content), piece_(piece), body_(content.pieces[piece]) {
    findRiders();
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (host_[v] == formats::kNone) continue;
      host_[v] = std::uint32_t(positions_.size());
      positions_.push_back(restOf(body_.first_vertex + v));
      masses_.push_back(double(content.physical_vertices[body_.first_vertex + v].mass));
      const double painted =
          content.vertex_stiffness.empty() ? 1.0 : double(content.vertex_stiffness[body_.first_vertex + v]);
      painted_.push_back(std::max(painted, kSoftest * kSoftest));
    }
    for (std::uint32_t t = 0; t < body_.tetrahedron_count; ++t) {
      std::array<std::uint32_t, 4> corners = content.tetrahedra[body_.first_tetrahedron + t].vertex;
      for (std::uint32_t& v : corners) v = host_[v - body_.first_vertex];
      if (std::find(corners.begin(), corners.end(), formats::kNone) == corners.end()) tetrahedra_.push_back(corners);
    }
    findMaterial();
    findLaws();
    findHeld();
    findFibres();
    options_.functions = settings.field.functions;
    options_.samples_per_function = settings.field.samples;
    options_.lowest_hz = lowest_hz_;
    findPoints(settings.field.points);
  }

  ordered_json add() {
    const FieldInput input = {positions_, tetrahedra_, masses_, young_, poisson_, held_, tethers_, loads_};
    const Fields fields = makeFields(input, options_);
    ordered_json report;
    report["piece"] = piece_;
    report["young_pa"] = fields.free.young_scale * meanYoung();
    report["free"] = append(fields.free, false);
    if (fields.held) report["held"] = append(*fields.held, true);
    if (!fibres_.empty()) report["fibres"] = fibres_.size();
    if (!tethers_.empty()) report["tethers"] = tethers_.size();
    return report;
  }

 private:
  Vector3d restOf(std::uint32_t vertex) const {
    const auto& x = content_.physical_vertices[vertex].rest_position;
    return {double(x[0]), double(x[1]), double(x[2])};
  }

  /// The vertices that carry rigid accessories follow the host: they are no unknowns of its elasticity.
  void findRiders() {
    host_.assign(body_.vertex_count, 0);
    for (const formats::AttachedPart& part : content_.parts) {
      if (part.cluster == formats::kNone) continue;
      const formats::Cluster& cluster = content_.clusters[part.cluster];
      if (cluster.piece != piece_) continue;
      riders_.push_back(part.cluster);
      for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
        const formats::Membership& member = content_.memberships[m];
        if (member.share > 0) host_[member.vertex - body_.first_vertex] = formats::kNone;
      }
    }
  }

  /// Values at all vertices of the piece. A rider's are those of the affine motion that comes nearest to the cluster's
  /// members on the host, and a little to all of the host: thin members do not tell how it tilts.
  Eigen::MatrixXd valuesAtAll(const Eigen::MatrixXd& of_host) const {
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(body_.vertex_count, of_host.cols());
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (host_[v] != formats::kNone) all.row(v) = of_host.row(host_[v]);
    }
    for (const std::uint32_t rider : riders_) {
      const formats::Cluster& cluster = content_.clusters[rider];
      const auto members = std::span(content_.memberships).subspan(cluster.first_member, cluster.member_count);
      std::vector<double> weights(body_.vertex_count, 0);
      double all_mu = 0, all_mass = 0;
      for (const formats::Membership& member : members) all_mu += double(member.mu);
      for (const double mass : masses_) all_mass += mass;
      for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
        if (host_[v] != formats::kNone) weights[v] = kWhole * masses_[host_[v]] / all_mass;
      }
      for (const formats::Membership& member : members) {
        weights[member.vertex - body_.first_vertex] += double(member.mu) / all_mu;
      }
      Vector3d center = Vector3d::Zero();
      double weight = 0;
      for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
        center += weights[v] * restOf(body_.first_vertex + v);
        weight += weights[v];
      }
      center /= weight;
      Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
      for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
        const Vector3d arm = restOf(body_.first_vertex + v) - center;
        moment += weights[v] * arm * arm.transpose();
      }
      const Eigen::Matrix3d inverse = geometry::pseudoInverse<3>(moment);
      for (const formats::Membership& to : members) {
        if (!(to.share > 0)) continue;
        const Vector3d lever = inverse * (restOf(to.vertex) - center);
        for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
          if (!(weights[v] > 0)) continue;
          const double part = weights[v] * (1 / weight + lever.dot(restOf(body_.first_vertex + v) - center));
          all.row(to.vertex - body_.first_vertex) += part * of_host.row(host_[v]);
        }
      }
    }
    return all;
  }

  double meanYoung() const {
    double sum = 0;
    for (const double e : young_) sum += e;
    return sum / double(young_.size());
  }

  void findMaterial() {
    std::vector<Material> materials;
    bool absolute = false;
    double lowest = std::numeric_limits<double>::infinity();
    const auto rides = [&](std::uint32_t c) { return std::find(riders_.begin(), riders_.end(), c) != riders_.end(); };
    for (std::uint32_t c = 0; c < body_.cluster_count; ++c) {
      materials.push_back(materialOf(content_, body_.first_cluster + c));
      if (rides(body_.first_cluster + c)) continue;
      absolute = absolute || materials.back().hz == 0;
      if (materials.back().hz > 0) lowest = std::min(lowest, materials.back().hz);
    }
    // What a vertex has of rigid clusters makes it stiff only where it belongs to nothing else.
    std::vector<double> young(masses_.size(), 0), poisson = young, soft = young;
    for (const bool rigid : {false, true}) {
      for (std::uint32_t c = 0; c < body_.cluster_count; ++c) {
        if ((content_.clusters[body_.first_cluster + c].mode == formats::ClusterMode::rigid) != rigid) continue;
        const Material& material = materials[c];
        double e = material.young;
        if (material.hz > 0) {
          const double ratio = std::clamp(material.hz / lowest, kSoftest, rigid ? kRigid : kStiffest);
          // Beside moduli in pascals a frequency counts for a metre of water.
          e = absolute ? 1000 * 4 * material.hz * material.hz : ratio * ratio;
        }
        const std::vector<double> shares = sharesOf(body_.first_cluster + c);
        for (std::size_t v = 0; v < shares.size(); ++v) {
          if (rigid && soft[v] > kNoShare) continue;
          // What several bones share is skin between them.
          young[v] += shares[v] * (!rigid || shares[v] > 1 - kNoShare ? e : 1.0);
          poisson[v] += shares[v] * material.poisson;
          if (!rigid) soft[v] += shares[v];
        }
      }
    }
    const bool all_rigid = std::all_of(soft.begin(), soft.end(), [](double share) { return share <= kNoShare; });
    double weighed = 0, weight = 0;
    for (std::size_t v = 0; v < masses_.size(); ++v) {
      if (soft[v] > kNoShare) {
        young[v] *= painted_[v] / soft[v];
        poisson[v] /= soft[v];
      } else if (!all_rigid) {
        continue;
      }
      weighed += masses_[v] * young[v];
      weight += masses_[v];
    }
    for (const auto& corners : tetrahedra_) {
      double e = 0, nu = 0;
      for (const std::uint32_t v : corners) {
        e += young[v] / 4;
        nu += poisson[v] / 4;
      }
      young_.push_back(std::max(e, 1e-9 * weighed / weight));
      poisson_.push_back(std::clamp(nu, 0.0, 0.49));
    }
    lowest_hz_ = absolute ? 0 : lowest * std::sqrt(weighed / weight);
  }

  /// Shares of a cluster at the host's vertices.
  std::vector<double> sharesOf(std::uint32_t c) const {
    std::vector<double> shares(positions_.size(), 0);
    const formats::Cluster& cluster = content_.clusters[c];
    for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
      const formats::Membership& member = content_.memberships[m];
      const std::uint32_t v = host_[member.vertex - body_.first_vertex];
      if (v != formats::kNone) shares[v] += double(member.share);
    }
    return shares;
  }

  /// The cluster that has the largest share of each vertex, where clusters have limits or plasticity; and the decay of
  /// its clusters' own damping.
  void findLaws() {
    if (content_.mechanics.empty()) return;
    std::vector<double> largest(positions_.size(), 0);
    law_.assign(positions_.size(), formats::kNone);
    decay_.assign(positions_.size(), 0);
    for (std::uint32_t c = body_.first_cluster; c < body_.first_cluster + body_.cluster_count; ++c) {
      const std::vector<double> shares = sharesOf(c);
      for (std::size_t v = 0; v < shares.size(); ++v) {
        decay_[v] += shares[v] * double(content_.mechanics[c].damping);
        if (!(shares[v] > largest[v])) continue;
        largest[v] = shares[v];
        law_[v] = hasLaws(content_.mechanics[c]) ? c : formats::kNone;
      }
    }
  }

  std::uint32_t lawAt(const Vector3d& place) const {
    if (law_.empty()) return formats::kNone;
    std::size_t nearest = 0;
    for (std::size_t v = 1; v < positions_.size(); ++v) {
      if ((positions_[v] - place).squaredNorm() < (positions_[nearest] - place).squaredNorm()) nearest = v;
    }
    return law_[nearest];
  }

  /// Fibres of activated clusters: what each tetrahedron adds to the mean stretch, and the force of a unit of tension.
  void findFibres() {
    for (std::uint32_t c = body_.first_cluster; c < body_.first_cluster + body_.cluster_count; ++c) {
      if (content_.mechanics.empty() || content_.mechanics[c].channel == formats::kNone) continue;
      const formats::ClusterMechanics& mechanics = content_.mechanics[c];
      const Vector3d along(double(mechanics.fibre[0]), double(mechanics.fibre[1]), double(mechanics.fibre[2]));
      const std::vector<Bit> bits = bitsOf(c, along);
      if (bits.empty()) continue;
      Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * Eigen::Index(positions_.size()));
      double volume = 0;
      for (const Bit& bit : bits) volume += bit.volume;
      const std::size_t segments = tethers_.empty() ? segmentsOf(bits, along) : 1;
      double low = bits[0].at.dot(along), high = low;
      for (const Bit& bit : bits) low = std::min(low, bit.at.dot(along)), high = std::max(high, bit.at.dot(along));
      std::vector<Fibre> fibres(segments);
      for (const Bit& bit : bits) {
        const double place = high > low ? (bit.at.dot(along) - low) / (high - low) : 0;
        Fibre& fibre = fibres[std::min(segments - 1, std::size_t(place * double(segments)))];
        if (fibre.stretch.size() == 0) fibre.stretch = Eigen::VectorXd::Zero(Eigen::Index(positions_.size()));
        const auto& corners = tetrahedra_[bit.tetrahedron];
        const auto add = [&](std::uint32_t v, double slope) {
          fibre.stretch[v] += slope;
          load.segment<3>(3 * Eigen::Index(v)) += slope / volume * along;
        };
        for (int k = 0; k < 3; ++k) add(corners[std::size_t(k) + 1], bit.slope[k]);
        add(corners[0], -bit.slope.sum());
        fibre.volume += bit.volume;
        fibre.tension += double(mechanics.contraction) * young_[bit.tetrahedron] * bit.volume;
        fibre.hardening += bit.volume * hardening(double(mechanics.contraction), poisson_[bit.tetrahedron]);
      }
      for (Fibre& fibre : fibres) {
        if (!(fibre.volume > 0)) continue;
        fibre.cluster = c;
        fibre.load = loads_.size();
        fibre.share = fibre.volume / volume;
        fibre.contraction = double(mechanics.contraction);
        fibre.hardening /= fibre.volume;
        fibre.stretch /= fibre.volume;
        fibres_.push_back(std::move(fibre));
      }
      loads_.push_back(std::move(load));
    }
  }

  /// What a tetrahedron is of a cluster.
  struct Bit {
    std::size_t tetrahedron = 0;
    double volume = 0;                  // times the cluster's share
    Vector3d at = Vector3d::Zero();     // its centre
    Vector3d slope = Vector3d::Zero();  // of its coordinates 1, 2, 3 along the fibre, times that volume
  };

  std::vector<Bit> bitsOf(std::uint32_t cluster, const Vector3d& along) const {
    const std::vector<double> shares = sharesOf(cluster);
    std::vector<Bit> bits;
    for (std::size_t t = 0; t < tetrahedra_.size(); ++t) {
      const auto& corners = tetrahedra_[t];
      Eigen::Matrix3d edges;
      Bit bit;
      double share = 0;
      for (const std::uint32_t v : corners) {
        share += shares[v] / 4;
        bit.at += positions_[v] / 4;
      }
      for (int k = 0; k < 3; ++k) edges.col(k) = positions_[corners[std::size_t(k) + 1]] - positions_[corners[0]];
      const double six = std::abs(edges.determinant()), longest = edges.colwise().norm().maxCoeff();
      if (share == 0 || !(six > 6 * geometry::kFlat * longest * longest * longest)) continue;
      bit.tetrahedron = t;
      bit.volume = share * six / 6;
      bit.slope = edges.inverse() * along * bit.volume;
      bits.push_back(bit);
    }
    return bits;
  }

  /// A fibre's tension acts on the mean stretch of what it runs through, so something long would buckle under it: it is
  /// cut into parts about as long as wide. (What tethers hold does not buckle.)
  static std::size_t segmentsOf(const std::vector<Bit>& bits, const Vector3d& along) {
    Vector3d center = Vector3d::Zero();
    double volume = 0;
    for (const Bit& bit : bits) {
      center += bit.volume * bit.at;
      volume += bit.volume;
    }
    center /= volume;
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const Bit& bit : bits) spread += bit.volume / volume * (bit.at - center) * (bit.at - center).transpose();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - along * along.transpose();
    const double length = std::sqrt(along.dot(spread * along));
    const double width = std::sqrt(
        std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(across * spread * across).eigenvalues()[2]));
    if (!(width * kMostSegments > length)) return std::size_t(kMostSegments);
    return std::size_t(std::max(1.0, std::round(length / width)));
  }

  void appendFibres(const FieldSpace& space, std::uint32_t field) {
    for (const Fibre& fibre : fibres_) {
      const Eigen::VectorXd values = space.values.transpose() * fibre.stretch;
      // What shortens the fibre by so much where it lies: what surrounds it stretches along.
      const double alone = space.young_scale * fibre.tension;
      const double answer = space.compliance.size() > 0 ? space.compliance[Eigen::Index(fibre.load)] : 0;
      const double embedded =
          answer > 0 ? std::min(fibre.share * fibre.contraction / answer, kStrongest * alone) : alone;
      const double tension = embedded + (fibre.hardening - 1) * alone;
      content_.field_fibres.push_back(
          {field, fibre.cluster, std::uint32_t(content_.field_fibre_values.size()), float(tension)});
      for (const double value : values) content_.field_fibre_values.push_back(float(value));
    }
  }

  /// What the pin sets hold: vertices, and by tethers what they hold in part.
  void findHeld() {
    taken_.assign(positions_.size(), 0);
    std::vector<std::uint32_t> held_by(positions_.size(), formats::kNone);
    std::vector<double> weight(positions_.size(), 0);
    for (std::uint32_t s = 0; s < content_.pin_sets.size(); ++s) {
      const formats::PinSet& set = content_.pin_sets[s];
      bool any = false;
      for (std::uint32_t i = set.first; i < set.first + set.count; ++i) {
        const std::uint32_t v = content_.pin_set_vertices[i];
        if (v < body_.first_vertex || v >= body_.first_vertex + body_.vertex_count) continue;
        const std::uint32_t host = host_[v - body_.first_vertex];
        if (host == formats::kNone || held_by[host] != formats::kNone) continue;
        weight[host] = content_.pin_weights.empty() ? 1 : double(content_.pin_weights[v]);
        if (!(weight[host] > 0)) continue;
        held_by[host] = std::uint32_t(held_.size());
        any = true;
      }
      if (!any) continue;
      held_.emplace_back();
      pin_sets_.push_back(s);
    }
    for (std::uint32_t v = 0; v < held_by.size(); ++v) {
      if (held_by[v] != formats::kNone && weight[v] >= 1) hold(v, held_by[v]);
    }
    holdRigid(held_by, weight);
    for (std::uint32_t v = 0; v < held_by.size(); ++v) {
      if (held_by[v] == formats::kNone || taken_[v] != 0) continue;
      const double omega = 2 * std::numbers::pi * formats::kPinHz * weight[v] / (1 - weight[v]);
      tethers_.push_back({v, held_by[v], 0, masses_[v] * omega * omega});
    }
    dropEmptySets();
    std::erase_if(tethers_, [&](const FieldTether& tether) { return taken_[tether.vertex] != 0; });
    for (std::vector<std::uint32_t>& vertices : held_) std::sort(vertices.begin(), vertices.end());
  }

  void hold(std::uint32_t vertex, std::uint32_t set) {
    if (taken_[vertex] != 0) return;
    taken_[vertex] = 1;
    held_[set].push_back(vertex);
  }

  /// Sets that hold nothing wholly drive no functions: their vertices stay the step's own springs.
  void dropEmptySets() {
    std::vector<std::uint32_t> number(held_.size(), formats::kNone);
    std::uint32_t kept = 0;
    for (std::uint32_t p = 0; p < held_.size(); ++p) {
      if (held_[p].empty()) continue;
      number[p] = kept;
      held_[kept] = held_[p];
      pin_sets_[kept++] = pin_sets_[p];
    }
    held_.resize(kept);
    pin_sets_.resize(kept);
    std::erase_if(tethers_, [&](const FieldTether& tether) { return number[tether.held] == formats::kNone; });
    for (FieldTether& tether : tethers_) tether.held = number[tether.held];
  }

  /// What belongs to a rigid cluster that one pin set holds moves with that set: its own vertices as if they were in
  /// the set, those that it shares with others by tethers. A share of s beside r of the clusters that deform makes the
  /// tether s / r times as stiff as a stretch of these clusters' size is.
  void holdRigid(const std::vector<std::uint32_t>& held_by, const std::vector<double>& weight) {
    std::vector<double> young(positions_.size(), 0), around = young, soft = young, radius = young;
    double volume = 0, mass = 0;
    for (std::size_t t = 0; t < tetrahedra_.size(); ++t) {
      volume += tetrahedronVolume(t);
      for (const std::uint32_t v : tetrahedra_[t]) young[v] += young_[t], around[v] += 1;
    }
    for (const double m : masses_) mass += m;
    for (std::uint32_t c = body_.first_cluster; c < body_.first_cluster + body_.cluster_count; ++c) {
      if (content_.clusters[c].mode == formats::ClusterMode::rigid) continue;
      const std::vector<double> shares = sharesOf(c);
      for (std::size_t v = 0; v < shares.size(); ++v) {
        soft[v] += shares[v];
        radius[v] += shares[v] * double(content_.clusters[c].radius);
      }
    }
    for (std::uint32_t c = body_.first_cluster; c < body_.first_cluster + body_.cluster_count; ++c) {
      if (content_.clusters[c].mode != formats::ClusterMode::rigid) continue;
      if (std::find(riders_.begin(), riders_.end(), c) != riders_.end()) continue;
      const std::vector<double> shares = sharesOf(c);
      const std::vector<std::uint32_t> holders = rigidHolders(shares, held_by, weight);
      if (holders.size() != 1) continue;
      const std::uint32_t set = holders[0];
      for (std::uint32_t v = 0; v < shares.size(); ++v) {
        if (!(shares[v] > kNoShare)) continue;
        if (shares[v] > 1 - kNoShare) {
          hold(v, set);
          continue;
        }
        const double rest = std::max(soft[v], kNoShare),
                     size = soft[v] > kNoShare ? radius[v] / soft[v] : double(content_.clusters[c].radius);
        if (!(around[v] > 0)) continue;
        const double stretch = kTether * young[v] / around[v] * masses_[v] * volume / (mass * size * size);
        tethers_.push_back({v, set, shares[v] / rest * stretch, 0});
      }
    }
  }

  /// From its first corner to the others, a column each.
  Eigen::Matrix3d edgesOf(const std::array<std::uint32_t, 4>& corners) const {
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = positions_[corners[std::size_t(k) + 1]] - positions_[corners[0]];
    return edges;
  }

  double tetrahedronVolume(std::size_t t) const { return std::abs(edgesOf(tetrahedra_[t]).determinant()) / 6; }

  /// A place in the tetrahedron that holds it, or of those that do not the one that it lies least outside of.
  void hang(const Vector3d& x, Point& point) const {
    double best = -std::numeric_limits<double>::infinity();
    for (const auto& tetrahedron : tetrahedra_) {
      const Vector3d weight = edgesOf(tetrahedron).inverse() * (x - positions_[tetrahedron[0]]);
      const double first = 1 - weight.sum(), least = std::min(first, weight.minCoeff());
      if (!(least > best)) continue;
      best = least;
      for (std::size_t k = 0; k < 4; ++k) {
        point.corner[k] = tetrahedron[k];
        point.weight[k] = k == 0 ? first : weight[int(k) - 1];
      }
    }
  }

  void findPoints(std::uint32_t count) {
    double area = 0;
    if (content_.barycentric.empty()) {
      // Hung on clusters: the physical vertices stand for the surface.
      for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
        points_.push_back({{v, v, v, v}, {1, 0, 0, 0}});
        const auto& x = content_.physical_vertices[body_.first_vertex + v].rest_position;
        places_.push_back(x);
      }
      const auto& d = content_.info.diagonal;
      area = double(d) * double(d);
    } else {
      const auto in_piece = [&](std::uint32_t v) {
        const std::uint32_t t = content_.barycentric[v].tetrahedron;
        return t >= body_.first_tetrahedron && t < body_.first_tetrahedron + body_.tetrahedron_count;
      };
      // Visual vertices, and places on triangles that are wider than the points lie apart.
      std::vector<char> used(content_.visual_positions.size(), 0);
      std::vector<std::array<Vector3d, 3>> triangles;
      for (const auto& triangle : content_.visual_triangles) {
        if (!in_piece(triangle[0])) continue;
        std::array<Vector3d, 3>& corner = triangles.emplace_back();
        bool whole = true;
        for (std::size_t k = 0; k < 3; ++k) {
          const auto& x = content_.visual_positions[triangle[k]];
          corner[k] = {double(x[0]), double(x[1]), double(x[2])};
          if (in_piece(triangle[k])) {
            used[triangle[k]] = 1;
          } else {
            whole = false;
          }
        }
        area += areaOf(corner);
        if (!whole) triangles.pop_back();
      }
      std::vector<std::uint32_t> vertices;
      std::vector<Vector3d> candidates;
      for (std::uint32_t v = 0; v < used.size(); ++v) {
        if (used[v] == 0) continue;
        vertices.push_back(v);
        const auto& x = content_.visual_positions[v];
        candidates.emplace_back(double(x[0]), double(x[1]), double(x[2]));
      }
      const double spacing = std::sqrt(std::max(area, 1e-12) / std::max(1.0, double(count)));
      // Of slivers without number the largest are enough.
      std::stable_sort(triangles.begin(), triangles.end(),
                       [](const auto& a, const auto& b) { return areaOf(a) > areaOf(b); });
      const std::size_t most = vertices.size() + kMostPlaces * count;
      for (const auto& corner : triangles) {
        if (candidates.size() < most) addPlacesWithin(corner, spacing, candidates);
      }
      for (const std::size_t i : spread(candidates, count)) {
        Point& point = points_.emplace_back();
        const Vector3d& x = candidates[i];
        places_.push_back({float(x[0]), float(x[1]), float(x[2])});
        if (i >= vertices.size()) {
          hang(x, point);
          continue;
        }
        const formats::BarycentricAttachment& at = content_.barycentric[vertices[i]];
        point.corner = content_.tetrahedra[at.tetrahedron].vertex;
        double last = 1;
        for (std::size_t k = 0; k < 3; ++k) {
          point.weight[k] = double(at.weight[k]);
          last -= point.weight[k];
        }
        point.weight[3] = last;
        for (std::uint32_t& vertex : point.corner) vertex -= body_.first_vertex;
      }
    }
    area_ = std::max(area, 1e-12) / std::max<double>(1, double(points_.size()));
  }

  ordered_json append(const FieldSpace& space, bool held) {
    const auto k = std::uint32_t(space.values.cols());
    formats::Field field = {};
    field.piece = piece_;
    field.held = held ? 1 : 0;
    field.function_count = k;
    field.driven_count = space.driven_count;
    field.first_function = std::uint32_t(content_.field_functions.size());
    field.first_pack = std::uint32_t(content_.field_packs.size());
    field.pack_count = std::uint32_t((space.samples.size() + 7) / 8);
    field.first_gradient = std::uint32_t(content_.field_gradients.size());
    field.first_value = std::uint32_t(content_.field_values.size());
    field.first_point = std::uint32_t(content_.field_points.size());
    field.point_count = std::uint32_t(points_.size());
    field.first_point_value = std::uint32_t(content_.field_point_values.size());
    field.lowest_hz = float(space.lowest_hz);
    field.static_error = float(space.static_error);
    field.least_eigenvalue = float(space.least_eigenvalue);
    for (std::uint32_t j = 0; j < k; ++j) {
      formats::FieldFunction function = {};
      function.stiffness = float(std::max(0.0, space.stiffness[j]));
      function.damping_hz = float(std::max(0.0, space.damping_hz[j]));
      function.one = float(space.one[j]);
      function.rest = {float(space.rest(j, 0)), float(space.rest(j, 1)), float(space.rest(j, 2))};
      function.pin_set = j < space.driven_count ? pin_sets_[space.pin_set[j]] : formats::kNone;
      function.monomial = j < space.driven_count ? space.monomial[j] : 0;
      for (std::size_t v = 0; v < decay_.size() && j >= space.driven_count; ++v) {
        const double phi = space.values(Eigen::Index(v), j);
        function.decay += float(masses_[v] * phi * phi * decay_[v]);
      }
      content_.field_functions.push_back(function);
    }
    for (std::uint32_t p = 0; p < field.pack_count; ++p) {
      formats::FieldPack pack = {};
      pack.cluster.fill(formats::kNone);
      const std::size_t first = 8 * std::size_t(p), last = std::min(first + 8, space.samples.size());
      for (std::size_t s = first; s < last; ++s) {
        const FieldSample& sample = space.samples[s];
        pack.volume[s - first] = float(sample.volume);
        pack.mu[s - first] = float(sample.mu);
        pack.lambda[s - first] = float(sample.lambda);
        pack.cluster[s - first] = lawAt(sample.at);
        for (int axis = 0; axis < 3; ++axis) pack.at[std::size_t(axis)][s - first] = float(sample.at[axis]);
      }
      content_.field_packs.push_back(pack);
      for (std::uint32_t j = 0; j < k; ++j) {
        for (int axis = 0; axis < 3; ++axis) {
          formats::Lanes lanes = {};
          for (std::size_t s = first; s < last; ++s) lanes[s - first] = float(space.samples[s].gradients(j, axis));
          content_.field_gradients.push_back(lanes);
        }
      }
    }
    const Eigen::MatrixXd values = valuesAtAll(space.values);
    appendBlocks(values, content_.field_values);
    Eigen::MatrixXd at_points = Eigen::MatrixXd::Zero(Eigen::Index(points_.size()), k);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        at_points.row(Eigen::Index(i)) += points_[i].weight[c] * values.row(points_[i].corner[c]);
      }
      content_.field_points.push_back({places_[i], float(area_)});
    }
    appendBlocks(at_points, content_.field_point_values);
    field.first_mode = std::uint32_t(content_.field_modes.size());
    const auto [stiffness, shapes] = modesOf(space);
    const Eigen::Index unknowns = stiffness.size();
    for (Eigen::Index block = 0; 8 * block < unknowns; ++block) {
      for (Eigen::Index i = -1; i < unknowns; ++i) {
        formats::Lanes lanes = {};
        for (Eigen::Index lane = 0; lane < 8 && 8 * block + lane < unknowns; ++lane) {
          const Eigen::Index mode = 8 * block + lane;
          lanes[std::size_t(lane)] = float(i < 0 ? std::max(0.0, stiffness[mode]) : shapes(i, mode));
        }
        content_.field_modes.push_back(lanes);
      }
    }
    appendFibres(space, std::uint32_t(content_.fields.size()));
    if (space.tethers.size() > 0) {
      content_.field_tethers.push_back(
          {std::uint32_t(content_.fields.size()), std::uint32_t(content_.field_tether_values.size())});
      for (const double value : space.tethers.reshaped()) content_.field_tether_values.push_back(float(value));
    }
    content_.fields.push_back(field);
    return {{"functions", k},
            {"driven", space.driven_count},
            {"samples", space.samples.size()},
            {"contact_points", points_.size()},
            {"lowest_hz", space.lowest_hz},
            {"static_error", space.static_error},
            {"gravity_error", space.gravity_error},
            {"least_eigenvalue", space.least_eigenvalue}};
  }

  struct Fibre {
    std::uint32_t cluster = 0;
    std::size_t load = 0;          // its cluster's
    Eigen::VectorXd stretch;       // sum over vertices of stretch x: the mean deformation gradient along the fibre
    double volume = 0, share = 0;  // m^3 of the cluster, and of all that it has
    double contraction = 0;        // of the cluster at full activation
    double hardening = 0;          // what it takes more than in proportion
    double tension = 0;            // J, that shortens it by so much alone
  };
  formats::PackageContent& content_;
  const std::uint32_t piece_;
  const formats::PieceRange body_;
  std::vector<std::uint32_t> host_;  // of each vertex of the piece: its number among the host's; kNone: it rides along
  std::vector<std::uint32_t> riders_;  // clusters of rigid accessories
  std::vector<Vector3d> positions_;
  std::vector<double> masses_, painted_, young_, poisson_, decay_;
  std::vector<std::uint32_t> law_;
  std::vector<Fibre> fibres_;
  std::vector<Eigen::VectorXd> loads_;
  std::vector<std::array<std::uint32_t, 4>> tetrahedra_;
  std::vector<std::vector<std::uint32_t>> held_;
  std::vector<char> taken_;  // the host's vertices that pin sets hold
  std::vector<FieldTether> tethers_;
  std::vector<std::uint32_t> pin_sets_;  // of held_, into PSET
  std::vector<Point> points_;
  std::vector<formats::Float3> places_;
  double area_ = 1, lowest_hz_ = 0;
  FieldOptions options_;
};

}  // namespace

ordered_json addFields(const Settings& settings, formats::PackageContent& content) {
  if (settings.field.functions == 0) return {{"left_out", "field.functions is 0"}};
  ordered_json pieces = ordered_json::array();
  for (std::uint32_t piece = 0; piece < content.pieces.size(); ++piece) {
    pieces.push_back(PieceFields(settings, piece, content).add());
  }
  addDistances(settings.field.distances, content);
  return pieces;
}

void removeFields(formats::PackageContent& content) {
  content.fields.clear();
  content.field_functions.clear();
  content.field_packs.clear();
  content.field_gradients.clear();
  content.field_values.clear();
  content.field_points.clear();
  content.field_point_values.clear();
  content.field_modes.clear();
  content.field_fibres.clear();
  content.field_fibre_values.clear();
  content.field_tethers.clear();
  content.field_tether_values.clear();
  content.distance_grids.clear();
  content.distance_values.clear();
}

}  // namespace sinew::tools
