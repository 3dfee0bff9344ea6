// SPDX-License-Identifier: MIT
//
// Arguments of the kernels of fields (docs/method.md §3). Plain structs: kernel files include nothing else.
#pragma once

#include <cstdint>

namespace sinew::internal {

/// Eight samples of the elastic energy: a FPAK record as kernels know it.
struct SamplePack {
  float volume[8], mu[8], lambda[8], at[3][8];
  std::uint32_t cluster[8];
};

/// Limits of eight samples (docs/method.md §3): bounds of principal stretches, of the lengths of
/// the rest axes, and of the squared norm of F, which beyond `norm` is to be norm_limit - norm / |F|^2 (norm_limit -
/// norm), or the response of a curve. Limits that a sample does not have are out of reach.
struct SampleLimits {
  float least[8], most[8], row[8], norm[8], norm_limit[8];
  float reach[8];                 ///< of |F - R|^2: below, all is within the limits
  const float* curve[8];          ///< pairs of squared norm and response, ascending; null without one
  std::uint32_t curve_points[8];  ///< 2..
};

/// A sum over samples: the elastic energy of a piece at given coefficients, and its gradient.
struct FieldEnergyArguments {
  std::uint32_t functions;   ///< k
  std::uint32_t pack_count;  ///< of eight samples
  const SamplePack* packs;
  const float* gradients;      ///< by pack and function: d phi / dX, dY, dZ of eight samples
  float stiffness;             ///< factor on mu and lambda
  const float* coefficients;   ///< k x 4: x y z 0, in the frame of the piece, less those of the rest shape
  bool mark;                   ///< find here how far samples lean on the frame's rotation: until the next mark
  float* quaternions;          ///< by pack 4 x 8, in and out: w x y z, where the search for rotations starts
  float* squeezed;             ///< by pack 8, in and out: so far do they, 0..1
  const float* rest_change;    ///< by pack 9 x 8: S^-1 - 1, column by column; null: no sample is plastic
  const SampleLimits* limits;  ///< by pack; null: there are none
  float* lanes;                ///< scratch, k x 3 x 8
  float* gradient;             ///< out, k x 4, in the frame of the piece
};

/// The second derivative of that sum, made positive sample by sample.
struct FieldStiffnessArguments {
  std::uint32_t functions, pack_count;
  std::uint32_t driven;  ///< functions that are not unknowns: the first
  std::uint32_t stride;  ///< floats a row of the matrix
  const SamplePack* packs;
  const float* gradients;
  float stiffness;
  const float* coefficients;
  const float* squeezed;
  const float* rest_change;
  const SampleLimits* limits;
  float* scratch;  ///< kStiffnessScratch floats a pack
  float* matrix;   ///< out, 3 (functions - driven) rows: the lower triangle
};
inline constexpr std::uint32_t kStiffnessScratch = 8 * (45 + 9);

/// A matrix product to be added, by columns.
struct ProductArguments {
  std::uint32_t rows, columns, depth;  ///< rows: a multiple of eight
  const double* left;                  ///< a column each `stride`
  const double* right;                 ///< a column each `depth`
  double* to;                          ///< a column each `to_stride`
  std::size_t stride, to_stride;
};

/// Values of a field at blocks of eight places.
struct FieldValuesArguments {
  std::uint32_t functions, blocks;
  const float* values;        ///< by block and function: phi at eight places
  const float* coefficients;  ///< k x 4
  float* out;                 ///< by block: x of eight places, y, z
};

/// Vectors by modes at blocks of eight places.
struct ResidualValuesArguments {
  std::uint32_t modes, blocks;
  const std::int16_t* values;  ///< by block: x of each mode at eight places, y, z
  const float* amplitudes;     ///< of the modes, times the unit of the values
  float* out;                  ///< by block: x of eight places, y, z
};

/// A solve with the rest stiffness: g becomes Q (inertia + stiffness values)^-1 Q^T g.
struct FieldModesArguments {
  std::uint32_t unknowns;  ///< 3 n
  const float* modes;      ///< by eight modes: squared frequencies, then coefficients by unknown
  float inertia;           ///< 1/h^2
  float stiffness;         ///< factor on the squared frequencies
  float* lanes;            ///< scratch, 3 n x 8
  float* vector;           ///< 3 n, in and out, and one float of scratch
};

/// A symmetric positive matrix, its lower triangle row by row, or what factorize makes of it. Entries right of the
/// diagonal are scratch.
struct FactorArguments {
  std::uint32_t size;
  std::uint32_t stride;  ///< floats a row: size rounded up to eight
  float* matrix;
  float* vector;  ///< `stride` floats: scratch of factorize, the right side and solution of solve
};

/// The same of one number a function: heights along a direction.
struct FieldHeightsArguments {
  std::uint32_t functions, blocks;
  const float* values;
  const float* coefficients;  ///< k
  float* out;                 ///< by block, eight
};

}  // namespace sinew::internal
