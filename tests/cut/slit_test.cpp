// SPDX-License-Identifier: MIT
//
// Planes that end: what they leave is closed, weighs what it did, and opens as finite elements do.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/geometry/sets.h"
#include "sinew/c_api.h"
#include "sinew/runtime/cut.h"
#include "sinew/runtime/world.h"
#include "tests/cut/cut_checks.h"
#include "tests/support/box_package.h"
#include "tests/support/field_content.h"

namespace sinew::test {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

Vector3d asVector(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

/// In the plane x = at, from y = low up to what is beyond every body here.
CutPlane notch(float low, float at = 0.01F) {
  return boundedPlane({Vec3{at, low, 9}, Vec3{at, low, -9}, Vec3{at, 9, -9}, Vec3{at, 9, 9}});
}

CutResult cutAtRest(const Asset& asset, const CutPlane& plane, std::size_t parts) {
  auto cut = cutAsset(asset, restOf(asset), plane);
  EXPECT_TRUE(cut) << (cut ? "" : cut.reason());
  if (!cut) return {};
  CutErrors errors;
  EXPECT_EQ(faultOfCut(asset, *cut, errors, parts), "");
  EXPECT_EQ(cut->parts.size(), parts);
  return std::move(*cut);
}

/// What lies on the part's side of tetrahedra that are there twice, below first: shares of places in them; others 1.
std::vector<double> sharesOf(const CutPart& part, const CutPlane& plane) {
  const formats::PackageView& package = part.asset->package();
  const auto tetrahedra = package.tetrahedra();
  std::vector<double> shares(tetrahedra.size(), 1);
  const auto sourceOf = [&](std::size_t t) {
    std::array<std::uint32_t, 4> source = {};
    for (std::size_t k = 0; k < 4; ++k) source[k] = part.physical[tetrahedra[t].vertex[k]];
    return source;
  };
  constexpr int kSteps = 12;
  for (std::size_t t = 0; t + 1 < tetrahedra.size(); ++t) {
    if (sourceOf(t) != sourceOf(t + 1)) continue;
    int all = 0, above = 0;
    for (int i = 0; i < kSteps; ++i) {
      for (int j = 0; i + j < kSteps; ++j) {
        for (int l = 0; i + j + l < kSteps; ++l, ++all) {
          const std::array<double, 4> w = {i + 0.25, j + 0.25, l + 0.25, kSteps - i - j - l - 0.75};
          Vector3d x = Vector3d::Zero();
          for (std::size_t k = 0; k < 4; ++k) {
            x += w[k] / kSteps * asVector(package.physicalVertices()[tetrahedra[t].vertex[k]].rest_position);
          }
          above += asVector(plane.normal).dot(x - asVector(plane.point)) > 0 ? 1 : 0;
        }
      }
    }
    shares[t + 1] = double(above) / all;
    shares[t] = 1 - shares[t + 1];
  }
  return shares;
}

/// Stiffness of linear elasticity on a package's tetrahedra, 3 n x 3 n, made firm by 1e-9 of its mean: free bodies
/// move.
Eigen::SparseMatrix<double> stiffnessOf(const formats::PackageView& package, const std::vector<double>& shares,
                                        double mu, double lambda) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto vertices = package.physicalVertices();
  double trace = 0;
  for (std::size_t n = 0; n < shares.size(); ++n) {
    const formats::Tetrahedron& t = package.tetrahedra()[n];
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) {
      edges.col(k) =
          asVector(vertices[t.vertex[std::size_t(k)]].rest_position) - asVector(vertices[t.vertex[3]].rest_position);
    }
    const double volume = shares[n] * std::abs(edges.determinant()) / 6;
    Eigen::Matrix<double, 4, 3> g;
    g.topRows<3>() = edges.inverse();
    g.row(3) = -g.topRows<3>().colwise().sum();
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) {
        const Eigen::Matrix3d k =
            volume * (mu * (g.row(i).dot(g.row(j)) * Eigen::Matrix3d::Identity() + g.row(j).transpose() * g.row(i)) +
                      lambda * g.row(i).transpose() * g.row(j));
        if (i == j) trace += k.trace();
        for (int a = 0; a < 3; ++a) {
          for (int b = 0; b < 3; ++b) {
            entries.emplace_back(3 * int(t.vertex[std::size_t(i)]) + a, 3 * int(t.vertex[std::size_t(j)]) + b, k(a, b));
          }
        }
      }
    }
  }
  const int n = 3 * int(vertices.size());
  for (int i = 0; i < n; ++i) entries.emplace_back(i, i, 1e-9 * trace / n);
  Eigen::SparseMatrix<double> matrix(n, n);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

