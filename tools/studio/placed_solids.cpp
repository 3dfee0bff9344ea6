// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/placed_solids.h"

#include <Eigen/Geometry>
#include <algorithm>

namespace sinew::tools {
namespace {

using Eigen::Vector3f;

Eigen::Matrix3f rotationOf(const PlacedSolid& solid) {
  return Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(solid.settings.at.rotation.data());
}

Vector3f middleOf(const PlacedSolid& solid) { return Vector3f(solid.settings.at.position.data()); }

// The axis of its own that a handle of size or turn belongs to.
int axisOf(HandleKind kind) {
  return kind == HandleKind::size_x || kind == HandleKind::turn_x ? 0 : kind == HandleKind::size_z ? 2 : 1;
}

float legalLength(float length) { return std::clamp(length, float(kLeastLength), float(kMostPlace)); }

}  // namespace

std::vector<PlacedSolid> PlacedSolids::all() const {
  std::vector<PlacedSolid> result;
  for (const Entry& entry : solids_) result.push_back(entry.solid);
  return result;
}

void PlacedSolids::add(Scene& scene, const PlacedSolid& solid) {
  Entry entry = {solid, {scene.addSolid(solid.shape, solid.settings), ++changes_}};
  solids_.push_back(entry);
  selected = solids_.size() - 1;
}

void PlacedSolids::change(Scene& scene, std::size_t i, const PlacedSolid& solid, SolidChange how) {
  Entry& entry = solids_[i];
  if (how == SolidChange::goes) {
    scene.world().moveCollider(entry.mark.id, solid.settings.at);
  } else {
    std::shared_ptr<const SolidMesh> mesh;
    for (const SceneSolid& own : scene.solids()) {
      if (own.id == entry.mark.id && how == SolidChange::jumps) mesh = own.mesh;
    }
    const ColliderId id = scene.addSolid(solid.shape, solid.settings, mesh);
    scene.removeSolid(entry.mark.id);
    entry.mark.id = id;
  }
  entry.solid = solid;
  entry.mark.change = ++changes_;
}

void PlacedSolids::remove(Scene& scene, std::size_t i) {
  scene.removeSolid(solids_[i].mark.id);
  solids_.erase(solids_.begin() + std::ptrdiff_t(i));
  selected.reset();
}

void PlacedSolids::enter(Scene& scene) {
  for (Entry& entry : solids_) entry.mark.id = scene.addSolid(entry.solid.shape, entry.solid.settings);
}

std::vector<PlacedSolids::Mark> PlacedSolids::marks() const {
  std::vector<Mark> all;
  for (const Entry& entry : solids_) all.push_back(entry.mark);
  return all;
}

void PlacedSolids::meet(Scene& scene, std::span<const Mark> then) {
  for (const Mark& mark : then) {
    const auto same = [&](const Entry& entry) { return entry.mark.change == mark.change; };
    if (std::none_of(solids_.begin(), solids_.end(), same)) scene.removeSolid(mark.id);
  }
  for (Entry& entry : solids_) {
    const auto same = [&](const Mark& mark) { return entry.mark.change == mark.change; };
    const auto known = std::find_if(then.begin(), then.end(), same);
    entry.mark.id = known != then.end() ? known->id : scene.addSolid(entry.solid.shape, entry.solid.settings);
  }
}

std::vector<Handle> handlesOf(const PlacedSolid& solid, const Vector3f& right, float length) {
  const Vector3f middle = middleOf(solid);
  const Eigen::Matrix3f axes = rotationOf(solid);
  std::vector<Handle> handles;
  const auto add = [&](HandleKind kind, const Vector3f& offset) {
    handles.push_back({kind, (middle + offset).cast<double>()});
  };
  add(HandleKind::center, Vector3f::Zero());
  if (const auto* sphere = std::get_if<SphereShape>(&solid.shape)) {
    add(HandleKind::radius, sphere->radius * right);
  } else if (const auto* capsule = std::get_if<CapsuleShape>(&solid.shape)) {
    const Vector3f along = axes.col(1), across = right - along.dot(right) * along;
    add(HandleKind::radius, capsule->radius * (across.norm() > 1e-3F ? across.normalized() : Vector3f(axes.col(0))));
    add(HandleKind::size_y, capsule->half_length * along);
    add(HandleKind::turn_y, (capsule->half_length + capsule->radius + length) * along);
  } else if (const auto* box = std::get_if<BoxShape>(&solid.shape)) {
    for (const HandleKind kind : {HandleKind::size_x, HandleKind::size_y, HandleKind::size_z})
      add(kind, box->half_size[std::size_t(axisOf(kind))] * axes.col(axisOf(kind)));
    for (const HandleKind kind : {HandleKind::turn_x, HandleKind::turn_y})
      add(kind, (box->half_size[std::size_t(axisOf(kind))] + length) * axes.col(axisOf(kind)));
  }
  return handles;
}

PlacedSolid dragged(const PlacedSolid& solid, HandleKind kind, const Vector3f& to) {
  PlacedSolid made = solid;
  const Vector3f way = to - middleOf(solid);
  const Vector3f axis = rotationOf(solid).col(axisOf(kind));
  if (kind == HandleKind::center) {
    made.settings.at.position = {to.x(), to.y(), to.z()};
  } else if (isTurn(kind)) {
    if (!(way.norm() > 0)) return made;
    const Eigen::Quaternionf turn = Eigen::Quaternionf::FromTwoVectors(axis, way);
    const Eigen::Quaternionf turned = (turn * Eigen::Quaternionf(rotationOf(solid))).normalized();
    Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(made.settings.at.rotation.data()) =
        turned.toRotationMatrix();
  } else if (auto* sphere = std::get_if<SphereShape>(&made.shape)) {
    sphere->radius = legalLength(way.norm());
  } else if (auto* box = std::get_if<BoxShape>(&made.shape)) {
    box->half_size[std::size_t(axisOf(kind))] = legalLength(std::abs(way.dot(axis)));
  } else if (auto* capsule = std::get_if<CapsuleShape>(&made.shape)) {
    const float along = way.dot(axis);
    if (kind == HandleKind::radius)
      capsule->radius = legalLength((way - along * axis).norm());
    else
      capsule->half_length = legalLength(std::abs(along));
  }
  return made;
}

}  // namespace sinew::tools
