// SPDX-License-Identifier: GPL-3.0-or-later
//
// The tab of a point: what it is, and what can be made there.
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>

#include "tools/studio/studio_state.h"
#include "tools/studio/widgets.h"

namespace sinew::tools {

class PickPanel {
 public:
  void draw(Document& document, StudioState& state, Widgets& widgets);

 private:
  static void describe(const Document& document, const PickedPoint& point, Widgets& widgets);
  void ruler(const Document& document, StudioState& state, Widgets& widgets);
  static void place(Document& document, StudioState& state, Widgets& widgets);
  static void muscle(Document& document, StudioState& state, Widgets& widgets);

  std::pair<Eigen::Vector3d, Eigen::Vector3d> ruler_;  // its ends, that along_ was found for
  std::string along_;
};

/// The selection that the panel makes at the point, as a recipe has it.
nlohmann::ordered_json selectionAt(const PickedPoint& point, int shape, double radius, double falloff);

}  // namespace sinew::tools
