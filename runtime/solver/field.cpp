// SPDX-License-Identifier: MIT
#include "runtime/solver/field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {

static_assert(sizeof(SamplePack) == sizeof(formats::FieldPack));

namespace {

/// Of E q^2 v, the foundation that a held vertex of volume v lies on, q the shortest wave that k functions show
/// (docs/method.md §4).
constexpr double kFoundation = 0.4;

std::uint32_t strideOf(std::uint32_t unknowns) { return (unknowns + 7) / 8 * 8; }

/// Q diag(values) Q^T from the modes.
void fillStiffness(const Field& field, float* to) {
  using Four = Eigen::Array4f;
  const std::uint32_t n = field.unknowns();
  const auto entry = [&](std::uint32_t i, std::uint32_t j) -> float& { return to[std::size_t(field.stride) * i + j]; };
  for (std::uint32_t first = 0; first < n; first += 8) {
    const float* const block = field.modes + std::size_t(first) * (n + 1);
    for (std::uint32_t i = 0; i < n; ++i) {
      const float* const own = block + 8 * (i + 1);
      const Four low = Four::Map(block) * Four::Map(own), high = Four::Map(block + 4) * Four::Map(own + 4);
      for (std::uint32_t j = 0; j <= i; ++j) {
        const float* const other = block + 8 * (j + 1);
        const Four sum = low * Four::Map(other) + high * Four::Map(other + 4);
        entry(i, j) += (sum[0] + sum[1]) + (sum[2] + sum[3]);
      }
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < i; ++j) entry(j, i) = entry(i, j);
  }
}

constexpr float kOutOfReach = 1e18F;

/// A sample's limits by a cluster's CMEC record. |F - R| is the root of the sum of (stretch - 1)^2, so it tells how
/// far all limits are at least.
void setLimits(const formats::PackageView& package, const formats::ClusterMechanics& m, std::size_t lane,
               SampleLimits& limits) {
  float reach = std::sqrt(kOutOfReach);
  switch (m.limit) {
    case formats::LimitMethod::none:
      return;
    case formats::LimitMethod::principal:
      limits.least[lane] = m.stretch_min;
      limits.most[lane] = m.stretch_max;
      reach = std::min(1 - m.stretch_min, m.stretch_max - 1);
      break;
    case formats::LimitMethod::rows:
      limits.row[lane] = m.stretch_max;
      reach = m.stretch_max - 1;
      break;
    case formats::LimitMethod::frobenius:
    case formats::LimitMethod::frobenius_cheap:
    case formats::LimitMethod::soft:
      limits.norm[lane] = m.norm_max;
      limits.norm_limit[lane] = m.limit == formats::LimitMethod::soft ? m.norm_limit : m.norm_max;
      reach = std::sqrt(m.norm_max) - std::sqrt(3.0F);
      break;
    case formats::LimitMethod::curve: {
      const auto curve = package.curvePoints().subspan(m.first_curve_point, m.curve_point_count);
      limits.curve[lane] = &curve[0].norm;
      limits.curve_points[lane] = m.curve_point_count;
      reach = std::sqrt(curve[0].norm) - std::sqrt(3.0F);
      break;
    }
  }
  reach = std::max(0.0F, reach);
  limits.reach[lane] = 0.999F * reach * reach;
}

/// \return whether some sample has limits.
bool setLimits(const formats::PackageView& package, std::span<const formats::FieldPack> packs,
               std::span<SampleLimits> limits) {
  bool some = false;
  for (std::size_t p = 0; p < packs.size(); ++p) {
    limits[p] = {};
    std::fill_n(limits[p].least, 8, -kOutOfReach);
    for (float* const bound : {limits[p].most, limits[p].row, limits[p].norm, limits[p].norm_limit, limits[p].reach}) {
      std::fill_n(bound, 8, kOutOfReach);
    }
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const std::uint32_t cluster = packs[p].cluster[lane];
      if (cluster == formats::kNone || package.mechanics().empty()) continue;
      setLimits(package, package.mechanics()[cluster], lane, limits[p]);
      some = some || package.mechanics()[cluster].limit != formats::LimitMethod::none;
    }
  }
  return some;
}

bool isPlastic(const formats::PackageView& package, std::span<const formats::FieldPack> packs) {
  if (package.mechanics().empty()) return false;
  for (const formats::FieldPack& pack : packs) {
    for (const std::uint32_t cluster : pack.cluster) {
      if (cluster != formats::kNone && package.mechanics()[cluster].plastic_creep > 0) return true;
    }
  }
  return false;
}

