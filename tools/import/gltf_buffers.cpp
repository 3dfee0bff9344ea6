// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/gltf_buffers.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <map>
#include <utility>

#include "tools/import/readers.h"

namespace sinew::tools {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are read in place");

constexpr std::uint64_t kMaxCount = 1U << 30;

std::uint32_t word(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::size_t componentSize(std::uint64_t type, const GltfValue& user) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      user.fail("an accessor has the unknown component type " + std::to_string(type));
  }
}

double component(const char* at, std::uint64_t type, bool normalized) {
  const auto load = [at]<class T>(T value) {
    std::memcpy(&value, at, sizeof value);
    return value;
  };
  switch (type) {
    case 5120:
      return normalized ? std::max(load(std::int8_t()) / 127.0, -1.0) : load(std::int8_t());
    case 5121:
      return normalized ? load(std::uint8_t()) / 255.0 : load(std::uint8_t());
    case 5122:
      return normalized ? std::max(load(std::int16_t()) / 32767.0, -1.0) : load(std::int16_t());
    case 5123:
      return normalized ? load(std::uint16_t()) / 65535.0 : load(std::uint16_t());
    case 5125:
      return double(load(std::uint32_t()));
    default:
      return double(load(float()));
  }
}

}  // namespace

GltfChunks gltfChunks(std::string_view bytes) {
  GltfChunks chunks{bytes, std::nullopt};
  if (!bytes.starts_with("glTF")) return chunks;
  if (bytes.size() < 20) throw ReadError("is a GLB cut off within its header");
  const std::uint32_t version = word(bytes, 4);
  if (version != 2)
    throw ReadError("is a GLB of version " + std::to_string(version) + "; only 2 is supported",
                    "Export it as glTF 2.0.");
  if (word(bytes, 8) > bytes.size())
    throw ReadError("is a GLB cut off: it promises " + std::to_string(word(bytes, 8)) + " bytes and holds " +
                        std::to_string(bytes.size()),
                    "Copy or export it again.");
  bytes = bytes.substr(0, std::max<std::size_t>(word(bytes, 8), 20));
  for (std::size_t at = 12, chunk = 0; at + 8 <= bytes.size(); ++chunk) {
    const std::uint32_t size = word(bytes, at);
    const std::uint32_t type = word(bytes, at + 4);
    at += 8;
    if (size > bytes.size() - at)
      throw ReadError("is a GLB whose chunk " + std::to_string(chunk) + " is cut off", "Copy or export it again.");
    if (chunk == 0 && type != 0x4E4F534A) throw ReadError("is a GLB whose first chunk is not JSON");
    if (chunk == 0) chunks.text = bytes.substr(at, size);
    if (chunk > 0 && type == 0x004E4942 && !chunks.binary) chunks.binary = bytes.substr(at, size);
    at += size;
    at += std::min((4 - at % 4) % 4, bytes.size() - at);
  }
  return chunks;
}

GltfBuffers::GltfBuffers(GltfValue top, std::optional<std::string_view> binary, std::filesystem::path folder)
    : top_(std::move(top)), binary_(binary), folder_(std::move(folder)) {}

std::string_view GltfBuffers::buffer(const GltfValue& user) {
  const GltfValue list = top_.get("buffers");
  const std::uint64_t index = user.index("buffer", list.size());
  if (buffers_.size() != list.size()) buffers_.resize(list.size());
  Buffer& out = buffers_[index];
  if (out.loaded) return out.bytes;
  const GltfValue value = list.at(index);
  const std::uint64_t length = value.need("byteLength").integer();
  const std::string uri = value.text("uri", "");
  if (uri.empty()) {
    if (index != 0 || !binary_) {
      if (value.get("extensions") && value.get("extensions").get("EXT_meshopt_compression"))
        unsupportedExtension("EXT_meshopt_compression", value.path());
      value.fail("a buffer has neither a file nor the GLB's binary chunk");
    }
    out.bytes = *binary_;
  } else if (uri.starts_with("data:")) {
    auto decoded = dataUri(uri);
    if (!decoded) value.get("uri").fail("a buffer's data URI is damaged");
    out.owned = std::move(*decoded);
    out.bytes = out.owned;
  } else {
    const std::string name = percentDecoded(uri);
    auto content = readCompanionFile(folder_, name, std::uint64_t(1) << 40);
    if (!content)
      throw ReadError("the buffer file \"" + name.substr(0, 200) +
                          "\" is missing or lies outside the file's folder (at " + value.path() + "/uri)",
                      "Put it beside the glTF, or export a GLB.");
    out.owned = std::move(*content);
    out.bytes = out.owned;
  }
  if (out.bytes.size() < length)
    value.fail("a buffer promises " + std::to_string(length) + " bytes and holds " + std::to_string(out.bytes.size()));
  out.bytes = out.bytes.substr(0, length);
  out.loaded = true;
  return out.bytes;
}

std::string_view GltfBuffers::view(const GltfValue& user, std::uint64_t* stride) {
  const GltfValue list = top_.get("bufferViews");
  const GltfValue view = list.at(user.index("bufferView", list.size()));
  if (const GltfValue extensions = view.get("extensions"))
    for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
      if (extensions.get(name) && !extensions.get(name).get("fallback")) {
        const GltfValue backing = top_.get("buffers").at(view.need("buffer").integer());
        if (backing.text("uri", "").empty() && !(view.need("buffer").integer() == 0 && binary_))
          unsupportedExtension(name, view.path());
      }
  const std::string_view bytes = buffer(view.need("buffer"));
  const std::uint64_t offset = view.integer("byteOffset", 0);
  const std::uint64_t length = view.need("byteLength").integer();
  if (offset > bytes.size() || length > bytes.size() - offset)
    view.fail("a bufferView reaches beyond its buffer of " + std::to_string(bytes.size()) + " bytes");
  if (stride) *stride = view.integer("byteStride", 0);
  return bytes.substr(offset, length);
}