/// How far a load moves what is measured (w . u), by finite elements, by the field's functions, by its samples.
struct Opening {
  double exact = 0, functions = 0, samples = 0;
};

Opening openingOf(const CutPart& part, const CutPlane& plane, const VectorXd& load, const VectorXd& measured) {
  const formats::PackageView& package = part.asset->package();
  const formats::Field& field = package.fields()[0];
  const double mu = double(package.fieldPacks()[0].mu[0]), lambda = double(package.fieldPacks()[0].lambda[0]);
  const Eigen::SparseMatrix<double> stiffness = stiffnessOf(package, sharesOf(part, plane), mu, lambda);
  const auto n = Eigen::Index(package.physicalVertices().size()), k = Eigen::Index(field.function_count);
  MatrixXd functions = MatrixXd::Zero(3 * n, 3 * k);
  for (Eigen::Index v = 0; v < n; ++v) {
    for (Eigen::Index j = 0; j < k; ++j) {
      const float value = package.fieldValues()[field.first_value + std::size_t(k * (v / 8) + j)][std::size_t(v % 8)];
      for (int a = 0; a < 3; ++a) functions(3 * v + a, 3 * j + a) = double(value);
    }
  }
  Opening result;
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(stiffness);
  result.exact = measured.dot(solver.solve(load));
  const VectorXd reduced = functions.transpose() * load, there = functions.transpose() * measured;
  const MatrixXd galerkin = functions.transpose() * (stiffness * functions);
  result.functions = there.dot(galerkin.ldlt().solve(reduced));
  const std::size_t block = std::size_t(3 * k) + 1;
  double highest = 0;
  for (Eigen::Index m = 0; m < 3 * k; ++m) {
    highest = std::max(highest,
                       double(package.fieldModes()[field.first_mode + block * std::size_t(m / 8)][std::size_t(m % 8)]));
  }
  for (Eigen::Index m = 0; m < 3 * k; ++m) {
    const std::size_t first = field.first_mode + block * std::size_t(m / 8), lane = std::size_t(m % 8);
    const double square = double(package.fieldModes()[first][lane]);
    if (!(square > 1e-6 * highest)) continue;
    double along = 0, seen = 0;
    for (Eigen::Index i = 0; i < 3 * k; ++i) {
      const double shape = double(package.fieldModes()[first + 1 + std::size_t(i)][lane]);
      along += shape * reduced[i];
      seen += shape * there[i];
    }
    result.samples += along * seen / square;
  }
  return result;
}

TEST(Slit, NotchOpensAsFiniteElementsDo) {
  const auto asset = boxAsset({.cells = {16, 6, 4}, .size = {4, 1.5, 1}, .stretch_hz = 8, .keep = {}});
  const CutPlane plane = notch(0.1F);
  const CutResult cut = cutAtRest(*asset, plane, 1);
  ASSERT_EQ(cut.parts.size(), 1U);
  const CutPart& part = cut.parts[0];
  const formats::PackageView& package = part.asset->package();
  // The ends turned; how far the slit's mouth opens.
  VectorXd turned = VectorXd::Zero(3 * Eigen::Index(part.physical.size())), mouth = turned;
  for (std::size_t v = 0; v < part.physical.size(); ++v) {
    const Vector3d x = asVector(package.physicalVertices()[v].rest_position);
    const bool twice = std::count(part.physical.begin(), part.physical.end(), part.physical[v]) > 1;
    if (twice && x[1] > 0.74) mouth[3 * Eigen::Index(v)] = (x[0] > 0) == (part.own[v] != 0) ? 1 : -1;
    if (std::abs(x[0]) > 1.99) turned[3 * Eigen::Index(v)] = (x[0] > 0 ? 1 : -1) * x[1];
  }
  ASSERT_GT(mouth.norm(), 1);
  const Opening found = openingOf(part, plane, turned, mouth);
  // Ten functions of the whole, quadratic, and ten that jump: stiffer than finite elements; the samples give most back.
  EXPECT_GT(found.functions, 0.7 * found.exact);
  EXPECT_LT(found.functions, found.exact);
  EXPECT_NEAR(found.samples, found.exact, 0.15 * found.exact);
}

