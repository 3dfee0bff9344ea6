// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/sparse_cholesky.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <span>

namespace sinew::tools {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Nodes = std::vector<std::uint32_t>;

// Sets of so many nodes are not cut any more.
constexpr std::size_t kLeaf = 24;
// Part of the nodes that is in front of a cut at least, and behind it.
constexpr double kLeastPart = 0.35;
// Across which sets are cut: axes and diagonals.
constexpr std::array<std::array<int, 3>, 13> kDirections = {{{1, 0, 0},
                                                             {0, 1, 0},
                                                             {0, 0, 1},
                                                             {1, 1, 0},
                                                             {1, -1, 0},
                                                             {1, 0, 1},
                                                             {1, 0, -1},
                                                             {0, 1, 1},
                                                             {0, 1, -1},
                                                             {1, 1, 1},
                                                             {1, 1, -1},
                                                             {1, -1, 1},
                                                             {-1, 1, 1}}};
// Columns that a thread updates at a time.
constexpr Index kColumns = 96;

// Nodes that are eliminated together, and the later ones that they touch then.
struct Front {
  Nodes own, later;
  std::vector<std::size_t> children;  // before it
  std::vector<std::uint32_t> into;    // of `later`: which of the parent's nodes, own first
  struct Place {
    std::size_t block;          // of the pattern
    std::uint32_t row, column;  // nodes of the front; the column is its own
    bool turned;                // of the block, above the diagonal there
  };
  std::vector<Place> places;
  MatrixXd factor;  // columns of `own`, rows of all
  MatrixXd rest;    // what `later` get from it: the lower triangle
};

// Who touches whom, oneself too.
struct Neighbours {
  std::vector<std::size_t> first;
  Nodes other;

  explicit Neighbours(const BlockPattern& pattern) : first(pattern.columns() + 1, 0) {
    const auto each = [&](const auto& visit) {
      for (std::uint32_t c = 0; c < pattern.columns(); ++c) {
        for (std::size_t i = pattern.first[c]; i < pattern.first[c + 1]; ++i) {
          visit(c, pattern.row[i]);
          if (pattern.row[i] != c) visit(pattern.row[i], c);
        }
      }
    };
    each([&](std::uint32_t a, std::uint32_t) { ++first[a + 1]; });
    for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
    other.resize(first.back());
    std::vector<std::size_t> next(first.begin(), first.end() - 1);
    each([&](std::uint32_t a, std::uint32_t b) { other[next[a]++] = b; });
  }
  std::span<const std::uint32_t> of(std::uint32_t node) const {
    return std::span(other).subspan(first[node], first[node + 1] - first[node]);
  }
};

// Nodes in an order that is cut before place `at`: those in front that touch one behind are the separator.
struct Cut {
  Nodes order;
  std::size_t at = 0, separator = std::numeric_limits<std::size_t>::max();
};

// Cuts sets of nodes in halves until they are small.
class Dissection {
 public:
  Dissection(const Neighbours& neighbours, const std::vector<Vector3d>& positions)
      : neighbours_(neighbours),
        positions_(positions),
        among_(positions.size(), 0),
        taken_(positions.size(), 0),
        place_(positions.size()) {}

  // \return fronts with `own` and `children`, the last one the root.
  std::vector<Front> run() {
    Nodes all(positions_.size());
    for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
    if (!all.empty()) dissect(std::move(all));
    return std::move(fronts_);
  }

