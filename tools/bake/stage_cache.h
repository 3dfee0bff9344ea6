// SPDX-License-Identifier: GPL-3.0-or-later
//
// A bake's store of its slow stages, so that the next one does again only what changed
// (docs/decisions/0009-bake-cache.md).
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "tools/attach/attach.h"
#include "tools/field/field.h"
#include "tools/import/visual_mesh.h"
#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

/// A 128-bit content address.
using StageKey = std::array<std::uint64_t, 2>;

/// The address of what a stage reads: these bytes, this very program and the libraries it runs with.
StageKey stageKey(const std::vector<std::byte>& inputs);

/// Everything that the tetrahedra of a mesh, and the places of its vertices on them, depend on: the mesh's geometry and
/// names, the settings of the stage, and this very program with the libraries it runs with.
/// \param mesh what is to be filled. Its texture coordinates, normals, colours, materials and file name do not count.
StageKey tetrahedraKey(const VisualMesh& mesh, const TetrahedraOptions& options);

/// A value as bytes, both ways. A struct is taken apart by structured bindings (fields() below), so one that gets a
/// field no longer compiles here until the field is kept too.
class StageWriter {
 public:
  template <class T>
  void operator()(T& value);
  void raw(const void* data, std::size_t size) {
    if (size == 0) return;
    const std::size_t end = bytes_.size();
    bytes_.resize(end + size);
    std::memcpy(bytes_.data() + end, data, size);
  }
  std::vector<std::byte> take() { return std::move(bytes_); }
  static constexpr bool kReads = false;

 private:
  std::vector<std::byte> bytes_;
};

class StageReader {
 public:
  explicit StageReader(std::span<const std::byte> bytes) : bytes_(bytes) {}
  template <class T>
  void operator()(T& value);
  /// Throws std::runtime_error where the bytes end early.
  void raw(void* data, std::size_t size) {
    if (size > bytes_.size()) throw std::runtime_error("ends early");
    if (size > 0) std::memcpy(data, bytes_.data(), size);
    bytes_ = bytes_.subspan(size);
  }
  std::size_t left() const { return bytes_.size(); }
  static constexpr bool kReads = true;

 private:
  std::span<const std::byte> bytes_;
};

/// A folder of finished stages, each under its key. Whatever is wrong with the folder or an entry, a bake goes on
/// without: an entry that is cut short or damaged is found by its checksum and made again, a folder that cannot be
/// written is no cache. Several programs may use one folder at once. Holds at most kMostBytes; what was not used for
/// longest goes first. Safe to delete at any time.
class StageCache {
 public:
  static constexpr std::uint64_t kMostBytes = 1ULL << 30;

  /// \param folder made when something is stored; empty: no cache.
  explicit StageCache(std::filesystem::path folder, std::uint64_t most_bytes = kMostBytes)
      : folder_(std::move(folder)), most_bytes_(most_bytes) {}
  /// The user's: $XDG_CACHE_HOME/sinew, else $HOME/.cache/sinew; none where neither is an absolute path.
  static std::filesystem::path userFolder();

  /// One stage of this bake.
  struct Stage {
    std::string name;
    bool from_cache = false;
    double seconds_saved = 0;  ///< what making it had cost, less what reading it did
  };
  const std::vector<Stage>& stages() const { return stages_; }
  std::uint32_t damaged() const { return damaged_; }  ///< entries found damaged, and made again
  const std::filesystem::path& folder() const { return folder_; }

  /// The stage's value: read, or made and stored.
  template <class Make>
  auto get(const std::string& stage, const StageKey& key, const Make& make) -> decltype(make()) {
    if (auto kept = find<decltype(make())>(stage, key)) return std::move(*kept);
    const Clock start;
    decltype(make()) value = make();
    stages_.push_back({stage, false, 0});
    keep(stage, key, value, start.seconds());
    return value;
  }
  bool has(const std::string& stage, const StageKey& key) const;
  /// The stage's value where it is there.
  template <class Value>
  std::optional<Value> find(const std::string& stage, const StageKey& key) {
    const Clock start;
    double cost = 0;
    std::vector<std::byte> bytes;
    if (!load(stage, key, bytes, cost)) return {};
    try {
      std::optional<Value> value(std::in_place);
      StageReader reader(bytes);
      reader(*value);
      if (reader.left() == 0) {
        stages_.push_back({stage, true, cost - start.seconds()});
        return value;
      }
    } catch (const std::exception&) {
      // Only a program that is not the one its key names can have written this.
    }
    ++damaged_;
    return {};
  }
  /// Stores a value. \param cost what making it took, s
  template <class Value>
  void keep(const std::string& stage, const StageKey& key, Value& value, double cost) const {
    if (folder_.empty()) return;
    StageWriter writer;
    writer(value);
    store(stage, key, writer.take(), cost);
  }

 private:
  class Clock {
   public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

   private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  };

  bool load(const std::string& stage, const StageKey& key, std::vector<std::byte>& bytes, double& cost);
  void store(const std::string& stage, const StageKey& key, const std::vector<std::byte>& bytes, double cost) const;
  std::filesystem::path entry(const std::string& stage, const StageKey& key) const;
  void prune() const;

  std::filesystem::path folder_;
  std::uint64_t most_bytes_;
  std::vector<Stage> stages_;
  std::uint32_t damaged_ = 0;
};

// ---- How each type is taken apart ----

