// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/alignment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kCoarse = 150;
constexpr std::size_t kFine = 1200;
constexpr std::size_t kFinalists = 8;
// Points that lie further off, in this part of all, belong to what one of the two lacks.
constexpr double kKept = 0.85;
// Of the diagonal: surfaces this near lie on each other as they are; need no refinement.
constexpr double kGood = 1e-3;
constexpr double kExact = 1e-4;
constexpr int kRefinements = 30;
constexpr int kTurntable = 12;
// Ratios of the units that files are made in.
constexpr std::array<double, 15> kRatios = {1,    10,   100,    1000,  0.1,        0.01,     0.001,     0.0254,
                                            2.54, 25.4, 0.3048, 30.48, 1 / 0.0254, 1 / 2.54, 1 / 0.3048};

std::vector<Vector3d> samples(const VisualMesh& mesh, std::size_t most) {
  // Of the points that faces use, evenly over their order.
  std::vector<std::uint8_t> used(mesh.welded_positions.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t p : mesh.weldedTriangle(t)) used[p] = 1;
  }
  std::vector<Vector3d> all;
  for (std::size_t p = 0; p < used.size(); ++p) {
    if (used[p] != 0) all.push_back(mesh.welded_positions[p]);
  }
  std::vector<Vector3d> chosen;
  for (std::size_t i = 0; i < std::min(most, all.size()); ++i) {
    chosen.push_back(all[i * all.size() / std::min(most, all.size())]);
  }
  return chosen;
}

double keptMean(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  values.resize(std::max<std::size_t>(1, std::size_t(kKept * double(values.size()))));
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

// Half the diagonal of the points' mean square distance from their centre: a size that loose parts change little.
struct Extent {
  Vector3d center, middle;
  double radius;
};

Extent extentOf(const VisualMesh& mesh) {
  const std::vector<Vector3d> points = samples(mesh, 4 * kFine);
  Vector3d center = Vector3d::Zero();
  for (const Vector3d& x : points) center += x / double(points.size());
  double squared = 0;
  for (const Vector3d& x : points) squared += (x - center).squaredNorm() / double(points.size());
  return {center, 0.5 * (mesh.bounds_min + mesh.bounds_max), std::sqrt(squared)};
}

// Of a fit to points that were scaled already, or not. False where it is none.
bool take(const Eigen::Matrix4d& fit, bool scales, Similarity& s) {
  const double scale = std::cbrt(std::abs(fit.topLeftCorner<3, 3>().determinant()));
  if (!fit.allFinite() || !(scale > 0)) return false;
  if (scales) s.scale = scale;
  s.rotation = fit.topLeftCorner<3, 3>() / scale;
  s.translation = fit.topRightCorner<3, 1>();
  return true;
}

// Turns that map axes to axes, the plainest first: none, z up to y up and back, then the rest.
std::vector<Matrix3d> axisTurns() {
  std::vector<Matrix3d> turns;
  const auto add = [&](const Matrix3d& turn) {
    if (std::none_of(turns.begin(), turns.end(), [&](const Matrix3d& t) { return t.isApprox(turn); }))
      turns.push_back(turn);
  };
  Matrix3d up;
  up << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  add(Matrix3d::Identity());
  add(up);
  add(up.transpose());
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int signs = 0; signs < 8; ++signs) {
      Matrix3d turn = Matrix3d::Zero();
      for (int k = 0; k < 3; ++k) turn(k, order[std::size_t(k)]) = ((signs >> k) & 1) != 0 ? -1 : 1;
      if (turn.determinant() > 0) add(turn);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  for (int k = 1; k < kTurntable; ++k) {
    add(Eigen::AngleAxisd(2 * double(EIGEN_PI) * k / kTurntable, Vector3d::UnitY()).toRotationMatrix());
  }
  return turns;
}

// The similarity that fits most pairs: fits all, leaves out the third that fits worst, fits again.
Similarity fitted(const std::vector<std::pair<Vector3d, Vector3d>>& pairs) {
  std::vector<std::pair<double, std::size_t>> order(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) order[i] = {0, i};
  Similarity s;
  for (int round = 0; round < kRefinements; ++round) {
    const std::size_t used = round == 0 ? pairs.size() : pairs.size() - pairs.size() / 3;
    Eigen::Matrix3Xd to(3, Eigen::Index(used));
    Eigen::Matrix3Xd from(3, Eigen::Index(used));
    for (std::size_t i = 0; i < used; ++i) {
      to.col(Eigen::Index(i)) = pairs[order[i].second].first;
      from.col(Eigen::Index(i)) = pairs[order[i].second].second;
    }
    if (!take(Eigen::umeyama(from, to, true), true, s)) break;
    for (auto& [error, i] : order) error = (s(pairs[i].second) - pairs[i].first).squaredNorm();
    std::sort(order.begin(), order.end());
  }
  return s;
}

class Judge {
 public:
  Judge(const Surface& old_surface, const Surface& new_surface, double diagonal)
      : old_surface_(old_surface), new_surface_(new_surface), diagonal_(diagonal) {}

  double error(const Similarity& s, const std::vector<Vector3d>& of_old, const std::vector<Vector3d>& of_new) const {
    std::vector<double> there;
    for (const Vector3d& x : of_new) there.push_back(old_surface_.nearest(s(x)).distance);
    std::vector<double> back;
    const Similarity inverse = s.inverse();
    for (const Vector3d& x : of_old) back.push_back(s.scale * new_surface_.nearest(inverse(x)).distance);
    return 0.5 * (keptMean(there) + keptMean(back)) / diagonal_;
  }

  Similarity refined(Similarity s, const std::vector<Vector3d>& of_new, bool scales) const {
    for (int round = 0; round < kRefinements; ++round) {
      std::vector<std::pair<double, std::size_t>> order;
      std::vector<Vector3d> target;
      for (std::size_t i = 0; i < of_new.size(); ++i) {
        const SurfacePoint at = old_surface_.nearest(s(of_new[i]));
        order.emplace_back(at.distance, i);
        target.push_back(at.position);
      }
      std::sort(order.begin(), order.end());
      order.resize(std::max<std::size_t>(4, std::size_t(kKept * double(order.size()))));
      Eigen::Matrix3Xd from(3, Eigen::Index(order.size()));
      Eigen::Matrix3Xd to(3, Eigen::Index(order.size()));
      for (std::size_t i = 0; i < order.size(); ++i) {
        from.col(Eigen::Index(i)) = (scales ? 1 : s.scale) * of_new[order[i].second];
        to.col(Eigen::Index(i)) = target[order[i].second];
      }
      if (!take(Eigen::umeyama(from, to, scales), scales, s)) break;
    }
    return s;
  }

 private:
  const Surface& old_surface_;
  const Surface& new_surface_;
  double diagonal_;
};

struct Candidate {
  Similarity similarity;
  double price;  // of being less plain: factor of the error, and diagonals
  double error;
  double cost() const { return error * (1 + 20 * price) + price * 0.05; }
};

}  // namespace

