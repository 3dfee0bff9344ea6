// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/weights_picture.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>

#include "tools/render/best_side.h"
#include "tools/render/camera.h"
#include "tools/render/draw_model.h"
#include "tools/render/headless.h"
#include "tools/render/image.h"
#include "tools/render/overlay.h"
#include "tools/render/page.h"
#include "tools/render/renderer.h"
#include "tools/render/text.h"

namespace sinew::tools {
namespace {

constexpr int kMargin = 16;
constexpr int kGap = 6;
constexpr int kTile = 300;
constexpr int kColumns = 4;
constexpr int kTitle = 40;
constexpr std::size_t kMostAlone = 40;
constexpr float kFitMargin = 0.08F;
constexpr float kFrontYaw = 0.35F, kFrontPitch = 0.15F;
constexpr std::array<float, 3> kBare = {0.42F, 0.43F, 0.45F};

// A mesh that shows nothing but weights.
DrawModel bareModel(const VisualMesh& mesh) {
  DrawModel model = makeDrawModel(mesh);
  model.colors.assign(model.positions.size(), {kBare[0], kBare[1], kBare[2], 1});
  model.textures.clear();
  for (DrawPart& part : model.parts) {
    part.texture = formats::kNone;
    part.base_color = Eigen::Vector3f::Ones();
    part.vertex_colors = true;
  }
  return model;
}

// Mixes the colours of all weights over grey.
void tint(DrawModel& model, const std::vector<NamedWeights>& named, std::size_t first, std::size_t count) {
  for (std::size_t v = 0; v < model.colors.size(); ++v) {
    std::array<double, 3> sum = {0, 0, 0};
    double total = 0;
    double largest = 0;
    for (std::size_t i = first; i < first + count; ++i) {
      const double w = named[i].weights[v];
      const std::array<float, 3> color = distinctColor(std::uint32_t(i));
      for (std::size_t k = 0; k < 3; ++k) sum[k] += w * double(color[k]);
      total += w;
      largest = std::max(largest, w);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const double mixed = total > 0 ? sum[k] / total : 0;
      model.colors[v][k] = float(largest * mixed + (1 - largest) * double(kBare[k]));
    }
  }
}

}  // namespace

void renderWeights(const VisualMesh& mesh, const std::vector<NamedWeights>& named, const std::string& title,
                   const std::filesystem::path& png, float front_yaw) {
  DrawModel model = bareModel(mesh);
  std::vector<Eigen::Vector3f> drawn;
  for (const Eigen::Vector3f& p : model.positions) drawn.push_back(p / model.diagonal);
  MotionHull hull;
  hull.add(drawn);
  DrawSettings settings;
  settings.shadow_center = hull.center();
  settings.shadow_radius = std::max(hull.radius(), 1e-3F);
  const HeadlessContext context;
  std::vector<Image> tiles;
  const auto draw = [&](Renderer& renderer, float yaw, float pitch, const std::string& label) {
    Camera camera;
    camera.yaw = yaw;
    camera.pitch = pitch;
    fitCamera(camera, hull.points(), 1, kFitMargin);
    settings.lighting = turnedLighting(Lighting{}, yaw - kLitYaw);
    renderer.draw(camera, settings, kTile, kTile);
    tiles.push_back(renderer.read());
    drawCaption(tiles.back(), 6, 4, 16, label);
    drawAxes(tiles.back(), camera);
    drawScaleBar(tiles.back(), camera, double(model.diagonal));
  };
  {
    tint(model, named, 0, named.size());
    Renderer renderer(model);
    draw(renderer, front_yaw + kFrontYaw, kFrontPitch, "all, front");
    draw(renderer, front_yaw - 1.2F, kFrontPitch, "all, its right side");
    draw(renderer, front_yaw + 1.9F, kFrontPitch, "all, its left side");
    draw(renderer, front_yaw + 3.5F, kFrontPitch, "all, back");
  }
  const Sides sides(model.positions, model.triangles);
  for (std::size_t i = 0; i < std::min(named.size(), kMostAlone); ++i) {
    tint(model, named, i, 1);
    Renderer renderer(model);
    const Side side = sides.best(named[i].weights);
    draw(renderer, side.yaw, side.pitch, named[i].name);
  }
  const int rows = (int(tiles.size()) + kColumns - 1) / kColumns;
  Image sheet(2 * kMargin + kColumns * kTile + (kColumns - 1) * kGap,
              2 * kMargin + kTitle + rows * kTile + (rows - 1) * kGap, kPaper);
  drawText(sheet, kMargin, kMargin - 4, 26, kInk, fitText(title, 26, float(sheet.width - 2 * kMargin)));
  for (int i = 0; i < int(tiles.size()); ++i) {
    sheet.paste(tiles[std::size_t(i)], kMargin + (i % kColumns) * (kTile + kGap),
                kMargin + kTitle + (i / kColumns) * (kTile + kGap));
  }
  writePng(sheet, png);
}

}  // namespace sinew::tools
