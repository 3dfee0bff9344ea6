// SPDX-License-Identifier: GPL-3.0-or-later
//
// Dots in the view by which something is moved, sized and turned.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>

namespace sinew::tools {

enum class HandleKind : std::uint8_t { center, radius, normal, fibre, size_x, size_y, size_z, turn_x, turn_y };
struct Handle {
  HandleKind kind = HandleKind::center;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();  ///< m
};
/// Whether it turns a collider.
inline bool isTurn(HandleKind kind) { return kind == HandleKind::turn_x || kind == HandleKind::turn_y; }
/// "handle radius": what a replay presses.
std::string handleName(HandleKind kind);

}  // namespace sinew::tools
