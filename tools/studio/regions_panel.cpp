// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/regions_panel.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "tools/author/material_presets.h"
#include "tools/author/weights.h"
#include "tools/core/text.h"
#include "tools/render/draw_model.h"

namespace sinew::tools {
namespace {

constexpr float kListRows = 8;

float encoded(float linear) { return std::pow(std::clamp(linear, 0.0F, 1.0F), 1 / 2.2F); }
float decoded(float value) { return std::pow(value, 2.2F); }

// The source's vertex or face, as a place to look at.
std::optional<Eigen::Vector3d> placeOf(const Finding& finding, const VisualMesh& mesh) {
  if (finding.places.empty()) return std::nullopt;
  const std::uint32_t number = finding.places.front();
  if (finding.place_kind == "vertex") {
    const auto at = std::find(mesh.source_vertex.begin(), mesh.source_vertex.end(), number);
    if (at != mesh.source_vertex.end()) return mesh.positions[std::size_t(at - mesh.source_vertex.begin())];
  } else if (finding.place_kind == "face") {
    const auto at = std::find(mesh.triangle_face.begin(), mesh.triangle_face.end(), number);
    if (at != mesh.triangle_face.end())
      return mesh.positions[mesh.triangles[std::size_t(at - mesh.triangle_face.begin())][0]];
  }
  return std::nullopt;
}

}  // namespace

void RegionsPanel::draw(Document& document, StudioState& state, Widgets& widgets) {
  if (document.evaluated() == nullptr || document.evaluated()->source == nullptr) {
    note(document.evaluated() == nullptr ? "The source is being read ..." : document.evaluated()->error);
    return;
  }
  list(*document.evaluated(), state, widgets);
  coverage(document, state, widgets);
  if (state.selected) details(document, state, widgets);
  check(document, state, widgets);
}

void RegionsPanel::list(const Evaluated& evaluated, StudioState& state, Widgets& widgets) {
  const std::vector<Region> regions = regionsOf(evaluated);
  if (regions.empty()) {
    note("No regions yet. Paint one, pick a point, or write them: sinew author RECIPE add-clusters group");
    return;
  }
  ImGui::BeginChild("##regions", {0, kListRows * ImGui::GetFrameHeightWithSpacing()}, true);
  std::optional<RegionKind> kind;
  bool open = false;
  std::uint32_t number = 0;
  for (const Region& region : regions) {
    const auto color = state.colors.contains(region) ? state.colors[region] : distinctColor(number);
    ++number;
    if (region.kind != kind) {
      kind = region.kind;
      open = ImGui::CollapsingHeader(regionKindNames()[std::size_t(region.kind)], ImGuiTreeNodeFlags_DefaultOpen);
    }
    if (!open) continue;
    ImGui::PushID(static_cast<int>(number));
    float rgb[3] = {encoded(color[0]), encoded(color[1]), encoded(color[2])};
    if (ImGui::ColorEdit3("##color", rgb, ImGuiColorEditFlags_NoInputs | ImGuiColorEditFlags_NoLabel))
      state.colors[region] = {decoded(rgb[0]), decoded(rgb[1]), decoded(rgb[2])};
    ImGui::SameLine();
    bool shown = !state.hidden.contains(region);
    ImGui::BeginDisabled(region.kind == RegionKind::mask);
    if (ImGui::Checkbox("##shown", &shown)) {
      if (shown)
        state.hidden.erase(region);
      else
        state.hidden.insert(region);
    }
    ImGui::EndDisabled();
    if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) {
      ImGui::SetTooltip(region.kind == RegionKind::mask ? "Masks show when they are selected."
                                                        : "Shown among all regions");
    }
    ImGui::SameLine();
    if (ImGui::Selectable(region.name.c_str(), state.selected == region)) {
      state.selected = region;
      state.show = Show::selected;
    }
    widgets.mark(std::string("region ") + region.name);
    ImGui::PopID();
  }
  ImGui::EndChild();
}

