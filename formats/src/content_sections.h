// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

#include "sinew/formats/sections.h"
#include "sinew/formats/writer.h"

namespace sinew::formats {

/// Gives the vector of a section other than INFO to a function, or nothing where the id is unknown.
/// \param content a PackageContent, const or not.
template <class Content, class Use>
void withSection(Content& content, std::uint32_t id, Use use) {
  switch (id) {
    case section::strings:
      return use(content.strings);
    case section::pieces:
      return use(content.pieces);
    case section::physical_vertices:
      return use(content.physical_vertices);
    case section::tetrahedra:
      return use(content.tetrahedra);
    case section::clusters:
      return use(content.clusters);
    case section::memberships:
      return use(content.memberships);
    case section::quadratic_moments:
      return use(content.quadratic_moments);
    case section::mechanics:
      return use(content.mechanics);
    case section::curve_points:
      return use(content.curve_points);
    case section::channels:
      return use(content.channels);
    case section::vertex_stiffness:
      return use(content.vertex_stiffness);
    case section::pin_weights:
      return use(content.pin_weights);
    case section::pin_sets:
      return use(content.pin_sets);
    case section::pin_set_vertices:
      return use(content.pin_set_vertices);
    case section::parts:
      return use(content.parts);
    case section::part_vertices:
      return use(content.part_vertices);
    case section::visual_positions:
      return use(content.visual_positions);
    case section::visual_normals:
      return use(content.visual_normals);
    case section::visual_uv:
      return use(content.visual_uvs);
    case section::visual_colors:
      return use(content.visual_colors);
    case section::visual_triangles:
      return use(content.visual_triangles);
    case section::sub_meshes:
      return use(content.sub_meshes);
    case section::materials:
      return use(content.materials);
    case section::textures:
      return use(content.textures);
    case section::texture_bytes:
      return use(content.texture_bytes);
    case section::barycentric:
      return use(content.barycentric);
    case section::cluster_attachment_ranges:
      return use(content.cluster_attachment_ranges);
    case section::cluster_attachments:
      return use(content.cluster_attachments);
    case section::visual_identity:
      return use(content.visual_identity);
    case section::source_identity:
      return use(content.source_identity);
    case section::source_visual_list:
      return use(content.source_visual_list);
    case section::source_meshes:
      return use(content.source_meshes);
    case section::groups:
      return use(content.groups);
    case section::group_vertices:
      return use(content.group_vertices);
    case section::masks:
      return use(content.masks);
    case section::mask_weights:
      return use(content.mask_weights);
    case section::fields:
      return use(content.fields);
    case section::field_functions:
      return use(content.field_functions);
    case section::field_packs:
      return use(content.field_packs);
    case section::field_gradients:
      return use(content.field_gradients);
    case section::field_values:
      return use(content.field_values);
    case section::field_points:
      return use(content.field_points);
    case section::field_point_values:
      return use(content.field_point_values);
    case section::field_modes:
      return use(content.field_modes);
    case section::field_fibres:
      return use(content.field_fibres);
    case section::field_fibre_values:
      return use(content.field_fibre_values);
    case section::field_tethers:
      return use(content.field_tethers);
    case section::field_tether_values:
      return use(content.field_tether_values);
    case section::field_residuals:
      return use(content.field_residuals);
    case section::field_residual_values:
      return use(content.field_residual_values);
    case section::field_residual_locals:
      return use(content.field_residual_locals);
    case section::distance_grids:
      return use(content.distance_grids);
    case section::distance_values:
      return use(content.distance_values);
    default:
      return;
  }
}

}  // namespace sinew::formats
