// SPDX-License-Identifier: MIT
#include "runtime/cut/content.h"

#include <Eigen/Dense>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <unordered_map>

#include "runtime/cut/clusters.h"
#include "runtime/cut/distances.h"
#include "runtime/cut/fields.h"

namespace sinew::cutting {
namespace {

using formats::kNone;

constexpr const char* kSectionName = "section";
constexpr const char* kSourceName = "cut";

class Maker {
 public:
  Maker(const Cut& cut, std::uint32_t part)
      : cut_(cut),
        package_(cut.package),
        mesh_(cut.partition.parts[part]),
        part_(part),
        visual_count_(std::uint32_t(cut.package.visualPositions().size())),
        out_(result_.content) {
    takeTexts();
    addPhysical();
    clusters_ = addClusters(cut, mesh_, pieces_, local_, out_);
    addPinSets();
    addVisual();
    addSubMeshes();
    addIdentity();
    addLists();
    addInfo();
    const auto start = std::chrono::steady_clock::now();
    addFields();
    result_.fields_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    addDistances(cut_, part_, pieces_, out_);
  }

  PartContent take() { return std::move(result_); }

 private:
  /// All of the package's: references stay as they are.
  void takeTexts() {
    const formats::SectionData strings = package_.sectionData(formats::section::strings);
    const char* const text = static_cast<const char*>(strings.data);
    if (strings.count > 0) out_.strings.assign(text, text + strings.count);
  }

  void addPhysical() {
    local_.assign(package_.physicalVertices().size(), kNone);
    for (std::uint32_t i = 0; i < mesh_.vertices.size(); ++i) {
      const std::uint32_t v = mesh_.vertices[i];
      if (local_[v] == kNone || mesh_.own[i] != 0) local_[v] = i;
      out_.physical_vertices.push_back({package_.physicalVertices()[v].rest_position, mesh_.masses[i]});
      if (!package_.vertexStiffness().empty()) out_.vertex_stiffness.push_back(package_.vertexStiffness()[v]);
      if (!package_.pinWeights().empty()) out_.pin_weights.push_back(package_.pinWeights()[v]);
    }
    for (auto& list : local_tetrahedron_) list.assign(package_.tetrahedra().size(), kNone);
    for (std::uint32_t i = 0; i < mesh_.tetrahedra.size(); ++i) {
      const std::uint32_t t = mesh_.tetrahedra[i].source;
      for (const Side side : kSides) {
        if (mesh_.tetrahedra[i].side != -side) local_tetrahedron_[placeOf(side)][t] = i;
      }
      formats::Tetrahedron made = package_.tetrahedra()[t];
      std::copy(mesh_.tetrahedra[i].corner.begin(), mesh_.tetrahedra[i].corner.end(), std::begin(made.vertex));
      out_.tetrahedra.push_back(made);
    }
    std::uint32_t vertex = 0, tetrahedron = 0;
    for (std::uint32_t b = 0; b < package_.pieces().size(); ++b) {
      const formats::PieceRange& range = package_.pieces()[b];
      PartPiece piece;
      piece.source = b;
      piece.first = vertex;
      piece.first_tetrahedron = tetrahedron;
      while (vertex < mesh_.vertices.size() && mesh_.vertices[vertex] < range.first_vertex + range.vertex_count)
        ++vertex;
      while (tetrahedron < mesh_.tetrahedra.size() &&
             mesh_.tetrahedra[tetrahedron].source < range.first_tetrahedron + range.tetrahedron_count) {
        ++tetrahedron;
      }
      piece.count = vertex - piece.first;
      piece.tetrahedron_count = tetrahedron - piece.first_tetrahedron;
      if (piece.count == 0) continue;
      piece.piece = std::uint32_t(pieces_.size());
      pieces_.push_back(piece);
    }
  }

  Vector3d restOf(std::uint32_t local) const { return asVector(out_.physical_vertices[local].rest_position); }
  double totalMass() const {
    double sum = 0;
    for (const float m : mesh_.masses) sum += double(m);
    return sum;
  }

