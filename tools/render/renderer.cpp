// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/renderer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "tools/core/error.h"
#include "tools/render/shaders.h"
#include "tools/render/texture.h"

namespace sinew::tools {

namespace {

constexpr int kSamples = 4;
constexpr int kShadowMapSize = 1024;
constexpr int kHeightMapSize = 256;
constexpr float kLineBias = 0.004F;  // drawing units towards the eye
constexpr float kDotBias = 0.012F;

// Texture units, the same for every program.
constexpr int kUnitTexture = 0;
constexpr int kUnitShadow = 1;
constexpr int kUnitHeight = 2;
constexpr int kUnitPoints = 3;

std::uint32_t pack(Rgba8 c) {
  return static_cast<std::uint32_t>(c[0]) | static_cast<std::uint32_t>(c[1]) << 8 |
         static_cast<std::uint32_t>(c[2]) << 16 | static_cast<std::uint32_t>(c[3]) << 24;
}

template <class T>
void fillBuffer(GLenum target, const gl::Buffer& buffer, std::span<const T> data, GLenum usage) {
  glBindBuffer(target, buffer.name());
  glBufferData(target, static_cast<GLsizeiptr>(data.size_bytes()), data.data(), usage);
}

template <class T>
void staticAttribute(const gl::Buffer& buffer, GLuint location, int components, const std::vector<T>& data) {
  if (data.empty()) return;  // the attribute then reads the default (0, 0, 0, 1)
  fillBuffer<T>(GL_ARRAY_BUFFER, buffer, data, GL_STATIC_DRAW);
  glEnableVertexAttribArray(location);
  glVertexAttribPointer(location, components, GL_FLOAT, GL_FALSE, 0, nullptr);
}

Eigen::Matrix4f biasMatrix() {  // clip space -1..1 to texture space 0..1
  Eigen::Matrix4f m = Eigen::Matrix4f::Identity() * 0.5F;
  m.col(3) = Eigen::Vector4f(0.5F, 0.5F, 0.5F, 1);
  return m;
}

}  // namespace

Lighting turnedLighting(Lighting lighting, float yaw) {
  lighting.key_direction = Eigen::AngleAxisf(yaw, Eigen::Vector3f::UnitY()) * lighting.key_direction;
  return lighting;
}

Renderer::Renderer(const DrawModel& model)
    : scale_(1 / model.diagonal),
      parts_(model.parts),
      triangles_(model.triangles),
      has_tint_(!model.cluster_tint.empty()),
      cluster_tint_(model.cluster_tint),
      mesh_program_("mesh", shaders::kMeshVertex, shaders::kMeshFragment),
      depth_program_("depth", shaders::kDepthVertex, shaders::kDepthFragment),
      background_program_("background", shaders::kScreenVertex, shaders::kBackgroundFragment),
      present_program_("present", shaders::kScreenVertex, shaders::kPresentFragment),
      ground_program_("ground", shaders::kGroundVertex, shaders::kGroundFragment),
      line_program_("line", shaders::kLineVertex, shaders::kLineFragment),
      dot_program_("dot", shaders::kDotVertex, shaders::kDotFragment) {
  if (epoxy_gl_version() < 33) {
    throw ToolError(ExitCode::system, "", "the OpenGL driver is older than version 3.3",
                    "Update the driver, or use Mesa's software renderer (LIBGL_ALWAYS_SOFTWARE=1).");
  }
  empty_array_ = gl::VertexArray::make();
  mesh_array_ = gl::VertexArray::make();
  glBindVertexArray(mesh_array_.name());
  positions_ = gl::Buffer::make();
  normals_ = gl::Buffer::make();
  uvs_ = gl::Buffer::make();
  colors_ = gl::Buffer::make();
  tints_ = gl::Buffer::make();
  indices_ = gl::Buffer::make();
  for (const auto& [buffer, location] : {std::pair(&positions_, 0U), std::pair(&normals_, 1U)}) {
    glBindBuffer(GL_ARRAY_BUFFER, buffer->name());
    glEnableVertexAttribArray(location);
    glVertexAttribPointer(location, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
  }
  staticAttribute(uvs_, 2, 2, model.uvs);
  staticAttribute(colors_, 3, 4, model.colors);
  staticAttribute(tints_, 4, 3, model.cluster_tint);
  fillBuffer<std::array<std::uint32_t, 3>>(GL_ELEMENT_ARRAY_BUFFER, indices_, triangles_, GL_STATIC_DRAW);
  highlight_indices_ = gl::Buffer::make();
  glBindVertexArray(0);
  setShape(model.positions, model.normals);

  for (std::size_t i = 0; i < model.textures.size(); ++i) {
    textures_.push_back(gl::Texture::make());
    const PreparedTexture prepared = prepareTexture(model, static_cast<std::uint32_t>(i));
    texture_cutout_.push_back(prepared.cutout);
    uploadTexture(textures_.back().name(), prepared);
  }

  upload(physical_, model.physical_positions);
  constexpr Rgba8 kEdgeColor = {24, 34, 56, 235};
  const auto edgeWords = [&](const std::vector<std::array<std::uint32_t, 2>>& edges) {
    std::vector<std::uint32_t> words;
    words.reserve(edges.size() * 3);
    for (const auto& e : edges) words.insert(words.end(), {e[0], e[1], pack(kEdgeColor)});
    return words;
  };
  uploadInstances(surface_edges_, edgeWords(model.surface_edges), 3);
  uploadInstances(inner_edges_, edgeWords(model.inner_edges), 3);

  makeDepthMap(shadow_map_, kShadowMapSize, true);
  makeDepthMap(height_map_, kHeightMapSize, false);
}

void Renderer::setShape(std::span<const Eigen::Vector3f> positions, std::span<const Eigen::Vector3f> normals) {
  fillBuffer(GL_ARRAY_BUFFER, positions_, positions, GL_STREAM_DRAW);
  fillBuffer(GL_ARRAY_BUFFER, normals_, normals, GL_STREAM_DRAW);
  surface_vertex_count_ = static_cast<std::uint32_t>(positions.size());
}

void Renderer::setPhysical(std::span<const Eigen::Vector3f> positions) { upload(physical_, positions); }

void Renderer::setTints(std::span<const std::array<float, 3>> tints) {
  has_own_tint_ = !tints.empty();
  const std::span<const std::array<float, 3>> shown = has_own_tint_ ? tints : std::span(cluster_tint_);
  if (shown.empty()) return;
  glBindVertexArray(mesh_array_.name());
  fillBuffer(GL_ARRAY_BUFFER, tints_, shown, GL_DYNAMIC_DRAW);
  glEnableVertexAttribArray(4);
  glVertexAttribPointer(4, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
  glBindVertexArray(0);
}

void Renderer::setPinned(std::span<const std::uint32_t> physical_vertices) {
  constexpr Rgba8 kPinColor = {235, 64, 52, 255};
  std::vector<std::uint32_t> words;
  for (const std::uint32_t v : physical_vertices) words.insert(words.end(), {v, pack(kPinColor)});
  uploadInstances(pinned_, words, 2);
}

void Renderer::setClusterFrames(std::span<const ClusterFrame> frames) {
  constexpr std::array<Rgba8, 3> kAxisColors = {{{220, 50, 47, 255}, {60, 150, 40, 255}, {38, 90, 220, 255}}};
  constexpr float kAxisLength = 0.035F;  // of the diagonal
  std::vector<Eigen::Vector3f> points;
  std::vector<std::uint32_t> lines;
  std::vector<std::uint32_t> dots;
  for (std::size_t c = 0; c < frames.size(); ++c) {
    const auto base = static_cast<std::uint32_t>(points.size());
    points.push_back(frames[c].center);
    for (int axis = 0; axis < 3; ++axis) {
      points.push_back(frames[c].center + frames[c].linear.col(axis) * (kAxisLength / scale_));
      lines.insert(lines.end(), {base, base + 1 + static_cast<std::uint32_t>(axis),
                                 pack(kAxisColors[static_cast<std::size_t>(axis)])});
    }
    const std::array<float, 3> color = distinctColor(static_cast<std::uint32_t>(c));
    Rgba8 encoded = {0, 0, 0, 255};
    for (std::size_t k = 0; k < 3; ++k)
      encoded[k] = static_cast<std::uint8_t>(std::lround(255 * std::pow(color[k], 1 / 2.2F)));
    dots.insert(dots.end(), {base, pack(encoded)});
  }
  upload(frame_points_, points);
  uploadInstances(frame_lines_, lines, 3);
  uploadInstances(frame_dots_, dots, 2);
}

void Renderer::setHighlights(std::span<const Highlight> highlights) {
  std::vector<std::uint32_t> indices;
  highlight_runs_.clear();
  for (const Highlight& h : highlights) {
    const auto first = static_cast<GLsizei>(indices.size());
    for (const std::uint32_t t : h.triangles) indices.insert(indices.end(), triangles_[t].begin(), triangles_[t].end());
    highlight_runs_.push_back({first, static_cast<GLsizei>(indices.size()) - first, h.color});
  }
  if (highlight_array_.name() == 0) highlight_array_ = gl::VertexArray::make();
  glBindVertexArray(highlight_array_.name());
  for (const auto& [buffer, location] : {std::pair(&positions_, 0U), std::pair(&normals_, 1U)}) {
    glBindBuffer(GL_ARRAY_BUFFER, buffer->name());
    glEnableVertexAttribArray(location);
    glVertexAttribPointer(location, 3, GL_FLOAT, GL_FALSE, 0, nullptr);
  }
  fillBuffer<std::uint32_t>(GL_ELEMENT_ARRAY_BUFFER, highlight_indices_, indices, GL_STATIC_DRAW);
  glBindVertexArray(0);
}

void Renderer::setAnnotation(const Annotation& annotation) {
  std::vector<std::uint32_t> lines;
  std::vector<std::uint32_t> dots;
  for (const Annotation::Line& l : annotation.lines) lines.insert(lines.end(), {l.from, l.to, pack(l.color)});
  for (const Annotation::Dot& d : annotation.dots) dots.insert(dots.end(), {d.point, pack(d.color)});
  upload(annotation_points_, annotation.points);
  uploadInstances(annotation_lines_, lines, 3);
  uploadInstances(annotation_dots_, dots, 2);
  annotation_width_ = annotation.line_width;
  annotation_hidden_ = annotation.hidden_opacity;
}

void Renderer::upload(PointSet& set, std::span<const Eigen::Vector3f> points) {
  if (set.points.name() == 0) {
    set.points = gl::Buffer::make();
    set.view = gl::Texture::make();
  }
  fillBuffer(GL_TEXTURE_BUFFER, set.points, points, GL_STREAM_DRAW);
  glBindTexture(GL_TEXTURE_BUFFER, set.view.name());
  glTexBuffer(GL_TEXTURE_BUFFER, GL_R32F, set.points.name());  // 3-component formats need OpenGL 4
  glBindTexture(GL_TEXTURE_BUFFER, 0);
}

void Renderer::uploadInstances(InstanceSet& set, std::span<const std::uint32_t> words, int words_each) {
  if (set.array.name() == 0) {
    set.array = gl::VertexArray::make();
    set.buffer = gl::Buffer::make();
  }
  glBindVertexArray(set.array.name());
  fillBuffer(GL_ARRAY_BUFFER, set.buffer, words, GL_STREAM_DRAW);
  glEnableVertexAttribArray(0);
  glVertexAttribIPointer(0, words_each, GL_UNSIGNED_INT, 0, nullptr);
  glVertexAttribDivisor(0, 1);
  glBindVertexArray(0);
  set.count = static_cast<GLsizei>(words.size()) / words_each;
}

void Renderer::makeDepthMap(DepthMap& map, int size, bool compare) {
  map.size = size;
  map.depth = gl::Texture::make();
  glBindTexture(GL_TEXTURE_2D, map.depth.name());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_DEPTH_COMPONENT24, size, size, 0, GL_DEPTH_COMPONENT, GL_UNSIGNED_INT, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  if (compare) {
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  }
  map.framebuffer = gl::Framebuffer::make();
  glBindFramebuffer(GL_FRAMEBUFFER, map.framebuffer.name());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_TEXTURE_2D, map.depth.name(), 0);
  glDrawBuffer(GL_NONE);
  glReadBuffer(GL_NONE);
  glBindTexture(GL_TEXTURE_2D, 0);
}

void Renderer::makeTarget(int width, int height) {
  if (target_.width == width && target_.height == height) return;
  target_ = Target{};
  GLint most_samples = 1;
  glGetIntegerv(GL_MAX_SAMPLES, &most_samples);
  const GLsizei samples = std::min(kSamples, static_cast<int>(most_samples));
  target_.color = gl::Renderbuffer::make();
  glBindRenderbuffer(GL_RENDERBUFFER, target_.color.name());
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_SRGB8_ALPHA8, width, height);
  target_.depth = gl::Renderbuffer::make();
  glBindRenderbuffer(GL_RENDERBUFFER, target_.depth.name());
  glRenderbufferStorageMultisample(GL_RENDERBUFFER, samples, GL_DEPTH_COMPONENT24, width, height);
  target_.multisampled = gl::Framebuffer::make();
  glBindFramebuffer(GL_FRAMEBUFFER, target_.multisampled.name());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, target_.color.name());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, target_.depth.name());
  const bool drawable = glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE;

  target_.picture = gl::Texture::make();
  glBindTexture(GL_TEXTURE_2D, target_.picture.name());
  glTexImage2D(GL_TEXTURE_2D, 0, GL_SRGB8_ALPHA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, nullptr);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  glBindTexture(GL_TEXTURE_2D, 0);
  target_.resolved = gl::Framebuffer::make();
  glBindFramebuffer(GL_FRAMEBUFFER, target_.resolved.name());
  glFramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, target_.picture.name(), 0);
  if (!drawable || glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    throw ToolError(ExitCode::system, "",
                    "the OpenGL driver cannot draw pictures of " + std::to_string(width) + " x " +
                        std::to_string(height) + " pixels",
                    "Ask for a smaller size.");
  }
  target_.width = width;
  target_.height = height;
}

