// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tools/author/clusters.h"

namespace sinew::tools {

/// Settings of a cluster under one name, for those who think in materials.
struct MaterialPreset {
  struct Value {
    std::string_view key;  ///< without "clusters."
    double value = 0;
  };
  std::string_view name, sentence;
  std::vector<Value> values;
};

/// jelly, flesh, rubber, stiff, cloth. All of them set the same keys, so one replaces another wholly.
std::span<const MaterialPreset> materialPresets();
/// The preset that these settings are; empty where they are none.
std::string_view materialPresetOf(const ClusterOptions& options);

}  // namespace sinew::tools
