// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/selection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "tools/author/mask_image.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/stored_masks.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// A mask is looked at this finely for regions that share UV space.
constexpr int kOverlapCells = 256;
// Of the diagonal: points of a stroke further from the surface than this were meant for another model.
constexpr double kOffSurface = 0.05;

double smoothstep(double t) {
  t = std::clamp(t, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

// 1 up to the edge, falling to 0 over `falloff` outside.
double ramp(double outside, double falloff) {
  if (outside <= 0) return 1;
  return falloff > 0 ? smoothstep(1 - outside / falloff) : 0;
}

Vector3d pointOf(const Json& json) { return {json[0].get<double>(), json[1].get<double>(), json[2].get<double>()}; }

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < 12; ++i) text += (i == 0 ? "" : ", ") + names[i];
  return text + (names.size() > 12 ? ", ..." : "");
}

}  // namespace

bool usesRest(const Recipe& recipe, const Json& selection) {
  if (selection.is_string()) {
    const SelectionText* mask = recipe.mask(selection.get<std::string>());
    return mask != nullptr && usesRest(recipe, mask->json);
  }
  if (selection.is_array())
    return std::any_of(selection.begin(), selection.end(), [&](const Json& s) { return usesRest(recipe, s); });
  const RecipeObject* kind = selection.is_object() ? selectionKind(selection) : nullptr;
  if (kind == nullptr) return false;
  const Json& value = selection[std::string(kind->name)];
  if (kind->name == "rest" && value.is_boolean()) return true;
  return (kind->keys.front().type & (kRecipeSelection | kRecipeSelections)) != 0 && usesRest(recipe, value);
}

bool matchesPattern(std::string_view name, std::string_view pattern) {
  const std::size_t star = pattern.find('*');
  if (star == std::string_view::npos) return name == pattern;
  if (!name.starts_with(pattern.substr(0, star))) return false;
  const std::string_view rest = pattern.substr(star + 1);
  for (std::size_t at = star; at <= name.size(); ++at) {
    if (matchesPattern(name.substr(at), rest)) return true;
  }
  return false;
}

std::vector<RecipeCluster> withClusterMeshes(const Recipe& recipe, const std::vector<ClusterMesh>& cluster_meshes) {
  std::vector<RecipeCluster> clusters = recipe.clusters;
  std::set<std::string> used;
  for (const RecipeCluster& cluster : recipe.clusters) used.insert(cluster.name);
  for (const ClusterMesh& mesh : cluster_meshes) {
    if (!used.insert(mesh.name).second) continue;
    RecipeCluster cluster;
    cluster.name = mesh.name;
    clusters.push_back(std::move(cluster));
  }
  return clusters;
}

class Selections::Evaluator {
 public:
  Evaluator(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
            const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings)
      : recipe_(recipe),
        mesh_(mesh),
        topology_(topology),
        cluster_meshes_(cluster_meshes),
        findings_(findings),
        surface_(mesh) {}

  const Surface& surface() const { return surface_; }
  void define(const std::string& name, VisualWeights weights) { masks_[name] = std::move(weights); }

  VisualWeights weights(const SelectionText& selection) { return at(selection.json, selection.pointer); }

  VisualWeights evaluate(const SelectionText& selection) {
    VisualWeights weights = this->weights(selection);
    requireSomething(weights, selection.pointer, "the selection selects nothing");
    return weights;
  }

  std::vector<VisualWeights> clusters() {
    const std::vector<RecipeCluster> all = withClusterMeshes(recipe_, cluster_meshes_);
    std::vector<VisualWeights> weights(all.size());
    VisualWeights covered(count(), 0);
    for (const bool rest : {false, true}) {
      if (rest) rest_ = complement(covered);
      for (std::size_t c = 0; c < all.size(); ++c) {
        if (usesRest(recipe_, all[c].from.json) != rest) continue;
        weights[c] = cluster(all[c]);
        if (rest) continue;
        for (std::size_t v = 0; v < covered.size(); ++v) covered[v] = std::max(covered[v], weights[c][v]);
      }
    }
    return weights;
  }

 private:
  std::size_t count() const { return mesh_.positions.size(); }

  [[noreturn]] void fail(const std::string& pointer, const std::string& what, const std::string& cure) const {
    recipe_.text->fail(pointer, what, cure);
  }

  void requireSomething(const VisualWeights& weights, const std::string& pointer, const std::string& what) const {
    if (std::none_of(weights.begin(), weights.end(), [](double w) { return w > 0; })) {
      const Vector3d& a = mesh_.bounds_min;
      const Vector3d& b = mesh_.bounds_max;
      char bounds[200];
      std::snprintf(bounds, sizeof bounds, "[%.4g, %.4g, %.4g] to [%.4g, %.4g, %.4g]", a[0], a[1], a[2], b[0], b[1],
                    b[2]);
      fail(pointer, what,
           "The source reaches from " + std::string(bounds) + " m (y up); look at it with sinew author " +
               recipe_.text->file() + " show.");
    }
  }

