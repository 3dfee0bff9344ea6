// SPDX-License-Identifier: GPL-3.0-or-later
//
// The studio's document: a recipe, its history, what it says on its source, and the body baked of it. No window in it.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tools/author/recipe.h"
#include "tools/author/recipe_commands.h"
#include "tools/author/recipe_strokes.h"
#include "tools/studio/bake_job.h"
#include "tools/studio/evaluation.h"

namespace sinew::tools {

/// Every edit is a command of RecipeEditor and is on the disk when it returns, with the history: `sinew author` sees
/// the same, and a process that is killed loses nothing. The recipe and its source are watched: what others change is
/// taken over, and never overwritten without being asked.
class Document {
 public:
  /// Opens a recipe. Throws ToolError.
  explicit Document(const std::filesystem::path& recipe);

  /// Runs commands as one edit and saves. Their error becomes message(), and nothing is changed; so does a
  /// selection that selects nothing. \return whether it was done
  bool edit(const std::function<void(RecipeEditor&)>& commands);
  bool undo();
  bool redo();
  /// Adds a brush stroke to a mask. \param weights what it makes of the mask, by visual vertex: shown until evaluated
  bool stroke(const std::string& mask, const Stroke& stroke, VisualWeights weights);

  /// Takes what threads, processes and other programs have done. To be called once a frame. \param seconds s, since
  /// any start: the clock of the watch
  void poll(double seconds);

  const RecipeEditor& editor() const { return editor_; }
  const Recipe& recipe() const { return recipe_; }
  /// Null before the source is read; that of an older text while the newest is evaluated.
  const std::shared_ptr<const Evaluated>& evaluated() const { return evaluated_; }
  bool isCurrent() const { return evaluated_ != nullptr && evaluated_->text == editor_.text(); }
  std::uint32_t evaluations() const { return evaluations_; }  ///< how many have come

  BakeJob& bake() { return bake_; }
  const BakeJob& bake() const { return bake_; }
  bool isBaked() const { return baked_text_ == editor_.text() && bake_.state() == BakeJob::State::done; }
  bool bakes_by_itself = true;  ///< after each edit
  void bakeNow();
  /// Writes the last package. Throws ToolError.
  void savePackage(const std::filesystem::path& file) const;

  /// The last failure or news; empty: none.
  const std::string& message() const { return message_; }
  bool isTrouble() const { return is_trouble_; }  ///< of the message
  void say(const std::string& text, bool trouble = false) { message_ = text, is_trouble_ = trouble; }

  /// Another program has changed the recipe while this one has an edit that is not saved. takeTheirs() drops it (it
  /// stays in the history), keepMine() writes over theirs (theirs stays in the history).
  bool isInConflict() const { return pending_.has_value(); }
  void takeTheirs();
  void keepMine();

 private:
  bool save(RecipeEditor editor, const std::string& done);
  void accept(RecipeEditor editor);
  void reload();
  void refresh();

  RecipeEditor editor_;
  Recipe recipe_;
  std::string on_disk_;  // the recipe's text as this program last wrote or read it
  FileVersion recipe_version_, source_version_;
  std::optional<RecipeEditor> pending_;
  Evaluation evaluation_;
  std::shared_ptr<const Evaluated> evaluated_;
  std::uint32_t evaluations_ = 0;
  BakeJob bake_;
  std::string baked_text_, failed_text_;
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  double watched_ = 0, edited_ = -kNever, bake_at_ = kNever, seconds_ = 0;
  bool source_changed_ = false;
  std::string message_;
  bool is_trouble_ = false;
};

}  // namespace sinew::tools
