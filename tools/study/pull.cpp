// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/pull.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "sinew/runtime/world.h"
#include "tools/bake/bake.h"
#include "tools/core/error.h"
#include "tools/study/finite_elements.h"
#include "tools/study/held_body.h"
#include "tools/study/row_picture.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kStep = 1.0 / 60;
constexpr double kDefaultPull = 0.02;  // of the diagonal
// Beside the middle, which lies on a border of an even number of clusters; of the bounds.
constexpr double kBesideMiddle = 0.08;
constexpr float kStandsOn = 0.1F;  // of the height
constexpr double kDriftSeconds = 0.5;
constexpr double kReferenceTolerance = 1e-5;
// A visual vertex hangs on a physical one that has this part of its weight.
constexpr float kCarries = 0.1F;
constexpr float kHeldWhole = 0.999F;
// Of the diagonal: small displacements are drawn as large as that.
constexpr double kDrawnDisplacement = 0.12;
constexpr float kPictureYaw = 0.35F;

struct Baked {
  std::shared_ptr<const Asset> asset;
  bool sheet = false;
};

std::shared_ptr<const Baked> bakeWith(Recipe recipe, const std::array<std::uint32_t, 3>& grid, const std::string& mode,
                                      std::uint32_t functions) {
  recipe.settings.set("clusters.mode", mode);
  recipe.settings.set("field.functions", std::to_string(functions));
  if (grid[0] > 0) {
    recipe.clusters.clear();
    recipe.settings.set("clusters.method", "grid");
    recipe.settings.set("clusters.grid",
                        std::to_string(grid[0]) + "," + std::to_string(grid[1]) + "," + std::to_string(grid[2]));
  }
  Progress progress(false);
  BakeResult result = bake(recipe, progress);
  auto baked = std::make_shared<Baked>();
  for (const auto& piece : result.report.at("pieces")) baked->sheet = baked->sheet || piece.at("method") == "shell";
  const auto asset = Asset::fromMemory(result.package);
  if (!asset) {
    throw ToolError(ExitCode::system, recipe.source.string(), "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it with the file.");
  }
  baked->asset = *asset;
  return baked;
}

std::array<float, 4> weightsOf(const formats::BarycentricAttachment& a) {
  return {a.weight[0], a.weight[1], a.weight[2], 1 - a.weight[0] - a.weight[1] - a.weight[2]};
}

Vector3d point(const std::array<float, 3>& x) { return {double(x[0]), double(x[1]), double(x[2])}; }

// Held and pulled physical vertices by number. All packages of a study share them, as they share tetrahedra.
struct Load {
  std::vector<std::uint32_t> held, pulled;
  bool own_pins = false;  // held by the package's pin sets
  Vector3d pull;
};

// Of a shell, which lies on both sides of its surface: physical vertices against the normals of the visual vertices on
// them, or of the nearest visual vertex where there is none.
std::vector<std::uint32_t> underSide(const formats::PackageView& package) {
  const auto vertices = package.physicalVertices();
  std::vector<double> above(vertices.size(), 0);
  const auto add = [&](std::uint32_t visual, std::uint32_t physical, double weight) {
    above[physical] +=
        weight * point(package.visualNormals()[visual])
                     .dot(point(vertices[physical].rest_position) - point(package.visualPositions()[visual]));
  };
  std::vector<std::uint8_t> known(vertices.size(), 0);
  for (std::uint32_t v = 0; v < package.barycentric().size(); ++v) {
    const std::array<float, 4> w = weightsOf(package.barycentric()[v]);
    for (std::size_t k = 0; k < 4; ++k) {
      if (w[k] < kCarries) continue;
      const std::uint32_t physical = package.tetrahedra()[package.barycentric()[v].tetrahedron].vertex[k];
      known[physical] = 1;
      add(v, physical, double(w[k]));
    }
  }
  std::vector<std::uint32_t> side;
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    if (known[v] == 0) {
      const auto away = [&](const std::array<float, 3>& x) {
        return (point(x) - point(vertices[v].rest_position)).squaredNorm();
      };
      const auto all = package.visualPositions();
      const auto nearest = std::min_element(
          all.begin(), all.end(), [&](const auto& one, const auto& other) { return away(one) < away(other); });
      add(std::uint32_t(nearest - all.begin()), v, 1);
    }
    if (above[v] < 0) side.push_back(v);
  }
  return side;
}

