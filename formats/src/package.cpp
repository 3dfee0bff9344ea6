// SPDX-License-Identifier: MIT
#include "sinew/formats/package.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cinttypes>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <limits>
#include <utility>

#include "field_rules.h"
#include "reach.h"
#include "section_rules.h"
#include "sinew/formats/checksum.h"
#include "sinew/formats/version.h"

namespace sinew::formats {
namespace {

// How far sums of rounded weights may lie from 1.
constexpr double kSumTolerance = 1e-3;
// Of radii, in diagonals. Places lie within a diagonal of the bounds, so two of them at most 3 apart along an axis; and
// outputs square a coordinate in a cluster twice: (kMostRadius / kLeastRadius)^4 = 8e37 is a float.
constexpr float kLeastRadius = 1e-9F, kMostRadius = 3;
// Of the inverse of a moment of places within a radius: bakes cut eigenvalues off at 1e-5 of the largest, which is at
// least the farthest member's mu; here that is 1e-7.
constexpr float kMostInverse = 1e12F;
// Of an entry of a pseudo-inverse times its moment, which is a projection: 1, and a tenth for rounding.
constexpr double kMostProjection = 1.1;
// Of a vertex that hangs outside its tetrahedron: floats round such a place by a sixteenth of an edge.
constexpr float kMostWeight = 1e6F;
// Of a unit vector's coordinate, rounded.
constexpr float kMostNormal = 1.001F;

// The tests on values are branch-free (| and & instead of || and &&) so that loops over them vectorize.
template <std::size_t kCount>
unsigned beyond(const std::array<float, kCount>& values, float most) {
  unsigned bad = 0;
  for (const float value : values) bad |= unsigned(!(std::fabs(value) <= most));
  return bad;
}

unsigned notPositive(float value, float most) { return unsigned(!(value > 0.0F)) | unsigned(!(value <= most)); }
unsigned negativeOrBeyond(float value, float most) { return unsigned(!(value >= 0.0F)) | unsigned(!(value <= most)); }
unsigned outsideUnit(float value) { return unsigned(!(value >= 0.0F)) | unsigned(!(value <= 1.0F)); }
unsigned outside(float value, float low, float high) { return unsigned(!(value >= low)) | unsigned(!(value <= high)); }
/// A frequency is at least 0; infinite: rigid.
unsigned noFrequency(float value) {
  return unsigned(!(value >= 0.0F)) | (unsigned(value > kMostNumber) & unsigned(!std::isinf(value)));
}

constexpr std::size_t kAllGood = std::numeric_limits<std::size_t>::max();

/// Index of the first item that `bad` (branch-free, nonzero = bad) rejects, or kAllGood.
template <class T, class Bad>
std::size_t firstBad(std::span<const T> items, Bad bad) {
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (bad(items[i]) != 0) return i;
  }
  return kAllGood;
}

// The name of a section, four times \xHH at most.
struct SectionName {
  explicit SectionName(std::uint32_t id) {
    char* at = text;
    for (unsigned shift = 0; shift < 32; shift += 8) {
      const unsigned byte = (id >> shift) & 0xffU;
      const bool prints = byte > 0x20U && byte < 0x7fU;
      at += std::snprintf(at, 5, prints ? "%c" : "\\x%02x", byte);
    }
  }
  char text[17];
};

}  // namespace

std::string sectionName(std::uint32_t id) { return SectionName(id).text; }

/// Fills a PackageView from hostile bytes. Each step relies on the ones before it: frame (header, table, checksums,
/// tiling), then the sections' presence, then every value in them. A step returns false once reason_ is set.
class PackageReader {
 public:
  PackageReader(std::span<const std::byte> bytes, PackageView& view) : bytes_(bytes), view_(view) {}

  bool read() {
    return readHeader() && readTable() && checkPresence() && readInfo() && checkTexts() && checkInfo() &&
           checkBodies() && checkPhysicalVertices() && checkTetrahedra() && checkClusters() && checkMemberships() &&
           checkMechanics() && checkPinSets() && checkParts() && checkVisualMesh() && checkMaterials() &&
           checkAttachments() && checkIdentity() && checkGroups() && checkMasks() && checkFields();
  }

  const char* reason() const { return reason_; }

 private:
  // Reasons are put together by printf's formats, by these few functions: text built at each of the hundred places
  // that can refuse was half of the reader's code.
  [[gnu::format(printf, 2, 3)]] bool refuse(const char* format, ...) {
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(reason_, sizeof reason_, format, arguments);
    va_end(arguments);
    return false;
  }

  [[gnu::format(printf, 3, 4)]] bool refuseSection(std::uint32_t id, const char* format, ...) {
    char line[256];
    std::va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    return refuse(id, line);
  }

  bool refuse(std::uint32_t id, const char* what) { return refuse("section %s: %s", SectionName(id).text, what); }

  bool refuse(std::uint32_t id, std::size_t element, const char* what) {
    return refuse("section %s, element %zu: %s", SectionName(id).text, element, what);
  }

