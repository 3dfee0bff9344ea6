// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/check_package.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <span>
#include <string_view>

#include "runtime/geometry/pseudo_inverse.h"
#include "runtime/geometry/symmetric_eigen.h"
#include "runtime/geometry/tet_mesh.h"
#include "tools/attach/attach.h"
#include "tools/bake/check_source.h"
#include "tools/core/text.h"
#include "tools/import/import_process.h"
#include "tools/import/textures.h"
#include "tools/pictures/decode_picture.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using formats::Cluster;
using formats::ClusterMode;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;

constexpr float kOutside = 0.5F;         // of a tetrahedron's height: what hangs further out has its motion multiplied
constexpr double kLeastDihedralDeg = 5;  // below, a tetrahedron is a sliver that bends nothing well
constexpr double kAngleAgreementDeg = 0.1;  // of the recorded angles with the recomputed ones
// Of a drawn vertex at rest, diagonals, where its numbers are blocks of 16 bits: 2^-15 of half a diagonal's coordinates
// in VPOS, and of the edges of its tetrahedron in ATBC.
constexpr double kPackedRounding = 1.0 / (1 << 14);
constexpr double kSumTolerance = 1e-4;     // of masses, which are sums of floats
constexpr double kMomentTolerance = 0.02;  // of M S M against M; rounding S to float costs up to 0.6 % at that cut-off
constexpr double kMostMassRatio = 1e4;

template <class Float3>
Vector3d wide(const Float3& x) {
  return {double(x[0]), double(x[1]), double(x[2])};
}

Vector9d monomials(const Vector3d& q) {
  Vector9d m;
  m << q, q[0] * q[0], q[1] * q[1], q[2] * q[2], q[0] * q[1], q[1] * q[2], q[2] * q[0];
  return m;
}

std::span<const std::byte> bytesOf(const formats::PackageView& package, const formats::Texture& texture) {
  return package.textureBytes().subspan(std::size_t(texture.offset), std::size_t(texture.bytes));
}

class PackageCheck {
 public:
  explicit PackageCheck(const formats::PackageView& package)
      : package_(package), diagonal_(double(package.info().diagonal)) {}

  std::vector<Finding> run() {
    tetrahedra();
    attachments();
    clusterMasses();
    clusterShapes();
    clusterTwins();
    masses();
    fields();
    volume();
    pieces();
    textures();
    return std::move(findings_);
  }

 private:
  Finding& add(const char* id, Severity severity, std::string message, std::uint64_t count, const char* cure) {
    findings_.push_back({id, severity, std::move(message), count, "", {}, "", cure});
    return findings_.back();
  }
  template <class Name>
  static std::string list(const std::vector<std::uint32_t>& items, const Name& name) {
    std::vector<std::string> names;
    for (const std::uint32_t item : items) names.push_back(name(item));
    return listed(names);
  }
  static std::string numbers(const char* what, const std::vector<std::uint32_t>& items) {
    return what + (" " + list(items, [](std::uint32_t i) { return std::to_string(i); }));
  }
  std::string clusterNames(const std::vector<std::uint32_t>& clusters) const {
    return "clusters " + list(clusters, [this](std::uint32_t c) {
             const std::string_view name = package_.text(package_.clusters()[c].name);
             return name.empty() ? std::to_string(c) : std::string(name);
           });
  }
  Vector3d rest(std::uint32_t vertex) const { return wide(package_.physicalVertices()[vertex].rest_position); }
  std::span<const formats::Membership> members(const Cluster& cluster) const {
    return package_.memberships().subspan(cluster.first_member, cluster.member_count);
  }
  void placeVisual(Finding& finding, const std::vector<std::uint32_t>& visual) const {
    if (package_.visualIdentity().empty()) {
      finding.place = numbers("visual vertices", visual);
      return;
    }
    finding.place_kind = "vertex";
    for (const std::uint32_t v : visual) finding.places.push_back(package_.visualIdentity()[v].source_vertex);
    std::sort(finding.places.begin(), finding.places.end());
    finding.places.erase(std::unique(finding.places.begin(), finding.places.end()), finding.places.end());
    finding.places.resize(std::min(finding.places.size(), Finding::kMaxPlaces));
  }