  /// Those that have vertices on the part's side.
  void addPinSets() {
    pin_sets_.assign(package_.pinSets().size(), kNone);
    for (std::uint32_t s = 0; s < package_.pinSets().size(); ++s) {
      formats::PinSet set = package_.pinSets()[s];
      const auto vertices = package_.pinSetVertices().subspan(set.first, set.count);
      set.first = std::uint32_t(out_.pin_set_vertices.size());
      for (const std::uint32_t v : vertices) {
        if (local_[v] != kNone && mesh_.own[local_[v]] != 0) out_.pin_set_vertices.push_back(local_[v]);
      }
      set.count = std::uint32_t(out_.pin_set_vertices.size()) - set.first;
      if (set.count == 0) continue;
      pin_sets_[s] = std::uint32_t(out_.pin_sets.size());
      out_.pin_sets.push_back(set);
    }
  }

  void addVisual() {
    // Kept vertices in their order, then new ones, then the section's.
    place_.assign(std::size_t(visual_count_) + 2 * cut_.surface.vertices.size(), kNone);
    for (const std::uint32_t f : mesh_.fragments) {
      const Fragment& fragment = cut_.surface.fragments[f];
      for (const std::uint32_t corner : fragment.corner) place_[numberOf(corner, fragment.side)] = 0;
    }
    // Vertices of no triangle stay where what they hang on is.
    if (!used_.empty()) used_.clear();
    used_.assign(visual_count_, 0);
    for (const formats::Triangle& t : package_.visualTriangles()) {
      for (const std::uint32_t v : t) used_[v] = 1;
    }
    for (std::uint32_t v = 0; v < visual_count_; ++v) {
      if (used_[v] != 0) continue;
      const auto& corners = package_.tetrahedra()[package_.barycentric()[v].tetrahedron].vertex;
      const Side side = cut_.sides.visual_side[v] == 0 ? Side(-1) : cut_.sides.visual_side[v];
      const std::uint32_t t = localOf(package_.barycentric()[v].tetrahedron, side);
      if (t != kNone && (isSlit() || side == mesh_.side || local_[corners[0]] == kNone)) place_[v] = 0;
    }
    for (std::uint32_t v = 0; v < place_.size(); ++v) {
      if (place_[v] == kNone) continue;
      place_[v] = std::uint32_t(out_.visual_positions.size());
      if (v < visual_count_) {
        keepVertex(v);
      } else {
        const std::uint32_t made = v - visual_count_;
        addVertex(cut_.surface.vertices[made / 2], made % 2 == 0 ? Side(-1) : Side(1));
      }
    }
    // Triangles by sub-mesh, those of the section into the last.
    for (const std::uint32_t f : mesh_.fragments) {
      const Fragment& fragment = cut_.surface.fragments[f];
      formats::Triangle& made = out_.visual_triangles.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) made[k] = place_[numberOf(fragment.corner[k], fragment.side)];
      source_triangle_.push_back(fragment.triangle);
    }
    surface_triangles_ = std::uint32_t(out_.visual_triangles.size());
    for (const PartPolygon& p : mesh_.polygons) addPolygon(cut_.section.polygons[p.polygon], p.side);
    const Vector3d origin = out_.visual_positions.empty() ? Vector3d::Zero() : asVector(out_.visual_positions[0]);
    for (const formats::Triangle& t : out_.visual_triangles) {
      const Vector3d a = asVector(out_.visual_positions[t[0]]) - origin,
                     b = asVector(out_.visual_positions[t[1]]) - origin,
                     c = asVector(out_.visual_positions[t[2]]) - origin;
      result_.volume += a.dot(b.cross(c)) / 6;
    }
  }

