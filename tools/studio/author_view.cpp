// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/author_view.h"

#include <imgui.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "tools/render/front.h"
#include "tools/studio/orbit.h"

namespace sinew::tools {
namespace {

constexpr float kWeightsTint = 1.0F;
constexpr Rgba8 kBrushColor = {255, 255, 255, 230};
constexpr Rgba8 kFalloffColor = {255, 255, 255, 110};
constexpr Rgba8 kPointColor = {255, 140, 0, 255};
constexpr Rgba8 kMuscleColor = {226, 60, 60, 255};
constexpr Rgba8 kHandleColor = {60, 190, 255, 255};
constexpr Rgba8 kRulerColor = {250, 220, 60, 255};
constexpr double kPointer = 0.12;  // diagonals, of what points somewhere

Eigen::Vector3d normalAt(const StudioSource& source, const SurfacePoint& at) {
  return source.surface->normal(at.triangle);
}

}  // namespace

void AuthorView::take(const std::shared_ptr<const StudioSource>& source, StudioState& state) {
  const bool is_first = source_ == nullptr;
  const double before = is_first ? 0 : source_->mesh.diagonal;
  source_ = source;
  const VisualMesh& mesh = source->mesh;
  center_ = 0.5 * (mesh.bounds_min + mesh.bounds_max);
  model_ = makeDrawModel(mesh);
  renderer_.reset();
  renderer_.emplace(model_);
  paint_.take(source);
  tinted_.reset();
  const auto diagonal = float(mesh.diagonal);
  if (is_first || std::abs(before - mesh.diagonal) > 0.2 * mesh.diagonal) {
    fits_ = false;
    state.brush.radius = state.brush.falloff = 0.02F * diagonal;
    state.brush.by = 0.01F * diagonal;
    state.pick_radius = 0.05F * diagonal;
    state.pick_falloff = 0.03F * diagonal;
    state.muscle_width = 0.06F * diagonal;
  }
  state.brush.symmetric = state.brush.symmetric && source->plane.has_value();
  state.picked.reset();
}

void AuthorView::fit(const ViewLayout& layout, ViewName view) {
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3f& p : model_.positions) points.push_back(p / model_.diagonal);
  camera_ = viewCamera(view, front_yaw_);
  fitCamera(camera_, points, layout.aspect(), 0.14F);
  camera_.target -= 0.02F * camera_.distance * camera_.up();  // above the line of help
  fits_ = true;
}

Eigen::Vector2f AuthorView::onScreen(const ViewLayout& layout, const Eigen::Vector3d& place) const {
  return tools::onScreen(layout, camera_, ((place - center_) / double(model_.diagonal)).cast<float>());
}

Look AuthorView::look(const ViewLayout& layout) const {
  const double scale = model_.diagonal;
  return {camera_.eye().cast<double>() * scale + center_, mouseRay(layout, camera_).cast<double>().normalized(),
          camera_.back().cast<double>(), double(camera_.distance) * scale};
}

void AuthorView::frame(const ViewLayout& layout, const Commands& commands, Document& document, StudioState& state) {
  const auto& evaluated = document.evaluated();
  if (evaluated != nullptr && evaluated->source != nullptr && evaluated->source != source_)
    take(evaluated->source, state);
  if (source_ == nullptr) return;
  const float front_yaw = frontYaw(document.recipe().settings.import.front, source_->mesh.up_axis);
  fits_ = fits_ && front_yaw == front_yaw_;
  front_yaw_ = front_yaw;
  if (!fits_) fit(layout);
  const ImGuiIO& io = ImGui::GetIO();
  for (const Command command : commands) run(command, layout, state);
  if (state.fly_to) flyTo(*std::exchange(state.fly_to, std::nullopt), state);
  const bool over_view = !io.WantCaptureMouse;
  Look look = this->look(layout);
  if (const bool begins = over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Left); begins || paint_.isStroking())
    look.pressure = pen_.pressure(begins);
  hover_ = over_view || paint_.isStroking() ? source_->surface->along(look.eye, look.ray) : SurfacePoint{};
  const bool looks = mouse_.begin(state.navigation, over_view);
  if (over_view && !looks && ImGui::IsMouseClicked(ImGuiMouseButton_Left) && !takeHandle(layout, document, state) &&
      !press(look, document, state))
    mouse_.leaveLeft();
  const bool left = ImGui::IsMouseDown(ImGuiMouseButton_Left);
  dragHandle(look, left, document, state);
  const bool moved = io.MouseDelta.x != 0 || io.MouseDelta.y != 0;
  const bool was_stroking = paint_.isStroking();
  paint_.frame(hover_, look, left, moved, document, state);
  tintStroke();
  // An unsaved stroke does not stay on the surface.
  if (was_stroking && !paint_.isStroking()) tinted_.reset();
  mouse_.frame(layout, paint_.isStroking() || held_.has_value(), over_view, camera_);
}

