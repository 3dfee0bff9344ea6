// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "tools/core/text.h"
#include "tools/import/gltf_text.h"
#include "tools/import/readers.h"

namespace sinew::tools {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "glTF buffers are read in place");

constexpr std::uint64_t kMaxCount = 1U << 30;

const std::set<std::string, std::less<>>& supportedExtensions() {
  static const std::set<std::string, std::less<>> kNames = {
      "KHR_mesh_quantization", "KHR_texture_transform",  "KHR_lights_punctual",
      "EXT_texture_webp",      "KHR_texture_basisu",     "KHR_materials_pbrSpecularGlossiness",
      "EXT_texture_avif",      "MSFT_texture_dds",       "KHR_xmp_json_ld",
      "KHR_animation_pointer", "KHR_materials_variants", "KHR_node_visibility"};
  return kNames;
}

class GltfReader {
 public:
  GltfReader(std::string_view bytes, const std::filesystem::path& folder, const std::string& stem)
      : folder_(folder), stem_(stem), top_(nullptr, "") {
    std::string_view text = bytes;
    if (bytes.starts_with("glTF")) text = openGlb(bytes);
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    if (tooDeep(text)) throw ReadError("holds JSON nested deeper than " + std::to_string(kMaxDepth) + " levels");
    try {
      json_ = json::parse(text);
    } catch (const json::parse_error& error) {
      const std::string_view before = text.substr(0, error.byte);
      const std::size_t line = std::size_t(std::count(before.begin(), before.end(), '\n')) + 1;
      throw ReadError("is no glTF: its JSON is malformed (line " + std::to_string(line) + ", byte " +
                      std::to_string(error.byte) + " of the JSON)");
    } catch (const json::out_of_range&) {
      throw ReadError("is no glTF: its JSON has a number that is larger than any double");
    }
    if (!json_.is_object()) throw ReadError("is no glTF: its JSON is no object");
    top_ = GltfValue(&json_, "");
  }

  RawScene read() {
    checkVersionAndExtensions();
    loadNodes();
    checkReferences();
    scene_.metres_per_unit = 1;
    scene_.unit_source = "glTF is in metres by its specification";
    materials_ = top_.get("materials");
    material_number_.assign(materials_.size(), kNoIndex);
    for (std::uint32_t node : order_) instance(node);
    std::size_t left_out = 0;
    for (std::size_t n = 0; n < nodes_.size(); ++n)
      if (number_of_node_[n] == kNoIndex && nodes_.at(n).get("mesh")) ++left_out;
    if (left_out > 0)
      info("dropped-nodes", left_out,
           std::to_string(left_out) + " nodes with a mesh are not in the file's scene and were left out");
    if (dropped_primitives_ > 0)
      info("dropped-primitives", dropped_primitives_,
           std::to_string(dropped_primitives_) + " point or line primitives were left out; only faces are used");
    if (zero_rotations_ > 0)
      warn("zero-rotations", zero_rotations_,
           counted(zero_rotations_, "node has", "nodes have") + " a rotation of four zeros; taken as none");
    if (loose_indices_ > 0)
      warn("loose-indices", loose_indices_,
           counted(loose_indices_, "index", "indices") + " behind the last whole triangle of a list were left out");
    if (!posed_morphs_.empty())
      scene_.findings.push_back(
          {"unapplied-morphs",
           Severity::warning,
           std::to_string(posed_morphs_.size()) + (posed_morphs_.size() == 1 ? " mesh has" : " meshes have") +
               " morph weights that are not 0 by default; they are not applied, the base shape is used",
           posed_morphs_.size(),
           "",
           {},
           posed_morphs_.front(),
           "For the other shape apply the shape keys to the mesh in the program that made the file, and export it "
           "again."});
    if (const std::size_t animations = top_.get("animations").size(); animations > 0)
      info("dropped-animations", animations,
           std::to_string(animations) + " animations were left out; the rest pose is used");
    return std::move(scene_);
  }

 private:
  struct Buffer {
    std::string owned;
    std::string_view bytes;
    bool loaded = false;
  };
  struct Accessor {
    std::uint64_t component_type = 0;
    std::size_t components = 0;
    std::size_t component_size = 0;
    bool normalized = false;
    std::uint64_t count = 0;
    std::size_t stride = 0;
    const char* data = nullptr;  ///< null = zeros
    GltfValue value{nullptr, ""};
  };

  void info(const char* id, std::size_t count, const std::string& message) {
    scene_.findings.push_back({id, Severity::info, message, count, "", {}, "", ""});
  }

  void warn(const char* id, std::size_t count, const std::string& message) {
    scene_.findings.push_back({id, Severity::warning, message, count, "", {}, "", "Export the file again."});
  }

  static std::uint32_t word(std::string_view bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
  }

  std::string_view openGlb(std::string_view bytes) {
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
    std::string_view text;
    for (std::size_t at = 12, chunk = 0; at + 8 <= bytes.size(); ++chunk) {
      const std::uint32_t size = word(bytes, at);
      const std::uint32_t type = word(bytes, at + 4);
      at += 8;
      if (size > bytes.size() - at)
        throw ReadError("is a GLB whose chunk " + std::to_string(chunk) + " is cut off", "Copy or export it again.");
      if (chunk == 0 && type != 0x4E4F534A) throw ReadError("is a GLB whose first chunk is not JSON");
      if (chunk == 0) text = bytes.substr(at, size);
      if (chunk > 0 && type == 0x004E4942 && !has_binary_chunk_)
        binary_chunk_ = bytes.substr(at, size), has_binary_chunk_ = true;
      at += size;
      at += std::min((4 - at % 4) % 4, bytes.size() - at);
    }
    return text;
  }