// The lowest tenth of a solid: it stands on these vertices.
std::vector<std::uint32_t> lowest(const formats::PackageView& package) {
  const auto vertices = package.physicalVertices();
  const auto height = [](const auto& v) { return v.rest_position[1]; };
  const auto [low, high] =
      std::minmax_element(vertices.begin(), vertices.end(),
                          [&](const auto& one, const auto& other) { return height(one) < height(other); });
  const float level = height(*low) + kStandsOn * (height(*high) - height(*low));
  std::vector<std::uint32_t> feet;
  for (std::uint32_t v = 0; v < vertices.size(); ++v) {
    if (height(vertices[v]) <= level) feet.push_back(v);
  }
  return feet;
}

std::vector<std::uint32_t> pinnedWhole(const formats::PackageView& package) {
  std::vector<std::uint32_t> held;
  for (const std::uint32_t v : package.pinSetVertices()) {
    if (package.pinWeights().empty() || package.pinWeights()[v] >= kHeldWhole) held.push_back(v);
  }
  std::sort(held.begin(), held.end());
  held.erase(std::unique(held.begin(), held.end()), held.end());
  return held;
}

Load loadOf(const Recipe& recipe, const Baked& baked, const PullOptions& options) {
  const formats::PackageView& package = baked.asset->package();
  const auto& info = package.info();
  Load load;
  load.held = pinnedWhole(package);
  load.own_pins = !load.held.empty();
  if (!load.own_pins) load.held = baked.sheet ? underSide(package) : lowest(package);
  const auto fromHeld = [&](const Vector3d& x) {
    double nearest = 1e300;
    for (const std::uint32_t v : load.held) {
      nearest = std::min(nearest, (x - point(package.physicalVertices()[v].rest_position)).squaredNorm());
    }
    return nearest;
  };
  Vector3d aim = Vector3d::Zero();
  const bool middle = !options.pick && !load.own_pins && baked.sheet;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto low = double(info.bounds_min[k]), high = double(info.bounds_max[k]);
    if (options.pick) aim[Eigen::Index(k)] = (*options.pick)[k] - info.origin[k];
    if (middle) aim[Eigen::Index(k)] = 0.5 * (low + high) + kBesideMiddle * (high - low);
  }
  std::uint32_t picked = 0;
  double best = 1e300;
  for (std::uint32_t v = 0; v < package.visualPositions().size(); ++v) {
    const Vector3d x = point(package.visualPositions()[v]);
    const double score = options.pick || middle ? (x - aim).norm() : -fromHeld(x);
    if (score >= best) continue;
    best = score;
    picked = v;
  }
  const auto diagonal = double(info.diagonal);
  load.pull = options.pull ? Vector3d(options.pull->data())
                           : Vector3d(kDefaultPull * diagonal * point(package.visualNormals()[picked]));
  const Vector3d at = point(package.visualPositions()[picked]);
  // Partly pinned vertices are neither held nor free to be pulled.
  std::vector<std::uint8_t> taken(package.physicalVertices().size(), 0);
  for (const std::uint32_t v : load.held) taken[v] = 1;
  for (const std::uint32_t v : package.pinSetVertices()) taken[v] = 1;
  for (std::uint32_t v = 0; v < package.physicalVertices().size(); ++v) {
    if (taken[v] != 0) continue;
    if ((point(package.physicalVertices()[v].rest_position) - at).norm() <= options.finger * diagonal)
      load.pulled.push_back(v);
  }
  if (load.pulled.empty() || load.pull.norm() <= 0) {
    throw ToolError(ExitCode::bad_input, recipe.source.string(),
                    "nothing is pulled: no free physical vertex is near the point",
                    "Raise --finger, or give --pick a point that nothing holds.");
  }
  return load;
}

struct Reference {
  std::vector<Vector3d> positions;  // of the visual vertices
  double change_rms = 0, change_max = 0, largest = 0, rms = 0;
  std::uint32_t tetrahedra = 0;
};

