// SPDX-License-Identifier: GPL-3.0-or-later
//
// Inside of selection.cpp: the kinds of selections that look at the source, each a function of it and of its object in
// the recipe.
#pragma once

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/author/json_text.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/selection.h"

namespace sinew::tools {

/// A kind, its object, the value of its first key, and where both stand.
struct SelectionPlace {
  const RecipeObject& kind;
  const nlohmann::ordered_json& json;
  const nlohmann::ordered_json& value;
  std::string pointer;
  std::string value_pointer;

  nlohmann::ordered_json get(std::string_view key) const { return recipeValue(kind, json, key); }
  double number(std::string_view key) const { return get(key).get<double>(); }
  std::string text(std::string_view key) const { return get(key).get<std::string>(); }
};

/// Inputs of selections' evaluation.
struct SelectionSource {
  const Recipe& recipe;
  const VisualMesh& mesh;
  const Topology& topology;
  const std::vector<ClusterMesh>& cluster_meshes;
  std::vector<Finding>& findings;
  Surface surface;
  /// Evaluates another selection, which stands at a pointer.
  std::function<std::vector<double>(const nlohmann::ordered_json&, const std::string&)> other = {};

  std::size_t count() const { return mesh.positions.size(); }
  [[noreturn]] void fail(const std::string& pointer, const std::string& what, const std::string& cure) const {
    recipe.text->fail(pointer, what, cure);
  }
  void requireFile(const std::filesystem::path& file, const std::string& pointer) const;

  /// Weight of each welded point: the largest of its visual vertices', so that both sides of a seam agree.
  std::vector<double> onPoints(const VisualWeights& weights) const;
  VisualWeights onVertices(const std::vector<double>& points) const;
  VisualWeights joined(const VisualWeights& weights) const { return onVertices(onPoints(weights)); }

  /// Numbers, ascending, of the names that the text, or list of texts, of a place means. Fails where one means none.
  /// \param what a name is one of
  std::vector<std::size_t> matching(const SelectionPlace& place, const std::vector<std::string>& names,
                                    const std::string& what) const;
};

using SelectionMethod = VisualWeights (*)(const SelectionSource& source, const SelectionPlace& place);
/// By the names that the source has: groups, materials, objects, parts, bones, morph targets, colours, attributes,
/// values, stored masks, cluster meshes.
const std::map<std::string_view, SelectionMethod>& namedSelections();
/// By where it lies: shapes in space, discs and strokes on the surface, pictures in UV space.
const std::map<std::string_view, SelectionMethod>& placedSelections();

/// \param pointer of what names it
VisualWeights clusterMeshWeights(const SelectionSource& source, const std::string& name,
                                 std::optional<double> tolerance, const std::string& pointer);

}  // namespace sinew::tools