  bool isSlit() const { return cut_.sides.plane.outline.has_value(); }
  /// Of vertices at a cut there are two, below and above; of those at the end of a slit one.
  std::uint32_t numberOf(std::uint32_t corner, Side side) const {
    if (corner < visual_count_) return corner;
    const std::uint32_t made = corner - visual_count_;
    const bool tip = cut_.surface.nodes[cut_.surface.vertices[made].node].tip;
    return visual_count_ + 2 * made + (side > 0 && !tip ? 1U : 0U);
  }
  /// Of a tetrahedron's copy on a side: the part's.
  std::uint32_t localOf(std::uint32_t tetrahedron, Side side) const {
    const std::uint32_t here = local_tetrahedron_[placeOf(side)][tetrahedron];
    return here != kNone || isSlit() ? here : local_tetrahedron_[placeOf(Side(-side))][tetrahedron];
  }

  void keepVertex(std::uint32_t v) {
    out_.visual_positions.push_back(package_.visualPositions()[v]);
    if (!package_.visualNormals().empty()) out_.visual_normals.push_back(package_.visualNormals()[v]);
    if (!package_.visualUvs().empty()) out_.visual_uvs.push_back(package_.visualUvs()[v]);
    if (!package_.visualColors().empty()) out_.visual_colors.push_back(package_.visualColors()[v]);
    formats::BarycentricAttachment hung = package_.barycentric()[v];
    hung.tetrahedron = localOf(hung.tetrahedron, cut_.sides.visual_side[v]);
    out_.barycentric.push_back(hung);
    result_.visual.push_back({v, v});
  }

  void addAttachment(const Hung& hung, Side side) {
    out_.barycentric.push_back(
        {localOf(hung.tetrahedron, side), {float(hung.weight[0]), float(hung.weight[1]), float(hung.weight[2])}});
  }

  /// At a + t (b - a) + s (c - a).
  template <class T>
  static T mixed(std::span<const T> of, const NewVertex& made) {
    const T &a = of[made.a], &b = of[made.b], &c = of[made.c == kNone ? made.a : made.c];
    T result;
    for (std::size_t i = 0; i < a.size(); ++i) {
      const double first = double(a[i]);
      const double value = first + made.t * (double(b[i]) - first) + made.s * (double(c[i]) - first);
      if constexpr (std::is_same_v<typename T::value_type, std::uint8_t>) {
        result[i] = std::uint8_t(std::clamp(std::lround(value), 0L, 255L));
      } else {
        result[i] = float(value);
      }
    }
    return result;
  }

  void addVertex(const NewVertex& made, Side side) {
    const Node& node = cut_.surface.nodes[made.node];
    out_.visual_positions.push_back(asFloats(node.rest));
    if (const auto normals = package_.visualNormals(); !normals.empty()) {
      const Vector3d n = asVector(mixed(normals, made));
      out_.visual_normals.push_back(n.norm() > 1e-6 ? asFloats(n.normalized()) : normals[made.a]);
    }
    if (const auto uvs = package_.visualUvs(); !uvs.empty()) out_.visual_uvs.push_back(mixed(uvs, made));
    if (const auto colors = package_.visualColors(); !colors.empty()) {
      out_.visual_colors.push_back(mixed(colors, made));
    }
    addAttachment(cut_.nodes[made.node], side);
    result_.visual.push_back({made.a, made.b, float(made.t), made.c, float(made.s)});
    new_points_.push_back({std::uint32_t(out_.visual_positions.size() - 1), made.node, side});
  }

