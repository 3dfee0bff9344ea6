// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"

namespace sinew::tools {

/// A package of `study steps` and what tables call it.
struct StepsBody {
  std::string name;
  std::shared_ptr<const Asset> asset;
  const SolverFactory* solver = nullptr;  ///< null: its fields
};

/// Meshes made here and baked as an artist's are (some hundred physical vertices each, all settings else at their
/// defaults): "box"; "beam"; "neck", a ball on a thin neck on a plate; "uneven", two boxes of 1 m and 0.1 m in one
/// file; "sheet", open; "rope", a tube of 2 m by 4 cm; "tetrahedron", a single one, in as few vertices as a bake makes
/// of it. Bounds within a few metres, standing on y = 0. Throws ToolError where the machine fails. \param worker a
/// program that imports (ImportOptions::worker); empty: the one that runs.
std::vector<StepsBody> builtInStepsBodies(const std::filesystem::path& worker = {});

}  // namespace sinew::tools