  VisualWeights cluster(const RecipeCluster& cluster) {
    VisualWeights weights;
    if (cluster.from.json.is_null()) {
      const std::string pointer = cluster.pointer.empty() ? "" : childPointer(cluster.pointer, "name");
      weights = clusterMesh(cluster.name, std::nullopt, pointer);
    } else {
      weights = at(cluster.from.json, cluster.from.pointer);
    }
    requireSomething(weights, cluster.from.pointer.empty() ? cluster.pointer : cluster.from.pointer,
                     "cluster '" + cluster.name + "' selects nothing");
    return weights;
  }

  VisualWeights at(const Json& json, const std::string& pointer) {
    if (json.is_string()) {
      const auto name = json.get<std::string>();
      const auto found = masks_.find(name);
      if (found != masks_.end()) return found->second;
      const SelectionText* mask = recipe_.mask(name);
      VisualWeights weights = at(mask->json, mask->pointer);
      if (!usesRest(recipe_, mask->json)) masks_[name] = weights;
      return weights;
    }
    const RecipeObject& kind = *selectionKind(json);
    const std::string name(kind.name);
    const Json& value = json[name];
    const Place place{kind, json, value, pointer, childPointer(pointer, name)};
    using Method = VisualWeights (Evaluator::*)(const Place&);
    static const std::map<std::string, Method> methods = {
        {"all", &Evaluator::all},          {"rest", &Evaluator::rest},
        {"group", &Evaluator::group},      {"material", &Evaluator::subMeshes},
        {"object", &Evaluator::subMeshes}, {"part", &Evaluator::part},
        {"bone", &Evaluator::bone},        {"morph", &Evaluator::morph},
        {"color", &Evaluator::color},      {"attribute", &Evaluator::attribute},
        {"values", &Evaluator::values},    {"stored", &Evaluator::stored},
        {"image", &Evaluator::image},      {"cluster_mesh", &Evaluator::namedClusterMesh},
        {"box", &Evaluator::shape},        {"sphere", &Evaluator::shape},
        {"capsule", &Evaluator::shape},    {"half_space", &Evaluator::shape},
        {"disc", &Evaluator::disc},        {"strokes", &Evaluator::strokes},
        {"and", &Evaluator::algebra},      {"or", &Evaluator::algebra},
        {"minus", &Evaluator::algebra},    {"not", &Evaluator::negation},
        {"grow", &Evaluator::moveEdge},    {"shrink", &Evaluator::moveEdge},
        {"soften", &Evaluator::soften},    {"mirror", &Evaluator::mirror},
        {"scale", &Evaluator::scale},
    };
    return (this->*methods.at(name))(place);
  }

  // A kind, its object, the value of its first key, and where both stand.
  struct Place {
    const RecipeObject& kind;
    const Json& json;
    const Json& value;
    std::string pointer;
    std::string value_pointer;

    Json get(std::string_view key) const { return recipeValue(kind, json, key); }
    double number(std::string_view key) const { return get(key).get<double>(); }
    std::string text(std::string_view key) const { return get(key).get<std::string>(); }
  };

  static VisualWeights complement(VisualWeights weights) {
    for (double& w : weights) w = 1 - w;
    return weights;
  }

  // Weight of each welded point: the largest of its visual vertices', so that both sides of a seam agree.
  std::vector<double> onPoints(const VisualWeights& weights) const {
    std::vector<double> points(mesh_.welded_positions.size(), 0);
    for (std::size_t v = 0; v < weights.size(); ++v) {
      points[mesh_.welded[v]] = std::max(points[mesh_.welded[v]], weights[v]);
    }
    return points;
  }
  VisualWeights onVertices(const std::vector<double>& points) const {
    VisualWeights weights(count());
    for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = points[mesh_.welded[v]];
    return weights;
  }
  VisualWeights joined(const VisualWeights& weights) const { return onVertices(onPoints(weights)); }

