// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_shape.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tools/author/recipe_keys.h"
#include "tools/author/settings.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

bool isNumbers(const Json& value, std::size_t least, std::size_t most, double minimum, double maximum) {
  if (!value.is_array() || value.size() < least || value.size() > most) return false;
  return std::all_of(value.begin(), value.end(), [&](const Json& x) {
    return x.is_number() && x.get<double>() >= minimum && x.get<double>() <= maximum;
  });
}

bool isFilledText(const Json& value) { return value.is_string() && !value.get_ref<const std::string&>().empty(); }

// Whether a value is legal in itself; what it holds (objects, selections) is looked at by ShapeCheck.
bool legal(const RecipeKey& key, const Json& value) {
  const auto has = [&](std::uint32_t type) { return (key.type & type) != 0; };
  if (key.type == 0) return value.is_array();
  if (has(kRecipeNumber) && value.is_number()) {
    const double x = value.get<double>();
    if (x >= key.minimum && x <= key.maximum) return true;
  }
  if (has(kRecipeInteger) && value.is_number()) {
    const double x = value.get<double>();
    if (x >= key.minimum && x <= key.maximum && x == std::floor(x)) return true;
  }
  if (has(kRecipeFlag) && value.is_boolean()) return true;
  if (has(kRecipeChoice) && value.is_string() &&
      std::find(key.choices.begin(), key.choices.end(), value.get_ref<const std::string&>()) != key.choices.end())
    return true;
  if (has(kRecipeText | kRecipePath) && isFilledText(value)) return true;
  if (has(kRecipeTexts) && value.is_array() && !value.empty() && std::all_of(value.begin(), value.end(), isFilledText))
    return true;
  if (has(kRecipePoint) && isNumbers(value, 3, 3, -kRecipeFar, kRecipeFar)) return true;
  if (has(kRecipePoints) && value.is_array() && value.size() == 2 &&
      isNumbers(value[0], 3, 3, -kRecipeFar, kRecipeFar) && isNumbers(value[1], 3, 3, -kRecipeFar, kRecipeFar))
    return true;
  if (has(kRecipeColor) && isNumbers(value, 3, 4, 0, 1)) return true;
  if (has(kRecipeSelection) && (isFilledText(value) || value.is_object())) return true;
  if (has(kRecipeSelections) && value.is_array() && !value.empty()) return true;
  return has(kRecipeMasks | kRecipeSettings | kRecipeClusterSettings) && value.is_object();
}

std::string shortened(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

class ShapeCheck {
 public:
  explicit ShapeCheck(const JsonText& text) : text_(text) {}

  void object(const RecipeObject& shape, const Json& json, const std::string& pointer) const {
    if (!json.is_object()) {
      text_.fail(pointer, "a " + std::string(shape.name) + " must be an object, not " + shortened(json),
                 "It looks like " + std::string(shape.example) + ".");
    }
    std::vector<std::string> names;
    for (const RecipeKey& key : shape.keys) names.emplace_back(key.name);
    for (const auto& [name, value] : json.items()) {
      const auto key = std::find_if(shape.keys.begin(), shape.keys.end(),
                                    [wanted = std::string_view(name)](const RecipeKey& k) { return k.name == wanted; });
      const std::string place = childPointer(pointer, name);
      if (key == shape.keys.end()) {
        // A cluster's settings are keys of its "settings".
        std::vector<std::string> known = names;
        if (shape.name == "cluster") {
          Settings settings;
          for (const auto& d : Settings::declarations(settings)) {
            if (d.of_cluster) known.emplace_back(d.key.substr(std::string_view(kClusterPrefix).size()));
          }
        }
        std::string near = nearestName(name, known);
        if (std::find(names.begin(), names.end(), near) == names.end())
          near.insert(0, R"("settings": {")").append(R"(": ...})");
        text_.fail(place, "there is no key '" + name + "' in a " + std::string(shape.name),
                   "Did you mean " + near + "? Known: " + listed(names, names.size()) + ".");
      }
      if (!legal(*key, value)) {
        text_.fail(place, std::string(key->name) + " cannot be " + shortened(value), "Legal: " + legalText(*key) + ".");
      }
      inside(*key, value, place);
    }
    for (const RecipeKey& key : shape.keys) {
      const std::string name(key.name), place = childPointer(pointer, key.name);
      const bool there = json.contains(key.name);
      if (key.fallback.empty() && !there) {
        text_.fail(pointer, "a " + std::string(shape.name) + " lacks its key '" + name + "'",
                   "It looks like " + std::string(shape.example) + ".");
      }
      if (there && !key.needs.empty() && !json.contains(key.needs)) {
        std::string cure = "Add \"";
        cure.append(key.needs).append("\": ").append(recipeKey(shape.name, key.needs).sentence);
        text_.fail(place, name + " says nothing without a " + std::string(key.needs), cure);
      }
      if (there && !key.excludes.empty() && json.contains(key.excludes)) {
        text_.fail(place,
                   "a " + std::string(shape.name) + " cannot have both " + name + " and " + std::string(key.excludes),
                   "Remove one of the two.");
      }
    }
  }

  void selection(const Json& json, const std::string& pointer) const {
    if (isFilledText(json)) return;
    if (json.is_object()) {
      if (const RecipeObject* kind = selectionKind(json)) {
        object(*kind, json, pointer);
        return;
      }
    }
    std::vector<std::string> kinds;
    std::string found;
    for (const RecipeObject& kind : selectionKinds()) {
      kinds.emplace_back(kind.name);
      if (json.is_object() && json.contains(kind.name))
        found += (found.empty() ? "" : " and ") + std::string(kind.name);
    }
    if (!found.empty()) {
      text_.fail(pointer, "a selection is of one kind, this one is " + found,
                 "Combine two with {\"and\": [..., ...]} or {\"or\": [..., ...]}.");
    }
    std::string cure;
    if (json.is_object() && !json.empty()) cure = "Did you mean " + nearestName(json.begin().key(), kinds) + "? ";
    text_.fail(json.is_object() && !json.empty() ? childPointer(pointer, json.begin().key()) : pointer,
               shortened(json) + " is no selection",
               cure + "Give a mask's name, or an object with one of: " + listed(kinds, kinds.size()) + ".");
  }

 private:
  void inside(const RecipeKey& key, const Json& value, const std::string& pointer) const {
    const auto has = [&](std::uint32_t type) { return (key.type & type) != 0; };
    if (key.type == 0) {
      const RecipeObject& shape = recipeObject(key.object);
      for (std::size_t i = 0; i < value.size(); ++i) object(shape, value[i], childPointer(pointer, i));
    } else if (has(kRecipeSelection)) {
      selection(value, pointer);
    } else if (has(kRecipeSelections)) {
      for (std::size_t i = 0; i < value.size(); ++i) selection(value[i], childPointer(pointer, i));
    } else if (has(kRecipeMasks)) {
      for (const auto& [name, mask] : value.items()) selection(mask, childPointer(pointer, name));
    }
  }

  const JsonText& text_;
};

}  // namespace

void checkRecipeShape(const JsonText& text) { ShapeCheck(text).object(recipeObject("recipe"), text.json(), ""); }

void checkSelectionShape(const JsonText& text, const std::string& pointer, const Json& selection) {
  ShapeCheck(text).selection(selection, pointer);
}

}  // namespace sinew::tools
