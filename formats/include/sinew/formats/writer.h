// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/sections.h"

namespace sinew::formats {

/// The content of a package, one vector for each section; an empty vector makes no section.
struct PackageContent {
  PackageInfo info{};
  std::vector<char> strings;
  std::vector<PieceRange> pieces;
  std::vector<PhysicalVertex> physical_vertices;
  std::vector<Tetrahedron> tetrahedra;
  std::vector<Cluster> clusters;
  std::vector<Membership> memberships;
  std::vector<QuadraticMoment> quadratic_moments;
  std::vector<ClusterMechanics> mechanics;
  std::vector<CurvePoint> curve_points;
  std::vector<ActivationChannel> channels;
  std::vector<float> vertex_stiffness, pin_weights;
  std::vector<PinSet> pin_sets;
  std::vector<std::uint32_t> pin_set_vertices;
  std::vector<AttachedPart> parts;
  std::vector<std::uint32_t> part_vertices;
  std::vector<Float3> visual_positions, visual_normals;
  std::vector<Float2> visual_uvs;
  std::vector<Color8> visual_colors;
  std::vector<Triangle> visual_triangles;
  std::vector<SubMesh> sub_meshes;
  std::vector<Material> materials;
  std::vector<Texture> textures;
  std::vector<std::byte> texture_bytes;
  std::vector<BarycentricAttachment> barycentric;
  std::vector<ClusterAttachmentRange> cluster_attachment_ranges;
  std::vector<ClusterAttachment> cluster_attachments;
  std::vector<VisualIdentity> visual_identity;
  std::vector<SourceIdentity> source_identity;
  std::vector<std::uint32_t> source_visual_list;
  std::vector<SourceMesh> source_meshes;
  std::vector<Group> groups;
  std::vector<std::uint32_t> group_vertices;
  std::vector<Mask> masks;
  std::vector<MaskWeight> mask_weights;
  std::vector<Field> fields;
  std::vector<FieldFunction> field_functions;
  std::vector<FieldPack> field_packs;
  std::vector<Lanes> field_gradients, field_values;
  std::vector<FieldPoint> field_points;
  std::vector<Lanes> field_point_values, field_modes;
  std::vector<FieldFibre> field_fibres;
  std::vector<float> field_fibre_values;
  std::vector<FieldTethers> field_tethers;
  std::vector<float> field_tether_values;
  std::vector<FieldResidual> field_residuals;
  std::vector<std::int16_t> field_residual_values;
  std::vector<float> field_residual_locals;
  std::vector<DistanceGrid> distance_grids;
  std::vector<std::int16_t> distance_values;

  /// Appends text to `strings` (equal texts are stored once) and returns its reference.
  StringRef addText(std::string_view text);
  /// Index of addText(): texts that end behind the range of `strings` that it searches.
  std::map<std::string, StringRef, std::less<>> texts_behind;
};

/// The bytes of a package: header, table, sections, checksums. Equal content gives equal bytes.
/// The content is not checked here: open the result with PackageView::open() before saving it.
/// \param packed sections that can be are packed (kSectionPacked).
[[nodiscard]] std::vector<std::byte> writePackage(const PackageContent& content, bool packed = false);
/// The same into memory of the caller's. \param memory is asked once, for so many bytes; whatever they hold.
void writePackage(const PackageContent& content, const std::function<std::byte*(std::size_t)>& memory,
                  bool packed = false);

/// A package's content, to be changed and written anew; sections unknown to this software are left out.
[[nodiscard]] PackageContent contentOf(const PackageView& package);

}  // namespace sinew::formats