  // Numbers of the names that a text, or a list of texts, means.
  std::vector<std::size_t> matching(const Place& place, const std::vector<std::string>& names,
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
           distinct.empty() ? "It has none at all."
                            : "Did you mean " + nearestName(pattern, distinct) + "? It has: " + listed(distinct) + ".");
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    return found;
  }

  VisualWeights all(const Place& place) { return {VisualWeights(count(), place.value.get<bool>() ? 1 : 0)}; }

  VisualWeights rest(const Place& place) {
    if (place.value.is_boolean()) {
      if (!place.value.get<bool>()) return VisualWeights(count(), 0);
      if (!rest_) {
        fail(place.pointer, "\"rest\": true means what the clusters leave, and stands in a cluster's from only",
             "Name the masks instead: {\"rest\": [\"a\", \"b\"]}.");
      }
      return *rest_;
    }
    VisualWeights covered(count(), 0);
    for (std::size_t i = 0; i < place.value.size(); ++i) {
      const VisualWeights mask = at(place.value[i], childPointer(place.value_pointer, i));
      for (std::size_t v = 0; v < covered.size(); ++v) covered[v] = std::max(covered[v], mask[v]);
    }
    return complement(std::move(covered));
  }

  VisualWeights group(const Place& place) {
    std::vector<std::string> names;
    for (const GroupSource& g : mesh_.groups) names.push_back(g.name);
    VisualWeights weights(count(), 0);
    for (const std::size_t g : matching(place, names, "group")) {
      for (const std::uint32_t v : mesh_.groups[g].vertices) weights[v] = 1;
    }
    return joined(weights);
  }

  void takeSubMesh(const SubMeshSource& sub, VisualWeights& weights) const {
    for (std::uint32_t t = sub.first_triangle; t < sub.first_triangle + sub.triangle_count; ++t) {
      for (const std::uint32_t v : mesh_.triangles[t]) weights[v] = 1;
    }
  }

  VisualWeights subMeshes(const Place& place) {
    VisualWeights weights(count(), 0);
    std::vector<std::string> names;
    if (place.kind.name == "material") {
      for (const MaterialSource& m : mesh_.materials) names.push_back(m.name);
      const auto found = matching(place, names, "material");
      for (const SubMeshSource& sub : mesh_.sub_meshes) {
        if (std::binary_search(found.begin(), found.end(), std::size_t(sub.material))) takeSubMesh(sub, weights);
      }
    } else {
      // Every sub-mesh has two names.
      for (const SubMeshSource& sub : mesh_.sub_meshes) {
        names.push_back(sub.node);
        names.push_back(sub.mesh);
      }
      for (const std::size_t n : matching(place, names, "object")) takeSubMesh(mesh_.sub_meshes[n / 2], weights);
    }
    return joined(weights);
  }

  VisualWeights part(const Place& place) {
    std::uint32_t number = 0;
    if (place.value.is_array()) {
      double nearest = kInfinity;
      for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
        if (topology_.part_of_triangle[t] == kNoIndex) continue;
        const Triangle c = mesh_.weldedTriangle(t);
        const auto& x = mesh_.welded_positions;
        const Vector3d p = pointOf(place.value);
        const double d = (geometry::closestPointOnTriangle(p, x[c[0]], x[c[1]], x[c[2]]) - p).squaredNorm();
        if (d < nearest) {
          nearest = d;
          number = topology_.part_of_triangle[t];
        }
      }
    } else {
      const double wanted = place.value.get<double>();
      if (wanted >= double(topology_.parts.size())) {
        fail(place.value_pointer, "there is no part " + place.value.dump(),
             "The source has " + std::to_string(topology_.parts.size()) + ", from 0; a point [x, y, z] is safer.");
      }
      number = std::uint32_t(wanted);
    }
    VisualWeights weights(count(), 0);
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (topology_.part_of_triangle[t] != number) continue;
      for (const std::uint32_t v : mesh_.triangles[t]) weights[v] = 1;
    }
    return joined(weights);
  }

  VisualWeights bone(const Place& place) {
    std::set<std::uint32_t> joints;
    for (const std::size_t j : matching(place, mesh_.joints, "bone")) joints.insert(std::uint32_t(j));
    if (place.get("children").get<bool>()) {
      std::map<std::string, std::string> parent;
      for (const NodeSource& node : mesh_.nodes) parent.emplace(node.name, node.parent);
      const std::set<std::uint32_t> roots = joints;
      for (std::uint32_t j = 0; j < mesh_.joints.size(); ++j) {
        std::string name = mesh_.joints[j];
        // As many steps as there are nodes, in case names make a circle.
        for (std::size_t step = 0; step < mesh_.nodes.size() && !name.empty(); ++step) {
          const auto up = parent.find(name);
          if (up == parent.end()) break;
          name = up->second;
          if (std::any_of(roots.begin(), roots.end(), [&](std::uint32_t r) { return mesh_.joints[r] == name; })) {
            joints.insert(j);
            break;
          }
        }
      }
    }
    const bool dominant = place.text("weights") == "dominant";
    VisualWeights weights(count(), 0);
    for (std::size_t v = 0; v < mesh_.skin.size(); ++v) {
      double mine = 0;
      double strongest = -1;
      bool is_mine = false;
      for (const SkinInfluence& influence : mesh_.skin[v]) {
        const bool of_these = joints.contains(influence.joint);
        if (of_these) mine += double(influence.weight);
        if (double(influence.weight) > strongest) {
          strongest = double(influence.weight);
          is_mine = of_these;
        }
      }
      weights[v] = dominant ? (is_mine ? 1 : 0) : std::clamp(mine, 0.0, 1.0);
    }
    return joined(weights);
  }

  VisualWeights morph(const Place& place) {
    std::vector<std::string> names;
    for (const MorphTargetSource& m : mesh_.morphs) names.push_back(m.name);
    VisualWeights weights(count(), 0);
    const double threshold = place.number("threshold");
    for (const std::size_t m : matching(place, names, "morph target")) {
      const MorphTargetSource& target = mesh_.morphs[m];
      float furthest = 0;
      for (const auto& d : target.displacements) furthest = std::max(furthest, d.norm());
      if (!(furthest > 0)) continue;
      for (std::size_t i = 0; i < target.vertices.size(); ++i) {
        const double part = double(target.displacements[i].norm() / furthest);
        weights[target.vertices[i]] =
            std::max(weights[target.vertices[i]], threshold > 0 ? (part > threshold ? 1.0 : 0.0) : part);
      }
    }
    return joined(weights);
  }

  const AttributeSource& attributeNamed(const std::string& name, const std::string& pointer) const {
    std::vector<std::string> names;
    for (const AttributeSource& a : mesh_.attributes) {
      if (a.name == name) return a;
      names.push_back(a.name);
    }
    fail(pointer, "the source has no attribute '" + name + "'",
         names.empty() ? "It has none; in Blender, export with attributes (names that begin with _)."
                       : "Did you mean " + nearestName(name, names) + "? It has: " + listed(names) + ".");
  }

  VisualWeights color(const Place& place) {
    const std::string set = place.text("set");
    std::vector<std::array<float, 4>> further;
    const std::vector<std::array<float, 4>>* colors = &mesh_.colors;
    if (set != "COLOR_0") {
      const AttributeSource& a = attributeNamed(set, childPointer(place.pointer, "set"));
      if (a.components < 3) {
        fail(childPointer(place.pointer, "set"), "attribute '" + set + "' is no colour",
             "Use {\"attribute\": \"" + set + "\"}.");
      }
      for (std::size_t v = 0; v < count(); ++v) {
        const float* c = a.values.data() + v * a.components;
        further.push_back({c[0], c[1], c[2], a.components > 3 ? c[3] : 1});
      }
      colors = &further;
    }
    if (colors->empty()) {
      fail(place.value_pointer, "the source has no vertex colours",
           "Export it with colours (GLB, PLY or FBX keep them), or use another selection.");
    }
    VisualWeights weights(count(), 0);
    for (std::size_t v = 0; v < count(); ++v) {
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
    return joined(weights);
  }

  VisualWeights attribute(const Place& place) {
    const AttributeSource& a = attributeNamed(place.value.get<std::string>(), place.value_pointer);
    const auto component = std::size_t(place.number("component"));
    if (component >= a.components) {
      fail(childPointer(place.pointer, "component"),
           "attribute '" + a.name + "' has " + std::to_string(a.components) + " components, not one numbered " +
               std::to_string(component),
           "Count from 0.");
    }
    const double low = place.number("low");
    const double high = place.number("high");
    if (low == high) {
      fail(place.pointer, "low and high are the same", "Give the values that mean weight 0 and weight 1.");
    }
    VisualWeights weights(count(), 0);
    for (std::size_t v = 0; v < count(); ++v) {
      weights[v] = std::clamp((double(a.values[v * a.components + component]) - low) / (high - low), 0.0, 1.0);
    }
    return joined(weights);
  }

  VisualWeights values(const Place& place) {
    const auto file = recipe_.file(place.value.get<std::string>(), place.value_pointer);
    requireFile(file, place.value_pointer);
    const JsonText text = JsonText::read(file.string());
    const Json& json = text.json();
    if (!json.is_array()) text.fail("", "must be a list of numbers", "Write [0, 0.5, 1, ...].");
    if (json.size() != mesh_.source_vertex_count) {
      text.fail("",
                "has " + std::to_string(json.size()) + " values, but the source has " +
                    std::to_string(mesh_.source_vertex_count) + " vertices",
                "Write one number for each vertex of the file, in its order; a mask of an older version of the source "
                "must be made again.");
    }
    for (std::size_t i = 0; i < json.size(); ++i) {
      if (!json[i].is_number() || json[i].get<double>() < 0 || json[i].get<double>() > 1)
        text.fail(childPointer("", i), "is no weight", "Give a number 0 .. 1.");
    }
    VisualWeights weights(count());
    for (std::size_t v = 0; v < count(); ++v) weights[v] = json[mesh_.source_vertex[v]].get<double>();
    return joined(weights);
  }

  VisualWeights stored(const Place& place) {
    const auto file = recipe_.file(place.value.get<std::string>(), place.value_pointer);
    requireFile(file, place.value_pointer);
    const std::string name = place.text("mask");
    std::vector<std::string> names;
    auto [found, mask] = readStoredMask(file, name, mesh_, names);
    if (!found) {
      std::string what = file.filename().string();
      what.append(" has no mask '").append(name).append("'");
      fail(childPointer(place.pointer, "mask"), what,
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
      finding.cure =
          "The source changed: sinew author " + recipe_.text->file() + " transfer NEW --old OLD carries the mask over.";
      findings_.push_back(finding);
    }
    return std::move(mask.weights);
  }

  void requireFile(const std::filesystem::path& file, const std::string& pointer) const {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) {
      fail(pointer, "there is no file '" + file.string() + "'", "Names are relative to the recipe's folder.");
    }
  }

  VisualWeights image(const Place& place) {
    if (mesh_.uvs.empty()) {
      fail(place.value_pointer, "the source has no UV coordinates, so a picture cannot lie on it",
           "Unwrap it and export with UVs, or use another selection.");
    }
    const auto file = recipe_.file(place.value.get<std::string>(), place.value_pointer);
    requireFile(file, place.value_pointer);
    MaskImageOptions options;
    options.channel = place.text("channel");
    if (const Json key = place.get("key"); key.is_array()) {
      const Vector3d rgb = pointOf(key);
      options.key = {rgb[0], rgb[1], rgb[2]};
    }
    options.tolerance = place.number("tolerance");
    if (const Json threshold = place.get("threshold"); threshold.is_number())
      options.threshold = threshold.get<double>();
    options.close = int(place.number("close"));
    options.specks = int(place.number("specks"));
    options.feather = place.number("feather");
    const MaskImage mask = readMaskImage(file, options);
    const bool up = place.text("v") == "up";
    std::vector<std::uint8_t> meant(mesh_.triangles.size(), 1);
    if (const Json material = place.get("material"); material.is_string()) {
      std::vector<std::string> names;
      for (const MaterialSource& m : mesh_.materials) names.push_back(m.name);
      const Json& pattern = place.json["material"];
      const Place named{place.kind, place.json, pattern, place.pointer, childPointer(place.pointer, "material")};
      const auto found = matching(named, names, "material");
      for (const SubMeshSource& sub : mesh_.sub_meshes) {
        const bool is_meant = std::binary_search(found.begin(), found.end(), std::size_t(sub.material));
        std::fill_n(meant.begin() + std::ptrdiff_t(sub.first_triangle), sub.triangle_count, is_meant ? 1 : 0);
      }
    }
    // Sampled up to a texel inside each triangle of a vertex, and averaged: an island's edge often lies right on the
    // edge of what was painted.
    VisualWeights sum(count(), 0);
    std::vector<std::uint32_t> samples(count(), 0);
    const Eigen::Vector2d texel(1.0 / mask.width, 1.0 / mask.height);
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (meant[t] == 0) continue;
      const Triangle& c = mesh_.triangles[t];
      const Eigen::Vector2d center =
          (mesh_.uvs[c[0]].cast<double>() + mesh_.uvs[c[1]].cast<double>() + mesh_.uvs[c[2]].cast<double>()) / 3;
      for (const std::uint32_t v : c) {
        const Eigen::Vector2d uv = mesh_.uvs[v].cast<double>();
        Eigen::Vector2d inwards = (center - uv) / 3;
        inwards *= std::min(1.0, 1 / std::max(1e-12, inwards.cwiseQuotient(texel).cwiseAbs().maxCoeff()));
        const Eigen::Vector2d s = uv + inwards;
        sum[v] += mask.sample(s[0], up ? s[1] : 1 - s[1]);
        ++samples[v];
      }
    }
    VisualWeights weights(count(), 0);
    for (std::size_t v = 0; v < count(); ++v) {
      if (samples[v] > 0) weights[v] = std::clamp(sum[v] / samples[v], 0.0, 1.0);
    }
    reportSharedUv(place, mask, meant, up);
    return joined(weights);
  }

  // Where distant triangles lie on the same painted place, a mask selects them all: mirrored halves, repeated parts.
  void reportSharedUv(const Place& place, const MaskImage& mask, const std::vector<std::uint8_t>& meant, bool up) {
    std::vector<std::uint32_t> owner(std::size_t(kOverlapCells) * kOverlapCells, kNoIndex);
    std::vector<std::uint8_t> shared(owner.size(), 0);
    std::size_t covered = 0;
    std::size_t overlapping = 0;
    const auto center = [&](std::uint32_t t) {
      const Triangle& c = mesh_.triangles[t];
      return Vector3d((mesh_.positions[c[0]] + mesh_.positions[c[1]] + mesh_.positions[c[2]]) / 3);
    };
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
      if (meant[t] == 0) continue;
      std::array<Eigen::Vector2d, 3> uv;
      for (std::size_t k = 0; k < 3; ++k) uv[k] = mesh_.uvs[mesh_.triangles[t][k]].cast<double>() * kOverlapCells;
      const Eigen::Vector2d low = uv[0].cwiseMin(uv[1]).cwiseMin(uv[2]);
      const Eigen::Vector2d high = uv[0].cwiseMax(uv[1]).cwiseMax(uv[2]);
      if (!((high - low).maxCoeff() < kOverlapCells)) continue;  // it wraps the whole picture: no island
      const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a[0] * b[1] - a[1] * b[0]; };
      for (double y = std::ceil(low[1] - 0.5) + 0.5; y < high[1]; ++y) {
        for (double x = std::ceil(low[0] - 0.5) + 0.5; x < high[0]; ++x) {
          const Eigen::Vector2d p(x, y);
          int positive = 0;
          int negative = 0;
          for (std::size_t k = 0; k < 3; ++k) {
            const double side = cross(uv[(k + 1) % 3] - uv[k], p - uv[k]);
            (side >= 0 ? positive : negative) += 1;
          }
          if (positive != 0 && negative != 0) continue;
          const double v = y / kOverlapCells;
          if (mask.sample(x / kOverlapCells, up ? v : 1 - v) < 0.5) continue;
          const auto wrap = [](double i) {
            return std::size_t((int(std::floor(i)) % kOverlapCells + kOverlapCells) % kOverlapCells);
          };
          const std::size_t cell = wrap(y) * kOverlapCells + wrap(x);
          if (owner[cell] == kNoIndex) {
            owner[cell] = t;
            ++covered;
          } else if (shared[cell] == 0 && (center(owner[cell]) - center(t)).norm() > 0.05 * mesh_.diagonal) {
            shared[cell] = 1;
            ++overlapping;
          }
        }
      }
    }
    if (overlapping * 50 <= covered) return;
    Finding finding;
    finding.id = "mask-uv-shared";
    finding.count = overlapping;
    finding.message = "mask " + place.value.get<std::string>() + " selects several places that share its UV space (" +
                      std::to_string(100 * overlapping / covered) + " % of it)";
    finding.place = place.pointer.substr(1);
    finding.cure = "If only one is meant, say which: {\"and\": [{\"image\": ...}, {\"half_space\": ...}]}.";
    findings_.push_back(finding);
  }

  VisualWeights clusterMesh(const std::string& name, std::optional<double> tolerance, const std::string& pointer) {
    const auto found = std::find_if(cluster_meshes_.begin(), cluster_meshes_.end(),
                                    [&](const ClusterMesh& m) { return m.name == name; });
    if (found == cluster_meshes_.end()) {
      std::vector<std::string> names;
      for (const ClusterMesh& m : cluster_meshes_) names.push_back(m.name);
      fail(pointer, "the source has no cluster mesh '" + name + "'",
           names.empty()
               ? "Name an object of it CLUSTER_" + name + ", or say where the cluster comes from with \"from\"."
               : "Did you mean " + nearestName(name, names) + "? It has: " + listed(names) + ".");
    }
    ClusterMatch match = matchClusterMesh(mesh_, surface_, *found, tolerance);
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
      findings_.push_back(finding);
    }
    return std::move(match.weights);
  }

  VisualWeights namedClusterMesh(const Place& place) {
    const Json tolerance = place.get("tolerance");
    return clusterMesh(place.value.get<std::string>(),
                       tolerance.is_number() ? std::optional(tolerance.get<double>()) : std::nullopt,
                       place.value_pointer);
  }

  VisualWeights shape(const Place& place) {
    const double falloff = place.number("falloff");
    const std::string_view kind = place.kind.name;
    VisualWeights weights(count());
    Vector3d a = Vector3d::Zero();
    Vector3d b = Vector3d::Zero();
    double radius = 0;
    if (kind == "box" || kind == "capsule") {
      a = pointOf(place.value[0]);
      b = pointOf(place.value[1]);
      if (kind == "box") {
        const Vector3d low = a.cwiseMin(b);
        b = a.cwiseMax(b);
        a = low;
      }
    } else {
      a = pointOf(place.value);
    }
    if (kind == "sphere" || kind == "capsule") radius = place.number("radius");
    if (kind == "half_space") {
      b = pointOf(place.json["normal"]);
      if (!(b.norm() > 0)) {
        fail(childPointer(place.pointer, "normal"), "a plane needs a normal that is not zero", "Give [0, 1, 0], say.");
      }
      b.normalize();
    }
    for (std::size_t v = 0; v < count(); ++v) {
      const Vector3d& x = mesh_.positions[v];
      double outside = 0;
      if (kind == "box") {
        outside = (a - x).cwiseMax(x - b).cwiseMax(0.0).norm();
      } else if (kind == "sphere") {
        outside = (x - a).norm() - radius;
      } else if (kind == "capsule") {
        const double s = std::clamp((x - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
        outside = (x - a - s * (b - a)).norm() - radius;
      } else {
        outside = (a - x).dot(b);
      }
      weights[v] = ramp(outside, falloff);
    }
    return weights;
  }

  VisualWeights disc(const Place& place) {
    const SurfacePoint center = surface_.nearest(pointOf(place.value));
    std::vector<double> points = surface_.distancesFrom({&center, 1});
    for (double& w : points) w = ramp(w - place.number("radius"), place.number("falloff"));
    return onVertices(points);
  }

  VisualWeights strokes(const Place& place) {
    const auto file = recipe_.file(place.value.get<std::string>(), place.value_pointer);
    requireFile(file, place.value_pointer);
    const JsonText text = JsonText::read(file.string());
    const Json& json = text.json();
    const auto isList = [](const Json& value) { return value.is_array() && !value.empty(); };
    if (!json.is_object() || !json.contains("strokes") || !isList(json["strokes"])) {
      text.fail("", "is no stroke file", R"(It looks like {"strokes": [{"points": [[x, y, z]], "radius": 0.01}]}.)");
    }
    std::vector<double> painted(mesh_.welded_positions.size(), 0);
    std::size_t off = 0;
    for (std::size_t i = 0; i < json["strokes"].size(); ++i) {
      const std::string pointer = childPointer("/strokes", i);
      const Stroke stroke = readStroke(text, json["strokes"][i], pointer);
      std::vector<SurfacePoint> places;
      for (std::size_t p = 0; p < stroke.points.size(); ++p) {
        // Points of a quick stroke lie far apart: in between, half a radius at a time.
        const Vector3d step = p == 0 ? Vector3d(Vector3d::Zero()) : Vector3d(stroke.points[p] - stroke.points[p - 1]);
        const int pieces = std::clamp(int(std::ceil(2 * step.norm() / stroke.radius)), 1, 1000);
        for (int s = p == 0 ? pieces : 1; s <= pieces; ++s) {
          places.push_back(surface_.nearest(stroke.points[p] - step * (1 - double(s) / pieces)));
        }
        if (places.back().distance > kOffSurface * mesh_.diagonal) ++off;
      }
      const std::vector<double> distance = surface_.distancesFrom(places);
      for (std::size_t p = 0; p < painted.size(); ++p) {
        const double w = stroke.strength * ramp(distance[p] - stroke.radius, stroke.falloff);
        painted[p] = stroke.erase ? std::min(painted[p], 1 - w) : std::max(painted[p], w);
      }
    }
    if (off > 0) {
      Finding finding;
      finding.id = "strokes-off-surface";
      finding.count = off;
      finding.message = std::to_string(off) + " points of " + file.filename().string() +
                        " lie further than 5 % of the diagonal from the surface";
      finding.place = place.pointer.substr(1);
      finding.cure = "Check that the strokes are in metres, y up, and were made on this source.";
      findings_.push_back(finding);
    }
    return onVertices(painted);
  }

  struct Stroke {
    std::vector<Vector3d> points;
    double radius = 0, falloff = 0, strength = 1;
    bool erase = false;
  };

  static Stroke readStroke(const JsonText& text, const Json& json, const std::string& pointer) {
    Stroke stroke;
    if (!json.is_object()) text.fail(pointer, "a stroke must be an object", "Give points and radius.");
    const std::vector<std::string> known = {"points", "radius", "falloff", "strength", "erase"};
    for (const auto& [key, value] : json.items()) {
      const std::string place = childPointer(pointer, key);
      const auto number = [&, &entry = value](double minimum, double maximum) {
        if (!entry.is_number() || entry.template get<double>() < minimum || entry.template get<double>() > maximum)
          text.fail(place, "cannot be " + entry.dump(), "Give a number in metres, or 0 .. 1 for strength.");
        return entry.template get<double>();
      };
      if (key == "points") {
        const auto isPoint = [](const Json& p) {
          return p.is_array() && p.size() == 3 && p[0].is_number() && p[1].is_number() && p[2].is_number();
        };
        if (!value.is_array() || value.empty() || !std::all_of(value.begin(), value.end(), isPoint))
          text.fail(place, "must be a list of points", "Write [[x, y, z], ...], in metres.");
        for (const Json& p : value) stroke.points.push_back(pointOf(p));
      } else if (key == "radius") {
        stroke.radius = number(1e-9, 1e9);
      } else if (key == "falloff") {
        stroke.falloff = number(0, 1e9);
      } else if (key == "strength") {
        stroke.strength = number(0, 1);
      } else if (key == "erase") {
        if (!value.is_boolean()) text.fail(place, "must be true or false", "Write true to erase.");
        stroke.erase = value.get<bool>();
      } else {
        text.fail(place, "there is no key '" + key + "' in a stroke", "Did you mean " + nearestName(key, known) + "?");
      }
    }
    if (stroke.points.empty() || !(stroke.radius > 0)) {
      text.fail(pointer, "a stroke needs points and a radius", R"(Write {"points": [[x, y, z]], "radius": 0.01}.)");
    }
    return stroke;
  }

  VisualWeights algebra(const Place& place) {
    VisualWeights weights;
    for (std::size_t i = 0; i < place.value.size(); ++i) {
      const VisualWeights next = at(place.value[i], childPointer(place.value_pointer, i));
      if (i == 0) {
        weights = next;
        continue;
      }
      for (std::size_t v = 0; v < weights.size(); ++v) {
        weights[v] = place.kind.name == "and"  ? std::min(weights[v], next[v])
                     : place.kind.name == "or" ? std::max(weights[v], next[v])
                                               : std::min(weights[v], 1 - next[v]);
      }
    }
    return weights;
  }

  VisualWeights negation(const Place& place) { return complement(at(place.value, place.value_pointer)); }

  VisualWeights moveEdge(const Place& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    const bool grows = place.kind.name == "grow";
    const double by = place.number("by");
    const std::vector<double> distance = surface_.signedDistances(onPoints(weights));
    for (std::size_t v = 0; v < weights.size(); ++v) {
      const double d = distance[mesh_.welded[v]];
      if (grows && d <= by) weights[v] = 1;
      if (!grows && d >= -by) weights[v] = 0;
    }
    return weights;
  }

  VisualWeights soften(const Place& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    const double by = place.number("by");
    if (!(by > 0)) return weights;
    std::vector<double> points = surface_.signedDistances(onPoints(weights));
    for (double& d : points) d = smoothstep(0.5 - d / by);
    return onVertices(points);
  }

  VisualWeights mirror(const Place& place) {
    const std::vector<double> weights = onPoints(at(place.value, place.value_pointer));
    const double tolerance = place.number("tolerance");
    MirrorPlane plane{pointOf(place.get("point")), Vector3d::UnitX(), 0};
    const std::string axis = place.text("plane");
    const std::string pointer = childPointer(place.pointer, "plane");
    if (const Json normal = place.get("normal"); normal.is_array()) {
      plane.normal = pointOf(normal);
      if (!(plane.normal.norm() > 0)) fail(pointer, "a plane needs a normal that is not zero", "Give [1, 0, 0], say.");
      plane.normal.normalize();
    } else if (axis == "auto") {
      plane = foundPlane(pointer);
    } else {
      plane.normal = Vector3d::Unit(axis == "x" ? 0 : axis == "y" ? 1 : 2);
    }
    std::vector<double> image(weights.size(), 0);
    for (std::size_t p = 0; p < weights.size(); ++p) {
      const SurfacePoint at = surface_.nearest(mirrored(mesh_.welded_positions[p], plane.point, plane.normal));
      if (at.triangle != kNoIndex && at.distance <= tolerance * mesh_.diagonal)
        image[p] = surface_.interpolate(at, weights);
    }
    return onVertices(image);
  }

  MirrorPlane foundPlane(const std::string& pointer) {
    if (!plane_) {
      plane_ = surface_.symmetryPlane();
      if (!plane_) {
        fail(pointer, "the source has no plane of symmetry that could be found",
             "Give one: \"plane\": \"x\", or \"point\" and \"normal\".");
      }
      char text[200];
      std::snprintf(
          text, sizeof text,
          "plane of symmetry found through [%.4g, %.4g, %.4g] across [%.3f, %.3f, %.3f], off by %.2g diagonals",
          plane_->point[0], plane_->point[1], plane_->point[2], plane_->normal[0], plane_->normal[1], plane_->normal[2],
          plane_->error);
      Finding finding;
      finding.id = "mirror-plane";
      finding.severity = Severity::info;
      finding.message = text;
      finding.cure = "Give plane, or point and normal, where it is another one.";
      findings_.push_back(finding);
    }
    return *plane_;
  }

  VisualWeights scale(const Place& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    for (double& w : weights) w *= place.number("by");
    return weights;
  }

  const Recipe& recipe_;
  const VisualMesh& mesh_;
  const Topology& topology_;
  const std::vector<ClusterMesh>& cluster_meshes_;
  std::vector<Finding>& findings_;
  Surface surface_;
  std::map<std::string, VisualWeights> masks_;
  std::optional<VisualWeights> rest_;
  std::optional<MirrorPlane> plane_;
};

Selections::Selections(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
                       const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings)
    : evaluator_(std::make_unique<Evaluator>(recipe, mesh, topology, cluster_meshes, findings)) {}
Selections::~Selections() = default;

VisualWeights Selections::evaluate(const SelectionText& selection) { return evaluator_->evaluate(selection); }
VisualWeights Selections::weights(const SelectionText& selection) { return evaluator_->weights(selection); }
std::vector<VisualWeights> Selections::clusters() { return evaluator_->clusters(); }
void Selections::define(const std::string& name, VisualWeights weights) {
  evaluator_->define(name, std::move(weights));
}
const Surface& Selections::surface() const { return evaluator_->surface(); }

}  // namespace sinew::tools
