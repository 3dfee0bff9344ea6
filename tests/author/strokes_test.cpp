// SPDX-License-Identifier: GPL-3.0-or-later
//
// Brush strokes: what they do to weights, their file, their commands.
#include "tools/author/strokes.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>

#include "tests/author/sheet.h"
#include "tools/author/recipe.h"
#include "tools/author/recipe_strokes.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

Stroke strokeOf(StrokeMode mode, double radius, double falloff, double strength = 1) {
  Stroke stroke;
  stroke.radius = radius;
  stroke.falloff = falloff;
  stroke.strength = strength;
  stroke.mode = mode;
  return stroke;
}

std::vector<double> painted(const Surface& surface, const Stroke& stroke, const std::vector<Vector3d>& points,
                            std::vector<double> weights) {
  StrokeBrush brush(surface);
  brush.begin(stroke, std::move(weights));
  for (const Vector3d& point : points) brush.add(point);
  brush.advance();
  return brush.takeWeights();
}

class Strokes : public testing::Test {
 protected:
  VisualMesh mesh = flat(40);
  Surface surface{mesh};
  std::vector<double> none = std::vector<double>(mesh.positions.size(), 0);
  std::uint32_t at(double x, double y) const { return std::uint32_t(std::lround(y * 40) * 41 + std::lround(x * 40)); }
};

// Along a stroke that is pressed less and less, and seen by an eye from above as well.
TEST_F(Strokes, APenPressesTheRadius) {
  Stroke stroke = strokeOf(StrokeMode::paint, 0.2, 0);
  stroke.points = {{0.2, 0.5, 0}, {0.8, 0.5, 0}};
  stroke.pressures = {1, 0.25};
  for (const bool seen : {false, true}) {
    if (seen) stroke.eye = Vector3d(0.5, 0.5, 50);
    StrokeBrush brush(surface);
    brush.begin(stroke, none);
    brush.addAll(stroke);
    brush.advance();
    const auto width = [&](double x) {
      int points = 0;
      for (int j = 0; j <= 40; ++j) points += brush.weights()[at(x, j / 40.0)] > 0.5;
      return points / 40.0;
    };
    EXPECT_NEAR(width(0.2), 0.4, 0.04) << seen;
    EXPECT_NEAR(width(0.5), 0.25, 0.05) << seen;
    EXPECT_NEAR(width(0.8), 0.1, 0.04) << seen;
  }
}

TEST_F(Strokes, AStrokeIsOneInsideItsRadiusAndZeroBeyondItsFalloff) {
  const auto weights =
      painted(surface, strokeOf(StrokeMode::paint, 0.1, 0.1, 0.8), {{0.3, 0.5, 0}, {0.7, 0.5, 0}}, none);
  for (std::size_t v = 0; v < weights.size(); ++v) {
    const Vector3d& x = mesh.positions[v];
    const double along = std::clamp(x[0], 0.3, 0.7);
    const double distance = std::hypot(x[0] - along, x[1] - 0.5);
    if (distance < 0.095) {
      EXPECT_NEAR(weights[v], 0.8, 1e-9) << v;
    }
    if (distance > 0.205) {
      EXPECT_EQ(weights[v], 0) << v;
    }
    const double t = std::clamp(1 - (distance - 0.1) / 0.1, 0.0, 1.0);
    EXPECT_NEAR(weights[v], 0.8 * t * t * (3 - 2 * t), 0.03) << v;
  }
}

TEST_F(Strokes, EachModeDoesWhatItSays) {
  const std::vector<double> half(none.size(), 0.5);
  const std::vector<Vector3d> middle = {{0.5, 0.5, 0}};
  const std::uint32_t c = at(0.5, 0.5);
  EXPECT_DOUBLE_EQ(painted(surface, strokeOf(StrokeMode::paint, 0.1, 0, 0.3), middle, half)[c], 0.5);
  EXPECT_DOUBLE_EQ(painted(surface, strokeOf(StrokeMode::add, 0.1, 0, 0.3), middle, half)[c], 0.8);
  EXPECT_DOUBLE_EQ(painted(surface, strokeOf(StrokeMode::add, 0.1, 0, 0.7), middle, half)[c], 1);
  EXPECT_DOUBLE_EQ(painted(surface, strokeOf(StrokeMode::subtract, 0.1, 0, 0.3), middle, half)[c], 0.2);
  EXPECT_DOUBLE_EQ(painted(surface, strokeOf(StrokeMode::erase, 0.1, 0, 0.9), middle, half)[c], 0.1);
  const auto edge = painted(surface, strokeOf(StrokeMode::paint, 0.2, 0), middle, none);
  const auto smoothed = painted(surface, strokeOf(StrokeMode::smooth, 0.4, 0), middle, edge);
  EXPECT_LT(smoothed[at(0.675, 0.5)], edge[at(0.675, 0.5)]);
  EXPECT_GT(smoothed[at(0.75, 0.5)], edge[at(0.75, 0.5)]);
  EXPECT_NEAR(smoothed[c], 1, 0.02);
  EXPECT_EQ(smoothed[at(0.05, 0.05)], edge[at(0.05, 0.05)]);
}

