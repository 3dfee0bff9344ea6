// SPDX-License-Identifier: MIT
#include "runtime/step/together.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/contact/firmness.h"
#include "runtime/kernels/kernels.h"
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

/// Order of floats as that of their bits.
std::uint64_t sortable(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return (bits & 0x80000000U) != 0 ? ~bits : bits | 0x80000000U;
}

/// The pieces of an island, minimized as one.
class Island {
 public:
  Island(std::span<const std::uint32_t> members, OwningArray<PieceStep>& steps, std::span<const TouchingPiece> seen,
         std::span<const FoundTouch> found, TogetherScratch& scratch, JobSystem* jobs)
      : members_(members), steps_(steps), seen_(seen), found_(found), scratch_(scratch), jobs_(jobs) {}

  void run(double h, const WorldSettings& settings) {
    gather();
    couple(asVector(settings.gravity).cast<double>());
    solve(settings.iterations);
    bool leaning = false;
    for (const std::uint32_t m : members_) leaning = leaning || steps_[m].isSupported();
    for (std::size_t i = 0; i < members_.size(); ++i) {
      MinimizeScratch& own = steps_[members_[i]].scratch();
      const std::uint32_t size = 4 * steps_[members_[i]].field().k;
      std::copy_n(scratch_.vectors.d.data() + first_[i], size, own.d.data());
      std::copy_n(scratch_.vectors.gradient.data() + first_[i], size, own.gradient.data());
      steps_[members_[i]].finishTogether(leaning);
    }
    leaning ? dampSwing(h, settings) : keepMomentum(h, settings);
    remember();
  }

 private:
  std::size_t placeOf(std::uint32_t member) const {
    return std::size_t(std::lower_bound(members_.begin(), members_.end(), member) - members_.begin());
  }

