// SPDX-License-Identifier: GPL-3.0-or-later
//
// What a scene file does to bodies while they move: picks, pushers, driven colliders, impulses, forces, levels, wind.
#include <cmath>
#include <limits>
#include <utility>

#include "tools/core/error.h"
#include "tools/scene/scene.h"

namespace sinew::tools {

Vec3 Scene::placed(const std::array<double, 3>& source) const {
  Vec3 result;
  for (std::size_t a = 0; a < 3; ++a) result[a] = float(source[a] - script_->origin[a]);
  return result;
}

std::pair<BodyId, BodyPoint> Scene::nearest(const Vec3& place) const {
  std::pair<BodyId, BodyPoint> best = {body(), {}};
  double least = std::numeric_limits<double>::infinity();
  for (const BodyId id : bodies_) {
    const BodyPoint point = world_.nearestPoint(id, place);
    const Vec3 at = world_.placeOf(id, point);
    const double off = std::hypot(double(at[0] - place[0]), double(at[1] - place[1]), double(at[2] - place[2]));
    if (!(off < least)) continue;
    least = off;
    best = {id, point};
  }
  return best;
}

void Scene::driveHands(double time) {
  const SceneScript& script = script_->script;
  const auto narrow = [](const std::array<double, 3>& v) { return Vec3{float(v[0]), float(v[1]), float(v[2])}; };
  hands_.resize(script.picks.size());
  for (std::size_t i = 0; i < hands_.size(); ++i) {
    const SceneScript::Pick& from = script.picks[i];
    Hand& hand = hands_[i];
    if (time < from.keys.front().time || hand.done) continue;
    if (hand.pick == PickId{}) {
      const PickSettings settings = {float(from.frequency_hz), float(from.most_force)};
      Vec3 at = placed(from.at);
      if (from.direction) {
        const auto& d = *from.direction;
        const double length = std::hypot(d[0], d[1], d[2]);
        const Vec3 along = {float(d[0] / length), float(d[1] / length), float(d[2] / length)};
        hand.pick = world_.pickRay(at, along, 1e6F, settings);
        if (hand.pick == PickId{}) {
          script.text.fail(childPointer("/picks", i), "the ray meets no body", "Move it, or leave out the direction.");
        }
        at = world_.pickState(hand.pick).target;
      } else {
        const auto [id, point] = nearest(at);
        at = world_.placeOf(id, point);
        hand.pick = world_.pick(id, point, at, settings);
      }
      hand.start = at;
      world_.lockPick(hand.pick, from.lock);
    }
    const std::array<double, 3> move = valueAt(from.keys, time);
    Vec3 target = hand.start;
    for (std::size_t a = 0; a < 3; ++a) target[a] += float(move[a]);
    world_.movePick(hand.pick, target);
    const bool let_go = from.lock ? from.release && time >= *from.release : time > from.keys.back().time;
    if (let_go) world_.releasePick(hand.pick);
    hand.done = let_go;
  }
  for (std::size_t i = 0; i < driven_solids_.size(); ++i) {
    if (!script.colliders[i].motion.keys.empty()) world_.moveCollider(driven_solids_[i], drivenAt(i, time));
  }
  pushers_.resize(script.pushes.size());
  for (std::size_t i = 0; i < pushers_.size(); ++i) {
    const SceneScript::Push& from = script.pushes[i];
    if (time < from.keys.front().time) continue;
    const RigidTransform to = {placed(valueAt(from.keys, time))};
    if (time > from.keys.back().time) {
      if (!(pushers_[i] == ColliderId{})) removeSolid(pushers_[i]);
      pushers_[i] = {};
    } else if (pushers_[i] == ColliderId{}) {
      ColliderSettings settings;
      settings.at = to;
      settings.most_speed = float(from.speed);
      settings.mass = float(from.mass);
      pushers_[i] = addSolid(SphereShape{float(from.radius)}, settings);
    } else {
      world_.moveCollider(pushers_[i], to);
    }
  }
  for (; next_impulse_ < script.impulses.size() && script.impulses[next_impulse_].time < time; ++next_impulse_) {
    const SceneScript::Impulse& from = script.impulses[next_impulse_];
    if (from.at) {
      const auto [id, point] = nearest(placed(*from.at));
      world_.addImpulse(id, point, narrow(from.impulse));
    } else {
      world_.addImpulse(body(), narrow(from.impulse));
    }
  }
  for (std::size_t i = 0; i < script.forces.size(); ++i) {
    const SceneScript::Force& from = script.forces[i];
    if (held_points_.size() <= i)
      held_points_.push_back(from.at ? nearest(placed(*from.at)) : std::pair{body(), BodyPoint{}});
    const auto& [id, point] = held_points_[i];
    const Vec3 force = narrow(valueAt(from.keys, time));
    if (!world_.contains(id)) continue;
    from.at ? world_.addForce(id, point, force) : world_.addForce(id, force);
  }
  if (!script.levels.empty()) {
    std::uint32_t level = 0;
    for (const SceneScript::Level& key : script.levels) {
      if (key.time <= time) level = key.level;
    }
    for (const BodyId id : bodies_) {
      BodySettings settings = world_.bodySettings(id);
      settings.level = level;
      world_.setBodySettings(id, settings);
    }
  }
  if (!script.wind.empty()) world_.settings().wind = narrow(valueAt(script.wind, time));
}

}  // namespace sinew::tools
