// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "sinew/formats/writer.h"
#include "tests/support/box_package.h"
#include "tools/bake/fields.h"

namespace sinew::test {

struct FieldBarOptions {
  bool pinned = false;  ///< the face at x = -0.5 is held by the pin set "held"
  bool soft = false;    ///< and what lies next to it, half as firmly
  float hz = 20;        ///< of the free bar's lowest mode
  double length = 1;    ///< m
};

/// A bar of 1 : 0.2 : 0.2 about the origin, with fields.
inline std::vector<std::byte> fieldBar(const FieldBarOptions& options) {
  BoxOptions box;
  box.cells = {10, 3, 3};
  box.size = {options.length, 0.2 * options.length, 0.2 * options.length};
  box.clusters = {2, 1, 1};
  box.stretch_hz = options.hz;
  formats::PackageContent content = boxContent(box);
  if (options.pinned) {
    content.pin_weights.assign(content.physical_vertices.size(), 1.0F);
    for (std::uint32_t v = 0; v < content.physical_vertices.size(); ++v) {
      const float x = content.physical_vertices[v].rest_position[0] / float(options.length);
      if (x < (options.soft ? -0.299F : -0.499F)) content.pin_set_vertices.push_back(v);
      if (x > -0.499F) content.pin_weights[v] = 0.5F;
    }
    content.pin_sets.push_back(
        {content.addText("held"), content.addText("world"), 3, 0, std::uint32_t(content.pin_set_vertices.size()), 0});
  }
  tools::addFields({}, content);
  return formats::writePackage(content);
}

}  // namespace sinew::test
