// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/kernel_body.h"

#include <algorithm>

#include "runtime/clusters/stiffness.h"

namespace sinew::tools {

KernelBody::KernelBody(const formats::PackageView& package, float kept)
    : rest_(internal::makeRestConstants(package)), vertices_(std::uint32_t(package.physicalVertices().size())) {
  const std::uint32_t clusters = std::uint32_t(package.clusters().size());
  stiffness_.resize(rest_.blocks.size());
  for (std::uint32_t c = 0; c < clusters; ++c) {
    internal::ClusterStiffness stiffness = internal::freeStiffness(package, c);
    stiffness.s *= kept;
    stiffness.deforms &= kept > 0;
    internal::storeStiffness(stiffness, c % 8, stiffness_[c / 8]);
  }
  state_.resize(rest_.blocks.size());
  for (internal::ClusterBlock& block : state_) {
    std::fill(std::begin(block.rotation[0]), std::end(block.rotation[0]), 1.0F);
    std::fill(std::begin(block.part_rotation[0]), std::end(block.part_rotation[0]), 1.0F);
  }
  slots_.resize(32 * rest_.members.size() + 4);
  const std::size_t floats = 3 * std::size_t(vertices_) + 8;
  x_.resize(floats);
  v_.resize(floats);
  y_.resize(floats);
}

void KernelBody::setPositions(std::span<const Vec3> y) {
  float* out = y_.data();
  for (const Vec3& position : y) out = std::copy(position.begin(), position.end(), out);
  std::copy(y_.begin(), y_.end(), x_.begin());
  std::fill(v_.begin(), v_.end(), 0.0F);
}

void KernelBody::momentsOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end) {
  for (std::size_t b = begin; b < end; ++b) {
    kernels.moments(rest_.blocks[b], rest_.members.data(), y_.data(), state_[b], slots_.data());
  }
}

void KernelBody::matchOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end) {
  kernels.match(rest_.blocks.data() + begin, stiffness_.data() + begin, state_.data() + begin,
                std::uint32_t(end - begin));
}

void KernelBody::goalsOf(const internal::Kernels& kernels, std::size_t begin, std::size_t end) {
  for (std::size_t b = begin; b < end; ++b) {
    kernels.goals(rest_.blocks[b], rest_.members.data(), stiffness_[b], state_[b], slots_.data());
  }
}

void KernelBody::moments(const internal::Kernels& kernels) { momentsOf(kernels, 0, state_.size()); }
void KernelBody::match(const internal::Kernels& kernels) { matchOf(kernels, 0, state_.size()); }
void KernelBody::goals(const internal::Kernels& kernels) { goalsOf(kernels, 0, state_.size()); }

void KernelBody::apply(const internal::Kernels& kernels) {
  internal::ApplyArguments arguments{};
  arguments.vertices = {0, vertices_, x_.data(), v_.data(), y_.data(), rest_.masses.data()};
  arguments.slots = slots_.data();
  arguments.uses = rest_.use_blocks.data();
  arguments.use_offset = rest_.use_offsets.data();
  arguments.inverse_h = 60;
  kernels.apply(arguments);
}

void KernelBody::all(const internal::Kernels& kernels) {
  for (std::size_t first = 0; first < state_.size(); first += 2) {
    const std::size_t end = std::min(first + 2, state_.size());
    momentsOf(kernels, first, end);
    matchOf(kernels, first, end);
    goalsOf(kernels, first, end);
  }
  apply(kernels);
}

std::vector<Vec3> KernelBody::positions() const {
  std::vector<Vec3> result(vertices_);
  for (std::size_t v = 0; v < vertices_; ++v) result[v] = {y_[3 * v], y_[3 * v + 1], y_[3 * v + 2]};
  return result;
}

}  // namespace sinew::tools
