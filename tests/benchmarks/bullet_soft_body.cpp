// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/benchmarks/bullet_soft_body.h"

#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace sinew::benchmarks {

struct BulletSoftBody::Impl {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::unique_ptr<btStaticPlaneShape> plane;
  std::unique_ptr<btRigidBody> ground;
  btSoftBody* body = nullptr;  // owned by the world until the destructor
  std::vector<btVector3> start;
  btScalar size = 0;
  bool moving = false;
};

BulletSoftBody::BulletSoftBody(std::span<const float> vertices, std::span<const int> triangles, const Scene& scene)
    : impl_(std::make_unique<Impl>()) {
  impl_->moving = scene.moving;
  const std::vector<btScalar> points(vertices.begin(), vertices.end());
  btSoftRigidDynamicsWorld& world = impl_->world;
  world.setGravity(btVector3(0, btScalar(-9.81), 0));
  world.getWorldInfo().m_gravity = world.getGravity();
  world.getWorldInfo().m_sparsesdf.Initialize();
  btSoftBody* body = btSoftBodyHelpers::CreateFromTriMesh(world.getWorldInfo(), points.data(), triangles.data(),
                                                          int(triangles.size() / 3));
  body->setTotalMass(btScalar(scene.total_mass));
  for (std::size_t i = 0; i < scene.held.size(); ++i) {
    if (scene.held[i] != 0) body->setMass(int(i), 0);
  }
  body->setActivationState(DISABLE_DEACTIVATION);
  world.addSoftBody(body);
  btVector3 low(1e30F, 1e30F, 1e30F), high = -low;
  for (int i = 0; i < body->m_nodes.size(); ++i) {
    impl_->start.push_back(body->m_nodes[i].m_x);
    low.setMin(body->m_nodes[i].m_x);
    high.setMax(body->m_nodes[i].m_x);
  }
  impl_->size = (high - low).length();
  if (scene.ground) {
    const btScalar level = low.y() - body->getCollisionShape()->getMargin();
    impl_->plane = std::make_unique<btStaticPlaneShape>(btVector3(0, 1, 0), level);
    impl_->ground =
        std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, impl_->plane.get()));
    world.addRigidBody(impl_->ground.get());
  }
  impl_->body = body;
  restart();
}

BulletSoftBody::~BulletSoftBody() {
  impl_->world.removeSoftBody(impl_->body);
  if (impl_->ground) impl_->world.removeRigidBody(impl_->ground.get());
  delete impl_->body;
}

void BulletSoftBody::restart() {
  const btVector3 spin = impl_->moving ? btVector3(1, -2, 3) : btVector3(0, 0, 0);
  for (int i = 0; i < impl_->body->m_nodes.size(); ++i) {
    btSoftBody::Node& node = impl_->body->m_nodes[i];
    node.m_x = node.m_q = impl_->start[std::size_t(i)];
    node.m_v = spin.cross(node.m_x);
  }
}

void BulletSoftBody::step() { impl_->world.stepSimulation(btScalar(1.0 / 60), 0); }

bool BulletSoftBody::isSound() const {
  btVector3 middle(0, 0, 0);
  const int count = impl_->body->m_nodes.size();
  for (int i = 0; i < count; ++i) middle += impl_->body->m_nodes[i].m_x / btScalar(count);
  for (int i = 0; i < count; ++i) {
    const btScalar away = (impl_->body->m_nodes[i].m_x - middle).length();
    if (!(std::isfinite(away) && away < 10 * impl_->size)) return false;
  }
  return true;
}

std::uint32_t BulletSoftBody::vertices() const { return std::uint32_t(impl_->body->m_nodes.size()); }

std::uint32_t BulletSoftBody::links() const { return std::uint32_t(impl_->body->m_links.size()); }

std::string BulletSoftBody::version() {
  return std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
}

}  // namespace sinew::benchmarks
