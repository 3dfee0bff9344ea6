// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/play_view.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "tools/studio/play_contacts.h"

namespace sinew::tools {
namespace {

constexpr Rgba8 kPickColor = {255, 140, 0, 255};
constexpr Rgba8 kLockColor = {60, 190, 255, 255};
constexpr Rgba8 kContactColor = {255, 60, 120, 255};

}  // namespace

Renderer& PlayView::draw(const ViewLayout& layout, const Shown& shown, ViewInput& input, Play& play) {
  Camera& camera = input.camera();
  if (!renderer_ || !play.shape().isLike(drawn_)) {
    drawn_ = play.shape();
    renderer_.reset();
    renderer_.emplace(modelOf(play.shape(), play.diagonal()));
  }
  const auto start = std::chrono::steady_clock::now();
  showShape(*renderer_, play.shape());
  const std::vector<std::array<float, 3>>& tints = colors_.update(shown.color, play);
  renderer_->setTints(tints);
  Annotation annotation;
  annotation.line_width = 2.5F * layout.scale * layout.pixels_per_unit;
  annotation.hidden_opacity = 0.6F;
  const auto dot = [&](const Eigen::Vector3f& at, Rgba8 color) {
    annotation.points.push_back(at);
    annotation.dots.push_back({std::uint32_t(annotation.points.size() - 1), color});
  };
  const auto line = [&](const Eigen::Vector3f& from, const Eigen::Vector3f& to, Rgba8 color) {
    annotation.points.push_back(from);
    annotation.points.push_back(to);
    const auto last = std::uint32_t(annotation.points.size() - 1);
    annotation.lines.push_back({last - 1, last, color});
  };
  if (const auto& grabbed = play.grabbed()) {
    line(play.shape().positions[grabbed->vertex], grabbed->target, kPickColor);
    dot(play.shape().positions[grabbed->vertex], kPickColor);
    dot(grabbed->target, kPickColor);
  }
  for (const auto& [at, target] : lockedPicks(play)) {
    line(at, target, kLockColor);
    dot(target, kLockColor);
  }
  if (play.hand == HandTool::target) {
    for (const Play::Target& target : play.targets()) {
      line(target.pivot, target.at(), kLockColor);
      dot(target.at(), kLockColor);
    }
  }
  if (shown.contacts) {
    for (const Eigen::Vector3f& at : contactsOf(play)) dot(at, kContactColor);
  }
  if (const auto& knife = input.knife()) {
    const float far = camera.distance * play.diagonal();
    const Eigen::Vector3f eye = camera.eye() * play.diagonal();
    line(eye + far * (*knife)[0], eye + far * (*knife)[1], kPickColor);
  }
  for (const std::vector<Handle> handles = input.handles(play); const Handle& handle : handles) {
    const Eigen::Vector3f at = handle.place.cast<float>();
    if (isTurn(handle.kind)) line(handles.front().place.cast<float>(), at, kLockColor);
    dot(at, kLockColor);
  }
  renderer_->setAnnotation(annotation);
  FrameTimes::add(play.times.colors, millisecondsSince(start));
  DrawSettings settings;
  settings.physical = shown.physical;
  settings.clusters = shown.clusters && tints.empty();
  settings.tint = tints.empty() ? 0 : 1;
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
  const auto drawing = std::chrono::steady_clock::now();
  Renderer* section = shown.section.shown
                          ? section_.draw(shown.section, play, camera, settings, layout.width(), layout.height())
                          : nullptr;
  if (section == nullptr) renderer_->draw(camera, settings, layout.width(), layout.height());
  FrameTimes::add(play.times.draw, millisecondsSince(drawing));
  return section != nullptr ? *section : *renderer_;
}

}  // namespace sinew::tools
