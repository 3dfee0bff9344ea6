// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/covering.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

using Cell = std::vector<std::uint8_t>;

constexpr std::size_t kCandidates = 24;

// One choice of `strength` factors, and which combinations of their levels are covered.
struct Tuple {
  std::vector<std::size_t> factors;
  std::vector<char> covered;
  std::size_t missing = 0;

  std::size_t index(const Cell& cell, const std::vector<std::uint8_t>& levels) const {
    std::size_t result = 0;
    for (const std::size_t f : factors) result = result * levels[f] + cell[f];
    return result;
  }
};

std::vector<Tuple> tuplesOf(const std::vector<std::uint8_t>& levels, std::size_t strength) {
  std::vector<Tuple> result;
  std::vector<char> chosen(levels.size(), 0);
  std::fill(chosen.begin(), chosen.begin() + std::ptrdiff_t(strength), char(1));
  do {
    Tuple tuple;
    std::size_t size = 1;
    for (std::size_t f = 0; f < levels.size(); ++f) {
      if (chosen[f] == 0) continue;
      tuple.factors.push_back(f);
      size *= levels[f];
    }
    tuple.covered.assign(size, 0);
    tuple.missing = size;
    result.push_back(std::move(tuple));
  } while (std::prev_permutation(chosen.begin(), chosen.end()));
  return result;
}

}  // namespace

std::vector<Cell> coveringDesign(const std::vector<std::uint8_t>& levels, std::size_t strength,
                                 const std::vector<Cell>& given) {
  std::vector<Tuple> tuples = tuplesOf(levels, strength);
  const auto cover = [&](const Cell& cell) {
    for (Tuple& tuple : tuples) {
      char& covered = tuple.covered[tuple.index(cell, levels)];
      tuple.missing -= covered == 0 ? 1U : 0U;
      covered = 1;
    }
  };
  for (const Cell& cell : given) cover(cell);
  std::vector<Cell> result;
  std::uint64_t draw = 0;
  while (true) {
    const auto most = std::max_element(tuples.begin(), tuples.end(),
                                       [](const Tuple& a, const Tuple& b) { return a.missing < b.missing; });
    if (most->missing == 0) return result;
    const std::size_t first =
        std::size_t(std::find(most->covered.begin(), most->covered.end(), 0) - most->covered.begin());
    Cell best;
    std::size_t best_gain = 0;
    for (std::size_t candidate = 0; candidate < kCandidates; ++candidate) {
      // The missing combination is fixed; the other factors by chance, then each changed once for the better.
      Cell cell(levels.size());
      for (std::size_t f = 0; f < levels.size(); ++f) {
        cell[f] = std::uint8_t(chance(strength, draw++) * double(levels[f]));
      }
      std::size_t rest = first;
      for (std::size_t k = most->factors.size(); k-- > 0;) {
        cell[most->factors[k]] = std::uint8_t(rest % levels[most->factors[k]]);
        rest /= levels[most->factors[k]];
      }
      std::size_t gain = 0;
      for (const Tuple& tuple : tuples) gain += tuple.covered[tuple.index(cell, levels)] == 0 ? 1U : 0U;
      if (best.empty() || gain > best_gain) {
        best = cell;
        best_gain = gain;
      }
    }
    cover(best);
    result.push_back(best);
  }
}

}  // namespace sinew::tools
