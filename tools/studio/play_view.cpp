// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/play_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sinew::tools {
namespace {

constexpr Rgba8 kPickColor = {255, 140, 0, 255};

}  // namespace

Renderer& PlayView::draw(const ViewLayout& layout, const Shown& shown, Camera& camera, const Play& play) {
  if (!renderer_ || !play.shape().isLike(drawn_)) {
    drawn_ = play.shape();
    renderer_.reset();
    renderer_.emplace(modelOf(play.shape(), play.diagonal()));
  }
  showShape(*renderer_, play.shape());
  Annotation annotation;
  if (const auto& grabbed = play.grabbed()) {
    annotation.points = {play.shape().positions[grabbed->vertex], grabbed->target};
    annotation.lines = {{0, 1, kPickColor}};
    annotation.dots = {{0, kPickColor}, {1, kPickColor}};
    annotation.line_width = 2.5F * layout.scale * layout.pixels_per_unit;
    annotation.hidden_opacity = 0.6F;
  }
  renderer_->setAnnotation(annotation);
  DrawSettings settings;
  settings.physical = shown.physical;
  settings.clusters = shown.clusters;
  settings.pinned = shown.pinned;
  settings.ground = play.scene().hasGround();
  settings.ground_height = play.scene().groundHeight() / play.diagonal();
  settings.line_width = 1.1F * layout.scale * layout.pixels_per_unit;
  settings.dot_size = 8 * layout.scale * layout.pixels_per_unit;
  Eigen::Vector3f low = Eigen::Vector3f::Constant(std::numeric_limits<float>::infinity());
  Eigen::Vector3f high = -low;
  for (const Eigen::Vector3f& p : play.shape().positions) {
    if (!p.allFinite()) continue;
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  if (low.allFinite() && high.allFinite()) {
    settings.shadow_center = (low + high) / (2 * play.diagonal());
    // In steps, so that the shadow's texels keep their size while the body wobbles.
    const float radius = std::max((high - low).norm() / (2 * play.diagonal()), 0.05F);
    settings.shadow_radius = std::pow(1.25F, std::ceil(std::log(radius) / std::log(1.25F)));
  }
  camera.near_plane = std::max(camera.distance * 0.02F, 1e-3F);
  camera.far_plane = camera.distance + 40;
  renderer_->draw(camera, settings, layout.width(), layout.height());
  return *renderer_;
}

}  // namespace sinew::tools
