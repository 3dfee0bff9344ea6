// SPDX-License-Identifier: GPL-3.0-or-later
//
// Painting by mouse: strokes along the surface and on the screen, and loops.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "tools/author/strokes.h"
#include "tools/studio/document.h"
#include "tools/studio/studio_state.h"

namespace sinew::tools {

/// How the view is looked at under the mouse. In metres of the source.
struct Look {
  Eigen::Vector3d eye = Eigen::Vector3d::Zero();
  Eigen::Vector3d ray = Eigen::Vector3d::Zero();   ///< unit, under the mouse
  Eigen::Vector3d back = Eigen::Vector3d::Zero();  ///< unit, out of the picture
  double depth = 1;                                ///< m, of what the camera turns about
  double pressure = 1;                             ///< of a pen, 0..1; of a mouse 1
  /// Under the mouse, at that depth.
  Eigen::Vector3d atDepth() const { return eye - ray * (depth / ray.dot(back)); }
};

class PaintTool {
 public:
  void take(const std::shared_ptr<const StudioSource>& source);
  /// \pre the state names a mask. \param at where the stroke begins; a loop may begin beside the surface
  void begin(const SurfacePoint& at, const Look& look, const Document& document, const StudioState& state);
  /// Goes on while the button is down, and ends the stroke as an edit of the document. \param moved since the last
  /// frame
  void frame(const SurfacePoint& at, const Look& look, bool down, bool moved, Document& document, StudioState& state);
  bool isStroking() const { return stroking_; }

  /// Welded points whose weight the last frame has changed, and the weights of all.
  std::span<const std::uint32_t> changed() const { return changed_; }
  const std::vector<double>& weights() const { return brush_->weights(); }
  /// Corners of the loop that is drawn; empty where none is.
  std::span<const Eigen::Vector3d> loop() const;

 private:
  void end(Document& document, const StudioState& state);

  std::shared_ptr<const StudioSource> source_;
  std::unique_ptr<StrokeBrush> brush_;
  bool stroking_ = false, released_ = false;
  Stroke stroke_;
  std::vector<std::uint32_t> changed_;
};

/// Lays a stroke that has all its points on a mask, as an edit of the document. \pre the document has a source
void layStroke(Document& document, const std::string& mask, const Stroke& stroke);

}  // namespace sinew::tools
