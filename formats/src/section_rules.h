// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "sinew/formats/sections.h"

namespace sinew::formats {

/// How an element is stored where its section is packed, part by part: indices in 2 or 3 bytes, plain numbers in 4, and
/// a block of numbers with one exponent, in 2 bytes each. All 0: never packed.
struct Packing {
  std::uint8_t indices = 0, plain = 0, block = 0;

  constexpr bool possible() const { return indices + plain + block > 0; }
  /// Bytes of a packed element. \param width of an index.
  constexpr std::uint32_t bytes(std::uint32_t width) const {
    return indices * width + plain * 4U + (block > 0 ? 2U + block * 2U : 0U);
  }
};

/// The format's rule for a section, whatever it holds. Reader and writer share this table.
struct SectionRule {
  std::uint32_t id;
  std::uint32_t element_bytes;
  std::uint32_t flags;    ///< every entry of this id carries exactly these
  bool always_present;    ///< a package without it is refused
  std::uint64_t feature;  ///< the bit of Header::features that is set exactly when the section is there; 0 = none
  Packing packing{};      ///< without it a section is never packed
};

/// In the order of section::kAll.
inline constexpr std::array<SectionRule, section::kAll.size()> kSectionRules = {{
    {section::info, sizeof(PackageInfo), kSectionRequired, true, 0},
    {section::strings, 1, kSectionRequired, false, 0},
    {section::pieces, sizeof(PieceRange), kSectionRequired, true, 0},
    {section::physical_vertices, sizeof(PhysicalVertex), kSectionRequired, true, 0},
    {section::tetrahedra, sizeof(Tetrahedron), kSectionRequired, false, kFeatureTetrahedra, {4, 0, 0}},
    {section::clusters, sizeof(Cluster), kSectionRequired, true, 0},
    {section::memberships, sizeof(Membership), kSectionRequired, true, 0, {1, 2, 0}},
    {section::quadratic_moments, sizeof(QuadraticMoment), kSectionRequired, false, kFeatureQuadratic},
    {section::mechanics, sizeof(ClusterMechanics), kSectionRequired, false, kFeatureMechanics},
    {section::curve_points, sizeof(CurvePoint), kSectionRequired, false, 0},
    {section::channels, sizeof(ActivationChannel), kSectionRequired, false, kFeatureActivation},
    {section::vertex_stiffness, sizeof(float), kSectionRequired, false, kFeatureVertexStiffness},
    {section::pin_weights, sizeof(float), kSectionRequired, false, kFeaturePinWeights},
    {section::pin_sets, sizeof(PinSet), 0, false, 0},
    {section::pin_set_vertices, sizeof(std::uint32_t), 0, false, 0, {1, 0, 0}},
    {section::parts, sizeof(AttachedPart), 0, false, 0},
    {section::part_vertices, sizeof(std::uint32_t), 0, false, 0, {1, 0, 0}},
    {section::visual_positions, sizeof(Float3), kSectionRequired, false, kFeatureVisual, {0, 0, 3}},
    {section::visual_normals, sizeof(Float3), 0, false, 0, {0, 0, 3}},
    {section::visual_uv, sizeof(Float2), 0, false, 0, {0, 0, 2}},
    {section::visual_colors, sizeof(Color8), 0, false, 0},
    {section::visual_triangles, sizeof(Triangle), kSectionRequired, false, kFeatureVisual, {3, 0, 0}},
    {section::sub_meshes, sizeof(SubMesh), 0, false, 0},
    {section::materials, sizeof(Material), 0, false, 0},
    {section::textures, sizeof(Texture), 0, false, kFeatureTextures},
    {section::texture_bytes, 1, 0, false, 0},
    {section::barycentric, sizeof(BarycentricAttachment), kSectionRequired, false, kFeatureBarycentric, {1, 0, 3}},
    {section::cluster_attachment_ranges,
     sizeof(ClusterAttachmentRange),
     kSectionRequired,
     false,
     kFeatureClusterAttachment,
     {2, 0, 0}},
    {section::cluster_attachments,
     sizeof(ClusterAttachment),
     kSectionRequired,
     false,
     kFeatureClusterAttachment,
     {1, 1, 0}},
    {section::visual_identity, sizeof(VisualIdentity), 0, false, kFeatureIdentity, {2, 0, 0}},
    {section::source_identity, sizeof(SourceIdentity), 0, false, kFeatureIdentity, {3, 0, 0}},
    {section::source_visual_list, sizeof(std::uint32_t), 0, false, kFeatureIdentity, {1, 0, 0}},
    {section::source_meshes, sizeof(SourceMesh), 0, false, kFeatureIdentity},
    {section::groups, sizeof(Group), 0, false, kFeatureGroups},
    {section::group_vertices, sizeof(std::uint32_t), 0, false, 0, {1, 0, 0}},
    {section::masks, sizeof(Mask), 0, false, 0},
    {section::mask_weights, sizeof(MaskWeight), 0, false, 0, {1, 1, 0}},
    {section::fields, sizeof(Field), kSectionRequired, false, kFeatureField},
    {section::field_functions, sizeof(FieldFunction), kSectionRequired, false, kFeatureField},
    {section::field_packs, sizeof(FieldPack), kSectionRequired, false, kFeatureField},
    {section::field_gradients, sizeof(Lanes), kSectionRequired, false, kFeatureField, {0, 0, 8}},
    {section::field_values, sizeof(Lanes), kSectionRequired, false, kFeatureField, {0, 0, 8}},
    {section::field_points, sizeof(FieldPoint), kSectionRequired, false, 0},
    {section::field_point_values, sizeof(Lanes), kSectionRequired, false, 0, {0, 0, 8}},
    {section::field_modes, sizeof(Lanes), kSectionRequired, false, kFeatureField, {0, 0, 8}},
    {section::field_fibres, sizeof(FieldFibre), kSectionRequired, false, 0},
    {section::field_fibre_values, sizeof(float), kSectionRequired, false, 0},
    {section::field_tethers, sizeof(FieldTethers), kSectionRequired, false, 0},
    {section::field_tether_values, sizeof(float), kSectionRequired, false, 0},
    {section::field_residuals, sizeof(FieldResidual), 0, false, 0},
    {section::field_residual_values, sizeof(std::int16_t), 0, false, 0},
    {section::field_residual_locals, sizeof(float), 0, false, 0},
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
    const SectionRule& rule = kSectionRules[i];
    if (rule.id != section::kAll[i]) return false;
    const Packing& packing = rule.packing;
    if (packing.possible() && 4U * std::uint32_t(packing.indices + packing.plain + packing.block) != rule.element_bytes)
      return false;
  }
  return true;
}());

/// `bytes` rounded up to the next multiple of kSectionAlignment; `bytes` at most 2^64 - 64.
constexpr std::uint64_t alignedSize(std::uint64_t bytes) {
  return (bytes + (kSectionAlignment - 1)) & ~std::uint64_t{kSectionAlignment - 1};
}

}  // namespace sinew::formats
