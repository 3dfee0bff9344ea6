// SPDX-License-Identifier: GPL-3.0-or-later
//
// Every setting of a bake, declared once: recipe validation, `--set`, `sinew help settings`, docs/settings.md and the
// recipe's JSON Schema all come from Settings::declarations().
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "tools/attach/attach.h"
#include "tools/author/clusters.h"
#include "tools/import/import.h"
#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

/// Prefix of the keys of clusters' settings.
inline constexpr std::string_view kClusterPrefix = "clusters.";

struct MaterialOptions {
  double density = 1000;  ///< kg/m^3
};

struct FieldSettings {
  std::uint32_t functions = 32;       ///< of a piece; 0 makes no fields
  double samples = 2;                 ///< of the energy, a function
  std::uint32_t points = 256;         ///< that may touch, a piece
  std::uint32_t levels = 0;           ///< of detail beside the whole, each of half the functions
  std::uint32_t residual_modes = 96;  ///< by which what is held at run time gives way; 0: springs of one firmness
  std::uint32_t distances = 32;       ///< cells of the distance grid along a piece's longest side; 0: no grid
};

struct PackageOptions {
  std::string needs = "all";  ///< as Needs::parse() takes it
};

struct Settings {
  ImportOptions import;
  TetrahedraOptions tetrahedra;
  ClusterOptions clusters;
  AttachmentOptions attachment;
  MaterialOptions material;
  FieldSettings field;
  PackageOptions package;

  // How a value is held and what is legal.
  struct Number {
    double* value;
    double minimum, maximum;
  };
  struct AutoNumber {  ///< "auto" or a number from 0
    std::optional<double>* value;
    double maximum;
  };
  struct Count {
    std::uint32_t* value;
    std::uint32_t minimum, maximum;
  };
  struct Flag {
    bool* value;
  };
  struct Choice {
    std::vector<std::string_view> names;
    int (*get)(const Settings&);
    void (*set)(Settings&, int);
  };
  struct Text {
    std::string* value;
    bool (*legal)(const std::string&);
    std::string form;              ///< what is legal, in words
    std::string pattern;           ///< and as a regular expression
    bool metres_per_unit = false;  ///< a recipe may have a number too
  };
  struct Grid {
    std::array<std::uint32_t, 3>* value;
    std::uint32_t maximum;
  };

  struct Declaration {
    std::string_view key;
    std::string_view unit;      ///< "" where it has none
    std::string_view sentence;  ///< what it does
    std::variant<Number, AutoNumber, Count, Flag, Choice, Text, Grid> type;
    bool of_cluster = false;  ///< a recipe's cluster can have a value of its own
    /// Another setting and its value without which this one says nothing; "" where it always does.
    std::string_view needs_key = "", needs_value = "";
  };

  /// The declarations, bound to the values of `settings`.
  static std::vector<Declaration> declarations(Settings& settings);

  /// Sets a key from the command line's text. Throws ToolError(usage) that names the key, the legal range and the
  /// nearest key.
  void set(std::string_view key, std::string_view text);
  /// The same from a recipe's value, which has the type that the schema says.
  void setJson(std::string_view key, const nlohmann::ordered_json& value);
  /// The same from "KEY=VALUE".
  void assign(std::string_view assignment);
  /// A value as a recipe has it.
  nlohmann::ordered_json recipeValue(std::string_view key) const;
  /// All values, keys in order of declaration.
  nlohmann::ordered_json toJson() const;
};

/// The points of a response curve "phi:f,phi:f,..."; none where the text is not a legal curve (formats::CurvePoint).
std::vector<formats::CurvePoint> curvePoints(std::string_view text);

/// A setting's value in the type that a recipe has: "on" is true, "2,2,1" a list; itself where it is no value of it.
nlohmann::ordered_json typedSetting(std::string_view key, nlohmann::ordered_json value);

/// The legal values of a setting in words ("0 .. 1", "auto | grid | stuffing | delaunay").
std::string legalText(const Settings::Declaration& declaration);
/// A setting's choices, in the order of its enumeration ("clusters.mode": rigid, linear, quadratic).
std::vector<std::string> choicesOf(std::string_view key);
/// The current value as text.
std::string valueText(const Settings& settings, const Settings::Declaration& declaration);
/// docs/settings.md, generated.
std::string settingsMarkdown();

}  // namespace sinew::tools
