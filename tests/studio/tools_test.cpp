// SPDX-License-Identifier: GPL-3.0-or-later
//
// The table of shortcuts (printable keys have their ASCII codes), the mouse's habits, handles of what is placed.
#include <gtest/gtest.h>

#include <map>

#include "tools/render/front.h"
#include "tools/studio/camera_mouse.h"
#include "tools/studio/gizmo.h"
#include "tools/studio/placed_solids.h"
#include "tools/studio/shortcuts.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

TEST(Shortcuts, NoKeyMeansTwoThingsInOnePlace) {
  for (const bool document : {false, true}) {
    for (const bool source : {false, true}) {
      if (source && !document) continue;
      std::map<std::string, std::string> taken;
      for (const Shortcut& shortcut : shortcuts()) {
        if (shortcut.key == 0 || !isPossible(shortcut, document, source)) continue;
        const auto [known, is_new] = taken.emplace(keysText(shortcut), shortcut.name);
        EXPECT_TRUE(is_new) << keysText(shortcut) << ": " << shortcut.name << " and " << known->second;
        // The key says what the table says.
        EXPECT_EQ(commandOf({shortcut.key, shortcut.control, shortcut.shift}, document, source), shortcut.command);
      }
    }
  }
}

TEST(Shortcuts, LettersBelongToTheirTabs) {
  EXPECT_EQ(commandOf({' ', false, false}, true, true), std::nullopt);
  EXPECT_EQ(commandOf({' ', false, false}, true, false), Command::play);
  EXPECT_EQ(commandOf({'Z', true, false}, false, false), std::nullopt);
  EXPECT_EQ(commandOf({'Z', true, false}, true, true), Command::undo);
  EXPECT_EQ(commandOf({'3', false, false}, false, false), Command(int(Command::scene) + 2));
  EXPECT_EQ(commandOf({'3', false, false}, true, true), std::nullopt);
  EXPECT_EQ(nameWithKeys(Command::redo), "Redo   (Ctrl+Shift+Z)");
}

TEST(Mouse, HabitsAreThoseOfThePrograms) {
  // Blender: the middle button alone. Maya: with Alt alone. Left is the tool's.
  EXPECT_EQ(dragOf(Navigation::blender, 2, false, false, false), CameraDrag::orbit);
  EXPECT_EQ(dragOf(Navigation::blender, 2, true, false, false), CameraDrag::pan);
  EXPECT_EQ(dragOf(Navigation::blender, 2, false, true, false), CameraDrag::zoom);
  EXPECT_EQ(dragOf(Navigation::blender, 0, true, false, false), CameraDrag::none);
  EXPECT_EQ(dragOf(Navigation::maya, 0, false, false, true), CameraDrag::orbit);
  EXPECT_EQ(dragOf(Navigation::maya, 2, false, false, true), CameraDrag::pan);
  EXPECT_EQ(dragOf(Navigation::maya, 1, false, false, true), CameraDrag::zoom);
  EXPECT_EQ(dragOf(Navigation::maya, 0, false, false, false), CameraDrag::none);
  // Without a wheel and with two buttons everything can be done.
  EXPECT_EQ(dragOf(Navigation::usual, 1, false, false, false), CameraDrag::orbit);
  EXPECT_EQ(dragOf(Navigation::usual, 0, true, false, false), CameraDrag::pan);
  EXPECT_EQ(dragOf(Navigation::usual, 1, false, true, false), CameraDrag::zoom);
  EXPECT_EQ(dragOf(Navigation::usual, 0, false, false, false), CameraDrag::none);
}

TEST(Front, IsWhereTheArtistSays) {
  const auto eye = [](const char* front, const char* up) {
    const Camera camera = viewCamera(ViewName::front, frontYaw(front, up));
    return Vector3d(double(camera.back().x()), 0, double(camera.back().z())).normalized();
  };
  EXPECT_NEAR((eye("auto", "y") - Vector3d::UnitZ()).norm(), 0, 1e-6);
  EXPECT_NEAR((eye("-z", "y") + Vector3d::UnitZ()).norm(), 0, 1e-6);
  EXPECT_NEAR((eye("x", "y") - Vector3d::UnitX()).norm(), 0, 1e-6);
  EXPECT_NEAR((eye("-x", "z") + Vector3d::UnitX()).norm(), 0, 1e-6);
  // Of a source with z up, y becomes -z: its front -y is +z here.
  EXPECT_NEAR((eye("-y", "z") - Vector3d::UnitZ()).norm(), 0, 1e-6);
  EXPECT_NEAR((eye("y", "z") + Vector3d::UnitZ()).norm(), 0, 1e-6);
  EXPECT_NEAR((eye("auto", "z") - Vector3d::UnitZ()).norm(), 0, 1e-6);
  // What points up is no front.
  EXPECT_NEAR((eye("y", "y") - Vector3d::UnitZ()).norm(), 0, 1e-6);
}