// \param progress called with 0..1.
Reference referenceOf(const formats::PackageView& package, const Load& load, double poisson, std::uint32_t refinements,
                      const std::function<void(double)>& progress) {
  ElasticSolid coarse;
  for (const auto& v : package.physicalVertices()) coarse.rest.push_back(point(v.rest_position));
  for (const auto& t : package.tetrahedra()) {
    coarse.tetrahedra.push_back({t.vertex[0], t.vertex[1], t.vertex[2], t.vertex[3]});
  }
  coarse.prescribed.resize(coarse.rest.size());
  for (const std::uint32_t v : load.held) coarse.prescribed[v] = coarse.rest[v];
  for (const std::uint32_t v : load.pulled) coarse.prescribed[v] = coarse.rest[v] + load.pull;
  Reference reference;
  std::vector<Vector3d> shape = equilibrium(coarse, {}, poisson, kReferenceTolerance).positions;
  ElasticSolid fine = coarse;
  for (std::uint32_t level = 1; level <= refinements; ++level) {
    fine = refined(fine, &shape);
    shape = equilibrium(fine, std::move(shape), poisson, kReferenceTolerance).positions;
    if (level + 1 < refinements) continue;
    const std::vector<Vector3d> before = std::move(reference.positions);
    reference.positions.clear();
    for (const auto& a : package.barycentric()) {
      const std::array<float, 4> w = weightsOf(a);
      reference.positions.push_back(deformedPoint(coarse, fine, int(level), a.tetrahedron,
                                                  {double(w[0]), double(w[1]), double(w[2]), double(w[3])}, shape));
    }
    double square = 0, all = 0;
    for (std::size_t v = 0; v < reference.positions.size(); ++v) {
      const double way = (reference.positions[v] - point(package.visualPositions()[v])).norm();
      all += way * way;
      reference.largest = std::max(reference.largest, way);
      if (before.empty()) continue;
      const double moved = (reference.positions[v] - before[v]).norm();
      square += moved * moved;
      reference.change_max = std::max(reference.change_max, moved);
    }
    reference.change_rms = std::sqrt(square / double(reference.positions.size()));
    reference.rms = std::sqrt(all / double(reference.positions.size()));
    progress(double(level) / refinements);
  }
  reference.change_rms /= reference.largest;
  reference.change_max /= reference.largest;
  reference.rms /= reference.largest;
  reference.tetrahedra = std::uint32_t(fine.tetrahedra.size());
  return reference;
}

Shape shapeOf(const World& world, BodyId body) {
  Shape shape;
  const std::size_t count = world.asset(body).package().visualPositions().size();
  shape.positions.resize(count);
  shape.normals.resize(count);
  world.visualVertices(body, {shape.positions[0].data(), sizeof(Vector3f), std::uint32_t(count)},
                       {shape.normals[0].data(), sizeof(Vector3f), std::uint32_t(count)});
  for (const Vec3& x : world.positions(body)) shape.physical.emplace_back(x[0], x[1], x[2]);
  return shape;
}

void simulate(PullRow& row, const Load& load, const PullOptions& options) {
  WorldSettings settings;
  settings.gravity = {0, 0, 0};
  settings.iterations = row.iterations;
  World world(settings);
  BodySettings body_settings;
  body_settings.solver = options.solver;
  const auto added = world.addBody(row.asset, body_settings);
  if (!added) throw ToolError(ExitCode::system, "", added.reason(), "Free some memory.");
  const BodyId body = *added;
  const std::vector<Vec3> rest(world.positions(body).begin(), world.positions(body).end());
  if (!load.own_pins) {
    for (const std::uint32_t v : load.held) world.pin(body, v, rest[v]);
  }
  std::vector<double> times;
  const int steps = std::max(1, int(std::lround(options.seconds / kStep)));
  const int late = steps - std::min(steps, int(std::lround(kDriftSeconds / kStep)));
  Shape before;
  for (int step = 0; step < steps; ++step) {
    const double part = std::min(1.0, 3.0 * (step + 1) / steps);
    for (const std::uint32_t v : load.pulled) {
      Vec3 target = rest[v];
      for (std::size_t k = 0; k < 3; ++k) target[k] += float(part * load.pull[Eigen::Index(k)]);
      world.pin(body, v, target);
    }
    if (step == late) before = shapeOf(world, body);
    const double start = threadSeconds();
    world.step(float(kStep));
    times.push_back(threadSeconds() - start);
  }
  std::nth_element(times.begin(), times.begin() + std::ptrdiff_t(times.size() / 2), times.end());
  row.microseconds = 1e6 * times[times.size() / 2];
  row.shape = shapeOf(world, body);
  for (std::size_t v = 0; v < row.shape.positions.size(); ++v) {
    row.drift = std::max(row.drift, double((row.shape.positions[v] - before.positions[v]).norm()));
  }
}

