// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/fields.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "runtime/geometry/pseudo_inverse.h"
#include "tools/field/field.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

/// Frequencies beyond these times the lowest of a piece stiffen nothing that can be seen.
constexpr double kStiffest = 30, kSoftest = 1e-2;
/// The limits of clusters that nobody has set: an elastic solid hardly gets there.
constexpr float kUsualMin = 0.5F, kUsualMax = 1.5F;
/// Poisson's ratio of what keeps its volume, where no modulus is given.
constexpr double kVolumeKept = 0.4, kVolumeFree = 0.3;

/// The material of a cluster: frequencies are relative to the piece, moduli are pascals.
struct Material {
  double hz = 0;     ///< the lowest that its settings name; 0 where young counts
  double young = 0;  ///< Pa
  double poisson = 0.3;
  double mass = 0;  ///< kg
};

Material materialOf(const formats::PackageContent& content, std::size_t c) {
  const formats::Cluster& cluster = content.clusters[c];
  const formats::ClusterMechanics& mechanics =
      content.mechanics.empty() ? formats::kPlainMechanics : content.mechanics[c];
  Material material;
  material.mass = double(cluster.mass);
  if (mechanics.stiffness == formats::StiffnessModel::elastic) {
    material.young = std::max(1e-3, double(mechanics.young));
    material.poisson = double(mechanics.poisson);
    return material;
  }
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  double hz = double(cluster.stretch_hz);
  if (quadratic) hz = std::min({hz, double(cluster.bend_hz), double(cluster.twist_hz)});
  if (cluster.mode == formats::ClusterMode::rigid) hz = std::numeric_limits<double>::infinity();
  material.hz = std::clamp(hz, 1e-3, 1e5);
  material.poisson = mechanics.volume == formats::VolumeMethod::none ? kVolumeFree : kVolumeKept;
  return material;
}

/// Why fields cannot stand for what the clusters ask for; empty if they can.
std::string faultOf(const formats::PackageContent& content) {
  if (content.tetrahedra.empty()) return "there are no tetrahedra";
  for (const formats::ClusterMechanics& mechanics : content.mechanics) {
    if (mechanics.stiffness == formats::StiffnessModel::per_step) return "clusters.stiffness is per_step";
    if (mechanics.plastic_creep > 0) return "clusters are plastic";
    const bool usual = mechanics.limit == formats::LimitMethod::principal && mechanics.stretch_min == kUsualMin &&
                       mechanics.stretch_max == kUsualMax;
    if (mechanics.limit != formats::LimitMethod::none && !usual) return "clusters have limits of their own";
    if (mechanics.channel != formats::kNone) return "clusters are activated";
  }
  return {};
}

/// Contact points: visual vertices of a piece, each as far as can be from those before it.
std::vector<std::uint32_t> spreadVertices(const formats::PackageContent& content,
                                          const std::vector<std::uint32_t>& candidates, std::uint32_t count) {
  std::vector<std::uint32_t> chosen;
  if (candidates.empty()) return chosen;
  const auto at = [&](std::uint32_t v) {
    const auto& x = content.visual_positions[v];
    return Vector3d(double(x[0]), double(x[1]), double(x[2]));
  };
  Vector3d center = Vector3d::Zero();
  for (const std::uint32_t v : candidates) center += at(v);
  center /= double(candidates.size());
  std::vector<double> distance(candidates.size(), std::numeric_limits<double>::infinity());
  std::size_t next = 0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if ((at(candidates[i]) - center).squaredNorm() > (at(candidates[next]) - center).squaredNorm()) next = i;
  }
  while (chosen.size() < count) {
    chosen.push_back(candidates[next]);
    const Vector3d last = at(candidates[next]);
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      distance[i] = std::min(distance[i], (at(candidates[i]) - last).squaredNorm());
    }
    next = std::size_t(std::max_element(distance.begin(), distance.end()) - distance.begin());
    if (!(distance[next] > 0)) break;
  }
  return chosen;
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
Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> modesOf(const FieldSpace& space) {
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
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(stiffness);
}

