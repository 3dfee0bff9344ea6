// SPDX-License-Identifier: GPL-3.0-or-later
//
// Authored content on its way into a package.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "sinew/formats/writer.h"
#include "tools/attach/attach.h"
#include "tools/author/recipe.h"
#include "tools/author/selection.h"
#include "tools/author/weights.h"

namespace sinew::tools {

/// A recipe's selections, evaluated on its source.
struct AuthoredWeights {
  std::vector<RecipeCluster> clusters;  ///< with the source's cluster meshes
  std::vector<VisualWeights> cluster_weights;
  std::vector<VisualWeights> origins, insertions;   ///< per cluster; empty where it has none
  std::vector<VisualWeights> pins;                  ///< per pin set of the recipe
  std::vector<VisualWeights> stiffness, thickness;  ///< per entry of the recipe
  std::vector<VisualWeights> colors;                ///< per entry of the recipe
  std::vector<VisualWeights> parts, part_hosts;     ///< per part of the recipe; hosts empty where the recipe has none
  std::vector<VisualWeights> masks;                 ///< per mask of the recipe
  std::vector<std::uint8_t> rides;                  ///< per visual vertex: whether it is of a part; empty without parts
};

/// Evaluates every selection of a recipe. Throws ToolError(bad_input) for a wrong one, see Selections::evaluate().
AuthoredWeights evaluateRecipe(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
                               const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings);

/// Vertices that pins select and will not move, by the visual ones (author/pins.h). The bake judges the physical
/// ones.
std::vector<Finding> judgePins(const Recipe& recipe, const AuthoredWeights& authored);

/// An edit's additions, evaluated on the source: throws ToolError(bad_input) where a new or changed selection selects
/// nothing or cannot be, or where one of a cluster or of pins selects accessories alone. \return findings, and what of
/// its pins will not move.
std::vector<Finding> checkNewSelections(const Recipe& before, const Recipe& after, const VisualMesh& mesh,
                                        const Topology& topology, const std::vector<ClusterMesh>& cluster_meshes);

/// Linear RGBA 0..1 as bytes 0..255, as the package keeps colours.
std::vector<formats::Color8> packedColors(std::span<const std::array<float, 4>> colors);

/// Factor of `thickness` on a shell at each point of the welded surface; empty where the recipe has none.
std::vector<double> shellFactors(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh);

/// Adds the activation channels of authored clusters (sections CHAN and CMEC), the softness of vertices (PSTF), the pin
/// sets (PPIN, PSET, PSTV), the masks by name (MASK, MSKV), and colours painted over the source's.
/// \param sources the clusters of content.clusters.
void addAuthored(const Recipe& recipe, const AuthoredWeights& authored, const WeightTransfer& transfer,
                 const std::vector<ClusterSource>& sources, const VisualMesh& mesh, formats::PackageContent& content,
                 std::vector<Finding>& findings);

}  // namespace sinew::tools
