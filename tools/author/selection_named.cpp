// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "tools/author/selection_kinds.h"
#include "tools/author/stored_masks.h"
#include "tools/author/surface.h"
#include "tools/core/command_line.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;
using Place = SelectionPlace;

// So many names of what there is does a message list.
constexpr std::size_t kNamed = 12;

VisualWeights group(const SelectionSource& source, const Place& place) {
  std::vector<std::string> names;
  for (const GroupSource& g : source.mesh.groups) names.push_back(g.name);
  VisualWeights weights(source.count(), 0);
  for (const std::size_t g : source.matching(place, names, "group")) {
    for (const std::uint32_t v : source.mesh.groups[g].vertices) weights[v] = 1;
  }
  return source.joined(weights);
}

void takeSubMesh(const SelectionSource& source, const SubMeshSource& sub, VisualWeights& weights) {
  for (std::uint32_t t = sub.first_triangle; t < sub.first_triangle + sub.triangle_count; ++t) {
    for (const std::uint32_t v : source.mesh.triangles[t]) weights[v] = 1;
  }
}

VisualWeights subMeshes(const SelectionSource& source, const Place& place) {
  VisualWeights weights(source.count(), 0);
  std::vector<std::string> names;
  if (place.kind.name == "material") {
    for (const MaterialSource& m : source.mesh.materials) names.push_back(m.name);
    const auto found = source.matching(place, names, "material");
    for (const SubMeshSource& sub : source.mesh.sub_meshes) {
      if (std::binary_search(found.begin(), found.end(), std::size_t(sub.material))) takeSubMesh(source, sub, weights);
    }
  } else {
    // Every sub-mesh has two names.
    for (const SubMeshSource& sub : source.mesh.sub_meshes) {
      names.push_back(sub.node);
      names.push_back(sub.mesh);
    }
    for (const std::size_t n : source.matching(place, names, "object"))
      takeSubMesh(source, source.mesh.sub_meshes[n / 2], weights);
  }
  return source.joined(weights);
}

VisualWeights part(const SelectionSource& source, const Place& place) {
  std::uint32_t number = 0;
  if (place.value.is_array()) {
    double nearest = kInfinity;
    for (std::uint32_t t = 0; t < source.mesh.triangles.size(); ++t) {
      if (source.topology.part_of_triangle[t] == formats::kNone) continue;
      const Triangle c = source.mesh.weldedTriangle(t);
      const auto& x = source.mesh.welded_positions;
      const Vector3d p = pointOf(place.value);
      const double d = (geometry::closestPointOnTriangle(p, x[c[0]], x[c[1]], x[c[2]]) - p).squaredNorm();
      if (d < nearest) {
        nearest = d;
        number = source.topology.part_of_triangle[t];
      }
    }
  } else {
    const double wanted = place.value.get<double>();
    if (wanted >= double(source.topology.parts.size())) {
      source.fail(
          place.value_pointer, "there is no part " + place.value.dump(),
          "The source has " + std::to_string(source.topology.parts.size()) + ", from 0; a point [x, y, z] is safer.");
    }
    number = std::uint32_t(wanted);
  }
  VisualWeights weights(source.count(), 0);
  for (std::size_t t = 0; t < source.mesh.triangles.size(); ++t) {
    if (source.topology.part_of_triangle[t] != number) continue;
    for (const std::uint32_t v : source.mesh.triangles[t]) weights[v] = 1;
  }
  return source.joined(weights);
}

// Skins of several skeletons may have bones of one name, which a selection cannot tell apart.
void sayOneName(const SelectionSource& source, const Place& place, const std::set<std::uint32_t>& joints) {
  std::map<std::string, std::size_t> bones;
  for (const std::uint32_t j : joints) ++bones[source.mesh.joints[j]];
  for (const auto& [name, count] : bones) {
    if (count == 1) continue;
    source.findings.push_back({"bones-of-one-name",
                               Severity::warning,
                               std::to_string(count) + " bones are named '" + name + "': all are taken as one",
                               count,
                               "",
                               {},
                               place.pointer,
                               "Rename them in the program that made the file, or take one object's: " +
                                   Json({{"and", {{{"bone", name}}, {{"object", "NAME"}}}}}).dump() + "."});
  }
}

