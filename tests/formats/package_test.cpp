// SPDX-License-Identifier: MIT
#include "sinew/formats/package.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/src/packing.h"
#include "formats/src/section_rules.h"
#include "sinew/formats/version.h"
#include "sinew/formats/writer.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace sinew::formats {
namespace {

using test::AlignedBytes;
using test::reasonOf;
using test::samplePackage;

template <class T>
void expectSameBytes(std::span<const T> read, const std::vector<T>& written, const char* what) {
  ASSERT_EQ(read.size(), written.size()) << what;
  EXPECT_EQ(std::memcmp(read.data(), written.data(), written.size() * sizeof(T)), 0) << what;
}

TEST(Package, RoundTripKeepsEverySection) {
  const PackageContent content = samplePackage();
  const AlignedBytes bytes(writePackage(content));
  PackageView view;
  ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
  EXPECT_EQ(view.formatVersion(), kFormatVersion);
  EXPECT_EQ(view.totalBytes(), bytes.span().size());
  EXPECT_EQ(view.features(), kFeatureTetrahedra | kFeatureQuadratic | kFeatureVisual | kFeatureBarycentric |
                                 kFeatureClusterAttachment | kFeatureIdentity | kFeatureGroups | kFeatureTextures);
  EXPECT_EQ(view.sections().size(), 26U);
  EXPECT_EQ(std::memcmp(&view.info(), &content.info, sizeof(PackageInfo)), 0);
  expectSameBytes(view.pieces(), content.pieces, "pieces");
  expectSameBytes(view.physicalVertices(), content.physical_vertices, "physical vertices");
  expectSameBytes(view.tetrahedra(), content.tetrahedra, "tetrahedra");
  expectSameBytes(view.clusters(), content.clusters, "clusters");
  expectSameBytes(view.memberships(), content.memberships, "memberships");
  expectSameBytes(view.quadraticMoments(), content.quadratic_moments, "quadratic moments");
  expectSameBytes(view.visualPositions(), content.visual_positions, "positions");
  expectSameBytes(view.visualNormals(), content.visual_normals, "normals");
  expectSameBytes(view.visualUvs(), content.visual_uvs, "uvs");
  expectSameBytes(view.visualColors(), content.visual_colors, "colors");
  expectSameBytes(view.visualTriangles(), content.visual_triangles, "triangles");
  expectSameBytes(view.subMeshes(), content.sub_meshes, "sub-meshes");
  expectSameBytes(view.materials(), content.materials, "materials");
  expectSameBytes(view.textures(), content.textures, "textures");
  expectSameBytes(view.textureBytes(), content.texture_bytes, "texture bytes");
  expectSameBytes(view.barycentric(), content.barycentric, "barycentric");
  expectSameBytes(view.clusterAttachmentRanges(), content.cluster_attachment_ranges, "attachment ranges");
  expectSameBytes(view.clusterAttachments(), content.cluster_attachments, "attachments");
  expectSameBytes(view.visualIdentity(), content.visual_identity, "visual identity");
  expectSameBytes(view.sourceIdentity(), content.source_identity, "source identity");
  expectSameBytes(view.sourceVisualList(), content.source_visual_list, "source visual list");
  expectSameBytes(view.sourceMeshes(), content.source_meshes, "source meshes");
  expectSameBytes(view.groups(), content.groups, "groups");
  expectSameBytes(view.groupVertices(), content.group_vertices, "group vertices");
  EXPECT_EQ(view.text(view.clusters()[0].name), "lower");
  EXPECT_EQ(view.text(view.groups()[0].name), "tip");
  EXPECT_EQ(view.text(view.info().unit_source), "Given by hand.");
}

TEST(Package, EqualContentGivesEqualBytes) { EXPECT_EQ(writePackage(samplePackage()), writePackage(samplePackage())); }

// The golden file is what this version of the format looks like: a difference means that packages already out there no
// longer read the same. SINEW_UPDATE_GOLDEN=1 writes it anew, for a new format version only.
void compareWithGolden(const PackageContent& content, const std::string& name, bool packed = false) {
  const std::string path = std::string(SINEW_GOLDEN) + "/" + name + "_v" + std::to_string(kFormatVersion) + ".sinew";
  const std::vector<std::byte> bytes = writePackage(content, packed);
  if (std::getenv("SINEW_UPDATE_GOLDEN") != nullptr) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> golden{std::istreambuf_iterator<char>(file), {}};
  ASSERT_EQ(golden.size(), bytes.size()) << path;
  for (std::size_t i = 0; i < golden.size(); ++i) ASSERT_EQ(std::byte(golden[i]), bytes[i]) << "byte " << i;
}

TEST(Package, MatchesGoldenBytes) { compareWithGolden(test::samplePackage(), "sample"); }

TEST(Package, WithMechanicsMatchesGoldenBytes) { compareWithGolden(test::mechanicsPackage(), "mechanics"); }

TEST(Package, WithFieldsMatchesGoldenBytes) { compareWithGolden(test::fieldPackage(), "fields"); }

TEST(Package, PackedMatchesGoldenBytes) {
  compareWithGolden(test::samplePackage(), "sample_packed", true);
  compareWithGolden(test::fieldPackage(), "fields_packed", true);
}

// What a block of numbers with one exponent rounds to.
void expectClose(const void* packed, const void* plain, const SectionRule& rule, std::size_t count) {
  const std::size_t words = rule.element_bytes / 4, block = rule.packing.block;
  for (std::size_t e = 0; e < count; ++e) {
    const char* a = static_cast<const char*>(packed) + e * rule.element_bytes;
    const char* b = static_cast<const char*>(plain) + e * rule.element_bytes;
    EXPECT_EQ(std::memcmp(a, b, 4 * (words - block)), 0) << sectionName(rule.id) << " element " << e;
    std::vector<float> read(block), written(block);
    if (block == 0) continue;
    std::memcpy(read.data(), a + 4 * (words - block), 4 * block);
    std::memcpy(written.data(), b + 4 * (words - block), 4 * block);
    float largest = 0;
    for (const float x : written) largest = std::max(largest, std::fabs(x));
    for (std::size_t i = 0; i < block; ++i) {
      EXPECT_NEAR(read[i], written[i], std::ldexp(largest, -15)) << sectionName(rule.id) << " element " << e;
    }
  }
}

TEST(Package, PackedSectionsReadAsWrittenButForTheirRounding) {
  PackageContent sample = samplePackage(), fields = test::fieldPackage();
  // A source vertex that no face uses: none in the narrow index too.
  ASSERT_TRUE(std::any_of(sample.source_identity.begin(), sample.source_identity.end(),
                          [](const SourceIdentity& s) { return s.welded == kNone; }));
  for (const PackageContent* content : {&sample, &fields}) {
    const std::vector<std::byte> plain_bytes = writePackage(*content), packed_bytes = writePackage(*content, true);
    EXPECT_LT(packed_bytes.size(), plain_bytes.size());
    const AlignedBytes plain(plain_bytes), packed(packed_bytes);
    PackageView a, b;
    ASSERT_EQ(PackageView::open(plain.span(), a).reason, "");
    ASSERT_EQ(PackageView::open(packed.span(), b).reason, "");
    ASSERT_EQ(a.sections().size(), b.sections().size());
    std::size_t smaller = 0;
    for (std::size_t i = 0; i < a.sections().size(); ++i) {
      const SectionRule& rule = kSectionRules[section::indexOf(a.sections()[i].id)];
      const SectionData one = a.sectionData(rule.id), other = b.sectionData(rule.id);
      ASSERT_EQ(one.count, other.count);
      EXPECT_EQ(b.sections()[i].packed, rule.packing.possible());
      EXPECT_EQ(b.sections()[i].bytes,
                one.count * (rule.packing.possible() ? rule.packing.bytes(2) : rule.element_bytes));
      smaller += b.sections()[i].packed ? 1U : 0U;
      if (rule.packing.possible()) {
        expectClose(other.data, one.data, rule, one.count);
      } else {
        EXPECT_EQ(std::memcmp(one.data, other.data, one.count * rule.element_bytes), 0);
      }
    }
    EXPECT_GT(smaller, 5U);
    // What was unpacked lives with the view, also with a copy of it.
    PackageView copy = b;
    b = PackageView();
    EXPECT_EQ(copy.tetrahedra().size(), a.tetrahedra().size());
    EXPECT_EQ(copy.tetrahedra()[0].vertex, a.tetrahedra()[0].vertex);
  }
}

TEST(Packing, IndicesTakeThreeBytesWhereTwoAreFewAndAreLeftAloneWhereThreeAre) {
  const Packing indices = {3, 0, 0};
  const auto packedAs = [&](std::array<std::uint32_t, 3> triangle, std::uint32_t& width) {
    const std::vector<std::byte> packed = pack(indices, std::as_bytes(std::span(triangle)), width);
    std::array<std::uint32_t, 3> back{};
    if (!packed.empty()) {
      EXPECT_EQ(packed.size(), indices.bytes(width));
      EXPECT_EQ(packedWidth(indices, indices.bytes(width)), width);
      EXPECT_TRUE(unpack(indices, width, packed, reinterpret_cast<std::byte*>(back.data())));
      EXPECT_EQ(back, triangle);
    }
    return packed.size();
  };
  std::uint32_t width = 0;
  EXPECT_EQ(packedAs({0, 0xfffe, kNone}, width), 6U);
  EXPECT_EQ(packedAs({0, 0xffff, kNone}, width), 9U);
  EXPECT_EQ(packedAs({0, 0xfffffe, kNone}, width), 9U);
  EXPECT_EQ(packedAs({0, 0xffffff, 0}, width), 0U);
}

TEST(Packing, NumbersOfAnySizeKeepTheirBlocksPrecision) {
  const Packing block = {0, 0, 3};
  for (const float scale : {0.0F, 1e-30F, 1e-9F, 1.0F, 1e18F, 1e37F}) {
    const std::array<float, 3> written = {scale, -0.9999999F * scale, 1e-5F * scale};
    std::uint32_t width = 0;
    const std::vector<std::byte> packed = pack(block, std::as_bytes(std::span(written)), width);
    std::array<float, 3> read{};
    ASSERT_TRUE(unpack(block, 2, packed, reinterpret_cast<std::byte*>(read.data())));
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(read[i], written[i], std::ldexp(scale, -15)) << scale;
  }
}

TEST(Package, PackedElementsOfAnotherSizeOrExponentAreRefused) {
  const std::vector<std::byte> good = writePackage(samplePackage(), true);
  const auto refusalAfter = [&](std::uint32_t id, auto change) {
    AlignedBytes bytes(good);
    Header header;
    std::memcpy(&header, bytes.span().data(), sizeof header);
    for (std::uint32_t i = 0; i < header.section_count; ++i) {
      std::byte* at = bytes.span().data() + sizeof(Header) + i * sizeof(SectionEntry);
      SectionEntry entry;
      std::memcpy(&entry, at, sizeof entry);
      if (entry.id != id) continue;
      change(entry, bytes.span().data() + entry.offset);
      std::memcpy(at, &entry, sizeof entry);
    }
    test::reseal(bytes.span());
    PackageView view;
    return PackageView::open(bytes.span(), view).reason;
  };
  EXPECT_EQ(refusalAfter(section::visual_positions, [](SectionEntry&, std::byte*) {}), "");
  EXPECT_NE(refusalAfter(section::visual_positions,
                         [](SectionEntry&, std::byte* p) {
                           const std::int16_t exponent = 128;
                           std::memcpy(p, &exponent, 2);
                         })
                .find("VPOS: an exponent"),
            std::string::npos);
  EXPECT_NE(refusalAfter(section::visual_positions,
                         [](SectionEntry& e, std::byte*) {
                           e.element_count *= 2;
                           e.element_bytes /= 2;
                         })
                .find("packed elements of 4 bytes, must be 8"),
            std::string::npos);
  EXPECT_NE(refusalAfter(section::info, [](SectionEntry& e, std::byte*) { e.flags |= kSectionPacked; }).find("flags"),
            std::string::npos);
}

TEST(Package, ContentOfAViewIsWhatWasWritten) {
  for (const PackageContent& content : {samplePackage(), test::mechanicsPackage(), test::fieldPackage()}) {
    const AlignedBytes bytes(writePackage(content));
    PackageView view;
    ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
    EXPECT_EQ(writePackage(contentOf(view)), writePackage(content));
  }
}

TEST(Package, FieldsReadAsWritten) {
  const PackageContent content = test::residualPackage();
  const test::AlignedBytes bytes(writePackage(content));
  PackageView view;
  ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
  EXPECT_EQ(view.features() >> 12, 1U);
  expectSameBytes(view.fields(), content.fields, "fields");
  expectSameBytes(view.fieldFunctions(), content.field_functions, "functions");
  expectSameBytes(view.fieldPacks(), content.field_packs, "packs");
  expectSameBytes(view.fieldGradients(), content.field_gradients, "gradients");
  expectSameBytes(view.fieldValues(), content.field_values, "values");
  expectSameBytes(view.fieldPoints(), content.field_points, "points");
  expectSameBytes(view.distanceGrids(), content.distance_grids, "distance grids");
  expectSameBytes(view.distanceValues(), content.distance_values, "distances");
  expectSameBytes(view.fieldPointValues(), content.field_point_values, "point values");
  expectSameBytes(view.fieldModes(), content.field_modes, "modes");
  expectSameBytes(view.fieldFibres(), content.field_fibres, "fibres");
  expectSameBytes(view.fieldFibreValues(), content.field_fibre_values, "fibre values");
  expectSameBytes(view.fieldTethers(), content.field_tethers, "tethers");
  expectSameBytes(view.fieldTetherValues(), content.field_tether_values, "tether values");
  expectSameBytes(view.fieldResiduals(), content.field_residuals, "residuals");
  expectSameBytes(view.fieldResidualValues(), content.field_residual_values, "residual values");
  expectSameBytes(view.fieldResidualLocals(), content.field_residual_locals, "residual locals");
  EXPECT_EQ(view.fields()[1].driven_count, 4U);
  EXPECT_EQ(view.fieldFunctions()[view.fields()[1].first_function + 3].monomial, 3U);
  EXPECT_EQ(view.text(view.pinSets()[view.fieldFunctions()[4].pin_set].name), "base");
  EXPECT_EQ(view.fieldFunctions()[4].decay, 0);
  EXPECT_GT(view.fieldFunctions()[8].decay, 0);
  EXPECT_EQ(view.fieldPacks()[1].cluster,
            (std::array<std::uint32_t, 8>{0, kNone, kNone, kNone, kNone, kNone, kNone, kNone}));
  ASSERT_EQ(view.fieldFibres().size(), 3U);
  EXPECT_EQ(view.fieldFibres()[2].field, 1U);
  EXPECT_EQ(view.fieldFibres()[1].cluster, 1U);
  const std::uint32_t channel = view.mechanics()[view.fieldFibres()[1].cluster].channel;
  EXPECT_EQ(view.text(view.channels()[channel].name), "frown");
  EXPECT_EQ(view.fieldFibres()[2].first_value, 8U);
  EXPECT_NEAR(view.fieldFibres()[0].tension, 0.375 * 2600 * (1.0 / 9 + 1.0 / 6), 1e-3);
  ASSERT_EQ(view.fieldTethers().size(), 1U);
  EXPECT_EQ(view.fieldTethers()[0].field, 1U);
  ASSERT_EQ(view.fieldTetherValues().size(), 25U);
  EXPECT_NEAR(view.fieldTetherValues()[24], (40 + 90) / 2.5, 1e-4);  // the inner function is 1 / sqrt(2.5 kg) there
}

// What a field is: x = sum phi z, here under a stretch, a turn and a shift, which z = A rest + b one makes.
TEST(Package, FieldsMoveAsTheyAreTold) {
  const PackageContent content = test::fieldPackage();
  const auto moved = [](const Float3& x) { return Float3{2 * x[0] + 1, -3 * x[2], x[1] + x[0] - 4}; };
  const auto check = [&](const Field& field, std::uint32_t first, const std::vector<Lanes>& values, std::size_t i,
                         const Float3& at) {
    Float3 sum = {};
    for (std::uint32_t j = 0; j < field.function_count; ++j) {
      const FieldFunction& f = content.field_functions[field.first_function + j];
      const Float3 whole = moved(f.rest), zero = moved({0, 0, 0});
      const float phi = values[first + i / 8 * field.function_count + j][i % 8];
      for (std::size_t c = 0; c < 3; ++c) sum[c] += phi * (whole[c] - zero[c] + f.one * zero[c]);
    }
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], moved(at)[c], 1e-5) << i;
  };
  for (const Field& field : content.fields) {
    for (std::size_t i = 0; i < content.physical_vertices.size(); ++i) {
      check(field, field.first_value, content.field_values, i, content.physical_vertices[i].rest_position);
    }
    for (std::size_t i = 0; i < field.point_count; ++i) {
      check(field, field.first_point_value, content.field_point_values, i,
            content.field_points[field.first_point + i].at);
    }
  }
  for (const FieldFibre& fibre : content.field_fibres) {
    const Field& field = content.fields[fibre.field];
    Float3 sum = {};
    for (std::uint32_t j = 0; j < field.function_count; ++j) {
      const FieldFunction& f = content.field_functions[field.first_function + j];
      const Float3 whole = moved(f.rest), zero = moved({0, 0, 0});
      const float b = content.field_fibre_values[fibre.first_value + j];
      for (std::size_t c = 0; c < 3; ++c) sum[c] += b * (whole[c] - zero[c] + f.one * zero[c]);
    }
    const Float3 end = moved(content.mechanics[fibre.cluster].fibre), start = moved({0, 0, 0});
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(sum[c], end[c] - start[c], 1e-5) << fibre.cluster;
  }
}

