// SPDX-License-Identifier: MIT
//
// The body of each kernels_*.cpp: all kernels, compiled for the instruction set that file is compiled for. Where
// SINEW_NARROW_KERNELS names another file's namespace they are that file's: nothing here gains from registers wider
// than eight floats.
#pragma once

#include "runtime/kernels/kernels.h"

#if !defined(SINEW_NARROW_KERNELS)
#define SINEW_NARROW_KERNELS SINEW_KERNELS
#define SINEW_NARROW_KERNELS_HERE
#include "runtime/kernels/attach.h"
#include "runtime/kernels/field.h"
#include "runtime/kernels/push.h"
#include "runtime/kernels/vectors.h"
#endif

namespace sinew::internal::SINEW_NARROW_KERNELS {

extern const AttachKernels kAttach;
double fieldEnergyOf(const FieldEnergyArguments& a);
void fieldStiffnessOf(const FieldStiffnessArguments& a);
void fieldModesOf(const FieldModesArguments& a);
bool factorizeOf(const FactorArguments& a);
void solveOf(const FactorArguments& a);
void addProductOf(const ProductArguments& a);
void fieldValuesOf(const FieldValuesArguments& a);
void residualValuesOf(const ResidualValuesArguments& a);
void fieldHeightsOf(const FieldHeightsArguments& a);
void pushWaysOf(const PushArguments& a);
double pushForcesOf(const PushArguments& a);
double pushRubsOf(const PushArguments& a);
void addPullsOf(const PushSideArguments& a);
void addBendsOf(const PushSideArguments& a);
double dotOf(const float* a, const float* b, std::uint32_t n);
double addThenDotOf(float factor, const float* a, float* to, const float* with, std::uint32_t n);

}  // namespace sinew::internal::SINEW_NARROW_KERNELS

namespace sinew::internal::SINEW_KERNELS {

#if defined(SINEW_NARROW_KERNELS_HERE)
const AttachKernels kAttach = attachTable();
double fieldEnergyOf(const FieldEnergyArguments& a) { return fieldEnergy(a); }
void fieldStiffnessOf(const FieldStiffnessArguments& a) { fieldStiffness(a); }
void fieldModesOf(const FieldModesArguments& a) { fieldModes(a); }
bool factorizeOf(const FactorArguments& a) { return factorize(a); }
void solveOf(const FactorArguments& a) { solve(a); }
void addProductOf(const ProductArguments& a) { addProduct(a); }
void fieldValuesOf(const FieldValuesArguments& a) { fieldValues(a); }
void residualValuesOf(const ResidualValuesArguments& a) { residualValues(a); }
void fieldHeightsOf(const FieldHeightsArguments& a) { fieldHeights(a); }
void pushWaysOf(const PushArguments& a) { pushWays(a); }
double pushForcesOf(const PushArguments& a) { return pushForces(a); }
double pushRubsOf(const PushArguments& a) { return pushRubs(a); }
void addPullsOf(const PushSideArguments& a) { addPulls(a); }
void addBendsOf(const PushSideArguments& a) { addBends(a); }
double dotOf(const float* a, const float* b, std::uint32_t n) { return dot(a, b, n); }
double addThenDotOf(float factor, const float* a, float* to, const float* with, std::uint32_t n) {
  return addThenDot(factor, a, to, with, n);
}
#endif

inline constexpr Kernels tableNamed(const char* name) {
  namespace narrow = SINEW_NARROW_KERNELS;
  return {name,
          narrow::fieldEnergyOf,
          narrow::fieldStiffnessOf,
          narrow::fieldModesOf,
          narrow::factorizeOf,
          narrow::solveOf,
          narrow::addProductOf,
          narrow::fieldValuesOf,
          narrow::residualValuesOf,
          narrow::fieldHeightsOf,
          narrow::pushWaysOf,
          narrow::pushForcesOf,
          narrow::pushRubsOf,
          narrow::addPullsOf,
          narrow::addBendsOf,
          narrow::dotOf,
          narrow::addThenDotOf,
          narrow::kAttach};
}

}  // namespace sinew::internal::SINEW_KERNELS
