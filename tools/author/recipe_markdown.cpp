// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_markdown.h"

#include <ostream>
#include <sstream>
#include <string_view>

#include "tools/author/recipe_keys.h"

namespace sinew::tools {
namespace {

constexpr std::string_view kColumns = "| key | holds | if absent | meaning |\n|---|---|---|---|\n";

void writeRow(std::ostream& out, const RecipeKey& key, const std::string& name, std::string_view before = {}) {
  if (key.name == "note") return;
  out << "| " << name << " | " << legalText(key) << (key.unit.empty() ? "" : " ") << key.unit << " | ";
  if (key.fallback.empty()) {
    out << "required";
  } else if (key.fallback != "none") {
    out << "`" << key.fallback << "`";
  }
  out << " | " << before << (before.empty() || key.sentence.empty() ? "" : " ") << key.sentence << " |\n";
}

std::string quoted(const RecipeKey& key) { return "`" + std::string(key.name) + "`"; }

void writeTable(std::ostream& out, const RecipeObject& object) {
  out << object.sentence << "\n\n" << kColumns;
  for (const RecipeKey& key : object.keys) writeRow(out, key, quoted(key));
  out << "\n```json\n" << object.example << "\n```\n\n";
}

/// One table of all kinds: the key that names the kind is bold, its other keys follow it.
void writeSelections(std::ostream& out) {
  out << kColumns;
  for (const RecipeObject& kind : selectionKinds()) {
    for (const RecipeKey& key : kind.keys) {
      const bool names_kind = key.name == kind.name;
      writeRow(out, key, names_kind ? "**" + quoted(key) + "**" : quoted(key), names_kind ? kind.sentence : "");
    }
  }
  out << "\nOne example of each kind:\n\n```\n";
  for (const RecipeObject& kind : selectionKinds()) out << kind.example << "\n";
  out << "```\n";
}

}  // namespace

std::string recipeMarkdown() {
  std::ostringstream out;
  out << R"(# The recipe

Written by `sinew help recipe --markdown` from `tools/author/recipe_keys.cpp`; a test compares. How to use it:
[authoring.md](authoring.md). Editors complete it with [recipe.schema.json](recipe.schema.json) (`sinew help schema`).

JSON, UTF-8, one object. Comments are allowed, but commands that change the recipe drop them; the key `note`, which every
object may have, stays. An unknown key is an error. A wrong recipe ends with exit code 3 before anything is written.

**Names** of clusters differ from each other, and so do names of pins. A text in place of a selection names a mask; masks
may not need themselves.

**Files** are relative to the recipe's folder. They lie in that folder, or in one above it that `project` names.

**Versions.** This is version 3. Versions 1 (`source` and `settings` only) and 2 (`clusters.overlap_metres`, a cluster's
key `overlap`, `clusters.overlap` in boxes) are read as what they mean now, with the finding `recipe-migrated`; the
first command of `sinew author` that changes one writes version 3.

)";
  for (const RecipeObject& object : recipeObjects()) {
    out << "## " << (object.name == "recipe" ? "The whole" : "A " + std::string(object.name)) << "\n\n";
    writeTable(out, object);
  }
  out << R"(## Selections

A selection gives every visual vertex a weight 0..1. It is the name of a mask, or an object of one of the kinds below:
the key in bold names the kind, the rows after it are its other keys. Where vertices at one point differ (the two sides
of a seam, a group's border), the largest weight counts for all of them. Distances "along the surface" are geodesic,
exact on flat pieces and within 2 % on finely divided curved ones.

)";
  writeSelections(out);
  return out.str();
}

}  // namespace sinew::tools
