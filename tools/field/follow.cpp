// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/follow.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "runtime/geometry/symmetric_eigen.h"

namespace sinew::tools::field {
namespace {

using Eigen::Vector3d;
using Tetrahedron = std::array<std::uint32_t, 4>;

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
constexpr std::size_t kTinyCount = 8;
constexpr double kTinyVolume = 0.01;
// Shared vertices lie on a line where their spread across it is less than so much of that along it.
constexpr double kLine = 1e-3;
// Rings of tetrahedra around a host that a follower may be hung on: about what a function shows as one strain.
constexpr int kRings = 3;

// Sets of tetrahedra joined by faces, largest volume first.
std::vector<std::vector<std::size_t>> faceSets(std::span<const Tetrahedron> tetrahedra,
                                               const std::vector<double>& volumes) {
  std::vector<std::size_t> parent(tetrahedra.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t t) {
    while (parent[t] != t) t = parent[t] = parent[parent[t]];
    return t;
  };
  std::vector<std::pair<std::array<std::uint32_t, 3>, std::size_t>> faces;
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    if (volumes[t] == 0) continue;
    for (std::size_t k = 0; k < 4; ++k) {
      std::array<std::uint32_t, 3> face = {tetrahedra[t][(k + 1) % 4], tetrahedra[t][(k + 2) % 4],
                                           tetrahedra[t][(k + 3) % 4]};
      std::sort(face.begin(), face.end());
      faces.emplace_back(face, t);
    }
  }
  std::sort(faces.begin(), faces.end());
  for (std::size_t i = 1; i < faces.size(); ++i) {
    if (faces[i].first != faces[i - 1].first) continue;
    const auto a = root(faces[i].second), b = root(faces[i - 1].second);
    parent[std::max(a, b)] = std::min(a, b);
  }
  std::map<std::size_t, std::vector<std::size_t>> by_root;
  for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
    if (volumes[t] > 0) by_root[root(t)].push_back(t);
  }
  std::vector<std::pair<double, std::vector<std::size_t>>> sets;
  for (auto& [first, list] : by_root) {
    double volume = 0;
    for (const auto t : list) volume += volumes[t];
    sets.emplace_back(volume, std::move(list));
  }
  std::stable_sort(sets.begin(), sets.end(), [](const auto& a, const auto& b) { return a.first > b.first; });
  std::vector<std::vector<std::size_t>> result;
  for (auto& set : sets) result.push_back(std::move(set.second));
  return result;
}

