// SPDX-License-Identifier: GPL-3.0-or-later
//
// Faces and vertices so far from all else in a file that they are mistakes.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "tools/import/raw_scene.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

struct StrayFaces {
  std::vector<std::uint32_t> faces;  ///< of the file, ascending; empty where there are none
  double distance = 0;               ///< of the nearest of them from the middle of the others, m
  double reach = 0;                  ///< of the others from that middle, m
};

/// The faces behind the first wide gap, going outwards from the middle, where they have next to no area.
/// \param points      of all meshes, one after the other
/// \param first_point of each mesh
StrayFaces findStrayFaces(const RawScene& scene, const std::vector<Eigen::Vector3d>& points,
                          const std::vector<std::uint32_t>& first_point);

/// The vertices behind a wide gap, each alone in its faces, ascending; none where there is no such gap or they make a
/// wall. \param x metres
std::vector<std::uint32_t> findFlungVertices(const std::vector<Eigen::Vector3d>& x,
                                             const std::vector<Triangle>& triangles);

}  // namespace sinew::tools
