// SPDX-License-Identifier: MIT
//
// A sweep of projected Gauss-Seidel over rows (docs/method.md §6): one row after the other, four floats to a vector.
// For kernel files only, see lanes.h.
#pragma once

#include "runtime/kernels/kernels.h"
#include "runtime/kernels/lanes.h"

namespace sinew::internal::SINEW_KERNELS {

// A push turns its cluster by no more than this, radians: its answer is of first order.
constexpr float kLargestTurn = 0.5F;

SINEW_INLINE Float4 spreadFour(float v) { return Float4{v, v, v, v}; }
SINEW_INLINE float dotOfThree(Float4 a, Float4 b) {
  const Float4 p = a * b;
  return p[0] + p[1] + p[2];
}
SINEW_INLINE Float4 crossOfThree(Float4 a, Float4 b) {
#define SINEW_TURNED(v, i, j, k) __builtin_shufflevector(v, v, i, j, k, 3)
  return SINEW_TURNED(a, 1, 2, 0) * SINEW_TURNED(b, 2, 0, 1) - SINEW_TURNED(a, 2, 0, 1) * SINEW_TURNED(b, 1, 2, 0);
#undef SINEW_TURNED
}

// Where the row's point is.
SINEW_INLINE Float4 pointOf(const SolverRow& row, const RowTerm* terms, const ClusterAnswer* answers) {
  Float4 point = load4(row.base);
  for (std::uint32_t t = row.first_term; t < row.first_term + row.term_count; ++t) {
    const RowTerm& term = terms[t];
    const ClusterAnswer& answer = answers[term.cluster];
    // Three sums side by side: they wait for nothing but themselves.
    Float4 sums[3] = {spreadFour(term.coefficient) * load4(answer.center),
                      crossOfThree(load4(answer.turn), load4(term.lever)), Float4{}};
    for (std::uint32_t k = 0; k < answer.columns; k += 3) {
      sums[0] += spreadFour(term.out[k]) * load4(answer.column[k]);
      sums[1] += spreadFour(term.out[k + 1]) * load4(answer.column[k + 1]);
      sums[2] += spreadFour(term.out[k + 2]) * load4(answer.column[k + 2]);
    }
    point += (sums[0] + sums[1]) + sums[2];
  }
  return point;
}

SINEW_INLINE void push(const SolverRow& row, const RowTerm* terms, ClusterAnswer* answers, Float4 impulse) {
  for (std::uint32_t t = row.first_term; t < row.first_term + row.term_count; ++t) {
    const RowTerm& term = terms[t];
    ClusterAnswer& answer = answers[term.cluster];
    const Float4 shift = spreadFour(term.scale) * impulse;
    store4(answer.center, load4(answer.center) + spreadFour(term.answer) * shift);
    for (std::uint32_t k = 0; k < answer.columns; ++k) {
      store4(answer.column[k], load4(answer.column[k]) + spreadFour(term.in[k]) * shift);
    }
    const Float4 torque = crossOfThree(load4(term.arm), shift);
    Float4 turn = spreadFour(torque[0]) * load4(answer.inertia_inverse[0]) +
                  spreadFour(torque[1]) * load4(answer.inertia_inverse[1]) +
                  spreadFour(torque[2]) * load4(answer.inertia_inverse[2]);
    const float angle2 = dotOfThree(turn, turn);
    if (angle2 > kLargestTurn * kLargestTurn) turn *= spreadFour(kLargestTurn / squareRoot(angle2));
    store4(answer.turn, load4(answer.turn) + turn);
  }
}

/// Relaxes rows one by one. \param most how far one relaxation may move a point, metres: what is far off comes in over
/// several. \return how far the point that moved most did.
SINEW_INLINE float relaxRows(SolverRow* rows, std::uint32_t count, const RowTerm* terms, ClusterAnswer* answers,
                             float most) {
  float farthest = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    SolverRow& row = rows[i];
    const Float4 impulse = load4(row.impulse);
    const Float4 error = load4(row.target) - pointOf(row, terms, answers) - spreadFour(row.compliance) * impulse;
    Float4 change;
    float moved;
    if (row.contact == 0) {
      change = spreadFour(error[0]) * load4(row.inverse_response[0]) +
               spreadFour(error[1]) * load4(row.inverse_response[1]) +
               spreadFour(error[2]) * load4(row.inverse_response[2]);
      moved = squareRoot(dotOfThree(error, error));
    } else {
      const Float4 normal = load4(row.normal);
      const float pressed = dotOfThree(normal, impulse), normal_error = dotOfThree(normal, error);
      const float wanted = pressed + normal_error / row.normal_response;
      const float push_normal = wanted > 0 ? wanted : 0.0F;
      const Float4 old_tangent = impulse - spreadFour(pressed) * normal;
      Float4 tangent = old_tangent + (error - spreadFour(normal_error) * normal) / spreadFour(row.tangent_response);
      const float limit = row.friction * push_normal;
      const float length2 = dotOfThree(tangent, tangent);
      if (!(length2 <= limit * limit)) tangent *= spreadFour(limit / squareRoot(length2));
      change = spreadFour(push_normal - pressed) * normal + (tangent - old_tangent);
      moved = squareRoot(dotOfThree(change, change)) * row.normal_response;
    }
    const float size = absolute(change[0]) + absolute(change[1]) + absolute(change[2]);
    if (!(size > 0 && size < 3.0e38F)) continue;  // nothing to do, or not finite
    if (moved > most) {
      change *= spreadFour(most / moved);
      moved = most;
    }
    store4(row.impulse, impulse + change);
    push(row, terms, answers, change);
    farthest = moved > farthest ? moved : farthest;
  }
  return farthest;
}

}  // namespace sinew::internal::SINEW_KERNELS
