// SPDX-License-Identifier: GPL-3.0-or-later
//
// The one drawing backend: window and pictures both use it. OpenGL 3.3 core, any context.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "tools/render/camera.h"
#include "tools/render/draw_model.h"
#include "tools/render/gl.h"
#include "tools/render/image.h"

namespace sinew::tools {

/// Lights, linear RGB. A white surface that faces key light, sky and eye comes out at 0.97: nothing is burnt out but
/// highlights.
struct Lighting {
  Eigen::Vector3f key_direction = Eigen::Vector3f(0.42F, 0.78F, 0.47F).normalized();  ///< unit, towards the light
  Eigen::Vector3f key_color = {0.62F, 0.60F, 0.57F};
  Eigen::Vector3f fill_color = {0.12F, 0.125F, 0.135F};   ///< from the eye
  Eigen::Vector3f sky_color = {0.25F, 0.26F, 0.28F};      ///< ambient from above
  Eigen::Vector3f ground_color = {0.15F, 0.145F, 0.14F};  ///< ambient from below
  float specular = 0.6F;                                  ///< 0 = matt
  Eigen::Vector3f background_top = {0.84F, 0.86F, 0.89F};
  Eigen::Vector3f background_bottom = {0.60F, 0.62F, 0.66F};
};

/// The same lights turned about the vertical by `yaw` (rad): so that a picture from behind is lit like one from the
/// front.
Lighting turnedLighting(Lighting lighting, float yaw);

struct DrawSettings {
  bool physical = false;  ///< the tetrahedra's edges
  float tint = 0;         ///< part of setTints() in the surface's colour, 0..1
  bool clusters = false;  ///< surface tinted by cluster, centre frames
  bool pinned = true;     ///< dots on held vertices
  bool ground = false;
  float ground_height = 0;                                  ///< drawing units
  Eigen::Vector3f shadow_center = Eigen::Vector3f::Zero();  ///< of what casts shadows, drawing units
  float shadow_radius = 1;  ///< the same; constant over a motion, so that shadows do not shimmer
  float line_width = 1.0F;  ///< pixels, of the physical mesh
  float dot_size = 7.0F;    ///< pixels
  Lighting lighting;
};

/// 8-bit sRGB colour and opacity of lines and dots.
using Rgba8 = std::array<std::uint8_t, 4>;

/// Lines and dots in the scene, seen faintly through what hides them.
struct Annotation {
  std::vector<Eigen::Vector3f> points;  ///< metres
  struct Line {
    std::uint32_t from, to;
    Rgba8 color;
  };
  struct Dot {
    std::uint32_t point;
    Rgba8 color;
  };
  std::vector<Line> lines;
  std::vector<Dot> dots;
  float line_width = 2.0F;       ///< pixels
  float hidden_opacity = 0.35F;  ///< of what lies behind the surface, 0..1
};

/// Where a cluster is, for its centre frame.
struct ClusterFrame {
  Eigen::Vector3f center;  ///< metres
  Eigen::Matrix3f linear;  ///< columns are the images of the axes
};

/// Draws one model. Needs the context it was made in to be current in every call and in the destructor.
class Renderer {
 public:
  /// Throws ToolError(system) where the driver cannot do what is needed.
  explicit Renderer(const DrawModel& model);

  /// Deformed vertices, metres; sizes as in the model. Normals need not be unit; zero ones become flat.
  void setShape(std::span<const Eigen::Vector3f> positions, std::span<const Eigen::Vector3f> normals);
  /// Deformed physical vertices, metres.
  void setPhysical(std::span<const Eigen::Vector3f> positions);
  /// Colours that DrawSettings::tint mixes in, linear, by vertex; in place of those of clusters. Empty: those again.
  void setTints(std::span<const std::array<float, 3>> tints);
  void setPinned(std::span<const std::uint32_t> physical_vertices);
  void setClusterFrames(std::span<const ClusterFrame> frames);
  /// Triangles drawn in a plain colour over the surface. \param triangles numbers in DrawModel::triangles.
  struct Highlight {
    std::vector<std::uint32_t> triangles;
    Rgba8 color;
  };
  void setHighlights(std::span<const Highlight> highlights);
  void setAnnotation(const Annotation& annotation);

  /// Draws a picture of width x height pixels; read() or present() gives it.
  void draw(const Camera& camera, const DrawSettings& settings, int width, int height);
  Image read() const;
  /// Copies the picture into a rectangle of the bound draw framebuffer (sRGB values, no conversion by OpenGL).
  /// \param x,y lower left corner, pixels.
  void present(int x, int y, int width, int height) const;

 private:
  // Points on the GPU and instances that refer to them.
  struct PointSet {
    gl::Buffer points;
    gl::Texture view;
  };
  struct InstanceSet {
    gl::Buffer buffer;
    gl::VertexArray array;
    GLsizei count = 0;
  };
  struct HighlightRun {
    GLsizei first, count;
    Rgba8 color;
  };
  struct Target {
    int width = 0, height = 0;
    gl::Framebuffer multisampled, resolved;
    gl::Renderbuffer color, depth;
    gl::Texture picture;
  };
  struct DepthMap {
    int size = 0;
    gl::Framebuffer framebuffer;
    gl::Texture depth;
  };

  void makeDepthMap(DepthMap& map, int size, bool compare);
  void makeTarget(int width, int height);
  static void upload(PointSet& set, std::span<const Eigen::Vector3f> points);
  static void uploadInstances(InstanceSet& set, std::span<const std::uint32_t> words, int words_each);
  void drawDepthMaps(const DrawSettings& settings);
  void drawMesh(const Camera& camera, const Eigen::Matrix4f& view_projection, const DrawSettings& settings);
  void drawGround(const Camera& camera, const Eigen::Matrix4f& view_projection, const DrawSettings& settings);
  void drawHighlights(const Camera& camera, const Eigen::Matrix4f& view_projection);
  void drawOverlays(const Camera& camera, const DrawSettings& settings);
  void drawInstances(const gl::Program& program, const PointSet& points, const InstanceSet& instances,
                     const Camera& camera, float width, float opacity, float hidden_opacity, float bias);

  float scale_ = 1;  // drawing units per metre
  std::vector<DrawPart> parts_;
  std::vector<float> part_cutout_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::uint32_t surface_vertex_count_ = 0;
  bool has_tint_ = false, has_own_tint_ = false;
  std::vector<std::array<float, 3>> cluster_tint_;

  gl::Program mesh_program_, depth_program_, background_program_, present_program_, ground_program_, line_program_,
      dot_program_;
  gl::VertexArray mesh_array_, empty_array_;
  gl::Buffer positions_, normals_, uvs_, colors_, tints_, indices_, highlight_indices_;
  gl::VertexArray highlight_array_;
  std::vector<HighlightRun> highlight_runs_;
  std::vector<gl::Texture> textures_;
  std::vector<bool> texture_cutout_;
  PointSet physical_, frame_points_, annotation_points_;
  InstanceSet surface_edges_, inner_edges_, pinned_, frame_lines_, frame_dots_, annotation_lines_, annotation_dots_;
  float annotation_width_ = 2, annotation_hidden_ = 0.35F;
  DepthMap shadow_map_, height_map_;
  Eigen::Matrix4f shadow_matrix_ = Eigen::Matrix4f::Identity(), height_matrix_ = Eigen::Matrix4f::Identity();
  float height_range_ = 1;
  Target target_;
};

}  // namespace sinew::tools
