// SPDX-License-Identifier: GPL-3.0-or-later
//
// State of panels and tools of the studio, beside the document: what is chosen, shown and set. None of it is saved.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "tools/author/strokes.h"
#include "tools/studio/camera_mouse.h"
#include "tools/studio/document.h"

namespace sinew::tools {

enum class Tool : std::uint8_t { regions, paint, pick, play };

enum class RegionKind : std::uint8_t { cluster, mask, pins, part, stiffness, thickness };
/// Names in the order of the enum, as a heading has them.
const std::array<const char*, 6>& regionKindNames();

/// A region of the recipe. Factors have no name of their own: "1", "2", ...
struct Region {
  RegionKind kind = RegionKind::cluster;
  std::string name;
  auto operator<=>(const Region&) const = default;
};

/// Meaning of surface colours.
enum class Show : std::uint8_t { model, selected, all, uncovered, several };

/// Where the brush measures: along the surface, or as it is seen; a lasso is a loop around what is seen.
enum class BrushShape : std::uint8_t { surface, screen, lasso };

struct BrushSettings {
  BrushShape shape = BrushShape::surface;
  float radius = 0, falloff = 0;  ///< m; 0 before the source is known
  float strength = 1;             ///< 0..1
  StrokeMode mode = StrokeMode::paint;
  bool fill = false;  ///< the whole connected part instead of the radius
  bool symmetric = false, front_only = true;
  float by = 0;  ///< m, how far Grow and Shrink move the edge; 0 before the source is known
};

/// A place of the surface, at rest.
struct PickedPoint {
  SurfacePoint at;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit
  std::uint32_t vertex = 0;                          ///< visual, the nearest corner
};

struct StudioState {
  Tool tool = Tool::regions;
  Navigation navigation = Navigation::usual;
  std::optional<Region> selected;
  std::optional<Region> solo;
  std::set<Region> hidden;
  std::map<Region, std::array<float, 3>> colors;  ///< linear; changed by the artist
  Show show = Show::all;
  BrushSettings brush;
  std::string painted;            ///< name of the mask that is painted
  double brush_milliseconds = 0;  ///< of the longest step of the last stroke
  std::optional<PickedPoint> picked;
  float pick_radius = 0, pick_falloff = 0;
  int pick_shape = 0;  ///< disc, sphere, half space
  std::string pick_name;
  std::optional<Eigen::Vector3d> muscle_from, muscle_to;
  float muscle_width = 0;
  bool muscle_mirror = true;
  std::string muscle_name;
  std::optional<Eigen::Vector3d> ruler_from;  ///< m
  std::optional<Eigen::Vector3d> fly_to;      ///< m, the camera goes there in the next frame
};

/// The weights of a region by visual vertex; null where it is not evaluated.
const VisualWeights* weightsOf(const Evaluated& evaluated, const Region& region);
/// All regions that have weights, in the order of the panel.
std::vector<Region> regionsOf(const Evaluated& evaluated);
/// From `a` to `b`, t from 0 to 1.
std::array<float, 3> mixed(const std::array<float, 3>& a, const std::array<float, 3>& b, float t);
/// Its colour, linear.
std::array<float, 3> colorOf(const StudioState& state, const Evaluated& evaluated, const Region& region);

/// Colours of the surface, linear, by visual vertex; empty: the model's own.
std::vector<std::array<float, 3>> tintsOf(const StudioState& state, const Evaluated& evaluated);
/// Of a weight 0..1 as heat: grey, then from blue over green to yellow, which colour-blind eyes tell apart too.
std::array<float, 3> heatColor(double weight);

/// How many vertices are in no cluster, and in several.
struct Coverage {
  std::size_t none = 0, several = 0;
};
Coverage coverageOf(const Evaluated& evaluated);

}  // namespace sinew::tools
