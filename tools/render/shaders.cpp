// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/shaders.h"

#define SINEW_GLSL "#version 330 core\n"

// Shadow of the key light: 16 bilinear comparisons on a Vogel disc. A fixed disc, so that nothing shimmers in motion.
#define SINEW_GLSL_SHADOW                                                              \
  "uniform sampler2DShadow u_shadow;\n"                                                \
  "uniform mat4 u_shadow_matrix;\n"                                                    \
  "float keyVisibility(vec3 p, float spread) {\n"                                      \
  "  vec3 s = (u_shadow_matrix * vec4(p, 1.0)).xyz;\n"                                 \
  "  if (length(s.xy - 0.5) > 0.5) return 1.0;  // nothing casts a shadow out there\n" \
  "  float sum = 0.0;\n"                                                               \
  "  for (int i = 0; i < 16; ++i) {\n"                                                 \
  "    float r = sqrt((float(i) + 0.5) / 16.0) * spread;\n"                            \
  "    float a = 2.39996323 * float(i);\n"                                             \
  "    sum += texture(u_shadow, vec3(s.xy + r * vec2(cos(a), sin(a)), s.z));\n"        \
  "  }\n"                                                                              \
  "  return sum / 16.0;\n"                                                             \
  "}\n"

#define SINEW_GLSL_BACKGROUND                                                                               \
  "uniform vec3 u_background_top;\n"                                                                        \
  "uniform vec3 u_background_bottom;\n"                                                                     \
  "uniform float u_height;\n"                                                                               \
  "vec3 background() {\n"                                                                                   \
  "  return mix(u_background_bottom, u_background_top, smoothstep(0.0, 1.0, gl_FragCoord.y / u_height));\n" \
  "}\n"

namespace sinew::tools::shaders {

const char* const kMeshVertex = SINEW_GLSL R"(
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec4 color;
layout(location = 4) in vec3 tint;
uniform mat4 u_view_projection;
uniform float u_scale;
out vec3 v_position;
out vec3 v_normal;
out vec2 v_uv;
out vec4 v_color;
out vec3 v_tint;
void main() {
  v_position = position * u_scale;
  v_normal = normal;
  v_uv = uv;
  v_color = color;
  v_tint = tint;
  gl_Position = u_view_projection * vec4(v_position, 1.0);
}
)";

const char* const kMeshFragment = SINEW_GLSL SINEW_GLSL_SHADOW R"(
in vec3 v_position;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_color;
in vec3 v_tint;
uniform vec3 u_eye;
uniform vec3 u_key_direction;
uniform vec3 u_key_color;
uniform vec3 u_fill_direction;
uniform vec3 u_fill_color;
uniform vec3 u_sky_color;
uniform vec3 u_ground_color;
uniform float u_specular;
uniform vec3 u_base_color;
uniform sampler2D u_texture;
uniform int u_use_texture;
uniform int u_use_color;
uniform float u_tint_amount;
uniform float u_wash;
uniform float u_shadow_spread;
uniform float u_shadow_bias;
uniform float u_cutout;
layout(location = 0) out vec4 o_color;
void main() {
  vec3 albedo = u_base_color;
  float alpha = 1.0;
  if (u_use_texture != 0) {
    vec4 texel = texture(u_texture, v_uv);
    albedo *= texel.rgb;
    alpha = mix(1.0, clamp((texel.a - 0.5) / max(fwidth(texel.a), 1e-4) + 0.5, 0.0, 1.0), u_cutout);
  }
  if (u_use_color != 0) albedo *= v_color.rgb;
  albedo = mix(mix(albedo, v_tint, u_tint_amount), vec3(0.62), u_wash);

  // Lit on the side that is seen, whatever the winding or the artist's normals say: the geometric normal faces the eye,
  // and the shading normal follows it.
  vec3 to_eye = normalize(u_eye - v_position);
  vec3 flat_normal = cross(dFdx(v_position), dFdy(v_position));
  float flat_length = length(flat_normal);
  flat_normal = flat_length > 0.0 ? flat_normal / flat_length : to_eye;
  if (dot(flat_normal, to_eye) < 0.0) flat_normal = -flat_normal;
  float normal_length = length(v_normal);
  vec3 n = normal_length > 1e-6 ? v_normal / normal_length : flat_normal;
  if (dot(n, flat_normal) < 0.0) n = -n;

  float key = max(dot(n, u_key_direction), 0.0);
  if (key > 0.0) key *= keyVisibility(v_position + u_shadow_bias * (0.006 * n + 0.012 * u_key_direction), u_shadow_spread);
  float fill = max(dot(n, u_fill_direction), 0.0);
  vec3 ambient = mix(u_ground_color, u_sky_color, 0.5 + 0.5 * n.y);
  vec3 color = albedo * (key * u_key_color + fill * u_fill_color + ambient);
  vec3 halfway = normalize(u_key_direction + to_eye);
  float fresnel = 0.04 + 0.96 * pow(1.0 - max(dot(halfway, to_eye), 0.0), 5.0);
  color += u_specular * fresnel * 5.0 * pow(max(dot(n, halfway), 0.0), 32.0) * key * u_key_color;
  o_color = vec4(color, alpha);
}
)";

