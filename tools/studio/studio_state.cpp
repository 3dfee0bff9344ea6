// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/studio_state.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "tools/render/draw_model.h"

namespace sinew::tools {
namespace {

constexpr std::array<float, 3> kBare = {0.36F, 0.37F, 0.39F};
constexpr std::array<float, 3> kMarked = {0.90F, 0.22F, 0.06F};
// A cluster below this holds nothing of a vertex.
constexpr double kNothing = 1e-3;

std::size_t numberOf(const std::string& name) {
  std::size_t number = 0;
  std::from_chars(name.data(), name.data() + name.size(), number);
  return number - 1;
}

template <class List>
std::optional<std::size_t> placeIn(const List& list, const std::string& name) {
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (list[i].name == name) return i;
  }
  return std::nullopt;
}

}  // namespace

std::array<float, 3> mixed(const std::array<float, 3>& a, const std::array<float, 3>& b, float t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}

const std::array<const char*, 6>& regionKindNames() {
  static constexpr std::array<const char*, 6> names = {"Clusters", "Masks", "Pins", "Parts", "Stiffness", "Thickness"};
  return names;
}

const VisualWeights* weightsOf(const Evaluated& evaluated, const Region& region) {
  const AuthoredWeights& weights = evaluated.weights;
  const Recipe& recipe = evaluated.recipe;
  const auto at = [](const std::vector<VisualWeights>& list, std::optional<std::size_t> i) {
    return i && *i < list.size() && !list[*i].empty() ? &list[*i] : nullptr;
  };
  switch (region.kind) {
    case RegionKind::cluster:
      return at(weights.cluster_weights, placeIn(weights.clusters, region.name));
    case RegionKind::mask:
      for (std::size_t m = 0; m < recipe.masks.size(); ++m) {
        if (recipe.masks[m].first == region.name) return at(weights.masks, m);
      }
      return nullptr;
    case RegionKind::pins:
      return at(weights.pins, placeIn(recipe.pins, region.name));
    case RegionKind::part:
      return at(weights.parts, placeIn(recipe.parts, region.name));
    case RegionKind::stiffness:
      return at(weights.stiffness, numberOf(region.name));
    case RegionKind::thickness:
      return at(weights.thickness, numberOf(region.name));
  }
  return nullptr;
}

std::vector<Region> regionsOf(const Evaluated& evaluated) {
  std::vector<Region> regions;
  const Recipe& recipe = evaluated.recipe;
  for (const RecipeCluster& cluster : evaluated.weights.clusters)
    regions.push_back({RegionKind::cluster, cluster.name});
  for (const auto& mask : recipe.masks) regions.push_back({RegionKind::mask, mask.first});
  for (const RecipePins& pins : recipe.pins) regions.push_back({RegionKind::pins, pins.name});
  for (const RecipePart& part : recipe.parts) regions.push_back({RegionKind::part, part.name});
  for (std::size_t i = 0; i < recipe.stiffness.size(); ++i)
    regions.push_back({RegionKind::stiffness, std::to_string(i + 1)});
  for (std::size_t i = 0; i < recipe.thickness.size(); ++i)
    regions.push_back({RegionKind::thickness, std::to_string(i + 1)});
  return regions;
}

std::array<float, 3> colorOf(const StudioState& state, const Evaluated& evaluated, const Region& region) {
  if (const auto own = state.colors.find(region); own != state.colors.end()) return own->second;
  const std::vector<Region> all = regionsOf(evaluated);
  return distinctColor(std::uint32_t(std::find(all.begin(), all.end(), region) - all.begin()));
}

std::array<float, 3> heatColor(double weight) {
  // Points of Viridis (Smith and van der Walt 2015), linear.
  static constexpr std::array<std::array<float, 3>, 5> kHeat = {{{0.058F, 0.0003F, 0.09F},
                                                                 {0.041F, 0.084F, 0.258F},
                                                                 {0.014F, 0.285F, 0.263F},
                                                                 {0.110F, 0.584F, 0.122F},
                                                                 {0.983F, 0.800F, 0.018F}}};
  if (!(weight > 0)) return kBare;
  const double at = std::min(weight, 1.0) * 4;
  const std::size_t i = std::min(std::size_t(at), std::size_t(3));
  const auto heat = mixed(kHeat[i], kHeat[i + 1], float(at - double(i)));
  return mixed(kBare, heat, float(std::min(1.0, weight * 8)));
}

std::vector<std::array<float, 3>> tintsOf(const StudioState& state, const Evaluated& evaluated) {
  if (state.show == Show::model || evaluated.source == nullptr) return {};
  const std::size_t count = evaluated.source->mesh.positions.size();
  std::vector<std::array<float, 3>> tints(count, kBare);
  if (state.show == Show::selected) {
    if (!state.selected) return tints;
    const VisualWeights* weights = weightsOf(evaluated, *state.selected);
    if (weights == nullptr) return tints;
    for (std::size_t v = 0; v < count; ++v) tints[v] = heatColor((*weights)[v]);
    return tints;
  }
  const auto& clusters = evaluated.weights.cluster_weights;
  if (state.show == Show::all && regionsOf(evaluated).empty()) return {};
  if (state.show != Show::all) {
    for (std::size_t v = 0; v < count; ++v) {
      std::size_t own = 0;
      for (const VisualWeights& weights : clusters) own += weights[v] > kNothing ? 1U : 0U;
      if (state.show == Show::uncovered ? own == 0 : own > 1) tints[v] = kMarked;
    }
    return tints;
  }
  std::vector<float> total(count, 0), largest(count, 0);
  std::vector<std::array<float, 3>> sum(count, {0, 0, 0});
  std::uint32_t number = 0;
  for (const Region& region : regionsOf(evaluated)) {
    const std::array<float, 3> own = distinctColor(number++);
    // Masks are what others are made of; by themselves they would cover all of those.
    const bool is_shown =
        state.solo ? region == *state.solo : region.kind != RegionKind::mask && !state.hidden.contains(region);
    const VisualWeights* weights = weightsOf(evaluated, region);
    if (!is_shown || weights == nullptr) continue;
    const auto changed = state.colors.find(region);
    const std::array<float, 3> color = changed == state.colors.end() ? own : changed->second;
    for (std::size_t v = 0; v < count; ++v) {
      const auto w = float((*weights)[v]);
      for (std::size_t k = 0; k < 3; ++k) sum[v][k] += w * color[k];
      total[v] += w;
      largest[v] = std::max(largest[v], w);
    }
  }
  for (std::size_t v = 0; v < count; ++v) {
    if (!(total[v] > 0)) continue;
    for (float& k : sum[v]) k /= total[v];
    tints[v] = mixed(kBare, sum[v], std::min(largest[v], 1.0F));
  }
  return tints;
}

Coverage coverageOf(const Evaluated& evaluated) {
  Coverage coverage;
  if (evaluated.source == nullptr) return coverage;
  const auto& clusters = evaluated.weights.cluster_weights;
  for (std::size_t v = 0; v < evaluated.source->mesh.positions.size(); ++v) {
    std::size_t own = 0;
    for (const VisualWeights& weights : clusters) own += weights[v] > kNothing ? 1U : 0U;
    coverage.none += own == 0 ? 1U : 0U;
    coverage.several += own > 1 ? 1U : 0U;
  }
  return coverage;
}

}  // namespace sinew::tools
