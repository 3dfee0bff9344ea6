// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <map>
#include <unordered_map>

#include "tools/core/text.h"
#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

/// Statements of an OBJ that say nothing about faces, and those of curves and free-form surfaces. `call` and `csh` are
/// none of them: without what they bring in, the model is not whole.
constexpr std::string_view kUnused[] = {
    "bevel",    "bmat",       "bsp", "bzp",   "c_interp", "cdc",       "cdp",  "con",    "cstype", "ctech",
    "d_interp", "deg",        "end", "hole",  "lod",      "maplib",    "mg",   "parm",   "res",    "s",
    "scrv",     "shadow_obj", "sp",  "stech", "step",     "trace_obj", "trim", "usemap", "vp"};

constexpr std::uint64_t kMaxLibraryBytes = 64U << 20;

std::string lineOf(const TextCursor& cursor) { return "line " + std::to_string(cursor.line()); }

/// A texture statement of a material library: options begin with `-` and take a known number of words; what is left is
/// the file's name, which may hold blanks.
std::string textureName(std::string_view rest) {
  static const std::map<std::string_view, int> kOptionWords = {
      {"-blendu", 1}, {"-blendv", 1}, {"-boost", 1}, {"-bm", 1}, {"-cc", 1},     {"-clamp", 1}, {"-imfchan", 1},
      {"-mm", 2},     {"-o", 3},      {"-s", 3},     {"-t", 3},  {"-texres", 1}, {"-type", 1}};
  TextCursor words(rest);
  while (true) {
    words.skipBlanks();
    const std::string_view left = words.rest();
    if (!left.starts_with('-')) break;
    const std::string_view option = words.word();
    const auto known = kOptionWords.find(option);
    if (known == kOptionWords.end()) return std::string(left);  // a name that begins with a dash
    for (int k = 0; k < known->second; ++k) {
      const std::string_view before = words.rest();
      const std::string_view word = words.word();
      // -o, -s and -t take one to three numbers.
      if (known->second == 3 && k > 0 && !parseNumber(word)) {
        words = TextCursor(before);
        break;
      }
    }
  }
  return std::string(words.lineRest());
}

class ObjReader {
 public:
  ObjReader(std::string_view text, const std::filesystem::path& folder, const std::string& stem)
      // Zero bytes may fill up the end.
      : cursor_(text.substr(0, text.find_last_not_of('\0') + 1), true), folder_(folder), stem_(stem) {
    text = text_ = cursor_.rest();
    if (text.substr(0, 4096).find('\0') != text.npos)
      throw ReadError("is no OBJ: it holds zero bytes where text belongs");
    mesh_.name = stem;
  }

  RawScene read() {
    while (!cursor_.atEnd()) {
      statement();
      cursor_.nextLine();
    }
    finish();
    return std::move(scene_);
  }

 private:
  void statement() {
    const std::string_view key = cursor_.word();
    if (key == "#MRGB") return paint();
    if (key.empty() || key.front() == '#') return;
    if (key == "v") {
      position();
    } else if (key == "vt") {
      const std::size_t n = numbers(3, true);
      uvs_.push_back(n >= 1 ? Eigen::Vector2f(float(number_[0]), n >= 2 ? float(number_[1]) : 0.0F)
                            : Eigen::Vector2f(0, 0));
    } else if (key == "vn") {
      const std::size_t n = numbers(3, true);
      normals_.push_back(n == 3 ? Eigen::Vector3d(number_[0], number_[1], number_[2]).cast<float>()
                                : Eigen::Vector3f(0, 0, 0));
    } else if (key == "f" || key == "fo") {
      face();
    } else if (key == "g") {
      groups();
    } else if (key == "o") {
      object(std::string(cursor_.lineRest()));
    } else if (key == "usemtl") {
      material_ = materialNumber(std::string(cursor_.lineRest()));
      part_ = formats::kNone;
    } else if (key == "mtllib") {
      library(std::string(cursor_.lineRest()));
    } else if (key == "l" || key == "p") {
      ++lines_;
    } else if (key == "curv" || key == "curv2" || key == "surf") {
      ++curves_;
    } else if (std::find(std::begin(kUnused), std::end(kUnused), key) == std::end(kUnused)) {
      const bool capital = capitals_.empty() && (key == "V" || key == "F");
      if (unknown_lines_++ > 0 && !capital) return;
      const std::string line =
          "\"" + quotable(key) + " " + quotable(cursor_.lineRest()) + "\" (" + lineOf(cursor_) + ")";
      if (unknown_lines_ == 1) unknown_ = line;
      if (capital) capitals_ = line;
    }
  }

