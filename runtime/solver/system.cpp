// SPDX-License-Identifier: MIT
#include "runtime/solver/system.h"

#include <Eigen/Core>
#include <algorithm>

#include "runtime/solver/minimize.h"

namespace sinew::internal {
namespace {

/// A matrix whose holds are turned by so much, rad, is off by about twice that, and a few iterations make up for it.
constexpr float kTurned = 0.05F;

/// Additions to the diagonal, relative: rounding must not make a factor negative.
constexpr float kRoundings[] = {3e-7F, 3e-5F, 3e-3F};

void addHolds(const Objective& objective, float* matrix) {
  const Field& field = *objective.field;
  const Eigen::Matrix3f& turn = objective.holds_rotation;
  for (std::uint32_t i = 0; i < field.unknowns(); i += 3) {
    for (std::uint32_t j = 0; j <= i; j += 3) {
      Eigen::Matrix3f block;
      for (std::uint32_t c = 0; c < 9; ++c) {
        block(c / 3, c % 3) = objective.holds[std::size_t(field.stride) * (i + c / 3) + j + c % 3];
      }
      const Eigen::Matrix3f half = turn.lazyProduct(block);
      block = objective.stiffness * half.lazyProduct(turn.transpose());
      for (std::uint32_t c = 0; c < 9; ++c) {
        matrix[std::size_t(field.stride) * (i + c / 3) + j + c % 3] += block(c / 3, c % 3);
      }
    }
  }
}

/// sum += factor x, four numbers at once: -O2 leaves loops of unknown length scalar.
void addMultiple(float factor, const float* x, std::uint32_t count, float* sum) {
  std::uint32_t j = 0;
  for (; j + 4 <= count; j += 4) Eigen::Array4f::Map(sum + j) += factor * Eigen::Array4f::Map(x + j);
  for (; j < count; ++j) sum[j] += factor * x[j];
}

void addSprings(const Objective& objective, float* matrix) {
  const Field& field = *objective.field;
  const MinimizeScratch& s = *objective.scratch;
  if (!objective.has_springs && s.contacts.empty() && objective.touch_rows.empty()) return;
  const std::uint32_t k = field.k, driven = field.driven;
  if (objective.holds != nullptr) addHolds(objective, matrix);
  float* const row = objective.scratch->parts.data();
  for (std::uint32_t i = driven; i < k; ++i) {
    if (objective.has_springs) {
      std::copy_n(s.springs.data() + std::size_t(k) * i, i + 1, row);
    } else {
      std::fill_n(row, i + 1, 0.0F);
    }
    for (const Contact& c : s.contacts) addMultiple(c.firm * c.phi[i], c.phi, i + 1, row);
    for (const TouchRow& t : objective.touch_rows) addMultiple(t.firm * t.phi[i], t.phi, i + 1, row);
    addRow(field, i, row, matrix);
  }
}

/// \param offset null: the rest shape's.
void make(Objective& objective, SystemFactor& system, const float* offset) {
  const Field& field = *objective.field;
  const std::uint32_t size = field.unknowns(), stride = field.stride;
  Array<float>& a = system.factor;
  a.resize(std::size_t(size) * stride);
  const float inertia = float(1 / (objective.h * objective.h));
  objective.system = nullptr;
  for (const float rounding : kRoundings) {
    if (offset != nullptr) {
      objective.stiffnessAt(offset, a.data());
    } else {
      for (std::size_t i = 0; i < a.size(); ++i) a[i] = objective.stiffness * field.stiffness[i];
    }
    addSprings(objective, a.data());
    for (std::uint32_t i = 0; i < size; ++i) {
      float& diagonal = a[std::size_t(stride) * i + i];
      diagonal += inertia + rounding * diagonal;
    }
    if (!kernels().factorize({size, stride, a.data(), objective.scratch->parts.data()})) continue;
    objective.system = a.data();
    break;
  }
}

}  // namespace

void useRestSystem(Objective& objective, SystemFactor& system) {
  const auto& contacts = objective.scratch->contacts;
  objective.system = nullptr;
  const auto& touches = objective.touch_rows;
  if (!objective.has_springs && contacts.empty() && touches.empty()) return;
  const auto split = system.points.begin() + std::min(contacts.size(), system.points.size());
  const bool turned = objective.holds != nullptr && !(objective.holds_rotation - system.holds_turn).isZero(kTurned);
  const bool same =
      system.h == objective.h && !turned &&
      std::equal(system.points.begin(), split, contacts.begin(), contacts.end(),
                 [](const SystemFactor::Point& p, const Contact& c) {
                   return p.point == c.point && p.firm == c.firm && Eigen::Vector3f::Map(p.rest.data()) == c.rest;
                 }) &&
      std::equal(split, system.points.end(), touches.begin(), touches.end(),
                 [](const SystemFactor::Point& p, const TouchRow& t) { return p.point == t.key && p.firm == t.firm; });
  if (same) {
    objective.system = system.factor.data();
    return;
  }
  make(objective, system, nullptr);
  system.h = objective.system != nullptr ? objective.h : 0;
  if (objective.holds != nullptr) system.holds_turn = objective.holds_rotation;
  system.points.clear();
  for (const Contact& contact : contacts) {
    system.points.push_back({contact.point, contact.firm, {contact.rest[0], contact.rest[1], contact.rest[2]}});
  }
  for (const TouchRow& touch : touches) system.points.push_back({touch.key, touch.firm, {}});
}

void useSystemAt(Objective& objective, SystemFactor& system, const float* offset) {
  make(objective, system, offset);
  system.h = 0;
}

}  // namespace sinew::internal
