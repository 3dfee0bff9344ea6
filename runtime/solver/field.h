// SPDX-License-Identifier: MIT
//
// The function spaces of a package (FELD) as the solver sees them: views, and constants computed at load.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>

#include "runtime/kernels/field_layout.h"
#include "runtime/memory/array.h"
#include "sinew/formats/package.h"

namespace sinew::internal {

using Vector3d = Eigen::Vector3d;
using Matrix3d = Eigen::Matrix3d;

/// Stiffness of a cluster's fibres that a channel activates.
struct FibreStiffness {
  std::uint32_t cluster = 0;      ///< CLUS record
  const float* matrix = nullptr;  ///< rows of the lower triangle, J: sum T b b^T over its records, fully activated
  const float* pull = nullptr;    ///< k x 4: that matrix times the rest shape
  double energy = 0;              ///< at rest, J
};

/// One field of a package: the free one of a piece, or the one for where its pin sets hold it.
struct Field {
  std::uint32_t piece = 0;          ///< BODY record
  std::uint32_t level = 0;          ///< of detail; 0: the whole
  bool held = false;                ///< pin sets drive the first functions
  std::uint32_t k = 0, driven = 0;  ///< functions; the first `driven` are prescribed
  std::uint32_t first_vertex = 0, vertex_count = 0;
  std::uint32_t drawn_count = 0;  ///< of them the first, among which are all that visual vertices hang on
  std::span<const formats::FieldFunction> functions;
  std::span<const formats::FieldPoint> points;
  double apart = 0;  ///< root of the area that a contact point stands for, in the mean, m
  const SamplePack* packs = nullptr;
  const float* gradients = nullptr;      ///< as FieldEnergyArguments wants them
  const float* values = nullptr;         ///< by eight vertices
  const float* point_values = nullptr;   ///< by eight points
  const float* modes = nullptr;          ///< by eight modes: squared frequencies, then their 3 n coefficients
  const SampleLimits* limits = nullptr;  ///< by pack; null where no sample has any
  bool plastic = false;                  ///< some sample may change its rest shape
  std::span<const FibreStiffness> fibres;
  const float* tethers = nullptr;          ///< k x k, N/m: 1/2 sum T_ij z_i . z_j; null without
  std::uint32_t residual_modes = 0;        ///< r, of what the functions lack (FRES); 0: not known
  const std::int16_t* residual = nullptr;  ///< by eight vertices: x of each mode, then y, then z
  float residual_scale = 0;                ///< of these, (m/N)^1/2
  const float* residual_locals = nullptr;  ///< by vertex, m/N
  std::uint32_t pack_count = 0;

  const float* stiffness = nullptr;         ///< at rest, of the unknowns: 3 n rows of `stride` floats, whole
  std::uint32_t stride = 0;                 ///< 3 n rounded up to eight
  const double* driven_mass = nullptr;      ///< of the driven functions: sum m phi, kg
  double mass = 0;                          ///< kg
  double second_moment = 0;                 ///< sum m |X - center|^2 at rest, kg m^2: squared size of its shapes
  double young = 0;                         ///< mean Young's modulus, Pa
  double foundation = 0;                    ///< kappa of a vertex held at run time (docs/method.md §4), N/m
  double lowest_hz = 0;                     ///< of the lowest elastic mode, Hz
  double ones = 0;                          ///< sum of squares of the functions' `one`
  Vector3d rest_center = Vector3d::Zero();  ///< of its mass, m

  /// Unknowns that are not prescribed: x, y and z of each function that no pin set drives.
  std::uint32_t unknowns() const { return 3 * (k - driven); }

  double oneOf(std::uint32_t j) const { return double(functions[j].one); }
  Vector3d restOf(std::uint32_t j) const {
    return {double(functions[j].rest[0]), double(functions[j].rest[1]), double(functions[j].rest[2])};
  }

  /// phi_j at vertex i of the piece, or at contact point i.
  float valueAt(std::uint32_t i, std::uint32_t j) const { return valuesAt(i)[8 * j]; }
  /// phi at vertex i, eight floats from one function to the next.
  const float* valuesAt(std::uint32_t i) const { return values + std::size_t(8) * (i / 8) * k + i % 8; }
  float valueAtPoint(std::uint32_t i, std::uint32_t j) const { return point_values[8 * (i / 8 * k + j) + i % 8]; }
};

/// Inertia from sum r r^T. A straight line has none about itself.
inline Matrix3d inertiaFrom(const Matrix3d& moment) {
  return (moment.trace() * (1 + 1e-9)) * Matrix3d::Identity() - moment;
}

/// sum_j row_j rows_j of k x 4.
inline Eigen::Array4f sumOfRows(const float* row, const float* rows, std::uint32_t k) {
  using Four = Eigen::Array4f;
  Four even = Four::Zero(), odd = Four::Zero();
  std::uint32_t j = 0;
  for (; j + 2 <= k; j += 2) {
    even += row[j] * Four::Map(rows + 4 * j);
    odd += row[j + 1] * Four::Map(rows + 4 * j + 4);
  }
  if (j < k) even += row[j] * Four::Map(rows + 4 * j);
  return even + odd;
}

/// Adds row i of a k x k matrix, as far as its diagonal, to the lower triangle of that of the unknowns: alike for each
/// axis.
inline void addRow(const Field& field, std::uint32_t i, const float* row, float* matrix) {
  const std::uint32_t driven = field.driven;
  for (std::uint32_t j = driven; j <= i; ++j) {
    for (std::uint32_t axis = 0; axis < 3; ++axis) {
      matrix[std::size_t(field.stride) * (3 * (i - driven) + axis) + 3 * (j - driven) + axis] += row[j];
    }
  }
}

/// All fields of a package, in its order; empty where it has none. \param[out] driven_masses, stiffness, limits own
/// the numbers that fields point to.
Array<Field> makeFields(const formats::PackageView& package, Array<double>& driven_masses, Array<float>& stiffness,
                        Array<SampleLimits>& limits);

/// Gives the fields their fibres. \param[out] fibres, matrices own what they point to.
void makeFibres(const formats::PackageView& package, std::span<Field> fields, Array<FibreStiffness>& fibres,
                Array<float>& matrices);

/// The field of a piece; null where there is none. \param held the one for its pin sets.
const Field* fieldOf(std::span<const Field> fields, std::uint32_t piece, bool held, std::uint32_t level = 0);

}  // namespace sinew::internal
