// SPDX-License-Identifier: MIT
//
// A row asks one point of a body to be somewhere: pins, picks and contacts are rows, solved together on the clusters'
// moments (docs/method.md §6).
#pragma once

#include <cstdint>

#include "runtime/clusters/algebra.h"

namespace sinew::internal {

enum class RowKind : std::uint8_t {
  hold,     ///< point = target, any direction
  contact,  ///< n . point >= n . target, pushing only; friction in the plane
};

/// What the point is.
enum class RowPoint : std::uint8_t { physical_vertex, visual_vertex };

struct Row {
  Vector3 target = Vector3::Zero();   ///< metres, world
  Vector3 impulse = Vector3::Zero();  ///< Λ = force h² over the body's mass, metres
  Vector3 normal = Vector3::Zero();   ///< of a contact, unit
  float weight = 1;                   ///< of a hold: how firmly, 0..1
  float friction = 0;                 ///< Coulomb coefficient
  std::uint32_t index = 0;            ///< physical or visual vertex
  std::uint32_t pick = 0;             ///< into Body::picks for a visual vertex
  RowKind kind = RowKind::hold;
  RowPoint point = RowPoint::physical_vertex;
};

/// How a cluster's goals answer to an impulse: constants of one pass.
struct ClusterResponse {
  Matrix3 rotation = Matrix3::Identity();     ///< R
  Columns<9> lever = Columns<9>::Zero();      ///< R (E - M S): a turn δ moves the goal of q~ by δ x (radius lever q~)
  Matrix3 inertia_inverse = Matrix3::Zero();  ///< world, for unit mass and radius
  bool used = false;                          ///< some row reaches this cluster
};

}  // namespace sinew::internal
