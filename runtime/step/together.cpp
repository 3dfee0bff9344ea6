// SPDX-License-Identifier: MIT
#include "runtime/step/together.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <mutex>

#include "runtime/contact/firmness.h"
#include "runtime/kernels/kernels.h"
#include "runtime/solver/for_each.h"
#include "runtime/step/body_state.h"
#include "runtime/step/piece_step.h"
#include "runtime/step/rigid.h"
#include "runtime/step/sleep.h"

namespace sinew::internal {
namespace {

void addBox(const Body& body, std::uint32_t body_index, std::uint32_t piece_index, const Vector3d& gravity, double h,
            TogetherScratch& scratch) {
  const Piece& piece = body.pieces[piece_index];
  if (piece.field().points.empty() || body.activity == Activity::disabled) return;
  const bool stands = body.activity != Activity::active;
  const Vector3d own_gravity = double(body.settings.gravity_scale) * gravity;
  const Eigen::AlignedBox3d box =
      body.asleep() && !stands ? piece.box : boxOf(body, piece, own_gravity, stands ? 0 : h, scratch.points);
  scratch.boxes.push_back({body_index,
                           piece_index,
                           {box.min()[0], box.min()[1], box.min()[2]},
                           {box.max()[0], box.max()[1], box.max()[2]}});
}

bool mayTouch(const BodySettings& a, const BodySettings& b) {
  return (a.layers & b.touches) != 0 && (b.layers & a.touches) != 0;
}

/// Whether a body's surface touches itself.
bool touchesItself(const Body& body) { return body.settings.self_contact && body.activity == Activity::active; }

}  // namespace

std::uint32_t rootOf(Array<std::uint32_t>& parent, std::uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

std::uint32_t placeOf(const BodyList& bodies, std::uint32_t id) {
  const auto comes_before = [](const BodyPointer& body, std::uint32_t value) { return body->id < value; };
  return std::uint32_t(std::lower_bound(bodies.begin(), bodies.end(), id, comes_before) - bodies.begin());
}

Eigen::AlignedBox3d boxOf(const Body& body, const Piece& piece, const Vector3d& gravity, double h,
                          Array<float>& heights) {
  const Field& field = piece.field();
  const std::uint32_t blocks = std::uint32_t((field.points.size() + 7) / 8);
  const Vector3d center = meanOf(field, piece.z());
  if (heights.size() < 8 * std::size_t(blocks)) heights.resize(8 * std::size_t(blocks));
  Eigen::AlignedBox3d box;
  if (field.points.empty()) return box;
  const double margin = kMargin * double(body.package().info().diagonal);
  for (int axis = 0; axis < 3; ++axis) {
    float low = 1e30F, high = -1e30F;
    for (const bool later : {false, true}) {
      if (later && !(h > 0)) break;
      std::array<float, 1024> along;
      for (std::uint32_t j = 0; j < field.k; ++j) {
        const double one = oneOf(field, j);
        double x = piece.state.z[j][axis] - one * center[axis];
        if (later) x += h * (piece.state.v[j][axis] + one * h * gravity[axis]);
        along[j] = float(x);
      }
      kernels().field_heights({field.k, blocks, field.point_values, along.data(), heights.data()});
      for (std::size_t p = 0; p < field.points.size(); ++p) {
        low = std::min(low, heights[p]);
        high = std::max(high, heights[p]);
      }
    }
    box.min()[axis] = center[axis] + double(low) - margin;
    box.max()[axis] = center[axis] + double(high) + margin;
  }
  return box;
}

void findPairs(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch) {
  scratch.boxes.clear();
  scratch.pairs.clear();
  scratch.order.clear();
  scratch.busy.resize(bodies.size());
  std::fill(scratch.busy.begin(), scratch.busy.end(), std::uint8_t{0});
  if (!settings.collisions) return;
  if (bodies.size() < 2 && (bodies.empty() || !touchesItself(*bodies[0]))) return;
  const Vector3d gravity = asVector(settings.gravity).cast<double>();
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    for (std::uint32_t p = 0; p < bodies[b]->pieces.size(); ++p) addBox(*bodies[b], b, p, gravity, seconds, scratch);
  }
  const auto& boxes = scratch.boxes;
  if (boxes.empty()) return;
  // Sorted by their lower ends along x, in floats about the first: equal ones in their order.
  const double origin = boxes[0].low[0];
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    scratch.order.push_back(std::uint64_t(sortable(float(boxes[i].low[0] - origin))) << 32 | i);
  }
  sortAscending({scratch.order.data(), scratch.order.size()});
  for (std::size_t n = 0; n < scratch.order.size(); ++n) {
    const PieceBox& a = boxes[std::uint32_t(scratch.order[n])];
    const double tie = 1e-6 * (std::abs(a.high[0] - origin) + std::abs(a.low[0] - origin));
    for (std::size_t m = n + 1; m < scratch.order.size(); ++m) {
      const PieceBox& b = boxes[std::uint32_t(scratch.order[m])];
      if (b.low[0] > a.high[0] + tie) break;
      const bool may = a.body == b.body ? touchesItself(*bodies[a.body])
                                        : mayTouch(bodies[a.body]->settings, bodies[b.body]->settings);
      if (!may) continue;
      bool meet = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        meet = meet && a.low[axis] <= b.high[axis] && b.low[axis] <= a.high[axis];
      }
      if (!meet) continue;
      const std::uint32_t i = std::uint32_t(scratch.order[n]), j = std::uint32_t(scratch.order[m]);
      scratch.pairs.push_back(std::uint64_t(std::min(i, j)) << 32 | std::max(i, j));
    }
  }
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    if (touchesItself(*bodies[boxes[i].body])) scratch.pairs.push_back(std::uint64_t(i) << 32 | i);
  }
  sortAscending({scratch.pairs.data(), scratch.pairs.size()});
  // What moves wakes what it meets, and that what it meets.
  const auto body_of = [&](std::uint32_t box) -> Body& { return *bodies[boxes[box].body]; };
  for (bool woke = true; woke;) {
    woke = false;
    for (const std::uint64_t pair : scratch.pairs) {
      Body *a = &body_of(std::uint32_t(pair >> 32)), *b = &body_of(std::uint32_t(pair));
      if (a->asleep()) std::swap(a, b);
      if (a->asleep() || !b->asleep() || b->activity != Activity::active || a->still > 0) continue;
      wake(bodies, *b);
      woke = true;
    }
  }
  std::size_t kept = 0;
  for (const std::uint64_t pair : scratch.pairs) {
    const Body &a = body_of(std::uint32_t(pair >> 32)), &b = body_of(std::uint32_t(pair));
    if ((a.asleep() && (a.activity == Activity::active || b.asleep())) ||
        (b.asleep() && b.activity == Activity::active)) {
      continue;
    }
    scratch.pairs[kept++] = pair;
    for (const std::uint32_t body : {boxes[pair >> 32].body, boxes[std::uint32_t(pair)].body}) {
      scratch.busy[body] = &a == &b ? std::max(scratch.busy[body], kBusyWithItself) : kBusyWithOthers;
    }
  }
  scratch.pairs.resize(kept);
}