  /// A face of the section with vertices of its own: its rim is a sharp edge.
  void addPolygon(const Polygon& polygon, Side side) {
    const auto first = std::uint32_t(out_.visual_positions.size());
    const PlaneFrame& plane = cut_.sides.plane;
    const double scale = 1 / double(package_.info().diagonal);
    const auto addShared = [&](const Vector3d& at) {
      if (!package_.visualUvs().empty()) {
        const Vector2d from = scale * plane.flat(at);
        out_.visual_uvs.push_back({float(from[0]), float(from[1])});
      }
      // The material of the section alone gives its colour.
      if (!package_.visualColors().empty()) out_.visual_colors.push_back({255, 255, 255, 255});
    };
    for (const std::uint32_t n : polygon.nodes) {
      const Node& node = cut_.surface.nodes[n];
      out_.visual_positions.push_back(asFloats(node.rest));
      addShared(node.at);
      addAttachment(cut_.nodes[n], side);
      result_.visual.push_back({node.a, node.b, float(node.t), node.c, float(node.s)});
      new_points_.push_back({std::uint32_t(out_.visual_positions.size() - 1), n, side});
      addSectionPoint(node.rest, cut_.nodes[n], side);
    }
    for (const Interior& point : polygon.interior) {
      out_.visual_positions.push_back(asFloats(point.rest));
      addShared(point.at);
      addAttachment(point.hung, side);
      result_.visual.push_back({});
      new_points_.push_back({std::uint32_t(out_.visual_positions.size() - 1), kNone, side});
      addSectionPoint(point.rest, point.hung, side);
    }
    std::vector<Vector3d> normals(out_.visual_positions.size() - first, Vector3d::Zero());
    for (const auto& t : polygon.triangles) {
      formats::Triangle made = {first + t[0], first + t[1], first + t[2]};
      if (side > 0) std::swap(made[1], made[2]);
      const Vector3d a = asVector(out_.visual_positions[made[0]]), b = asVector(out_.visual_positions[made[1]]),
                     c = asVector(out_.visual_positions[made[2]]);
      const Vector3d area = (b - a).cross(c - a);
      for (const std::uint32_t v : made) normals[v - first] += area;
      out_.visual_triangles.push_back(made);
    }
    for (PartPiece& piece : pieces_) {
      const formats::PieceRange& range = package_.pieces()[piece.source];
      const std::uint32_t t = cut_.nodes[polygon.nodes[0]].tetrahedron;
      if (t >= range.first_tetrahedron && t < range.first_tetrahedron + range.tetrahedron_count) {
        piece.section_area += polygon.area;
      }
    }
    if (package_.visualNormals().empty()) return;
    Vector3d mean_normal = Vector3d::Zero();
    for (const Vector3d& n : normals) mean_normal += n;
    if (!(mean_normal.norm() > 0)) mean_normal = -double(side) * plane.normal;
    for (const Vector3d& n : normals) {
      out_.visual_normals.push_back(asFloats((n.norm() > 1e-30 ? n : mean_normal).normalized()));
    }
  }

  void addSectionPoint(const Vector3d& rest, Hung hung, Side side) {
    for (PartPiece& piece : pieces_) {
      const formats::PieceRange& range = package_.pieces()[piece.source];
      if (hung.tetrahedron < range.first_tetrahedron + range.tetrahedron_count &&
          hung.tetrahedron >= range.first_tetrahedron) {
        hung.tetrahedron = localOf(hung.tetrahedron, side);
        piece.section.push_back({rest, hung});
        return;
      }
    }
  }