double AuthorView::pointerLength() const { return kPointer * double(model_.diagonal); }

// Those of the document, the one that is held as it is dragged.
std::vector<Gizmo> AuthorView::gizmos(const Document& document, const StudioState& state) const {
  std::vector<Gizmo> all = gizmosOf(document, state);
  for (Gizmo& gizmo : all) {
    if (held_ && held_->gizmo.pointer == gizmo.pointer) gizmo.value = held_->value;
  }
  return all;
}

bool AuthorView::takeHandle(const ViewLayout& layout, const Document& document, const StudioState& state) {
  const ImVec2 mouse = ImGui::GetIO().MousePos;
  double nearest = double(layout.handleReach());
  for (const Gizmo& gizmo : gizmosOf(document, state)) {
    for (const Handle& handle : handlesOf(gizmo, camera_.right().cast<double>(), pointerLength())) {
      const Eigen::Vector2f at = onScreen(layout, handle.place);
      const double distance = std::hypot(double(at.x() - mouse.x), double(at.y() - mouse.y));
      if (!(distance < nearest)) continue;
      nearest = distance;
      held_ = Held{gizmo, handle.kind, handle.place, gizmo.value};
    }
  }
  return held_.has_value();
}

void AuthorView::dragHandle(const Look& look, bool left, Document& document, StudioState& state) {
  handles_.clear();
  if (held_ && left) {
    const auto drawn = [&](const Eigen::Vector3d& p) {
      return Eigen::Vector3f(((p - center_) / double(model_.diagonal)).cast<float>());
    };
    Eigen::Vector3d to = held_->from + dragOffset(camera_, drawn(held_->from), look.ray.cast<float>()).cast<double>() *
                                           double(model_.diagonal);
    // A centre on the surface stays there.
    const bool on_surface = held_->kind == HandleKind::center && hover_.triangle != formats::kNone;
    if (on_surface) to = hover_.position;
    held_->value = dragged(held_->gizmo, held_->kind, to);
    if (held_->gizmo.pointer.empty()) {
      if (held_->kind == HandleKind::radius) state.pick_radius = held_->value["radius"].get<float>();
      if (held_->kind == HandleKind::normal && state.picked)
        state.picked->normal = (to - middleOf(held_->gizmo)).normalized();
    }
  } else if (held_) {
    const Held held = *std::exchange(held_, std::nullopt);
    if (!held.gizmo.pointer.empty() && held.value != held.gizmo.value)
      document.edit([&](RecipeEditor& editor) { editor.set(held.gizmo.pointer, held.value.dump()); });
  }
  for (const Gizmo& gizmo : gizmos(document, state)) {
    const auto more = handlesOf(gizmo, camera_.right().cast<double>(), pointerLength());
    handles_.insert(handles_.end(), more.begin(), more.end());
  }
}

void AuthorView::run(Command command, const ViewLayout& layout, StudioState& state) {
  switch (command) {
    case Command::fit:
    case Command::front:
      fit(layout);
      break;
    case Command::side:
      fit(layout, ViewName::side);
      break;
    case Command::top:
      fit(layout, ViewName::top);
      break;
    case Command::smaller:
      state.brush.radius *= 0.8F;
      break;
    case Command::larger:
      state.brush.radius *= 1.25F;
      break;
    case Command::symmetric:
      state.brush.symmetric = !state.brush.symmetric && source_->plane.has_value();
      break;
    default:
      break;
  }
}

