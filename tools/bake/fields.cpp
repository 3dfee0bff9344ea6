// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/fields.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/author/pins.h"
#include "tools/bake/contact_points.h"
#include "tools/bake/distances.h"
#include "tools/bake/fibres.h"
#include "tools/bake/field_host.h"
#include "tools/field/field.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

/// Frequencies beyond these times the lowest of a piece stiffen nothing that can be seen; what is rigid stiffens more.
constexpr double kStiffest = 30, kSoftest = 1e-2, kRigid = 90;
/// Radius squared over the mean square of one coordinate in a ball: what a tether of stiffness E V / radius^2 lacks to
/// the energy of a stretch.
constexpr double kTether = 5;
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
    // Deformation kept by a step of 1/60 s, beta = 1 / (1 + (2 pi f h)^2), as a frequency.
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

/// Of a level of detail: half of those of the level before, no fewer than eight.
std::uint32_t functionsOf(std::uint32_t whole, std::uint32_t level) {
  constexpr std::uint32_t kFewest = 8;
  return level == 0 ? whole : std::min(whole, std::max(kFewest, whole >> level));
}

/// Whether samples in a cluster have limits or plasticity.
bool hasLaws(const formats::ClusterMechanics& mechanics) {
  return mechanics.limit != formats::LimitMethod::none || mechanics.plastic_creep > 0;
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

/// The addresses of a piece's fields: of all that they depend on, and of what their functions are functions on.
struct FieldKeys {
  StageKey shape = {}, all = {};
};

FieldKeys keysOf(const FieldInput& input, const FieldOptions& options) {
  StageWriter writer;
  const auto add = [&](auto value) { writer(value); };
  const auto addAll = [&](const auto& span) {
    add(span.size());
    for (const auto& value : span) add(value);
  };
  addAll(input.positions), addAll(input.tetrahedra), addAll(input.masses), addAll(input.held);
  add(options.functions), add(options.samples_per_function), add(options.element);
  FieldKeys keys;
  const std::vector<std::byte> shape = writer.take();
  keys.shape = stageKey(shape);
  writer = {};
  add(keys.shape), add(options.lowest_hz), add(options.residual_modes);
  addAll(input.young), addAll(input.poisson), addAll(input.loads), addAll(input.reaches);
  add(input.tethers.size());
  for (const FieldTether& tether : input.tethers) {
    add(tether.vertex), add(tether.held), add(tether.strength), add(tether.absolute);
  }
  keys.all = stageKey(writer.take());
  return keys;
}

class PieceFields {
 public:
  PieceFields(const Settings& settings, std::uint32_t piece, formats::PackageContent& content)
      : content_(content), host_(content, piece) {
    findMaterial();
    findLaws();
    findHeld();
    fibres_ = findFibres(content, host_, young_, poisson_);
    options_.functions = settings.field.functions;
    options_.samples_per_function = settings.field.samples;
    options_.residual_modes = settings.field.residual_modes;
    options_.lowest_hz = lowest_hz_;
    contact_ = contactPoints(content, host_, settings.field.points);
  }

  PieceElasticity elasticity() && {
    PieceElasticity result;
    result.piece = host_.piece;
    result.vertices = host_.vertices;
    result.tetrahedra = host_.tetrahedra;
    for (const auto& corners : host_.tetrahedra) {
      Vector3d centre = Vector3d::Zero();
      for (const std::uint32_t v : corners) centre += host_.positions[v] / 4;
      result.centres.push_back(centre);
    }
    result.young = std::move(young_);
    result.poisson = std::move(poisson_);
    result.lowest_hz = lowest_hz_;
    result.held = std::move(held_);
    result.pin_sets = std::move(pin_sets_);
    result.tethers = std::move(tethers_);
    for (Fibre& fibre : fibres_.fibres) result.fibres.push_back(std::move(fibre));
    return result;
  }

  /// \param level of detail: each has half as many functions. \param draft fields of other materials serve, where the
  /// cache has them.
  ordered_json add(StageCache& cache, std::uint32_t level, bool draft) {
    level_ = level;
    FieldOptions options = options_;
    options.functions = functionsOf(options_.functions, level);
    if (level > 0) options.residual_modes = 0;
    const FieldInput input = {host_.positions, host_.tetrahedra, host_.masses,  young_,         poisson_,
                              held_,           tethers_,         fibres_.loads, fibres_.reaches};
    const FieldKeys keys = keysOf(input, options);
    std::optional<Fields> before;
    if (draft && !cache.has("fields", keys.all)) before = cache.find<Fields>("functions", keys.shape);
    const Fields fields = before ? reweighed(*before, input, options) : cache.get("fields", keys.all, [&] {
      Fields made = makeFields(input, options), bare = made;
      bare.free.residual_modes.resize(0, 0);
      bare.free.residual_locals.resize(0);
      cache.keep("functions", keys.shape, bare, 0);
      return made;
    });
    ordered_json report;
    report["piece"] = host_.piece;
    if (level > 0) report["level"] = level;
    if (before) report["draft"] = true;
    report["young_pa"] = fields.free.young_scale * meanYoung();
    report["free"] = append(fields.free, false);
    if (fields.held) report["held"] = append(*fields.held, true);
    if (!fibres_.fibres.empty()) report["fibres"] = fibres_.fibres.size();
    if (!tethers_.empty()) report["tethers"] = tethers_.size();
    return report;
  }

 private:
  double meanYoung() const {
    double sum = 0;
    for (const double e : young_) sum += e;
    return sum / double(young_.size());
  }

  /// Factor on the stiffness of a vertex.
  double paintedAt(std::size_t v) const {
    if (content_.vertex_stiffness.empty()) return 1;
    return std::max(double(content_.vertex_stiffness[host_.vertices[v]]), kSoftest * kSoftest);
  }

  void findMaterial() {
    std::vector<Material> materials;
    bool absolute = false;
    double lowest = std::numeric_limits<double>::infinity();
    for (std::uint32_t c = 0; c < host_.range.cluster_count; ++c) {
      materials.push_back(materialOf(content_, host_.range.first_cluster + c));
      if (host_.rides(host_.range.first_cluster + c)) continue;
      absolute = absolute || materials.back().hz == 0;
      if (materials.back().hz > 0) lowest = std::min(lowest, materials.back().hz);
    }
    // Rigid clusters make a vertex stiff only where it belongs to nothing else.
    std::vector<double> young(host_.masses.size(), 0), poisson = young, soft = young;
    for (const bool rigid : {false, true}) {
      for (std::uint32_t c = 0; c < host_.range.cluster_count; ++c) {
        if ((content_.clusters[host_.range.first_cluster + c].mode == formats::ClusterMode::rigid) != rigid) continue;
        const Material& material = materials[c];
        double e = material.young;
        if (material.hz > 0) {
          const double ratio = std::clamp(material.hz / lowest, kSoftest, rigid ? kRigid : kStiffest);
          // Beside moduli in pascals a frequency counts for a metre of water.
          e = absolute ? 1000 * 4 * material.hz * material.hz : ratio * ratio;
        }
        const std::vector<double> shares = host_.sharesOf(host_.range.first_cluster + c);
        for (std::size_t v = 0; v < shares.size(); ++v) {
          if (rigid && soft[v] > kNoShare) continue;
          // Vertices of several bones are skin there.
          young[v] += shares[v] * (!rigid || shares[v] > 1 - kNoShare ? e : 1.0);
          poisson[v] += shares[v] * material.poisson;
          if (!rigid) soft[v] += shares[v];
        }
      }
    }
    const bool all_rigid = std::all_of(soft.begin(), soft.end(), [](double share) { return share <= kNoShare; });
    double weighed = 0, weight = 0;
    for (std::size_t v = 0; v < host_.masses.size(); ++v) {
      if (soft[v] > kNoShare) {
        young[v] *= paintedAt(v) / soft[v];
        poisson[v] /= soft[v];
      } else if (!all_rigid) {
        continue;
      }
      weighed += host_.masses[v] * young[v];
      weight += host_.masses[v];
    }
    for (const auto& corners : host_.tetrahedra) {
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

  /// The cluster that has the largest share of each vertex, where clusters have limits or plasticity; and the decay of
  /// its clusters' own damping.
  void findLaws() {
    if (content_.mechanics.empty()) return;
    std::vector<double> largest(host_.positions.size(), 0);
    law_.assign(host_.positions.size(), formats::kNone);
    decay_.assign(host_.positions.size(), 0);
    for (std::uint32_t c = host_.range.first_cluster; c < host_.range.first_cluster + host_.range.cluster_count; ++c) {
      const std::vector<double> shares = host_.sharesOf(c);
      for (std::size_t v = 0; v < shares.size(); ++v) {
        decay_[v] += shares[v] * double(content_.mechanics[c].damping);
        if (!(shares[v] > largest[v])) continue;
        largest[v] = shares[v];
        law_[v] = hasLaws(content_.mechanics[c]) ? c : formats::kNone;
      }
    }
    if (std::count(law_.begin(), law_.end(), formats::kNone) == std::ptrdiff_t(law_.size())) law_.clear();
  }

  std::uint32_t lawAt(const Vector3d& place) const {
    if (law_.empty()) return formats::kNone;
    std::size_t nearest = 0;
    for (std::size_t v = 1; v < host_.positions.size(); ++v) {
      if ((host_.positions[v] - place).squaredNorm() < (host_.positions[nearest] - place).squaredNorm()) nearest = v;
    }
    return law_[nearest];
  }

  /// The pin sets' holds: vertices, and by tethers the ones held in part.
  void findHeld() {
    taken_.assign(host_.positions.size(), 0);
    std::vector<std::uint32_t> held_by(host_.positions.size(), formats::kNone);
    std::vector<double> weight(host_.positions.size(), 0);
    for (std::uint32_t s = 0; s < content_.pin_sets.size(); ++s) {
      const formats::PinSet& set = content_.pin_sets[s];
      bool any = false;
      for (std::uint32_t i = set.first; i < set.first + set.count; ++i) {
        const std::uint32_t v = content_.pin_set_vertices[i];
        const std::uint32_t host = host_.numberOf(v);
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
      tethers_.push_back({v, held_by[v], 0, host_.masses[v] * omega * omega});
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

  /// A rigid cluster that one pin set holds moves with that set: its own vertices as if they were in
  /// the set, shared ones by tethers. A share of s beside r of the clusters that deform makes the
  /// tether s / r times as stiff as a stretch of these clusters' size is.
  void holdRigid(const std::vector<std::uint32_t>& held_by, const std::vector<double>& weight) {
    std::vector<double> young(host_.positions.size(), 0), around = young, soft = young, radius = young;
    double volume = 0, mass = 0;
    for (std::size_t t = 0; t < host_.tetrahedra.size(); ++t) {
      volume += host_.volumeOf(t);
      for (const std::uint32_t v : host_.tetrahedra[t]) young[v] += young_[t], around[v] += 1;
    }
    for (const double m : host_.masses) mass += m;
    for (std::uint32_t c = host_.range.first_cluster; c < host_.range.first_cluster + host_.range.cluster_count; ++c) {
      if (content_.clusters[c].mode == formats::ClusterMode::rigid) continue;
      const std::vector<double> shares = host_.sharesOf(c);
      for (std::size_t v = 0; v < shares.size(); ++v) {
        soft[v] += shares[v];
        radius[v] += shares[v] * double(content_.clusters[c].radius);
      }
    }
    for (std::uint32_t c = host_.range.first_cluster; c < host_.range.first_cluster + host_.range.cluster_count; ++c) {
      if (content_.clusters[c].mode != formats::ClusterMode::rigid) continue;
      if (host_.rides(c)) continue;
      const std::vector<double> shares = host_.sharesOf(c);
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
        const double stretch = kTether * young[v] / around[v] * host_.masses[v] * volume / (mass * size * size);
        tethers_.push_back({v, set, shares[v] / rest * stretch, 0});
      }
    }
  }

  ordered_json append(const FieldSpace& space, bool held) {
    const auto k = std::uint32_t(space.values.cols());
    formats::Field field = {};
    field.piece = host_.piece;
    field.held = held ? 1 : 0;
    field.level = std::uint16_t(level_);
    field.function_count = k;
    field.driven_count = space.driven_count;
    field.first_function = std::uint32_t(content_.field_functions.size());
    field.first_pack = std::uint32_t(content_.field_packs.size());
    field.pack_count = std::uint32_t((space.samples.size() + 7) / 8);
    field.first_gradient = std::uint32_t(content_.field_gradients.size());
    field.first_value = std::uint32_t(content_.field_values.size());
    field.first_point = std::uint32_t(content_.field_points.size());
    field.point_count = std::uint32_t(contact_.points.size());
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
        function.decay += float(host_.masses[v] * phi * phi * decay_[v]);
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
    const Eigen::MatrixXd values = host_.valuesAtAll(space.values);
    appendBlocks(values, content_.field_values);
    Eigen::MatrixXd at_points = Eigen::MatrixXd::Zero(Eigen::Index(contact_.points.size()), k);
    for (std::size_t i = 0; i < contact_.points.size(); ++i) {
      const ContactPoint& point = contact_.points[i];
      for (std::size_t c = 0; c < 4; ++c) {
        at_points.row(Eigen::Index(i)) += point.weight[c] * values.row(point.corner[c]);
      }
      content_.field_points.push_back({point.place, float(contact_.area)});
    }
    appendBlocks(at_points, content_.field_point_values);
    field.first_mode = std::uint32_t(content_.field_modes.size());
    const auto [stiffness, shapes] = geometry::symmetricEigen(field::sampledStiffness(space));
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
    addFibres(fibres_.fibres, space, std::uint32_t(content_.fields.size()), content_);
    if (space.tethers.size() > 0) {
      content_.field_tethers.push_back(
          {std::uint32_t(content_.fields.size()), std::uint32_t(content_.field_tether_values.size())});
      for (const double value : space.tethers.reshaped()) content_.field_tether_values.push_back(float(value));
    }
    addResidual(space);
    content_.fields.push_back(field);
    return {{"functions", k},
            {"residual_modes", space.residual_modes.cols()},
            {"driven", space.driven_count},
            {"samples", space.samples.size()},
            {"contact_points", contact_.points.size()},
            {"lowest_hz", space.lowest_hz},
            {"static_error", space.static_error},
            {"gravity_error", space.gravity_error},
            {"least_eigenvalue", space.least_eigenvalue}};
  }

  void addResidual(const FieldSpace& space) {
    const Eigen::Index modes = space.residual_modes.cols();
    if (modes == 0) return;
    Eigen::MatrixXd at_all[3];
    double largest = 0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      at_all[axis] =
          host_.valuesAtAll(space.residual_modes(Eigen::seqN(axis, space.residual_modes.rows() / 3, 3), Eigen::all));
      largest = std::max(largest, at_all[axis].cwiseAbs().maxCoeff());
    }
    formats::FieldResidual record = {};
    record.field = std::uint32_t(content_.fields.size());
    record.mode_count = std::uint32_t(modes);
    record.first_value = std::uint32_t(content_.field_residual_values.size());
    record.first_local = std::uint32_t(content_.field_residual_locals.size());
    record.scale = float(largest / std::numeric_limits<std::int16_t>::max());
    const Eigen::Index vertices = at_all[0].rows();
    for (Eigen::Index block = 0; block < vertices; block += 8) {
      for (const Eigen::MatrixXd& along : at_all) {
        for (Eigen::Index m = 0; m < modes; ++m) {
          for (Eigen::Index v = block; v < block + 8; ++v) {
            const double value = v < vertices ? along(v, m) / double(record.scale) : 0;
            content_.field_residual_values.push_back(std::int16_t(std::lround(value)));
          }
        }
      }
    }
    std::vector<double> local(host_.range.vertex_count, space.residual_locals.mean());
    for (std::size_t i = 0; i < host_.vertices.size(); ++i) {
      local[host_.vertices[i] - host_.range.first_vertex] = space.residual_locals[Eigen::Index(i)];
    }
    for (const double value : local) content_.field_residual_locals.push_back(float(value));
    content_.field_residuals.push_back(record);
  }

  formats::PackageContent& content_;
  const FieldHost host_;
  std::vector<double> young_, poisson_;  // of the host's tetrahedra
  std::vector<double> decay_;            // of its vertices
  std::vector<std::uint32_t> law_;       // of its vertices: a cluster, or kNone; empty: kNone
  std::vector<std::vector<std::uint32_t>> held_;
  std::vector<char> taken_;  // the host's vertices that pin sets hold
  std::vector<FieldTether> tethers_;
  std::vector<std::uint32_t> pin_sets_;  // of held_, into PSET
  Fibres fibres_;
  ContactPoints contact_;
  double lowest_hz_ = 0;
  FieldOptions options_;
  std::uint32_t level_ = 0;
};

}  // namespace

ordered_json addFields(const Settings& settings, formats::PackageContent& content, StageCache* cache, bool draft) {
  StageCache no_cache{{}};
  StageCache& kept = cache == nullptr ? no_cache : *cache;
  if (settings.field.functions == 0) return {{"left_out", "field.functions is 0"}};
  ordered_json report = ordered_json::array();
  std::deque<PieceFields> pieces;
  for (std::uint32_t piece = 0; piece < content.pieces.size(); ++piece) pieces.emplace_back(settings, piece, content);
  for (std::uint32_t level = 0; level <= settings.field.levels; ++level) {
    if (level > 0 && functionsOf(settings.field.functions, level) == functionsOf(settings.field.functions, level - 1)) {
      break;
    }
    for (PieceFields& piece : pieces) report.push_back(piece.add(kept, level, draft));
  }
  addDistances(settings.field.distances, content, kept);
  return report;
}

PieceElasticity elasticityOf(formats::PackageContent& content, std::uint32_t piece) {
  return PieceFields(Settings{}, piece, content).elasticity();
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
  content.field_residuals.clear();
  content.field_residual_values.clear();
  content.field_residual_locals.clear();
  content.distance_grids.clear();
  content.distance_values.clear();
}

}  // namespace sinew::tools