void Renderer::draw(const Camera& camera, const DrawSettings& settings, int width, int height) {
  GLint caller_framebuffer = 0;
  glGetIntegerv(GL_DRAW_FRAMEBUFFER_BINDING, &caller_framebuffer);
  makeTarget(width, height);
  glDisable(GL_CULL_FACE);
  glDisable(GL_SCISSOR_TEST);
  glDisable(GL_STENCIL_TEST);
  glDepthMask(GL_TRUE);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  drawDepthMaps(settings);

  glBindFramebuffer(GL_FRAMEBUFFER, target_.multisampled.name());
  glViewport(0, 0, width, height);
  glEnable(GL_MULTISAMPLE);
  glEnable(GL_FRAMEBUFFER_SRGB);
  glDisable(GL_BLEND);
  glClearDepth(1);
  glClear(GL_DEPTH_BUFFER_BIT);

  const auto setBackground = [&](const gl::Program& program) {
    program.set("u_background_top", settings.lighting.background_top);
    program.set("u_background_bottom", settings.lighting.background_bottom);
    program.set("u_height", static_cast<float>(height));
  };
  glDisable(GL_DEPTH_TEST);
  background_program_.use();
  setBackground(background_program_);
  glBindVertexArray(empty_array_.name());
  glDrawArrays(GL_TRIANGLES, 0, 3);

  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  const Eigen::Matrix4f view_projection =
      camera.projection(static_cast<float>(width) / static_cast<float>(height)) * camera.view();
  drawMesh(camera, view_projection, settings);
  drawHighlights(camera, view_projection);
  if (settings.ground) {
    ground_program_.use();
    setBackground(ground_program_);
    drawGround(camera, view_projection, settings);
  }
  drawOverlays(camera, settings);

  glBindFramebuffer(GL_READ_FRAMEBUFFER, target_.multisampled.name());
  glBindFramebuffer(GL_DRAW_FRAMEBUFFER, target_.resolved.name());
  glBlitFramebuffer(0, 0, width, height, 0, 0, width, height, GL_COLOR_BUFFER_BIT, GL_NEAREST);
  glDisable(GL_FRAMEBUFFER_SRGB);
  glDisable(GL_BLEND);
  glDisable(GL_DEPTH_TEST);
  glBindVertexArray(0);
  glBindFramebuffer(GL_FRAMEBUFFER, static_cast<GLuint>(caller_framebuffer));
}

