// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "tools/core/text.h"
#include "tools/import/gltf_buffers.h"
#include "tools/import/gltf_materials.h"
#include "tools/import/gltf_nodes.h"
#include "tools/import/gltf_text.h"
#include "tools/import/readers.h"

namespace sinew::tools {
namespace {

using nlohmann::json;

const std::set<std::string, std::less<>>& supportedExtensions() {
  static const std::set<std::string, std::less<>> kNames = {
      "KHR_mesh_quantization", "KHR_texture_transform",  "KHR_lights_punctual",
      "EXT_texture_webp",      "KHR_texture_basisu",     "KHR_materials_pbrSpecularGlossiness",
      "EXT_texture_avif",      "MSFT_texture_dds",       "KHR_xmp_json_ld",
      "KHR_animation_pointer", "KHR_materials_variants", "KHR_node_visibility"};
  return kNames;
}

json parseGltf(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (tooDeep(text)) throw ReadError("holds JSON nested deeper than " + std::to_string(kMaxDepth) + " levels");
  json parsed;
  try {
    parsed = json::parse(text);
  } catch (const json::parse_error& error) {
    const std::string_view before = text.substr(0, error.byte);
    const std::size_t line = std::size_t(std::count(before.begin(), before.end(), '\n')) + 1;
    throw ReadError("is no glTF: its JSON is malformed (line " + std::to_string(line) + ", byte " +
                    std::to_string(error.byte) + " of the JSON)");
  } catch (const json::out_of_range&) {
    throw ReadError("is no glTF: its JSON has a number that is larger than any double");
  }
  if (!parsed.is_object()) throw ReadError("is no glTF: its JSON is no object");
  return parsed;
}

class GltfReader {
 public:
  GltfReader(const json& parsed, const GltfChunks& chunks, const std::filesystem::path& folder)
      : top_(&parsed, ""), buffers_(top_, chunks.binary, folder), materials_(top_, buffers_, scene_) {}

  RawScene read() {
    checkVersionAndExtensions();
    nodes_ = gltfNodes(top_, scene_);
    checkReferences();
    scene_.metres_per_unit = 1;
    scene_.unit_source = "glTF is in metres by its specification";
    for (std::uint32_t node : nodes_.order) instance(node);
    std::size_t left_out = 0;
    for (std::size_t n = 0; n < nodes_.number.size(); ++n)
      if (nodes_.number[n] == formats::kNone && nodes_.values.at(n).get("mesh")) ++left_out;
    if (left_out > 0)
      info("dropped-nodes", left_out,
           std::to_string(left_out) + " nodes with a mesh are not in the file's scene and were left out");
    if (dropped_primitives_ > 0)
      info("dropped-primitives", dropped_primitives_,
           std::to_string(dropped_primitives_) + " point or line primitives were left out; only faces are used");
    if (nodes_.zero_rotations > 0)
      warn("zero-rotations", nodes_.zero_rotations,
           counted(nodes_.zero_rotations, "node has", "nodes have") + " a rotation of four zeros; taken as none");
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
  void info(const char* id, std::size_t count, const std::string& message) {
    scene_.findings.push_back({id, Severity::info, message, count, "", {}, "", ""});
  }

  void warn(const char* id, std::size_t count, const std::string& message) {
    scene_.findings.push_back({id, Severity::warning, message, count, "", {}, "", "Export the file again."});
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
        unsupportedExtension(name, required.at(i).path());
    }
  }

  /// Checks every accessor, view and buffer, used or not: the readers below would meet faults only by chance.
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