  void checkVersionAndExtensions() {
    const GltfValue asset = top_.need("asset");
    const GltfValue stated = asset.get("version");
    // A number where the specification wants a text.
    const std::string version =
        stated && stated.raw().is_number() ? rounded(stated.number(), 2) + ".0" : asset.text("version", "");
    if (!version.starts_with("2."))
      throw ReadError("is glTF of version \"" + version.substr(0, 20) + "\"; only 2.x is supported (at /asset/version)",
                      "Export it as glTF 2.0.");
    const GltfValue required = top_.get("extensionsRequired");
    for (std::size_t i = 0; i < required.size(); ++i) {
      if (!required.at(i).raw().is_string()) required.at(i).fail("the JSON has no text where one belongs");
      const std::string name = required.at(i).raw().get<std::string>();
      if (!supportedExtensions().contains(name) && !name.starts_with("KHR_materials_"))
        unsupported(name, required.at(i).path());
    }
  }

  [[noreturn]] static void unsupported(const std::string& name, const std::string& path) {
    const bool compressed =
        name == "KHR_draco_mesh_compression" || name == "EXT_meshopt_compression" || name == "KHR_meshopt_compression";
    throw ReadError("needs the glTF extension " + name + ", which is not supported (at " + path + ")",
                    compressed ? "Export it without mesh compression." : "Export it without that extension.");
  }

  // --- Nodes -------------------------------------------------------------------------------------------------------

  void loadNodes() {
    nodes_ = top_.get("nodes");
    const std::size_t count = nodes_.size();
    std::vector<std::uint32_t> parent(count, kNoIndex);
    local_.resize(count);
    for (std::uint32_t n = 0; n < count; ++n) {
      const GltfValue node = nodes_.at(n);
      local_[n] = localTransform(node);
      const GltfValue children = node.get("children");
      for (std::size_t k = 0; k < children.size(); ++k) {
        const std::uint64_t child = children.at(k).integer();
        if (child >= count) children.at(k).fail("names node " + std::to_string(child) + " of " + std::to_string(count));
        if (parent[child] != kNoIndex)
          children.at(k).fail("node " + std::to_string(child) + " hangs on two nodes, or on one twice");
        parent[child] = n;
      }
    }
    // Every node has at most one parent by now, so a walk over parents that takes more steps than nodes is a cycle.
    global_.resize(count);
    std::vector<std::uint8_t> done(count, 0);
    for (std::uint32_t n = 0; n < count; ++n) {
      std::vector<std::uint32_t> chain;
      std::uint32_t at = n;
      while (at != kNoIndex && done[at] == 0) {
        if (chain.size() >= count) nodes_.at(n).fail("nodes form a cycle");
        chain.push_back(at);
        at = parent[at];
      }
      for (auto it = chain.rbegin(); it != chain.rend(); ++it) {
        global_[*it] = parent[*it] == kNoIndex ? local_[*it] : Eigen::Matrix4d(global_[parent[*it]] * local_[*it]);
        done[*it] = 1;
      }
    }
    // The scene's nodes, parents first.
    std::vector<std::uint32_t> stack;
    const GltfValue scenes = top_.get("scenes");
    if (const GltfValue chosen = top_.get("scene"); chosen || scenes.size() > 0) {
      const std::uint64_t index = chosen ? chosen.integer() : 0;
      if (index >= scenes.size())
        chosen.fail("names scene " + std::to_string(index) + " of " + std::to_string(scenes.size()));
      const GltfValue roots = scenes.at(index).get("nodes");
      for (std::size_t k = 0; k < roots.size(); ++k) {
        const std::uint64_t root = roots.at(k).integer();
        if (root >= count) roots.at(k).fail("names node " + std::to_string(root) + " of " + std::to_string(count));
        stack.push_back(std::uint32_t(root));
      }
    } else {
      for (std::uint32_t n = 0; n < count; ++n)
        if (parent[n] == kNoIndex) stack.push_back(n);
    }
    std::reverse(stack.begin(), stack.end());
    number_of_node_.assign(count, kNoIndex);
    while (!stack.empty()) {
      const std::uint32_t n = stack.back();
      stack.pop_back();
      if (number_of_node_[n] != kNoIndex) continue;  // named twice as a root, or a root below another
      number_of_node_[n] = std::uint32_t(scene_.nodes.size());
      order_.push_back(n);
      const GltfValue node = nodes_.at(n);
      RawNode raw;
      raw.name = nodeName(n);
      raw.parent = parent[n] == kNoIndex ? kNoIndex : number_of_node_[parent[n]];
      raw.properties_json = properties(node);
      scene_.nodes.push_back(std::move(raw));
      const GltfValue children = node.get("children");
      for (std::size_t k = children.size(); k-- > 0;) stack.push_back(std::uint32_t(children.at(k).integer()));
    }
  }

  std::string nodeName(std::uint32_t n) const {
    const std::string name = nodes_.at(n).text("name", "");
    return name.empty() ? "node " + std::to_string(n) : name;
  }

