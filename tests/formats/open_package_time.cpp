// SPDX-License-Identifier: MIT
//
// Prints how long PackageView::open() takes on a package of about 10 MB (or argv[1] megabytes): many copies of the
// sample package as bodies of one package, without its picture.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "sinew/formats/package.h"
#include "sinew/formats/writer.h"
#include "tests/support/package_bytes.h"
#include "tests/support/sample_package.h"

namespace {

using namespace sinew;

template <class T, class Shift>
void repeat(std::vector<T>& items, std::size_t copies, Shift shift) {
  const std::vector<T> once = items;
  items.clear();
  items.reserve(once.size() * copies);
  for (std::uint32_t k = 0; k < copies; ++k) {
    for (T item : once) {
      shift(item, k);
      items.push_back(item);
    }
  }
}

formats::PackageContent many(std::size_t copies) {
  formats::PackageContent c = test::samplePackage();
  c.textures.clear();
  c.texture_bytes.clear();
  for (auto& m : c.materials) m.texture = formats::kNone;
  const auto n = [](const auto& items) { return std::uint32_t(items.size()); };
  const std::uint32_t vertices = n(c.physical_vertices), tets = n(c.tetrahedra), clusters = n(c.clusters);
  const std::uint32_t members = n(c.memberships), moments = n(c.quadratic_moments), visuals = n(c.visual_positions);
  const std::uint32_t triangles = n(c.visual_triangles), weights = n(c.cluster_attachments);
  const std::uint32_t sources = n(c.source_identity), grouped = n(c.group_vertices);
  const auto same = [](auto&, std::uint32_t) {};
  repeat(c.bodies, copies, [&](auto& b, std::uint32_t k) {
    b.first_vertex += k * vertices, b.first_tetrahedron += k * tets, b.first_cluster += k * clusters;
  });
  repeat(c.physical_vertices, copies, same);
  repeat(c.tetrahedra, copies, [&](auto& t, std::uint32_t k) {
    for (auto& v : t.vertex) v += k * vertices;
  });
  repeat(c.clusters, copies, [&](auto& cluster, std::uint32_t k) {
    cluster.body = k;
    cluster.first_member += k * members;
    if (cluster.quadratic != formats::kNone) cluster.quadratic += k * moments;
  });
  repeat(c.memberships, copies, [&](auto& m, std::uint32_t k) { m.vertex += k * vertices; });
  repeat(c.quadratic_moments, copies, same);
  repeat(c.visual_positions, copies, same);
  repeat(c.visual_normals, copies, same);
  repeat(c.visual_uvs, copies, same);
  repeat(c.visual_colors, copies, same);
  repeat(c.visual_triangles, copies, [&](auto& t, std::uint32_t k) {
    for (auto& v : t) v += k * visuals;
  });
  repeat(c.sub_meshes, copies, [&](auto& s, std::uint32_t k) { s.first_triangle += k * triangles; });
  repeat(c.barycentric, copies, [&](auto& a, std::uint32_t k) { a.tetrahedron += k * tets; });
  repeat(c.cluster_attachment_ranges, copies, [&](auto& r, std::uint32_t k) { r.first += k * weights; });
  repeat(c.cluster_attachments, copies, [&](auto& a, std::uint32_t k) { a.cluster += k * clusters; });
  repeat(c.visual_identity, copies,
         [&](auto& v, std::uint32_t k) { v.source_vertex += k * sources, v.welded += k * 5; });
  repeat(c.source_identity, copies, [&](auto& s, std::uint32_t k) {
    s.first_visual += k * visuals;
    if (s.welded != formats::kNone) s.welded += k * 5;
  });
  repeat(c.source_visual_list, copies, [&](auto& v, std::uint32_t k) { v += k * visuals; });
  repeat(c.source_meshes, copies, [&](auto& m, std::uint32_t k) { m.first_source_vertex += k * sources; });
  repeat(c.groups, copies, [&](auto& g, std::uint32_t k) { g.first += k * grouped; });
  repeat(c.group_vertices, copies, [&](auto& v, std::uint32_t k) { v += k * visuals; });
  return c;
}

}  // namespace

int main(int argc, char** argv) {
  const double megabytes = argc > 1 ? std::atof(argv[1]) : 10;
  const std::size_t once = formats::writePackage(many(1000)).size();
  const formats::PackageContent content = many(std::max<std::size_t>(1, std::size_t(megabytes * 1e9 / double(once))));
  const test::AlignedBytes bytes(formats::writePackage(content));
  std::vector<double> milliseconds;
  for (int k = 0; k < 51; ++k) {
    formats::PackageView view;
    const auto start = std::chrono::steady_clock::now();
    const std::string reason = formats::PackageView::open(bytes.span(), view).reason;
    milliseconds.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    if (!reason.empty()) {
      std::fprintf(stderr, "open_package_time: %s\n", reason.c_str());
      return 1;
    }
  }
  std::sort(milliseconds.begin(), milliseconds.end());
  std::printf("%.2f MB: median %.3f ms, fastest %.3f ms, slowest %.3f ms\n", double(bytes.span().size()) / 1e6,
              milliseconds[25], milliseconds.front(), milliseconds.back());
  return 0;
}
