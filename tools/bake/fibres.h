// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "sinew/formats/writer.h"
#include "tools/bake/field_host.h"
#include "tools/field/field.h"

namespace sinew::tools {

/// A cell of an activated cluster: its tension shortens it.
struct Fibre {
  std::uint32_t cluster = 0;
  std::size_t load = 0;     ///< its cluster's
  Eigen::VectorXd stretch;  ///< sum over vertices of stretch x: the mean deformation gradient along the fibre
  std::vector<std::pair<std::size_t, double>> parts;  ///< tetrahedra of the host, and what of their volume it has, m^3
  double volume = 0, share = 0;                       ///< m^3 of the cluster, and of all that it has
  double contraction = 0;                             ///< of the cluster at full activation
  double hardening = 0;                               ///< what it takes more than in proportion
  double tension = 0;                                 ///< J, that shortens it by so much alone
};

/// Fibres of the activated clusters of a piece, and by cluster the force of a unit of tension.
struct Fibres {
  std::vector<Fibre> fibres;
  std::vector<Eigen::VectorXd> loads;  ///< 3 by vertex of the host, N
  std::vector<double> reaches;         ///< of each load: the contraction
};

/// \param young, poisson of the host's tetrahedra.
Fibres findFibres(const formats::PackageContent& content, const FieldHost& host, std::span<const double> young,
                  std::span<const double> poisson);

/// Records them for a field (sections FFIB, FFBV).
void addFibres(std::span<const Fibre> fibres, const FieldSpace& space, std::uint32_t field,
               formats::PackageContent& content);

}  // namespace sinew::tools
