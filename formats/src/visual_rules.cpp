// SPDX-License-Identifier: MIT
#include "value_rules.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "value_tests.h"

namespace sinew::formats {
namespace {

// Of a vertex that hangs outside its tetrahedron: floats round such a place by a sixteenth of an edge.
constexpr float kMostWeight = 1e6F;
// Of a unit vector's coordinate, rounded.
constexpr float kMostNormal = 1.001F;

class VisualRules {
 public:
  VisualRules(const PackageView& view, const Reach& reach, Refusal& refuse)
      : view_(view), reach_(reach), refuse_(refuse) {}

  bool hold() {
    return checkParts() && checkMesh() && checkMaterials() && checkAttachments() && checkIdentity() && checkGroups() &&
           checkMasks();
  }

 private:
  bool checkParts() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.parts().size(); ++i) {
      const AttachedPart& part = view_.parts()[i];
      if ((part.cluster != kNone && part.cluster >= view_.clusters().size()) || part.reserved0 != 0) {
        return refuse_(section::parts, i, "its cluster is not in section CLUS, or a reserved field is not 0");
      }
      if (!checkRun(refuse_, section::parts, i, part.first, part.count, view_.partVertices(),
                    view_.visualPositions().size(), end)) {
        return false;
      }
    }
    return end == view_.partVertices().size() || refuse_(section::part_vertices, "has vertices of no part");
  }

  bool checkMesh() {
    for (const std::uint32_t id :
         {section::visual_normals, section::visual_uv, section::visual_colors, section::barycentric,
          section::cluster_attachment_ranges, section::visual_identity}) {
      const std::size_t count = view_.sectionData(id).count;
      if (count != 0 && count != view_.visualPositions().size()) {
        return refuse_.section(id, "%zu elements for %zu visual vertices", count, view_.visualPositions().size());
      }
    }
    const Reach reach = reach_;
    if (!check(refuse_, section::visual_positions, view_.visualPositions(),
               "more than a diagonal outside the bounds of section INFO",
               [reach](const Float3& v) { return reach.beyond(v); }) ||
        !check(refuse_, section::visual_normals, view_.visualNormals(), "a coordinate is outside -1 to 1",
               [](const Float3& v) { return beyond(v, kMostNormal); }) ||
        !check(refuse_, section::visual_uv, view_.visualUvs(), "not finite or beyond 1e9",
               [](const Float2& v) { return beyond(v, kMostTexture); })) {
      return false;
    }
    const std::size_t vertices = view_.visualPositions().size();
    if (!check(refuse_, section::visual_triangles, view_.visualTriangles(), "a corner is not a visual vertex",
               [vertices](const Triangle& t) {
                 return unsigned(t[0] >= vertices) | unsigned(t[1] >= vertices) | unsigned(t[2] >= vertices);
               })) {
      return false;
    }
    std::uint64_t triangle = 0;
    for (std::size_t i = 0; i < view_.subMeshes().size(); ++i) {
      const SubMesh& sub_mesh = view_.subMeshes()[i];
      if (sub_mesh.first_triangle != triangle) {
        return refuse_(section::sub_meshes, i, "does not start where the sub-mesh before it ends");
      }
      triangle += sub_mesh.triangle_count;
      if (sub_mesh.material != kNone && sub_mesh.material >= view_.materials().size()) {
        return refuse_(section::sub_meshes, i, "its material is not in section VMAT");
      }
      if (sub_mesh.reserved0 != 0) return refuse_(section::sub_meshes, i, "a reserved field is not 0");
    }
    if (!view_.subMeshes().empty() && triangle != view_.visualTriangles().size()) {
      return refuse_(section::sub_meshes, "the sub-meshes do not cover exactly the triangles");
    }
    return true;
  }

