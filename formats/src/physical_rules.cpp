// SPDX-License-Identifier: MIT
#include "value_rules.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "value_tests.h"

namespace sinew::formats {
namespace {

// Of radii, in diagonals. Places lie within a diagonal of the bounds, so two of them at most 3 apart along an axis; and
// outputs square a coordinate in a cluster twice: (kMostRadius / kLeastRadius)^4 = 8e37 is a float.
constexpr float kLeastRadius = 1e-9F, kMostRadius = 3;
// Of the inverse of a moment of places within a radius: bakes cut eigenvalues off at 1e-5 of the largest, which is at
// least the farthest member's mu; here that is 1e-7.
constexpr float kMostInverse = 1e12F;
// Of an entry of a pseudo-inverse times its moment, which is a projection: 1, and a tenth for rounding.
constexpr double kMostProjection = 1.1;

/// A frequency is at least 0; infinite: rigid.
unsigned noFrequency(float value) {
  return unsigned(!(value >= 0.0F)) | (unsigned(value > kMostNumber) & unsigned(!std::isinf(value)));
}

class PhysicalRules {
 public:
  PhysicalRules(const PackageView& view, const Reach& reach, Refusal& refuse)
      : view_(view), reach_(reach), refuse_(refuse) {}

  bool hold() {
    return checkPieces() && checkVertices() && checkTetrahedra() && checkClusters() && checkMemberships() &&
           checkMechanics() && checkPinSets();
  }

 private:
  bool checkPieces() {
    std::uint64_t vertices = 0, tetrahedra = 0, clusters = 0;
    for (std::size_t i = 0; i < view_.pieces().size(); ++i) {
      const PieceRange& piece = view_.pieces()[i];
      if (piece.first_vertex != vertices || piece.first_tetrahedron != tetrahedra || piece.first_cluster != clusters) {
        return refuse_(section::pieces, i, "a run does not start where the piece before it ends");
      }
      if (piece.vertex_count == 0 || piece.cluster_count == 0) {
        return refuse_(section::pieces, i, "has no vertices or no clusters");
      }
      vertices += piece.vertex_count;
      tetrahedra += piece.tetrahedron_count;
      clusters += piece.cluster_count;
      if (vertices > view_.physicalVertices().size() || tetrahedra > view_.tetrahedra().size() ||
          clusters > view_.clusters().size()) {
        return refuse_(section::pieces, i, "reaches beyond the vertices, tetrahedra or clusters that there are");
      }
    }
    if (vertices != view_.physicalVertices().size() || tetrahedra != view_.tetrahedra().size() ||
        clusters != view_.clusters().size()) {
      return refuse_(section::pieces, "the pieces do not cover all vertices, tetrahedra and clusters");
    }
    return true;
  }

  bool checkVertices() {
    const Reach reach = reach_;
    if (!check(refuse_, section::physical_vertices, view_.physicalVertices(),
               "position more than a diagonal outside the bounds of section INFO, or mass not above 0 to 1e18",
               [reach](const PhysicalVertex& v) {
                 return reach.beyond(v.rest_position) | notPositive(v.mass, kMostNumber);
               })) {
      return false;
    }
    double mass = 0;
    for (const PhysicalVertex& v : view_.physicalVertices()) mass += double(v.mass);
    return std::abs(mass - double(view_.info().total_mass)) <= kSumTolerance * mass ||
           refuse_(section::physical_vertices, "the masses do not sum to total_mass of section INFO");
  }

  bool checkTetrahedra() {
    for (const PieceRange& piece : view_.pieces()) {
      const std::uint32_t first = piece.first_vertex, count = piece.vertex_count;
      const std::size_t index = firstBad(
          view_.tetrahedra().subspan(piece.first_tetrahedron, piece.tetrahedron_count), [=](const Tetrahedron& t) {
            const auto [a, b, c, d] = t.vertex;
            // v - first wraps to a large number where v < first, so one comparison tests both ends.
            return unsigned(a - first >= count) | unsigned(b - first >= count) | unsigned(c - first >= count) |
                   unsigned(d - first >= count) | unsigned(a == b) | unsigned(a == c) | unsigned(a == d) |
                   unsigned(b == c) | unsigned(b == d) | unsigned(c == d);
          });
      if (index != kAllGood) {
        return refuse_(section::tetrahedra, piece.first_tetrahedron + index,
                       "a vertex outside its piece, or the same vertex twice");
      }
    }
    return true;
  }

