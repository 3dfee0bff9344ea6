// SPDX-License-Identifier: MIT
//
// Touches: contact points of one piece that are under the drawn surface of another (docs/method.md §4).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>

#include "runtime/contact/depth_map.h"
#include "runtime/memory/array.h"
#include "runtime/solver/minimize.h"

namespace sinew::internal {

/// The part of a touch that the next step needs, and what World::contacts() tells of it.
struct TouchMemory {
  std::uint32_t body_a, piece_a, body_b, piece_b, point;  ///< a's point; by these in this order
  float floor;                                            ///< Push::floor, m
  float depth;                                            ///< below that, m; not above 0: it did not push
  float kappa;                                            ///< Push::kappa, N/m
  std::array<float, 3> anchor;                            ///< rest place of b where friction holds it, metres
  std::array<float, 3> outward;                           ///< way out of b's rest shape there, unit
  std::uint32_t parting;                                  ///< 1: the two started inside one another, and it is still
  std::array<float, 3> normal = {};                       ///< out of b, unit, world
  std::array<float, 3> force = {};                        ///< on a's point in the step, N, world
  float speed = 0;                                        ///< m/s at which it came, if it did not push before
};

/// A piece as contacts see it in a step.
struct TouchingPiece {
  std::uint32_t body = 0, piece = 0;  ///< BodyId, BODY record
  const Field* field = nullptr;
  const DepthMap* map = nullptr;  ///< null: only its own points touch
  const float* base = nullptr;    ///< predicted coefficients relative to the centre, k x 4
  const float* before = nullptr;  ///< those before the step, relative to the same place
  Vector3d center = Vector3d::Zero();
  Eigen::Vector3f center_before = Eigen::Vector3f::Zero();  ///< before the step, relative to it, m
  float stirring = 0;                                       ///< way in the step against the centre, at most, m
  Eigen::Vector3f fall = Eigen::Vector3f::Zero();           ///< ContactStep::fall
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();       ///< of the prediction
  Eigen::Vector3f rest_center = Eigen::Vector3f::Zero();
  double mass = 0;    ///< kg; infinite: it does not move
  double weight = 0;  ///< N, with at least kLeastGravity
  double diagonal = 0;
  float stiffness = 1, friction = 0, damping_ratio = 0;
  double firmer = 1;                   ///< Collider::firmer(), of what it touches
  std::span<const TouchMemory> known;  ///< touches of its points in the last step, sorted
  std::span<float> points;             ///< x of all, y of all, z of all, relative to the centre
  /// Of what touches itself, else empty: room for one number a point, and for the normals of the bent surface there.
  std::span<std::uint64_t> order;
  std::span<Eigen::Vector3f> normals;
  // By placePoints():
  Eigen::Vector3f low = Eigen::Vector3f::Zero(), high = Eigen::Vector3f::Zero();
  Eigen::Vector3f belt = Eigen::Vector3f::Zero();  ///< way of its surface against itself, m
  float bent = 0;                                  ///< how far they are from where a rigid motion has them, at most
};

/// The order of touches.
inline std::array<std::uint32_t, 5> touchOrder(const TouchMemory& m) {
  return {m.body_a, m.piece_a, m.body_b, m.piece_b, m.point};
}

/// Calls visit for the touches of one pair of pieces after the other, as far as they lie together.
template <class Visit>
void forEachPair(std::span<const TouchMemory> touches, const Visit& visit) {
  const auto pairOf = [](const TouchMemory& m) { return std::array{m.body_a, m.piece_a, m.body_b, m.piece_b}; };
  for (std::size_t first = 0, end = 0; first < touches.size(); first = end) {
    while (end < touches.size() && pairOf(touches[end]) == pairOf(touches[first])) ++end;
    visit(touches.subspan(first, end - first));
  }
}

/// A touch as it is found: its rows are places in TouchList::rows.
struct FoundTouch {
  Touch touch;  ///< pieces as they were given to findTouches()
  std::uint32_t row_a, row_b;
  TouchMemory memory;
  bool held;                 ///< by friction, at memory.anchor
  float coming;              ///< speed at which it comes, m/s
  bool entered;              ///< on its way in this step
  Eigen::Matrix3f gradient;  ///< of b's deformation there; its turn where that is turned inside out
  Eigen::Vector3f place;     ///< rest place of b that it pushes at: where the point is, metres
  Eigen::Vector3f left_at;   ///< where its way out of b's rest shape ends, metres
  Eigen::Vector3f before;    ///< how far it was pressed in and slid before the step, m
  Eigen::Vector3f over;      ///< from left_at to a's point, at the prediction, metres
};

struct TouchList {
  explicit TouchList(std::pmr::memory_resource* memory) : touches(memory), rows(memory) {}
  /// Adds copies of another one's.
  Range add(const TouchList& other);

  Array<FoundTouch> touches;
  Array<float> rows;
};

/// Places a piece's points at the prediction. \pre TouchingPiece::points has room
void placePoints(TouchingPiece& piece);
/// Floats of TouchingPiece::points: three a point, rounded up to eight.
std::size_t pointFloats(const Field& field);

/// Adds the touches of a's points with b, which may be another piece of the same body, or a itself: of these not what
/// is so at rest. \param index_a, index_b what Touch names the pieces by. \param h of the step, s.
void findTouches(const TouchingPiece& a, const TouchingPiece& b, std::uint32_t index_a, std::uint32_t index_b, double h,
                 TouchList& list);
/// TouchingPiece::known of a piece. \param touches of the last step, sorted.
std::span<const TouchMemory> touchesOf(std::span<const TouchMemory> touches, std::uint32_t body, std::uint32_t piece);

/// The memory of a touch whose point moved so from the prediction, past the piece that it goes out of. Of a touch that
/// does not push it is the way out and the place.
TouchMemory rememberTouch(const FoundTouch& found, const Eigen::Vector3f& moved);

}  // namespace sinew::internal
