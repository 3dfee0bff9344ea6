// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/gltf_materials.h"

#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace sinew::tools {
namespace {

GltfTextureUse textureUse(const GltfValue& reference) {
  GltfTextureUse use;
  use.uv_set = reference.integer("texCoord", 0);
  if (const GltfValue extensions = reference.get("extensions"))
    if (const GltfValue transform = extensions.get("KHR_texture_transform")) {
      use.transformed = true;
      use.offset = transform.numbers<2>("offset", {0, 0});
      use.scale = transform.numbers<2>("scale", {1, 1});
      use.rotation = transform.number("rotation", 0);
      use.uv_set = transform.integer("texCoord", use.uv_set);
    }
  return use;
}

}  // namespace

std::uint32_t GltfMaterials::number(const GltfValue& user) {
  const GltfValue list = top_.get("materials");
  const std::uint64_t index = user.index("material", list.size());
  const auto [at, fresh] = number_of_material_.try_emplace(index, std::uint32_t(scene_.materials.size()));
  if (!fresh) return at->second;
  const GltfValue value = list.at(index);
  RawMaterial out;
  out.name = value.text("name", "material " + std::to_string(index));
  out.double_sided = value.boolean("doubleSided", false);
  out.base_color = {1, 1, 1, 1};
  GltfTextureUse use;
  const auto colorOf = [&](const GltfValue& group, const char* factor, const char* texture) {
    const auto color = group.numbers<4>(factor, {1, 1, 1, 1});
    for (std::size_t k = 0; k < 4; ++k) out.base_color[k] = float(color[k]);
    if (const GltfValue reference = group.get(texture)) {
      out.texture = textureOf(reference);
      use = textureUse(reference);
    }
  };
  if (const GltfValue pbr = value.get("pbrMetallicRoughness")) {
    colorOf(pbr, "baseColorFactor", "baseColorTexture");
  } else if (const GltfValue extensions = value.get("extensions")) {
    if (const GltfValue old = extensions.get("KHR_materials_pbrSpecularGlossiness"))
      colorOf(old, "diffuseFactor", "diffuseTexture");
  }
  scene_.materials.push_back(std::move(out));
  uses_.push_back(use);
  return at->second;
}

std::uint32_t GltfMaterials::textureOf(const GltfValue& reference) {
  const GltfValue list = top_.get("textures");
  const GltfValue texture = list.at(reference.need("index").index("texture", list.size()));
  GltfValue source = texture.get("source");
  if (const GltfValue extensions = texture.get("extensions"); !source && extensions)
    for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"})
      if (const GltfValue own = extensions.get(name); own && !source) source = own.get("source");
  if (!source) return formats::kNone;
  const GltfValue images = top_.get("images");
  const std::uint64_t image_index = source.index("image", images.size());
  const auto [at, fresh] = texture_of_image_.try_emplace(image_index, std::uint32_t(scene_.textures.size()));
  if (!fresh) return at->second;
  const GltfValue image = images.at(image_index);
  RawTexture out;
  out.name = image.text("name", "");
  const std::string uri = image.text("uri", "");
  std::string_view bytes;
  std::optional<std::string> decoded;
  if (const GltfValue view = image.get("bufferView")) {
    bytes = buffers_.view(view);
  } else if (uri.starts_with("data:")) {
    decoded = dataUri(uri);
    if (!decoded) image.get("uri").fail("an image's data URI is damaged");
    bytes = *decoded;
  } else {
    out.path = percentDecoded(uri);
    if (out.name.empty()) out.name = out.path;
  }
  if (out.path.empty())
    out.name = "embedded " + std::to_string(image_index) + (out.name.empty() ? "" : " (" + out.name + ")");
  out.bytes.resize(bytes.size());
  if (!bytes.empty()) std::memcpy(out.bytes.data(), bytes.data(), bytes.size());
  scene_.textures.push_back(std::move(out));
  return at->second;
}

}  // namespace sinew::tools
