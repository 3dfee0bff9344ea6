// SPDX-License-Identifier: MIT
#include "sinew/formats/package.h"

#include <array>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>

#include "packing.h"
#include "reach.h"
#include "refusal.h"
#include "section_rules.h"
#include "sinew/formats/checksum.h"
#include "sinew/formats/version.h"
#include "value_rules.h"
#include "value_tests.h"

namespace sinew::formats {

std::string sectionName(std::uint32_t id) { return SectionName(id).text; }

/// Fills a PackageView from hostile bytes. Each step relies on the ones before it: frame (header, table, checksums,
/// tiling), then the sections' presence, then every value in them. A step returns false once refuse_ has a reason.
class PackageReader {
 public:
  PackageReader(std::span<const std::byte> bytes, PackageView& view) : bytes_(bytes), view_(view) {}

  bool read() {
    if (!(readHeader() && readTable() && checkPresence() && readInfo() && checkTexts() && checkInfo())) return false;
    const Reach reach(view_.info());
    return checkPhysical(view_, reach, refuse_) && checkVisual(view_, reach, refuse_) &&
           checkFields(view_, reach, refuse_);
  }

  const char* reason() const { return refuse_.reason(); }

 private:
  bool readHeader() {
    if (bytes_.size() < sizeof(Header)) {
      return refuse_("not a package, or cut short: %zu bytes, the header alone has %zu", bytes_.size(), sizeof(Header));
    }
    if ((std::bit_cast<std::uintptr_t>(bytes_.data()) & (kSectionAlignment - 1)) != 0) {
      return refuse_("the bytes are not aligned to 64 in memory (a mistake of the calling program)");
    }
    std::memcpy(&header_, bytes_.data(), sizeof header_);
    if (header_.magic != kMagic) return refuse_("not a Sinew package (the first 8 bytes are not its magic)");
    if (header_.format_version != kFormatVersion) {
      return refuse_("format version %u, but this software (%s) reads version %u%s", unsigned(header_.format_version),
                     kSoftwareVersion, unsigned(kFormatVersion),
                     (header_.format_version > kFormatVersion ? ": use a newer version" : ": bake the package again"));
    }
    if (header_.header_bytes != sizeof(Header)) {
      return refuse_("header: header_bytes is %u, must be %zu", unsigned(header_.header_bytes), sizeof(Header));
    }
    if (header_.total_bytes != bytes_.size()) {
      return refuse_("header: the package says it has %" PRIu64 " bytes, but it has %zu%s",
                     std::uint64_t(header_.total_bytes), bytes_.size(),
                     (header_.total_bytes > bytes_.size() ? " (cut short)" : " (something was appended)"));
    }
    if (header_.reserved0 != 0 || header_.reserved1 != std::array<std::uint64_t, 2>{}) {
      return refuse_("header: a reserved field is not 0");
    }
    if (header_.section_count > (bytes_.size() - sizeof(Header)) / sizeof(SectionEntry)) {
      return refuse_("header: a table of %u sections does not fit the file", unsigned(header_.section_count));
    }
    Header unsummed = header_;
    unsummed.checksum = 0;
    const auto table = bytes_.subspan(sizeof(Header), header_.section_count * sizeof(SectionEntry));
    if (checksum(std::as_bytes(std::span{&unsummed, 1}), table) != header_.checksum) {
      return refuse_("header: checksum does not match (header or section table damaged)");
    }
    return true;
  }

  bool readTable() {
    view_.sections_.reserve(header_.section_count);
    std::uint64_t expected_offset = alignedSize(sizeof(Header) + header_.section_count * sizeof(SectionEntry));
    for (std::size_t i = 0; i < header_.section_count; ++i) {
      SectionEntry entry;
      std::memcpy(&entry, bytes_.data() + sizeof(Header) + i * sizeof(SectionEntry), sizeof entry);
      if (!readEntry(entry, expected_offset)) return false;
      expected_offset += alignedSize(entry.bytes);
    }
    if (expected_offset != bytes_.size()) {
      return refuse_("section table: the sections end at byte %" PRIu64 ", the file at %zu", expected_offset,
                     bytes_.size());
    }
    return true;
  }

