// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/picture.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <numbers>
#include <optional>
#include <string>

#include "tools/render/front.h"
#include "tools/render/overlay.h"
#include "tools/render/page.h"
#include "tools/render/text.h"
#include "tools/render/video.h"

namespace sinew::tools {

namespace {

constexpr std::array<std::string_view, 4> kOverlayNames = {"none", "physical", "clusters", "all"};
constexpr int kMargin = 20;
constexpr int kGap = 6;
constexpr int kLabelHeight = 22;
constexpr float kLabelText = 15;
constexpr float kFitMargin = 0.09F;
// The hull of a motion is made from at most so many vertices and every so many steps: enough to frame it.
constexpr std::size_t kHullVertices = 6000;
constexpr std::uint64_t kHullSteps = 3;

std::string seconds(double time) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f s", time);
  return text.data();
}

std::string grouped(std::size_t number) {
  std::string digits = std::to_string(number);
  for (std::size_t i = digits.size(); i > 3; i -= 3) digits.insert(i - 3, " ");
  return digits;
}

// Of all packages together.
std::string counts(const formats::PackageView& first, const std::vector<std::shared_ptr<const Asset>>& others) {
  const auto sum = [&](const auto& of) {
    std::size_t all = of(first).size();
    for (const auto& other : others) all += of(other->package()).size();
    return all;
  };
  using View = formats::PackageView;
  const std::size_t clusters = sum([](const View& p) { return p.clusters(); });
  return grouped(sum([](const View& p) { return p.visualTriangles(); })) + " triangles, " +
         grouped(sum([](const View& p) { return p.visualPositions(); })) + " vertices  ·  " +
         grouped(sum([](const View& p) { return p.physicalVertices(); })) + " physical vertices, " +
         grouped(sum([](const View& p) { return p.tetrahedra(); })) + " tetrahedra  ·  " + grouped(clusters) +
         (clusters == 1 ? " cluster" : " clusters");
}

void addToHull(MotionHull& hull, const Shape& shape) {
  const std::size_t stride = shape.positions.size() / kHullVertices + 1;
  std::vector<Eigen::Vector3f> some;
  for (std::size_t i = 0; i < shape.body_vertices; i += stride) some.push_back(shape.positions[i]);
  // Of colliders only ones not much larger than all bodies together.
  constexpr float kMuch = 4;
  Eigen::AlignedBox3f bodies;
  for (const Eigen::Vector3f& p : some) bodies.extend(p);
  std::size_t first = shape.body_vertices;
  for (const auto& solid : shape.solids) {
    const std::span<const Eigen::Vector3f> own = std::span(shape.positions).subspan(first, solid->positions.size());
    first += own.size();
    Eigen::AlignedBox3f box;
    for (const Eigen::Vector3f& p : own) box.extend(p);
    if (solid->endless || own.empty() || box.diagonal().norm() > kMuch * bodies.diagonal().norm()) continue;
    some.insert(some.end(), own.begin(), own.end());
  }
  hull.add(some);
}

// The hull in drawing units.
std::vector<Eigen::Vector3f> scaled(std::span<const Eigen::Vector3f> points, float factor) {
  std::vector<Eigen::Vector3f> result(points.begin(), points.end());
  for (Eigen::Vector3f& p : result) p *= factor;
  return result;
}

void applyOverlay(DrawSettings& settings, OverlayName overlay) {
  settings.physical = overlay == OverlayName::physical || overlay == OverlayName::all;
  settings.clusters = overlay == OverlayName::clusters || overlay == OverlayName::all;
}

// Lines and dots that suit the size of the picture.
void scaleMarks(DrawSettings& settings, int height) {
  settings.line_width = std::clamp(static_cast<float>(height) / 500, 0.7F, 2.0F);
  settings.dot_size = std::clamp(static_cast<float>(height) / 65, 3.5F, 12.0F);
}

void label(Image& picture, const std::string& text) {
  const float size = std::clamp(static_cast<float>(picture.height) / 18.0F, 11.0F, 24.0F);
  drawCaption(picture, 8, 6, size, text);
}

struct Tile {
  Shape shape;
  Camera camera;
  DrawSettings settings;
  std::string label;
};

// A scene simulated once, with the shapes of the asked moments and what the whole motion covers.
struct Take {
  SceneChoice scene = SceneKind::rest;
  std::vector<Shape> shapes;
  std::vector<Eigen::Vector3f> hull;  // drawing units
  DrawSettings settings;
};

SceneOptions sceneOptions(const PictureOptions& from, const SceneChoice& choice) {
  SceneOptions options;
  options.scene = choice;
  options.others = from.others;
  options.step_seconds = static_cast<float>(from.step_seconds > 0 ? from.step_seconds : choice.stepSeconds());
  options.solver = from.solver;
  return options;
}

Take recordTake(const std::shared_ptr<const Asset>& asset, const SceneOptions& options,
                const std::vector<double>& times) {
  const SceneChoice& choice = options.scene;
  const double step_seconds = static_cast<double>(options.step_seconds);
  Scene scene(asset, options);
  Take take;
  take.scene = choice;
  MotionHull hull;
  Shape shape;
  std::uint64_t step = 0;
  for (const double time : times) {
    while (scene.time() + 0.5 * step_seconds < time) {
      scene.step();
      if (++step % kHullSteps == 0) {
        captureShape(scene, shape);
        addToHull(hull, shape);
      }
    }
    captureShape(scene, shape);
    addToHull(hull, shape);
    take.shapes.push_back(shape);
  }
  const float factor = 1 / asset->package().info().diagonal;
  take.hull = scaled(hull.points(), factor);
  take.settings.ground = scene.hasGround();
  take.settings.ground_height = scene.groundHeight() * factor;
  take.settings.shadow_center = hull.center() * factor;
  take.settings.shadow_radius = std::max(hull.radius() * factor, 1e-3F);
  return take;
}

// Held vertices are part of what a built-in scene shows; those of a file's scene are seen when they are asked for.
bool showsPinned(const PictureOptions& options, const SceneChoice& scene) {
  return options.overlay ? *options.overlay != OverlayName::none : !scene.script;
}

std::vector<double> tileTimes(const SceneChoice& scene, double length, int count) {
  // Denser at the start, where things happen.
  std::vector<double> times;
  for (int k = 0; k < count; ++k) {
    times.push_back(count == 1 ? (scene.script ? std::min(scene.script->still, length) : length)
                               : length * std::pow(static_cast<double>(k) / (count - 1), 1.6));
  }
  return times;
}

// The unit vector of a direction about the model.
Eigen::Vector3f unitOf(const Direction& direction, float front_yaw) {
  Camera camera;
  camera.yaw = front_yaw + direction.yaw;
  camera.pitch = direction.pitch;
  return camera.back();
}

// Lights and background as asked. \param yaw of the camera; without a direction the key light comes from beside it
Lighting lightingOf(const PictureOptions& options, float yaw, float front_yaw) {
  Lighting lighting = turnedLighting({}, yaw - viewCamera(ViewName::three_quarter).yaw);
  if (options.light) lighting.key_direction = unitOf(*options.light, front_yaw);
  if (options.background) {
    lighting.background_top = (*options.background)[0];
    lighting.background_bottom = (*options.background)[1];
  }
  return lighting;
}

// The yaw that lights go with: the usual one for named views and those of a scene's file, so that their pictures are
// lit alike.
float litFrom(const PictureOptions& options, const Camera& camera, float front_yaw) {
  return options.camera ? camera.yaw : viewCamera(ViewName::three_quarter, front_yaw).yaw;
}

Camera fitted(Camera camera, const Take& take, int width, int height) {
  fitCamera(camera, take.hull, static_cast<float>(width) / static_cast<float>(height), kFitMargin);
  return camera;
}

// Where a scene is seen from: as asked, as its file says, or three-quarter; all of it, or what its file frames.
Camera sceneCamera(const PictureOptions& options, const Take& take, const formats::PackageView& package, int width,
                   int height) {
  const SceneScript::View* own = take.scene.script && take.scene.script->view ? &*take.scene.script->view : nullptr;
  const float front_yaw = frontYaw(package);
  Camera camera = viewCamera(options.view.value_or(ViewName::three_quarter), front_yaw);
  if (options.camera) {
    camera.yaw = front_yaw + options.camera->yaw;
    camera.pitch = options.camera->pitch;
  }
  const bool chosen = options.view || options.camera;
  Camera asked = camera;
  const bool framed = own != nullptr && lookAsScene(asked, *own, package);
  if (own != nullptr && !chosen) {
    camera.yaw = asked.yaw;
    camera.pitch = asked.pitch;
  }
  camera = fitted(camera, take, width, height);
  if (!framed) return camera;
  const Eigen::Vector3f fitted_eye = camera.eye();
  camera.target = asked.target;
  camera.distance = asked.distance;
  const float nearer = (fitted_eye - camera.eye()).norm();
  camera.near_plane = std::max(camera.near_plane - nearer, camera.distance * 0.1F);
  camera.far_plane += nearer;
  return camera;
}

}  // namespace

