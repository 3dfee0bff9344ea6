// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every edit of a recipe, as an undoable command. The program's `author` verb and windows run the same ones.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tools/author/json_text.h"
#include "tools/author/source_regions.h"

namespace sinew::tools {

/// A recipe that is being edited, with its history. A command changes the document in memory, which is validated as a
/// whole before it counts: one that would make the recipe wrong throws ToolError and changes nothing. Nothing reaches
/// the disk before save().
///
/// The history lies beside the recipe in RECIPE.history (JSON: the texts after each command, at most 200 of them); it
/// may be deleted at any time. A recipe that was changed by hand in between gets that change as a step of its own, so
/// undo goes back over it too.
class RecipeEditor {
 public:
  /// Begins a new recipe for a source. Throws ToolError(usage) where `file` exists, is no .json, or `source` is not
  /// there or outside the recipe's folder and all folders above it.
  static RecipeEditor create(const std::filesystem::path& file, const std::filesystem::path& source);
  /// Opens a recipe; one of an older version becomes one of the present version with the first command.
  static RecipeEditor open(const std::filesystem::path& file);
  /// Begins a recipe with the text of another one, and a history of its own. Throws ToolError(usage) where `file`
  /// exists or is no .json. The paths in it are not changed: replace() does that.
  static RecipeEditor copy(const std::filesystem::path& from, const std::filesystem::path& file);

  /// Adds a cluster. \param selection JSON, or a mask's name; empty: the cluster mesh of this name.
  void addCluster(const std::string& name, const std::string& selection);
  /// Adds a cluster for each region that the source names. \param kind of the regions, for the history.
  void addClusters(const std::string& kind, const std::vector<SourceRegion>& regions);
  /// Adds or replaces a mask.
  void setMask(const std::string& name, const std::string& selection);
  /// Adds a set of pins.
  void addPins(const std::string& name, const std::string& selection, const std::string& method,
               const std::string& target);
  /// Adds a factor. \param list "stiffness" or "thickness". \param value where the weight is 1.
  void addFactor(const std::string& list, const std::string& selection, double value);
  /// Adds loose parts that ride along. \param attach "rigid", "follow" or empty. \param to a name or selection, or
  /// empty.
  void addPart(const std::string& name, const std::string& selection, const std::string& attach, const std::string& to);
  /// A value that set() has changed.
  struct Change {
    std::string place;   ///< "clusters.mode", "skin.stretch_hz" ("pins.skin.from" where several have the name),
                         ///< "/clusters/0/from"
    std::string before;  ///< JSON; "default" where the recipe says nothing
    std::string after;
  };
  /// Sets values. \param key a setting ("clusters.mode"), a key or setting of a cluster, a set of pins or a part
  /// ("NAME.split", "NAME.stretch_hz"), or a JSON pointer ("/clusters/0/from"); * in a setting's key, in NAME or in
  /// the key of a cluster's setting stands for any letters, "clusters.*.mode" means clusters only; "c*.mode" is of
  /// what has such a name, else a setting. "clusters.material" and "NAME.material" set all values of
  /// a preset (material_presets.h). \param value JSON, or plain text; "default" removes it. \return every value that
  /// differs now.
  std::vector<Change> set(const std::string& key, const std::string& value);
  /// The same of several at once: one step of the history, which `command` names there.
  std::vector<Change> setTogether(std::span<const std::pair<std::string, std::string>> values,
                                  const std::string& command);
  /// Renames a mask (with all selections that use it), a cluster or a set of pins.
  void rename(const std::string& from, const std::string& to);
  /// Moves a mask, a cluster, a part or a set of pins by so many places in its list: the order in which they are shown.
  /// \param list "masks", "clusters", "pins" or "parts"; empty: the first of the latter three that has it, else masks.
  void move(const std::string& name, int by, const std::string& list = "");
  /// Removes a mask, a cluster or a set of pins. A mask that is in use stays, with an error that says where.
  void remove(const std::string& name);
  /// Adds the mirror image of a mask, a cluster, a part or a set of pins: of its selections and its fibre; names of
  /// channels, targets and carriers have their sides exchanged. \param to empty: the name with left and right exchanged
  /// (.L/.R, _l/_r, left/right). \param plane auto, x, y or z. \param found_normal asked for the normal (unit) of the
  /// source's plane of symmetry where plane is auto and a fibre has a given direction. \param list as of move().
  void mirror(const std::string& name, const std::string& to, const std::string& plane,
              const std::function<Eigen::Vector3d()>& found_normal, const std::string& list = "");
  /// Adds a mask from a picture or a stroke file (.json). \param file relative to the working folder; it must lie in
  /// the project folder. \param options further keys of the selection as a JSON object; may be empty.
  void paint(const std::string& name, const std::filesystem::path& file, const std::string& options);

  /// Replaces the whole recipe, as one command of this name.
  void replace(const std::string& command, const nlohmann::ordered_json& document);
  /// The recipe's JSON in the present version.
  nlohmann::ordered_json document() const;

  /// Steps back or forward. \return the command that was undone or is done again; empty where there is none.
  std::string undo();
  std::string redo();

  /// The commands so far, oldest first, and how many of them are in effect.
  std::vector<std::string> history() const;
  std::size_t position() const { return at_; }
  /// The recipe as it would be written.
  const std::string& text() const { return states_[at_].text; }
  const std::filesystem::path& file() const { return file_; }
  /// Whether any step of the history, undone ones too, has these letters in its text.
  bool everMentions(std::string_view letters) const;
  /// Writes recipe and history, whole or not at all.
  void save() const;

 private:
  struct State {
    std::string command;
    std::string text;
  };
  RecipeEditor() = default;
  void commit(const std::string& command, const nlohmann::ordered_json& document);
  std::vector<Change> setMaterial(const std::string& owner, const std::string& value);
  void commitText(const std::string& command, std::string text);

  std::filesystem::path file_;
  std::vector<State> states_;
  std::size_t at_ = 0;
};

/// A path as a recipe in `recipe` has it; both relative to the working folder. Empty where no such path exists.
std::string pathFromRecipe(const std::filesystem::path& recipe, const std::filesystem::path& file);

/// Further keys of a selection, from the command line. Throws ToolError(usage) where `text` is no JSON object.
/// \param example shown then.
nlohmann::ordered_json furtherKeys(const std::string& text, const std::string& example);

/// A name with left and right exchanged; the name itself where it has no side.
std::string otherSide(const std::string& name);

}  // namespace sinew::tools
