// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/elastic.h"

#include <Eigen/Dense>
#include <algorithm>
#include <map>

#include "runtime/geometry/tet_mesh.h"
#include "tools/field/follow.h"

namespace sinew::tools::field {
namespace {

using Eigen::Matrix3d;

struct Tetrahedra {
  std::vector<double> volume;  // 0: flat, left out
  std::vector<Eigen::Matrix<double, 3, 4>> gradient;
};

Tetrahedra measure(const FieldInput& input) {
  Tetrahedra result;
  for (const auto& tet : input.tetrahedra) {
    Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = input.positions[tet[std::size_t(k) + 1]] - input.positions[tet[0]];
    const double longest = edges.colwise().norm().maxCoeff(), volume = std::abs(edges.determinant()) / 6;
    Eigen::Matrix<double, 3, 4> gradient = Eigen::Matrix<double, 3, 4>::Zero();
    const bool solid = volume > geometry::kFlat * longest * longest * longest;
    if (solid) {
      gradient.rightCols<3>() = edges.inverse().transpose();
      gradient.col(0) = -gradient.rightCols<3>().rowwise().sum();
    }
    result.volume.push_back(solid ? volume : 0);
    result.gradient.push_back(gradient);
  }
  return result;
}

void setNodes(const FieldInput& input, const std::vector<Follower>& followers, Elastic& elastic) {
  const auto n = Index(input.positions.size());
  elastic.mass = Eigen::Map<const VectorXd>(input.masses.data(), n);
  elastic.positions.resize(n, 3);
  std::vector<Index> node(std::size_t(n), -1);
  for (std::size_t v = 0; v < followers.size(); ++v) {
    elastic.positions.row(Index(v)) = input.positions[v];
    if (!followers[v].vertex.empty()) continue;
    node[v] = Index(elastic.vertex_of.size());
    elastic.vertex_of.push_back(std::uint32_t(v));
  }
  std::vector<Eigen::Triplet<double>> entries;
  elastic.node_mass = VectorXd::Zero(elastic.nodes());
  for (std::size_t v = 0; v < followers.size(); ++v) {
    const Follower& f = followers[v];
    if (f.vertex.empty()) {
      entries.emplace_back(int(v), int(node[v]), 1.0);
      elastic.node_mass[node[v]] += input.masses[v];
    }
    for (std::size_t i = 0; i < f.vertex.size(); ++i) {
      entries.emplace_back(int(v), int(node[f.vertex[i]]), f.weight[i]);
      elastic.node_mass[node[f.vertex[i]]] += input.masses[v] / double(f.vertex.size());
    }
  }
  elastic.extend.resize(n, elastic.nodes());
  elastic.extend.setFromTriplets(entries.begin(), entries.end());
}

// Tetrahedra that share a patch: by edge, or each by itself.
std::vector<std::vector<std::size_t>> groups(const FieldInput& input, const Tetrahedra& tetrahedra,
                                             FieldElement element) {
  std::vector<std::vector<std::size_t>> result;
  std::vector<std::pair<std::array<std::uint32_t, 2>, std::size_t>> edges;
  for (std::size_t t = 0; t < input.tetrahedra.size(); ++t) {
    if (tetrahedra.volume[t] == 0) continue;
    if (element == FieldElement::tetrahedra) result.push_back({t});
    const auto& tet = input.tetrahedra[t];
    for (std::size_t i = 0; i < 4 && element == FieldElement::edges; ++i) {
      for (std::size_t j = i + 1; j < 4; ++j) {
        edges.push_back({{std::min(tet[i], tet[j]), std::max(tet[i], tet[j])}, t});
      }
    }
  }
  std::sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (i == 0 || edges[i].first != edges[i - 1].first) result.emplace_back();
    result.back().push_back(edges[i].second);
  }
  return result;
}

// The volume-weighted mean of the tetrahedra's gradients, on nodes. By edges a tetrahedron gives each of its six a
// sixth of its volume (Liu et al. 2009; in space: Cazes and Meschke 2013).
void addPatch(const FieldInput& input, const Tetrahedra& tetrahedra, const std::vector<std::size_t>& group,
              double share, Elastic& elastic) {
  Patch patch;
  patch.at.setZero();
  std::map<std::uint32_t, Vector3d> sum;
  for (const auto t : group) {
    const double volume = share * tetrahedra.volume[t];
    const double mu = input.young[t] / (2 * (1 + input.poisson[t]));
    patch.volume += volume;
    patch.mu += volume * mu;
    patch.lambda += volume * 2 * mu * input.poisson[t] / (1 - 2 * input.poisson[t]);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint32_t v = input.tetrahedra[t][k];
      patch.at += volume / 4 * input.positions[v];
      for (decltype(elastic.extend)::InnerIterator it(elastic.extend, Index(v)); it; ++it) {
        const auto [at, added] = sum.try_emplace(std::uint32_t(it.col()), Vector3d::Zero());
        at->second += volume * it.value() * tetrahedra.gradient[t].col(Index(k));
      }
    }
  }
  patch.mu /= patch.volume;
  patch.lambda /= patch.volume;
  patch.at /= patch.volume;
  patch.first = std::uint32_t(elastic.node.size());
  patch.count = std::uint32_t(sum.size());
  for (const auto& [node, gradient] : sum) {
    elastic.node.push_back(node);
    elastic.gradient.push_back(gradient / patch.volume);
  }
  patch.number = std::uint32_t(elastic.patches.size());
  elastic.patches.push_back(patch);
}

