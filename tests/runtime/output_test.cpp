// SPDX-License-Identifier: MIT
//
// Outputs: tangents, previous positions, sub-meshes, bounds, strides, the same bits for every instruction set.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "runtime/attach/visual.h"
#include "runtime/attach/visual_constants.h"
#include "runtime/kernels/kernels.h"
#include "sinew/runtime/thread_pool.h"
#include "tests/runtime/world_state.h"
#include "tests/support/box_package.h"

namespace sinew::test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using formats::ClusterMode;
using Vec4 = std::array<float, 4>;

Vector3d direction(const Vec4& t) { return {double(t[0]), double(t[1]), double(t[2])}; }

struct Outputs {
  std::vector<Vec3> positions, normals, previous;
  std::vector<Vec4> tangents;
};

VisualOutput streamsInto(Outputs& out, std::size_t count) {
  out.positions.resize(count);
  out.normals.resize(count);
  out.previous.resize(count);
  out.tangents.resize(count);
  const auto n = std::uint32_t(count);
  return {{out.positions[0].data(), 12, n},
          {out.normals[0].data(), 12, n},
          {out.tangents[0].data(), 16, n},
          {out.previous[0].data(), 12, n}};
}

Outputs outputsOf(const World& world, BodyId body) {
  Outputs out;
  world.visualVertices(body, streamsInto(out, world.asset(body).package().visualPositions().size()));
  return out;
}

// A box with texture coordinates on its z faces: u along x, v along y, u mirrored where x < 0. Two sub-meshes.
formats::PackageContent texturedBox(bool cluster_attachment, ClusterMode mode = ClusterMode::linear) {
  BoxOptions box;
  box.clusters = {2, 2, 1};
  box.mode = mode;
  box.cluster_attachment = cluster_attachment;
  formats::PackageContent content = boxContent(box);
  for (const formats::Float3& p : content.visual_positions) {
    content.visual_uvs.push_back({p[0] < 0 ? -p[0] : p[0], p[1]});
  }
  const auto count = std::uint32_t(content.visual_triangles.size());
  const std::uint32_t half = count / 2;
  content.sub_meshes = {{content.addText("first"), formats::kNone, 0, half, 0},
                        {content.addText("second"), formats::kNone, half, count - half, 0}};
  return content;
}

TEST(Outputs, RestTangentsFollowTheTextureCoordinates) {
  const auto asset = makeAsset(texturedBox(false));
  const auto& package = asset->package();
  const auto tangents = asset->restTangents();
  const auto normals = package.visualNormals();
  ASSERT_EQ(tangents.size(), package.visualPositions().size());
  int judged = 0;
  for (std::size_t i = 0; i < tangents.size(); ++i) {
    const Vec4& t = tangents[i];
    const Vector3d tangent = direction(t), normal = wide(normals[i]).normalized();
    ASSERT_NEAR(tangent.norm(), 1, 1e-6);
    ASSERT_NEAR(tangent.dot(normal), 0, 1e-6);
    ASSERT_EQ(std::abs(t[3]), 1.0F);
    const Vec3& p = package.visualPositions()[i];
    // Well inside a z face all triangles around agree: u grows along +x or, mirrored, along -x; v along y.
    if (std::abs(normal[2]) < 0.99 || std::abs(p[0]) < 0.2F || std::abs(p[0]) > 0.3F) continue;
    const double side = p[0] > 0 ? 1 : -1;
    EXPECT_NEAR(tangent[0], side, 1e-5);
    EXPECT_NEAR((double(t[3]) * normal.cross(tangent))[1], 1, 1e-5);
    ++judged;
  }
  EXPECT_GT(judged, 3);
}

TEST(Outputs, TangentsFollowAffineMapsByTheGradient) {
  Matrix3d shear;
  shear << 1.3, 0.4, 0, 0, 0.7, 0.1, 0.2, 0, 1.1;
  for (const bool cluster_attachment : {false, true}) {
    for (const Matrix3d& map : {Matrix3d(Matrix3d::Identity()), shear}) {
      World world(weightless());
      const BodyId body = *world.addBody(makeAsset(texturedBox(cluster_attachment)));
      const auto& asset = world.asset(body);
      std::vector<Vec3> x;
      for (const Vec3& p : world.positions(body)) {
        const Vector3d moved = map * wide(p) + Vector3d(1, 2, 3);
        x.push_back({float(moved[0]), float(moved[1]), float(moved[2])});
      }
      world.setState(body, x, {});
      const Outputs out = outputsOf(world, body);
      for (std::size_t i = 0; i < out.tangents.size(); ++i) {
        const Vec4 &t = out.tangents[i], &rest = asset.restTangents()[i];
        const Vector3d tangent = direction(t), n = wide(out.normals[i]);
        Vector3d expected = map * direction(rest);
        expected = (expected - n * n.dot(expected)).normalized();
        ASSERT_LT((tangent - expected).norm(), 1e-4);
        ASSERT_EQ(t[3], rest[3]);
      }
    }
  }
}