  /// True when `bad` rejects no item; otherwise sets the reason.
  template <class T, class Bad>
  bool check(std::uint32_t id, std::span<const T> items, const char* what, Bad bad) {
    const std::size_t index = firstBad(items, bad);
    return index == kAllGood || refuse(id, index, what);
  }

  // ---- Frame ----

  bool readHeader() {
    if (bytes_.size() < sizeof(Header)) {
      return refuse("not a package, or cut short: %zu bytes, the header alone has %zu", bytes_.size(), sizeof(Header));
    }
    if ((std::bit_cast<std::uintptr_t>(bytes_.data()) & (kSectionAlignment - 1)) != 0) {
      return refuse("the bytes are not aligned to 64 in memory (a mistake of the calling program)");
    }
    std::memcpy(&header_, bytes_.data(), sizeof header_);
    if (header_.magic != kMagic) return refuse("not a Sinew package (the first 8 bytes are not its magic)");
    if (header_.format_version != kFormatVersion) {
      return refuse("format version %u, but this software (%s) reads version %u%s", unsigned(header_.format_version),
                    kSoftwareVersion, unsigned(kFormatVersion),
                    (header_.format_version > kFormatVersion ? ": use a newer version" : ": bake the package again"));
    }
    if (header_.header_bytes != sizeof(Header)) {
      return refuse("header: header_bytes is %u, must be %zu", unsigned(header_.header_bytes), sizeof(Header));
    }
    if (header_.total_bytes != bytes_.size()) {
      return refuse("header: the package says it has %" PRIu64 " bytes, but it has %zu%s",
                    std::uint64_t(header_.total_bytes), bytes_.size(),
                    (header_.total_bytes > bytes_.size() ? " (cut short)" : " (something was appended)"));
    }
    if (header_.reserved0 != 0 || header_.reserved1 != std::array<std::uint64_t, 2>{}) {
      return refuse("header: a reserved field is not 0");
    }
    if (header_.section_count > (bytes_.size() - sizeof(Header)) / sizeof(SectionEntry)) {
      return refuse("header: a table of %u sections does not fit the file", unsigned(header_.section_count));
    }
    Header unsummed = header_;
    unsummed.checksum = 0;
    const auto table = bytes_.subspan(sizeof(Header), header_.section_count * sizeof(SectionEntry));
    if (checksum(std::as_bytes(std::span{&unsummed, 1}), table) != header_.checksum) {
      return refuse("header: checksum does not match (header or section table damaged)");
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
      return refuse("section table: the sections end at byte %" PRIu64 ", the file at %zu", expected_offset,
                    bytes_.size());
    }
    return true;
  }

  bool readEntry(const SectionEntry& entry, std::uint64_t expected_offset) {
    const std::uint32_t id = entry.id;
    if (entry.offset != expected_offset) return refuse(id, "does not start where the section before it ends");
    // expected_offset <= size holds before every entry, so the subtraction cannot wrap, nor alignedSize() after it.
    const std::uint64_t room = bytes_.size() - expected_offset;
    if (entry.bytes > room || alignedSize(entry.bytes) > room) return refuse(id, "reaches beyond the end of the file");
    if (entry.element_count == 0 || entry.element_bytes == 0) return refuse(id, "has no elements");
    if (entry.element_count > entry.bytes / entry.element_bytes ||
        entry.element_count * entry.element_bytes != entry.bytes) {
      return refuse(id, "its bytes are not its number of elements times their size");
    }
    if (entry.reserved0 != 0 || entry.reserved1 != std::array<std::uint64_t, 2>{}) {
      return refuse(id, "a reserved field of its table entry is not 0");
    }
    const auto padded = bytes_.subspan(entry.offset, alignedSize(entry.bytes));
    if (checksum(padded) != entry.checksum) return refuse(id, "checksum does not match (damaged)");
    for (const std::byte byte : padded.subspan(entry.bytes)) {
      if (byte != std::byte{0}) return refuse(id, "the padding behind it is not 0");
    }

    const std::size_t rule_index = section::indexOf(id);
    const bool known = rule_index < kSectionRules.size();
    view_.sections_.push_back({id, entry.bytes, entry.element_count, known});
    if (!known) {
      if ((entry.flags & kSectionRequired) == 0) return true;
      return refuseSection(id, "required, but unknown to this software (%s): use a newer version", kSoftwareVersion);
    }
    const SectionRule& rule = kSectionRules[rule_index];
    if (entry.flags != rule.flags) return refuse(id, "its flags are not those that the format gives it");
    if (entry.element_bytes != rule.element_bytes) {
      return refuseSection(id, "elements of %u bytes, must be %u", unsigned(entry.element_bytes), rule.element_bytes);
    }
    if (entry.element_count >= kNone) return refuse(id, "more elements than 32-bit indices can name");
    PackageView::List& list = view_.lists_[rule_index];
    if (list.count != 0) return refuse(id, "occurs twice");
    list = {bytes_.data() + entry.offset, entry.element_count};
    return true;
  }