void Renderer::drawDepthMaps(const DrawSettings& settings) {
  // Key light: an orthographic box around what casts shadows, deep enough for the ground behind it.
  const float reach = std::max(settings.shadow_radius, 1e-3F) * 1.05F;
  Eigen::Matrix3f axes;
  const Eigen::Vector3f& to_light = settings.lighting.key_direction;
  const Eigen::Vector3f helper = std::abs(to_light.y()) < 0.99F ? Eigen::Vector3f::UnitY() : Eigen::Vector3f::UnitX();
  axes.row(0) = helper.cross(to_light).normalized().transpose();
  axes.row(2) = to_light.transpose();
  axes.row(1) = axes.row(2).cross(axes.row(0));
  // The box moves in whole texels: its shadow edges stay where they are when the centre moves a little.
  const float texel = 2 * reach / static_cast<float>(kShadowMapSize);
  Eigen::Vector3f center = axes * settings.shadow_center;
  center.x() = std::round(center.x() / texel) * texel;
  center.y() = std::round(center.y() / texel) * texel;
  Eigen::Matrix4f light = Eigen::Matrix4f::Identity();
  const Eigen::Vector3f shrink(1 / reach, 1 / reach, -1 / (4 * reach));
  light.block<3, 3>(0, 0) = shrink.asDiagonal() * axes;
  light.block<3, 1>(0, 3) = -shrink.cwiseProduct(center);

  // From below: x and z across, height above the ground as depth; everything in one unit, 2 * reach.
  Eigen::Matrix4f from_below = Eigen::Matrix4f::Zero();
  from_below(0, 0) = 1 / reach;
  from_below(0, 3) = -settings.shadow_center.x() / reach;
  from_below(1, 2) = 1 / reach;
  from_below(1, 3) = -settings.shadow_center.z() / reach;
  from_below(2, 1) = 1 / reach;
  from_below(2, 3) = -settings.ground_height / reach - 1;
  from_below(3, 3) = 1;
  height_range_ = 2 * reach;
  shadow_matrix_ = biasMatrix() * light;
  height_matrix_ = biasMatrix() * from_below;

  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_LESS);
  glEnable(GL_DEPTH_CLAMP);
  depth_program_.use();
  depth_program_.set("u_scale", scale_);
  glBindVertexArray(mesh_array_.name());
  const auto drawMap = [&](const DepthMap& map, const Eigen::Matrix4f& matrix) {
    glBindFramebuffer(GL_FRAMEBUFFER, map.framebuffer.name());
    glViewport(0, 0, map.size, map.size);
    glClearDepth(1);
    glClear(GL_DEPTH_BUFFER_BIT);
    depth_program_.set("u_view_projection", matrix);
    for (const DrawPart& part : parts_) {
      if (part.one_sided) continue;  // what is not seen casts no shadow
      glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(part.triangle_count * 3), GL_UNSIGNED_INT,
                     gl::offset(std::size_t{part.first_triangle} * 12));
    }
  };
  drawMap(shadow_map_, light);
  if (settings.ground) drawMap(height_map_, from_below);
  glDisable(GL_DEPTH_CLAMP);
  glActiveTexture(GL_TEXTURE0 + kUnitShadow);
  glBindTexture(GL_TEXTURE_2D, shadow_map_.depth.name());
  glActiveTexture(GL_TEXTURE0 + kUnitHeight);
  glBindTexture(GL_TEXTURE_2D, height_map_.depth.name());
  glActiveTexture(GL_TEXTURE0);
}