  std::vector<std::uint32_t> triangleIndices(const GltfValue& primitive, std::uint64_t vertex_count) {
    std::vector<std::uint32_t> indices;
    if (const GltfValue user = primitive.get("indices")) {
      indices = buffers_.indices(user, vertex_count);
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
    const GltfValue value = list.at(user.index("skin", list.size()));
    const GltfValue joints = value.need("joints");
    if (joints.size() == 0) joints.fail("a skin has no joints");
    Skin out;
    for (std::size_t k = 0; k < joints.size(); ++k) {
      const std::uint64_t node = joints.at(k).index("node", nodes_.values.size());
      const auto [at, fresh] = joint_of_node_.try_emplace(node, std::uint32_t(scene_.joints.size()));
      if (fresh) scene_.joints.push_back(nodes_.name(std::uint32_t(node)));
      out.joint_number.push_back(at->second);
      out.rest.push_back(nodes_.global[node]);
    }
    // Without inverse bind matrices they are identities (specification, 3.7.3.1).
    if (const GltfValue bind = value.get("inverseBindMatrices")) {
      const GltfAccessor a = buffers_.accessor(bind);
      if (a.components != 16 || a.component_type != 5126) bind.fail("names an accessor that holds no matrices");
      if (a.count < joints.size()) bind.fail("has fewer inverse bind matrices than joints");
      const std::vector<float> m = buffers_.numbers(a);
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
    const GltfAccessor a = buffers_.accessor(user);
    if (a.components != 3) user.fail("names an accessor of the wrong type");
    const std::vector<float> positions = buffers_.numbers(a);
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
      joints.push_back(buffers_.attribute(j, a.count, {4}));
      weights.push_back(buffers_.attribute(w, a.count, {4}));
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
    const GltfValue node = nodes_.values.at(node_index);
    const GltfValue mesh_user = node.get("mesh");
    if (!mesh_user) return;
    const GltfValue meshes = top_.get("meshes");
    const GltfValue source = meshes.at(mesh_user.index("mesh", meshes.size()));
    RawMesh mesh;
    mesh.name = source.text("name", "mesh " + std::to_string(mesh_user.integer()));
    mesh.node = nodes_.number[node_index];
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
      std::vector<std::uint32_t> vertex_of(pool.count, formats::kNone);
      std::vector<std::uint32_t> used;
      for (std::uint32_t i : indices) vertex_of[i] = 0;
      const std::uint32_t first_vertex = std::uint32_t(mesh.vertex_point.size());
      for (std::uint32_t i = 0; i < vertex_of.size(); ++i) {
        if (vertex_of[i] == formats::kNone) continue;
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
      const std::uint32_t its_material = material_user ? materials_.number(material_user) : formats::kNone;
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
      unsupportedExtension("KHR_draco_mesh_compression", primitive.path());
  }

  void vertexAttributes(const GltfValue& attributes, const Pool& pool, const std::vector<std::uint32_t>& used,
                        std::uint32_t first, std::uint32_t its_material,
                        std::map<std::string, std::size_t>& attribute_number, RawMesh& mesh) {
    const std::size_t total = mesh.vertex_point.size();
    if (const GltfValue user = attributes.get("NORMAL")) {
      const std::vector<float> values = buffers_.attribute(user, pool.count, {3});
      mesh.normals.resize(total, Eigen::Vector3f::Zero());
      for (std::size_t k = 0; k < used.size(); ++k) mesh.normals[first + k] = at3(values, used[k]).cast<float>();
    }
    const GltfTextureUse use = its_material == formats::kNone ? GltfTextureUse{} : materials_.use(its_material);
    if (const GltfValue user = attributes.get(("TEXCOORD_" + std::to_string(use.uv_set)).c_str())) {
      const std::vector<float> values = buffers_.attribute(user, pool.count, {2});
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
      const std::vector<float> values = buffers_.attribute(user, pool.count, {3, 4}, &components);
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
          buffers_.attribute(attributes.get(name.c_str()), pool.count, {1, 2, 3, 4, 9, 16}, &components);
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
      const std::vector<float> deltas = buffers_.attribute(user, pool.count, {3});
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
    mesh.transform = nodes_.global[node_index];
    if (!its_skin) return;
    mesh.skin_count.resize(vertex_origin.size());
    for (std::size_t v = 0; v < vertex_origin.size(); ++v) {
      const auto& [pool, element] = vertex_origin[v];
      for (std::uint32_t k = pool->skin_begin[element]; k < pool->skin_begin[element + 1]; ++k)
        mesh.skin.push_back({its_skin->joint_number[pool->skin[k].joint], pool->skin[k].weight});
      mesh.skin_count[v] = pool->skin_begin[element + 1] - pool->skin_begin[element];
    }
    if (const auto common = commonTransform(*its_skin, nodes_.global[node_index], mesh)) {
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

  GltfValue top_;
  RawScene scene_;
  GltfBuffers buffers_;
  GltfMaterials materials_;
  GltfNodes nodes_;
  std::map<std::uint64_t, std::uint32_t> joint_of_node_;
  std::size_t dropped_primitives_ = 0;
  std::size_t loose_indices_ = 0;
  std::vector<std::string> posed_morphs_;  // where, and by how much
};

}  // namespace

RawScene readGltf(std::string_view bytes, const std::filesystem::path& folder) {
  const GltfChunks chunks = gltfChunks(bytes);
  const json parsed = parseGltf(chunks.text);
  return GltfReader(parsed, chunks, folder).read();
}

}  // namespace sinew::tools