  /// Of what has no points or no faces: says what it looks like, where that can be told.
  void refuseOther() const {
    if (unknown_lines_ == 0) return;
    if (const std::string other = formatOfText(text_); !other.empty() && other != "OBJ") throw looksLike(other, "OBJ");
    if (!capitals_.empty())
      throw ReadError("has its statements in capital letters: " + capitals_, "Write them small: v, vt, vn, f.");
  }

  /// Reads the numbers up to the line's end into number_.
  /// \param forgive what is no number is NaN, as of normals and UVs, which are made anew where they are not finite.
  std::size_t numbers(std::size_t most, bool forgive = false) {
    std::size_t n = 0;
    while (n < most) {
      const std::string_view word = cursor_.wordBeforeComment();
      if (word.empty()) break;
      const auto value = parseNumber(word);
      if (!value && !forgive) throw noNumber("", word, " (" + lineOf(cursor_) + ")");
      number_[n++] = value.value_or(std::numeric_limits<double>::quiet_NaN());
    }
    return n;
  }

  /// ZBrush's colours of vertices: eight hexadecimal digits each, MMRRGGBB, 64 in a line.
  void paint() {
    std::string_view digits = cursor_.word();
    for (; digits.size() >= 8; digits.remove_prefix(8)) {
      std::uint32_t rgb = 0;
      const auto [stop, error] = std::from_chars(digits.data() + 2, digits.data() + 8, rgb, 16);
      if (error != std::errc() || stop != digits.data() + 8) return;
      const auto channel = [&](int shift) { return float(rgb >> shift & 255U) / 255; };
      painted_.push_back({channel(16), channel(8), channel(0), 1.0F});
    }
  }

  void position() {
    const std::size_t n = numbers(8);
    const auto name = [&] { return "vertex " + std::to_string(mesh_.points.size()) + " (" + lineOf(cursor_) + ")"; };
    if (n < 3) throw ReadError(name() + " has " + std::to_string(n) + " coordinates instead of 3");
    const Eigen::Vector3d p(number_[0], number_[1], number_[2]);
    if (!p.allFinite())
      throw ReadError(name() + " has a coordinate that is not a finite number",
                      "Repair that vertex in the program that made the file.");
    mesh_.points.push_back(p);
    if (n >= 6) {
      if (colors_.empty()) colors_.assign(mesh_.points.size() - 1, {0, 0, 0, 0});
      colors_.push_back({float(number_[3]), float(number_[4]), float(number_[5]), n >= 7 ? float(number_[6]) : 1.0F});
    } else if (!colors_.empty()) {
      colors_.push_back({0, 0, 0, 0});
    }
  }

  /// An index as written, 1-based or counted back from the end, to a 0-based one that may still be out of range.
  static std::int64_t resolve(std::int64_t written, std::size_t count) {
    return written > 0 ? written - 1 : written < 0 ? std::int64_t(count) + written : -1;
  }

  void face() {
    const std::size_t start = corners_.size();
    while (true) {
      const std::string_view word = cursor_.wordBeforeComment();
      if (word.empty()) break;
      std::array<std::int64_t, 3> index = {0, 0, 0};
      std::size_t field = 0;
      for (std::string_view left = word; field < 3; ++field) {
        const std::size_t slash = left.find('/');
        const std::string_view digits = left.substr(0, slash);
        if (!digits.empty()) {
          const auto value = parseInteger(digits);
          if (!value || *value == 0)
            throw ReadError("has \"" + std::string(word.substr(0, 40)) + "\" where a face's corner belongs (" +
                            lineOf(cursor_) + ")");
          index[field] = *value;
        }
        if (slash == left.npos) break;
        left.remove_prefix(slash + 1);
      }
      const std::int64_t point = resolve(index[0], mesh_.points.size());
      if (index[0] == 0 || point < 0 || point > std::int64_t(formats::kNone) - 1)
        throw ReadError("face " + std::to_string(face_number_) + " names vertex " + std::to_string(index[0]) +
                        ", which does not exist (" + lineOf(cursor_) + ")");
      // Later statements may still define what this one names, so the upper bound is checked at the end.
      const auto optional = [](std::int64_t written, std::size_t count) {
        if (written == 0) return formats::kNone;
        const std::int64_t at = resolve(written, count);
        return at < 0 || at > std::int64_t(formats::kNone) - 1 ? formats::kNone - 1 : std::uint32_t(at);
      };
      corners_.push_back({std::uint32_t(point), optional(index[1], uvs_.size()), optional(index[2], normals_.size())});
      highest_point_ = std::max(highest_point_, std::uint64_t(point) + 1);
      if (highest_point_ == std::uint64_t(point) + 1) highest_line_ = cursor_.line(), highest_face_ = face_number_;
    }
    const std::size_t size = corners_.size() - start;
    if (part_ == formats::kNone) part_ = partNumber();
    if (group_set_ == formats::kNone && !group_names_.empty()) group_set_ = groupSetNumber();
    if (size < 3) {  // keeps its number
      corners_.resize(start);
      small_faces_.push_back(face_number_);
    }
    ++face_number_;
    mesh_.face_size.push_back(size < 3 ? 0 : std::uint32_t(size));
    mesh_.face_part.push_back(part_);
    mesh_.face_groups.push_back(group_set_);
  }

