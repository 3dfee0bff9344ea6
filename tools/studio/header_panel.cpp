// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/header_panel.h"

#include <imgui.h>

#include <cstdio>
#include <exception>
#include <filesystem>

#include "tools/studio/shortcuts.h"

namespace sinew::tools {

void HeaderPanel::draw(Document& document, Widgets& widgets) {
  const auto& file = document.editor().file();
  ImGui::TextUnformatted(file.filename().string().c_str());
  if (ImGui::IsItemHovered()) {
    ImGui::SetTooltip("%s, of %s\nEach edit is saved at once: sinew author %s undo takes it back too.",
                      file.string().c_str(), document.recipe().source.string().c_str(), file.string().c_str());
  }
  const float quarter = (ImGui::GetContentRegionAvail().x - 3 * ImGui::GetStyle().ItemSpacing.x) / 4;
  const auto history = document.editor().history();
  const std::size_t at = document.editor().position();
  if (widgets.button("Undo", quarter, at > 0)) document.undo();
  if (at > 0 && ImGui::IsItemHovered())
    ImGui::SetTooltip("%s: %s", nameWithKeys(Command::undo).c_str(), history[at].c_str());
  ImGui::SameLine();
  if (widgets.button("Redo", quarter, at + 1 < history.size())) document.redo();
  tip(Command::redo);
  ImGui::SameLine();
  const BakeJob::State state = document.bake().state();
  const bool running = state == BakeJob::State::running;
  if (widgets.button(running ? "Cancel" : "Bake", quarter, running || !document.isBaked())) {
    if (running)
      document.bake().cancel();
    else
      document.bakeNow();
  }
  ImGui::SameLine();
  if (widgets.button("Export", quarter, document.bake().asset() != nullptr && !document.bake().isDraft()))
    exportPackage(document);
  tip(Command::export_package);
  char text[128];
  if (running) {
    std::snprintf(text, sizeof text, "%s%s", document.bake().isDraft() ? "plays a draft; " : "",
                  document.bake().stage().c_str());
    ImGui::ProgressBar(document.bake().fraction(), {-1, ImGui::GetFrameHeight()}, text);
  } else {
    if (document.isBaked())
      std::snprintf(text, sizeof text, "Baked in %.1f s", document.bake().seconds());
    else
      std::snprintf(text, sizeof text, "%s", state == BakeJob::State::failed ? "The bake failed" : "Not baked yet");
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("%s", text);
  }
  // Room for two lines, whatever there is to say: nothing below moves under the mouse.
  ImGui::BeginChild("##message", {0, 2 * ImGui::GetTextLineHeight() + ImGui::GetStyle().ItemSpacing.y});
  const ImVec4 color = document.isTrouble() ? ImVec4(1.0F, 0.5F, 0.4F, 1) : ImVec4(0.6F, 0.8F, 0.65F, 1);
  ImGui::PushStyleColor(ImGuiCol_Text, color);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(document.message().c_str());
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
  ImGui::EndChild();
  if (!document.message().empty() && ImGui::IsItemHovered()) {
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(ImGui::GetFontSize() * 30);
    ImGui::TextUnformatted(document.message().c_str());
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
  }
}

void HeaderPanel::exportPackage(Document& document) {
  const auto target = std::filesystem::path(document.editor().file()).replace_extension(".sinew");
  try {
    document.savePackage(target);
    document.say("wrote " + target.string());
  } catch (const std::exception& error) {
    document.say(error.what(), true);
  }
}

void HeaderPanel::drawConflict(Document& document, Widgets& widgets) {
  const char* title = "The recipe changed on the disk";
  if (!document.isInConflict()) return;
  if (!ImGui::IsPopupOpen(title)) ImGui::OpenPopup(title);
  const ImVec2 middle = ImGui::GetMainViewport()->GetCenter();
  ImGui::SetNextWindowPos(middle, ImGuiCond_Appearing, {0.5F, 0.5F});
  if (!ImGui::BeginPopupModal(title, nullptr, ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoMove)) return;
  ImGui::TextUnformatted("Another program has saved it since it was read here, and you have just edited it too.");
  const float width = ImGui::GetFontSize() * 14;
  if (widgets.button("Take theirs", width)) {
    document.takeTheirs();
    ImGui::CloseCurrentPopup();
  }
  ImGui::SameLine();
  if (widgets.button("Keep mine", width)) {
    document.keepMine();
    ImGui::CloseCurrentPopup();
  }
  note("Either way the other stays in the history.");
  ImGui::EndPopup();
}

}  // namespace sinew::tools
