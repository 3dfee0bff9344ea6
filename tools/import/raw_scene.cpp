// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/raw_scene.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <type_traits>

namespace sinew::tools {
namespace {

constexpr std::uint32_t kStreamMagic = 0x31495753;  // "SWI1"

/// One description of the stream for both directions: `Archive` is a Writer or a Reader, `T&` const or not.
class Writer {
 public:
  explicit Writer(ByteSink& sink) : sink_(sink) {}

  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void operator()(const T& value) { sink_.write(&value, sizeof value); }
  void operator()(const std::string& text) {
    (*this)(std::uint64_t(text.size()));
    sink_.write(text.data(), text.size());
  }
  template <class T>
  void flat(const std::vector<T>& values) {
    (*this)(std::uint64_t(values.size()));
    sink_.write(values.data(), values.size() * sizeof(T));
  }
  template <class T, class Each>
  void list(const std::vector<T>& values, Each each) {
    (*this)(std::uint64_t(values.size()));
    for (const T& value : values) each(*this, value);
  }
  void raw(const void* data, std::size_t size) { sink_.write(data, size); }

 private:
  ByteSink& sink_;
};

class Reader {
 public:
  explicit Reader(ByteSource& source) : source_(source) {}

  template <class T>
  requires std::is_arithmetic_v<T> || std::is_enum_v<T>
  void operator()(T& value) {
    if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t byte = 0;
      source_.read(&byte, 1);
      value = byte != 0;
    } else {
      source_.read(&value, sizeof value);
    }
  }
  void operator()(std::string& text) {
    text.resize(count(1));
    source_.read(text.data(), text.size());
  }
  template <class T>
  void flat(std::vector<T>& values) {
    values.resize(count(sizeof(T)));
    source_.read(static_cast<void*>(values.data()), values.size() * sizeof(T));
  }
  template <class T, class Each>
  void list(std::vector<T>& values, Each each) {
    values.resize(count(sizeof(T)));
    for (T& value : values) each(*this, value);
  }
  void raw(void* data, std::size_t size) { source_.read(data, size); }

