// SPDX-License-Identifier: GPL-3.0-or-later
//
// Measures of `study steps`: finiteness, momentum, energy, shape and rest of a body, from the positions and
// velocities that a World reports and the masses of the package, in double. Nothing here knows how the runtime moves a
// body.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/runtime/world.h"

namespace sinew::tools {

/// A World's report of a body: metres and m/s, one each per physical vertex.
struct BodyState {
  std::span<const Vec3> positions, velocities;
};

/// Positions and velocities of a body as they are now; valid until the world changes.
inline BodyState stateOf(const World& world, BodyId body) { return {world.positions(body), world.velocities(body)}; }

enum class StepsCriterion : std::uint8_t {
  finite,    ///< positions and velocities are numbers, and the world had no vertex to put right; value: how many not
  momentum,  ///< a free part's linear momentum stays, kg m/s
  angular,   ///< a free part's angular momentum about its centre of mass stays, kg m^2/s
  centre,    ///< a free part's centre of mass goes where its momentum takes it, m
  energy,    ///< a free body's kinetic energy is never more than its energy at the start, J
  shape,     ///< a part is back in its rest shape, m
  speed,     ///< what rests has no speed, by velocities and by positions, m/s
  ground,    ///< nothing is below the ground, m
  creep,     ///< what rests on a slope does not slide, m/s
};
inline constexpr std::size_t kStepsCriterionCount = 9;
std::string_view nameOf(StepsCriterion criterion);
/// Unit of a criterion's values.
std::string_view unitOf(StepsCriterion criterion);

/// A value against its limit, in the criterion's unit.
struct StepsFinding {
  StepsCriterion criterion = StepsCriterion::finite;
  double value = 0, limit = 0;
  /// Above 1 is a failure; infinite where the value is no number.
  double ratio() const;
};

// ---- limits ----
inline constexpr double kMomentumTolerance = 1e-4;  ///< of Σ m |v| and Σ m |x - c| |v|
inline constexpr double kEnergyTolerance = 0.01;    ///< of the energy at the start
inline constexpr double kShapeTolerance = 1e-3;     ///< diagonals of the part, root mean square over the mass
inline constexpr double kRestSpeed = 1e-3;          ///< diagonals/s: less counts as rest, whatever the steps
inline constexpr double kSteadyRestSpeed = 1e-4;    ///< diagonals/s: the same for constant steps, held or on the ground
inline constexpr double kBelowGround = 0.01;        ///< diagonals
inline constexpr double kCreepSpeed = 1e-5;         ///< m/s per metre of diagonal

/// How far off a coordinate is that was rounded to a float: ε = 2^-24 max |x_k|, half of the spacing of floats at the
/// largest coordinate. A reported place is off by √3 ε at most, 1e-3 m at 10 km; a difference of two by 2 √3 ε.
double coordinateRounding(std::span<const Vec3> positions);

/// Sums over a separate part of a package (formats::PieceRange), about its centre of mass.
struct PartMotion {
  double mass = 0;                                     ///< kg
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();    ///< metres
  Eigen::Vector3d momentum = Eigen::Vector3d::Zero();  ///< kg m/s
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();   ///< about the centre, kg m^2/s
  double momentum_scale = 0;                           ///< Σ m |v|
  double angular_scale = 0;                            ///< Σ m |x - centre| |v|
  double kinetic = 0;                                  ///< ½ Σ m v², J
  double speed() const;                                ///< root mean square over the mass, m/s
};

/// One entry per part of the package, in its order.
std::vector<PartMotion> motionOf(const formats::PackageView& package, const BodyState& state);

/// Vertices whose position or velocity is not finite.
std::uint32_t notFinite(const BodyState& state);

/// Energy of a body as far as it is known, J.
struct BodyEnergy {
  double kinetic = 0;
  std::optional<double> elastic;  ///< none: what moves the body does not tell
};
/// The one place that asks a World for energy. Kinetic is computed here from what is reported. \param has_elastic the
/// body's solver has an energy of its shape: the coupled one, not the report's.
BodyEnergy energyOf(const World& world, BodyId body, bool has_elastic);

/// Follows a body that nothing touches: no gravity, air, ground, pins or picks.
class FreeJudge {
 public:
  /// \param package outlives the judge. \param start what is reported when the body is let go. \param energy then.
  /// \param moving whether it moves or is deformed; else it rests, and is to stay so.
  FreeJudge(const formats::PackageView& package, const BodyState& start, const BodyEnergy& energy, bool moving);
  /// After each step. \param seconds its length.
  void observe(const BodyState& now, double seconds);
  /// Moving: momentum, angular, centre, and energy where it is known at the start; else speed. Each as it was where it
  /// was worst:
  ///   |P - P0|            <=  1e-4 S                     S  = max over the run of Σ m |v|
  ///   |L - L0|            <=  1e-4 S_L + 2 √3 ε S        S_L = max over the run of Σ m |x - c| |v|
  ///   |c - c0 - t P0 / M| <=  1e-4 ∫ S / M dt + 2 √3 ε
  ///   K                   <=  1.01 (K0 + E0) + ½ M (1e-3 D)²
  /// S and S_L are never less than those of a part whose speed counts as rest; |v| is that which is reported, or that
  /// of the way in the step beyond 2 √3 ε, if that is more: there are solvers that move a body without a speed.
  std::vector<StepsFinding> findings() const;

