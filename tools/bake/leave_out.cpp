// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/leave_out.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <span>
#include <string>
#include <utility>

#include "sinew/runtime/asset.h"
#include "tools/bake/moments.h"
#include "tools/bake/stages.h"

namespace sinew::tools {
namespace {

using formats::kNone;
using formats::PackageContent;

// Displacement at which two packages are compared, rms, diagonals.
constexpr double kBent = 0.1;
// Unseen errors: a place that is off by so many diagonals, light that falls so many degrees askew.
constexpr double kUnseenPlace = 1e-3, kUnseenDegrees = 0.5;

Eigen::Vector3d vectorOf(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

constexpr std::uint32_t lanesOf(std::uint32_t count) { return (count + 7) / 8; }

// Copies runs of a section one behind the other: what stays of it.
template <class T>
class Kept {
 public:
  explicit Kept(std::vector<T>& items) : items_(items) {}
  ~Kept() { items_ = std::move(kept_); }
  Kept(const Kept&) = delete;
  Kept& operator=(const Kept&) = delete;

  void run(std::uint32_t& first, std::size_t count) {
    const auto from = items_.begin() + first;
    first = std::uint32_t(kept_.size());
    kept_.insert(kept_.end(), from, from + std::ptrdiff_t(count));
  }

 private:
  std::vector<T>& items_;
  std::vector<T> kept_;
};

void removeContact(PackageContent& content) {
  content.field_points.clear();
  content.field_point_values.clear();
  content.distance_grids.clear();
  content.distance_values.clear();
  for (formats::Field& field : content.fields) field.first_point = field.point_count = field.first_point_value = 0;
}

void removeFibres(PackageContent& content) {
  content.channels.clear();
  content.field_fibres.clear();
  content.field_fibre_values.clear();
  for (formats::ClusterMechanics& m : content.mechanics) {
    m.fibre = {0, 0, 0};
    m.channel = kNone;
    m.contraction = 0;
  }
}

// Pin sets and the fields that they hold, and how what holds a piece gives way.
void removePins(PackageContent& content) {
  content.field_residuals.clear();
  content.field_residual_values.clear();
  content.field_residual_locals.clear();
  content.pin_sets.clear();
  content.pin_set_vertices.clear();
  content.pin_weights.clear();
  content.field_tethers.clear();
  content.field_tether_values.clear();
  std::vector<std::uint32_t> number(content.fields.size(), kNone);
  std::vector<formats::Field> free;
  {
    Kept functions(content.field_functions);
    Kept packs(content.field_packs);
    Kept gradients(content.field_gradients), values(content.field_values), point_values(content.field_point_values);
    Kept modes(content.field_modes);
    Kept points(content.field_points);
    for (std::size_t f = 0; f < content.fields.size(); ++f) {
      formats::Field field = content.fields[f];
      if (field.held != 0) continue;
      number[f] = std::uint32_t(free.size());
      const std::uint32_t k = field.function_count;
      functions.run(field.first_function, k);
      packs.run(field.first_pack, field.pack_count);
      gradients.run(field.first_gradient, std::size_t{3} * k * field.pack_count);
      values.run(field.first_value, std::size_t{k} * lanesOf(content.pieces[field.piece].vertex_count));
      points.run(field.first_point, field.point_count);
      point_values.run(field.first_point_value, std::size_t{k} * lanesOf(field.point_count));
      modes.run(field.first_mode, std::size_t{3 * k + 1} * lanesOf(3 * k));
      free.push_back(field);
    }
  }
  std::vector<formats::FieldFibre> fibres;
  {
    Kept values(content.field_fibre_values);
    for (formats::FieldFibre fibre : content.field_fibres) {
      if (number[fibre.field] == kNone) continue;
      values.run(fibre.first_value, content.fields[fibre.field].function_count);
      fibre.field = number[fibre.field];
      fibres.push_back(fibre);
    }
  }
  content.field_fibres = std::move(fibres);
  content.fields = std::move(free);
}

// Tetrahedra that carry no visual vertex.
void removeInnerTetrahedra(PackageContent& content) {
  if (content.barycentric.empty()) return;
  std::vector<std::uint32_t> number(content.tetrahedra.size(), kNone);
  for (const formats::BarycentricAttachment& a : content.barycentric) number[a.tetrahedron] = 0;
  std::vector<formats::Tetrahedron> kept;
  for (formats::PieceRange& piece : content.pieces) {
    const std::uint32_t first = std::uint32_t(kept.size()), end = piece.first_tetrahedron + piece.tetrahedron_count;
    for (std::uint32_t t = piece.first_tetrahedron; t < end; ++t) {
      if (number[t] == kNone) continue;
      number[t] = std::uint32_t(kept.size());
      kept.push_back(content.tetrahedra[t]);
    }
    piece.first_tetrahedron = first;
    piece.tetrahedron_count = std::uint32_t(kept.size()) - first;
  }
  for (formats::BarycentricAttachment& a : content.barycentric) a.tetrahedron = number[a.tetrahedron];
  content.tetrahedra = std::move(kept);
  content.info.inverted_tetrahedra = 0;
}

// Clusters of a piece that have the same mechanics become one, all linear: their frequencies, modes and moments are the
// report's solver's. Those of accessories stay as they are.
void joinClusters(PackageContent& content) {
  if (!content.cluster_attachments.empty()) return;
  std::vector<char> rides(content.clusters.size(), 0);
  for (const formats::AttachedPart& part : content.parts) {
    if (part.cluster != kNone) rides[part.cluster] = 1;
  }
  struct Joined {
    std::uint32_t first;                     // of its clusters
    std::map<std::uint32_t, double> shares;  // by vertex
  };
  std::vector<Joined> joined;
  std::vector<std::uint32_t> number(content.clusters.size());
  std::map<std::pair<std::uint32_t, std::string>, std::uint32_t> alike;  // by piece and mechanics
  for (std::uint32_t c = 0; c < content.clusters.size(); ++c) {
    const formats::Cluster& cluster = content.clusters[c];
    std::string mechanics;
    if (!content.mechanics.empty()) {
      mechanics.assign(reinterpret_cast<const char*>(&content.mechanics[c]), sizeof content.mechanics[c]);
    }
    if (rides[c] != 0) mechanics += std::to_string(c);
    const auto [at, fresh] = alike.try_emplace({cluster.piece, mechanics}, std::uint32_t(joined.size()));
    if (fresh) joined.push_back({c, {}});
    number[c] = at->second;
    for (std::uint32_t m = 0; m < cluster.member_count; ++m) {
      const formats::Membership& member = content.memberships[cluster.first_member + m];
      joined[at->second].shares[member.vertex] += double(member.share);
    }
  }
  std::vector<ClusterSource> sources;
  for (const Joined& j : joined) {
    if (rides[j.first] != 0) continue;
    ClusterSource& source = sources.emplace_back();
    source.piece = content.clusters[j.first].piece;
    for (const auto& [vertex, share] : j.shares) {
      if (!(share > 0)) continue;
      source.vertices.push_back(vertex);
      source.weights.push_back(share);
    }
  }
  std::vector<Finding> flat;  // no news: they were rigid before
  const ClusterConstants constants = clusterConstants(sources, content.physical_vertices, {}, flat);
  std::vector<formats::Cluster> clusters;
  std::vector<formats::Membership> memberships;
  std::vector<formats::ClusterMechanics> mechanics;
  for (std::size_t j = 0, next = 0; j < joined.size(); ++j) {
    const bool rider = rides[joined[j].first] != 0;
    const formats::Cluster& old = content.clusters[joined[j].first];
    formats::Cluster cluster = rider ? old : constants.clusters[next++];
    const auto from = (rider ? content.memberships : constants.memberships).begin() + cluster.first_member;
    cluster.first_member = std::uint32_t(memberships.size());
    memberships.insert(memberships.end(), from, from + cluster.member_count);
    cluster.name =
        std::count(number.begin(), number.end(), std::uint32_t(j)) == 1 ? old.name : content.pieces[old.piece].name;
    cluster.alpha = old.alpha;
    cluster.stretch_hz = old.stretch_hz;
    cluster.bend_hz = old.bend_hz;
    cluster.twist_hz = old.twist_hz;
    clusters.push_back(cluster);
    if (!content.mechanics.empty()) mechanics.push_back(content.mechanics[joined[j].first]);
  }
  content.clusters = std::move(clusters);
  content.memberships = std::move(memberships);
  content.mechanics = std::move(mechanics);
  content.quadratic_moments.clear();
  content.vertex_stiffness.clear();
  for (formats::PieceRange& piece : content.pieces) piece.cluster_count = 0;
  for (std::uint32_t c = 0; c < content.clusters.size(); ++c) {
    formats::PieceRange& piece = content.pieces[content.clusters[c].piece];
    if (piece.cluster_count++ == 0) piece.first_cluster = c;
  }
  for (formats::AttachedPart& part : content.parts) {
    if (part.cluster != kNone) part.cluster = number[part.cluster];
  }
  for (formats::FieldFibre& fibre : content.field_fibres) fibre.cluster = number[fibre.cluster];
  for (formats::FieldPack& pack : content.field_packs) {
    for (std::uint32_t& cluster : pack.cluster) {
      if (cluster != kNone) cluster = number[cluster];
    }
  }
}

// STRS with the texts that are still referred to.
void keepTexts(PackageContent& content) {
  const std::vector<char> before = std::exchange(content.strings, {});
  content.texts_behind.clear();
  const auto keep = [&](formats::StringRef& ref) { ref = content.addText({before.data() + ref.offset, ref.bytes}); };
  const auto keepNames = [&](auto& items) {
    for (auto& item : items) keep(item.name);
  };
  keepNames(content.pieces);
  keepNames(content.clusters);
  keepNames(content.channels);
  keepNames(content.pin_sets);
  for (formats::PinSet& set : content.pin_sets) keep(set.target);
  keepNames(content.parts);
  keepNames(content.sub_meshes);
  keepNames(content.materials);
  keepNames(content.textures);
  for (formats::Texture& texture : content.textures) keep(texture.mime);
  keepNames(content.source_meshes);
  keepNames(content.groups);
  keepNames(content.masks);
  formats::PackageInfo& info = content.info;
  for (auto* ref : {&info.name, &info.tool_version, &info.source_file, &info.unit_source, &info.settings_json})
    keep(*ref);
}

// Visual vertices of a package whose pieces move by `deform` (metres a function, by field and function).
std::vector<Eigen::Vector3d> drawn(const formats::PackageView& package,
                                   const std::vector<std::vector<Eigen::Vector3d>>& deform) {
  std::vector<Eigen::Vector3d> places(package.physicalVertices().size());
  for (std::size_t f = 0; f < package.fields().size(); ++f) {
    const formats::Field& field = package.fields()[f];
    if (field.held != 0) continue;
    const formats::PieceRange& piece = package.pieces()[field.piece];
    const auto functions = package.fieldFunctions().subspan(field.first_function, field.function_count);
    for (std::uint32_t i = 0; i < piece.vertex_count; ++i) {
      Eigen::Vector3d x = Eigen::Vector3d::Zero();
      for (std::uint32_t j = 0; j < field.function_count; ++j) {
        const float phi =
            package.fieldValues()[field.first_value + std::size_t{field.function_count} * (i / 8) + j][i % 8];
        const auto& rest = functions[j].rest;
        x +=
            double(phi) * (Eigen::Vector3d(double(rest[0]), double(rest[1]), double(rest[2])) + deform[field.piece][j]);
      }
      places[piece.first_vertex + i] = x;
    }
  }
  std::vector<Eigen::Vector3d> visual;
  for (const formats::BarycentricAttachment& a : package.barycentric()) {
    const auto& v = package.tetrahedra()[a.tetrahedron].vertex;
    Eigen::Vector3d x = places[v[3]];
    for (std::size_t k = 0; k < 3; ++k) x += double(a.weight[k]) * (places[v[k]] - places[v[3]]);
    visual.push_back(x);
  }
  return visual;
}

// Largest angle between the artist's normals and the ones made without, degrees.
double normalsDifference(const formats::PackageView& package) {
  const auto made = Asset::fromMemory(packageWith(package, Needs::all().without(Need::normals)));
  if (!made) return std::numeric_limits<double>::infinity();
  double largest = 0;
  for (std::size_t v = 0; v < package.visualNormals().size(); ++v) {
    const Eigen::Vector3d one = vectorOf(package.visualNormals()[v]), other = vectorOf((*made)->restNormals()[v]);
    largest = std::max(largest, std::atan2(one.cross(other).norm(), one.dot(other)));
  }
  return largest * 180 / std::numbers::pi;
}

double packedDifference(const formats::PackageView& package) {
  PackageContent content = formats::contentOf(package);
  const auto packed = Asset::fromMemory(packedPackage(content).bytes);
  return packed ? drawnDifference(package, (*packed)->package()) : std::numeric_limits<double>::infinity();
}

bool allAlike(std::span<const formats::Float2> uvs) {
  return std::all_of(uvs.begin(), uvs.end(), [&](const formats::Float2& uv) { return uv == uvs.front(); });
}

bool allWhite(std::span<const formats::Color8> colors) {
  constexpr formats::Color8 kWhite = {255, 255, 255, 255};
  return std::all_of(colors.begin(), colors.end(), [&](const formats::Color8& c) { return c == kWhite; });
}

}  // namespace

std::optional<SeenChange> changeWithout(const formats::PackageView& package, Need need) {
  const auto share = [](bool unseen) { return SeenChange{unseen ? 0.0 : 1.0, 0, ""}; };
  switch (need) {
    case Need::exact:
      return SeenChange{packedDifference(package), kUnseenPlace, "diagonals"};
    case Need::normals:
      return SeenChange{normalsDifference(package), kUnseenDegrees, "degrees"};
    case Need::uvs:
      return share(allAlike(package.visualUvs()));
    case Need::colors:
      return share(allWhite(package.visualColors()));
    case Need::textures:
      return share(std::all_of(package.materials().begin(), package.materials().end(),
                               [](const formats::Material& material) { return material.texture == kNone; }));
    case Need::activation:
      return share(std::all_of(package.fieldFibres().begin(), package.fieldFibres().end(),
                               [](const formats::FieldFibre& fibre) { return fibre.tension == 0; }));
    case Need::plasticity:
      return share(std::all_of(package.mechanics().begin(), package.mechanics().end(),
                               [](const formats::ClusterMechanics& m) { return m.plastic_creep == 0; }));
    case Need::clusters:
      return share(true);
    default:
      return std::nullopt;
  }
}

Needs narrowed(Needs needs, const formats::PackageView& package, bool authored, std::vector<LeftUnseen>& left) {
  if (!needs.isAutomatic()) return needs;
  Needs kept = Needs::none();
  for (const NeedDeclaration& d : kNeedDeclarations) {
    if (needs.has(d.need)) kept = kept.with(d.need);
  }
  if (kept == Needs::none()) {
    kept = Needs::all();
    for (const Need need : {Need::cut, Need::identity, Need::groups, Need::masks}) kept = kept.without(need);
  }
  std::size_t bytes = packageWith(package, kept).size();
  for (const NeedDeclaration& d : kNeedDeclarations) {
    if (!kept.has(d.need) || (d.need == Need::clusters && authored)) continue;
    const std::optional<SeenChange> change = changeWithout(package, d.need);
    if (!change || !change->isUnseen()) continue;
    kept = kept.without(d.need);
    const std::size_t less = packageWith(package, kept).size();
    if (less < bytes) left.push_back({d.need, *change, bytes - less});
    bytes = less;
  }
  return kept;
}

void leaveOut(PackageContent& content, Needs needs) {
  if (!needs.has(Need::pins)) removePins(content);
  if (!needs.has(Need::contact)) removeContact(content);
  if (!needs.has(Need::activation)) removeFibres(content);
  if (!needs.has(Need::plasticity)) {
    for (formats::ClusterMechanics& m : content.mechanics) m.plastic_creep = 0;
  }
  if (!needs.has(Need::cut) && !needs.has(Need::contact)) removeInnerTetrahedra(content);
  if (!needs.has(Need::clusters)) joinClusters(content);
  if (!needs.has(Need::normals)) content.visual_normals.clear();
  if (!needs.has(Need::uvs)) content.visual_uvs.clear();
  if (!needs.has(Need::colors)) content.visual_colors.clear();
  if (!needs.has(Need::textures)) {
    content.textures.clear();
    content.texture_bytes.clear();
    for (formats::Material& material : content.materials) material.texture = kNone;
  }
  if (!needs.has(Need::identity)) {
    content.visual_identity.clear();
    content.source_identity.clear();
    content.source_visual_list.clear();
    content.source_meshes.clear();
  }
  if (!needs.has(Need::groups)) {
    content.groups.clear();
    content.group_vertices.clear();
  }
  if (!needs.has(Need::masks)) {
    content.masks.clear();
    content.mask_weights.clear();
  }
  keepTexts(content);
}

std::vector<std::byte> packageWith(const formats::PackageView& package, Needs needs) {
  PackageContent content = formats::contentOf(package);
  leaveOut(content, needs);
  if (!needs.has(Need::exact)) {
    if (PackedPackage packed = packedPackage(content); packed.refusal.empty()) return std::move(packed.bytes);
  }
  return formats::writePackage(content);
}

double restErrorOf(const PackageContent& content) {
  double largest = 0;
  for (std::size_t v = 0; v < content.visual_positions.size(); ++v) {
    const HungPlace hung = hungAt(content, v);
    largest = std::max(largest, (vectorOf(hung.place) - vectorOf(content.visual_positions[v])).norm());
  }
  return largest / double(content.info.diagonal);
}

PackedPackage packedPackage(PackageContent& content) {
  const float exact = std::exchange(content.info.max_rest_error, 1.0F);
  const auto asset = Asset::fromMemory(formats::writePackage(content, true));
  content.info.max_rest_error = asset ? float(restErrorOf(formats::contentOf((*asset)->package()))) : exact;
  if (!asset) return {{}, asset.reason()};
  return {formats::writePackage(content, true), ""};
}

double drawnDifference(const formats::PackageView& one, const formats::PackageView& other) {
  const double diagonal = double(one.info().diagonal);
  double largest = 0;
  for (std::size_t v = 0; v < one.visualPositions().size(); ++v) {
    largest = std::max(largest, (vectorOf(one.visualPositions()[v]) - vectorOf(other.visualPositions()[v])).norm());
  }
  if (one.barycentric().empty() || one.fields().empty()) return largest / diagonal;
  // Functions are orthonormal under the masses: a coordinate of a sqrt(mass of the piece) is a displacement of rms a.
  std::vector<double> amount;
  for (const formats::PieceRange& piece : one.pieces()) {
    double mass = 0;
    for (const auto& vertex : one.physicalVertices().subspan(piece.first_vertex, piece.vertex_count)) {
      mass += double(vertex.mass);
    }
    amount.push_back(kBent * diagonal * std::sqrt(mass));
  }
  std::uint32_t most = 0;
  for (const formats::Field& field : one.fields()) most = std::max(most, field.function_count);
  std::vector<std::vector<Eigen::Vector3d>> deform(one.pieces().size());
  for (std::uint32_t j = 0; j <= most; ++j) {  // the last: at rest
    for (std::size_t p = 0; p < deform.size(); ++p) {
      deform[p].assign(most, Eigen::Vector3d::Zero());
      if (j < most) deform[p][j][j % 3] = amount[p];
    }
    const std::vector<Eigen::Vector3d> a = drawn(one, deform), b = drawn(other, deform);
    for (std::size_t v = 0; v < a.size(); ++v) largest = std::max(largest, (a[v] - b[v]).norm());
  }
  return largest / diagonal;
}

}  // namespace sinew::tools
