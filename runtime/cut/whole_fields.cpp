// SPDX-License-Identifier: MIT
#include "runtime/cut/fields.h"

namespace sinew::cutting {

void addWholeFields(const FieldInput& input, formats::PackageContent& content) {
  const formats::PackageView& package = input.package;
  const PartPiece& piece = input.piece;
  const auto append = [](auto& to, const auto& from, std::size_t first, std::size_t count) {
    to.insert(to.end(), from.begin() + std::ptrdiff_t(first), from.begin() + std::ptrdiff_t(first + count));
  };
  for (std::uint32_t f = 0; f < package.fields().size(); ++f) {
    formats::Field field = package.fields()[f];
    if (field.piece != piece.source) continue;
    const std::size_t k = field.function_count, unknowns = 3 * (k - field.driven_count);
    const formats::Field from = field;
    field.piece = piece.piece;
    field.first_function = std::uint32_t(content.field_functions.size());
    field.first_pack = std::uint32_t(content.field_packs.size());
    field.first_gradient = std::uint32_t(content.field_gradients.size());
    field.first_value = std::uint32_t(content.field_values.size());
    field.first_point = std::uint32_t(content.field_points.size());
    field.first_point_value = std::uint32_t(content.field_point_values.size());
    field.first_mode = std::uint32_t(content.field_modes.size());
    append(content.field_functions, package.fieldFunctions(), from.first_function, k);
    for (std::size_t j = 0; j < k; ++j) {
      formats::FieldFunction& function = content.field_functions[field.first_function + j];
      if (function.pin_set != formats::kNone) function.pin_set = input.pin_sets[function.pin_set];
    }
    append(content.field_packs, package.fieldPacks(), from.first_pack, from.pack_count);
    for (std::size_t p = 0; p < from.pack_count; ++p) {
      for (std::uint32_t& c : content.field_packs[field.first_pack + p].cluster) {
        if (c != formats::kNone) c = input.clusters[c];
      }
    }
    append(content.field_gradients, package.fieldGradients(), from.first_gradient, 3 * k * from.pack_count);
    append(content.field_values, package.fieldValues(), from.first_value, k * ((std::size_t(piece.count) + 7) / 8));
    append(content.field_points, package.fieldPoints(), from.first_point, from.point_count);
    append(content.field_point_values, package.fieldPointValues(), from.first_point_value,
           k * ((std::size_t(from.point_count) + 7) / 8));
    append(content.field_modes, package.fieldModes(), from.first_mode, (unknowns + 1) * ((unknowns + 7) / 8));
    const auto index = std::uint32_t(content.fields.size());
    for (const formats::FieldFibre& fibre : package.fieldFibres()) {
      if (fibre.field != f) continue;
      content.field_fibres.push_back(
          {index, input.clusters[fibre.cluster], std::uint32_t(content.field_fibre_values.size()), fibre.tension});
      append(content.field_fibre_values, package.fieldFibreValues(), fibre.first_value, k);
    }
    for (const formats::FieldTethers& tethers : package.fieldTethers()) {
      if (tethers.field != f) continue;
      content.field_tethers.push_back({index, std::uint32_t(content.field_tether_values.size())});
      append(content.field_tether_values, package.fieldTetherValues(), tethers.first_value, k * k);
    }
    content.fields.push_back(field);
  }
}

}  // namespace sinew::cutting
