// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/material_presets.h"

#include <algorithm>

#include "tools/author/settings.h"

namespace sinew::tools {
namespace {

MaterialPreset preset(std::string_view name, std::string_view sentence, double stretch_hz, double bend_hz,
                      double limit_min, double limit_max) {
  return {name,
          sentence,
          {{"stretch_hz", stretch_hz},
           {"bend_hz", bend_hz},
           {"twist_hz", bend_hz},
           {"limit_min", limit_min},
           {"limit_max", limit_max}}};
}

}  // namespace

std::span<const MaterialPreset> materialPresets() {
  static const std::vector<MaterialPreset> presets = {
      preset("jelly", "wobbles for long and gives way far", 4, 4, 0.4, 2),
      preset("flesh", "the defaults: a belly, a cheek", 10, 10, 0.5, 1.5),
      preset("rubber", "springs back fast", 25, 25, 0.5, 2),
      preset("stiff", "hardly gives way: gristle, a hoof's pad", 80, 80, 0.8, 1.2),
      preset("cloth", "of sheets: bends freely and, being thin, hardly stretches", 2, 2, 0.8, 1.1)};
  return presets;
}

std::string_view materialPresetOf(const ClusterOptions& options) {
  Settings settings;
  settings.clusters = options;
  for (const MaterialPreset& preset : materialPresets()) {
    const bool is_this = std::all_of(preset.values.begin(), preset.values.end(), [&](const auto& value) {
      const auto now = settings.recipeValue(std::string(kClusterPrefix).append(value.key));
      return now.is_number() && now.template get<double>() == value.value;
    });
    if (is_this) return preset.name;
  }
  return "";
}

}  // namespace sinew::tools
