// SPDX-License-Identifier: MIT
//
// What kernels of all instruction sets share because few lanes ever need it.
#define SINEW_KERNELS kernels_limits
#include "runtime/kernels/kernels.h"
#include "runtime/kernels/match.h"

namespace sinew::internal {
namespace {

using kernels_limits::Float4;
using Matrix = kernels_limits::Mat3Of<Float4>;
using Svd = kernels_limits::SvdOf<Float4>;

}  // namespace

void limitFourStretches(const StiffnessBlock& stiffness, std::uint32_t lane, FourStretches& four) {
  using Mask = kernels_limits::Int4;
  Mask act, tangled, shaped;
  __builtin_memcpy(&act, four.act, sizeof act);
  __builtin_memcpy(&tangled, four.tangled, sizeof tangled);
  __builtin_memcpy(&shaped, four.shaped, sizeof shaped);
  Mask stopped = {};
  if (kernels_limits::any(act)) {
    Matrix a;
    __builtin_memcpy(&a, four.a, sizeof a);
    stopped = kernels_limits::limitStretches<Float4>({&stiffness, 0, lane}, act, tangled, a, shaped);
    __builtin_memcpy(four.a, &a, sizeof a);
  }
  __builtin_memcpy(four.shaped, &shaped, sizeof shaped);
  __builtin_memcpy(four.stopped, &stopped, sizeof stopped);
}

void rotationSvdOfLane(const float* a, float* u, float* v, float* sigma) {
  Matrix all;
  for (int k = 0; k < 9; ++k) all.m[k] = kernels_limits::splat<Float4>(a[k]);
  const Svd svd = kernels_limits::rotationSvd(all);
  for (int k = 0; k < 9; ++k) {
    u[k] = svd.u.m[k][0];
    v[k] = svd.v.m[k][0];
  }
  sigma[0] = svd.sigma.x[0];
  sigma[1] = svd.sigma.y[0];
  sigma[2] = svd.sigma.z[0];
}

}  // namespace sinew::internal
