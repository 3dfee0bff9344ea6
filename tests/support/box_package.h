// SPDX-License-Identifier: MIT
//
// Small packages for the runtime's tests, made without the tools: a box of cells, five tetrahedra each, in a grid of
// overlapping clusters. Constants are computed here in double, independently of the bake and of the runtime.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "sinew/formats/writer.h"
#include "sinew/runtime/asset.h"

namespace sinew::test {

struct BoxOptions {
  std::array<std::uint32_t, 3> cells = {4, 4, 4};
  std::array<double, 3> size = {1, 1, 1};    ///< metres
  std::array<double, 3> center = {0, 0, 0};  ///< metres
  std::array<std::uint32_t, 3> clusters = {1, 1, 1};
  double overlap = 0.5;  ///< of a cluster's own size, on each side
  formats::ClusterMode mode = formats::ClusterMode::linear;
  double density = 1000;  ///< kg/m^3
  float alpha = 1, stretch_hz = 5, bend_hz = 3, twist_hz = 3;
  bool cluster_attachment = false;  ///< attach visual vertices to clusters instead of tetrahedra
  /// Keeps the cell if true; all cells without it. Cell indices.
  std::function<bool(std::uint32_t, std::uint32_t, std::uint32_t)> keep;
};

/// The content of a box package; several are joined by appendBody().
formats::PackageContent boxContent(const BoxOptions& options = {});

/// Adds another content's body to a package as a further BODY part.
void appendBody(formats::PackageContent& content, const formats::PackageContent& other);

/// Recomputes all constants of clusters (centre, radius, mass, moments, shares) from vertices, masses and `weights`,
/// one per membership: how tests make odd clusters.
void computeClusterConstants(formats::PackageContent& content, const std::vector<double>& weights);

/// An asset of the content, with fields (addFields()) where it has none; fails the test where the package is refused.
std::shared_ptr<const Asset> makeAsset(formats::PackageContent content);
/// The same of the content as it is.
std::shared_ptr<const Asset> makePlainAsset(const formats::PackageContent& content);
std::shared_ptr<const Asset> boxAsset(const BoxOptions& options = {});

}  // namespace sinew::test