// Collapsed, mirrored, huge, tiny, not finite: directions are unit and orthogonal, whatever happens.
TEST(Outputs, DirectionsAreUnitInTheWorstStates) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  const std::vector<std::pair<const char*, std::function<Vec3(Vec3)>>> states = {
      {"point",
       [](Vec3) {
         return Vec3{1, 1, 1};
       }},
      {"line",
       [](Vec3 p) {
         return Vec3{p[0], 0, 0};
       }},
      {"plane",
       [](Vec3 p) {
         return Vec3{p[0], 0, p[2]};
       }},
      {"mirrored",
       [](Vec3 p) {
         return Vec3{-p[0], p[1], p[2]};
       }},
      {"inside out",
       [](Vec3 p) {
         return Vec3{-p[0], -p[1], -p[2]};
       }},
      {"tiny",
       [](Vec3 p) {
         return Vec3{1e-9F * p[0], 1e-9F * p[1], 1e-9F * p[2]};
       }},
      {"huge",
       [](Vec3 p) {
         return Vec3{1e14F * p[0], 1e14F * p[1], 1e14F * p[2]};
       }},
      {"not a number",
       [nan](Vec3) {
         return Vec3{nan, nan, nan};
       }},
      {"one lost",
       [nan](Vec3 p) {
         return p[0] + p[1] + p[2] > 1.4F ? Vec3{nan, 0, 0} : p;
       }},
      {"infinite", [infinity](Vec3 p) {
         return p[0] > 0.4F ? Vec3{infinity, 0, 0} : p;
       }}};
  for (const bool cluster_attachment : {false, true}) {
    for (const auto& [name, state] : states) {
      World world(weightless());
      const BodyId body = *world.addBody(makeAsset(texturedBox(cluster_attachment, ClusterMode::quadratic)));
      std::vector<Vec3> x;
      for (const Vec3& p : world.positions(body)) x.push_back(state(p));
      world.setState(body, x, {});
      for (int i = 0; i < 3; ++i) {
        const Outputs out = outputsOf(world, body);
        for (std::size_t k = 0; k < out.normals.size(); ++k) {
          const Vector3d n = wide(out.normals[k]);
          const Vector3d t = direction(out.tangents[k]);
          ASSERT_NEAR(n.norm(), 1, 1e-5) << name << " " << k;
          ASSERT_NEAR(t.norm(), 1, 1e-5) << name << " " << k;
          ASSERT_NEAR(n.dot(t), 0, 1e-4) << name << " " << k;
          ASSERT_TRUE(wide(out.positions[k]).allFinite()) << name << " " << k;
        }
        world.step(1.0F / 60);
      }
    }
  }
}

TEST(Outputs, PreviousPositionsAreThoseBeforeTheLastStep) {
  for (const bool cluster_attachment : {false, true}) {
    World world;
    BodySettings settings;
    settings.keep_previous = true;
    const BodyId body = *world.addBody(makeAsset(texturedBox(cluster_attachment)), settings);
    Outputs before = outputsOf(world, body);
    EXPECT_EQ(before.positions, before.previous);
    for (int i = 0; i < 4; ++i) {
      world.step(1.0F / 60);
      const Outputs now = outputsOf(world, body);
      EXPECT_EQ(now.previous, before.positions);
      EXPECT_NE(now.previous, now.positions);
      before = now;
    }
    world.resetBody(body);
    const Outputs reset = outputsOf(world, body);
    EXPECT_EQ(reset.positions, reset.previous);
  }
}

TEST(Outputs, WithoutHistoryPreviousPositionsAreThePositions) {
  World world;
  const BodyId body = *world.addBody(makeAsset(texturedBox(false)));
  world.step(1.0F / 60);
  const Outputs out = outputsOf(world, body);
  EXPECT_EQ(out.positions, out.previous);
}

