// SPDX-License-Identifier: MIT
//
// Contacts of a piece with colliders, the ground among them: which of its contact points a step has to look at, and the
// plane that each is pushed out over.
#pragma once

#include "runtime/contact/collider.h"
#include "runtime/contact/touch.h"
#include "runtime/solver/minimize.h"
#include "runtime/solver/piece.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Contact points that one piece begins to carry with at most; of more that touch, the first in the package's order,
/// which spreads them over the surface, carry for all. One that carries goes on while fewer than kMostContacts come
/// before it: else those that sway at the edge of touching would exchange the last ones in each step. What lies inside
/// a shape and does not carry is remembered, for it is to leave by the way by which it came in.
inline constexpr std::uint32_t kMostCarrying = 96, kMostContacts = 128;
/// Points of a collider near a piece's surface that are looked for at most, and touches of all colliders' points.
inline constexpr std::uint32_t kMostLooked = 256;

/// PieceState::touching has at most so many; kMostContacts where all colliders are planes.
inline std::size_t mostTouching(const Field& field) { return kMostContacts + field.points.size(); }

/// A step as contacts see it.
struct ContactStep {
  std::span<const Collider* const> colliders;  ///< ids ascending
  const BodySettings* body;
  double h;              ///< s
  double diagonal;       ///< of the package, m
  Vector3d fall;         ///< of the prediction, which what holds a piece takes back, m
  double weight;         ///< of the piece: its mass times gravity, N
  float stiffness;       ///< factor on the moduli
  double damping_ratio;  ///< of contact points
};

/// Contact points that a plane may push, before the few that carry are chosen.
struct Candidate {
  std::uint32_t point, collider;     ///< of the field; number among those of the step
  bool near_before;                  ///< near it before the step
  bool stays;                        ///< near it at the prediction, but for its fall
  Vector3d normal;                   ///< of the plane, in the collider's coordinates, unit
  double offset;                     ///< of the plane along it, m
  bool inside = false;               ///< it begins within the collider
  bool touched = false;              ///< in the step before
  bool carries = false;              ///< it has become a contact
  Vector3d from = Vector3d::Zero();  ///< place before the step, in its coordinates
};

/// Memory for looking for contacts.
struct ContactScratch {
  explicit ContactScratch(std::pmr::memory_resource* memory)
      : places(memory), candidates(memory), near(memory), touches(memory) {}
  void reserve(const Field& field);
  /// What colliders take.
  void reserveNear(const Field& field, std::span<const Collider* const> all);

  Array<float> places;  ///< of the contact points: at the prediction, before
  Array<Candidate> candidates;
  Array<const Collider*> near;
  Vector3d reach = Vector3d::Zero();  ///< of the piece about its centre along each axis in the step, m
  TouchList touches;                  ///< with points of colliders
};

/// Where a contact point of a field is. \param center near it.
Vector3d positionOf(const Field& field, std::uint32_t point, const ConstCoefficientMap& z, const Vector3d& center);

/// Memory of a point and a collider from the last step; null where they did not touch.
const TouchingPoint* touchedBefore(const Piece& piece, std::uint32_t collider, std::uint32_t point);

/// Whether no collider is of another shape.
bool areAllPlanes(std::span<const Collider* const> all);

/// max over the contact points of |phi_j|, by function: what a bound of them is made of.
void findReach(const Field& field, Array<float>& reach);

/// Those colliders that the piece may reach in a step into scratch.near. \param all of the world. \param y predicted
/// coefficients. \param center near the piece.
void findNear(const Piece& piece, std::span<const Collider* const> all, const ContactStep& step,
              const ConstCoefficientMap& y, const Vector3d& center, ContactScratch& scratch);

/// Fills scratch.contacts and scratch.rows with contacts of the piece's own points. \param y predicted coefficients.
/// \param center what scratch.base is relative to.
void findContacts(const Piece& piece, const ContactStep& step, const ConstCoefficientMap& y, const Vector3d& center,
                  ContactScratch& lent, MinimizeScratch& scratch);

/// A collider that has a mass gives way in the step by h^2 / m for each force, so that its springs and it are in
/// series: 1/kappa + n h^2 / m, where n share the load.
void giveWay(const ContactStep& step, std::span<Contact> contacts);

/// Touches at the offset that the objective's scratch ends at become PieceState::touching, and the forces there times
/// `seconds` what the colliders get. \param given what the piece gave away of its momentum, if contacts alone took it,
/// N s: what minimizing leaves of it is shared out by load. \param center near the piece. \param[out] touches grows by
/// the colliders touched.
void rememberContacts(Piece& piece, const ContactStep& step, const Vector3d& center, ContactScratch& lent,
                      double seconds, const Vector3d* given, const Objective& objective, Array<ColliderTouch>& touches);

}  // namespace sinew::internal