void keepSleeping(const BodyList& bodies, TogetherScratch& scratch) {
  for (const TouchMemory& touch : scratch.touching) {
    const std::uint32_t a = placeOf(bodies, touch.body_a), b = placeOf(bodies, touch.body_b);
    if (a >= bodies.size() || b >= bodies.size()) continue;
    const Body &one = *bodies[a], &other = *bodies[b];
    if (one.id != touch.body_a || other.id != touch.body_b || !one.asleep() || !other.asleep()) continue;
    scratch.next_touching.push_back(touch);
  }
}

namespace {

/// Pairs that a thread takes at once.
constexpr std::uint32_t kPairsAJob = 8;

/// What is stepped together: one step for each piece of a busy body, in the order of boxes.
class Together {
 public:
  Together(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs)
      : bodies_(bodies), world_(world), seconds_(seconds), scratch_(scratch), jobs_(jobs) {}

  void run() {
    begin();
    predict();
    look();
    stepIslands();
    finish();
  }

 private:
  /// Calls visit(box, body, piece) for what is stepped.
  template <class Visit>
  void forEachBusy(const Visit& visit) {
    for (std::uint32_t i = 0; i < scratch_.boxes.size(); ++i) {
      const PieceBox& box = scratch_.boxes[i];
      if (scratch_.busy[box.body] != 0) visit(i, *bodies_[box.body], bodies_[box.body]->pieces[box.piece]);
    }
  }

