// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "tools/import/gltf_buffers.h"
#include "tools/import/gltf_text.h"
#include "tools/import/raw_scene.h"

namespace sinew::tools {

/// How a material's base colour texture is laid on.
struct GltfTextureUse {
  std::uint64_t uv_set = 0;
  bool transformed = false;
  std::array<double, 2> offset = {0, 0};
  std::array<double, 2> scale = {1, 1};
  double rotation = 0;
};

/// Materials asked for, and their textures, in the order of the first asking.
class GltfMaterials {
 public:
  /// \param scene receives them. All that is given stays.
  GltfMaterials(const GltfValue& top, GltfBuffers& buffers, RawScene& scene)
      : top_(top), buffers_(buffers), scene_(scene) {}

  /// The number in RawScene::materials of the one that `user` names.
  std::uint32_t number(const GltfValue& user);
  /// \param number from number().
  const GltfTextureUse& use(std::uint32_t number) const { return uses_[number]; }

 private:
  std::uint32_t textureOf(const GltfValue& reference);

  const GltfValue& top_;
  GltfBuffers& buffers_;
  RawScene& scene_;
  std::map<std::uint64_t, std::uint32_t> number_of_material_, texture_of_image_;
  std::vector<GltfTextureUse> uses_;
};

}  // namespace sinew::tools
