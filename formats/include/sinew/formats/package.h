// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/sections.h"

namespace sinew::formats {

/// The reason of a refusal, one line that names the section and its fault; empty: none.
struct PackageError {
  std::string reason;
};

/// An entry of the section table, its bytes as the file has them; `known`: this software reads it.
struct SectionInfo {
  std::uint32_t id;
  std::uint64_t bytes;
  std::uint64_t element_count;
  bool known, packed;
};

/// Place and number of the elements of a section.
struct SectionData {
  const void* data = nullptr;
  std::size_t count = 0;
  std::uint32_t bytes_each = 0;
};

/// The four characters of a section's id; bytes that do not print as \xHH.
[[nodiscard]] std::string sectionName(std::uint32_t id);

/// A checked, read-only view of a package's bytes. Every span points into the bytes given to open(), but those of
/// packed sections, which are unpacked into memory of the view's.
///
/// Guarantee: after open() succeeded, every span is aligned for its type, every index in every section is inside the
/// section it refers to, every count adds up, and every float is finite where the format says so; code that uses the
/// view needs no checks of its own. Optional sections that are absent give empty spans.
class PackageView {
 public:
  PackageView() = default;

  /// Checks the whole package: size, magic, version, checksums (all bytes), table, counts, indices, values.
  /// \param bytes the whole file, 64-byte aligned (a memory map or an aligned allocation); must outlive the view.
  /// \param[out] view set only on success.
  /// \return an empty reason on success. Throws std::bad_alloc only. Cost: one pass, 1 ms for 10 MB, 2 ms of fields.
  [[nodiscard]] static PackageError open(std::span<const std::byte> bytes, PackageView& view);

  std::uint64_t features() const { return features_; }
  std::uint32_t formatVersion() const { return format_version_; }
  std::uint64_t totalBytes() const { return total_bytes_; }
  std::span<const SectionInfo> sections() const { return sections_; }

  /// Text of a reference; safe for every StringRef inside this package.
  std::string_view text(StringRef ref) const { return {strings().data() + ref.offset, ref.bytes}; }

  /// The elements of a section. Absent: a count of 0. Unknown to this software: also 0 bytes each.
  SectionData sectionData(std::uint32_t id) const;