 private:
  std::size_t count(std::size_t element_size) {
    std::uint64_t n = 0;
    (*this)(n);
    if (n > std::uint64_t(1) << 40) throw std::runtime_error("count out of range");
    source_.claim(n * element_size);
    return std::size_t(n);
  }
  ByteSource& source_;
};

template <class Archive, class Scene>
void exchange(Archive& archive, Scene& scene) {
  const auto text = [](auto& a, auto& value) { a(value); };
  archive(scene.metres_per_unit);
  archive(scene.unit_source);
  archive(scene.up_axis);
  archive.list(scene.nodes, [](auto& a, auto& node) {
    a(node.name);
    a(node.parent);
    a(node.properties_json);
  });
  archive.list(scene.meshes, [](auto& a, auto& mesh) {
    a(mesh.name);
    a(mesh.node);
    a.raw(mesh.transform.data(), 16 * sizeof(double));
    a.list(mesh.ranges, [](auto& b, auto& range) {
      b(range.name);
      b(range.first_source_vertex);
      b(range.source_vertex_count);
    });
    a.flat(mesh.points);
    a.flat(mesh.vertex_point);
    a.flat(mesh.normals);
    a.flat(mesh.uvs);
    a.flat(mesh.colors);
    a.list(mesh.attributes, [](auto& b, auto& attribute) {
      b(attribute.name);
      b(attribute.components);
      b.flat(attribute.values);
    });
    a.flat(mesh.skin_count);
    a.flat(mesh.skin);
    a.list(mesh.morphs, [](auto& b, auto& morph) {
      b(morph.name);
      b.flat(morph.vertices);
      b.flat(morph.displacements);
    });
    a.flat(mesh.face_size);
    a.flat(mesh.corners);
    a.flat(mesh.face_part);
    a.flat(mesh.face_groups);
    a.list(mesh.parts, [](auto& b, auto& part) {
      b(part.name);
      b(part.material);
    });
  });
  archive.list(scene.materials, [](auto& a, auto& material) {
    a(material.name);
    a.raw(material.base_color.data(), sizeof material.base_color);
    a(material.texture);
    a(material.double_sided);
  });
  archive.list(scene.textures, [](auto& a, auto& texture) {
    a(texture.path);
    a(texture.name);
    a.flat(texture.bytes);
  });
  archive.list(scene.groups, text);
  archive.list(scene.group_sets, [](auto& a, auto& set) { a.flat(set); });
  archive.list(scene.joints, text);
  archive.list(scene.findings, [](auto& a, auto& finding) {
    a(finding.id);
    a(finding.severity);
    a(finding.message);
    a(finding.count);
    a(finding.place_kind);
    a.flat(finding.places);
    a(finding.place);
    a(finding.cure);
  });
}

void require(bool condition, const char* what) {
  if (!condition) throw ReadError(std::string("the reader returned ") + what);
}

void requireBelow(const std::vector<std::uint32_t>& values, std::size_t bound, const char* what) {
  require(std::all_of(values.begin(), values.end(), [&](std::uint32_t v) { return v < bound; }), what);
}

bool emptyOr(std::size_t size, std::size_t expected) { return size == 0 || size == expected; }

void validateMesh(const RawScene& scene, const RawMesh& mesh, std::uint64_t first_source_vertex) {
  require(mesh.node == formats::kNone || mesh.node < scene.nodes.size(), "a mesh on a node that does not exist");
  if (!mesh.transform.allFinite()) throw ReadError("the transform of mesh \"" + mesh.name + "\" is not finite");
  const std::size_t vertices = mesh.vertex_point.size();
  for (std::size_t i = 0; i < mesh.points.size(); ++i)
    if (!mesh.points[i].allFinite())
      throw ReadError("vertex " + std::to_string(first_source_vertex + i) + " of mesh \"" + mesh.name +
                          "\" has a coordinate that is not a finite number",
                      "Repair that vertex in the program that made the file.");
  requireBelow(mesh.vertex_point, mesh.points.size(), "a vertex without a point");
  require(emptyOr(mesh.normals.size(), vertices) && emptyOr(mesh.uvs.size(), vertices) &&
              emptyOr(mesh.colors.size(), vertices) && emptyOr(mesh.skin_count.size(), vertices),
          "vertex attributes of the wrong length");
  for (const AttributeSource& attribute : mesh.attributes) {
    require(attribute.components >= 1 && attribute.components <= 16, "an attribute of no or too many components");
    require(attribute.values.size() == vertices * attribute.components, "an attribute of the wrong length");
  }
  std::uint64_t influences = 0;
  for (std::uint32_t count : mesh.skin_count) influences += count;
  require(influences == mesh.skin.size(), "skin weights of the wrong length");
  for (const SkinInfluence& influence : mesh.skin)
    require(influence.joint < scene.joints.size(), "a skin weight of a joint that does not exist");
  for (const RawMorph& morph : mesh.morphs) {
    require(morph.vertices.size() == morph.displacements.size(), "a morph target of the wrong length");
    requireBelow(morph.vertices, vertices, "a morph target of vertices that do not exist");
    for (const Eigen::Vector3f& d : morph.displacements)
      if (!d.allFinite()) throw ReadError("morph target \"" + morph.name + "\" holds a number that is not finite");
  }
  std::uint64_t corners = 0;
  for (std::uint32_t size : mesh.face_size) {
    require(size == 0 || size >= 3, "a face of one or two corners");
    corners += size;
  }
  require(corners == mesh.corners.size(), "faces of the wrong length");
  requireBelow(mesh.corners, vertices, "a face of vertices that do not exist");
  require(
      emptyOr(mesh.face_part.size(), mesh.face_size.size()) && emptyOr(mesh.face_groups.size(), mesh.face_size.size()),
      "face attributes of the wrong length");
  require(!mesh.parts.empty() || mesh.face_size.empty(), "faces without a part");
  requireBelow(mesh.face_part, mesh.parts.size(), "a face of a part that does not exist");
  for (std::uint32_t set : mesh.face_groups)
    require(set == formats::kNone || set < scene.group_sets.size(), "a face of groups that do not exist");
  for (const RawPart& part : mesh.parts)
    require(part.material == formats::kNone || part.material < scene.materials.size(),
            "a material that does not exist");
  std::uint64_t covered = 0;
  for (const SourceMeshRange& range : mesh.ranges) {
    require(range.first_source_vertex == covered, "runs of source vertices with gaps");
    covered += range.source_vertex_count;
  }
  require(mesh.ranges.empty() || covered == mesh.points.size(), "runs of source vertices that do not cover the mesh");
}

}  // namespace