  bool readEntry(const SectionEntry& entry, std::uint64_t expected_offset) {
    const std::uint32_t id = entry.id;
    if (entry.offset != expected_offset) return refuse_(id, "does not start where the section before it ends");
    // expected_offset <= size holds before every entry, so the subtraction cannot wrap, nor alignedSize() after it.
    const std::uint64_t room = bytes_.size() - expected_offset;
    if (entry.bytes > room || alignedSize(entry.bytes) > room) return refuse_(id, "reaches beyond the end of the file");
    if (entry.element_count == 0 || entry.element_bytes == 0) return refuse_(id, "has no elements");
    if (entry.element_count > entry.bytes / entry.element_bytes ||
        entry.element_count * entry.element_bytes != entry.bytes) {
      return refuse_(id, "its bytes are not its number of elements times their size");
    }
    if (entry.reserved0 != 0 || entry.reserved1 != std::array<std::uint64_t, 2>{}) {
      return refuse_(id, "a reserved field of its table entry is not 0");
    }
    const auto padded = bytes_.subspan(entry.offset, alignedSize(entry.bytes));
    if (checksum(padded) != entry.checksum) return refuse_(id, "checksum does not match (damaged)");
    for (const std::byte byte : padded.subspan(entry.bytes)) {
      if (byte != std::byte{0}) return refuse_(id, "the padding behind it is not 0");
    }

    const std::size_t rule_index = section::indexOf(id);
    const bool known = rule_index < kSectionRules.size();
    view_.sections_.push_back({id, entry.bytes, entry.element_count, known, (entry.flags & kSectionPacked) != 0});
    if (!known) {
      if ((entry.flags & kSectionRequired) == 0) return true;
      return refuse_.section(id, "required, but unknown to this software (%s): use a newer version", kSoftwareVersion);
    }
    const SectionRule& rule = kSectionRules[rule_index];
    const bool packed = rule.packing.possible() && (entry.flags & kSectionPacked) != 0;
    if (entry.flags != (rule.flags | (packed ? std::uint32_t(kSectionPacked) : 0U))) {
      return refuse_(id, "its flags are not those that the format gives it");
    }
    if (!packed && entry.element_bytes != rule.element_bytes) {
      return refuse_.section(id, "elements of %u bytes, must be %u", unsigned(entry.element_bytes), rule.element_bytes);
    }
    if (entry.element_count >= kNone) return refuse_(id, "more elements than 32-bit indices can name");
    PackageView::List& list = view_.lists_[rule_index];
    if (list.count != 0) return refuse_(id, "occurs twice");
    list = {bytes_.data() + entry.offset, entry.element_count};
    return !packed || unpackSection(entry, rule, list);
  }

  bool unpackSection(const SectionEntry& entry, const SectionRule& rule, PackageView::List& list) {
    const std::uint32_t width = packedWidth(rule.packing, entry.element_bytes);
    if (width == 0) {
      return refuse_.section(rule.id, "packed elements of %u bytes, must be %u or %u", unsigned(entry.element_bytes),
                             rule.packing.bytes(2), rule.packing.bytes(3));
    }
    const auto memory = std::align_val_t(kSectionAlignment);
    std::shared_ptr<std::byte> plain(
        static_cast<std::byte*>(::operator new(entry.element_count* rule.element_bytes, memory)),
        [](std::byte* p) { ::operator delete(p, std::align_val_t(kSectionAlignment)); });
    if (!unpack(rule.packing, width, bytes_.subspan(entry.offset, entry.bytes), plain.get())) {
      return refuse_(rule.id, "an exponent of its packed numbers is outside -111 to 127");
    }
    list.data = plain.get();
    view_.unpacked_.push_back(std::move(plain));
    return true;
  }