  void groups() {
    group_names_.clear();
    group_set_ = formats::kNone;
    while (!cursor_.atLineEnd()) group_names_.emplace_back(cursor_.word());
  }

  void object(std::string name) {
    const std::uint32_t first = std::uint32_t(mesh_.points.size());
    if (mesh_.ranges.empty() && first > 0) mesh_.ranges.push_back({stem_, 0, first});
    closeRange();
    mesh_.ranges.push_back({name.empty() ? stem_ : name, first, 0});
    object_ = std::move(name);
    part_ = formats::kNone;
  }
  void closeRange() {
    if (mesh_.ranges.empty()) return;
    SourceMeshRange& last = mesh_.ranges.back();
    last.source_vertex_count = std::uint32_t(mesh_.points.size()) - last.first_source_vertex;
    if (last.source_vertex_count == 0) mesh_.ranges.pop_back();
  }

  std::uint32_t materialNumber(const std::string& name) {
    if (name.empty()) return formats::kNone;
    const auto [at, fresh] = material_by_name_.try_emplace(name, std::uint32_t(scene_.materials.size()));
    if (fresh) {
      RawMaterial material;
      material.name = name;
      scene_.materials.push_back(material);
      material_known_.push_back(false);
    }
    return at->second;
  }

  std::uint32_t partNumber() {
    const auto [at, fresh] = part_by_key_.try_emplace({object_, material_}, std::uint32_t(mesh_.parts.size()));
    if (fresh) mesh_.parts.push_back({object_.empty() ? stem_ : object_, material_});
    return at->second;
  }

  std::uint32_t groupSetNumber() {
    std::vector<std::uint32_t> set;
    for (const std::string& name : group_names_) {
      const auto [at, fresh] = group_by_name_.try_emplace(name, std::uint32_t(scene_.groups.size()));
      if (fresh) scene_.groups.push_back(name);
      if (std::find(set.begin(), set.end(), at->second) == set.end()) set.push_back(at->second);
    }
    const auto [at, fresh] = group_set_by_groups_.try_emplace(set, std::uint32_t(scene_.group_sets.size()));
    if (fresh) scene_.group_sets.push_back(set);
    return at->second;
  }

  void library(const std::string& names) {
    if (names.empty()) return;
    if (auto text = readCompanionFile(folder_, names, kMaxLibraryBytes)) {
      materials(*text);
      return;
    }
    // Several names in one statement, or one name with blanks that is missing.
    TextCursor words(names);
    bool all = true;
    bool several = false;
    while (!words.atLineEnd()) {
      const std::string name(words.word());
      several = several || name != names;
      auto text = readCompanionFile(folder_, name, kMaxLibraryBytes);
      if (text) {
        materials(*text);
      } else {
        all = false;
      }
    }
    if ((!all || !several) && std::find(missing_.begin(), missing_.end(), names) == missing_.end()) {
      missing_.push_back(names);
    }
  }

