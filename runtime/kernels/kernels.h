// SPDX-License-Identifier: MIT
//
// The table of kernels for each instruction set. Which one runs is chosen once, at the first call of kernels(): the
// widest this processor has, or what the environment variable SINEW_INSTRUCTION_SET (sse42, avx2, avx512) asks for.
// Results do not depend on the choice, bit for bit.
#pragma once

#include <cstdint>

#include "runtime/kernels/attach_layout.h"
#include "runtime/kernels/field_layout.h"
#include "runtime/kernels/guard.h"
#include "runtime/kernels/layout.h"

namespace sinew::internal {

/// Beyond these a state counts as lost: floats could no longer square or difference it.
inline constexpr float kLargestPosition = 1e15F;  // metres
inline constexpr float kLargestVelocity = 1e17F;  // m/s

/// For what lanes rarely need, one lane at a time (runtime/kernels/lane_fallback.cpp).
/// Rotation nearest to a column-major 3x3 matrix whose entries are finite and not all zero. \param[in,out] quaternion
/// w x y z: the previous rotation; the result.
void nearestRotationOfLane(const float* matrix, float* quaternion);

/// Four clusters that limitStretches() of match.h looks at. Masks are -1 or 0.
struct alignas(16) FourStretches {
  float a[9][4];            ///< in and out: the linear blocks
  std::int32_t act[4];      ///< lanes to look at
  std::int32_t tangled[4];  ///< lanes that may pass through themselves
  std::int32_t shaped[4];   ///< in and out: plus the lanes that changed
  std::int32_t stopped[4];  ///< out: lanes whose motion has to be stopped
};
/// Compiled once, for the least of the instruction sets (runtime/kernels/limit_lanes.cpp): lanes do not know how many
/// they are. \param lane of the block: 0 or 4.
void limitFourStretches(const StiffnessBlock& stiffness, std::uint32_t lane, FourStretches& four);

/// rotationSvd() of svd.h of one matrix, compiled there as well. Matrices column-major.
void rotationSvdOfLane(const float* a, float* u, float* v, float* sigma);

/// Vertices begin..end of a body, with what a pass over them needs.
struct VertexRange {
  std::uint32_t begin, end;
  float* x;           ///< positions at the start of the pass, xyz, padded by one float
  float* v;           ///< velocities
  float* y;           ///< predicted, then matched positions
  const float* mass;  ///< relative to that of all vertices
};

struct PredictArguments {
  VertexRange vertices;
  float h;             ///< pass length, s
  float kick[3];       ///< velocity that forces on all vertices add, m/s
  float kept;          ///< part of the velocity that the air leaves
  float reference[3];  ///< of the sums
  float moving[3];     ///< velocity of the reference: momenta are relative to it
  /// Called for each vertex whose state is not usable; has to mend x and v.
  void (*repair)(void* context, std::uint32_t vertex);
  void* context;
  MotionLanes* sums;  ///< momentum and angular momentum of v at x only
};

struct ApplyArguments {
  VertexRange vertices;
  const float* slots;               ///< goals: xyz0 by slot
  const UseBlock* uses;             ///< of the vertices from `begin` on
  const std::uint32_t* use_offset;  ///< rows of the use blocks
  float inverse_h;
  bool ground;
  float normal[3];
  float offset;
  float recovery;  ///< metres that what starts below the ground may rise in this pass
  float reference[3];
  float moving[3];    ///< velocity of the reference
  MotionLanes* sums;  ///< of v at y; null: not wanted yet
};

struct SumArguments {
  VertexRange vertices;
  const float* at;               ///< positions: x or y
  const float* force;            ///< null, or xyz by vertex: vertices with any force count as anchored
  const std::uint8_t* anchored;  ///< null, or not 0 for pinned vertices
  float anchor_mass;             ///< added to anchored vertices
  float reference[3];
  float moving[3];  ///< velocity of the reference
  MotionLanes* sums;
};

/// What is left of a vertex's own motion, v - found (the part's rigid motion), is damped; the rigid motion changes:
/// v += change + change_omega x arm - lost (v - found), with arm = y - center and found = moving + lost_omega x arm.
/// x of a free part goes on by h (v + shift + shift_omega x arm), otherwise x = y.
struct SettleArguments {
  VertexRange vertices;
  float h;
  bool free;
  float center[3];
  float moving[3], lost_omega[3];    ///< rigid motion of the part as it is
  float change[3], change_omega[3];  ///< to the one it has to have
  float shift[3], shift_omega[3];    ///< the same for the positions
  float lost;                        ///< part of the motion beyond the rigid one that inner friction takes
  const float* vertex_kept;          ///< null, or factors on 1 - lost by vertex from `begin` on
};

/// v += motion at x.
struct AddMotionArguments {
  VertexRange vertices;
  MotionOf3 motion;
};

struct Kernels {
  const char* name;
  void (*moments)(const ClusterRestBlock& rest, const MemberBlock* members, const float* y, ClusterBlock& state,
                  float* slots);
  void (*match)(const ClusterRestBlock* rest, const StiffnessBlock* stiffness, ClusterBlock* state,
                std::uint32_t blocks);
  void (*goals)(const ClusterRestBlock& rest, const MemberBlock* members, const StiffnessBlock& stiffness,
                const ClusterBlock& state, float* slots);
  std::uint32_t (*predict)(const PredictArguments& arguments);  ///< \return vertices repaired
  void (*apply)(const ApplyArguments& arguments);
  void (*sum)(const SumArguments& arguments);
  void (*settle)(const SettleArguments& arguments);
  void (*add_motion)(const AddMotionArguments& arguments);
  float (*relax_rows)(SolverRow* rows, std::uint32_t count, const RowTerm* terms, ClusterAnswer* answers, float most);
  double (*field_energy)(const FieldEnergyArguments& arguments);  ///< \return joule
  void (*field_modes)(const FieldModesArguments& arguments);
  bool (*factorize)(const FactorArguments& arguments);  ///< \return whether the matrix was positive
  void (*solve)(const FactorArguments& arguments);
  void (*field_values)(const FieldValuesArguments& arguments);
  void (*field_heights)(const FieldHeightsArguments& arguments);
  const AttachKernels& attach;
};

/// Those of the widest instruction set that this processor has, or of the one that SINEW_INSTRUCTION_SET names.
const Kernels& kernels();

/// Whether this build has kernels that this processor runs; without them kernels() must not be used.
bool kernelsRun();

/// One by name, or null where this processor or build lacks it: sse42, avx2, avx512, portable.
const Kernels* kernelsNamed(const char* name);

}  // namespace sinew::internal
