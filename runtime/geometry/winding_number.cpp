// SPDX-License-Identifier: MIT
#include "runtime/geometry/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

// Packets are worth it in registers that hold one: the program chooses at start. Sanitizers start too late for that.
#if defined(__x86_64__) && defined(__gnu_linux__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define SINEW_WIDE_AND_PLAIN __attribute__((target_clones("avx2", "default"), flatten))
#else
#define SINEW_WIDE_AND_PLAIN
#endif

namespace sinew::geometry {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = 3.14159265358979323846;
constexpr double kAccuracy = 2.1;  // beta of Barill et al. 2018, of radii to the farthest point

// Sums over a node, with all components: n_i, n_i d_j, n_i d_j d_k (one symmetric matrix for each i).
struct Sums {
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();
  std::array<Matrix3d, 3> third = {Matrix3d::Zero(), Matrix3d::Zero(), Matrix3d::Zero()};

  // Adds sums about a centre that lies at `shift` from this one's.
  void add(const Sums& s, const Vector3d& shift) {
    first += s.first;
    second += s.second + s.first * shift.transpose();
    for (int i = 0; i < 3; ++i) {
      const Vector3d row = s.second.row(i).transpose();
      third[std::size_t(i)] += s.third[std::size_t(i)] + row * shift.transpose() + shift * row.transpose() +
                               s.first[i] * shift * shift.transpose();
    }
  }
};

// Some points at once, a lane each. The code below serves one point (double, bool) and a packet alike, so
// that both have the same bits.
constexpr std::size_t kLanes = 4;
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));
using Mask = decltype(Lanes{} < Lanes{});

