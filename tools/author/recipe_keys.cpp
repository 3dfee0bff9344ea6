// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/recipe_keys.h"

#include <algorithm>

#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

RecipeKey falloff() {
  return {"falloff", kRecipeNumber, "Outside, the weight falls smoothly to 0 over this.", "0", "m", 0, kRecipeFar};
}
RecipeKey radius() { return {"radius", kRecipeNumber, "Inside this the weight is 1.", "", "m", 1e-9, kRecipeFar}; }
RecipeKey by(std::string_view sentence) { return {"by", kRecipeNumber, sentence, "", "m", 0, kRecipeFar}; }
RecipeKey note() { return {"note", kRecipeText, "A comment.", "none"}; }

std::vector<RecipeObject> declareObjects() {
  return {
      {"recipe",
       "A whole recipe. Lengths and points are metres, y up, as `sinew inspect` shows the source.",
       {{"$schema", kRecipeText, "Where editors find the schema.", "none"},
        {"sinew_recipe", kRecipeInteger, "Version of the format.", "", "", 1, 3},
        note(),
        {"project", kRecipeText, "Folder that no file of the recipe lies outside of: \".\" or \"..\", \"../..\", ...",
         "\".\""},
        {"source", kRecipePath, "The artist's file.", ""},
        {"settings", kRecipeSettings, "Settings that differ from their defaults: [settings.md](settings.md).", "{}"},
        {"masks", kRecipeMasks, "Selections with names.", "{}"},
        {"clusters",
         0,
         "Regions with their own material. Without any, clusters are made automatically.",
         "[]",
         "",
         0,
         0,
         {},
         "cluster"},
        {"pins", 0, "What is held.", "[]", "", 0, 0, {}, "pin"},
        {"stiffness", 0, "What is softer than the rest.", "[]", "", 0, 0, {}, "stiffness"},
        {"thickness", 0, "Where a shell is thicker or thinner.", "[]", "", 0, 0, {}, "thickness"},
        {"colors", 0, "Colours of a source that has none.", "[]", "", 0, 0, {}, "color"},
        {"parts",
         0,
         "Loose parts that ride along instead of being filled: eyeballs, teeth, lashes, buttons.",
         "[]",
         "",
         0,
         0,
         {},
         "part"}},
       R"({"sinew_recipe": 3, "source": "head.obj", "clusters": [{"name": "nose", "from": {"group": "nose"}}]})"},
      {"cluster",
       "A named region with its own material. Regions may overlap; gaps go to the nearest region along the surface, "
       "and the bake says how many vertices.",
       {{"name", kRecipeText, "Its name in the package.", ""},
        note(),
        {"from", kRecipeSelection, "The region. Without it: the cluster mesh of this name.", "none"},
        {"settings", kRecipeClusterSettings, "Its own settings, without the prefix `clusters.`: mode, stretch_hz, ...",
         "{}"},
        {"split",
         kRecipeNumber,
         "Cut it into clusters of this mean width, named NAME.1, NAME.2, ...",
         "none",
         "m",
         1e-9,
         kRecipeFar,
         {},
         "",
         "",
         "channel"},
        {"channel", kRecipeText, "Name of the input 0..1 that contracts it.", "none"},
        {"contraction",
         kRecipeNumber,
         "With a channel: shortening along the fibre at full activation.",
         "0.3",
         "",
         0,
         0.9,
         {},
         "",
         "channel"},
        {"fibre",
         kRecipeChoice | kRecipePoint,
         "Direction of contraction; auto: from origin to insertion where both are given, else its longest axis along "
         "the surface.",
         "\"auto\"",
         "",
         0,
         1,
         {"auto"},
         "",
         "channel"},
        {"origin", kRecipeSelection, "Where a muscle hangs on the bone: pinned as NAME.origin.", "none"},
        {"insertion", kRecipeSelection, "Where a muscle pulls; gives the fibre its direction.", "none"}},
       R"({"name": "smile.L", "from": {"cluster_mesh": "smile.L"}, "settings": {"stretch_hz": 20}, "channel": "smile.L"})"},
      {"pin",
       "A named set of held vertices.",
       {{"name", kRecipeText, "Its name in the package.", ""},
        note(),
        {"from", kRecipeSelection, "What is held, and how firmly (weight 0..1).", ""},
        {"method",
         kRecipeChoice,
         "Only --solver report: how it holds (docs/report.md).",
         "\"constrained_fit\"",
         "",
         0,
         1,
         {"hold", "infinite_mass", "matrix", "constrained_fit"}},
        {"target", kRecipeText, "What holds it: \"world\", or the name of a bone or body of the game.", "\"world\""}},
       R"({"name": "skull", "from": {"half_space": [0, 1.6, 0], "normal": [0, 0, -1]}, "target": "Head"})"},
      {"stiffness",
       "Multiplies Young's modulus of what deforms there (--solver report: `clusters.alpha`); entries that overlap "
       "multiply. What a frequency names is the mean of the piece.",
       {note(),
        {"from", kRecipeSelection, "Which vertices.", ""},
        {"value", kRecipeNumber, "The factor where the weight is 1; 1 where it is 0.", ""}},
       R"({"from": {"color": "r"}, "value": 0.4})"},
      {"thickness",
       "Multiplies the `tetrahedra.thickness` of a shell; entries that overlap multiply. It changes evenly between "
       "vertices of the shell; soften the selection for a wider ramp.",
       {note(),
        {"from", kRecipeSelection, "Which vertices.", ""},
        {"value", kRecipeNumber, "The factor where the weight is 1; 1 where it is 0.", "", "", 0.01, 100}},
       R"({"from": {"soften": {"group": "cheek"}, "by": 0.02}, "value": 3})"},
      {"color",
       "The colour that visual vertices are drawn in; later entries paint over earlier ones. The rest keeps the "
       "source's vertex colour, or is white.",
       {note(),
        {"from", kRecipeSelection, "What is painted, and how strongly (weight 0..1).", ""},
        {"color", kRecipeColor, "Linear red, green, blue; an alpha is ignored.", ""}},
       R"({"from": {"group": "lip_*"}, "color": [0.5, 0.15, 0.12]})"},
      {"part",
       "An accessory: whole loose parts of the source that get no tetrahedra.",
       {{"name", kRecipeText, "Its name in the package.", ""},
        note(),
        {"from", kRecipeSelection, "Every loose part of which this selects at least half.", ""},
        {"attach",
         kRecipeChoice,
         "rigid: all of it moves with one rigid motion. follow: each vertex keeps its place on the nearest surface.",
         "\"rigid\"",
         "",
         0,
         1,
         {"rigid", "follow"}},
        {"to", kRecipeSelection,
         "What carries it: the name of a cluster, a pin set or a mask, or a selection. rigid: its best-fitting rigid "
         "motion; absent: that of the physical vertices around. follow: the surface to sit on; absent: all.",
         "none"}},
       R"({"name": "eye.L", "from": {"object": "eyeball_L"}, "attach": "rigid", "to": "skull"})"},
  };
}