VisualWeights bone(const SelectionSource& source, const Place& place) {
  std::set<std::uint32_t> joints;
  for (const std::size_t j : source.matching(place, source.mesh.joints, "bone")) joints.insert(std::uint32_t(j));
  sayOneName(source, place, joints);
  if (place.get("children").get<bool>()) {
    std::map<std::string, std::string> parent;
    for (const NodeSource& node : source.mesh.nodes) parent.emplace(node.name, node.parent);
    const std::set<std::uint32_t> roots = joints;
    for (std::uint32_t j = 0; j < source.mesh.joints.size(); ++j) {
      std::string name = source.mesh.joints[j];
      // As many steps as there are nodes, in case names make a circle.
      for (std::size_t step = 0; step < source.mesh.nodes.size() && !name.empty(); ++step) {
        const auto up = parent.find(name);
        if (up == parent.end()) break;
        name = up->second;
        if (std::any_of(roots.begin(), roots.end(), [&](std::uint32_t r) { return source.mesh.joints[r] == name; })) {
          joints.insert(j);
          break;
        }
      }
    }
  }
  const bool dominant = place.text("weights") == "dominant";
  VisualWeights weights(source.count(), 0);
  for (std::size_t v = 0; v < source.mesh.skin.size(); ++v) {
    double mine = 0;
    double strongest = -1;
    bool is_mine = false;
    for (const SkinInfluence& influence : source.mesh.skin[v]) {
      const bool of_these = joints.contains(influence.joint);
      if (of_these) mine += double(influence.weight);
      if (double(influence.weight) > strongest) {
        strongest = double(influence.weight);
        is_mine = of_these;
      }
    }
    weights[v] = dominant ? (is_mine ? 1 : 0) : std::clamp(mine, 0.0, 1.0);
  }
  return source.joined(weights);
}

VisualWeights morph(const SelectionSource& source, const Place& place) {
  std::vector<std::string> names;
  for (const MorphTargetSource& m : source.mesh.morphs) names.push_back(m.name);
  VisualWeights weights(source.count(), 0);
  const double threshold = place.number("threshold");
  for (const std::size_t m : source.matching(place, names, "morph target")) {
    const MorphTargetSource& target = source.mesh.morphs[m];
    float furthest = 0;
    for (const auto& d : target.displacements) furthest = std::max(furthest, d.norm());
    if (!(furthest > 0)) continue;
    for (std::size_t i = 0; i < target.vertices.size(); ++i) {
      const double part = double(target.displacements[i].norm() / furthest);
      weights[target.vertices[i]] =
          std::max(weights[target.vertices[i]], threshold > 0 ? (part > threshold ? 1.0 : 0.0) : part);
    }
  }
  return source.joined(weights);
}

const AttributeSource& attributeNamed(const SelectionSource& source, const std::string& name,
                                      const std::string& pointer) {
  std::vector<std::string> names;
  for (const AttributeSource& a : source.mesh.attributes) {
    if (a.name == name) return a;
    names.push_back(a.name);
  }
  source.fail(pointer, "the source has no attribute '" + name + "'",
              names.empty() ? "It has none; in Blender, export with attributes (names that begin with _)."
                            : "Did you mean " + nearestName(name, names) + "? It has: " + listed(names, kNamed) + ".");
}

VisualWeights color(const SelectionSource& source, const Place& place) {
  const std::string set = place.text("set");
  std::vector<std::array<float, 4>> further;
  const std::vector<std::array<float, 4>>* colors = &source.mesh.colors;
  if (set != "COLOR_0") {
    const AttributeSource& a = attributeNamed(source, set, childPointer(place.pointer, "set"));
    if (a.components < 3) {
      source.fail(childPointer(place.pointer, "set"), "attribute '" + set + "' is no colour",
                  "Use {\"attribute\": \"" + set + "\"}.");
    }
    for (std::size_t v = 0; v < source.count(); ++v) {
      const float* c = a.values.data() + v * a.components;
      further.push_back({c[0], c[1], c[2], a.components > 3 ? c[3] : 1});
    }
    colors = &further;
  }
  if (colors->empty()) {
    source.fail(place.value_pointer, "the source has no vertex colours",
                "Export it with colours (GLB, PLY or FBX keep them), or use another selection.");
  }
  VisualWeights weights(source.count(), 0);
  for (std::size_t v = 0; v < source.count(); ++v) {
    const std::array<float, 4>& c = (*colors)[v];
    if (place.value.is_string()) {
      const std::size_t channel = std::string_view("rgba").find(place.value.get<std::string>());
      weights[v] = std::clamp(double(c[channel]), 0.0, 1.0);
    } else {
      double squared = 0;
      for (std::size_t k = 0; k < place.value.size(); ++k) {
        squared += std::pow(double(c[k]) - place.value[k].get<double>(), 2);
      }
      weights[v] = std::sqrt(squared) <= place.number("tolerance") ? 1 : 0;
    }
  }
  return source.joined(weights);
}

