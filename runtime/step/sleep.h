// SPDX-License-Identifier: MIT
//
// Bodies that rest are not stepped (docs/method.md §3): they fall asleep with all that they touch, and wake with it.
#pragma once

#include "runtime/step/together.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// After a step: counts how long each body has rested. Bodies at rest for
/// WorldSettings::sleep_seconds fall asleep, if all that they touch has rested as long.
void letSleep(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch);

/// \param group the first body of those it falls asleep with.
void fallAsleep(Body& body, std::uint32_t group);
/// Wakes a body and all that fell asleep with it.
void wake(BodyList& bodies, Body& body);
void wakeAll(BodyList& bodies);
/// Wakes the bodies that a box (world) meets.
void wakeIn(BodyList& bodies, const Eigen::AlignedBox3d& box);

}  // namespace sinew::internal