bool any(bool mask) { return mask; }
bool any(const Mask& mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
double squareRoot(double x) { return std::sqrt(x); }
Lanes squareRoot(const Lanes& x) { return Lanes{std::sqrt(x[0]), std::sqrt(x[1]), std::sqrt(x[2]), std::sqrt(x[3])}; }
double arcTangent(double y, double x) { return std::atan2(y, x); }
Lanes arcTangent(const Lanes& y, const Lanes& x) {
  return Lanes{std::atan2(y[0], x[0]), std::atan2(y[1], x[1]), std::atan2(y[2], x[2]), std::atan2(y[3], x[3])};
}

template <class Real>
struct Vector {
  Real x, y, z;
};
template <class Real>
Real dot(const Vector<Real>& a, const Vector<Real>& b) {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}
template <class Real>
Vector<Real> cross(const Vector<Real>& a, const Vector<Real>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class Real>
Vector<Real> minus(const Vector3d& a, const Vector<Real>& b) {
  return {a.x() - b.x, a.y() - b.y, a.z() - b.z};
}

// Sum of solid angles of triangles with one arc tangent: half angles (van Oosterom & Strackee 1983, eq. 8) add up as
// the arguments of a product of complex numbers; full turns are counted where it passes the negative real axis.
template <class Real>
class AngleSum {
 public:
  template <class Which>
  void add(const Vector<Real>& point, const TriangleBvh::Corners& triangle, const Which& which) {
    const Vector<Real> a = minus(triangle[0], point), b = minus(triangle[1], point), c = minus(triangle[2], point);
    const Real la = squareRoot(dot(a, a)), lb = squareRoot(dot(b, b)), lc = squareRoot(dot(c, c));
    const Real size = la * lb * lc;
    const Real numerator = dot(a, cross(b, c));
    const Real y = numerator / size, x = 1 + (dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb) / size;
    const Real real = real_ * x - imaginary_ * y, imaginary = real_ * y + imaginary_ * x;
    // In the triangle's plane the angle is 0, or undefined on the triangle itself.
    const auto counts = which & (numerator != 0) & (size != 0);
    const Real none = Real{}, one = none + 1;
    turns_ += (counts & (imaginary_ > 0) & (y > 0) & (imaginary < 0)) != 0 ? one : none;
    turns_ -= (counts & (imaginary_ < 0) & (y < 0) & (imaginary > 0)) != 0 ? one : none;
    real_ = counts != 0 ? real : real_;
    imaginary_ = counts != 0 ? imaginary : imaginary_;
  }
  // A factor is at most 4 and the smallest that is no rounding about 1e-16: some dozens cannot leave a double's range.
  template <class Which>
  void normalize(const Which& which) {
    const Real size = squareRoot(real_ * real_ + imaginary_ * imaginary_);
    const Real scale = (which & (size > 0)) != 0 ? 1 / size : Real{} + 1;
    real_ *= scale;
    imaginary_ *= scale;
  }
  Real windingNumber() const { return arcTangent(imaginary_, real_) / (2 * kPi) + turns_; }

 private:
  Real real_ = Real{} + 1, imaginary_ = Real{}, turns_ = Real{};
};

// Points that are asked for at once.
constexpr std::size_t kAtOnce = 64;

// Triangles that close a surface along its open edges. Loops of edges are cut shorter, every second corner at a time,
// so that few triangles are large: from a point most are far, in groups.
std::vector<Triangle> lidsOf(std::vector<std::array<std::uint32_t, 2>> open) {
  std::sort(open.begin(), open.end());
  // As many edges leave a corner as arrive there: a walk along unused ones, of each corner in order, ends where it
  // began.
  std::vector<std::size_t> next(open.size());  // by the first edge of a corner
  std::iota(next.begin(), next.end(), std::size_t(0));
  const auto nextFrom = [&](std::uint32_t corner) -> std::size_t& {
    return next[std::size_t(std::lower_bound(open.begin(), open.end(), std::array{corner, 0U}) - open.begin())];
  };
  std::vector<Triangle> lids;
  std::vector<std::uint32_t> loop, shorter;
  for (std::size_t edge = 0; edge < open.size(); ++edge) {
    const std::uint32_t start = open[edge][0];
    if (nextFrom(start) > edge) continue;
    loop.clear();
    for (std::uint32_t at = start; loop.empty() || at != start; at = open[nextFrom(at)++][1]) loop.push_back(at);
    while (loop.size() > 2) {
      shorter.clear();
      for (std::size_t i = 0; i < loop.size(); i += 2) {
        shorter.push_back(loop[i]);
        if (i + 1 < loop.size()) lids.push_back({loop[i + 1], loop[i], loop[(i + 2) % loop.size()]});
      }
      std::swap(loop, shorter);
    }
  }
  return lids;
}

// A node's moments, seen from afar: r from the point to their centre.
template <class Real, class Moments>
Real expansion(const Moments& m, const Vector<Real>& r, const Real& squared_distance) {
  const Real &x = r.x, &y = r.y, &z = r.z;
  const Real inverse2 = 1 / squared_distance;
  const Real inverse3 = inverse2 * squareRoot(inverse2);
  const Real inverse5 = inverse3 * inverse2;
  const auto& s = m.second;
  const auto& t = m.third;
  const auto along = [&](const Vector3d& v) { return (v.x() * x + v.y() * y) + v.z() * z; };
  const Real quadratic = s[0] * x * x + s[1] * y * y + s[2] * z * z + s[3] * x * y + s[4] * y * z + s[5] * z * x;
  const Real cubic = x * x * (t[0] * x + t[3] * y + t[4] * z) + y * y * (t[1] * y + t[5] * x + t[6] * z) +
                     z * z * (t[2] * z + t[7] * x + t[8] * y) + t[9] * x * y * z;
  Real sum = inverse3 * (along(m.first) + s[0] + s[1] + s[2]) - 3 * inverse5 * quadratic;
  sum += 0.5 * (15 * inverse5 * inverse2 * cubic - 3 * inverse5 * along(m.third_trace));
  return sum / (4 * kPi);
}

// Sum over the tree: far nodes as a whole, near leaves exactly.
template <class Real, class Moments>
Real sumOver(const TriangleBvh& bvh, const std::vector<Moments>& moments, const Vector<Real>& point) {
  using Which = decltype(Real{} < Real{});
  const auto& nodes = bvh.nodes();
  const auto& corners = bvh.corners();
  struct Entry {
    std::uint32_t node;
    Which which;  // of the points
  };
  std::array<Entry, 64> stack;
  std::size_t depth = 0;
  stack[depth++] = {0, Real{} == Real{}};
  Real sum = Real{};
  AngleSum<Real> angles;
  while (depth > 0) {
    const auto [index, which] = stack[--depth];
    const Moments& m = moments[index];
    const Vector<Real> r = minus(m.center, point);
    const Real squared_distance = dot(r, r);
    const Which far = which & (squared_distance > m.squared_reach);
    if (any(far)) sum = far != 0 ? sum + expansion(m, r, squared_distance) : sum;
    const Which near = which & !far;
    if (!any(near)) continue;
    const TriangleBvh::Node& node = nodes[index];
    if (node.right == 0) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) angles.add(point, corners[i], near);
      angles.normalize(near);
      continue;
    }
    stack[depth++] = {node.right, near};
    stack[depth++] = {index + 1, near};
  }
  return sum + angles.windingNumber();
}

}  // namespace