 private:
  struct Part {
    PartMotion start;
    double extent = 0;  ///< radius of gyration at the start, m
    double scale = 0, angular_scale = 0, way = 0;
  };
  void keep(StepsCriterion criterion, double value, double limit);
  /// Σ m |x - x before| and Σ m |x - x before| |x - centre| over a part; ways up to `rounding` are none.
  std::pair<double, double> wayOf(const formats::PieceRange& body, const Eigen::Vector3d& centre,
                                  std::span<const Vec3> now, double rounding) const;
  const formats::PackageView* package_;
  std::vector<Part> parts_;
  std::vector<Vec3> start_, before_;
  std::vector<std::optional<StepsFinding>> worst_;
  double rounding_ = 0, time_ = 0, mass_ = 0, energy_ = 0, diagonal_ = 0;
  bool moving_, energy_known_;
};

/// Follows a body that is to rest, over a stretch of time.
class RestJudge {
 public:
  /// \param package outlives the judge. \param start what is reported when the stretch begins.
  /// \param speed_limit diagonals/s. \param slope the plane's normal, where creep is judged.
  RestJudge(const formats::PackageView& package, const BodyState& start, double speed_limit,
            std::optional<Vec3> slope = {});
  /// After each step. \param seconds its length.
  void observe(const BodyState& now, double seconds);
  /// speed, and creep where there is a slope. For the worst part, the larger (over its limit) of
  ///   the largest speed (root mean square over the mass) of any step                  <=  limit D
  ///   the distance from where each vertex was at the beginning, rms, over the time    <=  limit D + 2 √3 ε / t
  /// and of creep, along the slope,
  ///   the mean velocity of the centre          <=  1e-5 D
  ///   the way of the centre, over the time     <=  1e-5 D + 2 √3 ε / t
  std::vector<StepsFinding> findings() const;
  double seconds() const { return time_; }

 private:
  const formats::PackageView* package_;
  std::vector<Vec3> start_, now_;
  std::vector<double> fastest_;             // by part
  std::vector<Eigen::Vector3d> travelled_;  // by part, ∫ P / M dt
  double speed_limit_, time_ = 0, diagonal_ = 0;
  std::optional<Eigen::Vector3d> slope_;
};

/// Distance from the rest shape, root mean square over the mass, the best rigid motion (Kabsch 1976) removed, of the
/// part that is worst over its limit, 1e-3 of its own diagonal + √3 ε.
StepsFinding shapeOf(const formats::PackageView& package, std::span<const Vec3> positions);

/// Where the visual vertices hang on the physical ones, whatever is drawn of it; empty where they hang on clusters.
std::vector<Vec3> hungPlaces(const formats::PackageView& package, std::span<const Vec3> positions);

/// How far the lowest point is below the plane; limit 0.01 diagonals + √3 ε. The drawn surface meets the ground: a
/// cage or the under side of a shell may reach below. \param drawn where visual vertices hang; empty: positions count.
StepsFinding groundOf(const formats::PackageView& package, std::span<const Vec3> positions, std::span<const Vec3> drawn,
                      const GroundPlane& ground);

/// normal . x of the lowest point, metres.
double lowestAlong(std::span<const Vec3> points, const Vec3& normal);

}  // namespace sinew::tools