std::span<const std::string_view> overlayNames() { return kOverlayNames; }

std::optional<OverlayName> overlayByName(std::string_view name) {
  for (std::size_t i = 0; i < kOverlayNames.size(); ++i) {
    if (kOverlayNames[i] == name) return static_cast<OverlayName>(i);
  }
  return std::nullopt;
}

bool lookAsScene(Camera& camera, const SceneScript::View& view, const formats::PackageView& package) {
  camera.yaw = static_cast<float>(view.yaw);
  camera.pitch = static_cast<float>(view.pitch);
  if (!view.at) return false;
  const float diagonal = package.info().diagonal;
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    camera.target[k] = static_cast<float>((*view.at)[axis] - package.info().origin[axis]) / diagonal;
  }
  camera.distance = static_cast<float>(view.height) / diagonal / (2 * std::tan(camera.fov_y / 2));
  return true;
}

SceneScript::View sceneViewOf(const Camera& camera, const formats::PackageView& package, const Vec3& placed) {
  const float diagonal = package.info().diagonal;
  SceneScript::View view;
  view.yaw = double(camera.yaw);
  constexpr double kSteepest = kMostPitch * kDegree;
  view.pitch = std::clamp(double(camera.pitch), -kSteepest, kSteepest);
  view.at.emplace();
  for (int k = 0; k < 3; ++k) {
    const auto axis = static_cast<std::size_t>(k);
    (*view.at)[axis] = double(camera.target[k] * diagonal - placed[axis]) + package.info().origin[axis];
  }
  view.height = double(camera.distance * 2 * std::tan(camera.fov_y / 2) * diagonal);
  return view;
}