  bool has(std::uint32_t id) const { return view_.sectionData(id).count != 0; }

  bool checkPresence() {
    if ((header_.features & ~kKnownFeatures) != 0) {
      return refuse("header: a feature bit that this software (%s) does not know: use a newer version",
                    kSoftwareVersion);
    }
    for (std::size_t i = 0; i < kSectionRules.size(); ++i) {
      const SectionRule& rule = kSectionRules[i];
      const bool present = view_.lists_[i].count != 0;
      if (rule.always_present && !present) return refuse(rule.id, "missing, but every package has it");
      if (rule.feature != 0 && present != ((header_.features & rule.feature) != 0)) {
        return refuse(rule.id, present ? "present, but its feature bit in the header is not set"
                                       : "missing, but its feature bit in the header is set");
      }
    }
    // What the first is about is in the second.
    constexpr std::array<std::array<std::uint32_t, 2>, 26> kNeeds = {{
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
        {section::distance_grids, section::field_points},
        {section::distance_values, section::distance_grids},
    }};
    for (const auto& [id, needed] : kNeeds) {
      if (has(id) && !has(needed)) {
        return refuseSection(id, "needs section %s, which is missing", SectionName(needed).text);
      }
    }
    if (has(section::visual_positions) && !has(section::barycentric) && !has(section::cluster_attachments)) {
      return refuse(section::visual_positions, "a visual mesh without an attachment (section ATBC, or ATCR and ATCW)");
    }
    return true;
  }

  bool readInfo() {
    if (view_.sectionData(section::info).count != 1) return refuse(section::info, "must have exactly one element");
    view_.features_ = header_.features;
    view_.format_version_ = header_.format_version;
    view_.total_bytes_ = header_.total_bytes;
    return true;
  }

  // ---- Values ----

  unsigned badText(StringRef ref) const {
    return unsigned(std::uint64_t{ref.offset} + ref.bytes > view_.strings().size());
  }

  // One text of each record of a section. \param offset where in the record.
  bool checkTexts(std::uint32_t id, std::size_t offset, const char* what) {
    const SectionData records = view_.sectionData(id);
    for (std::size_t i = 0; i < records.count; ++i) {
      StringRef ref;
      std::memcpy(&ref, static_cast<const std::byte*>(records.data) + i * records.bytes_each + offset, sizeof ref);
      if (badText(ref) != 0) return refuse(id, i, what);
    }
    return true;
  }

