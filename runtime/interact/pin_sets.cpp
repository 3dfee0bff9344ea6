// SPDX-License-Identifier: MIT
#include "runtime/interact/pin_sets.h"

#include <algorithm>
#include <cmath>

#include "runtime/geometry/rotation.h"

namespace sinew::internal {
namespace {

/// Rounding of a rotation matrix that was made of a quaternion, both of floats: sums of products 2 q_i q_j, four
/// roundings of 2^-24 each and as much of the target.
constexpr float kTurnRounding = 5e-7F;

// Whether the vertices of a set count as held.
void setHeld(Body& body, const PinSet& set, bool held) {
  for (const PinnedVertex& vertex : set.vertices) body.pinned[vertex.vertex] = held ? 1 : 0;
}

}  // namespace

void addPinSet(Body& body, PinSet&& set) {
  const Matrix3 rotation = asMatrix(set.at.rotation);
  for (PinnedVertex& vertex : set.vertices) {
    const Vector3 arm = asVector(body.x[vertex.vertex]) - asVector(set.at.position);
    vertex.local = asArray(rotation.transpose() * arm);
  }
  body.pin_sets.push_back(std::move(set));
  setHeld(body, body.pin_sets.back(), true);
}

void setPackagePins(Body& body, std::uint32_t& next_id) {
  const formats::PackageView& package = body.package();
  const auto weights = package.pinWeights();
  OwningArray<PinSet> sets(body.pin_sets.memory());
  Array<std::uint8_t> held(body.pin_sets.memory());
  const std::size_t count = body.settings.package_pins ? package.pinSets().size() : 0;
  if (count > 0) held.resize(body.vertexCount());
  for (std::uint32_t s = 0; s < count; ++s) {
    const formats::PinSet& source = package.pinSets()[s];
    PinSet set(body.pin_sets.memory());
    set.source = s;
    set.method = PinMethod(source.method);
    set.before = set.at = set.target = {body.settings.position, body.settings.rotation};
    for (const std::uint32_t vertex : package.pinSetVertices().subspan(source.first, source.count)) {
      const float weight = weights.empty() ? 1.0F : weights[vertex];
      if (!(weight > 0) || held[vertex] != 0) continue;
      set.vertices.push_back({vertex, weight, body.vertices()[vertex].rest_position});
      held[vertex] = 1;
    }
    if (set.vertices.empty()) continue;
    set.id = next_id + std::uint32_t(sets.size());
    sets.push_back(std::move(set));
  }
  body.pin_sets.swap(sets);
  next_id += std::uint32_t(body.pin_sets.size());
}

RigidTransform between(const RigidTransform& from, const RigidTransform& to, double part) {
  if (part == 0) return from;
  if (part == 1) return to;
  const auto mixed = [part](float a, float b) { return float((1 - part) * double(a) + part * double(b)); };
  RigidTransform result;
  Mat3 mean;
  for (std::size_t i = 0; i < 3; ++i) result.position[i] = mixed(from.position[i], to.position[i]);
  float apart = 0;
  for (std::size_t i = 0; i < 9; ++i) {
    mean[i] = mixed(from.rotation[i], to.rotation[i]);
    apart = std::max(apart, std::abs(to.rotation[i] - from.rotation[i]));
  }
  if (apart <= kTurnRounding) {
    result.rotation = to.rotation;
    return result;
  }
  const Matrix3 rotation = geometry::nearestRotation(asMatrix(mean));
  for (int i = 0; i < 9; ++i) result.rotation[std::size_t(i)] = rotation(i / 3, i % 3);
  return result;
}

void moveHolds(Body& body, double share) {
  for (Pin& pin : body.pins) {
    pin.before = pin.at;
    // The target itself in the last part: nothing is rounded.
    if (share == 1) {
      pin.at = pin.target;
    } else {
      asVector(pin.at) += float(share) * (asVector(pin.target) - asVector(pin.at));
    }
  }
  for (PinSet& set : body.pin_sets) {
    set.before = set.at;
    set.at = between(set.at, set.target, share);
    set.force_sum.setZero();
    set.torque_sum.setZero();
  }
}

void removePinSet(Body& body, std::size_t index) {
  setHeld(body, body.pin_sets[index], false);
  body.pin_sets.erase(index);
}

void removePinSets(Body& body) {
  for (const PinSet& set : body.pin_sets) setHeld(body, set, false);
  body.pin_sets.clear();
}

}  // namespace sinew::internal
