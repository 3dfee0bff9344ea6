// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace sinew::benchmarks {

/// A soft body of the Bullet physics library on a triangle mesh, as Bullet ships it: CreateFromTriMesh, a link along
/// every edge, its default configuration. Only sleeping is off, so that there is something to time.
class BulletSoftBody {
 public:
  struct Scene {
    bool ground = false;                 ///< a static plane right below the body
    std::span<const std::uint8_t> held;  ///< one a vertex, not 0: its mass is infinite; empty: none
    bool moving = false;                 ///< it starts turning
    float total_mass = 1;                ///< kg
  };
  /// \param vertices x, y, z each. \param triangles three indices each.
  BulletSoftBody(std::span<const float> vertices, std::span<const int> triangles, const Scene& scene);
  ~BulletSoftBody();
  BulletSoftBody(const BulletSoftBody&) = delete;
  BulletSoftBody& operator=(const BulletSoftBody&) = delete;

  /// Back to the start.
  void restart();
  /// Advances by 1/60 s.
  void step();
  /// Whether every position is finite and within ten times the body's size of its middle.
  bool isSound() const;

  std::uint32_t vertices() const;
  std::uint32_t links() const;
  static std::string version();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::benchmarks
