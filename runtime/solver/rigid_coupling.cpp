// SPDX-License-Identifier: MIT
#include "runtime/solver/rigid_coupling.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>

#include "runtime/clusters/algebra.h"
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

/// The same form (n . x_1) (n . x_2) of two places with these moments.
Block blockAlong(const Vector3d& n, const Eigen::Vector4d& one, const Eigen::Vector4d& other) {
  const auto row = [&n](const Eigen::Vector4d& at) {
    Six result;
    result << at[0] * n, at.tail<3>().cross(n);
    return result;
  };
  return row(one) * row(other).transpose();
}

/// from -= a b^T: unrolled once.
[[gnu::noinline]] void subtractProduct(Block& from, const Block& a, const Block& b) { from -= a * b.transpose(); }

/// A row's moments of a translation and a turn about the centre, in the frame of the piece.
Eigen::Vector4d momentsOf(const Field& field, const float* phi) {
  double one = 0;
  Vector3d rest = Vector3d::Zero();
  for (std::uint32_t j = 0; j < field.k; ++j) {
    one += double(phi[j]) * field.oneOf(j);
    rest += double(phi[j]) * field.restOf(j);
  }
  rest -= one * field.rest_center;
  return {one, rest[0], rest[1], rest[2]};
}

Matrix3d frameOf(const Objective& objective) { return objective.rotation.cast<double>(); }

bool invert(const Block& block, Block& inverse) {
  const Eigen::LLT<Block> factor(block);
  if (factor.info() != Eigen::Success) return false;
  inverse = factor.solve(Block::Identity());
  return inverse.allFinite();
}

}  // namespace

RigidCoupling::RigidCoupling(std::pmr::memory_resource* memory)
    : nodes_(memory), couplings_(memory), keys_(memory), node_of_(memory), moments_(memory), blocks_(memory) {}

void RigidCoupling::reserve(std::size_t pieces, std::size_t touches) {
  nodes_.reserve(pieces);
  node_of_.reserve(pieces);
  couplings_.reserve(touches);
  keys_.reserve(touches);
  moments_.reserve(2 * touches);
  blocks_.reserve(pieces);
}

void RigidCoupling::findBlocks(const Minimand& minimand, const Objective& objective, Block& d, Block& a) {
  const Field& field = *objective.field;
  const std::uint32_t k = field.k;
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
  const auto armOf = [&field](std::uint32_t j) {
    const double one = field.oneOf(j);
    const Vector3d arm = field.restOf(j) - one * field.rest_center;
    return Eigen::Vector4d(one, arm[0], arm[1], arm[2]);
  };
  const double inertia = 1 / (objective.h * objective.h);
  for (std::uint32_t j = 0; j < k; ++j) gram += inertia * armOf(j) * armOf(j).transpose();
  if (objective.has_springs) {
    const float* row = objective.scratch->springs.data();
    for (std::uint32_t i = 0; i < k; ++i, row += k) gram += momentsOf(field, row) * armOf(i).transpose();
  }
  // The mean of its three directions.
  for (std::uint32_t i = 0; objective.holds != nullptr && i < k; ++i) {
    const auto at = [&](std::uint32_t j, std::uint32_t c) {
      return objective.holds[std::size_t(field.stride) * (3 * i + c) + 3 * j + c];
    };
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (std::uint32_t j = 0; j < k; ++j) {
      sum += double(objective.stiffness) / 3 * double(at(j, 0) + at(j, 1) + at(j, 2)) * armOf(j);
    }
    gram += sum * armOf(i).transpose();
  }
  Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
  turn.bottomRightCorner<3, 3>() = frameOf(objective);
  Eigen::Matrix4d carrying = gram;  // of A
  Block along = Block::Zero();      // of A: what slides is held along its normal
  const auto add = [&](float firm, const Eigen::Vector4d& at, bool carries, float across, const auto& normal) {
    const Eigen::Matrix4d own = double(firm) * at * at.transpose();
    gram += own;
    if (!carries) return;
    carrying += double(across) * own;
    if (across < 1) along += double((1 - across) * firm) * blockAlong(normal(), turn * at, turn * at);
  };
  for (const Contact& contact : objective.scratch->contacts) {
    const Vector3d arm = contact.rest.cast<double>() - field.rest_center;
    add(contact.firm, {1, arm[0], arm[1], arm[2]}, contact.carries, minimand.knows_loads ? heldAcross(contact) : 1,
        [&] { return Vector3d(contact.normal.cast<double>()); });
  }
  for (const TouchRow& touch : objective.touch_rows) {
    const Eigen::Vector4d at = touch.moments.cast<double>();
    const TouchLink& link = minimand.touches[touch.touch];
    add(touch.firm, at, link.carries, minimand.knows_loads ? minimand.lanes->heldAcross(link.slot) : 1,
        [&] { return minimand.lanes->normal(link.slot); });
    moments_[2 * touch.touch + (touch.sign < 0 ? 1 : 0)] = turn * at;
  }
  d = blockOf(turn * gram * turn.transpose());
  a = along + blockOf(turn * carrying * turn.transpose());
}

