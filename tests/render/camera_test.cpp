// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/render/camera.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "tools/studio/orbit.h"

namespace sinew::tools {
namespace {

std::vector<Eigen::Vector3f> cloud(unsigned seed, const Eigen::Vector3f& extent) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  std::vector<Eigen::Vector3f> points;
  for (int i = 0; i < 500; ++i)
    points.push_back(Eigen::Vector3f(uniform(random), uniform(random), uniform(random)).cwiseProduct(extent));
  return points;
}

Eigen::Vector3f project(const Camera& camera, float aspect, const Eigen::Vector3f& p) {
  const Eigen::Vector4f clip = camera.projection(aspect) * camera.view() * p.homogeneous();
  return clip.head<3>() / clip.w();
}

TEST(Camera, AxesAreRightHandedAndUnit) {
  for (float yaw : {-3.0F, -0.4F, 0.0F, 1.0F, 2.5F}) {
    for (float pitch : {-1.5F, -0.3F, 0.0F, 0.8F, 1.5F}) {
      Camera camera;
      camera.yaw = yaw;
      camera.pitch = pitch;
      const Eigen::Matrix3f axes = camera.view().block<3, 3>(0, 0);
      EXPECT_LT((axes * axes.transpose() - Eigen::Matrix3f::Identity()).norm(), 1e-5F);
      EXPECT_NEAR(axes.determinant(), 1, 1e-5F);
      EXPECT_LT((camera.view() * camera.eye().homogeneous()).head<3>().norm(), 1e-5F);
    }
  }
}

TEST(Camera, FitHoldsAllPointsAndTouchesTheMargin) {
  constexpr float margin = 0.1F;
  for (unsigned seed = 0; seed < 20; ++seed) {
    const std::vector<Eigen::Vector3f> points =
        cloud(seed, Eigen::Vector3f(0.2F + 0.1F * static_cast<float>(seed % 5), 0.5F, 0.9F));
    for (float aspect : {0.6F, 1.0F, 1.8F}) {
      Camera camera = viewCamera(static_cast<ViewName>(seed % 4));
      fitCamera(camera, points, aspect, margin);
      float widest = 0;
      for (const Eigen::Vector3f& p : points) {
        const Eigen::Vector3f ndc = project(camera, aspect, p);
        ASSERT_GT(ndc.z(), -1);
        ASSERT_LT(ndc.z(), 1);
        widest = std::max({widest, std::abs(ndc.x()), std::abs(ndc.y())});
      }
      EXPECT_NEAR(widest, 1 - margin, 1e-3F) << "seed " << seed << ", aspect " << aspect;
    }
  }
}

TEST(Camera, RayOfAPixelGoesThroughWhatIsDrawnThere) {
  Camera camera = viewCamera(ViewName::three_quarter);
  camera.target = {0.3F, -0.2F, 0.1F};
  for (const Eigen::Vector3f& p : cloud(7, Eigen::Vector3f::Constant(0.5F))) {
    const Eigen::Vector3f ndc = project(camera, 1.5F, p);
    const Eigen::Vector3f ray = camera.ray((ndc.x() + 1) * 300, (1 - ndc.y()) * 200, 600, 400);
    EXPECT_LT(ray.cross(p - camera.eye()).norm(), 1e-4F);
    EXPECT_GT(ray.dot(p - camera.eye()), 0);
  }
}

TEST(Camera, NamesAndViewsAgree) {
  for (std::size_t i = 0; i < viewNames().size(); ++i) EXPECT_EQ(viewByName(viewNames()[i]), static_cast<ViewName>(i));
  EXPECT_FALSE(viewByName("behind"));
}

TEST(MotionHull, SupportsAreWithinItsStatedError) {
  MotionHull hull;
  EXPECT_TRUE(hull.empty());
  std::vector<Eigen::Vector3f> sphere = cloud(3, Eigen::Vector3f::Ones());
  for (int i = 0; i < 60; ++i) {
    const std::vector<Eigen::Vector3f> more = cloud(100 + static_cast<unsigned>(i), Eigen::Vector3f::Ones());
    sphere.insert(sphere.end(), more.begin(), more.end());
  }
  for (Eigen::Vector3f& p : sphere) p.normalize();
  hull.add(sphere);
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3f direction = Eigen::Vector3f(normal(random), normal(random), normal(random)).normalized();
    float reach = -1;
    for (const Eigen::Vector3f& p : hull.points()) reach = std::max(reach, direction.dot(p));
    ASSERT_GT(reach, 0.97F);
  }
  EXPECT_NEAR(hull.radius(), 1, 0.02F);
  hull.add(std::vector<Eigen::Vector3f>{Eigen::Vector3f::Constant(std::nanf(""))});
  for (const Eigen::Vector3f& p : hull.points()) EXPECT_TRUE(p.allFinite());
}

