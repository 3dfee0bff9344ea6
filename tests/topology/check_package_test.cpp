// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/check_package.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <new>
#include <set>

#include "tests/support/field_content.h"
#include "tests/support/sample_package.h"
#include "tools/bake/check_source.h"

namespace sinew::tools {
namespace {

using formats::PackageContent;

const Finding* find(const std::vector<Finding>& findings, const std::string& id) {
  const auto at = std::find_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.id == id; });
  return at == findings.end() ? nullptr : &*at;
}

template <class Check>
std::vector<Finding> checkAsItIs(const PackageContent& content, const Check& check) {
  const std::vector<std::byte> bytes = formats::writePackage(content);
  struct Aligned {
    std::align_val_t alignment{formats::kSectionAlignment};
    void operator()(std::byte* p) const { ::operator delete(p, alignment); }
  };
  const std::unique_ptr<std::byte, Aligned> memory(
      static_cast<std::byte*>(::operator new(bytes.size(), std::align_val_t(formats::kSectionAlignment))));
  std::memcpy(memory.get(), bytes.data(), bytes.size());
  formats::PackageView view;
  const formats::PackageError error = formats::PackageView::open({memory.get(), bytes.size()}, view);
  if (!error.reason.empty()) {
    ADD_FAILURE() << error.reason;
    return {};
  }
  return check(view);
}

std::vector<Finding> checkAsItIs(const PackageContent& content) { return checkAsItIs(content, checkPackage); }

std::set<std::string> faults(const std::vector<Finding>& findings) {
  std::set<std::string> ids;
  for (const Finding& f : findings) {
    if (f.severity != Severity::info) ids.insert(f.id);
  }
  ids.erase("small-clusters");  // the sample's quadratic cluster has 5 vertices
  return ids;
}

std::vector<Finding> check(PackageContent content) {
  test::addFields(content);
  return checkAsItIs(content);
}

TEST(CheckPackage, OneWithoutFieldsSaysSo) {
  const auto findings = checkAsItIs(test::samplePackage());
  ASSERT_NE(find(findings, "no-fields"), nullptr);
  EXPECT_EQ(find(check(test::samplePackage()), "no-fields"), nullptr);
}

TEST(CheckPackage, ASoundOneHasFactsOnly) {
  const auto findings = check(test::samplePackage());
  EXPECT_EQ(faults(findings), std::set<std::string>{});
  ASSERT_NE(find(findings, "small-clusters"), nullptr);
  EXPECT_EQ(find(findings, "small-clusters")->place, "clusters whole");
  ASSERT_NE(find(findings, "attachment-rest-error"), nullptr);
  EXPECT_EQ(find(findings, "attachment-rest-error")->count, 6U);
  ASSERT_NE(find(findings, "pieces"), nullptr);
  EXPECT_EQ(find(findings, "pieces")->place, "corner");
  EXPECT_EQ(packageVerdict(findings), "1 warning: it can be simulated");
}

struct Fault {
  const char* name;
  std::function<void(PackageContent&)> make;
  std::set<std::string> ids;
  bool error;
};

class BrokenPackage : public ::testing::TestWithParam<Fault> {};

TEST_P(BrokenPackage, IsFound) {
  PackageContent content = test::samplePackage();
  GetParam().make(content);
  const auto findings = check(content);
  EXPECT_EQ(faults(findings), GetParam().ids);
  EXPECT_EQ(hasErrors(findings), GetParam().error);
}

