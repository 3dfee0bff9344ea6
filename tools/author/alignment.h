// SPDX-License-Identifier: GPL-3.0-or-later
//
// Where a new version of a source stands against the old one: unit, axes, place.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "tools/author/surface.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A similarity: x -> scale * rotation * x + translation, metres.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  Similarity inverse() const;
  /// Whether it moves nothing of a model of this size (m) by more than 1e-4 of it.
  bool isIdentity(double diagonal) const;
};

struct Alignment {
  Similarity to_old;  ///< from the new mesh's metres to the old one's
  /// How far the two surfaces then lie apart, in diagonals of the old one: mean over the nearer 85 % of points, of
  /// both.
  double error = 1;
};

/// Finds the similarity that lays the new surface onto the old one. Tries the 24 turns that map axes to axes and those
/// of a turntable, the scales that sizes and common units suggest, and three ways of placing; what is simpler wins
/// unless another is clearly better; then refines it by matching nearest points (Besl and McKay 1992) where that helps.
/// Parts that one of them lacks may be up to 15 % of it. \param pairs places of the old mesh and of the new one that
/// are known to belong together, may be empty: the similarity that fits most of them (Umeyama 1991) is tried too.
Alignment findAlignment(const VisualMesh& old_mesh, const Surface& old_surface, const VisualMesh& new_mesh,
                        const Surface& new_surface,
                        const std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>& pairs);

}  // namespace sinew::tools
