// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "sinew/formats/package.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/output.h"
#include "sinew/runtime/result.h"

namespace sinew {

namespace internal {
struct ClusterRest;
struct RestConstants;
struct VisualConstants;
}  // namespace internal

/// A loaded package: the constants that all bodies made from it share. Immutable, so safe to use from many threads.
class SINEW_API Asset {
 public:
  /// Opens and checks a package file (memory-mapped, used in place but for packed sections, which are unpacked into
  /// memory of the asset's). \return an error that names the file and the fault.
  static Result<std::shared_ptr<const Asset>> load(const std::string& path);

  /// The same from memory. Copies: `bytes` may go as soon as this returns.
  static Result<std::shared_ptr<const Asset>> fromMemory(std::span<const std::byte> bytes);

  /// The same from memory, without a copy but of packed sections: for packages in an engine's own archives and maps.
  /// \param bytes the whole package, at an address that is a multiple of 64 (else an error). They are only read, so
  /// they may be write-protected and shared. They must stay unchanged until the asset is gone, which bodies made from
  /// it keep alive: nothing is checked again after this call. \param owner of the bytes, kept as long; null: none.
  static Result<std::shared_ptr<const Asset>> inPlace(std::span<const std::byte> bytes,
                                                      std::shared_ptr<const void> owner = nullptr);

  const formats::PackageView& package() const { return view_; }

  /// The checksum in the file's header, which covers all of its bytes: it tells packages apart.
  std::uint64_t checksum() const { return checksum_; }

  /// Levels of detail that bodies can have (BodySettings::level): 1, the whole, and any that the bake has added.
  std::uint32_t levels() const;

  /// The visual vertices that a sub-mesh's triangles use: runs, ascending. Empty for an unknown sub-mesh.
  std::span<const VertexRun> subMeshVertices(std::uint32_t sub_mesh) const;

  /// Makes now what the first output of a body would make: half a microsecond a visual vertex, for threads that load.
  /// May throw std::bad_alloc.
  void prepareDrawing() const;

  /// For the runtime itself: constants made at load, and those of clusters and outputs, made when first asked for.
  const internal::RestConstants& constants() const { return *constants_; }
  std::span<const internal::ClusterRest> clusterConstants() const;
  const internal::VisualConstants& visualConstants() const;
  std::span<const Vec3> restNormals() const;
  std::span<const std::array<float, 4>> restTangents() const;

  ~Asset();
  Asset(const Asset&) = delete;
  Asset& operator=(const Asset&) = delete;

 private:
  Asset();
  static Result<std::shared_ptr<const Asset>> open(std::shared_ptr<Asset> asset, std::span<const std::byte> bytes);
  formats::PackageView view_;
  std::shared_ptr<const void> owner_;  // of bytes in place
  void* memory_ = nullptr;             // mapped or owned bytes, released by the destructor
  std::size_t bytes_ = 0;
  std::unique_ptr<const internal::RestConstants> constants_;
  struct Lazy;
  std::unique_ptr<Lazy> lazy_;
  bool mapped_ = false;
  std::uint64_t checksum_ = 0;
};

}  // namespace sinew
