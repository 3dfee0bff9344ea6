// SPDX-License-Identifier: GPL-3.0-or-later
//
// The stages of a bake as values, imported -> solid -> placed -> clustered -> content: each reads those before it and
// changes none of them. bake.cpp has them in order; the report reads them.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "sinew/formats/writer.h"
#include "tools/attach/attach.h"
#include "tools/author/recipe.h"
#include "tools/bake/bake.h"
#include "tools/bake/parts.h"

namespace sinew::tools {

/// Solid to fill with tetrahedra, about the package's origin and on the floats that the package holds: all that
/// follows is computed from what the runtime will see.
struct Solid {
  ImportedSource source;
  VisualMesh host;                ///< the source's mesh without the parts that ride along
  Topology topology;              ///< of the host
  StageKey key = {};              ///< of all that the tetrahedra depend on
  PhysicalMesh physical;          ///< of the host
  Eigen::Vector3d origin;         ///< of the package, in the source
  std::vector<Finding> findings;  ///< of all stages so far, as those below
};

/// Where what is drawn hangs, on tetrahedra that are numbered as the package numbers them.
struct Placed {
  PhysicalMesh physical;                 ///< with the rigid parts' own behind each piece's
  std::vector<TetrahedronPlace> places;  ///< per visual vertex
  std::vector<Rider> riders;
};

/// Its clusters. \warning refers to the stages before.
struct Clustered {
  WeightTransfer transfer;
  std::vector<ClusterSource> clusters;  ///< by piece, those of its parts behind its own
  std::vector<Finding> findings;
};

struct Content {
  formats::PackageContent package;
  std::vector<Finding> findings;
  double mass = 0;        ///< kg
  double rest_error = 0;  ///< largest distance of a visual vertex from its place, metres
};

/// Throws ToolError(bad_input) where the body is too light or heavy to compute with, or a visual vertex would not hang
/// in its place.
Content contentOf(const Recipe& recipe, const Solid& solid, const Placed& placed, const Clustered& clustered,
                  Progress& progress);

/// Where visual vertex v of a package hangs at rest.
HungPlace hungAt(const formats::PackageContent& content, std::size_t v);

/// The settings as package and report state them.
nlohmann::ordered_json statedSettings(const Settings& settings, const VisualMesh& mesh);

/// Report of the stages. \param fields what addFields() returned.
nlohmann::ordered_json reportOf(const Settings& settings, const Solid& solid, const Placed& placed,
                                const Content& content, const nlohmann::ordered_json& fields,
                                std::size_t package_bytes);

}  // namespace sinew::tools
