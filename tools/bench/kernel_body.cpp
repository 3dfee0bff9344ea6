// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/kernel_body.h"

#include <algorithm>

namespace sinew::tools {
namespace {

using internal::ClusterRestBlock;
using internal::MemberBlock;
using internal::StiffnessBlock;

constexpr std::uint32_t kLanes = 8;

std::array<float, 9> monomials(const std::array<float, 3>& q) {
  return {q[0], q[1], q[2], q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0]};
}

std::array<float, 3> restOffset(const formats::PackageView& package, const formats::Cluster& cluster,
                                std::uint32_t vertex) {
  const auto& rest = package.physicalVertices()[vertex].rest_position;
  std::array<float, 3> q{};
  for (std::size_t k = 0; k < 3; ++k) q[k] = (rest[k] - cluster.rest_center[k]) / cluster.radius;
  return q;
}

// kept A_qq as a lower triangle row by row.
std::array<float, 45> stiffnessOf(const formats::PackageView& package, const formats::Cluster& cluster, float kept) {
  std::array<float, 45> s{};
  if (cluster.mode == formats::ClusterMode::quadratic) {
    s = package.quadraticMoments()[cluster.quadratic].a_qq;
  } else {
    const auto& a = cluster.a_qq;  // xx yy zz xy yz zx
    s[0] = a[0];
    s[1] = a[3];
    s[2] = a[1];
    s[3] = a[5];
    s[4] = a[4];
    s[5] = a[2];
  }
  for (float& value : s) value *= kept;
  return s;
}

}  // namespace

KernelBody::KernelBody(const formats::PackageView& package, float kept)
    : vertices_(std::uint32_t(package.physicalVertices().size())) {
  const auto clusters = package.clusters();
  const std::size_t blocks = (clusters.size() + kLanes - 1) / kLanes;
  rest_.resize(blocks);
  stiffness_.resize(blocks);
  state_.resize(blocks);
  std::vector<std::vector<std::uint32_t>> uses(vertices_);
  for (std::size_t c = 0; c < blocks * kLanes; ++c) {
    const std::size_t lane = c % kLanes;
    ClusterRestBlock& rest = rest_[c / kLanes];
    rest.radius[lane] = 1;
    state_[c / kLanes].rotation[0][lane] = state_[c / kLanes].part_rotation[0][lane] = 1;
    if (c >= clusters.size()) continue;
    const formats::Cluster& cluster = clusters[c];
    const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
    const std::size_t columns = quadratic ? 9 : 3;
    if (quadratic) rest.quadratic = 1;
    rest.radius[lane] = cluster.radius;
    rest.first_block[lane] = std::uint32_t(members_.size());
    rest.block_count[lane] = (cluster.member_count + kLanes - 1) / kLanes;
    const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
    for (std::uint32_t m = 0; m < rest.block_count[lane] * kLanes; ++m) {
      if (m % kLanes == 0) members_.emplace_back();
      MemberBlock& block = members_.back();
      const bool real = m < members.size();
      const formats::Membership& member = real ? members[m] : members.back();
      const auto q = restOffset(package, cluster, member.vertex);
      block.offset[m % kLanes] = 3 * member.vertex;
      block.mu[m % kLanes] = real ? member.mu : 0;
      block.share[m % kLanes] = real ? member.share : 0;
      for (std::size_t k = 0; k < 3; ++k) block.q[k][m % kLanes] = q[k];
      if (!real) continue;
      uses[member.vertex].push_back(rest.first_block[lane] * kLanes + m);
      const auto monomial = monomials(q);
      for (std::size_t k = 0; k < columns; ++k) rest.mean[k][lane] += member.mu * monomial[k];
    }
    for (const formats::Membership& member : members) {
      const auto monomial = monomials(restOffset(package, cluster, member.vertex));
      for (std::size_t k = 0; k < columns; ++k) {
        for (std::size_t row = 0; row < 3; ++row) {
          rest.moment[3 * k + row][lane] +=
              member.mu * (monomial[row] - rest.mean[row][lane]) * (monomial[k] - rest.mean[k][lane]);
        }
      }
    }
    const auto s = stiffnessOf(package, cluster, kept);
    for (std::size_t k = 0; k < 45; ++k) stiffness_[c / kLanes].s[k][lane] = s[k];
    stiffness_[c / kLanes].alpha[lane] = 1;
    stiffness_[c / kLanes].deforms[lane] = kept > 0 ? -1 : 0;
    stiffness_[c / kLanes].least[lane] = internal::kLeastStretch;
    stiffness_[c / kLanes].largest[lane] = internal::kLargestStretch;
  }
  const std::uint32_t nothing = std::uint32_t(members_.size() * 4 * kLanes);
  slots_.resize(nothing + 4);
  for (std::uint32_t begin = 0; begin < vertices_; begin += kLanes) {
    const std::uint32_t end = std::min(begin + kLanes, vertices_);
    internal::UseBlock block = {std::uint32_t(use_offset_.size() / kLanes), 0};
    for (std::uint32_t v = begin; v < end; ++v) block.rows = std::max(block.rows, std::uint32_t(uses[v].size()));
    for (std::uint32_t row = 0; row < block.rows; ++row) {
      for (std::uint32_t v = begin; v < begin + kLanes; ++v) {
        use_offset_.push_back(v < end && row < uses[v].size() ? 4 * uses[v][row] : nothing);
      }
    }
    use_blocks_.push_back(block);
  }
  const std::size_t floats = 3 * std::size_t(vertices_) + kLanes;
  x_.resize(floats);
  v_.resize(floats);
  y_.resize(floats);
  for (const formats::PhysicalVertex& vertex : package.physicalVertices()) mass_.push_back(vertex.mass);
}

