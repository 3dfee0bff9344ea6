// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "runtime/kernels/kernels.h"
#include "runtime/load/rest_constants.h"
#include "runtime/world/body.h"
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
  /// All four, the first three two blocks of eight clusters at a time.
  void all(const internal::Kernels& kernels);

  /// Positions after apply(), metres.
  std::vector<Vec3> positions() const;

 private:
  // The same for blocks begin..end of eight clusters.
  void momentsOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end);
  void matchOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end);
  void goalsOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end);

  internal::RestConstants rest_;
  std::vector<internal::StiffnessBlock> stiffness_;
  std::vector<internal::ClusterBlock> state_;
  internal::LineMemory lines_{std::pmr::get_default_resource()};  // as the runtime keeps them
  std::pmr::vector<float> slots_{&lines_}, x_{&lines_}, v_{&lines_}, y_{&lines_};
  std::uint32_t vertices_;
};

}  // namespace sinew::tools
