// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/parts.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "sinew/runtime/world.h"
#include "tools/bake/bake.h"
#include "tools/bake/suggest_parts.h"
#include "tools/core/error.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// A bar of 2 x 0.5 x 0.5 m; on its upper side a closed block of 0.1 m (group stone), which sinks into it a little, and
// an upright strip whose foot stands on the surface (group ribbon).
std::string barWithParts() {
  std::ostringstream obj;
  std::size_t points = 0;
  const auto grid = [&](const Vector3d& at, const Vector3d& u, const Vector3d& v, int nu, int nv) {
    for (int j = 0; j <= nv; ++j) {
      for (int i = 0; i <= nu; ++i) {
        const Vector3d x = at + u * i / nu + v * j / nv;
        obj << "v " << x[0] << ' ' << x[1] << ' ' << x[2] << '\n';
      }
    }
    const auto id = [&](int i, int j) { return points + std::size_t(j * (nu + 1) + i) + 1; };
    for (int j = 0; j < nv; ++j) {
      for (int i = 0; i < nu; ++i) {
        obj << "f " << id(i, j) << ' ' << id(i + 1, j) << ' ' << id(i + 1, j + 1) << ' ' << id(i, j + 1) << '\n';
      }
    }
    points += std::size_t((nu + 1) * (nv + 1));
  };
  const auto box = [&](const Vector3d& low, const Vector3d& size, int nx, int n) {
    const Vector3d x(size[0], 0, 0), y(0, size[1], 0), z(0, 0, size[2]);
    grid(low, y, x, n, nx);
    grid(low + z, x, y, nx, n);
    grid(low, x, z, nx, n);
    grid(low + y, z, x, n, nx);
    grid(low, z, y, n, n);
    grid(low + x, y, z, n, n);
  };
  obj << "g bar\n";
  box({-1, 0, -0.25}, {2, 0.5, 0.5}, 24, 6);
  obj << "g stone\n";
  box({0.3, 0.48, -0.05}, {0.1, 0.1, 0.1}, 2, 2);
  obj << "g ribbon\n";
  grid({-0.4, 0.5, 0}, {0.2, 0, 0}, {0, 0.1, 0}, 4, 2);
  return obj.str();
}

class Parts : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("sinew_parts_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) +
               std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "bar.obj") << barWithParts();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  Recipe recipe(const std::string& keys) const {
    Recipe recipe = parseRecipe(
        R"({"sinew_recipe": 2, "source": "bar.obj", "settings": {"clusters.volume": "none"}, )" + keys + "}",
        folder_ / "bar.json");
    recipe.settings.import.worker = SINEW_TEST_IMPORT_WORKER;
    return recipe;
  }
  static BakeResult baked(const Recipe& recipe) {
    Progress progress(false);
    return bake(recipe, progress);
  }
  // The one line of a recipe that cannot be baked.
  std::string refusal(const std::string& keys) const {
    try {
      baked(recipe(keys));
    } catch (const ToolError& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input);
      return error.what();
    }
    ADD_FAILURE() << "baked: " << keys;
    return "";
  }
  std::filesystem::path folder_;
};

const char* const kStone = R"("parts": [{"name": "stone", "from": {"group": "stone"}}])";
const char* const kBoth = R"("parts": [{"name": "stone", "from": {"group": "stone"}, "attach": "rigid"},
  {"name": "ribbon", "from": {"group": "ribbon"}, "attach": "follow"}])";

std::vector<Vector3d> visual(const World& world, BodyId body) {
  std::vector<float> x(3 * world.asset(body).package().visualPositions().size());
  world.visualVertices(body, StridedFloat3{x.data(), 12, std::uint32_t(x.size() / 3)}, {});
  std::vector<Vector3d> result;
  for (std::size_t i = 0; i < x.size(); i += 3) result.emplace_back(double(x[i]), double(x[i + 1]), double(x[i + 2]));
  return result;
}

// Largest distance of points from the best rigid image of their rest positions.
double deformation(const std::vector<Vector3d>& rest, const std::vector<Vector3d>& now,
                   std::span<const std::uint32_t> vertices) {
  Eigen::Matrix3Xd from(3, vertices.size()), to(3, vertices.size());
  for (Eigen::Index i = 0; i < from.cols(); ++i) {
    from.col(i) = rest[vertices[std::size_t(i)]];
    to.col(i) = now[vertices[std::size_t(i)]];
  }
  const Eigen::Matrix4d t = Eigen::umeyama(from, to, false);
  return ((t.topLeftCorner<3, 3>() * from).colwise() + t.topRightCorner<3, 1>().eval() - to)
      .colwise()
      .norm()
      .maxCoeff();
}

