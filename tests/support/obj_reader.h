// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tools/import/visual_mesh.h"

namespace sinew::testing {

/// A visual mesh from bare positions and polygons (fan triangulation, welded where positions are equal): what tests of
/// the stages after import need, without the importer. One visual vertex a source vertex; unreferenced ones get none.
inline tools::VisualMesh makeMesh(const std::vector<Eigen::Vector3d>& positions,
                                  const std::vector<std::vector<std::uint32_t>>& faces) {
  tools::VisualMesh mesh;
  mesh.source_vertex_count = std::uint32_t(positions.size());
  mesh.source_face_count = std::uint32_t(faces.size());
  mesh.source_meshes.push_back({"mesh", 0, mesh.source_vertex_count});
  std::vector<std::uint32_t> visual(positions.size(), formats::kNone);
  for (const auto& face : faces) {
    for (const std::uint32_t v : face) visual.at(v) = 0;
  }
  std::map<std::array<double, 3>, std::uint32_t> points;
  Eigen::AlignedBox3d bounds;
  for (std::uint32_t v = 0; v < positions.size(); ++v) {
    if (visual[v] == formats::kNone) {
      mesh.unreferenced.push_back(v);
      continue;
    }
    visual[v] = std::uint32_t(mesh.positions.size());
    mesh.positions.push_back(positions[v]);
    mesh.source_vertex.push_back(v);
    bounds.extend(positions[v]);
    const auto [at, fresh] = points.try_emplace({positions[v].x(), positions[v].y(), positions[v].z()},
                                                std::uint32_t(mesh.welded_positions.size()));
    if (fresh) mesh.welded_positions.push_back(positions[v]);
    mesh.welded.push_back(at->second);
  }
  for (std::uint32_t f = 0; f < faces.size(); ++f) {
    for (std::size_t k = 1; k + 1 < faces[f].size(); ++k) {
      mesh.triangles.push_back({visual[faces[f][0]], visual[faces[f][k]], visual[faces[f][k + 1]]});
      mesh.triangle_face.push_back(f);
    }
  }
  mesh.normals.assign(mesh.positions.size(), Eigen::Vector3f::UnitY());
  mesh.sub_meshes.push_back({"node", "mesh", formats::kNone, 0, std::uint32_t(mesh.triangles.size())});
  if (!bounds.isEmpty()) {
    mesh.bounds_min = bounds.min();
    mesh.bounds_max = bounds.max();
    mesh.diagonal = bounds.diagonal().norm();
  }
  return mesh;
}

/// Positions and faces of an OBJ file, nothing else.
inline tools::VisualMesh readObj(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw std::runtime_error("cannot read " + file.string());
  std::vector<Eigen::Vector3d> positions;
  std::vector<std::vector<std::uint32_t>> faces;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "v") {
      Eigen::Vector3d p;
      words >> p.x() >> p.y() >> p.z();
      positions.push_back(p);
    } else if (word == "f") {
      std::vector<std::uint32_t> face;
      while (words >> word) {
        const long index = std::stol(word);
        face.push_back(std::uint32_t(index > 0 ? index - 1 : long(positions.size()) + index));
      }
      faces.push_back(std::move(face));
    }
  }
  tools::VisualMesh mesh = makeMesh(positions, faces);
  mesh.file = file.filename().string();
  mesh.format = "obj";
  return mesh;
}

}  // namespace sinew::testing