  bool checkTexts() {
    const PackageInfo& info = view_.info();
    for (const StringRef ref : {info.name, info.tool_version, info.source_file, info.unit_source, info.settings_json}) {
      if (badText(ref) != 0) return refuse(section::info, "a text lies outside section STRS");
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
    return checkTexts(section::textures, offsetof(Texture, mime), "its mime type lies outside section STRS");
  }

  bool checkInfo() {
    const PackageInfo& info = view_.info();
    const auto bad = [this](const char* what) { return refuse(section::info, what); };
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
    reach_ = Reach(info);
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

  bool checkBodies() {
    std::uint64_t vertices = 0, tetrahedra = 0, clusters = 0;
    for (std::size_t i = 0; i < view_.pieces().size(); ++i) {
      const PieceRange& piece = view_.pieces()[i];
      if (piece.first_vertex != vertices || piece.first_tetrahedron != tetrahedra || piece.first_cluster != clusters) {
        return refuse(section::pieces, i, "a run does not start where the piece before it ends");
      }
      if (piece.vertex_count == 0 || piece.cluster_count == 0) {
        return refuse(section::pieces, i, "has no vertices or no clusters");
      }
      vertices += piece.vertex_count;
      tetrahedra += piece.tetrahedron_count;
      clusters += piece.cluster_count;
      if (vertices > view_.physicalVertices().size() || tetrahedra > view_.tetrahedra().size() ||
          clusters > view_.clusters().size()) {
        return refuse(section::pieces, i, "reaches beyond the vertices, tetrahedra or clusters that there are");
      }
    }
    if (vertices != view_.physicalVertices().size() || tetrahedra != view_.tetrahedra().size() ||
        clusters != view_.clusters().size()) {
      return refuse(section::pieces, "the pieces do not cover all vertices, tetrahedra and clusters");
    }
    return true;
  }

  bool checkPhysicalVertices() {
    const Reach reach = reach_;
    if (!check(section::physical_vertices, view_.physicalVertices(),
               "position more than a diagonal outside the bounds of section INFO, or mass not above 0 to 1e18",
               [reach](const PhysicalVertex& v) {
                 return reach.beyond(v.rest_position) | notPositive(v.mass, kMostNumber);
               })) {
      return false;
    }
    double mass = 0;
    for (const PhysicalVertex& v : view_.physicalVertices()) mass += double(v.mass);
    return std::abs(mass - double(view_.info().total_mass)) <= kSumTolerance * mass ||
           refuse(section::physical_vertices, "the masses do not sum to total_mass of section INFO");
  }

  bool checkTetrahedra() {
    for (const PieceRange& piece : view_.pieces()) {
      const std::uint32_t first = piece.first_vertex, count = piece.vertex_count;
      const std::size_t index = firstBad(
          view_.tetrahedra().subspan(piece.first_tetrahedron, piece.tetrahedron_count), [=](const Tetrahedron& t) {
            const auto [a, b, c, d] = t.vertex;
            // v - first wraps to a large number where v < first, so one comparison tests both ends.
            return unsigned(a - first >= count) | unsigned(b - first >= count) | unsigned(c - first >= count) |
                   unsigned(d - first >= count) | unsigned(a == b) | unsigned(a == c) | unsigned(a == d) |
                   unsigned(b == c) | unsigned(b == d) | unsigned(c == d);
          });
      if (index != kAllGood) {
        return refuse(section::tetrahedra, piece.first_tetrahedron + index,
                      "a vertex outside its piece, or the same vertex twice");
      }
    }
    return true;
  }

  bool checkClusters() {
    std::uint64_t member = 0;
    std::uint32_t quadratic = 0;
    for (std::size_t b = 0; b < view_.pieces().size(); ++b) {
      const PieceRange& piece = view_.pieces()[b];
      for (std::size_t i = piece.first_cluster; i < std::size_t{piece.first_cluster} + piece.cluster_count; ++i) {
        const Cluster& c = view_.clusters()[i];
        const auto bad = [&](const char* what) { return refuse(section::clusters, i, what); };
        const auto mode = static_cast<std::uint32_t>(c.mode);
        if (mode > static_cast<std::uint32_t>(ClusterMode::quadratic)) return bad("unknown mode");
        if (c.piece != b) return bad("is listed by another piece than the one it names");
        if (c.first_member != member) return bad("its members do not start where those of the cluster before end");
        if (c.member_count == 0) return bad("has no members");
        member += c.member_count;
        if (member > view_.memberships().size()) return bad("its members reach beyond section MEMB");
        if (c.mode == ClusterMode::quadratic) {
          if (c.quadratic != quadratic || c.quadratic >= view_.quadraticMoments().size()) {
            return bad("its moment is not the next one of section AQQ9");
          }
          ++quadratic;
        } else if (c.quadratic != kNone) {
          return bad("has a quadratic moment, but its mode is not quadratic");
        }
        const float diagonal = view_.info().diagonal;
        if (outside(c.radius, kLeastRadius * diagonal, std::max(kMostRadius * diagonal, 1.0F)) != 0) {
          return bad("radius is outside 1e-9 to 3 diagonals of section INFO (or 1)");
        }
        if (notPositive(c.mass, 1.001F * view_.info().total_mass) != 0) {
          return bad("mass is not above 0 to total_mass of section INFO");
        }
        if (outsideUnit(c.alpha) != 0) return bad("alpha is outside 0 to 1");
        if ((noFrequency(c.stretch_hz) | noFrequency(c.bend_hz) | noFrequency(c.twist_hz)) != 0) {
          return bad("a frequency is neither 0 to 1e18 nor infinite");
        }
        if (reach_.beyond(c.rest_center) != 0) {
          return bad("rest_center is more than a diagonal outside the bounds of section INFO");
        }
        if (beyond(c.a_qq, kMostInverse) != 0) return bad("a_qq is not finite or beyond 1e12");
      }
    }
    if (member != view_.memberships().size()) return refuse(section::memberships, "has members of no cluster");
    if (quadratic != view_.quadraticMoments().size()) {
      return refuse(section::quadratic_moments, "has moments of no cluster");
    }
    return check(section::quadratic_moments, view_.quadraticMoments(), "not finite or beyond 1e12",
                 [](const QuadraticMoment& m) { return beyond(m.a_qq, kMostInverse); });
  }

  /// Whether a member lies outside its cluster's radius by more than rounding.
  bool farFrom(const Cluster& cluster, const Float3& place) const {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off = double(place[axis]) - double(cluster.rest_center[axis]);
      squared += off * off;
    }
    return !(std::sqrt(squared) <= 1.001 * double(cluster.radius) + 1e-6 * double(view_.info().diagonal));
  }

  /// What is wrong with the pseudo-inverses of a cluster's moments; null if nothing. Fitting multiplies
  /// sums over the members by the inverse: what makes more than 1 of the moment would throw them anywhere.
  const char* faultOfMoments(const Cluster& cluster) const {
    std::array<double, 9> mean = {};
    std::array<std::array<double, 9>, 9> moment = {};
    const std::size_t terms = cluster.mode == ClusterMode::quadratic ? 9 : 3;
    for (const Membership& m : view_.memberships().subspan(cluster.first_member, cluster.member_count)) {
      std::array<double, 9> q = {};
      for (std::size_t k = 0; k < 3; ++k) {
        q[k] = (double(view_.physicalVertices()[m.vertex].rest_position[k]) - double(cluster.rest_center[k])) /
               double(cluster.radius);
      }
      for (std::size_t k = 0; k < 3; ++k) {
        q[3 + k] = q[k] * q[k];
        q[6 + k] = q[k] * q[(k + 1) % 3];
      }
      for (std::size_t row = 0; row < 9; ++row) mean[row] += double(m.mu) * q[row];
      for (std::size_t row = 0; row < terms; ++row) {
        for (std::size_t column = 0; column < terms; ++column) moment[row][column] += double(m.mu) * q[row] * q[column];
      }
    }
    for (std::size_t row = 0; row < terms; ++row) {
      for (std::size_t column = 0; column < terms; ++column) moment[row][column] -= mean[row] * mean[column];
    }
    const auto [xx, yy, zz, xy, yz, zx] = cluster.a_qq;
    if (!isInverse<3>({xx, xy, yy, zx, yz, zz}, moment)) return "a_qq is not the inverse of its members' moment";
    if (cluster.mode == ClusterMode::quadratic &&
        !isInverse<9>(view_.quadraticMoments()[cluster.quadratic].a_qq, moment)) {
      return "its element of section AQQ9 is not the inverse of its members' moment";
    }
    return nullptr;
  }

  /// Whether a symmetric matrix, its lower triangle row by row, times the corner of a moment has entries as a
  /// projection has.
  template <std::size_t kSize>
  static bool isInverse(const std::array<float, kSize*(kSize + 1) / 2>& triangle,
                        const std::array<std::array<double, 9>, 9>& moment) {
    bool good = true;
    for (std::size_t row = 0; row < kSize; ++row) {
      for (std::size_t column = 0; column < kSize; ++column) {
        double sum = 0;
        for (std::size_t k = 0; k < kSize; ++k) {
          const std::size_t low = std::min(row, k), high = std::max(row, k);
          sum += double(triangle[high * (high + 1) / 2 + low]) * moment[k][column];
        }
        good &= std::abs(sum) <= kMostProjection;
      }
    }
    return good;
  }

  bool checkMemberships() {
    std::vector<float> shares(view_.physicalVertices().size(), 0.0F);
    for (std::size_t i = 0; i < view_.clusters().size(); ++i) {
      const Cluster& cluster = view_.clusters()[i];
      const PieceRange& piece = view_.pieces()[cluster.piece];
      const std::uint64_t end = std::uint64_t{piece.first_vertex} + piece.vertex_count;
      std::uint64_t lowest = piece.first_vertex;
      double mu = 0;
      for (std::size_t k = cluster.first_member; k < std::size_t{cluster.first_member} + cluster.member_count; ++k) {
        const Membership& m = view_.memberships()[k];
        if (m.vertex < lowest || m.vertex >= end) {
          return refuse(section::memberships, k, "vertex not ascending, or outside the piece of its cluster");
        }
        lowest = std::uint64_t{m.vertex} + 1;
        if ((outsideUnit(m.mu) | outsideUnit(m.share)) != 0) {
          return refuse(section::memberships, k, "mu or share is outside 0 to 1");
        }
        if (m.mu > 0 && farFrom(cluster, view_.physicalVertices()[m.vertex].rest_position)) {
          return refuse(section::memberships, k, "the vertex has mu, but lies outside the radius of its cluster");
        }
        mu += static_cast<double>(m.mu);
        shares[m.vertex] += m.share;
      }
      if (std::abs(mu - 1.0) > kSumTolerance) {
        return refuseSection(section::memberships, "mu of cluster %zu does not sum to 1", i);
      }
      if (const char* fault = faultOfMoments(cluster); fault != nullptr) return refuse(section::clusters, i, fault);
    }
    const std::size_t index = firstBad(std::span<const float>{shares}, [](float sum) {
      return unsigned(!(std::abs(sum - 1.0F) <= static_cast<float>(kSumTolerance)));
    });
    return index == kAllGood ||
           refuseSection(section::memberships, "the shares of physical vertex %zu over its clusters do not sum to 1",
                         index);
  }

  /// One of the runs that tile a list of ascending numbers below `limit`. \param end of the run before, and after.
  bool checkRun(std::uint32_t id, std::size_t i, std::uint32_t first, std::uint32_t count,
                std::span<const std::uint32_t> list, std::size_t limit, std::uint64_t& end) {
    if (first != end || count > list.size() - end) {
      return refuse(id, i, "does not start where the one before ends, or reaches beyond the list of vertices");
    }
    std::uint64_t lowest = 0;
    for (const std::uint32_t v : list.subspan(first, count)) {
      if (v < lowest || v >= limit) return refuse(id, i, "its vertices are not ascending, or do not exist");
      lowest = std::uint64_t{v} + 1;
    }
    end += count;
    return true;
  }

  bool checkPinSets() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.pinSets().size(); ++i) {
      const PinSet& set = view_.pinSets()[i];
      if (badText(set.target) != 0) return refuse(section::pin_sets, i, "its target lies outside section STRS");
      if (set.method > 3 || set.reserved0 != 0) {
        return refuse(section::pin_sets, i, "unknown method, or a reserved field that is not 0");
      }
      if (!checkRun(section::pin_sets, i, set.first, set.count, view_.pinSetVertices(), view_.physicalVertices().size(),
                    end)) {
        return false;
      }
    }
    return end == view_.pinSetVertices().size() || refuse(section::pin_set_vertices, "has vertices of no pin set");
  }

  bool checkParts() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.parts().size(); ++i) {
      const AttachedPart& part = view_.parts()[i];
      if ((part.cluster != kNone && part.cluster >= view_.clusters().size()) || part.reserved0 != 0) {
        return refuse(section::parts, i, "its cluster is not in section CLUS, or a reserved field is not 0");
      }
      if (!checkRun(section::parts, i, part.first, part.count, view_.partVertices(), view_.visualPositions().size(),
                    end)) {
        return false;
      }
    }
    return end == view_.partVertices().size() || refuse(section::part_vertices, "has vertices of no part");
  }

  bool checkMechanics() {
    const std::size_t vertices = view_.physicalVertices().size();
    for (const auto& [id, values] : {std::pair{section::vertex_stiffness, view_.vertexStiffness()},
                                     std::pair{section::pin_weights, view_.pinWeights()}}) {
      if (!values.empty() && values.size() != vertices) {
        return refuseSection(id, "%zu elements for %zu physical vertices", values.size(), vertices);
      }
      if (!check(id, values, "outside 0 to 1", [](float value) { return outsideUnit(value); })) return false;
    }
    if (!view_.mechanics().empty() && view_.mechanics().size() != view_.clusters().size()) {
      return refuseSection(section::mechanics, "%zu elements for %zu clusters", view_.mechanics().size(),
                           view_.clusters().size());
    }
    for (std::size_t i = 0; i < view_.mechanics().size(); ++i) {
      const char* fault = faultOf(view_.mechanics()[i]);
      if (fault != nullptr) return refuse(section::mechanics, i, fault);
    }
    return true;
  }

  /// What is wrong with a cluster's mechanics; null if nothing.
  const char* faultOf(const ClusterMechanics& m) const {
    if (m.stiffness > StiffnessModel::elastic) return "unknown stiffness model";
    if (m.limit > LimitMethod::curve) return "unknown limit method";
    if (m.volume > VolumeMethod::principal) return "unknown volume method";
    for (const float beta : m.per_step_beta) {
      if (outsideUnit(beta) != 0) return "per_step_beta is outside 0 to 1";
    }
    if (outside(m.young, 0, 1e12F) != 0) return "young is outside 0 to 1e12";
    if (outside(m.poisson, 0, 0.499F) != 0) return "poisson is outside 0 to 0.499";
    if (outside(m.damping, 0, 1e5F) != 0) return "damping is outside 0 to 1e5";
    if (outside(m.stretch_min, 0.05F, 1) != 0) return "stretch_min is outside 0.05 to 1";
    if (outside(m.stretch_max, 1, 20) != 0) return "stretch_max is outside 1 to 20";
    if (outside(m.norm_max, 3, 1000) != 0) return "norm_max is outside 3 to 1000";
    if (outside(m.norm_limit, m.norm_max, 1000) != 0) return "norm_limit is outside norm_max to 1000";
    if ((outside(m.plastic_yield, 0, 10) | outside(m.plastic_creep, 0, 1e5F) | outside(m.plastic_limit, 0, 10)) != 0) {
      return "plastic_yield or plastic_limit is outside 0 to 10, or plastic_creep outside 0 to 1e5";
    }
    if (outside(m.contraction, 0, 0.9F) != 0) return "contraction is outside 0 to 0.9";
    double length2 = 0;  // of no float but 0 it is 0
    for (const float x : m.fibre) length2 += double(x) * double(x);
    if (length2 != 0 && !(length2 >= 0.999 && length2 <= 1.001)) return "fibre is neither 0 nor of length 1";
    if (m.channel != kNone && m.channel >= view_.channels().size()) return "its channel is not in section CHAN";
    if (m.reserved0 != 0) return "a reserved field is not 0";
    return faultOfCurve(m);
  }

  const char* faultOfCurve(const ClusterMechanics& m) const {
    if (m.limit != LimitMethod::curve) {
      return m.first_curve_point == 0 && m.curve_point_count == 0 ? nullptr : "has a curve that its limit does not use";
    }
    const std::span<const CurvePoint> all = view_.curvePoints();
    if (m.curve_point_count < 2) return "its curve has fewer than 2 points";
    if (m.first_curve_point >= all.size() || m.curve_point_count > all.size() - m.first_curve_point) {
      return "its curve reaches beyond section CURV";
    }
    const auto points = all.subspan(m.first_curve_point, m.curve_point_count);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const CurvePoint& point = points[k];
      if (outside(point.norm, 3, 1e6F) != 0 || outside(point.response, 3, point.norm) != 0) {
        return "a point of its curve has a norm outside 3 to 1e6, or a response outside 3 to that norm";
      }
      if (k == 0 && point.response != point.norm) return "the first point of its curve changes the norm";
      if (k > 0 && (!(point.norm > points[k - 1].norm) || !(point.response >= points[k - 1].response))) {
        return "its curve is not ascending";
      }
    }
    return nullptr;
  }

  bool checkVisualMesh() {
    for (const std::uint32_t id :
         {section::visual_normals, section::visual_uv, section::visual_colors, section::barycentric,
          section::cluster_attachment_ranges, section::visual_identity}) {
      const std::size_t count = view_.sectionData(id).count;
      if (count != 0 && count != view_.visualPositions().size()) {
        return refuseSection(id, "%zu elements for %zu visual vertices", count, view_.visualPositions().size());
      }
    }
    const Reach reach = reach_;
    if (!check(section::visual_positions, view_.visualPositions(),
               "more than a diagonal outside the bounds of section INFO",
               [reach](const Float3& v) { return reach.beyond(v); }) ||
        !check(section::visual_normals, view_.visualNormals(), "a coordinate is outside -1 to 1",
               [](const Float3& v) { return beyond(v, kMostNormal); }) ||
        !check(section::visual_uv, view_.visualUvs(), "not finite or beyond 1e9",
               [](const Float2& v) { return beyond(v, kMostTexture); })) {
      return false;
    }
    const std::size_t vertices = view_.visualPositions().size();
    if (!check(section::visual_triangles, view_.visualTriangles(), "a corner is not a visual vertex",
               [vertices](const Triangle& t) {
                 return unsigned(t[0] >= vertices) | unsigned(t[1] >= vertices) | unsigned(t[2] >= vertices);
               })) {
      return false;
    }
    std::uint64_t triangle = 0;
    for (std::size_t i = 0; i < view_.subMeshes().size(); ++i) {
      const SubMesh& sub_mesh = view_.subMeshes()[i];
      if (sub_mesh.first_triangle != triangle) {
        return refuse(section::sub_meshes, i, "does not start where the sub-mesh before it ends");
      }
      triangle += sub_mesh.triangle_count;
      if (sub_mesh.material != kNone && sub_mesh.material >= view_.materials().size()) {
        return refuse(section::sub_meshes, i, "its material is not in section VMAT");
      }
      if (sub_mesh.reserved0 != 0) return refuse(section::sub_meshes, i, "a reserved field is not 0");
    }
    if (!view_.subMeshes().empty() && triangle != view_.visualTriangles().size()) {
      return refuse(section::sub_meshes, "the sub-meshes do not cover exactly the triangles");
    }
    return true;
  }

  bool checkMaterials() {
    const std::size_t textures = view_.textures().size();
    if (!check(section::materials, view_.materials(), "base_color outside 0 to 1, no such texture, or unknown flag",
               [textures](const Material& m) {
                 unsigned bad = unsigned(m.texture != kNone) & unsigned(m.texture >= textures);
                 for (const float channel : m.base_color) bad |= outsideUnit(channel);
                 return bad | unsigned((m.flags & ~std::uint32_t{kMaterialDoubleSided}) != 0);
               })) {
      return false;
    }
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < textures; ++i) {
      const Texture& texture = view_.textures()[i];
      if (texture.offset != end) {
        return refuse(section::textures, i, "its bytes do not start where those of the texture before end");
      }
      if (texture.bytes > view_.textureBytes().size() - end) {
        return refuse(section::textures, i, "its bytes reach beyond section TEXB");
      }
      end += texture.bytes;
    }
    return end == view_.textureBytes().size() || refuse(section::texture_bytes, "has bytes of no texture");
  }

  bool checkAttachments() {
    const std::size_t tetrahedra = view_.tetrahedra().size(), clusters = view_.clusters().size();
    if (!check(section::barycentric, view_.barycentric(), "no such tetrahedron, or a weight not finite or beyond 1e6",
               [tetrahedra](const BarycentricAttachment& a) {
                 return unsigned(a.tetrahedron >= tetrahedra) | beyond(a.weight, kMostWeight);
               }) ||
        !check(section::cluster_attachments, view_.clusterAttachments(), "no such cluster, or weight outside 0 to 1",
               [clusters](const ClusterAttachment& a) {
                 return unsigned(a.cluster >= clusters) | outsideUnit(a.weight);
               })) {
      return false;
    }
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.clusterAttachmentRanges().size(); ++i) {
      const ClusterAttachmentRange& range = view_.clusterAttachmentRanges()[i];
      if (range.first != end || range.count == 0 || range.count > view_.clusterAttachments().size() - end) {
        return refuse(section::cluster_attachment_ranges, i,
                      "empty, does not start where the run before ends, or reaches beyond section ATCW");
      }
      double sum = 0;
      for (const ClusterAttachment& a : view_.clusterAttachments().subspan(range.first, range.count)) {
        sum += static_cast<double>(a.weight);
      }
      if (!(std::abs(sum - 1.0) <= kSumTolerance)) {
        return refuse(section::cluster_attachment_ranges, i, "the weights of its run in ATCW do not sum to 1");
      }
      end += range.count;
    }
    return end == view_.clusterAttachments().size() ||
           refuse(section::cluster_attachments, "has weights of no visual vertex");
  }

  bool checkIdentity() {
    const std::size_t vertices = view_.visualIdentity().size(), sources = view_.sourceIdentity().size();
    if (view_.sourceVisualList().size() != vertices) {
      return refuse(section::source_visual_list, "does not have one element for each visual vertex");
    }
    if (!check(section::visual_identity, view_.visualIdentity(), "no such source vertex or welded point",
               [=](const VisualIdentity& v) {
                 return unsigned(v.source_vertex >= sources) | unsigned(v.welded >= vertices);
               }) ||
        !check(section::source_visual_list, view_.sourceVisualList(), "no such visual vertex",
               [vertices](std::uint32_t v) { return unsigned(v >= vertices); })) {
      return false;
    }
    // Runs that tile a list of as many elements as there are visual vertices, each run ascending and holding only
    // vertices that name this source vertex: so every visual vertex occurs exactly once.
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < sources; ++i) {
      const SourceIdentity& source = view_.sourceIdentity()[i];
      const auto bad = [&](const char* what) { return refuse(section::source_identity, i, what); };
      if (source.first_visual != end) return bad("its run of SVLS does not start where the run before ends");
      if (source.visual_count > vertices - end) return bad("its run reaches beyond section SVLS");
      if (source.visual_count == 0) {
        if (source.welded != kNone) return bad("names a welded point, but became no visual vertex");
        continue;
      }
      for (std::uint64_t k = end; k < end + source.visual_count; ++k) {
        const std::uint32_t v = view_.sourceVisualList()[k];
        if (view_.visualIdentity()[v].source_vertex != i || (k > end && v <= view_.sourceVisualList()[k - 1])) {
          return bad("its run of SVLS is not ascending, or holds a visual vertex of another source vertex");
        }
        if (view_.visualIdentity()[v].welded != source.welded) {
          return bad("its welded point is not that of its visual vertices");
        }
      }
      end += source.visual_count;
    }
    if (end != vertices) return refuse(section::source_visual_list, "has visual vertices of no source vertex");

    std::uint64_t source_vertex = 0;
    for (std::size_t i = 0; i < view_.sourceMeshes().size(); ++i) {
      const SourceMesh& mesh = view_.sourceMeshes()[i];
      if (mesh.first_source_vertex != source_vertex) {
        return refuse(section::source_meshes, i, "does not start where the mesh before it ends");
      }
      source_vertex += mesh.source_vertex_count;
    }
    return source_vertex == sources || refuse(section::source_meshes, "the meshes do not cover the source vertices");
  }

  bool checkGroups() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.groups().size(); ++i) {
      const Group& group = view_.groups()[i];
      if (!checkRun(section::groups, i, group.first, group.count, view_.groupVertices(), view_.visualPositions().size(),
                    end)) {
        return false;
      }
    }
    return end == view_.groupVertices().size() || refuse(section::group_vertices, "has vertices of no group");
  }

  bool checkMasks() {
    const std::span<const MaskWeight> weights = view_.maskWeights();
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.masks().size(); ++i) {
      const Mask& mask = view_.masks()[i];
      if (mask.first != end || mask.count > weights.size() - end) {
        return refuse(section::masks, i, "does not start where the mask before ends, or reaches beyond section MSKV");
      }
      std::uint64_t lowest = 0;
      for (const MaskWeight& w : weights.subspan(mask.first, mask.count)) {
        if (w.vertex < lowest || w.vertex >= view_.visualPositions().size() || !(w.weight > 0) || !(w.weight <= 1)) {
          return refuse(section::masks, i, "its vertices are not ascending visual vertices of weight 0 to 1");
        }
        lowest = std::uint64_t{w.vertex} + 1;
      }
      end += mask.count;
    }
    return end == weights.size() || refuse(section::mask_weights, "has weights of no mask");
  }

  bool checkFields() {
    const FieldFault fault = findFieldFault(view_, reach_);
    if (fault.what == nullptr) return true;
    return fault.element == FieldFault::kWhole ? refuse(fault.section, fault.what)
                                               : refuse(fault.section, fault.element, fault.what);
  }

  std::span<const std::byte> bytes_;
  PackageView& view_;
  Header header_{};
  Reach reach_;  // once INFO is checked
  char reason_[320] = "";
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
