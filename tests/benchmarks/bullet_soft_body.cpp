// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/benchmarks/bullet_soft_body.h"

#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <array>
#include <cmath>
#include <map>
#include <vector>

namespace sinew::benchmarks {
namespace {

constexpr btScalar kSize = 10;  // of the block, Bullet's units; its demonstrations use such sizes
constexpr btScalar kMatching = 0.05F;

// The surface of a block, each point once.
void blockSurface(std::uint32_t points, std::vector<btScalar>& vertices, std::vector<int>& triangles) {
  const int last = int(points) - 1;
  std::map<std::array<int, 3>, int> numbers;
  const auto number = [&](const std::array<int, 3>& at) {
    const auto [place, added] = numbers.try_emplace(at, int(vertices.size() / 3));
    if (added) {
      for (const int k : at) vertices.push_back(kSize * (btScalar(k) / btScalar(last) - btScalar(0.5)));
    }
    return place->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const int side : {0, last}) {
      for (int j = 0; j < last; ++j) {
        for (int i = 0; i < last; ++i) {
          const auto corner = [&](int di, int dj) {
            std::array<int, 3> at{};
            at[axis] = side;
            at[(axis + 1) % 3] = i + di;
            at[(axis + 2) % 3] = j + dj;
            return number(at);
          };
          const std::array<int, 4> c = {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)};
          const std::array<int, 6> faces = side == 0 ? std::array<int, 6>{c[0], c[2], c[1], c[0], c[3], c[2]}
                                                     : std::array<int, 6>{c[0], c[1], c[2], c[0], c[2], c[3]};
          triangles.insert(triangles.end(), faces.begin(), faces.end());
        }
      }
    }
  }
}

}  // namespace

struct BulletSoftBody::Impl {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world{&dispatcher, &broadphase, &solver, &configuration};
  btSoftBody* body = nullptr;  // owned by the world until the destructor
  std::vector<btVector3> start;
  bool moving = true;
};

BulletSoftBody::BulletSoftBody(std::uint32_t points, std::uint32_t clusters, bool moving)
    : impl_(std::make_unique<Impl>()) {
  impl_->moving = moving;
  std::vector<btScalar> vertices;
  std::vector<int> triangles;
  blockSurface(points, vertices, triangles);
  btSoftRigidDynamicsWorld& world = impl_->world;
  world.setGravity(btVector3(0, moving ? -10 : 0, 0));
  world.getWorldInfo().m_gravity = world.getGravity();
  world.getWorldInfo().m_sparsesdf.Initialize();
  btSoftBody* body = btSoftBodyHelpers::CreateFromTriMesh(world.getWorldInfo(), vertices.data(), triangles.data(),
                                                          int(triangles.size() / 3), false);
  body->m_cfg.piterations = 1;
  body->m_cfg.collisions = btSoftBody::fCollision::CL_SS + btSoftBody::fCollision::CL_RS;
  body->setTotalMass(btScalar(vertices.size() / 3));
  body->generateClusters(int(clusters));
  for (int c = 0; c < body->m_clusters.size(); ++c) {
    // The master cluster is the one that collides with nothing.
    body->m_clusters[c]->m_matching = body->m_clusters[c]->m_collide ? kMatching : 0;
  }
  body->getCollisionShape()->setMargin(btScalar(0.01));
  body->setActivationState(DISABLE_DEACTIVATION);
  world.addSoftBody(body);
  for (int i = 0; i < body->m_nodes.size(); ++i) impl_->start.push_back(body->m_nodes[i].m_x);
  impl_->body = body;
  restart();
}

BulletSoftBody::~BulletSoftBody() {
  impl_->world.removeSoftBody(impl_->body);
  delete impl_->body;
}

void BulletSoftBody::restart() {
  const btVector3 spin = impl_->moving ? btVector3(1, -2, 3) : btVector3(0, 0, 0);
  const btScalar bend = impl_->moving ? btScalar(0.01) : btScalar(0);
  for (int i = 0; i < impl_->body->m_nodes.size(); ++i) {
    btSoftBody::Node& node = impl_->body->m_nodes[i];
    const btVector3& rest = impl_->start[std::size_t(i)];
    node.m_x = node.m_q = rest + btVector3(0, bend * rest.x() * rest.x(), 0);
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
    if (!(std::isfinite(away) && away < 4 * kSize)) return false;
  }
  return true;
}

std::uint32_t BulletSoftBody::vertices() const { return std::uint32_t(impl_->body->m_nodes.size()); }

std::uint32_t BulletSoftBody::memberships() const {
  int sum = 0;
  for (int c = 0; c < impl_->body->m_clusters.size(); ++c) sum += impl_->body->m_clusters[c]->m_nodes.size();
  return std::uint32_t(sum);
}

std::string BulletSoftBody::version() {
  return std::to_string(btGetVersion() / 100) + "." + std::to_string(btGetVersion() % 100);
}

}  // namespace sinew::benchmarks