void captureShape(const Scene& scene, Shape& shape) {
  const World& world = scene.world();
  const BodyId body = scene.body();
  const formats::PackageView& package = world.asset(body).package();
  shape.assets.assign(scene.assets().begin(), scene.assets().end());
  std::size_t count = 0;
  for (const auto& asset : shape.assets) count += asset->package().visualPositions().size();
  shape.body_vertices = count;
  shape.solids.clear();
  for (const SceneSolid& solid : scene.solids()) {
    shape.solids.push_back(solid.mesh);
    count += solid.mesh->positions.size();
  }
  shape.positions.resize(count);
  shape.normals.resize(count);
  std::size_t first = 0;
  for (std::size_t b = 0; b < shape.assets.size(); ++b) {
    const auto own = static_cast<std::uint32_t>(shape.assets[b]->package().visualPositions().size());
    if (own == 0) continue;
    world.visualVertices(scene.bodies()[b], {shape.positions[first].data(), sizeof(Eigen::Vector3f), own},
                         {shape.normals[first].data(), sizeof(Eigen::Vector3f), own});
    first += own;
  }
  for (const SceneSolid& solid : scene.solids()) {
    const RigidTransform at = world.colliderPose(solid.id);
    const Eigen::Matrix3f turn = Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(at.rotation.data());
    for (std::size_t i = 0; i < solid.mesh->positions.size(); ++i, ++first) {
      shape.positions[first] = turn * Eigen::Map<const Eigen::Vector3f>(solid.mesh->positions[i].data()) +
                               Eigen::Map<const Eigen::Vector3f>(at.position.data());
      shape.normals[first] = turn * Eigen::Map<const Eigen::Vector3f>(solid.mesh->normals[i].data());
    }
  }
  const std::span<const Vec3> physical = world.positions(body);
  shape.physical.resize(physical.size());
  for (std::size_t i = 0; i < physical.size(); ++i)
    shape.physical[i] = {physical[i][0], physical[i][1], physical[i][2]};
  shape.pinned.assign(scene.pinned().begin(), scene.pinned().end());
  shape.frames.resize(package.clusters().size());
  for (std::size_t c = 0; c < shape.frames.size(); ++c) {
    Vec3 center{};
    Mat3 linear{};
    world.clusterFrame(body, static_cast<std::uint32_t>(c), center, linear);
    shape.frames[c].center = {center[0], center[1], center[2]};
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) shape.frames[c].linear(r, k) = linear[3 * std::size_t(r) + std::size_t(k)];
    }
  }
  shape.time = scene.time();
}