TEST(Outputs, ASubMeshWritesItsVerticesAndNoOther) {
  World world;
  const BodyId body = *world.addBody(makeAsset(texturedBox(false)));
  world.step(1.0F / 60);
  const auto& package = world.asset(body).package();
  const std::size_t count = package.visualPositions().size();
  const Outputs all = outputsOf(world, body);
  for (std::uint32_t s = 0; s < 2; ++s) {
    std::vector<bool> used(count, false);
    const formats::SubMesh& sub_mesh = package.subMeshes()[s];
    for (const auto& triangle : package.visualTriangles().subspan(sub_mesh.first_triangle, sub_mesh.triangle_count)) {
      for (const std::uint32_t v : triangle) used[v] = true;
    }
    ASSERT_TRUE(std::find(used.begin(), used.end(), false) != used.end());
    Outputs part;
    const VisualOutput streams = streamsInto(part, count);
    std::fill(part.positions.begin(), part.positions.end(), Vec3{-7, -7, -7});
    std::fill(part.normals.begin(), part.normals.end(), Vec3{-7, -7, -7});
    std::fill(part.tangents.begin(), part.tangents.end(), Vec4{-7, -7, -7, -7});
    world.visualSubMesh(body, s, streams);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_EQ(part.positions[i], used[i] ? all.positions[i] : (Vec3{-7, -7, -7}));
      EXPECT_EQ(part.normals[i], used[i] ? all.normals[i] : (Vec3{-7, -7, -7}));
      EXPECT_EQ(part.tangents[i], used[i] ? all.tangents[i] : (Vec4{-7, -7, -7, -7}));
    }
  }
}

TEST(Outputs, InterleavedStreamsOfAnyLengthEqualPackedOnes) {
  World world;
  const BodyId body = *world.addBody(makeAsset(texturedBox(false)));
  world.step(1.0F / 60);
  const Outputs all = outputsOf(world, body);
  const std::size_t count = all.positions.size();
  // position, normal, one of the caller's, tangent, two of the caller's
  constexpr std::size_t kFloats = 13;
  for (const std::uint32_t n : {0U, 1U, 2U, 3U, 5U, 30U}) {
    std::vector<float> buffer(kFloats * count, -7.0F);
    constexpr std::uint32_t stride = kFloats * 4;
    const VisualOutput streams = {
        {buffer.data(), stride, n}, {buffer.data() + 3, stride, n + 1}, {buffer.data() + 7, stride, n / 2}, {}};
    world.visualVertices(body, streams);
    for (std::size_t i = 0; i < count; ++i) {
      const float* at = buffer.data() + kFloats * i;
      const auto is = [&](std::size_t from, const float* values, std::size_t size, bool written) {
        for (std::size_t k = 0; k < size; ++k) ASSERT_EQ(at[from + k], written ? values[k] : -7.0F) << n << " " << i;
      };
      is(0, all.positions[i].data(), 3, i < n);
      is(3, all.normals[i].data(), 3, i < n + 1);
      is(7, all.tangents[i].data(), 4, i < n / 2);
      EXPECT_EQ(at[6], -7.0F);
      EXPECT_EQ(at[11], -7.0F);
      EXPECT_EQ(at[12], -7.0F);
    }
  }
}

TEST(Outputs, BoundsHoldAllVerticesAndNoMore) {
  World world;
  const auto asset = makeAsset(texturedBox(false));
  BodySettings settings;
  settings.position = {5, -3, 2};
  const BodyId body = *world.addBody(asset, settings);
  world.step(1.0F / 60);
  const auto expect_box = [](const Bounds& box, std::span<const Vec3> points) {
    for (std::size_t k = 0; k < 3; ++k) {
      float low = points[0][k], high = points[0][k];
      for (const Vec3& p : points) {
        low = std::min(low, p[k]);
        high = std::max(high, p[k]);
      }
      EXPECT_EQ(box.low[k], low);
      EXPECT_EQ(box.high[k], high);
    }
  };
  expect_box(world.physicalBounds(body), world.positions(body));
  expect_box(world.visualBounds(body), outputsOf(world, body).positions);
}

TEST(Outputs, SameBitsForAnyJobSystem) {
  ThreadPool pool(3);
  for (const bool cluster_attachment : {false, true}) {
    World alone, together(WorldSettings{}, &pool);
    const auto asset = makeAsset(texturedBox(cluster_attachment, ClusterMode::quadratic));
    const BodyId a = *alone.addBody(asset), b = *together.addBody(asset);
    for (int i = 0; i < 5; ++i) {
      alone.step(1.0F / 60);
      together.step(1.0F / 60);
    }
    const Outputs one = outputsOf(alone, a), other = outputsOf(together, b);
    EXPECT_EQ(one.positions, other.positions);
    EXPECT_EQ(one.normals, other.normals);
    EXPECT_EQ(one.tangents, other.tangents);
  }
}

