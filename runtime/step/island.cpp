// SPDX-License-Identifier: MIT
#include "runtime/step/island.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "runtime/solver/for_each.h"
#include "runtime/step/rigid.h"

namespace sinew::internal {
namespace {

/// Times the iterations near where something flew into another: the end of such a step lies far from all places to
/// start from, and a heap that lands in steps cut short goes on creeping (docs/decisions/0026-impacts.md).
constexpr std::uint32_t kImpact = 2;
/// Near is what that many touches, one after the other, part from it.
constexpr std::uint32_t kNear = 3;
/// Rounds of rigid answers, each to what the one before left.
constexpr int kRigidRounds = 2;

/// Rows of one key are alike from step to step.
std::uint32_t keyOf(const TouchMemory& memory) {
  return memory.point ^ (memory.body_a * 2654435761U) ^ (memory.body_b * 2246822519U);
}

}  // namespace

void IslandSize::include(const IslandSize& other) {
  for (const auto one : {&IslandSize::members, &IslandSize::functions, &IslandSize::touches, &IslandSize::pairs,
                         &IslandSize::packs, &IslandSize::rows}) {
    this->*one = std::max(this->*one, other.*one);
  }
}

// Memory for the next power of two, so that it seldom grows.
void IslandScratch::reserve(std::size_t steps, const IslandSize& size) {
  const std::size_t members = std::bit_ceil(size.members), functions = std::bit_ceil(size.functions),
                    touch_count = std::bit_ceil(size.touches);
  vectors.reserveVectors(4 * functions);
  vectors.rigid.reserve(members, touch_count);
  for (Array<std::uint32_t>* array : {&first, &order, &near_order, &arranged, &hops, &next_row})
    array->reserve(members + 1);
  place.reserve(steps);
  objectives.reserve(members);
  systems.reserve(members);
  own_pairs.reserve(members);
  values.reserve(members);
  for (Array<double>* array : {&elastic, &predicted}) array->reserve(members);
  touches.reserve(touch_count);
  rows.reserve(2 * touch_count);
  lanes.reserve(members, std::bit_ceil(size.pairs), std::bit_ceil(size.packs), std::bit_ceil(size.rows));
}

void Island::run(double h, const WorldSettings& settings, std::span<TouchMemory> remembered) {
  arrange();
  gather();
  couple(asVector(settings.gravity).cast<double>());
  solve(settings.iterations);
  bool leaning = false;
  for (const std::uint32_t m : members_) leaning = leaning || steps_[m].isSupported();
  const MinimizeScratch& all = scratch_.vectors;
  // Pieces of a body share what they report.
  const auto body_of = [&](std::uint32_t i) { return seen_[members_[i]].body; };
  forEachByBody(jobs_, std::uint32_t(members_.size()), kPiecesAJob, body_of, [&](std::uint32_t i) {
    PieceStep& step = steps_[members_[i]];
    const std::uint32_t size = 4 * step.field().k, first = scratch_.first[scratch_.place[members_[i]]];
    std::copy_n(all.d.data() + first, size, step.scratch().d.data());
    std::copy_n(all.gradient.data() + first, size, step.scratch().gradient.data());
    step.finishTogether(leaning, minimand_.elastic[scratch_.place[members_[i]]]);
  });
  leaning ? dampSwing(h) : keepMomentum(h, settings);
  forEach(jobs_, std::uint32_t(found_.size()), 8 * kPiecesAJob, [&](std::uint32_t i) {
    const FoundTouch& found = *found_[i];
    const TouchLink& touch = scratch_.touches[i];
    const auto way_of = [&](std::uint32_t piece, std::size_t row) {
      return scratch_.objectives[piece]->wayOf(all_rows_.data() + row, all.d.data() + scratch_.first[piece]);
    };
    remembered[i] = rememberTouch(found, way_of(touch.a, found.row_a) - way_of(touch.b, found.row_b));
  });
}

void Island::arrange() {
  IslandScratch& s = scratch_;
  s.place.resize(steps_.size());
  for (std::uint32_t i = 0; i < members_.size(); ++i) s.place[members_[i]] = i;
  s.hops.resize(members_.size());
  std::fill(s.hops.begin(), s.hops.end(), kNear + 1);
  for (const FoundTouch* found : found_) {
    if (found->entered) s.hops[s.place[found->touch.a]] = s.hops[s.place[found->touch.b]] = 0;
  }
  const bool impact = std::find(s.hops.begin(), s.hops.end(), 0U) != s.hops.end();
  for (std::uint32_t hop = 1; impact && hop <= kNear; ++hop) {
    for (const FoundTouch* found : found_) {
      std::uint32_t &a = s.hops[s.place[found->touch.a]], &b = s.hops[s.place[found->touch.b]];
      if (a == hop - 1) b = std::min(b, hop);
      if (b == hop - 1) a = std::min(a, hop);
    }
  }
  s.arranged.clear();
  for (const bool near : {true, false}) {
    for (std::size_t i = 0; i < members_.size(); ++i) {
      if ((s.hops[i] <= kNear) == near) s.arranged.push_back(members_[i]);
    }
    if (near) near_ = std::uint32_t(s.arranged.size());
  }
  for (std::uint32_t i = 0; i < s.arranged.size(); ++i) s.place[s.arranged[i]] = i;
}

void Island::gather() {
  IslandScratch& s = scratch_;
  s.first.clear();
  s.objectives.clear();
  s.systems.clear();
  s.own_pairs.clear();
  std::uint32_t size = 0;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    s.first.push_back(size);
    size += 4 * piece(i).field().k;
    s.objectives.push_back(&piece(i).objective());
    s.systems.push_back(&piece(i).system());
    s.own_pairs.push_back(&piece(i).startPairs());
  }
  s.values.resize(members_.size());
  s.elastic.resize(members_.size());
  s.vectors.reserveVectors(size);
  gatherRows();
  gatherPairs();
  minimand_.pieces = {s.objectives.data(), s.objectives.size()};
  minimand_.systems = {s.systems.data(), s.systems.size()};
  minimand_.own_pairs = {s.own_pairs.data(), s.own_pairs.size()};
  minimand_.first = {s.first.data(), s.first.size()};
  minimand_.size = size;
  minimand_.touches = {s.touches.data(), s.touches.size()};
  minimand_.lanes = &s.lanes;
  minimand_.vectors = &s.vectors;
  minimand_.values = {s.values.data(), s.values.size()};
  minimand_.elastic = {s.elastic.data(), s.elastic.size()};
  minimand_.jobs = jobs_;
  const auto rows_of = [&](std::size_t i) {
    const std::uint32_t begin = i == 0 ? 0 : s.next_row[i - 1];
    return std::span<TouchRow>(s.rows.data() + begin, s.next_row[i] - begin);
  };
  forEach(jobs_, std::uint32_t(members_.size()), kPiecesAJob, [&](std::uint32_t i) {
    piece(i).prepareTogether(rows_of(i));
    std::copy_n(piece(i).scratch().base.data(), 4 * piece(i).field().k, s.vectors.base.data() + s.first[i]);
  });
}

