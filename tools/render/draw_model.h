// SPDX-License-Identifier: GPL-3.0-or-later
//
// Data of a mesh for the renderer that do not change while it deforms.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sinew/formats/package.h"
#include "tools/import/visual_mesh.h"
#include "tools/render/image.h"

namespace sinew::tools {

/// A run of triangles of one look.
struct DrawPart {
  std::uint32_t first_triangle = 0;
  std::uint32_t triangle_count = 0;
  Eigen::Vector3f base_color = Eigen::Vector3f::Ones();  ///< linear RGB, multiplied with texture or vertex colour
  std::uint32_t texture = formats::kNone;                ///< into DrawModel::textures
  bool vertex_colors = false;
  bool one_sided = false;  ///< not seen from behind
};

/// A mesh ready to be drawn. Drawing units: position / diagonal, so that lights, shadows and depth work alike
/// for a bee and a whale.
struct DrawModel {
  std::string name;
  float diagonal = 1;  ///< metres, > 0

  std::vector<Eigen::Vector3f> positions;    ///< metres, rest
  std::vector<Eigen::Vector3f> normals;      ///< unit
  std::vector<Eigen::Vector2f> uvs;          ///< v up; empty where there is none
  std::vector<std::array<float, 4>> colors;  ///< linear; empty where there is none
  std::vector<std::array<float, 3>>
      cluster_tint;  ///< linear; the blend of the colours of a vertex' clusters; empty where none
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<DrawPart> parts;
  std::vector<TexturePixels> textures;  ///< width 0 where it could not be decoded

  std::vector<Eigen::Vector3f> physical_positions;          ///< metres, rest
  std::vector<std::array<std::uint32_t, 2>> surface_edges;  ///< of the tetrahedra's boundary, each once
  std::vector<std::array<std::uint32_t, 2>> inner_edges;    ///< all others
  std::uint32_t cluster_count = 0;
};

/// A colour (linear RGB) that tells neighbours apart; the same number always gives the same one.
std::array<float, 3> distinctColor(std::uint32_t number);

/// From a package. Positions are as in the package: relative to its origin.
DrawModel makeDrawModel(const formats::PackageView& package);

/// Several packages one after the other, for the bodies of a scene; what is drawn of the inside, and the diagonal, is
/// that of the first. Equal pointers are equal packages. \param packages at least one; parts of a package that was cut,
/// the same one often, or others. \param diagonal metres; 0: that of the first.
DrawModel joinedModel(std::span<const formats::PackageView* const> packages, float diagonal = 0);

/// Adds what bodies collide with, in plain grey.
void addSolid(DrawModel& model, std::span<const std::array<std::uint32_t, 3>> triangles, std::size_t vertices,
              bool one_sided);

/// From an imported source: positions are relative to the centre of its bounds.
DrawModel makeDrawModel(const VisualMesh& mesh);

}  // namespace sinew::tools
