// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/kernels/kernels.h"
#include "sinew/formats/package.h"
#include "sinew/runtime/settings.h"

namespace sinew::tools {

/// The clusters of a package as the runtime's kernels see them, to time the kernels alone.
class KernelBody {
 public:
  /// \param kept the part of a deformation that a pass keeps, beta of docs/method.md eq. 6; 0 = rigid clusters.
  KernelBody(const formats::PackageView& package, float kept);

  /// Sets the positions that the next phases see (predicted ones, metres) and clears velocities.
  void setPositions(std::span<const Vec3> y);

  void moments(const internal::Kernels& kernels);
  void match(const internal::Kernels& kernels);
  void goals(const internal::Kernels& kernels);
  void apply(const internal::Kernels& kernels);
  /// All four, the first three block by block of eight clusters.
  void all(const internal::Kernels& kernels);

  /// Positions after apply(), metres.
  std::vector<Vec3> positions() const;

 private:
  std::vector<internal::ClusterRestBlock> rest_;
  std::vector<internal::MemberBlock> members_;
  std::vector<internal::StiffnessBlock> stiffness_;
  std::vector<internal::ClusterBlock> state_;
  std::vector<float> slots_;
  std::vector<internal::UseBlock> use_blocks_;
  std::vector<std::uint32_t> use_offset_;
  std::vector<float> x_, v_, y_, mass_;
  std::uint32_t vertices_;
};

}  // namespace sinew::tools
