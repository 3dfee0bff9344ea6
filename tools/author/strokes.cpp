// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/strokes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/json_text.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

constexpr std::array<std::string_view, 7> kModes = {"paint", "add", "subtract", "erase", "smooth", "grow", "shrink"};
// Of the diagonal: points of a stroke further from the surface than this were meant for another model.
constexpr double kOffSurface = 0.05;
// Of the diagonal: how far the sides may differ, as in the selection `mirror`.
constexpr double kMirrorTolerance = 0.02;
constexpr int kSmoothRounds = 10;

// 1 up to the edge, falling to 0 over `falloff` outside.
double ramp(double outside, double falloff) {
  if (outside <= 0) return 1;
  return falloff > 0 ? geometry::smoothstep(1 - outside / falloff) : 0;
}

bool isPoint(const Json& p) {
  return p.is_array() && p.size() == 3 && p[0].is_number() && p[1].is_number() && p[2].is_number();
}
// As isPoint(), or with a pressure.
bool isPressed(const Json& p) {
  if (!p.is_array() || p.size() != 4 || !p[3].is_number()) return isPoint(p);
  return isPoint({p[0], p[1], p[2]}) && p[3].get<double>() >= 0 && p[3].get<double>() <= 1;
}
bool isPoints(const Json& value) {
  return value.is_array() && !value.empty() && std::all_of(value.begin(), value.end(), isPoint);
}

Stroke readStroke(const JsonText& text, const Json& json, const std::string& pointer) {
  Stroke stroke;
  if (!json.is_object()) text.fail(pointer, "a stroke must be an object", "Give points and radius.");
  const std::vector<std::string> known = {"points", "radius", "falloff", "strength", "mode", "erase",
                                          "facing", "mirror", "eye",     "through",  "lasso"};
  for (const auto& [key, value] : json.items()) {
    const std::string place = childPointer(pointer, key);
    const auto number = [&, &entry = value](double minimum, double maximum) {
      if (!entry.is_number() || entry.template get<double>() < minimum || entry.template get<double>() > maximum)
        text.fail(place, "cannot be " + entry.dump(), "Give a number in metres, or 0 .. 1 for strength.");
      return entry.template get<double>();
    };
    if (key == "points") {
      if (!value.is_array() || value.empty() || !std::all_of(value.begin(), value.end(), isPressed))
        text.fail(place, "must be a list of points",
                  "Write [[x, y, z], ...], in metres; a pressure, 0 .. 1, may follow.");
      for (const Json& p : value) {
        stroke.points.push_back(pointOf(p));
        stroke.pressures.push_back(p.size() == 4 ? p[3].get<double>() : 1);
      }
    } else if (key == "radius") {
      stroke.radius = number(1e-9, 1e9);
    } else if (key == "falloff") {
      stroke.falloff = number(0, 1e9);
    } else if (key == "strength") {
      stroke.strength = number(0, 1);
    } else if (key == "mode") {
      const auto found = std::find(kModes.begin(), kModes.end(), value.is_string() ? value.get<std::string>() : "");
      if (found == kModes.end())
        text.fail(place, "cannot be " + value.dump(), "Write paint, add, subtract, erase, smooth, grow or shrink.");
      stroke.mode = StrokeMode(found - kModes.begin());
    } else if (key == "erase" || key == "through" || key == "lasso") {
      if (!value.is_boolean()) text.fail(place, "must be true or false", "Write true, or leave it out.");
      if (key == "erase" && value.get<bool>()) stroke.mode = StrokeMode::erase;
      if (key == "through") stroke.through = value.get<bool>();
      if (key == "lasso") stroke.lasso = value.get<bool>();
    } else if (key == "eye") {
      if (!isPoint(value)) text.fail(place, "must be a point", "Write [x, y, z], in metres.");
      stroke.eye = pointOf(value);
    } else if (key == "facing") {
      if (!isPoint(value) || !(pointOf(value).norm() > 0))
        text.fail(place, "must be a direction that is not zero", "Write [x, y, z].");
      stroke.facing = pointOf(value).normalized();
    } else if (key == "mirror") {
      if (!isPoints(value) || value.size() != 2 || !(pointOf(value[1]).norm() > 0))
        text.fail(place, "must be a point of the plane and its normal", "Write [[x, y, z], [x, y, z]].");
      stroke.mirror = MirrorPlane{pointOf(value[0]), pointOf(value[1]).normalized(), 0};
    } else {
      text.fail(place, "there is no key '" + key + "' in a stroke", "Did you mean " + nearestName(key, known) + "?");
    }
  }
  if (const std::string wrong = whatIsWrong(stroke); !wrong.empty())
    text.fail(pointer, wrong, R"(Write {"points": [[x, y, z]], "radius": 0.01}.)");
  return stroke;
}

}  // namespace