  Eigen::Matrix4d localTransform(const GltfValue& node) {
    if (node.get("matrix")) {
      const auto m = node.numbers<16>("matrix", {});
      Eigen::Matrix4d out;
      for (int k = 0; k < 16; ++k) out(k % 4, k / 4) = m[std::size_t(k)];
      if (std::abs(out(3, 0)) + std::abs(out(3, 1)) + std::abs(out(3, 2)) + std::abs(out(3, 3) - 1) > 1e-6)
        node.get("matrix").fail("a node's matrix is no affine one");
      out.row(3) << 0, 0, 0, 1;
      return out;
    }
    const auto t = node.numbers<3>("translation", {0, 0, 0});
    const auto r = node.numbers<4>("rotation", {0, 0, 0, 1});
    const auto s = node.numbers<3>("scale", {1, 1, 1});
    Eigen::Quaterniond q(r[3], r[0], r[1], r[2]);
    if (q.norm() < 1e-12) {
      ++zero_rotations_;
      q.setIdentity();
    }
    q.normalize();
    Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
    out.topLeftCorner<3, 3>() = q.toRotationMatrix() * Eigen::Vector3d(s[0], s[1], s[2]).asDiagonal();
    out.topRightCorner<3, 1>() << t[0], t[1], t[2];
    return out;
  }

  /// The entry of a list at the top that `user` names.
  GltfValue entry(const char* list, const GltfValue& user) const {
    const GltfValue values = top_.get(list);
    const std::uint64_t index = user.integer();
    if (index >= values.size())
      user.fail("names entry " + std::to_string(index) + " of the " + std::to_string(values.size()) + " " + list);
    return values.at(index);
  }

