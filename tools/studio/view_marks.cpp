// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/view_marks.h"

#include <imgui.h>

#include <algorithm>
#include <array>

#include "tools/render/overlay.h"

namespace sinew::tools {

void drawViewMarks(const ViewLayout& layout, const Camera& camera, double metres_per_unit, int height) {
  ImDrawList& draw = *ImGui::GetBackgroundDrawList();
  constexpr std::array<ImU32, 3> kColors = {IM_COL32(200, 40, 30, 255), IM_COL32(20, 130, 50, 255),
                                            IM_COL32(40, 80, 200, 255)};
  constexpr std::array<const char*, 3> kNames = {"x", "y", "z"};
  const float unit = 16 * layout.scale;
  const float left = float(layout.panel) / layout.pixels_per_unit;
  // Above the line of help.
  const ImVec2 middle = {left + 2.4F * unit, float(height) - 7.8F * unit};
  std::array<int, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(), [&](int a, int b) { return camera.back()[a] < camera.back()[b]; });
  for (const int axis : order) {
    const float x = 1.4F * unit * camera.right()[axis], y = -1.4F * unit * camera.up()[axis];
    const auto a = std::size_t(axis);
    draw.AddLine(middle, {middle.x + x, middle.y + y}, kColors[a], 2 * layout.scale);
    const ImVec2 size = ImGui::CalcTextSize(kNames[a]);
    draw.AddText({middle.x + 1.4F * x - size.x / 2, middle.y + 1.4F * y - size.y / 2}, kColors[a], kNames[a]);
  }
  const float width = float(layout.width()) / layout.pixels_per_unit;
  const ScaleBar bar = scaleBarOf(camera, int(width), height, metres_per_unit);
  const float end = left + width - unit, start = end - float(bar.pixels), at = float(height) - 6.2F * unit;
  const ImU32 ink = IM_COL32(40, 44, 52, 255);
  draw.AddLine({start, at}, {end, at}, ink, 2 * layout.scale);
  for (const float x : {start, end})
    draw.AddLine({x, at - 4 * layout.scale}, {x, at + 4 * layout.scale}, ink, 2 * layout.scale);
  const ImVec2 size = ImGui::CalcTextSize(bar.text.c_str());
  draw.AddText({(start + end - size.x) / 2, at - size.y - 4 * layout.scale}, ink, bar.text.c_str());
}

}  // namespace sinew::tools
