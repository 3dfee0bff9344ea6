// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <span>

namespace sinew::tools {

/// The normal of a vertex that carries a layer of prisms, and its least cosine with the faces around.
struct LayerNormal {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
  double least = -1;
  /// A face that the normal leans over further than this (cosine 0.05) has no prism there: the surface folds.
  [[nodiscard]] bool folds() const { return least < kLeastLean; }
  static constexpr double kLeastLean = 0.05;
};

/// The unit vector whose smallest cosine with some unit normals is largest (Aubry & Loehner 2008): the centre of their
/// smallest cap, by at most 200 small steps towards the worst one. No normals: folds.
LayerNormal layerNormal(std::span<const Eigen::Vector3d> normals);

/// Whether no unit vector has this cosine, > 0, with all of some unit normals. Doubt after 20 such steps means none.
bool leansOver(std::span<const Eigen::Vector3d> normals, double cosine);

}  // namespace sinew::tools
