// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sinew/formats/package.h"

namespace sinew::tools {

/// How a package's drawn surface gives way to small constant loads, by the modes of its fields (held ones where it has
/// pins): the same question for packages of the same source, whatever their tetrahedra and functions.
class Answers {
 public:
  /// Loads are chosen by the package: on places spread over its surface, along three axes; its weight where it is held;
  /// its channels, fully drawn. \pre it has fields, and its surface hangs on tetrahedra
  explicit Answers(const formats::PackageView& package);

  /// Error of another package's answers, of this one's rms displacement, by area: rms over the places, rms over the
  /// channels or the largest of the weights, whichever is most; infinite where the surface is another.
  double errorOf(const formats::PackageView& other) const;

 private:
  struct Place {
    std::uint32_t piece;
    std::vector<std::pair<std::uint32_t, double>> vertices;  // and their part of the load
  };
  Eigen::MatrixXd answersOf(const formats::PackageView& package) const;
  void takeRigidAway(Eigen::MatrixXd& answers) const;

  std::vector<Eigen::Vector3d> surface_;
  std::vector<double> areas_;
  std::vector<std::vector<std::uint32_t>> free_;  // visual vertices of each piece that nothing holds
  std::vector<Place> places_;
  bool held_ = false;
  std::uint32_t channels_ = 0;
  Eigen::MatrixXd answers_;  // 3 v x loads
};

}  // namespace sinew::tools
