// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/preferences.h"

#include <cstdlib>
#include <exception>
#include <string>

#include "tools/author/json_text.h"
#include "tools/core/atomic_file.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

// An object, whatever the file is.
Json objectIn(const std::filesystem::path& file) {
  try {
    const Json json = JsonText::read(file.string()).json();
    return json.is_object() ? json : Json::object();
  } catch (const std::exception&) {
    return Json::object();
  }
}

}  // namespace

std::filesystem::path preferencesFile() {
  const auto folder = [](const char* variable) {
    const char* value = std::getenv(variable);
    return std::filesystem::path(value == nullptr ? "" : value);
  };
  if (const auto config = folder("XDG_CONFIG_HOME"); config.is_absolute()) return config / "sinew" / "studio.json";
  if (const auto home = folder("HOME"); home.is_absolute()) return home / ".config" / "sinew" / "studio.json";
  return {};
}

Preferences readPreferences() {
  Preferences preferences;
  const Json json = objectIn(preferencesFile());
  for (std::size_t k = 0; k < navigationNames().size(); ++k) {
    if (json.contains("navigation") && json["navigation"] == navigationNames()[k])
      preferences.navigation = Navigation(k);
  }
  return preferences;
}

bool writePreferences(const Preferences& preferences) {
  const std::filesystem::path file = preferencesFile();
  Json json = objectIn(file);
  json["navigation"] = navigationNames()[std::size_t(preferences.navigation)];
  try {
    std::filesystem::create_directories(file.parent_path());
    writeFileAtomically(file, json.dump(1) + "\n");
    return true;
  } catch (const std::exception&) {
    return false;
  }
}

}  // namespace sinew::tools
