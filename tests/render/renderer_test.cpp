// SPDX-License-Identifier: GPL-3.0-or-later
//
// The drawing backend against values worked out by hand: light, geometry, texture space.
#include "tools/render/renderer.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "tools/render/headless.h"
#include "tools/render/text.h"
#include "tools/render/texture.h"

namespace sinew::tools {
namespace {

constexpr int kSize = 256;

int encoded(float linear) {
  const float c = std::min(linear, 1.0F);
  return static_cast<int>(std::lround(255 * (c <= 0.0031308F ? 12.92F * c : 1.055F * std::pow(c, 1 / 2.4F) - 0.055F)));
}

void expectColor(const Image& image, int x, int y, const Eigen::Vector3f& linear, int tolerance, const char* what) {
  const Rgb8 got = image.at(x, y);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(static_cast<int>(got[k]), encoded(linear[static_cast<Eigen::Index>(k)]), tolerance)
        << what << ", channel " << k << " at " << x << ", " << y;
  }
}

int difference(Rgb8 a, Rgb8 b) {
  int most = 0;
  for (std::size_t k = 0; k < 3; ++k) most = std::max(most, std::abs(static_cast<int>(a[k]) - static_cast<int>(b[k])));
  return most;
}

std::size_t changedPixels(const Image& a, const Image& b, int threshold) {
  std::size_t count = 0;
  for (int y = 0; y < a.height; ++y) {
    for (int x = 0; x < a.width; ++x) count += difference(a.at(x, y), b.at(x, y)) > threshold ? 1U : 0U;
  }
  return count;
}

// A unit cube with flat normals, centred.
DrawModel cube(const Eigen::Vector3f& color) {
  DrawModel model;
  model.diagonal = std::sqrt(3.0F);
  for (int axis = 0; axis < 3; ++axis) {
    for (float side : {-1.0F, 1.0F}) {
      const auto base = static_cast<std::uint32_t>(model.positions.size());
      const Eigen::Vector3f n = side * Eigen::Vector3f::Unit(axis);
      const Eigen::Vector3f u = Eigen::Vector3f::Unit((axis + 1) % 3);
      const Eigen::Vector3f v = n.cross(u);
      for (const auto& [a, b] : {std::pair(-1, -1), std::pair(1, -1), std::pair(1, 1), std::pair(-1, 1)}) {
        model.positions.push_back((n + static_cast<float>(a) * u + static_cast<float>(b) * v) / 2);
        model.normals.push_back(n);
      }
      model.triangles.push_back({base, base + 1, base + 2});
      model.triangles.push_back({base, base + 2, base + 3});
    }
  }
  model.parts.push_back({0, static_cast<std::uint32_t>(model.triangles.size()), color, formats::kNone, false});
  return model;
}

// A quad from (-1, -1) to (1, 1) in the plane z = 0, its UVs covering the texture once.
DrawModel quad() {
  DrawModel model;
  model.diagonal = 2;
  model.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  model.normals.assign(4, Eigen::Vector3f::UnitZ());
  model.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  model.triangles = {{0, 1, 2}, {0, 2, 3}};
  model.parts.push_back({0, 2, Eigen::Vector3f::Ones(), 0, false});
  return model;
}

Camera frontCamera() {
  Camera camera;
  camera.distance = 2.5F;
  camera.near_plane = 0.5F;
  camera.far_plane = 10;
  return camera;
}

// Every surface sees exactly its own colour.
DrawSettings plainLight() {
  DrawSettings settings;
  settings.lighting.key_color = settings.lighting.fill_color = Eigen::Vector3f::Zero();
  settings.lighting.sky_color = settings.lighting.ground_color = Eigen::Vector3f::Ones();
  settings.lighting.specular = 0;
  return settings;
}

class RendererTest : public ::testing::Test {
 protected:
  static Image draw(const DrawModel& model, const DrawSettings& settings, const Camera& camera = frontCamera(),
                    int width = kSize, int height = kSize) {
    Renderer renderer(model);
    renderer.draw(camera, settings, width, height);
    return renderer.read();
  }
  HeadlessContext context_;
};

TEST_F(RendererTest, CubeUnderKnownLightHasTheComputedColour) {
  const Eigen::Vector3f albedo(0.5F, 0.25F, 0.1F);
  DrawSettings settings;
  settings.lighting.specular = 0;
  const Lighting& light = settings.lighting;
  for (const Eigen::Vector3f& to_light :
       {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(0, 0.6F, 0.8F), Eigen::Vector3f(0, 0, -1)}) {
    settings.lighting.key_direction = to_light;
    const Image image = draw(cube(albedo), settings);
    // The front face looks at the eye: full fill, and ambient halfway between sky and ground.
    const Eigen::Vector3f sum =
        std::max(to_light.z(), 0.0F) * light.key_color + light.fill_color + (light.sky_color + light.ground_color) / 2;
    expectColor(image, kSize / 2, kSize / 2, albedo.cwiseProduct(sum), 1, "front face");
    expectColor(image, kSize / 2 + 40, kSize / 2 - 40, albedo.cwiseProduct(sum), 1, "front face");
  }
}

TEST_F(RendererTest, NothingIsBurntOutByTheStandardLights) {
  DrawSettings settings;
  settings.lighting.specular = 0;
  const Lighting& light = settings.lighting;
  EXPECT_LE((light.key_color + light.fill_color + light.sky_color).maxCoeff(), 1.0F);
  EXPECT_GT((light.key_color + light.fill_color + light.sky_color).minCoeff(), 0.9F);
}

TEST_F(RendererTest, BackgroundIsTheGradient) {
  const DrawSettings settings;
  const Image image = draw(cube(Eigen::Vector3f::Ones()), settings);
  for (int y : {0, 30, 128, 255}) {
    const float t = (static_cast<float>(kSize - 1 - y) + 0.5F) / kSize;
    const float s = t * t * (3 - 2 * t);
    expectColor(image, 2, y,
                settings.lighting.background_bottom +
                    s * (settings.lighting.background_top - settings.lighting.background_bottom),
                1, "background");
  }
}

TEST_F(RendererTest, SilhouetteHasTheAnalyticArea) {
  const Camera camera = frontCamera();
  DrawSettings settings = plainLight();
  settings.lighting.background_top = settings.lighting.background_bottom = Eigen::Vector3f::Zero();
  const Image image = draw(cube(Eigen::Vector3f::Ones()), settings, camera);
  // Coverage from the anti-aliased edges: white on black, decoded to linear.
  double covered = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double c = image.at(x, y)[0] / 255.0;
      covered += c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
    }
  }
  const double half = 0.5 / std::sqrt(3.0);  // drawing units
  const double side = 2 * half / (static_cast<double>(camera.distance) - half) /
                      (2 * std::tan(static_cast<double>(camera.fov_y) / 2)) * kSize;
  EXPECT_NEAR(covered, side * side, side) << "side " << side;  // within a quarter of a pixel at each edge
}

