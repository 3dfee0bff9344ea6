// SPDX-License-Identifier: MIT
#include "runtime/geometry/tet_mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "runtime/geometry/sets.h"
#include "sinew/formats/sections.h"

namespace sinew::geometry {

using formats::kNone;
namespace {

// Corners of the face opposite to each vertex, counter-clockwise from outside.
constexpr std::array<std::array<std::size_t, 3>, 4> kFaces = {{{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}}};

constexpr double kDegrees = 57.295779513082320876;

std::uint64_t spread(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffffULL;
  v = (v | v << 16) & 0x1f0000ff0000ffULL;
  v = (v | v << 8) & 0x100f00f00f00f00fULL;
  v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
  return (v | v << 2) & 0x1249249249249249ULL;
}

}  // namespace

double volume(const TetMesh& mesh, const Tetrahedron& t) {
  const auto& x = mesh.positions;
  return signedVolume6(x[t[0]], x[t[1]], x[t[2]], x[t[3]]) / 6;
}

double volume(const TetMesh& mesh) {
  double sum = 0;
  for (const Tetrahedron& t : mesh.tetrahedra) sum += volume(mesh, t);
  return sum;
}

std::array<double, 2> dihedralRange(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                                    const Eigen::Vector3d& d) {
  const std::array<Eigen::Vector3d, 4> x = {a, b, c, d};
  std::array<Eigen::Vector3d, 4> normal;
  for (std::size_t f = 0; f < 4; ++f) {
    const auto& face = kFaces[f];
    normal[f] = (x[face[1]] - x[face[0]]).cross(x[face[2]] - x[face[0]]);
    if (normal[f].squaredNorm() == 0) return {0, 180};
  }
  double smallest = 180, largest = 0;
  for (std::size_t f = 0; f < 4; ++f) {
    for (std::size_t g = f + 1; g < 4; ++g) {
      // Outward normals enclose 180 degrees minus the angle inside. atan2 keeps small angles exact.
      const double angle = 180 - kDegrees * std::atan2(normal[f].cross(normal[g]).norm(), normal[f].dot(normal[g]));
      smallest = std::min(smallest, angle);
      largest = std::max(largest, angle);
    }
  }
  return {smallest, largest};
}

std::vector<Triangle> boundaryFaces(const TetMesh& mesh, std::vector<std::uint32_t>* tetrahedron_of) {
  struct Face {
    Triangle key;
    std::uint32_t tetrahedron, face;
    bool operator<(const Face& o) const {
      return std::tie(key, tetrahedron, face) < std::tie(o.key, o.tetrahedron, o.face);
    }
  };
  std::vector<Face> faces;
  faces.reserve(mesh.tetrahedra.size() * 4);
  for (std::uint32_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    for (std::uint32_t f = 0; f < 4; ++f) {
      Triangle key = {mesh.tetrahedra[t][kFaces[f][0]], mesh.tetrahedra[t][kFaces[f][1]],
                      mesh.tetrahedra[t][kFaces[f][2]]};
      std::sort(key.begin(), key.end());
      faces.push_back({key, t, f});
    }
  }
  std::sort(faces.begin(), faces.end());
  std::vector<std::array<std::uint32_t, 2>> border;
  for (std::size_t i = 0; i < faces.size();) {
    std::size_t end = i + 1;
    while (end < faces.size() && faces[end].key == faces[i].key) ++end;
    // Faces left when tetrahedra on either side have paired off, in order.
    const auto even = [&](const Face& f) {
      const Tetrahedron& t = mesh.tetrahedra[f.tetrahedron];
      const auto& corners = kFaces[f.face];
      return (t[corners[0]] < t[corners[1]]) == ((t[corners[1]] < t[corners[2]]) == (t[corners[0]] < t[corners[2]]));
    };
    const auto sides =
        std::stable_partition(faces.begin() + std::ptrdiff_t(i), faces.begin() + std::ptrdiff_t(end), even);
    const auto evens = std::size_t(sides - faces.begin()) - i, odds = end - i - evens;
    const std::size_t pairs = std::min(evens, odds);
    for (std::size_t k = i + pairs; k < i + evens; ++k) border.push_back({faces[k].tetrahedron, faces[k].face});
    for (std::size_t k = i + evens + pairs; k < end; ++k) border.push_back({faces[k].tetrahedron, faces[k].face});
    i = end;
  }
  std::sort(border.begin(), border.end());
  std::vector<Triangle> result;
  result.reserve(border.size());
  if (tetrahedron_of != nullptr) tetrahedron_of->clear();
  for (const auto& [t, f] : border) {
    const auto& face = kFaces[f];
    const Tetrahedron& tetrahedron = mesh.tetrahedra[t];
    result.push_back({tetrahedron[face[0]], tetrahedron[face[1]], tetrahedron[face[2]]});
    if (tetrahedron_of != nullptr) tetrahedron_of->push_back(t);
  }
  return result;
}

std::uint32_t connectedComponents(const TetMesh& mesh, JoinedBy joined_by,
                                  std::vector<std::uint32_t>& component_of_tetrahedron) {
  const auto count = std::uint32_t(mesh.tetrahedra.size());
  Sets sets(count);
  if (joined_by == JoinedBy::vertices) {
    std::vector<std::uint32_t> first(mesh.positions.size(), kNone);
    for (std::uint32_t t = 0; t < count; ++t) {
      for (const std::uint32_t v : mesh.tetrahedra[t]) {
        if (first[v] == kNone) first[v] = t;
        sets.join(first[v], t);
      }
    }
  } else {
    std::vector<std::pair<Triangle, std::uint32_t>> faces;
    faces.reserve(std::size_t{4} * count);
    for (std::uint32_t t = 0; t < count; ++t) {
      const Tetrahedron& tetrahedron = mesh.tetrahedra[t];
      for (const auto& face : kFaces) {
        Triangle key = {tetrahedron[face[0]], tetrahedron[face[1]], tetrahedron[face[2]]};
        std::sort(key.begin(), key.end());
        faces.emplace_back(key, t);
      }
    }
    std::sort(faces.begin(), faces.end());
    for (std::size_t i = 1; i < faces.size(); ++i) {
      if (faces[i].first == faces[i - 1].first) sets.join(faces[i].second, faces[i - 1].second);
    }
  }
  std::vector<std::uint32_t> number(count, kNone);
  std::uint32_t components = 0;
  component_of_tetrahedron.resize(count);
  for (std::uint32_t t = 0; t < count; ++t) {
    std::uint32_t& n = number[sets.find(t)];
    if (n == kNone) n = components++;
    component_of_tetrahedron[t] = n;
  }
  return components;
}

TetMesh compact(const TetMesh& mesh, const std::vector<char>& keep) {
  TetMesh result;
  std::vector<char> used(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.tetrahedra.size(); ++t) {
    if (keep[t] == 0) continue;
    result.tetrahedra.push_back(mesh.tetrahedra[t]);
    for (const std::uint32_t v : mesh.tetrahedra[t]) used[v] = 1;
  }
  std::vector<std::uint32_t> number(mesh.positions.size(), 0);
  for (std::size_t v = 0; v < used.size(); ++v) {
    if (used[v] == 0) continue;
    number[v] = static_cast<std::uint32_t>(result.positions.size());
    result.positions.push_back(mesh.positions[v]);
  }
  for (Tetrahedron& t : result.tetrahedra) {
    for (std::uint32_t& v : t) v = number[v];
  }
  return result;
}

void sortForLocality(TetMesh& mesh) {
  if (mesh.positions.empty()) return;
  Eigen::Vector3d low = mesh.positions[0], high = mesh.positions[0];
  for (const auto& p : mesh.positions) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  // 1024 cells along the longest side: finer than any neighbourhood that matters to a cache.
  const double extent = std::max((high - low).maxCoeff(), 1e-300);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(mesh.positions.size());
  for (std::uint32_t v = 0; v < order.size(); ++v) {
    std::uint64_t code = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double unit = (mesh.positions[v][axis] - low[axis]) / extent;
      code |= spread(static_cast<std::uint64_t>(std::clamp(unit, 0.0, 1.0) * 1023)) << axis;
    }
    order[v] = {code, v};
  }
  std::sort(order.begin(), order.end());
  std::vector<std::uint32_t> number(order.size());
  std::vector<Eigen::Vector3d> positions(order.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    number[order[i].second] = i;
    positions[i] = mesh.positions[order[i].second];
  }
  mesh.positions = std::move(positions);
  for (Tetrahedron& t : mesh.tetrahedra) {
    for (std::uint32_t& v : t) v = number[v];
  }
  std::stable_sort(mesh.tetrahedra.begin(), mesh.tetrahedra.end(), [](const Tetrahedron& a, const Tetrahedron& b) {
    return *std::min_element(a.begin(), a.end()) < *std::min_element(b.begin(), b.end());
  });
}

}  // namespace sinew::geometry
