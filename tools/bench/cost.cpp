// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/cost.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "sinew/runtime/world.h"
#include "tools/bake/leave_out.h"
#include "tools/bench/moving_state.h"
#include "tools/bench/timing.h"

namespace sinew::tools {
namespace {

using nlohmann::ordered_json;

constexpr float kStep = 1.0F / 60;
constexpr unsigned kFrames = 120;  // of a run
const TimingOptions kTiming{.sample_seconds = 2e-3, .seconds = 0.3};

// A world with one body of a package.
class Played {
 public:
  Played(const std::shared_ptr<const Asset>& asset, FrameScene scene)
      : asset_(*asset), scene_(scene), world_(settings()) {
    id_ = *world_.addBody(asset, {});
    if (scene != FrameScene::held) {
      std::vector<PinSetId> pins(world_.pinSets(id_, {}));
      world_.pinSets(id_, pins);
      for (const PinSetId set : pins) world_.removePinSet(set);
    }
    state_ = movingState(asset_);
  }

  double stepMicroseconds(bool channels = false) {
    unsigned frame = 0;
    const TimedCall call{[&] {
                           if (channels) activate(frame++);
                           world_.step(kStep);
                         },
                         [&] {
                           if (scene_ == FrameScene::air) {
                             world_.setState(id_, state_.positions, state_.velocities);
                           } else {
                             world_.resetBody(id_);
                           }
                         },
                         kFrames};
    return 1e6 * measure(call, kTiming).seconds;
  }

  double drawnMicroseconds(bool normals) {
    const auto count = std::uint32_t(asset_.package().visualPositions().size());
    if (count == 0) return 0;
    std::vector<Vec3> to(2 * std::size_t{count});
    const StridedFloat3 positions{to[0].data(), sizeof(Vec3), count};
    const StridedFloat3 normal_target =
        normals ? StridedFloat3{to[count].data(), sizeof(Vec3), count} : StridedFloat3{};
    const TimedCall call{[&] { world_.visualVertices(id_, positions, normal_target); }, [&] { world_.step(kStep); }, 1};
    return 1e6 * measure(call, kTiming).seconds;
  }

 private:
  WorldSettings settings() const {
    const formats::PackageInfo& info = asset_.package().info();
    WorldSettings settings;
    settings.ground.enabled = scene_ == FrameScene::ground;
    settings.ground.offset = info.bounds_min[1] - 0.1F * info.diagonal;
    return settings;
  }

  void activate(unsigned frame) {
    const float input = float(0.5 - 0.5 * std::cos(0.1 * frame));
    for (std::uint32_t c = 0; c < asset_.package().channels().size(); ++c) world_.setActivation(id_, c, input);
  }

  const Asset& asset_;
  FrameScene scene_;
  World world_;
  BodyId id_;
  MovingState state_;
};

double loadMicroseconds(const std::vector<std::byte>& package) {
  const TimedCall call{[&] { keepAlive(Asset::fromMemory(package)->get()); }};
  return 1e6 * measure(call, kTiming).seconds;
}

}  // namespace

FrameScene usualScene(const Asset& asset) {
  if (!asset.package().pinSets().empty()) return FrameScene::held;
  return asset.package().fieldPoints().empty() ? FrameScene::air : FrameScene::ground;
}

FrameCost measureFrame(const std::shared_ptr<const Asset>& asset, FrameScene scene) {
  Played played(asset, scene);
  return {played.stepMicroseconds(), played.drawnMicroseconds(true)};
}

ordered_json packageCost(const std::shared_ptr<const Asset>& asset) {
  const formats::PackageView& package = asset->package();
  const bool packed = std::any_of(package.sections().begin(), package.sections().end(),
                                  [](const formats::SectionInfo& section) { return section.packed; });
  ordered_json json;
  json["bytes"] = package.totalBytes();
  json["sections"] = ordered_json::array();
  for (const formats::SectionInfo& section : package.sections()) {
    json["sections"].push_back({{"name", formats::sectionName(section.id)}, {"bytes", section.bytes}});
    if (section.packed) json["sections"].back()["packed"] = true;
  }
  const Needs now = packed ? Needs::all().without(Need::exact) : Needs::all();
  const std::size_t bytes = packageWith(package, now).size();

  Played air(asset, FrameScene::air);
  const double in_the_air = air.stepMicroseconds();
  const double positions = air.drawnMicroseconds(false);
  const auto timeOf = [&](Need need) -> std::optional<double> {
    switch (need) {
      case Need::contact:
        if (package.fieldPoints().empty()) return std::nullopt;
        return Played(asset, FrameScene::ground).stepMicroseconds() - in_the_air;
      case Need::pins:
        if (package.pinSets().empty()) return std::nullopt;
        return Played(asset, FrameScene::held).stepMicroseconds() - in_the_air;
      case Need::activation:
        if (package.channels().empty()) return std::nullopt;
        return air.stepMicroseconds(true) - in_the_air;
      default:
        return std::nullopt;
    }
  };
  json["needs"] = ordered_json::array();
  for (const NeedDeclaration& d : kNeedDeclarations) {
    if (!now.has(d.need)) continue;
    const std::vector<std::byte> without = packageWith(package, now.without(d.need));
    ordered_json need = {{"need", d.name}, {"bytes", std::int64_t(bytes) - std::int64_t(without.size())}};
    if (const auto time = timeOf(d.need)) need["microseconds"] = std::max(0.0, *time);
    if (const auto change = changeWithout(package, d.need); change && without.size() < bytes) {
      need["change"] = change->most;
      need["unseen"] = change->isUnseen();
      need["unit"] = change->unit;
    }
    need["for"] = d.sentence;
    json["needs"].push_back(need);
  }
  const Needs neither = now.without(Need::contact).without(Need::cut);
  json["needs"].push_back({{"need", "contact,cut"},
                           {"bytes", std::int64_t(bytes) - std::int64_t(packageWith(package, neither).size())},
                           {"for", "both: also the tetrahedra that carry nothing drawn"}});
  const std::vector<std::byte> least = packageWith(package, Needs::none());
  json["none"] = {{"bytes", least.size()}};
  json["times"] = {{"step_in_the_air_us", in_the_air},
                   {"drawn_positions_us", positions},
                   {"drawn_normals_us", std::max(0.0, air.drawnMicroseconds(true) - positions)},
                   {"load_us", loadMicroseconds(packageWith(package, now))},
                   {"load_none_us", loadMicroseconds(least)}};
  return json;
}

}  // namespace sinew::tools
