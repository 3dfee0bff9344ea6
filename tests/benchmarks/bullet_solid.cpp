// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/benchmarks/bullet_solid.h"

#include <BulletSoftBody/btDeformableBodySolver.h>
#include <BulletSoftBody/btDeformableGravityForce.h>
#include <BulletSoftBody/btDeformableMultiBodyConstraintSolver.h>
#include <BulletSoftBody/btDeformableMultiBodyDynamicsWorld.h>
#include <BulletSoftBody/btDeformableNeoHookeanForce.h>
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyHelpers.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>

#include <algorithm>
#include <set>
#include <utility>

namespace sinew::benchmarks {
namespace {

constexpr int kClusters = 16;
// Of the body's size: the margins of shapes; half the ground's width.
constexpr btScalar kMargin = 1e-3F, kGroundSize = 5;

}  // namespace

struct BulletSolid::Impl {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher{&configuration};
  btDbvtBroadphase broadphase;
  std::unique_ptr<btSequentialImpulseConstraintSolver> plain_solver;
  std::unique_ptr<btDeformableBodySolver> body_solver;
  std::unique_ptr<btDeformableMultiBodyConstraintSolver> deformable_solver;
  std::unique_ptr<btDeformableMultiBodyDynamicsWorld> deformable_world;
  std::unique_ptr<btSoftRigidDynamicsWorld> plain_world;
  std::unique_ptr<btDeformableNeoHookeanForce> elasticity;
  std::unique_ptr<btDeformableGravityForce> gravity;
  std::unique_ptr<btSoftBody> body;
  std::unique_ptr<btBoxShape> ground_shape;
  std::unique_ptr<btRigidBody> ground;
  std::set<std::pair<int, int>> edges;
  btScalar step = 0;

  btSoftBodyWorldInfo& info() {
    return deformable_world ? deformable_world->getWorldInfo() : plain_world->getWorldInfo();
  }
};

BulletSolid::BulletSolid(const Tetrahedra& given, Kind kind, double step_seconds, int iterations)
    : impl_(std::make_unique<Impl>()) {
  Impl& all = *impl_;
  all.step = btScalar(step_seconds);
  if (kind == Kind::links) {
    all.plain_solver = std::make_unique<btSequentialImpulseConstraintSolver>();
    all.plain_world = std::make_unique<btSoftRigidDynamicsWorld>(&all.dispatcher, &all.broadphase,
                                                                 all.plain_solver.get(), &all.configuration);
  } else {
    all.body_solver = std::make_unique<btDeformableBodySolver>();
    all.deformable_solver = std::make_unique<btDeformableMultiBodyConstraintSolver>();
    all.deformable_solver->setDeformableSolver(all.body_solver.get());
    all.deformable_world = std::make_unique<btDeformableMultiBodyDynamicsWorld>(
        &all.dispatcher, &all.broadphase, all.deformable_solver.get(), &all.configuration, all.body_solver.get());
    // Without projection its implicit steps leave every vertex where it is.
    all.deformable_world->setImplicit(kind == Kind::implicit_finite_elements);
    all.deformable_world->setUseProjection(kind == Kind::implicit_finite_elements);
  }
  all.info().m_sparsesdf.Initialize();
  const std::size_t count = given.vertices.size() / 3;
  std::vector<btVector3> points;
  std::vector<btScalar> masses;
  for (std::size_t v = 0; v < count; ++v) {
    points.emplace_back(given.vertices[3 * v], given.vertices[3 * v + 1], given.vertices[3 * v + 2]);
    masses.push_back(given.held[v] != 0 ? 0 : btScalar(given.masses[v]));
  }
  all.body = std::make_unique<btSoftBody>(&all.info(), int(count), points.data(), masses.data());
  btSoftBody& body = *all.body;
  std::set<std::pair<int, int>>& edges = all.edges;
  for (std::size_t t = 0; t + 3 < given.corners.size(); t += 4) {
    const auto corner = [&](std::size_t k) { return int(given.corners[t + k]); };
    body.appendTetra(corner(0), corner(1), corner(2), corner(3));
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t k = i + 1; k < 4; ++k) edges.insert(std::minmax(corner(i), corner(k)));
    }
  }
  body.setActivationState(DISABLE_DEACTIVATION);
  if (kind == Kind::links) {
    for (const auto& [a, b] : edges) body.appendLink(a, b);
    body.m_cfg.piterations = iterations;
    btSoftBodyHelpers::generateBoundaryFaces(&body);
    body.generateClusters(kClusters);
    all.plain_world->addSoftBody(&body);
    return;
  }
  btSoftBodyHelpers::generateBoundaryFaces(&body);
  body.initializeDmInverse();
  body.m_tetraScratches.resize(body.m_tetras.size());
  body.m_tetraScratchesTn.resize(body.m_tetras.size());
  all.deformable_world->addSoftBody(&body);
  // Of the paper's energy (Smith, de Goes, Kim 2018, §3.4), whose parameters for the same linear elasticity are 4/3 mu
  // and lambda + 5/6 mu.
  const double mu = 0.5 * given.young / (1 + given.poisson);
  const double lambda = given.young * given.poisson / ((1 + given.poisson) * (1 - 2 * given.poisson));
  all.elasticity =
      std::make_unique<btDeformableNeoHookeanForce>(btScalar(4 * mu / 3), btScalar(lambda + 5 * mu / 6), btScalar(0));
  all.gravity = std::make_unique<btDeformableGravityForce>(btVector3(0, 0, 0));
  all.deformable_world->addForce(&body, all.elasticity.get());
  all.deformable_world->addForce(&body, all.gravity.get());
}

