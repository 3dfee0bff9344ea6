// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/author/cluster_mesh.h"
#include "tools/author/recipe.h"
#include "tools/author/surface.h"
#include "tools/core/finding.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Weights 0..1, one per visual vertex.
using VisualWeights = std::vector<double>;

/// Evaluates the selections of a recipe on its source (docs/recipe-format.md). Masks are evaluated once. All arguments
/// must outlive it; what is worth knowing goes to `findings`.
class Selections {
 public:
  Selections(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
             const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings);
  ~Selections();
  Selections(const Selections&) = delete;
  Selections& operator=(const Selections&) = delete;

  /// Weights of a selection. Throws ToolError(bad_input) with line and cure where the source lacks what it names, a
  /// file of it is wrong, or it selects nothing.
  VisualWeights evaluate(const SelectionText& selection);
  /// The same, but may select nothing.
  VisualWeights weights(const SelectionText& selection);
  /// Weights of all clusters of the recipe, in order. Users of `rest` are evaluated last.
  std::vector<VisualWeights> clusters();
  /// Makes `name` a mask of these weights, before the recipe's of that name.
  void define(const std::string& name, VisualWeights weights);
  const Surface& surface() const;

 private:
  class Evaluator;
  std::unique_ptr<Evaluator> evaluator_;
};

/// The recipe's clusters, and after them one for each cluster mesh of the source that the recipe does not name.
std::vector<RecipeCluster> withClusterMeshes(const Recipe& recipe, const std::vector<ClusterMesh>& cluster_meshes);

/// Whether a selection takes "the rest", itself or through masks: then it depends on the other clusters.
bool usesRest(const Recipe& recipe, const nlohmann::ordered_json& selection);

/// Whether `name` matches a pattern in which * stands for any letters.
bool matchesPattern(std::string_view name, std::string_view pattern);

}  // namespace sinew::tools
