// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/scene_text.h"

#include <Eigen/Core>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;

constexpr double kReachSeconds = 0.5;  // from rest to the pose

Vector3d wideOf(const Vec3& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

Json jsonOf(const Vector3d& x) { return {sevenDigits(x[0]), sevenDigits(x[1]), sevenDigits(x[2])}; }

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

// From the first body at its start.
Json picksOf(const Scene& scene) {
  const formats::PackageView& package = scene.assets().front()->package();
  const auto& origin = package.info().origin;
  const Vector3d o(origin[0], origin[1], origin[2]);
  const RigidTransform& placement = scene.placement();
  const Eigen::Matrix3d turn =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(placement.rotation.data()).cast<double>();
  Json list = Json::array();
  std::vector<PickId> picks(scene.world().picks(scene.body(), {}));
  scene.world().picks(scene.body(), picks);
  for (const PickId id : picks) {
    const PickState pick = scene.world().pickState(id);
    if (!pick.locked) continue;
    const Vector3d rest = restOf(package, pick.at);
    const Vector3d target = turn.transpose() * (wideOf(pick.target) - wideOf(placement.position));
    Json keys = Json::array();
    keys.push_back({{"time", 0}, {"move", {0, 0, 0}}});
    keys.push_back({{"time", kReachSeconds}, {"move", jsonOf(target - rest)}});
    list.push_back({{"at", jsonOf(rest + o)}, {"keys", keys}, {"lock", true}});
  }
  return list;
}

}  // namespace

std::string sceneText(const Scene& scene, const SceneTextOptions& options) {
  Json json = {{"sinew_scene", 1}, {"seconds", 2}};
  const WorldSettings& world = scene.world().settings();
  if (world.gravity[1] < 0) json["gravity"] = sevenDigits(-double(world.gravity[1]));
  json["iterations"] = world.iterations;
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
  constexpr double kDegrees = 180 / std::numbers::pi;
  for (const SceneScript::Target& target : options.targets) {
    const SceneScript::TargetKey& key = target.keys.front();
    const Vector3d move(key.move[0], key.move[1], key.move[2]);
    if (key.turn == 0 && move.isZero()) continue;
    Json keys = Json::array();
    keys.push_back({{"time", 0}});
    keys.push_back({{"time", kReachSeconds}, {"turn", sevenDigits(key.turn * kDegrees)}, {"move", jsonOf(move)}});
    json["targets"][target.name] = {{"axis", jsonOf({target.axis[0], target.axis[1], target.axis[2]})},
                                    {"point", jsonOf({target.point[0], target.point[1], target.point[2]})},
                                    {"keys", keys}};
  }
  if (options.camera) {
    json["camera"] = {{"yaw", sevenDigits(options.camera->yaw * kDegrees)},
                      {"pitch", sevenDigits(options.camera->pitch * kDegrees)}};
    if (options.camera->at) {
      const auto& at = *options.camera->at;
      json["camera"]["at"] = jsonOf({at[0], at[1], at[2]});
      json["camera"]["height"] = sevenDigits(options.camera->height);
    }
  }
  return json.dump(1) + "\n";
}

}  // namespace sinew::tools
