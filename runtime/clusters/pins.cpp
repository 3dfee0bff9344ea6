// SPDX-License-Identifier: MIT
#include "runtime/clusters/pins.h"

namespace sinew::internal {

void addPinRows(Body& body, float pass_seconds, std::uint32_t passes_left) {
  for (const Pin& pin : body.pins) {
    Row row;
    row.kind = RowKind::hold;
    row.point = RowPoint::physical_vertex;
    row.index = pin.vertex;
    row.target = pinPosition(asVector(body.x[pin.vertex]), asVector(pin.target), passes_left);
    row.impulse = pass_seconds * pass_seconds * asVector(body.force[pin.vertex]);
    body.rows.push_back(row);
  }
}

void holdPins(Body& body, float pass_seconds, std::uint32_t passes_left) {
  for (const Pin& pin : body.pins) {
    const Vector3 start = asVector(body.x[pin.vertex]);
    const Vector3 end = pinPosition(start, asVector(pin.target), passes_left);
    asVector(body.y[pin.vertex]) = end;
    asVector(body.v[pin.vertex]) = (end - start) / pass_seconds;
  }
}

}  // namespace sinew::internal
