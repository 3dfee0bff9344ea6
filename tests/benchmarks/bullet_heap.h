// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

namespace sinew::benchmarks {

/// Soft bodies of the Bullet physics library that collide with each other by clusters (CL_SS, CL_RS), over a plane and
/// within four walls. Its default configuration but for these; eight clusters a body and links to second neighbours, as
/// its demos have them.
class BulletHeap {
 public:
  /// \param vertices x, y, z each, of one body. \param triangles three indices each. \param places of its origin, one a
  /// body, m. \param half distance of the walls from the middle, m. \param mass of a body, kg.
  BulletHeap(std::span<const float> vertices, std::span<const int> triangles,
             std::span<const std::array<float, 3>> places, float half, float mass);
  ~BulletHeap();
  BulletHeap(const BulletHeap&) = delete;
  BulletHeap& operator=(const BulletHeap&) = delete;

  /// Advances by 1/60 s.
  void step();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::benchmarks
