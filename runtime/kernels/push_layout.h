// SPDX-License-Identifier: MIT
//
// Arguments of the kernels of pushes between pieces (docs/method.md §4). Plain structs: kernel files include nothing
// else.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sinew::internal {

/// Eight pushes (Push in solver/minimize.h) between the same two pieces. A lane without one has kappa 0.
struct PushPack {
  float normal[3][8], slide[3][8], gap[8], kappa[8], friction[8];
  float pressed[8];    ///< N, that friction sees
  float way[3][8];     ///< at the last evaluation, m
  float pull[3][8];    ///< the energy's derivative by it, N; of push_rubs how much that has changed
  float pulled[3][8];  ///< where the minimization has come to, N
};

/// Pushes between pieces a and b. Rows, by pack: phi of a by function at eight points, then that of b; times -1 of the
/// piece that a push goes out of, so that the way of a push is the sum of both times their coefficients.
struct PushSide {
  std::uint32_t functions;    ///< 0: there is no b
  const float* rotation;      ///< of the frame that its coefficients are in, column-major
  const float* coefficients;  ///< k x 4
};
struct PushArguments {
  std::uint32_t count;  ///< of packs
  PushPack* packs;
  const float* rows;
  PushSide a, b;
  bool* pulls;  ///< out: whether any pull is not 0
};

/// One of the two pieces, and what is added to of it.
struct PushSideArguments {
  std::uint32_t count;
  const PushPack* packs;
  const float* rows;   ///< of this piece, in the first pack
  std::size_t stride;  ///< from pack to pack, floats
  PushSide side;       ///< coefficients: of add_bends its step
  float* to;           ///< k x 4
};

}  // namespace sinew::internal