  bool checkClusters() {
    std::uint64_t member = 0;
    std::uint32_t quadratic = 0;
    for (std::size_t b = 0; b < view_.pieces().size(); ++b) {
      const PieceRange& piece = view_.pieces()[b];
      for (std::size_t i = piece.first_cluster; i < std::size_t{piece.first_cluster} + piece.cluster_count; ++i) {
        const Cluster& c = view_.clusters()[i];
        const auto bad = [&](const char* what) { return refuse_(section::clusters, i, what); };
        const auto mode = static_cast<std::uint32_t>(c.mode);
        if (mode > static_cast<std::uint32_t>(ClusterMode::quadratic)) return bad("unknown mode");
        if (c.piece != b) return bad("is listed by another piece than the one it names");
        if (c.first_member != member) return bad("its members do not start where those of the cluster before end");
        if (c.member_count == 0) return bad("has no members");
        member += c.member_count;
        if (member > view_.memberships().size()) return bad("its members reach beyond section MEMB");
        if (c.mode == ClusterMode::quadratic) {
          if (c.quadratic != quadratic || c.quadratic >= view_.quadraticMoments().size()) {
            return bad("its moment is not the next one of section AQQ9");
          }
          ++quadratic;
        } else if (c.quadratic != kNone) {
          return bad("has a quadratic moment, but its mode is not quadratic");
        }
        const float diagonal = view_.info().diagonal;
        if (outside(c.radius, kLeastRadius * diagonal, std::max(kMostRadius * diagonal, 1.0F)) != 0) {
          return bad("radius is outside 1e-9 to 3 diagonals of section INFO (or 1)");
        }
        if (notPositive(c.mass, 1.001F * view_.info().total_mass) != 0) {
          return bad("mass is not above 0 to total_mass of section INFO");
        }
        if (outsideUnit(c.alpha) != 0) return bad("alpha is outside 0 to 1");
        if ((noFrequency(c.stretch_hz) | noFrequency(c.bend_hz) | noFrequency(c.twist_hz)) != 0) {
          return bad("a frequency is neither 0 to 1e18 nor infinite");
        }
        if (reach_.beyond(c.rest_center) != 0) {
          return bad("rest_center is more than a diagonal outside the bounds of section INFO");
        }
        if (beyond(c.a_qq, kMostInverse) != 0) return bad("a_qq is not finite or beyond 1e12");
      }
    }
    if (member != view_.memberships().size()) return refuse_(section::memberships, "has members of no cluster");
    if (quadratic != view_.quadraticMoments().size()) {
      return refuse_(section::quadratic_moments, "has moments of no cluster");
    }
    return check(refuse_, section::quadratic_moments, view_.quadraticMoments(), "not finite or beyond 1e12",
                 [](const QuadraticMoment& m) { return beyond(m.a_qq, kMostInverse); });
  }

  /// Whether a member lies outside its cluster's radius by more than rounding.
  bool farFrom(const Cluster& cluster, const Float3& place) const {
    double squared = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double off = double(place[axis]) - double(cluster.rest_center[axis]);
      squared += off * off;
    }
    return !(std::sqrt(squared) <= 1.001 * double(cluster.radius) + 1e-6 * double(view_.info().diagonal));
  }

  /// Fault of the pseudo-inverses of a cluster's moments; null if none. Fitting multiplies
  /// sums over the members by the inverse: what makes more than 1 of the moment would throw them anywhere.
  const char* faultOfMoments(const Cluster& cluster) const {
    std::array<double, 9> mean = {};
    std::array<std::array<double, 9>, 9> moment = {};  // its lower triangle
    const std::size_t terms = cluster.mode == ClusterMode::quadratic ? 9 : 3;
    for (const Membership& m : view_.memberships().subspan(cluster.first_member, cluster.member_count)) {
      std::array<double, 9> q = {};
      for (std::size_t k = 0; k < 3; ++k) {
        q[k] = (double(view_.physicalVertices()[m.vertex].rest_position[k]) - double(cluster.rest_center[k])) /
               double(cluster.radius);
      }
      for (std::size_t k = 0; k < 3; ++k) {
        q[3 + k] = q[k] * q[k];
        q[6 + k] = q[k] * q[(k + 1) % 3];
      }
      for (std::size_t row = 0; row < terms; ++row) {
        const double weighed = double(m.mu) * q[row];
        mean[row] += weighed;
        for (std::size_t column = 0; column <= row; ++column) moment[row][column] += weighed * q[column];
      }
    }
    for (std::size_t row = 0; row < terms; ++row) {
      for (std::size_t column = 0; column <= row; ++column) moment[row][column] -= mean[row] * mean[column];
    }
    const auto [xx, yy, zz, xy, yz, zx] = cluster.a_qq;
    if (!isInverse<3>({xx, xy, yy, zx, yz, zz}, moment)) return "a_qq is not the inverse of its members' moment";
    if (cluster.mode == ClusterMode::quadratic &&
        !isInverse<9>(view_.quadraticMoments()[cluster.quadratic].a_qq, moment)) {
      return "its element of section AQQ9 is not the inverse of its members' moment";
    }
    return nullptr;
  }

