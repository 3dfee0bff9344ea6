// SPDX-License-Identifier: GPL-3.0-or-later
//
// What the window plays, without one: going back in time, cuts, pushes, colours, sections, scenes that are saved.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numeric>

#include "tests/support/touching_box.h"
#include "tools/scene/scene_text.h"
#include "tools/studio/play_colors.h"
#include "tools/studio/play_contacts.h"
#include "tools/studio/section_view.h"
#include "tools/studio/timeline.h"
#include "tools/studio/view_play.h"

namespace sinew::tools {
namespace {

constexpr double kStep = 1.0 / 60;

std::shared_ptr<const Asset> box(std::uint32_t cells_along = 4) {
  test::BoxOptions options;
  options.cells[0] = cells_along;
  options.size = {0.2, 0.1, 0.1};
  options.clusters = {2, 1, 1};
  return test::boxAsset(options);
}

Play playing(SceneKind scene, std::uint32_t cells_along = 4) {
  ViewOptions options;
  options.scene = scene;
  return Play(box(cells_along), options);
}

void run(Play& play, int steps) {
  for (int s = 0; s < steps; ++s) {
    play.stepPaused();
    play.advance(0);
  }
}

float extentOf(const Play& play, int axis) {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  const std::size_t count = play.scene().assets().front()->package().visualPositions().size();  // then the plates
  for (std::size_t v = 0; v < count; ++v) {
    low = std::min(low, play.shape().positions[v][axis]);
    high = std::max(high, play.shape().positions[v][axis]);
  }
  return high - low;
}

TEST(BuiltIn, SquashPressesToHalfAndLetsGo) {
  Play play = playing(SceneKind::squash);
  run(play, 41);
  EXPECT_EQ(play.scene().solids().size(), 2U);
  EXPECT_NEAR(extentOf(play, 1), 0.05, 1e-3);
  run(play, 49);
  EXPECT_TRUE(play.scene().solids().empty());
  EXPECT_NEAR(extentOf(play, 1), 0.1, 1e-5);
  EXPECT_NEAR(extentOf(play, 2), 0.1, 1e-5);
}

// Between faces that friction holds: with functions enough for that.
TEST(BuiltIn, SquashMakesSidesBulge) {
  Play play = playing(SceneKind::squash, 8);
  run(play, 1);
  const float width = extentOf(play, 2);
  run(play, 40);
  EXPECT_NEAR(extentOf(play, 1), 0.05, 1e-3);
  EXPECT_GT(extentOf(play, 2), 1.03F * width);
}

TEST(GoingBack, WhatFollowsIsTheSameBitForBit) {
  Play play = playing(SceneKind::drop);
  run(play, 30);
  const std::size_t moment = play.timeline().at();
  const std::vector<Eigen::Vector3f> then = play.shape().positions;
  run(play, 25);
  const std::vector<Eigen::Vector3f> later = play.shape().positions;
  EXPECT_NE(then, later);
  play.goTo(moment);
  EXPECT_EQ(play.shape().positions, then);
  EXPECT_NEAR(play.scene().time(), 30 * kStep, 1e-6);
  run(play, 25);
  EXPECT_EQ(play.shape().positions, later);
  play.stepBack();
  EXPECT_NEAR(play.scene().time(), 54 * kStep, 1e-6);
  EXPECT_EQ(play.timeline().size(), 56U);
  // What comes after a moment goes when another way is taken from there.
  play.goTo(10);
  run(play, 1);
  EXPECT_EQ(play.timeline().size(), 12U);
}

TEST(Channels, WhatIsPausedHasTheInputItIsGiven) {
  test::BoxOptions options;
  formats::PackageContent content = test::boxContent(options);
  content.channels.push_back({content.addText("biceps")});
  ViewOptions view;
  view.scene = SceneKind::rest;
  Play play(test::makeAsset(content), view);
  ASSERT_EQ(play.scene().channelInputs().size(), 1U);
  play.scene().holdChannel(0, 0.5F);
  EXPECT_EQ(play.scene().channelInputs()[0], 0.5F);
  play.scene().holdChannel(0, std::nullopt);
  EXPECT_EQ(play.scene().channelInputs()[0], 0);
}

TEST(GoingBack, TheHandThatHeldThenHoldsNoMore) {
  Play play = playing(SceneKind::hang);
  play.grab(0);
  play.moveGrab(play.grabbed()->start + Eigen::Vector3f(0.1F, 0, 0));
  run(play, 5);
  const std::size_t held = play.timeline().at();
  play.push({0, 0.5F, 0}, 0.01F);
  run(play, 2);
  const std::size_t pushed = play.timeline().at();
  play.goTo(held);
  EXPECT_FALSE(play.grabbed().has_value());
  EXPECT_EQ(play.scene().world().picks(play.scene().body(), {}), 0U);
  play.goTo(pushed);
  EXPECT_FALSE(play.pushed().has_value());
  EXPECT_TRUE(play.scene().solids().empty());
}

TEST(GoingBack, ACutIsTakenBackToo) {
  Play play = playing(SceneKind::drop);
  run(play, 3);
  const std::size_t whole = play.timeline().at();
  const auto middle = play.shape().physical.front();
  ASSERT_TRUE(play.cut((middle + play.shape().physical.back()) / 2, Eigen::Vector3f::UnitX())) << play.message();
  EXPECT_EQ(play.scene().bodies().size(), 2U);
  run(play, 3);
  const std::size_t parts = play.timeline().at();
  play.goTo(whole);
  EXPECT_EQ(play.scene().bodies().size(), 1U);
  play.goTo(parts);
  EXPECT_EQ(play.scene().bodies().size(), 2U);
  run(play, 2);
  EXPECT_FALSE(play.cut({100, 0, 0}, Eigen::Vector3f::UnitX()));
  EXPECT_NE(play.message().find("cannot be cut"), std::string::npos);
  EXPECT_EQ(play.scene().bodies().size(), 2U);
}

TEST(GoingBack, MemoryHasABoundAndTheNewestMomentsStay) {
  SceneOptions options;
  options.scene = SceneKind::rest;  // nothing touches: all moments are as large
  Scene scene(box(), options);
  const std::size_t each = scene.save().bytes();
  Timeline timeline(10 * each + each / 2);
  for (int s = 0; s < 50; ++s) {
    scene.step();
    timeline.add({scene.save(), {}, {}, {}});
    EXPECT_LE(timeline.bytes(), 10 * each + each / 2);
  }
  EXPECT_EQ(timeline.size(), 10U);
  EXPECT_NEAR(timeline[timeline.size() - 1].state.time(), 50 * kStep, 1e-6);
  EXPECT_NEAR(timeline[0].state.time(), 41 * kStep, 1e-6);
}

TEST(SlowMotion, TakesAsManyTimesTheTime) {
  Play play = playing(SceneKind::drop);
  play.settings.speed = 0.25F;
  for (int frame = 0; frame < 40; ++frame) play.advance(kStep);
  EXPECT_NEAR(play.scene().time(), 10 * kStep, 1.5 * kStep);
}

TEST(StepLength, ChangesWhileItPlaysAndTimeIsTheSum) {
  Play play = playing(SceneKind::drop);
  run(play, 12);
  play.settings.step_seconds = 1.0F / 240;
  play.applySettings();
  const std::size_t moment = play.timeline().at();
  run(play, 48);
  EXPECT_NEAR(play.scene().time(), 0.4, 1e-6);
  // As many as the time of a frame asks for.
  play.playing = true;
  play.advance(kStep * 1.01);
  EXPECT_NEAR(play.scene().time(), 0.4 + kStep, 1e-6);
  const std::vector<Eigen::Vector3f> fine = play.shape().positions;
  // Back, and on by the length that is set now: another way by coarser steps, the same by the same.
  play.settings.step_seconds = 1.0F / 60;
  play.goTo(moment);
  EXPECT_NEAR(play.scene().time(), 0.2, 1e-6);
  run(play, 13);
  EXPECT_NEAR(play.scene().time(), 0.4 + kStep, 1e-6);
  EXPECT_NE(play.shape().positions, fine);
  play.settings.step_seconds = 1.0F / 240;
  play.goTo(moment);
  run(play, 52);
  EXPECT_EQ(play.shape().positions, fine);
  play.restart();
  EXPECT_EQ(play.scene().stepSeconds(), 1.0F / 240);
}

TEST(Scenes, OneThatCannotBePlayedLeavesTheOneBefore) {
  Play play = playing(SceneKind::drop);
  run(play, 3);
  play.start(SceneKind::stack);  // the box has no distance grids
  EXPECT_NE(play.message().find("distance grids"), std::string::npos);
  EXPECT_EQ(play.scene().options().scene, SceneChoice(SceneKind::drop));
  EXPECT_NEAR(play.scene().time(), 3 * kStep, 1e-6);
}

TEST(Hand, ABallPushesTheBodyAside) {
  Play play = playing(SceneKind::rest);
  const Eigen::Vector3f center =
      Eigen::Map<const Eigen::Vector3f>(play.scene().world().motion(play.scene().body()).center.data());
  play.push(center + Eigen::Vector3f(-0.2F, 0, 0), 0.03F);
  for (int s = 0; s < 40; ++s) {
    play.movePush(center + Eigen::Vector3f(-0.2F + 0.005F * float(s), 0, 0));
    run(play, 1);
  }
  const Eigen::Vector3f now =
      Eigen::Map<const Eigen::Vector3f>(play.scene().world().motion(play.scene().body()).center.data());
  EXPECT_GT(now.x() - center.x(), 0.03F);
  play.endPush();
  EXPECT_TRUE(play.scene().solids().empty());
}

// A slab under the box in the scene drop.
PlacedSolid slab(const Play& play) {
  PlacedSolid solid;
  solid.shape = BoxShape{{0.5F, 0.02F, 0.5F}};
  solid.settings.at.position = {play.shape().positions.front().x(), 0.04F, 0};
  return solid;
}

float lowest(const Play& play) {
  float low = std::numeric_limits<float>::infinity();
  for (std::size_t v = 0; v < play.shape().body_vertices; ++v) low = std::min(low, play.shape().positions[v].y());
  return low;
}

TEST(PlacedColliders, CarryTheBodyAtOnceAndSurviveRestartAndAnotherBody) {
  Play play = playing(SceneKind::drop);
  play.addSolid(BoxShape{{0.1F, 0.1F, 0.1F}});
  EXPECT_EQ(play.placed().selected, 0U);
  play.changeSolid(0, slab(play), false);
  run(play, 90);
  EXPECT_NEAR(lowest(play), 0.06F, 5e-3F);  // its upper side
  play.restart();
  EXPECT_EQ(play.scene().solids().size(), 1U);
  run(play, 90);
  EXPECT_NEAR(lowest(play), 0.06F, 5e-3F);
  ASSERT_TRUE(play.swap(box()));
  run(play, 30);
  EXPECT_EQ(play.scene().solids().size(), 1U);
  EXPECT_NEAR(lowest(play), 0.06F, 5e-3F);
  play.removeSolid(0);
  run(play, 60);
  EXPECT_TRUE(play.scene().solids().empty());
  EXPECT_NEAR(lowest(play), 0, 5e-3F);
  play.settings.ground = false;
  play.applySettings();
  run(play, 60);
  EXPECT_LT(lowest(play), -0.5F);
}

TEST(PlacedColliders, StayWhenItGoesBackAndWhatFollowsIsTheSame) {
  Play play = playing(SceneKind::drop);
  run(play, 10);
  play.addSolid(SphereShape{0.05F});
  PlacedSolid solid = slab(play);
  play.changeSolid(0, solid, false);
  run(play, 50);
  const std::size_t moment = play.timeline().at();
  run(play, 20);
  const std::vector<Eigen::Vector3f> later = play.shape().positions;
  play.goTo(5);  // before it was there
  EXPECT_EQ(play.scene().solids().size(), 1U);
  play.goTo(moment);
  EXPECT_EQ(play.scene().solids().size(), 1U);
  run(play, 20);
  EXPECT_EQ(play.shape().positions, later);
  // Moved while it stands still, it is there at once, in all moments.
  solid.settings.at.position[1] = 0.09F;
  play.playing = false;
  play.changeSolid(0, solid, true);
  EXPECT_FLOAT_EQ(play.scene().world().colliderPose(play.scene().solids()[0].id).position[1], 0.09F);
  play.goTo(moment);
  ASSERT_EQ(play.scene().solids().size(), 1U);
  EXPECT_FLOAT_EQ(play.scene().world().colliderPose(play.scene().solids()[0].id).position[1], 0.09F);
  play.removeSolid(0);
  play.goTo(moment);
  EXPECT_TRUE(play.scene().solids().empty());
}

TEST(PlacedColliders, MovedWhileItPlaysTakeTheBodyAlong) {
  Play play = playing(SceneKind::rest);
  play.addSolid(SphereShape{0.03F});
  const auto center = [&] { return Eigen::Vector3f(play.scene().world().motion(play.scene().body()).center.data()); };
  const Eigen::Vector3f before = center();
  PlacedSolid solid = play.placed()[0];
  for (int s = 0; s < 40; ++s) {
    const Eigen::Vector3f at = before + Eigen::Vector3f(0.2F - 0.005F * float(s), 0, 0);
    solid.settings.at.position = {at.x(), at.y(), at.z()};
    play.playing = true;
    play.changeSolid(0, solid, true);
    play.advance(kStep);
  }
  EXPECT_LT(center().x() - before.x(), -0.03F);
}

int contactsWithin(const Play& play, float low, float high, std::size_t axis) {
  int count = 0;
  for (const Eigen::Vector3f& x : contactsOf(play))
    count += x[Eigen::Index(axis)] > low && x[Eigen::Index(axis)] < high ? 1 : 0;
  return count;
}

TEST(Contacts, AreThoseOfTwoBodiesToo) {
  ViewOptions options;
  options.scene = SceneKind::stack;
  Play play(test::touchingBox({0.2, 0.2, 0.2}), options);
  play.settings.stiffness = 20;  // else the lowest are flat
  play.restart();
  run(play, 60);
  EXPECT_GE(contactsWithin(play, -0.01F, 0.01F, 1), 4);  // with the ground
  EXPECT_GE(contactsWithin(play, 0.19F, 0.21F, 1), 8);   // of the first two with each other
  EXPECT_EQ(contactsWithin(play, 0.03F, 0.17F, 1), 0);   // and not between
  play.scene().world().settings().collisions = false;
  EXPECT_EQ(contactsWithin(play, 0.19F, 0.21F, 1), 0);
}

TEST(Contacts, AreThoseOfABodyWithItselfToo) {
  // Two cubes of one body, apart at rest, together now.
  test::BoxOptions box;
  box.cells = {2, 2, 2};
  box.center = {-0.75, 0, 0};
  formats::PackageContent content = test::boxContent(box);
  box.center[0] = 0.75;
  test::appendBody(content, test::boxContent(box));
  for (const std::uint32_t piece : {0U, 1U}) {
    const std::array<double, 3> center = {piece == 0 ? -0.75 : 0.75, 0, 0};
    test::addDistances(content, piece, center, {1, 1, 1}, [&](const auto& at) {
      return test::boxDistance(at, center, {1, 1, 1});
    });
  }
  for (const bool self_contact : {true, false}) {
    SceneScript script;
    script.self_contact = self_contact;
    ViewOptions options;
    options.scene = SceneKind::rest;
    options.scene.script = std::make_shared<const SceneScript>(script);
    Play play(test::makeAsset(content), options);
    play.playing = false;
    EXPECT_TRUE(contactsOf(play).empty());
    World& world = play.scene().world();
    std::vector<Vec3> positions(world.positions(play.scene().body()).begin(),
                                world.positions(play.scene().body()).end());
    for (Vec3& x : positions) x[0] += x[0] < 0 ? 0.25F : -0.25F;
    world.setState(play.scene().body(), positions, {});
    play.advance(0);
    EXPECT_EQ(contactsWithin(play, -0.01F, 0.01F, 0) > 8, self_contact);
    EXPECT_EQ(contactsWithin(play, 0.01F, 2, 0), 0);
  }
}

// A body put into a known shape.
class Colors : public testing::Test {
 protected:
  void deform(const Eigen::Matrix3f& f) {
    World& world = play.scene().world();
    std::vector<Vec3> positions(world.positions(play.scene().body()).begin(),
                                world.positions(play.scene().body()).end());
    for (Vec3& x : positions) Eigen::Map<Eigen::Vector3f>(x.data()) = f * Eigen::Vector3f(x.data());
    world.setState(play.scene().body(), positions, {});
    play.advance(0);
  }
  Play play = [] {
    Play made = playing(SceneKind::rest);
    made.playing = false;
    return made;
  }();
  PlayColors colors;
};

TEST_F(Colors, StretchAndVolumeAreThoseOfTheDeformation) {
  deform(Eigen::Vector3f(1.3F, 1, 1).asDiagonal());
  colors.update(PlayColor::volume, play);
  for (const float v : colors.values()) EXPECT_NEAR(v, 1.3F, 0.02F);
  const auto& tints = colors.update(PlayColor::stretch, play);
  EXPECT_EQ(tints.size(), play.shape().positions.size());
  // Sides along x are stretched, the two ends are not; corners have some of both.
  const auto [low, high] = std::minmax_element(colors.values().begin(), colors.values().end());
  EXPECT_NEAR(*high, 1.3F, 0.03F);
  EXPECT_GT(*low, 0.97F);
  deform(Eigen::Vector3f(1, 1, 1).asDiagonal());
  EXPECT_TRUE(colors.update(PlayColor::model, play).empty());
}

TEST_F(Colors, SpeedAndAttachmentErrorAreMeasured) {
  World& world = play.scene().world();
  world.setVelocity(play.scene().body(), {0, 0.5F, 0}, {0, 0, 0});
  play.advance(0);
  colors.update(PlayColor::speed, play);
  for (const float v : colors.values()) EXPECT_NEAR(v, 0.5F, 1e-3F);
  colors.update(PlayColor::attachment, play);
  for (const float v : colors.values()) EXPECT_LT(v, 1e-3F * play.diagonal());
}

TEST(SectionFaces, CloseWhatIsShown) {
  const auto asset = box();
  for (const float at : {0.0F, 0.4F, 1.0F}) {
    for (const bool flip : {false, true}) {
      const auto faces = sectionFaces(asset->package(), {true, 0, at, flip});
      // Closed: the area vectors sum to zero; and outward: the volume is positive, and both sides fill the box.
      Eigen::Vector3d area = Eigen::Vector3d::Zero();
      double volume = 0;
      const auto vertex = [&](std::uint32_t v) {
        const auto& x = asset->package().physicalVertices()[v].rest_position;
        return Eigen::Vector3d(double(x[0]), double(x[1]), double(x[2]));
      };
      for (const auto& f : faces) {
        const Eigen::Vector3d n = (vertex(f[1]) - vertex(f[0])).cross(vertex(f[2]) - vertex(f[0])) / 2;
        area += n;
        volume += n.dot(vertex(f[0])) / 3;
      }
      EXPECT_LT(area.norm(), 1e-8);
      const auto others = sectionFaces(asset->package(), {true, 0, at, !flip});
      if (at == 0.4F) {
        EXPECT_GT(volume, 0.2 * 0.002);
        EXPECT_LT(volume, 0.8 * 0.002);
      } else {
        EXPECT_NEAR(volume, faces.empty() ? 0 : 0.002, 1e-6);
        EXPECT_NE(faces.empty(), others.empty());
      }
    }
  }
}

class SavedScene : public testing::Test {
 protected:
  void SetUp() override {
    folder = std::filesystem::temp_directory_path() / ("sinew_saved_scene_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
  }
  void TearDown() override { std::filesystem::remove_all(folder); }
  SceneScript readBack(const Scene& scene, const SceneTextOptions& options) const {
    const std::string file = (folder / "pose.json").string();
    std::ofstream(file) << sceneText(scene, options);
    return SceneScript::read(file);
  }
  std::filesystem::path folder;
};

TEST_F(SavedScene, ALockedPullComesToTheSamePlace) {
  Play play = playing(SceneKind::rest);
  std::uint32_t corner = 0;
  for (std::uint32_t v = 0; v < play.shape().body_vertices; ++v) {
    if (play.shape().positions[v].sum() > play.shape().positions[corner].sum()) corner = v;
  }
  play.grab(corner);
  play.moveGrab(play.grabbed()->start + Eigen::Vector3f(0.05F, 0.02F, -0.01F));
  play.lock();
  play.release();
  run(play, 300);
  const SceneScript script = readBack(play.scene(), {});
  ASSERT_EQ(script.picks.size(), 1U);
  EXPECT_TRUE(script.picks[0].lock);
  EXPECT_NEAR(script.picks[0].keys.back().value[0], 0.05, 1e-4);
  EXPECT_NEAR(script.picks[0].keys.back().value[1], 0.02, 1e-4);
  EXPECT_TRUE(readBack(play.scene(), {.picks = false, .targets = {}, .camera = {}, .solids = {}}).picks.empty());
  // Played, the body hangs on the pull as it does here.
  ViewOptions options;
  options.scene = SceneKind::rest;
  options.scene.script = std::make_shared<const SceneScript>(script);
  Play again(play.shape().assets.front(), options);
  run(again, 400);
  const Eigen::Vector3f shift(play.scene().placement().position.data());
  float largest = 0;
  for (std::size_t v = 0; v < play.shape().body_vertices; ++v)
    largest = std::max(largest, (again.shape().positions[v] + shift - play.shape().positions[v]).norm());
  EXPECT_LT(largest, 0.05F * play.diagonal());
}

TEST_F(SavedScene, PlacedCollidersAndGroundPlayTheSame) {
  Play play = playing(SceneKind::drop);  // which turns the body
  play.settings.ground_height = -0.03F;
  play.applySettings();
  for (const ColliderShape& shape : {ColliderShape(BoxShape{{0.02F, 0.03F, 0.04F}}), ColliderShape(SphereShape{0.03F}),
                                     ColliderShape(CapsuleShape{0.02F, 0.06F})}) {
    play.addSolid(shape);
    PlacedSolid solid = play.placed()[play.placed().size() - 1];
    const float x = 0.06F * (float(play.placed().size()) - 2);
    solid.settings.at.position = {x, 0.02F, 0.01F};
    solid.settings.friction = 0.25F;
    solid = dragged(solid, HandleKind::turn_y, Eigen::Vector3f(x + 0.3F, 0.6F, 0.2F));
    play.changeSolid(play.placed().size() - 1, solid, false);
  }
  play.advance(0);
  SceneTextOptions options;
  options.solids = play.placed().all();
  const SceneScript script = readBack(play.scene(), options);
  ASSERT_EQ(script.colliders.size(), 3U);
  EXPECT_NEAR(script.colliders[1].friction, 0.25, 1e-6);
  ViewOptions view;
  view.scene = SceneKind::rest;
  view.scene.script = std::make_shared<const SceneScript>(script);
  Play again(play.shape().assets.front(), view);
  const Eigen::Vector3f shift(play.scene().placement().position.data());
  const auto apart = [&] {
    float most = 0;
    for (std::size_t v = 0; v < play.shape().positions.size(); ++v)
      most = std::max(most, (again.shape().positions[v] + shift - play.shape().positions[v]).norm());
    return most;
  };
  ASSERT_EQ(again.shape().positions.size(), play.shape().positions.size());
  EXPECT_LT(apart(), 1e-5F);  // bodies and colliders
  EXPECT_NEAR(again.scene().groundHeight() + shift.y(), -0.03F, 1e-6);
  run(play, 25);
  run(again, 25);
  EXPECT_LT(apart(), 1e-3F);
  // Saved again, from the file's scene, they are there once more.
  EXPECT_EQ(readBack(again.scene(), {}).colliders.size(), 3U);
}

TEST_F(SavedScene, PlaysByAllThatTheSlidersSay) {
  Play play = playing(SceneKind::drop);
  play.settings.gravity = 0.5F;
  play.settings.iterations = 7;
  play.settings.damping = 1.5F;
  play.settings.deformation_damping = 0.0625F;
  play.settings.stiffness = 3;
  play.settings.step_seconds = 1.0F / 120;
  play.restart();
  ViewOptions view;
  view.scene = SceneKind::rest;
  view.scene.script = std::make_shared<const SceneScript>(readBack(play.scene(), {}));
  Play again(play.shape().assets.front(), view);
  const WorldSettings &saved = play.scene().world().settings(), &read = again.scene().world().settings();
  EXPECT_NEAR(read.gravity[1], saved.gravity[1], 1e-6F);
  EXPECT_EQ(read.iterations, 7U);
  EXPECT_EQ(read.damping, 1.5F);
  EXPECT_EQ(read.deformation_damping_ratio, 0.0625F);
  EXPECT_EQ(again.scene().world().bodySettings(again.scene().body()).stiffness_scale, 3);
  EXPECT_NEAR(again.scene().stepSeconds(), 1.0F / 120, 1e-8F);
  // What falls here falls there; what something holds is held by the package's pins.
  EXPECT_FALSE(again.scene().world().bodySettings(again.scene().body()).package_pins);
  EXPECT_TRUE(readBack(playing(SceneKind::hang).scene(), {}).package_pins);
  EXPECT_TRUE(readBack(playing(SceneKind::rest).scene(), {}).package_pins);
  // The sliders stand where they stood; stiffness multiplies what the file has.
  EXPECT_EQ(again.settings.damping, 1.5F);
  EXPECT_EQ(again.settings.stiffness, 1);
  again.settings.stiffness = 2;
  again.restart();
  EXPECT_EQ(again.scene().world().bodySettings(again.scene().body()).stiffness_scale, 6);
}

TEST_F(SavedScene, FromStraightAboveReadsBack) {
  Play play = playing(SceneKind::rest);
  Camera camera;
  camera.pitch = 1.57F;
  SceneTextOptions options;
  options.camera = sceneViewOf(camera, play.package(), {});
  EXPECT_NEAR(readBack(play.scene(), options).view->pitch, 1.55, 0.01);
}

TEST_F(SavedScene, CameraAndTargetsReadBack) {
  Play play = playing(SceneKind::rest);
  SceneTextOptions options;
  options.camera = SceneScript::View{0.5, -0.25, std::array{0.1, 0.2, 0.3}, 0.75};
  SceneScript::Target target;
  target.name = "jaw";
  target.axis = {0, 1, 0};
  target.point = {0.1, 0, 0};
  target.keys = {{0, 0.5, {0, 0.01, 0}}};
  options.targets = {target};
  const SceneScript script = readBack(play.scene(), options);
  ASSERT_TRUE(script.view.has_value());
  EXPECT_NEAR(script.view->yaw, 0.5, 1e-6);
  EXPECT_NEAR(script.view->pitch, -0.25, 1e-6);
  EXPECT_NEAR((*script.view->at)[2], 0.3, 1e-6);
  EXPECT_NEAR(script.view->height, 0.75, 1e-6);
  ASSERT_EQ(script.targets.size(), 1U);
  EXPECT_EQ(script.targets[0].name, "jaw");
  EXPECT_NEAR(script.targets[0].keys.back().turn, 0.5, 1e-6);
  EXPECT_NEAR(script.targets[0].keys.back().move[1], 0.01, 1e-6);
}

}  // namespace
}  // namespace sinew::tools
