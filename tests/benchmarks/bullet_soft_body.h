// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace sinew::benchmarks {

/// A cluster soft body of the Bullet physics library: the closed surface of a block, without contacts. Made as Bullet's
/// own demonstrations make theirs: links along the edges, generateClusters(), one solver iteration; but every cluster
/// matches, as ours do, and the master cluster, which holds the whole body, does not: Bullet's polar decomposition
/// fails on the moments of large ones.
class BulletSoftBody {
 public:
  /// \param points along each edge of the block, >= 2: 6 (points - 1)^2 + 2 vertices. \param clusters asked for.
  /// \param moving it falls, turns and swings; else it floats at rest, which spares Bullet the care of its trees.
  BulletSoftBody(std::uint32_t points, std::uint32_t clusters, bool moving);
  ~BulletSoftBody();
  BulletSoftBody(const BulletSoftBody&) = delete;
  BulletSoftBody& operator=(const BulletSoftBody&) = delete;

  /// Back to the start.
  void restart();
  /// Advances by 1/60 s.
  void step();
  /// Whether every position is finite and within four times the block's size of the body's middle.
  bool isSound() const;

  std::uint32_t vertices() const;
  std::uint32_t memberships() const;  ///< of all clusters, the master's included
  static std::string version();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew::benchmarks
