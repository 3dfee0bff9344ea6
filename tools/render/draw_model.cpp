// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/draw_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

namespace sinew::tools {

namespace {

constexpr int kMaxTextureSize = 4096;
const Eigen::Vector3f kPlainColor(0.56F, 0.53F, 0.49F);  // of a mesh without materials and colours: unfired clay
const Eigen::Vector3f kSolidColor(0.42F, 0.43F, 0.45F);  // linear, of colliders

Eigen::Vector3f toVector(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

// Area-weighted normals over vertices of equal position, for meshes that carry none.
std::vector<Eigen::Vector3f> smoothNormals(const std::vector<Eigen::Vector3f>& positions,
                                           const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::map<std::array<float, 3>, std::uint32_t> points;
  std::vector<std::uint32_t> point_of(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector3f& p = positions[i];
    point_of[i] = points.try_emplace({p.x(), p.y(), p.z()}, static_cast<std::uint32_t>(points.size())).first->second;
  }
  std::vector<Eigen::Vector3f> sums(points.size(), Eigen::Vector3f::Zero());
  for (const auto& t : triangles) {
    const Eigen::Vector3f n = (positions[t[1]] - positions[t[0]]).cross(positions[t[2]] - positions[t[0]]);
    for (const std::uint32_t v : t) sums[point_of[v]] += n;
  }
  std::vector<Eigen::Vector3f> normals(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i) normals[i] = sums[point_of[i]].stableNormalized();
  return normals;
}

void addEdges(const formats::PackageView& package, DrawModel& model) {
  using Edge = std::array<std::uint32_t, 2>;
  using Face = std::array<std::uint32_t, 3>;
  std::vector<Edge> edges;
  std::vector<Face> faces;
  constexpr std::array<std::array<std::size_t, 2>, 6> kEdges = {{{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};
  constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
  for (const formats::Tetrahedron& t : package.tetrahedra()) {
    std::array<std::uint32_t, 4> v = t.vertex;
    std::sort(v.begin(), v.end());
    for (const auto& e : kEdges) edges.push_back({v[e[0]], v[e[1]]});
    for (const auto& f : kFaces) faces.push_back({v[f[0]], v[f[1]], v[f[2]]});
  }
  std::sort(faces.begin(), faces.end());
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i;
    while (end < faces.size() && faces[end] == faces[i]) ++end;
    if (end == i + 1) {
      const Face& f = faces[i];
      model.surface_edges.push_back({f[0], f[1]});
      model.surface_edges.push_back({f[0], f[2]});
      model.surface_edges.push_back({f[1], f[2]});
    }
    i = end;
  }
  const auto makeUnique = [](std::vector<Edge>& list) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  };
  makeUnique(model.surface_edges);
  makeUnique(edges);
  std::set_difference(edges.begin(), edges.end(), model.surface_edges.begin(), model.surface_edges.end(),
                      std::back_inserter(model.inner_edges));
}

void addClusterTint(const formats::PackageView& package, DrawModel& model) {
  model.cluster_count = static_cast<std::uint32_t>(package.clusters().size());
  if (model.cluster_count == 0) return;
  // Per physical vertex, the blend over its clusters by share cubed: plain shares of many overlapping clusters are
  // grey.
  std::vector<Eigen::Vector3f> physical(package.physicalVertices().size(), Eigen::Vector3f::Zero());
  std::vector<float> sums(physical.size(), 0);
  for (std::uint32_t c = 0; c < model.cluster_count; ++c) {
    const formats::Cluster& cluster = package.clusters()[c];
    const Eigen::Vector3f color = toVector(distinctColor(c));
    for (const formats::Membership& m : package.memberships().subspan(cluster.first_member, cluster.member_count)) {
      const float weight = m.share * m.share * m.share;
      physical[m.vertex] += weight * color;
      sums[m.vertex] += weight;
    }
  }
  for (std::size_t i = 0; i < physical.size(); ++i) {
    if (sums[i] > 0) physical[i] /= sums[i];
  }
  const std::size_t count = model.positions.size();
  model.cluster_tint.assign(count, {0.5F, 0.5F, 0.5F});
  const auto store = [&](std::size_t i, const Eigen::Vector3f& color) {
    for (int k = 0; k < 3; ++k) model.cluster_tint[i][static_cast<std::size_t>(k)] = std::clamp(color[k], 0.0F, 1.0F);
  };
  if (!package.barycentric().empty()) {
    for (std::size_t i = 0; i < count; ++i) {
      const formats::BarycentricAttachment& a = package.barycentric()[i];
      const auto& v = package.tetrahedra()[a.tetrahedron].vertex;
      // Weights outside 0..1 would leave the gamut: nearest point of the tetrahedron instead.
      std::array<float, 4> w = {a.weight[0], a.weight[1], a.weight[2], 1 - a.weight[0] - a.weight[1] - a.weight[2]};
      float sum = 0;
      for (float& x : w) sum += (x = std::max(x, 0.0F));
      Eigen::Vector3f color = Eigen::Vector3f::Zero();
      for (std::size_t k = 0; k < 4; ++k) color += w[k] / std::max(sum, 1e-6F) * physical[v[k]];
      store(i, color);
    }
  } else if (!package.clusterAttachmentRanges().empty()) {
    for (std::size_t i = 0; i < count; ++i) {
      const formats::ClusterAttachmentRange& range = package.clusterAttachmentRanges()[i];
      Eigen::Vector3f color = Eigen::Vector3f::Zero();
      for (const formats::ClusterAttachment& a : package.clusterAttachments().subspan(range.first, range.count)) {
        color += a.weight * toVector(distinctColor(a.cluster));
      }
      store(i, color);
    }
  }
}

// Without sub-meshes, or where they leave triangles out, the rest is drawn plainly: nothing is invisible.
void coverAllTriangles(DrawModel& model) {
  const auto plain = [&](std::uint32_t first, std::uint32_t end) {
    if (first >= end) return;
    DrawPart part;
    part.first_triangle = first;
    part.triangle_count = end - first;
    part.vertex_colors = !model.colors.empty();
    if (!part.vertex_colors) part.base_color = kPlainColor;
    model.parts.push_back(part);
  };
  std::vector<DrawPart> ordered = model.parts;
  std::sort(ordered.begin(), ordered.end(),
            [](const DrawPart& a, const DrawPart& b) { return a.first_triangle < b.first_triangle; });
  std::uint32_t at = 0;
  for (const DrawPart& part : ordered) {
    plain(at, part.first_triangle);
    at = std::max(at, part.first_triangle + part.triangle_count);
  }
  plain(at, static_cast<std::uint32_t>(model.triangles.size()));
}

bool anyColor(const std::vector<std::array<float, 4>>& colors,
              const std::vector<std::array<std::uint32_t, 3>>& triangles, const DrawPart& part) {
  if (colors.empty()) return false;
  for (std::uint32_t t = part.first_triangle; t < part.first_triangle + part.triangle_count; ++t) {
    for (const std::uint32_t v : triangles[t]) {
      const auto& c = colors[v];
      if (c[0] > 0 || c[1] > 0 || c[2] > 0) return true;
    }
  }
  return false;  // all black: a sub-mesh without colours beside one that has them
}

void finishPart(DrawModel& model, DrawPart& part, bool has_material, const std::array<float, 4>& base_color,
                std::uint32_t texture) {
  const bool textured = texture < model.textures.size() && model.textures[texture].width > 0 && !model.uvs.empty();
  part.base_color =
      has_material ? Eigen::Vector3f(base_color[0], base_color[1], base_color[2]) : Eigen::Vector3f::Ones();
  if (textured) {
    part.texture = texture;
  } else if (anyColor(model.colors, model.triangles, part)) {
    part.vertex_colors = true;  // as in glTF, colours multiply the material's base colour
  } else if (!has_material) {
    part.base_color = kPlainColor;
  }
}

}  // namespace

std::array<float, 3> distinctColor(std::uint32_t number) {
  // Equal lightness and chroma in OKLCH (Ottosson 2020), hues a golden angle apart, with a second and third ring of
  // lightness.
  constexpr std::array<float, 3> kLightness = {0.72F, 0.60F, 0.83F};
  const float lightness = kLightness[(number / 7) % 3];
  const float chroma = 0.15F;
  const float hue = 0.35F + static_cast<float>(number) * 2.39996323F;
  const float a = chroma * std::cos(hue);
  const float b = chroma * std::sin(hue);
  const auto cube = [](float x) { return x * x * x; };
  const float l = cube(lightness + 0.3963377774F * a + 0.2158037573F * b);
  const float m = cube(lightness - 0.1055613458F * a - 0.0638541728F * b);
  const float s = cube(lightness - 0.0894841775F * a - 1.2914855480F * b);
  const auto clamp = [](float x) { return std::clamp(x, 0.0F, 1.0F); };
  return {clamp(4.0767416621F * l - 3.3077115913F * m + 0.2309699292F * s),
          clamp(-1.2684380046F * l + 2.6097574011F * m - 0.3413193965F * s),
          clamp(-0.0041960863F * l - 0.7034186147F * m + 1.7076147010F * s)};
}

DrawModel makeDrawModel(const formats::PackageView& package) {
  DrawModel model;
  model.name = std::string(package.text(package.info().name));
  model.diagonal = package.info().diagonal;
  for (const auto& p : package.visualPositions()) model.positions.push_back(toVector(p));
  for (const auto& n : package.visualNormals()) model.normals.push_back(toVector(n));
  for (const auto& uv : package.visualUvs()) model.uvs.emplace_back(uv[0], uv[1]);
  for (const auto& c : package.visualColors()) {
    model.colors.push_back({static_cast<float>(c[0]) / 255, static_cast<float>(c[1]) / 255,
                            static_cast<float>(c[2]) / 255, static_cast<float>(c[3]) / 255});
  }
  model.triangles.assign(package.visualTriangles().begin(), package.visualTriangles().end());
  if (model.normals.size() != model.positions.size()) model.normals = smoothNormals(model.positions, model.triangles);
  for (const formats::Texture& t : package.textures()) {
    model.textures.push_back(decodeTexture(package.textureBytes().subspan(t.offset, t.bytes), kMaxTextureSize));
  }
  for (const formats::SubMesh& s : package.subMeshes()) {
    DrawPart part;
    part.first_triangle = s.first_triangle;
    part.triangle_count = s.triangle_count;
    const bool has_material = s.material != formats::kNone;
    const formats::Material material = has_material ? package.materials()[s.material] : formats::Material{};
    finishPart(model, part, has_material, material.base_color, has_material ? material.texture : formats::kNone);
    model.parts.push_back(part);
  }
  coverAllTriangles(model);
  for (const formats::PhysicalVertex& v : package.physicalVertices())
    model.physical_positions.push_back(toVector(v.rest_position));
  addEdges(package, model);
  addClusterTint(package, model);
  return model;
}

DrawModel joinedModel(std::span<const formats::PackageView* const> packages, float diagonal) {
  DrawModel joined = makeDrawModel(*packages[0]);
  if (diagonal > 0) joined.diagonal = diagonal;
  DrawModel next = joined;
  std::uint32_t first_texture = 0;
  for (std::size_t i = 1; i < packages.size(); ++i) {
    if (packages[i] != packages[i - 1]) {
      next = makeDrawModel(*packages[i]);
      first_texture = static_cast<std::uint32_t>(joined.textures.size());
      joined.textures.insert(joined.textures.end(), next.textures.begin(), next.textures.end());
    }
    const auto vertices = static_cast<std::uint32_t>(joined.positions.size());
    const auto triangles = static_cast<std::uint32_t>(joined.triangles.size());
    const auto append = [](auto& to, const auto& from) { to.insert(to.end(), from.begin(), from.end()); };
    // A stream that one of them has is there for all.
    const auto appendStream = [&](auto& to, const auto& from, const auto& none) {
      if (to.empty() && from.empty()) return;
      to.resize(vertices, none);
      append(to, from);
      to.resize(vertices + next.positions.size(), none);
    };
    append(joined.positions, next.positions);
    append(joined.normals, next.normals);
    appendStream(joined.uvs, next.uvs, Eigen::Vector2f(0, 0));
    appendStream(joined.colors, next.colors, std::array<float, 4>{1, 1, 1, 1});
    appendStream(joined.cluster_tint, next.cluster_tint, std::array<float, 3>{0.5F, 0.5F, 0.5F});
    for (std::array<std::uint32_t, 3> t : next.triangles) {
      for (std::uint32_t& v : t) v += vertices;
      joined.triangles.push_back(t);
    }
    for (DrawPart part : next.parts) {
      part.first_triangle += triangles;
      if (part.texture != formats::kNone) part.texture += first_texture;
      joined.parts.push_back(part);
    }
  }
  return joined;
}

void addSolid(DrawModel& model, std::span<const std::array<std::uint32_t, 3>> triangles, std::size_t vertices,
              bool one_sided) {
  const auto first = static_cast<std::uint32_t>(model.positions.size());
  DrawPart part;
  part.first_triangle = static_cast<std::uint32_t>(model.triangles.size());
  part.triangle_count = static_cast<std::uint32_t>(triangles.size());
  part.base_color = kSolidColor;
  part.one_sided = one_sided;
  model.parts.push_back(part);
  for (const std::array<std::uint32_t, 3>& t : triangles) {
    model.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  const std::size_t count = model.positions.size() + vertices;
  model.positions.resize(count, Eigen::Vector3f::Zero());
  model.normals.resize(count, Eigen::Vector3f::UnitY());
  if (!model.uvs.empty()) model.uvs.resize(count, Eigen::Vector2f::Zero());
  if (!model.colors.empty()) model.colors.resize(count, {1, 1, 1, 1});
  if (!model.cluster_tint.empty()) model.cluster_tint.resize(count, {0.5F, 0.5F, 0.5F});
}

DrawModel makeDrawModel(const VisualMesh& mesh) {
  DrawModel model;
  model.name = mesh.file;
  model.diagonal = mesh.diagonal > 0 ? static_cast<float>(mesh.diagonal) : 1.0F;
  const Eigen::Vector3d center = (mesh.bounds_min + mesh.bounds_max) / 2;
  for (const Eigen::Vector3d& p : mesh.positions) model.positions.push_back((p - center).cast<float>());
  model.normals = mesh.normals;
  model.uvs = mesh.uvs;
  model.colors = mesh.colors;
  model.triangles = mesh.triangles;
  if (model.normals.size() != model.positions.size()) model.normals = smoothNormals(model.positions, model.triangles);
  for (const TextureSource& t : mesh.textures) model.textures.push_back(decodeTexture(t.bytes, kMaxTextureSize));
  for (const SubMeshSource& s : mesh.sub_meshes) {
    DrawPart part;
    part.first_triangle = s.first_triangle;
    part.triangle_count = s.triangle_count;
    const bool has_material = s.material != formats::kNone;
    const MaterialSource material = has_material ? mesh.materials[s.material] : MaterialSource{};
    finishPart(model, part, has_material, material.base_color, material.texture);
    model.parts.push_back(part);
  }
  coverAllTriangles(model);
  return model;
}

}  // namespace sinew::tools
