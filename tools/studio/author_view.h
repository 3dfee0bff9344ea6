// SPDX-License-Identifier: GPL-3.0-or-later
//
// The source at rest, as regions are painted and picked on it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tools/render/renderer.h"
#include "tools/studio/camera_mouse.h"
#include "tools/studio/gizmo.h"
#include "tools/studio/paint_tool.h"
#include "tools/studio/pen.h"
#include "tools/studio/shortcuts.h"
#include "tools/studio/studio_state.h"

namespace sinew::tools {

class AuthorView {
 public:
  /// Obeys mouse and keys. \param seconds s, the clock of strokes' cost
  void frame(const ViewLayout& layout, const Commands& commands, Document& document, StudioState& state);
  /// Draws into the renderer's own target; present() what is returned. Null while there is no source.
  Renderer* draw(const ViewLayout& layout, const Document& document, const StudioState& state);

  const Camera& camera() const { return camera_; }
  /// Where a place of the source (m) lies in the window.
  Eigen::Vector2f onScreen(const ViewLayout& layout, const Eigen::Vector3d& place) const;
  bool isStroking() const { return paint_.isStroking(); }
  bool hasSource() const { return source_ != nullptr; }
  double metresPerUnit() const { return double(model_.diagonal); }
  /// Handles that can be dragged now.
  const std::vector<Handle>& handles() const { return handles_; }

 private:
  void take(const std::shared_ptr<const StudioSource>& source, StudioState& state);
  void fit(const ViewLayout& layout, ViewName view = ViewName::front);
  void run(Command command, const ViewLayout& layout, StudioState& state);
  void flyTo(const Eigen::Vector3d& place, StudioState& state);
  PickedPoint pointAt(const SurfacePoint& at) const;
  bool takeHandle(const ViewLayout& layout, const Document& document, const StudioState& state);
  void dragHandle(const Look& look, bool left, Document& document, StudioState& state);
  double pointerLength() const;
  /// Obeys the left button that went down. \return false: nothing
  bool press(const Look& look, Document& document, StudioState& state);
  Look look(const ViewLayout& layout) const;
  /// The colours of what the brush has changed.
  void tintStroke();
  void updateTints(const Document& document, const StudioState& state);
  Annotation marks(const ViewLayout& layout, const Document& document, const StudioState& state) const;
  std::vector<Gizmo> gizmos(const Document& document, const StudioState& state) const;

  std::shared_ptr<const StudioSource> source_;
  float front_yaw_ = 0;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  std::optional<Renderer> renderer_;
  DrawModel model_;
  Camera camera_;
  bool fits_ = false;
  CameraMouse mouse_;
  SurfacePoint hover_;
  PaintTool paint_;
  Pen pen_;
  std::vector<Handle> handles_;
  struct Held {
    Gizmo gizmo;
    HandleKind kind;
    Eigen::Vector3d from;  // m, where the handle was
    nlohmann::ordered_json value;
  };
  std::optional<Held> held_;
  std::vector<std::array<float, 3>> tints_;
  bool tints_changed_ = false;
  // Sources of tints_.
  struct Tinted {
    std::uint32_t evaluations = 0;
    const void* evaluated = nullptr;
    std::optional<Region> selected, solo;
    std::set<Region> hidden;
    std::map<Region, std::array<float, 3>> colors;
    Show show = Show::model;
    bool operator==(const Tinted&) const = default;
  };
  std::optional<Tinted> tinted_;
};

}  // namespace sinew::tools
