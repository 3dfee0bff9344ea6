// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/scene_panel.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <string>
#include <tuple>
#include <vector>

#include "tools/core/text.h"
#include "tools/studio/shortcuts.h"

namespace sinew::tools {
namespace {

float share(int count) {
  return (ImGui::GetContentRegionAvail().x - float(count - 1) * ImGui::GetStyle().ItemSpacing.x) / float(count);
}

}  // namespace

void ScenePanel::draw(Widgets& widgets, Play& play) {
  choice(widgets, play);
  time(widgets, play);
  hand(widgets, play);
  colliders(widgets, play);
  settings(widgets, play);
}

void ScenePanel::choice(Widgets& widgets, Play& play) {
  heading("Scene");
  ImGui::SetNextItemWidth(-1);
  const SceneChoice scene = play.scene().options().scene;
  const bool open = ImGui::BeginCombo("##scene", scene.name().c_str());
  widgets.mark("Scene choice");
  if (!open) return;
  if (play.options().scene.script && widgets.selectable(play.options().scene.name(), scene.script != nullptr))
    play.start(play.options().scene);
  for (std::size_t k = 0; k < sceneNames().size(); ++k) {
    const SceneChoice other = static_cast<SceneKind>(k);
    if (widgets.selectable(std::string(sceneNames()[k]), scene == other)) play.start(other);
  }
  ImGui::EndCombo();
}

void ScenePanel::time(Widgets& widgets, Play& play) {
  const float quarter = share(4);
  if (widgets.button(play.playing ? "Pause" : "Play", quarter)) play.playing = !play.playing;
  tip(Command::play);
  ImGui::SameLine();
  if (widgets.button("Back", quarter, play.timeline().at() > 0)) play.stepBack();
  tip(Command::step_back);
  ImGui::SameLine();
  if (widgets.button("Step", quarter)) play.stepPaused();
  tip(Command::step);
  ImGui::SameLine();
  if (widgets.button("Reset", quarter)) play.restart();
  tip(Command::restart);
  const Timeline& timeline = play.timeline();
  auto at = float(play.scene().time());
  const auto first = float(timeline[0].state.time()), last = float(timeline[timeline.size() - 1].state.time());
  if (widgets.slider("Time", at, first, last > first ? last : first + 1e-3F, "%.2f s", false)) {
    std::size_t moment = 0;
    while (moment + 1 < timeline.size() && timeline[moment + 1].state.time() <= double(at)) ++moment;
    play.goTo(moment);
  }
  widgets.slider("Speed", play.settings.speed, 0.02F, 1, "%.2f x", true);
}

void ScenePanel::hand(Widgets& widgets, Play& play) {
  heading("Hand");
  std::size_t column = 0;
  for (const auto& [label, tool, command] : {std::tuple{"Pull", HandTool::pull, Command::pull},
                                             {"Push", HandTool::push, Command::push},
                                             {"Cut", HandTool::cut, Command::cut},
                                             {"Targets", HandTool::target, Command::target}}) {
    if (column > 0) ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    ++column;
    if (widgets.radio(label, play.hand == tool)) play.hand = tool;
    tip(command);
  }
  if (play.hand == HandTool::target && play.targets().empty())
    note("Nothing to move: pins hold in the scene rest, of a body that has some.");
  const float half = share(2);
  if (widgets.button("Lock", half, play.grabbed().has_value())) play.lock();
  tip(Command::lock);
  ImGui::SameLine();
  if (widgets.button("Let go", half)) play.releaseAll();
  tip(Command::let_go);
  if (!play.message().empty()) note(play.message());
}

void ScenePanel::colliders(Widgets& widgets, Play& play) {
  heading("Colliders");
  PlaySettings& settings = play.settings;
  bool changed = widgets.checkbox("Ground", settings.ground);
  if (settings.ground) {
    const float far = 2 * play.diagonal();
    changed |= widgets.slider("Height", settings.ground_height, -far, far, "%.3f m", false);
  }
  if (changed) play.applySettings();
  const float size = kSolidDiagonals * play.diagonal(), third = share(3);
  const auto add = [&](const char* label, const ColliderShape& shape) {
    if (widgets.button(label, third)) play.addSolid(shape);
  };
  add("+ Box", BoxShape{{size, size, size}});
  ImGui::SameLine();
  add("+ Sphere", SphereShape{size});
  ImGui::SameLine();
  add("+ Capsule", CapsuleShape{size / 2, size});
  for (std::size_t i = 0; i < play.placed().size(); ++i) {
    const bool is_selected = play.placed().selected == i;
    const std::string name = shapeName(play.placed()[i].shape) + " " + std::to_string(i + 1);
    if (widgets.selectable(name, is_selected)) play.selectSolid(is_selected ? std::nullopt : std::optional(i));
  }
  if (play.placed().selected) selected(widgets, play, *play.placed().selected);
}

void ScenePanel::selected(Widgets& widgets, Play& play, std::size_t i) {
  PlacedSolid solid = play.placed()[i];
  const float most = 2 * play.diagonal(), least = 1e-3F * play.diagonal();
  const auto length = [&](const char* label, float& value) {
    return widgets.slider(label, value, least, most, "%.4f m", true);
  };
  bool changed = false;
  if (auto* sphere = std::get_if<SphereShape>(&solid.shape)) {
    changed |= length("Radius##of the collider", sphere->radius);
  } else if (auto* capsule = std::get_if<CapsuleShape>(&solid.shape)) {
    changed |= length("Radius##of the collider", capsule->radius);
    changed |= length("Half length", capsule->half_length);
  } else if (auto* box = std::get_if<BoxShape>(&solid.shape)) {
    changed |= length("Half x", box->half_size[0]);
    changed |= length("Half y", box->half_size[1]);
    changed |= length("Half z", box->half_size[2]);
  }
  changed |= widgets.slider("Friction##of the collider", solid.settings.friction, 0, 2, "%.2f", false);
  changed |= widgets.slider("Bounce", solid.settings.restitution, 0, 1, "%.2f", false);
  if (changed) play.changeSolid(i, solid, false);
  if (widgets.button("Remove the collider")) play.removeSolid(i);
}

bool ScenePanel::step(Widgets& widgets, float& seconds) {
  static constexpr std::array kRates = {30, 60, 120, 240};
  std::vector<std::string> choices;
  std::string chosen = rounded(double(seconds), 4) + " s";  // of a scene from a file
  for (const int rate : kRates) {
    choices.push_back("1/" + std::to_string(rate) + " s");
    if (float(1.0 / rate) == seconds) chosen = choices.back();
  }
  if (!widgets.combo("Step##length", chosen, choices)) return false;
  const auto at = std::find(choices.begin(), choices.end(), chosen);
  seconds = float(1.0 / kRates[std::size_t(at - choices.begin())]);
  return true;
}

void ScenePanel::settings(Widgets& widgets, Play& play) {
  heading("Settings");
  PlaySettings& settings = play.settings;
  bool changed = widgets.slider("Gravity", settings.gravity, 0, 3, "%.2f x", false);
  changed |= step(widgets, settings.step_seconds);
  changed |= widgets.whole("Iterations", settings.iterations, 1, 16);
  changed |= widgets.slider("Air damping", settings.damping, 0, 10, "%.2f /s", true);
  changed |= widgets.slider("Friction##inner", settings.deformation_damping, 0, 1, "%.2f", false);
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("Inner friction, of critical damping");
  if (changed) play.applySettings();
  widgets.slider("Stiffness", settings.stiffness, 0.05F, 20, "%.2f x", true);
  if (widgets.wasLeft()) play.restart();
}

}  // namespace sinew::tools
