// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/elastic_solid.h"

#include <Eigen/LU>
#include <algorithm>
#include <unordered_map>
#include <utility>

namespace sinew::tools {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d edgesOf(const std::vector<Vector3d>& x, const std::array<std::uint32_t, 4>& t) {
  Matrix3d m;
  for (int k = 0; k < 3; ++k) m.col(k) = x[t[std::size_t(k) + 1]] - x[t[0]];
  return m;
}

ElasticSolid refined(const ElasticSolid& solid, std::vector<Vector3d>* shape) {
  ElasticSolid fine;
  fine.rest = solid.rest;
  fine.prescribed = solid.prescribed;
  std::unordered_map<std::uint64_t, std::uint32_t> middles;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const std::uint64_t key = (std::uint64_t(std::min(a, b)) << 32) | std::max(a, b);
    const auto [at, fresh] = middles.try_emplace(key, std::uint32_t(fine.rest.size()));
    if (fresh) {
      fine.rest.push_back(0.5 * (solid.rest[a] + solid.rest[b]));
      std::optional<Vector3d> held;
      if (solid.prescribed[a] && solid.prescribed[b]) held = 0.5 * (*solid.prescribed[a] + *solid.prescribed[b]);
      fine.prescribed.push_back(held);
      if (shape != nullptr) shape->push_back(0.5 * ((*shape)[a] + (*shape)[b]));
    }
    return at->second;
  };
  const auto add = [&](std::array<std::uint32_t, 4> t) {
    if (edgesOf(fine.rest, t).determinant() < 0) std::swap(t[0], t[1]);
    fine.tetrahedra.push_back(t);
  };
  for (const auto& [a, b, c, d] : solid.tetrahedra) {
    const std::uint32_t ab = middle(a, b), ac = middle(a, c), ad = middle(a, d);
    const std::uint32_t bc = middle(b, c), bd = middle(b, d), cd = middle(c, d);
    add({a, ab, ac, ad});
    add({ab, b, bc, bd});
    add({ac, bc, c, cd});
    add({ad, bd, cd, d});
    // The octahedron in the middle, cut along its shortest diagonal; the other four corners in order around it.
    struct Diagonal {
      std::array<std::uint32_t, 2> ends;
      std::array<std::uint32_t, 4> around;
    };
    const std::array<Diagonal, 3> diagonals = {
        Diagonal{{ab, cd}, {ac, ad, bd, bc}}, {{ac, bd}, {ab, ad, cd, bc}}, {{ad, bc}, {ab, ac, cd, bd}}};
    const auto length = [&](const Diagonal& one) { return (fine.rest[one.ends[0]] - fine.rest[one.ends[1]]).norm(); };
    const Diagonal& cut =
        *std::min_element(diagonals.begin(), diagonals.end(),
                          [&](const auto& one, const auto& other) { return length(one) < length(other); });
    for (std::size_t k = 0; k < 4; ++k) add({cut.ends[0], cut.ends[1], cut.around[k], cut.around[(k + 1) % 4]});
  }
  return fine;
}

ElasticSolid quadratic(const ElasticSolid& solid, std::vector<Vector3d>* shape) {
  ElasticSolid result = solid;
  std::unordered_map<std::uint64_t, std::uint32_t> middles;
  for (const auto& t : solid.tetrahedra) {
    std::array<std::uint32_t, 6>& own = result.middles.emplace_back();
    for (std::size_t e = 0; e < 6; ++e) {
      const auto [a, b] = std::minmax(t[kTetrahedronEdges[e][0]], t[kTetrahedronEdges[e][1]]);
      const auto [at, fresh] = middles.try_emplace((std::uint64_t(a) << 32) | b, std::uint32_t(result.rest.size()));
      own[e] = at->second;
      if (!fresh) continue;
      result.rest.push_back(0.5 * (solid.rest[a] + solid.rest[b]));
      std::optional<Vector3d> held;
      if (solid.prescribed[a] && solid.prescribed[b]) held = 0.5 * (*solid.prescribed[a] + *solid.prescribed[b]);
      result.prescribed.push_back(held);
      if (shape != nullptr) shape->push_back(0.5 * ((*shape)[a] + (*shape)[b]));
    }
  }
  return result;
}

std::vector<double> nodalVolumes(const ElasticSolid& solid) {
  std::vector<double> volumes(solid.rest.size(), 0);
  for (const auto& t : solid.tetrahedra) {
    const double quarter = edgesOf(solid.rest, t).determinant() / 24;
    for (const std::uint32_t v : t) volumes[v] += quarter;
  }
  return volumes;
}

std::vector<double> nodalMasses(const ElasticSolid& solid, const std::vector<double>& vertex_masses) {
  if (solid.middles.empty()) return vertex_masses;
  const std::vector<double> volumes = nodalVolumes(solid);
  std::vector<double> masses(solid.rest.size(), 0);
  for (std::size_t t = 0; t < solid.tetrahedra.size(); ++t) {
    const double volume = edgesOf(solid.rest, solid.tetrahedra[t]).determinant() / 6;
    std::array<double, 4> part{};  // of the tetrahedron's mass, were it uniform
    double all = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t v = solid.tetrahedra[t][k];
      part[k] = volume * vertex_masses[v] / volumes[v];
      all += part[k];
    }
    // Integrals of products of barycentric coordinates (Eisenberg, Malvern 1973).
    for (std::size_t k = 0; k < 4; ++k) masses[solid.tetrahedra[t][k]] -= (all - part[k]) / 60;
    for (std::size_t e = 0; e < 6; ++e) {
      const auto [i, j] = kTetrahedronEdges[e];
      masses[solid.middles[t][e]] += (all + part[i] + part[j]) / 30;
    }
  }
  return masses;
}

Vector3d deformedPoint(const ElasticSolid& coarse, const ElasticSolid& fine, int refinements, std::uint32_t tetrahedron,
                       const Eigen::Vector4d& weights, const std::vector<Vector3d>& positions) {
  Vector3d point = Vector3d::Zero();
  for (int k = 0; k < 4; ++k) point += weights[k] * coarse.rest[coarse.tetrahedra[tetrahedron][std::size_t(k)]];
  const std::uint32_t count = 1U << (3 * refinements);
  Eigen::Vector4d best = weights;
  std::uint32_t home = tetrahedron;
  double inside = -1e300;
  for (std::uint32_t child = tetrahedron * count; child < (tetrahedron + 1) * count; ++child) {
    const auto& t = fine.tetrahedra[child];
    const Vector3d w = edgesOf(fine.rest, t).inverse() * (point - fine.rest[t[0]]);
    const Eigen::Vector4d all(1 - w.sum(), w[0], w[1], w[2]);
    if (all.minCoeff() <= inside) continue;
    inside = all.minCoeff();
    best = all;
    home = child;
  }
  Vector3d moved = Vector3d::Zero();
  for (int k = 0; k < 4; ++k) moved += best[k] * positions[fine.tetrahedra[home][std::size_t(k)]];
  return moved;
}

}  // namespace sinew::tools
