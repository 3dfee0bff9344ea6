// SPDX-License-Identifier: MIT
//
// Touches in lanes, against the push of one point alone.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <random>

#include "runtime/kernels/kernels.h"
#include "runtime/solver/minimize.h"

namespace sinew::test {
namespace {

using Eigen::Vector3f;
using internal::Push;
using internal::TouchLanes;

constexpr std::uint32_t kFunctions[] = {5, 4};
constexpr std::uint32_t kFirst[] = {0, 20};
/// Frames of the pieces.
const Eigen::Matrix3f kRotation[] = {
    Eigen::AngleAxisf(0.9F, Vector3f(1, -2, 2).normalized()).toRotationMatrix(),
    Eigen::AngleAxisf(-2.1F, Vector3f(3, 1, -1).normalized()).toRotationMatrix(),
};

/// Touches between two pieces, both ways, and of the second with itself.
struct Touches {
  struct One {
    Push push = {};
    std::uint32_t a = 0, b = 0;
    std::vector<float> phi_a, phi_b;
  };

  Touches() : lanes(std::pmr::get_default_resource()) {
    for (std::uint32_t i = 0; i < 14; ++i) {
      One one;
      one.a = i < 6 ? 0 : 1;
      one.b = i < 6 || i >= 11 ? 1 : 0;
      for (std::uint32_t j = 0; j < kFunctions[one.a]; ++j) one.phi_a.push_back(chance());
      for (std::uint32_t j = 0; j < kFunctions[one.b]; ++j) one.phi_b.push_back(one.a == one.b ? 0 : chance());
      Push& push = one.push;
      push.way = push.lag = Vector3f::Zero();
      push.normal = Vector3f(chance(), chance(), chance()).normalized();
      push.gap = 0.5F * chance();
      push.slide = Vector3f(chance(), chance(), chance());
      push.slide -= push.slide.dot(push.normal) * push.normal;
      push.kappa = 100 + 50 * chance();
      push.friction = i % 4 == 0 ? 0 : 0.3F + 0.3F * chance();
      all.push_back(one);
    }
    for (int i = 0; i < 36; ++i) d.push_back(i % 4 == 3 ? 0 : chance());
    fill(0, 11, 0);
    fill(11, 3, 1);
    lanes.finish(2);
  }
  float chance() { return std::uniform_real_distribution<float>(-1, 1)(random); }
  void fill(std::uint32_t first, std::uint32_t count, std::uint32_t a) {
    const std::uint32_t slot = lanes.addPair({a, kFunctions[a], kRotation[a].data()},
                                             {1, a == 1 ? 0 : kFunctions[1], kRotation[1].data()}, {first, count});
    slots.push_back(slot);
    for (std::uint32_t i = 0; i < count; ++i) {
      const One& one = all[first + i];
      lanes.set(slot + i, lanes.pairs().back(), one.push, one.phi_a.data(), one.phi_b.data(), one.a != a);
    }
  }
  Vector3f wayOf(const One& one) const {
    Vector3f way = Vector3f::Zero();
    for (std::uint32_t j = 0; j < one.phi_a.size(); ++j) way += one.phi_a[j] * at(one.a, j);
    for (std::uint32_t j = 0; j < one.phi_b.size(); ++j) way -= one.phi_b[j] * at(one.b, j);
    return way;
  }
  Vector3f at(std::uint32_t piece, std::uint32_t j) const {
    return kRotation[piece] * Eigen::Map<const Vector3f>(d.data() + kFirst[piece] + 4 * j);
  }
  /// What a pull at the point of one adds to a gradient.
  void add(const One& one, const Vector3f& pull, std::vector<float>& gradient) const {
    for (std::uint32_t j = 0; j < one.phi_a.size(); ++j) {
      Eigen::Map<Vector3f>(gradient.data() + kFirst[one.a] + 4 * j) +=
          one.phi_a[j] * kRotation[one.a].transpose() * pull;
    }
    for (std::uint32_t j = 0; j < one.phi_b.size(); ++j) {
      Eigen::Map<Vector3f>(gradient.data() + kFirst[one.b] + 4 * j) -=
          one.phi_b[j] * kRotation[one.b].transpose() * pull;
    }
  }
  std::vector<float> gradient() const {
    std::vector<float> result(36, 0.0F);
    for (std::uint32_t piece : {0U, 1U}) lanes.addPulls(piece, result.data() + kFirst[piece]);
    return result;
  }

  std::mt19937 random{7};
  std::vector<One> all;
  std::vector<float> d;
  std::vector<std::uint32_t> slots;
  TouchLanes lanes;
};

void expectNear(const std::vector<float>& found, const std::vector<float>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], expected[i], 1e-4 * 200) << i;
}

