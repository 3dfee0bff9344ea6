// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/clusters/mechanics.h"
#include "runtime/kernels/layout.h"
#include "runtime/memory/array.h"
#include "runtime/solver/field.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

/// One membership as seen from its vertex.
struct ClusterUse {
  std::uint32_t cluster;
  float share;  ///< w_ic / W_i
};

/// Rest-shape constants of one cluster, beside its CLUS record.
struct ClusterRest {
  Monomials<9> mean =
      Monomials<9>::Zero();  ///< Σ mu q~ as floats evaluate it: subtracting it keeps goals centred to rounding
  Columns<9> moment = Columns<9>::Zero();  ///< M = Σ mu q q~^T, what A_pq is at rest; columns 3.. only if quadratic
  /// How much smaller than its body part the cluster is (ratio of radii of gyration), 1 or more. Frequencies are
  /// authored for the part: cut from the same stuff, a piece of 1/n of the size rings n times as high.
  float frequency_ratio = 1;
  Matrix3 inertia_inverse = Matrix3::Zero();  ///< (tr(M) 1 - M)^-1 of the rest shape, floored for straight clusters
};

/// What the step wants of a package and the package does not hold in that form. One per Asset, shared by its bodies.
struct RestConstants {
  Array<ClusterRest> clusters;
  Array<std::uint32_t> first_use;  ///< vertex -> uses, vertex count + 1 entries
  Array<ClusterUse> uses;          ///< by vertex, clusters ascending
  Array<Square<9>> full_moments;   ///< Σ mu q~ q~^T by the cluster's `quadratic` index

  /// Clusters that share a vertex, each with the next one that the vertex has: lower index first, ascending.
  Array<std::array<std::uint32_t, 2>> overlaps;

  Array<double> driven_masses;   ///< Field::driven_mass
  Array<float> field_stiffness;  ///< Field::stiffness
  Array<Field> fields;           ///< in which pieces move; empty: clusters are matched

  MechanicsConstants mechanics;
  // The same for kernels.
  Array<float> masses;               ///< by vertex, relative to the mass of all
  Array<MemberBlock> members;        ///< cluster by cluster
  Array<ClusterRestBlock> blocks;    ///< eight clusters each
  Array<UseBlock> use_blocks;        ///< eight vertices each, part by part
  Array<std::uint32_t> use_offsets;  ///< rows of the use blocks

  std::span<const ClusterUse> usesOf(std::uint32_t vertex) const {
    return {uses.data() + first_use[vertex], uses.data() + first_use[vertex + 1]};
  }
};

/// One pass over the memberships, sums in double.
RestConstants makeRestConstants(const formats::PackageView& package);

}  // namespace sinew::internal