/// By physical vertex: 1 where visual vertices, or what rides along, hang on it; empty: on clusters, so on all.
Array<std::uint8_t> drawnVertices(const formats::PackageView& package) {
  Array<std::uint8_t> drawn;
  if (package.barycentric().empty()) return drawn;
  drawn.resize(package.physicalVertices().size());
  for (const formats::BarycentricAttachment& at : package.barycentric()) {
    for (const std::uint32_t v : package.tetrahedra()[at.tetrahedron].vertex) drawn[v] = 1;
  }
  for (const formats::AttachedPart& part : package.parts()) {
    if (part.cluster == formats::kNone) continue;
    const formats::Cluster& cluster = package.clusters()[part.cluster];
    for (const auto& member : package.memberships().subspan(cluster.first_member, cluster.member_count)) {
      if (member.share > 0) drawn[member.vertex] = 1;
    }
  }
  return drawn;
}

}  // namespace

Array<Field> makeFields(const formats::PackageView& package, Array<double>& driven_masses, Array<float>& stiffness,
                        Array<SampleLimits>& limits) {
  std::size_t driven = 0, entries = 0;
  for (const formats::Field& record : package.allFields()) {
    driven += record.driven_count;
    const std::uint32_t unknowns = 3 * (record.function_count - record.driven_count);
    entries += std::size_t(unknowns) * strideOf(unknowns);
  }
  stiffness.resize(entries);
  float* next_stiffness = stiffness.data();
  driven_masses.resize(driven);
  double* next_mass = driven_masses.data();
  limits.resize(package.fieldPacks().size());
  bool limited = false;
  const Array<std::uint8_t> drawn = drawnVertices(package);
  Array<Field> fields(package.allFields().size());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const formats::Field& record = package.allFields()[i];
    const formats::PieceRange& piece = package.pieces()[record.piece];
    Field& field = fields[i];
    field.piece = record.piece;
    field.held = record.held != 0;
    field.level = record.level;
    field.k = record.function_count;
    field.driven = record.driven_count;
    field.lowest_hz = double(record.lowest_hz);
    field.first_vertex = piece.first_vertex;
    field.vertex_count = field.drawn_count = piece.vertex_count;
    while (!drawn.empty() && field.drawn_count > 0 && drawn[piece.first_vertex + field.drawn_count - 1] == 0) {
      --field.drawn_count;
    }
    field.functions = package.fieldFunctions().subspan(record.first_function, record.function_count);
    for (std::uint32_t j = 0; j < field.k; ++j) {
      field.rest_center += field.oneOf(j) * field.restOf(j);
      field.ones += field.oneOf(j) * field.oneOf(j);
    }
    field.rest_center /= field.ones;
    // Contact points are the same on all levels, and are known by their place in the first one's.
    const formats::Field& whole = package.allFields()[i % package.fields().size()];
    field.points = package.fieldPoints().subspan(whole.first_point, whole.point_count);
    const auto packs = package.fieldPacks().subspan(record.first_pack, record.pack_count);
    field.packs = reinterpret_cast<const SamplePack*>(packs.data());
    field.pack_count = record.pack_count;
    const auto own_limits = std::span(limits.data(), limits.size()).subspan(record.first_pack, record.pack_count);
    if (setLimits(package, packs, own_limits)) field.limits = own_limits.data();
    limited = limited || field.limits != nullptr;
    field.plastic = isPlastic(package, packs);
    for (const formats::FieldTethers& tethers : package.fieldTethers()) {
      if (tethers.field == i) field.tethers = package.fieldTetherValues().data() + tethers.first_value;
    }
    for (const formats::FieldResidual& residual : package.fieldResiduals()) {
      if (residual.field != i) continue;
      field.residual_modes = residual.mode_count;
      field.residual = package.fieldResidualValues().data() + residual.first_value;
      field.residual_scale = residual.scale;
      field.residual_locals = package.fieldResidualLocals().data() + residual.first_local;
    }
    field.gradients = package.fieldGradients().data()[record.first_gradient].data();
    field.values = package.fieldValues().data()[record.first_value].data();
    if (!field.points.empty()) field.point_values = package.fieldPointValues().data()[record.first_point_value].data();
    field.modes = package.fieldModes().data()[record.first_mode].data();
    field.stride = strideOf(field.unknowns());
    fillStiffness(field, next_stiffness);
    field.stiffness = next_stiffness;
    next_stiffness += std::size_t(field.unknowns()) * field.stride;
    double* const driven_mass = next_mass;
    next_mass += field.driven;
    field.driven_mass = driven_mass;
    double squared_masses = 0;
    Vector3d moment = Vector3d::Zero();
    for (std::uint32_t v = 0; v < piece.vertex_count; ++v) {
      const formats::PhysicalVertex& vertex = package.physicalVertices()[piece.first_vertex + v];
      const double mass = double(vertex.mass);
      const Vector3d at = asVector(vertex.rest_position).cast<double>();
      field.mass += mass;
      moment += mass * at;
      field.second_moment += mass * at.squaredNorm();
      squared_masses += mass * mass;
      for (std::uint32_t j = 0; j < field.driven; ++j) {
        driven_mass[j] += mass * double(field.valueAt(v, j));
      }
    }
    field.second_moment -= moment.squaredNorm() / field.mass;
    double volume = 0, weighed = 0;
    for (const formats::FieldPack& pack : packs) {
      for (std::size_t lane = 0; lane < 8; ++lane) {
        const double v = double(pack.volume[lane]), mu = double(pack.mu[lane]), lambda = double(pack.lambda[lane]);
        volume += v;
        if (mu > 0) weighed += v * mu * (3 * lambda + 2 * mu) / (lambda + mu);
      }
    }
    field.young = volume > 0 ? weighed / volume : 0;
    for (const formats::FieldPoint& point : field.points) {
      field.apart += double(point.area) / double(field.points.size());
    }
    field.apart = std::sqrt(field.apart);
    // Vertices count by their masses: mere carriers of accessories have next to none.
    const double wave = volume > 0 ? M_PI * std::cbrt(double(field.k) / volume) : 0;
    const double of_one = volume * squared_masses / (field.mass * field.mass);
    field.foundation = kFoundation * field.young * wave * wave * of_one;
  }
  if (!limited) limits.clear();
  return fields;
}

