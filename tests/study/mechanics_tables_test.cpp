// SPDX-License-Identifier: GPL-3.0-or-later
//
// `sinew study limits` and `sinew study pins`: what docs/method.md §9 and §10 claim, and that their tables are these.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tools/study/limits.h"
#include "tools/study/pins.h"

namespace sinew::tools {
namespace {

using formats::ClusterMode;
using formats::LimitMethod;
using formats::VolumeMethod;

const std::vector<LimitsResult>& limits() {
  static const std::vector<LimitsResult> results = [] {
    std::vector<LimitsResult> all;
    for (const LimitsCase& cube : limitsCases()) all.push_back(measureLimits(cube));
    return all;
  }();
  return results;
}

const LimitsResult& limitsOf(ClusterMode mode, LimitMethod limit, VolumeMethod volume) {
  return *std::find_if(limits().begin(), limits().end(), [&](const LimitsResult& r) {
    return r.cube.mode == mode && r.cube.limit == limit && r.cube.volume == volume;
  });
}

template <class Wanted>
std::vector<PinsResult> pinsWith(const Wanted& wanted) {
  std::vector<PinsResult> found;
  for (const PinsCase& beam : pinsCases()) {
    if (wanted(beam)) found.push_back(measurePins(beam));
  }
  return found;
}

bool isUsual(const PinsCase& beam) { return beam.cells == PinsCase{}.cells && beam.clusters == 1; }

std::string withoutNumbers(const std::string& line) {
  std::string words;
  for (const char c : line) {
    if (std::strchr("0123456789.-+", c) == nullptr) words += c;
  }
  return words;
}

std::vector<double> numbersIn(const std::string& line) {
  std::vector<double> numbers;
  for (const char* at = line.c_str(); *at != 0;) {
    if (std::isdigit(static_cast<unsigned char>(*at)) == 0) {
      ++at;
      continue;
    }
    char* end = nullptr;
    numbers.push_back(std::strtod(at, &end));
    at = end;
  }
  return numbers;
}

// Every row of a study's text is a row of docs/method.md: the same words, and numbers within 2 % or 0.011 (other
// compilers round elsewhere).
void expectInDocs(const std::string& text) {
  std::ifstream file(SINEW_DOCS "/method.md");
  ASSERT_TRUE(file.good());
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  std::istringstream rows(text);
  for (std::string row; std::getline(rows, row);) {
    if (row.empty()) continue;
    const std::vector<double> wanted = numbersIn(row);
    const bool there = std::any_of(lines.begin(), lines.end(), [&](const std::string& line) {
      if (withoutNumbers(line) != withoutNumbers(row)) return false;
      const std::vector<double> given = numbersIn(line);
      return std::equal(wanted.begin(), wanted.end(), given.begin(), given.end(),
                        [](double a, double b) { return std::abs(a - b) <= std::max(0.011, 0.02 * std::abs(a)); });
    });
    EXPECT_TRUE(there) << row;
  }
}

TEST(LimitsStudy, APushedCubeStaysWithinItsLimits) {
  for (const ClusterMode mode : {ClusterMode::linear, ClusterMode::quadratic}) {
    // Volume preservation alone lets it spread, the farther the more modes it has to do so.
    const double unlimited = limitsOf(mode, LimitMethod::none, VolumeMethod::cube_root).largest_area;
    EXPECT_GT(unlimited, mode == ClusterMode::linear ? 1.3 : 3);
    for (const LimitsResult& r : limits()) {
      EXPECT_TRUE(r.finite);
      if (r.cube.mode != mode || r.cube.limit == LimitMethod::none) continue;
      EXPECT_LT(r.largest_area, 0.9 * unlimited) << limitsText({r});
    }
    // Without volume it is squashed, not spread.
    EXPECT_LT(limitsOf(mode, LimitMethod::none, VolumeMethod::none).largest_area, 1);
    EXPECT_LT(limitsOf(mode, LimitMethod::none, VolumeMethod::none).least_volume, 0.11);
  }
  // Stretches of 0.5..1.5 and volume 1: the area of a box a b c is at most that of 1.5, 1.5, 1/2.25.
  const LimitsResult& principal = limitsOf(ClusterMode::linear, LimitMethod::principal, VolumeMethod::principal);
  EXPECT_LT(principal.largest_area, 1.02 * (1.5 * 1.5 + 2 * 1.5 / 2.25) / 3);
  EXPECT_GT(principal.least_volume, 0.98);
  EXPECT_LT(principal.largest_volume, 1.02);
}

TEST(LimitsStudy, TheTableOfTheDocs) { expectInDocs(limitsText(limits())); }

TEST(PinsStudy, OnlyConstrainedFitDoesNotFeelTheStep) {
  const auto spread = [](PinMethod method, BeamStuff stuff) {
    double least = 1e30, most = 0;
    for (const PinsResult& r : pinsWith([&](const PinsCase& beam) {
           return isUsual(beam) && !beam.pulled && beam.method == method && beam.stuff == stuff;
         })) {
      least = std::min(least, r.sag);
      most = std::max(most, r.sag);
    }
    EXPECT_GT(least, 0.01);
    return most / least;
  };
  for (const BeamStuff stuff : {BeamStuff::soft, BeamStuff::elastic}) {
    EXPECT_LT(spread(PinMethod::constrained_fit, stuff), 1.03);
  }
  for (const PinMethod method : {PinMethod::hold, PinMethod::infinite_mass, PinMethod::matrix}) {
    EXPECT_GT(spread(method, BeamStuff::elastic), 1.03);
  }
}

TEST(PinsStudy, ConstrainedFitReturnsWhenGravityGoesAndCarriesTheWeight) {
  const double diagonal = std::sqrt(1 + 2 * 0.04), weight = 40 * 9.81;
  for (const PinsResult& r : pinsWith([](const PinsCase& beam) {
         return isUsual(beam) && !beam.pulled && beam.method == PinMethod::constrained_fit;
       })) {
    EXPECT_LT(r.left, 1e-3 * diagonal);
    EXPECT_NEAR(r.force[1], -weight, 2e-3 * weight);
    if (r.beam.stuff == BeamStuff::soft) {
      EXPECT_NEAR(r.moment, -0.5 * weight, 2e-3 * 0.5 * weight);
    }
  }
}

TEST(PinsStudy, ConstrainedFitKeepsSectionAndVolumeWhenACornerIsPulled) {
  const auto pulled = pinsWith([](const PinsCase& beam) {
    return beam.pulled && beam.method == PinMethod::constrained_fit && beam.stuff != BeamStuff::soft;
  });
  ASSERT_EQ(pulled.size(), 2U);
  for (const PinsResult& r : pulled) {
    EXPECT_LT(r.sag, -0.05);
    EXPECT_LT(r.section_change, 0.05);
    EXPECT_NEAR(r.volume, 1, 0.02);
  }
}

TEST(PinsStudy, ConstrainedFitDoesNotFeelTheNumberOfVertices) {
  const auto fine = pinsWith([](const PinsCase& beam) { return beam.cells != PinsCase{}.cells; });
  ASSERT_EQ(fine.size(), 2U);
  EXPECT_GT(fine[1].vertices, 6 * fine[0].vertices);
  EXPECT_NEAR(fine[1].sag, fine[0].sag, 0.05 * fine[0].sag);
}

TEST(PinsStudy, TheTablesOfTheDocsAndEveryWallIsInItsPlace) {
  const auto all = pinsWith([](const PinsCase&) { return true; });
  for (const PinsResult& r : all) {
    EXPECT_TRUE(r.finite);
    EXPECT_EQ(r.wall_error, 0);
  }
  expectInDocs(pinsText(all));
}

}  // namespace
}  // namespace sinew::tools