namespace {

/// Marks what A has.
void findCarrying(const Minimand& minimand, bool pushing_only) {
  for (TouchLink& touch : minimand.touches) {
    touch.carries = !pushing_only || minimand.lanes->predictedGap(touch.slot) < 0 || minimand.pushes(touch);
  }
  for (const Objective* piece : minimand.pieces) {
    for (Contact& contact : piece->scratch->contacts) {
      contact.carries = !pushing_only || contact.gap < 0 || gapOf(contact) < 0;
    }
  }
}

}  // namespace

void RigidCoupling::make(const Minimand& minimand, bool pushing_only) {
  findCarrying(minimand, pushing_only);
  nodes_.clear();
  couplings_.clear();
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
    Block d;
    findBlocks(minimand, *minimand.pieces[node.piece], d, node.inverse);
    if (!invert(d, node.own)) node.own.setZero();
  });
  // Of touches, by the nodes that they couple.
  const auto keyOf = [&](const TouchLink& touch) {
    const std::uint64_t a = node_of_[touch.a], b = node_of_[touch.b];
    return std::min(a, b) << 32 | std::max(a, b);
  };
  const auto couples = [&](const TouchLink& touch) {
    return touch.a != touch.b && std::max(touch.a, touch.b) < node_of_.size() && node_of_[touch.a] != formats::kNone &&
           node_of_[touch.b] != formats::kNone;
  };
  keys_.clear();
  for (const TouchLink& touch : minimand.touches) {
    if (couples(touch) && (keys_.empty() || keys_.back() != keyOf(touch))) keys_.push_back(keyOf(touch));
  }
  sortAscending({keys_.data(), keys_.size()});
  const auto* const end = std::unique(keys_.begin(), keys_.end());
  for (const auto* key = keys_.begin(); key != end; ++key) couplings_.push_back({*key, Block::Zero()});
  Coupling* coupling = nullptr;
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();  // of one coupling's touches that come together
  const auto close = [&] {
    if (coupling != nullptr) coupling->block += blockOf(gram);
    gram.setZero();
  };
  for (std::size_t i = 0; i < minimand.touches.size(); ++i) {
    const TouchLink& touch = minimand.touches[i];
    if (!couples(touch) || !touch.carries) continue;
    const std::uint64_t key = keyOf(touch);
    if (coupling == nullptr || coupling->key != key) {
      close();
      coupling = find(key);
    }
    const bool a_is_later = node_of_[touch.a] > node_of_[touch.b];
    const Eigen::Vector4d &later = moments_[2 * i + (a_is_later ? 0 : 1)],
                          &earlier = moments_[2 * i + (a_is_later ? 1 : 0)];
    const float across = minimand.knows_loads ? minimand.lanes->heldAcross(touch.slot) : 1;
    gram -= double(across * touch.firm) * later * earlier.transpose();
    if (across < 1) {
      coupling->block -=
          double((1 - across) * touch.firm) * blockAlong(minimand.lanes->normal(touch.slot), later, earlier);
    }
  }
  close();
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
    const Objective& piece = *minimand.pieces[node.piece];
    const Field& field = *piece.field;
    const float* from = g + minimand.first[node.piece];
    Vector3d force = Vector3d::Zero(), torque = force;
    for (std::uint32_t j = 0; j < field.k; ++j, from += 4) {
      const Vector3d pull = {double(from[0]), double(from[1]), double(from[2])};
      force += field.oneOf(j) * pull;
      torque += field.restOf(j).cross(pull);
    }
    torque -= field.rest_center.cross(force);
    const Matrix3d frame = frameOf(piece);
    node.load << frame * force, frame * torque;
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
  const Objective& piece = *minimand.pieces[node.piece];
  const Field& field = *piece.field;
  const Matrix3d back = frameOf(piece).transpose();
  const Vector3d turn = back * motion.tail<3>(), shift = back * motion.head<3>() - turn.cross(field.rest_center);
  float* to = direction + minimand.first[node.piece];
  for (std::uint32_t j = 0; j < field.k; ++j, to += 4) {
    const Vector3d way = field.oneOf(j) * shift + turn.cross(field.restOf(j));
    for (std::uint32_t c = 0; c < 3; ++c) to[c] += float(way[int(c)]);
  }
}

}  // namespace sinew::internal