INSTANTIATE_TEST_SUITE_P(
    All, BrokenPackage,
    ::testing::Values(
        Fault{"InvertedTetrahedron",
              [](PackageContent& c) { std::swap(c.tetrahedra[0].vertex[0], c.tetrahedra[0].vertex[1]); },
              {"inverted-tetrahedra", "attachment-error"},
              true},
        Fault{"AttachmentOffByTwoMillionths",
              [](PackageContent& c) { c.visual_positions[1][0] += 4e-6F; },
              {"attachment-error"},
              true},
        Fault{"ClusterWeightsOff",
              [](PackageContent& c) {
                c.barycentric.clear();
                c.cluster_attachments[0].weight = 0.75001F;
                c.visual_positions[0] = {0.5F, 0, 0};
              },
              {"attachment-error"},
              true},
        Fault{"ClusterMassOff", [](PackageContent& c) { c.clusters[1].mass *= 1.001F; }, {"wrong-cluster-mass"}, true},
        Fault{"ForeignMoment", [](PackageContent& c) { c.clusters[0].a_qq[0] *= 0.95F; }, {"wrong-moments"}, true},
        Fault{"QuadraticMomentOff",
              [](PackageContent& c) {
                for (float& x : c.quadratic_moments[0].a_qq) x *= 1.1F;
              },
              {"wrong-moments"},
              true},
        Fault{"TwinClusters",
              [](PackageContent& c) {
                for (std::uint32_t i = 0; i < 4; ++i) {
                  c.memberships[i].share /= 2;
                  formats::Membership copy = c.memberships[i];
                  c.memberships.insert(c.memberships.begin() + 4 + i, copy);
                }
                c.clusters[0].mass /= 2;
                c.clusters.insert(c.clusters.begin(), c.clusters[0]);
                c.clusters[1].first_member = 4;
                c.clusters[2].first_member = 8;
                c.pieces[0].cluster_count = 3;
                for (auto& use : c.cluster_attachments) use.cluster += use.cluster == 1 ? 1 : 0;
              },
              {"identical-clusters"},
              false},
        Fault{"WrongAngles", [](PackageContent& c) { c.info.min_dihedral_deg = 60; }, {"wrong-quality-record"}, false},
        Fault{"NoPicture", [](PackageContent& c) { c.texture_bytes[1] = std::byte{0}; }, {"unknown-picture"}, false},
        Fault{"PictureOfAnotherType",
              [](PackageContent& c) { c.textures[0].mime = c.addText("image/jpeg"); },
              {"mislabelled-picture"},
              false},
        Fault{"TooMuchVolume", [](PackageContent& c) { c.info.source_volume = 0.1F; }, {"volume-ratio"}, false}),
    [](const auto& tested) { return std::string(tested.param.name); });

TEST(CheckPackage, PicturesThatCannotBeDrawnAreSaid) {
  PackageContent content = test::samplePackage();
  ImportOptions options;
  options.worker = SINEW_TEST_IMPORT_WORKER;
  const auto unread = [&] {
    return checkAsItIs(content, [&](const formats::PackageView& view) { return checkPictures(view, options); });
  };
  EXPECT_TRUE(unread().empty());
  content.texture_bytes.pop_back();
  content.textures[0].bytes -= 1;
  const auto findings = unread();
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].id, "texture-not-read");
  EXPECT_EQ(findings[0].severity, Severity::warning);
  EXPECT_EQ(findings[0].place, "orange.png");
}

TEST(CheckPackage, PicturesHaveOneListOfKinds) {
  PackageContent content = test::samplePackage();
  for (const std::string_view head : {"#?RADIANCE\n", "#?RGBE\n"}) {
    content.texture_bytes.clear();
    for (const char c : head) content.texture_bytes.push_back(std::byte(c));
    content.textures = {{content.addText("sky.hdr"), content.addText("image/vnd.radiance"), 0, head.size()}};
    EXPECT_EQ(faults(check(content)), std::set<std::string>{});
  }
}

TEST(CheckPackage, PlacesAreSourceVertices) {
  PackageContent content = test::samplePackage();
  content.visual_positions[4][1] += 1e-3F;
  const auto findings = check(content);
  const Finding* f = find(findings, "attachment-error");
  ASSERT_NE(f, nullptr);
  EXPECT_EQ(f->place_kind, "vertex");
  EXPECT_EQ(f->places, (std::vector<std::uint32_t>{5}));  // visual vertices 4 and 5 come from source vertex 5
  EXPECT_EQ(f->count, 1U);
}

}  // namespace
}  // namespace sinew::tools
