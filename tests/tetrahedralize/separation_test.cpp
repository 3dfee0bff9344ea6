// SPDX-License-Identifier: GPL-3.0-or-later
//
// Near but separate stays separate: lips, fingers, feet, a slit ring.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <queue>
#include <set>
#include <string>

#include "tests/geometry/shapes.h"
#include "tests/support/obj_reader.h"
#include "tests/tetrahedralize/check.h"
#include "tools/attach/attach.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using testing::fill;
using testing::Surface;
using enum TetrahedraMethod;

VisualMesh import(const std::string& name) {
  Progress progress(false);
  ImportOptions options;
  options.worker = SINEW_IMPORT_WORKER;
  return importVisualMesh(std::filesystem::path(SINEW_TEST_ASSETS) / "models" / name, options, progress);
}

// A surface from a closed outline in x-y (counter-clockwise), drawn out along z in `steps`.
Surface extrude(const std::vector<std::array<double, 2>>& outline, double depth, std::uint32_t steps,
                const std::vector<std::array<std::uint32_t, 4>>& caps) {
  Surface s;
  const auto n = std::uint32_t(outline.size());
  for (std::uint32_t k = 0; k <= steps; ++k) {
    for (const auto& p : outline) s.positions.emplace_back(p[0], p[1], depth * (double(k) / steps - 0.5));
  }
  const auto quad = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d) {
    s.triangles.push_back({a, b, c});
    s.triangles.push_back({a, c, d});
  };
  for (std::uint32_t k = 0; k < steps; ++k) {
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t j = (i + 1) % n;
      quad(k * n + i, k * n + j, (k + 1) * n + j, (k + 1) * n + i);
    }
  }
  for (const auto& c : caps) {
    quad(c[3], c[2], c[1], c[0]);
    quad(steps * n + c[0], steps * n + c[1], steps * n + c[2], steps * n + c[3]);
  }
  return s;
}

// Two jaws of 1 x 0.5 x 1 in front of a back of 0.4, `gap` apart.
Surface jaws(double gap) {
  const double g = gap / 2;
  const std::vector<std::array<double, 2>> outline = {{-0.4, -0.5}, {0, -0.5},   {1, -0.5}, {1, -g},
                                                      {0, -g},      {0, g},      {1, g},    {1, 0.5},
                                                      {0, 0.5},     {-0.4, 0.5}, {-0.4, g}, {-0.4, -g}};
  return extrude(outline, 1, 8, {{0, 1, 4, 11}, {11, 4, 5, 10}, {10, 5, 8, 9}, {1, 2, 3, 4}, {5, 6, 7, 8}});
}

VisualMesh visual(const Surface& surface) {
  std::vector<std::vector<std::uint32_t>> faces;
  for (const auto& t : surface.triangles) faces.push_back({t[0], t[1], t[2]});
  return testing::makeMesh(surface.positions, faces);
}

// Physical vertices nearer (along edges) to the tetrahedra of `moved` than to those of `kept` move by 1.
struct Motion {
  double least_moved = 0;  // of `moved`
  double most_kept = 0;    // of `kept`
  std::vector<double> of;  // every visual vertex
};

Motion move(const VisualMesh& mesh, const PhysicalMesh& physical, const std::vector<std::uint32_t>& moved,
            const std::vector<std::uint32_t>& kept) {
  const auto places = placeVisualVertices(mesh, analyzeTopology(mesh), physical);
  std::vector<std::set<std::uint32_t>> neighbours(physical.positions.size());
  for (const auto& t : physical.tetrahedra) {
    for (const std::uint32_t a : t) neighbours[a].insert(t.begin(), t.end());
  }
  const auto distances = [&](const std::vector<std::uint32_t>& from) {
    std::vector<double> distance(physical.positions.size(), std::numeric_limits<double>::infinity());
    std::priority_queue<std::pair<double, std::uint32_t>> queue;
    for (const std::uint32_t v : from) {
      for (const std::uint32_t p : physical.tetrahedra[places[v].tetrahedron]) {
        distance[p] = 0;
        queue.emplace(0, p);
      }
    }
    while (!queue.empty()) {
      const auto [d, p] = queue.top();
      queue.pop();
      if (-d > distance[p]) continue;
      for (const std::uint32_t n : neighbours[p]) {
        const double next = distance[p] + (physical.positions[p] - physical.positions[n]).norm();
        if (next < distance[n]) {
          distance[n] = next;
          queue.emplace(-next, n);
        }
      }
    }
    return distance;
  };
  const std::vector<double> to_moved = distances(moved), to_kept = distances(kept);
  Motion motion;
  motion.least_moved = std::numeric_limits<double>::infinity();
  for (const TetrahedronPlace& place : places) {
    double x = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t p = physical.tetrahedra[place.tetrahedron][k];
      x += place.weights[k] * (to_moved[p] < to_kept[p] ? 1.0 : 0.0);
    }
    motion.of.push_back(x);
  }
  int ties = 0;
  for (std::size_t p = 0; p < physical.positions.size(); ++p) {
    if (to_moved[p] == 0 && to_kept[p] == 0 && ++ties < 6)
      std::cout << "tie " << physical.positions[p].transpose() << "\n";
  }
  std::cout << ties << " ties\n";
  for (const std::uint32_t v : moved) motion.least_moved = std::min(motion.least_moved, motion.of[v]);
  for (const std::uint32_t v : kept) motion.most_kept = std::max(motion.most_kept, std::abs(motion.of[v]));
  return motion;
}