  // One finding, however many materials lack their library.
  void reportUnknown(const std::vector<std::string>& materials) {
    const auto listed = [](const std::vector<std::string>& names) {
      constexpr std::size_t kMost = 8;
      std::string text;
      for (std::size_t i = 0; i < std::min(names.size(), kMost); ++i) text += (i == 0 ? "" : ", ") + names[i];
      return names.size() > kMost ? text + " and " + std::to_string(names.size() - kMost) + " more" : text;
    };
    const std::string many = std::to_string(materials.size()) + (materials.size() == 1 ? " material" : " materials");
    Finding finding;
    if (!missing_.empty()) {
      finding.id = "missing-material-library";
      finding.count = std::max<std::size_t>(materials.size(), 1);
      finding.message = (missing_.size() == 1 ? "the material library " : "the material libraries ") +
                        listed(missing_) + (missing_.size() == 1 ? " is missing" : " are missing");
      if (!materials.empty()) finding.message += ": " + many + " of default colour (" + listed(materials) + ")";
      finding.place = listed(missing_);
      finding.cure = "Put the file beside the OBJ.";
    } else if (!materials.empty()) {
      finding.id = "missing-material";
      finding.count = materials.size();
      finding.message = "no material library defines " + many + "; default colour";
      finding.place = listed(materials);
      finding.cure = "Put the material library beside the OBJ.";
    } else {
      return;
    }
    scene_.findings.push_back(finding);
  }

  void materials(std::string_view text) {
    TextCursor lines(text, true);
    std::uint32_t current = formats::kNone;
    for (; !lines.atEnd(); lines.nextLine()) {
      const std::string key = lowerCase(lines.word());
      if (key == "newmtl") {
        current = materialNumber(std::string(lines.lineRest()));
        if (current != formats::kNone) material_known_[current] = true;
      } else if (current != formats::kNone && key == "kd") {
        std::array<double, 3> rgb = {0.8, 0.8, 0.8};
        std::size_t n = 0;
        while (n < 3 && !lines.atLineEnd()) {
          const auto value = parseNumber(lines.word());
          if (!value || !std::isfinite(*value)) break;
          rgb[n++] = *value;
        }
        if (n == 1) rgb[1] = rgb[2] = rgb[0];
        for (std::size_t k = 0; k < 3 && n > 0; ++k) scene_.materials[current].base_color[k] = float(rgb[k]);
      } else if (current != formats::kNone && (key == "d" || key == "tr")) {
        const auto value = parseNumber(lines.word());
        if (value && std::isfinite(*value))
          scene_.materials[current].base_color[3] = float(key == "d" ? *value : 1.0 - *value);
      } else if (current != formats::kNone && key == "map_kd") {
        const std::string path = textureName(lines.lineRest());
        if (path.empty()) continue;
        const auto [at, fresh] = texture_by_path_.try_emplace(path, std::uint32_t(scene_.textures.size()));
        if (fresh) scene_.textures.push_back({path, path, {}});
        scene_.materials[current].texture = at->second;
      }
    }
  }

  void finish() {
    if (mesh_.points.empty() || mesh_.face_size.empty()) refuseOther();
    if (highest_point_ > mesh_.points.size())
      throw ReadError("face " + std::to_string(highest_face_) + " names vertex " + std::to_string(highest_point_) +
                      " of " + std::to_string(mesh_.points.size()) + " (line " + std::to_string(highest_line_) + ")");
    closeRange();
    if (!mesh_.ranges.empty() && mesh_.ranges.front().first_source_vertex > 0)
      mesh_.ranges.insert(mesh_.ranges.begin(), {stem_, 0, mesh_.ranges.front().first_source_vertex});
    std::uint64_t bad_indices = 0;
    for (RawCorner& corner : corners_) {
      if (corner.uv != formats::kNone && corner.uv >= uvs_.size()) corner.uv = formats::kNone, ++bad_indices;
      if (corner.normal != formats::kNone && corner.normal >= normals_.size())
        corner.normal = formats::kNone, ++bad_indices;
    }
    if (bad_indices > 0)
      scene_.findings.push_back(
          {"bad-uv-or-normal-index",
           Severity::warning,
           std::to_string(bad_indices) + " face corners name a UV or normal that does not exist; they have none",
           bad_indices,
           "",
           {},
           "",
           "Export the file again."});
    joinCorners(corners_, uvs_, normals_, mesh_);
    colorsFromBytes(colors_);
    if (colors_.empty() && painted_.size() == mesh_.points.size()) colors_ = std::move(painted_);
    if (!colors_.empty()) {
      mesh_.colors.resize(mesh_.vertex_point.size());
      for (std::size_t v = 0; v < mesh_.colors.size(); ++v) mesh_.colors[v] = colors_[mesh_.vertex_point[v]];
    }
    if (scene_.group_sets.empty()) mesh_.face_groups.clear();
    dropUnusedMaterials();
    const auto dropped = [&](std::uint64_t count, const char* what) {
      if (count > 0)
        scene_.findings.push_back({"dropped-primitives",
                                   Severity::info,
                                   std::to_string(count) + " " + what + " were left out; only faces are used",
                                   count,
                                   "",
                                   {},
                                   "",
                                   ""});
    };
    dropped(lines_, "line and point statements");
    dropped(curves_, "curve and free-form surface statements");
    if (unknown_lines_ > 0)
      scene_.findings.push_back(
          skippedLines("unknown-statement", unknown_lines_, "", "is known of an OBJ", unknown_, "#"));
    if (!small_faces_.empty()) {
      Finding finding{
          "degenerate-faces",
          Severity::warning,
          std::to_string(small_faces_.size()) + " face statements with fewer than three corners were left out",
          small_faces_.size(),
          "face",
          small_faces_,
          "",
          "Remove them in the program that made the file."};
      finding.places.resize(std::min(finding.places.size(), Finding::kMaxPlaces));
      scene_.findings.push_back(finding);
    }
    scene_.meshes.push_back(std::move(mesh_));
  }