TEST_F(RendererTest, WindingNormalsAndTheirAbsenceDoNotMatter) {
  DrawSettings settings;
  settings.lighting.key_direction = Eigen::Vector3f(0.3F, 0.5F, 0.8F).normalized();
  Camera camera = viewCamera(ViewName::three_quarter);
  camera.distance = 2.5F;
  const DrawModel right = cube({0.6F, 0.6F, 0.6F});
  const Image expected = draw(right, settings, camera);
  DrawModel wound = right;
  for (auto& t : wound.triangles) std::swap(t[0], t[1]);
  DrawModel turned = right;
  for (auto& n : turned.normals) n = -n;
  DrawModel bare = right;
  for (auto& n : bare.normals) n.setZero();
  for (const DrawModel& model : {wound, turned, bare})
    EXPECT_LT(changedPixels(expected, draw(model, settings, camera), 2), 20U);
}

TEST_F(RendererTest, ScaleOfTheModelDoesNotMatter) {
  const DrawSettings settings;
  const Image expected = draw(cube({0.6F, 0.5F, 0.4F}), settings);
  for (float scale : {1e-6F, 1e3F}) {
    DrawModel model = cube({0.6F, 0.5F, 0.4F});
    model.diagonal *= scale;
    for (auto& p : model.positions) p *= scale;
    EXPECT_EQ(changedPixels(expected, draw(model, settings), 1), 0U) << scale;
  }
}

TEST_F(RendererTest, TextureLandsTheRightWayUpAndKeepsItsColours) {
  DrawModel model = quad();
  TexturePixels texture{64, 64, {}};
  const auto color = [](int x, int y) -> Rgb8 {  // y counts from the top of the picture
    if (y < 32) return x < 32 ? Rgb8{200, 20, 20} : Rgb8{20, 188, 20};
    return x < 32 ? Rgb8{30, 30, 220} : Rgb8{188, 188, 188};
  };
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (std::uint8_t c : color(x, y)) texture.rgba.push_back(c);
      texture.rgba.push_back(255);
    }
  }
  model.textures.push_back(texture);
  const Image image = draw(model, plainLight());
  const int d = kSize / 5;
  for (const auto& [x, y] : {std::pair(-1, -1), std::pair(1, -1), std::pair(-1, 1), std::pair(1, 1)}) {
    const Rgb8 got = image.at(kSize / 2 + x * d, kSize / 2 + y * d);
    EXPECT_LE(difference(got, color(32 + 16 * x, 32 + 16 * y)), 1) << x << ", " << y;
  }
}

