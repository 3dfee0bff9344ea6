// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/gizmo.h"

#include <algorithm>
#include <array>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/author/json_text.h"
#include "tools/studio/pick_panel.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 3> kPlaced = {"disc", "sphere", "half_space"};

// The key that places a selection; empty: it is not placed.
std::string placedKey(const Json& selection) {
  for (const char* key : kPlaced) {
    if (selection.is_object() && selection.contains(key) && selection[key].is_array() && selection[key].size() == 3)
      return key;
  }
  return "";
}

// The selection of a region; through a mask's name to the mask.
std::optional<SelectionText> selectionOf(const Recipe& recipe, const Region& region) {
  const auto named = [&](const auto& list) -> std::optional<SelectionText> {
    for (const auto& entry : list) {
      if (entry.name == region.name) return entry.from;
    }
    return std::nullopt;
  };
  std::optional<SelectionText> found;
  if (region.kind == RegionKind::mask) {
    if (const SelectionText* mask = recipe.mask(region.name)) found = *mask;
  } else if (region.kind == RegionKind::cluster) {
    found = named(recipe.clusters);
  } else if (region.kind == RegionKind::pins) {
    found = named(recipe.pins);
  } else if (region.kind == RegionKind::part) {
    found = named(recipe.parts);
  }
  if (found && found->json.is_string()) {
    const SelectionText* mask = recipe.mask(found->json.get<std::string>());
    return mask == nullptr ? std::nullopt : std::optional(*mask);
  }
  return found;
}

// Weighted middle of a region and its longest axis, unit.
std::pair<Vector3d, Vector3d> axisOf(const VisualMesh& mesh, const VisualWeights& weights) {
  Vector3d middle = Vector3d::Zero();
  double total = 0;
  for (std::size_t v = 0; v < weights.size(); ++v) middle += weights[v] * mesh.positions[v], total += weights[v];
  if (!(total > 0)) return {middle, Vector3d::UnitX()};
  middle /= total;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (std::size_t v = 0; v < weights.size(); ++v) {
    const Vector3d x = mesh.positions[v] - middle;
    spread += weights[v] * x * x.transpose();
  }
  return {middle, geometry::symmetricEigen(spread).vectors.col(2)};
}

}  // namespace

std::string handleName(HandleKind kind) {
  static constexpr std::array<const char*, 9> names = {"center", "radius", "normal", "fibre", "size x",
                                                       "size y", "size z", "turn x", "turn y"};
  return std::string("handle ") + names[std::size_t(kind)];
}

std::vector<Gizmo> gizmosOf(const Document& document, const StudioState& state) {
  std::vector<Gizmo> gizmos;
  if (document.evaluated() == nullptr || document.evaluated()->source == nullptr) return gizmos;
  if (state.tool == Tool::pick && state.picked) {
    gizmos.push_back(
        {"", selectionAt(*state.picked, state.pick_shape, double(state.pick_radius), double(state.pick_falloff)),
         std::nullopt, false});
    return gizmos;
  }
  if (state.tool != Tool::regions || !state.selected || !document.isCurrent()) return gizmos;
  const Recipe& recipe = document.recipe();
  const auto selection = selectionOf(recipe, *state.selected);
  if (selection && !placedKey(selection->json).empty())
    gizmos.push_back({selection->pointer, selection->json, std::nullopt, false});
  if (state.selected->kind != RegionKind::cluster) return gizmos;
  for (const RecipeCluster& cluster : recipe.clusters) {
    if (cluster.name != state.selected->name || cluster.channel.empty()) continue;
    const VisualWeights* weights = weightsOf(*document.evaluated(), *state.selected);
    if (weights == nullptr) continue;
    const auto [middle, axis] = axisOf(document.evaluated()->source->mesh, *weights);
    const Vector3d direction = cluster.fibre ? cluster.fibre->normalized() : axis;
    gizmos.push_back({cluster.pointer + "/fibre", jsonOf(direction), middle, !cluster.fibre.has_value()});
  }
  return gizmos;
}

Vector3d middleOf(const Gizmo& gizmo) {
  if (gizmo.tail) return *gizmo.tail;
  return pointOf(gizmo.value[placedKey(gizmo.value)]);
}

double radiusOf(const Gizmo& gizmo) {
  return !gizmo.tail && gizmo.value.contains("radius") ? gizmo.value["radius"].get<double>() : 0;
}

std::vector<Handle> handlesOf(const Gizmo& gizmo, const Vector3d& right, double length) {
  const Vector3d middle = middleOf(gizmo);
  if (gizmo.tail) return {{HandleKind::fibre, middle + length * pointOf(gizmo.value).normalized()}};
  // Where a point was picked, picking again moves it.
  std::vector<Handle> handles;
  if (!gizmo.pointer.empty()) handles.push_back({HandleKind::center, middle});
  if (radiusOf(gizmo) > 0) handles.push_back({HandleKind::radius, middle + radiusOf(gizmo) * right});
  if (gizmo.value.contains("normal"))
    handles.push_back({HandleKind::normal, middle + length * pointOf(gizmo.value["normal"]).normalized()});
  return handles;
}

Json dragged(const Gizmo& gizmo, HandleKind kind, const Vector3d& to) {
  Json value = gizmo.value;
  const Vector3d way = to - middleOf(gizmo);
  switch (kind) {
    case HandleKind::center:
      value[placedKey(value)] = jsonOf(to);
      break;
    case HandleKind::radius:
      value["radius"] = sevenDigits(std::max(way.norm(), 1e-9));
      break;
    case HandleKind::normal:
      if (way.norm() > 0) value["normal"] = jsonOf(way.normalized());
      break;
    case HandleKind::fibre:
      if (way.norm() > 0) value = jsonOf(way.normalized());
      break;
    default:
      break;  // of a collider
  }
  return value;
}

}  // namespace sinew::tools