void writeRawScene(const RawScene& scene, ByteSink& sink) {
  Writer writer(sink);
  writer(kStreamMagic);
  exchange(writer, scene);
  writer(kStreamMagic);
}

void readRawScene(ByteSource& source, RawScene& scene) {
  Reader reader(source);
  std::uint32_t magic = 0;
  reader(magic);
  if (magic != kStreamMagic) throw std::runtime_error("bad start");
  exchange(reader, scene);
  reader(magic);
  if (magic != kStreamMagic) throw std::runtime_error("bad end");
}

void validateRawScene(const RawScene& scene) {
  require(std::isfinite(scene.metres_per_unit) && scene.metres_per_unit >= 0 && scene.metres_per_unit < 1e9,
          "an impossible unit");
  require(scene.up_axis < 3, "an impossible up axis");
  for (std::size_t i = 0; i < scene.nodes.size(); ++i)
    require(scene.nodes[i].parent == formats::kNone || scene.nodes[i].parent < i, "nodes out of order");
  for (const RawMaterial& material : scene.materials) {
    require(material.texture == formats::kNone || material.texture < scene.textures.size(),
            "a texture that does not exist");
    for (float channel : material.base_color) require(std::isfinite(channel), "a colour that is not finite");
  }
  for (const auto& set : scene.group_sets) requireBelow(set, scene.groups.size(), "a group that does not exist");
  for (const Finding& finding : scene.findings) {
    require(finding.severity >= Severity::info && finding.severity <= Severity::error, "an impossible finding");
    require(finding.places.size() <= Finding::kMaxPlaces, "a finding of too many places");
  }
  std::uint64_t points = 0;
  std::uint64_t vertices = 0;
  std::uint64_t corners = 0;
  for (const RawMesh& mesh : scene.meshes) {
    validateMesh(scene, mesh, points);
    points += mesh.points.size();
    vertices += mesh.vertex_point.size();
    corners += mesh.corners.size();
  }
  constexpr std::uint64_t kMost = 1U << 31;
  if (points >= kMost || vertices >= kMost || corners >= kMost)
    throw ReadError("has more than 2^31 vertices or corners", "Reduce the mesh first.");
}

std::string asUtf8(const std::string& text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  bool valid = true;
  for (std::size_t i = 0; i < text.size() && valid;) {
    const unsigned lead = byte(i);
    const std::size_t length = lead < 0x80                   ? 1
                               : lead >= 0xC2 && lead < 0xE0 ? 2
                               : lead >= 0xE0 && lead < 0xF0 ? 3
                               : lead >= 0xF0 && lead < 0xF5 ? 4
                                                             : 0;
    valid = length > 0;
    for (std::size_t k = 1; k < length; ++k) valid = valid && (byte(i + k) & 0xC0U) == 0x80;
    // Overlong forms, surrogates and what lies beyond the last code point.
    if (length == 3) valid = valid && !(lead == 0xE0 && byte(i + 1) < 0xA0) && !(lead == 0xED && byte(i + 1) >= 0xA0);
    if (length == 4) valid = valid && !(lead == 0xF0 && byte(i + 1) < 0x90) && !(lead == 0xF4 && byte(i + 1) >= 0x90);
    i += length;
  }
  if (valid) return text;
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const unsigned c = byte(i);
    if (c < 0x80) {
      out += char(c);
    } else {
      out += char(0xC0U | c >> 6);
      out += char(0x80U | (c & 0x3FU));
    }
  }
  return out;
}

