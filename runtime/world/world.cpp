// SPDX-License-Identifier: MIT
#include "sinew/runtime/world.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "runtime/attach/visual.h"
#include "runtime/step/world_step.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;

struct World::Impl {
  WorldSettings settings;
  JobSystem* jobs = nullptr;
  std::vector<std::unique_ptr<Body>> bodies;  // by BodyId; null where removed, since ids are never used again
  std::array<Phase, internal::kStepPhaseCount> phases = {
      {{"predict", 0}, {"moments", 0}, {"rows", 0}, {"match", 0}, {"solve", 0}, {"goals", 0}, {"settle", 0}}};
  std::uint32_t next_pick = 0;

  // The stiffness that bodies of an asset with the same scale share.
  std::shared_ptr<internal::StiffnessSet> stiffnessOf(const Asset& asset, float scale) const {
    for (const std::unique_ptr<Body>& body : bodies) {
      if (body != nullptr && body->asset.get() == &asset && body->stiffness->scale == scale) return body->stiffness;
    }
    return std::make_shared<internal::StiffnessSet>(asset.package(), scale);
  }

  Body* find(BodyId id) const { return id.value < bodies.size() ? bodies[id.value].get() : nullptr; }

  // The body and place of a pick; (nullptr, 0) where it was let go.
  std::pair<Body*, std::size_t> findPick(PickId id) const {
    for (const std::unique_ptr<Body>& body : bodies) {
      if (body == nullptr) continue;
      for (std::size_t i = 0; i < body->picks.size(); ++i) {
        if (body->picks[i].id == id.value) return {body.get(), i};
      }
    }
    return {nullptr, 0};
  }
};

