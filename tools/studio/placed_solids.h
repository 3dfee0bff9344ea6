// SPDX-License-Identifier: GPL-3.0-or-later
//
// Colliders that are placed by hand in the scene that plays, and their handles. No window in it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/scene/scene_text.h"
#include "tools/studio/handle.h"

namespace sinew::tools {

/// How one becomes another: it goes to its place in the next step and takes bodies along, is there at once, or has
/// another shape or surface.
enum class SolidChange : std::uint8_t { goes, jumps, anew };

/// They stay where they are in the world, whatever scene plays there.
class PlacedSolids {
 public:
  /// Names one as it was in a moment: a number of its own for each change.
  struct Mark {
    ColliderId id;
    std::uint32_t change;
  };

  std::size_t size() const { return solids_.size(); }
  const PlacedSolid& operator[](std::size_t i) const { return solids_[i].solid; }
  /// All of them, for a scene's file.
  std::vector<PlacedSolid> all() const;

  /// Adds one to the scene, and selects it. Throws ToolError(bad_input), as the others do, and changes nothing.
  void add(Scene& scene, const PlacedSolid& solid);
  void change(Scene& scene, std::size_t i, const PlacedSolid& solid, SolidChange how);
  void remove(Scene& scene, std::size_t i);

  /// Puts all into a scene that has none of them.
  void enter(Scene& scene);
  std::vector<Mark> marks() const;
  /// Makes a scene that went back to a moment have them as they are now. \param then marks() of the moment
  void meet(Scene& scene, std::span<const Mark> then);

  /// The one whose handles are shown.
  std::optional<std::size_t> selected;

 private:
  struct Entry {
    PlacedSolid solid;
    Mark mark;
  };
  std::vector<Entry> solids_;
  std::uint32_t changes_ = 0;
};

/// Its middle, its sizes, and what turns it. \param right, length as of a gizmo's
std::vector<Handle> handlesOf(const PlacedSolid& solid, const Eigen::Vector3f& right, float length);
/// The solid after a handle is dragged to a place (m, world); lengths as a scene's file may have them.
PlacedSolid dragged(const PlacedSolid& solid, HandleKind kind, const Eigen::Vector3f& to);

}  // namespace sinew::tools