// What rests on something is pressed into it by a little; it is drawn on it.
TEST(Outputs, WhatRestsIsDrawnOnWhatItRestsOn) {
  struct Support {
    ColliderShape shape;
    Vec3 at;
    Vector3d up;
  };
  const double tilt = 0.2;
  const Vec3 leaning = {float(-std::sin(tilt)), float(std::cos(tilt)), 0};
  const Support supports[] = {{PlaneShape{{0, 1, 0}, 0}, {0, 0, 0}, {0, 1, 0}},
                              {PlaneShape{leaning, 0}, {0, 0, 0}, {-std::sin(tilt), std::cos(tilt), 0}},
                              {BoxShape{{3, 1, 3}}, {0, -1, 0}, {0, 1, 0}},
                              {BoxShape{{3, 1, 3}}, {4000, -1, 0}, {0, 1, 0}},
                              {BoxShape{{3, 1.2e-3F, 3}}, {0, -1.2e-3F, 0}, {0, 1, 0}}};  // deeper than half of it
  for (const Support& support : supports) {
    WorldSettings settings;
    settings.ground.enabled = false;
    World world(settings);
    ASSERT_TRUE(world.addCollider(support.shape, {.at = {.position = support.at}, .friction = 1}));
    const auto asset = makeAsset(texturedBox(false, ClusterMode::quadratic));
    const float low = asset->package().info().bounds_min[1];
    const BodyId id = *world.addBody(asset, {.position = {support.at[0], 0.05F - low + 0.3F * float(tilt), 0}});
    for (int i = 0; i < 240; ++i) world.step(1.0F / 60);
    const Outputs drawn = outputsOf(world, id);
    double lowest = 1e300, physical = 1e300;
    const auto height = [&](const Vec3& x) {
      return support.up.dot(Vector3d(double(x[0] - support.at[0]), double(x[1]), double(x[2])));
    };
    for (const Vec3& x : drawn.positions) lowest = std::min(lowest, height(x));
    for (const Vec3& x : world.positions(id)) physical = std::min(physical, height(x));
    const double rounding = 1e-6 * (1 + std::abs(double(support.at[0])));
    // Sub-meshes are drawn alike into a buffer that nobody has written.
    for (std::uint32_t m = 0; m < asset->package().subMeshes().size(); ++m) {
      const float nothing = std::numeric_limits<float>::quiet_NaN();
      std::vector<Vec3> part(drawn.positions.size(), Vec3{nothing, nothing, nothing});
      world.visualSubMesh(id, m, {{part[0].data(), 12, std::uint32_t(part.size())}, {}, {}, {}});
      for (std::size_t v = 0; v < part.size(); ++v) {
        if (std::isnan(part[v][0])) continue;
        EXPECT_EQ(part[v], drawn.positions[v]);
      }
    }
    EXPECT_LT(physical, -1e-6);
    EXPECT_GT(lowest, -rounding) << support.at[0] << " " << support.up.transpose();
    EXPECT_LT(lowest, 2e-3);
  }
}

// Which places lie below a plane, by every instruction set, runs that do not fill the lanes among them.
TEST(Outputs, PlacesBelowAPlaneAreFoundForEveryInstructionSet) {
  std::vector<float> places(5 * 103);
  for (std::size_t i = 0; i < places.size(); ++i) places[i] = float(std::sin(double(i * i)));
  const float plane[4] = {0.6F, -0.64F, 0.48F, 0.1F};
  int sets = 0;
  for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
    const internal::Kernels* table = internal::kernelsNamed(name);
    if (table == nullptr) continue;
    ++sets;
    for (const auto& [begin, end] : {std::pair{0U, 103U}, {3U, 10U}, {7U, 8U}, {100U, 103U}}) {
      std::vector<std::uint32_t> expected, found(end - begin);
      for (std::uint32_t v = begin; v < end; ++v) {
        const float* x = places.data() + 5 * std::size_t(v);
        if ((plane[0] * x[0] + plane[1] * x[1]) + plane[2] * x[2] < plane[3]) expected.push_back(v);
      }
      const std::uint32_t count =
          table->attach.below({reinterpret_cast<std::byte*>(places.data()), 20}, begin, end, plane, found.data());
      found.resize(count);
      EXPECT_EQ(found, expected) << name;
    }
  }
  EXPECT_GT(sets, 0);
}