std::span<const std::string_view> strokeModeNames() { return kModes; }

bool isWhole(StrokeMode mode) { return mode == StrokeMode::grow || mode == StrokeMode::shrink; }

std::string whatIsWrong(const Stroke& stroke) {
  if (isWhole(stroke.mode)) {
    if (!stroke.points.empty()) return "a stroke that grows or shrinks does so everywhere: it has no points";
    return stroke.radius > 0 ? "" : "a stroke that grows or shrinks needs a radius: how far";
  }
  if (stroke.lasso) {
    if (!stroke.eye) return "a lasso needs the eye that sees it";
    return stroke.points.size() >= 3 ? "" : "a lasso needs three points at least";
  }
  return stroke.points.empty() || !(stroke.radius > 0) ? "a stroke needs points and a radius" : "";
}

std::vector<Stroke> readStrokes(const std::filesystem::path& file) {
  const JsonText text = JsonText::read(file.string());
  const Json& json = text.json();
  const auto isList = [](const Json& value) { return value.is_array() && !value.empty(); };
  if (!json.is_object() || !json.contains("strokes") || !isList(json["strokes"])) {
    text.fail("", "is no stroke file", R"(It looks like {"strokes": [{"points": [[x, y, z]], "radius": 0.01}]}.)");
  }
  std::vector<Stroke> strokes;
  for (std::size_t i = 0; i < json["strokes"].size(); ++i)
    strokes.push_back(readStroke(text, json["strokes"][i], childPointer("/strokes", i)));
  return strokes;
}

std::string strokesText(std::span<const Stroke> strokes) {
  std::string text = "{\"strokes\": [";
  for (std::size_t i = 0; i < strokes.size(); ++i) {
    const Stroke& stroke = strokes[i];
    Json json;
    for (std::size_t k = 0; k < stroke.points.size(); ++k) {
      Json point = jsonOf(stroke.points[k]);
      if (!stroke.pressures.empty() && stroke.pressures[k] < 1) point.push_back(sevenDigits(stroke.pressures[k]));
      json["points"].push_back(std::move(point));
    }
    if (!stroke.lasso) json["radius"] = sevenDigits(stroke.radius);
    json["falloff"] = sevenDigits(stroke.falloff);
    json["strength"] = sevenDigits(stroke.strength);
    if (stroke.mode != StrokeMode::paint) json["mode"] = kModes[std::size_t(stroke.mode)];
    if (stroke.facing) json["facing"] = jsonOf(*stroke.facing);
    if (stroke.eye) json["eye"] = jsonOf(*stroke.eye);
    if (stroke.through) json["through"] = true;
    if (stroke.lasso) json["lasso"] = true;
    if (stroke.mirror) json["mirror"] = {jsonOf(stroke.mirror->point), jsonOf(stroke.mirror->normal)};
    text += (i == 0 ? "\n  " : ",\n  ") + json.dump();
  }
  return text + "\n]}\n";
}

StrokeBrush::StrokeBrush(const Surface& surface)
    : surface_(surface), front_(surface), normals_(surface.pointNormals()) {}