  /// Whether a symmetric matrix, its lower triangle row by row, times the corner of a moment, of which the lower
  /// triangle is read, has entries as a projection has.
  template <std::size_t kSize>
  static bool isInverse(const std::array<float, kSize*(kSize + 1) / 2>& triangle,
                        const std::array<std::array<double, 9>, 9>& moment) {
    bool good = true;
    for (std::size_t row = 0; row < kSize; ++row) {
      for (std::size_t column = 0; column < kSize; ++column) {
        double sum = 0;
        for (std::size_t k = 0; k < kSize; ++k) {
          const std::size_t low = std::min(row, k), high = std::max(row, k);
          sum += double(triangle[high * (high + 1) / 2 + low]) * moment[std::max(k, column)][std::min(k, column)];
        }
        good &= std::abs(sum) <= kMostProjection;
      }
    }
    return good;
  }

  bool checkMemberships() {
    std::vector<float> shares(view_.physicalVertices().size(), 0.0F);
    for (std::size_t i = 0; i < view_.clusters().size(); ++i) {
      const Cluster& cluster = view_.clusters()[i];
      const PieceRange& piece = view_.pieces()[cluster.piece];
      const std::uint64_t end = std::uint64_t{piece.first_vertex} + piece.vertex_count;
      std::uint64_t lowest = piece.first_vertex;
      double mu = 0;
      for (std::size_t k = cluster.first_member; k < std::size_t{cluster.first_member} + cluster.member_count; ++k) {
        const Membership& m = view_.memberships()[k];
        if (m.vertex < lowest || m.vertex >= end) {
          return refuse_(section::memberships, k, "vertex not ascending, or outside the piece of its cluster");
        }
        lowest = std::uint64_t{m.vertex} + 1;
        if ((outsideUnit(m.mu) | outsideUnit(m.share)) != 0) {
          return refuse_(section::memberships, k, "mu or share is outside 0 to 1");
        }
        if (m.mu > 0 && farFrom(cluster, view_.physicalVertices()[m.vertex].rest_position)) {
          return refuse_(section::memberships, k, "the vertex has mu, but lies outside the radius of its cluster");
        }
        mu += static_cast<double>(m.mu);
        shares[m.vertex] += m.share;
      }
      if (std::abs(mu - 1.0) > kSumTolerance) {
        return refuse_.section(section::memberships, "mu of cluster %zu does not sum to 1", i);
      }
      if (const char* fault = faultOfMoments(cluster); fault != nullptr) return refuse_(section::clusters, i, fault);
    }
    const std::size_t index = firstBad(std::span<const float>{shares}, [](float sum) {
      return unsigned(!(std::abs(sum - 1.0F) <= static_cast<float>(kSumTolerance)));
    });
    return index == kAllGood ||
           refuse_.section(section::memberships, "the shares of physical vertex %zu over its clusters do not sum to 1",
                           index);
  }

  bool checkMechanics() {
    const std::size_t vertices = view_.physicalVertices().size();
    for (const auto& [id, values] : {std::pair{section::vertex_stiffness, view_.vertexStiffness()},
                                     std::pair{section::pin_weights, view_.pinWeights()}}) {
      if (!values.empty() && values.size() != vertices) {
        return refuse_.section(id, "%zu elements for %zu physical vertices", values.size(), vertices);
      }
      if (!check(refuse_, id, values, "outside 0 to 1", [](float value) { return outsideUnit(value); })) return false;
    }
    if (!view_.mechanics().empty() && view_.mechanics().size() != view_.clusters().size()) {
      return refuse_.section(section::mechanics, "%zu elements for %zu clusters", view_.mechanics().size(),
                             view_.clusters().size());
    }
    for (std::size_t i = 0; i < view_.mechanics().size(); ++i) {
      const char* fault = faultOf(view_.mechanics()[i]);
      if (fault != nullptr) return refuse_(section::mechanics, i, fault);
    }
    return true;
  }

