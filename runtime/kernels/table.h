// SPDX-License-Identifier: MIT
//
// The body of each kernels_*.cpp: all kernels, compiled for the instruction set that file is compiled for. Those that
// gain nothing from registers wider than eight floats are another file's where SINEW_NARROW_KERNELS names its
// namespace.
#pragma once

#include "runtime/kernels/attach.h"
#include "runtime/kernels/field.h"
#include "runtime/kernels/goals.h"
#include "runtime/kernels/kernels.h"
#include "runtime/kernels/match.h"
#include "runtime/kernels/moments.h"
#include "runtime/kernels/rows.h"
#include "runtime/kernels/vertices.h"

#if !defined(SINEW_NARROW_KERNELS)
#define SINEW_NARROW_KERNELS SINEW_KERNELS
#define SINEW_NARROW_KERNELS_HERE
#endif

namespace sinew::internal::SINEW_NARROW_KERNELS {

void sumOf(const SumArguments& a);
void addMotionOf(const AddMotionArguments& a);
float relaxRowsOf(SolverRow* rows, std::uint32_t count, const RowTerm* terms, ClusterAnswer* answers, float most);
extern const AttachKernels kAttach;

}  // namespace sinew::internal::SINEW_NARROW_KERNELS

namespace sinew::internal::SINEW_KERNELS {
namespace {

void momentsOf(const ClusterRestBlock& rest, const MemberBlock* members, const float* y, ClusterBlock& state,
               float* slots) {
  if (rest.quadratic != 0) {
    moments<true>(rest, members, y, state, slots);
  } else {
    moments<false>(rest, members, y, state, slots);
  }
}
void matchOf(const ClusterRestBlock* rest, const StiffnessBlock* stiffness, ClusterBlock* state, std::uint32_t blocks) {
#if defined(__AVX512F__)
  using W = Float16;
#elif defined(__AVX__)
  using W = Float8;
#else
  using W = Float4;
#endif
  constexpr std::uint32_t kWidth = sizeof(W) / sizeof(float);
  for (std::uint32_t b = 0; b < blocks; ++b) {
    const bool quadratic = rest[b].quadratic != 0;
    const bool two = kWidth > kLanes && b + 1 < blocks && (rest[b + 1].quadratic != 0) == quadratic;
    const std::uint32_t next = two ? 1 : 0;
    for (std::uint32_t lane = 0; lane < kLanes; lane += kWidth) {
      match<W>(quadratic ? 9 : 3, {rest + b, next, lane}, {stiffness + b, next, lane}, {state + b, next, lane});
    }
    b += next;
  }
}
void goalsOf(const ClusterRestBlock& rest, const MemberBlock* members, const StiffnessBlock& stiffness,
             const ClusterBlock& state, float* slots) {
  if (rest.quadratic != 0) {
    goals<true>(rest, members, stiffness, state, slots);
  } else {
    goals<false>(rest, members, stiffness, state, slots);
  }
}
std::uint32_t predictOf(const PredictArguments& a) { return predict(a); }
void applyOf(const ApplyArguments& a) { apply(a); }
void settleOf(const SettleArguments& a) { settle(a); }
double fieldEnergyOf(const FieldEnergyArguments& a) { return fieldEnergy(a); }
void fieldModesOf(const FieldModesArguments& a) { fieldModes(a); }
bool factorizeOf(const FactorArguments& a) { return factorize(a); }
void solveOf(const FactorArguments& a) { solve(a); }
void fieldValuesOf(const FieldValuesArguments& a) { fieldValues(a); }
void fieldHeightsOf(const FieldHeightsArguments& a) { fieldHeights(a); }

}  // namespace

#if defined(SINEW_NARROW_KERNELS_HERE)
void sumOf(const SumArguments& a) { sum(a); }
void addMotionOf(const AddMotionArguments& a) { addMotion(a); }
float relaxRowsOf(SolverRow* rows, std::uint32_t count, const RowTerm* terms, ClusterAnswer* answers, float most) {
  return relaxRows(rows, count, terms, answers, most);
}
const AttachKernels kAttach = attachTable();
#endif

inline constexpr Kernels tableNamed(const char* name) {
  namespace narrow = SINEW_NARROW_KERNELS;
  return {name,
          momentsOf,
          matchOf,
          goalsOf,
          predictOf,
          applyOf,
          narrow::sumOf,
          settleOf,
          narrow::addMotionOf,
          narrow::relaxRowsOf,
          fieldEnergyOf,
          fieldModesOf,
          factorizeOf,
          solveOf,
          fieldValuesOf,
          fieldHeightsOf,
          narrow::kAttach};
}

}  // namespace sinew::internal::SINEW_KERNELS