TEST_F(Strokes, PaintingInStepsGivesWhatPaintingAtOnceDoes) {
  const Stroke stroke = strokeOf(StrokeMode::paint, 0.05, 0.1);
  std::vector<Vector3d> points;
  for (int i = 0; i <= 20; ++i) points.emplace_back(0.2 + 0.03 * i, 0.5 + 0.2 * std::sin(0.4 * i), 0);
  StrokeBrush brush(surface);
  brush.begin(stroke, none);
  for (const Vector3d& point : points) {
    brush.add(point);
    brush.advance(50);  // leaves work over
  }
  while (!brush.advance(50)) {
  }
  const std::vector<double> at_once = painted(surface, stroke, points, none);
  for (std::size_t v = 0; v < none.size(); ++v) EXPECT_NEAR(brush.weights()[v], at_once[v], 0.05) << v;
}

TEST_F(Strokes, AMirroredStrokeIsSymmetricAndOneThatFacesAwayPaintsNothing) {
  Stroke stroke = strokeOf(StrokeMode::paint, 0.06, 0.05);
  stroke.mirror = MirrorPlane{{0.5, 0, 0}, Vector3d::UnitX(), 0};
  const auto weights = painted(surface, stroke, {{0.207, 0.312, 0}, {0.307, 0.417, 0}}, none);
  for (std::uint32_t j = 0; j <= 40; ++j) {
    for (std::uint32_t i = 0; i <= 40; ++i) EXPECT_NEAR(weights[j * 41 + i], weights[j * 41 + 40 - i], 0.02);
  }
  EXPECT_EQ(weights[at(0.8, 0.3)], 1);
  stroke.facing = Vector3d(0, 0, -1);
  for (const double w : painted(surface, stroke, {{0.2, 0.3, 0}}, none)) EXPECT_EQ(w, 0);
  stroke.facing = Vector3d(0, 0, 1);
  EXPECT_EQ(painted(surface, stroke, {{0.2, 0.3, 0}}, none)[at(0.2, 0.3)], 1);
}

TEST_F(Strokes, TheBrushStaysOnItsSideOfAFold) {
  // Two leaves 0.02 apart that join at u = 1/2, far along the surface.
  const VisualMesh folded = sheet(80, [](double u, double v) {
    const double s = u < 0.5 ? u : 1 - u;
    return Vector3d(s, v, u < 0.5 ? 0 : 0.02);
  });
  const Surface fold(folded);
  const auto weights = painted(fold, strokeOf(StrokeMode::paint, 0.1, 0), {{0.1, 0.5, 0}},
                               std::vector<double>(folded.positions.size(), 0));
  for (std::size_t v = 0; v < weights.size(); ++v) {
    if (folded.positions[v][2] > 0.01) {
      EXPECT_EQ(weights[v], 0);
    }
  }
  EXPECT_EQ(weights[40 * 81 + 8], 1);
}

TEST_F(Strokes, ARayMeetsWhatALinearSearchFinds) {
  const VisualMesh bowl = sheet(60, [](double u, double v) {
    const double a = 2 * std::numbers::pi * u;
    const double b = std::numbers::pi * (v - 0.5);
    return Vector3d(std::cos(a) * std::cos(b), std::sin(b), std::sin(a) * std::cos(b));
  });
  const Surface ball(bowl);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1.2, 1.2);
  int hits = 0;
  for (int i = 0; i < 500; ++i) {
    const Vector3d origin(any(random), any(random), 3);
    const SurfacePoint hit = ball.along(origin, {0, 0, -1});
    const double squared = origin[0] * origin[0] + origin[1] * origin[1];
    if (squared > 1) {
      EXPECT_EQ(hit.triangle, formats::kNone);
    }
    if (squared > 0.95) continue;
    ++hits;
    ASSERT_NE(hit.triangle, formats::kNone);
    EXPECT_NEAR(hit.position[2], std::sqrt(1 - squared), 0.02);
    EXPECT_NEAR(hit.distance, 3 - hit.position[2], 1e-9);
  }
  EXPECT_GT(hits, 100);
}