void compare(PullRow& row, const Reference& reference) {
  double square = 0;
  for (std::size_t v = 0; v < reference.positions.size(); ++v) {
    const double off = (row.shape.positions[v].cast<double>() - reference.positions[v]).norm();
    square += off * off;
    row.max = std::max(row.max, off);
  }
  row.rms = std::sqrt(square / double(reference.positions.size())) / (reference.rms * reference.largest);
  row.max /= reference.largest;
  row.drift /= reference.largest;
}

void markBest(std::vector<PullRow>& rows) {
  for (PullRow& row : rows) {
    row.best = std::none_of(rows.begin(), rows.end(), [&](const PullRow& other) {
      return other.rms < row.rms && other.microseconds < row.microseconds;
    });
  }
}

std::vector<Vector3f> normalsOf(const formats::PackageView& package, const std::vector<Vector3f>& positions) {
  std::vector<Vector3f> normals(positions.size(), Vector3f::Zero());
  for (const auto& c : package.visualTriangles()) {
    const Vector3f n = (positions[c[1]] - positions[c[0]]).cross(positions[c[2]] - positions[c[0]]);
    for (const std::uint32_t v : c) normals[v] += n;
  }
  for (Vector3f& n : normals) n.normalize();
  return normals;
}

std::array<std::uint32_t, 3> gridOf(const formats::PackageView& package, std::uint32_t clusters) {
  std::array<double, 3> extent{};
  for (std::size_t k = 0; k < 3; ++k) extent[k] = double(package.info().bounds_max[k] - package.info().bounds_min[k]);
  const double longest = *std::max_element(extent.begin(), extent.end());
  std::array<std::uint32_t, 3> grid{};
  for (std::size_t k = 0; k < 3; ++k) {
    grid[k] = std::max(1U, std::uint32_t(std::floor(clusters * extent[k] / longest + 1e-6)));
  }
  return grid;
}

std::string gridText(const PullRow& row) {
  if (row.grid[0] == 0) return "recipe";
  return std::to_string(row.grid[0]) + "x" + std::to_string(row.grid[1]) + "x" + std::to_string(row.grid[2]);
}

}  // namespace

PullStudy measurePull(const Recipe& recipe, const PullOptions& options, const std::function<void(double)>& progress) {
  // Half of the bar is the reference.
  PullStudy study;
  study.poisson = recipe.settings.clusters.poisson;
  std::vector<std::uint32_t> functions = options.functions;
  if (functions.empty()) functions = {recipe.settings.field.functions};
  std::shared_ptr<const Baked> first = bakeWith(recipe, {1, 1, 1}, options.modes.front(), functions.front());
  const formats::PackageView& package = first->asset->package();
  if (package.barycentric().empty()) {
    throw ToolError(ExitCode::bad_input, recipe.source.string(), "its surface hangs on clusters, not on tetrahedra",
                    "Set attachment.method to barycentric.");
  }
  const Load load = loadOf(recipe, *first, options);
  study.held = std::uint32_t(load.held.size());
  study.pulled = std::uint32_t(load.pulled.size());
  const Reference reference =
      referenceOf(package, load, study.poisson, options.refinements, [&](double part) { progress(0.5 * part); });
  study.largest = reference.largest;
  study.change_rms = reference.change_rms;
  study.change_max = reference.change_max;
  study.rms = reference.rms;
  study.reference_tetrahedra = reference.tetrahedra;
  for (const Vector3d& x : reference.positions) study.reference.positions.push_back(x.cast<float>());
  study.reference.normals = normalsOf(package, study.reference.positions);
  const std::size_t count =
      options.clusters.size() * options.modes.size() * functions.size() * options.iterations.size();
  for (const std::uint32_t clusters : options.clusters) {
    const std::array<std::uint32_t, 3> grid =
        clusters > 0 ? gridOf(package, clusters) : std::array<std::uint32_t, 3>{0, 0, 0};
    for (const std::string& mode : options.modes) {
      for (const std::uint32_t wanted : functions) {
        const std::shared_ptr<const Baked> baked = bakeWith(recipe, grid, mode, wanted);
        for (const std::uint32_t iterations : options.iterations) {
          PullRow row;
          row.grid = grid;
          row.mode = mode;
          row.functions = wanted;
          row.iterations = iterations;
          row.asset = {baked, baked->asset.get()};
          row.clusters = std::uint32_t(row.asset->package().clusters().size());
          row.memberships = std::uint32_t(row.asset->package().memberships().size());
          simulate(row, load, options);
          compare(row, reference);
          study.rows.push_back(std::move(row));
          progress(0.5 + 0.5 * double(study.rows.size()) / double(count));
        }
      }
    }
  }
  markBest(study.rows);
  return study;
}

