// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <bit>
#include <cstring>
#include <map>

#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

enum class Scalar : std::uint8_t { i8, u8, i16, u16, i32, u32, f32, f64 };

constexpr std::size_t kScalarSize[] = {1, 1, 2, 2, 4, 4, 4, 8};

std::optional<Scalar> scalarByName(std::string_view name) {
  static const std::map<std::string_view, Scalar> kNames = {
      {"char", Scalar::i8},   {"int8", Scalar::i8},     {"uchar", Scalar::u8},   {"uint8", Scalar::u8},
      {"short", Scalar::i16}, {"int16", Scalar::i16},   {"ushort", Scalar::u16}, {"uint16", Scalar::u16},
      {"int", Scalar::i32},   {"int32", Scalar::i32},   {"uint", Scalar::u32},   {"uint32", Scalar::u32},
      {"float", Scalar::f32}, {"float32", Scalar::f32}, {"double", Scalar::f64}, {"float64", Scalar::f64}};
  const auto at = kNames.find(name);
  return at == kNames.end() ? std::nullopt : std::optional(at->second);
}

/// The stored integer that is 1 in a colour; 1 for real numbers.
double colorScale(Scalar type) {
  switch (type) {
    case Scalar::u8:
      return 255;
    case Scalar::u16:
      return 65535;
    case Scalar::i8:
      return 127;
    case Scalar::i16:
      return 32767;
    case Scalar::i32:
      return 2147483647.0;
    case Scalar::u32:
      return 4294967295.0;
    default:
      return 1;
  }
}

struct Property {
  std::string name;
  Scalar type = Scalar::f32;
  bool list = false;
  Scalar count_type = Scalar::u8;
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

/// Gives the numbers of the body one after the other, whatever the encoding.
class Body {
 public:
  Body(std::string_view bytes, bool text, bool swap)
      : bytes_(bytes), cursor_(text ? bytes : ""), text_(text), swap_(swap) {}

  double number(Scalar type) {
    if (text_) {
      const std::string_view word = cursor_.wordAnywhere();
      const auto value = parseNumber(word);
      if (word.empty()) throw ReadError(place() + " is missing: the file ends too early");
      if (!value) throw noNumber(place(), word, "");
      return *value;
    }
    const std::size_t size = kScalarSize[std::size_t(type)];
    if (bytes_.size() - at_ < size) throw ReadError(place() + " is missing: the file ends too early");
    std::array<char, 8> raw{};
    std::memcpy(raw.data(), bytes_.data() + at_, size);
    at_ += size;
    if (swap_) std::reverse(raw.begin(), raw.begin() + std::ptrdiff_t(size));
    switch (type) {
      case Scalar::i8:
        return double(load<std::int8_t>(raw));
      case Scalar::u8:
        return double(load<std::uint8_t>(raw));
      case Scalar::i16:
        return double(load<std::int16_t>(raw));
      case Scalar::u16:
        return double(load<std::uint16_t>(raw));
      case Scalar::i32:
        return double(load<std::int32_t>(raw));
      case Scalar::u32:
        return double(load<std::uint32_t>(raw));
      case Scalar::f32:
        return double(load<float>(raw));
      case Scalar::f64:
        return load<double>(raw);
    }
    return 0;
  }

  std::uint64_t listCount(Scalar type) {
    const double count = number(type);
    if (!(count >= 0) || count > double(remaining()))
      throw ReadError(place() + " has a list of " + std::to_string(count) + " entries, more than the file holds");
    return std::uint64_t(count);
  }

  /// Bytes left: an upper bound of how many numbers can follow.
  std::uint64_t remaining() const { return text_ ? cursor_.rest().size() : bytes_.size() - at_; }

  void setPlace(const std::string* element, std::uint64_t index) { element_ = element, index_ = index; }
  std::string place() const {
    return *element_ + " " + std::to_string(index_) +
           (text_ ? " (line " + std::to_string(cursor_.line()) + " of the body)" : "");
  }

