// SPDX-License-Identifier: MIT
//
// Permanent deformation S, det S = 1, of the samples of a piece: the energy of a sample is that of F S^-1
// (docs/method.md; the flow is that of Müller et al. 2005, §5.3).
#pragma once

#include "runtime/clusters/algebra.h"
#include "runtime/memory/array.h"
#include "runtime/solver/field.h"

namespace sinew::internal {

/// By pack: S column by column, eight samples each; the identity in all. Empty where nothing may become permanent.
void resetPlasticity(const Field& field, Array<float>& plastic);

/// S^-1 - 1 from S, in the same layout.
void invertPlasticity(const Array<float>& plastic, Array<float>& rest_change);

/// Plastic flow of a step: strain beyond the yield goes into S. \param local coefficients in the frame of the
/// piece, less those of the rest shape, k x 4. \return whether S changed.
bool flow(const formats::PackageView& package, const Field& field, const float* local, double seconds,
          Array<float>& plastic);

/// S at the samples of another field of the piece: that of the nearest sample.
void movePlasticity(const Field& from, const Field& to, Array<float>& plastic);

/// The mean of S over the samples of a cluster; the identity where it has none.
Matrix3 plasticShapeOf(const Field& field, std::uint32_t cluster, const Array<float>& plastic);

/// Deformation of a cluster that nothing holds, by its activated fibre: (1 - a c) along it, 1 / sqrt(1 - a c) across.
/// \param activation a, 0..1.
Matrix3 activationStretch(const formats::ClusterMechanics& mechanics, float activation);

}  // namespace sinew::internal
