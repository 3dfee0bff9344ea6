// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/fibres.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/geometry/cells.h"
#include "runtime/geometry/tet_mesh.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

/// Tension of a fibre that what surrounds it holds, against what shortens it alone.
constexpr double kStrongest = 20;

/// Tension that holds a bar so much shorter, of what it would be in proportion: under Psi of docs/method.md, sides
/// free.
double hardening(double contraction, double poisson) {
  const double mu = 0.5 / (1 + poisson), lambda = poisson / ((1 + poisson) * (1 - 2 * poisson));
  const double along = 1 - contraction;
  // Sides are between the rest's and the volume-keeping ones.
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

/// A tetrahedron's bit of a cluster.
struct Bit {
  std::size_t tetrahedron = 0;
  double volume = 0;                  // times the cluster's share
  Vector3d at = Vector3d::Zero();     // its centre
  Vector3d slope = Vector3d::Zero();  // of its coordinates 1, 2, 3 along the fibre, times that volume
};

std::vector<Bit> bitsOf(const FieldHost& host, std::uint32_t cluster, const Vector3d& along) {
  const std::vector<double> shares = host.sharesOf(cluster);
  std::vector<Bit> bits;
  for (std::size_t t = 0; t < host.tetrahedra.size(); ++t) {
    double share = 0;
    for (const std::uint32_t v : host.tetrahedra[t]) share += shares[v] / 4;
    if (share == 0) continue;
    Bit bit;
    for (const std::uint32_t v : host.tetrahedra[t]) bit.at += host.positions[v] / 4;
    const Eigen::Matrix3d edges = host.edgesOf(t);
    const double six = std::abs(edges.determinant()), longest = edges.colwise().norm().maxCoeff();
    if (!(six > 6 * geometry::kFlat * longest * longest * longest)) continue;
    bit.tetrahedron = t;
    bit.volume = share * six / 6;
    bit.slope = edges.inverse() * along * bit.volume;
    bits.push_back(bit);
  }
  return bits;
}

}  // namespace

Fibres findFibres(const formats::PackageContent& content, const FieldHost& host, std::span<const double> young,
                  std::span<const double> poisson) {
  const formats::PieceRange& range = host.range;
  Fibres result;
  for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
    if (content.mechanics.empty() || content.mechanics[c].channel == formats::kNone) continue;
    const formats::ClusterMechanics& mechanics = content.mechanics[c];
    const Vector3d along(double(mechanics.fibre[0]), double(mechanics.fibre[1]), double(mechanics.fibre[2]));
    const std::vector<Bit> bits = bitsOf(host, c, along);
    if (bits.empty()) continue;
    Eigen::VectorXd load = Eigen::VectorXd::Zero(3 * Eigen::Index(host.positions.size()));
    double volume = 0;
    for (const Bit& bit : bits) volume += bit.volume;
    std::vector<Vector3d> places;
    std::vector<double> volumes;
    for (const Bit& bit : bits) places.push_back(bit.at), volumes.push_back(bit.volume);
    const std::vector<std::uint32_t> cells = geometry::cellsOf(places, volumes, geometry::kFibreCells);
    std::vector<Fibre> fibres(1 + *std::max_element(cells.begin(), cells.end()));
    for (std::size_t b = 0; b < bits.size(); ++b) {
      const Bit& bit = bits[b];
      Fibre& fibre = fibres[cells[b]];
      if (fibre.stretch.size() == 0) fibre.stretch = Eigen::VectorXd::Zero(Eigen::Index(host.positions.size()));
      const auto& corners = host.tetrahedra[bit.tetrahedron];
      const auto add = [&](std::uint32_t v, double slope) {
        fibre.stretch[v] += slope;
        load.segment<3>(3 * Eigen::Index(v)) += slope / volume * along;
      };
      for (int k = 0; k < 3; ++k) add(corners[std::size_t(k) + 1], bit.slope[k]);
      add(corners[0], -bit.slope.sum());
      fibre.parts.emplace_back(bit.tetrahedron, bit.volume);
      fibre.volume += bit.volume;
      fibre.tension += double(mechanics.contraction) * young[bit.tetrahedron] * bit.volume;
      fibre.hardening += bit.volume * hardening(double(mechanics.contraction), poisson[bit.tetrahedron]);
    }
    for (Fibre& fibre : fibres) {
      fibre.cluster = c;
      fibre.load = result.loads.size();
      fibre.share = fibre.volume / volume;
      fibre.contraction = double(mechanics.contraction);
      fibre.hardening /= fibre.volume;
      fibre.stretch /= fibre.volume;
      result.fibres.push_back(std::move(fibre));
    }
    result.loads.push_back(std::move(load));
    result.reaches.push_back(double(mechanics.contraction));
  }
  return result;
}

void addFibres(std::span<const Fibre> fibres, const FieldSpace& space, std::uint32_t field,
               formats::PackageContent& content) {
  for (const Fibre& fibre : fibres) {
    const Eigen::VectorXd values = space.values.transpose() * fibre.stretch;
    // Tension to shorten the fibre so much where it lies: its surroundings stretch along.
    const double alone = space.young_scale * fibre.tension;
    const double answer = space.compliance.size() > 0 ? space.compliance[Eigen::Index(fibre.load)] : 0;
    const double embedded = answer > 0 ? std::min(fibre.share * fibre.contraction / answer, kStrongest * alone) : alone;
    const double tension = embedded + (fibre.hardening - 1) * alone;
    content.field_fibres.push_back(
        {field, fibre.cluster, std::uint32_t(content.field_fibre_values.size()), float(tension)});
    for (const double value : values) content.field_fibre_values.push_back(float(value));
  }
}

}  // namespace sinew::tools
