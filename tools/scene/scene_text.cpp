// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/scene_text.h"

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/author/json_text.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;

constexpr double kReachSeconds = 0.5;  // from rest to the pose

Vector3d wideOf(const Vec3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// Where a point of a body lies at rest, relative to the package's origin.
Vector3d restOf(const formats::PackageView& package, const BodyPoint& at) {
  Vector3d x = Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3 corner = at.physical != 0 ? Vec3(package.physicalVertices()[at.vertex[k]].rest_position)
                                         : Vec3(package.visualPositions()[at.vertex[k]]);
    x += double(at.weight[k]) * wideOf(corner);
  }
  return x;
}

Eigen::Matrix3d rotationOf(const RigidTransform& at) {
  return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(at.rotation.data()).cast<double>();
}

// Places of the file are those of the scene's world, moved so that the first body starts where its source is.
Vector3d shiftOf(const Scene& scene) {
  const auto& origin = scene.assets().front()->package().info().origin;
  return Vector3d(origin[0], origin[1], origin[2]) - wideOf(scene.placement().position);
}

Json picksOf(const Scene& scene) {
  const formats::PackageView& package = scene.assets().front()->package();
  const Vector3d shift = shiftOf(scene), start = wideOf(scene.placement().position);
  Json list = Json::array();
  std::vector<PickId> picks(scene.world().picks(scene.body(), {}));
  scene.world().picks(scene.body(), picks);
  for (const PickId id : picks) {
    const PickState pick = scene.world().pickState(id);
    if (!pick.locked) continue;
    const Vector3d rest = rotationOf(scene.placement()) * restOf(package, pick.at) + start;
    Json keys = Json::array();
    keys.push_back({{"time", 0}, {"move", {0, 0, 0}}});
    keys.push_back({{"time", kReachSeconds}, {"move", jsonOf(wideOf(pick.target) - rest)}});
    list.push_back({{"at", jsonOf(rest + shift)}, {"keys", keys}, {"lock", true}});
  }
  return list;
}

double degreesOf(const Eigen::AngleAxisd& turn) { return sevenDigits(turn.angle() / kDegree); }

Json solidOf(const PlacedSolid& solid, const Vector3d& shift) {
  Json json = Json::object();
  Json& shape = json[shapeName(solid.shape)];
  if (const auto* sphere = std::get_if<SphereShape>(&solid.shape)) {
    shape["radius"] = sevenDigits(double(sphere->radius));
  } else if (const auto* capsule = std::get_if<CapsuleShape>(&solid.shape)) {
    shape["radius"] = sevenDigits(double(capsule->radius));
    shape["half_length"] = sevenDigits(double(capsule->half_length));
  } else {
    shape["half_size"] = jsonOf(wideOf(std::get<BoxShape>(solid.shape).half_size));
  }
  json["at"] = jsonOf(wideOf(solid.settings.at.position) + shift);
  if (const Eigen::AngleAxisd turn(rotationOf(solid.settings.at)); turn.angle() > 0) {
    json["axis"] = jsonOf(turn.axis());
    json["keys"] = Json::array({{{"time", 0}, {"turn", degreesOf(turn)}}});
  }
  json["friction"] = sevenDigits(double(solid.settings.friction));
  json["restitution"] = sevenDigits(double(solid.settings.restitution));
  return json;
}

// The first body, where its scene turns it.
Json bodiesOf(const Scene& scene) {
  const formats::PackageInfo& info = scene.assets().front()->package().info();
  const Eigen::Matrix3d rotation = rotationOf(scene.placement());
  const Eigen::AngleAxisd turn(rotation);
  const Vector3d middle = (wideOf(info.bounds_min) + wideOf(info.bounds_max)) / 2;
  return Json::array(
      {{{"move", jsonOf(rotation * middle - middle)}, {"axis", jsonOf(turn.axis())}, {"turn", degreesOf(turn)}}});
}

}  // namespace

std::string shapeName(const ColliderShape& shape) {
  return std::holds_alternative<BoxShape>(shape)       ? "box"
         : std::holds_alternative<SphereShape>(shape)  ? "sphere"
         : std::holds_alternative<CapsuleShape>(shape) ? "capsule"
                                                       : "";
}

std::string sceneText(const Scene& scene, const SceneTextOptions& options) {
  Json json = {{"sinew_scene", 1}, {"seconds", 2}};
  const WorldSettings& world = scene.world().settings();
  if (world.gravity[1] < 0) json["gravity"] = sevenDigits(-double(world.gravity[1]));
  json["step"] = sevenDigits(double(scene.options().step_seconds));
  json["iterations"] = world.iterations;
  json["damping"] = sevenDigits(double(world.damping));
  json["deformation_damping_ratio"] = sevenDigits(double(world.deformation_damping_ratio));
  json["support_damping"] = sevenDigits(double(world.support_damping));
  json["stiffness"] = sevenDigits(double(scene.world().bodySettings(scene.body()).stiffness_scale));
  // The package's pins hold it here, or the scene's own; in either case the package's hold it there.
  json["package_pins"] = scene.world().bodySettings(scene.body()).package_pins || !scene.pinned().empty();
  const formats::PackageView& package = scene.assets().front()->package();
  Json channels = Json::object();
  for (std::uint32_t c = 0; c < scene.channelInputs().size(); ++c) {
    const double input = sevenDigits(double(scene.channelInputs()[c]));
    if (!(input > 0)) continue;
    Json keys = Json::array();
    keys.push_back({0, 0});
    keys.push_back({kReachSeconds, input});
    channels[std::string(package.text(package.channels()[c].name))] = keys;
  }
  if (!channels.empty()) json["channels"] = channels;
  if (options.picks) {
    if (const Json picks = picksOf(scene); !picks.empty()) json["picks"] = picks;
  }
  for (const SceneScript::Target& target : options.targets) {
    const SceneScript::TargetKey& key = target.keys.front();
    const Vector3d move(key.move[0], key.move[1], key.move[2]);
    if (key.turn == 0 && move.isZero()) continue;
    Json keys = Json::array();
    keys.push_back({{"time", 0}});
    keys.push_back({{"time", kReachSeconds}, {"turn", sevenDigits(key.turn / kDegree)}, {"move", jsonOf(move)}});
    json["targets"][target.name] = {{"axis", jsonOf({target.axis[0], target.axis[1], target.axis[2]})},
                                    {"point", jsonOf({target.point[0], target.point[1], target.point[2]})},
                                    {"keys", keys}};
  }
  const Vector3d shift = shiftOf(scene);
  if (scene.hasGround()) json["ground"] = sevenDigits(double(scene.groundHeight()) + shift.y());
  const SceneChoice& choice = scene.options().scene;
  Json colliders = choice.script ? choice.script->text.json().value("colliders", Json::array()) : Json::array();
  for (const PlacedSolid& solid : options.solids) colliders.push_back(solidOf(solid, shift));
  if (!colliders.empty()) json["colliders"] = colliders;
  if (!rotationOf(scene.placement()).isIdentity()) json["bodies"] = bodiesOf(scene);
  if (options.camera) {
    json["camera"] = {{"yaw", sevenDigits(options.camera->yaw / kDegree)},
                      {"pitch", sevenDigits(options.camera->pitch / kDegree)}};
    if (options.camera->at) {
      const auto& at = *options.camera->at;
      json["camera"]["at"] = jsonOf({at[0], at[1], at[2]});
      json["camera"]["height"] = sevenDigits(options.camera->height);
    }
  }
  return json.dump(1) + "\n";
}

}  // namespace sinew::tools
