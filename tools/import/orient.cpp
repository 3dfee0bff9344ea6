// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/orient.h"

#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace sinew::tools {
namespace {

struct EdgeUse {
  std::uint64_t key;  ///< smaller point, larger point
  std::uint32_t triangle;
  std::uint8_t forward;  ///< runs from the smaller to the larger
  bool operator<(const EdgeUse& o) const { return key != o.key ? key < o.key : triangle < o.triangle; }
};

/// Disjoint sets in which each element knows whether it agrees with its set's root.
class SideSets {
 public:
  explicit SideSets(std::size_t n) : parent_(n), opposite_(n, 0) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t find(std::uint32_t at, std::uint8_t& side) {
    std::uint32_t root = at;
    side = 0;
    while (parent_[root] != root) side ^= opposite_[root], root = parent_[root];
    std::uint8_t along = side;
    while (parent_[at] != root && at != root) {
      const std::uint32_t up = parent_[at];
      const std::uint8_t own = opposite_[at];
      parent_[at] = root;
      opposite_[at] = along;
      along ^= own;
      at = up;
    }
    return root;
  }
  /// \return false where the two are in one set already and `opposite` contradicts it.
  bool join(std::uint32_t a, std::uint32_t b, std::uint8_t opposite) {
    std::uint8_t side_a = 0;
    std::uint8_t side_b = 0;
    std::uint32_t root_a = find(a, side_a);
    std::uint32_t root_b = find(b, side_b);
    if (root_a == root_b) return (side_a ^ side_b) == opposite;
    if (root_b < root_a) std::swap(root_a, root_b);
    parent_[root_b] = root_a;
    opposite_[root_b] = side_a ^ side_b ^ opposite;
    return true;
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::uint8_t> opposite_;
};

struct Part {
  std::vector<std::uint32_t> triangles;
  std::array<double, 2> side_area = {0, 0};
  bool orientable = true;
  bool closed = true;
  double volume = 0;
  Eigen::AlignedBox3d box;
  bool turn = false;
  bool cavity = false;
};

/// How often the part winds around a point (van Oosterom and Strackee 1983, solid angle of a triangle).
double windingNumber(const VisualMesh& mesh, const Part& part, const Eigen::Vector3d& at) {
  double sum = 0;
  for (std::uint32_t t : part.triangles) {
    const Triangle points = mesh.weldedTriangle(t);
    const Eigen::Vector3d a = mesh.welded_positions[points[0]] - at;
    const Eigen::Vector3d b = mesh.welded_positions[points[1]] - at;
    const Eigen::Vector3d c = mesh.welded_positions[points[2]] - at;
    const double la = a.norm();
    const double lb = b.norm();
    const double lc = c.norm();
    sum += std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (2 * std::numbers::pi);
}

/// Turns closed parts that face inward, outermost first.
void turnInsideOut(const VisualMesh& mesh, std::vector<Part>& parts) {
  std::vector<std::uint32_t> closed;
  bool any_inward = false;
  for (std::uint32_t p = 0; p < parts.size(); ++p)
    if (parts[p].closed && parts[p].orientable && parts[p].volume != 0) {
      closed.push_back(p);
      any_inward = any_inward || parts[p].volume < 0;
    }
  if (!any_inward) return;
  // Larger parts first: a container comes before what it holds.
  std::stable_sort(closed.begin(), closed.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::abs(parts[a].volume) > std::abs(parts[b].volume);
  });
  std::uint64_t work_left = 2'000'000'000;
  for (std::size_t i = 0; i < closed.size(); ++i) {
    Part& part = parts[closed[i]];
    const Part* container = nullptr;
    for (std::size_t j = 0; j < i && !container; ++j) {
      const Part& other = parts[closed[j]];
      if (!other.box.contains(part.box)) continue;
      // All samples must lie inside: a part that only pokes into another is no content of it.
      const std::size_t samples = std::min<std::size_t>(8, part.triangles.size());
      bool inside = true;
      for (std::size_t s = 0; s < samples && inside; ++s) {
        if (work_left < other.triangles.size()) break;  // then the boxes alone decide
        work_left -= other.triangles.size();
        const std::uint32_t t = part.triangles[s * part.triangles.size() / samples];
        inside = std::abs(windingNumber(mesh, other, mesh.welded_positions[mesh.weldedTriangle(t)[0]])) > 0.5;
      }
      if (inside) container = &other;
    }
    if (!container) {
      part.turn = part.volume < 0;
    } else {
      part.turn = container->turn;
      part.cavity = (part.volume < 0) != part.turn;
    }
  }
}

void listFaces(const VisualMesh& mesh, const std::vector<std::uint32_t>& triangles, Finding& finding) {
  std::vector<std::uint32_t> faces;
  faces.reserve(triangles.size());
  for (std::uint32_t t : triangles) faces.push_back(mesh.triangle_face[t]);
  std::sort(faces.begin(), faces.end());
  faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
  finding.count = faces.size();
  finding.place_kind = "face";
  faces.resize(std::min(faces.size(), Finding::kMaxPlaces));
  finding.places = std::move(faces);
}

}  // namespace

Turned orientFaces(VisualMesh& mesh) {
  const std::uint32_t triangle_count = std::uint32_t(mesh.triangles.size());
  Turned turned;
  turned.triangle.assign(triangle_count, 0);

  std::vector<EdgeUse> uses;
  uses.reserve(3 * std::size_t(triangle_count));
  std::vector<std::uint8_t> degenerate(triangle_count, 0);
  for (std::uint32_t t = 0; t < triangle_count; ++t) {
    const Triangle p = mesh.weldedTriangle(t);
    degenerate[t] = p[0] == p[1] || p[1] == p[2] || p[2] == p[0];
    if (degenerate[t]) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = p[k];
      const std::uint32_t b = p[(k + 1) % 3];
      uses.push_back({std::uint64_t(std::min(a, b)) << 32 | std::max(a, b), t, a < b});
    }
  }
  tbb::parallel_sort(uses.begin(), uses.end());

