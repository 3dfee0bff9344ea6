// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>

#include "sinew/formats/writer.h"
#include "tools/author/settings.h"
#include "tools/bake/stage_cache.h"

namespace sinew::tools {

/// The function space of each piece (sections FELD to DVAL), made from its tetrahedra and the material of its clusters.
/// To be called when all else of the content stands. \return for the report: by piece what was made; nothing is, and
/// the report says why, where the settings ask for no functions.
/// \param cache keeps them; null: none does. \param draft those that are kept of the same tetrahedra and pins serve, in
/// new materials (reweighed()); the report says `draft` of a piece where they do.
nlohmann::ordered_json addFields(const Settings& settings, formats::PackageContent& content,
                                 StageCache* cache = nullptr, bool draft = false);

/// Takes all sections of fields out again.
void removeFields(formats::PackageContent& content);

}  // namespace sinew::tools