void RegionsPanel::coverage(const Document& document, StudioState& state, Widgets& widgets) {
  heading("Colours of the surface");
  const auto choose = [&](const char* label, Show show) {
    if (widgets.radio(label, state.show == show)) state.show = show;
  };
  const float half = ImGui::GetContentRegionAvail().x / 2;
  choose("All regions", Show::all);
  ImGui::SameLine(half);
  choose("Selected", Show::selected);
  choose("In no cluster", Show::uncovered);
  ImGui::SameLine(half);
  choose("In several", Show::several);
  choose("The model's own", Show::model);
  if (document.evaluated()->weights.clusters.empty()) return;
  const Coverage counts = coverageOf(*document.evaluated());
  note(counted(counts.none, "vertex", "vertices") + " in no cluster, " + std::to_string(counts.several) +
       " in several");
}

void RegionsPanel::details(Document& document, StudioState& state, Widgets& widgets) {
  const Region region = *state.selected;
  const VisualWeights* weights = weightsOf(*document.evaluated(), region);
  if (weights == nullptr) return;
  heading("Selected");
  const auto touched = std::size_t(std::count_if(weights->begin(), weights->end(), [](double w) { return w > 0; }));
  note(region.name + ": " + counted(touched, "vertex", "vertices"));
  if (region.kind == RegionKind::stiffness || region.kind == RegionKind::thickness) return;
  if (named_ != region) {
    named_ = region;
    name_ = region.name;
  }
  if (widgets.text("Name", name_) && name_ != region.name) {
    const std::string to = name_;
    if (document.edit([&](RecipeEditor& editor) { editor.rename(region.name, to); })) {
      state.selected = Region{region.kind, to};
      if (state.painted == region.name) state.painted = to;
      return;
    }
  }
  if (region.kind == RegionKind::cluster) material(document, region.name, widgets);
  const float third = (ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().ItemSpacing.x) / 3;
  const bool is_solo = state.solo == region;
  if (widgets.button(is_solo ? "Not solo" : "Solo", third)) {
    state.solo = is_solo ? std::nullopt : std::optional(region);
    state.show = Show::all;
  }
  ImGui::SameLine();
  const bool mirrors = region.kind == RegionKind::cluster || region.kind == RegionKind::mask;
  if (widgets.button("Mirror", third, mirrors && otherSide(region.name) != region.name)) {
    const auto source = document.evaluated()->source;
    document.edit([&](RecipeEditor& editor) {
      editor.mirror(region.name, "", "auto",
                    [&] { return source->plane ? source->plane->normal : Eigen::Vector3d(Eigen::Vector3d::UnitX()); });
    });
  }
  ImGui::SameLine();
  if (widgets.button("Remove", third)) {
    if (document.edit([&](RecipeEditor& editor) { editor.remove(region.name); })) {
      state.selected.reset();
      if (state.show == Show::selected) state.show = Show::all;
      if (state.solo == region) state.solo.reset();
      return;
    }
  }
  order(document, region, widgets);
}

void RegionsPanel::order(Document& document, const Region& region, Widgets& widgets) {
  const Recipe& recipe = document.recipe();
  std::vector<std::string> names;
  const auto take = [&](const auto& list) {
    for (const auto& entry : list) names.push_back(entry.name);
  };
  std::string list;
  if (region.kind == RegionKind::cluster) {
    take(recipe.clusters);
    list = "clusters";
  } else if (region.kind == RegionKind::pins) {
    take(recipe.pins);
    list = "pins";
  } else if (region.kind == RegionKind::part) {
    take(recipe.parts);
    list = "parts";
  } else {
    for (const auto& mask : recipe.masks) names.push_back(mask.first);
    list = "masks";
  }
  // A region of a source's cluster mesh alone is in no list.
  const auto at = std::find(names.begin(), names.end(), region.name);
  const float half = (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x) / 2;
  const auto button = [&](const char* label, int by, bool possible) {
    if (widgets.button(label, half, possible))
      document.edit([&](RecipeEditor& editor) { editor.move(region.name, by, list); });
  };
  button("Up", -1, at != names.end() && at != names.begin());
  ImGui::SameLine();
  button("Down", 1, at != names.end() && at + 1 != names.end());
}

