// SPDX-License-Identifier: GPL-3.0-or-later
//
// Near but separate stays separate: lips, fingers, feet, a slit ring.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
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
  std::vector<double> of;  // every visual vertex
  motion.least_moved = std::numeric_limits<double>::infinity();
  for (const TetrahedronPlace& place : places) {
    double x = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t p = physical.tetrahedra[place.tetrahedron][k];
      x += place.weights[k] * (to_moved[p] < to_kept[p] ? 1.0 : 0.0);
    }
    of.push_back(x);
  }
  for (const std::uint32_t v : moved) motion.least_moved = std::min(motion.least_moved, of[v]);
  for (const std::uint32_t v : kept) motion.most_kept = std::max(motion.most_kept, std::abs(of[v]));
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
        EXPECT_EQ(euler(physical), 1) << what;  // a ball, whatever the gap
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

// Vertices of a group within some distance of a plane across x.
std::vector<std::uint32_t> middleOf(const VisualMesh& mesh, std::vector<std::uint32_t> vertices, double x,
                                    double reach) {
  std::erase_if(vertices, [&](std::uint32_t v) { return std::abs(mesh.positions[v].x() - x) > reach; });
  return vertices;
}

// Opened by two clusters, the mouth parts all along the upper lip. The lower lip goes with its own cluster but for the
// corners: two cells from one, as fine as the lattice can be.
TEST(Separation, LipsOfAHead) {
  const VisualMesh mesh = import("makehuman_head.obj");
  const std::vector<std::uint32_t> upper = groupVertices(mesh, "lip_upper"), lower = groupVertices(mesh, "lip_lower");
  ASSERT_GT(upper.size(), 100U);
  ASSERT_GT(lower.size(), 100U);
  double half_width = 0;
  for (const std::uint32_t v : upper) half_width = std::max(half_width, std::abs(mesh.positions[v].x()));
  for (const auto& [target, part] : {std::pair{1500U, 0.2}, std::pair{8000U, 0.35}}) {
    for (const TetrahedraMethod method : {automatic, grid}) {
      const std::string what = testing::name(method) + " " + std::to_string(target);
      const PhysicalMesh physical = fill(mesh, method, target);
      EXPECT_LT(move(mesh, physical, lower, upper).most_kept, 0.05) << what;
      EXPECT_LT(move(mesh, physical, upper, lower).most_kept, 0.05) << what;
      const auto middle_upper = middleOf(mesh, upper, 0, part * half_width),
                 middle_lower = middleOf(mesh, lower, 0, part * half_width);
      const Motion motion = move(mesh, physical, middle_lower, middle_upper);
      EXPECT_LT(motion.most_kept, 0.05) << what;
      EXPECT_GT(motion.least_moved, 0.95) << what;
    }
  }
}

// A lid does not take the other one along. How far it opens itself depends on the tetrahedra: it is thinner than a cell
// of the lattice, and only a shell follows it wholly.
TEST(Separation, EyelidsOfAHead) {
  const VisualMesh mesh = import("makehuman_head.obj");
  const std::vector<std::uint32_t> upper = groupVertices(mesh, "eyelid_upper_l"),
                                   lower = groupVertices(mesh, "eyelid_lower_l");
  ASSERT_GT(upper.size(), 50U);
  ASSERT_GT(lower.size(), 50U);
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const std::uint32_t v : upper) {
    low = std::min(low, mesh.positions[v].x());
    high = std::max(high, mesh.positions[v].x());
  }
  for (const std::uint32_t target : {1500U, 8000U}) {
    for (const TetrahedraMethod method : {automatic, grid, TetrahedraMethod::shell}) {
      const std::string what = testing::name(method) + " " + std::to_string(target);
      const PhysicalMesh physical = fill(mesh, method, target);
      EXPECT_LT(move(mesh, physical, lower, upper).most_kept, 0.05) << what;
      EXPECT_LT(move(mesh, physical, upper, lower).most_kept, 0.05) << what;
      if (method != TetrahedraMethod::shell) continue;
      const auto middle = [&](const std::vector<std::uint32_t>& lid) {
        return middleOf(mesh, lid, (low + high) / 2, 0.175 * (high - low));
      };
      EXPECT_GT(move(mesh, physical, middle(lower), middle(upper)).least_moved, 0.95) << what;
    }
  }
}

TEST(Separation, FingersOfAHand) {
  const VisualMesh mesh = import("hand_rigged.glb");
  const std::vector<std::string> names = {"thumb", "index-finger", "middle-finger", "ring-finger", "pinky-finger"};
  // Vertices that the two outer bones of each finger carry.
  std::vector<std::vector<std::uint32_t>> fingers(names.size());
  for (std::uint32_t v = 0; v < mesh.skin.size(); ++v) {
    for (std::size_t f = 0; f < names.size(); ++f) {
      double weight = 0;
      for (const SkinInfluence& influence : mesh.skin[v]) {
        const std::string& joint = mesh.joints[influence.joint];
        if (joint == names[f] + "-tip" || joint == names[f] + "-phalanx-distal") weight += double(influence.weight);
      }
      if (weight > 0.9) fingers[f].push_back(v);
    }
  }
  for (const std::uint32_t target : {600U, 1500U}) {
    const PhysicalMesh physical = fill(mesh, automatic, target);
    EXPECT_EQ(euler(physical), 1) << target;
    for (std::size_t f = 0; f < names.size(); ++f) {
      ASSERT_GT(fingers[f].size(), 20U) << names[f];
      std::vector<std::uint32_t> others;
      for (std::size_t g = 0; g < names.size(); ++g) {
        if (g != f) others.insert(others.end(), fingers[g].begin(), fingers[g].end());
      }
      const Motion motion = move(mesh, physical, fingers[f], others);
      EXPECT_LT(motion.most_kept, 0.05) << names[f] << " " << target;
      EXPECT_GT(motion.least_moved, 0.95) << names[f] << " " << target;
    }
  }
}

TEST(Separation, FeetOfAPenguin) {
  const VisualMesh mesh = testing::readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "models" / "penguin_control.obj");
  std::vector<std::uint32_t> left, right;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v) {
    if (mesh.positions[v].y() < -1.1 && std::abs(mesh.positions[v].x()) > 0.25)
      (mesh.positions[v].x() < 0 ? left : right).push_back(v);
  }
  ASSERT_GT(left.size(), 10U);
  ASSERT_GT(right.size(), 10U);
  const Motion motion = move(mesh, fill(mesh, automatic, 1500), left, right);
  EXPECT_LT(motion.most_kept, 0.05);
  EXPECT_GT(motion.least_moved, 0.95);
}

// Links of a chain that pass through one another are bodies of their own, also where they are asked to share one.
TEST(Separation, LinksOfAChain) {
  const VisualMesh mesh = testing::readObj(std::filesystem::path(SINEW_TEST_ASSETS) / "generated" / "chain.obj");
  for (const std::uint32_t target : {100U, 1500U}) {
    const PhysicalMesh physical = fill(mesh, automatic, target);
    ASSERT_EQ(physical.pieces.size(), 3U);
    EXPECT_EQ(euler(physical), 0);  // three rings
  }
}

}  // namespace
}  // namespace sinew::tools