TEST(Slit, OneThatCoversTheBodyCutsIt) {
  const auto asset = boxAsset({.cells = {6, 5, 4}, .size = {1, 1, 1}, .keep = {}});
  const CutPlane bounded = notch(-9);
  CutPlane plane = bounded;
  plane.corners.reset();
  const CutResult slit = cutAtRest(*asset, bounded, 2), cut = cutAtRest(*asset, plane, 2);
  for (std::size_t p = 0; p < 2; ++p) {
    const CutPart &one = slit.parts[p], &other = cut.parts[p];
    EXPECT_EQ(one.above, other.above);
    EXPECT_EQ(one.physical, other.physical);
    EXPECT_EQ(one.own, other.own);
    EXPECT_NEAR(one.mass, other.mass, 1e-6 * other.mass);
    EXPECT_NEAR(one.volume, other.volume, 1e-6 * other.volume);
    EXPECT_EQ(one.asset->package().fields()[0].function_count, other.asset->package().fields()[0].function_count);
    EXPECT_NEAR(one.asset->package().fields()[0].lowest_hz, other.asset->package().fields()[0].lowest_hz, 1e-3F);
  }
}

TEST(Slit, ItsSidesAreOnePlaceAtRestAndTwoVertices) {
  const auto asset = boxAsset({.cells = {8, 4, 4}, .size = {2, 1, 1}, .keep = {}});
  const CutResult cut = cutAtRest(*asset, notch(0.02F), 1);
  const CutPart& part = cut.parts[0];
  const formats::PackageView& package = part.asset->package();
  EXPECT_NEAR(part.volume, 2, 1e-5);
  EXPECT_NEAR(part.mass, 2000, 1e-2);
  std::vector<double> masses(restOf(*asset).size(), 0);
  std::vector<int> own(masses.size(), 0);
  for (std::size_t v = 0; v < part.physical.size(); ++v) {
    masses[part.physical[v]] += double(package.physicalVertices()[v].mass);
    own[part.physical[v]] += part.own[v];
    EXPECT_EQ(package.physicalVertices()[v].rest_position, restOf(*asset)[part.physical[v]]);
  }
  for (std::size_t v = 0; v < masses.size(); ++v) {
    EXPECT_EQ(masses[v], double(asset->package().physicalVertices()[v].mass));
    EXPECT_EQ(own[v], 1);
  }
  EXPECT_GT(part.physical.size(), masses.size());
  // The section: two faces of 0.48 m^2.
  const formats::SubMesh& sub = package.subMeshes().back();
  double area = 0;
  for (const auto& t : package.visualTriangles().subspan(sub.first_triangle, sub.triangle_count)) {
    const Vector3d a = asVector(package.visualPositions()[t[0]]);
    area += 0.5 *
            (asVector(package.visualPositions()[t[1]]) - a).cross(asVector(package.visualPositions()[t[2]]) - a).norm();
  }
  EXPECT_NEAR(area, 2 * 0.48, 1e-4);
}

