// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/selection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/recipe_keys.h"
#include "tools/author/selection_kinds.h"
#include "tools/core/command_line.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

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
  if (kind->name == "rest" && selection["rest"].is_boolean()) return true;
  return std::any_of(kind->keys.begin(), kind->keys.end(), [&](const RecipeKey& key) {
    return (key.type & (kRecipeSelection | kRecipeSelections)) != 0 && selection.contains(key.name) &&
           usesRest(recipe, selection[std::string(key.name)]);
  });
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
      : source_{recipe,
                mesh,
                topology,
                cluster_meshes,
                findings,
                Surface(mesh),
                [this](const Json& json, const std::string& pointer) { return at(json, pointer); }} {}
  ~Evaluator() = default;
  Evaluator(const Evaluator&) = delete;
  Evaluator& operator=(const Evaluator&) = delete;

  const Surface& surface() const { return source_.surface; }
  void define(const std::string& name, VisualWeights weights) { masks_[name] = std::move(weights); }

  VisualWeights weights(const SelectionText& selection) { return at(selection.json, selection.pointer); }

  VisualWeights evaluate(const SelectionText& selection) {
    VisualWeights weights = this->weights(selection);
    requireSomething(weights, selection.pointer, "the selection selects nothing");
    return weights;
  }

  std::vector<VisualWeights> clusters() {
    const std::vector<RecipeCluster> all = withClusterMeshes(source_.recipe, source_.cluster_meshes);
    std::vector<VisualWeights> weights(all.size());
    VisualWeights covered(source_.count(), 0);
    for (const bool rest : {false, true}) {
      if (rest) rest_ = complement(covered);
      for (std::size_t c = 0; c < all.size(); ++c) {
        if (usesRest(source_.recipe, all[c].from.json) != rest) continue;
        weights[c] = cluster(all[c]);
        if (rest) continue;
        for (std::size_t v = 0; v < covered.size(); ++v) covered[v] = std::max(covered[v], weights[c][v]);
      }
    }
    return weights;
  }

 private:
  void requireSomething(const VisualWeights& weights, const std::string& pointer, const std::string& what) const {
    if (std::none_of(weights.begin(), weights.end(), [](double w) { return w > 0; })) {
      const Vector3d& a = source_.mesh.bounds_min;
      const Vector3d& b = source_.mesh.bounds_max;
      char bounds[200];
      std::snprintf(bounds, sizeof bounds, "[%.4g, %.4g, %.4g] to [%.4g, %.4g, %.4g]", a[0], a[1], a[2], b[0], b[1],
                    b[2]);
      source_.fail(pointer, what,
                   "The source reaches from " + std::string(bounds) + " m (y up); look at it with " +
                       commandLine({"sinew", "author", source_.recipe.text->file(), "show"}) + ".");
    }
  }

  VisualWeights cluster(const RecipeCluster& cluster) {
    VisualWeights weights;
    if (cluster.from.json.is_null()) {
      const std::string pointer = cluster.pointer.empty() ? "" : childPointer(cluster.pointer, "name");
      weights = clusterMeshWeights(source_, cluster.name, std::nullopt, pointer);
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
      const SelectionText* mask = source_.recipe.mask(name);
      VisualWeights weights = at(mask->json, mask->pointer);
      if (!usesRest(source_.recipe, mask->json)) masks_[name] = weights;
      return weights;
    }
    const RecipeObject& kind = *selectionKind(json);
    const std::string name(kind.name);
    const Json& value = json[name];
    const SelectionPlace place{kind, json, value, pointer, childPointer(pointer, name)};
    using Method = VisualWeights (Evaluator::*)(const SelectionPlace&);
    static const std::map<std::string_view, Method> methods = {
        {"all", &Evaluator::all},       {"rest", &Evaluator::rest},       {"and", &Evaluator::algebra},
        {"or", &Evaluator::algebra},    {"minus", &Evaluator::algebra},   {"not", &Evaluator::negation},
        {"grow", &Evaluator::moveEdge}, {"shrink", &Evaluator::moveEdge}, {"soften", &Evaluator::soften},
        {"mirror", &Evaluator::mirror}, {"scale", &Evaluator::scale},
    };
    if (const auto own = methods.find(name); own != methods.end()) return (this->*own->second)(place);
    const auto named = namedSelections().find(name);
    return (named != namedSelections().end() ? named->second : placedSelections().at(name))(source_, place);
  }

  static VisualWeights complement(VisualWeights weights) {
    for (double& w : weights) w = 1 - w;
    return weights;
  }

  VisualWeights all(const SelectionPlace& place) {
    return {VisualWeights(source_.count(), place.value.get<bool>() ? 1 : 0)};
  }

  VisualWeights rest(const SelectionPlace& place) {
    if (place.value.is_boolean()) {
      if (!place.value.get<bool>()) return VisualWeights(source_.count(), 0);
      if (!rest_) {
        source_.fail(place.pointer, "\"rest\": true means what the clusters leave, and stands in a cluster's from only",
                     "Name the masks instead: {\"rest\": [\"a\", \"b\"]}.");
      }
      return *rest_;
    }
    VisualWeights covered(source_.count(), 0);
    for (std::size_t i = 0; i < place.value.size(); ++i) {
      const VisualWeights mask = at(place.value[i], childPointer(place.value_pointer, i));
      for (std::size_t v = 0; v < covered.size(); ++v) covered[v] = std::max(covered[v], mask[v]);
    }
    return complement(std::move(covered));
  }

  VisualWeights algebra(const SelectionPlace& place) {
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

  VisualWeights negation(const SelectionPlace& place) { return complement(at(place.value, place.value_pointer)); }

  VisualWeights moveEdge(const SelectionPlace& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    const bool grows = place.kind.name == "grow";
    const double by = place.number("by");
    const std::vector<double> distance = source_.surface.signedDistances(source_.onPoints(weights));
    for (std::size_t v = 0; v < weights.size(); ++v) {
      const double d = distance[source_.mesh.welded[v]];
      if (grows && d <= by) weights[v] = 1;
      if (!grows && d >= -by) weights[v] = 0;
    }
    return weights;
  }

  VisualWeights soften(const SelectionPlace& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    const double by = place.number("by");
    if (!(by > 0)) return weights;
    std::vector<double> points = source_.surface.signedDistances(source_.onPoints(weights));
    for (double& d : points) d = geometry::smoothstep(0.5 - d / by);
    return source_.onVertices(points);
  }

  VisualWeights mirror(const SelectionPlace& place) {
    const std::vector<double> weights = source_.onPoints(at(place.value, place.value_pointer));
    const double tolerance = place.number("tolerance");
    MirrorPlane plane{pointOf(place.get("point")), Vector3d::UnitX(), 0};
    const std::string axis = place.text("plane");
    const std::string pointer = childPointer(place.pointer, "plane");
    if (const Json normal = place.get("normal"); normal.is_array()) {
      plane.normal = pointOf(normal);
      if (!(plane.normal.norm() > 0))
        source_.fail(pointer, "a plane needs a normal that is not zero", "Give [1, 0, 0], say.");
      plane.normal.normalize();
    } else if (axis == "auto") {
      plane = foundPlane(pointer);
    } else {
      plane.normal = Vector3d::Unit(axis == "x" ? 0 : axis == "y" ? 1 : 2);
    }
    std::vector<double> image(weights.size(), 0);
    for (std::size_t p = 0; p < weights.size(); ++p) {
      const SurfacePoint at =
          source_.surface.nearest(mirrored(source_.mesh.welded_positions[p], plane.point, plane.normal));
      if (at.triangle != formats::kNone && at.distance <= tolerance * source_.mesh.diagonal)
        image[p] = source_.surface.interpolate(at, weights);
    }
    return source_.onVertices(image);
  }

  MirrorPlane foundPlane(const std::string& pointer) {
    if (!plane_) {
      plane_ = source_.surface.symmetryPlane();
      if (!plane_) {
        source_.fail(pointer, "the source has no plane of symmetry that could be found",
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
      source_.findings.push_back(finding);
    }
    return *plane_;
  }

  VisualWeights scale(const SelectionPlace& place) {
    VisualWeights weights = at(place.value, place.value_pointer);
    for (double& w : weights) w *= place.number("by");
    return weights;
  }

  SelectionSource source_;
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