// 1/2 sum T_ij z_i . z_j is that of springs from two vertices to where their pin set would have them.
TEST(Package, TethersTieVerticesToTheirPinSet) {
  const PackageContent content = test::fieldPackage();
  const Field& field = content.fields[1];
  ASSERT_EQ(field.function_count, 5U);
  const std::vector<Float3> z = {{3, -1, 2}, {0, 2, 0.5F}, {-1, 0, 0}, {0.25F, 0, 4}, {7, -5, 1}};
  double wanted = 0, found = 0;
  for (const auto& [vertex, kappa] : {std::pair{3U, 40.0}, std::pair{4U, 90.0}}) {
    const Float3& at = content.physical_vertices[vertex].rest_position;
    for (std::size_t c = 0; c < 3; ++c) {
      double off = -double(z[0][c]);
      for (std::size_t axis = 0; axis < 3; ++axis) off -= double(at[axis]) * double(z[1 + axis][c]);
      for (std::size_t j = 0; j < 5; ++j) {
        off += double(content.field_values[field.first_value + j][vertex]) * double(z[j][c]);
      }
      wanted += 0.5 * kappa * off * off;
    }
  }
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t j = 0; j < 5; ++j) {
      const double t = double(content.field_tether_values[content.field_tethers[0].first_value + 5 * i + j]);
      for (std::size_t c = 0; c < 3; ++c) found += 0.5 * t * double(z[i][c]) * double(z[j][c]);
    }
  }
  EXPECT_GT(wanted, 100);
  EXPECT_NEAR(found, wanted, 1e-5 * wanted);
}