VisualWeights attribute(const SelectionSource& source, const Place& place) {
  const AttributeSource& a = attributeNamed(source, place.value.get<std::string>(), place.value_pointer);
  const auto component = std::size_t(place.number("component"));
  if (component >= a.components) {
    source.fail(childPointer(place.pointer, "component"),
                "attribute '" + a.name + "' has " + std::to_string(a.components) + " components, not one numbered " +
                    std::to_string(component),
                "Count from 0.");
  }
  const double low = place.number("low");
  const double high = place.number("high");
  if (low == high) {
    source.fail(place.pointer, "low and high are the same", "Give the values that mean weight 0 and weight 1.");
  }
  VisualWeights weights(source.count(), 0);
  for (std::size_t v = 0; v < source.count(); ++v) {
    weights[v] = std::clamp((double(a.values[v * a.components + component]) - low) / (high - low), 0.0, 1.0);
  }
  return source.joined(weights);
}

VisualWeights values(const SelectionSource& source, const Place& place) {
  const auto file = source.recipe.file(place.value.get<std::string>(), place.value_pointer);
  source.requireFile(file, place.value_pointer);
  const JsonText text = JsonText::read(file.string());
  const Json& json = text.json();
  if (!json.is_array()) text.fail("", "must be a list of numbers", "Write [0, 0.5, 1, ...].");
  if (json.size() != source.mesh.source_vertex_count) {
    text.fail("",
              "has " + std::to_string(json.size()) + " values, but the source has " +
                  std::to_string(source.mesh.source_vertex_count) + " vertices",
              "Write one number for each vertex of the file, in its order; a mask of an older version of the source "
              "must be made again.");
  }
  for (std::size_t i = 0; i < json.size(); ++i) {
    if (!json[i].is_number() || json[i].get<double>() < 0 || json[i].get<double>() > 1)
      text.fail(childPointer("", i), "is no weight", "Give a number 0 .. 1.");
  }
  VisualWeights weights(source.count());
  for (std::size_t v = 0; v < source.count(); ++v) weights[v] = json[source.mesh.source_vertex[v]].get<double>();
  return source.joined(weights);
}

VisualWeights stored(const SelectionSource& source, const Place& place) {
  const auto file = source.recipe.file(place.value.get<std::string>(), place.value_pointer);
  source.requireFile(file, place.value_pointer);
  const std::string name = place.text("mask");
  std::vector<std::string> names;
  auto [found, mask] = readStoredMask(file, name, source.mesh, names);
  if (!found) {
    std::string what = file.filename().string();
    what.append(" has no mask '").append(name).append("'");
    source.fail(childPointer(place.pointer, "mask"), what,
                names.empty() ? "It has none." : "Did you mean " + nearestName(name, names) + "?");
  }
  if (mask.moved + mask.unknown > 0) {
    Finding finding;
    finding.id = "stored-mask-moved";
    finding.count = mask.moved + mask.unknown;
    finding.message = "mask " + name + " of " + file.filename().string() +
                      " was made on other points: " + std::to_string(mask.moved) + " take that of one nearby, " +
                      std::to_string(mask.unknown) + " have none";
    finding.place = place.pointer.substr(1);
    finding.cure = "The source changed: " +
                   commandLine({"sinew", "author", source.recipe.text->file(), "transfer", "NEW", "--old", "OLD"}) +
                   " carries the mask over.";
    source.findings.push_back(finding);
  }
  return std::move(mask.weights);
}

