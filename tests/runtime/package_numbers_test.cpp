// SPDX-License-Identifier: MIT
//
// What opens stays finite: numbers of packages changed at random, under right checksums, then stepped.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <string>

#include "sinew/runtime/report.h"
#include "sinew/runtime/world.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace sinew {
namespace {

bool allFinite(std::span<const Vec3> values) {
  for (const Vec3& value : values) {
    for (const float number : value) {
      if (!std::isfinite(number)) return false;
    }
  }
  return true;
}

// What is not finite of some steps of a body; empty if all is.
std::string faultOfSteps(const std::shared_ptr<const Asset>& asset, const SolverFactory* solver) {
  WorldSettings settings;
  settings.ground = {true, {0, 1, 0}, -0.5F, 0.6F};
  World world(settings);
  BodySettings how;
  how.solver = solver;
  const Result<BodyId> body = world.addBody(asset, how);
  if (!body) return {};
  for (std::uint32_t c = 0; c < asset->package().channels().size(); ++c) world.setActivation(*body, c, 1);
  std::vector<Vec3> positions(asset->package().visualPositions().size()), normals(positions.size());
  const auto count = std::uint32_t(positions.size());
  for (int step = 0; step < 6; ++step) {
    world.step(1.0F / 60);
    if (world.repairedVertices(*body) > 0) return "repaired";
    if (!allFinite(world.positions(*body))) return "positions";
    if (!allFinite(world.velocities(*body))) return "velocities";
    if (positions.empty()) continue;
    world.visualVertices(*body, {positions[0].data(), 12, count}, {normals[0].data(), 12, count});
    if (!allFinite(positions)) return "visual positions";
    if (!allFinite(normals)) return "visual normals";
  }
  const BodyEnergy energy = world.energy(*body);
  return std::isfinite(energy.kinetic) && std::isfinite(energy.elastic) ? "" : "energy";
}

struct Place {
  std::string section;
  std::size_t offset;  // of the word in its record
};

// The section and the word of its records that byte `at` of a package belongs to.
Place placeOf(std::span<const std::byte> bytes, std::size_t at) {
  formats::Header header;
  std::memcpy(&header, bytes.data(), sizeof header);
  for (std::uint32_t i = 0; i < header.section_count; ++i) {
    formats::SectionEntry entry;
    std::memcpy(&entry, bytes.data() + sizeof header + i * sizeof entry, sizeof entry);
    if (at < entry.offset || at >= entry.offset + entry.bytes) continue;
    return {formats::sectionName(entry.id), (at - entry.offset) % entry.element_bytes};
  }
  return {"frame", at};
}

std::uint32_t changed(std::uint32_t word, std::mt19937& random) {
  const float value = std::bit_cast<float>(word);
  switch (random() % 6) {
    case 0:
      return word ^ 1U << random() % 32U;
    case 1:
      return std::uint32_t(random());
    case 2:
      return std::bit_cast<std::uint32_t>(std::ldexp(value, int(random() % 200) - 100));
    case 3:
      return std::bit_cast<std::uint32_t>(-value);
    case 4:
      return std::bit_cast<std::uint32_t>(std::ldexp(random() % 2 == 0 ? 1.0F : -1.0F, int(random() % 256) - 128));
    default:
      return word + std::uint32_t(random() % 5) - 2;
  }
}

// Changes one or two numbers behind the table, so many times.
void mutate(const formats::PackageContent& content, const SolverFactory* solver, int rounds) {
  const std::vector<std::byte> good = formats::writePackage(content);
  formats::Header header;
  std::memcpy(&header, good.data(), sizeof header);
  const std::size_t frame = (sizeof header + header.section_count * sizeof(formats::SectionEntry)) / 4;
  std::mt19937 random(20260607);
  int opened = 0;
  for (int round = 0; round < rounds; ++round) {
    test::AlignedBytes bytes(good);
    std::string where;
    for (std::size_t k = 0, changes = 1 + random() % 2; k < changes; ++k) {
      const std::size_t at = 4 * (frame + random() % (good.size() / 4 - frame));
      std::uint32_t word;
      std::memcpy(&word, bytes.span().data() + at, 4);
      const float before = std::bit_cast<float>(word);
      word = changed(word, random);
      std::memcpy(bytes.span().data() + at, &word, 4);
      const Place place = placeOf(good, at);
      if (place.section == "frame") continue;
      char line[96];
      std::snprintf(line, sizeof line, "%s+%zu (%g -> %g) ", place.section.c_str(), place.offset, double(before),
                    double(std::bit_cast<float>(word)));
      where += line;
    }
    test::reseal(bytes.span());
    const auto asset = Asset::fromMemory(bytes.span());
    if (!asset) continue;
    ++opened;
    const std::string fault = faultOfSteps(*asset, solver);
    EXPECT_EQ(fault, "") << "round " << round << ": " << where;
  }
  EXPECT_GT(opened, rounds / 5);  // or the damage tests nothing
}

formats::PackageContent box(bool hung) {
  test::BoxOptions options;
  options.cells = {2, 1, 1};
  options.clusters = {2, 1, 1};
  options.mode = hung ? formats::ClusterMode::linear : formats::ClusterMode::quadratic;
  options.cluster_attachment = hung;
  formats::PackageContent content = test::boxContent(options);
  test::addFields(content);
  return content;
}

TEST(PackageNumbers, WhatOpensStaysFinite) {
  mutate(box(false), nullptr, 8000);
  mutate(box(true), nullptr, 8000);
  mutate(test::fieldPackage(), nullptr, 8000);
}

TEST(PackageNumbers, WhatOpensStaysFiniteByTheReportsSolver) {
  mutate(box(false), &reportSolver(), 8000);
  mutate(box(true), &reportSolver(), 8000);
  mutate(test::mechanicsPackage(), &reportSolver(), 8000);
}

}  // namespace
}  // namespace sinew