std::vector<RecipeObject> declareKinds() {
  const RecipeKey tolerance{
      "tolerance", kRecipeNumber, "Largest distance of a colour that counts as this one.", "0.25", "", 0, 2};
  return {
      {"all", "Every vertex.", {{"all", kRecipeFlag, "Always true.", ""}, note()}, R"({"all": true})"},
      {"rest",
       "What the named masks leave; with true, in a cluster's `from`: what all clusters without `rest` leave.",
       {{"rest", kRecipeFlag | kRecipeTexts, "true, or names of masks.", ""}, note()},
       R"({"rest": true})"},
      {"group",
       "Vertices of the faces of a group (OBJ `g`, vertex sets).",
       {{"group", kRecipeText | kRecipeTexts, "* stands for any letters.", ""}, note()},
       R"({"group": "lip_*"})"},
      {"material",
       "Vertices of the faces of a material.",
       {{"material", kRecipeText | kRecipeTexts, "* stands for any letters.", ""}, note()},
       R"({"material": "skin"})"},
      {"object",
       "Vertices of an object: a node or a mesh of the source.",
       {{"object", kRecipeText | kRecipeTexts, "* stands for any letters.", ""}, note()},
       R"({"object": "eyeball_*"})"},
      {"part",
       "A loose part: what hangs together over edges.",
       {{"part", kRecipeInteger | kRecipePoint,
         "Its number (from 0, by first face), or a point: the part nearest to it.", "", "m", 0, 4e9},
        note()},
       R"({"part": [0.03, 1.62, 0.1]})"},
      {"bone",
       "What a bone moves.",
       {{"bone", kRecipeText | kRecipeTexts, "* stands for any letters.", ""},
        note(),
        {"weights",
         kRecipeChoice,
         "The skin's weights as they are, or 1 where these bones weigh most.",
         "\"blended\"",
         "",
         0,
         1,
         {"blended", "dominant"}},
        {"children", kRecipeFlag, "With the bones below it.", "false"}},
       R"({"bone": "Jaw", "weights": "dominant"})"},
      {"morph",
       "What a morph target (shape key) moves.",
       {{"morph", kRecipeText, "Its name.", ""},
        note(),
        {"threshold", kRecipeNumber,
         "Weight 1 beyond this part of its largest displacement; 0: weight in proportion to the displacement.",
         "0.02"}},
       R"({"morph": "smile", "threshold": 0.1})"},
      {"color",
       "A vertex colour channel, or the vertices of one colour (as the file has it; linear).",
       {{"color", kRecipeChoice | kRecipeColor, "Channel or colour.", "", "", 0, 1, {"r", "g", "b", "a"}},
        note(),
        tolerance,
        {"set", kRecipeText, "COLOR_0 is the first; others by the attribute's name.", "\"COLOR_0\""}},
       R"({"color": [1, 0, 0], "tolerance": 0.3})"},
      {"attribute",
       "A vertex attribute of the file (glTF `_NAME`, further PLY properties).",
       {{"attribute", kRecipeText, "Its name, as in the file.", ""},
        note(),
        {"component", kRecipeInteger, "Which one, where it has several.", "0", "", 0, 15},
        {"low", kRecipeNumber, "Value of weight 0.", "0", "", -kRecipeFar, kRecipeFar},
        {"high", kRecipeNumber, "Value of weight 1.", "1", "", -kRecipeFar, kRecipeFar}},
       R"({"attribute": "_SMILE_L"})"},
      {"values",
       "A JSON file with one number 0..1 for each source vertex.",
       {{"values", kRecipePath, "", ""}, note()},
       R"({"values": "weights/smile.json"})"},
      {"stored",
       "Weights at points, as `sinew author RECIPE transfer` writes them: `{\"sinew_masks\": 1, \"points\": [x, y, z, "
       "...], \"masks\": {\"cheek\": {\"points\": [numbers, from 0], \"weights\": [0..1]}}}`, metres, y up. A vertex "
       "takes the weight of the nearest point within 2 % of the diagonal.",
       {{"stored", kRecipePath, "", ""}, note(), {"mask", kRecipeText, "Which mask of it.", ""}},
       R"({"stored": "head.masks.json", "mask": "cheek"})"},
      {"image",
       "A picture in UV space (PNG, EXR, TIFF, JPEG). In this order: channel or key, threshold, close, specks, "
       "feather, bilinear sampling (repeated outside 0..1).",
       {{"image", kRecipePath, "", ""},
        note(),
        {"channel", kRecipeChoice, "What is read.", "\"luminance\"", "", 0, 1, {"luminance", "r", "g", "b", "a"}},
        {"key", kRecipeColor, "Instead of a channel: weight 1 where the picture has this colour.", "none"},
        tolerance,
        {"threshold", kRecipeNumber, "Weight 1 from this value on, else 0; absent: greys are weights.", "none"},
        {"close", kRecipeInteger, "Closes holes and gaps up to twice this.", "0", "texels", 0, 256},
        {"specks", kRecipeInteger, "Removes spots of fewer texels.", "0", "texels", 0, 1e9},
        {"feather", kRecipeNumber, "Softens edges over this width.", "0", "texels", 0, 1000},
        {"v", kRecipeChoice, "Where v = 1 lies in the picture.", "\"up\"", "", 0, 1, {"up", "down"}},
        {"material", kRecipeText, "Only on faces of this material, where several share the UV space.", "none"}},
       R"({"image": "masks/smile.png", "threshold": 0.5, "close": 2, "specks": 20, "feather": 6})"},
      {"cluster_mesh",
       "A duplicate of part of the surface: an object of the source named CLUSTER_x, or with a property sinew_cluster.",
       {{"cluster_mesh", kRecipeText, "Its name, without CLUSTER_.", ""},
        note(),
        {"tolerance", kRecipeNumber,
         "How far its vertices may lie from the surface; absent: half an edge, at most 2 % of the diagonal.", "none",
         "m", 0, kRecipeFar}},
       R"({"cluster_mesh": "smile.L"})"},
      {"box",
       "Vertices in a box.",
       {{"box", kRecipePoints, "Two opposite corners.", "", "m"}, note(), falloff()},
       R"({"box": [[0, 1.5, 0], [0.1, 1.6, 0.2]], "falloff": 0.01})"},
      {"sphere",
       "Vertices in a sphere.",
       {{"sphere", kRecipePoint, "Its centre.", "", "m"}, note(), radius(), falloff()},
       R"({"sphere": [0, 1.6, 0.1], "radius": 0.05})"},
      {"capsule",
       "Vertices near a line.",
       {{"capsule", kRecipePoints, "The line's ends.", "", "m"}, note(), radius(), falloff()},
       R"({"capsule": [[0, 1.5, 0.1], [0.05, 1.6, 0.1]], "radius": 0.01, "falloff": 0.01})"},
      {"half_space",
       "Vertices on the side of a plane to which its normal points.",
       {{"half_space", kRecipePoint, "A point of the plane.", "", "m"},
        note(),
        {"normal", kRecipePoint, "Any length.", ""},
        falloff()},
       R"({"half_space": [0, 0, 0], "normal": [1, 0, 0], "falloff": 0.02})"},
      {"disc",
       "Vertices within a distance, along the surface, from the surface point nearest to a point.",
       {{"disc", kRecipePoint, "The point.", "", "m"}, note(), radius(), falloff()},
       R"({"disc": [0.04, 1.55, 0.1], "radius": 0.02, "falloff": 0.01})"},
      {"strokes",
       "A stroke file: `{\"strokes\": [{\"points\": [[x, y, z], ...], \"radius\": m, \"falloff\": m, \"strength\": "
       "0..1, \"mode\": ..., \"facing\": [x, y, z], \"mirror\": [[x, y, z], [x, y, z]], \"eye\": [x, y, z]}]}`, "
       "distances along the surface, later strokes over earlier ones. `mode`: `paint` (what is larger, the default), "
       "`add`, `subtract`, `erase`, `smooth`; `grow` and `shrink` move the edge of all (no points) by the radius; "
       "`facing`: paints only what faces this way; `mirror`: a plane (point, normal) across which the stroke has an "
       "image; a point may have a pen's pressure, 0..1, as its fourth number: there the radius is this part of it; "
       "`eye`: distances are those seen from there, and only what is seen is painted (`through`: true: what is "
       "hidden too; `lasso`: true: points are the corners of a loop, all inside is painted, no radius).",
       {{"strokes", kRecipePath, "", ""},
        note(),
        {"over", kRecipeSelection, "What the strokes change; without it, they begin from nothing.", "none"}},
       R"({"strokes": "masks/brow.json"})"},
      {"and",
       "The least of the weights.",
       {{"and", kRecipeSelections, "", ""}, note()},
       R"({"and": [{"group": "lip_upper"}, {"half_space": [0, 0, 0], "normal": [1, 0, 0]}]})"},
      {"or",
       "The largest of the weights.",
       {{"or", kRecipeSelections, "", ""}, note()},
       R"({"or": [{"group": "lip_upper"}, {"group": "lip_lower"}]})"},
      {"not", "1 less the weight.", {{"not", kRecipeSelection, "", ""}, note()}, R"({"not": {"material": "skin"}})"},
      {"minus",
       "The first without the others.",
       {{"minus", kRecipeSelections, "", ""}, note()},
       R"({"minus": [{"group": "jaw"}, {"group": "lip_lower"}]})"},
      {"grow",
       "Adds what is nearer than this, along the surface, to where the weight is above one half.",
       {{"grow", kRecipeSelection, "", ""}, note(), by("How far.")},
       R"({"grow": {"group": "nose"}, "by": 0.01})"},
      {"shrink",
       "Removes what is nearer than this, along the surface, to where the weight is below one half.",
       {{"shrink", kRecipeSelection, "", ""}, note(), by("How far.")},
       R"({"shrink": {"group": "nose"}, "by": 0.005})"},
      {"soften",
       "Makes the edge a smooth ramp of this width, along the surface.",
       {{"soften", kRecipeSelection, "", ""}, note(), by("Width of the ramp.")},
       R"({"soften": {"group": "nose"}, "by": 0.02})"},
      {"mirror",
       "The mirror image.",
       {{"mirror", kRecipeSelection, "", ""},
        note(),
        {"plane",
         kRecipeChoice,
         "x, y, z: the plane through `point` across this axis; auto: the source's plane of symmetry.",
         "\"auto\"",
         "",
         0,
         1,
         {"auto", "x", "y", "z"}},
        {"point", kRecipePoint, "A point of the plane.", "[0, 0, 0]", "m"},
        {"normal", kRecipePoint, "The plane's normal, instead of an axis.", "none"},
        {"tolerance", kRecipeNumber, "How far the sides may differ, in diagonals.", "0.02"}},
       R"({"mirror": {"group": "cheek_l"}, "plane": "x"})"},
      {"scale",
       "The weight times a factor.",
       {{"scale", kRecipeSelection, "", ""}, note(), {"by", kRecipeNumber, "The factor.", ""}},
       R"({"scale": {"group": "nose"}, "by": 0.5})"},
  };
}

}  // namespace