void makeFibres(const formats::PackageView& package, std::span<Field> fields, Array<FibreStiffness>& fibres,
                Array<float>& matrices) {
  const auto records = package.fieldFibres();
  // Records go by field, then by cluster.
  const auto isNext = [&](std::size_t i) {
    return i == 0 || records[i].field != records[i - 1].field || records[i].cluster != records[i - 1].cluster;
  };
  std::size_t count = 0, entries = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const std::size_t k = fields[records[i].field].k;
    if (isNext(i)) ++count, entries += k * (k + 1) / 2 + 4 * k;
  }
  fibres.resize(count);
  matrices.resize(entries);
  std::fill(matrices.begin(), matrices.end(), 0.0F);
  float* next = matrices.data();
  std::size_t of = 0;
  for (std::size_t i = 0; i < records.size(); ++i) {
    const formats::FieldFibre& record = records[i];
    Field& field = fields[record.field];
    const std::size_t k = field.k;
    if (isNext(i)) {
      fibres[of] = {record.cluster, next + 4 * k, next, 0};
      const std::size_t first = field.fibres.empty() ? of : std::size_t(field.fibres.data() - fibres.data());
      field.fibres = {fibres.data() + first, ++of - first};
      next += k * (k + 1) / 2 + 4 * k;
    }
    const auto values = package.fieldFibreValues().subspan(record.first_value, k);
    Vector3d along = Vector3d::Zero();  // at rest
    for (std::size_t j = 0; j < k; ++j) {
      for (int axis = 0; axis < 3; ++axis) {
        along[axis] += double(values[j]) * double(field.functions[j].rest[std::size_t(axis)]);
      }
    }
    fibres[of - 1].energy += 0.5 * double(record.tension) * along.squaredNorm();
    float* entry = next - k * (k + 1) / 2 - 4 * k;
    for (std::size_t j = 0; j < k; ++j, entry += 4) {
      for (int axis = 0; axis < 3; ++axis) entry[axis] += float(double(record.tension * values[j]) * along[axis]);
    }
    for (std::size_t row = 0; row < k; ++row) {
      const float pull = record.tension * values[row];
      for (std::size_t column = 0; column <= row; ++column) *entry++ += pull * values[column];
    }
  }
}

const Field* fieldOf(std::span<const Field> fields, std::uint32_t piece, bool held, std::uint32_t level) {
  for (const Field& field : fields) {
    if (field.piece == piece && field.held == held && field.level == level) return &field;
  }
  return nullptr;
}

}  // namespace sinew::internal
