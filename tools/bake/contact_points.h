// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sinew/formats/writer.h"
#include "tools/bake/field_host.h"

namespace sinew::tools {

/// A point of the surface: weights of vertices of the piece.
struct ContactPoint {
  formats::Float3 place = {};
  std::array<std::uint32_t, 4> corner = {};
  std::array<double, 4> weight = {};
};

struct ContactPoints {
  std::vector<ContactPoint> points;
  double area = 1;  ///< m^2 of the surface for each
};

/// Places spread over the drawn surface of a piece, each as far as can be from the others; where that hangs on
/// clusters, all physical vertices. \param count of them at most.
ContactPoints contactPoints(const formats::PackageContent& content, const FieldHost& host, std::uint32_t count);

}  // namespace sinew::tools
