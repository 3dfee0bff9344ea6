// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/texture.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace sinew::tools {

namespace {

struct Level {
  int width = 0, height = 0;
  std::vector<std::array<float, 4>> rgba;  // linear, not premultiplied
  std::vector<float> weight;               // how much of it triangles use

  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  }
};

const std::array<float, 256>& linearTable() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (std::size_t i = 0; i < t.size(); ++i) {
      const float c = static_cast<float>(i) / 255;
      t[i] = c <= 0.04045F ? c / 12.92F : std::pow((c + 0.055F) / 1.055F, 2.4F);
    }
    return t;
  }();
  return table;
}

std::uint8_t encode(float c) {
  // 4096 steps are exact to within half a step of 8 bits from the third darkest value on.
  static const std::array<std::uint8_t, 4097> table = [] {
    std::array<std::uint8_t, 4097> t{};
    for (std::size_t i = 0; i < t.size(); ++i) {
      const float linear = static_cast<float>(i) / 4096;
      const float s = linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1 / 2.4F) - 0.055F;
      t[i] = static_cast<std::uint8_t>(std::clamp(s * 255 + 0.5F, 0.0F, 255.0F));
    }
    return t;
  }();
  return table[static_cast<std::size_t>(std::clamp(c, 0.0F, 1.0F) * 4096 + 0.5F)];
}

int wrap(int i, int n) {
  const int r = i % n;
  return r < 0 ? r + n : r;
}

// Marks the texels that a triangle covers, with one texel around it for the bilinear filter.
void coverTriangle(Level& level, std::array<Eigen::Vector2f, 3> p) {
  const auto size = Eigen::Vector2f(static_cast<float>(level.width), static_cast<float>(level.height));
  Eigen::Vector2f shift(std::floor(p[0].x()), std::floor(p[0].y()));
  for (Eigen::Vector2f& q : p) q = (q - shift).cwiseProduct(size);
  const Eigen::Vector2f low = p[0].cwiseMin(p[1]).cwiseMin(p[2]).array() - 1;
  const Eigen::Vector2f high = p[0].cwiseMax(p[1]).cwiseMax(p[2]).array() + 1;
  if (!low.allFinite() || !high.allFinite()) return;
  if ((high - low).x() > 4 * size.x() || (high - low).y() > 4 * size.y()) {  // tiled many times: all of it is used
    std::fill(level.weight.begin(), level.weight.end(), 1.0F);
    return;
  }
  // Edge functions, pushed outwards by one texel.
  std::array<Eigen::Vector3f, 3> edges;
  const float area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
  const float side = area < 0 ? -1.0F : 1.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector2f a = p[k];
    const Eigen::Vector2f d = p[(k + 1) % 3] - a;
    const float length = std::max(d.norm(), 1e-6F);
    edges[k] = Eigen::Vector3f(-d.y(), d.x(), d.y() * a.x() - d.x() * a.y()) * (side / length);
    edges[k].z() += 1.0F;
  }
  for (int y = static_cast<int>(std::floor(low.y())); y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(std::floor(low.x())); x <= static_cast<int>(high.x()); ++x) {
      const Eigen::Vector3f q(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 1);
      if (edges[0].dot(q) < 0 || edges[1].dot(q) < 0 || edges[2].dot(q) < 0) continue;
      level.weight[level.at(wrap(x, level.width), wrap(y, level.height))] = 1;
    }
  }
}

Level halve(const Level& fine) {
  Level coarse;
  coarse.width = std::max(1, fine.width / 2);
  coarse.height = std::max(1, fine.height / 2);
  const std::size_t count = static_cast<std::size_t>(coarse.width) * static_cast<std::size_t>(coarse.height);
  coarse.rgba.resize(count);
  coarse.weight.resize(count);
  for (int y = 0; y < coarse.height; ++y) {
    // An odd last row or column is folded into the last texel.
    const int y0 = y * fine.height / coarse.height;
    const int y1 = (y + 1) * fine.height / coarse.height;
    for (int x = 0; x < coarse.width; ++x) {
      const int x0 = x * fine.width / coarse.width;
      const int x1 = (x + 1) * fine.width / coarse.width;
      std::array<float, 4> used{};
      std::array<float, 4> all{};
      float weight = 0;
      float texels = 0;
      for (int v = y0; v < y1; ++v) {
        for (int u = x0; u < x1; ++u) {
          const std::size_t i = fine.at(u, v);
          for (std::size_t k = 0; k < 4; ++k) {
            used[k] += fine.weight[i] * fine.rgba[i][k];
            all[k] += fine.rgba[i][k];
          }
          weight += fine.weight[i];
          texels += 1;
        }
      }
      const std::size_t o = coarse.at(x, y);
      for (std::size_t k = 0; k < 4; ++k) coarse.rgba[o][k] = weight > 0 ? used[k] / weight : all[k] / texels;
      coarse.weight[o] = weight / texels;
    }
  }
  return coarse;
}

}  // namespace

