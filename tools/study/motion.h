// SPDX-License-Identifier: GPL-3.0-or-later
//
// What `study error` asks of every method alike: a body of tetrahedra, what holds and pulls it, and where its visual
// vertices go, frame by frame.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/study/assets.h"
#include "tools/study/finite_elements.h"
#include "tools/study/held_body.h"

namespace sinew::tools {

inline constexpr double kFrameSeconds = 1.0 / 60;

/// A visual vertex as a point of a tetrahedron: sum weight x[vertex].
struct Probe {
  std::array<std::uint32_t, 4> vertex{};
  std::array<double, 4> weight{};
};

/// A body as a method is given it.
struct MotionBody {
  std::vector<Eigen::Vector3d> rest;                     ///< metres
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;  ///< of positive volume
  std::vector<ElasticMaterial> materials;                ///< of each tetrahedron
  std::vector<double> masses;                            ///< kg, of each vertex
  std::vector<std::int32_t> region;                      ///< of each vertex, into MotionScene::regions; -1: free
  std::vector<std::optional<Probe>> probes;  ///< of each visual vertex; nothing: it hangs on what is left out
  std::vector<Eigen::Vector3d> surface;      ///< the visual vertices at rest, metres
  std::vector<double> areas;                 ///< m², of each visual vertex: a third of its triangles
};

/// What is done to it. Time starts at 0, at rest.
struct MotionScene {
  HoldScene hold = HoldScene::hang;
  bool release = false;             ///< gravity ends at kReleaseSeconds, and what comes after is compared
  std::vector<HeldRegion> regions;  ///< what moves does so evenly over kMotionSeconds
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s²
  double seconds = 2;
  double slowest_seconds = 1e9;  ///< a method that takes more for a frame is stopped

  double comparedFrom() const { return release ? kReleaseSeconds : 0; }
  Eigen::Vector3d gravityAt(double time) const;
  /// Rate at which all velocity decays, 1/s: v' = -damping v, the one damping that every method has alike.
  double dampingAt(double time) const;
  double part(double time) const { return std::min(1.0, time / kMotionSeconds); }

  static constexpr double kReleaseSeconds = 1;
};

std::string_view nameOf(const MotionScene& scene);

/// Where the visual vertices were, at the end of each frame of kFrameSeconds.
struct Motion {
  std::vector<std::vector<Eigen::Vector3f>> frames;  ///< metres; of vertices without a probe: at rest
  double cpu_seconds = 0;                            ///< of this thread, without what writes the frames
  bool finite = true;                                ///< false: frames end where it was not
  bool slow = false;                                 ///< it was stopped

  /// Whether it goes on. \param scene of MotionScene::slowest_seconds
  bool goesOn(const MotionScene& scene) {
    slow = cpu_seconds > double(std::max<std::size_t>(frames.size(), 8)) * scene.slowest_seconds;
    return finite && !slow;
  }
};

/// The pieces of a package that the scene holds, as far as they hang together by faces, with one material a piece.
/// \param extent of another package of the same source: what is held lies between the same planes.
/// \param materials one a piece.
MotionBody motionBody(const formats::PackageView& package, const MotionScene& scene,
                      const std::vector<ElasticMaterial>& materials, const std::optional<SolidExtent>& extent);

/// Every tetrahedron cut into eight: the same body, of the same mass.
MotionBody refined(const MotionBody& body);

/// Positions of a frame's probes. \param positions by vertex of the body.
std::vector<Eigen::Vector3f> probed(const MotionBody& body, const std::vector<Eigen::Vector3d>& positions);

}  // namespace sinew::tools