TEST_F(Strokes, ARayThroughAnEdgeOrACornerMeetsTheSurface) {
  // A gable along x = 0, as the middle of a face: rays within the plane of its ridge, and through all its corners.
  const VisualMesh gable =
      sheet(24, [](double u, double v) { return Vector3d(2 * u - 1, 2 * v - 1, -std::abs(2 * u - 1) / 3); });
  const Surface roof(gable);
  const Vector3d eye = {0, 0.37, 3};
  for (const Vector3d& x : gable.positions) {
    if (std::abs(x.x()) > 0.99 || std::abs(x.y()) > 0.99) continue;
    for (const Vector3d& from : {eye, Vector3d(x.x(), x.y(), 2.0)}) {
      const SurfacePoint hit = roof.along(from, (x - from).normalized());
      ASSERT_NE(hit.triangle, formats::kNone) << x.transpose();
      EXPECT_LT((hit.position - x).norm(), 1e-6);
    }
  }
}

TEST_F(Strokes, APathLeadsFromEndToEndAndIsHardlyLongerThanTheStraightOne) {
  const auto path = surface.path(surface.nearest({0.11, 0.2, 0}), surface.nearest({0.83, 0.71, 0}));
  ASSERT_GE(path.size(), 3U);
  EXPECT_NEAR((path.front() - Vector3d(0.11, 0.2, 0)).norm(), 0, 1e-9);
  EXPECT_NEAR((path.back() - Vector3d(0.83, 0.71, 0)).norm(), 0, 1e-9);
  double length = 0;
  for (std::size_t i = 1; i < path.size(); ++i) length += (path[i] - path[i - 1]).norm();
  EXPECT_LT(length, 1.15 * std::hypot(0.72, 0.51));
}

// Two sheets, one above the other, both facing up: from above the upper one hides the lower.
VisualMesh decks() {
  VisualMesh mesh = sheet(20, [](double u, double v) { return Vector3d(u, v, 0); });
  const VisualMesh upper = sheet(20, [](double u, double v) { return Vector3d(0.5 * u, v, 0.3); });
  const auto first = std::uint32_t(mesh.positions.size());
  for (const Vector3d& x : upper.positions) {
    mesh.welded.push_back(std::uint32_t(mesh.positions.size()));
    mesh.positions.push_back(x);
  }
  for (const Triangle& t : upper.triangles) mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  mesh.welded_positions = mesh.positions;
  mesh.bounds_max.z() = 0.3;
  mesh.diagonal = (mesh.bounds_max - mesh.bounds_min).norm();
  return mesh;
}

class SeenStrokes : public testing::Test {
 protected:
  VisualMesh mesh = decks();
  Surface surface{mesh};
  std::vector<double> none = std::vector<double>(mesh.positions.size(), 0);
  Vector3d eye = {0.5, 0.5, 5};
  // The place as the eye sees it, on the plane z = 0.
  Vector3d projected(const Vector3d& x) const { return eye + (x - eye) * (eye.z() / (eye.z() - x.z())); }
};

TEST_F(SeenStrokes, ABrushOnTheScreenPaintsWhatIsSeenWithinItsRadius) {
  Stroke stroke = strokeOf(StrokeMode::paint, 0.2, 0);
  stroke.eye = eye;
  const Vector3d middle = {0.5, 0.5, 0};  // the upper deck ends there
  const auto weights = painted(surface, stroke, {middle}, none);
  stroke.through = true;
  const auto through = painted(surface, stroke, {middle}, none);
  std::size_t seen = 0, hidden = 0;
  for (std::size_t v = 0; v < none.size(); ++v) {
    const Vector3d& x = mesh.positions[v];
    const double distance = (projected(x) - middle).norm();
    if (std::abs(distance - 0.2) < 1e-3) continue;
    const bool under = x.z() == 0 && x.x() < 0.5;  // seen from the eye, the edge of the deck is there
    if (x.z() == 0 && std::abs(x.x() - 0.5) < 0.04) continue;
    EXPECT_EQ(weights[v], distance < 0.2 && !under ? 1 : 0) << x.transpose();
    EXPECT_EQ(through[v], distance < 0.2 ? 1 : 0) << x.transpose();
    (under ? hidden : seen) += distance < 0.2 ? 1U : 0U;
  }
  EXPECT_GT(seen, 10U);
  EXPECT_GT(hidden, 10U);
}

