// SPDX-License-Identifier: MIT
//
// What holds a piece at run time, and how it gives way there. The functions of a field meet a hold only with their own
// compliance; what they lack, G = R R^T + D of its FRES section, lies between them and the hold. So b, by how much the
// functions are off at the held vertices, costs 1/2 b^T S b, S = (R R^T + D)^-1 (docs/method.md §4).
#pragma once

#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/solver/piece.h"
#include "runtime/world/body.h"

namespace sinew::internal {

struct MinimizeScratch;

inline bool isIn(const Field& field, std::uint32_t vertex) {
  return vertex >= field.first_vertex && vertex - field.first_vertex < field.vertex_count;
}

/// Whether the field itself holds a set: its functions and tethers do.
bool isDriven(const Piece& piece, const PinSet& set);

/// A vertex of the piece that springs hold.
struct HeldVertex {
  std::uint32_t vertex;
  double weight;      ///< 0..1
  std::uint32_t set;  ///< the pin set's number, or kNone
  Vec3 local;         ///< place in the set's transform, m
  const Pin* pin;     ///< null where a set holds it

  /// Where it is to be, m. \param part of the last step that has passed, 0..1.
  Vector3d target(const Body& body, double part = 1) const {
    if (pin == nullptr) {
      const PinSet& of = body.pin_sets[set];
      return part < 1 ? placeOf(between(of.before, of.at, part), local) : placeOf(of.at, local);
    }
    const Vector3d at = asVector(pin->at).cast<double>();
    return part < 1 ? Vector3d((1 - part) * asVector(pin->before).cast<double>() + part * at) : at;
  }
};

/// Calls visit(HeldVertex) for each.
template <class Visit>
void forEachHeld(const Body& body, const Piece& piece, const Visit& visit) {
  const Field& field = piece.field();
  for (const Pin& pin : body.pins) {
    if (isIn(field, pin.vertex)) visit(HeldVertex{pin.vertex, 1.0, formats::kNone, {}, &pin});
  }
  for (std::uint32_t s = 0; s < body.pin_sets.size(); ++s) {
    const PinSet& set = body.pin_sets[s];
    if (isDriven(piece, set)) continue;
    for (const PinnedVertex& held : set.vertices) {
      if (!(held.weight > 0) || !isIn(field, held.vertex)) continue;
      visit(HeldVertex{held.vertex, double(held.weight), s, held.local, nullptr});
    }
  }
}

/// Takes the memory of a piece's holds where pins or pin sets have come. May throw.
void reserveHolds(Body& body, Piece& piece);
/// The same of the scratch that makeHolds() needs. May throw.
void reserveHolds(const Piece& piece, MinimizeScratch& scratch);

/// Makes piece.holds where pins or pin sets have changed; count is 0 where nothing is held, or the field does not know
/// how it gives way. \pre reserved
void makeHolds(const Body& body, Piece& piece, MinimizeScratch& scratch);

/// Where a piece is, as springs see it.
struct PlacedShape {
  ConstCoefficientMap z;  ///< coefficients
  Vector3d center;        ///< a place near the piece: functions add up to 1 to the digits of floats only
  Matrix3d turned;        ///< the frame of what holds it
};

/// The rotation from the held vertices at rest to where they are to be; where these leave it open, as one vertex does,
/// the frame of the piece. What gives way is near what holds, and turns with it.
Matrix3d frameOf(const Body& body, const Piece& piece, double part, const Matrix3d& of_piece);

/// b: by how much the functions are off at the held vertices, three numbers each, in their frame, m; then
/// zeros to the columns of Holds::rows.
/// \param part of the last step that has passed: where the holds are
void findOffsets(const Body& body, const Piece& piece, const PlacedShape& shape, double part, Array<float>& offsets);

/// \param row of Holds::rows \return what it answers to offsets, N (times a factor on moduli)
float answerOf(const Holds& holds, std::size_t row, std::span<const float> offsets);

/// Amplitudes of the residual modes at offsets: R^T S b, pulling back. \param[out] amplitudes r
void findAmplitudes(const Piece& piece, std::span<const float> offsets, Array<float>& amplitudes);
/// Adds those of a force at a point, in the frame of the amplitudes, N (over a factor on moduli).
void addAmplitudes(const Field& field, const PickedPoint& point, const Vector3d& force, Array<float>& amplitudes);
/// Mean compliance in the three directions of a point in the residual modes, m/N; 0 where they are not known.
double ownCompliance(const Field& field, const PickedPoint& point);

/// Moves the piece's vertices by the residual modes. \param turned the frame of the amplitudes. \param x of its vertices
void giveWay(const Field& field, const Array<float>& amplitudes, const Matrix3d& turned, Vec3* x);

}  // namespace sinew::internal
