// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "runtime/geometry/tet_mesh.h"

namespace sinew::testing {

/// A surface of triangles, outward counter-clockwise.
struct Surface {
  std::vector<Eigen::Vector3d> positions;
  std::vector<geometry::Triangle> triangles;

  Eigen::AlignedBox3d bounds() const;
  double volume() const;  ///< divergence theorem
  void append(const Surface& other, const Eigen::Vector3d& offset = Eigen::Vector3d::Zero());
  void reverse();
};

Surface sphere(double radius, std::uint32_t rings);  ///< latitude and longitude, poles are fans
Surface torus(double major, double minor, std::uint32_t segments);
Surface box(const Eigen::Vector3d& size, std::uint32_t subdivisions);
/// A star-shaped lump with several random bumps, closed.
Surface blob(std::uint32_t seed, std::uint32_t rings);

/// Solids given by a function: negative inside.
struct Implicit {
  std::string name;
  Eigen::AlignedBox3d bounds;
  std::function<double(const Eigen::Vector3d&)> value;
};
std::vector<Implicit> implicitMenagerie();

/// The same numbers everywhere, unlike std distributions.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 2654435761ULL + 88172645463325252ULL) {}
  double unit();  ///< 0..1
  double between(double low, double high) { return low + (high - low) * unit(); }
  Eigen::Vector3d inBox(const Eigen::AlignedBox3d& box);

 private:
  std::uint64_t state_;
};

}  // namespace sinew::testing
