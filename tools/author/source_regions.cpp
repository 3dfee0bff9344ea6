// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/source_regions.h"

#include <algorithm>

#include "tools/author/selection.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

struct Named {
  std::string name;
  Json value;  // of the selection's first key
};

void addName(std::vector<Named>& to, const std::string& name) {
  const auto same = [&](const Named& other) { return other.name == name; };
  if (!name.empty() && std::none_of(to.begin(), to.end(), same)) to.push_back({name, name});
}

std::vector<Named> namedBySource(const std::string& kind, const VisualMesh& mesh, const Topology& topology) {
  std::vector<Named> named;
  if (kind == "bone") {
    for (const std::string& joint : mesh.joints) addName(named, joint);
  } else if (kind == "group") {
    for (const GroupSource& group : mesh.groups) addName(named, group.name);
  } else if (kind == "material") {
    for (const MaterialSource& material : mesh.materials) addName(named, material.name);
  } else if (kind == "object") {
    for (const SubMeshSource& sub : mesh.sub_meshes) addName(named, sub.node.empty() ? sub.mesh : sub.node);
  } else if (kind == "part") {
    for (std::size_t part = 0; part < topology.parts.size(); ++part) {
      named.push_back({"part." + std::to_string(part), part});
    }
  } else if (kind == "morph") {
    for (const MorphTargetSource& morph : mesh.morphs) addName(named, morph.name);
  }
  return named;
}

}  // namespace

const std::vector<std::string>& sourceRegionKinds() {
  static const std::vector<std::string> kinds = {"bone", "group", "material", "object", "part", "morph"};
  return kinds;
}

std::vector<SourceRegion> sourceRegions(const std::string& kind, const std::vector<std::string>& patterns,
                                        const Json& options, const VisualMesh& mesh, const Topology& topology) {
  const std::vector<Named> all = namedBySource(kind, mesh, topology);
  if (all.empty()) {
    throw ToolError(ExitCode::usage, mesh.file, "it has no " + (kind == "morph" ? "morph target" : kind) + "s",
                    "sinew inspect shows what it has; further selections: sinew help recipe.");
  }
  const auto wanted = [&](const std::string& name) {
    return patterns.empty() || std::any_of(patterns.begin(), patterns.end(),
                                           [&](const std::string& pattern) { return matchesPattern(name, pattern); });
  };
  std::vector<std::string> names;
  for (const Named& named : all) names.push_back(named.name);
  for (const std::string& pattern : patterns) {
    if (std::none_of(names.begin(), names.end(), [&](const auto& name) { return matchesPattern(name, pattern); })) {
      std::string missing = "it has no ";
      missing.append(kind).append(" '").append(pattern).append("'");
      throw ToolError(ExitCode::usage, mesh.file, missing, "Did you mean " + nearestName(pattern, names) + "?");
    }
  }
  std::vector<SourceRegion> regions;
  for (const Named& named : all) {
    if (!wanted(named.name)) continue;
    SourceRegion region{named.name, Json::object({{kind, named.value}}), 0};
    if (options.is_object()) region.selection.update(options);
    regions.push_back(std::move(region));
  }
  return regions;
}

void countVertices(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
                   std::vector<SourceRegion>& regions) {
  const std::vector<ClusterMesh> cluster_meshes;
  std::vector<Finding> findings;  // told again when the regions are part of the recipe
  Selections selections(recipe, mesh, topology, cluster_meshes, findings);
  for (SourceRegion& region : regions) {
    const VisualWeights weights = selections.weights({region.selection, ""});
    region.visual_vertices = std::size_t(std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0; }));
  }
}

}  // namespace sinew::tools
