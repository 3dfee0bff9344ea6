// SPDX-License-Identifier: MIT
#include "runtime/contact/ground.h"

#include <algorithm>

namespace sinew::internal {
namespace {

// Vertices this close to the plane get a row although the prediction does not touch: matching may press them in.
// Relative to the diagonal.
constexpr float kMargin = 2e-3F;

// Speed at which what starts inside comes out, diagonals per second.
constexpr float kRecoverySpeed = 1.0F;

}  // namespace

float recoveryHeight(float diagonal, float pass_seconds) { return kRecoverySpeed * diagonal * pass_seconds; }

float reachableHeight(float height, float diagonal, float pass_seconds) {
  return height >= 0 ? 0.0F : std::min(0.0F, height + recoveryHeight(diagonal, pass_seconds));
}

void addGroundRows(Body& body, const GroundPlane& ground, float pass_seconds) {
  const float diagonal = body.package().info().diagonal;
  const float margin = kMargin * diagonal;
  const Vector3 normal = asVector(ground.normal);
  for (std::uint32_t i = 0; i < body.vertexCount(); ++i) {
    if (body.pinned[i] != 0) continue;
    const Vector3 x = asVector(body.x[i]);
    const float predicted = heightAbove(ground, asVector(body.y[i]));
    if (!(predicted < margin)) {
      body.force[i] = {};
      continue;
    }
    const float height = heightAbove(ground, x);
    Row row;
    row.kind = RowKind::contact;
    row.point = RowPoint::physical_vertex;
    row.index = i;
    row.normal = normal;
    row.friction = ground.friction;
    row.target = x + (reachableHeight(height, diagonal, pass_seconds) - height) * normal;
    row.impulse = pass_seconds * pass_seconds * asVector(body.force[i]);
    const float pressed = normal.dot(row.impulse);
    if (!(pressed > 0)) row.impulse.setZero();
    body.rows.push_back(row);
  }
}

}  // namespace sinew::internal
