// SPDX-License-Identifier: GPL-3.0-or-later
//
// Shapes side by side under their names: what studies show.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"
#include "tools/render/camera.h"
#include "tools/render/image.h"
#include "tools/render/picture.h"

namespace sinew::tools {

struct RowPicture {
  std::shared_ptr<const Asset> asset;
  Shape shape;
  std::string label;
  std::vector<std::array<float, 3>> colors =
      {};  ///< of the visual vertices, linear RGB, in place of the asset's; empty: those
};

struct RowOptions {
  int width = 400, height = 400;  ///< pixels of one picture
  int columns = 0;                ///< pictures in a row; 0 = all
};

/// All from the same place and at the same scale. \param row at least one; packages of one source, so that their sizes
/// are alike. \param camera its direction; it is fitted to what is shown. Needs a current OpenGL context.
Image drawRow(std::span<const RowPicture> row, Camera camera, const RowOptions& options);

}  // namespace sinew::tools