TEST(Package, SeveralBodiesHaveFieldsEach) {
  for (const std::size_t copies : {2U, 3U}) {
    const test::AlignedBytes bytes(writePackage(test::repeated(test::fieldPackage(), copies)));
    PackageView view;
    ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
    EXPECT_EQ(view.fields().size(), 2 * copies);
    EXPECT_EQ(view.fieldFibres().size(), 3 * copies);
    EXPECT_EQ(view.fieldFibres().back().cluster, 2 * (copies - 1));
    ASSERT_EQ(view.fieldTethers().size(), copies);
    EXPECT_EQ(view.fieldTethers().back().field, 2 * copies - 1);
    EXPECT_EQ(view.fieldTethers().back().first_value, 25 * (copies - 1));
    EXPECT_EQ(view.fieldPacks().back().cluster[0], 2 * (copies - 1));
  }
}

TEST(Package, MechanicsReadAsWritten) {
  const test::AlignedBytes bytes(writePackage(test::mechanicsPackage()));
  PackageView view;
  ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
  EXPECT_EQ(view.features() >> 8, 15U);
  ASSERT_EQ(view.mechanics().size(), 2U);
  EXPECT_EQ(view.mechanics()[0].young, 2e5F);
  EXPECT_EQ(view.mechanics()[1].per_step_beta[2], 1);
  EXPECT_EQ(view.curvePoints()[2].response, 5);
  EXPECT_EQ(view.text(view.channels()[view.mechanics()[0].channel].name), "smile");
  EXPECT_EQ(view.vertexStiffness()[4], 0.25F);
  EXPECT_EQ(view.pinWeights()[3], 0.5F);
}