TEST(TouchLanes, PushAsEachPointAlone) {
  Touches t;
  t.lanes.place(t.d.data(), kFirst, true, nullptr);
  double energy = t.lanes.evaluate(t.d.data(), kFirst, nullptr), expected = 0;
  std::vector<float> gradient(36, 0.0F);
  int pushing = 0;
  for (Touches::One& one : t.all) {
    one.push.way = t.wayOf(one);
    one.push.pressed = one.push.kappa * std::max(0.0F, -(one.push.gap + one.push.normal.dot(one.push.way)));
    const internal::PushForce force = pushForce(one.push);
    expected += force.energy;
    pushing += force.energy > 0 ? 1 : 0;
    t.add(one, force.pull, gradient);
  }
  EXPECT_GT(pushing, 3);
  EXPECT_LT(pushing, 12);
  EXPECT_NEAR(energy, expected, 1e-5 * expected);
  expectNear(t.gradient(), gradient);

  // Elsewhere friction has another load, which rub() makes up for.
  t.lanes.pullOn(nullptr);
  for (float& x : t.d) x *= 0.6F;
  energy = t.lanes.evaluate(t.d.data(), kFirst, nullptr);
  std::vector<float> bends(36, 0.0F), offset(36);
  for (std::size_t i = 0; i < offset.size(); ++i) offset[i] = i % 4 == 3 ? 0 : t.chance();
  for (std::uint32_t piece : {0U, 1U}) {
    t.lanes.addBends(piece, offset.data() + kFirst[piece], bends.data() + kFirst[piece]);
  }
  energy += t.lanes.rub(nullptr);
  const std::vector<float> change = t.gradient();
  std::vector<float> expected_change(36, 0.0F), expected_bends(36, 0.0F);
  expected = 0;
  for (std::size_t i = 0; i < t.all.size(); ++i) {
    Touches::One& one = t.all[i];
    const internal::PushForce before = pushForce(one.push);
    one.push.way = t.wayOf(one);
    const internal::PushForce there = pushForce(one.push);
    const float gap = one.push.gap + one.push.normal.dot(one.push.way);
    EXPECT_NEAR(t.lanes.gap(t.slots[i < 11 ? 0 : 1] + std::uint32_t(i < 11 ? i : i - 11)), gap, 1e-5);
    t.add(one, before.pull - there.pull, expected_bends);
    for (const bool other : {false, true}) {
      const std::uint32_t piece = other ? one.b : one.a;
      const std::vector<float>& phi = other ? one.phi_b : one.phi_a;
      if (!(gap < 0)) continue;
      Vector3f way = Vector3f::Zero();
      for (std::uint32_t j = 0; j < phi.size(); ++j) {
        way += phi[j] * Eigen::Map<const Vector3f>(offset.data() + kFirst[piece] + 4 * j);
      }
      for (std::uint32_t j = 0; j < phi.size(); ++j) {
        Eigen::Map<Vector3f>(expected_bends.data() + kFirst[piece] + 4 * j) += one.push.kappa * phi[j] * way;
      }
    }
    one.push.pressed = one.push.kappa * std::max(0.0F, -gap);
    const internal::PushForce after = pushForce(one.push);
    expected += after.energy;
    t.add(one, after.pull - there.pull, expected_change);
  }
  EXPECT_NEAR(energy, expected, 1e-5 * expected);
  expectNear(change, expected_change);
  expectNear(bends, expected_bends);
}

TEST(TouchLanes, AreTheSameForAllInstructionSets) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> number(-1, 1);
  const auto some = [&](std::size_t count) {
    std::vector<float> numbers(count);
    for (float& each : numbers) each = number(random);
    return numbers;
  };
  constexpr std::uint32_t kPacks = 11, kA = 5, kB = 4;
  std::vector<internal::PushPack> begin(kPacks);
  for (internal::PushPack& pack : begin) {
    const std::vector<float> numbers = some(sizeof(internal::PushPack) / sizeof(float));
    std::memcpy(&pack, numbers.data(), sizeof(internal::PushPack));
    for (float* positive : {pack.kappa, pack.friction, pack.pressed}) {
      for (int i = 0; i < 8; ++i) positive[i] = std::abs(positive[i]);
    }
  }
  const std::vector<float> rows = some(8 * kPacks * (kA + kB)), a = some(4 * kA), b = some(4 * kB),
                           offset = some(4 * kA);
  std::vector<std::byte> expected;
  int sets = 0;
  for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
    const internal::Kernels* table = internal::kernelsNamed(name);
    if (table == nullptr) continue;
    ++sets;
    std::vector<internal::PushPack> packs = begin;
    bool pulls = false;
    const float* const turns[] = {kRotation[0].data(), kRotation[1].data()};
    const internal::PushArguments arguments = {
        kPacks, packs.data(), rows.data(), {kA, turns[0], a.data()}, {kB, turns[1], b.data()}, &pulls};
    std::vector<double> energies = {table->push_forces(arguments)};
    std::vector<float> sums(8 * kA, 0.0F);
    const std::size_t stride = std::size_t(8) * (kA + kB);
    table->add_pulls({kPacks, packs.data(), rows.data(), stride, {kA, turns[0], nullptr}, sums.data()});
    table->add_bends({kPacks, packs.data(), rows.data(), stride, {kA, turns[0], offset.data()}, sums.data() + 4 * kA});
    energies.push_back(table->push_rubs(arguments));
    EXPECT_TRUE(pulls);
    std::vector<std::byte> found;
    const auto note = [&found](const auto& numbers) {
      const auto* const bytes = reinterpret_cast<const std::byte*>(numbers.data());
      found.insert(found.end(), bytes, bytes + numbers.size() * sizeof numbers[0]);
    };
    note(packs);
    note(energies);
    note(sums);
    if (expected.empty()) expected = found;
    EXPECT_EQ(found, expected) << name;
  }
  EXPECT_GT(sets, 0);
}

}  // namespace
}  // namespace sinew::test