void cleanTexts(RawScene& scene) {
  const auto clean = [](std::string& text) { text = asUtf8(text); };
  clean(scene.unit_source);
  for (RawNode& node : scene.nodes) clean(node.name), clean(node.properties_json);
  for (RawMesh& mesh : scene.meshes) {
    clean(mesh.name);
    for (SourceMeshRange& range : mesh.ranges) clean(range.name);
    for (AttributeSource& attribute : mesh.attributes) clean(attribute.name);
    for (RawMorph& morph : mesh.morphs) clean(morph.name);
    for (RawPart& part : mesh.parts) clean(part.name);
  }
  for (RawMaterial& material : scene.materials) clean(material.name);
  for (RawTexture& texture : scene.textures) clean(texture.name);
  for (std::string& group : scene.groups) clean(group);
  for (std::string& joint : scene.joints) clean(joint);
  for (Finding& finding : scene.findings)
    clean(finding.id), clean(finding.message), clean(finding.place_kind), clean(finding.place), clean(finding.cure);
}

void joinCorners(const std::vector<RawCorner>& corners, const std::vector<Eigen::Vector2f>& uvs,
                 const std::vector<Eigen::Vector3f>& normals, RawMesh& mesh) {
  struct Entry {
    std::uint32_t part, uv, normal, next, vertex;
  };
  // Chains of the distinct combinations at each point. Chains are short: as many as seams meet in a point.
  std::vector<std::uint32_t> head(mesh.points.size(), formats::kNone);
  std::vector<std::uint32_t> entry_point;
  std::vector<Entry> entries;
  entries.reserve(mesh.points.size());
  entry_point.reserve(mesh.points.size());
  mesh.corners.resize(corners.size());
  std::size_t c = 0;
  for (std::size_t f = 0; f < mesh.face_size.size(); ++f) {
    const std::uint32_t part = mesh.face_part.empty() ? 0 : mesh.face_part[f];
    for (std::uint32_t k = 0; k < mesh.face_size[f]; ++k, ++c) {
      const RawCorner& corner = corners[c];
      std::uint32_t at = head[corner.point];
      while (at != formats::kNone &&
             (entries[at].part != part || entries[at].uv != corner.uv || entries[at].normal != corner.normal))
        at = entries[at].next;
      if (at == formats::kNone) {
        at = std::uint32_t(entries.size());
        entries.push_back({part, corner.uv, corner.normal, head[corner.point], 0});
        entry_point.push_back(corner.point);
        head[corner.point] = at;
      }
      mesh.corners[c] = at;
    }
  }
  std::vector<std::uint32_t> order(entries.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    if (entries[a].part != entries[b].part) return entries[a].part < entries[b].part;
    if (entry_point[a] != entry_point[b]) return entry_point[a] < entry_point[b];
    return a < b;
  });
  const bool any_uv =
      std::any_of(entries.begin(), entries.end(), [](const Entry& e) { return e.uv != formats::kNone; });
  const bool any_normal =
      std::any_of(entries.begin(), entries.end(), [](const Entry& e) { return e.normal != formats::kNone; });
  mesh.vertex_point.resize(entries.size());
  if (any_uv) mesh.uvs.assign(entries.size(), Eigen::Vector2f::Zero());
  if (any_normal) mesh.normals.assign(entries.size(), Eigen::Vector3f::Zero());
  for (std::uint32_t v = 0; v < order.size(); ++v) {
    Entry& entry = entries[order[v]];
    entry.vertex = v;
    mesh.vertex_point[v] = entry_point[order[v]];
    if (entry.uv != formats::kNone) mesh.uvs[v] = uvs[entry.uv];
    if (entry.normal != formats::kNone) mesh.normals[v] = normals[entry.normal];
  }
  for (std::uint32_t& corner : mesh.corners) corner = entries[corner].vertex;
}

}  // namespace sinew::tools
