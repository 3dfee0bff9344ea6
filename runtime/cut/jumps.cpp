// SPDX-License-Identifier: MIT
#include "runtime/cut/jumps.h"

#include <Eigen/Dense>
#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <numeric>

#include "runtime/geometry/tet_mesh.h"

namespace sinew::cutting {
namespace {

using Eigen::Index;
using Eigen::VectorXd;

/// Functions of the parent that may differ on the two sides: a rigid motion of each, its uniform strains, and bending.
constexpr std::size_t kJumping = 12;
/// Of the net's solution, relative: it only shapes a function.
constexpr double kExact = 1e-3;
/// Share of a tetrahedron that the net has of it at least.
constexpr double kLeastOfTetrahedron = 1e-2;

}  // namespace

Around::Around(const FieldInput& input) : input_(input), first_(std::size_t(input.piece.count) + 1, 0) {
  const PartPiece& piece = input.piece;
  const auto forEach = [&](const auto& visit) {
    for (std::uint32_t t = piece.first_tetrahedron; t < piece.first_tetrahedron + piece.tetrahedron_count; ++t) {
      for (const std::uint32_t v : input.mesh.tetrahedra[t].corner) visit(v - piece.first, t);
    }
  };
  forEach([&](std::uint32_t row, std::uint32_t) { ++first_[row + 1]; });
  std::partial_sum(first_.begin(), first_.end(), first_.begin());
  list_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  forEach([&](std::uint32_t row, std::uint32_t t) { list_[next[row]++] = t; });
}

std::uint32_t Around::at(std::uint32_t vertex, const Vector3d& at) const {
  const PartPiece& piece = input_.piece;
  const auto begin = input_.mesh.vertices.begin() + piece.first, end = begin + piece.count;
  double best = -1e300;
  std::uint32_t found = formats::kNone;
  for (auto v = std::lower_bound(begin, end, vertex); v != end && *v == vertex; ++v) {
    for (const std::uint32_t t : of(std::size_t(v - begin))) {
      const PartTetrahedron& tetrahedron = input_.mesh.tetrahedra[t];
      const auto& corners = input_.package.tetrahedra()[tetrahedron.source].vertex;
      const auto rest = [&](std::size_t k) {
        return asVector(input_.package.physicalVertices()[corners[k]].rest_position);
      };
      Eigen::Matrix3d edges;
      for (int k = 0; k < 3; ++k) edges.col(k) = rest(std::size_t(k)) - rest(3);
      const Vector3d weight = edges.inverse() * (at - rest(3));
      if (!weight.allFinite()) continue;
      const double last = 1 - weight.sum(), least = std::min(weight.minCoeff(), last);
      if (tetrahedron.side != 0) {
        double height = last * input_.sides.heightOf(corners[3]);
        for (std::size_t k = 0; k < 3; ++k) height += weight[int(k)] * input_.sides.heightOf(corners[k]);
        if (height * tetrahedron.side < 0) continue;
      }
      if (least > best) best = least, found = t;
    }
  }
  return found;
}

double Jumps::at(const FieldInput& input, std::uint32_t tetrahedron) const {
  const PartTetrahedron& t = input.mesh.tetrahedra[tetrahedron];
  double mean = 0;
  for (std::size_t k = 0; k < 4; ++k) mean += t.center[k] * psi[t.corner[k] - input.piece.first];
  return mean;
}

Jumps findJumps(const FieldInput& input, const ParentField& parent) {
  Jumps jumps;
  const PartPiece& piece = input.piece;
  const std::span<const PartTetrahedron> tetrahedra(input.mesh.tetrahedra.data() + piece.first_tetrahedron,
                                                    piece.tetrahedron_count);
  VectorXd force = VectorXd::Zero(Index(piece.count));
  struct Pair {
    const PartTetrahedron *below, *above;
    const Gap* gap;
  };
  std::vector<Pair> pairs;
  double area = 0;
  for (std::size_t i = 0; i + 1 < tetrahedra.size(); ++i) {
    const PartTetrahedron &below = tetrahedra[i], &above = tetrahedra[i + 1];
    if (below.source != above.source) continue;
    const auto gap = std::lower_bound(input.gaps.begin(), input.gaps.end(), below.source,
                                      [](const Gap& one, std::uint32_t t) { return one.tetrahedron < t; });
    pairs.push_back({&below, &above, &*gap});
    area += gap->area;
    for (std::size_t k = 0; k < 4; ++k) {
      force[below.corner[k] - piece.first] -= gap->area * gap->center[k];
      force[above.corner[k] - piece.first] += gap->area * gap->center[k];
    }
  }
  if (!(force.cwiseAbs().maxCoeff() > 0)) return jumps;

  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(16 * tetrahedra.size());
  for (const PartTetrahedron& t : tetrahedra) {
    const auto& corners = input.package.tetrahedra()[t.source].vertex;
    const auto rest = [&](std::size_t k) {
      return asVector(input.package.physicalVertices()[corners[k]].rest_position);
    };
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = rest(std::size_t(k)) - rest(3);
    const double volume = std::abs(edges.determinant()) / 6, longest = edges.colwise().norm().maxCoeff();
    if (!(volume > geometry::kFlat * longest * longest * longest)) continue;
    Eigen::Matrix<double, 4, 3> slopes;
    slopes.topRows<3>() = edges.inverse();
    slopes.row(3) = -slopes.topRows<3>().colwise().sum();
    const Eigen::Matrix4d net = std::max(t.volume, kLeastOfTetrahedron * volume) * slopes * slopes.transpose();
    for (Index i = 0; i < 4; ++i) {
      for (Index j = 0; j < 4; ++j) {
        entries.emplace_back(int(t.corner[std::size_t(i)] - piece.first), int(t.corner[std::size_t(j)] - piece.first),
                             net(i, j));
      }
    }
  }
  // Loose vertices have a net of their own.
  const double mean = std::accumulate(entries.begin(), entries.end(), 0.0,
                                      [](double sum, const auto& e) { return sum + std::abs(e.value()); }) /
                      double(piece.count);
  for (int i = 0; i < int(piece.count); ++i) entries.emplace_back(i, i, 1e-9 * mean);
  Eigen::SparseMatrix<double, Eigen::RowMajor> matrix{Index(piece.count), Index(piece.count)};
  matrix.setFromTriplets(entries.begin(), entries.end());
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double, Eigen::RowMajor>, Eigen::Lower | Eigen::Upper> solver(matrix);
  solver.setTolerance(kExact);
  solver.setMaxIterations(300);
  VectorXd psi = solver.solve(force);

  double largest = 0;
  for (const Pair& pair : pairs) {
    double jump = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      jump +=
          pair.gap->center[k] * (psi[pair.above->corner[k] - piece.first] - psi[pair.below->corner[k] - piece.first]);
    }
    largest = std::max(largest, std::abs(jump));
  }
  if (!(largest > 0) || !psi.allFinite()) return jumps;
  jumps.psi = psi / largest;
  jumps.size = std::sqrt(area);
  for (Index j = 0; j < parent.own(); ++j) {
    if (parent.function(j).pin_set == formats::kNone) jumps.phi.push_back(j);
  }
  std::stable_sort(jumps.phi.begin(), jumps.phi.end(),
                   [&](Index a, Index b) { return parent.function(a).stiffness < parent.function(b).stiffness; });
  if (jumps.phi.size() > kJumping) jumps.phi.resize(kJumping);
  return jumps;
}

}  // namespace sinew::cutting