TEST(Mouse, HitsTheNearestTriangleFromEitherSide) {
  const std::vector<Eigen::Vector3f> positions = {{-1, -1, 0},  {1, -1, 0}, {0, 1, 0},
                                                  {-1, -1, -1}, {0, 1, -1}, {1, -1, -1}};
  const std::vector<std::array<std::uint32_t, 3>> triangles = {{3, 4, 5}, {0, 1, 2}};
  const auto front = hitTriangles(positions, triangles, {0.1F, 0.7F, 5}, {0, 0, -1});
  ASSERT_TRUE(front);
  EXPECT_EQ(front->triangle, 1U);
  EXPECT_EQ(front->vertex, 2U);
  EXPECT_LT((front->point - Eigen::Vector3f(0.1F, 0.7F, 0)).norm(), 1e-6F);
  const auto back = hitTriangles(positions, triangles, {0.1F, 0.7F, -5}, {0, 0, 1});
  ASSERT_TRUE(back);
  EXPECT_EQ(back->triangle, 0U);
  EXPECT_FALSE(hitTriangles(positions, triangles, {3, 0, 5}, {0, 0, -1}));
  EXPECT_FALSE(hitTriangles(positions, triangles, {0, 0, 5}, {0, 0, 1}));  // behind the eye
}

TEST(Mouse, DraggedPointStaysUnderTheMouseInThePicturePlane) {
  Camera camera = viewCamera(ViewName::three_quarter);
  const Eigen::Vector3f hit(0.2F, 0.1F, -0.3F);
  for (float x = 50; x < 600; x += 90) {
    const Eigen::Vector3f offset = dragOffset(camera, hit, camera.ray(x, 130, 600, 400));
    EXPECT_NEAR(offset.dot(camera.back()), 0, 1e-5F);
    const Eigen::Vector3f ndc = project(camera, 1.5F, hit + offset);
    EXPECT_NEAR((ndc.x() + 1) * 300, x, 0.05F);
    EXPECT_NEAR((1 - ndc.y()) * 200, 130, 0.05F);
  }
}

TEST(Mouse, PanFollowsTheMouse) {
  Camera camera = viewCamera(ViewName::three_quarter);
  const Eigen::Vector3f point = camera.target;
  const Eigen::Vector3f before = project(camera, 1.5F, point);
  panCamera(camera, 40, -25, 400);
  const Eigen::Vector3f after = project(camera, 1.5F, point);
  EXPECT_NEAR((after.x() - before.x()) * 300, 40, 0.05F);
  EXPECT_NEAR((after.y() - before.y()) * -200, -25, 0.05F);
  const float distance = camera.distance;
  zoomCamera(camera, 2);
  EXPECT_NEAR(camera.distance, distance * 0.81F, 1e-5F);
  orbitCamera(camera, 1e6F, 1e6F);
  EXPECT_LT(camera.pitch, 1.5708F);
}

}  // namespace
}  // namespace sinew::tools
