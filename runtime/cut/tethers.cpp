// SPDX-License-Identifier: MIT
#include "runtime/cut/tethers.h"

#include <cmath>
#include <numbers>

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Difference of sums that are the same, of their size: masses and values are floats.
constexpr double kSame = 1e-3;

struct Tether {
  std::uint32_t vertex = 0, set = 0;  // of the package
  double per_mass = 0;                // 1/s^2
};

std::vector<Tether> findTethers(const FieldInput& input, const ParentField& parent) {
  std::vector<Tether> tethers;
  const formats::PackageView& package = input.package;
  if (package.pinWeights().empty()) return tethers;
  std::vector<char> drives(package.pinSets().size(), 0), taken(package.physicalVertices().size(), 0);
  for (Index j = 0; j < Index(parent.field().driven_count); ++j) drives[parent.function(j).pin_set] = 1;
  const formats::PieceRange& range = package.pieces()[parent.field().piece];
  for (std::uint32_t s = 0; s < drives.size(); ++s) {
    const formats::PinSet& set = package.pinSets()[s];
    for (const std::uint32_t v : package.pinSetVertices().subspan(set.first, set.count)) {
      const double weight = double(package.pinWeights()[v]);
      if (v - range.first_vertex >= range.vertex_count || taken[v] != 0 || !(weight > 0)) continue;
      taken[v] = 1;  // the first set has it
      if (weight >= 1 || drives[s] == 0) continue;
      const double omega = 2 * std::numbers::pi * formats::kPinHz * weight / (1 - weight);
      tethers.push_back({v, s, omega * omega});
    }
  }
  return tethers;
}

/// How far each function takes a vertex from where its set has it.
void addTether(double strength, VectorXd offsets, std::uint32_t set, const Vector3d& rest,
               const std::vector<formats::FieldFunction>& driven, MatrixXd& sum) {
  for (std::size_t d = 0; d < driven.size(); ++d) {
    if (driven[d].pin_set != set) continue;
    offsets[Index(d)] -= driven[d].monomial == 0 ? 1 : rest[Index(driven[d].monomial) - 1];
  }
  sum.selfadjointView<Eigen::Lower>().rankUpdate(offsets, strength);
}

}  // namespace

std::optional<MatrixXd> partTethers(const FieldInput& input, std::uint32_t field, const ParentField& parent,
                                    const PartFunctions& functions, const MatrixXd& parent_values,
                                    const std::vector<std::uint32_t>& local) {
  const formats::PackageView& package = input.package;
  const formats::FieldTethers* stored = nullptr;
  for (const formats::FieldTethers& one : package.fieldTethers()) stored = one.field == field ? &one : stored;
  if (stored == nullptr) return MatrixXd();

  const Index k = parent.own();
  std::vector<formats::FieldFunction> driven;
  for (Index j = 0; j < Index(parent.field().driven_count); ++j) driven.push_back(parent.function(j));
  MatrixXd whole = MatrixXd::Zero(k, k), part = MatrixXd::Zero(functions.count(), functions.count());
  bool some = false;
  for (const Tether& tether : findTethers(input, parent)) {
    const formats::PhysicalVertex& vertex = package.physicalVertices()[tether.vertex];
    const Vector3d rest = asVector(vertex.rest_position);
    VectorXd values(k);
    for (Index j = 0; j < k; ++j) values[j] = parent.valueAt(tether.vertex, j);
    addTether(tether.per_mass * double(vertex.mass), values, tether.set, rest, driven, whole);
    if (!input.isOwn(tether.vertex) || input.pin_sets[tether.set] == formats::kNone) continue;
    const std::uint32_t row = local[tether.vertex];
    const double mass = double(input.mesh.masses[std::size_t(input.piece.first) + row]);
    addTether(tether.per_mass * mass, functions.valuesFrom(rest.transpose(), parent_values.row(row)).transpose(),
              input.pin_sets[tether.set], rest, functions.driver, part);
    some = true;
  }
  double difference = 0, size = 0;
  for (Index i = 0; i < k; ++i) {
    for (Index j = 0; j <= i; ++j) {
      const std::size_t at = std::size_t(stored->first_value) + std::size_t(i * k + j);
      const double value = double(package.fieldTetherValues()[at]);
      difference += (value - whole(i, j)) * (value - whole(i, j));
      size += value * value;
    }
  }
  if (difference > kSame * kSame * size) return std::nullopt;
  return some ? MatrixXd(part.selfadjointView<Eigen::Lower>()) : MatrixXd();
}

}  // namespace sinew::cutting