  const PackageInfo& info() const { return list<PackageInfo, section::info>().front(); }
  std::span<const PieceRange> pieces() const { return list<PieceRange, section::pieces>(); }
  std::span<const PhysicalVertex> physicalVertices() const {
    return list<PhysicalVertex, section::physical_vertices>();
  }
  std::span<const Tetrahedron> tetrahedra() const { return list<Tetrahedron, section::tetrahedra>(); }
  std::span<const Cluster> clusters() const { return list<Cluster, section::clusters>(); }
  std::span<const Membership> memberships() const { return list<Membership, section::memberships>(); }
  std::span<const QuadraticMoment> quadraticMoments() const {
    return list<QuadraticMoment, section::quadratic_moments>();
  }
  std::span<const ClusterMechanics> mechanics() const { return list<ClusterMechanics, section::mechanics>(); }
  std::span<const CurvePoint> curvePoints() const { return list<CurvePoint, section::curve_points>(); }
  std::span<const ActivationChannel> channels() const { return list<ActivationChannel, section::channels>(); }
  std::span<const float> vertexStiffness() const { return list<float, section::vertex_stiffness>(); }
  std::span<const float> pinWeights() const { return list<float, section::pin_weights>(); }
  std::span<const PinSet> pinSets() const { return list<PinSet, section::pin_sets>(); }
  std::span<const std::uint32_t> pinSetVertices() const { return list<std::uint32_t, section::pin_set_vertices>(); }
  std::span<const AttachedPart> parts() const { return list<AttachedPart, section::parts>(); }
  std::span<const std::uint32_t> partVertices() const { return list<std::uint32_t, section::part_vertices>(); }
  std::span<const Float3> visualPositions() const { return list<Float3, section::visual_positions>(); }
  std::span<const Float3> visualNormals() const { return list<Float3, section::visual_normals>(); }
  std::span<const Float2> visualUvs() const { return list<Float2, section::visual_uv>(); }
  std::span<const Color8> visualColors() const { return list<Color8, section::visual_colors>(); }
  std::span<const Triangle> visualTriangles() const { return list<Triangle, section::visual_triangles>(); }
  std::span<const SubMesh> subMeshes() const { return list<SubMesh, section::sub_meshes>(); }
  std::span<const Material> materials() const { return list<Material, section::materials>(); }
  std::span<const Texture> textures() const { return list<Texture, section::textures>(); }
  std::span<const std::byte> textureBytes() const { return list<std::byte, section::texture_bytes>(); }
  std::span<const BarycentricAttachment> barycentric() const {
    return list<BarycentricAttachment, section::barycentric>();
  }
  std::span<const ClusterAttachmentRange> clusterAttachmentRanges() const {
    return list<ClusterAttachmentRange, section::cluster_attachment_ranges>();
  }
  std::span<const ClusterAttachment> clusterAttachments() const {
    return list<ClusterAttachment, section::cluster_attachments>();
  }
  std::span<const VisualIdentity> visualIdentity() const { return list<VisualIdentity, section::visual_identity>(); }
  std::span<const SourceIdentity> sourceIdentity() const { return list<SourceIdentity, section::source_identity>(); }
  std::span<const std::uint32_t> sourceVisualList() const { return list<std::uint32_t, section::source_visual_list>(); }
  std::span<const SourceMesh> sourceMeshes() const { return list<SourceMesh, section::source_meshes>(); }
  std::span<const Group> groups() const { return list<Group, section::groups>(); }
  std::span<const std::uint32_t> groupVertices() const { return list<std::uint32_t, section::group_vertices>(); }
  std::span<const Mask> masks() const { return list<Mask, section::masks>(); }
  std::span<const MaskWeight> maskWeights() const { return list<MaskWeight, section::mask_weights>(); }
  /// Of all levels of detail, those of level 0 first. Indices of fields count among these.
  std::span<const Field> allFields() const { return list<Field, section::fields>(); }
  /// Those of level 0.
  std::span<const Field> fields() const {
    const auto all = allFields();
    std::size_t count = 0;
    while (count < all.size() && all[count].level == 0) ++count;
    return all.first(count);
  }
  std::span<const FieldFunction> fieldFunctions() const { return list<FieldFunction, section::field_functions>(); }
  std::span<const FieldPack> fieldPacks() const { return list<FieldPack, section::field_packs>(); }
  std::span<const Lanes> fieldGradients() const { return list<Lanes, section::field_gradients>(); }
  std::span<const Lanes> fieldValues() const { return list<Lanes, section::field_values>(); }
  std::span<const FieldPoint> fieldPoints() const { return list<FieldPoint, section::field_points>(); }
  std::span<const FieldFibre> fieldFibres() const { return list<FieldFibre, section::field_fibres>(); }
  std::span<const float> fieldFibreValues() const { return list<float, section::field_fibre_values>(); }
  std::span<const FieldTethers> fieldTethers() const { return list<FieldTethers, section::field_tethers>(); }
  std::span<const float> fieldTetherValues() const { return list<float, section::field_tether_values>(); }
  std::span<const FieldResidual> fieldResiduals() const { return list<FieldResidual, section::field_residuals>(); }
  std::span<const std::int16_t> fieldResidualValues() const {
    return list<std::int16_t, section::field_residual_values>();
  }
  std::span<const float> fieldResidualLocals() const { return list<float, section::field_residual_locals>(); }
  std::span<const DistanceGrid> distanceGrids() const { return list<DistanceGrid, section::distance_grids>(); }
  std::span<const std::int16_t> distanceValues() const { return list<std::int16_t, section::distance_values>(); }
  std::span<const Lanes> fieldModes() const { return list<Lanes, section::field_modes>(); }
  std::span<const Lanes> fieldPointValues() const { return list<Lanes, section::field_point_values>(); }

 private:
  friend class PackageReader;
  struct List {
    const void* data = nullptr;
    std::size_t count = 0;
  };
  template <class T, std::uint32_t kId>
  std::span<const T> list() const {
    constexpr std::size_t kIndex = section::indexOf(kId);
    return {static_cast<const T*>(lists_[kIndex].data), lists_[kIndex].count};
  }
  std::span<const char> strings() const { return list<char, section::strings>(); }

  std::uint64_t features_ = 0;
  std::uint32_t format_version_ = 0;
  std::uint64_t total_bytes_ = 0;
  std::vector<SectionInfo> sections_;
  std::array<List, section::kAll.size()> lists_;  // in the order of section::kAll
  std::vector<std::shared_ptr<const std::byte>> unpacked_;
};

}  // namespace sinew::formats