const std::vector<RecipeObject>& recipeObjects() {
  static const std::vector<RecipeObject> objects = declareObjects();
  return objects;
}

const RecipeObject& recipeObject(std::string_view name) {
  const auto& all = recipeObjects();
  return *std::find_if(all.begin(), all.end(), [&](const RecipeObject& o) { return o.name == name; });
}

const RecipeKey& recipeKey(std::string_view object, std::string_view key) {
  const auto& keys = recipeObject(object).keys;
  return *std::find_if(keys.begin(), keys.end(), [&](const RecipeKey& k) { return k.name == key; });
}

std::string legalText(const RecipeKey& key) {
  std::vector<std::string> texts;
  const auto has = [&](std::uint32_t type) { return (key.type & type) != 0; };
  if (has(kRecipeNumber)) texts.push_back("number " + exactText(key.minimum) + " .. " + exactText(key.maximum));
  if (has(kRecipeInteger)) {
    texts.push_back("whole number " + exactText(key.minimum) + " .. " + exactText(key.maximum));
  }
  if (has(kRecipeFlag)) texts.emplace_back("true or false");
  if (has(kRecipeText)) texts.emplace_back("text");
  if (has(kRecipeTexts)) texts.emplace_back("list of texts");
  if (has(kRecipeChoice)) {
    for (const auto& choice : key.choices) texts.push_back("\"" + std::string(choice) + "\"");
  }
  if (has(kRecipePath)) texts.emplace_back("file name");
  if (has(kRecipePoint)) texts.emplace_back("[x, y, z]");
  if (has(kRecipePoints)) texts.emplace_back("[[x, y, z], [x, y, z]]");
  if (has(kRecipeColor)) texts.emplace_back("[r, g, b] or [r, g, b, a], each 0 .. 1");
  if (has(kRecipeSelection)) texts.emplace_back("selection");
  if (has(kRecipeSelections)) texts.emplace_back("list of selections");
  if (has(kRecipeMasks)) texts.emplace_back("object: name -> selection");
  if (has(kRecipeSettings)) texts.emplace_back("object of settings");
  if (has(kRecipeClusterSettings)) texts.emplace_back("object of cluster settings");
  if (key.type == 0) texts.push_back("list of " + std::string(key.object) + " objects");
  std::string text;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    text += (i == 0 ? "" : i + 1 == texts.size() ? " or " : ", ") + texts[i];
  }
  return text;
}

const std::vector<RecipeObject>& selectionKinds() {
  static const std::vector<RecipeObject> kinds = declareKinds();
  return kinds;
}

const RecipeObject* selectionKind(const Json& selection) {
  const RecipeObject* found = nullptr;
  for (const RecipeObject& kind : selectionKinds()) {
    if (!selection.contains(kind.name)) continue;
    // An image may name the material it is for.
    if (kind.name == "material" && selection.contains("image")) continue;
    if (found != nullptr) return nullptr;
    found = &kind;
  }
  return found;
}

Json recipeValue(const RecipeObject& object, const Json& json, std::string_view key) {
  const auto at = json.find(key);
  if (at != json.end()) return *at;
  for (const RecipeKey& k : object.keys) {
    if (k.name == key && !k.fallback.empty() && k.fallback != "none") return Json::parse(k.fallback);
  }
  return nullptr;
}

}  // namespace sinew::tools
