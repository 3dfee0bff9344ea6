// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/topology/exact_pairs.h"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/intersections.h>

namespace sinew::testing {
namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Segment = Kernel::Segment_3;

Kernel::Triangle_3 exact(const std::array<Eigen::Vector3d, 3>& t) {
  const auto point = [](const Eigen::Vector3d& p) { return Kernel::Point_3(p.x(), p.y(), p.z()); };
  return {point(t[0]), point(t[1]), point(t[2])};
}

bool onEdge(const Kernel::Triangle_3& t, const Segment& s) {
  for (int k = 0; k < 3; ++k) {
    const Segment edge(t[k], t[k + 1]);
    if (edge.has_on(s.source()) && edge.has_on(s.target())) return true;
  }
  return false;
}

}  // namespace

bool pierceExactly(const std::array<Eigen::Vector3d, 3>& a, const std::array<Eigen::Vector3d, 3>& b) {
  const auto s = exact(a), t = exact(b);
  const auto common = CGAL::intersection(s, t);
  if (!common) return false;
  if (boost::get<Kernel::Point_3>(&*common) != nullptr) return false;
  if (const Segment* segment = boost::get<Segment>(&*common)) return !onEdge(s, *segment) || !onEdge(t, *segment);
  return true;
}

bool collinearExactly(const std::array<Eigen::Vector3d, 3>& t) { return exact(t).is_degenerate(); }

}  // namespace sinew::testing
