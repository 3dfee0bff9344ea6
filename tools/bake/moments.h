// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <vector>

#include "sinew/formats/sections.h"
#include "tools/author/clusters.h"
#include "tools/core/finding.h"

namespace sinew::tools {

/// The constants of all clusters, as the package holds them.
struct ClusterConstants {
  std::vector<formats::Cluster> clusters;  ///< names are left empty
  std::vector<formats::Membership> memberships;
  std::vector<formats::QuadraticMoment> quadratic_moments;
};

/// Rest-shape moments and their pseudo-inverses (docs/report.md §1), in double from the package's own float positions.
/// A cluster whose vertices lie in a plane or on a line is made rigid, one that cannot carry any quadratic term linear;
/// findings say which.
/// \param options of clusters that have none of their own.
ClusterConstants clusterConstants(std::span<const ClusterSource> sources,
                                  std::span<const formats::PhysicalVertex> vertices, const ClusterOptions& options,
                                  std::vector<Finding>& findings);

}  // namespace sinew::tools
