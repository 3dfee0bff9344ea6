// SPDX-License-Identifier: GPL-3.0-or-later
//
// Brush strokes: the file that holds them, and what they do to weights. A recipe's selection and a window's brush run
// the same code.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/author/seen_front.h"
#include "tools/author/surface.h"

namespace sinew::tools {

/// A stroke's effect on weights; w is the brush's own, 1 inside its radius times its strength.
enum class StrokeMode : std::uint8_t {
  paint,     ///< at least w
  add,       ///< more by w, 1 at most
  subtract,  ///< less by w, 0 at least
  erase,     ///< at most 1 - w
  smooth,    ///< nearer to the neighbours' mean
  grow,      ///< the edge (where weights are one half) moves out by the radius; all of the mask, no points
  shrink     ///< and in
};
/// Names in the order of the enum, as a stroke file has them.
std::span<const std::string_view> strokeModeNames();

/// Whether it changes all of a mask, and has no points.
bool isWhole(StrokeMode mode);

struct Stroke {
  std::vector<Eigen::Vector3d> points;  ///< metres; each stands for the surface point nearest to it
  /// Of a pen, one a point, 0..1: there the radius is this part of it. Empty: all 1.
  std::vector<double> pressures;
  double radius = 0;    ///< m, > 0, along the surface; a lasso has none
  double falloff = 0;   ///< m, from 1 at the radius to 0
  double strength = 1;  ///< 0..1
  StrokeMode mode = StrokeMode::paint;
  std::optional<Eigen::Vector3d> facing;  ///< unit; only what faces this direction is painted
  std::optional<MirrorPlane> mirror;      ///< the stroke has an image across it
  /// m; radius and falloff are then as seen from here, in metres at the points' depth. Points are where
  /// they are.
  std::optional<Eigen::Vector3d> eye;
  bool through = false;  ///< of an eye: what is hidden, or faces away, is painted too
  bool lasso = false;    ///< of an eye: points are the corners of a loop, and all inside is painted
};

/// A stroke's fault, as part of a message; empty: none.
std::string whatIsWrong(const Stroke& stroke);

/// Reads a stroke file (docs/recipe-format.md). Throws ToolError(bad_input) naming file, line and cure.
std::vector<Stroke> readStrokes(const std::filesystem::path& file);
/// The text of a stroke file.
std::string strokesText(std::span<const Stroke> strokes);

/// Lays strokes on weights, point by point.
class StrokeBrush {
 public:
  /// \param surface must outlive it
  explicit StrokeBrush(const Surface& surface);

  /// Begins a stroke. \param stroke its points are not looked at. \param weights by welded point, 0..1
  void begin(const Stroke& stroke, std::vector<double> weights);
  /// The stroke goes on to a point (metres), at most half a radius at a time; or a lasso has this corner.
  void add(const Eigen::Vector3d& point, double pressure = 1);
  /// All points of a stroke, one after the other.
  void addAll(const Stroke& stroke);
  /// Does what the points so far say, or a part of it. \param most points of the surface that are looked at: 1,000 take
  /// about 1 ms. \return whether all is done
  bool advance(std::size_t most = std::numeric_limits<std::size_t>::max());
  /// By welded point; what the last advance() has changed is in changed().
  const std::vector<double>& weights() const { return weights_; }
  std::vector<double> takeWeights() { return std::move(weights_); }
  const std::vector<std::uint32_t>& changed() const { return changed_; }
  /// Whether the stroke has changed any weight so far.
  bool hasChanged() const { return changed_any_; }
  /// Points of this stroke that lie further than 5 % of the diagonal from the surface.
  std::size_t off() const { return off_; }

 private:
  void place(const Eigen::Vector3d& point, double pressure);
  void beginSeen(const Eigen::Vector3d& toward);
  bool spread(std::size_t most);
  double own(std::uint32_t point);
  void smooth();
  void moveEdge();

  const Surface& surface_;
  SurfaceFront front_;
  std::vector<SeenFront> seen_;  // of an eye: from there, and from its mirror image
  bool sees_ = false;
  std::vector<Eigen::Vector3d> corners_;  // of a lasso
  Stroke stroke_;
  std::optional<Eigen::Vector3d> last_;
  double last_pressure_ = 1;
  std::vector<double> before_, weights_;
  std::vector<std::uint32_t> changed_;
  std::vector<Eigen::Vector3d> normals_;  // by welded point
  std::vector<std::vector<std::uint32_t>> neighbours_;
  std::size_t off_ = 0;
  bool changed_any_ = false;
};

}  // namespace sinew::tools