// Nodes that share a patch, ascending, each with itself.
std::vector<std::vector<std::uint32_t>> neighbours(const Elastic& elastic) {
  std::vector<std::vector<std::uint32_t>> result(std::size_t(elastic.nodes()));
  for (std::uint32_t i = 0; i < result.size(); ++i) result[i].push_back(i);
  for (const Patch& p : elastic.patches) {
    for (std::uint32_t i = p.first; i < p.first + p.count; ++i) {
      auto& list = result[elastic.node[i]];
      list.insert(list.end(), elastic.node.begin() + p.first, elastic.node.begin() + p.first + p.count);
    }
  }
  for (auto& list : result) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return result;
}

// An empty matrix with blocks of size x size where nodes are neighbours.
Sparse pattern(const std::vector<std::vector<std::uint32_t>>& neighbours, int size) {
  const auto n = Index(neighbours.size()) * size;
  Sparse result(n, n);
  Index count = 0;
  for (const auto& list : neighbours) count += Index(list.size()) * size * size;
  result.resizeNonZeros(count);
  int at = 0;
  for (std::size_t j = 0; j < neighbours.size(); ++j) {
    for (int b = 0; b < size; ++b) {
      result.outerIndexPtr()[Index(j) * size + b] = at;
      for (const auto i : neighbours[j]) {
        for (int a = 0; a < size; ++a) result.innerIndexPtr()[at++] = int(i) * size + a;
      }
    }
  }
  result.outerIndexPtr()[n] = at;
  std::fill_n(result.valuePtr(), count, 0.0);
  return result;
}

std::vector<std::uint32_t> surfaceOf(const FieldInput& input) {
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const auto& tet : input.tetrahedra) {
    for (std::size_t k = 0; k < 4; ++k) {
      faces.push_back({tet[(k + 1) % 4], tet[(k + 2) % 4], tet[(k + 3) % 4]});
      std::sort(faces.back().begin(), faces.back().end());
    }
  }
  std::sort(faces.begin(), faces.end());
  std::vector<std::uint32_t> result;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const bool twice = (i > 0 && faces[i] == faces[i - 1]) || (i + 1 < faces.size() && faces[i] == faces[i + 1]);
    if (!twice) result.insert(result.end(), faces[i].begin(), faces[i].end());
  }
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

}  // namespace

void addStiffness(Elastic& elastic) {
  const auto near = neighbours(elastic);
  elastic.stiffness = pattern(near, 3);
  elastic.scalar = pattern(near, 1);
  for (const Patch& p : elastic.patches) {
    for (std::uint32_t j = p.first; j < p.first + p.count; ++j) {
      const auto& list = near[elastic.node[j]];
      const Vector3d& gj = elastic.gradient[j];
      for (std::uint32_t i = p.first; i < p.first + p.count; ++i) {
        const Vector3d& gi = elastic.gradient[i];
        const auto row = std::lower_bound(list.begin(), list.end(), elastic.node[i]) - list.begin();
        const double dot = gi.dot(gj);
        elastic.scalar.valuePtr()[elastic.scalar.outerIndexPtr()[elastic.node[j]] + row] +=
            p.volume * (2 * p.mu + p.lambda) * dot;
        for (int b = 0; b < 3; ++b) {
          double* column = elastic.stiffness.valuePtr() +
                           elastic.stiffness.outerIndexPtr()[3 * Index(elastic.node[j]) + b] + 3 * row;
          for (int a = 0; a < 3; ++a) {
            column[a] += p.volume * ((a == b ? p.mu * dot : 0) + p.mu * gj[a] * gi[b] + p.lambda * gi[a] * gj[b]);
          }
        }
      }
    }
  }
}

Elastic assemblePatches(const FieldInput& input, FieldElement element) {
  Elastic elastic;
  const Tetrahedra tetrahedra = measure(input);
  setNodes(input, findFollowers(input.positions, input.tetrahedra, tetrahedra.volume), elastic);
  const double share = element == FieldElement::edges ? 1.0 / 6 : 1.0;
  for (const auto& group : groups(input, tetrahedra, element)) addPatch(input, tetrahedra, group, share, elastic);
  elastic.surface = surfaceOf(input);
  return elastic;
}

Elastic assemble(const FieldInput& input, FieldElement element) {
  Elastic elastic = assemblePatches(input, element);
  addStiffness(elastic);
  return elastic;
}

MatrixXd gradientsOf(const Elastic& elastic, const MatrixXd& on_nodes, std::size_t first, std::size_t count) {
  MatrixXd result = MatrixXd::Zero(3 * Index(count), on_nodes.cols());
  for (std::size_t s = 0; s < count; ++s) {
    const Patch& p = elastic.patches[first + s];
    for (std::uint32_t i = p.first; i < p.first + p.count; ++i) {
      result.middleRows(3 * Index(s), 3).noalias() += elastic.gradient[i] * on_nodes.row(elastic.node[i]);
    }
  }
  return result;
}

MatrixXd strainFactor(const Patch& patch, const MatrixXd& gradient) {
  const Index k = gradient.cols();
  const double shear = std::sqrt(2 * patch.mu);
  const double shared = (std::sqrt(2 * patch.mu + 3 * patch.lambda) - shear) / 3;
  MatrixXd b = MatrixXd::Zero(3 * k, 6);
  for (Index j = 0; j < k; ++j) {
    for (int i = 0; i < 3; ++i) {
      for (int s = 0; s < 3; ++s) b(3 * j + i, s) = gradient(i, j) * (shared + (s == i ? shear : 0));
      const int next = (i + 1) % 3;
      b(3 * j + i, 3 + i) += shear * std::sqrt(0.5) * gradient(next, j);
      b(3 * j + next, 3 + i) += shear * std::sqrt(0.5) * gradient(i, j);
    }
  }
  return b;
}

}  // namespace sinew::tools::field