class PieceFields {
 public:
  PieceFields(const Settings& settings, std::uint32_t piece, formats::PackageContent& content)
      : content_(content), piece_(piece), body_(content.bodies[piece]) {
    findRiders();
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (host_[v] == formats::kNone) continue;
      host_[v] = std::uint32_t(positions_.size());
      positions_.push_back(restOf(body_.first_vertex + v));
      masses_.push_back(double(content.physical_vertices[body_.first_vertex + v].mass));
    }
    for (std::uint32_t t = 0; t < body_.tetrahedron_count; ++t) {
      std::array<std::uint32_t, 4> corners = content.tetrahedra[body_.first_tetrahedron + t].vertex;
      for (std::uint32_t& v : corners) v = host_[v - body_.first_vertex];
      if (std::find(corners.begin(), corners.end(), formats::kNone) == corners.end()) tetrahedra_.push_back(corners);
    }
    findMaterial();
    findHeld();
    options_.functions = settings.field.functions;
    options_.samples_per_function = settings.field.samples;
    options_.lowest_hz = lowest_hz_;
    findPoints(settings.field.points);
  }

  ordered_json add() {
    const FieldInput input = {positions_, tetrahedra_, masses_, young_, poisson_, held_, {}};
    const Fields fields = makeFields(input, options_);
    ordered_json report;
    report["piece"] = piece_;
    report["young_pa"] = fields.free.young_scale * meanYoung();
    report["free"] = append(fields.free, false);
    if (fields.held) report["held"] = append(*fields.held, true);
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
      if (cluster.body != piece_) continue;
      riders_.push_back(part.cluster);
      for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
        const formats::Membership& member = content_.memberships[m];
        if (member.share > 0) host_[member.vertex - body_.first_vertex] = formats::kNone;
      }
    }
  }

  /// Values at all vertices of the piece. A rider's are those of the affine motion that comes nearest to the cluster's
  /// members on the host.
  Eigen::MatrixXd valuesAtAll(const Eigen::MatrixXd& of_host) const {
    Eigen::MatrixXd all = Eigen::MatrixXd::Zero(body_.vertex_count, of_host.cols());
    for (std::uint32_t v = 0; v < body_.vertex_count; ++v) {
      if (host_[v] != formats::kNone) all.row(v) = of_host.row(host_[v]);
    }
    for (const std::uint32_t rider : riders_) {
      const formats::Cluster& cluster = content_.clusters[rider];
      const auto members = std::span(content_.memberships).subspan(cluster.first_member, cluster.member_count);
      Vector3d center = Vector3d::Zero();
      double weight = 0;
      for (const formats::Membership& member : members) {
        center += double(member.mu) * restOf(member.vertex);
        weight += double(member.mu);
      }
      center /= weight;
      Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
      for (const formats::Membership& member : members) {
        const Vector3d arm = restOf(member.vertex) - center;
        moment += double(member.mu) * arm * arm.transpose();
      }
      const Eigen::Matrix3d inverse = geometry::pseudoInverse<3>(moment);
      for (const formats::Membership& to : members) {
        if (!(to.share > 0)) continue;
        const Vector3d lever = inverse * (restOf(to.vertex) - center);
        for (const formats::Membership& member : members) {
          if (!(member.mu > 0)) continue;
          const double part = double(member.mu) * (1 / weight + lever.dot(restOf(member.vertex) - center));
          all.row(to.vertex - body_.first_vertex) += part * of_host.row(host_[member.vertex - body_.first_vertex]);
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
    std::vector<double> young(masses_.size(), 0), poisson(masses_.size(), 0);
    for (std::uint32_t c = 0; c < body_.cluster_count; ++c) {
      const formats::Cluster& cluster = content_.clusters[body_.first_cluster + c];
      const Material& material = materials[c];
      double e = material.young;
      if (material.hz > 0) {
        const double ratio = std::clamp(material.hz / lowest, kSoftest, kStiffest);
        // Beside moduli in pascals a frequency counts for a metre of water.
        e = absolute ? 1000 * 4 * material.hz * material.hz : ratio * ratio;
      }
      for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
        const std::uint32_t v = host_[content_.memberships[m].vertex - body_.first_vertex];
        if (v == formats::kNone) continue;
        young[v] += double(content_.memberships[m].share) * e;
        poisson[v] += double(content_.memberships[m].share) * material.poisson;
      }
    }
    double weighed = 0, weight = 0;
    for (std::size_t v = 0; v < masses_.size(); ++v) {
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

  void findHeld() {
    std::vector<char> taken(content_.physical_vertices.size(), 0);
    for (std::uint32_t s = 0; s < content_.pin_sets.size(); ++s) {
      const formats::PinSet& set = content_.pin_sets[s];
      std::vector<std::uint32_t> vertices;
      for (std::uint32_t i = set.first; i < set.first + set.count; ++i) {
        const std::uint32_t v = content_.pin_set_vertices[i];
        if (v < body_.first_vertex || v >= body_.first_vertex + body_.vertex_count || taken[v] != 0) continue;
        if (!content_.pin_weights.empty() && content_.pin_weights[v] < 1) continue;
        if (host_[v - body_.first_vertex] == formats::kNone) continue;
        taken[v] = 1;
        vertices.push_back(host_[v - body_.first_vertex]);
      }
      if (vertices.empty()) continue;
      held_.push_back(std::move(vertices));
      pin_sets_.push_back(s);
    }
  }

  void findPoints(std::uint32_t count) {
    double area = 0;
    std::vector<std::uint32_t> candidates;
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
      std::vector<char> used(content_.visual_positions.size(), 0);
      for (const auto& triangle : content_.visual_triangles) {
        if (!in_piece(triangle[0])) continue;
        Vector3d corner[3];
        for (std::size_t k = 0; k < 3; ++k) {
          const auto& x = content_.visual_positions[triangle[k]];
          corner[k] = {double(x[0]), double(x[1]), double(x[2])};
          if (in_piece(triangle[k])) used[triangle[k]] = 1;
        }
        area += 0.5 * (corner[1] - corner[0]).cross(corner[2] - corner[0]).norm();
      }
      for (std::uint32_t v = 0; v < used.size(); ++v) {
        if (used[v] != 0) candidates.push_back(v);
      }
      for (const std::uint32_t v : spreadVertices(content_, candidates, count)) {
        const formats::BarycentricAttachment& at = content_.barycentric[v];
        Point point;
        point.corner = content_.tetrahedra[at.tetrahedron].vertex;
        double last = 1;
        for (std::size_t k = 0; k < 3; ++k) {
          point.weight[k] = double(at.weight[k]);
          last -= point.weight[k];
        }
        point.weight[3] = last;
        for (std::uint32_t& corner : point.corner) corner -= body_.first_vertex;
        points_.push_back(point);
        places_.push_back(content_.visual_positions[v]);
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
      content_.field_functions.push_back(function);
    }
    for (std::uint32_t p = 0; p < field.pack_count; ++p) {
      formats::FieldPack pack = {};
      const std::size_t first = 8 * std::size_t(p), last = std::min(first + 8, space.samples.size());
      for (std::size_t s = first; s < last; ++s) {
        const FieldSample& sample = space.samples[s];
        pack.volume[s - first] = float(sample.volume);
        pack.mu[s - first] = float(sample.mu);
        pack.lambda[s - first] = float(sample.lambda);
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
    const auto modes = modesOf(space);
    const Eigen::Index unknowns = modes.eigenvalues().size();
    for (Eigen::Index block = 0; 8 * block < unknowns; ++block) {
      for (Eigen::Index i = -1; i < unknowns; ++i) {
        formats::Lanes lanes = {};
        for (Eigen::Index lane = 0; lane < 8 && 8 * block + lane < unknowns; ++lane) {
          const Eigen::Index mode = 8 * block + lane;
          lanes[std::size_t(lane)] =
              float(i < 0 ? std::max(0.0, modes.eigenvalues()[mode]) : modes.eigenvectors()(i, mode));
        }
        content_.field_modes.push_back(lanes);
      }
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

  struct Point {
    std::array<std::uint32_t, 4> corner = {};
    std::array<double, 4> weight = {};
  };

  formats::PackageContent& content_;
  const std::uint32_t piece_;
  const formats::BodyRange body_;
  std::vector<std::uint32_t> host_;  // of each vertex of the piece: its number among the host's; kNone: it rides along
  std::vector<std::uint32_t> riders_;  // clusters of rigid accessories
  std::vector<Vector3d> positions_;
  std::vector<double> masses_, young_, poisson_;
  std::vector<std::array<std::uint32_t, 4>> tetrahedra_;
  std::vector<std::vector<std::uint32_t>> held_;
  std::vector<std::uint32_t> pin_sets_;  // of held_, into PSET
  std::vector<Point> points_;
  std::vector<formats::Float3> places_;
  double area_ = 1, lowest_hz_ = 0;
  FieldOptions options_;
};

}  // namespace

ordered_json addFields(const Settings& settings, formats::PackageContent& content) {
  if (settings.field.functions == 0) return {{"left_out", "field.functions is 0"}};
  if (const std::string fault = faultOf(content); !fault.empty()) return {{"left_out", fault}};
  ordered_json pieces = ordered_json::array();
  for (std::uint32_t piece = 0; piece < content.bodies.size(); ++piece) {
    pieces.push_back(PieceFields(settings, piece, content).add());
  }
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
}

}  // namespace sinew::tools
