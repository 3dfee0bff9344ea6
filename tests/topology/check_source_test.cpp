// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/check_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <regex>
#include <set>

#include "tests/support/obj_reader.h"
#include "tools/author/settings.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::makeMesh;
using testing::readObj;
using Faces = std::vector<std::vector<std::uint32_t>>;
using Places = std::vector<std::uint32_t>;

std::vector<Finding> check(const VisualMesh& mesh) { return checkSource(mesh, analyzeTopology(mesh)); }

std::vector<Finding> checkGenerated(const std::string& name) {
  return check(readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / name));
}

const Finding* find(const std::vector<Finding>& findings, const std::string& id) {
  const auto at = std::find_if(findings.begin(), findings.end(), [&](const Finding& f) { return f.id == id; });
  return at == findings.end() ? nullptr : &*at;
}

std::set<std::string> warnings(const std::vector<Finding>& findings) {
  std::set<std::string> ids;
  for (const Finding& f : findings) {
    if (f.severity != Severity::info) ids.insert(f.id);
  }
  return ids;
}

struct Expected {
  const char* file;
  std::set<std::string> ids;  // all warnings and errors
};

// A cure that names a setting names one that there is.
void expectKnownSettings(const std::string& text) {
  Settings settings;
  std::set<std::string> keys;
  for (const Settings::Declaration& d : Settings::declarations(settings)) keys.emplace(d.key);
  const std::regex key("(import|tetrahedra|clusters|material|attachment|package)[.][a-z_]+");
  for (std::sregex_iterator i(text.begin(), text.end(), key), end; i != end; ++i) {
    EXPECT_TRUE(keys.contains(i->str())) << i->str();
  }
}

class GeneratedSource : public ::testing::TestWithParam<Expected> {};

TEST_P(GeneratedSource, HasExactlyItsFaults) {
  const auto findings = checkGenerated(GetParam().file);
  EXPECT_EQ(warnings(findings), GetParam().ids);
  EXPECT_FALSE(hasErrors(findings));
  for (const Finding& f : findings) {
    EXPECT_FALSE(f.message.empty());
    EXPECT_LE(f.places.size(), Finding::kMaxPlaces);
    expectKnownSettings(f.cure);
    EXPECT_TRUE(std::set<std::uint32_t>(f.places.begin(), f.places.end()).size() == f.places.size()) << f.id;
    if (f.severity != Severity::info) {
      EXPECT_FALSE(f.cure.empty()) << f.id;
      EXPECT_FALSE(f.places.empty()) << f.id;
      EXPECT_NE(f.message.find(std::to_string(f.count)), std::string::npos) << f.message;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, GeneratedSource,
    ::testing::Values(Expected{"cube.obj", {}}, Expected{"beam.obj", {}}, Expected{"l_bar.obj", {}},
                      Expected{"sphere.obj", {}}, Expected{"torus.obj", {}}, Expected{"capsule.obj", {}},
                      Expected{"hollow_sphere.obj", {}}, Expected{"chain.obj", {}},
                      Expected{"slab.obj", {"thin-parts"}}, Expected{"two_spheres.obj", {"self-intersections"}},
                      Expected{"bad_hole.obj", {"open-boundary"}}, Expected{"bad_tjunction.obj", {"cracks"}},
                      Expected{"bad_fin.obj", {"open-flaps", "non-manifold-edges", "self-intersections"}},
                      Expected{"bad_inner_wall.obj", {"non-manifold-edges"}},
                      Expected{"bad_bowtie.obj", {"non-manifold-vertices"}},
                      Expected{"bad_duplicate.obj", {"duplicate-faces"}}, Expected{"bad_sliver.obj", {}},
                      Expected{"bad_tiny.obj", {}}, Expected{"bad_far.obj", {}}, Expected{"bad_unreferenced.obj", {}}),
    [](const auto& tested) { return std::string(tested.param.file, std::string_view(tested.param.file).find('.')); });

TEST(CheckSource, CountsFacesAsTheArtistDoes) {
  // Eight of 104 polygons are doubles: the last ones.
  const auto findings = checkGenerated("bad_duplicate.obj");
  const Finding* f = find(findings, "duplicate-faces");
  ASSERT_NE(f, nullptr);
  EXPECT_EQ(f->count, 8U);
  EXPECT_EQ(f->place_kind, "face");
  EXPECT_EQ(f->places, (Places{96, 97, 98, 99, 100, 101, 102, 103}));
}

TEST(CheckSource, KeepsWhatImportFound) {
  VisualMesh mesh =
      makeMesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}});
  mesh.findings.push_back(
      {"missing-texture", Severity::warning, "1 texture is missing", 1, "", {}, "skin.png", "Find it."});
  const auto findings = check(mesh);
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"missing-texture"}));
  EXPECT_EQ(findings.front().place, "skin.png");
  EXPECT_EQ(sourceVerdict(findings), "1 warning: it can be baked");
}

