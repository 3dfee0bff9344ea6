// SPDX-License-Identifier: GPL-3.0-or-later
//
// The binary data of a glTF: its GLB, buffers, views and accessors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/import/gltf_text.h"

namespace sinew::tools {

/// The chunks of a GLB; of another file all is text.
struct GltfChunks {
  std::string_view text;
  std::optional<std::string_view> binary;
};

GltfChunks gltfChunks(std::string_view bytes);

/// An accessor whose view has been found to hold it.
struct GltfAccessor {
  std::uint64_t component_type = 0;
  std::size_t components = 0;
  std::size_t component_size = 0;
  bool normalized = false;
  std::uint64_t count = 0;
  std::size_t stride = 0;
  const char* data = nullptr;  ///< null = zeros
  GltfValue value{nullptr, ""};
};

/// Buffers are loaded when they are first asked for. In these functions `user` is the place in the JSON that names what
/// is wanted, by its number.
class GltfBuffers {
 public:
  /// \param top of the JSON; stays, as the binary chunk does.
  /// \param folder where the files of buffers lie.
  GltfBuffers(GltfValue top, std::optional<std::string_view> binary, std::filesystem::path folder);

  std::string_view view(const GltfValue& user, std::uint64_t* stride = nullptr);
  GltfAccessor accessor(const GltfValue& user);
  /// All components of all elements, sparse entries put in.
  std::vector<float> numbers(const GltfAccessor& a);
  /// A vertex attribute of `count` elements with one of the given numbers of components.
  std::vector<float> attribute(const GltfValue& user, std::uint64_t count,
                               std::initializer_list<std::size_t> components, std::size_t* found = nullptr);
  /// Indices of vertices below `vertex_count`.
  std::vector<std::uint32_t> indices(const GltfValue& user, std::uint64_t vertex_count);

 private:
  struct Buffer {
    std::string owned;
    std::string_view bytes;
    bool loaded = false;
  };
  std::string_view buffer(const GltfValue& user);
  const char* sparseBytes(const GltfValue& part, std::uint64_t count, std::size_t element);

  GltfValue top_;
  std::optional<std::string_view> binary_;
  std::filesystem::path folder_;
  std::vector<Buffer> buffers_;
};

}  // namespace sinew::tools
