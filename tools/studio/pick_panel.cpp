// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/pick_panel.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "tools/author/json_text.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

// One region of each RegionKind.
constexpr std::array<const char*, 6> kKinds = {"cluster", "mask", "pins", "part", "stiffness", "thickness"};

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, 3> kShapes = {"Disc", "Sphere", "Half space"};

std::string pointText(const Eigen::Vector3d& p, int digits) {
  return rounded(p[0], digits) + ", " + rounded(p[1], digits) + ", " + rounded(p[2], digits);
}

void row(const char* what, const std::string& value) {
  ImGui::TextDisabled("%s", what);
  ImGui::SameLine(ImGui::GetFontSize() * 5);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(value.c_str());
  ImGui::PopTextWrapPos();
}

}  // namespace

Json selectionAt(const PickedPoint& point, int shape, double radius, double falloff) {
  Json json;
  const Json at = jsonOf(point.at.position);
  if (shape == 2) {
    json = {{"half_space", at}, {"normal", jsonOf(point.normal)}};
  } else {
    json = {{shape == 0 ? "disc" : "sphere", at}, {"radius", sevenDigits(radius)}};
  }
  if (falloff > 0) json["falloff"] = sevenDigits(falloff);
  return json;
}

void PickPanel::draw(Document& document, StudioState& state, Widgets& widgets) {
  if (document.evaluated() == nullptr || document.evaluated()->source == nullptr) {
    note("The source is being read ...");
    return;
  }
  if (!state.picked) {
    note("Click a point of the surface.");
  } else {
    describe(document, *state.picked, widgets);
    ruler(document, state, widgets);
    place(document, state, widgets);
  }
  muscle(document, state, widgets);
}

void PickPanel::describe(const Document& document, const PickedPoint& point, Widgets& widgets) {
  const Evaluated& evaluated = *document.evaluated();
  const VisualMesh& mesh = evaluated.source->mesh;
  if (point.vertex >= mesh.positions.size()) return;
  heading("Point");
  std::string all = pointText(point.at.position, 5);
  row("x y z", all + " m");
  row("vertex", std::to_string(mesh.source_vertex[point.vertex]) + " of the source");
  all += "\nvertex " + std::to_string(mesh.source_vertex[point.vertex]);
  const auto say = [&](const char* what, const std::string& value) {
    if (value.empty()) return;
    row(what, value);
    all += std::string("\n") + what + " " + value;
  };
  std::vector<std::string> names;
  for (const GroupSource& group : mesh.groups) {
    if (std::binary_search(group.vertices.begin(), group.vertices.end(), point.vertex)) names.push_back(group.name);
  }
  say("group", listed(names));
  for (const SubMeshSource& part : mesh.sub_meshes) {
    if (point.at.triangle - part.first_triangle < part.triangle_count && part.material < mesh.materials.size())
      say("material", mesh.materials[part.material].name);
  }
  names.clear();
  if (point.vertex < mesh.skin.size()) {
    for (const SkinInfluence& influence : mesh.skin[point.vertex])
      names.push_back(mesh.joints[influence.joint] + " " + rounded(double(influence.weight), 2));
  }
  say("bone", listed(names, 4));
  for (const Region& region : regionsOf(evaluated)) {
    const VisualWeights* weights = weightsOf(evaluated, region);
    if (weights == nullptr || !((*weights)[point.vertex] > 0)) continue;
    say(kKinds[std::size_t(region.kind)], region.name + " " + rounded((*weights)[point.vertex], 2));
  }
  if (widgets.button("Copy")) ImGui::SetClipboardText(all.c_str());
}