void Island::gatherRows() {
  IslandScratch& s = scratch_;
  s.touches.resize(found_.size());
  s.next_row.resize(members_.size() + 1);
  std::fill(s.next_row.begin(), s.next_row.end(), 0U);
  for (std::size_t i = 0; i < found_.size(); ++i) {
    const Touch& found = found_[i]->touch;
    TouchLink& touch = s.touches[i];
    touch = {s.place[found.a], s.place[found.b], 0, found.kappa, found.kappa};
    ++s.next_row[touch.a + 1];
    if (touch.a != touch.b) ++s.next_row[touch.b + 1];
  }
  for (std::size_t i = 0; i < members_.size(); ++i) s.next_row[i + 1] += s.next_row[i];
  s.rows.resize(2 * found_.size());
  for (std::uint32_t i = 0; i < s.touches.size(); ++i) {
    const TouchLink& touch = s.touches[i];
    const FoundTouch& found = *found_[i];
    const std::uint32_t key = keyOf(found.memory);
    const auto momentsAbout = [this](std::uint32_t member, const Eigen::Vector3f& at) {
      const Eigen::Vector3f arm = at - piece(member).field().rest_center.cast<float>();
      return Eigen::Vector4f(1, arm[0], arm[1], arm[2]);
    };
    Eigen::Vector4f a = momentsAbout(touch.a, asVector(piece(touch.a).field().points[found.memory.point].at));
    const Eigen::Vector4f b = momentsAbout(touch.b, found.place);
    if (touch.a == touch.b) a -= b;
    s.rows[s.next_row[touch.a]++] = {all_rows_.data() + found.row_a, touch.kappa, key, i, 1, a};
    if (touch.a != touch.b) {
      s.rows[s.next_row[touch.b]++] = {all_rows_.data() + found.row_b, touch.kappa, ~key, i, -1, b};
    }
  }
}