TEST(Package, SectionDataIsThatOfTheTable) {
  const test::AlignedBytes bytes(writePackage(test::mechanicsPackage()));
  PackageView view;
  ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
  std::size_t present = 0;
  for (const std::uint32_t id : section::kAll) present += std::size_t(view.sectionData(id).count > 0);
  EXPECT_EQ(present, view.sections().size());
  for (const SectionInfo& info : view.sections()) {
    const SectionData data = view.sectionData(info.id);
    EXPECT_EQ(data.count, info.element_count) << sectionName(info.id);
    EXPECT_EQ(data.count * data.bytes_each, info.bytes) << sectionName(info.id);
  }
  EXPECT_EQ(view.sectionData(section::mechanics).data, view.mechanics().data());
  EXPECT_EQ(view.sectionData(fourcc("NONE")).bytes_each, 0U);
}

TEST(Package, OnlySectionsThatAreNeededExist) {
  PackageContent content = samplePackage();
  PackageContent bare;
  bare.info = content.info;
  bare.info.inverted_tetrahedra = 0;
  bare.strings = content.strings;
  bare.pieces = {{0, 5, 0, 0, 0, 2, {}}};
  bare.physical_vertices = content.physical_vertices;
  bare.clusters = content.clusters;
  bare.clusters[1].mode = ClusterMode::linear;
  bare.clusters[1].quadratic = kNone;
  bare.memberships = content.memberships;
  const AlignedBytes bytes(writePackage(bare));
  PackageView view;
  ASSERT_EQ(PackageView::open(bytes.span(), view).reason, "");
  EXPECT_EQ(view.sections().size(), 6U);
  EXPECT_EQ(view.features(), 0U);
  EXPECT_TRUE(view.tetrahedra().empty());
  EXPECT_TRUE(view.visualPositions().empty());
  EXPECT_EQ(view.text(view.pieces()[0].name), "");
}