void PickPanel::ruler(const Document& document, StudioState& state, Widgets& widgets) {
  heading("Ruler");
  const Eigen::Vector3d& at = state.picked->at.position;
  const float half = (ImGui::GetContentRegionAvail().x - ImGui::GetStyle().ItemSpacing.x) / 2;
  if (widgets.button("Measure from here", half)) state.ruler_from = at;
  ImGui::SameLine();
  if (widgets.button("No ruler", half, state.ruler_from.has_value())) state.ruler_from.reset();
  if (!state.ruler_from) return;
  row("straight", lengthText((at - *state.ruler_from).norm()));
  // Along the surface only where it has changed: it takes milliseconds.
  if (ruler_ != std::pair(*state.ruler_from, at)) {
    ruler_ = {*state.ruler_from, at};
    const Surface& surface = *document.evaluated()->source->surface;
    const SurfacePoint from = surface.nearest(*state.ruler_from);
    const double along = surface.interpolate(state.picked->at, surface.distancesFrom({&from, 1}));
    along_ = std::isfinite(along) ? lengthText(along) : "no way leads there";
  }
  row("on surface", along_);
}

void PickPanel::place(Document& document, StudioState& state, Widgets& widgets) {
  heading("Make here");
  for (int k = 0; k < 3; ++k) {
    if (k > 0) ImGui::SameLine();
    if (widgets.radio(kShapes[std::size_t(k)], state.pick_shape == k)) state.pick_shape = k;
  }
  const auto largest = float(document.evaluated()->source->mesh.diagonal);
  if (state.pick_shape != 2)
    widgets.slider("Radius##of it", state.pick_radius, largest * 1e-3F, largest / 2, "%.4f m", true);
  widgets.slider("Falloff##of it", state.pick_falloff, 0, largest / 2, "%.4f m", true);
  widgets.text("Name##of it", state.pick_name, "cheek.L");
  const std::string selection =
      selectionAt(*state.picked, state.pick_shape, double(state.pick_radius), double(state.pick_falloff)).dump();
  const std::string name = state.pick_name;
  const float third = (ImGui::GetContentRegionAvail().x - 2 * ImGui::GetStyle().ItemSpacing.x) / 3;
  const auto make = [&](const char* label, RegionKind kind, const std::function<void(RecipeEditor&)>& command) {
    if (!widgets.button(label, third, !name.empty())) return;
    if (document.edit(command)) {
      state.selected = Region{kind, name};
      state.show = Show::selected;
    }
  };
  make("Mask", RegionKind::mask, [&](RecipeEditor& editor) { editor.setMask(name, selection); });
  ImGui::SameLine();
  make("Cluster", RegionKind::cluster, [&](RecipeEditor& editor) { editor.addCluster(name, selection); });
  ImGui::SameLine();
  make("Pins", RegionKind::pins, [&](RecipeEditor& editor) { editor.addPins(name, selection, "", ""); });
}

void PickPanel::muscle(Document& document, StudioState& state, Widgets& widgets) {
  heading("Muscle");
  const StudioSource& source = *document.evaluated()->source;
  const auto end = [&](const char* label, std::optional<Eigen::Vector3d>& point) {
    if (widgets.button(label, ImGui::GetContentRegionAvail().x * 0.45F, state.picked.has_value()))
      point = state.picked->at.position;
    ImGui::SameLine();
    ImGui::TextDisabled("%s", point ? pointText(*point, 3).c_str() : "the point picked");
  };
  end("Hangs here", state.muscle_from);
  end("Pulls here", state.muscle_to);
  widgets.slider("Width", state.muscle_width, float(source.mesh.diagonal) * 1e-3F, float(source.mesh.diagonal) / 4,
                 "%.4f m", true);
  widgets.checkbox("Mirror image too", state.muscle_mirror, source.plane.has_value());
  widgets.text("Name##of the muscle", state.muscle_name, "smile.L");
  const bool ready = state.muscle_from && state.muscle_to && !state.muscle_name.empty();
  if (!widgets.button("Make the muscle", -1, ready)) return;
  MuscleOptions options;
  options.name = state.muscle_name;
  options.width = double(state.muscle_width);
  options.mirror = state.muscle_mirror && source.plane.has_value();
  const Surface& surface = *source.surface;
  options.path = surface.path(surface.nearest(*state.muscle_from), surface.nearest(*state.muscle_to));
  if (document.edit([&](RecipeEditor& editor) { addMuscle(editor, options, [&] { return source.plane->normal; }); })) {
    state.selected = Region{RegionKind::cluster, options.name};
    state.show = Show::selected;
  }
}

}  // namespace sinew::tools