TEST_F(SeenStrokes, ALassoPaintsTheInsideOfItsLoopAndItsImage) {
  Stroke stroke = strokeOf(StrokeMode::paint, 0, 0);
  stroke.eye = eye;
  stroke.lasso = true;
  stroke.through = true;
  // A horseshoe, so that the loop is not convex.
  const std::vector<Vector3d> loop = {{0.1, 0.1, 0}, {0.4, 0.1, 0}, {0.4, 0.9, 0},
                                      {0.3, 0.9, 0}, {0.3, 0.3, 0}, {0.1, 0.3, 0}};
  const auto inside = [](const Vector3d& p) {
    return p.x() > 0.1 && p.x() < 0.4 && p.y() > 0.1 && p.y() < 0.9 && (p.x() > 0.3 || p.y() < 0.3);
  };
  const auto nearEdge = [](const Vector3d& p) {
    for (const double edge : {0.1, 0.3, 0.4, 0.9, 0.6, 0.7}) {
      if (std::abs(p.x() - edge) < 1e-3 || std::abs(p.y() - edge) < 1e-3) return true;
    }
    return false;
  };
  const auto weights = painted(surface, stroke, loop, none);
  stroke.mirror = MirrorPlane{{0.5, 0, 0}, Vector3d::UnitX(), 0};
  const auto both = painted(surface, stroke, loop, none);
  std::size_t count = 0;
  for (std::size_t v = 0; v < none.size(); ++v) {
    const Vector3d p = projected(mesh.positions[v]);
    if (nearEdge(p)) continue;
    EXPECT_EQ(weights[v], inside(p) ? 1 : 0) << p.transpose();
    EXPECT_EQ(both[v], inside(p) || inside({1 - p.x(), p.y(), 0}) ? 1 : 0) << p.transpose();
    count += inside(p) ? 1U : 0U;
  }
  EXPECT_GT(count, 30U);
}

TEST_F(Strokes, GrowAndShrinkMoveTheEdgeByTheirRadius) {
  const auto disc = painted(surface, strokeOf(StrokeMode::paint, 0.2, 0), {{0.5, 0.5, 0}}, none);
  const auto grown = painted(surface, strokeOf(StrokeMode::grow, 0.1, 0), {}, disc);
  const auto shrunk = painted(surface, strokeOf(StrokeMode::shrink, 0.1, 0), {}, disc);
  const auto back = painted(surface, strokeOf(StrokeMode::shrink, 0.1, 0), {}, grown);
  const auto soft = painted(surface, strokeOf(StrokeMode::grow, 0.1, 0.1), {}, disc);
  for (std::size_t v = 0; v < disc.size(); ++v) {
    const double r = (mesh.positions[v] - Vector3d(0.5, 0.5, 0)).norm();
    // The mesh's edges are 0.025 to 0.035 long.
    if (std::abs(r - 0.3) > 0.035) {
      EXPECT_EQ(grown[v], r < 0.3 ? 1 : 0) << r;
    }
    if (std::abs(r - 0.1) > 0.035) {
      EXPECT_EQ(shrunk[v], r < 0.1 ? 1 : 0) << r;
    }
    if (std::abs(r - 0.2) > 0.035) {
      EXPECT_EQ(back[v], r < 0.2 ? 1 : 0) << r;
    }
    EXPECT_GE(soft[v], grown[v]);
    if (r > 0.435) {
      EXPECT_EQ(soft[v], 0);
    }
  }
  EXPECT_GT(soft[at(0.5, 0.86)], 0);
  EXPECT_LT(soft[at(0.5, 0.86)], 1);
}