void Island::gatherPairs() {
  IslandScratch& s = scratch_;
  s.lanes.clear();
  const auto pieces_of = [&](std::size_t i) {
    return std::pair(std::min(s.touches[i].a, s.touches[i].b), std::max(s.touches[i].a, s.touches[i].b));
  };
  const auto add = [&](std::uint32_t first, std::uint32_t end) {
    const auto [a, b] = pieces_of(first);
    const auto side_of = [&](std::uint32_t piece, std::uint32_t functions) {
      return TouchSide{piece, functions, steps_[s.arranged[piece]].objective().rotation.data()};
    };
    const std::uint32_t slot = s.lanes.addPair(side_of(a, piece(a).field().k),
                                               side_of(b, a == b ? 0 : piece(b).field().k), {first, end - first});
    for (std::uint32_t i = first; i < end; ++i) s.touches[i].slot = slot + (i - first);
  };
  for (const bool near : {true, false}) {
    std::uint32_t end = 0;
    for (std::uint32_t first = 0; first < s.touches.size(); first = end) {
      while (end < s.touches.size() && pieces_of(end) == pieces_of(first)) ++end;
      if ((pieces_of(first).first < near_) == near) add(first, end);
    }
    if (near) near_pairs_ = std::uint32_t(s.lanes.pairs().size());
  }
  forEach(jobs_, std::uint32_t(s.lanes.pairs().size()), kPiecesAJob, [&](std::uint32_t pair) {
    const TouchPair& of = s.lanes.pairs()[pair];
    for (std::uint32_t i = of.touches.first; i < of.touches.first + of.touches.count; ++i) {
      const FoundTouch& found = *found_[i];
      s.lanes.set(s.touches[i].slot, of, found.touch, all_rows_.data() + found.row_a, all_rows_.data() + found.row_b,
                  s.touches[i].a != of.a.piece);
    }
  });
  s.lanes.finish(std::uint32_t(members_.size()));
}

void Island::couple(const Vector3d& gravity) {
  Array<std::uint32_t>& order = scratch_.order;
  order.resize(members_.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto depth = [&](std::uint32_t i) { return gravity.dot(seen_[scratch_.arranged[i]].center); };
  std::sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t j) {
    const double a = depth(i), b = depth(j);
    return a != b ? a < b : i < j;
  });
  minimand_.order = {order.data(), order.size()};
  minimand_.rigid = &scratch_.vectors.rigid;
  minimand_.knows_loads = near_ == 0;
}

void Island::solve(std::uint32_t iterations) {
  MinimizeScratch& s = scratch_.vectors;
  const std::uint32_t size = minimand_.size;
  std::fill_n(s.d.begin(), size, 0.0F);
  minimand_.press(s.d.data());
  // The gradient is wanted there if something flew into another, or if no other place is lower.
  bool stale = near_ == 0;  // the gradient is not the one at s.d
  Objective::Value value = minimand_.at(s.d.data(), stale ? nullptr : s.gradient.data(), true);
  minimand_.comeTo();
  Array<double>& predicted = scratch_.predicted;
  predicted.assign(minimand_.elastic);
  const bool all_near = near_ == members_.size();
  bool last_taken = true;  // touches are as they are at s.d
  if (near_ > 0) {
    const Minimand near = all_near ? minimand_ : nearImpacts();
    scratch_.vectors.rigid.make(near, false);
    stale = startRigid(near, all_near ? value : near.at(s.d.data(), s.gradient.data(), false), value);
    last_taken = false;
    scratch_.lanes.useFirst(std::uint32_t(scratch_.lanes.pairs().size()));
  }
  for (const bool all : {true, false}) {
    bool differs = all, known = true;
    double elastic = 0;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      float* const next = s.next.data() + scratch_.first[i];
      const bool old = all || piece(i).leaned();
      if (old) {
        piece(i).oldPlace(next);
      } else {
        std::fill_n(next, 4 * piece(i).field().k, 0.0F);
        differs = true;
      }
      const double own = old && !piece(i).stands() ? piece(i).stored() : predicted[i];
      known = known && own >= 0;
      elastic += own;
    }
    if (!differs) continue;
    minimand_.press(s.next.data());
    last_taken = false;
    if (known && elastic + minimand_.besideElastic(s.next.data()) >= value.total) continue;
    const Objective::Value other = minimand_.at(s.next.data(), s.next_gradient.data(), false);
    if (!(other.total < value.total)) continue;
    last_taken = true;
    stale = false;
    value = other;
    minimand_.comeTo();
    std::copy_n(s.next.data(), size, s.d.data());
    std::copy_n(s.next_gradient.data(), size, s.gradient.data());
  }
  if (!last_taken) {
    minimand_.press(s.d.data());
    if (stale) {
      value = minimand_.at(s.d.data(), s.gradient.data(), false);
    } else {
      scratch_.lanes.evaluate(s.d.data(), minimand_.first, jobs_);
    }
  }
  scratch_.vectors.rigid.make(minimand_, true);
  s.pairs.start(size);
  minimize(minimand_, s.pairs, (all_near ? kImpact : 1) * 2 * iterations, value);
  if (near_ == 0 || all_near) return;
  Minimand near = nearImpacts();
  // Trials have the others where they are.
  std::copy(s.d.data() + near.size, s.d.data() + size, s.next.data() + near.size);
  value = near.at(s.d.data(), s.gradient.data(), false);
  scratch_.vectors.rigid.make(near, true);
  s.pairs.start(near.size);
  minimize(near, s.pairs, (kImpact - 1) * 2 * iterations, value);
}

