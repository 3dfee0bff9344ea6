// SPDX-License-Identifier: GPL-3.0-or-later
//
// A package that is held somewhere and comes to rest: what finite elements on its own tetrahedra say, what the runtime
// does, and how far the two are apart. Of the runtime it uses the public World alone, of the package the tetrahedra,
// masses and materials.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/runtime/world.h"
#include "tools/study/finite_elements.h"

namespace sinew::tools {

/// Where a piece's material comes from.
enum class StiffnessSource : std::uint8_t {
  field,     ///< Lame's parameters of the samples of its field (FELD, FPAK), their mean by volume
  clusters,  ///< StiffnessModel::elastic of all of its clusters (CMEC), their mean by mass
  given,     ///< by the caller
  none,      ///< the package says none: kPresumed
};

std::string_view nameOf(StiffnessSource source);

/// Material of the reference where a package has none: only the shape of the answer means something then.
inline constexpr ElasticMaterial kPresumed = {1e5, 0.3};

/// Material of a piece of a package.
struct PieceMaterial {
  ElasticMaterial material = kPresumed;
  StiffnessSource source = StiffnessSource::none;
  double softest = 0,
         stiffest = 0;  ///< Young's modulus over its samples or clusters, Pa: the reference has one for all
};

/// One for each of the package's pieces (BODY), from the first of StiffnessSource that it has.
std::vector<PieceMaterial> materialsOf(const formats::PackageView& package);

/// The tetrahedra of a package that finite elements can be asked about: of each piece the largest set that is joined by
/// faces. Crumbs of a few tetrahedra that hang by an edge or a vertex are mechanisms: they have no equilibrium.
struct PackageSolid {
  std::vector<Eigen::Vector3d> rest;                     ///< all physical vertices, metres
  std::vector<double> masses;                            ///< kg
  std::vector<std::uint32_t> piece;                      ///< of each vertex, into BODY
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;  ///< the kept ones
  std::vector<std::uint8_t> kept;                        ///< by vertex: 1 where a kept tetrahedron has it
  std::uint32_t pieces = 0;
  std::uint32_t left_out = 0;  ///< tetrahedra that are not kept
  double diagonal = 0;         ///< PackageInfo::diagonal, metres
};

/// \pre the package has tetrahedra
PackageSolid packageSolid(const formats::PackageView& package);

/// Physical vertices that are held as one.
struct HeldRegion {
  std::vector<std::uint32_t> vertices;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< how far they are moved, metres
  double turn = 0;                                  ///< by how much they are turned, radians
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< unit
  Eigen::Vector3d about = Eigen::Vector3d::Zero();  ///< a point of the axis, metres (rest)

  bool moves() const { return turn != 0 || shift.squaredNorm() > 0; }
  /// Where a point of the region is. \param part of the motion, 0..1.
  Eigen::Vector3d at(const Eigen::Vector3d& rest, double part) const;
};

/// Load case of a body.
struct HeldCase {
  std::vector<HeldRegion> regions;
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s²
  /// The package's own pin sets hold the regions (they do not move); else pin sets that are added at run time.
  bool package_pins = false;
};

/// By piece: 1 where regions hold it by three points or more that are not in line.
std::vector<std::uint8_t> heldPieces(const PackageSolid& solid, const HeldCase& held);

/// Where World::movePinSet() puts a region. \param part of the motion, 0..1. \param offset of the world from the rest,
/// m
RigidTransform poseOf(const HeldRegion& region, double part, const Eigen::Vector3d& offset);

/// Processor time of this thread, s: others that run beside it do not count.
double threadSeconds();

/// Throws ToolError(system): a World did not take what a study gave it.
[[noreturn]] void refuseHold(const std::string& reason);

/// Finite elements' answer.
struct ReferenceShape {
  std::vector<Eigen::Vector3d> displacement;  ///< of the package's physical vertices, metres; 0 of those left out
  std::vector<std::uint32_t> compared;        ///< vertices that are free and kept, of pieces that are held; ascending
  std::vector<std::uint32_t> left_out;        ///< vertices of pieces that no region holds (by three points not in line)
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();  ///< m/s²: as asked, or as found
  double rms = 0, largest = 0;                        ///< displacement over `compared`, metres
  std::uint32_t tetrahedra = 0;
  int iterations = 0;     ///< of the last solution
  double residual = 0;    ///< Equilibrium::residual
  bool stable = false;    ///< Equilibrium::stable
  bool on_target = true;  ///< false: no gravity near gives the displacement that was asked for; it is a nearby one
};

/// Rest by quadratic finite elements, as equilibrium() finds it, from where linear ones come to rest, which come from
/// the shape at rest by steps. Empty `compared` where nothing is held. \param materials one a piece. \param target rms
/// displacement in metres for which gravity is made stronger or weaker; 0: gravity stays as it is.
ReferenceShape referenceShape(const PackageSolid& solid, const std::vector<ElasticMaterial>& materials,
                              const HeldCase& held, double target);

/// How a world is stepped until it rests.
struct PlayOptions {
  WorldSettings settings;                 ///< gravity is the case's
  double rate_hz = 60;                    ///< steps a second
  double seconds = 20;                    ///< at most
  const SolverFactory* solver = nullptr;  ///< null: its fields
  double rest_speed = 0;  ///< m/s, root mean square over the compared vertices: slower for a tenth of a second is rest
};

/// The runtime's answer.
struct PlayedShape {
  std::vector<Eigen::Vector3d> displacement;  ///< of all physical vertices, metres
  double rest_seconds = -1;                   ///< simulated time to rest; negative: it did not come to rest
  double speed = 0;                           ///< at the end, as PlayOptions::rest_speed, m/s
  double microseconds = 0;                    ///< median processor time of a step, one thread
  bool finite = true;
};

/// Time over which regions that move reach their places, simulated seconds.
inline constexpr double kMotionSeconds = 1;

/// Adds the body to a world of its own, holds the regions (each one pin set; what is left out of the reference is held
/// as well, so that it does not fall), moves them evenly over kMotionSeconds, and steps until it rests.
/// \param reference what is compared and left out. Throws ToolError where the world refuses.
PlayedShape playHeld(const std::shared_ptr<const Asset>& asset, const PackageSolid& solid, const HeldCase& held,
                     const ReferenceShape& reference, const PlayOptions& options);

/// How far apart two answers are; all are shares.
struct HeldScore {
  double rms = 0;      ///< rms(difference) / rms(reference): a body that does not move scores 1
  double largest = 0;  ///< largest difference / largest reference displacement
  double way = 0;      ///< <played, reference> / <reference, reference>: 1 where it goes as far, 0 where it stays
};

/// \param vertices what is compared. \param played \param reference displacements by vertex.
HeldScore scoreOf(std::span<const std::uint32_t> vertices, const std::vector<Eigen::Vector3d>& played,
                  const std::vector<Eigen::Vector3d>& reference);

}  // namespace sinew::tools
