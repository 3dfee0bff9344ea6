// SPDX-License-Identifier: MIT
//
// Bodies whose pieces move in fields: at rest, as vertices, as energy.
#pragma once

#include "runtime/step/piece_step.h"
#include "runtime/world/body.h"

namespace sinew::internal {

/// Puts a piece at rest where the body was added.
void restPiece(const Body& body, Piece& piece);

/// Positions and velocities of a body's physical vertices from its pieces' coefficients, where they are outdated.
/// \param part of the last step that they are to show: between its two states, in the frame that turns with the piece.
void refresh(Body& body, double part, Asked what);

/// Coefficients that come nearest to the positions and velocities in Body::x and v. \param touching what touched a
/// collider still does.
void project(Body& body, bool touching = false);

/// Fibres are to be made anew, as the body's channels are activated. \param changed the shapes' energies are others
/// now.
void updateFibres(Body& body, bool changed = true);
/// Makes Piece::fibres where they have changed: before a step, and before energies are asked for.
void makeFibres(Body& body);

/// Chooses the field of each piece: the held one where all of the package's pin sets on it hold. \return whether one
/// changed.
bool chooseFields(Body& body);

/// The level of detail that a body is to have: what its settings ask for, as far as its package has it.
std::uint32_t levelOf(const Body& body);
/// A piece takes the fields of a level; its state does not follow.
void useLevel(const Body& body, Piece& piece, std::uint32_t level);
/// The pieces take the fields of levelOf(), and their state follows. The shape that this loses is drawn on for a
/// while. May throw.
void changeLevel(Body& body);
/// A step passes of that while.
void passFade(Body& body, double seconds);
/// It is over.
void endFade(Body& body);

/// Kinetic energy, and the elastic energy of the shape (made anew where it is not known), J.
double kineticEnergy(const Body& body);
double elasticEnergy(Body& body, PieceScratch& scratch);

}  // namespace sinew::internal
