// SPDX-License-Identifier: MIT
//
// How kernels see a body: plain arrays, eight clusters or eight members to a block, [component][lane].
#pragma once

#include <cstdint>

namespace sinew::internal {

/// What clusters know of a member, in this order: 3 * physical vertex (an integer); mu_ic / Σ mu, which sums to 1 in
/// each cluster; w_ic / W_i times the vertex's stiffness; (X - c0) / radius.
enum MemberField : std::uint32_t { kMemberOffset, kMemberMu, kMemberShare, kMemberRest, kMemberFields = 6 };

/// Eight members of one cluster, [field][lane]. A cluster of more than eight has an even number of blocks, two and two
/// as one: [field][sixteen lanes]. What is missing repeats the last member with mu = share = 0. First come runs: blocks
/// whose members are eight consecutive vertices that a UseBlock begins with.
struct alignas(64) MemberBlock {
  std::uint32_t words[8 * kMemberFields];  ///< but for the offsets, the bits of floats
};
static_assert(sizeof(MemberBlock) == 192);

/// Where the slots of a block's members lie within it: k and k + 4 side by side, as registers hold them. Those of a run
/// are three floats each, in order, and the second run of a pair follows the first at once.
inline constexpr std::uint32_t kSlotOfLane[8] = {0, 2, 4, 6, 1, 3, 5, 7};

/// Floats of the slots of a block: eight members, four each; three each in a run.
inline constexpr std::uint64_t kSlotFloats = 32, kRunFloats = 24;

/// State of eight clusters. Matrices column by column: component 3 k + row; columns 3.. only if quadratic.
struct alignas(32) ClusterBlock {
  float center[3][8];         ///< c, metres
  float reference[3][8];      ///< a member's position: moments leave what is relative to it in the slots
  float rotation[4][8];       ///< R as w x y z
  float part_rotation[4][8];  ///< of the whole body part: what a cluster falls back to that has lost its own
  float a_pq[27][8];          ///< Σ mu p q~^T, p = (x - c) / radius
  float f[27][8];             ///< F: goals are center + radius F q~
  std::int32_t limited[8];    ///< not 0: the guard against inversion moved F in the last match
  std::int32_t lost[8];       ///< not 0: the moments no longer said how the cluster is turned
  std::int32_t astray[8];     ///< not 0: its part is so far from its rest shape that it is matched as one
  std::int32_t tangled[8];    ///< not 0: and is tangled, so that the way back may lead through mirrored shapes
};

/// Rest-shape constants of eight clusters.
struct alignas(32) ClusterRestBlock {
  float mean[9][8];              ///< Σ mu q~ as floats evaluate it: subtracting it keeps goals centred to rounding
  float moment[27][8];           ///< M = Σ mu q q~^T, what A_pq is at rest
  float radius[8];               ///< metres; 1 in a lane without a cluster
  std::uint32_t first_block[8];  ///< into the member blocks
  std::uint32_t block_count[8];  ///< 0 in a lane without a cluster, 1, or even
  std::uint32_t run_count[8];    ///< of them runs; even where block_count is
  std::uint32_t quadratic;       ///< not 0: some cluster of the eight is
  std::uint32_t unused[7];
};

/// The memberships of eight consecutive vertices of a part: offsets into the slots from 8 * first on. First that of
/// each run, in whole rows of eight; then `rows` rows for the vertices' other memberships (4 * slot). Vertices with
/// fewer of them have offsets of the slot behind the last, which stays zero.
struct UseBlock {
  std::uint32_t first;
  std::uint32_t runs;
  std::uint32_t rows;
};

/// What stiffness means for one length of pass, of eight clusters.
struct alignas(32) StiffnessBlock {
  float s[45][8];           ///< S of F = [R 0] + (A_pq - R M) S: symmetric, lower triangle row by row; zero where rigid
  float alpha[8];           ///< alpha_h: how much of the way to the goal a vertex goes
  std::int32_t deforms[8];  ///< -1: S is not zero
  std::int32_t stiff[8];  ///< -1: a pass keeps less than half of a stretch: what is lost goes where it belongs at once
  std::int32_t mixes[8];  ///< -1: classes of modes differ in stiffness, so F needs its torque removed
  float margin[8];        ///< what is beyond a limit or the guard by more than this factor is stopped
  float least[8];         ///< principal stretches of F: the limit `principal`, or the guard's
  float largest[8];
  std::int32_t keeps_volume[8];  ///< -1: a pressure keeps the volume, also within the limits
  float volume_ease[8];          ///< how much the volume gives way to a unit pressure (eq. 18)
};

/// A row as sweeps see it (docs/method.md §6). Vectors are xyz and one float that does not count. Masses, and impulses
/// with them, are relative to the body's.
struct alignas(16) SolverRow {
  float target[4];               ///< where the point is asked to be, metres
  float impulse[4];              ///< force h², m
  float normal[4];               ///< of a contact, unit
  float base[4];                 ///< the point before this round's impulses
  float inverse_response[3][4];  ///< of a hold: (W + E)^-1 by columns
  float compliance;              ///< E = e 1: the row gives way by e x impulse
  float normal_response;         ///< of a contact: n^T W n + e
  float tangent_response;        ///< of a contact: largest W in the plane + e
  float friction;                ///< Coulomb coefficient
  std::uint32_t first_term, term_count;
  std::uint32_t contact;  ///< not 0: a contact, which only pushes; 0: a hold
  std::uint32_t unused;
};

/// How a row hangs on one cluster: its point moves with coefficient x centre + turn x lever + Σ column out, and an
/// impulse moves centre by answer x scale, the columns by scale in, and turns by inertia_inverse (arm x scale).
struct RowTerm {
  std::uint32_t cluster;  ///< into the ClusterAnswers
  float coefficient;
  float scale;   ///< coefficient over the cluster's mass
  float answer;  ///< 1, less where pins hold the cluster
  float arm[3];
  float lever[3];
  float in[9];
  float out[9];
};
static_assert(sizeof(RowTerm) == 112);

/// What the impulses of a round have done to a cluster.
struct alignas(64) ClusterAnswer {
  float center[4];              ///< metres
  float turn[4];                ///< radians
  float column[9][4];           ///< of A_pq (of F where pins hold the cluster)
  float inertia_inverse[3][4];  ///< by columns; 0 where a push does not turn
  std::uint32_t columns;        ///< 3 or 9
  std::uint32_t unused[3];
};

/// Sums over vertices about a reference point, as kernels leave them: eight partial sums each.
/// 0 mass, 1-3 first, 4-6 momentum, 7-9 angular, 10-15 second xx yy zz xy yz zx.
struct alignas(32) MotionLanes {
  float sum[16][8];
};

/// A rigid motion: velocity of a point is velocity + omega x (point - center).
struct MotionOf3 {
  float center[3];
  float velocity[3];
  float omega[3];
};

}  // namespace sinew::internal