// Whether a set that shares these points can turn about them.
bool onALine(const std::vector<Vector3d>& points) {
  if (points.size() < 3) return true;
  Vector3d mean = Vector3d::Zero();
  for (const auto& p : points) mean += p / double(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const auto& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::VectorXd along = geometry::symmetricEigenvalues(spread);
  return along[1] <= kLine * kLine * along[2];
}

class Joiner {
 public:
  Joiner(std::span<const Vector3d> positions, std::span<const Tetrahedron> tetrahedra,
         const std::vector<double>& volumes)
      : positions_(positions),
        tetrahedra_(tetrahedra),
        volumes_(volumes),
        followers_(positions.size()),
        placed_(positions.size(), false),
        tetrahedra_of_(positions.size()) {
    for (std::size_t t = 0; t < tetrahedra.size(); ++t) {
      if (volumes[t] == 0) continue;
      for (const auto v : tetrahedra[t]) tetrahedra_of_[v].push_back(t);
    }
  }

  std::vector<Follower> run() {
    const double total = std::accumulate(volumes_.begin(), volumes_.end(), 0.0);
    const auto sets = faceSets(tetrahedra_, volumes_);
    for (const auto& set : sets) {
      if (!hosts_.empty()) join(set, total);
      for (const auto t : set) {
        for (const auto v : tetrahedra_[t]) placed_[v] = true;
        hosts_.push_back(t);
      }
    }
    for (std::uint32_t v = 0; v < positions_.size(); ++v) {
      if (!placed_[v] && !hosts_.empty()) follow(v, nearestHost(positions_[v]));
    }
    return std::move(followers_);
  }

 private:
  std::size_t sharedCount(std::size_t t) const {
    return std::size_t(std::count_if(tetrahedra_[t].begin(), tetrahedra_[t].end(), [&](auto v) { return placed_[v]; }));
  }

  Vector3d centre(std::size_t t) const {
    Vector3d c = Vector3d::Zero();
    for (const auto v : tetrahedra_[t]) c += 0.25 * positions_[v];
    return c;
  }

  std::size_t nearestHost(const Vector3d& at) const {
    std::size_t best = kNone;
    double least = std::numeric_limits<double>::infinity();
    for (const auto t : hosts_) {
      const double d = (centre(t) - at).squaredNorm();
      if (d < least) least = d, best = t;
    }
    return best;
  }

  void join(const std::vector<std::size_t>& set, double total) {
    std::vector<std::uint32_t> shared;
    double volume = 0;
    std::size_t joint = set.front();
    for (const auto t : set) {
      volume += volumes_[t];
      if (sharedCount(t) > sharedCount(joint)) joint = t;
      for (const auto v : tetrahedra_[t]) {
        if (placed_[v]) shared.push_back(v);
      }
    }
    std::sort(shared.begin(), shared.end());
    shared.erase(std::unique(shared.begin(), shared.end()), shared.end());
    std::vector<Vector3d> points;
    for (const auto v : shared) points.push_back(positions_[v]);
    if (!onALine(points)) return;
    const std::size_t host = hostAt(shared, joint);
    const bool tiny = set.size() < kTinyCount || volume < kTinyVolume * total;
    const std::vector<std::size_t> followers = tiny ? set : std::vector<std::size_t>{joint};
    for (const auto t : followers) {
      for (const auto v : tetrahedra_[t]) {
        if (!placed_[v] && followers_[v].vertex.empty()) follow(v, host);
      }
    }
  }

  // The tetrahedron of the larger sets that has most of the shared vertices, the nearest of those.
  std::size_t hostAt(const std::vector<std::uint32_t>& shared, std::size_t joint) const {
    if (shared.empty()) return nearestHost(centre(joint));
    std::size_t best = kNone, most = 0;
    double least = 0;
    for (const auto t : hosts_) {
      const auto count = std::size_t(std::count_if(tetrahedra_[t].begin(), tetrahedra_[t].end(), [&](auto v) {
        return std::binary_search(shared.begin(), shared.end(), v);
      }));
      if (count == 0 || count < most) continue;
      const double d = (centre(t) - centre(joint)).squaredNorm();
      if (count > most || d < least) best = t, most = count, least = d;
    }
    return best;
  }

  // Barycentric coordinates in the host or, where they are smaller, in four vertices around it that span more: in a
  // flat host they would multiply its strain by the distance over its height, and rounding with it.
  void follow(std::uint32_t v, std::size_t host) {
    Follower best = inHost(v, tetrahedra_[host]);
    std::vector<std::uint32_t> around = best.vertex;
    for (int ring = 0; ring < kRings && sizeOf(best) > 1; ++ring) {
      around = grown(around);
      const Follower wider = inWidest(v, around);
      if (wider.vertex.size() == 4 && sizeOf(wider) < sizeOf(best)) best = wider;
    }
    followers_[v] = std::move(best);
  }

  static double sizeOf(const Follower& follower) {
    double sum = 0;
    for (const double w : follower.weight) sum += std::abs(w);
    return sum > 0 ? sum : std::numeric_limits<double>::infinity();
  }

  // A host's vertex that follows itself is replaced by what it follows.
  Follower inHost(std::uint32_t v, const Tetrahedron& tet) const {
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k) edges.col(k) = positions_[tet[std::size_t(k) + 1]] - positions_[tet[0]];
    const Vector3d b = edges.inverse() * (positions_[v] - positions_[tet[0]]);
    const std::array<double, 4> weights = {1 - b.sum(), b[0], b[1], b[2]};
    std::map<std::uint32_t, double> sum;
    for (std::size_t k = 0; k < 4; ++k) {
      const Follower& up = followers_[tet[k]];
      if (up.vertex.empty()) sum[tet[k]] += weights[k];
      for (std::size_t i = 0; i < up.vertex.size(); ++i) sum[up.vertex[i]] += weights[k] * up.weight[i];
    }
    Follower result;
    for (const auto& [u, w] : sum) {
      result.vertex.push_back(u);
      result.weight.push_back(w);
    }
    return result;
  }

  // In the four that pivoting finds among these vertices that move by themselves.
  Follower inWidest(std::uint32_t v, const std::vector<std::uint32_t>& around) const {
    std::vector<std::uint32_t> free;
    double size = 0;
    for (const auto u : around) {
      if (u == v || !followers_[u].vertex.empty()) continue;
      free.push_back(u);
      size = std::max(size, (positions_[u] - positions_[v]).norm());
    }
    if (free.size() < 4 || !(size > 0)) return {};
    Eigen::MatrixXd rows(4, Eigen::Index(free.size()));
    for (std::size_t i = 0; i < free.size(); ++i)
      rows.col(Eigen::Index(i)) << (positions_[free[i]] - positions_[v]) / size, 1;
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(rows);
    if (qr.rank() < 4) return {};
    const Eigen::VectorXd weights = qr.solve(Eigen::Vector4d::UnitW());
    Follower result;
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (weights[Eigen::Index(i)] == 0) continue;
      result.vertex.push_back(free[i]);
      result.weight.push_back(weights[Eigen::Index(i)]);
    }
    return result;
  }

  // These vertices and all of the sets so far that share a tetrahedron with them.
  std::vector<std::uint32_t> grown(const std::vector<std::uint32_t>& vertices) const {
    std::vector<std::uint32_t> result = vertices;
    for (const auto v : vertices) {
      for (const auto t : tetrahedra_of_[v]) {
        for (const auto u : tetrahedra_[t]) {
          if (placed_[u]) result.push_back(u);
        }
      }
    }
    std::sort(result.begin(), result.end());
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

  std::span<const Vector3d> positions_;
  std::span<const Tetrahedron> tetrahedra_;
  const std::vector<double>& volumes_;
  std::vector<Follower> followers_;
  std::vector<bool> placed_;        // vertices of the sets so far
  std::vector<std::size_t> hosts_;  // their tetrahedra
  std::vector<std::vector<std::size_t>> tetrahedra_of_;
};

}  // namespace

std::vector<Follower> findFollowers(std::span<const Vector3d> positions, std::span<const Tetrahedron> tetrahedra,
                                    const std::vector<double>& volumes) {
  return Joiner(positions, tetrahedra, volumes).run();
}

}  // namespace sinew::tools::field
