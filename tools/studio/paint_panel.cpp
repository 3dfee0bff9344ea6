// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/paint_panel.h"

#include <imgui.h>

#include <cstdio>

#include "tools/studio/paint_tool.h"

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
  const auto shape = [&](const char* label, BrushShape which, const char* what) {
    if (widgets.radio(label, brush.shape == which)) brush.shape = which;
    if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", what);
  };
  shape("Surface", BrushShape::surface, "Radius and falloff are measured along the surface");
  ImGui::SameLine(half * 0.75F);
  shape("Screen", BrushShape::screen, "Radius and falloff are what is seen: no fold is in the way");
  ImGui::SameLine(half * 1.4F);
  shape("Lasso", BrushShape::lasso, "Drag a loop around what is to be painted");
  ImGui::Separator();
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
  widgets.checkbox("Fill part", brush.fill, brush.shape == BrushShape::surface);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("A click does all that is connected to the point.");
  const auto largest = float(source.mesh.diagonal);
  if (brush.shape != BrushShape::lasso)
    widgets.slider("Radius", brush.radius, largest * 1e-3F, largest / 2, "%.4f m", true);
  widgets.slider("Falloff", brush.falloff, 0, largest / 2, "%.4f m", true);
  widgets.slider("Strength", brush.strength, 0, 1, "%.2f", false);
  widgets.checkbox("Symmetric", brush.symmetric, source.plane.has_value());
  if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) {
    ImGui::SetTooltip(source.plane ? "Across the plane of symmetry that `mirror` finds"
                                   : "No plane of symmetry was found");
  }
  widgets.checkbox("Front faces only", brush.front_only);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("What turns away stays; of Screen and Lasso, what is hidden stays too");
  char text[64];
  std::snprintf(text, sizeof text, "Longest step of the last stroke: %.2f ms", state.brush_milliseconds);
  note(text);
  if (!state.painted.empty()) edge(document, state, widgets);
}

// All of the mask, without a brush.
void PaintPanel::edge(Document& document, StudioState& state, Widgets& widgets) {
  heading("Edge of the mask");
  const StudioSource& source = *document.evaluated()->source;
  const auto largest = float(source.mesh.diagonal);
  widgets.slider("By", state.brush.by, largest * 1e-3F, largest / 10, "%.4f m", true);
  const float half = (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x) / 2;
  const bool there = document.recipe().mask(state.painted) != nullptr;
  const auto move = [&](const char* label, StrokeMode mode) {
    if (!widgets.button(label, half, there)) return;
    Stroke stroke;
    stroke.mode = mode;
    stroke.radius = sevenDigits(double(state.brush.by));
    stroke.falloff = sevenDigits(double(state.brush.falloff));
    layStroke(document, state.painted, stroke);
  };
  move("Grow", StrokeMode::grow);
  ImGui::SameLine();
  move("Shrink", StrokeMode::shrink);
}

// Buttons to use the mask.
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
