// SPDX-License-Identifier: MIT
#include "runtime/load/rest_constants.h"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>

namespace sinew::internal {
namespace {

// Least inertia about any axis, relative to the largest: a straight cluster has none about itself.
constexpr double kInertiaFloor = 1e-3;

// \param[out] full Σ mu q~ q~^T; null unless the cluster is quadratic.
void addMoments(const formats::PackageView& package, const formats::Cluster& cluster, ClusterRest& rest,
                Square<9>* full) {
  const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
  const auto vertices = package.physicalVertices();
  MomentSums sums;
  for (const formats::Membership& member : members) {
    const Monomials<9> q = monomials<9>(restOffset(cluster, asVector(vertices[member.vertex].rest_position)));
    Eigen::Matrix<double, 9, 1> wide;
    for (int k = 0; k < 9; ++k) wide[k] = double(q[k]);
    sums.add(double(member.mu), wide);
  }
  sums.finish();
  const int columns = full != nullptr ? 9 : 3;
  for (int k = 0; k < columns; ++k) {
    rest.mean[k] = float(sums.mean[k]);
    for (int axis = 0; axis < 3; ++axis) rest.moment(axis, k) = float(sums.moment(axis, k));
  }
  for (int k = 0; full != nullptr && k < 81; ++k) full->data()[k] = float(sums.moment.data()[k]);
  const double trace = sums.moment(0, 0) + (sums.moment(1, 1) + sums.moment(2, 2));
  if (trace > 0) {
    Eigen::Matrix3d inertia;
    for (int k = 0; k < 9; ++k) {
      inertia.data()[k] = (k % 4 == 0 ? trace * (1.0 + kInertiaFloor) : 0.0) - sums.moment(k % 3, k / 3);
    }
    inertia = inverseOf(inertia);
    for (int k = 0; k < 9; ++k) rest.inertia_inverse.data()[k] = float(inertia.data()[k]);
  }
}

// Radius of gyration of a body part, metres.
double gyrationRadius(const formats::PackageView& package, const formats::BodyRange& range) {
  double mass = 0, first[3] = {}, second = 0;
  const auto vertices = package.physicalVertices().subspan(range.first_vertex, range.vertex_count);
  if (vertices.empty()) return 0;
  for (const formats::PhysicalVertex& vertex : vertices) {
    const double m = double(vertex.mass);
    mass += m;
    for (std::size_t k = 0; k < 3; ++k) {
      const double d = double(vertex.rest_position[k] - vertices.front().rest_position[k]);
      first[k] += m * d;
      second += m * d * d;
    }
  }
  double mean2 = 0;
  for (const double sum : first) mean2 += (sum / mass) * (sum / mass);
  return std::sqrt(std::max(0.0, second / mass - mean2));
}

std::uint32_t firstVertexOfPart(const formats::PackageView& package, std::size_t cluster) {
  for (const formats::BodyRange& range : package.bodies()) {
    if (cluster - range.first_cluster < range.cluster_count) return range.first_vertex;
  }
  return 0;
}

// Of a cluster's members in the order of its lanes, first those of runs: eight consecutive vertices that a use block of
// the part begins with. More than eight members take runs by twos, as blocks. \return how many runs.
std::size_t orderOfLanes(std::span<const formats::Membership> members, std::uint32_t first_vertex,
                         Array<std::uint32_t>& order) {
  const auto is_run = [&](std::size_t m) {
    if (m + 8 > members.size() || (members[m].vertex - first_vertex) % 8 != 0) return false;
    for (std::size_t i = 1; i < 8; ++i) {
      if (members[m + i].vertex != members[m].vertex + i) return false;
    }
    return true;
  };
  // The others from the back, turned round afterwards.
  order.resize(members.size());
  std::size_t of_runs = 0, others = members.size();
  for (std::size_t m = 0; m < members.size();) {
    const bool run = is_run(m);
    for (const std::size_t end = m + (run ? 8 : 1); m < end; ++m) order[run ? of_runs++ : --others] = std::uint32_t(m);
  }
  std::reverse(order.begin() + of_runs, order.end());
  return members.size() > 8 ? of_runs / 16 * 2 : of_runs / 8;
}

void makeBlocks(const formats::PackageView& package, RestConstants& result) {
  const auto clusters = package.clusters();
  const auto vertices = package.physicalVertices();
  result.masses.resize(vertices.size());
  double total = 0;
  for (const formats::PhysicalVertex& vertex : vertices) total += double(vertex.mass);
  for (std::size_t i = 0; i < vertices.size(); ++i) result.masses[i] = float(double(vertices[i].mass) / total);
  result.blocks.resize((clusters.size() + 7) / 8, ClusterRestBlock{});
  for (ClusterRestBlock& block : result.blocks) std::fill(std::begin(block.radius), std::end(block.radius), 1.0F);
  struct UseSlot {
    std::uint32_t offset;
    bool of_run;
  };
  Array<UseSlot> use_slots(package.memberships().size());  // as `uses`
  Array<std::uint32_t> order, next;
  next.assign(result.first_use);
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const formats::Cluster& cluster = clusters[c];
    const ClusterRest& rest = result.clusters[c];
    ClusterRestBlock& block = result.blocks[c / 8];
    const std::size_t lane = c % 8;
    for (std::size_t k = 0; k < 9; ++k) block.mean[k][lane] = rest.mean[Eigen::Index(k)];
    for (std::size_t k = 0; k < 27; ++k) block.moment[k][lane] = rest.moment.data()[k];
    block.radius[lane] = cluster.radius;
    block.first_block[lane] = std::uint32_t(result.members.size());
    const std::size_t wide = cluster.member_count > 8 ? 16 : 8;
    const std::size_t places = (cluster.member_count + wide - 1) / wide * wide;
    block.block_count[lane] = std::uint32_t(places / 8);
    result.members.resize(result.members.size() + places / 8);
    if (cluster.mode == formats::ClusterMode::quadratic) block.quadratic = 1;
    const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
    const std::size_t runs = orderOfLanes(members, firstVertexOfPart(package, c), order);
    block.run_count[lane] = std::uint32_t(runs);
    for (std::size_t m = 0; m < places; ++m) {
      const std::size_t eight = block.first_block[lane] + m / 8, half = m / 8 % (wide / 8);
      std::uint32_t* const words = result.members[eight - half].words + m % wide;
      const auto set = [&](std::uint32_t field, float value) {
        words[wide * field] = std::bit_cast<std::uint32_t>(value);
      };
      const bool real = m < members.size();
      const formats::Membership& member = members[order[real ? m : order.size() - 1]];
      const Vector3 q = restOffset(cluster, asVector(vertices[member.vertex].rest_position));
      const float stiffness = package.vertexStiffness().empty() ? 1.0F : package.vertexStiffness()[member.vertex];
      words[wide * kMemberOffset] = 3 * member.vertex;
      set(kMemberMu, real ? member.mu : 0.0F);
      set(kMemberShare, real ? member.share * stiffness : 0.0F);
      for (std::uint32_t k = 0; k < 3; ++k) set(kMemberRest + k, q[k]);
      if (!real) continue;
      const bool of_run = m / 8 < runs;
      const std::size_t offset =
          of_run ? kSlotFloats * (eight - half) + kRunFloats * half : kSlotFloats * eight + 4 * kSlotOfLane[m % 8];
      use_slots[next[member.vertex]++] = {std::uint32_t(offset), of_run};
    }
  }
  const auto nothing = std::uint32_t(kSlotFloats * result.members.size());
  Array<std::uint32_t>& offsets = result.use_offsets;
  for (const formats::BodyRange& range : package.bodies()) {
    for (std::uint32_t begin = 0; begin < range.vertex_count; begin += 8) {
      const std::uint32_t count = std::min(range.vertex_count - begin, 8U);
      const auto uses_of = [&](std::uint32_t k) {
        const std::uint32_t* const first = result.first_use.data() + range.first_vertex + begin + k;
        return std::span<const UseSlot>(use_slots).subspan(first[0], first[1] - first[0]);
      };
      UseBlock block = {std::uint32_t(offsets.size() / 8), 0, 0};
      for (const UseSlot& use : uses_of(0)) {  // which all eight vertices have
        if (!use.of_run) continue;
        offsets.push_back(use.offset);
        ++block.runs;
      }
      offsets.resize((offsets.size() + 7) / 8 * 8, nothing);
      for (std::uint32_t k = 0; k < count; ++k) {
        block.rows = std::max(block.rows, std::uint32_t(uses_of(k).size()) - block.runs);
      }
      const std::size_t rows = offsets.size();
      offsets.resize(rows + 8 * std::size_t(block.rows), nothing);
      for (std::uint32_t k = 0; k < count; ++k) {
        std::size_t at = rows + k;
        for (const UseSlot& use : uses_of(k)) {
          if (use.of_run) continue;
          offsets[at] = use.offset;
          at += 8;
        }
      }
      result.use_blocks.push_back(block);
    }
  }
}

}  // namespace

