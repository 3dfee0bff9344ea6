// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sinew/formats/writer.h"

namespace sinew::tools {

/// Deforming part of a piece. Vertices that carry rigid accessories, behind the others, follow this host: they are no
/// unknowns of its elasticity.
class FieldHost {
 public:
  /// \param content stays; sections of fields may be added to it.
  FieldHost(const formats::PackageContent& content, std::uint32_t piece);

  /// The number among `positions` of a vertex of the package; kNone where it rides along or is of another piece.
  std::uint32_t numberOf(std::uint32_t vertex) const;
  /// Whether a cluster of the package is that of a rigid accessory.
  bool rides(std::uint32_t cluster) const;
  /// Shares of a cluster of the package at the host's vertices.
  std::vector<double> sharesOf(std::uint32_t cluster) const;
  /// From the first corner of a tetrahedron to the others, a column each.
  Eigen::Matrix3d edgesOf(std::size_t tetrahedron) const;
  double volumeOf(std::size_t tetrahedron) const;
  /// Values at all vertices of the piece, a row each. A rider's are those of the affine motion that comes nearest to
  /// the cluster's members on the host, and a little to all of the host: thin members do not tell how it tilts.
  Eigen::MatrixXd valuesAtAll(const Eigen::MatrixXd& of_host) const;

  const std::uint32_t piece;
  const formats::PieceRange range;
  std::vector<std::uint32_t> vertices;     ///< of the package
  std::vector<Eigen::Vector3d> positions;  ///< at rest, m
  std::vector<double> masses;              ///< kg
  std::vector<std::array<std::uint32_t, 4>> tetrahedra;

 private:
  Eigen::Vector3d restOf(std::uint32_t vertex) const;
  void findRiders();

  const formats::PackageContent& content_;
  std::vector<std::uint32_t> number_;  // of each vertex of the piece
  std::vector<std::uint32_t> riders_;  // clusters of rigid accessories
};

}  // namespace sinew::tools