// Else the skin is stopped first, and they are drawn out to many times their length.
bool Island::startRigid(const Minimand& near, Objective::Value near_value, Objective::Value& value) {
  MinimizeScratch& s = scratch_.vectors;
  bool taken = false;
  std::fill_n(s.next.begin(), minimand_.size, 0.0F);
  std::copy_n(s.gradient.data(), near.size, s.next_gradient.data());
  for (int round = 0; round < kRigidRounds; ++round) {
    std::fill_n(s.direction.begin(), near.size, 0.0F);
    scratch_.vectors.rigid.take(near, s.next_gradient.data());
    scratch_.vectors.rigid.giveAlone(near, s.direction.data());
    for (std::uint32_t i = 0; i < near.size; ++i) s.next[i] -= s.direction[i];
    near.press(s.next.data());
    const Objective::Value other = near.at(s.next.data(), s.next_gradient.data(), false);
    if (!(other.total < near_value.total)) continue;
    taken = true;
    value.total += other.total - near_value.total;
    value.elastic += other.elastic - near_value.elastic;
    near_value = other;
    near.comeTo();
    std::copy_n(s.next.data(), near.size, s.d.data());
    std::copy_n(s.next_gradient.data(), near.size, s.gradient.data());
  }
  return taken;
}

Minimand Island::nearImpacts() {
  Minimand near = minimand_;
  near.pieces = near.pieces.first(near_);
  near.systems = near.systems.first(near_);
  near.own_pairs = near.own_pairs.first(near_);
  near.values = near.values.first(near_);
  near.elastic = near.elastic.first(near_);
  near.size = scratch_.first[near_];
  Array<std::uint32_t>& order = scratch_.near_order;
  order.clear();
  for (const std::uint32_t i : minimand_.order) {
    if (i < near_) order.push_back(i);
  }
  near.order = {order.data(), order.size()};
  scratch_.lanes.useFirst(near_pairs_);
  return near;
}

void Island::dampSwing(double h) {
  double mass = 0, rate = 0;
  Vector3d center = Vector3d::Zero(), velocity = center, spin = center;
  for (const std::uint32_t m : members_) {
    const PieceStep::Whole w = steps_[m].whole();
    mass += w.mass;
    rate += w.mass * steps_[m].supportDamping();
    center += w.mass * w.after;
    velocity += w.mass * w.velocity;
  }
  center /= mass;
  velocity /= mass;
  rate /= mass;
  Matrix3d inertia = Matrix3d::Zero();
  for (const std::uint32_t m : members_) {
    const PieceStep::Whole w = steps_[m].whole();
    const Vector3d arm = w.after - center;
    spin += w.spin + w.mass * arm.cross(Vector3d(w.velocity - velocity));
    inertia += w.inertia + w.mass * (arm.squaredNorm() * Matrix3d::Identity() - arm * arm.transpose());
  }
  const Vector3d omega = (std::exp(-rate * h) - 1) * solved(inertia, spin);
  for (const std::uint32_t m : members_) {
    const Vector3d arm = steps_[m].whole().after - center;
    steps_[m].add(Vector3d::Zero(), omega.cross(arm), Vector3d::Zero(), Vector3d::Zero());
  }
}

void Island::keepMomentum(double h, const WorldSettings& settings) {
  double mass = 0;
  Vector3d astray = Vector3d::Zero(), lacking = astray, before = astray, moving = astray, center = astray, now = astray;
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

}  // namespace sinew::internal
