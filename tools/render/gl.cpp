// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/gl.h"

#include <vector>

#include "tools/core/error.h"

namespace sinew::tools::gl {

namespace {

class Shader {
 public:
  Shader(const char* program_name, GLenum kind, const std::string& source) : name_(glCreateShader(kind)) {
    const char* text = source.c_str();
    glShaderSource(name_, 1, &text, nullptr);
    glCompileShader(name_);
    GLint ok = GL_FALSE;
    glGetShaderiv(name_, GL_COMPILE_STATUS, &ok);
    if (ok == GL_TRUE) return;
    std::vector<char> log(4096, '\0');
    glGetShaderInfoLog(name_, static_cast<GLsizei>(log.size() - 1), nullptr, log.data());
    glDeleteShader(name_);
    throw ToolError(ExitCode::system, "",
                    std::string("the OpenGL driver refuses the shader '") + program_name + "' (" + log.data() + ")",
                    "Use a driver with OpenGL 3.3, or Mesa's software renderer (LIBGL_ALWAYS_SOFTWARE=1).");
  }
  ~Shader() { glDeleteShader(name_); }
  Shader(const Shader&) = delete;
  Shader& operator=(const Shader&) = delete;
  GLuint name() const { return name_; }

 private:
  GLuint name_;
};

}  // namespace

Program::Program(const char* name, const std::string& vertex_source, const std::string& fragment_source)
    : program_(Object<ProgramTraits>::make()) {
  const Shader vertex(name, GL_VERTEX_SHADER, vertex_source);
  const Shader fragment(name, GL_FRAGMENT_SHADER, fragment_source);
  glAttachShader(program_.name(), vertex.name());
  glAttachShader(program_.name(), fragment.name());
  glLinkProgram(program_.name());
  GLint ok = GL_FALSE;
  glGetProgramiv(program_.name(), GL_LINK_STATUS, &ok);
  if (ok != GL_TRUE) {
    std::vector<char> log(4096, '\0');
    glGetProgramInfoLog(program_.name(), static_cast<GLsizei>(log.size() - 1), nullptr, log.data());
    throw ToolError(ExitCode::system, "",
                    std::string("the OpenGL driver cannot link '") + name + "' (" + log.data() + ")",
                    "Use a driver with OpenGL 3.3, or Mesa's software renderer (LIBGL_ALWAYS_SOFTWARE=1).");
  }
}

}  // namespace sinew::tools::gl