  SideSets sets(triangle_count);
  std::vector<std::uint32_t> conflicts;
  for (std::size_t i = 0; i < uses.size();) {
    std::size_t j = i + 1;
    while (j < uses.size() && uses[j].key == uses[i].key) ++j;
    // Two faces agree when they run along their edge in opposite directions.
    if (j - i == 2 && !sets.join(uses[i].triangle, uses[i + 1].triangle, uses[i].forward == uses[i + 1].forward))
      conflicts.push_back(uses[i].triangle);
    i = j;
  }
  std::vector<Part> parts;
  std::vector<std::uint32_t> part_of(triangle_count, formats::kNone);
  std::vector<std::uint8_t> side_of(triangle_count, 0);
  for (std::uint32_t t = 0; t < triangle_count; ++t) {
    if (degenerate[t]) continue;
    const std::uint32_t root = sets.find(t, side_of[t]);
    if (part_of[root] == formats::kNone) {
      part_of[root] = std::uint32_t(parts.size());
      parts.emplace_back();
    }
    part_of[t] = part_of[root];
    Part& part = parts[part_of[t]];
    part.triangles.push_back(t);
    const Triangle p = mesh.weldedTriangle(t);
    const Eigen::Vector3d& a = mesh.welded_positions[p[0]];
    part.side_area[side_of[t]] += (mesh.welded_positions[p[1]] - a).cross(mesh.welded_positions[p[2]] - a).norm();
    for (std::uint32_t point : p) part.box.extend(mesh.welded_positions[point]);
  }
  for (std::uint32_t t : conflicts) parts[part_of[t]].orientable = false;
  for (std::size_t i = 0; i < uses.size();) {
    // Closed: each edge is met an even number of times by the part's own faces.
    std::size_t j = i + 1;
    while (j < uses.size() && uses[j].key == uses[i].key) ++j;
    if (j - i != 2) {
      std::vector<std::uint32_t> here;
      for (std::size_t k = i; k < j; ++k) here.push_back(part_of[uses[k].triangle]);
      std::sort(here.begin(), here.end());
      for (std::size_t k = 0; k < here.size();) {
        std::size_t l = k;
        while (l < here.size() && here[l] == here[k]) ++l;
        if ((l - k) % 2 != 0) parts[here[k]].closed = false;
        k = l;
      }
    }
    i = j;
  }

  const auto turn = [&](std::uint32_t t) {
    std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    turned.triangle[t] ^= 1;
    turned.any = true;
  };
  std::vector<std::uint32_t> flipped;
  for (Part& part : parts) {
    if (!part.orientable) continue;
    const std::uint8_t minority = part.side_area[1] > part.side_area[0] ? 0 : 1;
    if (part.side_area[minority] > 0)
      for (std::uint32_t t : part.triangles)
        if (side_of[t] == minority) turn(t), flipped.push_back(t);
    if (!part.closed) continue;
    const Eigen::Vector3d origin = part.box.center();
    for (std::uint32_t t : part.triangles) {
      const Triangle p = mesh.weldedTriangle(t);
      const Eigen::Vector3d a = mesh.welded_positions[p[0]] - origin;
      const Eigen::Vector3d b = mesh.welded_positions[p[1]] - origin;
      const Eigen::Vector3d c = mesh.welded_positions[p[2]] - origin;
      part.volume += a.dot(b.cross(c)) / 6;
    }
    // A flat closed part (two sheets back to back) has no inside to speak of.
    if (std::abs(part.volume) < 1e-9 * std::pow(part.box.diagonal().norm(), 3)) part.volume = 0;
  }
  turnInsideOut(mesh, parts);

  std::vector<std::uint32_t> inside_out;
  std::size_t inside_out_parts = 0;
  std::size_t cavities = 0;
  for (const Part& part : parts) {
    cavities += part.cavity;
    if (!part.turn) continue;
    ++inside_out_parts;
    for (std::uint32_t t : part.triangles) turn(t), inside_out.push_back(t);
  }
  if (!flipped.empty()) {
    Finding finding{"flipped-faces",
                    Severity::warning,
                    "",
                    0,
                    "",
                    {},
                    "",
                    "Recalculate the normals in the program that made the file."};
    listFaces(mesh, flipped, finding);
    finding.message =
        std::to_string(finding.count) + " faces ran the other way round than their neighbours and were turned";
    mesh.findings.push_back(std::move(finding));
  }
  if (!inside_out.empty()) {
    Finding finding{
        "inside-out-part", Severity::warning, "", 0, "", {}, "", "Flip the normals in the program that made the file."};
    listFaces(mesh, inside_out, finding);
    finding.message = std::to_string(inside_out_parts) +
                      (inside_out_parts == 1 ? " closed part was" : " closed parts were") + " inside out and turned (" +
                      std::to_string(finding.count) + " faces)";
    mesh.findings.push_back(std::move(finding));
  }
  if (cavities > 0)
    mesh.findings.push_back(
        {"cavity",
         Severity::info,
         std::to_string(cavities) + " closed parts within others face inward and are taken as walls of cavities",
         cavities,
         "",
         {},
         "",
         ""});
  return turned;
}

}  // namespace sinew::tools