Similarity Similarity::inverse() const {
  Similarity back;
  back.scale = 1 / scale;
  back.rotation = rotation.transpose();
  back.translation = -back.scale * (back.rotation * translation);
  return back;
}

bool Similarity::isIdentity(double diagonal) const {
  return std::abs(scale - 1) < 1e-4 && (rotation - Matrix3d::Identity()).norm() < 1e-4 &&
         translation.norm() < 1e-4 * diagonal;
}

Alignment findAlignment(const VisualMesh& old_mesh, const Surface& old_surface, const VisualMesh& new_mesh,
                        const Surface& new_surface, const std::vector<std::pair<Vector3d, Vector3d>>& pairs) {
  const Judge judge(old_surface, new_surface, old_mesh.diagonal);
  const std::vector<Vector3d> fine_old = samples(old_mesh, kFine);
  const std::vector<Vector3d> fine_new = samples(new_mesh, kFine);
  Alignment found;
  found.error = judge.error(found.to_old, fine_old, fine_new);
  if (found.error < kGood) return found;

  const Extent of_old = extentOf(old_mesh);
  const Extent of_new = extentOf(new_mesh);
  const double ratio = of_old.radius / std::max(of_new.radius, 1e-300);
  const double unit = *std::min_element(kRatios.begin(), kRatios.end(), [&](double a, double b) {
    return std::abs(std::log(a / ratio)) < std::abs(std::log(b / ratio));
  });
  const std::array<std::pair<double, double>, 4> scales = {
      {{1, 0}, {unit, 0.01}, {ratio, 0.02}, {old_mesh.diagonal / new_mesh.diagonal, 0.02}}};
  const std::vector<Vector3d> coarse_old = samples(old_mesh, kCoarse);
  const std::vector<Vector3d> coarse_new = samples(new_mesh, kCoarse);
  std::vector<Candidate> candidates;
  const std::vector<Matrix3d> turns = axisTurns();
  for (std::size_t r = 0; r < turns.size(); ++r) {
    for (const auto& [scale, price_of_scale] : scales) {
      // A scale that misses the size by more than half fits nothing.
      if (std::abs(std::log(scale / ratio)) > 0.7) continue;
      for (int place = 0; place < 3; ++place) {
        Similarity s{scale, turns[r], Vector3d::Zero()};
        if (place == 1) s.translation = of_old.center - s(of_new.center);
        if (place == 2) s.translation = of_old.middle - s(of_new.middle);
        const double price = price_of_scale + (r == 0 ? 0 : r < 3 ? 0.005 : 0.02) + (place == 0 ? 0 : 0.01);
        candidates.push_back({s, price, judge.error(s, coarse_old, coarse_new)});
      }
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.cost() < b.cost(); });
  if (candidates.size() > kFinalists) candidates.resize(kFinalists);
  if (candidates.empty()) return found;
  for (Candidate& c : candidates) c.error = judge.error(c.similarity, fine_old, fine_new);
  const auto best = *std::min_element(candidates.begin(), candidates.end(),
                                      [](const Candidate& a, const Candidate& b) { return a.cost() < b.cost(); });
  found = {best.similarity, best.error};
  if (found.error < kExact) return found;
  // The model was turned or moved by hand, or changed its shape: then the plain one stays.
  const auto offer = [&](const Similarity& s) {
    const double error = judge.error(s, fine_old, fine_new);
    if (error < 0.5 * best.error && error < found.error) found = {s, error};
  };
  for (const Candidate& c : candidates) {
    const Similarity s = judge.refined(c.similarity, coarse_new, false);
    offer(s);
    // Its scale too, where it is not a unit's; that shrinking onto the surface is no success, the way back says.
    if (c.similarity.scale != 1 && c.similarity.scale != unit) offer(judge.refined(s, fine_new, true));
  }
  if (pairs.size() >= kCoarse) offer(fitted(pairs));
  return found;
}

}  // namespace sinew::tools