  bool has(std::uint32_t id) const { return view_.sectionData(id).count != 0; }

  bool checkPresence() {
    if ((header_.features & ~kKnownFeatures) != 0) {
      return refuse_("header: a feature bit that this software (%s) does not know: use a newer version",
                     kSoftwareVersion);
    }
    for (std::size_t i = 0; i < kSectionRules.size(); ++i) {
      const SectionRule& rule = kSectionRules[i];
      const bool present = view_.lists_[i].count != 0;
      if (rule.always_present && !present) return refuse_(rule.id, "missing, but every package has it");
      if (rule.feature != 0 && present != ((header_.features & rule.feature) != 0)) {
        return refuse_(rule.id, present ? "present, but its feature bit in the header is not set"
                                        : "missing, but its feature bit in the header is set");
      }
    }
    // The first describes items of the second.
    constexpr std::array<std::array<std::uint32_t, 2>, 29> kNeeds = {{
        {section::visual_normals, section::visual_positions},
        {section::visual_uv, section::visual_positions},
        {section::visual_colors, section::visual_positions},
        {section::sub_meshes, section::visual_positions},
        {section::materials, section::visual_positions},
        {section::barycentric, section::visual_positions},
        {section::cluster_attachments, section::visual_positions},
        {section::visual_identity, section::visual_positions},
        {section::groups, section::visual_positions},
        {section::parts, section::visual_positions},
        {section::masks, section::visual_positions},
        {section::curve_points, section::mechanics},
        {section::texture_bytes, section::textures},
        {section::group_vertices, section::groups},
        {section::mask_weights, section::masks},
        {section::pin_set_vertices, section::pin_sets},
        {section::part_vertices, section::parts},
        {section::barycentric, section::tetrahedra},
        {section::field_points, section::fields},
        {section::field_point_values, section::field_points},
        {section::field_fibres, section::fields},
        {section::field_fibre_values, section::field_fibres},
        {section::field_tethers, section::fields},
        {section::field_tether_values, section::field_tethers},
        {section::field_residuals, section::fields},
        {section::field_residual_values, section::field_residuals},
        {section::field_residual_locals, section::field_residuals},
        {section::distance_grids, section::field_points},
        {section::distance_values, section::distance_grids},
    }};
    for (const auto& [id, needed] : kNeeds) {
      if (has(id) && !has(needed)) {
        return refuse_.section(id, "needs section %s, which is missing", SectionName(needed).text);
      }
    }
    if (has(section::visual_positions) && !has(section::barycentric) && !has(section::cluster_attachments)) {
      return refuse_(section::visual_positions, "a visual mesh without an attachment (section ATBC, or ATCR and ATCW)");
    }
    return true;
  }

  bool readInfo() {
    if (view_.sectionData(section::info).count != 1) return refuse_(section::info, "must have exactly one element");
    view_.features_ = header_.features;
    view_.format_version_ = header_.format_version;
    view_.total_bytes_ = header_.total_bytes;
    return true;
  }

  unsigned badText(StringRef ref) const {
    return unsigned(std::uint64_t{ref.offset} + ref.bytes > view_.strings().size());
  }

  // One text of each record of a section. \param offset where in the record.
  bool checkTexts(std::uint32_t id, std::size_t offset, const char* what) {
    const SectionData records = view_.sectionData(id);
    for (std::size_t i = 0; i < records.count; ++i) {
      StringRef ref;
      std::memcpy(&ref, static_cast<const std::byte*>(records.data) + i * records.bytes_each + offset, sizeof ref);
      if (badText(ref) != 0) return refuse_(id, i, what);
    }
    return true;
  }

