// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "tools/core/finding.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

struct CheckOptions {
  /// Parts closer than this share a piece; of the diagonal, 0..1. The bake's own value (tetrahedra.join).
  double join_distance = 1e-3;
  /// Stop looking for faces that cross each other after so many pairs.
  std::size_t self_intersection_limit = 100'000;
};

/// The doctor for all that is drawn of a source: what import found, then faces without area or that lie double,
/// non-manifold and flipped edges. Places are numbers of the source, from 0.
/// \param topology of this mesh.
std::vector<Finding> checkFaces(const VisualMesh& mesh, const Topology& topology);

/// The doctor for what a bake fills: faces that cross, holes, parts that enclose nothing, nearly touch or are thin.
/// Severity error marks what makes a bake impossible; warnings what a bake works around or an artist did not mean.
/// \param host the mesh without the parts that ride along (withoutParts()). \param topology of the host.
/// Cost: about 3 s for 400,000 triangles on two threads. The same for any number of threads.
std::vector<Finding> checkFilling(const VisualMesh& host, const Topology& topology, const CheckOptions& options = {});

/// Both, of a source without parts that ride along.
std::vector<Finding> checkSource(const VisualMesh& mesh, const Topology& topology, const CheckOptions& options = {});

/// Appends those that are not among them.
void appendNew(std::vector<Finding>& findings, const std::vector<Finding>& more);

/// One line: "2 warnings: it can be baked".
std::string sourceVerdict(const std::vector<Finding>& findings);

/// Whether any finding is an error.
bool hasErrors(const std::vector<Finding>& findings);

/// "2 errors, 1 warning"; "no findings" where there is neither.
std::string countedSeverities(const std::vector<Finding>& findings);

}  // namespace sinew::tools
