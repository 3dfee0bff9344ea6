// SPDX-License-Identifier: GPL-3.0-or-later
//
// Where the bodies of a scene that plays touch something.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tools/studio/view_play.h"

namespace sinew::tools {

/// Vertices of the bodies that touch the ground, a collider, another body, or their own body in another place, metres.
/// Bodies touch each other, and themselves, where the scene says so (WorldSettings::collisions,
/// BodySettings::self_contact).
std::vector<Eigen::Vector3f> contactsOf(const Play& play);

}  // namespace sinew::tools