  /// Those of the package, some perhaps empty; the section's triangles in one of their own, the same in cuts of cuts.
  void addSubMeshes() {
    std::vector<formats::SubMesh> from(package_.subMeshes().begin(), package_.subMeshes().end());
    if (from.empty()) {
      from.push_back({package_.info().name, kNone, 0, std::uint32_t(package_.visualTriangles().size()), 0});
    }
    out_.materials.assign(package_.materials().begin(), package_.materials().end());
    if (cut_.settings.keep_textures) {
      out_.textures.assign(package_.textures().begin(), package_.textures().end());
      out_.texture_bytes.assign(package_.textureBytes().begin(), package_.textureBytes().end());
    } else {
      for (formats::Material& material : out_.materials) material.texture = kNone;
    }
    const bool has_section = package_.text(from.back().name) == kSectionName;
    std::uint32_t first = 0, done = 0;
    for (formats::SubMesh sub : from) {
      const std::uint32_t end = sub.first_triangle + sub.triangle_count;
      while (done < surface_triangles_ && source_triangle_[done] < end) ++done;
      sub.first_triangle = first;
      sub.triangle_count = done - first;
      first = done;
      out_.sub_meshes.push_back(sub);
    }
    const std::uint32_t closing = std::uint32_t(out_.visual_triangles.size()) - surface_triangles_;
    if (has_section) {
      out_.sub_meshes.back().triangle_count += closing;
    } else if (closing > 0) {
      const formats::StringRef name = out_.addText(kSectionName);
      formats::Material material = {};
      material.name = name;
      material.base_color = cut_.settings.section_color;
      for (float& c : material.base_color) c = std::isfinite(c) ? std::clamp(c, 0.0F, 1.0F) : 1.0F;
      material.texture = kNone;
      out_.sub_meshes.push_back({name, std::uint32_t(out_.materials.size()), surface_triangles_, closing, 0});
      out_.materials.push_back(material);
    }
  }

  /// Source vertices stay; each new point is a source vertex of a mesh of its own.
  void addIdentity() {
    // The faces of a slit are in one place at rest: only its identity tells them apart.
    const bool has = !package_.visualIdentity().empty();
    if (!has && !isSlit()) return;
    const auto sources = has ? std::uint32_t(package_.sourceIdentity().size()) : visual_count_;
    out_.source_meshes.assign(package_.sourceMeshes().begin(), package_.sourceMeshes().end());
    if (!has) out_.source_meshes.push_back({package_.info().name, 0, sources});
    const auto identityOf = [&](std::uint32_t v) {
      return has ? package_.visualIdentity()[v] : formats::VisualIdentity{v, cut_.sides.weld[v]};
    };
    std::vector<std::uint32_t> welded(visual_count_, kNone);
    std::uint32_t next = 0, next_source = sources;
    const std::size_t count = out_.visual_positions.size();
    out_.visual_identity.resize(count);
    std::unordered_map<std::uint32_t, formats::VisualIdentity> of_node;  // by side, of a slit
    std::size_t made = 0;
    for (std::uint32_t v = 0; v < count; ++v) {
      if (made < new_points_.size() && new_points_[made].vertex == v) {
        const auto [point, node, side] = new_points_[made++];
        const bool kept = node != kNone && cut_.surface.nodes[node].a != kNone &&
                          cut_.surface.nodes[node].a == cut_.surface.nodes[node].b;
        if (kept) {
          // It is a vertex of the source that lies on the plane.
          const formats::VisualIdentity from = identityOf(cut_.surface.nodes[node].a);
          if (welded[from.welded] == kNone) welded[from.welded] = next++;
          out_.visual_identity[v] = {from.source_vertex, welded[from.welded]};
          continue;
        }
        if (node == kNone) {
          out_.visual_identity[v] = {next_source++, next++};
          continue;
        }
        const bool apart = isSlit() && side > 0 && !cut_.surface.nodes[node].tip;
        const auto [found, added] =
            of_node.try_emplace(2 * node + (apart ? 1U : 0U), formats::VisualIdentity{next_source, next});
        if (added) ++next_source, ++next;
        out_.visual_identity[v] = found->second;
        continue;
      }
      const formats::VisualIdentity from = identityOf(result_.visual[v].a);
      if (welded[from.welded] == kNone) welded[from.welded] = next++;
      out_.visual_identity[v] = {from.source_vertex, welded[from.welded]};
    }
    out_.source_identity.assign(next_source, {kNone, 0, 0});
    for (const formats::VisualIdentity& id : out_.visual_identity) {
      out_.source_identity[id.source_vertex].welded = id.welded;
      ++out_.source_identity[id.source_vertex].visual_count;
    }
    std::uint32_t first = 0;
    for (formats::SourceIdentity& source : out_.source_identity) {
      source.first_visual = first;
      first += source.visual_count;
    }
    std::vector<std::uint32_t> filled(next_source, 0);
    out_.source_visual_list.resize(count);
    for (std::uint32_t v = 0; v < count; ++v) {
      const std::uint32_t s = out_.visual_identity[v].source_vertex;
      out_.source_visual_list[out_.source_identity[s].first_visual + filled[s]++] = v;
    }
    if (next_source > sources)
      out_.source_meshes.push_back({out_.addText(kSourceName), sources, next_source - sources});
  }