World::World(const WorldSettings& settings, JobSystem* jobs) : impl_(std::make_unique<Impl>()) {
  impl_->settings = settings;
  impl_->jobs = jobs;
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

WorldSettings& World::settings() { return impl_->settings; }
const WorldSettings& World::settings() const { return impl_->settings; }

Result<BodyId> World::addBody(std::shared_ptr<const Asset> asset, const BodySettings& settings) {
  if (asset == nullptr) return Error{"addBody: no asset"};
  const auto finite = [](float value) { return std::isfinite(value); };
  if (!std::all_of(settings.position.begin(), settings.position.end(), finite)) {
    return Error{"addBody: BodySettings::position is not finite"};
  }
  const Eigen::Map<const internal::Matrix3> rotation(settings.rotation.data());
  if (!((rotation * rotation.transpose() - internal::Matrix3::Identity()).norm() < 1e-3F) ||
      !(rotation.determinant() > 0)) {
    return Error{"addBody: BodySettings::rotation is not a proper rotation"};
  }
  if (!(settings.stiffness_scale >= 0) || !finite(settings.stiffness_scale)) {
    return Error{"addBody: BodySettings::stiffness_scale must be 0 or more"};
  }
  auto stiffness = impl_->stiffnessOf(*asset, settings.stiffness_scale);
  impl_->bodies.push_back(std::make_unique<Body>(std::move(asset), settings, std::move(stiffness)));
  return BodyId{std::uint32_t(impl_->bodies.size() - 1)};
}

void World::removeBody(BodyId id) {
  if (impl_->find(id) == nullptr) return;
  impl_->bodies[id.value].reset();
}

void World::resetBody(BodyId id) {
  if (Body* body = impl_->find(id)) body->reset();
}

const Asset& World::asset(BodyId id) const { return *impl_->bodies[id.value]->asset; }

void World::step(float seconds) {
  if (!(seconds > 0) || !std::isfinite(seconds)) return;
  internal::StepTimes times;
  const bool measured = impl_->settings.measure_phases;
  internal::stepWorld(impl_->bodies, impl_->settings, impl_->jobs, seconds, measured ? &times : nullptr);
  for (std::size_t k = 0; k < times.size(); ++k) impl_->phases[k].milliseconds = measured ? times[k] : 0;
}

std::span<const Vec3> World::positions(BodyId id) const {
  const Body* body = impl_->find(id);
  return body != nullptr ? std::span<const Vec3>(body->x.data(), body->vertexCount()) : std::span<const Vec3>();
}

std::span<const Vec3> World::velocities(BodyId id) const {
  const Body* body = impl_->find(id);
  return body != nullptr ? std::span<const Vec3>(body->v.data(), body->vertexCount()) : std::span<const Vec3>();
}

std::uint32_t World::repairedVertices(BodyId id) const {
  const Body* body = impl_->find(id);
  return body != nullptr ? body->repaired : 0;
}

void World::setState(BodyId id, std::span<const Vec3> positions, std::span<const Vec3> velocities) {
  Body* body = impl_->find(id);
  if (body == nullptr || positions.size() != body->vertexCount()) return;
  if (!velocities.empty() && velocities.size() != body->vertexCount()) return;
  std::copy(positions.begin(), positions.end(), body->x.begin());
  if (velocities.empty()) {
    std::fill(body->v.begin(), body->v.end(), Vec3{});
  } else {
    std::copy(velocities.begin(), velocities.end(), body->v.begin());
  }
  std::fill(body->force.begin(), body->force.end(), Vec3{});
  for (internal::Pick& pick : body->picks) pick.force = {};
  body->matchPositions();
}

void World::pin(BodyId id, std::uint32_t vertex, Vec3 target) {
  Body* body = impl_->find(id);
  if (body == nullptr || vertex >= body->vertexCount()) return;
  const auto place = std::lower_bound(body->pins.begin(), body->pins.end(), vertex,
                                      [](const internal::Pin& pin, std::uint32_t v) { return pin.vertex < v; });
  if (place != body->pins.end() && place->vertex == vertex) {
    place->target = target;
    return;
  }
  body->pins.insert(place, {vertex, target});
  body->pinned[vertex] = 1;
  body->force[vertex] = {};
}

void World::unpin(BodyId id, std::uint32_t vertex) {
  Body* body = impl_->find(id);
  if (body == nullptr || vertex >= body->vertexCount() || body->pinned[vertex] == 0) return;
  std::erase_if(body->pins, [vertex](const internal::Pin& pin) { return pin.vertex == vertex; });
  body->pinned[vertex] = 0;
  body->force[vertex] = {};
}

void World::unpinAll(BodyId id) {
  Body* body = impl_->find(id);
  if (body == nullptr) return;
  for (const internal::Pin& pin : body->pins) {
    body->pinned[pin.vertex] = 0;
    body->force[pin.vertex] = {};
  }
  body->pins.clear();
}

PickId World::pick(BodyId id, std::uint32_t visual_vertex, Vec3 target, float frequency_hz) {
  Body* body = impl_->find(id);
  if (body == nullptr || visual_vertex >= body->package().visualPositions().size()) return {};
  const PickId pick{impl_->next_pick++};
  body->picks.push_back({pick.value, visual_vertex, target, std::clamp(frequency_hz, 0.1F, 100.0F), {}});
  body->rows.reserve(body->vertexCount() + body->picks.size());
  return pick;
}

void World::movePick(PickId id, Vec3 target) {
  const auto [body, index] = impl_->findPick(id);
  if (body != nullptr) body->picks[index].target = target;
}

void World::releasePick(PickId id) {
  const auto [body, index] = impl_->findPick(id);
  if (body != nullptr) body->picks.erase(body->picks.begin() + std::ptrdiff_t(index));
}

void World::visualVertices(BodyId id, StridedFloat3 positions, StridedFloat3 normals) const {
  const Body* body = impl_->find(id);
  if (body == nullptr) return;
  const formats::PackageView& package = body->package();
  const std::uint32_t visual_count = std::uint32_t(package.visualPositions().size());
  if (package.visualNormals().empty()) normals.data = nullptr;
  const auto parallel = [this](std::uint32_t count, std::uint32_t grain, const auto& work) {
    if (impl_->jobs == nullptr) {
      work(0U, count);
    } else {
      impl_->jobs->parallelFor(count, grain, [&work](std::uint32_t begin, std::uint32_t end) { work(begin, end); });
    }
  };
  if (normals.data != nullptr && !body->cofactors_fresh) {
    body->cofactors.resize(body->vertexCount());
    parallel(body->vertexCount(), 1024,
             [body](std::uint32_t begin, std::uint32_t end) { updateCofactors(*body, begin, end); });
    body->cofactors_fresh = true;
  }
  std::uint32_t count = 0;
  if (positions.data != nullptr) count = std::max(count, std::min(positions.count, visual_count));
  if (normals.data != nullptr) count = std::max(count, std::min(normals.count, visual_count));
  parallel(count, 4096,
           [&](std::uint32_t begin, std::uint32_t end) { writeVisual(*body, begin, end, positions, normals); });
}

void World::rigidMotion(BodyId id, Mat3& rotation, Vec3& translation) const {
  Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> result(rotation.data());
  const Body* body = impl_->find(id);
  if (body == nullptr) {
    result.setIdentity();
    translation = {};
    return;
  }
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < body->vertexCount(); ++i) {
    const double m = double(body->vertices()[i].mass);
    mass += m;
    center += m * asVector(body->x[i]).cast<double>();
    rest_center += m * asVector(body->vertices()[i].rest_position).cast<double>();
  }
  center /= mass;
  rest_center /= mass;
  Eigen::Matrix3d a_pq = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < body->vertexCount(); ++i) {
    a_pq += double(body->vertices()[i].mass) * (asVector(body->x[i]).cast<double>() - center) *
            (asVector(body->vertices()[i].rest_position).cast<double>() - rest_center).transpose();
  }
  const double scale = a_pq.cwiseAbs().maxCoeff();
  const internal::Matrix3 r =
      scale > 0 ? geometry::nearestRotation((a_pq / scale).cast<float>()) : internal::Matrix3::Identity();
  result = r;
  translation = asArray((center - r.cast<double>() * rest_center).cast<float>());
}

void World::clusterFrame(BodyId id, std::uint32_t cluster, Vec3& center, Mat3& linear) const {
  const Body* body = impl_->find(id);
  if (body == nullptr || cluster >= body->clusterCount()) return;
  const internal::ClusterFrame frame = internal::loadFrame(body->blocks, cluster);
  center = asArray(frame.center);
  Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>> result(linear.data());
  result = frame.f.leftCols<3>();
}

std::span<const World::Phase> World::lastStepPhases() const { return impl_->phases; }

}  // namespace sinew