  bool checkTexts() {
    const PackageInfo& info = view_.info();
    for (const StringRef ref : {info.name, info.tool_version, info.source_file, info.unit_source, info.settings_json}) {
      if (badText(ref) != 0) return refuse_(section::info, "a text lies outside section STRS");
    }
    constexpr std::array<std::array<std::uint32_t, 2>, 11> kNames = {{
        {section::pieces, offsetof(PieceRange, name)},
        {section::clusters, offsetof(Cluster, name)},
        {section::channels, offsetof(ActivationChannel, name)},
        {section::pin_sets, offsetof(PinSet, name)},
        {section::parts, offsetof(AttachedPart, name)},
        {section::sub_meshes, offsetof(SubMesh, name)},
        {section::materials, offsetof(Material, name)},
        {section::textures, offsetof(Texture, name)},
        {section::source_meshes, offsetof(SourceMesh, name)},
        {section::groups, offsetof(Group, name)},
        {section::masks, offsetof(Mask, name)},
    }};
    for (const auto& [id, offset] : kNames) {
      if (!checkTexts(id, offset, "its name lies outside section STRS")) return false;
    }
    return checkTexts(section::textures, offsetof(Texture, mime), "its mime type lies outside section STRS") &&
           checkTexts(section::pin_sets, offsetof(PinSet, target), "its target lies outside section STRS");
  }

  bool checkInfo() {
    const PackageInfo& info = view_.info();
    const auto bad = [this](const char* what) { return refuse_(section::info, what); };
    for (const double value : info.origin) {
      if (!(std::abs(value) <= double(kMostMetres))) return bad("origin is not finite or beyond 1e15");
    }
    if (!(info.metres_per_unit > 0) || !(info.metres_per_unit <= double(kMostNumber))) {
      return bad("metres_per_unit is not above 0 to 1e18");
    }
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float low = info.bounds_min[axis], high = info.bounds_max[axis];
      if (!(low >= -kMostMetres) || !(high <= kMostMetres) || !(low <= high)) {
        return bad("bounds are not in order, not finite or beyond 1e15");
      }
      squared += (double(high) - double(low)) * (double(high) - double(low));
    }
    if (!(info.diagonal > 0) || !(std::abs(double(info.diagonal) - std::sqrt(squared)) <= 1e-3 * std::sqrt(squared))) {
      return bad("diagonal is not above 0, or not that of the bounds");
    }
    if (notPositive(info.total_mass, kMostNumber) != 0) return bad("total_mass is not above 0 to 1e18");
    if (negativeOrBeyond(info.density, kMostNumber) != 0) return bad("density is outside 0 to 1e18");
    if (negativeOrBeyond(info.physical_volume, kMostNumber) != 0) return bad("physical_volume is outside 0 to 1e18");
    if (!(std::fabs(info.source_volume) <= kMostNumber)) return bad("source_volume is not finite or beyond 1e18");
    if (negativeOrBeyond(info.max_rest_error, kMostNumber) != 0) return bad("max_rest_error is outside 0 to 1e18");
    if (!(info.min_dihedral_deg >= 0.0F && info.min_dihedral_deg <= info.max_dihedral_deg &&
          info.max_dihedral_deg <= 180.0F)) {
      return bad("dihedral angles are not in order within 0 to 180");
    }
    if (info.inverted_tetrahedra > view_.tetrahedra().size()) return bad("more inverted tetrahedra than tetrahedra");
    if (info.reserved0 != 0) return bad("a reserved field is not 0");
    return true;
  }

  std::span<const std::byte> bytes_;
  PackageView& view_;
  Header header_{};
  Refusal refuse_;
};

SectionData PackageView::sectionData(std::uint32_t id) const {
  const std::size_t index = section::indexOf(id);
  if (index == lists_.size()) return {};
  return {lists_[index].data, lists_[index].count, kSectionRules[index].element_bytes};
}

PackageError PackageView::open(std::span<const std::byte> bytes, PackageView& view) {
  PackageView candidate;
  PackageReader reader(bytes, candidate);
  if (!reader.read()) return {reader.reason()};
  view = std::move(candidate);
  return {};
}

}  // namespace sinew::formats
