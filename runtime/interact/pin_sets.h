// SPDX-License-Identifier: MIT
#pragma once

#include "runtime/world/body.h"

namespace sinew::internal {

/// Adds a set to the body; the arguments are sound. Its vertices stay where they are in its transform. Leaves all as it
/// was where memory runs out (std::bad_alloc).
void addPinSet(Body& body, PinSet&& set);
/// Replaces all pin sets of a body by its package's, if BodySettings ask for them; Body::reset() is due. Where memory
/// runs out (std::bad_alloc) the body keeps its sets. \param next_id of a pin set; moves on.
void setPackagePins(Body& body, std::uint32_t& next_id);
/// A step begins: pins and pin sets go `share` of the way to their targets, and feel nothing yet.
void moveHolds(Body& body, double share);
/// From one transform (part 0) to another (1), on the way.
RigidTransform between(const RigidTransform& from, const RigidTransform& to, double part);
/// Removes the set at an index.
void removePinSet(Body& body, std::size_t index);
/// Removes all.
void removePinSets(Body& body);

}  // namespace sinew::internal
