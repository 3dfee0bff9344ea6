// SPDX-License-Identifier: MIT
#include "runtime/solver/plasticity.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "runtime/geometry/rotation.h"

namespace sinew::internal {
namespace {

constexpr std::size_t kPack = 72;  // floats

Matrix3 shapeAt(const Array<float>& plastic, std::size_t pack, std::size_t lane) {
  Matrix3 shape;
  for (std::size_t i = 0; i < 9; ++i) shape.data()[i] = plastic[kPack * pack + 8 * i + lane];
  return shape;
}

void setShape(Array<float>& plastic, std::size_t pack, std::size_t lane, const Matrix3& shape) {
  for (std::size_t i = 0; i < 9; ++i) plastic[kPack * pack + 8 * i + lane] = shape.data()[i];
}

/// F of one sample.
Matrix3 gradientAt(const Field& field, const float* local, std::size_t pack, std::size_t lane) {
  Matrix3 f = Matrix3::Identity();
  const float* const gradients = field.gradients + std::size_t(24) * field.k * pack + lane;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    const Eigen::Vector3f slope(gradients[24 * j], gradients[24 * j + 8], gradients[24 * j + 16]);
    f += Eigen::Vector3f(local[4 * j], local[4 * j + 1], local[4 * j + 2]) * slope.transpose();
  }
  return f;
}

/// S after a step. \param f F.
Matrix3 flowed(const formats::ClusterMechanics& mechanics, const Matrix3& f, const Matrix3& shape, double seconds) {
  const Matrix3 elastic = f * shape.inverse();
  const Matrix3 local = geometry::nearestRotation(elastic).transpose() * elastic;
  const Matrix3 strain = 0.5F * (local + local.transpose()) - Matrix3::Identity();
  if (!(strain.norm() > mechanics.plastic_yield)) return shape;
  // An exponential, so that creep does not depend on the step.
  const float part = float(-std::expm1(-double(mechanics.plastic_creep) * seconds));
  Matrix3 next = shape + part * strain * shape;
  const Matrix3 change = next - Matrix3::Identity();
  const float size = change.norm();
  if (size > mechanics.plastic_limit) next = Matrix3::Identity() + (mechanics.plastic_limit / size) * change;
  const float volume = next.determinant();
  if (!(volume > 1e-3F) || !next.allFinite()) return shape;
  return next / std::cbrt(volume);
}

}  // namespace

void resetPlasticity(const Field& field, Array<float>& plastic) {
  plastic.resize(field.plastic ? kPack * field.pack_count : 0);
  for (std::size_t i = 0; i < plastic.size(); ++i) plastic[i] = i / 8 % 9 % 4 == 0 ? 1.0F : 0.0F;
}

void invertPlasticity(const Array<float>& plastic, Array<float>& rest_change) {
  rest_change.resize(plastic.size());
  for (std::size_t pack = 0; pack < plastic.size() / kPack; ++pack) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      setShape(rest_change, pack, lane, shapeAt(plastic, pack, lane).inverse() - Matrix3::Identity());
    }
  }
}

bool flow(const formats::PackageView& package, const Field& field, const float* local, double seconds,
          Array<float>& plastic) {
  bool changed = false;
  for (std::size_t pack = 0; pack < field.pack_count; ++pack) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const std::uint32_t cluster = field.packs[pack].cluster[lane];
      if (cluster == formats::kNone || !(package.mechanics()[cluster].plastic_creep > 0)) continue;
      const Matrix3 shape = shapeAt(plastic, pack, lane);
      const Matrix3 next = flowed(package.mechanics()[cluster], gradientAt(field, local, pack, lane), shape, seconds);
      // Of a shape at its limit rounding is left, by which it would flow for ever.
      if (!((next - shape).norm() > 4 * std::numeric_limits<float>::epsilon() * shape.norm())) continue;
      setShape(plastic, pack, lane, next);
      changed = true;
    }
  }
  return changed;
}

void movePlasticity(const Field& from, const Field& to, Array<float>& plastic) {
  if (plastic.empty()) return;
  Array<float> moved(kPack * to.pack_count, plastic.memory());
  const auto placeOf = [](const Field& field, std::size_t pack, std::size_t lane) {
    const SamplePack& p = field.packs[pack];
    return Eigen::Vector3f(p.at[0][lane], p.at[1][lane], p.at[2][lane]);
  };
  for (std::size_t pack = 0; pack < to.pack_count; ++pack) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      std::size_t nearest = 0;
      float least = -1;
      for (std::size_t i = 0; i < 8 * std::size_t(from.pack_count); ++i) {
        if (!(from.packs[i / 8].volume[i % 8] > 0)) continue;
        const float distance = (placeOf(from, i / 8, i % 8) - placeOf(to, pack, lane)).squaredNorm();
        if (least < 0 || distance < least) least = distance, nearest = i;
      }
      const bool there = to.packs[pack].volume[lane] > 0;
      setShape(moved, pack, lane, there ? shapeAt(plastic, nearest / 8, nearest % 8) : Matrix3(Matrix3::Identity()));
    }
  }
  plastic.swap(moved);
}

Matrix3 plasticShapeOf(const Field& field, std::uint32_t cluster, const Array<float>& plastic) {
  Matrix3 sum = Matrix3::Zero();
  float volume = 0;
  for (std::size_t i = 0; i < 8 * std::size_t(field.pack_count) && !plastic.empty(); ++i) {
    const SamplePack& pack = field.packs[i / 8];
    if (pack.cluster[i % 8] != cluster) continue;
    sum += pack.volume[i % 8] * shapeAt(plastic, i / 8, i % 8);
    volume += pack.volume[i % 8];
  }
  return volume > 0 ? Matrix3(sum / volume) : Matrix3(Matrix3::Identity());
}

Matrix3 activationStretch(const formats::ClusterMechanics& mechanics, float activation) {
  const Eigen::Vector3f fibre = asVector(mechanics.fibre);
  if (fibre.isZero(0)) return Matrix3::Identity();
  const float along = 1.0F - std::clamp(activation, 0.0F, 1.0F) * mechanics.contraction;
  const float across = 1.0F / std::sqrt(along);
  const Matrix3 direction = fibre.normalized() * fibre.normalized().transpose();
  return across * Matrix3::Identity() + (along - across) * direction;
}

}  // namespace sinew::internal
