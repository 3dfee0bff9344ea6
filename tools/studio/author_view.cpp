// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/author_view.h"

#define GLFW_INCLUDE_NONE  // epoxy declares OpenGL
#include <GLFW/glfw3.h>
#include <imgui.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>

#include "tools/studio/orbit.h"

namespace sinew::tools {
namespace {

// Points of the surface that a brush looks at in a frame: about 3 ms.
constexpr std::size_t kMostPoints = 3000;
constexpr double kFillRadius = 1e9;  // m, beyond any model
constexpr float kWeightsTint = 1.0F;
constexpr Rgba8 kBrushColor = {255, 255, 255, 230};
constexpr Rgba8 kFalloffColor = {255, 255, 255, 110};
constexpr Rgba8 kPointColor = {255, 140, 0, 255};
constexpr Rgba8 kMuscleColor = {226, 60, 60, 255};

// Of this thread: a recipe may be evaluated meanwhile.
double cpuMilliseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * double(now.tv_sec) + 1e-6 * double(now.tv_nsec);
}

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
  brush_ = std::make_unique<StrokeBrush>(*source->surface);
  stroking_ = false;
  tinted_.reset();
  const auto diagonal = float(mesh.diagonal);
  if (is_first || std::abs(before - mesh.diagonal) > 0.2 * mesh.diagonal) {
    fits_ = false;
    state.brush.radius = state.brush.falloff = 0.02F * diagonal;
    state.pick_radius = 0.05F * diagonal;
    state.pick_falloff = 0.03F * diagonal;
    state.muscle_width = 0.06F * diagonal;
  }
  state.brush.symmetric = state.brush.symmetric && source->plane.has_value();
  state.picked.reset();
}

void AuthorView::fit(const ViewLayout& layout) {
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3f& p : model_.positions) points.push_back(p / model_.diagonal);
  camera_.yaw = 0.35F;
  camera_.pitch = 0.15F;
  fitCamera(camera_, points, layout.aspect(), 0.14F);
  camera_.target -= 0.02F * camera_.distance * camera_.up();  // above the line of help
  fits_ = true;
}

Eigen::Vector2f AuthorView::onScreen(const ViewLayout& layout, const Eigen::Vector3d& place) const {
  const Eigen::Matrix4f m = camera_.projection(layout.aspect()) * camera_.view();
  const Eigen::Vector3f at = ((place - center_) / double(model_.diagonal)).cast<float>();
  const Eigen::Vector4f clip = m * at.homogeneous();
  const float x = (clip.x() / clip.w() * 0.5F + 0.5F) * float(layout.width()) + float(layout.panel);
  const float y = (0.5F - clip.y() / clip.w() * 0.5F) * float(layout.height());
  return {x / layout.pixels_per_unit, y / layout.pixels_per_unit};
}

SurfacePoint AuthorView::under(const ViewLayout& layout) const {
  const Eigen::Vector3d eye = camera_.eye().cast<double>() * double(model_.diagonal) + center_;
  return source_->surface->along(eye, mouseRay(layout, camera_).cast<double>().normalized());
}

void AuthorView::frame(const ViewLayout& layout, std::span<const Keys::Press> pressed, Document& document,
                       StudioState& state) {
  const auto& evaluated = document.evaluated();
  if (evaluated != nullptr && evaluated->source != nullptr && evaluated->source != source_)
    take(evaluated->source, state);
  if (source_ == nullptr) return;
  if (!fits_) fit(layout);
  const ImGuiIO& io = ImGui::GetIO();
  for (const Keys::Press& press : pressed) {
    if (io.WantTextInput || press.control) continue;
    if (press.key == GLFW_KEY_F) fit(layout);
    if (press.key == GLFW_KEY_LEFT_BRACKET) state.brush.radius *= 0.8F;
    if (press.key == GLFW_KEY_RIGHT_BRACKET) state.brush.radius *= 1.25F;
    if (press.key == GLFW_KEY_X) state.brush.symmetric = !state.brush.symmetric && source_->plane.has_value();
  }
  if (state.fly_to) {
    camera_.target = ((*state.fly_to - center_) / double(model_.diagonal)).cast<float>();
    camera_.distance = std::min(camera_.distance, 0.6F);
    const SurfacePoint at = source_->surface->nearest(*state.fly_to);
    const Eigen::Vector3f n = normalAt(*source_, at).cast<float>();
    if (n.norm() > 0) {
      camera_.yaw = std::atan2(n.x(), n.z());
      camera_.pitch = std::asin(std::clamp(n.y(), -0.95F, 0.95F));
    }
    state.picked =
        PickedPoint{at, normalAt(*source_, at), source_->visual[source_->surface->nearestCorner(at)].front()};
    state.fly_to.reset();
  }
  const bool over_view = !io.WantCaptureMouse;
  hover_ = over_view || stroking_ ? under(layout) : SurfacePoint{};
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Left)) {
    if (hover_.triangle == kNoIndex || io.KeyShift) {
      drag_ = io.KeyShift ? CameraDrag::pan : CameraDrag::orbit;
    } else if (state.tool == Tool::paint && !state.painted.empty() && !document.isInConflict()) {
      state.brush_milliseconds = 0;
      beginStroke(hover_, document, state);
    } else if (state.tool == Tool::pick) {
      state.picked = PickedPoint{hover_, normalAt(*source_, hover_),
                                 source_->visual[source_->surface->nearestCorner(hover_)].front()};
    } else {
      if (state.tool == Tool::paint) document.say("give a mask a name first", true);
      drag_ = CameraDrag::orbit;
    }
  }
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Right))
    drag_ = io.KeyShift ? CameraDrag::pan : CameraDrag::orbit;
  if (over_view && ImGui::IsMouseClicked(ImGuiMouseButton_Middle)) drag_ = CameraDrag::pan;
  const bool left = ImGui::IsMouseDown(ImGuiMouseButton_Left);
  if (!left && !ImGui::IsMouseDown(ImGuiMouseButton_Right) && !ImGui::IsMouseDown(ImGuiMouseButton_Middle))
    drag_ = CameraDrag::none;
  if (stroking_) {
    const double start = cpuMilliseconds();
    const bool moved = (io.MouseDelta.x != 0 || io.MouseDelta.y != 0) && stroke_.radius < kFillRadius;
    if (left && moved && hover_.triangle != kNoIndex) {
      stroke_.points.push_back(hover_.position);
      brush_->add(hover_.position);
    }
    const bool done = brush_->advance(kMostPoints);
    tintStroke();
    state.brush_milliseconds = std::max(state.brush_milliseconds, cpuMilliseconds() - start);
    if (!left && done) endStroke(document, state);
  }
  moveCamera(layout, stroking_ ? CameraDrag::none : drag_, over_view, camera_);
}

