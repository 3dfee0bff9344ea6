// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/solver.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>

namespace sinew::tools::field {
namespace {

// Sets of so many nodes are not cut any more.
constexpr std::size_t kLeaf = 24;
// Part of the nodes that is in front of a cut at least, and behind it.
constexpr double kLeastPart = 0.4;

MatrixXd gather(const MatrixXd& from, const std::vector<std::uint32_t>& nodes) {
  MatrixXd result(3 * Index(nodes.size()), from.cols());
  for (std::size_t i = 0; i < nodes.size(); ++i)
    result.middleRows<3>(3 * Index(i)) = from.middleRows<3>(3 * Index(nodes[i]));
  return result;
}

void scatter(const MatrixXd& values, const std::vector<std::uint32_t>& nodes, MatrixXd& to) {
  for (std::size_t i = 0; i < nodes.size(); ++i)
    to.middleRows<3>(3 * Index(nodes[i])) = values.middleRows<3>(3 * Index(i));
}

// Breadth first over these nodes, one component after the other, the first of them from `first`.
// @param among f: 1 at the nodes
std::vector<std::uint32_t> breadthFirst(const Elastic& elastic, const std::vector<std::uint32_t>& nodes,
                                        std::uint32_t first, std::vector<char>& among) {
  std::vector<std::uint32_t> order;
  order.reserve(nodes.size());
  const auto take = [&](std::uint32_t i) {
    if (among[i] == 0) return;
    among[i] = 0;
    order.push_back(i);
  };
  take(first);
  auto next = nodes.begin();
  for (std::size_t done = 0; done < nodes.size(); ++done) {
    while (done == order.size()) take(*next++);
    for (Sparse::InnerIterator it(elastic.scalar, Index(order[done])); it; ++it) take(std::uint32_t(it.row()));
  }
  for (const auto i : nodes) among[i] = 1;
  return order;
}

// Nodes in an order that is cut before place `at`: those in front that touch one behind are the separator.
struct Cut {
  std::vector<std::uint32_t> order;
  std::size_t at = 0, separator = std::numeric_limits<std::size_t>::max();
};

// The cut with the smallest separator, in the middle part of an order.
// @param among f: 1 at the nodes
Cut leastCut(const Elastic& elastic, std::vector<std::uint32_t> order, const std::vector<char>& among) {
  const std::size_t n = order.size();
  std::vector<std::size_t> place(among.size(), 0);
  for (std::size_t i = 0; i < n; ++i) place[order[i]] = i;
  // How many nodes more a separator has at each cut than at the one before.
  std::vector<std::ptrdiff_t> more(n + 1, 0);
  for (std::size_t i = 0; i < n; ++i) {
    std::size_t last = i;
    for (Sparse::InnerIterator it(elastic.scalar, Index(order[i])); it; ++it) {
      const auto other = std::size_t(it.row());
      if (among[other] != 0) last = std::max(last, place[other]);
    }
    ++more[i + 1];
    --more[last + 1];
  }
  Cut cut;
  std::ptrdiff_t separator = 0;
  const auto least = std::size_t(kLeastPart * double(n));
  for (std::size_t at = 1; at + least <= n; ++at) {
    separator += more[at];
    if (at < least || std::size_t(separator) >= cut.separator) continue;
    cut.separator = std::size_t(separator);
    cut.at = at;
  }
  cut.order = std::move(order);
  return cut;
}

}  // namespace

Solver::Solver(const Elastic& elastic, const std::vector<bool>& fixed, double shift) {
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t i = 0; i < fixed.size(); ++i) {
    if (!fixed[i]) nodes.push_back(i);
  }
  if (nodes.empty()) return;
  std::vector<char> among(fixed.size(), 0);
  dissect(elastic, std::move(nodes), among);
  setLater(elastic, fixed);
  factorize(elastic, shift);
}

// In the order of the longest axis or of distances along the mesh, whichever has the smaller separator: a crumpled
// sheet is all over both sides of a plane, but a ring around one of its ends is short.
std::size_t Solver::dissect(const Elastic& elastic, std::vector<std::uint32_t> nodes, std::vector<char>& among) {
  Front front;
  if (nodes.size() > kLeaf) {
    const auto at = [&](std::uint32_t i) { return elastic.positions.row(elastic.vertex_of[i]); };
    Eigen::RowVector3d low = at(nodes[0]), high = low;
    for (const auto i : nodes) low = low.cwiseMin(at(i)), high = high.cwiseMax(at(i));
    Index axis = 0;
    (high - low).maxCoeff(&axis);
    std::sort(nodes.begin(), nodes.end(),
              [&](auto a, auto b) { return at(a)[axis] < at(b)[axis] || (at(a)[axis] == at(b)[axis] && a < b); });
    for (const auto i : nodes) among[i] = 1;
    const std::uint32_t end = breadthFirst(elastic, nodes, nodes[0], among).back();
    Cut cut = leastCut(elastic, breadthFirst(elastic, nodes, end, among), among);
    Cut by_axis = leastCut(elastic, std::move(nodes), among);
    if (by_axis.separator <= cut.separator) cut = std::move(by_axis);
    const auto middle = cut.order.begin() + std::ptrdiff_t(cut.at);
    std::for_each(cut.order.begin(), middle, [&](auto i) { among[i] = 0; });
    std::vector<std::uint32_t> before;
    for (auto i = cut.order.begin(); i != middle; ++i) {
      bool touches = false;
      for (Sparse::InnerIterator it(elastic.scalar, Index(*i)); it; ++it) touches |= among[std::size_t(it.row())] != 0;
      (touches ? front.own : before).push_back(*i);
    }
    std::vector<std::uint32_t> behind(middle, cut.order.end());
    for (const auto i : behind) among[i] = 0;
    if (!before.empty()) front.children.push_back(dissect(elastic, std::move(before), among));
    front.children.push_back(dissect(elastic, std::move(behind), among));
  } else {
    front.own = std::move(nodes);
  }
  fronts_.push_back(std::move(front));
  return fronts_.size() - 1;
}

