// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>

#include "sinew/formats/writer.h"
#include "tools/author/settings.h"
#include "tools/bake/fibres.h"
#include "tools/bake/stage_cache.h"
#include "tools/field/field.h"

namespace sinew::tools {

/// The function space of each piece (sections FELD to DVAL), made from its tetrahedra and the material of its clusters.
/// To be called when all else of the content stands. \return for the report: by piece what was made; nothing is, and
/// the report says why, where the settings ask for no functions.
/// \param cache keeps them; null: none does. \param draft fields kept of the same tetrahedra and pins serve, in
/// new materials (reweighed()); the report says `draft` of a piece where they do.
nlohmann::ordered_json addFields(const Settings& settings, formats::PackageContent& content,
                                 StageCache* cache = nullptr, bool draft = false);

/// Sources of a piece's fields, and all that finite elements need to be the same body.
struct PieceElasticity {
  std::uint32_t piece = 0;
  std::vector<std::uint32_t> vertices;                   ///< of the package: all that deforms
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;  ///< of these
  std::vector<Eigen::Vector3d> centres;                  ///< of each tetrahedron, m
  std::vector<double> young, poisson;                    ///< of each; Pa, or relative where lowest_hz is not 0
  double lowest_hz = 0;                                  ///< as FieldOptions::lowest_hz
  std::vector<std::vector<std::uint32_t>> held;          ///< vertices that a pin set holds wholly
  std::vector<std::uint32_t> pin_sets;                   ///< of each of `held`, into PSET
  std::vector<FieldTether> tethers;                      ///< what pin sets hold in part
  std::vector<Fibre> fibres;                             ///< in the order of FFIB
};
PieceElasticity elasticityOf(formats::PackageContent& content, std::uint32_t piece);

/// Takes all sections of fields out again.
void removeFields(formats::PackageContent& content);

}  // namespace sinew::tools
