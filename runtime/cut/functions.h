// SPDX-License-Identifier: MIT
//
// The function space of a part: a field of its parent's, restricted to it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "runtime/cut/parts.h"

namespace sinew::cutting {

/// Numbers of a field of a package, out of their lanes; after its own functions the slit's (Jumps), which
/// no set drives and whose values are not read here.
class ParentField {
 public:
  ParentField(const formats::PackageView& package, const formats::Field& field) : package_(package), field_(field) {
    added_.pin_set = formats::kNone;
  }

  const formats::Field& field() const { return field_; }
  Eigen::Index own() const { return Eigen::Index(field_.function_count); }
  Eigen::Index count() const { return own() + more_; }
  void add(Eigen::Index functions) { more_ = functions; }
  const formats::FieldFunction& function(Eigen::Index j) const {
    return j < own() ? package_.fieldFunctions()[field_.first_function + std::size_t(j)] : added_;
  }
  /// \param vertex of the package, of the field's piece.
  double valueAt(std::uint32_t vertex, Eigen::Index j) const;
  /// At a contact point; 0 of added ones. \param point of the field.
  Eigen::VectorXd valuesAt(std::uint32_t point) const;
  /// k x 3, at a sample; the same.
  Eigen::MatrixXd gradientsAt(std::uint32_t pack, std::size_t lane) const;

 private:
  const formats::PackageView& package_;
  const formats::Field& field_;
  formats::FieldFunction added_ = {};
  Eigen::Index more_ = 0;
};

/// Functions of a part: each is a sum of 1, X, Y, Z and of the parent's functions.
///
/// Every affine motion of what is not held is in them exactly, and so is the parent's place and motion. Driven ones are
/// the parent's, of pin sets that the part has; the others are orthonormal under the part's masses and 0 where it is
/// held.
struct PartFunctions {
  Eigen::Index driven = 0;       ///< the first ones
  Eigen::Index affine = 0;       ///< of the others, the first ones until turn()
  Eigen::MatrixXd of_monomials;  ///< k x 4: by 1, (X - center) / size
  Eigen::MatrixXd of_parent;     ///< k x those of the parent
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  double size = 1;                             ///< m
  Eigen::VectorXd one;                         ///< of 1
  Eigen::MatrixXd rest;                        ///< k x 3: of X, Y, Z
  std::vector<formats::FieldFunction> driver;  ///< of driven ones, pin sets of the part

  Eigen::Index count() const { return of_parent.rows(); }
  Eigen::Index free() const { return count() - driven; }
  /// At places, k x 3 for each. \param of_parent_here the parent's, the same.
  Eigen::MatrixXd gradientsFrom(const Eigen::MatrixXd& of_parent_here) const;
  /// At places, m: places x k. \param of_parent_here the parent's, places x its functions.
  Eigen::MatrixXd valuesFrom(const Eigen::MatrixX3d& at, const Eigen::MatrixXd& of_parent_here) const;
  /// Those that are not driven become sums of each other. \param by as many rows as there are, orthonormal columns.
  void turn(const Eigen::MatrixXd& by);
};

/// \param parent_values vertices of the part's piece x functions of the parent. \param rest_places m. \param masses kg.
/// \param pin_sets of the package to those of the part; kNone: the part has nothing of it.
PartFunctions restrictFunctions(const ParentField& parent, const Eigen::MatrixXd& parent_values,
                                const Eigen::MatrixX3d& rest_places, const Eigen::VectorXd& masses,
                                const std::vector<std::uint32_t>& pin_sets);

}  // namespace sinew::cutting
