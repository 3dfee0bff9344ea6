// SPDX-License-Identifier: MIT
//
// Fields for the runtime's small test packages, made without the tools: the constant, linear and quadratic monomials.
#pragma once

#include "sinew/formats/writer.h"

namespace sinew::test {

/// Gives each body of a package one free field (sections FELD ..., docs/package-format.md): ten monomials, orthonormal
/// under the masses and diagonal under the stiffness, with a sample of the energy at each tetrahedron's centre. The
/// body's first cluster says how stiff: Young's modulus, or that of a bar as long as the body whose lowest stretch has
/// the cluster's frequency.
void addFields(formats::PackageContent& content);

/// Gives each free field residual modes (FRES): waves, as firm as the body's mass at 30 Hz.
void addResiduals(formats::PackageContent& content);

}  // namespace sinew::test