const char* const kDepthVertex = SINEW_GLSL R"(
layout(location = 0) in vec3 position;
uniform mat4 u_view_projection;
uniform float u_scale;
void main() { gl_Position = u_view_projection * vec4(position * u_scale, 1.0); }
)";

const char* const kDepthFragment = SINEW_GLSL "void main() {}\n";

const char* const kScreenVertex = SINEW_GLSL R"(
out vec2 v_uv;
void main() {
  v_uv = vec2(float((gl_VertexID << 1) & 2), float(gl_VertexID & 2));
  gl_Position = vec4(v_uv * 2.0 - 1.0, 1.0, 1.0);
}
)";

const char* const kBackgroundFragment = SINEW_GLSL SINEW_GLSL_BACKGROUND R"(
layout(location = 0) out vec4 o_color;
void main() { o_color = vec4(background(), 1.0); }
)";

const char* const kPresentFragment = SINEW_GLSL R"(
in vec2 v_uv;
uniform sampler2D u_picture;
layout(location = 0) out vec4 o_color;
void main() {
  vec3 c = texture(u_picture, v_uv).rgb;
  o_color = vec4(mix(12.92 * c, 1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, c)), 1.0);
}
)";

const char* const kGroundVertex = SINEW_GLSL R"(
uniform mat4 u_view_projection;
uniform vec3 u_center;
uniform float u_extent;
out vec3 v_position;
void main() {
  vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
  v_position = u_center + u_extent * vec3(corner.x, 0.0, corner.y);
  gl_Position = u_view_projection * vec4(v_position, 1.0);
}
)";

// The ground is the background, darkened where the body keeps light away: it has no edge and no colour of its own.
const char* const kGroundFragment = SINEW_GLSL SINEW_GLSL_SHADOW SINEW_GLSL_BACKGROUND R"(
in vec3 v_position;
uniform vec3 u_center;
uniform float u_extent;
uniform float u_shadow_spread;
uniform float u_opacity;
uniform vec3 u_key_direction;
uniform vec3 u_key_color;
uniform vec3 u_sky_color;
uniform sampler2D u_height_map;    // depth of the lowest surface above the ground, seen from below
uniform mat4 u_height_matrix;
uniform float u_height_range;      // drawing units per depth unit
layout(location = 0) out vec4 o_color;
float skyVisibility(vec3 p) {
  vec3 s = (u_height_matrix * vec4(p, 1.0)).xyz;
  if (length(s.xy - 0.5) > 0.56) return 1.0;
  float sum = 0.0;
  for (int i = 0; i < 16; ++i) {
    float r = sqrt((float(i) + 0.5) / 16.0) * 0.09;
    float a = 2.39996323 * float(i);
    vec2 at = s.xy + r / u_height_range * vec2(cos(a), sin(a));
    float height = (texture(u_height_map, at).r - s.z) * u_height_range;
    sum += clamp(1.0 - height / 0.16, 0.0, 1.0) * step(0.0, at.x) * step(at.x, 1.0) * step(0.0, at.y) * step(at.y, 1.0);
  }
  return 1.0 - 0.75 * sum / 16.0;
}
float grid(vec2 p, float cell) {
  vec2 q = p / cell;
  vec2 width = max(fwidth(q), 1e-6);
  vec2 d = abs(fract(q - 0.5) - 0.5) / width;
  vec2 line = clamp(1.0 - d, 0.0, 1.0) * clamp(0.5 / width - 1.0, 0.0, 1.0);  // fades out before it becomes noise
  return max(line.x, line.y);
}
void main() {
  float away = length(v_position - u_center) / u_extent;
  float fade = 1.0 - smoothstep(0.45, 0.95, away);
  vec3 key = u_key_color * max(u_key_direction.y, 0.0);
  vec3 open = key + u_sky_color;
  vec3 kept =
      key * keyVisibility(v_position + 0.003 * u_key_direction, u_shadow_spread) + u_sky_color * skyVisibility(v_position);
  vec3 ratio = mix(vec3(1.0), kept / open, fade);
  float line = fade * (0.10 * grid(v_position.xz, 0.5) + 0.05 * grid(v_position.xz, 0.1));
  float edge = 1.0 - smoothstep(0.9, 1.0, away);
  o_color = vec4(background() * ratio * (1.0 - line), edge * u_opacity);
}
)";