TEST(Package, RefusalLeavesTheViewAsItWas) {
  const AlignedBytes good(writePackage(samplePackage()));
  PackageView view;
  ASSERT_EQ(PackageView::open(good.span(), view).reason, "");
  AlignedBytes bad(good.span());
  bad.span().back() ^= std::byte{1};
  EXPECT_NE(PackageView::open(bad.span(), view).reason, "");
  EXPECT_EQ(view.clusters().data(), reinterpret_cast<const Cluster*>(
                                        good.span().data() + test::entryOf(good.span(), section::clusters).offset));
}

TEST(Package, UnalignedBytesAreRefused) {
  std::vector<std::byte> bytes = writePackage(samplePackage());
  bytes.insert(bytes.begin(), std::byte{0});
  const AlignedBytes shifted(bytes);
  PackageView view;
  EXPECT_NE(PackageView::open(shifted.span().subspan(1), view).reason.find("aligned"), std::string::npos);
}

TEST(Package, OtherVersionsAreNamed) {
  for (const std::uint32_t version : {0U, kFormatVersion - 1, kFormatVersion + 1, 0xffffffffU}) {
    std::vector<std::byte> bytes = writePackage(samplePackage());
    std::memcpy(bytes.data() + offsetof(Header, format_version), &version, sizeof version);
    test::reseal(bytes);
    const std::string reason = reasonOf(bytes);
    EXPECT_NE(reason.find("format version " + std::to_string(version)), std::string::npos) << reason;
    EXPECT_NE(reason.find("reads version " + std::to_string(kFormatVersion)), std::string::npos) << reason;
    const char* const cure = version < kFormatVersion ? ": bake the package again" : ": use a newer version";
    EXPECT_NE(reason.find(cure), std::string::npos) << reason;
  }
}