void StrokeBrush::begin(const Stroke& stroke, std::vector<double> weights) {
  stroke_ = stroke;
  stroke_.points.clear();
  front_.clear();
  sees_ = false;
  last_.reset();
  corners_.clear();
  changed_.clear();
  changed_any_ = false;
  off_ = 0;
  before_ = std::move(weights);
  weights_ = before_;
  if (stroke.mode != StrokeMode::smooth || !neighbours_.empty()) return;
  neighbours_.resize(before_.size());
  const VisualMesh& mesh = surface_.mesh();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle c = mesh.weldedTriangle(t);
    for (std::size_t k = 0; k < 3; ++k) {
      neighbours_[c[k]].push_back(c[(k + 1) % 3]);
      neighbours_[c[k]].push_back(c[(k + 2) % 3]);
    }
  }
  for (auto& list : neighbours_) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
}

// Both eyes look to what was painted first.
void StrokeBrush::beginSeen(const Vector3d& toward) {
  sees_ = true;
  const auto look = [&](std::size_t i, const Vector3d& eye, const Vector3d& at) {
    if (seen_.size() == i) seen_.emplace_back(surface_);
    seen_[i].begin(eye, (at - eye).stableNormalized(), stroke_.through ? std::span<const Vector3d>{} : normals_);
  };
  look(0, *stroke_.eye, toward);
  if (!stroke_.mirror) {
    if (seen_.size() > 1) seen_.pop_back();
    return;
  }
  const MirrorPlane& plane = *stroke_.mirror;
  look(1, mirrored(*stroke_.eye, plane.point, plane.normal), mirrored(toward, plane.point, plane.normal));
}

// A smaller radius: distances begin with what it lacks.
void StrokeBrush::place(const Vector3d& point, double pressure) {
  const double limit = stroke_.radius + stroke_.falloff, from = (1 - pressure) * stroke_.radius;
  if (stroke_.eye) {
    if (!sees_) beginSeen(point);
    seen_[0].add(point, from, limit);
    if (stroke_.mirror) seen_[1].add(mirrored(point, stroke_.mirror->point, stroke_.mirror->normal), from, limit);
    return;
  }
  front_.add(surface_.nearest(point), from, limit);
  if (!stroke_.mirror) return;
  const SurfacePoint image = surface_.nearest(mirrored(point, stroke_.mirror->point, stroke_.mirror->normal));
  if (image.distance <= kMirrorTolerance * surface_.mesh().diagonal) front_.add(image, from, limit);
}

void StrokeBrush::addAll(const Stroke& stroke) {
  for (std::size_t i = 0; i < stroke.points.size(); ++i)
    add(stroke.points[i], stroke.pressures.empty() ? 1 : stroke.pressures[i]);
}

void StrokeBrush::add(const Vector3d& point, double pressure) {
  if (stroke_.lasso) {
    corners_.push_back(point);
    return;
  }
  // Points of a quick stroke lie far apart: in between, half a radius at a time.
  const Vector3d step = last_ ? Vector3d(point - *last_) : Vector3d(Vector3d::Zero());
  const int pieces = std::clamp(int(std::ceil(2 * step.norm() / stroke_.radius)), 1, 1000);
  for (int s = 1; s <= pieces; ++s) {
    const double back = last_ ? 1 - double(s) / pieces : 0;
    place(point - back * step, pressure - back * (pressure - last_pressure_));
  }
  if (surface_.nearest(point).distance > kOffSurface * surface_.mesh().diagonal) ++off_;
  last_ = point;
  last_pressure_ = pressure;
}

double StrokeBrush::own(std::uint32_t point) {
  if (sees_) {
    double distance = seen_[0].distances()[point];
    if (stroke_.mirror) distance = std::min(distance, seen_[1].distances()[point]);
    return stroke_.strength * ramp(distance - (stroke_.lasso ? 0 : stroke_.radius), stroke_.falloff);
  }
  if (stroke_.facing) {
    const Vector3d& n = normals_[point];
    bool faces = n.dot(*stroke_.facing) > 0;
    if (stroke_.mirror && !faces) {
      const Vector3d& across = stroke_.mirror->normal;
      faces = n.dot(*stroke_.facing - 2 * stroke_.facing->dot(across) * across) > 0;
    }
    if (!faces) return 0;
  }
  return stroke_.strength * ramp(front_.distances()[point] - stroke_.radius, stroke_.falloff);
}

