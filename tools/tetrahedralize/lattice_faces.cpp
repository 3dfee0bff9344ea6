// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/lattice_faces.h"

#include <algorithm>
#include <tuple>

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::TetMesh;
using geometry::Tetrahedron;

// Points of a face in sixths, relative to its corners by ascending number: both cells of it mean the same ones.
constexpr std::array<std::array<int, 3>, kFaceSamples> kFaceSample = {
    {{2, 2, 2}, {4, 1, 1}, {1, 4, 1}, {1, 1, 4}, {3, 2, 1}, {3, 1, 2}, {2, 3, 1}, {1, 3, 2}, {2, 1, 3}, {1, 2, 3}}};

}  // namespace

LatticeFaces::LatticeFaces(const SolidPiece& piece, const TetMesh& lattice)
    : piece_(piece), lattice_(lattice), number_(lattice.tetrahedra.size()) {
  struct Face {
    geometry::Triangle key;
    std::uint32_t tetrahedron;
    std::uint8_t face;
    bool operator<(const Face& o) const { return std::tie(key, tetrahedron) < std::tie(o.key, o.tetrahedron); }
  };
  std::vector<Face> faces;
  faces.reserve(lattice.tetrahedra.size() * 4);
  for (std::uint32_t t = 0; t < lattice.tetrahedra.size(); ++t) {
    for (std::uint8_t f = 0; f < 4; ++f) faces.push_back({corners(t, f), t, f});
  }
  std::sort(faces.begin(), faces.end());
  std::uint32_t count = 0;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const bool shared = i > 0 && faces[i].key == faces[i - 1].key;
    if (shared) inner_.push_back({faces[i - 1].tetrahedron, faces[i].tetrahedron, faces[i - 1].face, faces[i].face});
    number_[faces[i].tetrahedron][faces[i].face] = shared ? count - 1 : count++;
  }
  answers_ = std::vector<std::atomic<std::uint32_t>>(count);
}

std::array<Vector3d, kFaceSamples> LatticeFaces::points(std::uint32_t tetrahedron, std::size_t face) const {
  const geometry::Triangle v = corners(tetrahedron, face);
  std::array<Vector3d, kFaceSamples> points;
  for (std::size_t k = 0; k < kFaceSamples; ++k) {
    points[k] = (kFaceSample[k][0] * lattice_.positions[v[0]] + kFaceSample[k][1] * lattice_.positions[v[1]] +
                 kFaceSample[k][2] * lattice_.positions[v[2]]) /
                6;
  }
  return points;
}

std::uint32_t LatticeFaces::solid(std::uint32_t tetrahedron, std::size_t face, double most,
                                  geometry::WindingNumber::Walk& walk) const {
  // Threads that meet here find the same bits.
  std::atomic<std::uint32_t>& kept = answers_[number_[tetrahedron][face]];
  std::uint32_t answer = kept.load(std::memory_order_relaxed);
  if (answer == 0) {
    std::array<double, kFaceSamples> winding{};
    piece_.winding.at(points(tetrahedron, face), winding, walk);
    answer = kKnown;
    for (std::size_t k = 0; k < kFaceSamples; ++k) {
      if (winding[k] > kSolid) answer |= 1U << k;
      if (winding[k] > kSolid && winding[k] < kTwice) answer |= 1U << (k + kFaceSamples);
    }
    kept.store(answer, std::memory_order_relaxed);
  }
  return (most > kTwice ? answer : answer >> kFaceSamples) & ((1U << kFaceSamples) - 1);
}

// By ascending number: both cells of a face mean the same samples.
geometry::Triangle LatticeFaces::corners(std::uint32_t tetrahedron, std::size_t face) const {
  const Tetrahedron& t = lattice_.tetrahedra[tetrahedron];
  geometry::Triangle v = {t[kTetrahedronFaces[face][0]], t[kTetrahedronFaces[face][1]], t[kTetrahedronFaces[face][2]]};
  std::sort(v.begin(), v.end());
  return v;
}

}  // namespace sinew::tools