TEST(Slit, WhatIsNoneIsRefused) {
  const auto asset = boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}});
  const auto refused = [&](const CutPlane& plane) { return !cutAsset(*asset, restOf(*asset), plane); };
  EXPECT_TRUE(refused(notch(0.6F)));                                                                       // beside
  EXPECT_TRUE(refused(boundedPlane({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{2, 0, 0}, Vec3{3, 0, 0}})));        // a line
  EXPECT_TRUE(refused(boundedPlane({Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{0.2F, 0.2F, 0}, Vec3{0, 1, 0}})));  // dented
  EXPECT_TRUE(refused(boundedPlane({Vec3{0, 0, NAN}, Vec3{1, 0, 0}, Vec3{1, 1, 0}, Vec3{0, 1, 0}})));
  EXPECT_TRUE(refused(boundedPlane({Vec3{-0.1F, -0.1F, 0}, Vec3{0.1F, -0.1F, 0}, Vec3{0.1F, 0.1F, 0},
                                    Vec3{-0.1F, 0.1F, 0}})));  // within: a knife comes from outside
}

TEST(Slit, OpensAndGoesOnAsItMoved) {
  // Hung by its ends' vertices: under its weight the notch at its lower side opens.
  const auto asset = boxAsset({.cells = {16, 6, 4}, .size = {4, 1.5, 1}, .stretch_hz = 4, .keep = {}});
  World world({.ground = {}});
  const BodyId body = *world.addBody(asset);
  const std::vector<Vec3> rest = restOf(*asset);
  for (std::uint32_t v = 0; v < rest.size(); ++v) {
    if (std::abs(rest[v][0]) > 1.99F) world.pin(body, v, rest[v]);
  }
  for (int i = 0; i < 240; ++i) world.step(1.0F / 60);
  const BodyEnergy before = world.energy(body);
  const auto cut =
      cutBody(world, body,
              boundedPlane({Vec3{0.01F, 0.1F, 9}, Vec3{0.01F, -9, 9}, Vec3{0.01F, -9, -9}, Vec3{0.01F, 0.1F, -9}}));
  ASSERT_TRUE(cut) << cut.reason();
  ASSERT_EQ(cut->bodies.size(), 1U);
  const CutPart& part = cut->cut.parts[0];
  const BodyEnergy after = world.energy(cut->bodies[0]);
  EXPECT_NEAR(after.kinetic, before.kinetic, 1e-6 + 1e-3 * before.kinetic);
  EXPECT_NEAR(after.elastic, before.elastic, 0.1 * before.elastic);
  const auto opening = [&] {
    const auto x = world.positions(cut->bodies[0]);
    double widest = 0;
    for (std::size_t v = 1; v < x.size(); ++v) {
      if (part.physical[v] == part.physical[v - 1])
        widest = std::max(widest, (asVector(x[v]) - asVector(x[v - 1])).norm());
    }
    return widest;
  };
  EXPECT_LT(opening(), 1e-4);
  for (int i = 0; i < 240; ++i) world.step(1.0F / 60);
  EXPECT_EQ(world.repairedVertices(cut->bodies[0]), 0U);
  EXPECT_GT(opening(), 0.02);
}

TEST(Slit, SlitsOfSlitsAndCutsOfThem) {
  auto asset = boxAsset({.cells = {8, 5, 5}, .size = {2, 1, 1}, .keep = {}});
  for (const float at : {-0.61F, 0.01F, 0.57F}) {
    const CutResult cut = cutAtRest(*asset, notch(0.1F, at), 1);
    ASSERT_EQ(cut.parts.size(), 1U);
    asset = cut.parts[0].asset;
  }
  // Beside the slits, so that no section meets their faces.
  cutAtRest(*asset, {{0.3F, 0, 0}, {1, 0.1F, 0}}, 2);
}