void Renderer::drawMesh(const Camera& camera, const Eigen::Matrix4f& view_projection, const DrawSettings& settings) {
  const Lighting& light = settings.lighting;
  const gl::Program& program = mesh_program_;
  program.use();
  program.set("u_view_projection", view_projection);
  program.set("u_scale", scale_);
  program.set("u_eye", camera.eye());
  program.set("u_key_direction", light.key_direction);
  program.set("u_key_color", light.key_color);
  program.set("u_fill_direction", camera.back());
  program.set("u_fill_color", light.fill_color);
  program.set("u_sky_color", light.sky_color);
  program.set("u_ground_color", light.ground_color);
  program.set("u_specular", light.specular);
  program.set("u_tint_amount", has_own_tint_ ? settings.tint : settings.clusters && has_tint_ ? 0.85F : 0.0F);
  program.set("u_wash", settings.physical ? 0.45F : 0.0F);  // dark edges are seen on dark textures too
  program.set("u_shadow", kUnitShadow);
  program.set("u_shadow_matrix", shadow_matrix_);
  program.set("u_shadow_spread", 0.010F / height_range_);
  // Offsets from the surface are for texels of 0.0015 drawing units.
  program.set("u_shadow_bias", std::max(1.0F, height_range_ / static_cast<float>(kShadowMapSize) / 0.0015F));
  program.set("u_texture", kUnitTexture);
  glBindVertexArray(mesh_array_.name());
  glEnable(GL_SAMPLE_ALPHA_TO_COVERAGE);
  for (const DrawPart& part : parts_) {
    const bool textured = part.texture < textures_.size();
    program.set("u_base_color", part.base_color);
    program.set("u_use_texture", textured ? 1 : 0);
    program.set("u_use_color", part.vertex_colors ? 1 : 0);
    program.set("u_cutout", textured && texture_cutout_[part.texture] ? 1.0F : 0.0F);
    glBindTexture(GL_TEXTURE_2D, textured ? textures_[part.texture].name() : 0);
    if (part.one_sided) glEnable(GL_CULL_FACE);
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(part.triangle_count * 3), GL_UNSIGNED_INT,
                   gl::offset(std::size_t{part.first_triangle} * 12));
    glDisable(GL_CULL_FACE);
  }
  glDisable(GL_SAMPLE_ALPHA_TO_COVERAGE);
  glBindTexture(GL_TEXTURE_2D, 0);
}

