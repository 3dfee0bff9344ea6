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

void holdPins(Body& body, std::uint32_t passes_left) {
  for (const Pin& pin : body.pins) {
    asVector(body.y[pin.vertex]) = pinPosition(asVector(body.x[pin.vertex]), asVector(pin.target), passes_left);
  }
}

}  // namespace sinew::internal