  void gather() {
    std::uint32_t size = 0;
    for (const std::uint32_t m : members_) {
      first_.push_back(size);
      size += 4 * steps_[m].field().k;
      objectives_.push_back(&steps_[m].objective());
      systems_.push_back(&steps_[m].system());
    }
    for (const FoundTouch& found : found_) {
      Touch& touch = touches_.add();
      touch = found.touch;
      touch.phi_a = scratch_.found.rows.data() + found.row_a;
      touch.phi_b = scratch_.found.rows.data() + found.row_b;
      touch.a = std::uint32_t(placeOf(found.touch.a));
      touch.b = std::uint32_t(placeOf(found.touch.b));
    }
    minimand_.pieces = {objectives_.data(), objectives_.size()};
    minimand_.systems = {systems_.data(), systems_.size()};
    minimand_.first = {first_.data(), first_.size()};
    minimand_.size = size;
    minimand_.touches = {touches_.data(), touches_.size()};
    minimand_.vectors = &scratch_.vectors;
    values_.resize(members_.size());
    minimand_.values = {values_.data(), values_.size()};
    minimand_.jobs = jobs_;
    scratch_.vectors.reserveVectors(size);
    // Rows by piece: each touch is one of both its sides.
    rows_.reserve(2 * touches_.size());
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const std::size_t begin = rows_.size();
      for (const Touch& touch : touches_) {
        if (touch.a == i) rows_.push_back({touch.phi_a, touch.kappa, keyOf(touch)});
        if (touch.b == i) rows_.push_back({touch.phi_b, touch.kappa, ~keyOf(touch)});
      }
      steps_[members_[i]].prepareTogether({rows_.data() + begin, rows_.size() - begin});
      std::copy_n(steps_[members_[i]].scratch().base.data(), 4 * steps_[members_[i]].field().k,
                  scratch_.vectors.base.data() + first_[i]);
    }
  }

  std::uint32_t keyOf(const Touch& touch) const {
    const TouchMemory& memory = found_[std::size_t(&touch - touches_.data())].memory;
    return memory.point ^ (memory.body_a * 2654435761U) ^ (memory.body_b * 2246822519U);
  }

  /// From above to below, so that what rests on others is taken apart before them.
  void couple(const Vector3d& gravity) {
    order_.resize(members_.size());
    for (std::uint32_t i = 0; i < order_.size(); ++i) order_[i] = i;
    const auto depth = [&](std::uint32_t i) { return gravity.dot(seen_[members_[i]].center); };
    std::sort(order_.begin(), order_.end(), [&](std::uint32_t i, std::uint32_t j) {
      const double a = depth(i), b = depth(j);
      return a != b ? a < b : i < j;
    });
    scratch_.rigid.make(minimand_, {order_.data(), order_.size()});
    minimand_.rigid = &scratch_.rigid;
  }

  /// From the prediction, from where all were, or from where those were that touched already: the lowest of these.
  void solve(std::uint32_t iterations) {
    MinimizeScratch& s = scratch_.vectors;
    const std::uint32_t size = minimand_.size;
    std::fill_n(s.d.begin(), size, 0.0F);
    minimand_.press(s.d.data());
    Objective::Value value = minimand_.at(s.d.data(), s.gradient.data(), true);
    int chosen = 0;
    for (int start = 1; start < 3; ++start) {
      bool differs = start == 1;
      for (std::size_t i = 0; i < members_.size(); ++i) {
        float* const next = s.next.data() + first_[i];
        if (start == 1 || steps_[members_[i]].leaned()) {
          steps_[members_[i]].oldPlace(next);
        } else {
          std::fill_n(next, 4 * steps_[members_[i]].field().k, 0.0F);
          differs = true;
        }
      }
      if (!differs) break;
      minimand_.press(s.next.data());
      const Objective::Value other = minimand_.at(s.next.data(), s.next_gradient.data(), false);
      if (!(other.total < value.total)) continue;
      chosen = start;
      value = other;
      std::copy_n(s.next.data(), size, s.d.data());
      std::copy_n(s.next_gradient.data(), size, s.gradient.data());
    }
    minimand_.press(s.d.data());
    if (chosen != 2) value = minimand_.at(s.d.data(), s.gradient.data(), false);
    minimize(minimand_, 2 * iterations, value);
  }

  /// Turning on supports decays, of the island as of a piece: what its pieces turn about its centre.
  void dampSwing(double h, const WorldSettings& settings) {
    double mass = 0;
    Vector3d center = Vector3d::Zero(), velocity = center, spin = center;
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      mass += w.mass;
      center += w.mass * w.after;
      velocity += w.mass * w.velocity;
    }
    center /= mass;
    velocity /= mass;
    Matrix3d inertia = Matrix3d::Zero();
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      const Vector3d arm = w.after - center;
      spin += w.spin + w.mass * arm.cross(Vector3d(w.velocity - velocity));
      inertia += w.inertia + w.mass * (arm.squaredNorm() * Matrix3d::Identity() - arm * arm.transpose());
    }
    const Vector3d omega = (std::exp(-double(settings.support_damping) * h) - 1) * solved(inertia, spin);
    for (const std::uint32_t m : members_) {
      const Vector3d arm = steps_[m].whole().after - center;
      steps_[m].add(Vector3d::Zero(), omega.cross(arm), Vector3d::Zero(), Vector3d::Zero());
    }
  }

  /// What minimizing has lost of the motion as a whole is put back: all forces were between the pieces.
  void keepMomentum(double h, const WorldSettings& settings) {
    double mass = 0;
    Vector3d astray = Vector3d::Zero(), lacking = astray, before = astray, moving = astray, center = astray,
             now = astray;
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      mass += w.mass;
      astray += w.mass * (w.predicted - w.after);
      lacking += w.mass * (w.velocity_predicted - w.velocity);
      before += w.mass * w.before;
      moving += w.mass * w.velocity_before;
    }
    for (const std::uint32_t m : members_) {
      steps_[m].add(astray / mass, lacking / mass, Vector3d::Zero(), Vector3d::Zero());
    }
    before /= mass;
    moving /= mass;
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      center += w.mass / mass * w.after;
      now += w.mass / mass * w.velocity;
    }
    Vector3d wanted = Vector3d::Zero(), found = wanted;
    Matrix3d inertia = Matrix3d::Zero();
    for (const std::uint32_t m : members_) {
      const PieceStep::Whole w = steps_[m].whole();
      wanted += w.spin_before + w.mass * Vector3d(w.before - before).cross(Vector3d(w.velocity_before - moving));
      found += w.spin + w.mass * Vector3d(w.after - center).cross(Vector3d(w.velocity - now));
      const Vector3d arm = w.after - center;
      inertia += w.inertia + w.mass * (arm.squaredNorm() * Matrix3d::Identity() - arm * arm.transpose());
    }
    wanted *= std::exp(-double(settings.damping) * h);
    const Vector3d omega = solved(inertia, wanted - found);
    for (const std::uint32_t m : members_) steps_[m].add(Vector3d::Zero(), Vector3d::Zero(), omega, center);
  }

  void remember() {
    for (std::size_t i = 0; i < touches_.size(); ++i) {
      const FoundTouch& found = found_[i];
      const std::span<const float> rows(scratch_.found.rows.data(), scratch_.found.rows.size());
      scratch_.next_touching.push_back(rememberTouch(found, seen_[found.touch.a], seen_[found.touch.b],
                                                     scratch_.vectors.d.data() + first_[touches_[i].a],
                                                     scratch_.vectors.d.data() + first_[touches_[i].b], rows));
    }
  }

  std::span<const std::uint32_t> members_;
  OwningArray<PieceStep>& steps_;
  std::span<const TouchingPiece> seen_;
  std::span<const FoundTouch> found_;
  TogetherScratch& scratch_;
  Array<std::uint32_t> first_, order_;
  Array<Objective*> objectives_;
  Array<SystemFactor*> systems_;
  Array<Touch> touches_;
  Array<TouchRow> rows_;
  Array<Objective::Value> values_;
  JobSystem* jobs_;
  Minimand minimand_;
};

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
  if (!settings.collisions || bodies.size() < 2) return;
  const Vector3d gravity = asVector(settings.gravity).cast<double>();
  for (std::uint32_t b = 0; b < bodies.size(); ++b) {
    for (std::uint32_t p = 0; p < bodies[b]->pieces.size(); ++p) addBox(*bodies[b], b, p, gravity, seconds, scratch);
  }
  const auto& boxes = scratch.boxes;
  if (boxes.empty()) return;
  // Sorted by their lower ends along x, in floats about the first: equal ones in their order.
  const double origin = boxes[0].low[0];
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    scratch.order.push_back(sortable(float(boxes[i].low[0] - origin)) << 32 | i);
  }
  sortAscending({scratch.order.data(), scratch.order.size()});
  for (std::size_t n = 0; n < scratch.order.size(); ++n) {
    const PieceBox& a = boxes[std::uint32_t(scratch.order[n])];
    const double tie = 1e-6 * (std::abs(a.high[0] - origin) + std::abs(a.low[0] - origin));
    for (std::size_t m = n + 1; m < scratch.order.size(); ++m) {
      const PieceBox& b = boxes[std::uint32_t(scratch.order[m])];
      if (b.low[0] > a.high[0] + tie) break;
      if (a.body == b.body || !mayTouch(bodies[a.body]->settings, bodies[b.body]->settings)) continue;
      bool meet = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        meet = meet && a.low[axis] <= b.high[axis] && b.low[axis] <= a.high[axis];
      }
      if (!meet) continue;
      const std::uint32_t i = std::uint32_t(scratch.order[n]), j = std::uint32_t(scratch.order[m]);
      scratch.pairs.push_back(std::uint64_t(std::min(i, j)) << 32 | std::max(i, j));
    }
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
    scratch.busy[boxes[pair >> 32].body] = scratch.busy[boxes[std::uint32_t(pair)].body] = 1;
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

