// SPDX-License-Identifier: GPL-3.0-or-later
//
// Handles of what is placed in a recipe: discs, spheres and half spaces of masks, clusters and pins, and fibres. No
// window in it.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/studio/handle.h"
#include "tools/studio/studio_state.h"

namespace sinew::tools {

/// Something with handles.
struct Gizmo {
  std::string pointer;                  ///< in the recipe; empty: what the tab Pick is about to make
  nlohmann::ordered_json value;         ///< the selection, or the direction of a fibre
  std::optional<Eigen::Vector3d> tail;  ///< m, of a fibre
  bool is_found = false;                ///< a fibre that the bake would choose: dragging it makes it the recipe's
};

/// Those of the selected region, or of the point that was picked.
std::vector<Gizmo> gizmosOf(const Document& document, const StudioState& state);
/// \param right unit, of the picture: the handle of a radius lies there. \param length m, of what points somewhere
std::vector<Handle> handlesOf(const Gizmo& gizmo, const Eigen::Vector3d& right, double length);
/// The gizmo after a handle is dragged to a place; numbers as a recipe has them.
nlohmann::ordered_json dragged(const Gizmo& gizmo, HandleKind kind, const Eigen::Vector3d& to);

/// The middle of a disc, sphere or half space, or the tail of a fibre, m.
Eigen::Vector3d middleOf(const Gizmo& gizmo);
/// Its radius, m; 0 where it has none.
double radiusOf(const Gizmo& gizmo);

}  // namespace sinew::tools
