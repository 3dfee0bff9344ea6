// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_schema.h"

#include <string>
#include <string_view>

#include "tools/author/recipe_keys.h"
#include "tools/author/settings.h"
#include "tools/core/units.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

// JSON Schema of one key.
Json keySchema(const RecipeKey& key);

Json withRange(Json schema, const RecipeKey& key) {
  schema["minimum"] = key.minimum;
  schema["maximum"] = key.maximum;
  return schema;
}

Json objectSchema(const RecipeObject& object) {
  Json schema = {{"type", "object"}, {"description", object.sentence}, {"additionalProperties", false}};
  Json properties = Json::object();
  Json required = Json::array();
  for (const RecipeKey& key : object.keys) {
    properties[std::string(key.name)] = keySchema(key);
    if (key.fallback.empty()) required.push_back(key.name);
  }
  schema["properties"] = properties;
  schema["required"] = required;
  for (const RecipeKey& key : object.keys) {
    const std::string name(key.name);
    if (!key.needs.empty()) schema["dependentRequired"][name] = {key.needs};
    if (!key.excludes.empty()) schema["dependentSchemas"][name] = {{"not", {{"required", {key.excludes}}}}};
  }
  return schema;
}

Json numbersSchema(std::size_t least, std::size_t most, double minimum, double maximum) {
  return {{"type", "array"},
          {"items", {{"type", "number"}, {"minimum", minimum}, {"maximum", maximum}}},
          {"minItems", least},
          {"maxItems", most}};
}

Json pointSchema() { return numbersSchema(3, 3, -kRecipeFar, kRecipeFar); }

Json keySchema(const RecipeKey& key) {
  const auto has = [&](std::uint32_t type) { return (key.type & type) != 0; };
  const Json selection = {{"$ref", "#/$defs/selection"}};
  const Json filled = {{"type", "string"}, {"minLength", 1}};
  Json any = Json::array();
  if (key.type == 0) any.push_back({{"type", "array"}, {"items", {{"$ref", "#/$defs/" + std::string(key.object)}}}});
  if (has(kRecipeNumber)) any.push_back(withRange({{"type", "number"}}, key));
  if (has(kRecipeInteger)) any.push_back(withRange({{"type", "integer"}}, key));
  if (has(kRecipeFlag)) any.push_back({{"type", "boolean"}});
  if (has(kRecipeText | kRecipePath)) any.push_back(filled);
  if (has(kRecipeTexts)) any.push_back({{"type", "array"}, {"items", filled}, {"minItems", 1}});
  if (has(kRecipeChoice)) any.push_back({{"enum", key.choices}});
  if (has(kRecipePoint)) any.push_back(pointSchema());
  if (has(kRecipePoints)) {
    any.push_back({{"type", "array"}, {"items", pointSchema()}, {"minItems", 2}, {"maxItems", 2}});
  }
  if (has(kRecipeColor)) any.push_back(numbersSchema(3, 4, 0, 1));
  if (has(kRecipeSelection)) any.push_back(selection);
  if (has(kRecipeSelections)) any.push_back({{"type", "array"}, {"items", selection}, {"minItems", 1}});
  if (has(kRecipeMasks)) any.push_back({{"type", "object"}, {"additionalProperties", selection}});
  if (has(kRecipeSettings)) any.push_back({{"$ref", "#/$defs/settings"}});
  if (has(kRecipeClusterSettings)) any.push_back({{"$ref", "#/$defs/cluster_settings"}});
  Json schema = any.size() == 1 ? any[0] : Json{{"anyOf", any}};
  std::string sentence(key.sentence);
  if (!key.unit.empty()) sentence += (sentence.empty() ? "" : " ") + ("[" + std::string(key.unit) + "]");
  if (!sentence.empty()) schema["description"] = sentence;
  if (!key.fallback.empty() && key.fallback != "none") schema["default"] = Json::parse(key.fallback);
  return schema;
}

Json settingSchema(Settings& defaults, const Settings::Declaration& d) {
  struct Visitor {
    const Settings& defaults;
    Json operator()(const Settings::Number& t) const {
      return {{"type", "number"}, {"minimum", t.minimum}, {"maximum", t.maximum}, {"default", *t.value}};
    }
    Json operator()(const Settings::AutoNumber& t) const {
      const Json number = {{"type", "number"}, {"minimum", 0}, {"maximum", t.maximum}};
      return {{"anyOf", {{{"const", "auto"}}, number}}, {"default", *t.value ? Json(**t.value) : Json("auto")}};
    }
    Json operator()(const Settings::Count& t) const {
      return {{"type", "integer"}, {"minimum", t.minimum}, {"maximum", t.maximum}, {"default", *t.value}};
    }
    Json operator()(const Settings::Flag& t) const { return {{"type", "boolean"}, {"default", *t.value}}; }
    Json operator()(const Settings::Choice& t) const {
      return {{"enum", t.names}, {"default", t.names[std::size_t(t.get(defaults))]}};
    }
    Json operator()(const Settings::Text& t) const {
      Json text = {{"type", "string"}, {"pattern", t.pattern}, {"default", *t.value}};
      if (!t.metres_per_unit) return text;
      return {
          {"anyOf", {text, {{"type", "number"}, {"exclusiveMinimum", kLeastUnit}, {"exclusiveMaximum", kMostUnit}}}}};
    }
    Json operator()(const Settings::Grid& t) const {
      const Json boxes = {{"type", "array"},
                          {"items", {{"type", "integer"}, {"minimum", 1}, {"maximum", t.maximum}}},
                          {"minItems", 3},
                          {"maxItems", 3}};
      return {{"anyOf", {{{"const", "auto"}}, boxes}}, {"default", "auto"}};
    }
  };
  Json schema = std::visit(Visitor{defaults}, d.type);
  schema["description"] = std::string(d.sentence) + (d.unit.empty() ? "" : " [" + std::string(d.unit) + "]");
  return schema;
}

}  // namespace

Json recipeSchema() {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"},
                 {"title", "Sinew recipe, version 3"},
                 {"description", "Written by `sinew help schema`."},
                 {"$ref", "#/$defs/recipe"}};
  Json defs = Json::object();
  for (const RecipeObject& object : recipeObjects()) defs[std::string(object.name)] = objectSchema(object);
  Json any = Json::array({{{"type", "string"}, {"minLength", 1}, {"description", "The name of a mask."}}});
  for (const RecipeObject& kind : selectionKinds()) any.push_back(objectSchema(kind));
  defs["selection"] = {{"anyOf", any}};
  Settings defaults;
  Json settings = Json::object();
  Json cluster_settings = Json::object();
  for (const Settings::Declaration& d : Settings::declarations(defaults)) {
    settings[std::string(d.key)] = settingSchema(defaults, d);
    if (d.of_cluster) cluster_settings[std::string(d.key.substr(kClusterPrefix.size()))] = settingSchema(defaults, d);
  }
  defs["settings"] = {{"type", "object"}, {"additionalProperties", false}, {"properties", settings}};
  defs["cluster_settings"] = {{"type", "object"}, {"additionalProperties", false}, {"properties", cluster_settings}};
  schema["$defs"] = defs;
  return schema;
}

}  // namespace sinew::tools
