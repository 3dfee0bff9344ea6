// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/contact/depth_map.h"
#include "runtime/memory/array.h"
#include "runtime/solver/field.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// Rest-shape constants of one cluster, beside its CLUS record.
struct ClusterRest {
  Monomials<9> mean = Monomials<9>::Zero();  ///< Σ mu q~ as floats evaluate it; columns 3.. only if quadratic
  Columns<9> moment = Columns<9>::Zero();    ///< M = Σ mu q q~^T, A_pq at rest; columns 3.. only if quadratic
};

/// Constants of a world's steps that a package does not hold in this form. One per Asset, shared by its bodies.
struct RestConstants {
  Array<double> driven_masses;       ///< Field::driven_mass
  Array<float> field_stiffness;      ///< Field::stiffness
  Array<SampleLimits> field_limits;  ///< Field::limits
  Array<FibreStiffness> fibres;      ///< Field::fibres
  Array<float> fibre_matrices;       ///< FibreStiffness::matrix
  Array<Field> fields;               ///< in which pieces move
  OwningArray<DepthMap> depths;      ///< of the pieces that have one, in their order

  /// Those of a piece, or null.
  const DepthMap* depthsOf(std::uint32_t piece) const {
    const auto has = [piece](const DepthMap& map) { return map.piece() == piece; };
    const auto* const found = std::find_if(depths.begin(), depths.end(), has);
    return found != depths.end() ? found : nullptr;
  }
};

RestConstants makeRestConstants(const formats::PackageView& package);

/// One pass over the memberships, sums in double.
Array<ClusterRest> makeClusterConstants(const formats::PackageView& package);

/// A_qq as the package has it, n x n in the upper left corner: n = 3, or 9 of a quadratic cluster.
inline Square<9> momentInverse(const formats::PackageView& package, const formats::Cluster& cluster) {
  Square<9> result = Square<9>::Zero();
  if (cluster.mode == formats::ClusterMode::quadratic) {
    const auto& packed = package.quadraticMoments()[cluster.quadratic].a_qq;
    for (int row = 0, n = 0; row < 9; ++row) {
      for (int column = 0; column <= row; ++column, ++n) {
        result(row, column) = result(column, row) = packed[std::size_t(n)];
      }
    }
    return result;
  }
  const auto& a = cluster.a_qq;
  result.topLeftCorner<3, 3>() << a[0], a[3], a[5], a[3], a[1], a[4], a[5], a[4], a[2];
  return result;
}

}  // namespace sinew::internal
