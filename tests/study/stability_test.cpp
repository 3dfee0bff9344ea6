// SPDX-License-Identifier: GPL-3.0-or-later
//
// The quick stability matrix (docs/stability.md), and the design it is made of.
#include "tools/study/stability.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <set>

#include "tools/study/covering.h"
#include "tools/study/sag.h"

namespace sinew::tools {
namespace {

TEST(CoveringDesign, HoldsEveryCombinationOfAnyTwoOrThreeFactors) {
  const std::vector<std::uint8_t> levels = {4, 3, 2, 5, 3};
  for (const std::size_t strength : {2U, 3U}) {
    const auto cells = coveringDesign(levels, strength);
    std::size_t product = 1;
    for (const std::uint8_t count : levels) product *= count;
    EXPECT_LT(cells.size(), product);
    for (std::size_t a = 0; a < levels.size(); ++a) {
      for (std::size_t b = a + 1; b < levels.size(); ++b) {
        std::set<std::pair<int, int>> seen;
        for (const auto& cell : cells) seen.insert({cell[a], cell[b]});
        EXPECT_EQ(seen.size(), std::size_t(levels[a]) * levels[b]) << a << " " << b;
      }
    }
  }
  EXPECT_EQ(coveringDesign(levels, 2), coveringDesign(levels, 2));
}

TEST(Stability, TheDesignsAreTheSameEachTimeAndDistinct) {
  const auto cells = stabilityDesign(true);
  EXPECT_EQ(cells, stabilityDesign(true));
  EXPECT_EQ(std::set<StabilityCell>(cells.begin(), cells.end()).size(), cells.size());
}

TEST(Stability, ChanceDrawsEveryLevelAndTheSameForTheSameSeed) {
  const auto cells = stabilityChance(2000, 3);
  EXPECT_EQ(cells, stabilityChance(2000, 3));
  EXPECT_NE(cells, stabilityChance(2000, 4));
  for (std::size_t f = 0; f < kStabilityFactorCount; ++f) {
    const std::size_t levels = levelsOf(StabilityFactor(f)).size();
    std::vector<double> drawn(levels, 0);
    for (const StabilityCell& cell : cells) ++drawn.at(cell[f]);
    for (const double count : drawn) EXPECT_NEAR(count, 2000.0 / double(levels), 0.2 * 2000.0 / double(levels) + 40);
  }
}

TEST(Stability, ACellGivesTheSameResultEachTime) {
  const StabilityCell cell = stabilityDesign(true)[17];
  const StabilityResult one = runStabilityCell(cell, true), two = runStabilityCell(cell, true);
  EXPECT_EQ(one.rest_error, two.rest_error);
  EXPECT_EQ(one.energy, two.energy);
  EXPECT_EQ(one.momentum, two.momentum);
}

// Every cell of the quick matrix keeps what docs/stability.md promises.
TEST(Stability, TheQuickMatrix) {
  StabilityOptions options;
  options.quick = true;
  for (const StabilityResult& result : runStability(options)) {
    EXPECT_TRUE(result.passed()) << result.cause() << " " << result.worst() << " " << textOf(result.cell);
  }
}

// Cells of the full matrix that faults of the runtime were found with.
TEST(Stability, CellsOfTheFullMatrixThatShowedFaults) {
  struct Found {
    const char* cell;
    const char* fault;
  };
  constexpr std::array<Found, 24> kFound = {{
      {"start=inside_out step=1/60 stiffness=1 mass_ratio=1 mode=quadratic passes=4"
       " body=box2 before=nothing model=frequency limit=none volume=none matter=plain size=1",
       "each cluster is well, its neighbours are half a turn away: tangled for good"},
      {"start=line step=1/240 stiffness=10 mass_ratio=1 mode=linear passes=4"
       " body=two_vertices before=infinite_mass model=elastic limit=rows volume=principal matter=active size=1e+03",
       "two vertices had a shear in directions that they lack, and limits drew them to a point"},
      {"start=scatter_1 step=1/60 stiffness=1e+03 mass_ratio=1 mode=rigid passes=1"
       " body=bar before=pinned model=elastic limit=frobenius volume=principal matter=plain size=1e+03",
       "rigid clusters of a chain passed a correction on by one neighbour a pass"},
      {"start=point step=0.1 stiffness=0 mass_ratio=1e+06 mode=quadratic passes=4"
       " body=animal before=infinite_mass model=frequency limit=frobenius volume=cube_root matter=active size=1",
       "what contracts spins up"},
      {"start=scatter_1e-3 step=1 stiffness=0 mass_ratio=1 mode=quadratic passes=16"
       " body=bar before=pinned model=elastic limit=soft volume=cube_root matter=plain size=1e-06",
       "volume in passes of a second was stiffer than such a pass resolves"},
      {"start=point step=1/60 stiffness=0 mass_ratio=1e+03 mode=linear passes=1"
       " body=ring before=infinite_mass model=elastic limit=curve volume=principal matter=active size=1e+06",
       "pins on a collapsed cluster stepped towards its volume without bound"},
      {"start=mirrored step=1e-05 stiffness=0 mass_ratio=1e+06 mode=linear passes=16"
       " body=two_vertices before=infinite_mass model=elastic limit=none volume=none matter=damped size=1",
       "damping drew a new state to the rest shape"},
      {"start=line step=1/60 stiffness=1 mass_ratio=1 mode=rigid passes=4"
       " body=box2 before=hold model=elastic limit=frobenius_cheap volume=principal matter=plain size=1e-06",
       "a rigid body of several clusters came to rest out of shape"},
      {"start=scatter_1 step=1/60 stiffness=0 mass_ratio=1e+06 mode=rigid passes=1"
       " body=bar before=pressed model=elastic limit=frobenius_cheap volume=principal matter=plain size=1e-06",
       "rigid clusters of uneven masses came to rest out of shape"},
      {"start=mirrored step=1e-05 stiffness=10 mass_ratio=1 mode=linear passes=1"
       " body=bar before=pinned model=per_step limit=frobenius_cheap volume=principal matter=plain size=1e+03",
       "damping of a chain by the frequency of its pieces had it creep"},
      {"start=mirrored step=0.1 stiffness=1 mass_ratio=1 mode=linear passes=16"
       " body=animal before=nothing model=elastic limit=frobenius_cheap volume=principal matter=damped size=1e+06",
       "damping pulled a part that goes back as one, as if it were stiffness"},
      {"start=plane step=1e-05 stiffness=0.1 mass_ratio=1 mode=linear passes=16"
       " body=coincident before=nothing model=frequency limit=frobenius volume=cube_root matter=active size=1",
       "what a limit brought back without a stop was a speed of 100 bodies a second"},
      {"start=stretched step=1 stiffness=0.1 mass_ratio=1e+06 mode=quadratic passes=4"
       " body=animal before=pressed model=frequency limit=frobenius_cheap volume=principal matter=plain size=0.001",
       "the motion of stopped vertices was that of their part"},
      {"start=scatter_1e6 step=1/240 stiffness=1 mass_ratio=1 mode=quadratic passes=4"
       " body=box2 before=nothing model=frequency limit=none volume=none matter=plain size=1",
       "clusters without an orientation of their own were stopped at the guard for good"},
      {"start=scatter_1e6 step=1e-05 stiffness=0.1 mass_ratio=1e+03 mode=quadratic passes=4"
       " body=bar before=hold model=per_step limit=principal volume=none matter=plain size=1e+03",
       "squares that were cut at once flung the neighbours"},
      {"start=scatter_1e-6 step=1e-05 stiffness=100 mass_ratio=1 mode=quadratic passes=4"
       " body=box2 before=nothing model=frequency limit=none volume=none matter=plain size=1",
       "a part near enough to its rest shape was pulled as one at each turning point"},
      {"start=scatter_1e-6 step=1/240 stiffness=0.1 mass_ratio=1 mode=quadratic passes=16"
       " body=plane before=nothing model=elastic limit=frobenius volume=none matter=active size=1",
       "large squares that a limit blended by a thousandth were no stop"},
      {"start=fast_opposed step=1e-05 stiffness=100 mass_ratio=1e+06 mode=rigid passes=1"
       " body=ring before=hold model=frequency limit=soft volume=principal matter=plastic size=1e-06",
       "what pins had held had its sums taken about a point that stayed with the pins"},
      {"start=scatter_1e-3 step=1e-05 stiffness=10 mass_ratio=1 mode=quadratic passes=1"
       " body=line before=hold model=per_step limit=soft volume=none matter=active size=1",
       "a line that twists fast was turned as fast about the axis of its momentum"},
      {"start=point step=1/240 stiffness=0 mass_ratio=1 mode=quadratic passes=1"
       " body=plane before=pressed model=elastic limit=rows volume=none matter=plain size=1",
       "limits moved what has no stiffness without stopping it, a little faster every pass"},
      {"start=inside_out step=1e-05 stiffness=0 mass_ratio=1 mode=quadratic passes=4"
       " body=box2 before=nothing model=frequency limit=none volume=none matter=plain size=1",
       "the guard did the same"},
      {"start=scatter_1 step=1 stiffness=1e+03 mass_ratio=1e+06 mode=quadratic passes=1"
       " body=odd before=pressed model=elastic limit=principal volume=none matter=plain size=1e-06",
       "elastic clusters of one vertex stayed where they were when their part went back as one"},
      {"start=thrown step=0.001 stiffness=0 mass_ratio=1 mode=linear passes=1"
       " body=two_vertices before=hold model=elastic limit=frobenius_cheap volume=cube_root matter=plastic size=1e-06",
       "the measure did not see what a plastic rest shape stores"},
      {"start=fast_random step=0.1 stiffness=0.1 mass_ratio=1e+03 mode=quadratic passes=1"
       " body=animal before=pressed model=per_step limit=none volume=cube_root matter=damped size=1e+03",
       "what clusters damped themselves was taken off the damping of how they swing about one another"},
  }};
  std::vector<StabilityCell> design = stabilityDesign(false);
  const std::vector<StabilityCell> chance = stabilityChance(2000, 2);
  design.insert(design.end(), chance.begin(), chance.end());
  for (const Found& found : kFound) {
    const auto has_text = [&](const StabilityCell& cell) { return textOf(cell) == found.cell; };
    const auto cell = std::find_if(design.begin(), design.end(), has_text);
    ASSERT_NE(cell, design.end()) << found.cell;
    const StabilityResult result = runStabilityCell(*cell, false);
    EXPECT_TRUE(result.passed()) << result.cause() << " " << result.worst() << ": " << found.fault << "\n"
                                 << found.cell;
  }
}

TEST(Sag, OneClusterDoesNotFeelTheStep) {
  SagCase beam;  // 1,029 vertices: a coarse one gives way at its few pins
  double least = 1e30, most = 0;
  for (const double rate : {30.0, 60.0, 120.0, 240.0}) {
    beam.rate_hz = rate;
    const double sag = measureSag(beam, 6).sag;
    least = std::min(least, sag);
    most = std::max(most, sag);
  }
  EXPECT_GT(least, 1e-3);
  EXPECT_LT(most / least, 1.03);
}

}  // namespace
}  // namespace sinew::tools