// The bytes that older versions of the format gave samplePackage().
TEST(Package, OfAnOlderVersionIsToBeBakedAgain) {
  for (std::uint32_t version = 1; version < kFormatVersion; ++version) {
    std::ifstream file(std::string(SINEW_GOLDEN) + "/sample_v" + std::to_string(version) + ".sinew", std::ios::binary);
    const std::vector<char> old{std::istreambuf_iterator<char>(file), {}};
    ASSERT_EQ(old.size(), 4480U);
    const std::string reason = reasonOf(std::as_bytes(std::span{old}));
    EXPECT_NE(reason.find("format version " + std::to_string(version) + ","), std::string::npos) << reason;
    EXPECT_NE(reason.find(": bake the package again"), std::string::npos) << reason;
  }
}

TEST(Package, UnknownOptionalSectionIsSkipped) {
  std::vector<std::byte> bytes = writePackage(samplePackage());
  SectionEntry entry = test::entryOf(bytes, section::visual_colors);
  entry.id = fourcc("ZZZ9");
  test::setEntry(bytes, section::visual_colors, entry);
  test::reseal(bytes);
  const AlignedBytes aligned(bytes);
  PackageView view;
  ASSERT_EQ(PackageView::open(aligned.span(), view).reason, "");
  EXPECT_TRUE(view.visualColors().empty());
  std::size_t unknown = 0;
  for (const SectionInfo& info : view.sections()) {
    EXPECT_EQ(info.known, info.id != entry.id);
    unknown += info.known ? 0 : 1;
  }
  EXPECT_EQ(unknown, 1U);
}

