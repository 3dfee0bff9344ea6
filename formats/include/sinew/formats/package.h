// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/sections.h"

namespace sinew::formats {

/// Why a package was refused. `reason` names the section and what is wrong with it, in one line.
struct PackageError {
  std::string reason;
};

/// A section as inspect shows it.
struct SectionInfo {
  std::uint32_t id;
  std::uint64_t bytes;
  std::uint64_t element_count;
  bool known;
};

/// The four characters of a section's id; bytes that do not print as \xHH.
[[nodiscard]] std::string sectionName(std::uint32_t id);

/// A checked, read-only view of a package's bytes. Never copies: every span points into the bytes given to open().
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
  /// \return empty reason on success. Never throws but for lack of memory. Cost: one pass, about 1 ms per 10 MB.
  [[nodiscard]] static PackageError open(std::span<const std::byte> bytes, PackageView& view);

  std::uint64_t features() const { return features_; }
  std::uint32_t formatVersion() const { return format_version_; }
  std::uint64_t totalBytes() const { return total_bytes_; }
  std::span<const SectionInfo> sections() const { return sections_; }

  /// Text of a reference; safe for every StringRef inside this package.
  std::string_view text(StringRef ref) const { return {strings_.data() + ref.offset, ref.bytes}; }

  const BodyInfo& info() const { return *info_; }
  std::span<const BodyRange> bodies() const { return bodies_; }
  std::span<const PhysicalVertex> physicalVertices() const { return physical_vertices_; }
  std::span<const Tetrahedron> tetrahedra() const { return tetrahedra_; }
  std::span<const Cluster> clusters() const { return clusters_; }
  std::span<const Membership> memberships() const { return memberships_; }
  std::span<const QuadraticMoment> quadraticMoments() const { return quadratic_moments_; }
  std::span<const ClusterMechanics> mechanics() const { return mechanics_; }
  std::span<const CurvePoint> curvePoints() const { return curve_points_; }
  std::span<const ActivationChannel> channels() const { return channels_; }
  std::span<const float> vertexStiffness() const { return vertex_stiffness_; }
  std::span<const float> pinWeights() const { return pin_weights_; }
  std::span<const PinSet> pinSets() const { return pin_sets_; }
  std::span<const std::uint32_t> pinSetVertices() const { return pin_set_vertices_; }
  std::span<const AttachedPart> parts() const { return parts_; }
  std::span<const std::uint32_t> partVertices() const { return part_vertices_; }
  std::span<const Float3> visualPositions() const { return visual_positions_; }
  std::span<const Float3> visualNormals() const { return visual_normals_; }
  std::span<const Float2> visualUvs() const { return visual_uvs_; }
  std::span<const Color8> visualColors() const { return visual_colors_; }
  std::span<const Triangle> visualTriangles() const { return visual_triangles_; }
  std::span<const SubMesh> subMeshes() const { return sub_meshes_; }
  std::span<const Material> materials() const { return materials_; }
  std::span<const Texture> textures() const { return textures_; }
  std::span<const std::byte> textureBytes() const { return texture_bytes_; }
  std::span<const BarycentricAttachment> barycentric() const { return barycentric_; }
  std::span<const ClusterAttachmentRange> clusterAttachmentRanges() const { return cluster_attachment_ranges_; }
  std::span<const ClusterAttachment> clusterAttachments() const { return cluster_attachments_; }
  std::span<const VisualIdentity> visualIdentity() const { return visual_identity_; }
  std::span<const SourceIdentity> sourceIdentity() const { return source_identity_; }
  std::span<const std::uint32_t> sourceVisualList() const { return source_visual_list_; }
  std::span<const SourceMesh> sourceMeshes() const { return source_meshes_; }
  std::span<const Group> groups() const { return groups_; }
  std::span<const std::uint32_t> groupVertices() const { return group_vertices_; }
  std::span<const Mask> masks() const { return masks_; }
  std::span<const MaskWeight> maskWeights() const { return mask_weights_; }

 private:
  friend class PackageReader;
  std::uint64_t features_ = 0;
  std::uint32_t format_version_ = 0;
  std::uint64_t total_bytes_ = 0;
  std::vector<SectionInfo> sections_;
  std::span<const char> strings_;
  const BodyInfo* info_ = nullptr;
  std::span<const BodyRange> bodies_;
  std::span<const PhysicalVertex> physical_vertices_;
  std::span<const Tetrahedron> tetrahedra_;
  std::span<const Cluster> clusters_;
  std::span<const Membership> memberships_;
  std::span<const QuadraticMoment> quadratic_moments_;
  std::span<const ClusterMechanics> mechanics_;
  std::span<const CurvePoint> curve_points_;
  std::span<const ActivationChannel> channels_;
  std::span<const float> vertex_stiffness_, pin_weights_;
  std::span<const PinSet> pin_sets_;
  std::span<const std::uint32_t> pin_set_vertices_;
  std::span<const AttachedPart> parts_;
  std::span<const std::uint32_t> part_vertices_;
  std::span<const Float3> visual_positions_, visual_normals_;
  std::span<const Float2> visual_uvs_;
  std::span<const Color8> visual_colors_;
  std::span<const Triangle> visual_triangles_;
  std::span<const SubMesh> sub_meshes_;
  std::span<const Material> materials_;
  std::span<const Texture> textures_;
  std::span<const std::byte> texture_bytes_;
  std::span<const BarycentricAttachment> barycentric_;
  std::span<const ClusterAttachmentRange> cluster_attachment_ranges_;
  std::span<const ClusterAttachment> cluster_attachments_;
  std::span<const VisualIdentity> visual_identity_;
  std::span<const SourceIdentity> source_identity_;
  std::span<const std::uint32_t> source_visual_list_;
  std::span<const SourceMesh> source_meshes_;
  std::span<const Group> groups_;
  std::span<const std::uint32_t> group_vertices_;
  std::span<const Mask> masks_;
  std::span<const MaskWeight> mask_weights_;
};

}  // namespace sinew::formats