TEST_F(RendererTest, TextureFileDecodesTopDownAndBadBytesAreNoPicture) {
  Image picture(4, 2, {10, 20, 30});
  picture.fillRectangle(0, 0, 2, 1, {250, 0, 0});
  const std::filesystem::path file = std::filesystem::path(::testing::TempDir()) / "sinew_texture_test.png";
  writePng(picture, file);
  std::ifstream stream(file, std::ios::binary);
  std::vector<char> text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  const auto bytes = std::as_bytes(std::span(text));
  const TexturePixels decoded = decodeTexture(bytes, 4096);
  ASSERT_EQ(decoded.width, 4);
  ASSERT_EQ(decoded.height, 2);
  EXPECT_EQ((std::array{decoded.rgba[0], decoded.rgba[1], decoded.rgba[2], decoded.rgba[3]}),
            (std::array<std::uint8_t, 4>{250, 0, 0, 255}));
  EXPECT_EQ(decoded.rgba[8], 10);
  EXPECT_EQ(decoded.rgba[16], 10);
  EXPECT_EQ(decodeTexture(bytes, 2).width, 2);
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    const TexturePixels part = decodeTexture(bytes.first(cut), 4096);
    EXPECT_EQ(part.width, 0) << cut;
  }
  std::filesystem::remove(file);
}

TEST_F(RendererTest, TgaDecodes) {
  // One row of two texels: blue, green, red.
  const std::string_view tga("\0\0\2\0\0\0\0\0\0\0\0\0\2\0\1\0\x18\0\x10\x20\xff\x40\x50\x60", 24);
  const TexturePixels decoded = decodeTexture(std::as_bytes(std::span(tga)), 4096);
  ASSERT_EQ(decoded.width, 2);
  ASSERT_EQ(decoded.height, 1);
  EXPECT_EQ(decoded.rgba, (std::vector<std::uint8_t>{0xff, 0x20, 0x10, 255, 0x60, 0x50, 0x40, 255}));
}

TEST_F(RendererTest, NothingBleedsOverTextureSeams) {
  // Triangles use the left half, red; the right half is green and used by nobody: no level may show any of it.
  DrawModel model = quad();
  for (auto& uv : model.uvs) uv.x() = 0.02F + 0.44F * uv.x();
  TexturePixels texture{64, 64, {}};
  for (int i = 0; i < 64 * 64; ++i) {
    const bool used = i % 64 < 32;
    for (int c : {used ? 200 : 0, used ? 0 : 200, 0, 255}) texture.rgba.push_back(static_cast<std::uint8_t>(c));
  }
  model.textures.push_back(texture);
  const PreparedTexture prepared = prepareTexture(model, 0);
  ASSERT_EQ(prepared.levels.size(), 7U);
  EXPECT_FALSE(prepared.cutout);
  for (const TexturePixels& level : prepared.levels) {
    for (std::size_t i = 0; i < level.rgba.size(); i += 4) {
      ASSERT_NEAR(level.rgba[i], 200, 1) << level.width;
      ASSERT_EQ(level.rgba[i + 1], 0) << level.width;
    }
  }
  // Alpha counts as a cut-out only where it is nearly two-valued over what is used.
  for (std::size_t i = 0; i < 64 * 64; ++i) model.textures[0].rgba[4 * i + 3] = (i / 64) % 16 < 8 ? 0 : 255;
  EXPECT_TRUE(prepareTexture(model, 0).cutout);
  for (std::size_t i = 0; i < 64 * 64; ++i) model.textures[0].rgba[4 * i + 3] = static_cast<std::uint8_t>(i % 256);
  EXPECT_FALSE(prepareTexture(model, 0).cutout);
}