  /// Fault of a cluster's mechanics; null if none.
  const char* faultOf(const ClusterMechanics& m) const {
    if (m.stiffness > StiffnessModel::elastic) return "unknown stiffness model";
    if (m.limit > LimitMethod::curve) return "unknown limit method";
    if (m.volume > VolumeMethod::principal) return "unknown volume method";
    for (const float beta : m.per_step_beta) {
      if (outsideUnit(beta) != 0) return "per_step_beta is outside 0 to 1";
    }
    if (outside(m.young, 0, 1e12F) != 0) return "young is outside 0 to 1e12";
    if (outside(m.poisson, 0, 0.499F) != 0) return "poisson is outside 0 to 0.499";
    if (outside(m.damping, 0, 1e5F) != 0) return "damping is outside 0 to 1e5";
    if (outside(m.stretch_min, 0.05F, 1) != 0) return "stretch_min is outside 0.05 to 1";
    if (outside(m.stretch_max, 1, 20) != 0) return "stretch_max is outside 1 to 20";
    if (outside(m.norm_max, 3, 1000) != 0) return "norm_max is outside 3 to 1000";
    if (outside(m.norm_limit, m.norm_max, 1000) != 0) return "norm_limit is outside norm_max to 1000";
    if ((outside(m.plastic_yield, 0, 10) | outside(m.plastic_creep, 0, 1e5F) | outside(m.plastic_limit, 0, 10)) != 0) {
      return "plastic_yield or plastic_limit is outside 0 to 10, or plastic_creep outside 0 to 1e5";
    }
    if (outside(m.contraction, 0, 0.9F) != 0) return "contraction is outside 0 to 0.9";
    double length2 = 0;  // of no float but 0 it is 0
    for (const float x : m.fibre) length2 += double(x) * double(x);
    if (length2 != 0 && !(length2 >= 0.999 && length2 <= 1.001)) return "fibre is neither 0 nor of length 1";
    if (m.channel != kNone && m.channel >= view_.channels().size()) return "its channel is not in section CHAN";
    if (m.reserved0 != 0) return "a reserved field is not 0";
    return faultOfCurve(m);
  }

  const char* faultOfCurve(const ClusterMechanics& m) const {
    if (m.limit != LimitMethod::curve) {
      return m.first_curve_point == 0 && m.curve_point_count == 0 ? nullptr : "has a curve that its limit does not use";
    }
    const std::span<const CurvePoint> all = view_.curvePoints();
    if (m.curve_point_count < 2) return "its curve has fewer than 2 points";
    if (m.first_curve_point >= all.size() || m.curve_point_count > all.size() - m.first_curve_point) {
      return "its curve reaches beyond section CURV";
    }
    const auto points = all.subspan(m.first_curve_point, m.curve_point_count);
    for (std::size_t k = 0; k < points.size(); ++k) {
      const CurvePoint& point = points[k];
      if (outside(point.norm, 3, 1e6F) != 0 || outside(point.response, 3, point.norm) != 0) {
        return "a point of its curve has a norm outside 3 to 1e6, or a response outside 3 to that norm";
      }
      if (k == 0 && point.response != point.norm) return "the first point of its curve changes the norm";
      if (k > 0 && (!(point.norm > points[k - 1].norm) || !(point.response >= points[k - 1].response))) {
        return "its curve is not ascending";
      }
    }
    return nullptr;
  }

  bool checkPinSets() {
    std::uint64_t end = 0;
    for (std::size_t i = 0; i < view_.pinSets().size(); ++i) {
      const PinSet& set = view_.pinSets()[i];
      if (set.method > 3 || set.reserved0 != 0) {
        return refuse_(section::pin_sets, i, "unknown method, or a reserved field that is not 0");
      }
      if (!checkRun(refuse_, section::pin_sets, i, set.first, set.count, view_.pinSetVertices(),
                    view_.physicalVertices().size(), end)) {
        return false;
      }
    }
    return end == view_.pinSetVertices().size() || refuse_(section::pin_set_vertices, "has vertices of no pin set");
  }

  const PackageView& view_;
  const Reach& reach_;
  Refusal& refuse_;
};

}  // namespace

bool checkPhysical(const PackageView& view, const Reach& reach, Refusal& refuse) {
  return PhysicalRules(view, reach, refuse).hold();
}

}  // namespace sinew::formats