  // Of a shell, which is one tetrahedron thick: all four vertices on the surface of the tetrahedra, and no visual
  // vertex so far outside that a thin tetrahedron's motion is multiplied in it. Thinness harms nothing there: clusters
  // deform a body, tetrahedra only carry what is drawn.
  std::vector<std::uint8_t> sheetTetrahedra() const {
    const auto tetrahedra = package_.tetrahedra();
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const auto& t : tetrahedra) {
      for (std::size_t k = 0; k < 4; ++k) {
        std::array<std::uint32_t, 3> face = {t.vertex[(k + 1) % 4], t.vertex[(k + 2) % 4], t.vertex[(k + 3) % 4]};
        std::sort(face.begin(), face.end());
        faces.push_back(face);
      }
    }
    std::sort(faces.begin(), faces.end());
    std::vector<std::uint8_t> outer(package_.physicalVertices().size(), 0);
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const bool twice = (i > 0 && faces[i - 1] == faces[i]) || (i + 1 < faces.size() && faces[i + 1] == faces[i]);
      if (twice) continue;
      for (const std::uint32_t v : faces[i]) outer[v] = 1;
    }
    std::vector<std::uint8_t> sheet(tetrahedra.size(), 0);
    for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
      const auto& v = tetrahedra[t].vertex;
      sheet[t] = std::all_of(v.begin(), v.end(), [&](std::uint32_t i) { return outer[i] != 0; }) ? 1 : 0;
    }
    for (const auto& attachment : package_.barycentric()) {
      const auto& w = attachment.weight;
      for (const float x : {w[0], w[1], w[2], 1 - w[0] - w[1] - w[2]}) {
        if (x < -kOutside || x > 1 + kOutside) sheet[attachment.tetrahedron] = 0;
      }
    }
    return sheet;
  }

  void tetrahedra() {
    if (package_.tetrahedra().empty()) return;
    std::vector<std::uint32_t> inverted, slivers;
    double least = 180, largest = 0;
    for (std::uint32_t t = 0; t < package_.tetrahedra().size(); ++t) {
      const auto& v = package_.tetrahedra()[t].vertex;
      const Vector3d a = rest(v[0]), b = rest(v[1]), c = rest(v[2]), d = rest(v[3]);
      if (!(geometry::signedVolume6(a, b, c, d) > 0)) {
        inverted.push_back(t);
        continue;
      }
      const auto range = geometry::dihedralRange(a, b, c, d);
      least = std::min(least, range[0]);
      largest = std::max(largest, range[1]);
      if (range[0] < kLeastDihedralDeg) slivers.push_back(t);
    }
    const std::size_t thin = slivers.size();
    std::erase_if(slivers, [sheet = sheetTetrahedra()](std::uint32_t t) { return sheet[t] != 0; });
    if (!inverted.empty()) {
      add("inverted-tetrahedra", Severity::error,
          counted(inverted.size(), "tetrahedron has", "tetrahedra have") + " no positive volume", inverted.size(),
          "Bake again; report the source if it happens again.")
          .place = numbers("tetrahedra", inverted);
      return;
    }
    if (!slivers.empty()) {
      add("sliver-tetrahedra", Severity::warning,
          counted(slivers.size(), "tetrahedron has", "tetrahedra have") + " a dihedral angle below " +
              rounded(kLeastDihedralDeg) + " degrees (smallest " + rounded(least) + ")",
          slivers.size(), "Bake with tetrahedra.method=stuffing, or with more physical vertices.")
          .place = numbers("tetrahedra", slivers);
    } else {
      add("tetrahedra-quality", Severity::info,
          "dihedral angles of " + counted(package_.tetrahedra().size(), "tetrahedron", "tetrahedra") + " lie between " +
              rounded(least) + " and " + rounded(largest) + " degrees",
          package_.tetrahedra().size(), "");
      if (thin > 0) {
        add("thin-sheet", Severity::info,
            counted(thin, "tetrahedron", "tetrahedra") + " of a sheet " + (thin == 1 ? "is" : "are") +
                " thinner than " + rounded(kLeastDihedralDeg) + " degrees, as the sheet is; nothing hangs outside them",
            thin, "");
      }
    }
    const formats::PackageInfo& info = package_.info();
    if (std::abs(double(info.min_dihedral_deg) - least) > kAngleAgreementDeg ||
        std::abs(double(info.max_dihedral_deg) - largest) > kAngleAgreementDeg || info.inverted_tetrahedra != 0) {
      add("wrong-quality-record", Severity::warning,
          "the package records dihedral angles of " + rounded(double(info.min_dihedral_deg)) + " to " +
              rounded(double(info.max_dihedral_deg)) + " degrees, but they are " + rounded(least) + " to " +
              rounded(largest),
          1, "Bake again with this version.");
    }
  }

  // The error of every visual vertex at rest, metres.
  void attachments() {
    const std::size_t count = package_.visualPositions().size();
    if (count == 0) return;
    const auto barycentric = package_.barycentric();
    const auto ranges = package_.clusterAttachmentRanges();
    std::vector<std::uint32_t> off;
    double largest = 0;
    const bool packed = std::any_of(package_.sections().begin(), package_.sections().end(),
                                    [](const formats::SectionInfo& section) { return section.packed; });
    const double allowed = kMostRestError + (packed ? kPackedRounding : 0);
    const auto judge = [&](std::uint32_t v, const HungPlace& hung) {
      const double error = (wide(hung.place) - wide(package_.visualPositions()[v])).norm() / diagonal_;
      largest = std::max(largest, error);
      if (!(error <= allowed + hung.rounded / diagonal_)) off.push_back(v);
    };
    for (std::uint32_t v = 0; v < barycentric.size(); ++v) {
      judge(v, hungOn(barycentric[v], package_.tetrahedra()[barycentric[v].tetrahedron],
                      [&](std::uint32_t p) { return package_.physicalVertices()[p].rest_position; }));
    }
    for (std::uint32_t v = 0; v < ranges.size(); ++v) {
      judge(v, hungAtRest(package_.clusterAttachments().subspan(ranges[v].first, ranges[v].count), package_.clusters(),
                          package_.visualPositions()[v]));
    }
    if (!off.empty()) {
      placeVisual(add("attachment-error", Severity::error,
                      counted(off.size(), "visual vertex does", "visual vertices do") +
                          " not come back to the rest position: " + rounded(largest) + " of the diagonal (" +
                          rounded(allowed) + " allowed)",
                      off.size(), "Bake again; report the source if it happens again."),
                  off);
    } else {
      add("attachment-rest-error", Severity::info,
          "all " + std::to_string(count) + " visual vertices are attached; rest error " + rounded(largest) +
              " of the diagonal",
          count, "");
    }
  }

  void clusterMasses() {
    std::vector<std::uint32_t> wrong;
    for (std::uint32_t c = 0; c < package_.clusters().size(); ++c) {
      const Cluster& cluster = package_.clusters()[c];
      double mass = 0;
      for (const auto& member : members(cluster)) {
        mass += double(member.share) * double(package_.physicalVertices()[member.vertex].mass);
      }
      if (!(std::abs(mass - double(cluster.mass)) <= kSumTolerance * mass)) wrong.push_back(c);
    }
    if (wrong.empty()) return;
    add("wrong-cluster-mass", Severity::error,
        "the recorded mass of " + counted(wrong.size(), "cluster is", "clusters is") +
            " not that of its vertices' shares",
        wrong.size(), "Bake again; report the recipe if it happens again.")
        .place = clusterNames(wrong);
  }

  // How many vertices a mode needs before its moments can have full rank.
  static std::uint32_t wantedMembers(ClusterMode mode) {
    switch (mode) {
      case ClusterMode::rigid:
        return 3;
      case ClusterMode::linear:
        return 4;
      case ClusterMode::quadratic:
        return 10;
    }
    return 1;
  }

  void clusterShapes() {
    std::vector<std::uint32_t> small, flat, wrong;
    for (std::uint32_t c = 0; c < package_.clusters().size(); ++c) {
      const Cluster& cluster = package_.clusters()[c];
      if (cluster.member_count < wantedMembers(cluster.mode)) small.push_back(c);
      const Vector3d center = wide(cluster.rest_center);
      Matrix9d moment = Matrix9d::Zero();
      Vector9d mean = Vector9d::Zero();
      double total = 0;
      for (const auto& member : members(cluster)) {
        const Vector9d m = monomials((rest(member.vertex) - center) / double(cluster.radius));
        moment += double(member.mu) * m * m.transpose();
        mean += double(member.mu) * m;
        total += double(member.mu);
      }
      moment = moment / total - (mean / total) * (mean / total).transpose();
      const Eigen::Matrix3d spread = moment.topLeftCorner<3, 3>();
      const Eigen::VectorXd spreads = geometry::symmetricEigenvalues(spread);
      if (cluster.mode != ClusterMode::rigid && spreads[0] <= geometry::kMomentCutoff * spreads[2]) flat.push_back(c);
      const auto& s = cluster.a_qq;
      Eigen::Matrix3d inverse;
      inverse << s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2];
      bool fits = fitsMoment<Eigen::Matrix3d>(spread, inverse);
      if (cluster.mode == ClusterMode::quadratic) {
        Matrix9d inverse9;
        std::size_t at = 0;
        for (Eigen::Index row = 0; row < 9; ++row) {
          for (Eigen::Index column = 0; column <= row; ++column) {
            inverse9(row, column) = inverse9(column, row) =
                double(package_.quadraticMoments()[cluster.quadratic].a_qq[at++]);
          }
        }
        fits = fits && fitsMoment<Matrix9d>(moment, inverse9);
      }
      if (!fits) wrong.push_back(c);
    }
    if (!small.empty()) {
      add("small-clusters", Severity::warning,
          counted(small.size(), "cluster has", "clusters have") +
              " fewer vertices than the mode can use (3 rigid, 4 linear, 10 quadratic)",
          small.size(), "Use a coarser clusters.grid, or more physical vertices.")
          .place = clusterNames(small);
    }
    if (!flat.empty()) {
      add("flat-clusters", Severity::warning,
          counted(flat.size(), "cluster lies", "clusters lie") +
              " in a plane or on a line and cannot stretch out of it",
          flat.size(), "Use a coarser clusters.grid, or make the cluster rigid.")
          .place = clusterNames(flat);
    }
    if (!wrong.empty()) {
      add("wrong-moments", Severity::error,
          "the stored moments of " + counted(wrong.size(), "cluster do", "clusters do") + " not belong to its vertices",
          wrong.size(), "Bake again; report the recipe if it happens again.")
          .place = clusterNames(wrong);
    }
  }

  // M S M = M for a pseudo-inverse S, but for what the cut-off dropped.
  template <class Matrix>
  static bool fitsMoment(const Matrix& moment, const Matrix& inverse) {
    return (moment * inverse * moment - moment).norm() <= kMomentTolerance * moment.norm();
  }

  void clusterTwins() {
    std::vector<std::uint32_t> order(package_.clusters().size());
    std::iota(order.begin(), order.end(), 0U);
    const auto compare = [&](std::uint32_t a, std::uint32_t b) {
      const auto x = members(package_.clusters()[a]), y = members(package_.clusters()[b]);
      const auto less = [](const formats::Membership& m, const formats::Membership& n) {
        return m.vertex != n.vertex ? m.vertex < n.vertex : m.mu < n.mu;
      };
      if (std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end(), less)) return -1;
      return std::lexicographical_compare(y.begin(), y.end(), x.begin(), x.end(), less) ? 1 : 0;
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const int way = compare(a, b);
      return way != 0 ? way < 0 : a < b;
    });
    std::vector<std::uint32_t> twins;
    for (std::size_t i = 1; i < order.size(); ++i) {
      if (compare(order[i - 1], order[i]) == 0) twins.push_back(order[i]);
    }
    if (twins.empty()) return;
    std::sort(twins.begin(), twins.end());
    add("identical-clusters", Severity::warning,
        counted(twins.size(), "cluster has", "clusters have") + " the same vertices and weights as another",
        twins.size(), "Remove the copy: it costs time and changes nothing but the stiffness.")
        .place = clusterNames(twins);
  }

  void fields() {
    if (!package_.fields().empty()) return;
    add("no-fields", Severity::warning, "the pieces have no fields: only the report's solver can move them", 1,
        "Bake it again without field.functions=0, and thicker where bake says that it is too thin; or use --solver "
        "report.");
  }

  /// Vertices carrying a rigid part weigh next to nothing; its host moves them.
  std::vector<char> carriers() const {
    std::vector<char> carries(package_.physicalVertices().size(), 0);
    for (const formats::AttachedPart& part : package_.parts()) {
      if (part.cluster == formats::kNone) continue;
      const formats::Cluster& cluster = package_.clusters()[part.cluster];
      for (const formats::Membership& member :
           package_.memberships().subspan(cluster.first_member, cluster.member_count)) {
        if (member.share > 0) carries[member.vertex] = 1;
      }
    }
    return carries;
  }

  void masses() {
    double least = INFINITY, largest = 0;
    std::uint32_t lightest = 0;
    const std::vector<char> carries = carriers();
    for (std::uint32_t v = 0; v < package_.physicalVertices().size(); ++v) {
      if (carries[v] != 0) continue;
      const double mass = double(package_.physicalVertices()[v].mass);
      if (mass < least) least = mass, lightest = v;
      largest = std::max(largest, mass);
    }
    if (largest > kMostMassRatio * least) {
      add("mass-ratio", Severity::warning,
          "the heaviest physical vertex weighs " + rounded(largest / least) + " times the lightest", 1,
          "Bake with tetrahedra.method=stuffing, or with another number of physical vertices.")
          .place = numbers("physical vertices", {lightest});
    }
  }

  void volume() {
    const double source = double(package_.info().source_volume), physical = double(package_.info().physical_volume);
    if (!(source > 0)) return;
    const double ratio = physical / source;
    const bool far = ratio < 0.7 || ratio > 2;
    add("volume-ratio", far ? Severity::warning : Severity::info,
        "the tetrahedra fill " + rounded(100 * ratio) + " % of the volume that the source encloses", 1,
        far ? "Use tetrahedra.method=stuffing or delaunay, or more physical vertices, if thin parts matter." : "");
  }

  void pieces() {
    const auto list = package_.pieces();
    Finding& f = add("pieces", Severity::info,
                     counted(list.size(), "piece", "pieces") + " with " +
                         counted(package_.physicalVertices().size(), "physical vertex", "physical vertices") + ", " +
                         counted(package_.tetrahedra().size(), "tetrahedron", "tetrahedra") + " and " +
                         counted(package_.clusters().size(), "cluster", "clusters"),
                     list.size(), "");
    for (std::size_t i = 0; i < list.size() && i < 8; ++i)
      f.place += (i == 0 ? "" : ", ") + std::string(package_.text(list[i].name));
    if (list.size() > 8) f.place += ", ...";
  }

  void textures() {
    std::vector<std::uint32_t> empty, unknown, mislabelled;
    for (std::uint32_t t = 0; t < package_.textures().size(); ++t) {
      const formats::Texture& texture = package_.textures()[t];
      const auto bytes = bytesOf(package_, texture);
      const std::string mime = pictureMime(bytes);
      if (bytes.empty()) {
        empty.push_back(t);
      } else if (mime.empty() && package_.text(texture.mime) != "image/x-tga") {  // TGA has no magic
        unknown.push_back(t);
      } else if (!mime.empty() && mime != package_.text(texture.mime)) {
        mislabelled.push_back(t);
      }
    }
    const auto names = [&](const std::vector<std::uint32_t>& textures) {
      return list(textures, [&](std::uint32_t t) { return std::string(package_.text(package_.textures()[t].name)); });
    };
    if (!empty.empty()) {
      add("missing-texture", Severity::warning,
          counted(empty.size(), "picture is", "pictures are") + " missing from the package", empty.size(),
          "Put the picture beside the source and bake again.")
          .place = names(empty);
    }
    if (!unknown.empty()) {
      add("unknown-picture", Severity::warning,
          counted(unknown.size(), "picture is", "pictures are") + " in no format this tool knows by its first bytes",
          unknown.size(), "Save it as PNG or JPEG and bake again.")
          .place = names(unknown);
    }
    if (!mislabelled.empty()) {
      add("mislabelled-picture", Severity::warning,
          counted(mislabelled.size(), "picture is", "pictures are") + " not of the type the package says",
          mislabelled.size(), "Bake again with this version.")
          .place = names(mislabelled);
    }
  }

  const formats::PackageView& package_;
  double diagonal_;
  std::vector<Finding> findings_;
};

}  // namespace

