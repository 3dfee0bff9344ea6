// SPDX-License-Identifier: MIT
//
// The compliance that a field lacks where vertices are held at run time, from the piece's own elements
// (docs/method.md §4).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <mutex>
#include <span>

#include "runtime/memory/array.h"
#include "runtime/solver/field.h"

namespace sinew::internal {

/// What it costs to hold vertices of a piece elsewhere than its field has them: 1/2 e^T S e, e in the patterns Q that the
/// field's functions show there, Q^T V Q = 1. Vectors are in the axes of the rest shape.
struct HoldShape {
  const Field* field = nullptr;
  Array<std::uint32_t> vertices;  ///< of the piece, ascending: those that are held whole and belong to its elements
  std::uint32_t rank = 0;         ///< patterns; 0: there are none, springs act
  Array<double> weights;          ///< by pattern and vertex: V Q
  Array<float> rows;              ///< by pattern and function: e_q = sum_j rows_qj z_j less the same of the targets
  Array<float> stiffness;         ///< S, N/m: 3 rank rows
  Array<float> matrix;            ///< rows^T S rows of the field's unknowns: 3 n rows of Field::stride floats
};

/// Makes a shape. The bits depend on the package, the field and the vertices alone.
/// \param vertices of the piece, ascending. May throw std::bad_alloc.
std::shared_ptr<const HoldShape> makeHoldShape(const formats::PackageView& package, const Field& field,
                                               std::span<const std::uint32_t> vertices);

/// The shapes that bodies of an asset have asked for: one that is asked for again costs nothing.
class HoldShapes {
 public:
  /// From any thread. May throw std::bad_alloc.
  std::shared_ptr<const HoldShape> find(const formats::PackageView& package, const Field& field,
                                        std::span<const std::uint32_t> vertices) const;

 private:
  struct Entry {
    Array<std::uint32_t> asked;
    std::shared_ptr<const HoldShape> shape;
  };
  mutable std::mutex mutex_;
  mutable OwningArray<Entry> entries_;
};

/// A pin set that holds a piece by a shape.
struct Hold {
  std::uint32_t set = 0;  ///< of Body::pin_sets
  std::shared_ptr<const HoldShape> shape;
  Matrix3d material = Matrix3d::Identity();  ///< the rest shape's axes in those of the set
  Array<double> targets;                     ///< by pattern: the sum of its weights, and of its places in the set
  float frame[9] = {};                       ///< the rest shape's axes in the world in this step, column-major

  explicit Hold(std::pmr::memory_resource* memory) : targets(memory) {}
  double one(std::uint32_t pattern) const { return targets[4 * std::size_t(pattern)]; }
  Vector3d arm(std::uint32_t pattern) const {
    return Eigen::Map<const Vector3d>(targets.data() + 4 * std::size_t(pattern) + 1);
  }
};

/// Patterns of a shape at most.
inline constexpr std::uint32_t kMostPatterns = 16;

}  // namespace sinew::internal
