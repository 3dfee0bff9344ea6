// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "sinew/formats/sections.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"
#include "tools/tetrahedralize/tetrahedralize.h"

namespace sinew::tools {

enum class AttachmentMethod { barycentric, clusters };

struct AttachmentOptions {
  AttachmentMethod method = AttachmentMethod::barycentric;
};

/// Farther than this from its place at rest no visual vertex is attached, but for what floats round; of the diagonal.
inline constexpr double kMostRestError = 1e-6;

/// Floats' rounding of a place that hangs on a tetrahedron's corners by weights (thin ones hold it by large weights):
/// 2^-24 each of a weight, a difference, a product and a sum.
/// \param reach sum of |weight| |corner - last corner|, metres.
constexpr double roundedReach(double reach) { return 4 * 0x1p-24 * reach; }

/// Where a visual vertex is, in the float arithmetic of the runtime, and what those floats may round of it.
struct HungPlace {
  std::array<float, 3> place = {};
  double rounded = 0;  ///< metres
};

/// On its tetrahedron: last + Σ w_k (corner_k - last). \param at at(physical vertex) is where that is, three floats.
template <class At>
HungPlace hungOn(const formats::BarycentricAttachment& attachment, const formats::Tetrahedron& tetrahedron,
                 const At& at) {
  HungPlace hung;
  hung.place = at(tetrahedron.vertex[3]);
  for (std::size_t c = 0; c < 3; ++c) {
    const float last = hung.place[c];
    for (std::size_t k = 0; k < 3; ++k) {
      const float part = attachment.weight[k] * (at(tetrahedron.vertex[k])[c] - last);
      hung.place[c] += part;
      hung.rounded += roundedReach(std::abs(double(part)));
    }
  }
  return hung;
}

/// On clusters at rest, Σ w (q r + c): their transforms are identities, which take q back to where it came from.
HungPlace hungAtRest(std::span<const formats::ClusterAttachment> uses, std::span<const formats::Cluster> clusters,
                     const std::array<float, 3>& place);

/// Where a visual vertex hangs on the tetrahedra. Vertices welded into one point share one place, so seams cannot open.
struct TetrahedronPlace {
  std::uint32_t tetrahedron = formats::kNone;
  std::array<double, 4> weights = {0, 0, 0, 0};  ///< barycentric, sum 1; outside 0..1 where extrapolated
  double distance = 0;                           ///< metres outside the tetrahedron, 0 inside
};

/// A point's place on a given tetrahedron, wherever it lies.
TetrahedronPlace placeIn(std::uint32_t tetrahedron, const Eigen::Vector3d& point, const PhysicalMesh& physical);

/// Finds for each visual vertex the tetrahedron of its piece that holds it, or else the nearest one. A vertex never
/// hangs on the far side of a gap that its own surface leads round: of tetrahedra that lie over one another it takes
/// its own (PhysicalMesh::home), and the nearest one counts only beside the place where its surface next enters the
/// tetrahedra.
std::vector<TetrahedronPlace> placeVisualVertices(const VisualMesh& mesh, const Topology& topology,
                                                  const PhysicalMesh& physical);

}  // namespace sinew::tools
