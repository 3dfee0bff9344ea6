// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "sinew/formats/sections.h"
#include "tools/core/finding.h"

namespace sinew::tools {

using Triangle = std::array<std::uint32_t, 3>;

/// A material as the source had it.
struct MaterialSource {
  std::string name;
  std::array<float, 4> base_color = {0.8F, 0.8F, 0.8F, 1.0F};  ///< linear RGBA
  std::uint32_t texture = formats::kNone;                      ///< into VisualMesh::textures
  bool double_sided = false;
};

/// A texture picture, still encoded (PNG, JPEG, ...). `bytes` is empty where the file was missing (a finding says so).
struct TextureSource {
  std::string name;  ///< file name as the source wrote it, or "embedded N"
  std::string mime;  ///< "image/png", "image/jpeg", ... by its first bytes
  std::vector<std::byte> bytes;
};

/// A run of triangles of one node, mesh and material.
struct SubMeshSource {
  std::string node;
  std::string mesh;
  std::uint32_t material = formats::kNone;
  std::uint32_t first_triangle = 0;
  std::uint32_t triangle_count = 0;
};

/// A named set of visual vertices (OBJ groups, vertex sets), ascending.
struct GroupSource {
  std::string name;
  std::vector<std::uint32_t> vertices;   ///< visual vertices
  std::vector<std::uint32_t> triangles;  ///< ascending
};

/// A mesh of the source and its run of source vertices.
struct SourceMeshRange {
  std::string name;
  std::uint32_t first_source_vertex = 0;
  std::uint32_t source_vertex_count = 0;
};

/// A per-vertex attribute of the source that is neither position, normal, UV nor skin (glTF `_MASK`, further colours).
struct AttributeSource {
  std::string name;
  std::uint32_t components = 1;
  std::vector<float> values;  ///< components per visual vertex; 0 where a sub-mesh lacks it
};

struct SkinInfluence {
  std::uint32_t joint = 0;
  float weight = 0;
};

/// A node of the source with its properties (glTF extras, FBX user properties, mesh and primitive extras).
struct NodeSource {
  std::string name;
  std::string parent;
  std::string properties_json;  ///< a JSON object, "{}" where there are none
};

struct MorphTargetSource {
  std::string name;
  std::vector<std::uint32_t> vertices;         ///< visual vertices it moves, ascending
  std::vector<Eigen::Vector3f> displacements;  ///< metres, one each
};

/// An artist's mesh after import: in metres, y up, node transforms applied, polygons triangulated, outward faces
/// counter-clockwise, positions welded. Visual vertices keep the artist's identity; nothing is dropped silently.
struct VisualMesh {
  // Visual vertices: unique combinations of source vertex, UV, normal, colour and sub-mesh; where normals are computed,
  // one for each side of a crease.
  std::vector<Eigen::Vector3d> positions;    ///< metres, world
  std::vector<Eigen::Vector3f> normals;      ///< unit; computed where absent (crease.h)
  std::vector<Eigen::Vector2f> uvs;          ///< first UV set, v up; empty where no sub-mesh has one
  std::vector<std::array<float, 4>> colors;  ///< first colour set, linear RGBA; empty where none
  std::vector<Triangle> triangles;           ///< visual vertices; degenerate ones stay (they are drawn by nobody)
  std::vector<std::uint32_t> triangle_face;  ///< source face (polygon) of each triangle, counted over the file from 0
  std::vector<SubMeshSource> sub_meshes;
  std::vector<MaterialSource> materials;
  std::vector<TextureSource> textures;
  std::vector<GroupSource> groups;
  std::vector<AttributeSource> attributes;
  std::vector<std::string> joints;
  std::vector<std::vector<SkinInfluence>> skin;  ///< per visual vertex, normalized; empty where there is no skin
  std::vector<MorphTargetSource> morphs;
  std::vector<NodeSource> nodes;

  // Identity.
  std::uint32_t source_vertex_count = 0;
  std::uint32_t source_face_count = 0;
  std::vector<std::uint32_t> source_vertex;  ///< per visual vertex
  std::vector<SourceMeshRange> source_meshes;
  std::vector<std::uint32_t> unreferenced;  ///< source vertices no face uses, ascending

  // Welded points: visual vertices of (nearly) equal position are one point.
  std::vector<Eigen::Vector3d> welded_positions;  ///< metres
  std::vector<std::uint32_t> welded;              ///< per visual vertex
  double weld_tolerance = 0;                      ///< metres

  // Where it came from.
  std::string file;    ///< as the user named it
  std::string format;  ///< "obj", "glb", ...
  double metres_per_unit = 1;
  std::string unit_source;                               ///< one sentence: where that came from
  std::string up_axis = "y";                             ///< of the source
  Eigen::Vector3d bounds_min = Eigen::Vector3d::Zero();  ///< of vertices that faces use, metres
  Eigen::Vector3d bounds_max = Eigen::Vector3d::Zero();
  double diagonal = 0;  ///< of those bounds, metres
  bool had_normals = false;
  std::vector<Finding> findings;  ///< what import repaired, dropped or doubts

  Triangle weldedTriangle(std::size_t triangle) const {
    const Triangle& t = triangles[triangle];
    return {welded[t[0]], welded[t[1]], welded[t[2]]};
  }
};

}  // namespace sinew::tools