TEST(Slit, RandomQuadrilateralsOverBentBodies) {
  const auto frame = [](std::uint32_t i, std::uint32_t j, std::uint32_t k) { return (i % 2) + (j % 2) + (k % 2) < 2; };
  const std::vector<std::shared_ptr<const Asset>> assets = {
      boxAsset({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}}),
      boxAsset({.cells = {3, 6, 2}, .size = {0.5, 1, 0.3}, .center = {50, 0, 0}, .keep = {}}),
      boxAsset({.cells = {5, 5, 5}, .size = {1, 1, 1}, .keep = frame})};
  for (const auto& asset : assets) {
    std::size_t done = 0;
    for (std::uint64_t seed = 0; seed < 100; ++seed) {
      std::vector<Vec3> positions = restOf(*asset);
      const float bend = 0.004F * float(seed);
      for (Vec3& x : positions) x[1] += bend * (x[0] - positions[0][0]) * (x[0] - positions[0][0]);
      const auto cut = cutAsset(*asset, positions, randomSlit(positions, seed));
      if (!cut) {
        EXPECT_FALSE(cut.reason().starts_with("a part")) << cut.reason();
        continue;
      }
      CutErrors errors;
      EXPECT_EQ(faultOfCut(*asset, *cut, errors, 1), "") << "quadrilateral " << seed;
      ++done;
    }
    EXPECT_GT(done, 60U);
  }
}

/// Whether chains of tetrahedra that share corners lead from each to all others.
bool hangsTogether(const formats::PackageView& package) {
  geometry::Sets corners(package.physicalVertices().size());
  for (const formats::Tetrahedron& t : package.tetrahedra()) {
    for (const std::uint32_t v : t.vertex) corners.join(t.vertex[0], v);
  }
  const auto first = corners.find(0);
  for (std::uint32_t v = 1; v < package.physicalVertices().size(); ++v) {
    if (corners.find(v) != first) return false;
  }
  return true;
}

// A slit that meets others severs what it may, and no more than the surface shows: what only that holds would fall out.
TEST(Slit, ManySlitsLeaveNothingLoose) {
  for (std::uint64_t first = 0; first < 3; ++first) {
    auto asset = boxAsset({.cells = {6, 6, 6}, .size = {1, 1, 1}, .keep = {}});
    for (std::uint64_t i = 0; i < 25; ++i) {
      const auto cut = cutAsset(*asset, restOf(*asset), randomSlit(restOf(*asset), 1000 * first + i));
      if (!cut) continue;
      asset = std::max_element(cut->parts.begin(), cut->parts.end(), [](const CutPart& a, const CutPart& b) {
                return a.mass < b.mass;
              })->asset;
      ASSERT_TRUE(hangsTogether(asset->package())) << first << ' ' << i;
      EXPECT_LE(asset->package().fields()[0].function_count, 96U);
    }
  }
}

TEST(Slit, FromC) {
  auto content = boxContent({.cells = {4, 4, 4}, .size = {1, 1, 1}, .keep = {}});
  addFields(content);
  const auto bytes = formats::writePackage(content);
  sinew_asset* asset = nullptr;
  ASSERT_EQ(sinew_asset_from_memory(bytes.data(), bytes.size(), &asset), SINEW_OK);
  sinew_world* world = nullptr;
  ASSERT_EQ(sinew_world_create(nullptr, nullptr, &world), SINEW_OK);
  std::uint32_t body = 0;
  ASSERT_EQ(sinew_body_add(world, asset, nullptr, &body), SINEW_OK);
  const std::array<float, 12> corners = {0.1F, 0, 1, 0.1F, 0, -1, 0.1F, 1, -1, 0.1F, 1, 1};
  sinew_cut* cut = nullptr;
  EXPECT_EQ(sinew_body_cut_bounded(world, body, nullptr, nullptr, &cut), SINEW_ERROR_ARGUMENT);
  ASSERT_EQ(sinew_body_cut_bounded(world, body, corners.data(), nullptr, &cut), SINEW_OK) << sinew_last_error();
  ASSERT_EQ(sinew_cut_part_count(cut), 1U);
  sinew_cut_part part = {};
  part.struct_size = sizeof part;
  ASSERT_EQ(sinew_cut_get_part(cut, 0, &part), SINEW_OK);
  EXPECT_NEAR(part.volume, 1, 1e-5);
  EXPECT_EQ(sinew_body_exists(world, part.body), 1U);
  sinew_cut_release(cut);
  EXPECT_EQ(sinew_world_step(world, 1.0F / 60), SINEW_OK);
  sinew_world_destroy(world);
  sinew_asset_release(asset);
}

}  // namespace
}  // namespace sinew::test
