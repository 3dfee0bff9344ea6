// SPDX-License-Identifier: GPL-3.0-or-later
//
// Packages that studies make in memory.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "sinew/formats/writer.h"
#include "sinew/runtime/asset.h"

namespace sinew::tools {

/// Options of a study's package. Its clusters are linear.
struct StudyPackageOptions {
  double frequency_hz = 1;                                  ///< of all classes of modes
  std::optional<formats::ClusterMechanics> mechanics = {};  ///< of every cluster; none: no CMEC at all
  bool fields = false;                                      ///< made as the bake makes them
  bool surface = false;                                     ///< the tetrahedra's boundary as visual mesh
};

/// A box of cells (five tetrahedra each) in a grid of overlapping clusters.
struct BoxBody {
  std::array<int, 3> cells = {2, 2, 2};
  std::array<double, 3> size = {1, 1, 1};    ///< metres
  std::array<double, 3> center = {0, 0, 0};  ///< metres
  std::array<std::uint32_t, 3> clusters = {1, 1, 1};
};
/// Made anew at each call; equal arguments give equal bytes.
std::shared_ptr<const Asset> boxPackage(const BoxBody& box, const StudyPackageOptions& options);

/// One regular tetrahedron with edges of 1 m, standing on y = 0: four vertices, one cluster.
std::shared_ptr<const Asset> tetrahedronPackage(const StudyPackageOptions& options);

/// A number in 0..1 that depends on its arguments alone: the studies' source of chance.
double chance(std::uint64_t seed, std::uint64_t index);

}  // namespace sinew::tools