DrawModel modelOf(const Shape& shape, float diagonal) {
  std::vector<const formats::PackageView*> packages;
  packages.reserve(shape.assets.size());
  for (const auto& asset : shape.assets) packages.push_back(&asset->package());
  DrawModel model = joinedModel(packages, diagonal);
  for (const auto& solid : shape.solids) {
    addSolid(model, solid->triangles, solid->positions.size(), solid->one_sided);
  }
  return model;
}

void showShape(Renderer& renderer, const Shape& shape) {
  renderer.setShape(shape.positions, shape.normals);
  renderer.setPhysical(shape.physical);
  renderer.setPinned(shape.pinned);
  renderer.setClusterFrames(shape.frames);
}

Image renderContactSheet(const std::shared_ptr<const Asset>& asset, const std::string& title,
                         const PictureOptions& options, const std::function<void(double)>& progress) {
  const bool chosen = !options.scenes.empty();
  const std::vector<SceneChoice> scenes =
      chosen ? options.scenes
             : std::vector<SceneChoice>{SceneKind::rest, SceneKind::squash, SceneKind::drop, SceneKind::hang};
  const int width = options.width > 0 ? options.width : 320;
  const int height = options.height > 0 ? options.height : 280;
  const int frames = options.frames > 0 ? options.frames : 6;
  const float front_yaw = frontYaw(asset->package());
  const int columns = options.columns > 0 ? options.columns : frames > 1 ? frames : static_cast<int>(scenes.size());

  std::vector<std::vector<Tile>> rows;  // a row each scene, wrapped over lines of `columns`
  std::vector<Tile> overlay_row;
  for (const SceneChoice& scene : scenes) {
    const std::string name = scene.name();
    const bool at_rest = scene == SceneKind::rest;
    const double length = options.seconds > 0 ? options.seconds : scene.seconds();
    Take take = recordTake(asset, sceneOptions(options, scene), tileTimes(scene, length, frames));
    applyOverlay(take.settings, options.overlay.value_or(OverlayName::none));
    take.settings.pinned = showsPinned(options, scene);
    scaleMarks(take.settings, height);
    const Camera camera = sceneCamera(options, take, asset->package(), width, height);
    take.settings.lighting = lightingOf(options, litFrom(options, camera, front_yaw), front_yaw);
    std::vector<Tile> row;
    for (std::size_t k = 0; k < take.shapes.size(); ++k) {
      Tile tile{take.shapes[k], camera, take.settings, name + "  " + seconds(take.shapes[k].time)};
      if (options.turntable) {
        const float turn =
            2 * std::numbers::pi_v<float> * static_cast<float>(k) / static_cast<float>(take.shapes.size());
        tile.camera.yaw += turn;
        tile.camera = fitted(tile.camera, take, width, height);
        tile.settings.lighting = lightingOf(options, tile.camera.yaw, front_yaw);
      } else if (at_rest && !options.view && !options.camera) {
        // Nothing moves, so the row shows all sides instead.
        struct Side {
          const char* name;
          float yaw, pitch;
        };
        constexpr float pi = std::numbers::pi_v<float>;
        constexpr std::array<Side, 6> kSides = {{{"three-quarter", 0.70F, 0.32F},
                                                 {"front", 0, 0.10F},
                                                 {"side", pi / 2, 0.10F},
                                                 {"back", pi, 0.10F},
                                                 {"top", 0, pi / 2 - 1e-3F},
                                                 {"three-quarter, below", 0.70F + pi, -0.45F}}};
        const Side& side = kSides[k % kSides.size()];
        Camera turned;
        turned.yaw = front_yaw + side.yaw;
        turned.pitch = side.pitch;
        tile.camera = fitted(turned, take, width, height);
        tile.settings.lighting = lightingOf(options, turned.yaw, front_yaw);
        tile.label += "  " + std::string(side.name);
      }
      row.push_back(std::move(tile));
    }
    if (!options.overlay && (at_rest || scene == SceneKind::squash || scene == SceneKind::hang || chosen)) {
      // One telling moment: the start of rest, early in a press, the end of the others.
      const std::size_t moment = at_rest                                                     ? 0
                                 : scene == SceneKind::squash || scene == SceneKind::stretch ? take.shapes.size() / 3
                                                                                             : take.shapes.size() - 1;
      for (const OverlayName overlay : {OverlayName::physical, OverlayName::clusters}) {
        Tile tile{take.shapes[moment], camera, take.settings,
                  name + "  " + seconds(take.shapes[moment].time) + "  " +
                      (overlay == OverlayName::physical ? "physical mesh" : "clusters")};
        applyOverlay(tile.settings, overlay);
        overlay_row.push_back(std::move(tile));
      }
    }
    if (frames == 1 && !rows.empty()) {
      rows.front().insert(rows.front().end(), std::make_move_iterator(row.begin()), std::make_move_iterator(row.end()));
    } else {
      rows.push_back(std::move(row));
    }
  }
  if (!overlay_row.empty()) rows.push_back(std::move(overlay_row));

  std::size_t lines = 0;
  std::size_t tiles = 0;
  const auto per_line = static_cast<std::size_t>(columns);
  for (const auto& row : rows) {
    lines += (row.size() + per_line - 1) / per_line;
    tiles += row.size();
  }
  constexpr int kTitleHeight = 62;
  Image sheet(2 * kMargin + columns * width + (columns - 1) * kGap,
              kMargin + kTitleHeight + static_cast<int>(lines) * (height + kLabelHeight + kGap) - kGap + kMargin,
              kPaper);
  const float room = static_cast<float>(sheet.width - 2 * kMargin);
  drawText(sheet, kMargin, kMargin - 4, 30, kInk, fitText(title, 30, room));
  drawText(sheet, kMargin, kMargin + 29, 17, kGreyInk, fitText(counts(asset->package(), options.others), 17, room));

  std::optional<Renderer> renderer;
  Shape drawn;
  int y = kMargin + kTitleHeight;
  std::size_t done = 0;
  for (const auto& row : rows) {
    for (std::size_t k = 0; k < row.size(); ++k) {
      const Tile& tile = row[k];
      if (!renderer || !tile.shape.isLike(drawn)) {
        drawn = tile.shape;
        renderer.reset();
        renderer.emplace(modelOf(tile.shape, asset->package().info().diagonal));
      }
      showShape(*renderer, tile.shape);
      renderer->draw(tile.camera, tile.settings, width, height);
      const Image picture = renderer->read();
      const auto column = static_cast<int>(k % per_line);
      if (k > 0 && column == 0) y += height + kLabelHeight + kGap;
      const int x = kMargin + column * (width + kGap);
      drawText(sheet, static_cast<float>(x + 2), static_cast<float>(y + 3), kLabelText, kInk,
               fitText(tile.label, kLabelText, static_cast<float>(width - 4)));
      sheet.paste(picture, x, y + kLabelHeight);
      if (progress) progress(static_cast<double>(++done) / static_cast<double>(tiles));
    }
    y += height + kLabelHeight + kGap;
  }
  return sheet;
}

