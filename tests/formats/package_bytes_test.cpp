// SPDX-License-Identifier: MIT
//
// Hostile bytes: every cut, every changed byte, and random damage under checksums that were made right again.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <span>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace sinew::formats {
namespace {

using test::AlignedBytes;
using test::reasonOf;
using test::samplePackage;

std::vector<PackageContent> packages() { return {samplePackage(), test::fieldPackage()}; }

TEST(PackageBytes, CutAtEveryByteIsRefused) {
  for (const PackageContent& content : packages()) {
    const std::vector<std::byte> bytes = writePackage(content);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      ASSERT_NE(reasonOf(std::span{bytes}.first(size)), "") << "cut at " << size;
    }
  }
}

TEST(PackageBytes, AreTheSameInMemoryOfTheCallers) {
  for (const PackageContent& content : packages()) {
    std::vector<std::byte> memory;
    const auto dirty = [&memory](std::size_t count) { return memory.assign(count, std::byte{0xff}), memory.data(); };
    writePackage(content, dirty);
    EXPECT_EQ(memory, writePackage(content));
  }
}

TEST(PackageBytes, CutAtEverySectionIsRefusedEvenWhenHeaderAndSumsAgree) {
  for (const PackageContent& content : packages()) {
    const std::vector<std::byte> bytes = writePackage(content);
    for (std::size_t size = sizeof(Header); size < bytes.size(); size += kSectionAlignment) {
      std::vector<std::byte> cut(bytes.begin(), bytes.begin() + std::ptrdiff_t(size));
      const std::uint64_t total = size;
      std::memcpy(cut.data() + offsetof(Header, total_bytes), &total, sizeof total);
      test::reseal(cut);
      ASSERT_NE(reasonOf(cut), "") << "cut at " << size;
    }
  }
}

TEST(PackageBytes, EveryChangedByteIsRefused) {
  for (const PackageContent& content : packages()) {
    AlignedBytes bytes(writePackage(content));
    for (std::size_t i = 0; i < bytes.span().size(); ++i) {
      for (const std::byte flip : {std::byte{0x01}, std::byte{0x80}, std::byte{0xff}}) {
        bytes.span()[i] ^= flip;
        PackageView view;
        ASSERT_NE(PackageView::open(bytes.span(), view).reason, "") << "byte " << i;
        bytes.span()[i] ^= flip;
      }
    }
    PackageView view;
    EXPECT_EQ(PackageView::open(bytes.span(), view).reason, "");
  }
}

TEST(PackageBytes, AppendedBytesAreRefused) {
  for (const std::size_t more : {1U, 63U, 64U, 4096U}) {
    std::vector<std::byte> bytes = writePackage(samplePackage());
    bytes.resize(bytes.size() + more);
    EXPECT_NE(reasonOf(bytes), "") << more;
    const std::uint64_t total = bytes.size();
    std::memcpy(bytes.data() + offsetof(Header, total_bytes), &total, sizeof total);
    test::reseal(bytes);
    EXPECT_NE(reasonOf(bytes), "") << more << ", and the header says so";
  }
}

template <class T>
double touch(std::span<const T> items) {
  double sum = 0;
  for (std::size_t i = 0; i < items.size(); ++i) {
    unsigned char last = 0;
    std::memcpy(&last, reinterpret_cast<const unsigned char*>(items.data() + i + 1) - 1, 1);
    sum += last;
  }
  return sum;
}

