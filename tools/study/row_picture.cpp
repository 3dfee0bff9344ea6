// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/row_picture.h"

#include <algorithm>
#include <vector>

#include "tools/render/draw_model.h"
#include "tools/render/page.h"
#include "tools/render/renderer.h"
#include "tools/render/text.h"

namespace sinew::tools {

Image drawRow(std::span<const RowPicture> row, Camera camera, const RowOptions& options) {
  constexpr int kLabel = 24;
  constexpr float kText = 15;
  constexpr float kMargin = 0.05F;
  std::vector<Eigen::Vector3f> points;
  for (const RowPicture& one : row) {
    for (const Eigen::Vector3f& x : one.shape.positions) points.push_back(x / one.asset->package().info().diagonal);
  }
  fitCamera(camera, points, float(options.width) / float(options.height), kMargin);
  const int count = int(row.size());
  const int columns = options.columns > 0 ? std::min(options.columns, count) : count;
  const int lines = (count + columns - 1) / columns;
  Image image(columns * options.width, lines * (options.height + kLabel));
  for (int i = 0; i < count; ++i) {
    const RowPicture& one = row[std::size_t(i)];
    DrawModel model = makeDrawModel(one.asset->package());
    if (!one.colors.empty()) {
      model.colors.clear();
      for (const auto& c : one.colors) model.colors.push_back({c[0], c[1], c[2], 1});
      for (DrawPart& part : model.parts) {
        part.vertex_colors = true;
        part.texture = formats::kNone;
        part.base_color = Eigen::Vector3f::Ones();
      }
    }
    Renderer renderer(model);
    DrawSettings settings;
    settings.pinned = false;
    showShape(renderer, one.shape);
    renderer.draw(camera, settings, options.width, options.height);
    const int x = i % columns * options.width;
    const int y = i / columns * (options.height + kLabel);
    image.paste(renderer.read(), x, y + kLabel);
    drawText(image, float(x + 6), float(y + 4), kText, kInk, fitText(one.label, kText, float(options.width - 10)));
  }
  return image;
}

}  // namespace sinew::tools