TEST(Package, UnknownRequiredSectionIsNamed) {
  std::vector<std::byte> bytes = writePackage(samplePackage());
  SectionEntry entry = test::entryOf(bytes, section::visual_colors);
  entry.id = fourcc("ZZZ9");
  entry.flags = kSectionRequired;
  test::setEntry(bytes, section::visual_colors, entry);
  test::reseal(bytes);
  const std::string reason = reasonOf(bytes);
  EXPECT_NE(reason.find("ZZZ9"), std::string::npos) << reason;
  EXPECT_NE(reason.find("newer version"), std::string::npos) << reason;
}

TEST(Package, SectionNamesPrint) {
  EXPECT_EQ(sectionName(section::clusters), "CLUS");
  EXPECT_EQ(sectionName(0x0041ff20), "\\x20\\xffA\\x00");
}

TEST(PackageContent, AddTextStoresEqualTextsOnce) {
  PackageContent content;
  const StringRef first = content.addText("belly"), other = content.addText("ear"), again = content.addText("belly");
  EXPECT_EQ(first.offset, again.offset);
  EXPECT_EQ(first.bytes, 5U);
  EXPECT_EQ(other.offset, 5U);
  EXPECT_EQ(content.addText("").bytes, 0U);
  EXPECT_EQ(content.strings.size(), 8U);
}

TEST(PackageContent, AddTextStoresManyTextsOnce) {
  PackageContent content;
  const auto text = [](int i) { return "group_" + std::to_string(i) + ";"; };
  std::vector<StringRef> first;
  for (int i = 0; i < 20000; ++i) first.push_back(content.addText(text(i)));
  const std::size_t bytes = content.strings.size();
  EXPECT_GT(bytes, 200000U);
  for (int i = 0; i < 20000; ++i) {
    const StringRef again = content.addText(text(i)), once = first[std::size_t(i)];
    ASSERT_EQ(again.offset, once.offset) << i;
    ASSERT_EQ(again.bytes, once.bytes) << i;
    ASSERT_EQ(std::string_view(content.strings.data() + again.offset, again.bytes), text(i));
  }
  EXPECT_EQ(content.strings.size(), bytes);
}

}  // namespace
}  // namespace sinew::formats
