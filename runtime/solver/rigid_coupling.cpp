// SPDX-License-Identifier: MIT
#include "runtime/solver/rigid_coupling.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "runtime/solver/for_each.h"
#include "runtime/solver/minimize.h"

namespace sinew::internal {
namespace {

using Block = Eigen::Matrix<double, 6, 6>;
using Six = Eigen::Matrix<double, 6, 1>;

Matrix3d crossOf(const Vector3d& v) {
  Matrix3d result;
  result << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return result;
}

/// The form sum_ij Q_ij x_i . x_j of motions x_i = a_i t + b_i x w on both sides, from the sum of Q_ij (a_i, b_i)(a_j,
/// b_j)^T.
Block blockOf(const Eigen::Matrix4d& gram) {
  const Matrix3d turns = gram.bottomRightCorner<3, 3>();
  Block block;
  block.topLeftCorner<3, 3>() = gram(0, 0) * Matrix3d::Identity();
  block.topRightCorner<3, 3>() = -crossOf(gram.row(0).tail<3>().transpose());
  block.bottomLeftCorner<3, 3>() = crossOf(gram.col(0).tail<3>());
  block.bottomRightCorner<3, 3>() = turns.trace() * Matrix3d::Identity() - turns.transpose();
  return block;
}

/// from -= a b^T: unrolled once.
[[gnu::noinline]] void subtractProduct(Block& from, const Block& a, const Block& b) { from -= a * b.transpose(); }

bool invert(const Block& block, Block& inverse) {
  const Eigen::LLT<Block> factor(block);
  if (factor.info() != Eigen::Success) return false;
  inverse = factor.solve(Block::Identity());
  return inverse.allFinite();
}

}  // namespace

RigidCoupling::RigidCoupling(std::pmr::memory_resource* memory)
    : nodes_(memory),
      couplings_(memory),
      keys_(memory),
      node_of_(memory),
      first_arm_(memory),
      arms_(memory),
      moments_(memory),
      blocks_(memory) {}

void RigidCoupling::reserve(std::size_t pieces, std::size_t functions, std::size_t touches) {
  nodes_.reserve(pieces);
  node_of_.reserve(pieces);
  first_arm_.reserve(pieces);
  arms_.reserve(functions);
  couplings_.reserve(touches);
  keys_.reserve(touches);
  moments_.reserve(2 * touches);
  blocks_.reserve(pieces);
}

Eigen::Vector4d RigidCoupling::momentsOf(std::uint32_t piece, const Field& field, const float* phi) const {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) sum += double(phi[j]) * arms(piece)[j];
  return sum;
}

void RigidCoupling::findArms(std::uint32_t piece, const Objective& objective) {
  const Field& field = *objective.field;
  Vector3d center = Vector3d::Zero();
  double mass = 0;
  for (const formats::FieldFunction& f : field.functions) {
    center += double(f.one) * Vector3d(double(f.rest[0]), double(f.rest[1]), double(f.rest[2]));
    mass += double(f.one) * double(f.one);
  }
  if (mass > 0) center /= mass;
  const Matrix3d turn = Eigen::Map<const Eigen::Matrix3f>(objective.rotation).cast<double>();
  Eigen::Vector4d* arm = arms(piece);
  for (const formats::FieldFunction& f : field.functions) {
    const Vector3d rest = {double(f.rest[0]), double(f.rest[1]), double(f.rest[2])};
    *arm++ << double(f.one), turn * (rest - double(f.one) * center);
  }
}

