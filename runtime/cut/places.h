// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace sinew::cutting {

/// Places as floats about the first of them, side by side: distances of all to one.
class Places {
 public:
  explicit Places(std::size_t count) : x_(count), y_(count), z_(count) {}

  void set(std::size_t i, const Eigen::Vector3d& at) {
    if (i == 0) origin_ = at;
    x_[i] = float(at[0] - origin_[0]);
    y_[i] = float(at[1] - origin_[1]);
    z_[i] = float(at[2] - origin_[2]);
  }

  /// \param[out] out m^2, as many as there are places.
  void squaredDistances(const Eigen::Vector3d& to, std::vector<float>& out) const {
    const Eigen::Vector3d from = to - origin_;
    const float px = float(from[0]), py = float(from[1]), pz = float(from[2]);
    const float *const x = x_.data(), *const y = y_.data(), *const z = z_.data();
    float* const d = out.data();
    for (std::size_t i = 0; i < out.size(); ++i) {
      d[i] = (x[i] - px) * (x[i] - px) + (y[i] - py) * (y[i] - py) + (z[i] - pz) * (z[i] - pz);
    }
  }

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  std::vector<float> x_, y_, z_;
};

}  // namespace sinew::cutting
