// SPDX-License-Identifier: GPL-3.0-or-later
// The only file that includes assimp.
#include <assimp/BaseImporter.h>
#include <assimp/config.h>
#include <assimp/importerdesc.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/DefaultIOSystem.h>
#include <Eigen/LU>
#include <algorithm>
#include <assimp/Importer.hpp>
#include <bit>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>
#include <unordered_map>

#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

using nlohmann::json;

constexpr unsigned kMaxNodes = 1'000'000;

std::string textOf(const aiString& text) { return {text.data, std::min<std::size_t>(text.length, sizeof text.data)}; }

Eigen::Matrix4d matrixOf(const aiMatrix4x4& m) {
  Eigen::Matrix4d out;
  for (unsigned r = 0; r < 4; ++r)
    for (unsigned c = 0; c < 4; ++c) out(r, c) = double(m[r][c]);
  return out;
}

/// A key that exporters or assimp put on every node, no artist's.
bool isBuiltIn(const std::string& key) {
  static const std::set<std::string, std::less<>> kKeys = {"IsNull",
                                                           "DefaultAttributeIndex",
                                                           "InheritType",
                                                           "RotationActive",
                                                           "ScalingMax",
                                                           "currentUVSet",
                                                           "Show",
                                                           "RotationOrder",
                                                           "NegativePercentShapeSupport",
                                                           "AspectH",
                                                           "AspectW",
                                                           "BackgroundMode",
                                                           "ForegroundTransparent",
                                                           "ResolutionMode",
                                                           "ViewFrustum",
                                                           "MaxHandle",
                                                           "QuaternionInterpolate",
                                                           "LookAtProperty",
                                                           "UpVectorProperty",
                                                           "Freeze"};
  return kKeys.contains(key);
}

json propertiesOf(const aiMetadata* data, int depth) {
  json out = json::object();
  if (!data || depth > 16) return out;
  for (unsigned i = 0; i < data->mNumProperties; ++i) {
    const std::string key = textOf(data->mKeys[i]);
    const aiMetadataEntry& entry = data->mValues[i];
    if (!entry.mData || isBuiltIn(key)) continue;
    switch (entry.mType) {
      case AI_BOOL:
        out[key] = *static_cast<const bool*>(entry.mData);
        break;
      case AI_INT32:
        out[key] = *static_cast<const std::int32_t*>(entry.mData);
        break;
      case AI_UINT64:
        out[key] = *static_cast<const std::uint64_t*>(entry.mData);
        break;
      case AI_FLOAT:
        out[key] = *static_cast<const float*>(entry.mData);
        break;
      case AI_DOUBLE:
        out[key] = *static_cast<const double*>(entry.mData);
        break;
      case AI_AISTRING: {
        const std::string text = textOf(*static_cast<const aiString*>(entry.mData));
        if (!text.empty() || key != "UserProperties") out[key] = text;
        break;
      }
      case AI_AIVECTOR3D: {
        const auto& v = *static_cast<const aiVector3D*>(entry.mData);
        out[key] = {v.x, v.y, v.z};
        break;
      }
      case AI_AIMETADATA:
        out[key] = propertiesOf(static_cast<const aiMetadata*>(entry.mData), depth + 1);
        break;
      default:
        break;
    }
  }
  return out;
}