void Renderer::drawHighlights(const Camera& camera, const Eigen::Matrix4f& view_projection) {
  if (highlight_runs_.empty()) return;
  const gl::Program& program = mesh_program_;  // lights are still set
  program.use();
  program.set("u_view_projection", view_projection);
  program.set("u_eye", camera.eye());
  program.set("u_use_texture", 0);
  program.set("u_use_color", 0);
  program.set("u_cutout", 0.0F);
  program.set("u_tint_amount", 0.0F);
  program.set("u_wash", 0.0F);
  glBindVertexArray(highlight_array_.name());
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(-1, -2);
  glDepthFunc(GL_LEQUAL);
  for (const HighlightRun& run : highlight_runs_) {
    Eigen::Vector3f color;
    for (int k = 0; k < 3; ++k)
      color[k] = std::pow(static_cast<float>(run.color[static_cast<std::size_t>(k)]) / 255, 2.2F);
    program.set("u_base_color", color);
    glDrawElements(GL_TRIANGLES, run.count, GL_UNSIGNED_INT, gl::offset(static_cast<std::size_t>(run.first) * 4));
  }
  glDisable(GL_POLYGON_OFFSET_FILL);
  glDepthFunc(GL_LESS);
}

void Renderer::drawGround(const Camera& camera, const Eigen::Matrix4f& view_projection, const DrawSettings& settings) {
  const gl::Program& program = ground_program_;
  const float extent = std::max(2.5F, 3 * settings.shadow_radius);
  program.set("u_view_projection", view_projection);
  program.set("u_center",
              Eigen::Vector3f(settings.shadow_center.x(), settings.ground_height, settings.shadow_center.z()));
  program.set("u_extent", extent);
  program.set("u_shadow", kUnitShadow);
  program.set("u_shadow_matrix", shadow_matrix_);
  program.set("u_shadow_spread", 0.028F / height_range_);
  program.set("u_height_map", kUnitHeight);
  program.set("u_height_matrix", height_matrix_);
  program.set("u_height_range", height_range_);
  program.set("u_key_direction", settings.lighting.key_direction);
  program.set("u_key_color", settings.lighting.key_color);
  program.set("u_sky_color", settings.lighting.sky_color);
  const bool from_below = camera.eye().y() < settings.ground_height;
  program.set("u_opacity", from_below ? 0.25F : 1.0F);
  glBindVertexArray(empty_array_.name());
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glDepthMask(from_below ? GL_FALSE : GL_TRUE);
  glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

void Renderer::drawInstances(const gl::Program& program, const PointSet& points, const InstanceSet& instances,
                             const Camera& camera, float width, float opacity, float hidden_opacity, float bias) {
  if (instances.count == 0) return;
  program.use();
  program.set("u_points", kUnitPoints);
  program.set("u_view", camera.view());
  program.set("u_projection",
              camera.projection(static_cast<float>(target_.width) / static_cast<float>(target_.height)));
  program.set("u_scale", scale_);
  program.set("u_viewport", Eigen::Vector2f(static_cast<float>(target_.width), static_cast<float>(target_.height)));
  program.set("u_width", width);
  program.set("u_bias", bias);
  program.set("u_near", camera.near_plane);
  glActiveTexture(GL_TEXTURE0 + kUnitPoints);
  glBindTexture(GL_TEXTURE_BUFFER, points.view.name());
  glActiveTexture(GL_TEXTURE0);
  glBindVertexArray(instances.array.name());
  glEnable(GL_BLEND);
  glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
  glDepthMask(GL_FALSE);
  const auto pass = [&](GLenum depth_function, float amount) {
    if (amount <= 0) return;
    glDepthFunc(depth_function);
    program.set("u_opacity", amount);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, instances.count);
  };
  pass(GL_GREATER, hidden_opacity);
  pass(GL_LEQUAL, opacity);
  glDepthFunc(GL_LESS);
  glDepthMask(GL_TRUE);
  glDisable(GL_BLEND);
}