nlohmann::ordered_json pullJson(const PullStudy& study) {
  nlohmann::ordered_json json = {{"study", "pull"},
                                 {"held_vertices", study.held},
                                 {"pulled_vertices", study.pulled},
                                 {"reference",
                                  {{"tetrahedra", study.reference_tetrahedra},
                                   {"poisson", study.poisson},
                                   {"largest_displacement", study.largest},
                                   {"rms_displacement", study.rms},
                                   {"change_rms", study.change_rms},
                                   {"change_max", study.change_max}}}};
  json["results"] = nlohmann::ordered_json::array();
  for (const PullRow& row : study.rows) {
    json["results"].push_back({{"clusters", row.clusters},
                               {"grid", gridText(row)},
                               {"mode", row.mode},
                               {"functions", row.functions},
                               {"iterations", row.iterations},
                               {"memberships", row.memberships},
                               {"rms", row.rms},
                               {"max", row.max},
                               {"drift", row.drift},
                               {"microseconds_per_step", row.microseconds},
                               {"best", row.best}});
  }
  return json;
}

std::string pullText(const PullStudy& study) {
  std::array<char, 256> line{};
  std::snprintf(
      line.data(), line.size(),
      "reference: %u tetrahedra, nu %.3g; largest displacement %.4g m, rms %.1f %% of it; the last refinement "
      "changed %.2f %% (rms), %.1f %% (most)\n",
      study.reference_tetrahedra, study.poisson, study.largest, 100 * study.rms, 100 * study.change_rms,
      100 * study.change_max);
  std::string text = line.data();
  text += "clusters        mode  functions  iterations  memberships  rms, %  max, %  drift, %  us per 1/60 s\n";
  for (const PullRow& row : study.rows) {
    std::snprintf(line.data(), line.size(), "%8s  %10s  %9u  %10u  %11u  %6.2f  %6.1f  %8.2f  %13.0f%s\n",
                  gridText(row).c_str(), row.mode.c_str(), row.functions, row.iterations, row.memberships,
                  100 * row.rms, 100 * row.max, 100 * row.drift, row.microseconds, row.best ? "  *" : "");
    text += line.data();
  }
  return text + "* no other row is both nearer and faster\n";
}

Image pullPicture(const PullStudy& study) {
  const formats::PackageView& package = study.rows.front().asset->package();
  const double larger = std::max(1.0, kDrawnDisplacement * double(package.info().diagonal) / study.largest);
  const auto enlarged = [&](const Shape& shape) {
    Shape drawn;
    for (std::size_t v = 0; v < shape.positions.size(); ++v) {
      const Vector3f rest = point(package.visualPositions()[v]).cast<float>();
      drawn.positions.push_back(rest + float(larger) * (shape.positions[v] - rest));
    }
    drawn.normals = normalsOf(package, drawn.positions);
    return drawn;
  };
  std::array<char, 96> text{};
  std::snprintf(text.data(), text.size(), "finite elements (displacements drawn x %.1f)", larger);
  std::vector<RowPicture> row = {{study.rows.front().asset, enlarged(study.reference), text.data()}};
  for (const PullRow& one : study.rows) {
    std::snprintf(text.data(), text.size(), "%u functions, clusters %s: max %.0f %%, rms %.0f %%", one.functions,
                  gridText(one).c_str(), 100 * one.max, 100 * one.rms);
    row.push_back({one.asset, enlarged(one.shape), text.data()});
  }
  RowOptions options;
  options.width = 360;
  options.height = 220;
  options.columns = 5;
  Camera camera = viewCamera(ViewName::three_quarter);
  camera.yaw = kPictureYaw;
  return drawRow(row, camera, options);
}

}  // namespace sinew::tools
