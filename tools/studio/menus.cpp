// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/menus.h"

#include <imgui.h>

#include <string>

namespace sinew::tools {
namespace {

void row(const std::string& left, const std::string& right) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(left.c_str());
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(right.c_str());
}

void menuHeading(const std::string& text) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextDisabled("%s", text.c_str());
}

}  // namespace

void Menus::draw(bool has_document, bool is_source, Widgets& widgets, Navigation& navigation, Commands& commands) {
  if (!ImGui::BeginMenuBar()) return;
  const auto all = shortcuts();
  for (std::size_t i = 0; i < all.size();) {
    const std::string menu = all[i].menu;
    const bool open = ImGui::BeginMenu(menu.c_str());
    widgets.mark("menu " + menu);
    const char* last = "";
    for (; i < all.size() && menu == all[i].menu; ++i) {
      if (!open) continue;
      const bool possible = isPossible(all[i], has_document, is_source);
      const bool again = i > 0 && all[i - 1].command == all[i].command;  // another key of the same
      last = all[i].name;
      if (again || all[i].command == Command::scene) continue;
      if (ImGui::MenuItem(last, keysText(all[i]).c_str(), false, possible)) commands.push_back(all[i].command);
      widgets.mark(last);
    }
    if (open && menu == "Look") {
      ImGui::Separator();
      for (const Navigation one : {Navigation::usual, Navigation::blender, Navigation::maya}) {
        const std::string name = "Mouse as in " + std::string(navigationNames()[std::size_t(one)]);
        if (ImGui::MenuItem(name.c_str(), "", navigation == one)) navigation = one;
        widgets.mark(name);
      }
    }
    if (open) ImGui::EndMenu();
  }
  ImGui::EndMenuBar();
}

void Menus::drawHelpPage(Navigation navigation, Widgets& widgets) {
  if (!help_) return;
  const ImGuiViewport& screen = *ImGui::GetMainViewport();
  ImGui::SetNextWindowPos(screen.GetCenter(), ImGuiCond_Always, {0.5F, 0.5F});
  ImGui::SetNextWindowSizeConstraints({0, 0}, {screen.Size.x * 0.96F, screen.Size.y * 0.96F});
  const ImGuiWindowFlags flags = ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove |
                                 ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings;
  if (ImGui::Begin("Keys and mouse", &help_, flags)) {
    // Two tables side by side: one column would be higher than a window.
    const auto all = shortcuts();
    ImGui::BeginGroup();
    if (ImGui::BeginTable("##keys", 2, ImGuiTableFlags_SizingFixedFit)) {
      std::string menu;
      for (const Shortcut& shortcut : all) {
        if (std::string(shortcut.menu) == "Look") break;
        if (menu != shortcut.menu) menuHeading(menu = shortcut.menu);
        row(shortcut.name, keysText(shortcut));
      }
      ImGui::EndTable();
    }
    ImGui::EndGroup();
    ImGui::SameLine(0, ImGui::GetFontSize() * 2);
    ImGui::BeginGroup();
    if (ImGui::BeginTable("##more", 2, ImGuiTableFlags_SizingFixedFit)) {
      std::string menu;
      bool rest = false;
      for (const Shortcut& shortcut : all) {
        rest = rest || std::string(shortcut.menu) == "Look";
        if (!rest) continue;
        if (menu != shortcut.menu) menuHeading(menu = shortcut.menu);
        row(shortcut.name, keysText(shortcut));
      }
      menuHeading("Mouse, as in " + std::string(navigationNames()[std::size_t(navigation)]));
      for (const auto& [what, how] : navigationHelp(navigation)) row(what, how);
      ImGui::EndTable();
    }
    ImGui::EndGroup();
    widgets.button("Close##help", ImGui::GetFontSize() * 8) ? help_ = false : true;
  }
  ImGui::End();
}

}  // namespace sinew::tools
