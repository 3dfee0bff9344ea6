// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/front.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

namespace sinew::tools {

float frontYaw(std::string_view front, std::string_view up) {
  const float sign = front.starts_with('-') ? -1.0F : 1.0F;
  const char axis = front.empty() ? ' ' : front.back();
  float x = 0, z = 0;
  if (axis == 'x') x = sign;
  // Of a source with z up, -y becomes +z.
  if (axis == 'z' && up != "z") z = sign;
  if (axis == 'y' && up == "z") z = -sign;
  return x == 0 && z == 0 ? 0 : std::atan2(x, z);
}

float frontYaw(const formats::PackageView& package) {
  const auto settings = nlohmann::json::parse(package.text(package.info().settings_json), nullptr, false);
  if (!settings.is_object()) return 0;
  const auto text = [&](const char* key) {
    const auto found = settings.find(key);
    return found != settings.end() && found->is_string() ? found->get<std::string>() : std::string();
  };
  return frontYaw(text("import.front"), text("import.up"));
}

}  // namespace sinew::tools