  bool checkMaterials() {
    const std::size_t textures = view_.textures().size();
    if (!check(refuse_, section::materials, view_.materials(),
               "base_color outside 0 to 1, no such texture, or unknown flag", [textures](const Material& m) {
                 unsigned bad = unsigned(m.texture != kNone) & unsigned(m.texture >= textures);
                 for (const float channel : m.base_color) bad |= outsideUnit(channel);
                 return bad | unsigned((m.flags & ~std::uint32_t{kMaterialDoubleSided}) != 0);
               })) {
      return false;
    }
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < textures; ++i) {
      const Texture& texture = view_.textures()[i];
      if (texture.offset != end) {
        return refuse_(section::textures, i, "its bytes do not start where those of the texture before end");
      }
      if (texture.bytes > view_.textureBytes().size() - end) {
        return refuse_(section::textures, i, "its bytes reach beyond section TEXB");
      }
      end += texture.bytes;
    }
    return end == view_.textureBytes().size() || refuse_(section::texture_bytes, "has bytes of no texture");
  }

  bool checkAttachments() {
    const std::size_t tetrahedra = view_.tetrahedra().size(), clusters = view_.clusters().size();
    if (!check(refuse_, section::barycentric, view_.barycentric(),
               "no such tetrahedron, or a weight not finite or beyond 1e6",
               [tetrahedra](const BarycentricAttachment& a) {
                 return unsigned(a.tetrahedron >= tetrahedra) | beyond(a.weight, kMostWeight);
               }) ||
        !check(refuse_, section::cluster_attachments, view_.clusterAttachments(),
               "no such cluster, or weight outside 0 to 1", [clusters](const ClusterAttachment& a) {
                 return unsigned(a.cluster >= clusters) | outsideUnit(a.weight);
               })) {
      return false;
    }
    for (std::size_t i = 0; i < view_.barycentric().size(); ++i) {
      if (hangsBeyond(view_.barycentric()[i])) {
        return refuse_(section::barycentric, i,
                       "hangs more than a diagonal outside the bounds of section INFO at rest");
      }
    }
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.clusterAttachmentRanges().size(); ++i) {
      const ClusterAttachmentRange& range = view_.clusterAttachmentRanges()[i];
      if (range.first != end || range.count == 0 || range.count > view_.clusterAttachments().size() - end) {
        return refuse_(section::cluster_attachment_ranges, i,
                       "empty, does not start where the run before ends, or reaches beyond section ATCW");
      }
      double sum = 0;
      for (const ClusterAttachment& a : view_.clusterAttachments().subspan(range.first, range.count)) {
        sum += static_cast<double>(a.weight);
      }
      if (!(std::abs(sum - 1.0) <= kSumTolerance)) {
        return refuse_(section::cluster_attachment_ranges, i, "the weights of its run in ATCW do not sum to 1");
      }
      end += range.count;
    }
    return end == view_.clusterAttachments().size() ||
           refuse_(section::cluster_attachments, "has weights of no visual vertex");
  }

  /// \pre its tetrahedron, and that one's vertices, are there
  bool hangsBeyond(const BarycentricAttachment& attachment) const {
    const auto& corners = view_.tetrahedra()[attachment.tetrahedron].vertex;
    const auto at = [&](std::size_t k) -> const Float3& { return view_.physicalVertices()[corners[k]].rest_position; };
    unsigned beyond = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double x = double(at(3)[axis]);
      for (std::size_t k = 0; k < 3; ++k)
        x += double(attachment.weight[k]) * (double(at(k)[axis]) - double(at(3)[axis]));
      beyond |= reach_.beyond(float(x), axis);
    }
    return beyond != 0;
  }

  bool checkIdentity() {
    const std::size_t vertices = view_.visualIdentity().size(), sources = view_.sourceIdentity().size();
    if (view_.sourceVisualList().size() != vertices) {
      return refuse_(section::source_visual_list, "does not have one element for each visual vertex");
    }
    if (!check(refuse_, section::visual_identity, view_.visualIdentity(), "no such source vertex or welded point",
               [=](const VisualIdentity& v) {
                 return unsigned(v.source_vertex >= sources) | unsigned(v.welded >= vertices);
               }) ||
        !check(refuse_, section::source_visual_list, view_.sourceVisualList(), "no such visual vertex",
               [vertices](std::uint32_t v) { return unsigned(v >= vertices); })) {
      return false;
    }
    // Runs that tile a list of as many elements as there are visual vertices, each run ascending and holding only
    // vertices that name this source vertex: so every visual vertex occurs exactly once.
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < sources; ++i) {
      const SourceIdentity& source = view_.sourceIdentity()[i];
      const auto bad = [&](const char* what) { return refuse_(section::source_identity, i, what); };
      if (source.first_visual != end) return bad("its run of SVLS does not start where the run before ends");
      if (source.visual_count > vertices - end) return bad("its run reaches beyond section SVLS");
      if (source.visual_count == 0) {
        if (source.welded != kNone) return bad("names a welded point, but became no visual vertex");
        continue;
      }
      for (std::uint64_t k = end; k < end + source.visual_count; ++k) {
        const std::uint32_t v = view_.sourceVisualList()[k];
        if (view_.visualIdentity()[v].source_vertex != i || (k > end && v <= view_.sourceVisualList()[k - 1])) {
          return bad("its run of SVLS is not ascending, or holds a visual vertex of another source vertex");
        }
        if (view_.visualIdentity()[v].welded != source.welded) {
          return bad("its welded point is not that of its visual vertices");
        }
      }
      end += source.visual_count;
    }
    if (end != vertices) return refuse_(section::source_visual_list, "has visual vertices of no source vertex");

    std::uint64_t source_vertex = 0;
    for (std::size_t i = 0; i < view_.sourceMeshes().size(); ++i) {
      const SourceMesh& mesh = view_.sourceMeshes()[i];
      if (mesh.first_source_vertex != source_vertex) {
        return refuse_(section::source_meshes, i, "does not start where the mesh before it ends");
      }
      source_vertex += mesh.source_vertex_count;
    }
    return source_vertex == sources || refuse_(section::source_meshes, "the meshes do not cover the source vertices");
  }

  bool checkGroups() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.groups().size(); ++i) {
      const Group& group = view_.groups()[i];
      if (!checkRun(refuse_, section::groups, i, group.first, group.count, view_.groupVertices(),
                    view_.visualPositions().size(), end)) {
        return false;
      }
    }
    return end == view_.groupVertices().size() || refuse_(section::group_vertices, "has vertices of no group");
  }

  bool checkMasks() {
    const std::span<const MaskWeight> weights = view_.maskWeights();
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.masks().size(); ++i) {
      const Mask& mask = view_.masks()[i];
      if (mask.first != end || mask.count > weights.size() - end) {
        return refuse_(section::masks, i, "does not start where the mask before ends, or reaches beyond section MSKV");
      }
      std::uint64_t lowest = 0;
      for (const MaskWeight& w : weights.subspan(mask.first, mask.count)) {
        if (w.vertex < lowest || w.vertex >= view_.visualPositions().size() || !(w.weight > 0) || !(w.weight <= 1)) {
          return refuse_(section::masks, i, "its vertices are not ascending visual vertices of weight 0 to 1");
        }
        lowest = std::uint64_t{w.vertex} + 1;
      }
      end += mask.count;
    }
    return end == weights.size() || refuse_(section::mask_weights, "has weights of no mask");
  }

  const PackageView& view_;
  const Reach& reach_;
  Refusal& refuse_;
};

}  // namespace

bool checkVisual(const PackageView& view, const Reach& reach, Refusal& refuse) {
  return VisualRules(view, reach, refuse).hold();
}

}  // namespace sinew::formats
