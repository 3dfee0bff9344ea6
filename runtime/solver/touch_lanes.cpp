// SPDX-License-Identifier: MIT
#include "runtime/solver/touch_lanes.h"

#include <algorithm>
#include <cstring>

#include "runtime/kernels/kernels.h"
#include "runtime/solver/for_each.h"
#include "runtime/solver/minimize.h"

namespace sinew::internal {
namespace {

/// Pairs that a job takes at least.
constexpr std::uint32_t kPairsAJob = 8;

}  // namespace

void TouchLanes::reserve(std::size_t pieces, std::size_t pairs, std::size_t packs, std::size_t rows) {
  pairs_.reserve(pairs);
  packs_.reserve(packs);
  rows_.reserve(rows);
  sides_.reserve(2 * pairs);
  first_side_.reserve(pieces + 1);
}

void TouchLanes::clear() {
  pairs_.clear();
  packs_.clear();
  rows_.clear();
  has_friction_ = false;
}

std::uint32_t TouchLanes::addPair(const TouchSide& a, const TouchSide& b, Range touches) {
  const Range packs = {std::uint32_t(packs_.size()), packsOf(touches.count)};
  pairs_.push_back({a, b, touches, packs, rows_.size(), false, 0});
  packs_.resize(packs.first + packs.count);
  rows_.resize(rows_.size() + rowsOf(packs.count, a.functions, b.functions));
  return 8 * packs.first;
}

void TouchLanes::set(std::uint32_t slot, const TouchPair& pair, const Push& push, const float* phi_a,
                     const float* phi_b, bool turned) {
  const std::uint32_t lane = slot % 8;
  PushPack& pack = packs_[slot / 8];
  for (std::uint32_t c = 0; c < 3; ++c) {
    pack.normal[c][lane] = push.normal[int(c)];
    pack.slide[c][lane] = push.slide[int(c)];
  }
  pack.gap[lane] = push.gap;
  pack.kappa[lane] = push.kappa;
  pack.friction[lane] = push.friction;
  float* row =
      rows_.data() + pair.first_row + rowsOf(slot / 8 - pair.packs.first, pair.a.functions, pair.b.functions) + lane;
  const float *const of_a = turned ? phi_b : phi_a, *const of_b = turned ? phi_a : phi_b;
  const float sign = turned ? -1.0F : 1.0F;
  for (std::uint32_t j = 0; j < pair.a.functions; ++j, row += 8) *row = sign * of_a[j];
  for (std::uint32_t j = 0; j < pair.b.functions; ++j, row += 8) *row = -sign * of_b[j];
}

void TouchLanes::finish(std::uint32_t pieces) {
  useFirst(std::uint32_t(pairs_.size()));
  first_side_.resize(pieces + 1);
  std::fill(first_side_.begin(), first_side_.end(), 0U);
  const auto visit = [this](const auto& each) {
    for (std::uint32_t i = 0; i < pairs_.size(); ++i) {
      each(pairs_[i].a.piece, Side{i, false});
      if (pairs_[i].b.functions > 0) each(pairs_[i].b.piece, Side{i, true});
    }
  };
  visit([this](std::uint32_t piece, Side) { ++first_side_[piece + 1]; });
  for (std::uint32_t i = 0; i < pieces; ++i) first_side_[i + 1] += first_side_[i];
  sides_.resize(first_side_[pieces]);
  // Each start goes on to its end, which is the next one's start.
  visit([this](std::uint32_t piece, Side side) { sides_[first_side_[piece]++] = side; });
  for (std::uint32_t i = pieces; i > 0; --i) first_side_[i] = first_side_[i - 1];
  first_side_[0] = 0;
  for (const PushPack& pack : packs_) {
    for (const float friction : pack.friction) has_friction_ = has_friction_ || friction > 0;
  }
}

void TouchLanes::useFirst(std::uint32_t pairs) {
  used_pairs_ = pairs;
  used_packs_ = pairs < pairs_.size() ? pairs_[pairs].packs.first : std::uint32_t(packs_.size());
}

float TouchLanes::gap(std::uint32_t slot) const {
  const PushPack& pack = packs_[slot / 8];
  const std::uint32_t i = slot % 8;
  return pack.gap[i] +
         (pack.normal[0][i] * pack.way[0][i] + pack.normal[1][i] * pack.way[1][i] + pack.normal[2][i] * pack.way[2][i]);
}

float TouchLanes::heldAcross(std::uint32_t slot) const {
  const PushPack& pack = packs_[slot / 8];
  const std::uint32_t i = slot % 8;
  const Eigen::Vector3f slide(pack.slide[0][i], pack.slide[1][i], pack.slide[2][i]);
  return internal::heldAcross(pack.kappa[i] * slide.norm(), pack.friction[i] * pack.pressed[i]);
}

Eigen::Vector3d TouchLanes::normal(std::uint32_t slot) const {
  const auto& normal = packs_[slot / 8].normal;
  const std::uint32_t i = slot % 8;
  return Eigen::Vector3f(normal[0][i], normal[1][i], normal[2][i]).cast<double>();
}

PushArguments TouchLanes::argumentsOf(TouchPair& pair, const float* d, std::span<const std::uint32_t> first) {
  const auto sideOf = [&](const TouchSide& side) {
    return PushSide{side.functions, side.rotation, d + first[side.piece]};
  };
  return {
      pair.packs.count, packs_.data() + pair.packs.first, rows_.data() + pair.first_row, sideOf(pair.a), sideOf(pair.b),
      &pair.pulls};
}

double TouchLanes::energy() const {
  double sum = 0;
  for (std::uint32_t i = 0; i < used_pairs_; ++i) sum += pairs_[i].energy;
  return sum;
}

double TouchLanes::evaluate(const float* d, std::span<const std::uint32_t> first, JobSystem* jobs) {
  forEach(jobs, used_pairs_, kPairsAJob,
          [&](std::uint32_t i) { pairs_[i].energy = kernels().push_forces(argumentsOf(pairs_[i], d, first)); });
  return energy();
}

void TouchLanes::place(const float* d, std::span<const std::uint32_t> first, bool press, JobSystem* jobs) {
  forEach(jobs, used_pairs_, kPairsAJob, [&](std::uint32_t i) {
    kernels().push_ways(argumentsOf(pairs_[i], d, first));
    const Range& packs = pairs_[i].packs;
    for (std::uint32_t slot = 8 * packs.first; press && slot < 8 * (packs.first + packs.count); ++slot) {
      packs_[slot / 8].pressed[slot % 8] = packs_[slot / 8].kappa[slot % 8] * std::max(0.0F, -gap(slot));
    }
  });
}

double TouchLanes::rub(JobSystem* jobs) {
  forEach(jobs, used_pairs_, kPairsAJob, [&](std::uint32_t i) {
    TouchPair& pair = pairs_[i];
    pair.energy =
        kernels().push_rubs({pair.packs.count, packs_.data() + pair.packs.first, nullptr, {}, {}, &pair.pulls});
  });
  return energy();
}

void TouchLanes::pullOn(JobSystem* jobs) {
  forEach(jobs, used_packs_, 8 * kPairsAJob,
          [&](std::uint32_t i) { std::memcpy(packs_[i].pulled, packs_[i].pull, sizeof packs_[i].pull); });
}

PushSideArguments TouchLanes::sideOf(const Side& side, const float* offset, float* to) const {
  const TouchPair& pair = pairs_[side.pair];
  const std::size_t of_a = std::size_t(8) * pair.a.functions, of_b = std::size_t(8) * pair.b.functions;
  const TouchSide& own = side.is_b ? pair.b : pair.a;
  return {
      pair.packs.count, packs_.data() + pair.packs.first,      rows_.data() + pair.first_row + (side.is_b ? of_a : 0),
      of_a + of_b,      {own.functions, own.rotation, offset}, to};
}

void TouchLanes::addPulls(std::uint32_t piece, float* gradient) const {
  for (const Side& side : sidesOf(piece)) {
    if (pairs_[side.pair].pulls) kernels().add_pulls(sideOf(side, nullptr, gradient));
  }
}

void TouchLanes::addBends(std::uint32_t piece, const float* offset, float* change) const {
  for (const Side& side : sidesOf(piece)) kernels().add_bends(sideOf(side, offset, change));
}

}  // namespace sinew::internal