VisualWeights namedClusterMesh(const SelectionSource& source, const Place& place) {
  const Json tolerance = place.get("tolerance");
  return clusterMeshWeights(source, place.value.get<std::string>(),
                            tolerance.is_number() ? std::optional(tolerance.get<double>()) : std::nullopt,
                            place.value_pointer);
}

}  // namespace

std::vector<double> SelectionSource::onPoints(const VisualWeights& weights) const {
  std::vector<double> points(mesh.welded_positions.size(), 0);
  for (std::size_t v = 0; v < weights.size(); ++v) {
    points[mesh.welded[v]] = std::max(points[mesh.welded[v]], weights[v]);
  }
  return points;
}
VisualWeights SelectionSource::onVertices(const std::vector<double>& points) const {
  VisualWeights weights(count());
  for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = points[mesh.welded[v]];
  return weights;
}

std::vector<std::size_t> SelectionSource::matching(const SelectionPlace& place, const std::vector<std::string>& names,
                                                   const std::string& what) const {
  std::vector<std::size_t> found;
  const std::size_t patterns = place.value.is_array() ? place.value.size() : 1;
  for (std::size_t i = 0; i < patterns; ++i) {
    const Json& entry = place.value.is_array() ? place.value[i] : place.value;
    const auto pattern = entry.get<std::string>();
    bool any = false;
    for (std::size_t n = 0; n < names.size(); ++n) {
      if (!matchesPattern(names[n], pattern)) continue;
      any = true;
      found.push_back(n);
    }
    if (any) continue;
    std::vector<std::string> distinct = names;
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
    std::string missing = "the source has no ";
    missing.append(what).append(" '").append(pattern).append("'");
    fail(place.value.is_array() ? childPointer(place.value_pointer, i) : place.value_pointer, missing,
         distinct.empty()
             ? "It has none at all."
             : "Did you mean " + nearestName(pattern, distinct) + "? It has: " + listed(distinct, kNamed) + ".");
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

void SelectionSource::requireFile(const std::filesystem::path& file, const std::string& pointer) const {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    fail(pointer, "there is no file '" + file.string() + "'", "Names are relative to the recipe's folder.");
  }
}

VisualWeights clusterMeshWeights(const SelectionSource& source, const std::string& name,
                                 std::optional<double> tolerance, const std::string& pointer) {
  const auto found = std::find_if(source.cluster_meshes.begin(), source.cluster_meshes.end(),
                                  [&](const ClusterMesh& m) { return m.name == name; });
  if (found == source.cluster_meshes.end()) {
    std::vector<std::string> names;
    for (const ClusterMesh& m : source.cluster_meshes) names.push_back(m.name);
    source.fail(pointer, "the source has no cluster mesh '" + name + "'",
                names.empty()
                    ? "Name an object of it CLUSTER_" + name + ", or say where the cluster comes from with \"from\"."
                    : "Did you mean " + nearestName(name, names) + "? It has: " + listed(names, kNamed) + ".");
  }
  ClusterMatch match = matchClusterMesh(source.mesh, source.surface, *found, tolerance);
  if (match.unmatched > 0) {
    char distance[32];
    std::snprintf(distance, sizeof distance, "%.3g", match.furthest_unmatched);
    Finding finding;
    finding.id = "cluster-mesh-unmatched";
    finding.count = match.unmatched;
    finding.message = std::to_string(match.unmatched) + " of " + std::to_string(found->positions.size()) +
                      " vertices of cluster mesh " + found->object + " lie on no face of the visual mesh (up to " +
                      distance + " m off)";
    finding.place = found->object;
    finding.cure = "Move them back, or give the selection a larger tolerance.";
    source.findings.push_back(finding);
  }
  return std::move(match.weights);
}

const std::map<std::string_view, SelectionMethod>& namedSelections() {
  static const std::map<std::string_view, SelectionMethod> methods = {
      {"group", group},
      {"material", subMeshes},
      {"object", subMeshes},
      {"part", part},
      {"bone", bone},
      {"morph", morph},
      {"color", color},
      {"attribute", attribute},
      {"values", values},
      {"stored", stored},
      {"cluster_mesh", namedClusterMesh},
  };
  return methods;
}

}  // namespace sinew::tools