  /// All that takes memory.
  void begin() {
    TogetherScratch& s = scratch_;
    s.places.resize(s.boxes.size());
    s.steps.clear();
    s.before_at.clear();
    std::uint32_t before = 0, points = 0, own_points = 0;
    forEachBusy([&](std::uint32_t, const Body& body, const Piece& piece) {
      if (s.pieces.size() <= s.before_at.size()) s.pieces.emplace_back(s.touching.memory());
      PieceScratch& own = s.pieces[s.before_at.size()];
      own.reserve(piece);
      own.contacts.near.reserve(world_.colliders.size());
      s.before_at.push_back(before);
      before += 4 * piece.field().k;
      points += std::uint32_t(pointFloats(piece.field()));
      if (touchesItself(body)) own_points += std::uint32_t(piece.field().points.size());
    });
    s.own_order.resize(own_points);
    s.own_normals.resize(own_points);
    s.before.resize(before);
    s.points.resize(points);
    s.seen.resize(s.before_at.size());
    forEachBusy([&](std::uint32_t box, Body& body, Piece& piece) {
      const std::size_t i = s.steps.size();
      s.places[box] = std::uint32_t(i);
      s.seen[i].body = body.id;
      s.steps.emplace_back(body, piece, world_, seconds_, s.pieces[i]);
    });
    // What touched itself goes on by one step each, as what meets others does.
    for (const TouchMemory& touch : s.touching) {
      const std::uint32_t body = placeOf(bodies_, touch.body_a);
      if (touch.body_a != touch.body_b || body >= bodies_.size() || bodies_[body]->id != touch.body_a) continue;
      if (s.busy[body] == 0) continue;
      s.busy[body] = kBusyWithOthers;
    }
  }

  void predict() {
    TogetherScratch& s = scratch_;
    s.body_of.resize(s.steps.size());
    forEachBusy([&](std::uint32_t box, const Body&, const Piece&) { s.body_of[s.places[box]] = s.boxes[box].body; });
    forEachStep([&](std::uint32_t i) {
      s.steps[i].begin();
      if (s.busy[s.body_of[i]] == kBusyWithOthers) s.steps[i].useEuler();
    });
    const auto count = std::uint32_t(s.steps.size());
    std::size_t points = 0, own_points = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const std::size_t size = pointFloats(s.steps[i].field()), number = s.steps[i].field().points.size();
      s.seen[i].points = {s.points.data() + points, size};
      points += size;
      if (!touchesItself(*bodies_[s.body_of[i]])) continue;
      s.seen[i].order = {s.own_order.data() + own_points, number};
      s.seen[i].normals = {s.own_normals.data() + own_points, number};
      own_points += number;
    }
    forEach(jobs_, count, kPiecesAJob, [&](std::uint32_t i) { see(i); });
  }

  /// Where a step's prediction has its piece.
  void see(std::uint32_t i) {
    TogetherScratch& s = scratch_;
    const TouchingPiece room = s.seen[i];
    TouchingPiece& seen = s.seen[i];
    seen = s.steps[i].touchingPiece({s.before.data() + s.before_at[i], 4 * std::size_t(s.steps[i].field().k)});
    seen.points = room.points;
    seen.order = room.order;
    seen.normals = room.normals;
    placePoints(seen);
  }

