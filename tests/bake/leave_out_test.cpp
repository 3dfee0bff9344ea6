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

std::set<std::string> namesOf(const std::vector<LeftUnseen>& left) {
  std::set<std::string> names;
  for (const LeftUnseen& one : left) names.insert(std::string(kNeedDeclarations[std::size_t(one.need)].name));
  return names;
}

TEST(Automatic, WhatGoesUnseenIsLeftOutWithItsChange) {
  std::vector<LeftUnseen> left;
  const Needs needs = narrowed(Needs::automatic(), cow()->package(), false, left);
  EXPECT_EQ(namesOf(left), (std::set<std::string>{"clusters", "exact"}));
  for (const Need gone : {Need::cut, Need::identity, Need::groups, Need::masks, Need::clusters, Need::exact}) {
    EXPECT_FALSE(needs.has(gone));
  }
  for (const Need seen : {Need::contact, Need::pins, Need::activation, Need::plasticity, Need::normals, Need::uvs,
                          Need::colors, Need::textures}) {
    EXPECT_TRUE(needs.has(seen)) << kNeedDeclarations[std::size_t(seen)].name;
  }
  std::uint64_t saved = 0;
  for (const LeftUnseen& one : left) {
    EXPECT_LE(one.change.most, one.change.unseen);
    saved += one.bytes;
  }
  const Needs before = needs.with(Need::clusters).with(Need::exact);
  EXPECT_EQ(packageWith(cow()->package(), before).size() - saved, packageWith(cow()->package(), needs).size());
  EXPECT_LT(drawnDifference(cow()->package(), with(needs)->package()), 1e-3);
}

TEST(Automatic, NarrowsOthersAndKeepsWhatIsNamed) {
  std::vector<LeftUnseen> left;
  const Needs asked = Needs::automatic().with(Need::cut).with(Need::exact).with(Need::colors);
  EXPECT_EQ(narrowed(asked, cow()->package(), false, left), Needs::none().with(Need::cut).with(Need::colors));
  left.clear();
  EXPECT_TRUE(narrowed(Needs::automatic(), cow()->package(), true, left).has(Need::clusters));
  EXPECT_EQ(narrowed(Needs::all(), cow()->package(), false, left), Needs::all());
}

TEST(Automatic, SeesWhatCannotBeSeen) {
  formats::PackageContent content = formats::contentOf(cow()->package());
  for (formats::Color8& color : content.visual_colors) color = {255, 255, 255, 255};
  for (formats::Float2& uv : content.visual_uvs) uv = {0.5F, 0.5F};
  for (formats::Material& material : content.materials) material.texture = formats::kNone;
  for (formats::FieldFibre& fibre : content.field_fibres) fibre.tension = 0;
  const auto made = with(Needs::all().without(Need::normals));
  content.visual_normals.assign(made->restNormals().begin(), made->restNormals().end());
  const std::vector<std::byte> bytes = formats::writePackage(content);
  const auto asset = *Asset::fromMemory(bytes);
  std::vector<LeftUnseen> left;
  narrowed(Needs::automatic(), asset->package(), false, left);
  EXPECT_EQ(namesOf(left),
            (std::set<std::string>{"activation", "clusters", "normals", "uvs", "colors", "textures", "exact"}));
  // One normal that is turned is seen.
  EXPECT_LT(changeWithout(asset->package(), Need::normals)->most, 0.5);
  content.visual_normals[0] = {content.visual_normals[0][1], content.visual_normals[0][2],
                               content.visual_normals[0][0]};
  const auto other = *Asset::fromMemory(formats::writePackage(content));
  EXPECT_GT(changeWithout(other->package(), Need::normals)->most, 0.5);
}

TEST(Needs, TextGoesBothWays) {
  EXPECT_EQ(Needs::parse("all"), Needs::all());
  EXPECT_EQ(Needs::parse("none"), Needs::none());
  EXPECT_EQ(Needs::parse("cut, contact"), Needs::none().with(Need::contact).with(Need::cut));
  EXPECT_EQ(Needs::parse(Needs::all().without(Need::exact).text()), Needs::all().without(Need::exact));
  EXPECT_EQ(Needs::parse("auto,cut"), Needs::automatic().with(Need::cut));
  EXPECT_EQ(Needs::automatic().with(Need::cut).text(), "auto,cut");
  for (const char* bad : {"", "contacts", "cut,", "all,cut"}) EXPECT_FALSE(Needs::parse(bad)) << bad;
}

}  // namespace
}  // namespace sinew::tools
