// SPDX-License-Identifier: GPL-3.0-or-later
//
// Error against run time: one body in several scenes, by this runtime and by others, each swept over its own knobs,
// against finer finite elements.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/study/motion.h"

namespace sinew::tools {

enum class Method : std::uint8_t {
  sinew,
  report,           ///< averaged clusters, as the report has them
  xpbd,             ///< playXpbd()
  warping,          ///< playStiffnessWarping()
  bullet,           ///< Bullet's finite elements, explicit in elasticity as by default
  bullet_implicit,  ///< Bullet's finite elements, implicit
  bullet_links,     ///< Bullet's soft body of links
};
inline constexpr std::size_t kMethodCount = 7;
std::string_view nameOf(Method method);

/// Beside those of HoldScene: a cantilever that is let go; the body dropped on its feet.
inline constexpr std::string_view kReleaseScene = "release", kFeetScene = "feet";

inline constexpr std::array<std::string_view, 9> kErrorScenes = {
    "hang", "lean", "cantilever", kReleaseScene, "press", "squeeze", "twist", kFeetScene, "pins"};

struct ErrorOptions {
  std::vector<std::string> scenes;  ///< of kErrorScenes, scene files (.json); empty: kDefaultErrorScenes, and pins
                                    ///< where there are any
  double target = 0.02;             ///< rms displacement by gravity, of the diagonal, 1e-4..0.5
  std::vector<std::uint32_t> functions = {8, 16, 32, 64, 128};  ///< field.functions of the bakes
  std::vector<std::uint32_t> vertices = {80, 250};  ///< tetrahedra.vertices of the meshes besides the recipe's
  bool peers = true;                                ///< false: this runtime alone
  /// Work within which the reference cuts every tetrahedron into eight, and says how much that changes it: twenty times
  /// its time or so. Beyond, it is that of the recipe's own mesh.
  double refine_work = 2e9;
  double reference_work = 2e10;  ///< ExplicitOptions::most_work of the reference; beyond, its elements are linear
  /// Of all references together where no scenes are named: scenes that exceed it are left out, and a note says so. The
  /// first is always played. 1.2e10 take three minutes on two cores.
  double page_work = 1.2e10;
  double slowest_ms = 20;  ///< a method that takes more for a frame is stopped

  static constexpr std::uint32_t kMostFunctions = 256, kLeastVertices = 8, kMostVertices = 1000000;
};

inline constexpr std::array<std::string_view, 5> kDefaultErrorScenes = {"hang", kReleaseScene, "press", "twist",
                                                                        kFeetScene};

/// Errors are shares of the reference's own rms displacement: a body that does not move scores 1. Of what is not held
/// displacements are those without the best rigid motion of each frame, from when the reference touches the ground:
/// what is rigid scores 1, wherever it lies.
struct ErrorRow {
  std::uint32_t scene = 0;  ///< into ErrorStudy::scenes
  Method method = Method::sinew;
  std::string knobs;           ///< what the method was set to
  std::uint32_t vertices = 0;  ///< physical
  double milliseconds = 0;     ///< processor time of a frame of 1/60 s, one thread
  double path = 0;             ///< rms over vertices and frames
  double end = 0;              ///< rms of the last quarter of a second's mean shape
  double largest = 0;          ///< largest distance of any vertex at any time, of the reference's largest displacement
  double volume = 0;           ///< largest difference of volume, of that at rest; 0 where the surface is open
  std::optional<double> frequency, decay;  ///< `release`: of the swing, over the reference's
  std::optional<double> astray;            ///< of what is not held: as path, with the rigid motion
  std::optional<double> turned;            ///< and its turn against the reference at the end, degrees
  bool lost = false;                       ///< not finite, or further away than 10 diagonals: errors mean nothing
  bool slow = false;                       ///< stopped: slower than ErrorOptions::slowest_ms
  bool front = false;                      ///< nothing of the same scene is nearer (path) for less time
  bool own_front = false;                  ///< nothing of the same scene and method is
  std::vector<Eigen::Vector3f> shape;      ///< the visual vertices in the frame of the reference's largest displacement
};

struct ErrorScene {
  std::string name;
  double gravity = 0;  ///< m/s²
  double seconds = 0;
  std::uint32_t compared = 0;    ///< visual vertices
  std::uint32_t tetrahedra = 0;  ///< of the reference
  double step_seconds = 0;       ///< of the reference
  double reference_seconds = 0;  ///< that it took, all threads
  double rms = 0, largest = 0;   ///< displacement, diagonals
  std::optional<double>
      linear;  ///< how far linear elements are off its quadratic ones, path; nothing: it has linear ones
  std::optional<double> refined;  ///< change of the path as each tetrahedron was cut into eight; nothing: it is not
  double shorter = 0;             ///< change of the path by steps of half the length (linear elements)
  double neo_hookean = 0;         ///< of the path by the neo-Hookean law of elasticity (linear elements)
  double own_law = 0;             ///< by the runtime's (linear elements)
  std::optional<double> penalty;  ///< `feet`: of the path by a ground twice as firm (linear elements)
  /// How this runtime was set where it is its own reference, as elements of the body would take too long; else empty.
  std::string self;
  std::optional<double> frequency;  ///< `release`, Hz
  std::optional<double> turned;     ///< of what is not held, from rest to its end, degrees
  /// Strains are so large that these figures depend on the law of elasticity.
  bool lawMatters() const { return neo_hookean > 0.1; }
  std::vector<Eigen::Vector3f> shape;  ///< as ErrorRow::shape
};

struct ErrorStudy {
  std::string input;
  std::vector<ErrorScene> scenes;
  std::vector<ErrorRow> rows;
  ElasticMaterial material;                    ///< of the first piece
  double diagonal = 0;                         ///< metres
  std::uint32_t vertices = 0, tetrahedra = 0;  ///< of the recipe's own mesh
  std::vector<std::string> notes;              ///< what was left out, and why
  std::shared_ptr<const Asset> asset;
};

/// A recipe, of which bakes with other functions and vertices are made, or a package as it is.
struct ErrorInput {
  std::string name;
  std::optional<Recipe> recipe;
  std::shared_ptr<const Asset> package;  ///< where there is no recipe
};

/// Throws ToolError: usage for an unknown name, bad_input where a file asks for what the reference cannot do.
void requireErrorScene(const std::string& name);

/// Plays all scenes by all methods. Throws ToolError where the recipe cannot be baked, its surface does not hang on
/// tetrahedra, it has no fields, or a scene is unknown.
ErrorStudy measureError(const ErrorInput& input, const ErrorOptions& options,
                        const std::function<void(double)>& progress);

/// The row of least path error within a time, of a scene and a method (of any: nothing). Null where there is none.
const ErrorRow* bestWithin(const ErrorStudy& study, std::uint32_t scene, std::optional<Method> method,
                           double milliseconds);
/// The same of all methods but this runtime.
const ErrorRow* bestOfOthers(const ErrorStudy& study, std::uint32_t scene, double milliseconds);

nlohmann::ordered_json errorJson(const ErrorStudy& study);
std::string errorText(const ErrorStudy& study);

}  // namespace sinew::tools
