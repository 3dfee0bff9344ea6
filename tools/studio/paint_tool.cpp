// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/paint_tool.h"

#include <ctime>

namespace sinew::tools {
namespace {

// Points of the surface that a brush looks at in a frame: about 3 ms.
constexpr std::size_t kMostPoints = 3000;
constexpr double kFillRadius = 1e9;  // m, beyond any model
// Of the depth: corners of a loop lie at least so far apart.
constexpr double kCornerStep = 0.004;

// Of this thread: a recipe may be evaluated meanwhile.
double cpuMilliseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * double(now.tv_sec) + 1e-6 * double(now.tv_nsec);
}

// Weights of a mask by welded point.
std::vector<double> pointWeights(const StudioSource& source, const Document& document, const std::string& mask) {
  std::vector<double> points(source.mesh.welded_positions.size(), 0);
  const VisualWeights* weights = weightsOf(*document.evaluated(), {RegionKind::mask, mask});
  if (weights == nullptr) return points;
  for (std::size_t v = 0; v < weights->size(); ++v) points[source.mesh.welded[v]] = (*weights)[v];
  return points;
}

void save(const StudioSource& source, const StrokeBrush& brush, const Stroke& stroke, const std::string& mask,
          Document& document) {
  if (!brush.hasChanged()) {
    document.say(isWhole(stroke.mode) ? "nothing changes: the mask has no edge, where weights cross one half"
                                      : "the stroke changes no vertex: it meets none that is not so already. A larger "
                                        "radius reaches more.");
    return;
  }
  VisualWeights weights(source.mesh.positions.size());
  for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = brush.weights()[source.mesh.welded[v]];
  document.stroke(mask, stroke, std::move(weights));
}

}  // namespace

void PaintTool::take(const std::shared_ptr<const StudioSource>& source) {
  source_ = source;
  brush_ = std::make_unique<StrokeBrush>(*source->surface);
  stroking_ = false;
  changed_.clear();
}

void PaintTool::begin(const SurfacePoint& at, const Look& look, const Document& document, const StudioState& state) {
  const BrushSettings& brush = state.brush;
  const bool fills = brush.fill && brush.shape == BrushShape::surface;
  stroke_ = {};
  stroke_.lasso = brush.shape == BrushShape::lasso;
  if (!stroke_.lasso) stroke_.radius = fills ? kFillRadius : sevenDigits(double(brush.radius));
  stroke_.falloff = fills ? 0 : sevenDigits(double(brush.falloff));
  stroke_.strength = sevenDigits(double(brush.strength));
  stroke_.mode = brush.mode;
  if (brush.shape != BrushShape::surface) {
    stroke_.eye = look.eye;
    stroke_.through = !brush.front_only;
  } else if (brush.front_only && !fills) {
    stroke_.facing = look.back;
  }
  if (brush.symmetric) stroke_.mirror = source_->plane;
  stroke_.points = {stroke_.lasso ? look.atDepth() : at.position};
  brush_->begin(stroke_, pointWeights(*source_, document, state.painted));
  if (!stroke_.lasso) stroke_.pressures = {look.pressure};
  brush_->add(stroke_.points.front(), look.pressure);
  changed_.clear();
  stroking_ = true;
  released_ = false;
}

void PaintTool::frame(const SurfacePoint& at, const Look& look, bool down, bool moved, Document& document,
                      StudioState& state) {
  changed_.clear();
  if (!stroking_) return;
  const double start = cpuMilliseconds();
  if (stroke_.lasso) {
    const Eigen::Vector3d corner = look.atDepth();
    if (down && (corner - stroke_.points.back()).norm() > kCornerStep * look.depth) {
      stroke_.points.push_back(corner);
      brush_->add(corner);
    }
    if (!down && stroke_.points.size() < 3) {
      stroking_ = false;
      document.say("a loop is dragged around what is to be painted");
      return;
    }
  } else if (down && moved && stroke_.radius < kFillRadius && at.triangle != formats::kNone) {
    stroke_.points.push_back(at.position);
    stroke_.pressures.push_back(look.pressure);
    brush_->add(at.position, look.pressure);
  }
  released_ = released_ || !down;
  // The loop is closed by letting go.
  const bool done = stroke_.lasso && !released_ ? false : brush_->advance(kMostPoints);
  changed_ = brush_->changed();
  state.brush_milliseconds = std::max(state.brush_milliseconds, cpuMilliseconds() - start);
  if (released_ && done) end(document, state);
}

void PaintTool::end(Document& document, const StudioState& state) {
  stroking_ = false;
  save(*source_, *brush_, stroke_, state.painted, document);
}

std::span<const Eigen::Vector3d> PaintTool::loop() const {
  return stroking_ && stroke_.lasso ? std::span<const Eigen::Vector3d>(stroke_.points)
                                    : std::span<const Eigen::Vector3d>{};
}

void layStroke(Document& document, const std::string& mask, const Stroke& stroke) {
  const StudioSource& source = *document.evaluated()->source;
  StrokeBrush brush(*source.surface);
  brush.begin(stroke, pointWeights(source, document, mask));
  brush.addAll(stroke);
  brush.advance();
  save(source, brush, stroke, mask, document);
}

}  // namespace sinew::tools
