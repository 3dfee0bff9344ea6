// SPDX-License-Identifier: MIT
//
// The table of kernels for each instruction set. Which one runs is chosen once, at the first call of kernels(): the
// widest this processor has, or what the environment variable SINEW_INSTRUCTION_SET (sse42, avx2, avx512) asks for.
// Results do not depend on the choice, bit for bit.
#pragma once

#include <cstdint>

#include "runtime/kernels/attach_layout.h"
#include "runtime/kernels/field_layout.h"
#include "runtime/kernels/push_layout.h"

namespace sinew::internal {

/// For what lanes rarely need, one lane at a time (runtime/kernels/lane_fallback.cpp).
/// Rotation nearest to a column-major 3x3 matrix whose entries are finite and not all zero. \param[in,out] quaternion
/// w x y z: the previous rotation; the result.
void nearestRotationOfLane(const float* matrix, float* quaternion);
/// Limits of the lengths of the rest axes (F e, as long as the rows of R^T F) and of the norm, of one sample.
/// \param stiff twice the stiffness of limits. \param p column by column, added to. \return the energy, J.
float addLengthLimits(const SampleLimits& limits, std::uint32_t lane, float stiff, const float* f, float* p);

struct Kernels {
  const char* name;
  double (*field_energy)(const FieldEnergyArguments& arguments);  ///< \return joule
  void (*field_stiffness)(const FieldStiffnessArguments& arguments);
  void (*field_modes)(const FieldModesArguments& arguments);
  bool (*factorize)(const FactorArguments& arguments);  ///< \return whether the matrix was positive
  void (*solve)(const FactorArguments& arguments);
  void (*add_product)(const ProductArguments& arguments);
  void (*field_values)(const FieldValuesArguments& arguments);
  void (*residual_values)(const ResidualValuesArguments& arguments);
  void (*field_heights)(const FieldHeightsArguments& arguments);
  void (*push_ways)(const PushArguments& arguments);
  double (*push_forces)(const PushArguments& arguments);  ///< \return joule
  double (*push_rubs)(const PushArguments& arguments);    ///< \return joule
  void (*add_pulls)(const PushSideArguments& arguments);
  void (*add_bends)(const PushSideArguments& arguments);
  double (*dot)(const float* a, const float* b, std::uint32_t n);  ///< n a multiple of four
  /// to += factor a. \return its product with another vector, which may be itself
  double (*add_then_dot)(float factor, const float* a, float* to, const float* with, std::uint32_t n);
  const AttachKernels& attach;
};

/// The kernels of the widest instruction set that this processor has, or of the one that SINEW_INSTRUCTION_SET names.
const Kernels& kernels();

/// Whether this build has kernels that this processor runs; without them kernels() must not be used.
bool kernelsRun();

/// One by name, or null where this processor or build lacks it: sse42, avx2, avx512, portable.
const Kernels* kernelsNamed(const char* name);

}  // namespace sinew::internal