void AuthorView::beginStroke(const SurfacePoint& at, const Document& document, const StudioState& state) {
  const BrushSettings& brush = state.brush;
  stroke_ = {};
  stroke_.radius = brush.fill ? kFillRadius : sevenDigits(double(brush.radius));
  stroke_.falloff = brush.fill ? 0 : sevenDigits(double(brush.falloff));
  stroke_.strength = sevenDigits(double(brush.strength));
  stroke_.mode = brush.mode;
  if (brush.front_only && !brush.fill) stroke_.facing = camera_.back().cast<double>();
  if (brush.symmetric) stroke_.mirror = source_->plane;
  stroke_.points = {at.position};
  std::vector<double> before(source_->mesh.welded_positions.size(), 0);
  const VisualWeights* weights = weightsOf(*document.evaluated(), {RegionKind::mask, state.painted});
  if (weights != nullptr) {
    for (std::size_t v = 0; v < weights->size(); ++v) before[source_->mesh.welded[v]] = (*weights)[v];
  }
  brush_->begin(stroke_, std::move(before));
  brush_->add(at.position);
  stroking_ = true;
}

void AuthorView::tintStroke() {
  if (tints_.size() != source_->mesh.positions.size()) return;
  for (const std::uint32_t p : brush_->changed()) {
    for (const std::uint32_t v : source_->visual[p]) tints_[v] = heatColor(brush_->weights()[p]);
  }
  tints_changed_ = true;
}

void AuthorView::endStroke(Document& document, StudioState& state) {
  stroking_ = false;
  const std::vector<double>& points = brush_->weights();
  if (!brush_->hasChanged()) {
    document.say("the stroke changes no vertex: it meets none that is not so already. A larger radius reaches more.");
    return;
  }
  VisualWeights weights(source_->mesh.positions.size());
  for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = points[source_->mesh.welded[v]];
  document.stroke(state.painted, stroke_, std::move(weights));
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
  if (!stroking_ && tinted_ != wanted) {
    tints_ = tintsOf(shown, *document.evaluated());
    tinted_ = wanted;
    tints_changed_ = true;
  }
  if (std::exchange(tints_changed_, false)) renderer_->setTints(tints_);
}

// The brush's ring, the point, the ends of a muscle.
Annotation AuthorView::marks(const ViewLayout& layout, const StudioState& state) const {
  Annotation marks;
  marks.line_width = 2 * layout.scale * layout.pixels_per_unit;
  marks.hidden_opacity = 0.45F;
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
  if (state.tool == Tool::paint && hover_.triangle != kNoIndex) {
    const Eigen::Vector3d normal = normalAt(*source_, hover_);
    ring(hover_.position, normal, double(state.brush.radius), kBrushColor);
    ring(hover_.position, normal, double(state.brush.radius + state.brush.falloff), kFalloffColor);
    if (state.brush.symmetric && source_->plane) {
      const MirrorPlane& plane = *source_->plane;
      const SurfacePoint image = source_->surface->nearest(mirrored(hover_.position, plane.point, plane.normal));
      ring(image.position, normalAt(*source_, image), double(state.brush.radius), kFalloffColor);
    }
  }
  if (state.tool == Tool::pick && state.picked) {
    dot(state.picked->at.position, kPointColor);
    if (state.pick_shape != 2) {
      ring(state.picked->at.position, state.picked->normal, double(state.pick_radius), kPointColor);
      ring(state.picked->at.position, state.picked->normal, double(state.pick_radius + state.pick_falloff),
           kFalloffColor);
    }
  }
  if (state.tool == Tool::pick) {
    if (state.muscle_from) dot(*state.muscle_from, kMuscleColor);
    if (state.muscle_to) dot(*state.muscle_to, kMuscleColor);
    if (state.muscle_from && state.muscle_to) {
      marks.points.push_back(drawn(*state.muscle_from));
      marks.points.push_back(drawn(*state.muscle_to));
      const auto last = std::uint32_t(marks.points.size() - 1);
      marks.lines.push_back({last - 1, last, kMuscleColor});
    }
  }
  return marks;
}

Renderer* AuthorView::draw(const ViewLayout& layout, const Document& document, const StudioState& state) {
  if (!renderer_) return nullptr;
  updateTints(document, state);
  renderer_->setAnnotation(marks(layout, state));
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
