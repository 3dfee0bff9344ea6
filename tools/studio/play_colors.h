// SPDX-License-Identifier: GPL-3.0-or-later
//
// Quantities of a body that plays, as colours of its surface.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "tools/studio/view_play.h"

namespace sinew::tools {

enum class PlayColor : std::uint8_t { model, stretch, volume, speed, attachment };
/// Names in the order of the enum, as a person reads them.
std::span<const std::string> playColorNames();

/// Colours of all vertices of a shape, those of colliders grey.
class PlayColors {
 public:
  /// Computes them anew; empty where the model's own colours are shown.
  const std::vector<std::array<float, 3>>& update(PlayColor what, const Play& play);
  /// Labels of the scale.
  struct Scale {
    std::string low, middle, high;
  };
  const Scale& scale() const { return scale_; }
  /// The same quantity as a number, by vertex of the bodies: a ratio, m/s, or m.
  std::span<const float> values() const { return values_; }

 private:
  // Where a visual vertex lies in the physical mesh: x = sum of weight x.
  struct Place {
    std::array<std::uint32_t, 4> vertex;
    std::array<float, 4> weight;
  };
  struct Rest {
    std::shared_ptr<const Asset> asset;
    std::vector<Place> places;   // by visual vertex
    std::vector<float> volumes;  // of the tetrahedra, m^3
  };
  const Rest& restOf(const std::shared_ptr<const Asset>& asset);
  void measure(PlayColor what, const Play& play);

  std::map<const Asset*, Rest> rest_;
  std::vector<float> values_;
  std::vector<std::array<float, 3>> tints_;
  Scale scale_;
};

/// Of a share of the scale, -1 .. 1: blue below, grey in the middle, orange above, which colour-blind eyes tell apart.
std::array<float, 3> divergingColor(float share);

}  // namespace sinew::tools
