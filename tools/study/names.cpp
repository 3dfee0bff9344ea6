// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/names.h"

#include <array>

namespace sinew::tools {

std::string_view nameOf(formats::ClusterMode mode) {
  return std::array<std::string_view, 3>{"rigid", "linear", "quadratic"}[std::size_t(mode)];
}

std::string_view nameOf(formats::StiffnessModel model) {
  return std::array<std::string_view, 3>{"frequency", "per_step", "elastic"}[std::size_t(model)];
}

std::string_view nameOf(formats::LimitMethod limit) {
  return std::array<std::string_view, 7>{
      "none", "rows", "frobenius", "frobenius_cheap", "soft", "principal", "curve"}[std::size_t(limit)];
}

std::string_view nameOf(formats::VolumeMethod volume) {
  return std::array<std::string_view, 3>{"none", "cube_root", "principal"}[std::size_t(volume)];
}

std::string_view nameOf(PinMethod method) {
  return std::array<std::string_view, 4>{"hold", "infinite_mass", "matrix", "constrained_fit"}[std::size_t(method)];
}

}  // namespace sinew::tools
