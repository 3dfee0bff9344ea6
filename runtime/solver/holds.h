// SPDX-License-Identifier: MIT
//
// Holds of a piece at run time, and how it gives way there. The functions of a field meet a hold only with their own
// compliance; what they lack, G = P P^T + D of its FRES section, lies between them and the hold. So b, by how much the
// functions are off at the held vertices, costs 1/2 b^T S b, S = (P P^T + D)^-1 (docs/method.md §4).
#pragma once

#include <span>

#include "runtime/clusters/algebra.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/kernels/kernels.h"
#include "runtime/solver/piece.h"
#include "runtime/world/body.h"

namespace sinew::internal {

struct MinimizeScratch;

inline bool isIn(const Field& field, std::uint32_t vertex) {
  return vertex >= field.first_vertex && vertex - field.first_vertex < field.vertex_count;
}

/// Whether the field itself holds a set: its functions and tethers do.
bool isDriven(const Piece& piece, const PinSet& set);

/// A point of the piece that something holds.
struct HeldPoint {
  PickedPoint at;
  double weight = 1;                   ///< 0..1, of a vertex of a pin set
  std::uint32_t set = formats::kNone;  ///< the pin set's number, or kNone
  Vec3 local = {};                     ///< place in the set's transform, m
  const Pin* pin = nullptr;            ///< or the set holds it

  /// Where a pin or set wants it, m.
  Vector3d target(const Body& body) const {
    return pin == nullptr ? placeOf(body.pin_sets[set].at, local) : Vector3d(asVector(pin->at).cast<double>());
  }
};

/// Calls visit(HeldPoint) for each vertex of the piece that pins hold and springs are to keep there.
template <class Visit>
void forEachPinned(const Body& body, const Piece& piece, const Visit& visit) {
  const Field& field = piece.field();
  HeldPoint held;
  held.at.weight[0] = 1;
  for (const Pin& pin : body.pins) {
    if (!isIn(field, pin.vertex)) continue;
    held.at.vertex[0] = pin.vertex;
    held.pin = &pin;
    visit(std::as_const(held));
  }
  held.pin = nullptr;
  for (held.set = 0; held.set < body.pin_sets.size(); ++held.set) {
    const PinSet& set = body.pin_sets[held.set];
    if (isDriven(piece, set)) continue;
    for (const PinnedVertex& pinned : set.vertices) {
      if (!(pinned.weight > 0) || !isIn(field, pinned.vertex)) continue;
      held.at.vertex[0] = pinned.vertex;
      held.weight = double(pinned.weight);
      held.local = pinned.local;
      visit(std::as_const(held));
    }
  }
}

/// phi_j at a point; 0 where it is none of the piece's.
double valueAt(const Field& field, const PickedPoint& point, std::uint32_t j);

struct PickSpring {
  double kappa = 0, damper = 0;  ///< N/m, N s/m
};
/// Of the mass that a pull of the pick's frequency moves, in series with what the functions lack at its point. \param
/// stiffness factor on the moduli
PickSpring springOf(const Piece& piece, const Pick& pick, float stiffness);

/// Takes the memory of a piece's holds where pins or pin sets have come. May throw.
void reserveHolds(Body& body, Piece& piece);
/// The same of the scratch that makeHolds() needs. May throw.
void reserveHolds(const Piece& piece, MinimizeScratch& scratch);

/// Makes piece.holds where pins or pin sets have changed; count is 0 where nothing is held, or the field does not know
/// how it gives way. \pre reserved
void prepareHolds(const Body& body, Piece& piece, float stiffness, MinimizeScratch& scratch);

/// A rigid motion: X is at turned X + moved.
struct RigidPlace {
  Matrix3d turned = Matrix3d::Identity();
  Vector3d moved = Vector3d::Zero();
};

/// From pinned vertices at rest to where they are to be; where these leave its rotation open, as one vertex does, or
/// nothing is pinned, as the piece. Yielding matter is near holds, and turns with them.
RigidPlace placeOfHolds(const Body& body, const Piece& piece, double part, const RigidPlace& of_piece);

/// Finds b = Phi w + l: w, the coefficients less those of the rest shape at a place, and l, by how much the held points
/// of that shape are off, both in its frame, m. Forces are S b: of w through one symmetric matrix, so that they have an
/// energy to the last digit and cannot drive a swing. \param z coefficients. \param part of the last step that has
/// passed: where the holds are
void findWays(const Body& body, const Piece& piece, const ConstCoefficientMap& z, const RigidPlace& place, double part,
              HoldWays& ways);
/// w alone.
void findWays(const Piece& piece, const ConstCoefficientMap& z, const RigidPlace& place, HoldWays& ways);

/// \param row of Holds \return what it answers to b, N (times a factor on moduli)
double answerOf(const Holds& holds, const HoldWays& ways, std::size_t row);

/// Amplitudes of the residual modes: P^T S b, pulling back. \param[out] amplitudes r
void findAmplitudes(const Piece& piece, const HoldWays& ways, Array<float>& amplitudes);
/// Finds the amplitudes that picks alone would have: P^T f. Modes cut off at the last ring all over the piece where a
/// point is pulled; what is given way to a pick is drawn near it alone, by PickWindow. \param z coefficients drawn.
/// \param turned the frame of the amplitudes. \param[out] amplitudes r. \return how many picks there are
std::uint32_t findPickAmplitudes(const Body& body, const Piece& piece, const ConstCoefficientMap& z,
                                 const Matrix3d& turned, Array<float>& amplitudes);
/// 1 at the piece's picked points, 0 from R = D / k^(1/3) on, about a wave of the functions: (1 - d^2 / R^2)^2 of the
/// distance d at rest to the nearest. D is the diagonal of a box as spread out as the piece: D^2 / 12 is the mean
/// square of the distance from its centre.
class PickWindow {
 public:
  PickWindow(const Body& body, const Piece& piece);
  /// \param vertex its number in the body
  float operator()(std::uint32_t vertex) const;

 private:
  const Body& body_;
  const Field& field_;
  double reach2_ = 0;  // R^2
};
/// Moves the piece's first vertices by the residual modes. \param turned the frame of the amplitudes. \param ways
/// scratch, 24 for every eight vertices. \param x of these. \param window called with the number of a vertex in the
/// body: factor of its way
template <class Window>
void giveWay(const Field& field, const Array<float>& amplitudes, const Matrix3d& turned, Array<float>& ways,
             std::span<Vec3> x, const Window& window) {
  const std::uint32_t blocks = std::uint32_t((x.size() + 7) / 8);
  ways.resize(24 * std::size_t(blocks));
  kernels().residual_values({field.residual_modes, blocks, field.residual, amplitudes.data(), ways.data()});
  const Matrix3 frame = field.residual_scale * turned.cast<float>();
  for (std::uint32_t v = 0; v < x.size(); ++v) {
    const float* const way = ways.data() + 24 * (v / 8) + v % 8;
    const Vector3 moved = frame * Vector3(way[0], way[8], way[16]);
    x[v] = asArray(Vector3(asVector(x[v]) + window(field.first_vertex + v) * moved));
  }
}

}  // namespace sinew::internal
