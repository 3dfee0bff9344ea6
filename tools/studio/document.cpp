// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/document.h"

#include <fstream>
#include <sstream>
#include <utility>

#include "tools/core/atomic_file.h"
#include "tools/core/error.h"
#include "tools/import/output_files.h"

namespace sinew::tools {
namespace {

namespace fs = std::filesystem;

constexpr double kWatchSeconds = 0.1;
// Edits in quick succession, as of a slider that is dragged, are baked so long after the last.
constexpr double kSettleSeconds = 0.1;

std::string bytesOf(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

}  // namespace

Document::Document(const fs::path& recipe)
    : editor_(RecipeEditor::open(recipe)),
      recipe_(parseRecipe(editor_.text(), recipe)),
      on_disk_(editor_.text()),
      recipe_version_(FileVersion::of(recipe)),
      source_version_(FileVersion::of(recipe_.source)) {
  refresh();
}

void Document::refresh() {
  recipe_ = parseRecipe(editor_.text(), editor_.file());
  evaluation_.submit(editor_.file(), editor_.text());
  bake_at_ = seconds_ - edited_ < kSettleSeconds ? seconds_ + kSettleSeconds : seconds_;
  edited_ = seconds_;
}

void Document::accept(RecipeEditor editor) {
  editor_ = std::move(editor);
  on_disk_ = editor_.text();
  recipe_version_ = FileVersion::of(editor_.file());
  refresh();
}

bool Document::save(RecipeEditor editor, const std::string& done) {
  if (bytesOf(editor_.file()) != on_disk_) {
    pending_ = std::move(editor);
    return false;
  }
  editor.save();
  accept(std::move(editor));
  say(done);
  return true;
}

bool Document::edit(const std::function<void(RecipeEditor&)>& commands) {
  if (isInConflict()) return false;
  try {
    RecipeEditor editor = editor_;
    commands(editor);
    if (editor.text() == editor_.text()) return true;
    const Recipe after = parseRecipe(editor.text(), editor.file());
    if (evaluated_ != nullptr && evaluated_->source != nullptr && !newSelections(recipe_, after).empty()) {
      const StudioSource& source = *evaluated_->source;
      checkNewSelections(recipe_, after, source.mesh, source.topology, source.cluster_meshes);
    }
    const std::string done = editor.history()[editor.position()];
    return save(std::move(editor), done);
  } catch (const std::exception& error) {
    say(error.what(), true);
    return false;
  }
}

bool Document::stroke(const std::string& mask, const Stroke& stroke, VisualWeights weights) {
  if (isInConflict()) return false;
  try {
    RecipeEditor editor = editor_;
    addStrokes(editor, mask, {&stroke, 1});
    if (!save(std::move(editor), "stroke " + mask)) return false;
    if (evaluated_ == nullptr) return true;
    Evaluated shown = *evaluated_;
    std::size_t m = 0;
    while (m < shown.recipe.masks.size() && shown.recipe.masks[m].first != mask) ++m;
    if (m == shown.recipe.masks.size()) shown.recipe.masks.emplace_back(mask, SelectionText{});
    shown.weights.masks.resize(shown.recipe.masks.size());
    shown.weights.masks[m] = std::move(weights);
    evaluated_ = std::make_shared<const Evaluated>(std::move(shown));
    return true;
  } catch (const std::exception& error) {
    say(error.what(), true);
    return false;
  }
}

bool Document::undo() {
  try {
    RecipeEditor editor = editor_;
    const std::string command = editor.undo();
    if (command.empty()) {
      say("there is nothing to undo");
      return false;
    }
    return save(std::move(editor), "undid: " + command);
  } catch (const std::exception& error) {
    say(error.what(), true);
    return false;
  }
}

bool Document::redo() {
  try {
    RecipeEditor editor = editor_;
    const std::string command = editor.redo();
    if (command.empty()) {
      say("there is nothing to do again");
      return false;
    }
    return save(std::move(editor), "did again: " + command);
  } catch (const std::exception& error) {
    say(error.what(), true);
    return false;
  }
}

void Document::takeTheirs() {
  pending_.reset();
  reload();
}

void Document::keepMine() {
  const RecipeEditor mine = *pending_;
  const fs::path file = editor_.file();
  try {
    std::optional<RecipeEditor> editor;
    try {
      // Theirs becomes a step of the history, and mine one after it.
      editor.emplace(RecipeEditor::open(file));
      editor->replace("kept in the studio: " + mine.history()[mine.position()], mine.document());
      say("written over what another program had changed; undo brings that back");
    } catch (const ToolError&) {
      // No recipe any more: it is put aside.
      const fs::path theirs = fs::path(file).concat(".theirs");
      writeFileAtomically(theirs, bytesOf(file));
      editor.emplace(mine);
      say("written over what another program had left, which cannot be read: that is in " + theirs.string());
    }
    editor->save();
    pending_.reset();
    accept(std::move(*editor));
  } catch (const std::exception& error) {
    say(error.what(), true);
  }
}

void Document::reload() {
  const fs::path file = editor_.file();
  recipe_version_ = FileVersion::of(file);
  const std::string text = bytesOf(file);
  if (text == on_disk_) return;
  try {
    RecipeEditor editor = RecipeEditor::open(file);
    editor_ = std::move(editor);
    on_disk_ = text;
    refresh();
    say("the recipe changed on the disk: taken over");
  } catch (const std::exception& error) {
    // Half written, or wrong: what is shown goes on, and the next edit will ask.
    say(std::string("the recipe changed on the disk and cannot be read: ") + error.what(), true);
  }
}

void Document::bakeNow() {
  baked_text_ = editor_.text();
  source_changed_ = false;
  bake_at_ = kNever;
  bake_.start(editor_.file());
}

void Document::poll(double seconds) {
  seconds_ = seconds;
  bake_.poll();
  if (bake_.state() == BakeJob::State::failed && failed_text_ != baked_text_) {
    failed_text_ = baked_text_;
    say(bake_.error(), true);
  }
  if (auto result = evaluation_.poll()) {
    if (!result->error.empty() && result->text == editor_.text()) say(result->error, true);
    if (result->source == nullptr && evaluated_ != nullptr) {
      Evaluated kept = *result;
      kept.source = evaluated_->source;
      result = std::make_shared<const Evaluated>(std::move(kept));
    }
    evaluated_ = std::move(result);
    ++evaluations_;
  }
  if (bakes_by_itself && seconds >= bake_at_ && (baked_text_ != editor_.text() || source_changed_)) {
    bakeNow();
  }
  if (seconds - watched_ < kWatchSeconds) return;
  watched_ = seconds;
  if (!isInConflict() && FileVersion::of(editor_.file()) != recipe_version_) reload();
  if (const FileVersion version = FileVersion::of(recipe_.source); version != source_version_) {
    source_version_ = version;
    if (version == FileVersion{}) return;  // being replaced: the next look finds it
    source_changed_ = true;
    refresh();
    say(recipe_.source.filename().string() + " changed on the disk: read again");
  }
}

void Document::savePackage(const fs::path& file) const {
  if (bake_.asset() == nullptr)
    throw ToolError(ExitCode::usage, file.string(), "there is no package yet", "Wait until the bake is done.");
  if (bake_.isDraft()) {
    throw ToolError(ExitCode::usage, file.string(), "what plays is a draft", "Wait until the whole bake is done.");
  }
  requireOutput(Output::package, file, {editor_.file(), recipe_.source});
  writeFileAtomically(file, bytesOf(bake_.package()));
}

}  // namespace sinew::tools