  /// Groups, masks, accessories: lists of visual vertices. A new vertex is in them where both its ends are.
  void addLists() {
    std::vector<float> weight(visual_count_, 0);
    const std::size_t count = out_.visual_positions.size();
    // Weights at the part's vertices: mixed between the ends.
    const auto weightAt = [&](std::size_t v) {
      const CutOrigin& from = result_.visual[v];
      if (from.a == kNone) return 0.0F;
      const float third = from.c == kNone ? 0 : from.s * (weight[from.c] - weight[from.a]);
      return weight[from.a] + from.t * (weight[from.b] - weight[from.a]) + third;
    };
    const auto inBoth = [&](std::size_t v) {
      const CutOrigin& from = result_.visual[v];
      return from.a != kNone && weight[from.a] > 0 && weight[from.b] > 0 && (from.c == kNone || weight[from.c] > 0);
    };
    for (formats::Group group : package_.groups()) {
      const auto list = package_.groupVertices().subspan(group.first, group.count);
      for (const std::uint32_t v : list) weight[v] = 1;
      group.first = std::uint32_t(out_.group_vertices.size());
      for (std::uint32_t v = 0; v < count; ++v) {
        if (inBoth(v)) out_.group_vertices.push_back(v);
      }
      group.count = std::uint32_t(out_.group_vertices.size()) - group.first;
      out_.groups.push_back(group);
      for (const std::uint32_t v : list) weight[v] = 0;
    }
    for (formats::Mask mask : package_.masks()) {
      const auto list = package_.maskWeights().subspan(mask.first, mask.count);
      for (const formats::MaskWeight& m : list) weight[m.vertex] = m.weight;
      mask.first = std::uint32_t(out_.mask_weights.size());
      for (std::uint32_t v = 0; v < count; ++v) {
        const float here = std::min(1.0F, weightAt(v));
        if (here > 0) out_.mask_weights.push_back({v, here});
      }
      mask.count = std::uint32_t(out_.mask_weights.size()) - mask.first;
      out_.masks.push_back(mask);
      for (const formats::MaskWeight& m : list) weight[m.vertex] = 0;
    }
    for (formats::AttachedPart part : package_.parts()) {
      const auto list = package_.partVertices().subspan(part.first, part.count);
      if (part.cluster != kNone && (clusters_[part.cluster] == kNone || !hasRider(part.cluster))) continue;
      if (part.cluster != kNone) part.cluster = clusters_[part.cluster];
      for (const std::uint32_t v : list) weight[v] = 1;
      part.first = std::uint32_t(out_.part_vertices.size());
      for (std::uint32_t v = 0; v < count; ++v) {
        if (inBoth(v)) out_.part_vertices.push_back(v);
      }
      part.count = std::uint32_t(out_.part_vertices.size()) - part.first;
      out_.parts.push_back(part);
      for (const std::uint32_t v : list) weight[v] = 0;
    }
  }

  /// Whether the vertices that carry an accessory are here.
  bool hasRider(std::uint32_t cluster) const {
    const formats::Cluster& from = package_.clusters()[cluster];
    for (const auto& m : package_.memberships().subspan(from.first_member, from.member_count)) {
      if (m.share > 0 && local_[m.vertex] != kNone) return true;
    }
    return false;
  }