  /// Looks for touches. Each thread has a list that does not grow; what it finds it hands over.
  void look() {
    TogetherScratch& s = scratch_;
    s.found.touches.clear();
    s.found.rows.clear();
    const auto count = std::uint32_t(s.pairs.size());
    s.pair_touches.resize(count);
    std::size_t most = 0, touches = 0;
    for (PieceStep& step : s.steps) {
      most = std::max(most, std::size_t(step.field().k));
      touches = std::max(touches, step.field().points.size());
    }
    touches *= 2;  // both ways
    const std::uint32_t lanes = jobs_ == nullptr ? 1 : std::clamp(jobs_->concurrency(), 1U, 64U);
    while (s.lanes.size() < lanes) s.lanes.emplace_back(s.touching.memory());
    for (TouchList& lane : s.lanes) {
      lane.touches.reserve(touches);
      lane.rows.reserve(2 * most * touches);
    }
    std::atomic<std::uint32_t> next = 0;
    std::mutex handing_over;
    forEach(jobs_, lanes, 1, [&](std::uint32_t lane) {
      TouchList& own = s.lanes[lane];
      for (std::uint32_t begin = next.fetch_add(kPairsAJob); begin < count; begin = next.fetch_add(kPairsAJob)) {
        for (std::uint32_t pair = begin; pair < std::min(count, begin + kPairsAJob); ++pair) {
          own.touches.clear();
          own.rows.clear();
          lookAt(s.pairs[pair], own);
          s.pair_touches[pair] = {0, 0};
          if (own.touches.empty()) continue;
          const std::lock_guard lock(handing_over);
          s.pair_touches[pair] = s.found.add(own);
        }
      }
    });
    lookAgain();
  }

  /// What has begun to touch itself goes on by one step, not by two.
  void lookAgain() {
    TogetherScratch& s = scratch_;
    const auto body_of = [&](std::uint64_t pair) { return s.boxes[pair >> 32].body; };
    bool changed = false;
    for (std::size_t pair = 0; pair < s.pairs.size(); ++pair) {
      std::uint8_t& busy = s.busy[body_of(s.pairs[pair])];
      if (s.pair_touches[pair].count == 0 || busy != kBusyWithItself) continue;
      busy = kBusyAnew;
      changed = true;
    }
    if (!changed) return;
    for (std::uint32_t i = 0; i < s.steps.size(); ++i) {
      if (s.busy[s.body_of[i]] != kBusyAnew) continue;
      s.steps[i].useEuler();
      see(i);
    }
    TouchList& own = s.lanes[0];
    for (std::size_t pair = 0; pair < s.pairs.size(); ++pair) {
      if (s.busy[body_of(s.pairs[pair])] != kBusyAnew) continue;
      own.touches.clear();
      own.rows.clear();
      lookAt(s.pairs[pair], own);
      s.pair_touches[pair] = s.found.add(own);
    }
  }

  void lookAt(std::uint64_t pair, TouchList& list) const {
    const std::uint32_t a = scratch_.places[pair >> 32], b = scratch_.places[std::uint32_t(pair)];
    const std::span<const TouchMemory> known(scratch_.touching.data(), scratch_.touching.size());
    findTouches(scratch_.seen[a], scratch_.seen[b], a, b, seconds_, known, list);
    if (a != b) findTouches(scratch_.seen[b], scratch_.seen[a], b, a, seconds_, known, list);
  }