GltfAccessor GltfBuffers::accessor(const GltfValue& user) {
  const GltfValue list = top_.get("accessors");
  const GltfValue value = list.at(user.index("accessor", list.size()));
  GltfAccessor out;
  out.value = value;
  out.count = value.need("count").integer();
  if (out.count > kMaxCount) value.get("count").fail("an accessor has " + std::to_string(out.count) + " elements");
  out.component_type = value.need("componentType").integer();
  out.component_size = componentSize(out.component_type, value.get("componentType"));
  out.normalized = value.boolean("normalized", false);
  static const std::map<std::string, std::size_t, std::less<>> kComponents = {
      {"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
  const auto known = kComponents.find(value.text("type", ""));
  if (known == kComponents.end()) value.get("type").fail("an accessor has an unknown type");
  out.components = known->second;
  const std::size_t element = out.components * out.component_size;
  out.stride = element;
  if (const GltfValue view = value.get("bufferView")) {
    std::uint64_t stride = 0;
    const std::string_view bytes = this->view(view, &stride);
    if (stride != 0) {
      if (stride < element || stride > 4096)
        value.fail("an accessor's stride of " + std::to_string(stride) + " bytes does not fit its elements of " +
                   std::to_string(element));
      out.stride = stride;
    }
    const std::uint64_t offset = value.integer("byteOffset", 0);
    if (out.count > 0 && (offset > bytes.size() || bytes.size() - offset < element ||
                          (out.count - 1) > (bytes.size() - offset - element) / out.stride))
      value.fail("an accessor of " + std::to_string(out.count) + " elements reaches beyond its bufferView of " +
                 std::to_string(bytes.size()) + " bytes");
    out.data = bytes.data() + offset;
  }
  return out;
}

std::vector<float> GltfBuffers::numbers(const GltfAccessor& a) {
  std::vector<float> out(a.count * a.components, 0.0F);
  if (a.data)
    for (std::uint64_t i = 0; i < a.count; ++i)
      for (std::size_t k = 0; k < a.components; ++k)
        out[i * a.components + k] =
            float(component(a.data + i * a.stride + k * a.component_size, a.component_type, a.normalized));
  if (const GltfValue sparse = a.value.get("sparse")) {
    const std::uint64_t count = sparse.need("count").integer();
    if (count > a.count) sparse.fail("a sparse accessor replaces more elements than there are");
    const GltfValue indices = sparse.need("indices");
    const GltfValue values = sparse.need("values");
    const std::uint64_t index_type = indices.need("componentType").integer();
    if (index_type != 5121 && index_type != 5123 && index_type != 5125)
      indices.fail("sparse indices have a wrong component type");
    const std::size_t index_size = componentSize(index_type, indices);
    const std::size_t element = a.components * a.component_size;
    const char* index_at = sparseBytes(indices, count, index_size);
    const char* value_at = sparseBytes(values, count, element);
    for (std::uint64_t i = 0; i < count; ++i) {
      const auto target = std::uint64_t(component(index_at + i * index_size, index_type, false));
      if (target >= a.count)
        indices.fail("a sparse index names element " + std::to_string(target) + " of " + std::to_string(a.count));
      for (std::size_t k = 0; k < a.components; ++k)
        out[target * a.components + k] =
            float(component(value_at + i * element + k * a.component_size, a.component_type, a.normalized));
    }
  }
  return out;
}

const char* GltfBuffers::sparseBytes(const GltfValue& part, std::uint64_t count, std::size_t element) {
  const std::string_view bytes = view(part.need("bufferView"));
  const std::uint64_t offset = part.integer("byteOffset", 0);
  if (offset > bytes.size() || count > (bytes.size() - offset) / element)
    part.fail("a sparse accessor reaches beyond its bufferView");
  return bytes.data() + offset;
}

std::vector<float> GltfBuffers::attribute(const GltfValue& user, std::uint64_t count,
                                          std::initializer_list<std::size_t> components, std::size_t* found) {
  const GltfAccessor a = accessor(user);
  if (std::find(components.begin(), components.end(), a.components) == components.end())
    user.fail("names an accessor of the wrong type");
  if (a.count != count)
    user.fail("names an accessor of " + std::to_string(a.count) + " elements, but there are " + std::to_string(count) +
              " positions");
  if (found) *found = a.components;
  return numbers(a);
}

std::vector<std::uint32_t> GltfBuffers::indices(const GltfValue& user, std::uint64_t vertex_count) {
  const GltfAccessor a = accessor(user);
  if (a.components != 1 || (a.component_type != 5121 && a.component_type != 5123 && a.component_type != 5125))
    user.fail("names an accessor that holds no indices");
  std::vector<std::uint32_t> indices(a.count);
  for (std::uint64_t i = 0; i < a.count; ++i) {
    const double index = a.data ? component(a.data + i * a.stride, a.component_type, false) : 0;
    if (index >= double(vertex_count))
      user.fail("index " + std::to_string(i) + " names vertex " + std::to_string(std::uint64_t(index)) + " of " +
                std::to_string(vertex_count));
    indices[i] = std::uint32_t(index);
  }
  return indices;
}

}  // namespace sinew::tools