double triangleWindingNumber(const Vector3d& point, const TriangleBvh::Corners& triangle) {
  AngleSum<double> sum;
  sum.add({point.x(), point.y(), point.z()}, triangle, true);
  return sum.windingNumber();
}

std::vector<std::array<std::uint32_t, 2>> openEdges(std::span<const Triangle> triangles) {
  struct Edge {
    std::uint32_t low, high;
    int direction;
    bool operator<(const Edge& o) const { return low != o.low ? low < o.low : high < o.high; }
  };
  std::vector<Edge> edges;
  edges.reserve(triangles.size() * 3);
  for (const Triangle& t : triangles) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<std::array<std::uint32_t, 2>> open;
  for (std::size_t i = 0; i < edges.size();) {
    const auto [low, high, direction] = edges[i];
    int sum = 0;
    for (; i < edges.size() && edges[i].low == low && edges[i].high == high; ++i) sum += edges[i].direction;
    for (; sum > 0; --sum) open.push_back({low, high});
    for (; sum < 0; ++sum) open.push_back({high, low});
  }
  return open;
}

WindingNumber::WindingNumber(std::span<const Vector3d> positions, std::span<const Triangle> triangles)
    : surface_(positions, triangles) {
  auto open = openEdges(triangles);
  closed_ = open.empty();
  whole_ = open.size() <= triangles.size() / 4;  // else lids are about as many as the triangles
  if (!closed_ && whole_) lids_ = Dipoles(positions, lidsOf(std::move(open)));
}