  /// By island, members and pairs in their order.
  void stepIslands() {
    TogetherScratch& s = scratch_;
    const auto count = std::uint32_t(s.steps.size());
    s.parent.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) s.parent[i] = i;
    const auto one_of = [&](std::size_t pair) { return s.places[s.pairs[pair] >> 32]; };
    for (std::size_t pair = 0; pair < s.pairs.size(); ++pair) {
      if (s.pair_touches[pair].count == 0) continue;
      const std::uint32_t a = rootOf(s.parent, one_of(pair)),
                          b = rootOf(s.parent, s.places[std::uint32_t(s.pairs[pair])]);
      s.parent[std::max(a, b)] = std::min(a, b);
    }
    s.alone.resize(count);
    std::fill(s.alone.begin(), s.alone.end(), std::uint8_t{0});
    s.members.clear();
    s.touching_pairs.clear();
    for (std::uint32_t i = 0; i < count; ++i) s.members.push_back(std::uint64_t(rootOf(s.parent, i)) << 32 | i);
    for (std::uint32_t pair = 0; pair < s.pairs.size(); ++pair) {
      if (s.pair_touches[pair].count == 0) continue;
      s.touching_pairs.push_back(std::uint64_t(rootOf(s.parent, one_of(pair))) << 32 | pair);
    }
    sortAscending({s.members.data(), s.members.size()});
    sortAscending({s.touching_pairs.data(), s.touching_pairs.size()});
    s.next_touching.resize(s.found.touches.size());
    std::size_t remembered = 0;
    std::size_t p = 0;
    for (std::size_t m = 0; m < s.members.size();) {
      const std::uint64_t root = s.members[m] >> 32;
      s.ids.clear();
      s.own.clear();
      for (; m < s.members.size() && s.members[m] >> 32 == root; ++m) s.ids.push_back(std::uint32_t(s.members[m]));
      for (; p < s.touching_pairs.size() && s.touching_pairs[p] >> 32 == root; ++p) {
        const TouchRange range = s.pair_touches[std::uint32_t(s.touching_pairs[p])];
        for (std::uint32_t i = 0; i < range.count; ++i) s.own.push_back(&s.found.touches[range.first + i]);
      }
      s.alone[s.ids[0]] = s.own.empty() ? 1 : 0;
      if (s.own.empty()) continue;
      for (const std::uint32_t id : s.ids) s.steps[id].setTogether();
      Island({s.ids.data(), s.ids.size()}, s.steps, {s.seen.data(), s.seen.size()}, {s.own.data(), s.own.size()},
             {s.found.rows.data(), s.found.rows.size()}, s.island, jobs_)
          .run(seconds_, world_.settings, {s.next_touching.data() + remembered, s.own.size()});
      remembered += s.own.size();
    }
    s.next_touching.resize(remembered);
    forEachStep([&](std::uint32_t i) {
      if (s.alone[i] != 0) s.steps[i].finishAlone();
    });
  }

  /// Calls visit for each step. Pieces of a body share what they report.
  template <class Visit>
  void forEachStep(const Visit& visit) {
    const auto body_of = [this](std::uint32_t i) { return scratch_.seen[i].body; };
    forEachByBody(jobs_, std::uint32_t(scratch_.steps.size()), kPiecesAJob, body_of, visit);
  }

  void finish() {
    forEachBusy([&](std::uint32_t box, Body& body, Piece& piece) {
      body.outdated = true;
      if (scratch_.boxes[box].piece == 0) body.repaired = 0;
      if (isUsable(piece)) return;
      restPiece(body, piece);
      body.repaired += piece.field().vertex_count;
    });
    keepSleeping(bodies_, scratch_);
    std::sort(scratch_.next_touching.begin(), scratch_.next_touching.end(),
              [](const TouchMemory& x, const TouchMemory& y) { return touchOrder(x) < touchOrder(y); });
    scratch_.touching.swap(scratch_.next_touching);
  }

  BodyList& bodies_;
  const StepWorld& world_;
  const double seconds_;
  TogetherScratch& scratch_;
  JobSystem* jobs_;
};

}  // namespace

void stepTogether(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs) {
  Together(bodies, world, seconds, scratch, jobs).run();
}

}  // namespace sinew::internal