void Solver::setLater(const Elastic& elastic, const std::vector<bool>& fixed) {
  place_.assign(fixed.size(), std::numeric_limits<std::size_t>::max());
  std::size_t count = 0;
  for (const Front& front : fronts_) {
    for (const auto i : front.own) place_[i] = count++;
  }
  count = 0;
  for (Front& front : fronts_) {
    count += front.own.size();
    std::vector<std::uint32_t> later;
    for (const auto i : front.own) {
      for (Sparse::InnerIterator it(elastic.scalar, Index(i)); it; ++it) later.push_back(std::uint32_t(it.row()));
    }
    for (const auto c : front.children) later.insert(later.end(), fronts_[c].later.begin(), fronts_[c].later.end());
    std::erase_if(later, [&](auto i) { return fixed[i] || place_[i] < count; });
    std::sort(later.begin(), later.end(), [&](auto a, auto b) { return place_[a] < place_[b]; });
    later.erase(std::unique(later.begin(), later.end()), later.end());
    front.later = std::move(later);
  }
}

void Solver::factorize(const Elastic& elastic, double shift) {
  std::vector<MatrixXd> complements(fronts_.size());  // lower triangles; what later nodes get from a front
  std::vector<Index> local(place_.size(), -1);
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    Front& front = fronts_[f];
    const Index own = 3 * Index(front.own.size()), later = 3 * Index(front.later.size());
    for (std::size_t i = 0; i < front.own.size(); ++i) local[front.own[i]] = 3 * Index(i);
    for (std::size_t i = 0; i < front.later.size(); ++i) local[front.later[i]] = own + 3 * Index(i);
    MatrixXd dense = MatrixXd::Zero(own + later, own + later);
    for (const auto j : front.own) {
      for (Index b = 0; b < 3; ++b) {
        for (Sparse::InnerIterator it(elastic.stiffness, 3 * Index(j) + b); it; ++it) {
          const auto i = std::size_t(it.row() / 3);
          if (place_[i] < place_[front.own[0]] || place_[i] == std::numeric_limits<std::size_t>::max()) continue;
          dense(local[i] + it.row() % 3, local[j] + b) = it.value();
        }
        dense(local[j] + b, local[j] + b) += shift * elastic.node_mass[Index(j)];
      }
    }
    for (const auto c : front.children) {
      const auto& nodes = fronts_[c].later;
      for (std::size_t j = 0; j < nodes.size(); ++j) {
        for (std::size_t i = j; i < nodes.size(); ++i) {
          dense.block<3, 3>(local[nodes[i]], local[nodes[j]]) += complements[c].block<3, 3>(3 * Index(i), 3 * Index(j));
        }
      }
      complements[c].resize(0, 0);
    }
    complements[f] = dense.bottomRightCorner(later, later);
    if (own == 0) continue;  // two halves that do not touch
    front.diagonal = Eigen::LLT<MatrixXd>(dense.topLeftCorner(own, own)).matrixL();
    if (later == 0) continue;
    front.below = dense.bottomLeftCorner(later, own);
    front.diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(front.below);
    complements[f].selfadjointView<Eigen::Lower>().rankUpdate(front.below, -1);
    // The diagonal blocks are added whole.
    for (Index i = 0; i < later; i += 3) {
      for (Index a = 0; a < 3; ++a) {
        for (Index b = 0; b < a; ++b) complements[f](i + b, i + a) = complements[f](i + a, i + b);
      }
    }
  }
}

double Solver::entries() const {
  double count = 0;
  for (const Front& front : fronts_) count += double(front.diagonal.size()) / 2 + double(front.below.size());
  return count;
}

MatrixXd Solver::solve(const MatrixXd& forces) const {
  if (fronts_.empty() || forces.cols() == 0) return MatrixXd::Zero(forces.rows(), forces.cols());
  MatrixXd x = forces;
  for (std::size_t i = 0; i < place_.size(); ++i) {
    if (place_[i] == std::numeric_limits<std::size_t>::max()) x.middleRows<3>(3 * Index(i)).setZero();
  }
  for (const Front& front : fronts_) {
    if (front.own.empty()) continue;
    MatrixXd own = gather(x, front.own);
    front.diagonal.triangularView<Eigen::Lower>().solveInPlace(own);
    scatter(own, front.own, x);
    if (!front.later.empty()) scatter(gather(x, front.later) - front.below * own, front.later, x);
  }
  for (auto front = fronts_.rbegin(); front != fronts_.rend(); ++front) {
    if (front->own.empty()) continue;
    MatrixXd own = gather(x, front->own);
    if (!front->later.empty()) own -= front->below.transpose() * gather(x, front->later);
    front->diagonal.triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    scatter(own, front->own, x);
  }
  return x;
}

}  // namespace sinew::tools::field
