// SPDX-License-Identifier: MIT
#include "sinew/formats/writer.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string_view>

#include "section_rules.h"
#include "sinew/formats/checksum.h"
#include "sinew/formats/version.h"

namespace sinew::formats {
namespace {

struct Payload {
  const void* data = nullptr;
  std::size_t count = 0;
};

template <class T>
Payload payload(const std::vector<T>& items) {
  return {items.data(), items.size()};
}

Payload payloadOf(const PackageContent& content, std::uint32_t id) {
  switch (id) {
    case section::info:
      return {&content.info, 1};
    case section::strings:
      return payload(content.strings);
    case section::pieces:
      return payload(content.pieces);
    case section::physical_vertices:
      return payload(content.physical_vertices);
    case section::tetrahedra:
      return payload(content.tetrahedra);
    case section::clusters:
      return payload(content.clusters);
    case section::memberships:
      return payload(content.memberships);
    case section::quadratic_moments:
      return payload(content.quadratic_moments);
    case section::mechanics:
      return payload(content.mechanics);
    case section::curve_points:
      return payload(content.curve_points);
    case section::channels:
      return payload(content.channels);
    case section::vertex_stiffness:
      return payload(content.vertex_stiffness);
    case section::pin_weights:
      return payload(content.pin_weights);
    case section::pin_sets:
      return payload(content.pin_sets);
    case section::pin_set_vertices:
      return payload(content.pin_set_vertices);
    case section::parts:
      return payload(content.parts);
    case section::part_vertices:
      return payload(content.part_vertices);
    case section::visual_positions:
      return payload(content.visual_positions);
    case section::visual_normals:
      return payload(content.visual_normals);
    case section::visual_uv:
      return payload(content.visual_uvs);
    case section::visual_colors:
      return payload(content.visual_colors);
    case section::visual_triangles:
      return payload(content.visual_triangles);
    case section::sub_meshes:
      return payload(content.sub_meshes);
    case section::materials:
      return payload(content.materials);
    case section::textures:
      return payload(content.textures);
    case section::texture_bytes:
      return payload(content.texture_bytes);
    case section::barycentric:
      return payload(content.barycentric);
    case section::cluster_attachment_ranges:
      return payload(content.cluster_attachment_ranges);
    case section::cluster_attachments:
      return payload(content.cluster_attachments);
    case section::visual_identity:
      return payload(content.visual_identity);
    case section::source_identity:
      return payload(content.source_identity);
    case section::source_visual_list:
      return payload(content.source_visual_list);
    case section::source_meshes:
      return payload(content.source_meshes);
    case section::groups:
      return payload(content.groups);
    case section::group_vertices:
      return payload(content.group_vertices);
    case section::masks:
      return payload(content.masks);
    case section::mask_weights:
      return payload(content.mask_weights);
    case section::fields:
      return payload(content.fields);
    case section::field_functions:
      return payload(content.field_functions);
    case section::field_packs:
      return payload(content.field_packs);
    case section::field_gradients:
      return payload(content.field_gradients);
    case section::field_values:
      return payload(content.field_values);
    case section::field_points:
      return payload(content.field_points);
    case section::field_point_values:
      return payload(content.field_point_values);
    case section::field_modes:
      return payload(content.field_modes);
    case section::field_fibres:
      return payload(content.field_fibres);
    case section::field_fibre_values:
      return payload(content.field_fibre_values);
    case section::field_tethers:
      return payload(content.field_tethers);
    case section::field_tether_values:
      return payload(content.field_tether_values);
    case section::distance_grids:
      return payload(content.distance_grids);
    case section::distance_values:
      return payload(content.distance_values);
    default:
      return {};
  }
}

}  // namespace

StringRef PackageContent::addText(std::string_view text) {
  if (text.empty()) return {0, 0};
  // Of many names (a source can have a hundred thousand groups) only the first are searched for parts of themselves.
  constexpr std::size_t kSearched = 65536;
  const std::string_view pool{strings.data(), std::min(strings.size(), kSearched)};
  std::size_t offset = pool.find(text);
  if (offset == std::string_view::npos) {
    const auto known = texts_behind.find(text);
    if (known != texts_behind.end()) return known->second;
    offset = strings.size();
    if (text.size() > std::numeric_limits<std::uint32_t>::max() - offset) {
      throw std::length_error("the texts of a package exceed 4 GiB");
    }
    strings.insert(strings.end(), text.begin(), text.end());
    if (strings.size() > kSearched) {
      texts_behind.emplace(text,
                           StringRef{static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(text.size())});
    }
  }
  return {static_cast<std::uint32_t>(offset), static_cast<std::uint32_t>(text.size())};
}

std::vector<std::byte> writePackage(const PackageContent& content) {
  struct Part {
    const SectionRule* rule;
    Payload payload;
  };
  std::vector<Part> parts;
  Header header{};
  header.magic = kMagic;
  header.format_version = kFormatVersion;
  header.header_bytes = sizeof(Header);
  for (const SectionRule& rule : kSectionRules) {
    const Payload part = payloadOf(content, rule.id);
    if (part.count == 0) continue;
    parts.push_back({&rule, part});
    header.features |= rule.feature;
  }
  header.section_count = static_cast<std::uint32_t>(parts.size());
  const std::size_t table_bytes = parts.size() * sizeof(SectionEntry);
  std::uint64_t end = alignedSize(sizeof(Header) + table_bytes);
  for (const Part& part : parts) end += alignedSize(part.payload.count * part.rule->element_bytes);
  header.total_bytes = end;

  std::vector<std::byte> bytes(end);  // zeros, so padding is zero
  const std::span<std::byte> all{bytes};
  std::uint64_t offset = alignedSize(sizeof(Header) + table_bytes);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto& [rule, part] = parts[i];
    SectionEntry entry{};
    entry.id = rule->id;
    entry.flags = rule->flags;
    entry.offset = offset;
    entry.bytes = part.count * rule->element_bytes;
    entry.element_count = part.count;
    entry.element_bytes = rule->element_bytes;
    std::memcpy(bytes.data() + offset, part.data, entry.bytes);
    entry.checksum = checksum(all.subspan(offset, alignedSize(entry.bytes)));
    std::memcpy(bytes.data() + sizeof(Header) + i * sizeof(SectionEntry), &entry, sizeof entry);
    offset += alignedSize(entry.bytes);
  }
  header.checksum = checksum(std::as_bytes(std::span{&header, 1}), all.subspan(sizeof(Header), table_bytes));
  std::memcpy(bytes.data(), &header, sizeof header);
  return bytes;
}

}  // namespace sinew::formats
