// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Where a pinned vertex is at the end of this pass, metres: on the straight way to its target, there after the last
/// pass of the step. \param passes_left including this one, >= 1.
inline Vector3 pinPosition(const Vector3& start, const Vector3& target, std::uint32_t passes_left) {
  return passes_left <= 1 ? target : Vector3(start + (target - start) / float(passes_left));
}

/// Part of the way from one transform to another: straight for the position, the shortest turn for the rotation.
RigidTransform betweenTransforms(const RigidTransform& from, const RigidTransform& to, float part);

/// Adds a set to the body; the arguments are sound. Its vertices stay where they are in its transform.
void addPinSet(Body& body, PinSet&& set);
/// In place of all sets of a body those of its package, if BodySettings ask for them; Body::reset() is due. Where
/// memory runs out (std::bad_alloc) the body keeps what it had. \param next_id of a pin set; moves on.
void setPackagePins(Body& body, std::uint32_t& next_id);
/// Makes Body::fits again from its sets, as they are.
void rebuildFits(Body& body);
/// Removes the set at an index. This and addPinSet() leave all as it was where memory runs out (std::bad_alloc).
void removePinSet(Body& body, std::size_t index);
/// Removes all.
void removePinSets(Body& body);

/// Appends a row for each vertex that is held (method `hold`: positions held, forces passed on through the match).
void addPinRows(Body& body, float pass_seconds, std::uint32_t passes_left);

/// Moves the transforms of pin sets on and puts the vertices of the fitted ones in their places of this pass. Call
/// after prediction, before the moments.
void placePins(Body& body, float pass_seconds, std::uint32_t passes_left);

/// Takes over the centres of pinned clusters, between moments (rows included) and match.
void beginPinFits(Body& body);

/// Puts the pinned vertices exactly where they are held and sums up the reactions.
void holdPins(Body& body, float pass_seconds, std::uint32_t passes_left);

/// Ends a pass for clusters that are plastic or damped: what they keep for the next.
void finishMatch(Body& body, float pass_seconds);

}  // namespace sinew::internal