 private:
  std::size_t dissect(Nodes nodes) {
    Front front;
    if (nodes.size() > kLeaf) {
      for (const auto i : nodes) among_[i] = 1;
      Cut best;
      const auto offer = [&](Nodes order) {
        Cut cut = leastCut(std::move(order));
        if (cut.separator < best.separator) best = std::move(cut);
      };
      for (const auto& direction : kDirections) {
        const Vector3d along(direction[0], direction[1], direction[2]);
        std::sort(nodes.begin(), nodes.end(), [&](auto a, auto b) {
          const double x = positions_[a].dot(along), y = positions_[b].dot(along);
          return x < y || (x == y && a < b);
        });
        offer(nodes);
      }
      offer(breadthFirst(nodes, breadthFirst(nodes, nodes.front()).back()));
      const auto middle = best.order.begin() + std::ptrdiff_t(best.at);
      for (auto i = best.order.begin(); i != middle; ++i) among_[*i] = 0;
      Nodes before;
      for (auto i = best.order.begin(); i != middle; ++i) {
        const auto others = neighbours_.of(*i);
        const bool touches = std::any_of(others.begin(), others.end(), [&](auto o) { return among_[o] != 0; });
        (touches ? front.own : before).push_back(*i);
      }
      Nodes behind(middle, best.order.end());
      for (const auto i : behind) among_[i] = 0;
      if (!before.empty()) front.children.push_back(dissect(std::move(before)));
      front.children.push_back(dissect(std::move(behind)));
    } else {
      front.own = std::move(nodes);
    }
    fronts_.push_back(std::move(front));
    return fronts_.size() - 1;
  }
  // One component after the other.
  Nodes breadthFirst(const Nodes& nodes, std::uint32_t from) {
    Nodes order;
    order.reserve(nodes.size());
    const auto take = [&](std::uint32_t i) {
      if (among_[i] == 0 || taken_[i] != 0) return;
      taken_[i] = 1;
      order.push_back(i);
    };
    take(from);
    auto next = nodes.begin();
    for (std::size_t done = 0; done < nodes.size(); ++done) {
      while (done == order.size()) take(*next++);
      for (const auto other : neighbours_.of(order[done])) take(other);
    }
    for (const auto i : nodes) taken_[i] = 0;
    return order;
  }
  // The cut with the smallest separator, in the middle part of an order.
  Cut leastCut(Nodes order) {
    const std::size_t n = order.size();
    for (std::size_t i = 0; i < n; ++i) place_[order[i]] = i;
    // How many nodes more a separator has at each cut than at the one before.
    std::vector<std::ptrdiff_t> more(n + 1, 0);
    for (std::size_t i = 0; i < n; ++i) {
      std::size_t last = i;
      for (const auto other : neighbours_.of(order[i])) {
        if (among_[other] != 0) last = std::max(last, place_[other]);
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

  const Neighbours& neighbours_;
  const std::vector<Vector3d>& positions_;
  std::vector<char> among_, taken_;
  std::vector<std::size_t> place_;
  std::vector<Front> fronts_;
};

}  // namespace

class SparseCholesky::Tree {
 public:
  Tree(const BlockPattern& pattern, const std::vector<Vector3d>& positions) {
    const Neighbours neighbours(pattern);
    fronts_ = Dissection(neighbours, positions).run();
    place_.resize(positions.size());
    std::size_t count = 0;
    for (const Front& front : fronts_) {
      for (const auto i : front.own) place_[i] = count++;
    }
    count = 0;
    for (Front& front : fronts_) {
      count += front.own.size();
      Nodes later;
      for (const auto i : front.own) {
        for (const auto other : neighbours.of(i)) later.push_back(other);
      }
      for (const auto c : front.children) later.insert(later.end(), fronts_[c].later.begin(), fronts_[c].later.end());
      std::erase_if(later, [&](auto i) { return place_[i] < count; });
      std::sort(later.begin(), later.end(), [&](auto a, auto b) { return place_[a] < place_[b]; });
      later.erase(std::unique(later.begin(), later.end()), later.end());
      front.later = std::move(later);
    }
    setPlaces(pattern);
  }

  bool factorize(const std::vector<Matrix3d>& blocks) {
    positive_ = true;
    if (!fronts_.empty()) factorize(fronts_.size() - 1, blocks);
    return positive_;
  }
  MatrixXd solve(const MatrixXd& right) const {
    MatrixXd x = right;
    for (const Front& front : fronts_) {
      const Index own = 3 * Index(front.own.size()), later = 3 * Index(front.later.size());
      if (own == 0) continue;
      MatrixXd part = gather(x, front.own);
      front.factor.topRows(own).triangularView<Eigen::Lower>().solveInPlace(part);
      scatter(part, front.own, x);
      if (later > 0) scatter(gather(x, front.later) - front.factor.bottomRows(later) * part, front.later, x);
    }
    for (auto front = fronts_.rbegin(); front != fronts_.rend(); ++front) {
      const Index own = 3 * Index(front->own.size()), later = 3 * Index(front->later.size());
      if (own == 0) continue;
      MatrixXd part = gather(x, front->own);
      if (later > 0) part -= front->factor.bottomRows(later).transpose() * gather(x, front->later);
      front->factor.topRows(own).triangularView<Eigen::Lower>().transpose().solveInPlace(part);
      scatter(part, front->own, x);
    }
    return x;
  }
  std::size_t entries() const {
    std::size_t count = 0;
    for (const Front& front : fronts_) {
      const std::size_t own = 3 * front.own.size();
      count += own * (own + 1) / 2 + own * 3 * front.later.size();
    }
    return count;
  }

 private:
  static MatrixXd gather(const MatrixXd& from, const Nodes& nodes) {
    MatrixXd result(3 * Index(nodes.size()), from.cols());
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      result.middleRows<3>(3 * Index(i)) = from.middleRows<3>(3 * Index(nodes[i]));
    }
    return result;
  }
  static void scatter(const MatrixXd& values, const Nodes& nodes, MatrixXd& to) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      to.middleRows<3>(3 * Index(nodes[i])) = values.middleRows<3>(3 * Index(i));
    }
  }
  void setPlaces(const BlockPattern& pattern) {
    std::vector<std::uint32_t> local(place_.size());
    std::vector<std::size_t> home(place_.size());
    const auto setLocal = [&](const Front& front) {
      std::uint32_t count = 0;
      for (const auto i : front.own) local[i] = count++;
      for (const auto i : front.later) local[i] = count++;
    };
    for (std::size_t f = 0; f < fronts_.size(); ++f) {
      for (const auto i : fronts_[f].own) home[i] = f;
      setLocal(fronts_[f]);
      for (const auto c : fronts_[f].children) {
        for (const auto i : fronts_[c].later) fronts_[c].into.push_back(local[i]);
      }
    }
    for (std::uint32_t c = 0; c < pattern.columns(); ++c) {
      for (std::size_t i = pattern.first[c]; i < pattern.first[c + 1]; ++i) {
        const std::uint32_t r = pattern.row[i];
        const bool turned = place_[r] < place_[c];
        fronts_[home[turned ? r : c]].places.push_back({i, turned ? c : r, turned ? r : c, turned});
      }
    }
    for (Front& front : fronts_) {
      setLocal(front);
      for (auto& place : front.places) place.row = local[place.row], place.column = local[place.column];
    }
  }
  // The lower triangle of a front is split between `factor` and `rest`. Above the diagonal lies what nobody reads.
  void factorize(std::size_t f, const std::vector<Matrix3d>& blocks) {
    Front& front = fronts_[f];
    tbb::parallel_for(std::size_t(0), front.children.size(),
                      [&](std::size_t c) { factorize(front.children[c], blocks); });
    if (!positive_) return;
    const Index own = 3 * Index(front.own.size()), later = 3 * Index(front.later.size());
    front.factor.setZero(own + later, own);
    front.rest.setZero(later, later);
    for (const auto& place : front.places) {
      auto to = front.factor.block<3, 3>(3 * Index(place.row), 3 * Index(place.column));
      if (place.turned) {
        to = blocks[place.block].transpose();
      } else {
        to = blocks[place.block];
      }
    }
    for (const auto c : front.children) {
      Front& child = fronts_[c];
      for (std::size_t j = 0; j < child.into.size(); ++j) {
        const Index column = 3 * Index(child.into[j]);
        for (std::size_t i = j; i < child.into.size(); ++i) {
          const Index row = 3 * Index(child.into[i]);
          const auto from = child.rest.block<3, 3>(3 * Index(i), 3 * Index(j));
          if (column < own) {
            front.factor.block<3, 3>(row, column) += from;
          } else {
            front.rest.block<3, 3>(row - own, column - own) += from;
          }
        }
      }
      child.rest.resize(0, 0);
    }
    if (own == 0) return;
    Eigen::Ref<MatrixXd> diagonal = front.factor.topRows(own);
    if (Eigen::LLT<Eigen::Ref<MatrixXd>>(diagonal).info() != Eigen::Success) {
      positive_ = false;
      return;
    }
    if (later == 0) return;
    const auto parts = std::size_t((later + kColumns - 1) / kColumns);
    const auto begin = [&](std::size_t part) { return std::min(later, kColumns * Index(part)); };
    tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
      auto below = front.factor.middleRows(own + begin(part), begin(part + 1) - begin(part));
      front.factor.topRows(own).triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(below);
    });
    tbb::parallel_for(std::size_t(0), parts, [&](std::size_t part) {
      const Index at = begin(part), width = begin(part + 1) - at;
      const auto below = front.factor.bottomRows(later);
      front.rest.block(at, at, width, width)
          .selfadjointView<Eigen::Lower>()
          .rankUpdate(below.middleRows(at, width), -1);
      if (at + width < later) {
        front.rest.block(at + width, at, later - at - width, width).noalias() -=
            below.bottomRows(later - at - width) * below.middleRows(at, width).transpose();
      }
    });
  }

  std::vector<Front> fronts_;       // children first
  std::vector<std::size_t> place_;  // of each node in the order of elimination
  std::atomic<bool> positive_ = true;
};

SparseCholesky::SparseCholesky(const BlockPattern& pattern, const std::vector<Vector3d>& positions)
    : tree_(std::make_unique<Tree>(pattern, positions)) {}
SparseCholesky::~SparseCholesky() = default;

bool SparseCholesky::factorize(const std::vector<Matrix3d>& blocks) { return tree_->factorize(blocks); }
MatrixXd SparseCholesky::solve(const MatrixXd& right) const { return tree_->solve(right); }
std::size_t SparseCholesky::entries() const { return tree_->entries(); }

}  // namespace sinew::tools