std::map<HandleKind, Vector3d> handles(const Gizmo& gizmo) {
  std::map<HandleKind, Vector3d> all;
  for (const Handle& handle : handlesOf(gizmo, Vector3d::UnitX(), 0.5)) all[handle.kind] = handle.place;
  return all;
}

TEST(Handles, MoveAndSizeADisc) {
  const Gizmo disc = {"/pins/0/from", {{"disc", {1, 2, 3}}, {"radius", 0.25}, {"falloff", 0.1}}, {}, false};
  const auto at = handles(disc);
  ASSERT_EQ(at.size(), 2U);
  EXPECT_EQ(at.at(HandleKind::center), Vector3d(1, 2, 3));
  EXPECT_EQ(at.at(HandleKind::radius), Vector3d(1.25, 2, 3));
  const Json moved = dragged(disc, HandleKind::center, {1, 2.5, 3});
  EXPECT_EQ(moved, Json({{"disc", {1, 2.5, 3}}, {"radius", 0.25}, {"falloff", 0.1}}));
  EXPECT_EQ(dragged(disc, HandleKind::radius, {1, 2.5, 3})["radius"], 0.5);
  // To its own middle: a disc of no radius would be no selection.
  EXPECT_GT(dragged(disc, HandleKind::radius, {1, 2, 3})["radius"].get<double>(), 0);
}

TEST(Handles, TurnAHalfSpaceAndAFibre) {
  const Gizmo half = {"/masks/a", {{"half_space", {0, 1, 0}}, {"normal", {0, 2, 0}}}, {}, false};
  const auto at = handles(half);
  ASSERT_EQ(at.size(), 2U);
  EXPECT_EQ(at.at(HandleKind::normal), Vector3d(0, 1.5, 0));
  EXPECT_EQ(dragged(half, HandleKind::normal, {3, 1, 0})["normal"], Json({1, 0, 0}));
  EXPECT_EQ(dragged(half, HandleKind::center, {0, 0, 2})["half_space"], Json({0, 0, 2}));
  EXPECT_EQ(dragged(half, HandleKind::normal, {0, 1, 0})["normal"], Json({0, 2, 0}));  // nowhere to turn to
  const Gizmo fibre = {"/clusters/0/fibre", {0, 0, 1}, Vector3d(1, 0, 0), false};
  EXPECT_EQ(handles(fibre).at(HandleKind::fibre), Vector3d(1, 0, 0.5));
  EXPECT_EQ(dragged(fibre, HandleKind::fibre, {1, 4, 0}), Json({0, 1, 0}));
}

std::map<HandleKind, Vector3d> handles(const PlacedSolid& solid) {
  std::map<HandleKind, Vector3d> all;
  for (const Handle& handle : handlesOf(solid, Eigen::Vector3f::UnitX(), 0.5F)) all[handle.kind] = handle.place;
  return all;
}

TEST(Handles, OfAColliderMoveSizeAndTurnIt) {
  PlacedSolid box;
  box.shape = BoxShape{{1, 2, 3}};
  box.settings.at.position = {1, 0, 0};
  const auto at = handles(box);
  EXPECT_EQ(at.size(), 6U);
  EXPECT_EQ(at.at(HandleKind::size_z), Vector3d(1, 0, 3));
  EXPECT_EQ(at.at(HandleKind::turn_y), Vector3d(1, 2.5, 0));
  EXPECT_EQ(dragged(box, HandleKind::center, {0, 5, 0}).settings.at.position, (Vec3{0, 5, 0}));
  // Only what lies along its side counts; what is dragged through the middle comes out at the other side.
  EXPECT_EQ(std::get<BoxShape>(dragged(box, HandleKind::size_z, {7, 0, -4}).shape).half_size, (Vec3{1, 2, 4}));
  EXPECT_GT(std::get<BoxShape>(dragged(box, HandleKind::size_x, {1, 0, 0}).shape).half_size[0], 0);
  const PlacedSolid turned = dragged(box, HandleKind::turn_y, {1, 0, 4});
  EXPECT_NEAR((handles(turned).at(HandleKind::turn_y) - Vector3d(1, 0, 2.5)).norm(), 0, 1e-6);
  EXPECT_NEAR((handles(turned).at(HandleKind::size_x) - Vector3d(2, 0, 0)).norm(), 0, 1e-6);

  PlacedSolid capsule;
  capsule.shape = CapsuleShape{0.25F, 1};
  const CapsuleShape longer = std::get<CapsuleShape>(dragged(capsule, HandleKind::size_y, {0.5F, 2, 0}).shape);
  EXPECT_EQ(longer.half_length, 2);
  EXPECT_EQ(longer.radius, 0.25F);
  EXPECT_EQ(std::get<CapsuleShape>(dragged(capsule, HandleKind::radius, {0.5F, 9, 0}).shape).radius, 0.5F);
  PlacedSolid sphere;
  sphere.shape = SphereShape{1};
  EXPECT_EQ(handles(sphere).size(), 2U);
  EXPECT_EQ(std::get<SphereShape>(dragged(sphere, HandleKind::radius, {0, 3, 4}).shape).radius, 5);
}

}  // namespace
}  // namespace sinew::tools