  void addInfo() {
    const formats::PackageInfo& from = package_.info();
    out_.info = from;
    Vector3d low = Vector3d::Constant(1e300), high = -low;
    for (const formats::Float3& x : out_.visual_positions) {
      low = low.cwiseMin(asVector(x));
      high = high.cwiseMax(asVector(x));
    }
    // Whole tetrahedra may reach far beyond a small part: all places lie within a diagonal of the bounds.
    const double reach = 0.9 * (high - low).norm();
    Vector3d physical_low = low, physical_high = high;
    for (const formats::PhysicalVertex& v : out_.physical_vertices) {
      physical_low = physical_low.cwiseMin(asVector(v.rest_position));
      physical_high = physical_high.cwiseMax(asVector(v.rest_position));
    }
    if ((physical_low.array() < low.array() - reach).any() || (physical_high.array() > high.array() + reach).any()) {
      low = physical_low;
      high = physical_high;
    }
    out_.info.bounds_min = asFloats(low);
    out_.info.bounds_max = asFloats(high);
    out_.info.diagonal = float((asVector(out_.info.bounds_max) - asVector(out_.info.bounds_min)).norm());
    out_.info.total_mass = float(totalMass());
    double volume = 0;
    for (const PartTetrahedron& t : mesh_.tetrahedra) volume += t.volume;
    out_.info.physical_volume = float(volume);
    out_.info.source_volume = from.source_volume < 0 ? from.source_volume : float(std::max(0.0, result_.volume));
    out_.info.max_rest_error = restError();
    out_.info.inverted_tetrahedra = std::min(from.inverted_tetrahedra, std::uint32_t(out_.tetrahedra.size()));
  }

  /// Largest distance of a visual vertex from where it hangs at rest, of the diagonal.
  float restError() const {
    double largest = 0;
    for (std::size_t v = 0; v < out_.visual_positions.size(); ++v) {
      const formats::BarycentricAttachment& hung = out_.barycentric[v];
      const auto& corners = out_.tetrahedra[hung.tetrahedron].vertex;
      Vector3d x = restOf(corners[3]);
      for (std::size_t k = 0; k < 3; ++k) x += double(hung.weight[k]) * (restOf(corners[k]) - restOf(corners[3]));
      largest = std::max(largest, (x - asVector(out_.visual_positions[v])).norm());
    }
    return float(largest / double(out_.info.diagonal));
  }

  void addFields() {
    const std::size_t vertices = package_.physicalVertices().size();
    const std::span<const std::uint32_t> label(
        cut_.partition.part_of.data() + (mesh_.side > 0 ? vertices : std::size_t(0)), vertices);
    for (const PartPiece& piece : pieces_) {
      const FieldInput input = {package_,  cut_.sides, mesh_, piece, cut_.nearest,
                                clusters_, pin_sets_,  label, part_, cut_.partition.gaps};
      cut_.piece_is_whole[piece.source] != 0 ? addWholeFields(input, out_) : addCutFields(input, out_);
    }
  }

  const Cut& cut_;
  const formats::PackageView& package_;
  const PartMesh& mesh_;
  const std::uint32_t part_, visual_count_;
  PartContent result_;
  formats::PackageContent& out_;
  std::vector<PartPiece> pieces_;
  std::vector<std::uint32_t> local_;  // of the package's vertices to the part's, the ones there first
  std::array<std::vector<std::uint32_t>, 2> local_tetrahedron_;  // below, above: of the package's to the part's
  std::vector<std::uint32_t> clusters_, pin_sets_;               // the same
  std::vector<std::uint32_t> place_;                             // by numberOf()
  std::vector<char> used_;
  std::vector<std::uint32_t> source_triangle_;
  std::uint32_t surface_triangles_ = 0;
  struct NewPoint {
    std::uint32_t vertex, node;  // of the part; none: within the section
    Side side;
  };
  std::vector<NewPoint> new_points_;
};

}  // namespace

PartContent makeContent(const Cut& cut, std::uint32_t part) { return Maker(cut, part).take(); }

}  // namespace sinew::cutting
