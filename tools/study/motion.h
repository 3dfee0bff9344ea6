// SPDX-License-Identifier: GPL-3.0-or-later
//
// Task of `study error` for every method alike: a body of tetrahedra, its holds and pulls, and where its visual
// vertices go, frame by frame.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/study/assets.h"
#include "tools/study/finite_elements.h"
#include "tools/study/held_body.h"

namespace sinew::tools {

struct SceneDrive;
struct SceneScript;

inline constexpr double kFrameSeconds = 1.0 / 60;

/// A visual vertex as a point of a tetrahedron: sum weight x[vertex].
struct Probe {
  std::array<std::uint32_t, 4> vertex{};
  std::array<double, 4> weight{};
};

/// A point of the drawn surface, as the mean of three of its vertices, and the part of the surface that it stands for.
struct ContactSample {
  std::array<std::uint32_t, 3> vertex{};  ///< visual
  std::array<double, 3> weight{};
  double area = 0;  ///< m²
};

/// A spring between a vertex and where a region would hold it.
struct MotionTether {
  std::uint32_t vertex = 0, region = 0;
  double stiffness = 0;  ///< N/m
};

/// A tension along a fibre in proportion to its stretch, as the runtime has it (docs/method.md §3): at activation a the
/// energy is a / (1 - a contraction) tension sum weight |F direction|^2 / 2 over the tetrahedra that it runs through.
struct MotionFibre {
  std::uint32_t channel = 0;                              ///< of the package
  double tension = 0;                                     ///< J
  double contraction = 0;                                 ///< what it shortens by alone at full activation
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();   ///< unit, at rest
  std::vector<std::pair<std::uint32_t, double>> weights;  ///< of tetrahedra; their sum is 1
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
  /// The visual vertices, and points between them where they lie further apart than those of the tetrahedra.
  std::vector<ContactSample> points;
  std::vector<MotionTether> tethers;  ///< of scenes from files, as all below
  std::vector<MotionFibre> fibres;
};

/// A level plane that bodies lie on, at which their points slide by Coulomb's law and from which nothing bounces.
struct MotionGround {
  double height = 0;      ///< y, metres
  double friction = 0.6;  ///< Coulomb coefficient, 0..
};

/// Its load case. Time starts at 0, at rest.
struct MotionScene {
  HoldScene hold = HoldScene::hang;
  bool release = false;             ///< gravity ends at kReleaseSeconds, and what comes after is compared
  std::vector<HeldRegion> regions;  ///< what moves does so evenly over kMotionSeconds
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s²
  std::optional<MotionGround> ground;
  bool free = false;  ///< nothing is held: all pieces are played
  double seconds = 2;
  double slowest_seconds = 1e9;  ///< a method that takes more for a frame is stopped

  /// Of a scene from a file: the file, and its channels and targets as the package has them.
  struct File {
    std::shared_ptr<const SceneScript> script;
    std::shared_ptr<const SceneDrive> drive;
  } file;
  std::optional<double> damping;                               ///< 1/s, in place of the scene's own
  std::function<Eigen::Isometry3d(std::size_t, double)> pose;  ///< in place of the regions' own motion
  std::function<double(std::uint32_t, double)> activation;     ///< of a channel of the package, 0..1
  std::function<Eigen::Vector3d(double)> push;                 ///< m/s², beside gravity

  double comparedFrom() const { return release ? kReleaseSeconds : 0; }
  /// Where region `region` takes what it holds, from rest.
  Eigen::Isometry3d poseOf(std::size_t region, double time) const;
  /// Holds of a package in this scene. \param extent as of heldCase()
  HeldCase holds(const PackageSolid& solid, const formats::PackageView& package, const SolidExtent& extent) const;
  /// By piece: 1 where it is played. Of what is held, the pieces that regions hold; else all.
  std::vector<std::uint8_t> pieces(const PackageSolid& solid, const HeldCase& held) const;
  Eigen::Vector3d gravityAt(double time) const;
  /// Rate at which all velocity decays, 1/s: v' = -damping v, the one damping that every method has alike.
  double dampingAt(double time) const;
  double part(double time) const { return std::min(1.0, time / kMotionSeconds); }

  static constexpr double kReleaseSeconds = 1;
  /// Of the body's height: how far it falls.
  static constexpr double kFall = 0.1;
  /// From its first contact on: what it does later depends on which side it falls over to.
  static constexpr double kLandSeconds = 0.5;
};

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

/// The pieces of a package that the scene plays, as far as they hang together by faces, with one material a piece.
/// \param extent of another package of the same source: what is held lies between the same planes.
/// \param materials one a piece.
MotionBody motionBody(const formats::PackageView& package, const MotionScene& scene,
                      const std::vector<ElasticMaterial>& materials, const std::optional<SolidExtent>& extent);

/// Adds the visual vertices, their areas and what touches. \param number of the body's vertices by those of the
/// package, -1: none
void addSurface(const formats::PackageView& package, const std::vector<std::int32_t>& number, MotionBody& body);

/// Every tetrahedron cut into eight: the same body, of the same mass.
MotionBody refined(const MotionBody& body);

/// Contact with the ground by projection: a point that a step takes below it is put on it, and slides by Coulomb's law:
/// its way along the plane is shorter by friction times the depth, at least 0 (Macklin et al. 2014, "Unified particle
/// physics for real-time applications", §6.1). \param before where it was when the step began
template <class Vector>
void projectToGround(const MotionGround& ground, const Vector& before, Vector& x) {
  using Scalar = typename Vector::Scalar;
  const Scalar depth = Scalar(ground.height) - x[1];
  if (depth <= 0) return;
  x[1] = Scalar(ground.height);
  const Scalar dx = x[0] - before[0], dz = x[2] - before[2], way = std::hypot(dx, dz);
  const Scalar less = way > 0 ? std::min(Scalar(1), Scalar(ground.friction) * depth / way) : Scalar(0);
  x[0] -= less * dx;
  x[2] -= less * dz;
}

/// Positions of a frame's probes. \param positions by vertex of the body.
std::vector<Eigen::Vector3f> probed(const MotionBody& body, const std::vector<Eigen::Vector3d>& positions);

}  // namespace sinew::tools