void stepTogether(BodyList& bodies, const StepWorld& world, double seconds, TogetherScratch& scratch, JobSystem* jobs) {
  const WorldSettings& settings = world.settings;
  scratch.next_touching.clear();
  scratch.found.touches.clear();
  scratch.found.rows.clear();
  // One step for each piece of a busy body, in the order of boxes.
  OwningArray<PieceStep> steps(scratch.touching.memory());
  Array<TouchingPiece> seen(scratch.touching.memory());
  scratch.places.resize(scratch.boxes.size());
  std::size_t before = 0, points = 0, count = 0;
  for (const PieceBox& box : scratch.boxes) {
    if (scratch.busy[box.body] == 0) continue;
    const Field& field = bodies[box.body]->pieces[box.piece].field();
    before += 4 * field.k;
    points += pointFloats(field);
    if (scratch.pieces.size() <= count) scratch.pieces.emplace_back(scratch.touching.memory());
    scratch.pieces[count++].reserve(bodies[box.body]->pieces[box.piece]);
  }
  scratch.before.resize(before);
  scratch.points.resize(points);
  before = points = 0;
  for (std::size_t i = 0; i < scratch.boxes.size(); ++i) {
    const PieceBox& box = scratch.boxes[i];
    if (scratch.busy[box.body] == 0) continue;
    Body& body = *bodies[box.body];
    Piece& piece = body.pieces[box.piece];
    scratch.places[i] = std::uint32_t(steps.size());
    PieceStep& step = steps.emplace_back(body, piece, world, seconds, scratch.pieces[steps.size()]);
    step.begin();
    step.useEuler();
    const std::size_t k = piece.field().k;
    TouchingPiece& sees = seen.add();
    sees = step.touchingPiece({scratch.before.data() + before, 4 * k});
    before += 4 * k;
    placePoints(sees, {scratch.points.data() + points, pointFloats(piece.field())});
    points += pointFloats(piece.field());
  }
  scratch.parent.resize(steps.size());
  for (std::uint32_t i = 0; i < steps.size(); ++i) scratch.parent[i] = i;
  for (const std::uint64_t pair : scratch.pairs) {
    const std::uint32_t a = scratch.places[pair >> 32], b = scratch.places[std::uint32_t(pair)];
    const std::size_t count_before = scratch.found.touches.size();
    const std::span<const TouchMemory> known(scratch.touching.data(), scratch.touching.size());
    findTouches(seen[a], seen[b], a, b, seconds, known, scratch.found);
    findTouches(seen[b], seen[a], b, a, seconds, known, scratch.found);
    if (scratch.found.touches.size() > count_before) {
      const std::uint32_t root_a = rootOf(scratch.parent, a), root_b = rootOf(scratch.parent, b);
      scratch.parent[std::max(root_a, root_b)] = std::min(root_a, root_b);
    }
  }
  // By island, members and touches in their order.
  Array<std::uint64_t> members(scratch.touching.memory()), touches(scratch.touching.memory());
  for (std::uint32_t i = 0; i < steps.size(); ++i) {
    members.push_back(std::uint64_t(rootOf(scratch.parent, i)) << 32 | i);
  }
  for (std::uint32_t t = 0; t < scratch.found.touches.size(); ++t) {
    touches.push_back(std::uint64_t(rootOf(scratch.parent, scratch.found.touches[t].touch.a)) << 32 | t);
  }
  sortAscending({members.data(), members.size()});
  sortAscending({touches.data(), touches.size()});
  std::size_t t = 0;
  for (std::size_t m = 0; m < members.size();) {
    const std::uint64_t root = members[m] >> 32;
    Array<std::uint32_t> ids(scratch.touching.memory());
    Array<FoundTouch> own(scratch.touching.memory());
    for (; m < members.size() && members[m] >> 32 == root; ++m) ids.push_back(std::uint32_t(members[m]));
    for (; t < touches.size() && touches[t] >> 32 == root; ++t) {
      own.push_back(scratch.found.touches[std::uint32_t(touches[t])]);
    }
    if (own.empty()) {
      steps[ids[0]].finishAlone();
      continue;
    }
    for (const std::uint32_t id : ids) steps[id].setTogether();
    Island({ids.data(), ids.size()}, steps, {seen.data(), seen.size()}, {own.data(), own.size()}, scratch, jobs)
        .run(seconds, settings);
  }
  for (std::size_t i = 0; i < scratch.boxes.size(); ++i) {
    const PieceBox& box = scratch.boxes[i];
    if (scratch.busy[box.body] == 0) continue;
    Body& body = *bodies[box.body];
    body.outdated = true;
    if (box.piece == 0) body.repaired = 0;
    Piece& piece = body.pieces[box.piece];
    if (isUsable(piece)) continue;
    restPiece(body, piece);
    body.repaired += piece.field().vertex_count;
  }
  keepSleeping(bodies, scratch);
  std::sort(scratch.next_touching.begin(), scratch.next_touching.end(),
            [](const TouchMemory& x, const TouchMemory& y) { return touchOrder(x) < touchOrder(y); });
  scratch.touching.swap(scratch.next_touching);
}

}  // namespace sinew::internal