// The kernels of every instruction set this processor has, on the same input: equal bits; and against doubles.
TEST(Outputs, SameBitsForEveryInstructionSet) {
  using namespace internal;
  World world;
  const auto asset = makeAsset(texturedBox(false, ClusterMode::quadratic));
  const BodyId id = *world.addBody(asset);
  for (int i = 0; i < 7; ++i) world.step(1.0F / 60);
  const VisualConstants& visual = asset->visualConstants();
  const std::size_t slots = visual.corners.size(), vertices = asset->package().physicalVertices().size();
  const auto count = std::uint32_t(visual.records.size());
  struct Result {
    std::vector<SlotFrame> frames;
    std::vector<PaddedMatrix> slot_gradients, gradients, cofactors;
    std::vector<Vec3> positions, normals;
    std::vector<Vec4> tangents;
  };
  const auto run = [&](const AttachKernels& kernel) {
    Result r;
    r.frames.resize(slots);
    r.slot_gradients.resize(slots);
    r.gradients.resize(vertices);
    r.cofactors.resize(vertices);
    r.positions.resize(count);
    r.normals.resize(count);
    r.tangents.resize(count);
    const auto bytes = [](auto& v) { return reinterpret_cast<std::byte*>(v.data()); };
    kernel.slot_frames(world.positions(id).data()->data(), visual.corners.data(), r.frames.data(), 0,
                       std::uint32_t(slots));
    kernel.slot_gradients(r.frames.data(), visual.inverses.data(), r.slot_gradients.data(), 0, std::uint32_t(slots));
    kernel.gradients(visual.slots_at.data(), visual.slot_terms.data(), r.slot_gradients.data(), r.gradients.data(),
                     r.cofactors.data(), 0, std::uint32_t(vertices));
    kernel.attached_positions(visual.records.data(), r.frames.data(), 0, count, {bytes(r.positions), 12});
    kernel.attached_directions(visual.directionRecords().data(), visual.corners.data(), r.cofactors.data(),
                               r.gradients.data(), asset->restNormals().data()->data(),
                               asset->restTangents().data()->data(), 0, count, {bytes(r.normals), 12},
                               {bytes(r.tangents), 16});
    return r;
  };
  const auto same = [](const auto& a, const auto& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
  };
  const Result expected = run(kernels().attach);
  int sets = 0;
  for (const char* name : {"portable", "sse42", "avx2", "avx512"}) {
    const Kernels* table = kernelsNamed(name);
    if (table == nullptr) continue;
    ++sets;
    const Result r = run(table->attach);
    EXPECT_TRUE(same(r.frames, expected.frames)) << name;
    EXPECT_TRUE(same(r.positions, expected.positions)) << name;
    EXPECT_TRUE(same(r.normals, expected.normals)) << name;
    EXPECT_TRUE(same(r.tangents, expected.tangents)) << name;
  }
  EXPECT_GT(sets, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& attachment = asset->package().barycentric()[i];
    const auto& corners = asset->package().tetrahedra()[attachment.tetrahedron].vertex;
    Vector3d place = wide(world.positions(id)[corners[3]]);
    const Vector3d last = place;
    for (std::size_t k = 0; k < 3; ++k) {
      place += double(attachment.weight[k]) * (wide(world.positions(id)[corners[k]]) - last);
    }
    ASSERT_LT((wide(expected.positions[i]) - place).norm(), 1e-6);
  }
  // A physical vertex deforms like the tetrahedra around it that carry something, by their volume.
  const auto restOf = [&](std::uint32_t v) { return wide(asset->package().physicalVertices()[v].rest_position); };
  std::vector<Eigen::Matrix3d> mean(vertices, Eigen::Matrix3d::Zero());
  std::vector<double> volume(vertices, 0);
  for (const SlotCorners& slot : visual.corners) {
    const std::uint32_t* v = slot.vertex;
    Eigen::Matrix3d rest, now;
    for (int k = 0; k < 3; ++k) {
      rest.col(k) = restOf(v[k]) - restOf(v[3]);
      now.col(k) = wide(world.positions(id)[v[k]]) - wide(world.positions(id)[v[3]]);
    }
    const double weight = std::abs(rest.determinant());
    for (int k = 0; k < 4; ++k) {
      mean[v[k]] += weight * now * rest.inverse();
      volume[v[k]] += weight;
    }
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    if (volume[v] == 0) continue;
    Eigen::Matrix3d got;
    for (int c = 0; c < 3; ++c) {
      for (int a = 0; a < 3; ++a) got(a, c) = double(expected.gradients[v].column[c][a]);
    }
    ASSERT_LT((got - mean[v] / volume[v]).norm(), 1e-4) << v;
  }
}

}  // namespace
}  // namespace sinew::test
