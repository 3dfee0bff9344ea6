// SPDX-License-Identifier: GPL-3.0-or-later
//
// Distances in a picture, for brushes and loops on the screen. As SurfaceFront, but as an eye sees them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "tools/author/surface.h"

namespace sinew::tools {

class SeenFront {
 public:
  /// \param surface must outlive it
  explicit SeenFront(const Surface& surface);

  /// Forgets all places and looks from an eye. Costs a look at each point. \param along unit, to the picture's middle.
  /// \param normals of the welded points where hidden points are left out; empty: they are not
  void begin(const Eigen::Vector3d& eye, const Eigen::Vector3d& along, std::span<const Eigen::Vector3d> normals);
  /// Lets distances spread from a place: those in the picture, in metres at the place's depth. \param from m, the
  /// distance there. \param limit m; what is farther is never reached
  void add(const Eigen::Vector3d& place, double from, double limit);
  /// The same from the inside of a loop, where they are 0. \param corners in order around it, at least 3
  void addLoop(std::span<const Eigen::Vector3d> corners, double limit);
  /// Spreads on. \param most points that are looked at; a ray counts as ten. \return whether all is done
  bool spread(std::size_t most);

  // As those of SurfaceFront.
  const std::vector<double>& distances() const { return distance_; }
  const std::vector<std::uint32_t>& reached() const { return reached_; }
  std::vector<std::uint32_t> takeChanged() { return std::exchange(changed_, {}); }

 private:
  struct Seen {
    Eigen::Vector2d at;
    double depth;  // m, along the middle
  };
  Seen seen(const Eigen::Vector3d& place) const;
  bool isVisible(std::uint32_t point);
  void makeGrid(double cell);
  /// Calls use(point) for what lies in the cells of a box.
  template <class Use>
  void inBox(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Use& use) const;

  const Surface& surface_;
  Eigen::Vector3d eye_ = Eigen::Vector3d::Zero(), u_, v_, along_;
  bool only_visible_ = false;
  std::vector<Eigen::Vector2d> at_;    // by point, of those in the grid
  std::vector<std::uint32_t> points_;  // in front of the eye, facing it where only these count
  // Points of each cell, row by row.
  Eigen::Vector2d low_ = Eigen::Vector2d::Zero(), high_ = Eigen::Vector2d::Zero();
  double cell_ = 0;
  bool is_first_ = true;
  std::size_t columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> first_, sorted_;
  std::vector<std::pair<std::uint32_t, double>> waiting_;  // points and their distances
  std::size_t next_ = 0;
  enum class Sight : std::uint8_t { unknown, visible, hidden };
  std::vector<Sight> sight_;
  std::vector<double> distance_;
  std::vector<std::uint32_t> reached_, changed_;
};

}  // namespace sinew::tools