// Holds the ends of the bar and draws them apart by 30 % within a second, then lets it rest for one.
class Stretched {
 public:
  explicit Stretched(const BakeResult& result, const std::function<void(const Stretched&)>& each_step = {})
      : world(settings()) {
    asset = *Asset::fromMemory(result.package);
    body = *world.addBody(asset);
    rest = now = visual(world, body);
    std::array<std::vector<std::uint32_t>, 2> ends;
    const auto x = world.positions(body);
    for (std::uint32_t v = 0; v < x.size(); ++v) {
      if (std::abs(x[v][0]) > 0.85F) ends[x[v][0] > 0 ? 1 : 0].push_back(v);
    }
    const PinSetId low = *world.addPinSet(body, ends[0], {}, PinMethod::hold);
    const PinSetId high = *world.addPinSet(body, ends[1], {}, PinMethod::hold);
    for (int i = 1; i <= 120; ++i) {
      const float way = 0.3F * float(std::min(i, 60)) / 60;
      world.movePinSet(low, {{-way, 0, 0}});
      world.movePinSet(high, {{way, 0, 0}});
      world.step(1.0F / 60);
      now = visual(world, body);
      if (each_step) each_step(*this);
    }
  }
  static WorldSettings settings() {
    WorldSettings settings;
    settings.gravity = {0, 0, 0};
    settings.ground.enabled = false;
    return settings;
  }
  std::span<const std::uint32_t> part(std::size_t i) const {
    const auto& p = asset->package().parts()[i];
    return asset->package().partVertices().subspan(p.first, p.count);
  }
  double length(const std::vector<Vector3d>& points) const {
    double low = 0, high = 0;
    for (const Vector3d& p : points) low = std::min(low, p[0]), high = std::max(high, p[0]);
    return high - low;
  }

  World world;
  std::shared_ptr<const Asset> asset;
  BodyId body;
  std::vector<Vector3d> rest, now;
};

// The bar's surface vertex nearest to a point at rest.
std::size_t nearestOfBar(const Stretched& s, const Vector3d& to) {
  const std::size_t bar = s.part(0)[0];  // groups are in the file's order: the bar's vertices come first
  std::size_t best = 0;
  for (std::size_t v = 0; v < bar; ++v) {
    if ((s.rest[v] - to).norm() < (s.rest[best] - to).norm()) best = v;
  }
  return best;
}

// Nothing of a piece moves by itself that pins hold whole: it has no modes, and its fields only what pins drive.
TEST_F(Parts, PinsMayHoldAllOfAPiece) {
  const BakeResult result = baked(recipe(R"("pins": [{"name": "everything", "from": {"all": true}}])"));
  const std::shared_ptr<const Asset> asset = *Asset::fromMemory(result.package);
  EXPECT_FALSE(asset->package().fields().empty());
  World world;
  const BodyId body = *world.addBody(asset, {});
  for (int i = 0; i < 30; ++i) world.step(1.0F / 60);
  for (const Vector3d& x : visual(world, body)) EXPECT_TRUE(x.allFinite());
}

TEST_F(Parts, ARigidPartKeepsItsShapeWhileItsHostStretches) {
  for (const char* method : {"barycentric", "clusters"}) {
    Recipe authored = recipe(kStone);
    authored.settings.set("attachment.method", method);
    double worst = 0;
    const Stretched s(baked(authored),
                      [&](const Stretched& at) { worst = std::max(worst, deformation(at.rest, at.now, at.part(0))); });
    ASSERT_GT(s.length(s.now), 1.29 * s.length(s.rest)) << method;
    EXPECT_LT(worst, 1e-3 * 0.1 * std::sqrt(3.0)) << method;
    // It rides on the bar, not beside it: the surface under it went the same way.
    const std::uint32_t foot = s.part(0)[0];
    const std::size_t under = nearestOfBar(s, Vector3d(0.35, s.rest[foot][1], 0));
    Vector3d before = Vector3d::Zero(), after = Vector3d::Zero();
    for (const std::uint32_t v : s.part(0)) {
      before += s.rest[v] / double(s.part(0).size());
      after += s.now[v] / double(s.part(0).size());
    }
    const Vector3d moved = s.now[under] - s.rest[under];
    EXPECT_GT(moved[0], 0.05) << method;
    EXPECT_LT(((after - before) - moved).norm(), 0.3 * moved.norm()) << method;
  }
}