void Renderer::drawOverlays(const Camera& camera, const DrawSettings& settings) {
  if (settings.physical) {
    drawInstances(line_program_, physical_, inner_edges_, camera, settings.line_width, 0.30F, 0.05F, kLineBias);
    drawInstances(line_program_, physical_, surface_edges_, camera, settings.line_width, 0.75F, 0.10F, kLineBias);
  }
  if (settings.clusters) {
    drawInstances(line_program_, frame_points_, frame_lines_, camera, settings.line_width * 1.6F, 1.0F, 0.75F,
                  kLineBias);
    drawInstances(dot_program_, frame_points_, frame_dots_, camera, settings.dot_size * 0.9F, 1.0F, 0.75F, kDotBias);
  }
  if (settings.pinned)
    drawInstances(dot_program_, physical_, pinned_, camera, settings.dot_size, 1.0F, 0.45F, kDotBias);
  drawInstances(line_program_, annotation_points_, annotation_lines_, camera, annotation_width_, 1.0F,
                annotation_hidden_, kLineBias);
  drawInstances(dot_program_, annotation_points_, annotation_dots_, camera, settings.dot_size, 1.0F, annotation_hidden_,
                kDotBias);
}

Image Renderer::read() const {
  Image image(target_.width, target_.height);
  std::vector<std::uint8_t> rgba(static_cast<std::size_t>(target_.width) * static_cast<std::size_t>(target_.height) *
                                 4);
  GLint caller_framebuffer = 0;
  glGetIntegerv(GL_READ_FRAMEBUFFER_BINDING, &caller_framebuffer);
  glBindFramebuffer(GL_READ_FRAMEBUFFER, target_.resolved.name());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, target_.width, target_.height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  glBindFramebuffer(GL_READ_FRAMEBUFFER, static_cast<GLuint>(caller_framebuffer));
  const auto row_pixels = static_cast<std::size_t>(target_.width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(target_.height); ++y) {
    const std::uint8_t* from = &rgba[(static_cast<std::size_t>(target_.height) - 1 - y) * row_pixels * 4];
    std::uint8_t* to = &image.rgb[y * row_pixels * 3];
    for (std::size_t x = 0; x < row_pixels; ++x) std::memcpy(to + 3 * x, from + 4 * x, 3);
  }
  return image;
}

void Renderer::present(int x, int y, int width, int height) const {
  glViewport(x, y, width, height);
  glDisable(GL_DEPTH_TEST);
  glDisable(GL_BLEND);
  glDisable(GL_FRAMEBUFFER_SRGB);
  present_program_.use();
  present_program_.set("u_picture", kUnitTexture);
  glActiveTexture(GL_TEXTURE0 + kUnitTexture);
  glBindTexture(GL_TEXTURE_2D, target_.picture.name());
  glBindVertexArray(empty_array_.name());
  glDrawArrays(GL_TRIANGLES, 0, 3);
  glBindTexture(GL_TEXTURE_2D, 0);
  glBindVertexArray(0);
}

}  // namespace sinew::tools