TEST_F(RendererTest, GroundIsTheBackgroundDarkenedByTheShadow) {
  DrawSettings settings;
  settings.ground = true;
  settings.ground_height = -0.9F;  // drawing units; the cube floats 0.6 above it
  settings.shadow_radius = 0.6F;
  Camera camera;
  camera.pitch = 0.6F;
  camera.distance = 5;
  camera.far_plane = 50;
  const DrawModel model = cube({0.5F, 0.5F, 0.5F});
  const Image with = draw(model, settings, camera);
  settings.ground = false;
  const Image without = draw(model, settings, camera);
  const auto pixelOf = [&](const Eigen::Vector3f& p) {
    const Eigen::Vector4f clip = camera.projection(1) * camera.view() * p.homogeneous();
    return std::pair(static_cast<int>((clip.x() / clip.w() * 0.5F + 0.5F) * kSize),
                     static_cast<int>((0.5F - clip.y() / clip.w() * 0.5F) * kSize));
  };
  // The middle of the cube's shadow: no key light arrives, all of the sky does. A line of the grid may darken by a
  // tenth.
  const Lighting& light = settings.lighting;
  const auto [x, y] = pixelOf(light.key_direction * (settings.ground_height / light.key_direction.y()));
  const float t = (static_cast<float>(kSize - 1 - y) + 0.5F) / kSize;
  const Eigen::Vector3f background =
      light.background_bottom + t * t * (3 - 2 * t) * (light.background_top - light.background_bottom);
  const Eigen::Vector3f open = light.key_color * light.key_direction.y() + light.sky_color;
  const Eigen::Vector3f expected = background.cwiseProduct(light.sky_color).cwiseQuotient(open);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_LE(static_cast<int>(with.at(x, y)[k]), encoded(expected[static_cast<Eigen::Index>(k)]) + 2);
    EXPECT_GE(static_cast<int>(with.at(x, y)[k]), encoded(0.84F * expected[static_cast<Eigen::Index>(k)]) - 2);
  }
  // In the open, at the same distance, it is the background (but for the grid).
  const auto [open_x, open_y] = pixelOf({0.53F, settings.ground_height, -0.54F});
  EXPECT_LE(difference(with.at(open_x, open_y), without.at(open_x, open_y)), 14);
  EXPECT_LE(difference(with.at(2, 2), without.at(2, 2)), 1);  // beyond its edge
}

TEST_F(RendererTest, LinesAndDotsAreWhereTheirPointsAre) {
  Renderer renderer(quad());
  Annotation annotation;
  annotation.points = {{-0.6F, 0.4F, 0}, {0.6F, 0.4F, 0}, {0, -0.5F, 0}};
  annotation.lines = {{0, 1, {255, 0, 0, 255}}};
  annotation.dots = {{2, {0, 0, 255, 255}}};
  annotation.line_width = 4;
  renderer.setAnnotation(annotation);
  const Camera camera = frontCamera();
  DrawSettings settings = plainLight();
  settings.dot_size = 14;
  renderer.draw(camera, settings, kSize, kSize);
  const Image image = renderer.read();
  const auto at = [&](const Eigen::Vector3f& metres) {
    const Eigen::Vector4f clip = camera.projection(1) * camera.view() * (metres / 2).homogeneous();
    return image.at(static_cast<int>((clip.x() / clip.w() * 0.5F + 0.5F) * kSize),
                    static_cast<int>((0.5F - clip.y() / clip.w() * 0.5F) * kSize));
  };
  EXPECT_LE(difference(at({0, 0.4F, 0}), {255, 0, 0}), 3);
  EXPECT_LE(difference(at({0.5F, 0.4F, 0}), {255, 0, 0}), 3);
  EXPECT_LE(difference(at({0, -0.5F, 0}), {0, 0, 255}), 3);
  EXPECT_LE(difference(at({0.8F, 0.4F, 0}), {255, 255, 255}), 1);
  EXPECT_LE(difference(at({0, 0, 0}), {255, 255, 255}), 1);
}

TEST(Text, HasInkOfAboutItsWidth) {
  Image image(300, 40, {255, 255, 255});
  drawText(image, 10, 5, 24, {0, 0, 0}, "Höhe Ω Я 0.25 s");
  int first = image.width;
  int last = -1;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (image.at(x, y)[0] > 128) continue;
      first = std::min(first, x);
      last = std::max(last, x);
    }
  }
  EXPECT_NEAR(static_cast<float>(last - first), textWidth("Höhe Ω Я 0.25 s", 24), 5);
  EXPECT_GE(first, 10);
  EXPECT_LE(textWidth(fitText("a long line of text that cannot fit", 20, 120), 20), 120);
  EXPECT_EQ(fitText("short", 20, 400), "short");
  drawText(image, 290, 30, 24, {0, 0, 0}, "outside \xff\xc3 is cut");  // broken UTF-8 and pixels outside do no harm
}

}  // namespace
}  // namespace sinew::tools