PreparedTexture prepareTexture(const DrawModel& model, std::uint32_t texture) {
  PreparedTexture prepared;
  const TexturePixels& pixels = model.textures[texture];
  if (pixels.width <= 0) return prepared;
  Level base;
  base.width = pixels.width;
  base.height = pixels.height;
  const std::size_t count = static_cast<std::size_t>(base.width) * static_cast<std::size_t>(base.height);
  base.rgba.resize(count);
  base.weight.assign(count, 0);
  for (int y = 0; y < base.height; ++y) {
    for (int x = 0; x < base.width; ++x) {
      const std::uint8_t* from = &pixels.rgba[base.at(x, base.height - 1 - y) * 4];
      base.rgba[base.at(x, y)] = {linearTable()[from[0]], linearTable()[from[1]], linearTable()[from[2]],
                                  static_cast<float>(from[3]) / 255};
    }
  }
  for (const DrawPart& part : model.parts) {
    if (part.texture != texture) continue;
    for (std::uint32_t t = part.first_triangle; t < part.first_triangle + part.triangle_count; ++t) {
      const auto& v = model.triangles[t];
      coverTriangle(base, {model.uvs[v[0]], model.uvs[v[1]], model.uvs[v[2]]});
    }
  }
  std::size_t used = 0;
  std::size_t clear = 0;
  std::size_t solid = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (base.weight[i] == 0) continue;
    ++used;
    if (base.rgba[i][3] < 0.0625F) ++clear;
    if (base.rgba[i][3] > 0.9375F) ++solid;
  }
  prepared.cutout = clear * 100 >= used && solid * 4 >= used && (clear + solid) * 10 >= used * 9 && clear > 0;

  std::vector<Level> levels;
  levels.push_back(std::move(base));
  while (levels.back().width > 1 || levels.back().height > 1) levels.push_back(halve(levels.back()));
  // Push: what nobody uses becomes its coarser neighbourhood, from the coarsest level down.
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    Level& fine = levels[l];
    const Level& coarse = levels[l + 1];
    for (int y = 0; y < fine.height; ++y) {
      for (int x = 0; x < fine.width; ++x) {
        const std::size_t i = fine.at(x, y);
        if (fine.weight[i] > 0) continue;
        const std::size_t o = coarse.at(std::min(x * coarse.width / fine.width, coarse.width - 1),
                                        std::min(y * coarse.height / fine.height, coarse.height - 1));
        const float alpha = fine.rgba[i][3];
        fine.rgba[i] = coarse.rgba[o];
        if (!prepared.cutout) fine.rgba[i][3] = alpha;
      }
    }
  }
  for (const Level& level : levels) {
    TexturePixels out;
    out.width = level.width;
    out.height = level.height;
    out.rgba.resize(level.rgba.size() * 4);
    for (std::size_t i = 0; i < level.rgba.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) out.rgba[4 * i + k] = encode(level.rgba[i][k]);
      out.rgba[4 * i + 3] = static_cast<std::uint8_t>(std::clamp(level.rgba[i][3] * 255 + 0.5F, 0.0F, 255.0F));
    }
    prepared.levels.push_back(std::move(out));
  }
  return prepared;
}

void uploadTexture(unsigned int name, const PreparedTexture& texture) {
  glBindTexture(GL_TEXTURE_2D, name);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
  for (std::size_t l = 0; l < texture.levels.size(); ++l) {
    const TexturePixels& level = texture.levels[l];
    glTexImage2D(GL_TEXTURE_2D, static_cast<GLint>(l), GL_SRGB8_ALPHA8, level.width, level.height, 0, GL_RGBA,
                 GL_UNSIGNED_BYTE, level.rgba.data());
  }
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAX_LEVEL, std::max(0, static_cast<GLint>(texture.levels.size()) - 1));
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_REPEAT);
  glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
  glBindTexture(GL_TEXTURE_2D, 0);
}

}  // namespace sinew::tools