// One instance an edge: four corners of a quad around the line on the screen.
const char* const kLineVertex = SINEW_GLSL R"(
layout(location = 0) in uvec3 instance;  // point, point, RGBA8
uniform samplerBuffer u_points;
uniform mat4 u_view;
uniform mat4 u_projection;
uniform float u_scale;
uniform vec2 u_viewport;
uniform float u_width;
uniform float u_bias;
uniform float u_near;
out vec4 v_color;
noperspective out float v_across;
vec3 point(uint i) {
  int k = int(i) * 3;
  vec3 p = vec3(texelFetch(u_points, k).r, texelFetch(u_points, k + 1).r, texelFetch(u_points, k + 2).r);
  vec3 v = (u_view * vec4(p * u_scale, 1.0)).xyz;
  return v * (1.0 - u_bias / max(length(v), 1e-6));  // nearer along the ray of sight: same pixel, in front of the surface
}
void main() {
  vec3 a = point(instance.x);
  vec3 b = point(instance.y);
  if (a.z > -u_near && b.z > -u_near) {
    gl_Position = vec4(0.0, 0.0, 2.0, 1.0);
    v_color = vec4(0.0);
    v_across = 0.0;
    return;
  }
  if (a.z > -u_near) a = mix(b, a, (-u_near - b.z) / (a.z - b.z));
  if (b.z > -u_near) b = mix(a, b, (-u_near - a.z) / (b.z - a.z));
  vec4 ca = u_projection * vec4(a, 1.0);
  vec4 cb = u_projection * vec4(b, 1.0);
  vec2 along = (cb.xy / cb.w - ca.xy / ca.w) * u_viewport;
  float len = length(along);
  vec2 side = len > 1e-6 ? vec2(-along.y, along.x) / len : vec2(0.0, 1.0);
  float reach = 0.5 * u_width + 0.5;
  float sign_side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec4 c = (gl_VertexID & 2) == 0 ? ca : cb;
  c.xy += sign_side * reach * side * 2.0 / u_viewport * c.w;
  gl_Position = c;
  v_across = sign_side * reach;
  v_color = vec4(uvec4(instance.z, instance.z >> 8, instance.z >> 16, instance.z >> 24) & 255u) / 255.0;
}
)";

const char* const kLineFragment = SINEW_GLSL R"(
in vec4 v_color;
noperspective in float v_across;
uniform float u_width;
uniform float u_opacity;
layout(location = 0) out vec4 o_color;
void main() {
  float cover = clamp(0.5 * u_width + 0.5 - abs(v_across), 0.0, 1.0);
  o_color = vec4(pow(v_color.rgb, vec3(2.2)), v_color.a * cover * u_opacity);
}
)";

const char* const kDotVertex = SINEW_GLSL R"(
layout(location = 0) in uvec2 instance;  // point, RGBA8
uniform samplerBuffer u_points;
uniform mat4 u_view;
uniform mat4 u_projection;
uniform float u_scale;
uniform vec2 u_viewport;
uniform float u_width;
uniform float u_bias;
uniform float u_near;
out vec4 v_color;
noperspective out vec2 v_at;
void main() {
  int k = int(instance.x) * 3;
  vec3 p = vec3(texelFetch(u_points, k).r, texelFetch(u_points, k + 1).r, texelFetch(u_points, k + 2).r);
  vec3 v = (u_view * vec4(p * u_scale, 1.0)).xyz;
  v *= 1.0 - u_bias / max(length(v), 1e-6);
  vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
  v_at = corner * (0.5 * u_width + 1.0);
  vec4 c = u_projection * vec4(v, 1.0);
  c.xy += v_at * 2.0 / u_viewport * c.w;
  gl_Position = v.z > -u_near ? vec4(0.0, 0.0, 2.0, 1.0) : c;
  v_color = vec4(uvec4(instance.y, instance.y >> 8, instance.y >> 16, instance.y >> 24) & 255u) / 255.0;
}
)";

const char* const kDotFragment = SINEW_GLSL R"(
in vec4 v_color;
noperspective in vec2 v_at;
uniform float u_width;
uniform float u_opacity;
layout(location = 0) out vec4 o_color;
void main() {
  float r = length(v_at);
  float cover = clamp(0.5 * u_width + 0.5 - r, 0.0, 1.0);
  float rim = clamp(r - 0.5 * u_width + min(1.8, 0.2 * u_width), 0.0, 1.0);
  o_color = vec4(mix(pow(v_color.rgb, vec3(2.2)), vec3(0.02), 0.7 * rim), v_color.a * cover * u_opacity);
}
)";

}  // namespace sinew::tools::shaders
