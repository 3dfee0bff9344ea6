// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/path_dialog.h"

#include <imgui.h>

#include <exception>

namespace sinew::tools {

void PathDialog::open(const std::string& title, const std::string& verb, const std::string& path,
                      const std::function<void(const std::string&)>& use, const std::function<void(Widgets&)>& more) {
  title_ = title;
  verb_ = verb;
  path_ = path;
  error_.clear();
  use_ = use;
  more_ = more;
  is_open_ = true;
}

void PathDialog::draw(Widgets& widgets) {
  // Dear ImGui closes a modal window only from within.
  const bool is_shown = !title_.empty() && ImGui::IsPopupOpen(title_.c_str());
  if (!is_open_ && !is_shown) return;
  if (!is_shown) ImGui::OpenPopup(title_.c_str());
  ImGui::SetNextWindowPos(ImGui::GetMainViewport()->GetCenter(), ImGuiCond_Appearing, {0.5F, 0.5F});
  ImGui::SetNextWindowSize({ImGui::GetFontSize() * 34, 0});
  if (!ImGui::BeginPopupModal(title_.c_str(), nullptr, ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoResize)) return;
  if (is_open_) fill(widgets);
  if (!is_open_) ImGui::CloseCurrentPopup();
  ImGui::EndPopup();
}

void PathDialog::fill(Widgets& widgets) {
  widgets.text("File", path_);
  if (more_) more_(widgets);
  if (!error_.empty()) note(error_);
  const float width = ImGui::GetFontSize() * 9;
  if (widgets.button(verb_ + "##the file", width, !path_.empty())) {
    try {
      use_(path_);
      is_open_ = false;
    } catch (const std::exception& error) {
      error_ = error.what();
    }
  }
  ImGui::SameLine();
  if (widgets.button("Leave it", width) || ImGui::IsKeyPressed(ImGui::GetIO().KeyMap[ImGuiKey_Escape]))
    is_open_ = false;
}

}  // namespace sinew::tools