// Corners that had been computed with before they were floats left weights off by 2e-7.
TEST_F(Parts, ARigidPartHangsByTheNearestFloats) {
  const BakeResult result = baked(recipe(kStone));
  const auto asset = *Asset::fromMemory(result.package);
  const formats::PackageView& package = asset->package();
  const auto wide = [](const formats::Float3& x) { return Vector3d(double(x[0]), double(x[1]), double(x[2])); };
  for (const std::uint32_t v : package.partVertices()) {
    const formats::BarycentricAttachment& attachment = package.barycentric()[v];
    const auto corner = [&](std::size_t k) {
      return wide(package.physicalVertices()[package.tetrahedra()[attachment.tetrahedron].vertex[k]].rest_position);
    };
    Eigen::Matrix3d edges;
    for (std::size_t k = 0; k < 3; ++k) edges.col(Eigen::Index(k)) = corner(k) - corner(3);
    const Vector3d exact = edges.inverse() * (wide(package.visualPositions()[v]) - corner(3));
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(double(attachment.weight[k]), exact[Eigen::Index(k)], 0x1p-24) << v;
  }
}

TEST_F(Parts, AFollowingPartStaysOnTheSurfaceAndHasNoTetrahedra) {
  const BakeResult with = baked(recipe(kBoth));
  const Stretched s(with);
  ASSERT_EQ(s.asset->package().parts().size(), 2U);
  EXPECT_EQ(s.asset->package().parts()[1].cluster, formats::kNone);
  std::size_t feet = 0;
  for (const std::uint32_t v : s.part(1)) {
    const std::size_t under = nearestOfBar(s, s.rest[v]);
    if ((s.rest[v] - s.rest[under]).norm() > 0.04) continue;
    ++feet;
    EXPECT_LT(((s.now[v] - s.rest[v]) - (s.now[under] - s.rest[under])).norm(), 0.02) << v;
  }
  EXPECT_GE(feet, 3U);
  // One tetrahedron and four vertices are the stone's, none is the ribbon's.
  const BakeResult alone = baked(recipe(kStone));
  EXPECT_EQ(with.report["pieces"].size(), 1U);
  EXPECT_EQ(s.asset->package().clusters()[s.asset->package().parts()[0].cluster].mode, formats::ClusterMode::rigid);
  EXPECT_LE(with.report["tetrahedra"].get<int>(), alone.report["tetrahedra"].get<int>());
}

TEST_F(Parts, TheHostDoesNotFeelARigidPart) {
  const BakeResult with = baked(recipe(kBoth));
  const BakeResult follows = baked(recipe(
      R"("parts": [{"name": "both", "from": {"or": [{"group": "stone"}, {"group": "ribbon"}]}, "attach": "follow"}])"));
  const Stretched a(with), b(follows);
  const auto x = a.world.positions(a.body), y = b.world.positions(b.body);
  ASSERT_EQ(x.size(), y.size() + 4);
  double largest = 0;
  for (std::size_t v = 0; v < y.size(); ++v) {
    for (std::size_t k = 0; k < 3; ++k) largest = std::max(largest, std::abs(double(x[v][k]) - double(y[v][k])));
  }
  EXPECT_LT(largest, 1e-5);
}

TEST_F(Parts, WhatIsDrawnIsNumberedFirstAndAloneMadeForIt) {
  const BakeResult plain = baked(recipe(R"("masks": {})")), with = baked(recipe(kBoth));
  const auto asset = *Asset::fromMemory(plain.package);
  const formats::PackageView& package = asset->package();
  std::set<std::uint32_t> drawn;
  for (const auto& at : package.barycentric()) {
    for (const std::uint32_t v : package.tetrahedra()[at.tetrahedron].vertex) drawn.insert(v);
  }
  EXPECT_EQ(*drawn.rbegin() + 1, drawn.size());
  EXPECT_LT(drawn.size(), package.physicalVertices().size());
  for (const BakeResult* const result : {&plain, &with}) {
    Stretched a(*result), b(*result);
    a.world.step(1.0F / 60);
    b.world.step(1.0F / 60);
    const auto x = b.world.positions(b.body), v = b.world.velocities(b.body);
    const std::vector<Vec3> places(x.begin(), x.end()), speeds(v.begin(), v.end());
    EXPECT_EQ(visual(a.world, a.body), visual(b.world, b.body));
    EXPECT_TRUE(std::equal(places.begin(), places.end(), a.world.positions(a.body).begin()));
    EXPECT_TRUE(std::equal(speeds.begin(), speeds.end(), a.world.velocities(a.body).begin()));
  }
}