// A box of six quads.
void addBox(std::vector<Vector3d>& positions, Faces& faces, const Vector3d& low, const Vector3d& high) {
  const std::uint32_t first = std::uint32_t(positions.size());
  for (std::uint32_t i = 0; i < 8; ++i) {
    positions.emplace_back(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z());
  }
  for (const auto& f : Faces{{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    faces.push_back({first + f[0], first + f[1], first + f[2], first + f[3]});
  }
}

TEST(CheckSource, NamesTheRimOfAHoleInSourceNumbers) {
  // A box without its face at the back, after two vertices no face uses.
  std::vector<Vector3d> positions = {{9, 9, 9}, {8, 8, 8}};
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  faces.erase(faces.begin());
  const auto findings = check(makeMesh(positions, faces));
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"open-boundary"}));
  const Finding* f = find(findings, "open-boundary");
  EXPECT_EQ(f->count, 1U);
  EXPECT_EQ(f->place_kind, "vertex");
  Places places = f->places;
  std::sort(places.begin(), places.end());
  EXPECT_EQ(places, (Places{2, 3, 4, 5}));
}

TEST(CheckSource, ALooseSheetBesideABodyIsNoHole) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  positions.insert(positions.end(), {{0, 1.1, 0}, {1, 1.1, 0}, {1, 1.6, 0.1}, {0, 1.6, 0.1}});
  faces.push_back({8, 9, 10, 11});
  const auto findings = check(makeMesh(positions, faces));
  // It reaches far, too.
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"loose-sheets", "large-sheets"}));
  EXPECT_EQ(find(findings, "loose-sheets")->count, 1U);
  EXPECT_EQ(find(findings, "loose-sheets")->places, (Places{6}));
}

TEST(CheckSource, ASmallBoxBesideALargeOneIsNoSheet) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  addBox(positions, faces, {0.4, 1.02, 0.4}, {0.5, 1.12, 0.5});
  const auto findings = check(makeMesh(positions, faces));
  EXPECT_TRUE(warnings(findings).empty());
  ASSERT_NE(find(findings, "small-parts"), nullptr);
  EXPECT_EQ(find(findings, "small-parts")->places, (Places{6}));
}

// A round hole of 1 m is 1 m across, however it lies.
TEST(CheckSource, AHoleIsAsWideAsItIs) {
  std::vector<Vector3d> positions = {{0, 0, 3}};
  Faces faces;
  constexpr std::uint32_t kSides = 24;
  for (std::uint32_t i = 0; i < kSides; ++i) {
    const double turn = 2 * std::numbers::pi * i / kSides;
    positions.push_back({0.5 * std::cos(turn), 0.5 * std::sin(turn), 0});
    faces.push_back({0, 1 + i, 1 + (i + 1) % kSides});
  }
  const auto findings = check(makeMesh(positions, faces));
  ASSERT_NE(find(findings, "open-boundary"), nullptr);
  EXPECT_NE(find(findings, "open-boundary")->message.find("24 points on the rim, 1 m across"), std::string::npos)
      << find(findings, "open-boundary")->message;
}