// As the runtime reads them: nothing that is computed with may be other than finite.
double followFields(const PackageView& view) {
  double sum = 0;
  const auto take = [&](double number) {
    EXPECT_TRUE(std::isfinite(number));
    sum += number;
  };
  const auto lanes = [&](std::span<const Lanes> all, std::uint32_t first, std::size_t count) {
    for (const Lanes& eight : all.subspan(first, count)) {
      for (const float number : eight) take(double(number * number));
    }
  };
  for (const Field& field : view.fields()) {
    const PieceRange& body = view.pieces()[field.piece];
    const std::size_t k = field.function_count;
    for (const FieldFunction& f : view.fieldFunctions().subspan(field.first_function, k)) {
      take(double(f.stiffness) + double(f.damping_hz) + double(f.decay) + double(f.one) + double(f.rest[2]));
      if (f.pin_set != kNone) sum += double(view.text(view.pinSets()[f.pin_set].name).size());
    }
    for (const FieldPack& pack : view.fieldPacks().subspan(field.first_pack, field.pack_count)) {
      for (std::size_t l = 0; l < 8; ++l) {
        take(double(pack.volume[l] * pack.mu[l] + pack.lambda[l] + pack.at[2][l]));
        if (pack.cluster[l] == kNone) continue;
        const ClusterMechanics& laws = view.mechanics()[pack.cluster[l]];
        take(double(laws.stretch_max) + double(laws.plastic_yield));
        EXPECT_EQ(view.clusters()[pack.cluster[l]].piece, field.piece);
      }
    }
    lanes(view.fieldGradients(), field.first_gradient, 3 * k * field.pack_count);
    lanes(view.fieldValues(), field.first_value, k * ((std::size_t{body.vertex_count} + 7) / 8));
    for (const FieldPoint& point : view.fieldPoints().subspan(field.first_point, field.point_count)) {
      take(double(point.area) + double(point.at[1]));
    }
    const std::size_t unknowns = 3 * (k - field.driven_count);
    lanes(view.fieldModes(), field.first_mode, (unknowns + 1) * ((unknowns + 7) / 8));
    lanes(view.fieldPointValues(), field.first_point_value, k * ((std::size_t{field.point_count} + 7) / 8));
  }
  for (const FieldFibre& fibre : view.fieldFibres()) {
    const Field& field = view.fields()[fibre.field];
    const ClusterMechanics& mechanics = view.mechanics()[fibre.cluster];
    sum += double(view.text(view.channels()[mechanics.channel].name).size());
    Float3 stretch = {};
    for (std::uint32_t j = 0; j < field.function_count; ++j) {
      const float value = view.fieldFibreValues()[fibre.first_value + j];
      const FieldFunction& function = view.fieldFunctions()[field.first_function + j];
      for (std::size_t axis = 0; axis < 3; ++axis) stretch[axis] += value * function.rest[axis];
    }
    // Its direction at rest, which is divided by.
    take(double(fibre.tension) / std::hypot(double(stretch[0]), double(stretch[1]), double(stretch[2])));
  }
  for (const FieldTethers& tethers : view.fieldTethers()) {
    const Field& field = view.fields()[tethers.field];
    const std::size_t k = field.function_count;
    const auto functions = view.fieldFunctions().subspan(field.first_function, k);
    for (std::size_t i = 0; i < k; ++i) {
      for (std::size_t j = 0; j < k; ++j) {
        const float value = view.fieldTetherValues()[tethers.first_value + k * i + j];
        EXPECT_EQ(value, view.fieldTetherValues()[tethers.first_value + k * j + i]);
        take(double(value * value) + double(value) * double(functions[j].rest[0]));
      }
    }
  }
  return sum;
}