TEST_F(Parts, AFreeBodyKeepsItsMomentumWithAPart) {
  const BakeResult result = baked(recipe(kBoth));
  const auto asset = *Asset::fromMemory(result.package);
  WorldSettings settings = Stretched::settings();
  settings.damping = 0;
  World world(settings);
  const BodyId body = *world.addBody(asset);
  const auto vertices = asset->package().physicalVertices();
  std::vector<Vec3> x(world.positions(body).begin(), world.positions(body).end()), v;
  for (const Vec3& p : x) v.push_back({1 + p[1], 2 * p[2], -p[0]});
  const auto momentum = [&](std::span<const Vec3> speeds) {
    Vector3d sum = Vector3d::Zero();
    double mass = 0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      const double m = double(vertices[i].mass);
      mass += m;
      for (int k = 0; k < 3; ++k) sum[k] += m * double(speeds[i][std::size_t(k)]);
    }
    return Vector3d(sum / mass);
  };
  const Vector3d before = momentum(v);
  world.setState(body, x, v);
  for (int i = 0; i < 120; ++i) world.step(1.0F / 60);
  EXPECT_LT((momentum(world.velocities(body)) - before).norm(), 1e-4 * before.norm());
}

TEST_F(Parts, SourceVerticesAreKnownByThePartsName) {
  const Recipe authored = recipe(kBoth);
  const BakeResult result = baked(authored);
  const auto asset = *Asset::fromMemory(result.package);
  const formats::PackageView& package = asset->package();
  ASSERT_EQ(package.parts().size(), 2U);
  const auto& stone = package.parts()[0];
  EXPECT_EQ(package.text(stone.name), "stone");
  EXPECT_EQ(package.text(package.clusters()[stone.cluster].name), "stone");
  // The block has 6 grids of 3 x 3 corners: source vertices behind those of the bar.
  std::vector<std::uint32_t> sources;
  for (const std::uint32_t v : package.partVertices().subspan(stone.first, stone.count)) {
    sources.push_back(package.visualIdentity()[v].source_vertex);
  }
  std::sort(sources.begin(), sources.end());
  const std::uint32_t bar = 4 * 25 * 7 + 2 * 7 * 7;
  ASSERT_EQ(sources.size(), 54U);
  EXPECT_EQ(sources.front(), bar);
  EXPECT_EQ(sources.back(), bar + 53);
}

TEST_F(Parts, WrongPartsAreRefusedWithPlaceAndCure) {
  EXPECT_NE(refusal(R"("parts": [{"name": "p", "from": {"box": [[-1, -1, -1], [-0.9, 1, 1]]}}])")
                .find("part p holds no loose part"),
            std::string::npos);
  EXPECT_NE(refusal(R"("parts": [{"name": "p", "from": {"group": "stone"}, "to": "skul"}],
    "pins": [{"name": "skull", "from": {"group": "bar"}}])")
                .find("there is no cluster, set of pins or mask 'skul'"),
            std::string::npos);
  EXPECT_NE(refusal(R"("parts": [{"name": "p", "from": {"all": true}}])").find("nothing is left to be filled"),
            std::string::npos);
  EXPECT_NE(
      refusal(R"("parts": [{"name": "p", "from": {"group": "stone"}}, {"name": "q", "from": {"group": "stone"}}])")
          .find("part q takes a loose part that part p has already"),
      std::string::npos);
  EXPECT_NE(
      refusal(R"("parts": [{"name": "p", "from": {"group": "stone"}, "attach": "glue"}])").find("attach cannot be"),
      std::string::npos);
}

TEST_F(Parts, ALoosePieceThatHugsAnotherIsSuggestedWithItsLine) {
  ImportOptions options;
  options.worker = SINEW_TEST_IMPORT_WORKER;
  Progress progress(false);
  const VisualMesh mesh = importVisualMesh(folder_ / "bar.obj", options, progress);
  const std::vector<Finding> findings = suggestParts(mesh, analyzeTopology(mesh));
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].severity, Severity::info);
  EXPECT_EQ(findings[0].count, 2U);
  EXPECT_NE(findings[0].cure.find(R"({"name": "stone", "from": {"group": "stone"}, "attach": "rigid"})"),
            std::string::npos)
      << findings[0].cure;
  EXPECT_NE(findings[0].cure.find(R"({"name": "ribbon", "from": {"group": "ribbon"}, "attach": "follow"})"),
            std::string::npos)
      << findings[0].cure;
  // With the parts in the recipe nothing is suggested any more.
  const BakeResult result = baked(recipe(kBoth));
  EXPECT_TRUE(std::none_of(result.findings.begin(), result.findings.end(),
                           [](const Finding& f) { return f.id == "loose-parts-ride"; }));
}

}  // namespace
}  // namespace sinew::tools
