// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "sinew/formats/sections.h"

namespace sinew::formats {

/// What the format fixes for a section, whatever it holds. Reader and writer share this table.
struct SectionRule {
  std::uint32_t id;
  std::uint32_t element_bytes;
  std::uint32_t flags;    ///< every entry of this id carries exactly these
  bool always_present;    ///< a package without it is refused
  std::uint64_t feature;  ///< the bit of Header::features that is set exactly when the section is there; 0 = none
};

/// In the order of section::kAll.
inline constexpr std::array<SectionRule, section::kAll.size()> kSectionRules = {{
    {section::info, sizeof(PackageInfo), kSectionRequired, true, 0},
    {section::strings, 1, kSectionRequired, false, 0},
    {section::pieces, sizeof(PieceRange), kSectionRequired, true, 0},
    {section::physical_vertices, sizeof(PhysicalVertex), kSectionRequired, true, 0},
    {section::tetrahedra, sizeof(Tetrahedron), kSectionRequired, false, kFeatureTetrahedra},
    {section::clusters, sizeof(Cluster), kSectionRequired, true, 0},
    {section::memberships, sizeof(Membership), kSectionRequired, true, 0},
    {section::quadratic_moments, sizeof(QuadraticMoment), kSectionRequired, false, kFeatureQuadratic},
    {section::mechanics, sizeof(ClusterMechanics), kSectionRequired, false, kFeatureMechanics},
    {section::curve_points, sizeof(CurvePoint), kSectionRequired, false, 0},
    {section::channels, sizeof(ActivationChannel), kSectionRequired, false, kFeatureActivation},
    {section::vertex_stiffness, sizeof(float), kSectionRequired, false, kFeatureVertexStiffness},
    {section::pin_weights, sizeof(float), kSectionRequired, false, kFeaturePinWeights},
    {section::pin_sets, sizeof(PinSet), 0, false, 0},
    {section::pin_set_vertices, sizeof(std::uint32_t), 0, false, 0},
    {section::parts, sizeof(AttachedPart), 0, false, 0},
    {section::part_vertices, sizeof(std::uint32_t), 0, false, 0},
    {section::visual_positions, sizeof(Float3), kSectionRequired, false, kFeatureVisual},
    {section::visual_normals, sizeof(Float3), 0, false, 0},
    {section::visual_uv, sizeof(Float2), 0, false, 0},
    {section::visual_colors, sizeof(Color8), 0, false, 0},
    {section::visual_triangles, sizeof(Triangle), kSectionRequired, false, kFeatureVisual},
    {section::sub_meshes, sizeof(SubMesh), 0, false, 0},
    {section::materials, sizeof(Material), 0, false, 0},
    {section::textures, sizeof(Texture), 0, false, kFeatureTextures},
    {section::texture_bytes, 1, 0, false, 0},
    {section::barycentric, sizeof(BarycentricAttachment), kSectionRequired, false, kFeatureBarycentric},
    {section::cluster_attachment_ranges, sizeof(ClusterAttachmentRange), kSectionRequired, false,
     kFeatureClusterAttachment},
    {section::cluster_attachments, sizeof(ClusterAttachment), kSectionRequired, false, kFeatureClusterAttachment},
    {section::visual_identity, sizeof(VisualIdentity), 0, false, kFeatureIdentity},
    {section::source_identity, sizeof(SourceIdentity), 0, false, kFeatureIdentity},
    {section::source_visual_list, sizeof(std::uint32_t), 0, false, kFeatureIdentity},
    {section::source_meshes, sizeof(SourceMesh), 0, false, kFeatureIdentity},
    {section::groups, sizeof(Group), 0, false, kFeatureGroups},
    {section::group_vertices, sizeof(std::uint32_t), 0, false, 0},
    {section::masks, sizeof(Mask), 0, false, 0},
    {section::mask_weights, sizeof(MaskWeight), 0, false, 0},
    {section::fields, sizeof(Field), kSectionRequired, false, kFeatureField},
    {section::field_functions, sizeof(FieldFunction), kSectionRequired, false, kFeatureField},
    {section::field_packs, sizeof(FieldPack), kSectionRequired, false, kFeatureField},
    {section::field_gradients, sizeof(Lanes), kSectionRequired, false, kFeatureField},
    {section::field_values, sizeof(Lanes), kSectionRequired, false, kFeatureField},
    {section::field_points, sizeof(FieldPoint), kSectionRequired, false, 0},
    {section::field_point_values, sizeof(Lanes), kSectionRequired, false, 0},
    {section::field_modes, sizeof(Lanes), kSectionRequired, false, kFeatureField},
    {section::field_fibres, sizeof(FieldFibre), kSectionRequired, false, 0},
    {section::field_fibre_values, sizeof(float), kSectionRequired, false, 0},
    {section::field_tethers, sizeof(FieldTethers), kSectionRequired, false, 0},
    {section::field_tether_values, sizeof(float), kSectionRequired, false, 0},
    {section::distance_grids, sizeof(DistanceGrid), 0, false, 0},
    {section::distance_values, sizeof(std::int16_t), 0, false, 0},
}};

inline constexpr std::uint64_t kKnownFeatures = [] {
  std::uint64_t bits = 0;
  for (const SectionRule& rule : kSectionRules) bits |= rule.feature;
  return bits;
}();

static_assert([] {
  for (std::size_t i = 0; i < section::kAll.size(); ++i) {
    if (kSectionRules[i].id != section::kAll[i]) return false;
  }
  return true;
}());

/// `bytes` rounded up to the next multiple of kSectionAlignment; `bytes` at most 2^64 - 64.
constexpr std::uint64_t alignedSize(std::uint64_t bytes) {
  return (bytes + (kSectionAlignment - 1)) & ~std::uint64_t{kSectionAlignment - 1};
}

}  // namespace sinew::formats