BulletSolid::~BulletSolid() {
  if (impl_->ground && impl_->deformable_world) impl_->deformable_world->removeRigidBody(impl_->ground.get());
  if (impl_->ground && impl_->plain_world) impl_->plain_world->removeRigidBody(impl_->ground.get());
  if (impl_->deformable_world) {
    impl_->deformable_world->removeForce(impl_->body.get(), impl_->elasticity.get());
    impl_->deformable_world->removeForce(impl_->body.get(), impl_->gravity.get());
    impl_->deformable_world->removeSoftBody(impl_->body.get());
  } else {
    impl_->plain_world->removeSoftBody(impl_->body.get());
  }
}

void BulletSolid::addGround(double height, double friction) {
  Impl& all = *impl_;
  btVector3 rest_low = all.body->m_nodes[0].m_x, rest_high = rest_low;
  for (int i = 0; i < all.body->m_nodes.size(); ++i) {
    rest_low.setMin(all.body->m_nodes[i].m_x);
    rest_high.setMax(all.body->m_nodes[i].m_x);
  }
  const btScalar size = (rest_high - rest_low).length(), margin = kMargin * size;
  all.ground_shape = std::make_unique<btBoxShape>(btVector3(kGroundSize * size, size, kGroundSize * size));
  all.ground_shape->setMargin(margin);
  // Margins of both are counted from the surface out.
  btTransform at = btTransform::getIdentity();
  at.setOrigin(
      {0.5F * (rest_low + rest_high)[0], btScalar(height) - size - 2 * margin, 0.5F * (rest_low + rest_high)[2]});
  all.ground = std::make_unique<btRigidBody>(0, nullptr, all.ground_shape.get());
  all.ground->setWorldTransform(at);
  all.ground->setFriction(1);
  all.body->getCollisionShape()->setMargin(margin);
  all.body->m_cfg.kDF = btScalar(friction);
  if (all.deformable_world) {
    // Neighbours for its tree of nodes, which it would not finish; links pull only where there is a force of theirs.
    for (const auto& [a, b] : all.edges) all.body->appendLink(a, b);
    all.body->m_cfg.collisions = btSoftBody::fCollision::SDF_RD | btSoftBody::fCollision::SDF_RDN;
    all.deformable_world->addRigidBody(all.ground.get());
  } else {
    all.body->m_cfg.collisions = btSoftBody::fCollision::SDF_RS;
    all.plain_world->addRigidBody(all.ground.get());
  }
}

void BulletSolid::setGravity(const std::array<double, 3>& gravity) {
  const btVector3 g{btScalar(gravity[0]), btScalar(gravity[1]), btScalar(gravity[2])};
  impl_->info().m_gravity = g;
  if (impl_->deformable_world) {
    impl_->gravity->m_gravity = g;
  } else {
    impl_->plain_world->setGravity(g);
  }
}

void BulletSolid::place(std::uint32_t vertex, const std::array<double, 3>& position) {
  btSoftBody::Node& node = impl_->body->m_nodes[int(vertex)];
  node.m_x = node.m_q = btVector3(btScalar(position[0]), btScalar(position[1]), btScalar(position[2]));
}

void BulletSolid::step(double decay) {
  if (impl_->deformable_world) {
    impl_->deformable_world->stepSimulation(impl_->step, 1, impl_->step);
  } else {
    impl_->plain_world->stepSimulation(impl_->step, 0);
  }
  for (int i = 0; i < impl_->body->m_nodes.size(); ++i) impl_->body->m_nodes[i].m_v *= btScalar(decay);
}

void BulletSolid::positions(std::vector<double>& out) const {
  out.clear();
  for (int i = 0; i < impl_->body->m_nodes.size(); ++i) {
    const btVector3& x = impl_->body->m_nodes[i].m_x;
    out.insert(out.end(), {double(x[0]), double(x[1]), double(x[2])});
  }
}

}  // namespace sinew::benchmarks
