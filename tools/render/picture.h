// SPDX-License-Identifier: GPL-3.0-or-later
//
// Contact sheets and videos of a package's scenes, drawn without a display.
#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "tools/render/camera.h"
#include "tools/render/image.h"
#include "tools/render/renderer.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

enum class OverlayName { none, physical, clusters, all };
/// Names in the order of the enum.
std::span<const std::string_view> overlayNames();
std::optional<OverlayName> overlayByName(std::string_view name);

/// A direction about a model, rad: yaw 0 is its front, positive towards its left (+x where the front is +z); positive
/// pitch is above.
struct Direction {
  float yaw = 0, pitch = 0;
};

struct PictureOptions {
  std::vector<std::shared_ptr<const Asset>> others;  ///< as in SceneOptions
  std::vector<SceneChoice> scenes;                   ///< empty = rest, squash, drop, hang (a video: drop)
  double seconds = 0;                                ///< of each scene, 0..; 0 = the scene's own length
  double step_seconds = 0;                           ///< 1e-5..1; 0 = the scene's own
  const SolverFactory* solver = nullptr;             ///< null: its fields
  int frames = 0;  ///< pictures of each scene (1: all scenes in one row), or frames of the video; 0 = 6, or 30 a second
  int width = 0, height = 0;           ///< pixels of one picture, or of the video; 0 = 320 x 280, or 960 x 720
  std::optional<OverlayName> overlay;  ///< nothing: none, and a sheet has a row of overlays at the end
  std::optional<ViewName> view;        ///< nothing: three-quarter, and the scene "rest" is shown from all sides
  std::optional<Direction> camera;     ///< in place of a view: where the eye is, from the front
  bool turntable = false;              ///< the camera goes once around; else it stands still
  std::optional<Direction> light;      ///< where the key light comes from, from the front; nothing: beside the eye
  std::optional<std::array<Eigen::Vector3f, 2>> background;  ///< linear RGB at the top and the bottom
  int columns = 0;                                           ///< pictures in a row; 0 = frames
};

/// Everything of a body that is drawn, at one moment. Lengths in metres.
struct Shape {
  std::vector<Eigen::Vector3f> positions, normals, physical;
  std::vector<std::uint32_t> pinned;
  std::vector<ClusterFrame> frames;
  /// Of the bodies whose positions and normals follow each other; the rest is the first one's.
  std::vector<std::shared_ptr<const Asset>> assets;
  std::vector<std::shared_ptr<const SolidMesh>> solids;  ///< colliders; their vertices follow those of the bodies
  std::size_t body_vertices = 0;
  /// Whether the same model draws both.
  bool isLike(const Shape& other) const { return assets == other.assets && solids == other.solids; }
  double time = 0;  ///< s
};
void captureShape(const Scene& scene, Shape& shape);
void showShape(Renderer& renderer, const Shape& shape);
/// Model of a shape's bodies. \param diagonal m, the unit of what is drawn.
DrawModel modelOf(const Shape& shape, float diagonal);

/// Looks from where a scene's file says. \return whether the file frames the picture too, which is done then; else what
/// is to be seen is still to be fitted in.
bool lookAsScene(Camera& camera, const SceneScript::View& view, const formats::PackageView& package);

/// A camera's view, as a scene's file says it. \param placed the body's position at the start of its scene, m
SceneScript::View sceneViewOf(const Camera& camera, const formats::PackageView& package, const Vec3& placed);

/// A row of pictures a scene, labelled, over a title with the counts. Needs a current OpenGL context.
/// \param progress called with 0..1 now and then; may be empty.
Image renderContactSheet(const std::shared_ptr<const Asset>& asset, const std::string& title,
                         const PictureOptions& options, const std::function<void(double)>& progress);

/// H.264 in mp4 of one scene. Nothing is left behind where it fails or is interrupted.
/// Throws ToolError(system) where there is no encoder or the file cannot be written. Needs a current OpenGL context.
void renderVideo(const std::shared_ptr<const Asset>& asset, const std::string& title, const PictureOptions& options,
                 const std::filesystem::path& file, const std::function<void(double)>& progress);

}  // namespace sinew::tools