void KernelBody::setPositions(std::span<const Vec3> y) {
  float* out = y_.data();
  for (const Vec3& position : y) out = std::copy(position.begin(), position.end(), out);
  std::copy(y_.begin(), y_.end(), x_.begin());
  std::fill(v_.begin(), v_.end(), 0.0F);
}

void KernelBody::moments(const internal::Kernels& kernels) {
  for (std::size_t b = 0; b < rest_.size(); ++b)
    kernels.moments(rest_[b], members_.data(), y_.data(), state_[b], slots_.data());
}

void KernelBody::match(const internal::Kernels& kernels) {
  kernels.match(rest_.data(), stiffness_.data(), state_.data(), std::uint32_t(rest_.size()));
}

void KernelBody::goals(const internal::Kernels& kernels) {
  for (std::size_t b = 0; b < rest_.size(); ++b) {
    kernels.goals(rest_[b], members_.data(), stiffness_[b], state_[b], slots_.data());
  }
}

void KernelBody::apply(const internal::Kernels& kernels) {
  internal::ApplyArguments arguments{};
  arguments.vertices = {0, vertices_, x_.data(), v_.data(), y_.data(), mass_.data()};
  arguments.slots = slots_.data();
  arguments.uses = use_blocks_.data();
  arguments.use_offset = use_offset_.data();
  arguments.inverse_h = 60;
  kernels.apply(arguments);
}

void KernelBody::all(const internal::Kernels& kernels) {
  for (std::size_t first = 0; first < rest_.size(); first += 2) {
    const std::size_t end = std::min(first + 2, rest_.size());
    for (std::size_t b = first; b < end; ++b) {
      kernels.moments(rest_[b], members_.data(), y_.data(), state_[b], slots_.data());
    }
    kernels.match(rest_.data() + first, stiffness_.data() + first, state_.data() + first, std::uint32_t(end - first));
    for (std::size_t b = first; b < end; ++b) {
      kernels.goals(rest_[b], members_.data(), stiffness_[b], state_[b], slots_.data());
    }
  }
  apply(kernels);
}

std::vector<Vec3> KernelBody::positions() const {
  std::vector<Vec3> result(vertices_);
  for (std::size_t v = 0; v < vertices_; ++v) result[v] = {y_[3 * v], y_[3 * v + 1], y_[3 * v + 2]};
  return result;
}

}  // namespace sinew::tools