// Follows every index of a package that opened; AddressSanitizer would report any that leads outside.
double follow(const PackageView& view) {
  double sum = 0;
  const auto text = [&](StringRef ref) {
    for (const char c : view.text(ref)) sum += double(c);
  };
  text(view.info().name);
  text(view.info().settings_json);
  for (const PieceRange& body : view.pieces()) {
    text(body.name);
    for (const Tetrahedron& t : view.tetrahedra().subspan(body.first_tetrahedron, body.tetrahedron_count)) {
      for (const std::uint32_t v : t.vertex) sum += double(view.physicalVertices()[v].rest_position[0]);
    }
    sum += touch(view.clusters().subspan(body.first_cluster, body.cluster_count));
  }
  for (const Cluster& c : view.clusters()) {
    text(c.name);
    if (c.quadratic != kNone) sum += double(view.quadraticMoments()[c.quadratic].a_qq[44]);
    for (const Membership& m : view.memberships().subspan(c.first_member, c.member_count)) {
      sum += double(view.physicalVertices()[m.vertex].mass * m.mu);
    }
  }
  for (const Triangle& t : view.visualTriangles()) {
    for (const std::uint32_t v : t) sum += double(view.visualPositions()[v][1]);
  }
  for (const SubMesh& s : view.subMeshes()) {
    sum += touch(view.visualTriangles().subspan(s.first_triangle, s.triangle_count));
    if (s.material != kNone) text(view.materials()[s.material].name);
  }
  for (const Material& m : view.materials()) {
    if (m.texture != kNone) text(view.textures()[m.texture].mime);
  }
  for (const Texture& t : view.textures()) sum += touch(view.textureBytes().subspan(t.offset, t.bytes));
  for (const BarycentricAttachment& a : view.barycentric()) sum += double(view.tetrahedra()[a.tetrahedron].vertex[0]);
  for (const ClusterAttachmentRange& r : view.clusterAttachmentRanges()) {
    for (const ClusterAttachment& a : view.clusterAttachments().subspan(r.first, r.count)) {
      sum += double(view.clusters()[a.cluster].radius * a.weight);
    }
  }
  for (const VisualIdentity& v : view.visualIdentity()) sum += view.sourceIdentity()[v.source_vertex].welded;
  for (const SourceIdentity& s : view.sourceIdentity()) {
    for (const std::uint32_t v : view.sourceVisualList().subspan(s.first_visual, s.visual_count)) {
      sum += double(view.visualPositions()[v][2]);
    }
  }
  for (const Group& g : view.groups()) {
    text(g.name);
    for (const std::uint32_t v : view.groupVertices().subspan(g.first, g.count)) sum += view.visualIdentity()[v].welded;
  }
  return sum + followFields(view);
}

void damageAtRandom(const PackageContent& content, std::size_t least_opened, bool packed = false) {
  const std::vector<std::byte> good = writePackage(content, packed);
  Header header;
  std::memcpy(&header, good.data(), sizeof header);
  std::mt19937 random(20240607);
  const auto below = [&](std::size_t limit) { return std::size_t{random()} % limit; };
  constexpr std::uint32_t kEdges[] = {0, 1, 2, 0x7f800000, 0x7fc00000, 0x80000000, 0xfffffffe, 0xffffffff, 64, 0x10000};
  std::size_t refused = 0, opened = 0;
  [[maybe_unused]] volatile double sink = 0;  // what was followed must not be optimized away
  for (int round = 0; round < 60000; ++round) {
    AlignedBytes bytes(good);
    const std::size_t changes = 1 + below(3);
    for (std::size_t k = 0; k < changes; ++k) {
      // Half of the damage goes to header and table, which are a small part of the file.
      const std::size_t words =
          (below(2) == 0 ? sizeof(Header) + header.section_count * sizeof(SectionEntry) : good.size()) / 4;
      std::byte* at = bytes.span().data() + 4 * below(words);
      std::uint32_t word;
      std::memcpy(&word, at, 4);
      switch (below(4)) {
        case 0:
          word ^= 1U << below(32);
          break;
        case 1:
          word = kEdges[below(std::size(kEdges))];
          break;
        case 2:
          word += std::uint32_t(below(5)) - 2;
          break;
        default:
          word = std::uint32_t(random());
          break;
      }
      std::memcpy(at, &word, 4);
    }
    test::reseal(bytes.span());
    PackageView view;
    if (PackageView::open(bytes.span(), view).reason.empty()) {
      ++opened;
      sink = follow(view);
    } else {
      ++refused;
    }
  }
  // Both must happen often, or the damage is not of the kind that tests anything.
  EXPECT_GT(refused, 10000U);
  EXPECT_GT(opened, least_opened);
}

TEST(PackageBytes, RandomDamageUnderRightChecksumsIsRefusedOrHarmless) { damageAtRandom(samplePackage(), 1000); }

TEST(PackageBytes, RandomDamageToFieldsIsRefusedOrHarmless) { damageAtRandom(test::fieldPackage(), 1000); }

TEST(PackageBytes, RandomDamageToPackedSectionsIsRefusedOrHarmless) {
  damageAtRandom(samplePackage(), 1000, true);
  damageAtRandom(test::fieldPackage(), 1000, true);
}

}  // namespace
}  // namespace sinew::formats
