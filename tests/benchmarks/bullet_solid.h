// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace sinew::benchmarks {

/// A body of the Bullet physics library on tetrahedra, in the world that Bullet has for its kind.
class BulletSolid {
 public:
  enum class Kind : std::uint8_t {
    finite_elements,           ///< btDeformableNeoHookeanForce, the world as it is by default (explicit in elasticity)
    implicit_finite_elements,  ///< the same, with setImplicit(true), setUseProjection(true)
    links,  ///< btSoftBody with a link along every edge and clusters for contact, default configuration
  };
  struct Tetrahedra {
    std::span<const float> vertices;         ///< x, y, z each, metres
    std::span<const std::uint32_t> corners;  ///< four a tetrahedron
    std::span<const float> masses;           ///< kg, one a vertex
    std::span<const std::uint8_t> held;      ///< one a vertex; not 0: its mass is infinite
    double young = 1, poisson = 0.3;         ///< Pa; of `links` nothing: Bullet's stiffness there has no unit
  };

  /// \param step_seconds of a step. \param iterations of `links`: piterations.
  BulletSolid(const Tetrahedra& body, Kind kind, double step_seconds, int iterations);
  ~BulletSolid();
  BulletSolid(const BulletSolid&) = delete;
  BulletSolid& operator=(const BulletSolid&) = delete;

  /// A level ground below the body, of a box: Bullet's deformable bodies meet convex shapes alone. \param height m.
  /// \param friction Coulomb coefficient
  void addGround(double height, double friction);
  void setGravity(const std::array<double, 3>& gravity);
  /// Of a held vertex.
  void place(std::uint32_t vertex, const std::array<double, 3>& position);
  /// One step. \param decay of all velocities at its end.
  void step(double decay);
  /// \param out x, y, z of each vertex.
  void positions(std::vector<double>& out) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::benchmarks