RigidCoupling::Block RigidCoupling::ownBlock(std::uint32_t piece, const Objective& objective) {
  const Field& field = *objective.field;
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
  const double inertia = 1 / (objective.h * objective.h);
  for (std::uint32_t j = 0; j < field.k; ++j) gram += inertia * arms(piece)[j] * arms(piece)[j].transpose();
  if (objective.has_springs) {
    const float* row = objective.scratch->springs.data();
    for (std::uint32_t i = 0; i < field.k; ++i, row += field.k) {
      gram += momentsOf(piece, field, row) * arms(piece)[i].transpose();
    }
  }
  // The mean of its three directions.
  for (std::uint32_t i = 0; objective.holds != nullptr && i < field.k; ++i) {
    const auto at = [&](std::uint32_t j, std::uint32_t c) {
      return objective.holds[std::size_t(field.stride) * (3 * i + c) + 3 * j + c];
    };
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (std::uint32_t j = 0; j < field.k; ++j) {
      sum += double(objective.stiffness) / 3 * double(at(j, 0) + at(j, 1) + at(j, 2)) * arms(piece)[j];
    }
    gram += sum * arms(piece)[i].transpose();
  }
  for (const Contact& contact : objective.scratch->contacts) {
    const Eigen::Vector4d at = momentsOf(piece, field, contact.phi);
    gram += double(contact.firm) * at * at.transpose();
  }
  for (const TouchRow& touch : objective.touch_rows) {
    const Eigen::Vector4d at = momentsOf(piece, field, touch.phi);
    gram += double(touch.firm) * at * at.transpose();
    moments_[2 * touch.touch + (touch.sign < 0 ? 1 : 0)] = at;
  }
  return blockOf(gram);
}

void RigidCoupling::make(const Minimand& minimand) {
  nodes_.clear();
  couplings_.clear();
  first_arm_.clear();
  std::uint32_t functions = 0;
  for (const Objective* piece : minimand.pieces) {
    first_arm_.push_back(functions);
    functions += piece->field->k;
  }
  arms_.resize(functions);
  moments_.resize(2 * minimand.touches.size());
  node_of_.resize(minimand.pieces.size());
  std::fill(node_of_.begin(), node_of_.end(), formats::kNone);
  for (const std::uint32_t piece : minimand.order) {
    if (minimand.pieces[piece]->field->driven > 0) continue;  // pin sets leave it no rigid motion
    node_of_[piece] = std::uint32_t(nodes_.size());
    nodes_.add().piece = piece;
  }
  forEach(minimand.jobs, std::uint32_t(nodes_.size()), kPiecesAJob, [&](std::uint32_t n) {
    Node& node = nodes_[n];
    findArms(node.piece, *minimand.pieces[node.piece]);
    node.inverse = ownBlock(node.piece, *minimand.pieces[node.piece]);
    if (!invert(node.inverse, node.own)) node.own.setZero();
  });
  // Of touches, by the nodes that they couple.
  const auto keyOf = [&](const TouchLink& touch) {
    const std::uint64_t a = node_of_[touch.a], b = node_of_[touch.b];
    return std::min(a, b) << 32 | std::max(a, b);
  };
  const auto couples = [&](const TouchLink& touch) {
    return touch.a != touch.b && node_of_[touch.a] != formats::kNone && node_of_[touch.b] != formats::kNone;
  };
  keys_.clear();
  for (const TouchLink& touch : minimand.touches) {
    if (couples(touch) && (keys_.empty() || keys_.back() != keyOf(touch))) keys_.push_back(keyOf(touch));
  }
  sortAscending({keys_.data(), keys_.size()});
  const auto* const end = std::unique(keys_.begin(), keys_.end());
  for (const auto* key = keys_.begin(); key != end; ++key) couplings_.push_back({*key, Block::Zero()});
  Coupling* coupling = nullptr;
  for (std::size_t i = 0; i < minimand.touches.size(); ++i) {
    const TouchLink& touch = minimand.touches[i];
    if (!couples(touch)) continue;
    const std::uint64_t key = keyOf(touch);
    if (coupling == nullptr || coupling->key != key) coupling = find(key);
    const bool a_is_later = node_of_[touch.a] > node_of_[touch.b];
    const Eigen::Vector4d &later = moments_[2 * i + (a_is_later ? 0 : 1)],
                          &earlier = moments_[2 * i + (a_is_later ? 1 : 0)];
    coupling->block += blockOf(-double(touch.firm) * later * earlier.transpose());
  }
  takeApart();
}

RigidCoupling::Coupling* RigidCoupling::find(std::uint64_t key) {
  auto* const found = std::lower_bound(couplings_.begin(), couplings_.end(), key,
                                       [](const Coupling& coupling, std::uint64_t k) { return coupling.key < k; });
  return found != couplings_.end() && found->key == key ? found : nullptr;
}

