// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "tools/field/answers.h"

namespace sinew::tools::field {

/// Adds what a free space lacks of the piece's answer to forces, its residual flexibility (MacNeal 1971; Rubin 1975):
/// G = K^-1 - B (B^T K B)^-1 B^T, both without their rigid part, B the functions for x, y and z. As P P^T + D: the
/// columns of P are the r eigenvectors of largest eigenvalue, the modes behind the functions, each times its root; D is
/// diagonal, what they leave of a vertex's own answer.
///
/// P is found by iterating on a random subspace (Halko, Martinsson, Tropp 2011, algorithm 4.4), with a Nystroem
/// factor at the end, so that G - P P^T stays positive semidefinite. D is (K_vv)^-1, the answer where all other
/// vertices stay, times a constant that is measured at some vertices.
/// @param count of modes, at most; 0: none
void addResidual(const Elastic& elastic, const Answers& answers, Index count, FieldSpace& space);

}  // namespace sinew::tools::field
