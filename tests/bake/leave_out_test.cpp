// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/leave_out.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "sinew/runtime/world.h"
#include "tools/bake/bake.h"
#include "tools/bake/check_package.h"

namespace sinew::tools {
namespace {

using Bytes = std::map<std::string, std::uint64_t>;

// A cow with pinned hooves, a muscle, a mask, colours and clay for flesh: every need finds something.
const std::shared_ptr<const Asset>& cow() {
  static const std::shared_ptr<const Asset> asset = [] {
    Recipe recipe = parseRecipe(R"({"sinew_recipe": 3, "source": "spot_textured.glb",
        "settings": {"clusters.plastic_creep": 1, "tetrahedra.vertices": 400},
        "masks": {"head": {"half_space": [0, 0.3, 0.3], "normal": [0, 1, 1]}},
        "clusters": [{"name": "body", "from": {"all": true}},
                     {"name": "neck", "from": "head", "fibre": [0, 1, 0], "channel": "nod", "contraction": 0.2}],
        "colors": [{"from": {"all": true}, "color": [0.5, 0.4, 0.3]}],
        "pins": [{"name": "hooves", "from": {"half_space": [0, -0.6, 0], "normal": [0, -1, 0]}, "method": "hold"}]})",
                                std::filesystem::path(SINEW_MODELS) / "cow.json");
    recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
    Progress progress(false);
    return *Asset::fromMemory(bake(recipe, progress).package);
  }();
  return asset;
}

std::shared_ptr<const Asset> with(Needs needs) { return *Asset::fromMemory(packageWith(cow()->package(), needs)); }

Bytes sectionsOf(const Asset& asset) {
  Bytes bytes;
  for (const formats::SectionInfo& section : asset.package().sections()) {
    bytes[formats::sectionName(section.id)] = section.bytes;
  }
  return bytes;
}

TEST(LeaveOut, AllKeepsEveryByteButUnusedTexts) {
  const std::vector<std::byte> bytes = packageWith(cow()->package(), Needs::all());
  EXPECT_EQ(sectionsOf(**Asset::fromMemory(bytes)), sectionsOf(*cow()));
}

TEST(LeaveOut, EachNeedTakesItsSectionsAndNoOthers) {
  // Sections that go or shrink without a need; texts may with any.
  const std::map<Need, std::set<std::string>> own = {
      {Need::contact, {"FPNT", "FPTV", "DIST", "DVAL"}},
      {Need::cut, {}},  // touching needs the tetrahedra too
      {Need::pins,
       {"PSET", "PSTV", "PPIN", "FTHR", "FTHV", "FELD", "FFUN", "FPAK", "FGRD", "FVAL", "FPTV", "FPNT", "FMOD", "FFIB",
        "FFBV", "FRES", "FRSV", "FRSL"}},
      {Need::activation, {"CHAN", "FFIB", "FFBV"}},
      {Need::plasticity, {}},
      {Need::clusters, {"CLUS", "MEMB", "AQQ9", "CMEC"}},
      {Need::normals, {"VNRM"}},
      {Need::uvs, {"VUV0"}},
      {Need::colors, {"VCOL"}},
      {Need::textures, {"VTEX", "TEXB"}},
      {Need::identity, {"VSRC", "SVTX", "SVLS", "SMSH"}},
      {Need::groups, {"GRUP", "GRPV"}},
      {Need::masks, {"MASK", "MSKV"}},
  };
  const Bytes all = sectionsOf(*cow());
  for (const auto& [need, sections] : own) {
    const std::string name(kNeedDeclarations[std::size_t(need)].name);
    const auto asset = with(Needs::all().without(need));
    const Bytes left = sectionsOf(*asset);
    std::uint64_t saved = 0, in_file = cow()->package().totalBytes() - asset->package().totalBytes();
    for (const auto& [section, bytes] : all) {
      const auto at = left.find(section);
      const std::uint64_t now = at == left.end() ? 0 : at->second;
      EXPECT_LE(now, bytes) << name << " " << section;
      if (section != "STRS" && now < bytes) {
        EXPECT_TRUE(sections.contains(section)) << name << " " << section;
      }
      const auto aligned = [](std::uint64_t size) { return (size + 63) / 64 * 64; };
      saved += aligned(bytes) - aligned(now) + (now == 0 ? 64 : 0);  // with its entry in the table
    }
    EXPECT_EQ(in_file, saved) << name;
    if (need != Need::cut && need != Need::plasticity && need != Need::groups && need != Need::clusters) {
      EXPECT_GT(in_file, 0U) << name;
    }
  }
}

TEST(LeaveOut, NothingExtraIsLessThanHalfAndMovesAlike) {
  const auto least = with(Needs::none());
  EXPECT_LT(2 * least->package().totalBytes(), cow()->package().totalBytes());
  const auto plain = with(Needs::none().with(Need::exact));
  EXPECT_LT(drawnDifference(plain->package(), least->package()), 1e-4);
  for (const Finding& finding : checkPackage(plain->package()))
    EXPECT_NE(finding.severity, Severity::error) << finding.message;

  // What is left moves bit by bit as before, in the air and without what was left out.
  const auto heights = [](const std::shared_ptr<const Asset>& asset) {
    World world{WorldSettings{}};
    const BodyId id = *world.addBody(asset);
    std::vector<PinSetId> pins(world.pinSets(id, {}));
    world.pinSets(id, pins);
    for (const PinSetId set : pins) world.removePinSet(set);
    world.addImpulse(id, {30, 0, 10});
    for (int i = 0; i < 60; ++i) world.step(1.0F / 60);
    std::vector<Vec3> positions(asset->package().visualPositions().size());
    world.visualVertices(id, {positions[0].data(), sizeof(Vec3), std::uint32_t(positions.size())}, {});
    return positions;
  };
  const std::vector<Vec3> one =
      heights(with(Needs::all().without(Need::plasticity).without(Need::activation).without(Need::pins)));
  const std::vector<Vec3> other = heights(plain);
  EXPECT_EQ(one, other);
  // Sixteen bits change the motion by what they round.
  const std::vector<Vec3> rounded = heights(least);
  double largest = 0;
  for (std::size_t v = 0; v < one.size(); ++v) {
    for (std::size_t a = 0; a < 3; ++a)
      largest = std::max(largest, std::abs(double(one[v][a]) - double(rounded[v][a])));
  }
  EXPECT_LT(largest, 1e-3 * double(cow()->package().info().diagonal));
}

TEST(LeaveOut, IsIdempotent) {
  for (const Need need : {Need::pins, Need::contact, Need::clusters}) {
    const Needs needs = Needs::all().without(need);
    const auto once = with(needs);
    EXPECT_EQ(packageWith(once->package(), needs), packageWith(cow()->package(), needs));
  }
}

TEST(Needs, TextGoesBothWays) {
  EXPECT_EQ(Needs::parse("all"), Needs::all());
  EXPECT_EQ(Needs::parse("none"), Needs::none());
  EXPECT_EQ(Needs::parse("cut, contact"), Needs::none().with(Need::contact).with(Need::cut));
  EXPECT_EQ(Needs::parse(Needs::all().without(Need::exact).text()), Needs::all().without(Need::exact));
  for (const char* bad : {"", "contacts", "cut,", "all,cut"}) EXPECT_FALSE(Needs::parse(bad)) << bad;
}

}  // namespace
}  // namespace sinew::tools