void RigidCoupling::takeApart() {
  std::uint32_t at = 0;
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) {
    nodes_[n].first = at;
    while (at < couplings_.size() && couplings_[at].key >> 32 == n) ++at;
    nodes_[n].count = at - nodes_[n].first;
  }
  for (Node& node : nodes_) {
    const std::span<Coupling> later(couplings_.data() + node.first, node.count);
    const Block whole = node.inverse;
    if (node.own.isZero(0) || !invert(whole, node.inverse)) {
      // Without its couplings it is what its own matrix says.
      node.inverse = node.own;
      for (Coupling& coupling : later) coupling.block.setZero();
      continue;
    }
    blocks_.resize(later.size());  // of A, which are those of L times S
    for (std::size_t i = 0; i < later.size(); ++i) {
      blocks_[i] = later[i].block;
      later[i].block = blocks_[i] * node.inverse;
    }
    for (std::size_t i = 0; i < later.size(); ++i) {
      const auto row = std::uint32_t(later[i].key);
      subtractProduct(nodes_[row].inverse, later[i].block, blocks_[i]);
      for (std::size_t j = 0; j < i; ++j) {
        const std::uint64_t key = std::uint64_t(std::uint32_t(later[j].key)) << 32 | row;
        Coupling* const found = find(key);
        if (found == nullptr) continue;
        subtractProduct(found->block, later[i].block, blocks_[j]);
      }
    }
  }
}

void RigidCoupling::take(const Minimand& minimand, const float* g) {
  forEach(minimand.jobs, std::uint32_t(nodes_.size()), kPiecesAJob, [&](std::uint32_t n) {
    Node& node = nodes_[n];
    const std::uint32_t k = minimand.pieces[node.piece]->field->k;
    const float* const from = g + minimand.first[node.piece];
    node.load.setZero();
    for (std::uint32_t j = 0; j < k; ++j) {
      const Vector3d pull = {double(from[4 * j]), double(from[4 * j + 1]), double(from[4 * j + 2])};
      const Eigen::Vector4d& arm = arms(node.piece)[j];
      node.load.head<3>() += arm[0] * pull;
      node.load.tail<3>() += arm.tail<3>().cross(pull);
    }
    node.way = node.load;
  });
}

void RigidCoupling::substitute() {
  for (const Node& node : nodes_) {
    for (std::uint32_t c = node.first; c < node.first + node.count; ++c) {
      nodes_[std::uint32_t(couplings_[c].key)].way -= couplings_[c].block * node.way;
    }
  }
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    Node& node = nodes_[n];
    node.way = (node.inverse * node.way).eval();
    for (std::uint32_t c = node.first; c < node.first + node.count; ++c) {
      node.way -= couplings_[c].block.transpose() * nodes_[std::uint32_t(couplings_[c].key)].way;
    }
  }
}

void RigidCoupling::give(const Minimand& minimand, float* direction) {
  substitute();
  forEach(minimand.jobs, std::uint32_t(nodes_.size()), kPiecesAJob, [&](std::uint32_t n) {
    add(minimand, nodes_[n], nodes_[n].way - nodes_[n].own * nodes_[n].load, direction);
  });
}

void RigidCoupling::giveAlone(const Minimand& minimand, float* direction) {
  substitute();
  for (const Node& node : nodes_) add(minimand, node, node.way, direction);
}

void RigidCoupling::add(const Minimand& minimand, const Node& node, const Six& motion, float* direction) {
  const Vector3d shift = motion.head<3>(), turn = motion.tail<3>();
  float* const to = direction + minimand.first[node.piece];
  const std::uint32_t k = minimand.pieces[node.piece]->field->k;
  for (std::uint32_t j = 0; j < k; ++j) {
    const Eigen::Vector4d& arm = arms(node.piece)[j];
    const Vector3d way = arm[0] * shift + turn.cross(Vector3d(arm.tail<3>()));
    for (std::uint32_t c = 0; c < 3; ++c) to[4 * j + c] += float(way[int(c)]);
  }
}

}  // namespace sinew::internal
