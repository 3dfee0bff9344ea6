// SPDX-License-Identifier: MIT
#include "sinew/formats/identity.h"

#include <algorithm>

namespace sinew::formats {

std::optional<std::vector<std::uint32_t>> visualVerticesOf(const PackageView& package, VertexKind kind,
                                                           std::uint32_t number) {
  std::vector<std::uint32_t> found;
  const std::size_t visual_count = package.visualPositions().size();
  switch (kind) {
    case VertexKind::visual:
      if (number >= visual_count) return std::nullopt;
      found.push_back(number);
      return found;
    case VertexKind::source: {
      if (number >= package.sourceIdentity().size()) return std::nullopt;
      const SourceIdentity& source = package.sourceIdentity()[number];
      const auto list = package.sourceVisualList().subspan(source.first_visual, source.visual_count);
      found.assign(list.begin(), list.end());
      return found;
    }
    case VertexKind::welded:
      for (std::uint32_t v = 0; v < package.visualIdentity().size(); ++v) {
        if (package.visualIdentity()[v].welded == number) found.push_back(v);
      }
      if (found.empty()) return std::nullopt;
      return found;
    case VertexKind::physical:
      if (number >= package.physicalVertices().size()) return std::nullopt;
      for (std::uint32_t v = 0; v < package.barycentric().size(); ++v) {
        const auto& corners = package.tetrahedra()[package.barycentric()[v].tetrahedron].vertex;
        if (std::find(corners.begin(), corners.end(), number) != corners.end()) found.push_back(v);
      }
      return found;
  }
  return std::nullopt;
}

std::optional<SourcePlace> sourcePlace(const PackageView& package, std::uint32_t source_vertex) {
  for (const SourceMesh& mesh : package.sourceMeshes()) {
    const std::uint32_t vertex = source_vertex - mesh.first_source_vertex;
    if (source_vertex >= mesh.first_source_vertex && vertex < mesh.source_vertex_count) {
      return SourcePlace{package.text(mesh.name), vertex};
    }
  }
  return std::nullopt;
}

std::optional<TetrahedronHold> tetrahedronOf(const PackageView& package, std::uint32_t visual_vertex) {
  if (visual_vertex >= package.barycentric().size()) return std::nullopt;
  const BarycentricAttachment& attachment = package.barycentric()[visual_vertex];
  const auto& w = attachment.weight;
  return TetrahedronHold{attachment.tetrahedron,
                         package.tetrahedra()[attachment.tetrahedron].vertex,
                         {w[0], w[1], w[2], 1 - w[0] - w[1] - w[2]}};
}

float maskWeight(const PackageView& package, std::uint32_t mask, std::uint32_t visual_vertex) {
  const Mask& entry = package.masks()[mask];
  const auto weights = package.maskWeights().subspan(entry.first, entry.count);
  const auto at = std::lower_bound(weights.begin(), weights.end(), visual_vertex,
                                   [](const MaskWeight& w, std::uint32_t v) { return w.vertex < v; });
  return at != weights.end() && at->vertex == visual_vertex ? at->weight : 0;
}

}  // namespace sinew::formats
