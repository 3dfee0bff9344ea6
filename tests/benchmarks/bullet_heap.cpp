// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/benchmarks/bullet_heap.h"

#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

namespace sinew::benchmarks {

struct BulletHeap::Impl {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  std::vector<std::unique_ptr<btCollisionShape>> shapes;
  std::vector<std::unique_ptr<btRigidBody>> walls;
  std::vector<std::unique_ptr<btSoftBody>> bodies;
};

BulletHeap::BulletHeap(std::span<const float> vertices, std::span<const int> triangles,
                       std::span<const std::array<float, 3>> places, float half, float mass)
    : impl_(std::make_unique<Impl>()) {
  btSoftRigidDynamicsWorld& world = impl_->world;
  world.setGravity(btVector3(0, btScalar(-9.81), 0));
  world.getWorldInfo().m_gravity = world.getGravity();
  world.getWorldInfo().m_sparsesdf.Initialize();
  const auto add = [&](btCollisionShape* shape, const btVector3& at) {
    impl_->shapes.emplace_back(shape);
    impl_->walls.push_back(std::make_unique<btRigidBody>(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, shape)));
    impl_->walls.back()->setWorldTransform(btTransform(btQuaternion::getIdentity(), at));
    world.addRigidBody(impl_->walls.back().get());
  };
  const btScalar reach = half + 2, away = half + 1;
  add(new btBoxShape(btVector3(reach, 1, reach)), btVector3(0, -1, 0));
  for (const btScalar side : {btScalar(-1), btScalar(1)}) {
    add(new btBoxShape(btVector3(1, 100, reach)), btVector3(side * away, 0, 0));
    add(new btBoxShape(btVector3(reach, 100, 1)), btVector3(0, 0, side * away));
  }
  const std::vector<btScalar> points(vertices.begin(), vertices.end());
  for (const std::array<float, 3>& place : places) {
    btSoftBody* const body = btSoftBodyHelpers::CreateFromTriMesh(world.getWorldInfo(), points.data(), triangles.data(),
                                                                  int(triangles.size() / 3));
    impl_->bodies.emplace_back(body);
    body->generateBendingConstraints(2);
    body->m_cfg.collisions = btSoftBody::fCollision::CL_SS | btSoftBody::fCollision::CL_RS;
    body->translate(btVector3(place[0], place[1], place[2]));
    body->setTotalMass(btScalar(mass));
    body->generateClusters(8);
    world.addSoftBody(body);
  }
}

BulletHeap::~BulletHeap() {
  for (const auto& body : impl_->bodies) impl_->world.removeSoftBody(body.get());
  for (const auto& wall : impl_->walls) impl_->world.removeRigidBody(wall.get());
}

void BulletHeap::step() { impl_->world.stepSimulation(btScalar(1.0 / 60), 0); }

}  // namespace sinew::benchmarks
