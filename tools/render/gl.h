// SPDX-License-Identifier: GPL-3.0-or-later
//
// OpenGL objects that release themselves. All need a current OpenGL 3.3 core context, also when they are destroyed.
#pragma once

#include <epoxy/gl.h>

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <utility>

namespace sinew::tools::gl {

/// Owns one OpenGL name; `Traits` makes and deletes it.
template <class Traits>
class Object {
 public:
  Object() = default;
  ~Object() { reset(); }
  Object(Object&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  Object& operator=(Object&& other) noexcept {
    if (this != &other) {
      reset();
      name_ = std::exchange(other.name_, 0);
    }
    return *this;
  }
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;

  static Object make() {
    Object object;
    object.name_ = Traits::make();
    return object;
  }
  void reset() {
    if (name_ != 0) Traits::destroy(name_);
    name_ = 0;
  }
  GLuint name() const { return name_; }

 private:
  GLuint name_ = 0;
};

struct BufferTraits {
  static GLuint make() {
    GLuint name = 0;
    glGenBuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteBuffers(1, &name); }
};
struct ArrayTraits {
  static GLuint make() {
    GLuint name = 0;
    glGenVertexArrays(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteVertexArrays(1, &name); }
};
struct TextureTraits {
  static GLuint make() {
    GLuint name = 0;
    glGenTextures(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteTextures(1, &name); }
};
struct FramebufferTraits {
  static GLuint make() {
    GLuint name = 0;
    glGenFramebuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteFramebuffers(1, &name); }
};
struct RenderbufferTraits {
  static GLuint make() {
    GLuint name = 0;
    glGenRenderbuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteRenderbuffers(1, &name); }
};
struct ProgramTraits {
  static GLuint make() { return glCreateProgram(); }
  static void destroy(GLuint name) { glDeleteProgram(name); }
};

using Buffer = Object<BufferTraits>;
using VertexArray = Object<ArrayTraits>;
using Texture = Object<TextureTraits>;
using Framebuffer = Object<FramebufferTraits>;
using Renderbuffer = Object<RenderbufferTraits>;

/// A linked program of a vertex and a fragment shader.
class Program {
 public:
  Program() = default;
  /// Throws ToolError(system) with the driver's log where a shader does not compile.
  Program(const char* name, const std::string& vertex_source, const std::string& fragment_source);

  void use() const { glUseProgram(program_.name()); }
  // Uniforms of the program in use; names the linker dropped are ignored.
  void set(const char* name, int value) const { glUniform1i(location(name), value); }
  void set(const char* name, float value) const { glUniform1f(location(name), value); }
  void set(const char* name, const Eigen::Vector2f& value) const { glUniform2fv(location(name), 1, value.data()); }
  void set(const char* name, const Eigen::Vector3f& value) const { glUniform3fv(location(name), 1, value.data()); }
  void set(const char* name, const Eigen::Vector4f& value) const { glUniform4fv(location(name), 1, value.data()); }
  void set(const char* name, const Eigen::Matrix4f& value) const {
    glUniformMatrix4fv(location(name), 1, GL_FALSE, value.data());
  }

 private:
  GLint location(const char* name) const { return glGetUniformLocation(program_.name(), name); }
  Object<ProgramTraits> program_;
};

/// Pointer argument of glVertexAttribPointer: an offset into the bound buffer.
inline const void* offset(std::size_t bytes) { return reinterpret_cast<const void*>(bytes); }

}  // namespace sinew::tools::gl