void AuthorView::flyTo(const Eigen::Vector3d& place, StudioState& state) {
  camera_.target = ((place - center_) / double(model_.diagonal)).cast<float>();
  camera_.distance = std::min(camera_.distance, 0.6F);
  const SurfacePoint at = source_->surface->nearest(place);
  const Eigen::Vector3f n = normalAt(*source_, at).cast<float>();
  if (n.norm() > 0) {
    camera_.yaw = std::atan2(n.x(), n.z());
    camera_.pitch = std::asin(std::clamp(n.y(), -0.95F, 0.95F));
  }
  state.picked = pointAt(at);
}

PickedPoint AuthorView::pointAt(const SurfacePoint& at) const {
  return {at, normalAt(*source_, at), source_->visual[source_->surface->nearestCorner(at)].front()};
}

bool AuthorView::press(const Look& look, Document& document, StudioState& state) {
  const bool loops = state.tool == Tool::paint && state.brush.shape == BrushShape::lasso;
  if (hover_.triangle == formats::kNone && !loops) return false;
  if (state.tool == Tool::pick) {
    state.picked = pointAt(hover_);
    return true;
  }
  if (state.tool != Tool::paint || document.isInConflict()) return false;
  if (state.painted.empty()) {
    document.say("give a mask a name first", true);
    return false;
  }
  state.brush_milliseconds = 0;
  paint_.begin(hover_, look, document, state);
  return true;
}

void AuthorView::tintStroke() {
  if (paint_.changed().empty() || tints_.size() != source_->mesh.positions.size()) return;
  for (const std::uint32_t p : paint_.changed()) {
    for (const std::uint32_t v : source_->visual[p]) tints_[v] = heatColor(paint_.weights()[p]);
  }
  tints_changed_ = true;
}

void AuthorView::updateTints(const Document& document, const StudioState& state) {
  if (document.evaluated() == nullptr || document.evaluated()->source != source_) return;
  StudioState shown = state;
  // The brush shows what it does.
  if (state.tool == Tool::paint && !state.painted.empty()) {
    shown.show = Show::selected;
    shown.selected = Region{RegionKind::mask, state.painted};
  }
  const Tinted wanted = {document.evaluated() ? 1U : 0U,
                         document.evaluated().get(),
                         shown.selected,
                         shown.solo,
                         shown.hidden,
                         shown.colors,
                         shown.show};
  if (!paint_.isStroking() && tinted_ != wanted) {
    tints_ = tintsOf(shown, *document.evaluated());
    tinted_ = wanted;
    tints_changed_ = true;
  }
  if (std::exchange(tints_changed_, false)) renderer_->setTints(tints_);
}

