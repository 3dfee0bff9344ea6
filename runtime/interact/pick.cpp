// SPDX-License-Identifier: MIT
#include "runtime/interact/pick.h"

#include "runtime/attach/visual.h"

namespace sinew::internal {

void addPickRows(Body& body, float pass_seconds) {
  for (std::uint32_t i = 0; i < body.picks.size(); ++i) {
    Row row;
    row.kind = RowKind::hold;
    row.point = RowPoint::visual_vertex;
    row.index = body.picks[i].visual_vertex;
    row.pick = i;
    row.target = attachedPosition(body, row.index, body.x);
    row.impulse = pass_seconds * pass_seconds * asVector(body.picks[i].force);
    body.rows.push_back(row);
  }
}

}  // namespace sinew::internal