 private:
  template <class T>
  static T load(const std::array<char, 8>& raw) {
    T value;
    std::memcpy(&value, raw.data(), sizeof value);
    return value;
  }
  std::string_view bytes_;
  std::size_t at_ = 0;
  TextCursor cursor_;
  bool text_;
  bool swap_;
  const std::string* element_ = nullptr;
  std::uint64_t index_ = 0;
};

class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& stem) : stem_(stem) {
    mesh_.name = stem;
    mesh_.parts.push_back({stem, formats::kNone});
    header(bytes);
  }

  RawScene read() {
    Body body(body_, text_, swap_);
    // Faces may lie before the vertices.
    for (const Element& element : elements_)
      if (element.name == "vertex") vertex_count_ = element.count;
    for (const Element& element : elements_) {
      body.setPlace(&element.name, 0);
      // Each entry takes at least one byte (text: a digit and a blank), so a count beyond that is a lie told before any
      // memory is taken.
      std::uint64_t least = 0;
      for (const Property& p : element.properties)
        least += text_ ? 1 : p.list ? kScalarSize[std::size_t(p.count_type)] : kScalarSize[std::size_t(p.type)];
      if (element.count > 0 && !element.properties.empty() &&
          element.count > body.remaining() / std::max<std::uint64_t>(least, 1) + 1)
        throw ReadError("the header promises " + std::to_string(element.count) + " of element " + element.name +
                        ", more than the file holds");
      if (element.name == "vertex") {
        vertices(body, element);
      } else if (element.name == "face") {
        faces(body, element);
      } else if (element.name == "tristrips") {
        strips(body, element);
      } else {
        skip(body, element);
      }
    }
    if (!text_ && body.remaining() > 0) scene_.findings.push_back(trailingBytes(body.remaining(), "element", "faces"));
    finish();
    return std::move(scene_);
  }

 private:
  void header(std::string_view bytes) {
    if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
    if (!bytes.starts_with("ply")) throw ReadError("is no PLY: it does not begin with \"ply\"");
    TextCursor lines(bytes);
    lines.nextLine();
    bool format = false;
    for (; !lines.atEnd(); lines.nextLine()) {
      const std::string place = " (line " + std::to_string(lines.line()) + " of the header)";
      const std::string_view key = lines.word();
      if (key == "format") {
        const std::string_view name = lines.word();
        text_ = name == "ascii";
        const bool big = name == "binary_big_endian";
        if (!text_ && !big && name != "binary_little_endian")
          throw ReadError("has an unknown format \"" + std::string(name.substr(0, 40)) + "\"" + place);
        swap_ = big != (std::endian::native == std::endian::big);
        format = true;
      } else if (key == "element") {
        Element element;
        element.name = std::string(lines.word());
        const auto count = parseInteger(lines.word());
        if (element.name.empty() || !count || *count < 0 || *count >= std::int64_t(formats::kNone))
          throw ReadError("has an element without a proper name and count" + place);
        for (const Element& other : elements_)
          if (other.name == element.name) throw ReadError("has two elements named " + element.name + place);
        element.count = std::uint64_t(*count);
        elements_.push_back(std::move(element));
      } else if (key == "property") {
        if (elements_.empty()) throw ReadError("has a property before any element" + place);
        Property property;
        std::string_view type = lines.word();
        if (type == "list") {
          property.list = true;
          const auto count_type = scalarByName(lines.word());
          if (!count_type) throw ReadError("has a list of unknown type" + place);
          property.count_type = *count_type;
          type = lines.word();
        }
        const auto known = scalarByName(type);
        if (!known) throw ReadError("has a property of unknown type \"" + quotable(type) + "\"" + place);
        property.type = *known;
        property.name = std::string(lines.word());
        elements_.back().properties.push_back(std::move(property));
      } else if (key == "comment" || key == "obj_info") {
        if (lines.word() == "TextureFile") texture_ = std::string(lines.lineRest());
      } else if (key == "end_header") {
        lines.nextLine();
        body_ = lines.rest();
        if (!format) throw ReadError("has a header without a format");
        if (unknown_lines_ > 0) {
          scene_.findings.push_back(
              skippedLines("unknown-header", unknown_lines_, " of the header", "a PLY can say", unknown_, "comment"));
        }
        return;
      } else if (!key.empty()) {
        // Old exporters wrote "Created by ..." without `comment`. Bytes that are no text are no remark.
        const auto control = [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; };
        if (std::any_of(key.begin(), key.end(), control)) {
          throw ReadError("has an unknown header statement \"" + quotable(key) + "\"" + place);
        }
        if (unknown_lines_++ == 0) unknown_ = "\"" + quotable(key) + " " + quotable(lines.lineRest()) + "\"" + place;
      }
    }
    throw ReadError("has a header without an end");
  }

  static bool isCorners(const Property& p) {
    return p.list && (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  static void skipList(Body& body, const Property& p) {
    const std::uint64_t count = body.listCount(p.count_type);
    for (std::uint64_t k = 0; k < count; ++k) body.number(p.type);
  }

  void skip(Body& body, const Element& element) {
    if (element.properties.empty()) return;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body.setPlace(&element.name, i);
      for (const Property& p : element.properties) {
        if (p.list) {
          skipList(body, p);
        } else {
          body.number(p.type);
        }
      }
    }
    if (element.count > 0)
      scene_.findings.push_back({"dropped-primitives",
                                 Severity::info,
                                 std::to_string(element.count) + " entries of the element " + element.name +
                                     " were left out; only faces are used",
                                 element.count,
                                 "",
                                 {},
                                 element.name,
                                 ""});
  }

  void vertices(Body& body, const Element& element) {
    enum Role : std::size_t { x, y, z, nx, ny, nz, red, green, blue, alpha, u, v, role_count };
    static const std::map<std::string_view, std::size_t> kRoles = {{"x", x},
                                                                   {"y", y},
                                                                   {"z", z},
                                                                   {"nx", nx},
                                                                   {"ny", ny},
                                                                   {"nz", nz},
                                                                   {"normal_x", nx},
                                                                   {"normal_y", ny},
                                                                   {"normal_z", nz},
                                                                   {"red", red},
                                                                   {"green", green},
                                                                   {"blue", blue},
                                                                   {"alpha", alpha},
                                                                   {"diffuse_red", red},
                                                                   {"diffuse_green", green},
                                                                   {"diffuse_blue", blue},
                                                                   {"diffuse_alpha", alpha},
                                                                   {"r", red},
                                                                   {"g", green},
                                                                   {"b", blue},
                                                                   {"a", alpha},
                                                                   {"s", u},
                                                                   {"t", v},
                                                                   {"u", u},
                                                                   {"v", v},
                                                                   {"texture_u", u},
                                                                   {"texture_v", v}};
    const std::size_t n = element.count;
    std::array<bool, role_count> has{};
    std::array<double, role_count> scale;
    scale.fill(1);
    std::vector<std::size_t> role(element.properties.size(), role_count);
    for (std::size_t p = 0; p < element.properties.size(); ++p) {
      const Property& property = element.properties[p];
      if (property.list) continue;
      const auto known = kRoles.find(property.name);
      if (known != kRoles.end() && !has[known->second]) {
        role[p] = known->second;
        has[role[p]] = true;
        if (role[p] >= red && role[p] <= alpha) scale[role[p]] = 1.0 / colorScale(property.type);
      } else {
        point_attributes_.push_back({property.name.empty() ? "property" : property.name, 1, {}});
        point_attributes_.back().values.resize(n);
        role[p] = role_count + point_attributes_.size();
      }
    }
    if (!has[x] || !has[y] || !has[z]) throw ReadError("has vertices without x, y and z");
    const bool normals = has[nx] && has[ny] && has[nz];
    const bool colors = has[red] && has[green] && has[blue];
    const bool uvs = has[u] && has[v];
    mesh_.points.resize(n);
    if (normals) point_normals_.resize(n);
    if (colors) point_colors_.resize(n);
    if (uvs) point_uvs_.resize(n);
    std::array<double, role_count> value{};
    value[alpha] = 1;
    for (std::size_t i = 0; i < n; ++i) {
      body.setPlace(&element.name, i);
      for (std::size_t p = 0; p < role.size(); ++p) {
        const Property& property = element.properties[p];
        if (property.list) {
          skipList(body, property);
          continue;
        }
        const double number = body.number(property.type);
        if (role[p] < role_count) {
          value[role[p]] = number * scale[role[p]];
        } else {
          point_attributes_[role[p] - role_count - 1].values[i] = float(number);
        }
      }
      mesh_.points[i] = {value[x], value[y], value[z]};
      if (!mesh_.points[i].allFinite())
        throw ReadError(body.place() + " has a coordinate that is not a finite number",
                        "Repair that vertex in the program that made the file.");
      if (normals) point_normals_[i] = Eigen::Vector3d(value[nx], value[ny], value[nz]).cast<float>();
      if (colors) point_colors_[i] = {float(value[red]), float(value[green]), float(value[blue]), float(value[alpha])};
      if (uvs) point_uvs_[i] = {float(value[u]), float(value[v])};
    }
  }

  void faces(Body& body, const Element& element) {
    mesh_.face_size.reserve(mesh_.face_size.size() + element.count);
    corners_.reserve(corners_.size() + 3 * element.count);
    std::vector<float> wedge;
    std::string lists;
    for (const Property& p : element.properties)
      if (p.list) lists += (lists.empty() ? "" : ", ") + quotable(p.name);
    if (element.count > 0 && std::none_of(element.properties.begin(), element.properties.end(), isCorners))
      throw ReadError(
          "has faces without a list vertex_indices" + (lists.empty() ? "" : " (their lists: " + lists + ")"),
          "If another list holds the corners, name it vertex_indices in the header.");
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body.setPlace(&element.name, i);
      const std::size_t start = corners_.size();
      wedge.clear();
      for (const Property& p : element.properties) {
        if (isCorners(p)) {
          const std::uint64_t count = body.listCount(p.count_type);
          for (std::uint64_t k = 0; k < count; ++k) corners_.push_back(corner(body, body.number(p.type)));
        } else if (p.list && p.name == "texcoord") {
          const std::uint64_t count = body.listCount(p.count_type);
          for (std::uint64_t k = 0; k < count; ++k) wedge.push_back(float(body.number(p.type)));
        } else if (p.list) {
          skipList(body, p);
        } else {
          body.number(p.type);
        }
      }
      const std::size_t size = corners_.size() - start;
      if (wedge.size() == 2 * size)
        for (std::size_t k = 0; k < size; ++k) {
          corners_[start + k].uv = wedgeUv({wedge[2 * k], wedge[2 * k + 1]});
        }
      closeFace(start);
    }
  }

  /// Equal wedge UVs of neighbouring faces are one UV, so that only true seams split vertices.
  std::uint32_t wedgeUv(const Eigen::Vector2f& uv) {
    const auto [at, fresh] = wedge_by_value_.try_emplace(
        {std::bit_cast<std::uint32_t>(uv.x()), std::bit_cast<std::uint32_t>(uv.y())}, std::uint32_t(wedge_uvs_.size()));
    if (fresh) wedge_uvs_.push_back(uv);
    return at->second;
  }

  void strips(Body& body, const Element& element) {
    for (std::uint64_t i = 0; i < element.count; ++i) {
      body.setPlace(&element.name, i);
      for (const Property& p : element.properties) {
        if (!isCorners(p)) {
          if (p.list) {
            skipList(body, p);
          } else {
            body.number(p.type);
          }
          continue;
        }
        const std::uint64_t count = body.listCount(p.count_type);
        RawCorner a;
        RawCorner b;
        std::uint64_t length = 0;
        for (std::uint64_t k = 0; k < count; ++k) {
          const double index = body.number(p.type);
          if (index < 0) {  // -1 ends a strip
            length = 0;
            continue;
          }
          const RawCorner c = corner(body, index);
          if (++length >= 3) {
            const std::size_t start = corners_.size();
            corners_.insert(corners_.end(), length % 2 == 1 ? std::initializer_list<RawCorner>{a, b, c}
                                                            : std::initializer_list<RawCorner>{b, a, c});
            closeFace(start);
          }
          a = b;
          b = c;
        }
      }
    }
  }

  RawCorner corner(const Body& body, double index) const {
    if (!(index >= 0 && index < double(vertex_count_)))
      throw ReadError(body.place() + " names vertex " + std::to_string(std::int64_t(std::clamp(index, -9e15, 9e15))) +
                      " of " + std::to_string(vertex_count_));
    return {std::uint32_t(index), formats::kNone, formats::kNone};
  }

  void closeFace(std::size_t start) {
    const std::size_t size = corners_.size() - start;
    if (size < 3) {
      corners_.resize(start);
      ++small_faces_;
    }
    mesh_.face_size.push_back(size < 3 ? 0 : std::uint32_t(size));
  }

  void finish() {
    if (small_faces_ > 0)
      scene_.findings.push_back({"degenerate-faces",
                                 Severity::warning,
                                 std::to_string(small_faces_) + " faces with fewer than three corners were left out",
                                 small_faces_,
                                 "",
                                 {},
                                 "",
                                 "Remove them in the program that made the file."});
    if (!wedge_uvs_.empty()) {
      joinCorners(corners_, wedge_uvs_, {}, mesh_);
    } else {
      // Without wedges a vertex is a point: keep the file's own numbers.
      mesh_.vertex_point.resize(mesh_.points.size());
      for (std::uint32_t v = 0; v < mesh_.vertex_point.size(); ++v) mesh_.vertex_point[v] = v;
      mesh_.corners.resize(corners_.size());
      std::transform(corners_.begin(), corners_.end(), mesh_.corners.begin(),
                     [](const RawCorner& c) { return c.point; });
    }
    const auto spread = [&](const auto& from, auto& to) {
      if (from.empty()) return;
      to.resize(mesh_.vertex_point.size());
      for (std::size_t v = 0; v < to.size(); ++v) to[v] = from[mesh_.vertex_point[v]];
    };
    spread(point_normals_, mesh_.normals);
    spread(point_colors_, mesh_.colors);
    if (mesh_.uvs.empty()) spread(point_uvs_, mesh_.uvs);
    for (AttributeSource& attribute : point_attributes_) {
      AttributeSource spread_out{attribute.name, 1, {}};
      spread(attribute.values, spread_out.values);
      spread_out.values.resize(mesh_.vertex_point.size());
      mesh_.attributes.push_back(std::move(spread_out));
    }
    if (!texture_.empty()) {
      scene_.textures.push_back({texture_, texture_, {}});
      RawMaterial material;
      material.name = stem_;
      material.base_color = {1, 1, 1, 1};
      material.texture = 0;
      scene_.materials.push_back(material);
      mesh_.parts[0].material = 0;
    }
    scene_.meshes.push_back(std::move(mesh_));
  }

  std::string stem_;
  RawScene scene_;
  RawMesh mesh_;
  std::vector<Element> elements_;
  std::string_view body_;
  bool text_ = true;
  bool swap_ = false;
  std::string texture_;
  std::string unknown_;  // the first line of the header that no PLY has
  std::uint64_t unknown_lines_ = 0;
  std::uint64_t vertex_count_ = 0;
  std::vector<RawCorner> corners_;
  std::vector<Eigen::Vector3f> point_normals_;
  std::vector<Eigen::Vector2f> point_uvs_;
  std::vector<Eigen::Vector2f> wedge_uvs_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> wedge_by_value_;
  std::vector<std::array<float, 4>> point_colors_;
  std::vector<AttributeSource> point_attributes_;
  std::uint64_t small_faces_ = 0;
};

}  // namespace

RawScene readPly(std::string_view bytes, const std::string& stem) { return PlyReader(bytes, stem).read(); }

}  // namespace sinew::tools
