// SPDX-License-Identifier: GPL-3.0-or-later
//
// The source at rest, as regions are painted and picked on it.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tools/author/strokes.h"
#include "tools/render/renderer.h"
#include "tools/studio/studio_state.h"
#include "tools/studio/view_input.h"

namespace sinew::tools {

class AuthorView {
 public:
  /// What mouse and keys do. \param seconds s, the clock of strokes' cost
  void frame(const ViewLayout& layout, std::span<const Keys::Press> pressed, Document& document, StudioState& state);
  /// Draws into the renderer's own target; present() what is returned. Null while there is no source.
  Renderer* draw(const ViewLayout& layout, const Document& document, const StudioState& state);

  const Camera& camera() const { return camera_; }
  /// Where a place of the source (m) lies in the window.
  Eigen::Vector2f onScreen(const ViewLayout& layout, const Eigen::Vector3d& place) const;
  bool isStroking() const { return stroking_; }
  bool hasSource() const { return source_ != nullptr; }

 private:
  void take(const std::shared_ptr<const StudioSource>& source, StudioState& state);
  void fit(const ViewLayout& layout);
  SurfacePoint under(const ViewLayout& layout) const;
  void beginStroke(const SurfacePoint& at, const Document& document, const StudioState& state);
  void endStroke(Document& document, StudioState& state);
  /// The colours of what the brush has changed.
  void tintStroke();
  void updateTints(const Document& document, const StudioState& state);
  Annotation marks(const ViewLayout& layout, const StudioState& state) const;

  std::shared_ptr<const StudioSource> source_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  std::optional<Renderer> renderer_;
  DrawModel model_;
  Camera camera_;
  bool fits_ = false;
  CameraDrag drag_ = CameraDrag::none;
  SurfacePoint hover_;
  std::unique_ptr<StrokeBrush> brush_;
  bool stroking_ = false;
  Stroke stroke_;
  std::vector<std::array<float, 3>> tints_;
  bool tints_changed_ = false;
  // What tints_ was made for.
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
