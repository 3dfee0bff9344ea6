// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "tools/core/finding.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// A reader's failure in the child; crosses to the parent as text and becomes a ToolError(bad_input) there.
class ReadError : public std::runtime_error {
 public:
  /// \param what no final full stop; the place in brackets.
  /// \param cure one sentence with a final full stop; empty = the usual "export it again".
  explicit ReadError(const std::string& what, std::string cure = {})
      : std::runtime_error(what), cure_(std::move(cure)) {}
  const std::string& cure() const { return cure_; }

 private:
  std::string cure_;
};

/// A run of faces of one name and material within a RawMesh (OBJ object and material, glTF primitive, ...).
struct RawPart {
  std::string name;
  std::uint32_t material = formats::kNone;  ///< into RawScene::materials
};

struct RawMorph {
  std::string name;
  std::vector<std::uint32_t> vertices;         ///< of the mesh, ascending
  std::vector<Eigen::Vector3f> displacements;  ///< in the mesh's space, one each
};

/// One mesh as it hangs on one node. `points` are the source vertices in the file's order; a vertex is a point with one
/// choice of normal, UV, colour and skin.
struct RawMesh {
  std::string name;
  std::uint32_t node = formats::kNone;                      ///< into RawScene::nodes
  Eigen::Matrix4d transform = Eigen::Matrix4d::Identity();  ///< mesh to scene; affine
  std::vector<SourceMeshRange> ranges;                      ///< runs of points; empty = one run of the mesh's name

  std::vector<Eigen::Vector3d> points;

  std::vector<std::uint32_t> vertex_point;
  std::vector<Eigen::Vector3f> normals;      ///< empty, or per vertex; zero where absent
  std::vector<Eigen::Vector2f> uvs;          ///< empty, or per vertex; v up
  std::vector<std::array<float, 4>> colors;  ///< empty, or per vertex
  std::vector<AttributeSource> attributes;   ///< values per vertex
  std::vector<std::uint32_t> skin_count;     ///< empty, or influences per vertex
  std::vector<SkinInfluence> skin;           ///< joints into RawScene::joints; as the file has them, unnormalized
  std::vector<RawMorph> morphs;

  std::vector<std::uint32_t>
      face_size;  ///< corners per polygon: 3 or more, or 0 for a face too small to draw (it keeps its number)
  std::vector<std::uint32_t> corners;      ///< vertices, polygon after polygon
  std::vector<std::uint32_t> face_part;    ///< empty = all 0
  std::vector<std::uint32_t> face_groups;  ///< empty, or per face into RawScene::group_sets
  std::vector<RawPart> parts;
};

struct RawMaterial {
  std::string name;
  std::array<float, 4> base_color = {0.8F, 0.8F, 0.8F, 1.0F};
  std::uint32_t texture = formats::kNone;  ///< into RawScene::textures
  bool double_sided = false;
};

struct RawTexture {
  std::string path;  ///< as the source wrote it; empty = embedded
  std::string name;
  std::vector<std::byte> bytes;  ///< of an embedded one
};

struct RawNode {
  std::string name;
  std::uint32_t parent = formats::kNone;
  std::string properties_json = "{}";
};

/// A file as its reader understood it, in the file's own unit and axes: flat arrays only, so that it can cross a pipe.
struct RawScene {
  double metres_per_unit = 0;  ///< 0 = the format does not say
  std::string unit_source;     ///< one sentence; empty where the format does not say
  std::uint32_t up_axis = 1;   ///< 0 x, 1 y, 2 z
  std::vector<RawNode> nodes;  ///< parents before children
  std::vector<RawMesh> meshes;
  std::vector<RawMaterial> materials;
  std::vector<RawTexture> textures;
  std::vector<std::string> groups;
  std::vector<std::vector<std::uint32_t>> group_sets;  ///< sets of groups; faces name a set
  std::vector<std::string> joints;
  std::vector<Finding> findings;
};

/// A byte stream between child and parent. Both throw; the reading side may throw anything, since it meets a stranger.
class ByteSink {
 public:
  virtual ~ByteSink() = default;
  virtual void write(const void* data, std::size_t size) = 0;
};
class ByteSource {
 public:
  virtual ~ByteSource() = default;
  virtual void read(void* data, std::size_t size) = 0;
  /// Called before memory for `size` bytes is taken on the stream's word; throws where that is too much.
  virtual void claim(std::uint64_t size) = 0;
};

void writeRawScene(const RawScene& scene, ByteSink& sink);
/// Throws std::runtime_error for a malformed stream. The scene is then still to be validated.
void readRawScene(ByteSource& source, RawScene& scene);

/// Checks all counts, indices and numbers of a scene that a stranger gave. Throws ReadError: "the reader returned ..."
/// where a count or index is wrong, and a message that names the vertex where a position is not finite.
void validateRawScene(const RawScene& scene);

/// `text` where it is valid UTF-8, else its bytes taken as Latin-1 (what old exporters write), as UTF-8.
std::string asUtf8(const std::string& text);
/// Makes every name and message of the scene valid UTF-8, so that reports can carry them. Texture paths keep their
/// bytes, since they are looked up on the disk.
void cleanTexts(RawScene& scene);

/// Corners with separately indexed points, UVs and normals (OBJ, PLY with wedge UVs), joined into vertices:
/// one for each distinct (part, point, UV, normal), ordered by part, then point, then first use.
struct RawCorner {
  std::uint32_t point = 0;
  std::uint32_t uv = formats::kNone;
  std::uint32_t normal = formats::kNone;
};

/// Fills vertex_point, normals, uvs and corners of `mesh` from `corners` (polygon after polygon, as in mesh.face_size).
void joinCorners(const std::vector<RawCorner>& corners, const std::vector<Eigen::Vector2f>& uvs,
                 const std::vector<Eigen::Vector3f>& normals, RawMesh& mesh);

}  // namespace sinew::tools
