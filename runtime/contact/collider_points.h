// SPDX-License-Identifier: MIT
//
// Contact points of colliders: what is narrower than a piece's own points are apart would pass between them. They are
// looked for in the piece like the points of another one (docs/method.md §4).
#pragma once

#include "runtime/contact/contacts.h"
#include "runtime/contact/touch.h"

namespace sinew::internal {

/// Whether some near collider may have points in reach of the piece. \pre findNear()
bool mayMeetPoints(const ContactStep& step, const Field& field, const Vector3d& center, const ContactScratch& scratch);

/// Adds the contacts with colliders' own points to those with the piece's, by collider, then by point. \param seen the
/// piece, with the pose of this step. \pre findContacts()
void findPointContacts(const Piece& piece, const ContactStep& step, TouchingPiece seen, ContactScratch& lent,
                       MinimizeScratch& scratch);

}  // namespace sinew::internal
