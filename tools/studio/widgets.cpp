// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/widgets.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>

namespace sinew::tools {
namespace {

constexpr std::size_t kMostText = 128;

constexpr float kLabelWidth = 5.6F;  // of the text's size
constexpr float kValueWidth = 5.4F;  // the same

std::string shownName(const std::string& label) { return label.substr(0, label.find("##")); }
std::string fullName(const std::string& label) {
  const std::size_t at = label.find("##");
  return at == std::string::npos ? label : label.substr(0, at) + " " + label.substr(at + 2);
}

// The label at the left; the next item fills the rest of the line.
std::string beside(const std::string& label) {
  ImGui::AlignTextToFramePadding();
  ImGui::TextDisabled("%s", shownName(label).c_str());
  ImGui::SameLine(ImGui::GetFontSize() * kLabelWidth);
  ImGui::SetNextItemWidth(-1);
  return "##" + fullName(label);
}

}  // namespace

void Widgets::beginFrame() { boxes_.clear(); }

void Widgets::mark(const std::string& name) {
  const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
  const float top = ImGui::GetWindowPos().y;
  const float bottom = top + ImGui::GetWindowSize().y;
  const int scroll = high.y > bottom ? 1 : low.y < top ? -1 : 0;
  const float lowest = std::min(bottom, ImGui::GetIO().DisplaySize.y);
  boxes_[fullName(name)] = {low.x, low.y, high.x, high.y, scroll, ImGui::GetWindowPos().x + 20, lowest - 8};
}

std::optional<Widgets::Box> Widgets::find(const std::string& name) const {
  const auto found = boxes_.find(name);
  return found == boxes_.end() ? std::nullopt : std::optional(found->second);
}

bool Widgets::button(const std::string& label, float width, bool enabled) {
  ImGui::BeginDisabled(!enabled);
  const bool pressed = ImGui::Button(label.c_str(), {width, 0});
  ImGui::EndDisabled();
  mark(label);
  return pressed;
}

bool Widgets::checkbox(const std::string& label, bool& value, bool enabled) {
  ImGui::BeginDisabled(!enabled);
  const bool changed = ImGui::Checkbox(label.c_str(), &value);
  ImGui::EndDisabled();
  mark(label);
  return changed;
}

bool Widgets::radio(const std::string& label, bool active) {
  const bool pressed = ImGui::RadioButton(label.c_str(), active);
  mark(label);
  return pressed;
}

bool Widgets::selectable(const std::string& label, bool selected) {
  const bool pressed = ImGui::Selectable(label.c_str(), selected);
  mark(label);
  return pressed;
}

bool Widgets::slider(const std::string& label, float& value, float low, float high, const char* format,
                     bool logarithmic) {
  const std::string id = beside(label);
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), format, double(value));
  // The value stands beside the slider: on it the grab would cover it.
  const float room = ImGui::GetFontSize() * kValueWidth;
  ImGui::SetNextItemWidth(-room);
  const ImGuiSliderFlags flags = ImGuiSliderFlags_AlwaysClamp | (logarithmic ? ImGuiSliderFlags_Logarithmic : 0);
  const bool changed = ImGui::SliderFloat(id.c_str(), &value, low, high, "", flags);
  mark(label);
  was_left_ = ImGui::IsItemDeactivatedAfterEdit();
  is_held_ = ImGui::IsItemActive();
  ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  ImGui::TextUnformatted(text.data());
  return changed;
}

bool Widgets::whole(const std::string& label, int& value, int low, int high) {
  auto real = float(value);
  const bool changed = slider(label, real, float(low), float(high), "%.0f", false);
  value = int(real + 0.5F);
  return changed;
}

bool Widgets::text(const std::string& label, std::string& value, const char* hint) {
  std::array<char, kMostText> buffer{};
  value.copy(buffer.data(), buffer.size() - 1);
  const std::string id = beside(label);
  const bool entered =
      ImGui::InputTextWithHint(id.c_str(), hint, buffer.data(), buffer.size(), ImGuiInputTextFlags_EnterReturnsTrue);
  const bool left = ImGui::IsItemDeactivatedAfterEdit();
  mark(label);
  value = buffer.data();
  return entered || left;
}

bool Widgets::combo(const std::string& label, std::string& value, std::span<const std::string> choices) {
  bool changed = false;
  const std::string id = beside(label);
  const bool open = ImGui::BeginCombo(id.c_str(), value.c_str());
  mark(label);
  if (!open) return false;
  for (const std::string& choice : choices) {
    if (selectable(choice, choice == value)) {
      value = choice;
      changed = true;
    }
  }
  ImGui::EndCombo();
  return changed;
}

void heading(const char* text) {
  ImGui::Spacing();
  ImGui::TextDisabled("%s", text);
  ImGui::Separator();
}

void note(const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

}  // namespace sinew::tools