// Brings distances on; changed_ says of which points.
bool StrokeBrush::spread(std::size_t most) {
  if (!stroke_.eye) {
    const bool done = front_.spread(most);
    changed_ = front_.takeChanged();
    return done;
  }
  if (corners_.size() >= 3) {
    Vector3d middle = Vector3d::Zero();
    for (const Vector3d& corner : corners_) middle += corner / double(corners_.size());
    beginSeen(middle);
    seen_[0].addLoop(corners_, stroke_.falloff);
    if (stroke_.mirror) {
      for (Vector3d& corner : corners_) corner = mirrored(corner, stroke_.mirror->point, stroke_.mirror->normal);
      seen_[1].addLoop(corners_, stroke_.falloff);
    }
    corners_.clear();
  }
  changed_.clear();
  bool done = true;
  if (!sees_) return done;
  for (SeenFront& front : seen_) {
    done = front.spread(most) && done;
    const std::vector<std::uint32_t> more = front.takeChanged();
    changed_.insert(changed_.end(), more.begin(), more.end());
  }
  return done;
}

bool StrokeBrush::advance(std::size_t most) {
  if (isWhole(stroke_.mode)) {
    moveEdge();
    return true;
  }
  const bool done = spread(most);
  if (stroke_.mode == StrokeMode::smooth) {
    if (done) smooth();
    return done;
  }
  for (const std::uint32_t p : changed_) {
    const double w = own(p);
    const double before = before_[p];
    weights_[p] = stroke_.mode == StrokeMode::paint      ? std::max(before, w)
                  : stroke_.mode == StrokeMode::add      ? std::min(1.0, before + w)
                  : stroke_.mode == StrokeMode::subtract ? std::max(0.0, before - w)
                                                         : std::min(before, 1 - w);
    changed_any_ = changed_any_ || weights_[p] != before;
  }
  return done;
}

// The edge lies where weights are one half; the ramp begins there.
void StrokeBrush::moveEdge() {
  const std::vector<double> distance = surface_.signedDistances(before_);
  changed_.clear();
  for (std::uint32_t p = 0; p < distance.size(); ++p) {
    const double by = stroke_.mode == StrokeMode::grow ? -stroke_.radius : stroke_.radius;
    const double w = ramp(distance[p] + by, stroke_.falloff);
    const double all = stroke_.mode == StrokeMode::grow ? std::max(before_[p], w) : std::min(before_[p], w);
    weights_[p] = before_[p] + stroke_.strength * (all - before_[p]);
    if (weights_[p] != before_[p]) changed_.push_back(p);
  }
  changed_any_ = !changed_.empty();
}

void StrokeBrush::smooth() {
  changed_.clear();
  if (sees_) {
    for (const SeenFront& front : seen_)
      changed_.insert(changed_.end(), front.reached().begin(), front.reached().end());
  } else {
    changed_ = front_.reached();
  }
  for (const std::uint32_t p : changed_) weights_[p] = before_[p];
  std::vector<double> brush(changed_.size()), next(changed_.size());
  for (std::size_t i = 0; i < changed_.size(); ++i) brush[i] = own(changed_[i]);
  for (int round = 0; round < kSmoothRounds; ++round) {
    for (std::size_t i = 0; i < changed_.size(); ++i) {
      const std::uint32_t p = changed_[i];
      double mean = 0;
      for (const std::uint32_t q : neighbours_[p]) mean += weights_[q] / double(neighbours_[p].size());
      next[i] = weights_[p] + brush[i] * (mean - weights_[p]);
    }
    for (std::size_t i = 0; i < changed_.size(); ++i) weights_[changed_[i]] = next[i];
  }
  for (const std::uint32_t p : changed_) changed_any_ = changed_any_ || weights_[p] != before_[p];
}

}  // namespace sinew::tools