void renderVideo(const std::shared_ptr<const Asset>& asset, const std::string& title, const PictureOptions& options,
                 const std::filesystem::path& file, const std::function<void(double)>& progress) {
  const SceneChoice choice = options.scenes.empty() ? SceneChoice(SceneKind::drop) : options.scenes.front();
  const int width = options.width > 0 ? options.width : 960;
  const int height = options.height > 0 ? options.height : 720;
  constexpr double kFramesPerSecond = 30;
  const double length = options.seconds > 0  ? options.seconds
                        : options.frames > 0 ? options.frames / kFramesPerSecond
                        : choice.script      ? choice.seconds()
                                             : 4;
  const int frames =
      options.frames > 0 ? options.frames : std::max(1, static_cast<int>(std::lround(length * kFramesPerSecond)));

  // First the motion as a whole, for the camera; then the same again, frame by frame. The runtime repeats itself
  // exactly.
  const SceneOptions scene_options = sceneOptions(options, choice);
  Take take = recordTake(asset, scene_options, {0.0, (frames - 1) / kFramesPerSecond});
  applyOverlay(take.settings, options.overlay.value_or(OverlayName::none));
  take.settings.pinned = showsPinned(options, choice);
  const float aspect = static_cast<float>(width) / static_cast<float>(height);
  scaleMarks(take.settings, height);
  const bool framed = choice.script && choice.script->view && choice.script->view->at;
  Camera camera = sceneCamera(options, take, asset->package(), width, height);
  const float yaw = camera.yaw;
  const float front_yaw = frontYaw(asset->package());
  take.settings.lighting = lightingOf(options, litFrom(options, camera, front_yaw), front_yaw);
  // About the middle, from as far as the widest side asks for.
  if (options.turntable && !framed) {
    const Eigen::Vector3f middle = take.settings.shadow_center;
    float distance = 0, near_plane = std::numeric_limits<float>::infinity(), far_plane = 0;
    constexpr int kSides = 8;
    for (int side = 0; side < kSides; ++side) {
      camera.yaw = yaw + 2 * std::numbers::pi_v<float> * static_cast<float>(side) / kSides;
      fitCamera(camera, take.hull, aspect, kFitMargin);
      // Fitted about its own centre; about the middle of the motion it must be farther by at most the difference.
      distance = std::max(distance, camera.distance + (camera.target - middle).norm());
      near_plane = std::min(near_plane, camera.near_plane);
      far_plane = std::max(far_plane, camera.far_plane);
    }
    camera.yaw = yaw;
    camera.target = middle;
    camera.distance = distance;
    camera.near_plane = near_plane;
    camera.far_plane = far_plane + distance;
  }

  Scene scene(asset, scene_options);
  std::optional<Renderer> renderer;
  Shape drawn;
  VideoFile video(file, width, height, kFramesPerSecond);
  Shape shape;
  for (int f = 0; f < frames; ++f) {
    const double time = f / kFramesPerSecond;
    while (scene.time() + 0.5 * double(scene.stepSeconds()) < time) scene.step();
    captureShape(scene, shape);
    if (!renderer || !shape.isLike(drawn)) {
      drawn = shape;
      renderer.reset();
      renderer.emplace(modelOf(shape, asset->package().info().diagonal));
    }
    showShape(*renderer, shape);
    if (options.turntable) {
      camera.yaw = yaw + 2 * std::numbers::pi_v<float> * static_cast<float>(f) / static_cast<float>(frames);
      take.settings.lighting = lightingOf(options, camera.yaw, front_yaw);
    }
    renderer->draw(camera, take.settings, width, height);
    Image picture = renderer->read();
    label(picture, title + "  ·  " + choice.name() + "  " + seconds(time));
    video.add(picture);
    if (progress) progress(static_cast<double>(f + 1) / frames);
  }
  video.finish();
}

}  // namespace sinew::tools