std::string fileText(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// The value of an attribute of the XML tag that begins at `tag`; empty where it has none.
std::string xmlAttribute(const std::string& text, std::size_t tag, std::string_view name) {
  const std::size_t stop = std::min(text.find('>', tag), text.size());
  for (std::size_t at = text.find(name, tag); at < stop; at = text.find(name, at + 1)) {
    if (at == 0 || !std::strchr(" \t\r\n", text[at - 1])) continue;
    std::size_t equals = at + name.size();
    while (equals < stop && std::strchr(" \t\r\n", text[equals])) ++equals;
    if (equals >= stop || text[equals] != '=') continue;
    const std::size_t quote = text.find_first_of("\"'", equals);
    if (quote >= stop) break;
    const std::size_t end = text.find(text[quote], quote + 1);
    if (end >= stop) break;
    return text.substr(quote + 1, end - quote - 1);
  }
  return {};
}

/// assimp 5.2 believes an accessor that reaches beyond its array and hands over what lies behind it in memory.
void checkColladaArrays(const std::string& text) {
  std::map<std::string, std::uint64_t> count_by_id;
  const auto number = [&](std::size_t tag, const char* name, std::int64_t otherwise) {
    const std::string value = xmlAttribute(text, tag, name);
    if (value.empty()) return otherwise;
    const auto parsed = parseInteger(TextCursor(value).word());
    if (!parsed || *parsed < 0 || *parsed > std::int64_t(1) << 31)
      throw ReadError(std::string("has the attribute ") + name + "=\"" + value.substr(0, 40) +
                      "\" where a count belongs (byte " + std::to_string(tag) + ")");
    return *parsed;
  };
  for (std::size_t at = text.find("<float_array"); at != text.npos; at = text.find("<float_array", at + 1))
    count_by_id[xmlAttribute(text, at, "id")] = std::uint64_t(number(at, "count", 0));
  for (std::size_t at = text.find("<accessor"); at != text.npos; at = text.find("<accessor", at + 1)) {
    std::string source = xmlAttribute(text, at, "source");
    if (source.starts_with('#')) source.erase(0, 1);
    const auto array = count_by_id.find(source);
    if (array == count_by_id.end()) continue;
    const std::int64_t reach = number(at, "offset", 0) + number(at, "count", 0) * number(at, "stride", 1);
    if (std::uint64_t(reach) > array->second)
      throw ReadError("an accessor reads " + std::to_string(reach) + " numbers of the array \"" +
                      source.substr(0, 100) + "\", which says it holds " + std::to_string(array->second));
  }
}

/// Refuses Collada that assimp reads as empty, silently.
void checkColladaFrame(const std::string& text) {
  if (text.find("<COLLADA") == text.npos)
    throw ReadError(text.find(":COLLADA") == text.npos ? "is no Collada: it has no element COLLADA"
                                                       : "has XML names with prefixes (x:COLLADA), which are not read",
                    "Export it again as Collada 1.4.1.");
  if (text.find("<instance_visual_scene") == text.npos)
    throw ReadError("has no scene: nothing in it names a visual_scene to show",
                    "Export it again with its objects in a scene.");
}

/// An importer that knows the one format only: by itself assimp would try others when the content looks like theirs.
const aiScene* loadFile(const std::filesystem::path& file, const std::string& format) {
  // Both are left to the end of the process; taking a broken scene apart is one more way to crash.
  auto* importer = new Assimp::Importer;
  for (std::size_t i = importer->GetImporterCount(); i-- > 0;) {
    Assimp::BaseImporter* loader = importer->GetImporter(i);
    std::set<std::string> extensions;
    loader->GetExtensionList(extensions);
    if (!extensions.contains(format)) importer->UnregisterLoader(loader);
  }
  importer->SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
  importer->SetPropertyBool(AI_CONFIG_IMPORT_COLLADA_USE_COLLADA_NAMES, true);
  const aiScene* scene = importer->ReadFile(file.string(), 0);
  if (!scene || !scene->mRootNode) {
    const std::string why = importer->GetErrorString();
    throw ReadError("cannot be read as " + format + " (" + why + ")",
                    why.find("old format version") != why.npos ? "Convert it to FBX 2013 or later." : "");
  }
  return scene;
}

class AssimpConverter {
 public:
  AssimpConverter(const aiScene& source, const std::filesystem::path& file, const std::string& format)
      : source_(source), file_(file), format_(format) {}

  RawScene convert() {
    if (format_ == "fbx") takeFbxSettings();
    if (format_ == "dae") takeColladaSettings();
    collectJoints();
    walk();
    if (dropped_ > 0)
      info("dropped-primitives", dropped_,
           std::to_string(dropped_) + " points and lines were left out; only faces are used");
    if (source_.mNumAnimations > 0)
      info("dropped-animations", source_.mNumAnimations,
           std::to_string(source_.mNumAnimations) + " animations were left out; the rest pose is used");
    return std::move(scene_);
  }

 private:
  void info(const char* id, std::uint64_t count, const std::string& message) {
    scene_.findings.push_back({id, Severity::info, message, count, "", {}, "", ""});
  }

  /// assimp hands FBX geometry over in the file's unit and axes and leaves the settings in the metadata.
  void takeFbxSettings() {
    if (!source_.mMetaData) return;
    const auto setting = [&](const char* key, std::int32_t otherwise) {
      std::int32_t value = otherwise;
      return source_.mMetaData->Get(key, value) ? value : otherwise;
    };
    double factor = 1;
    float single = 1;
    if (!source_.mMetaData->Get("UnitScaleFactor", factor))
      factor = source_.mMetaData->Get("UnitScaleFactor", single) ? double(single) : 1.0;
    if (std::isfinite(factor) && factor > 0 && factor < 1e9) {
      char text[96];
      // assimp kept it in single precision; the decimal number that was written is meant, not its nearest float.
      std::snprintf(text, sizeof text, "%.7g", factor);
      factor = parseNumber(text).value_or(factor);
      scene_.metres_per_unit = factor / 100;
      std::snprintf(text, sizeof text, "the FBX says UnitScaleFactor %g, so 1 unit is %g cm", factor, factor);
      scene_.unit_source = text;
    }
    const std::array<std::int32_t, 3> axis = {setting("CoordAxis", 0), setting("UpAxis", 1), setting("FrontAxis", 2)};
    const std::array<std::int32_t, 3> sign = {setting("CoordAxisSign", 1), setting("UpAxisSign", 1),
                                              setting("FrontAxisSign", 1)};
    Eigen::Matrix3d wanted = Eigen::Matrix3d::Zero();
    for (int row = 0; row < 3; ++row) {
      const std::int32_t column = axis[std::size_t(row)];
      if (column < 0 || column > 2) return;
      wanted(row, column) = sign[std::size_t(row)] < 0 ? -1 : 1;
    }
    scene_.up_axis = std::uint32_t(axis[1]);
    // A left-handed triple would mirror the model. Exporters write it by mistake more often than they mean it, so then
    // only the up axis counts.
    if (std::abs(wanted.determinant() - 1) > 1e-9) return;
    Eigen::Matrix3d usual = Eigen::Matrix3d::Identity();
    if (scene_.up_axis == 2) usual << 1, 0, 0, 0, 0, 1, 0, -1, 0;
    if (scene_.up_axis == 0) usual << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    root_.topLeftCorner<3, 3>() = usual.transpose() * wanted;
  }

  /// assimp applies a Collada file's unit and axes to its root node, by rules that changed between versions; so they
  /// are read from the text and the root node, which has no transform of its own in the format, is left out.
  void takeColladaSettings() {
    const std::string text = fileText(file_);
    scene_.metres_per_unit = 1;
    scene_.unit_source = "the Collada file names no unit, which means metres";
    if (const std::size_t unit = text.find("<unit"); unit != text.npos) {
      const std::string number = xmlAttribute(text, unit, "meter");
      const auto value = parseNumber(TextCursor(number).word());
      if (value && std::isfinite(*value) && *value > 0 && *value < 1e9) {
        scene_.metres_per_unit = *value;
        scene_.unit_source = "the Collada file says meter=\"" + number.substr(0, 32) + "\"";
      } else {
        scene_.unit_source = "the Collada file says meter=\"" + number.substr(0, 32) + "\", no length; taken as metres";
        scene_.findings.push_back({"unit-not-read",
                                   Severity::warning,
                                   scene_.unit_source,
                                   1,
                                   "",
                                   {},
                                   "",
                                   "Say the unit with --set import.unit=cm, or export the file again."});
      }
    }
    const std::string_view head = std::string_view(text).substr(0, text.find("<library_"));
    if (head.find("Z_UP") != head.npos) scene_.up_axis = 2;
    if (head.find("X_UP") != head.npos) scene_.up_axis = 0;
  }

  void collectJoints() {
    for (unsigned m = 0; m < source_.mNumMeshes; ++m)
      for (unsigned b = 0; b < source_.mMeshes[m]->mNumBones; ++b) {
        const std::string name = textOf(source_.mMeshes[m]->mBones[b]->mName);
        if (joint_by_name_.try_emplace(name, std::uint32_t(scene_.joints.size())).second) scene_.joints.push_back(name);
      }
  }

  void walk() {
    struct Visit {
      const aiNode* node;
      std::uint32_t parent;
      Eigen::Matrix4d global;
    };
    std::vector<Visit> stack = {{source_.mRootNode, formats::kNone, root_}};
    while (!stack.empty()) {
      const Visit visit = stack.back();
      stack.pop_back();
      if (scene_.nodes.size() >= kMaxNodes) throw ReadError("has more than a million nodes");
      const bool is_root = visit.parent == formats::kNone;
      const Eigen::Matrix4d global = is_root && format_ != "mesh"
                                         ? visit.global
                                         : Eigen::Matrix4d(visit.global * matrixOf(visit.node->mTransformation));
      const std::uint32_t number = std::uint32_t(scene_.nodes.size());
      RawNode node;
      node.name = textOf(visit.node->mName);
      if (node.name.empty()) node.name = is_root ? file_.stem().string() : "node " + std::to_string(number);
      node.parent = visit.parent;
      node.properties_json =
          propertiesOf(visit.node->mMetaData, 0).dump(-1, ' ', false, json::error_handler_t::replace);
      scene_.nodes.push_back(node);
      if (visit.node->mNumMeshes > 0) mesh(*visit.node, number, global);
      for (unsigned c = visit.node->mNumChildren; c-- > 0;) stack.push_back({visit.node->mChildren[c], number, global});
    }
  }

  /// All meshes of a node (assimp makes one of each material) become one, so that their shared points stay shared.
  /// assimp gives every corner a vertex of its own; a source vertex is a distinct position, in order of first use.
  void mesh(const aiNode& node, std::uint32_t node_number, const Eigen::Matrix4d& global) {
    RawMesh out;
    out.node = node_number;
    out.transform = global;
    std::map<std::string, std::size_t> attribute_number;
    std::map<std::string, std::size_t> morph_number;
    point_by_position_.clear();
    for (unsigned i = 0; i < node.mNumMeshes; ++i) {
      if (node.mMeshes[i] >= source_.mNumMeshes) throw ReadError("a node names a mesh that does not exist");
      const aiMesh& mesh = *source_.mMeshes[node.mMeshes[i]];
      if (out.name.empty()) out.name = textOf(mesh.mName);
      append(mesh, attribute_number, morph_number, out);
    }
    if (out.name.empty()) out.name = scene_.nodes[node_number].name;
    for (RawPart& part : out.parts)
      if (part.name.empty()) part.name = out.name;
    if (!out.points.empty()) scene_.meshes.push_back(std::move(out));
  }

  std::uint32_t pointOf(const aiVector3D& p, RawMesh& out) {
    const auto bits = [](float v) { return std::bit_cast<std::uint32_t>(v == 0 ? 0.0F : v); };
    const auto [at, fresh] =
        point_by_position_.try_emplace({bits(p.x), bits(p.y), bits(p.z)}, std::uint32_t(out.points.size()));
    if (fresh) {
      const Eigen::Vector3d point(double(p.x), double(p.y), double(p.z));
      if (!point.allFinite())
        throw ReadError("vertex " + std::to_string(out.points.size()) + " of mesh \"" + out.name +
                            "\" has a coordinate that is not a finite number",
                        "Repair that vertex in the program that made the file.");
      out.points.push_back(point);
    }
    return at->second;
  }

  void append(const aiMesh& mesh, std::map<std::string, std::size_t>& attribute_number,
              std::map<std::string, std::size_t>& morph_number, RawMesh& out) {
    const unsigned n = mesh.mNumVertices;
    if (n == 0 || !mesh.mVertices) return;
    // Influences by vertex.
    std::vector<std::uint32_t> begin(std::size_t(n) + 1, 0);
    for (unsigned b = 0; b < mesh.mNumBones; ++b)
      for (unsigned w = 0; w < mesh.mBones[b]->mNumWeights; ++w) {
        const unsigned v = mesh.mBones[b]->mWeights[w].mVertexId;
        if (v >= n)
          throw ReadError("bone \"" + textOf(mesh.mBones[b]->mName) + "\" weights a vertex that does not exist");
        ++begin[v + 1];
      }
    for (unsigned v = 0; v < n; ++v) begin[v + 1] += begin[v];
    std::vector<SkinInfluence> influences(begin[n]);
    std::vector<std::uint32_t> fill(begin.begin(), begin.end() - 1);
    for (unsigned b = 0; b < mesh.mNumBones; ++b) {
      const std::uint32_t joint = joint_by_name_.at(textOf(mesh.mBones[b]->mName));
      for (unsigned w = 0; w < mesh.mBones[b]->mNumWeights; ++w) {
        const aiVertexWeight& weight = mesh.mBones[b]->mWeights[w];
        influences[fill[weight.mVertexId]++] = {joint, weight.mWeight};
      }
    }
    const auto same = [&](unsigned a, unsigned b) {
      const auto equal = [&](const auto* values) {
        // Bit for bit on purpose; these hold floats and no padding.
        // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison)
        return !values || std::memcmp(values + a, values + b, sizeof *values) == 0;
      };
      if (!equal(mesh.mNormals)) return false;
      for (unsigned k = 0; k < AI_MAX_NUMBER_OF_TEXTURECOORDS; ++k)
        if (!equal(mesh.mTextureCoords[k])) return false;
      for (unsigned k = 0; k < AI_MAX_NUMBER_OF_COLOR_SETS; ++k)
        if (!equal(mesh.mColors[k])) return false;
      for (unsigned k = 0; k < mesh.mNumAnimMeshes; ++k)
        if (mesh.mAnimMeshes[k]->mNumVertices == n && !equal(mesh.mAnimMeshes[k]->mVertices)) return false;
      return std::equal(influences.begin() + begin[a], influences.begin() + begin[a + 1], influences.begin() + begin[b],
                        influences.begin() + begin[b + 1], [](const SkinInfluence& x, const SkinInfluence& y) {
                          return x.joint == y.joint && x.weight == y.weight;
                        });
    };

    // Vertices of this mesh: distinct among those at one point. `chosen` keeps which of assimp's vertices each one is.
    const std::uint32_t first = std::uint32_t(out.vertex_point.size());
    std::vector<std::uint32_t> vertex_of(n, formats::kNone);
    std::vector<unsigned> chosen;
    std::vector<std::uint32_t> next;
    std::unordered_map<std::uint32_t, std::uint32_t> head;
    const std::uint32_t part = std::uint32_t(out.parts.size());
    out.parts.push_back({textOf(mesh.mName), material(mesh.mMaterialIndex)});
    const auto vertexOf = [&](unsigned v) {
      if (vertex_of[v] != formats::kNone) return vertex_of[v];
      const std::uint32_t point = pointOf(mesh.mVertices[v], out);
      const auto [at, fresh] = head.try_emplace(point, formats::kNone);
      std::uint32_t k = at->second;
      while (k != formats::kNone && !same(chosen[k], v)) k = next[k];
      if (k == formats::kNone) {
        k = std::uint32_t(chosen.size());
        chosen.push_back(v);
        next.push_back(at->second);
        at->second = k;
        out.vertex_point.push_back(point);
      }
      return vertex_of[v] = first + k;
    };
    for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
      const aiFace& face = mesh.mFaces[f];
      if (face.mNumIndices < 3) {
        ++dropped_;
        continue;
      }
      for (unsigned k = 0; k < face.mNumIndices; ++k) {
        if (face.mIndices[k] >= n)
          throw ReadError("face " + std::to_string(f) + " of mesh \"" + textOf(mesh.mName) + "\" names vertex " +
                          std::to_string(face.mIndices[k]) + " of " + std::to_string(n));
        out.corners.push_back(vertexOf(face.mIndices[k]));
      }
      out.face_size.push_back(face.mNumIndices);
      out.face_part.push_back(part);
    }

    const std::size_t total = out.vertex_point.size();
    const auto vector3 = [](const aiVector3D& v) { return Eigen::Vector3f(v.x, v.y, v.z); };
    if (mesh.mNormals) out.normals.resize(first, Eigen::Vector3f::Zero());
    if (mesh.mTextureCoords[0]) out.uvs.resize(first, Eigen::Vector2f::Zero());
    if (mesh.mColors[0]) out.colors.resize(first, {0, 0, 0, 0});
    if (mesh.mNumBones > 0) out.skin_count.resize(first, 0);
    for (const unsigned v : chosen) {
      if (mesh.mNormals) out.normals.push_back(vector3(mesh.mNormals[v]));
      if (mesh.mTextureCoords[0]) out.uvs.push_back({mesh.mTextureCoords[0][v].x, mesh.mTextureCoords[0][v].y});
      if (mesh.mColors[0])
        out.colors.push_back({mesh.mColors[0][v].r, mesh.mColors[0][v].g, mesh.mColors[0][v].b, mesh.mColors[0][v].a});
      if (mesh.mNumBones > 0) {
        out.skin_count.push_back(begin[v + 1] - begin[v]);
        out.skin.insert(out.skin.end(), influences.begin() + begin[v], influences.begin() + begin[v + 1]);
      }
    }
    const auto further = [&](const std::string& name, std::uint32_t components, auto value) {
      const auto [at, fresh] = attribute_number.try_emplace(name, out.attributes.size());
      if (fresh) out.attributes.push_back({name, components, {}});
      std::vector<float>& values = out.attributes[at->second].values;
      values.resize(std::size_t(first) * components, 0.0F);
      for (const unsigned v : chosen)
        for (std::uint32_t c = 0; c < components; ++c) values.push_back(value(v, c));
    };
    for (unsigned k = 1; k < AI_MAX_NUMBER_OF_TEXTURECOORDS; ++k)
      if (mesh.mTextureCoords[k])
        further("TEXCOORD_" + std::to_string(k), 2,
                [&](unsigned v, unsigned c) { return mesh.mTextureCoords[k][v][c]; });
    for (unsigned k = 1; k < AI_MAX_NUMBER_OF_COLOR_SETS; ++k)
      if (mesh.mColors[k])
        further("COLOR_" + std::to_string(k), 4, [&](unsigned v, unsigned c) { return mesh.mColors[k][v][c]; });
    for (unsigned k = 0; k < mesh.mNumAnimMeshes; ++k) {
      const aiAnimMesh& target = *mesh.mAnimMeshes[k];
      if (target.mNumVertices != n || !target.mVertices) continue;
      std::string name = textOf(target.mName);
      if (name.empty()) name = "morph " + std::to_string(k);
      const auto [at, fresh] = morph_number.try_emplace(name, out.morphs.size());
      if (fresh) out.morphs.push_back({name, {}, {}});
      RawMorph& morph = out.morphs[at->second];
      for (std::uint32_t i = 0; i < chosen.size(); ++i) {
        const Eigen::Vector3f d = vector3(target.mVertices[chosen[i]]) - vector3(mesh.mVertices[chosen[i]]);
        if (d == Eigen::Vector3f::Zero()) continue;
        morph.vertices.push_back(first + i);
        morph.displacements.push_back(d);
      }
    }
    if (!out.normals.empty()) out.normals.resize(total, Eigen::Vector3f::Zero());
    if (!out.uvs.empty()) out.uvs.resize(total, Eigen::Vector2f::Zero());
    if (!out.colors.empty()) out.colors.resize(total, {0, 0, 0, 0});
    if (!out.skin_count.empty()) out.skin_count.resize(total, 0);
    for (AttributeSource& attribute : out.attributes) attribute.values.resize(total * attribute.components, 0.0F);
  }

  std::uint32_t material(unsigned index) {
    if (index >= source_.mNumMaterials) return formats::kNone;
    const auto [at, fresh] = material_number_.try_emplace(index, formats::kNone);
    if (!fresh) return at->second;
    const aiMaterial& source = *source_.mMaterials[index];
    RawMaterial out;
    aiString name;
    if (source.Get(AI_MATKEY_NAME, name) == AI_SUCCESS) out.name = textOf(name);
    aiColor4D color;
    if (source.Get(AI_MATKEY_BASE_COLOR, color) == AI_SUCCESS ||
        source.Get(AI_MATKEY_COLOR_DIFFUSE, color) == AI_SUCCESS)
      out.base_color = {color.r, color.g, color.b, color.a};
    float opacity = 1;
    if (source.Get(AI_MATKEY_OPACITY, opacity) == AI_SUCCESS && opacity >= 0 && opacity <= 1)
      out.base_color[3] = opacity;
    for (float& channel : out.base_color)
      if (!std::isfinite(channel)) channel = 1;
    int two_sided = 0;
    if (source.Get(AI_MATKEY_TWOSIDED, two_sided) == AI_SUCCESS) out.double_sided = two_sided != 0;
    aiString path;
    for (const aiTextureType type : {aiTextureType_BASE_COLOR, aiTextureType_DIFFUSE})
      if (out.texture == formats::kNone && source.GetTexture(type, 0, &path) == AI_SUCCESS && path.length > 0)
        out.texture = texture(path);
    // assimp invents a material where the file has none.
    if (out.name == AI_DEFAULT_MATERIAL_NAME && out.texture == formats::kNone) return formats::kNone;
    at->second = std::uint32_t(scene_.materials.size());
    scene_.materials.push_back(std::move(out));
    return at->second;
  }

  std::uint32_t texture(const aiString& path) {
    const std::string key = textOf(path);
    const auto [at, fresh] = texture_by_path_.try_emplace(key, std::uint32_t(scene_.textures.size()));
    if (!fresh) return at->second;
    RawTexture out;
    out.name = key;
    const aiTexture* embedded = source_.GetEmbeddedTexture(path.C_Str());
    if (embedded && embedded->mHeight == 0 && embedded->pcData) {
      out.name = "embedded " + std::to_string(at->second) + " (" +
                 (embedded->mFilename.length > 0 ? textOf(embedded->mFilename) : key) + ")";
      out.bytes.resize(embedded->mWidth);
      std::memcpy(out.bytes.data(), embedded->pcData, embedded->mWidth);
    } else {
      out.path = key;
    }
    scene_.textures.push_back(std::move(out));
    return at->second;
  }

  const aiScene& source_;
  std::filesystem::path file_;
  std::string format_;
  RawScene scene_;
  Eigen::Matrix4d root_ = Eigen::Matrix4d::Identity();
  std::map<std::string, std::uint32_t> joint_by_name_;
  struct BitsHash {
    std::size_t operator()(const std::array<std::uint32_t, 3>& b) const {
      std::uint64_t h = (std::uint64_t(b[0]) << 32 | b[1]) * 0x9E3779B97F4A7C15ULL;
      h = (h ^ h >> 29 ^ b[2]) * 0xBF58476D1CE4E5B9ULL;
      return std::size_t(h ^ h >> 32);
    }
  };
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, BitsHash> point_by_position_;
  std::map<unsigned, std::uint32_t> material_number_;
  std::map<std::string, std::uint32_t> texture_by_path_;
  std::uint64_t dropped_ = 0;
};

}  // namespace

RawScene readWithAssimp(const std::filesystem::path& file, const std::string& format) {
  if (format == "dae") {
    const std::string text = fileText(file);
    checkColladaFrame(text);
    checkColladaArrays(text);
  }
  return AssimpConverter(*loadFile(file, format), file, format).convert();
}

}  // namespace sinew::tools