class StrokeCommands : public testing::Test {
 protected:
  void SetUp() override {
    folder = fs::temp_directory_path() / ("sinew_strokes_" + std::to_string(::getpid()));
    fs::create_directories(folder);
    std::ofstream(folder / "a.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  }
  void TearDown() override { fs::remove_all(folder); }
  std::size_t files() const {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(folder / "a.strokes")) count += entry.is_regular_file() ? 1U : 0U;
    return count;
  }
  fs::path folder;
};

TEST_F(StrokeCommands, TheFileReadsBackAndOldOnesStillDo) {
  Stroke stroke = strokeOf(StrokeMode::subtract, 0.25, 0.125, 0.5);
  stroke.points = {{1, 2, 3}, {4, 5, 6.5}};
  stroke.pressures = {1, 0.5};
  stroke.facing = Vector3d(0, 0, 1);
  stroke.mirror = MirrorPlane{{1, 0, 0}, Vector3d::UnitX(), 0};
  stroke.eye = Vector3d(0, 1, 2);
  stroke.through = true;
  std::ofstream(folder / "s.json") << strokesText({&stroke, 1});
  const std::vector<Stroke> read = readStrokes(folder / "s.json");
  ASSERT_EQ(read.size(), 1U);
  EXPECT_EQ(read[0].points, stroke.points);
  EXPECT_EQ(read[0].pressures, stroke.pressures);
  EXPECT_EQ(read[0].mode, StrokeMode::subtract);
  EXPECT_EQ(*read[0].facing, *stroke.facing);
  EXPECT_EQ(read[0].mirror->normal, stroke.mirror->normal);
  EXPECT_EQ(strokesText(read), strokesText({&stroke, 1}));
  std::ofstream(folder / "old.json") << R"({"strokes": [{"points": [[0, 0, 0]], "radius": 1, "erase": true}]})";
  EXPECT_EQ(readStrokes(folder / "old.json")[0].mode, StrokeMode::erase);
  std::ofstream(folder / "bad.json") << R"({"strokes": [{"points": [[0, 0, 0]], "radius": 1, "mode": "blur"}]})";
  try {
    readStrokes(folder / "bad.json");
    FAIL();
  } catch (const ToolError& error) {
    EXPECT_NE(std::string(error.what()).find("subtract"), std::string::npos) << error.what();
  }
}

TEST_F(StrokeCommands, UndoFindsTheStrokesBeforeAndFilesThatNobodyNamesGo) {
  RecipeEditor editor = RecipeEditor::create(folder / "a.json", folder / "a.obj");
  Stroke stroke = strokeOf(StrokeMode::paint, 0.1, 0);
  stroke.points = {{0, 0, 0}};
  addStrokes(editor, "cheek.L", {&stroke, 1});
  const std::string once = editor.text();
  stroke.points = {{1, 0, 0}};
  addStrokes(editor, "cheek.L", {&stroke, 1});
  editor.save();
  EXPECT_EQ(strokesOf(editor, "cheek.L").size(), 2U);
  EXPECT_EQ(editor.undo(), "stroke cheek.L");
  EXPECT_EQ(editor.text(), once);
  EXPECT_EQ(strokesOf(editor, "cheek.L").size(), 1U);
  editor.undo();
  EXPECT_EQ(files(), 2U);
  // A new command drops what was undone; its files go with the next stroke.
  editor.set("clusters.mode", "linear");
  addStrokes(editor, "cheek.L", {&stroke, 1});
  EXPECT_EQ(files(), 1U);
  // A mask of another kind stays below the strokes.
  editor.setMask("all", R"({"all": true})");
  addStrokes(editor, "all", {&stroke, 1});
  EXPECT_EQ(editor.document()["masks"]["all"]["over"].dump(), R"({"all":true})");
}

TEST_F(StrokeCommands, AMuscleIsOneCommandWithAllItsParts) {
  RecipeEditor editor = RecipeEditor::create(folder / "a.json", folder / "a.obj");
  MuscleOptions muscle;
  muscle.name = "smile.L";
  muscle.path = {{0.1, 0.1, 0}, {0.2, 0.2, 0}, {0.4, 0.2, 0}};
  muscle.width = 0.04;
  muscle.mirror = true;
  muscle.plane = "x";
  addMuscle(editor, muscle, [] { return Vector3d(Vector3d::UnitX()); });
  const auto document = editor.document();
  ASSERT_EQ(document["clusters"].size(), 2U);
  EXPECT_EQ(document["clusters"][1]["name"], "smile.R");
  EXPECT_EQ(document["clusters"][1]["channel"], "smile.R");
  EXPECT_EQ(document["clusters"][1]["from"], "smile.R.region");
  EXPECT_EQ(document["clusters"][0]["fibre"].dump(), "[0.3,0.1,0.0]");
  EXPECT_EQ(document["clusters"][1]["fibre"].dump(), "[-0.3,0.1,0.0]");
  EXPECT_EQ(document["masks"]["smile.R.region"]["mirror"], "smile.L.region");
  EXPECT_EQ(editor.undo(), "muscle smile.L");
  EXPECT_FALSE(editor.document().contains("clusters"));
  muscle.name = "nose";
  EXPECT_THROW(addMuscle(editor, muscle, [] { return Vector3d(Vector3d::UnitX()); }), ToolError);
}

}  // namespace
}  // namespace sinew::tools
