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

/// Points whose places are found at once, a multiple of eight.
constexpr std::uint32_t kPointsAtOnce = 128;
/// Pairs that a thread takes at once.
constexpr std::uint32_t kPairsAJob = 8;

void findBox(const Body& body, const Vector3d& gravity, double h, PieceBox& box) {
  const Piece& piece = body.pieces[box.piece];
  const bool stands = body.activity != Activity::active;
  const Vector3d own_gravity = double(body.settings.gravity_scale) * gravity;
  const Eigen::AlignedBox3d found =
      body.asleep() && !stands ? piece.box : boxOf(body, piece, own_gravity, stands ? 0 : h);
  Vector3d::Map(box.low.data()) = found.min();
  Vector3d::Map(box.high.data()) = found.max();
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

Eigen::AlignedBox3d boxOf(const Body& body, const Piece& piece, const Vector3d& gravity, double h) {
  const Field& field = piece.field();
  const auto count = std::uint32_t(field.points.size());
  const Vector3d center = meanOf(field, piece.z());
  Eigen::AlignedBox3d box;
  if (count == 0) return box;
  const DepthMap* const map = body.rest().depthsOf(field.piece);
  const double margin =
      kMargin * double(body.package().info().diagonal) + (map != nullptr ? double(map->bulge()) : 0.0);
  for (int axis = 0; axis < 3; ++axis) {
    float low = 1e30F, high = -1e30F;
    for (const bool later : {false, true}) {
      if (later && !(h > 0)) break;
      std::array<float, 1024> along;
      for (std::uint32_t j = 0; j < field.k; ++j) {
        const double one = field.oneOf(j);
        double x = piece.state.z[j][axis] - one * center[axis];
        if (later) x += h * (piece.state.v[j][axis] + one * h * gravity[axis]);
        along[j] = float(x);
      }
      std::array<float, kPointsAtOnce> heights;
      for (std::uint32_t first = 0; first < count; first += kPointsAtOnce) {
        const std::uint32_t some = std::min(kPointsAtOnce, count - first);
        kernels().field_heights(
            {field.k, (some + 7) / 8, field.point_values + std::size_t(first) * field.k, along.data(), heights.data()});
        for (std::uint32_t p = 0; p < some; ++p) {
          low = std::min(low, heights[p]);
          high = std::max(high, heights[p]);
        }
      }
    }
    box.min()[axis] = center[axis] + double(low) - margin;
    box.max()[axis] = center[axis] + double(high) + margin;
  }
  return box;
}

void findPairs(BodyList& bodies, const WorldSettings& settings, double seconds, TogetherScratch& scratch,
               JobSystem* jobs) {
  scratch.boxes.clear();
  scratch.pairs.clear();
  scratch.order.clear();
  scratch.busy.resize(bodies.size());
  std::fill(scratch.busy.begin(), scratch.busy.end(), std::uint8_t{0});
  if (!settings.collisions) return;
  if (bodies.size() < 2 && (bodies.empty() || !touchesItself(*bodies[0]))) return;
  const Vector3d gravity = asVector(settings.gravity).cast<double>();
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b]->activity == Activity::disabled) continue;
    for (std::uint32_t p = 0; p < bodies[b]->pieces.size(); ++p) {
      if (!bodies[b]->pieces[p].field().points.empty()) scratch.boxes.push_back({b, p, {}, {}});
    }
  }
  auto& boxes = scratch.boxes;
  if (boxes.empty()) return;
  forEach(jobs, std::uint32_t(boxes.size()), kPiecesAJob,
          [&](std::uint32_t i) { findBox(*bodies[boxes[i].body], gravity, seconds, boxes[i]); });
  // Sorted by their lower ends along the axis along which they are spread most, in floats about the first: equal ones
  // in their order.
  std::array<double, 3> least = boxes[0].low, most = least;
  for (const PieceBox& box : boxes) {
    for (std::size_t c = 0; c < 3; ++c) {
      least[c] = std::min(least[c], box.low[c]);
      most[c] = std::max(most[c], box.low[c]);
    }
  }
  std::size_t along = 0;
  for (std::size_t c = 1; c < 3; ++c) {
    if (most[c] - least[c] > most[along] - least[along]) along = c;
  }
  const double origin = boxes[0].low[along];
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    scratch.order.push_back(std::uint64_t(sortable(float(boxes[i].low[along] - origin))) << 32 | i);
  }
  sortAscending({scratch.order.data(), scratch.order.size()});
  for (std::size_t n = 0; n < scratch.order.size(); ++n) {
    const PieceBox& a = boxes[std::uint32_t(scratch.order[n])];
    const double tie = 1e-6 * (std::abs(a.high[along] - origin) + std::abs(a.low[along] - origin));
    for (std::size_t m = n + 1; m < scratch.order.size(); ++m) {
      const PieceBox& b = boxes[std::uint32_t(scratch.order[m])];
      if (b.low[along] > a.high[along] + tie) break;
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
  // A moving body wakes what it meets, and that the next.
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
  forEachPair({scratch.touching.data(), scratch.touching.size()}, [&](std::span<const TouchMemory> touches) {
    const std::uint32_t a = placeOf(bodies, touches[0].body_a), b = placeOf(bodies, touches[0].body_b);
    if (a >= bodies.size() || b >= bodies.size()) return;
    const Body &one = *bodies[a], &other = *bodies[b];
    if (one.id != touches[0].body_a || other.id != touches[0].body_b || !one.asleep() || !other.asleep()) return;
    for (const TouchMemory& touch : touches) scratch.next_touching.push_back(touch);
  });
}

namespace {

/// Pieces stepped together: one step for each piece of a busy body, in the order of boxes.
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
      own.contacts.reserveNear(piece.field(), world_.colliders);
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
    // Self-touching bodies go on by one step each, like bodies among others.
    forEachPair({s.touching.data(), s.touching.size()}, [&](std::span<const TouchMemory> touches) {
      if (touches[0].body_a != touches[0].body_b) return;
      const std::uint32_t body = placeOf(bodies_, touches[0].body_a);
      if (body >= bodies_.size() || bodies_[body]->id != touches[0].body_a || s.busy[body] == 0) return;
      s.busy[body] = kBusyWithOthers;
    });
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
    seen.known = touchesOf({s.touching.data(), s.touching.size()}, seen.body, seen.piece);
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
    const std::uint32_t lanes = std::max(1U, lanesOf((count + kPairsAJob - 1) / kPairsAJob));
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

  /// A newly self-touching body goes on by one step, not by two.
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
    findTouches(scratch_.seen[a], scratch_.seen[b], a, b, seconds_, list);
    if (a != b) findTouches(scratch_.seen[b], scratch_.seen[a], b, a, seconds_, list);
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
    s.rows_of.resize(count);
    std::fill(s.rows_of.begin(), s.rows_of.end(), 0U);
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
    s.ids.clear();
    s.own.clear();
    s.islands.clear();
    std::size_t p = 0;
    for (std::size_t m = 0; m < s.members.size();) {
      const std::uint64_t root = s.members[m] >> 32;
      IslandRange island = {std::uint32_t(s.ids.size()), 0, std::uint32_t(s.own.size()), 0, 0, 0, 0};
      for (; m < s.members.size() && s.members[m] >> 32 == root; ++m) s.ids.push_back(std::uint32_t(s.members[m]));
      for (; p < s.touching_pairs.size() && s.touching_pairs[p] >> 32 == root; ++p) {
        const Range range = s.pair_touches[std::uint32_t(s.touching_pairs[p])];
        for (std::uint32_t i = 0; i < range.count; ++i) s.own.push_back(&s.found.touches[range.first + i]);
        const Touch& touch = s.own.back()->touch;
        const std::uint32_t packs = TouchLanes::packsOf(range.count);
        ++island.pairs;
        island.packs += packs;
        island.rows += TouchLanes::rowsOf(packs, s.steps[touch.a].field().k, s.steps[touch.b].field().k);
      }
      island.members = std::uint32_t(s.ids.size()) - island.first_member;
      island.touches = std::uint32_t(s.own.size()) - island.first_touch;
      if (island.touches > 0) {
        s.islands.push_back(island);
      } else {
        s.alone[s.ids[island.first_member]] = 1;
      }
    }
    for (const FoundTouch* touch : s.own) {
      ++s.rows_of[touch->touch.a];
      if (touch->touch.b != touch->touch.a) ++s.rows_of[touch->touch.b];
    }
    for (std::uint32_t i = 0; i < count; ++i) {
      if (s.rows_of[i] > 0) s.steps[i].reserveSystem(s.rows_of[i]);
    }
    solveIslands();
    s.next_touching.resize(s.own.size());
    forEachStep([&](std::uint32_t i) {
      if (s.alone[i] != 0) s.steps[i].finishAlone();
    });
  }

  /// Large ones one after the other, each shared by all threads; small ones side by side.
  void solveIslands() {
    TogetherScratch& s = scratch_;
    IslandSize most;
    s.small.clear();
    for (std::uint32_t i = 0; i < s.islands.size(); ++i) {
      const IslandRange& island = s.islands[i];
      IslandSize size = {island.members, 0, island.touches, island.pairs, island.packs, island.rows};
      for (const std::uint32_t id : membersOf(island)) {
        s.steps[id].setTogether();
        size.functions += s.steps[id].field().k;
      }
      if (!isSmall(island)) {
        solve(island, s.island, jobs_);
        continue;
      }
      s.small.push_back(i);
      most.include(size);
    }
    const std::uint32_t lanes = lanesOf(std::uint32_t(s.small.size()));
    while (s.island_lanes.size() < lanes) s.island_lanes.emplace_back(s.touching.memory());
    for (std::uint32_t lane = 0; lane < lanes; ++lane) {
      s.island_lanes[lane].reserve(s.steps.size(), most);
    }
    std::atomic<std::uint32_t> next = 0;
    forEach(jobs_, lanes, 1, [&](std::uint32_t lane) {
      for (std::uint32_t i = next++; i < s.small.size(); i = next++) {
        solve(s.islands[s.small[i]], s.island_lanes[lane], nullptr);
      }
    });
  }

  std::span<const std::uint32_t> membersOf(const IslandRange& island) const {
    return {scratch_.ids.data() + island.first_member, island.members};
  }

  /// Threads that may work side by side on so many jobs.
  std::uint32_t lanesOf(std::uint32_t jobs) const {
    return jobs_ == nullptr ? std::min(jobs, 1U) : std::min(jobs, std::clamp(jobs_->concurrency(), 1U, 64U));
  }

  /// Whether it is a small part of what each thread has to do, or too small to be shared; and shares no body with
  /// another.
  bool isSmall(const IslandRange& island) const {
    constexpr std::uint32_t kParts = 4;
    const std::uint32_t threads = jobs_ == nullptr ? 1 : std::max(1U, jobs_->concurrency());
    if (island.members >= std::max(2 * kPiecesAJob, std::uint32_t(scratch_.ids.size()) / (kParts * threads)))
      return false;
    const auto members = membersOf(island);
    return std::all_of(members.begin(), members.end(),
                       [this](std::uint32_t id) { return bodies_[scratch_.body_of[id]]->pieces.size() == 1; });
  }

  void solve(const IslandRange& island, IslandScratch& memory, JobSystem* jobs) {
    TogetherScratch& s = scratch_;
    Island(membersOf(island), s.steps, {s.seen.data(), s.seen.size()},
           {s.own.data() + island.first_touch, island.touches}, {s.found.rows.data(), s.found.rows.size()}, memory,
           jobs)
        .run(seconds_, world_.settings, {s.next_touching.data() + island.first_touch, island.touches});
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
    sortTouches();
  }

  /// From next_touching to touching: pair after pair, whose touches are in order.
  void sortTouches() {
    TogetherScratch& s = scratch_;
    s.runs.clear();
    forEachPair({s.next_touching.data(), s.next_touching.size()}, [&](std::span<const TouchMemory> touches) {
      s.runs.push_back({std::uint32_t(touches.data() - s.next_touching.data()), std::uint32_t(touches.size())});
    });
    std::sort(s.runs.begin(), s.runs.end(), [&](const Range& x, const Range& y) {
      return touchOrder(s.next_touching[x.first]) < touchOrder(s.next_touching[y.first]);
    });
    s.touching.resize(s.next_touching.size());
    TouchMemory* to = s.touching.data();
    for (const Range& run : s.runs) to = std::copy_n(s.next_touching.data() + run.first, run.count, to);
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