// The brush's ring, the point, the ends of a muscle.
Annotation AuthorView::marks(const ViewLayout& layout, const Document& document, const StudioState& state) const {
  Annotation marks;
  marks.line_width = 2 * layout.scale * layout.pixels_per_unit;
  marks.hidden_opacity = 0.7F;
  const auto drawn = [&](const Eigen::Vector3d& p) { return Eigen::Vector3f((p - center_).cast<float>()); };
  const auto dot = [&](const Eigen::Vector3d& p, Rgba8 color) {
    marks.points.push_back(drawn(p));
    marks.dots.push_back({std::uint32_t(marks.points.size() - 1), color});
  };
  const auto ring = [&](const Eigen::Vector3d& at, const Eigen::Vector3d& normal, double radius, Rgba8 color) {
    if (!(radius > 0) || !(normal.norm() > 0)) return;
    const Eigen::Vector3d u = normal.unitOrthogonal();
    const Eigen::Vector3d v = normal.cross(u);
    constexpr std::uint32_t kCorners = 48;
    const auto first = std::uint32_t(marks.points.size());
    for (std::uint32_t i = 0; i < kCorners; ++i) {
      const double a = 2 * 3.14159265358979 * i / kCorners;
      marks.points.push_back(drawn(at + radius * (std::cos(a) * u + std::sin(a) * v)));
      marks.lines.push_back({first + i, first + (i + 1) % kCorners, color});
    }
  };
  const auto path = [&](std::span<const Eigen::Vector3d> points, bool closed, Rgba8 color) {
    const auto first = std::uint32_t(marks.points.size());
    const auto count = std::uint32_t(points.size());
    for (const Eigen::Vector3d& p : points) marks.points.push_back(drawn(p));
    for (std::uint32_t i = 0; i + (closed ? 0 : 1) < count; ++i)
      marks.lines.push_back({first + i, first + (i + 1) % count, color});
  };
  if (!paint_.loop().empty()) path(paint_.loop(), true, kBrushColor);
  const bool is_round = state.brush.shape != BrushShape::lasso;
  if (state.tool == Tool::paint && is_round && hover_.triangle != formats::kNone) {
    const bool flat = state.brush.shape == BrushShape::screen;
    const Eigen::Vector3d normal = flat ? camera_.back().cast<double>() : normalAt(*source_, hover_);
    ring(hover_.position, normal, double(state.brush.radius), kBrushColor);
    ring(hover_.position, normal, double(state.brush.radius + state.brush.falloff), kFalloffColor);
    if (state.brush.symmetric && source_->plane) {
      const MirrorPlane& plane = *source_->plane;
      const SurfacePoint image = source_->surface->nearest(mirrored(hover_.position, plane.point, plane.normal));
      ring(image.position, normalAt(*source_, image), double(state.brush.radius), kFalloffColor);
    }
  }
  for (const Gizmo& gizmo : gizmos(document, state)) {
    const Eigen::Vector3d middle = middleOf(gizmo);
    const double radius = radiusOf(gizmo);
    if (gizmo.pointer.empty() || gizmo.tail) dot(middle, kPointColor);
    const bool flat = state.picked && gizmo.pointer.empty();
    const Eigen::Vector3d normal = flat ? state.picked->normal : camera_.back().cast<double>();
    ring(middle, normal, radius, kPointColor);
    if (radius > 0) ring(middle, normal, radius + gizmo.value.value("falloff", 0.0), kFalloffColor);
    for (const Handle& handle : handlesOf(gizmo, camera_.right().cast<double>(), pointerLength())) {
      if (handle.kind == HandleKind::normal || handle.kind == HandleKind::fibre)
        path(std::array{middle, handle.place}, false, gizmo.is_found ? kFalloffColor : kHandleColor);
      dot(handle.place, kHandleColor);
    }
    if (gizmo.value.contains("normal"))
      ring(middle, handlesOf(gizmo, {}, 1).back().place - middle, pointerLength(), kFalloffColor);
  }
  if (state.tool == Tool::pick && state.ruler_from && state.picked)
    path(std::array{*state.ruler_from, state.picked->at.position}, false, kRulerColor);
  if (state.tool == Tool::pick) {
    if (state.muscle_from) dot(*state.muscle_from, kMuscleColor);
    if (state.muscle_to) dot(*state.muscle_to, kMuscleColor);
    if (state.muscle_from && state.muscle_to)
      path(std::array{*state.muscle_from, *state.muscle_to}, false, kMuscleColor);
  }
  return marks;
}

Renderer* AuthorView::draw(const ViewLayout& layout, const Document& document, const StudioState& state) {
  if (!renderer_) return nullptr;
  updateTints(document, state);
  renderer_->setAnnotation(marks(layout, document, state));
  DrawSettings settings;
  settings.tint = tints_.empty() ? 0 : kWeightsTint;
  settings.pinned = false;
  settings.dot_size = 9 * layout.scale * layout.pixels_per_unit;
  settings.shadow_radius = 0.55F;
  // The key light comes from beside the eye: what is painted is never in the dark.
  settings.lighting = turnedLighting(Lighting{}, camera_.yaw - 0.70F);
  settings.lighting.specular = 0.25F;
  camera_.near_plane = std::max(camera_.distance * 0.02F, 1e-3F);
  camera_.far_plane = camera_.distance + 40;
  renderer_->draw(camera_, settings, layout.width(), layout.height());
  return &*renderer_;
}

}  // namespace sinew::tools