WindingNumber::Dipoles::Dipoles(std::span<const Vector3d> positions, std::span<const Triangle> triangles)
    : bvh(positions, triangles) {
  const auto& nodes = bvh.nodes();
  const auto& corners = bvh.corners();
  moments.resize(nodes.size());
  std::vector<Sums> sums(nodes.size());
  std::vector<double> areas(nodes.size());
  for (std::size_t n = nodes.size(); n-- > 0;) {
    const TriangleBvh::Node& node = nodes[n];
    Sums& s = sums[n];
    Vector3d center = Vector3d::Zero();
    if (node.right == 0) {
      double area = 0;
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& t = corners[i];
        const double a = (t[1] - t[0]).cross(t[2] - t[0]).norm() / 2;
        center += a * (t[0] + t[1] + t[2]) / 3;
        area += a;
      }
      center = area > 0 ? Vector3d(center / area) : node.box.center();
      areas[n] = area;
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
        const auto& t = corners[i];
        const Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]) / 2;
        const Vector3d d = (t[0] + t[1] + t[2]) / 3 - center;
        // The mean of x x^T over a triangle is that over its three edge midpoints.
        Matrix3d square = Matrix3d::Zero();
        for (std::size_t e = 0; e < 3; ++e) {
          const Vector3d m = (t[e] + t[(e + 1) % 3]) / 2 - center;
          square += m * m.transpose() / 3;
        }
        s.first += normal;
        s.second += normal * d.transpose();
        for (int k = 0; k < 3; ++k) s.third[std::size_t(k)] += normal[k] * square;
      }
    } else {
      const std::size_t left = n + 1, right = node.right;
      areas[n] = areas[left] + areas[right];
      center = areas[n] > 0
                   ? Vector3d((areas[left] * moments[left].center + areas[right] * moments[right].center) / areas[n])
                   : node.box.center();
      s.add(sums[left], moments[left].center - center);
      s.add(sums[right], moments[right].center - center);
    }
    Moments& m = moments[n];
    m.center = center;
    // Of the triangles themselves: the corner of their box is up to sqrt(3) times as far, and the nodes that are near
    // to a point grow in number with the square of it.
    double squared_radius = 0;
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      for (const Vector3d& x : corners[i]) squared_radius = std::max(squared_radius, (x - center).squaredNorm());
    }
    m.squared_reach = kAccuracy * kAccuracy * squared_radius;
    m.first = s.first;
    const Matrix3d& w = s.second;
    m.second = {w(0, 0), w(1, 1), w(2, 2), w(0, 1) + w(1, 0), w(1, 2) + w(2, 1), w(2, 0) + w(0, 2)};
    const auto& t = s.third;
    for (int k = 0; k < 3; ++k) {
      // d_ij r_k + d_ik r_j + d_jk r_i of the second derivative, contracted with n_i d_j d_k.
      double trace = 0;
      for (int i = 0; i < 3; ++i) trace += 2 * t[std::size_t(i)](i, k);
      m.third_trace[k] = trace + t[std::size_t(k)].trace();
    }
    const auto third = [&](int i, int j, int k) { return t[std::size_t(i)](j, k); };
    const auto two = [&](int i, int j) { return third(i, i, j) + third(i, j, i) + third(j, i, i); };
    m.third = {third(0, 0, 0), third(1, 1, 1),
               third(2, 2, 2), two(0, 1),
               two(0, 2),      two(1, 0),
               two(1, 2),      two(2, 0),
               two(2, 1),      2 * (third(0, 1, 2) + third(1, 2, 0) + third(2, 0, 1))};
  }
}

double WindingNumber::Dipoles::at(const Vector3d& point) const {
  return bvh.empty() ? 0 : sumOver<double>(bvh, moments, {point.x(), point.y(), point.z()});
}

SINEW_WIDE_AND_PLAIN
void WindingNumber::Dipoles::at(std::span<const Vector3d> points, std::span<double> result) const {
  if (bvh.empty()) {
    std::fill(result.begin(), result.end(), 0);
    return;
  }
  for (std::size_t first = 0; first < points.size(); first += kLanes) {
    const std::size_t last = std::min(first + kLanes, points.size()) - 1;
    const auto at = [&](std::size_t k) -> const Vector3d& { return points[std::min(first + k, last)]; };
    const Vector3d &p = at(0), &q = at(1), &r = at(2), &s = at(3);
    const Vector<Lanes> packet = {Lanes{p.x(), q.x(), r.x(), s.x()}, Lanes{p.y(), q.y(), r.y(), s.y()},
                                  Lanes{p.z(), q.z(), r.z(), s.z()}};
    const Lanes sum = sumOver<Lanes>(bvh, moments, packet);
    for (std::size_t i = first; i <= last; ++i) result[i] = sum[i - first];
  }
}

double WindingNumber::at(const Vector3d& point) const {
  const double sum = surface_.at(point);
  if (!whole_) return sum;
  const double lids = lids_.at(point);
  return std::round(sum + lids) - lids;
}

