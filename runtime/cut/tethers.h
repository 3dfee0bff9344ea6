// SPDX-License-Identifier: MIT
//
// Tethers of partly held vertices: springs of a held field between them and where their pin sets would have them.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "runtime/cut/fields.h"
#include "runtime/cut/functions.h"

namespace sinew::cutting {

/// The matrix of tethers (section FTHV) of a part, k x k. A package has the sum over its vertices alone, so each is
/// made anew from its pin weight (PPIN, docs/method.md §2) and the sum is compared with the package's.
/// \param field of the package, held. \param local of the package's vertices: rows of the part's values.
/// \return of size 0 where there are none; nothing where the package has others: rigid clusters that share vertices.
std::optional<Eigen::MatrixXd> partTethers(const FieldInput& input, std::uint32_t field, const ParentField& parent,
                                           const PartFunctions& functions, const Eigen::MatrixXd& parent_values,
                                           const std::vector<std::uint32_t>& local);

}  // namespace sinew::cutting