template <class Archive>
void fields(Archive& archive, TetrahedraOptions& value) {
  auto& [method, target_vertices, join_distance, shell_thickness, shell_factors] = value;
  archive(method), archive(target_vertices), archive(join_distance), archive(shell_thickness);
  archive(shell_factors);
}
template <class Archive>
void fields(Archive& archive, SubMeshSource& value) {
  auto& [node, mesh, material, first_triangle, triangle_count] = value;
  archive(node), archive(mesh), archive(material), archive(first_triangle), archive(triangle_count);
}
template <class Archive>
void fields(Archive& archive, Finding& value) {
  auto& [id, severity, message, count, place_kind, places, place, cure] = value;
  archive(id), archive(severity), archive(message), archive(count), archive(place_kind), archive(places);
  archive(place), archive(cure);
}
template <class Archive>
void fields(Archive& archive, PhysicalPiece& value) {
  auto& [name, method, parts, first_vertex, vertex_count, first_tetrahedron, tetrahedron_count, volume, source, ties] =
      value;
  archive(name), archive(method), archive(parts), archive(first_vertex), archive(vertex_count);
  archive(first_tetrahedron), archive(tetrahedron_count), archive(volume), archive(source);
  archive(ties);
}
template <class Archive>
void fields(Archive& archive, TetrahedraQuality& value) {
  auto& [min_dihedral_deg, max_dihedral_deg, inverted] = value;
  archive(min_dihedral_deg), archive(max_dihedral_deg), archive(inverted);
}
template <class Archive>
void fields(Archive& archive, PhysicalMesh& value) {
  auto& [positions, tetrahedra, fill, pieces, quality, part_piece, home, findings] = value;
  archive(positions), archive(tetrahedra), archive(fill), archive(pieces), archive(quality), archive(part_piece);
  archive(home), archive(findings);
}
template <class Archive>
void fields(Archive& archive, TetrahedronPlace& value) {
  auto& [tetrahedron, weights, distance] = value;
  archive(tetrahedron), archive(weights), archive(distance);
}

template <class Archive>
void fields(Archive& archive, FieldSample& value) {
  auto& [at, volume, mu, lambda, gradients, patch] = value;
  archive(at), archive(volume), archive(mu), archive(lambda), archive(gradients), archive(patch);
}
template <class Archive>
void fields(Archive& archive, FieldSpace& value) {
  auto& [values, stiffness, damping_hz, one, rest, driven, pin_set, monomial, samples, compliance, tethers, modes,
         locals, young_scale, lowest_hz, static_error, gravity_error, least_eigenvalue] = value;
  archive(values), archive(stiffness), archive(damping_hz), archive(one), archive(rest), archive(driven);
  archive(pin_set), archive(monomial), archive(samples), archive(compliance), archive(tethers), archive(modes);
  archive(locals), archive(young_scale), archive(lowest_hz), archive(static_error), archive(gravity_error);
  archive(least_eigenvalue);
}
template <class Archive>
void fields(Archive& archive, Fields& value) {
  auto& [free, held] = value;
  bool is_held = held.has_value();
  archive(free), archive(is_held);
  if constexpr (Archive::kReads) {
    if (is_held) held.emplace();
  }
  if (is_held) archive(*held);
}

namespace stage_detail {

template <class T>
struct IsVector : std::false_type {};
template <class T>
struct IsVector<std::vector<T>> : std::true_type {};
// Values whose bytes are all there is of them; vectors of these go as one block.
template <class T>
struct IsPlain : std::bool_constant<std::is_arithmetic_v<T> || std::is_enum_v<T>> {};
template <class T, std::size_t kCount>
struct IsPlain<std::array<T, kCount>> : IsPlain<T> {};
template <>
struct IsPlain<Eigen::Vector3d> : std::true_type {};
template <class T>
struct IsMatrix : std::false_type {};
template <int kRows, int kColumns>
struct IsMatrix<Eigen::Matrix<double, kRows, kColumns>> : std::bool_constant<kRows == Eigen::Dynamic> {};

template <class Archive, class T>
void archive(Archive& archive, T& value) {
  if constexpr (IsPlain<T>::value) {
    archive.raw(&value, sizeof value);
  } else if constexpr (IsMatrix<T>::value) {
    std::array<std::uint64_t, 2> size = {std::uint64_t(value.rows()), std::uint64_t(value.cols())};
    archive.raw(&size, sizeof size);
    if constexpr (Archive::kReads) {
      const std::uint64_t most = archive.left() / sizeof(double);
      if (size[1] > 0 && size[0] > most / size[1]) throw std::runtime_error("ends early");
      value.resize(Eigen::Index(size[0]), Eigen::Index(size[1]));
    }
    archive.raw(value.data(), std::size_t(value.size()) * sizeof(double));
  } else if constexpr (IsVector<T>::value || std::is_same_v<T, std::string>) {
    std::uint64_t size = value.size();
    archive.raw(&size, sizeof size);
    using Element = typename T::value_type;
    if constexpr (Archive::kReads) {
      if (size > archive.left()) throw std::runtime_error("ends early");  // an element has at least a byte
      value.resize(std::size_t(size));
    }
    if constexpr (IsPlain<Element>::value) {
      archive.raw(value.data(), value.size() * sizeof(Element));
    } else {
      for (Element& element : value) archive(element);
    }
  } else {
    fields(archive, value);
  }
}

}  // namespace stage_detail

template <class T>
void StageWriter::operator()(T& value) {
  stage_detail::archive(*this, value);
}
template <class T>
void StageReader::operator()(T& value) {
  stage_detail::archive(*this, value);
}

}  // namespace sinew::tools