RestConstants makeRestConstants(const formats::PackageView& package) {
  RestConstants result;
  result.fields = makeFields(package, result.driven_masses, result.field_stiffness);
  const auto clusters = package.clusters();
  const auto members = package.memberships();
  result.clusters.resize(clusters.size());
  result.full_moments.resize(package.quadraticMoments().size(), Square<9>::Zero());
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const bool quadratic = clusters[c].mode == formats::ClusterMode::quadratic;
    addMoments(package, clusters[c], result.clusters[c],
               quadratic ? &result.full_moments[clusters[c].quadratic] : nullptr);
  }
  for (const formats::BodyRange& range : package.bodies()) {
    const double part_radius = gyrationRadius(package, range);
    for (std::uint32_t c = range.first_cluster; c < range.first_cluster + range.cluster_count; ++c) {
      const double trace = double(result.clusters[c].moment.leftCols<3>().trace());
      const double radius = double(clusters[c].radius) * std::sqrt(std::max(0.0, trace));
      if (radius > 0) result.clusters[c].frequency_ratio = float(std::max(1.0, part_radius / radius));
    }
  }

  result.mechanics = makeMechanics(package);

  const std::size_t vertex_count = package.physicalVertices().size();
  result.first_use.resize(vertex_count + 1);
  for (const formats::Membership& member : members) ++result.first_use[member.vertex + 1];
  for (std::size_t i = 0; i < vertex_count; ++i) result.first_use[i + 1] += result.first_use[i];
  result.uses.resize(members.size());
  Array<std::uint32_t> next;
  next.assign(result.first_use);
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    for (const formats::Membership& member : members.subspan(clusters[c].first_member, clusters[c].member_count)) {
      result.uses[next[member.vertex]++] = {std::uint32_t(c), member.share};
    }
  }
  Array<std::uint64_t> overlaps;  // a pair each, the first cluster in the high half
  for (std::size_t i = 0; i < vertex_count; ++i) {
    const auto uses = result.usesOf(std::uint32_t(i));
    for (std::size_t k = 1; k < uses.size(); ++k) {
      overlaps.push_back((std::uint64_t(uses[k - 1].cluster) << 32) | uses[k].cluster);
    }
  }
  sortAscending(overlaps);
  overlaps.truncate(std::size_t(std::unique(overlaps.begin(), overlaps.end()) - overlaps.begin()));
  result.overlaps.reserve(overlaps.size());
  for (const std::uint64_t pair : overlaps) {
    result.overlaps.push_back({std::uint32_t(pair >> 32), std::uint32_t(pair)});
  }
  makeBlocks(package, result);
  return result;
}

}  // namespace sinew::internal
