// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace sinew::cutting {

/// Places as floats about the first of them, side by side: distances of all to one. A fourth axis, where it is asked
/// for, tells places apart that are one at rest.
class Places {
 public:
  explicit Places(std::size_t count, bool deep = false) : x_(count), y_(count), z_(count), w_(deep ? count : 0) {}

  void set(std::size_t i, const Eigen::Vector3d& at, double depth = 0) {
    if (i == 0) origin_ = at;
    x_[i] = float(at[0] - origin_[0]);
    y_[i] = float(at[1] - origin_[1]);
    z_[i] = float(at[2] - origin_[2]);
    if (!w_.empty()) w_[i] = float(depth);
  }

  /// \param[out] out m^2, as many as there are places.
  void squaredDistances(const Eigen::Vector3d& to, double depth, Eigen::ArrayXf& out) const {
    const Eigen::Vector3d from = to - origin_;
    const float px = float(from[0]), py = float(from[1]), pz = float(from[2]);
    const float *const x = x_.data(), *const y = y_.data(), *const z = z_.data();
    float* const d = out.data();
    for (std::size_t i = 0; i < x_.size(); ++i) {
      d[i] = (x[i] - px) * (x[i] - px) + (y[i] - py) * (y[i] - py) + (z[i] - pz) * (z[i] - pz);
    }
    for (std::size_t i = 0; i < w_.size(); ++i) d[i] += (w_[i] - float(depth)) * (w_[i] - float(depth));
  }

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<float> x_, y_, z_, w_;
};

/// Place of the first of the largest numbers: by blocks, whose largest is found in lanes.
template <class Numbers>
std::size_t firstLargest(const Eigen::ArrayBase<Numbers>& numbers) {
  constexpr Eigen::Index kBlock = 64;
  Eigen::Index best = 0;
  float largest = -std::numeric_limits<float>::infinity();
  for (Eigen::Index first = 0; first < numbers.size(); first += kBlock) {
    const float here = numbers.segment(first, std::min(kBlock, numbers.size() - first)).maxCoeff();
    if (here > largest) largest = here, best = first;
  }
  for (Eigen::Index i = best; i < numbers.size(); ++i) {
    if (numbers.coeff(i) == largest) return std::size_t(i);
  }
  return 0;
}

}  // namespace sinew::cutting