void WindingNumber::wholeNumbers(std::span<const Vector3d> points, std::span<double> result, Walk& walk) const {
  std::array<Vector3d, kAtOnce> asked;
  std::array<std::uint8_t, kAtOnce> asked_for{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::optional<int> change;
    if (walk.known_) {
      change = surface_.bvh.windingChange(walk.at_, points[i]);
      const std::optional<int> of_lids = lids_.bvh.windingChange(walk.at_, points[i]);
      change = change && of_lids ? std::optional(*change + *of_lids) : std::nullopt;
    }
    if (!change && walk.known_) {
      asked[count] = points[i];
      asked_for[count++] = std::uint8_t(i);
      continue;
    }
    walk.whole_ = change ? walk.whole_ + *change : std::round(surface_.at(points[i]) + lids_.at(points[i]));
    walk.at_ = points[i];
    walk.known_ = true;
    result[i] = walk.whole_;
  }
  std::array<double, kAtOnce> sums{}, lids{};
  surface_.at(std::span(asked).first(count), std::span(sums).first(count));
  lids_.at(std::span(asked).first(count), std::span(lids).first(count));
  for (std::size_t k = 0; k < count; ++k) result[asked_for[k]] = std::round(sums[k] + lids[k]);
  if (count == 0) return;
  // On from the last of them: no segment from a point on a triangle is sure.
  walk.at_ = asked[count - 1];
  walk.whole_ = result[asked_for[count - 1]];
}

void WindingNumber::at(std::span<const Vector3d> points, std::span<double> result, Walk& walk) const {
  if (!whole_) {
    surface_.at(points, result);
    return;
  }
  std::array<double, kAtOnce> lids{};
  for (std::size_t first = 0; first < points.size(); first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, points.size() - first);
    const auto some = points.subspan(first, count);
    const auto numbers = result.subspan(first, count);
    wholeNumbers(some, numbers, walk);
    lids_.at(some, std::span(lids).first(count));
    for (std::size_t i = 0; i < count; ++i) numbers[i] -= lids[i];
  }
}

void WindingNumber::inside(std::span<const Vector3d> points, std::span<char> result, Walk& walk) const {
  std::array<double, kAtOnce> at{};
  for (std::size_t first = 0; first < points.size(); first += kAtOnce) {
    const std::size_t count = std::min(kAtOnce, points.size() - first);
    this->at(points.subspan(first, count), std::span(at).first(count), walk);
    for (std::size_t i = 0; i < count; ++i) result[first + i] = at[i] > 0.5 ? 1 : 0;
  }
}

double WindingNumber::crossing(const Vector3d& a, const Vector3d& b, Walk& walk) const {
  const Vector3d direction = b - a;
  std::vector<TriangleBvh::Crossing> hits;
  surface_.bvh.crossings(a, b, hits);
  const auto within = [&](double parameter) {
    const Vector3d point = a + direction * parameter;
    char answer = 0;
    inside({&point, 1}, {&answer, 1}, walk);
    return answer != 0;
  };
  if (closed_) {
    // One crossing needs no further question; with several, the first after which a point lies outside.
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (i + 1 == hits.size()) return hits[i].parameter;
      const double middle = (hits[i].parameter + hits[i + 1].parameter) / 2;
      if (middle - hits[i].parameter > 1e-9 && !within(middle)) return hits[i].parameter;
    }
  } else {
    // Near a hole the level 1/2 leaves the triangles: ask on both sides of each.
    for (const TriangleBvh::Crossing& hit : hits) {
      constexpr double kAside = 1e-4;
      if (hit.winding > 0) continue;
      if (within(hit.parameter - kAside) && !within(hit.parameter + kAside)) return hit.parameter;
    }
  }
  constexpr int kRounds = 7;  // 1e-5 of the segment
  return leavingPoint(a, b, kRounds,
                      [&](std::span<const Vector3d> points, std::span<char> result) { inside(points, result, walk); });
}

}  // namespace sinew::geometry
