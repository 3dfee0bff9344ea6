// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/clusters/algebra.h"
#include "runtime/geometry/rotation.h"

namespace sinew::internal {

/// State of one cluster of one body: what the match found, and the transform that gives its goals,
/// g = center + radius * f * q~.
struct ClusterFrame {
  Vector3 center = Vector3::Zero();                               ///< c, metres
  geometry::Quaternion rotation = geometry::kIdentityQuaternion;  ///< R
  Columns<9> a_pq = Columns<9>::Zero();  ///< Σ mu p q~^T with p = (x - c) / radius; columns 3.. only if quadratic
  Columns<9> f = Columns<9>::Zero();     ///< F; columns 3.. only if quadratic
  geometry::Quaternion part_rotation =
      geometry::kIdentityQuaternion;      ///< of the whole body part, from its clusters' moments
  Vector3 part_center = Vector3::Zero();  ///< where the cluster's centre is in the part's rigid pose, metres
  bool part_astray = false;               ///< the part is so far from its rest shape that it is matched as one
  bool limited = false;                   ///< the guard against inversion moved F in the last match
};

}  // namespace sinew::internal