void RegionsPanel::material(Document& document, const std::string& cluster, Widgets& widgets) {
  const auto& clusters = document.recipe().clusters;
  const auto own = std::find_if(clusters.begin(), clusters.end(), [&](const auto& c) { return c.name == cluster; });
  if (own == clusters.end()) {
    note("A cluster mesh of the source: name it in the recipe to give it a material.");
    return;
  }
  const ClusterOptions options = optionsOf(*own, document.recipe().settings);
  std::vector<std::string> materials;
  for (const MaterialPreset& preset : materialPresets()) materials.emplace_back(preset.name);
  std::string material(materialPresetOf(options));
  if (material.empty()) material = "its own";
  if (widgets.combo("Material", material, materials))
    document.edit([&](RecipeEditor& editor) { editor.set("clusters." + cluster + ".material", material); });
  const std::vector<std::string> modes = choicesOf("clusters.mode");
  std::string mode = modes[std::size_t(options.mode)];
  if (widgets.combo("Mode", mode, modes))
    document.edit([&](RecipeEditor& editor) { editor.set("clusters." + cluster + ".mode", mode); });
  // The frequency that counts; the other ones keep their proportions to it.
  const std::array<std::pair<const char*, double>, 3> frequencies = {
      {{"stretch_hz", options.stretch_hz}, {"bend_hz", options.bend_hz}, {"twist_hz", options.twist_hz}}};
  const double counts = options.mode == formats::ClusterMode::quadratic
                            ? std::min({options.stretch_hz, options.bend_hz, options.twist_hz})
                            : options.stretch_hz;
  if (!rings_at_held_) rings_at_ = float(counts);
  widgets.slider("Rings at", rings_at_, 0.5F, 200, "%.1f Hz", true);
  rings_at_held_ = widgets.isHeld();
  if (widgets.wasLeft()) {
    std::vector<std::pair<std::string, std::string>> values;
    std::string command = "set";
    for (const auto& [key, value] : frequencies) {
      values.emplace_back("clusters." + cluster + "." + key,
                          exactText(sevenDigits(value / counts * double(rings_at_))));
      command += " " + values.back().first + "=" + values.back().second;
    }
    document.edit([&](RecipeEditor& editor) { editor.setTogether(values, command); });
  }
  if (!own->channel.empty()) note("Channel " + own->channel + ", contraction " + rounded(own->contraction));
}

void RegionsPanel::check(const Document& document, StudioState& state, Widgets& widgets) {
  heading("Check");
  std::vector<const Finding*> findings;
  const auto take = [&](const std::vector<Finding>& more) {
    for (const Finding& finding : more) {
      const bool known = std::any_of(findings.begin(), findings.end(), [&](const Finding* f) {
        return f->id == finding.id && f->message == finding.message;
      });
      if (!known && finding.severity != Severity::info) findings.push_back(&finding);
    }
  };
  const Evaluated& evaluated = *document.evaluated();
  take(evaluated.source->findings);
  take(evaluated.findings);
  if (document.isBaked()) take(document.bake().findings());
  if (findings.empty()) note("Nothing found.");
  for (std::size_t i = 0; i < findings.size(); ++i) {
    const Finding& finding = *findings[i];
    const ImVec4 color =
        finding.severity == Severity::error ? ImVec4(1.0F, 0.45F, 0.35F, 1) : ImVec4(0.95F, 0.75F, 0.35F, 1);
    ImGui::PushID(static_cast<int>(i));
    ImGui::PushStyleColor(ImGuiCol_Text, color);
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(finding.message.c_str());
    ImGui::PopTextWrapPos();
    ImGui::PopStyleColor();
    if (ImGui::IsItemHovered()) {
      ImGui::BeginTooltip();
      ImGui::PushTextWrapPos(ImGui::GetFontSize() * 30);
      ImGui::TextUnformatted(finding.cure.c_str());
      ImGui::PopTextWrapPos();
      ImGui::EndTooltip();
    }
    if (const auto place = placeOf(finding, evaluated.source->mesh)) {
      if (ImGui::SmallButton("Go there")) state.fly_to = place;
      widgets.mark("go to " + finding.id);
    }
    ImGui::PopID();
  }
}

}  // namespace sinew::tools