int euler(const PhysicalMesh& mesh) {
  std::set<std::array<std::uint32_t, 2>> edges;
  std::set<std::array<std::uint32_t, 3>> faces;
  for (auto t : mesh.tetrahedra) {
    std::sort(t.begin(), t.end());
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = i + 1; j < 4; ++j) {
        edges.insert({t[i], t[j]});
        for (std::size_t k = j + 1; k < 4; ++k) faces.insert({t[i], t[j], t[k]});
      }
    }
  }
  return int(mesh.positions.size()) - int(edges.size()) + int(faces.size()) - int(mesh.tetrahedra.size());
}

TEST(Separation, JawsAcrossAnyGap) {
  for (const TetrahedraMethod method : {automatic, grid, stuffing}) {
    for (const double gap : {0.3, 0.1, 0.03, 0.003, 1e-5}) {
      for (const std::uint32_t target : {200U, 1000U}) {
        const VisualMesh mesh = visual(jaws(gap));
        const PhysicalMesh physical = fill(mesh, method, target);
        const std::string what = testing::name(method) + " gap " + std::to_string(gap) + " " + std::to_string(target);
        testing::checkPhysicalMesh(physical, what);
        std::vector<std::uint32_t> upper, lower;
        for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
          if (mesh.positions[v].x() > 0.9) (mesh.positions[v].y() > 0 ? upper : lower).push_back(v);
        }
        const Motion motion = move(mesh, physical, lower, upper);
        EXPECT_LT(motion.most_kept, 0.05) << what;
        EXPECT_GT(motion.least_moved, 0.95) << what;
        std::cout << what << " chi " << euler(physical) << " n " << physical.positions.size() << " " << motion.most_kept
                  << " " << motion.least_moved << "\n";
      }
    }
  }
}

std::vector<std::uint32_t> groupVertices(const VisualMesh& mesh, const std::string& name) {
  for (const GroupSource& group : mesh.groups) {
    if (group.name == name) return group.vertices;
  }
  return {};
}

TEST(Separation, LipsOfAHead) {
  const VisualMesh mesh = import("makehuman_head.obj");
  for (const std::uint32_t target : {1500U}) {
    for (const TetrahedraMethod method : {automatic}) {
      const PhysicalMesh physical = fill(mesh, method, target);
      for (const double part : {0.2, 0.35, 0.5}) {
        std::vector<std::uint32_t> upper = groupVertices(mesh, "lip_upper"), lower = groupVertices(mesh, "lip_lower");
        double width = 0;
        for (const auto& v : upper) width = std::max(width, std::abs(mesh.positions[v].x()));
        const auto corner = [&](std::uint32_t v) { return std::abs(mesh.positions[v].x()) > part * width; };
        std::erase_if(upper, corner);
        std::erase_if(lower, corner);
        const Motion motion = move(mesh, physical, lower, upper);
        std::cout << testing::name(method) << " " << target << " part " << part << " " << upper.size() << "+"
                  << lower.size() << ": " << motion.most_kept << " " << motion.least_moved << "\n";
      }
    }
  }
}

TEST(Separation, FingersOfAHand) {
  const VisualMesh mesh = import("hand_rigged.glb");
  for (const auto& j : mesh.joints) std::cout << j << " ";
  std::cout << "\n";
}

}  // namespace
}  // namespace sinew::tools