  /// The node's extras; what mesh, primitives and materials carry goes below "mesh", "primitives" and "materials".
  std::string properties(const GltfValue& node) const {
    json out = json::object();
    const GltfValue extras = node.get("extras");
    if (extras) {
      if (extras.raw().is_object()) {
        out = extras.raw();
      } else {
        out["extras"] = extras.raw();
      }
    }
    if (const GltfValue index = node.get("mesh")) {
      const GltfValue mesh = entry("meshes", index);
      if (const GltfValue own = mesh.get("extras")) out["mesh"] = own.raw();
      const GltfValue primitives = mesh.get("primitives");
      json list = json::array();
      json materials = json::object();
      bool any = false;
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        const GltfValue own = primitives.at(p).get("extras");
        any = any || own;
        list.push_back(own ? own.raw() : json::object());
        if (const GltfValue material = primitives.at(p).get("material")) {
          const GltfValue source = entry("materials", material);
          if (const GltfValue its = source.get("extras"))
            materials[source.text("name", "material " + std::to_string(material.integer()))] = its.raw();
        }
      }
      if (any) out["primitives"] = list;
      if (!materials.empty()) out["materials"] = materials;
    }
    return out.dump(-1, ' ', false, json::error_handler_t::replace);
  }

  /// What the readers below would only meet by chance: every accessor, view and buffer is checked, used or not.
  void checkReferences() {
    const GltfValue views = top_.get("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i) {
      views.at(i).need("buffer").integer();
      views.at(i).need("byteLength").integer();
      views.at(i).integer("byteOffset", 0);
      views.at(i).integer("byteStride", 0);
    }
    const GltfValue accessors = top_.get("accessors");
    for (std::size_t i = 0; i < accessors.size(); ++i) {
      const GltfValue accessor = accessors.at(i);
      accessor.need("count").integer();
      accessor.need("componentType").integer();
      accessor.integer("byteOffset", 0);
      if (accessor.need("type"); accessor.text("type", "").empty())
        accessor.get("type").fail("an accessor has no type");
      for (const char* key : {"min", "max"}) {
        const GltfValue bounds = accessor.get(key);
        for (std::size_t k = 0; k < bounds.size(); ++k)
          if (!bounds.at(k).raw().is_number()) bounds.at(k).fail("the JSON has no number where one belongs");
      }
    }
    const GltfValue materials = top_.get("materials");
    for (std::size_t i = 0; i < materials.size(); ++i) {
      const GltfValue material = materials.at(i);
      const GltfValue pbr = material.get("pbrMetallicRoughness");
      material.number("alphaCutoff", 0.5);
      material.numbers<3>("emissiveFactor", {0, 0, 0});
      for (const char* factor : {"metallicFactor", "roughnessFactor"}) pbr.number(factor, 1);
      for (const GltfValue& info :
           {material.get("normalTexture"), material.get("occlusionTexture"), material.get("emissiveTexture"),
            pbr.get("baseColorTexture"), pbr.get("metallicRoughnessTexture")}) {
        if (!info) continue;
        info.need("index").integer();
        info.integer("texCoord", 0);
        info.number("scale", 1);
        info.number("strength", 1);
      }
    }
    for (const char* list : {"meshes", "materials", "textures", "images", "skins", "animations", "buffers"}) {
      const GltfValue values = top_.get(list);
      for (std::size_t i = 0; i < values.size(); ++i)
        if (!values.at(i).raw().is_object()) values.at(i).fail("the JSON has no object where one belongs");
    }
  }

  // --- Buffers and accessors ---------------------------------------------------------------------------------------

  std::string_view buffer(std::uint64_t index, const GltfValue& user) {
    const GltfValue list = top_.get("buffers");
    if (index >= list.size()) user.fail("names buffer " + std::to_string(index) + " of " + std::to_string(list.size()));
    if (buffers_.size() != list.size()) buffers_.resize(list.size());
    Buffer& out = buffers_[index];
    if (out.loaded) return out.bytes;
    const GltfValue value = list.at(index);
    const std::uint64_t length = value.need("byteLength").integer();
    const std::string uri = value.text("uri", "");
    if (uri.empty()) {
      if (index != 0 || !has_binary_chunk_) {
        if (value.get("extensions") && value.get("extensions").get("EXT_meshopt_compression"))
          unsupported("EXT_meshopt_compression", value.path());
        value.fail("a buffer has neither a file nor the GLB's binary chunk");
      }
      out.bytes = binary_chunk_;
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
      value.fail("a buffer promises " + std::to_string(length) + " bytes and holds " +
                 std::to_string(out.bytes.size()));
    out.bytes = out.bytes.substr(0, length);
    out.loaded = true;
    return out.bytes;
  }

  std::string_view bufferView(std::uint64_t index, const GltfValue& user, std::uint64_t* stride) {
    const GltfValue list = top_.get("bufferViews");
    if (index >= list.size())
      user.fail("names bufferView " + std::to_string(index) + " of " + std::to_string(list.size()));
    const GltfValue view = list.at(index);
    if (const GltfValue extensions = view.get("extensions"))
      for (const char* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
        if (extensions.get(name) && !extensions.get(name).get("fallback")) {
          const GltfValue backing = top_.get("buffers").at(view.need("buffer").integer());
          if (backing.text("uri", "").empty() && !(view.need("buffer").integer() == 0 && has_binary_chunk_))
            unsupported(name, view.path());
        }
    const std::string_view bytes = buffer(view.need("buffer").integer(), view.get("buffer"));
    const std::uint64_t offset = view.integer("byteOffset", 0);
    const std::uint64_t length = view.need("byteLength").integer();
    if (offset > bytes.size() || length > bytes.size() - offset)
      view.fail("a bufferView reaches beyond its buffer of " + std::to_string(bytes.size()) + " bytes");
    if (stride) *stride = view.integer("byteStride", 0);
    return bytes.substr(offset, length);
  }

  static std::size_t componentSize(std::uint64_t type, const GltfValue& user) {
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

  Accessor accessor(const GltfValue& user) {
    const std::uint64_t index = user.integer();
    const GltfValue list = top_.get("accessors");
    if (index >= list.size())
      user.fail("names accessor " + std::to_string(index) + " of " + std::to_string(list.size()));
    const GltfValue value = list.at(index);
    Accessor out;
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
      const std::string_view bytes = bufferView(view.integer(), view, &stride);
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

  static double component(const char* at, std::uint64_t type, bool normalized) {
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

  /// All components of all elements, sparse entries put in.
  std::vector<float> numbers(const Accessor& a) {
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

  const char* sparseBytes(const GltfValue& part, std::uint64_t count, std::size_t element) {
    const std::string_view bytes = bufferView(part.need("bufferView").integer(), part.get("bufferView"), nullptr);
    const std::uint64_t offset = part.integer("byteOffset", 0);
    if (offset > bytes.size() || count > (bytes.size() - offset) / element)
      part.fail("a sparse accessor reaches beyond its bufferView");
    return bytes.data() + offset;
  }

  /// A vertex attribute of `count` elements with one of the given numbers of components.
  std::vector<float> attribute(const GltfValue& user, std::uint64_t count,
                               std::initializer_list<std::size_t> components, std::size_t* found = nullptr) {
    const Accessor a = accessor(user);
    if (std::find(components.begin(), components.end(), a.components) == components.end())
      user.fail("names an accessor of the wrong type");
    if (a.count != count)
      user.fail("names an accessor of " + std::to_string(a.count) + " elements, but there are " +
                std::to_string(count) + " positions");
    if (found) *found = a.components;
    return numbers(a);
  }

  // --- Materials ---------------------------------------------------------------------------------------------------

  struct TextureUse {
    bool any = false;
    std::uint64_t uv_set = 0;
    bool transformed = false;
    std::array<double, 2> offset = {0, 0};
    std::array<double, 2> scale = {1, 1};
    double rotation = 0;
  };

  std::uint32_t material(const GltfValue& user) {
    const std::uint64_t index = user.integer();
    if (index >= materials_.size())
      user.fail("names material " + std::to_string(index) + " of " + std::to_string(materials_.size()));
    std::uint32_t& number = material_number_[index];
    if (number != kNoIndex) return number;
    const GltfValue value = materials_.at(index);
    RawMaterial out;
    out.name = value.text("name", "material " + std::to_string(index));
    out.double_sided = value.boolean("doubleSided", false);
    out.base_color = {1, 1, 1, 1};
    TextureUse use;
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
    number = std::uint32_t(scene_.materials.size());
    scene_.materials.push_back(std::move(out));
    texture_uses_.push_back(use);
    return number;
  }

  TextureUse textureUse(const GltfValue& reference) const {
    TextureUse use;
    use.any = true;
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

  std::uint32_t textureOf(const GltfValue& reference) {
    const GltfValue list = top_.get("textures");
    const std::uint64_t index = reference.need("index").integer();
    if (index >= list.size())
      reference.get("index").fail("names texture " + std::to_string(index) + " of " + std::to_string(list.size()));
    const GltfValue texture = list.at(index);
    GltfValue source = texture.get("source");
    if (const GltfValue extensions = texture.get("extensions"); !source && extensions)
      for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"})
        if (const GltfValue own = extensions.get(name); own && !source) source = own.get("source");
    if (!source) return kNoIndex;
    const std::uint64_t image_index = source.integer();
    const GltfValue images = top_.get("images");
    if (image_index >= images.size())
      source.fail("names image " + std::to_string(image_index) + " of " + std::to_string(images.size()));
    const auto [at, fresh] = texture_of_image_.try_emplace(image_index, std::uint32_t(scene_.textures.size()));
    if (!fresh) return at->second;
    const GltfValue image = images.at(image_index);
    RawTexture out;
    out.name = image.text("name", "");
    const std::string uri = image.text("uri", "");
    std::string_view bytes;
    std::optional<std::string> decoded;
    if (const GltfValue view = image.get("bufferView")) {
      bytes = bufferView(view.integer(), view, nullptr);
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

  // --- Meshes ------------------------------------------------------------------------------------------------------

  std::vector<std::uint32_t> triangleIndices(const GltfValue& primitive, std::uint64_t vertex_count) {
    std::vector<std::uint32_t> indices;
    if (const GltfValue user = primitive.get("indices")) {
      const Accessor a = accessor(user);
      if (a.components != 1 || (a.component_type != 5121 && a.component_type != 5123 && a.component_type != 5125))
        user.fail("names an accessor that holds no indices");
      indices.resize(a.count);
      for (std::uint64_t i = 0; i < a.count; ++i) {
        const double index = a.data ? component(a.data + i * a.stride, a.component_type, false) : 0;
        if (index >= double(vertex_count))
          user.fail("index " + std::to_string(i) + " names vertex " + std::to_string(std::uint64_t(index)) + " of " +
                    std::to_string(vertex_count));
        indices[i] = std::uint32_t(index);
      }
    } else {
      indices.resize(vertex_count);
      for (std::uint32_t i = 0; i < indices.size(); ++i) indices[i] = i;
    }
    const std::uint64_t mode = primitive.integer("mode", 4);
    if (mode == 4) {
      loose_indices_ += indices.size() % 3;
      indices.resize(indices.size() / 3 * 3);
      return indices;
    }
    std::vector<std::uint32_t> out;
    for (std::size_t i = 2; i < indices.size(); ++i) {
      if (mode == 6) {
        out.insert(out.end(), {indices[0], indices[i - 1], indices[i]});
      } else if (i % 2 == 0) {
        out.insert(out.end(), {indices[i - 2], indices[i - 1], indices[i]});
      } else {
        out.insert(out.end(), {indices[i - 1], indices[i - 2], indices[i]});
      }
    }
    return out;
  }

  struct Skin {
    std::vector<std::uint32_t> joint_number;  ///< into RawScene::joints
    std::vector<Eigen::Matrix4d> rest;        ///< mesh to world: joint's global transform times inverse bind matrix
  };

  Skin skin(const GltfValue& user) {
    const GltfValue list = top_.get("skins");
    const std::uint64_t index = user.integer();
    if (index >= list.size()) user.fail("names skin " + std::to_string(index) + " of " + std::to_string(list.size()));
    const GltfValue value = list.at(index);
    const GltfValue joints = value.need("joints");
    if (joints.size() == 0) joints.fail("a skin has no joints");
    Skin out;
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const std::uint64_t node = joints.at(k).integer();
      if (node >= nodes_.size())
        joints.at(k).fail("names node " + std::to_string(node) + " of " + std::to_string(nodes_.size()));
      const auto [at, fresh] = joint_of_node_.try_emplace(node, std::uint32_t(scene_.joints.size()));
      if (fresh) scene_.joints.push_back(nodeName(std::uint32_t(node)));
      out.joint_number.push_back(at->second);
      out.rest.push_back(global_[node]);
    }
    // Without inverse bind matrices they are identities (specification, 3.7.3.1).
    if (const GltfValue bind = value.get("inverseBindMatrices")) {
      const Accessor a = accessor(bind);
      if (a.components != 16 || a.component_type != 5126) bind.fail("names an accessor that holds no matrices");
      if (a.count < joints.size()) bind.fail("has fewer inverse bind matrices than joints");
      const std::vector<float> m = numbers(a);
      for (std::size_t k = 0; k < out.rest.size(); ++k) {
        Eigen::Matrix4d inverse_bind;
        for (std::size_t e = 0; e < 16; ++e)
          inverse_bind(Eigen::Index(e % 4), Eigen::Index(e / 4)) = double(m[16 * k + e]);
        if (!inverse_bind.allFinite()) bind.fail("inverse bind matrix " + std::to_string(k) + " is not finite");
        inverse_bind.row(3) << 0, 0, 0, 1;
        out.rest[k] = out.rest[k] * inverse_bind;
      }
    }
    return out;
  }

  struct Pool {
    std::uint32_t first_point = 0;
    std::uint64_t count = 0;
    std::vector<std::uint32_t> skin_begin;  ///< per point into skin, empty without one
    std::vector<SkinInfluence> skin;        ///< joints of the skin, not yet of the scene
  };

  static Eigen::Vector3d at3(const std::vector<float>& values, std::uint64_t i) {
    return {double(values[3 * i]), double(values[3 * i + 1]), double(values[3 * i + 2])};
  }

  /// The points of one POSITION accessor (with its joints), shared by all primitives of the mesh that name it.
  Pool makePool(const GltfValue& attributes, const std::optional<Skin>& skin, RawMesh& mesh) {
    Pool pool;
    const GltfValue user = attributes.need("POSITION");
    const Accessor a = accessor(user);
    if (a.components != 3) user.fail("names an accessor of the wrong type");
    const std::vector<float> positions = numbers(a);
    pool.first_point = std::uint32_t(mesh.points.size());
    pool.count = a.count;
    for (std::uint64_t i = 0; i < a.count; ++i) {
      const Eigen::Vector3d p = at3(positions, i);
      if (!p.allFinite())
        user.fail("vertex " + std::to_string(i) + " of mesh \"" + mesh.name +
                  "\" has a coordinate that is not a finite number");
      mesh.points.push_back(p);
    }
    if (!skin) return pool;
    std::vector<std::vector<float>> joints;
    std::vector<std::vector<float>> weights;
    for (int set = 0; set < 16; ++set) {
      const GltfValue j = attributes.get(("JOINTS_" + std::to_string(set)).c_str());
      const GltfValue w = attributes.get(("WEIGHTS_" + std::to_string(set)).c_str());
      if (!j && !w) break;
      if (!j || !w) (j ? w : j).fail("joints and weights do not come in pairs");
      joints.push_back(attribute(j, a.count, {4}));
      weights.push_back(attribute(w, a.count, {4}));
    }
    pool.skin_begin.push_back(0);
    for (std::uint64_t i = 0; i < a.count; ++i) {
      for (std::size_t set = 0; set < joints.size(); ++set)
        for (std::size_t k = 4 * i; k < 4 * i + 4; ++k) {
          const float weight = weights[set][k];
          if (!std::isfinite(weight))
            user.fail("a skin weight of vertex " + std::to_string(i) + " is not a finite number");
          if (weight <= 0) continue;
          const float joint = joints[set][k];
          if (!(joint >= 0 && joint < float(skin->rest.size())))
            user.fail("vertex " + std::to_string(i) + " is weighted to joint " + std::to_string(std::int64_t(joint)) +
                      " of " + std::to_string(skin->rest.size()));
          pool.skin.push_back({std::uint32_t(joint), weight});
        }
      pool.skin_begin.push_back(std::uint32_t(pool.skin.size()));
    }
    return pool;
  }

  /// Where a skinned mesh stands at rest. The specification ignores its node: joints place it. Where all joints agree
  /// (the usual case: the rest pose is the bind pose) that one transform is used, free of the blend's rounding.
  static std::optional<Eigen::Matrix4d> commonTransform(const Skin& skin, const Eigen::Matrix4d& node,
                                                        const RawMesh& mesh) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : mesh.points) box.extend(p);
    if (box.isEmpty()) return node;
    for (const Eigen::Matrix4d& candidate : {node, skin.rest[0]}) {
      Eigen::AlignedBox3d placed;
      double worst = 0;
      for (int c = 0; c < 8; ++c) {
        const Eigen::Vector4d corner = box.corner(Eigen::AlignedBox3d::CornerType(c)).homogeneous();
        const Eigen::Vector4d expected = candidate * corner;
        placed.extend(Eigen::Vector3d(expected.head<3>()));
        for (const Eigen::Matrix4d& joint : skin.rest) worst = std::max(worst, (joint * corner - expected).norm());
      }
      if (worst <= 1e-4 * placed.diagonal().norm()) return candidate;
    }
    return std::nullopt;
  }

  void instance(std::uint32_t node_index) {
    const GltfValue node = nodes_.at(node_index);
    const GltfValue mesh_user = node.get("mesh");
    if (!mesh_user) return;
    const GltfValue meshes = top_.get("meshes");
    if (mesh_user.integer() >= meshes.size())
      mesh_user.fail("names mesh " + std::to_string(mesh_user.integer()) + " of " + std::to_string(meshes.size()));
    const GltfValue source = meshes.at(mesh_user.integer());
    RawMesh mesh;
    mesh.name = source.text("name", "mesh " + std::to_string(mesh_user.integer()));
    mesh.node = number_of_node_[node_index];
    std::optional<Skin> its_skin;
    if (const GltfValue user = node.get("skin")) its_skin = skin(user);

    const GltfValue primitives = source.need("primitives");
    std::map<std::vector<std::uint64_t>, Pool> pools;
    std::vector<std::pair<const Pool*, std::uint32_t>> vertex_origin;  // pool and element of each vertex
    std::map<std::string, std::size_t> attribute_number;
    std::map<std::size_t, RawMorph> morphs;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const GltfValue primitive = primitives.at(p);
      const GltfValue attributes = primitive.need("attributes");
      const std::uint64_t mode = primitive.integer("mode", 4);
      if (mode > 6) primitive.get("mode").fail("a primitive has the unknown mode " + std::to_string(mode));
      if (mode < 4) {
        ++dropped_primitives_;
        continue;
      }
      checkDraco(primitive, attributes);
      if (!attributes.get("POSITION")) continue;  // nothing to draw (specification, 3.7.2.1)
      std::vector<std::uint64_t> key = {attributes.get("POSITION").integer()};
      if (its_skin)
        for (const char* name : {"JOINTS_0", "WEIGHTS_0", "JOINTS_1", "WEIGHTS_1"})
          key.push_back(attributes.get(name) ? attributes.get(name).integer() + 1 : 0);
      auto pool_at = pools.find(key);
      if (pool_at == pools.end()) pool_at = pools.emplace(key, makePool(attributes, its_skin, mesh)).first;
      const Pool& pool = pool_at->second;

      const std::vector<std::uint32_t> indices = triangleIndices(primitive, pool.count);
      std::vector<std::uint32_t> vertex_of(pool.count, kNoIndex);
      std::vector<std::uint32_t> used;
      for (std::uint32_t i : indices) vertex_of[i] = 0;
      const std::uint32_t first_vertex = std::uint32_t(mesh.vertex_point.size());
      for (std::uint32_t i = 0; i < vertex_of.size(); ++i) {
        if (vertex_of[i] == kNoIndex) continue;
        vertex_of[i] = first_vertex + std::uint32_t(used.size());
        used.push_back(i);
        mesh.vertex_point.push_back(pool.first_point + i);
        vertex_origin.emplace_back(&pool, i);
      }
      const std::size_t total = mesh.vertex_point.size();
      for (std::uint32_t i : indices) mesh.corners.push_back(vertex_of[i]);
      mesh.face_size.insert(mesh.face_size.end(), indices.size() / 3, 3U);
      mesh.face_part.insert(mesh.face_part.end(), indices.size() / 3, std::uint32_t(mesh.parts.size()));
      const GltfValue material_user = primitive.get("material");
      const std::uint32_t its_material = material_user ? material(material_user) : kNoIndex;
      mesh.parts.push_back({mesh.name, its_material});

      vertexAttributes(attributes, pool, used, first_vertex, its_material, attribute_number, mesh);
      morphTargets(primitive, source, pool, used, first_vertex, morphs);
      if (!mesh.normals.empty()) mesh.normals.resize(total, Eigen::Vector3f::Zero());
      if (!mesh.uvs.empty()) mesh.uvs.resize(total, Eigen::Vector2f::Zero());
      if (!mesh.colors.empty()) mesh.colors.resize(total, {0, 0, 0, 0});
      for (AttributeSource& attribute : mesh.attributes) attribute.values.resize(total * attribute.components, 0.0F);
    }
    if (mesh.face_size.empty() && mesh.points.empty()) return;
    notePosedMorphs(node, source, morphs, mesh.name);
    for (auto& [index, morph] : morphs) mesh.morphs.push_back(std::move(morph));
    place(node_index, its_skin, vertex_origin, mesh);
    scene_.meshes.push_back(std::move(mesh));
  }

  // Weights of a node replace the weights of its mesh. Clusters of morphs refer to the base shape.
  void notePosedMorphs(const GltfValue& node, const GltfValue& source, const std::map<std::size_t, RawMorph>& morphs,
                       const std::string& name) {
    const GltfValue weights = node.get("weights") ? node.get("weights") : source.get("weights");
    std::string posed;
    for (const auto& [index, morph] : morphs) {
      if (index >= weights.size() || morph.vertices.empty()) continue;
      const double weight = weights.at(index).number();
      if (weight == 0) continue;
      char text[32];
      std::snprintf(text, sizeof text, "%.3g", weight);
      posed += (posed.empty() ? "" : ", ") + morph.name + " " + text;
    }
    if (!posed.empty()) posed_morphs_.push_back("in " + name + ": " + posed);
  }

  void checkDraco(const GltfValue& primitive, const GltfValue& attributes) const {
    const GltfValue extensions = primitive.get("extensions");
    if (!extensions || !extensions.get("KHR_draco_mesh_compression")) return;
    // Uncompressed data may lie beside the compressed; without it the accessors have no view.
    const GltfValue position = attributes.get("POSITION");
    if (!position || !top_.get("accessors").at(position.integer()).get("bufferView"))
      unsupported("KHR_draco_mesh_compression", primitive.path());
  }

  void vertexAttributes(const GltfValue& attributes, const Pool& pool, const std::vector<std::uint32_t>& used,
                        std::uint32_t first, std::uint32_t its_material,
                        std::map<std::string, std::size_t>& attribute_number, RawMesh& mesh) {
    const std::size_t total = mesh.vertex_point.size();
    if (const GltfValue user = attributes.get("NORMAL")) {
      const std::vector<float> values = attribute(user, pool.count, {3});
      mesh.normals.resize(total, Eigen::Vector3f::Zero());
      for (std::size_t k = 0; k < used.size(); ++k) mesh.normals[first + k] = at3(values, used[k]).cast<float>();
    }
    const TextureUse use = its_material == kNoIndex ? TextureUse{} : texture_uses_[its_material];
    if (const GltfValue user = attributes.get(("TEXCOORD_" + std::to_string(use.uv_set)).c_str())) {
      const std::vector<float> values = attribute(user, pool.count, {2});
      mesh.uvs.resize(total, Eigen::Vector2f::Zero());
      const double c = std::cos(use.rotation);
      const double s = std::sin(use.rotation);
      for (std::size_t k = 0; k < used.size(); ++k) {
        float u = values[2 * used[k]];
        float v = values[2 * used[k] + 1];
        if (use.transformed) {
          const double su = double(u) * use.scale[0];
          const double sv = double(v) * use.scale[1];
          u = float(c * su + s * sv + use.offset[0]);
          v = float(-s * su + c * sv + use.offset[1]);
        }
        mesh.uvs[first + k] = {u, 1.0F - v};
      }
    }
    if (const GltfValue user = attributes.get("COLOR_0")) {
      std::size_t components = 0;
      const std::vector<float> values = attribute(user, pool.count, {3, 4}, &components);
      mesh.colors.resize(total, {0, 0, 0, 0});
      for (std::size_t k = 0; k < used.size(); ++k) {
        const float* c = values.data() + components * used[k];
        mesh.colors[first + k] = {c[0], c[1], c[2], components == 4 ? c[3] : 1.0F};
      }
    }
    for (const auto& [name, unused] : attributes.raw().items()) {
      const bool further = (name.starts_with("COLOR_") && name != "COLOR_0") ||
                           (name.starts_with("TEXCOORD_") && name != "TEXCOORD_" + std::to_string(use.uv_set));
      if (!name.starts_with("_") && !further) continue;
      std::size_t components = 0;
      const std::vector<float> values =
          attribute(attributes.get(name.c_str()), pool.count, {1, 2, 3, 4, 9, 16}, &components);
      const auto [at, fresh] = attribute_number.try_emplace(name, mesh.attributes.size());
      if (fresh) mesh.attributes.push_back({name, std::uint32_t(components), {}});
      AttributeSource& out = mesh.attributes[at->second];
      out.values.resize(total * out.components, 0.0F);
      const std::size_t shared = std::min<std::size_t>(components, out.components);
      for (std::size_t k = 0; k < used.size(); ++k)
        std::copy_n(values.begin() + std::ptrdiff_t(components * used[k]), shared,
                    out.values.begin() + std::ptrdiff_t(out.components * (first + k)));
    }
  }

  void morphTargets(const GltfValue& primitive, const GltfValue& source, const Pool& pool,
                    const std::vector<std::uint32_t>& used, std::uint32_t first,
                    std::map<std::size_t, RawMorph>& morphs) {
    const GltfValue targets = primitive.get("targets");
    const GltfValue extras = source.get("extras");
    for (std::size_t t = 0; t < targets.size(); ++t) {
      RawMorph& morph = morphs[t];
      if (morph.name.empty()) {
        morph.name = "morph " + std::to_string(t);
        if (extras && extras.raw().is_object() && extras.raw().contains("targetNames")) {
          const json& names = extras.raw()["targetNames"];
          if (names.is_array() && t < names.size() && names[t].is_string()) morph.name = names[t].get<std::string>();
        }
      }
      const GltfValue user = targets.at(t).get("POSITION");
      if (!user) continue;
      const std::vector<float> deltas = attribute(user, pool.count, {3});
      for (std::uint32_t k = 0; k < used.size(); ++k) {
        const Eigen::Vector3f d = at3(deltas, used[k]).cast<float>();
        if (d == Eigen::Vector3f::Zero()) continue;
        morph.vertices.push_back(first + k);
        morph.displacements.push_back(d);
      }
    }
  }

  void place(std::uint32_t node_index, const std::optional<Skin>& its_skin,
             const std::vector<std::pair<const Pool*, std::uint32_t>>& vertex_origin, RawMesh& mesh) {
    mesh.transform = global_[node_index];
    if (!its_skin) return;
    mesh.skin_count.resize(vertex_origin.size());
    for (std::size_t v = 0; v < vertex_origin.size(); ++v) {
      const auto& [pool, element] = vertex_origin[v];
      for (std::uint32_t k = pool->skin_begin[element]; k < pool->skin_begin[element + 1]; ++k)
        mesh.skin.push_back({its_skin->joint_number[pool->skin[k].joint], pool->skin[k].weight});
      mesh.skin_count[v] = pool->skin_begin[element + 1] - pool->skin_begin[element];
    }
    if (const auto common = commonTransform(*its_skin, global_[node_index], mesh)) {
      mesh.transform = *common;
      return;
    }
    info("posed-skin", 1,
         "mesh " + mesh.name + " stands in a pose other than the one it was bound in; that pose is used");
    mesh.transform.setIdentity();
    std::vector<Eigen::Matrix4d> of_vertex(vertex_origin.size());
    std::vector<Eigen::Vector3d> placed = mesh.points;
    for (std::size_t v = 0; v < vertex_origin.size(); ++v) {
      const auto& [pool, element] = vertex_origin[v];
      Eigen::Matrix4d blend = Eigen::Matrix4d::Zero();
      double sum = 0;
      for (std::uint32_t k = pool->skin_begin[element]; k < pool->skin_begin[element + 1]; ++k) {
        blend += double(pool->skin[k].weight) * its_skin->rest[pool->skin[k].joint];
        sum += double(pool->skin[k].weight);
      }
      of_vertex[v] = sum > 0 ? Eigen::Matrix4d(blend / sum) : its_skin->rest[0];
      const std::uint32_t point = mesh.vertex_point[v];
      placed[point] = (of_vertex[v] * mesh.points[point].homogeneous()).head<3>();
      if (!mesh.normals.empty()) {
        const Eigen::Matrix3d linear = of_vertex[v].topLeftCorner<3, 3>();
        const double determinant = linear.determinant();
        if (std::abs(determinant) > 1e-30)
          mesh.normals[v] = (linear.inverse().transpose() * mesh.normals[v].cast<double>()).normalized().cast<float>();
      }
    }
    mesh.points = std::move(placed);
    for (RawMorph& morph : mesh.morphs)
      for (std::size_t k = 0; k < morph.vertices.size(); ++k)
        morph.displacements[k] =
            (of_vertex[morph.vertices[k]].topLeftCorner<3, 3>() * morph.displacements[k].cast<double>()).cast<float>();
  }

  std::filesystem::path folder_;
  std::string stem_;
  json json_;
  GltfValue top_;
  GltfValue nodes_{nullptr, "/nodes"};
  GltfValue materials_{nullptr, "/materials"};
  RawScene scene_;
  std::string_view binary_chunk_;
  bool has_binary_chunk_ = false;
  std::vector<Buffer> buffers_;
  std::vector<Eigen::Matrix4d> local_;
  std::vector<Eigen::Matrix4d> global_;
  std::vector<std::uint32_t> number_of_node_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint32_t> material_number_;
  std::vector<TextureUse> texture_uses_;
  std::map<std::uint64_t, std::uint32_t> texture_of_image_;
  std::map<std::uint64_t, std::uint32_t> joint_of_node_;
  std::size_t dropped_primitives_ = 0;
  std::size_t zero_rotations_ = 0;
  std::size_t loose_indices_ = 0;
  std::vector<std::string> posed_morphs_;  // where, and by how much
};

}  // namespace

RawScene readGltf(std::string_view bytes, const std::filesystem::path& folder, const std::string& stem) {
  return GltfReader(bytes, folder, stem).read();
}

}  // namespace sinew::tools
