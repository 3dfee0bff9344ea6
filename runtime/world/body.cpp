// SPDX-License-Identifier: MIT
#include "runtime/world/body.h"

#include <algorithm>
#include <cmath>

#include "runtime/geometry/rotation.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {
Body::Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings, const SolverFactory& factory,
           std::pmr::memory_resource* memory)
    : asset(std::move(source)),
      settings(body_settings),
      x(vertexCount() + 1, memory),
      v(vertexCount() + 1, memory),
      pinned(vertexCount(), memory),
      pins(memory),
      picks(memory),
      forces(memory),
      pin_sets(memory),
      activation(package().channels().size(), memory),
      pieces(memory),
      coefficients(memory),
      field_values(memory),
      amplitudes(memory),
      shape(memory),
      ways(memory),
      touches(memory),
      touched(memory),
      history(memory) {
  solver = factory.make(*this, memory);
}

BodyPointer makeBody(std::shared_ptr<const Asset> asset, const BodySettings& settings, const SolverFactory& factory,
                     std::pmr::memory_resource* memory) {
  void* const place = memory->allocate(sizeof(Body), alignof(Body));
  try {
    return {new (place) Body(std::move(asset), settings, factory, memory), BodyRelease{memory}};
  } catch (...) {
    memory->deallocate(place, sizeof(Body), alignof(Body));
    throw;
  }
}

void Body::reset() {
  std::fill(pinned.begin(), pinned.end(), std::uint8_t(0));
  for (const PinSet& set : pin_sets) {
    for (const PinnedVertex& vertex : set.vertices) pinned[vertex.vertex] = 1;
  }
  pins.clear();
  picks.clear();
  forces.clear();
  std::fill(activation.begin(), activation.end(), 0.0F);
  repaired = 0;
  const Matrix3 rotation = asMatrix(settings.rotation);
  for (std::uint32_t i = 0; i < vertexCount(); ++i) {
    x[i] = asArray(rotation * asVector(vertices()[i].rest_position) + asVector(settings.position));
    v[i] = {};
  }
  solver->rest();
}

void findTouched(const Body& body, Array<std::uint32_t>& ids) {
  ids.clear();
  for (const Piece& piece : body.pieces) {
    for (const TouchingPoint& point : piece.state.touching) {
      const auto* const place = std::lower_bound(ids.begin(), ids.end(), point.collider);
      if (place == ids.end() || *place != point.collider) ids.insert(std::size_t(place - ids.begin()), point.collider);
    }
  }
}

RigidTransform rigidMotionOf(const Body& body, VertexRun run) {
  double mass = 0;
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), rest_center = Eigen::Vector3d::Zero();
  const auto forEach = [&](const auto& visit) {
    for (std::uint32_t i = run.first; i < run.first + run.count; ++i) {
      if (!stateIsUsable(body.x[i], body.v[i])) continue;
      const formats::PhysicalVertex& vertex = body.vertices()[i];
      visit(double(vertex.mass), asVector(body.x[i]).cast<double>(), asVector(vertex.rest_position).cast<double>());
    }
  };
  forEach([&](double m, const auto& x, const auto& rest) {
    mass += m;
    center += m * x;
    rest_center += m * rest;
  });
  if (!(mass > 0)) return {body.settings.position, body.settings.rotation};
  center /= mass;
  rest_center /= mass;
  Eigen::Matrix3d a_pq = Eigen::Matrix3d::Zero();
  forEach([&](double m, const auto& x, const auto& rest) {
    a_pq += Eigen::Vector3d(m * (x - center)) * Eigen::Vector3d(rest - rest_center).transpose();
  });
  RigidTransform motion;
  const double scale = a_pq.cwiseAbs().maxCoeff();
  if (scale > 0) {
    const Matrix3 r = geometry::nearestRotation(Matrix3((a_pq / scale).cast<float>()));
    for (int k = 0; k < 9; ++k) motion.rotation[std::size_t(k)] = r(k / 3, k % 3);
  }
  for (std::size_t row = 0; row < 3; ++row) {
    double turned = 0;
    for (std::size_t k = 0; k < 3; ++k) turned += double(motion.rotation[3 * row + k]) * rest_center[int(k)];
    motion.position[row] = float(center[int(row)] - turned);
  }
  return motion;
}

WholeMotion motionOfVertices(const Body& body) {
  WholeMotion whole;
  const auto forEach = [&](const auto& visit) {
    for (std::uint32_t i = 0; i < body.vertexCount(); ++i) {
      visit(double(body.vertices()[i].mass), Eigen::Vector3d(asVector(body.x[i]).cast<double>() - whole.center),
            Eigen::Vector3d(asVector(body.v[i]).cast<double>() - whole.velocity));
    }
  };
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), velocity = center, spin = center;
  forEach([&](double m, const Eigen::Vector3d& x, const Eigen::Vector3d& v) {
    whole.mass += m;
    center += m * x;
    velocity += m * v;
  });
  whole.center = center / whole.mass;
  whole.velocity = velocity / whole.mass;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  forEach([&](double m, const Eigen::Vector3d& arm, const Eigen::Vector3d& v) {
    spin += m * arm.cross(v);
    inertia += m * (arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose());
  });
  const Eigen::Vector3d omega = inertia.inverse() * spin;
  if (omega.allFinite()) whole.angular_velocity = omega;
  return whole;
}

namespace {

std::uint32_t replaceUnusable(Body& body, VertexRun run) {
  const std::uint32_t end = run.first + run.count;
  std::uint32_t lost = 0;
  for (std::uint32_t i = run.first; i < end; ++i) lost += stateIsUsable(body.x[i], body.v[i]) ? 0U : 1U;
  if (lost == 0) return 0;
  const RigidTransform motion = rigidMotionOf(body, run);
  const Matrix3 rotation = asMatrix(motion.rotation);
  Vector3 velocity = Vector3::Zero();
  for (std::uint32_t i = run.first; i < end; ++i) {
    if (stateIsUsable(body.x[i], body.v[i])) velocity += asVector(body.v[i]) / float(run.count - lost);
  }
  for (std::uint32_t i = run.first; i < end; ++i) {
    if (stateIsUsable(body.x[i], body.v[i])) continue;
    asVector(body.x[i]) = rotation * asVector(body.vertices()[i].rest_position) + asVector(motion.position);
    asVector(body.v[i]) = velocity;
  }
  return lost;
}

}  // namespace

std::uint32_t replaceUnusable(Body& body) {
  std::uint32_t lost = 0;
  for (const formats::PieceRange& piece : body.package().pieces()) {
    lost += replaceUnusable(body, {piece.first_vertex, piece.vertex_count});
  }
  return lost;
}

}  // namespace sinew::internal