std::vector<Finding> checkPackage(const formats::PackageView& package) { return PackageCheck(package).run(); }

std::vector<Finding> checkPictures(const formats::PackageView& package, const ImportOptions& options) {
  std::vector<std::span<const std::byte>> pictures;
  for (const formats::Texture& texture : package.textures()) pictures.push_back(bytesOf(package, texture));
  const std::vector<PictureState> states = pictureStates(pictures, options);
  std::vector<Finding> findings;
  for (const PictureRemark& remark : kPictureRemarks) {
    std::vector<std::string> names;
    for (std::size_t t = 0; t < states.size(); ++t) {
      if (states[t] == remark.state && !pictures[t].empty())
        names.emplace_back(package.text(package.textures()[t].name));
    }
    if (names.empty()) continue;
    findings.push_back({remark.id,
                        Severity::warning,
                        counted(names.size(), "texture", "textures") + " " + remark.message,
                        names.size(),
                        "",
                        {},
                        listed(names),
                        std::string(kPictureCure) + " Then bake again."});
  }
  return findings;
}

std::string packageVerdict(const std::vector<Finding>& findings) {
  const std::string counts = countedSeverities(findings);
  if (hasErrors(findings)) return counts + ": it should not be simulated";
  return counts == "no findings" ? "sound: it can be simulated" : counts + ": it can be simulated";
}

}  // namespace sinew::tools