  /// A library may serve many files: materials no face uses do not belong to this mesh, nor do their textures.
  void dropUnusedMaterials() {
    std::vector<bool> used(scene_.materials.size(), false);
    for (const RawPart& part : mesh_.parts)
      if (part.material != formats::kNone) used[part.material] = true;
    std::vector<std::string> unknown;
    std::vector<RawMaterial> materials;
    std::vector<RawTexture> textures;
    std::vector<std::uint32_t> material_to(scene_.materials.size(), formats::kNone);
    std::vector<std::uint32_t> texture_to(scene_.textures.size(), formats::kNone);
    for (std::size_t m = 0; m < used.size(); ++m) {
      if (!used[m]) continue;
      RawMaterial material = scene_.materials[m];
      if (!material_known_[m]) unknown.push_back(material.name);
      if (material.texture != formats::kNone) {
        std::uint32_t& to = texture_to[material.texture];
        if (to == formats::kNone) {
          to = std::uint32_t(textures.size());
          textures.push_back(scene_.textures[material.texture]);
        }
        material.texture = to;
      }
      material_to[m] = std::uint32_t(materials.size());
      materials.push_back(std::move(material));
    }
    for (RawPart& part : mesh_.parts)
      if (part.material != formats::kNone) part.material = material_to[part.material];
    scene_.materials = std::move(materials);
    scene_.textures = std::move(textures);
    reportUnknown(unknown);
  }

  TextCursor cursor_;
  std::string_view text_;
  std::filesystem::path folder_;
  std::string stem_;
  RawScene scene_;
  RawMesh mesh_;
  std::array<double, 8> number_{};
  std::vector<Eigen::Vector2f> uvs_;
  std::vector<Eigen::Vector3f> normals_;
  std::vector<std::array<float, 4>> colors_;
  std::vector<std::array<float, 4>> painted_;
  std::vector<RawCorner> corners_;
  std::vector<std::string> group_names_;
  std::vector<std::uint32_t> small_faces_;
  std::string object_;
  std::uint32_t material_ = formats::kNone;
  std::uint32_t part_ = formats::kNone;
  std::uint32_t group_set_ = formats::kNone;
  std::uint32_t face_number_ = 0;
  std::uint64_t highest_point_ = 0;
  std::uint64_t highest_line_ = 0;
  std::uint32_t highest_face_ = 0;
  std::uint64_t lines_ = 0;
  std::uint64_t curves_ = 0;
  std::uint64_t unknown_lines_ = 0;
  std::string unknown_, capitals_;  // the first of them, the first that would be read if it were small
  std::map<std::pair<std::string, std::uint32_t>, std::uint32_t> part_by_key_;
  std::map<std::vector<std::uint32_t>, std::uint32_t> group_set_by_groups_;
  std::unordered_map<std::string, std::uint32_t> group_by_name_;
  std::unordered_map<std::string, std::uint32_t> material_by_name_;
  std::unordered_map<std::string, std::uint32_t> texture_by_path_;
  std::vector<bool> material_known_;
  std::vector<std::string> missing_;  // material libraries
};

}  // namespace

RawScene readObj(std::string_view text, const std::filesystem::path& folder, const std::string& stem) {
  return ObjReader(text, folder, stem).read();
}

}  // namespace sinew::tools