TEST(CheckSource, ASkinWithoutInsideIsSaidToEncloseNothing) {
  const auto findings = checkGenerated("skin_patch.obj");
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"encloses-nothing"}));
}

TEST(CheckSource, SheetsThatNearlyTouchAreFound) {
  for (const double gap : {1e-4, 5e-4, 5e-3, 0.1}) {
    std::vector<Vector3d> positions;
    Faces faces;
    addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
    addBox(positions, faces, {0, 1 + gap, 0}, {1, 2 + gap, 1});
    const auto findings = check(makeMesh(positions, faces));
    const Finding* f = find(findings, "near-coincident-parts");
    // The diagonal is about 2.45: a thousandth is 0.00245.
    ASSERT_EQ(f != nullptr, gap < 2e-3) << gap;
    if (f == nullptr) continue;
    EXPECT_EQ(f->count, 1U);
    EXPECT_EQ(f->places, (Places{3, 8}));
  }
}

TEST(CheckSource, FacesThatCrossAreNamed) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {2, 2, 2});
  addBox(positions, faces, {1.5, 0.5, 0.5}, {3, 1.5, 1.5});
  const auto findings = check(makeMesh(positions, faces));
  const Finding* f = find(findings, "self-intersections");
  ASSERT_NE(f, nullptr);
  // The face x = 2 of the first and the four sides of the second.
  EXPECT_EQ(f->count, 5U);
  EXPECT_EQ(f->places, (Places{5, 6, 7, 8, 9}));
  EXPECT_NE(f->message.find("all of two parts"), std::string::npos);
}

TEST(CheckSource, PartsFarApartBecomeBodies) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  addBox(positions, faces, {3, 0, 0}, {4, 1, 1});
  const auto findings = check(makeMesh(positions, faces));
  EXPECT_TRUE(warnings(findings).empty());
  ASSERT_NE(find(findings, "several-parts"), nullptr);
  ASSERT_NE(find(findings, "several-pieces"), nullptr);
  EXPECT_EQ(find(findings, "several-pieces")->count, 2U);
  expectKnownSettings(find(findings, "several-pieces")->cure);
  EXPECT_EQ(sourceVerdict(findings), "sound: it can be baked");
}

TEST(CheckSource, PartsThatNearlyShareABodyAreAWarning) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  addBox(positions, faces, {1.005, 0, 0}, {2, 1, 1});
  const auto findings = check(makeMesh(positions, faces));
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"near-pieces"}));
  const Finding* f = find(findings, "near-pieces");
  EXPECT_EQ(f->count, 2U);
  EXPECT_NE(f->message.find("the smallest gap is 5 mm"), std::string::npos) << f->message;
  EXPECT_NE(f->cure.find("--set tetrahedra.join=0.0021"), std::string::npos) << f->cure;
  expectKnownSettings(f->cure);
}

TEST(CheckSource, AFaceWithoutAreaIsNamed) {
  std::vector<Vector3d> positions;
  Faces faces;
  addBox(positions, faces, {0, 0, 0}, {1, 1, 1});
  positions.emplace_back(0.5, 0, 0);
  faces.push_back({0, 8, 1});
  const auto findings = check(makeMesh(positions, faces));
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"zero-area-faces"}));
  EXPECT_EQ(find(findings, "zero-area-faces")->places, (Places{6}));
}

TEST(CheckSource, ASourceWithoutAnyAreaCannotBeBaked) {
  const auto findings = check(makeMesh({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{0, 1, 2}}));
  EXPECT_EQ(warnings(findings), (std::set<std::string>{"no-area", "zero-area-faces"}));
  EXPECT_EQ(find(findings, "no-area")->severity, Severity::error);
  EXPECT_EQ(sourceVerdict(findings), "1 error, 1 warning: it cannot be baked as it is");
}

}  // namespace
}  // namespace sinew::tools
