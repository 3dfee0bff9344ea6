// SPDX-License-Identifier: GPL-3.0-or-later
//
// Packages that studies make in memory: good ones, and such as nobody would author.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/writer.h"
#include "sinew/runtime/asset.h"

namespace sinew::tools {

/// The bodies that studies simulate.
enum class StudyBody : std::uint8_t {
  box,         ///< 1 m, 27 vertices, one cluster
  box2,        ///< 1 m, 125 vertices, 2 x 2 x 2 overlapping clusters
  box3,        ///< 1 m, 216 vertices, 3 x 3 x 3 overlapping clusters
  bar,         ///< 4 x 0.4 x 0.4 m, 6 clusters along it
  ring,        ///< a torus in 2 x 2 clusters, each shaped like a C
  animal,      ///< a trunk with four legs and a head, clusters as a bake chooses them
  one_vertex,  ///< a single vertex
  two_vertices,
  three_vertices,
  line,        ///< 5 vertices on a line
  plane,       ///< 16 vertices in a plane
  coincident,  ///< a box whose every vertex is there twice
  odd,         ///< a box in clusters of 1, 2 and 3 vertices, of a line, of a sheet, and one of all
};
inline constexpr std::size_t kStudyBodyCount = 13;

std::string_view nameOf(StudyBody body);

/// What may be asked of a study's package.
struct StudyPackageOptions {
  formats::ClusterMode mode = formats::ClusterMode::linear;
  double frequency_hz = 1;  ///< of all classes of modes
  double size = 1;          ///< times the lengths that StudyBody states; masses follow
  double mass_ratio = 1;    ///< heaviest to lightest vertex, >= 1: vertices lie between, evenly over the logarithm
  /// Of every cluster; a fibre is driven by the package's one channel, "fibre". None: no CMEC at all.
  std::optional<formats::ClusterMechanics> mechanics = {};
  double elastic_hz = 0;  ///< of StiffnessModel::elastic, > 0: a modulus with which a slice as long as the body's
                          ///< radius of gyration rings so, in place of `young`
  std::vector<formats::CurvePoint> curve = {};  ///< of LimitMethod::curve
  bool fields = false;                          ///< made as the bake makes them
  bool surface = false;                         ///< the tetrahedra's boundary as visual mesh, for picks
};

/// Made anew at each call; equal arguments give equal bytes. Degenerate clusters keep the mode that is asked for.
std::shared_ptr<const Asset> studyPackage(StudyBody body, const StudyPackageOptions& options);

/// A box of cells (five tetrahedra each) in a grid of overlapping clusters.
struct BoxBody {
  std::array<int, 3> cells = {2, 2, 2};
  std::array<double, 3> size = {1, 1, 1};    ///< metres
  std::array<double, 3> center = {0, 0, 0};  ///< metres
  std::array<std::uint32_t, 3> clusters = {1, 1, 1};
};
std::shared_ptr<const Asset> boxPackage(const BoxBody& box, const StudyPackageOptions& options);

/// One regular tetrahedron with edges of 1 m, standing on y = 0: four vertices, one cluster.
std::shared_ptr<const Asset> tetrahedronPackage(const StudyPackageOptions& options);

/// A number in 0..1 that depends on its arguments alone: the studies' source of chance.
double chance(std::uint64_t seed, std::uint64_t index);

}  // namespace sinew::tools
