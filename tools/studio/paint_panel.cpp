// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/paint_panel.h"

#include <imgui.h>

#include <cstdio>

namespace sinew::tools {

void PaintPanel::draw(Document& document, StudioState& state, Widgets& widgets) {
  if (document.evaluated() == nullptr || document.evaluated()->source == nullptr) {
    note("The source is being read ...");
    return;
  }
  const StudioSource& source = *document.evaluated()->source;
  heading("Mask");
  std::vector<std::string> names;
  for (const auto& mask : document.recipe().masks) names.push_back(mask.first);
  std::string name = state.painted;
  if (!names.empty() && widgets.combo("Paint on", name, names)) {
    state.painted = name;
    state.selected = Region{RegionKind::mask, name};
  }
  if (widgets.text("New mask", new_name_, "its name") && !new_name_.empty()) {
    state.painted = new_name_;
    state.selected = Region{RegionKind::mask, new_name_};
    document.say("paint on the surface: the first stroke makes " + new_name_);
    new_name_.clear();
  }
  if (state.painted.empty())
    note("Give a mask a name to begin.");
  else
    make(document, state, widgets);

  heading("Brush");
  const float half = ImGui::GetContentRegionAvail().x / 2;
  BrushSettings& brush = state.brush;
  std::size_t column = 0;
  for (const auto& [label, mode] : {std::pair{"Paint", StrokeMode::paint},
                                    {"Erase", StrokeMode::erase},
                                    {"Add", StrokeMode::add},
                                    {"Subtract", StrokeMode::subtract},
                                    {"Smooth", StrokeMode::smooth}}) {
    if (column++ % 2 == 1) ImGui::SameLine(half);
    if (widgets.radio(label, brush.mode == mode)) brush.mode = mode;
  }
  ImGui::SameLine(half);
  widgets.checkbox("Fill part", brush.fill);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("A click does all that is connected to the point.");
  const auto largest = float(source.mesh.diagonal);
  widgets.slider("Radius", brush.radius, largest * 1e-3F, largest / 2, "%.4f m", true);
  widgets.slider("Falloff", brush.falloff, 0, largest / 2, "%.4f m", true);
  widgets.slider("Strength", brush.strength, 0, 1, "%.2f", false);
  widgets.checkbox("Symmetric", brush.symmetric, source.plane.has_value());
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) {
    ImGui::SetTooltip(source.plane ? "Across the plane of symmetry that `mirror` finds"
                                   : "No plane of symmetry was found");
  }
  widgets.checkbox("Front faces only", brush.front_only);
  char text[64];
  std::snprintf(text, sizeof text, "Longest step of the last stroke: %.2f ms", state.brush_milliseconds);
  note(text);
}

// What can be made of the mask.
void PaintPanel::make(Document& document, StudioState& state, Widgets& widgets) {
  const std::string mask = state.painted;
  const Recipe& recipe = document.recipe();
  const bool there = recipe.mask(mask) != nullptr;
  const float half = (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x) / 2;
  const auto selection = nlohmann::ordered_json(mask).dump();
  if (widgets.button("Make a cluster", half, there)) {
    if (document.edit([&](RecipeEditor& editor) { editor.addCluster(mask, selection); }))
      state.selected = Region{RegionKind::cluster, mask};
  }
  ImGui::SameLine();
  if (widgets.button("Make pins", half, there)) {
    const std::string name = "hold." + mask;
    if (document.edit([&](RecipeEditor& editor) { editor.addPins(name, selection, "", ""); }))
      state.selected = Region{RegionKind::pins, name};
  }
}

}  // namespace sinew::tools
