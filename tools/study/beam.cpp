// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/beam.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>

#include "tools/bake/bake.h"
#include "tools/core/error.h"
#include "tools/study/assets.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

constexpr double kLength = 1, kThickness = 0.2;  // of the beam, m
constexpr double kBall = 0.25, kNeck = 0.05, kNeckLength = 0.3, kFoot = 0.03;
constexpr double kEarth = 9.81;
constexpr double kNeckTarget = 0.05;  // of the diagonal
constexpr double kRestSpeed = 1e-5;   // diagonals/s
constexpr double kFace = 1e-4;        // m: tolerance of a vertex on a face
constexpr double kSwingGravity = 0.1 * kEarth;
constexpr double kSettleSeconds = 10, kSwingSeconds = 4;
constexpr double kAuthoredDamping = 2;  // 1/s
// Of the first turning point: smaller ones are noise.
constexpr double kSmallestTurn = 0.02;
constexpr std::array<double, 4> kRates = {30, 60, 120, 240};

double youngOf(BeamBody body) { return body == BeamBody::beam ? 1e7 : 1e6; }

std::string line(const char* format, auto... values) {
  std::array<char, 256> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return buffer.data();
}

// A box of squares.
std::string boxObj(const Vector3d& low, const Vector3d& high, const std::array<int, 3>& cells) {
  std::string vertices, faces;
  std::map<std::array<int, 3>, int> number;
  const auto vertex = [&](const std::array<int, 3>& at) {
    const auto [found, fresh] = number.try_emplace(at, int(number.size()) + 1);
    if (fresh) {
      Vector3d x;
      for (int k = 0; k < 3; ++k) x[k] = low[k] + (high[k] - low[k]) * at[std::size_t(k)] / cells[std::size_t(k)];
      vertices += line("v %.9g %.9g %.9g\n", x[0], x[1], x[2]);
    }
    return found->second;
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const bool far : {false, true}) {
      for (int i = 0; i < cells[u]; ++i) {
        for (int j = 0; j < cells[v]; ++j) {
          std::array<int, 4> corner{};
          for (std::size_t k = 0; k < 4; ++k) {
            std::array<int, 3> at{};
            at[axis] = far ? cells[axis] : 0;
            at[u] = i + (k == 1 || k == 2 ? 1 : 0);
            at[v] = j + (k >= 2 ? 1 : 0);
            corner[far ? k : 3 - k] = vertex(at);
          }
          faces += line("f %d %d %d %d\n", corner[0], corner[1], corner[2], corner[3]);
        }
      }
    }
  }
  return vertices + faces;
}

// Turned about y.
std::string neckObj() {
  constexpr int kAround = 40, kAlong = 20, kRings = 36;
  std::vector<std::array<double, 2>> profile;  // radius, height
  for (const double part : {0.34, 0.67}) profile.push_back({part * kNeck, 0});
  for (int i = 0; i <= kAlong; ++i) profile.push_back({kNeck, kNeckLength * i / kAlong});
  const double first = std::asin(kNeck / kBall), middle = kNeckLength + kBall * std::cos(first);
  for (int i = 1; i < kRings; ++i) {
    const double angle = first + (std::numbers::pi - first) * i / kRings;
    profile.push_back({kBall * std::sin(angle), middle - kBall * std::cos(angle)});
  }
  std::string text;
  for (const auto& [radius, height] : profile) {
    for (int k = 0; k < kAround; ++k) {
      const double angle = 2 * std::numbers::pi * k / kAround;
      text += line("v %.9g %.9g %.9g\n", radius * std::cos(angle), height, radius * std::sin(angle));
    }
  }
  const int rings = int(profile.size()), bottom = rings * kAround + 1, top = bottom + 1;
  text += line("v 0 0 0\nv 0 %.9g 0\n", middle + kBall);
  for (int k = 0; k < kAround; ++k) {
    const int next = (k + 1) % kAround;
    text += line("f %d %d %d\n", bottom, k + 1, next + 1);
    text += line("f %d %d %d\n", top, (rings - 1) * kAround + next + 1, (rings - 1) * kAround + k + 1);
    for (int i = 0; i + 1 < rings; ++i) {
      text += line("f %d %d %d %d\n", i * kAround + k + 1, (i + 1) * kAround + k + 1, (i + 1) * kAround + next + 1,
                   i * kAround + next + 1);
    }
  }
  return text;
}

std::string objOf(BeamBody body) {
  switch (body) {
    case BeamBody::beam:
      return boxObj({0, -kThickness / 2, -kThickness / 2}, {kLength, kThickness / 2, kThickness / 2}, {40, 8, 8});
    case BeamBody::box:
      return boxObj({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, {12, 12, 12});
    case BeamBody::neck:
      return neckObj();
  }
  return {};
}

// The box of held vertices, in the source's coordinates.
nlohmann::ordered_json heldBox(BeamBody body) {
  switch (body) {
    case BeamBody::beam:
      return {{-1, -1, -1}, {kFace, 1, 1}};
    case BeamBody::box:
      return {{-1, 0.5 - kFace, -1}, {1, 1, 1}};
    case BeamBody::neck:
      return {{-1, -1, -1}, {1, kFoot, 1}};
  }
  return {};
}

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "sinew_study_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw ToolError(ExitCode::system, name, "cannot be made", "Set TMPDIR to a folder that can be written.");
    }
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  void write(const std::string& name, const std::string& text) const { std::ofstream(path_ / name) << text; }
  fs::path file(const std::string& name) const { return path_ / name; }

 private:
  fs::path path_;
};

// Sets the keys that exist: a recipe baked elsewhere may name a material otherwise.
void setKnown(Settings& settings, std::initializer_list<std::string_view> keys, const std::string& value) {
  for (const std::string_view key : keys) {
    for (const Settings::Declaration& declared : Settings::declarations(settings)) {
      if (declared.key == key) settings.set(key, value);
    }
  }
}

std::string number(double value) { return line("%.17g", value); }

// Vertices on the face that is held, and on the one that is watched (of `neck`: its highest).
struct Faces {
  std::vector<std::uint32_t> held, far;
};

Faces facesOf(BeamBody body, const PackageSolid& solid) {
  const Eigen::Index axis = body == BeamBody::beam ? 0 : 1;
  double low = 1e300, high = -1e300;
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.kept[v] == 0) continue;
    low = std::min(low, solid.rest[v][axis]);
    high = std::max(high, solid.rest[v][axis]);
  }
  Faces faces;
  for (std::uint32_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.kept[v] == 0) continue;
    const double from_low = solid.rest[v][axis] - low, from_high = high - solid.rest[v][axis];
    const bool box = body == BeamBody::box;
    if ((box ? from_high : from_low) <= (body == BeamBody::neck ? kFoot : kFace)) faces.held.push_back(v);
    if ((box ? from_low : from_high) <= kFace) faces.far.push_back(v);
  }
  return faces;
}

double meanAlong(const std::vector<std::uint32_t>& vertices, const std::vector<Vector3d>& displacement,
                 const Vector3d& direction) {
  double sum = 0;
  for (const std::uint32_t v : vertices) sum += displacement[v].dot(direction);
  return sum / double(vertices.size());
}

ElasticMaterial materialOf(const formats::PackageView& package, BeamBody body, double poisson) {
  const PieceMaterial found = materialsOf(package).front();
  return found.source == StiffnessSource::none ? ElasticMaterial{youngOf(body), poisson} : found.material;
}

// A clamped beam under its weight (Timoshenko 1921), Cowper's (1966) shear coefficient of a square section.
double beamTheory(const ElasticMaterial& material, double density, double gravity) {
  const double area = kThickness * kThickness, inertia = std::pow(kThickness, 4) / 12;
  const double shear = 10 * (1 + material.poisson) / (12 + 11 * material.poisson);
  const double weight = density * gravity * area;  // N/m
  return weight * std::pow(kLength, 4) / (8 * material.young * inertia) +
         weight * kLength * kLength * 2 * (1 + material.poisson) / (2 * shear * material.young * area);
}

}  // namespace

std::string_view nameOf(BeamBody body) {
  return std::array<std::string_view, 3>{"beam", "box", "neck"}[std::size_t(body)];
}

std::shared_ptr<const Asset> beamPackage(BeamBody body, double poisson, bool pins, double damping) {
  const TemporaryFolder folder;
  folder.write("body.obj", objOf(body));
  nlohmann::ordered_json json = {{"sinew_recipe", 2}, {"source", "body.obj"}};
  if (pins) json["pins"] = {{{"name", "held"}, {"from", {{"box", heldBox(body)}}}}};
  folder.write("body.json", json.dump());
  Recipe recipe = readRecipe(folder.file("body.json"));
  setKnown(recipe.settings, {"clusters.stiffness"}, "elastic");
  setKnown(recipe.settings, {"clusters.young", "material.young"}, number(youngOf(body)));
  setKnown(recipe.settings, {"clusters.poisson", "material.poisson"}, number(poisson));
  setKnown(recipe.settings, {"clusters.damping", "material.damping"}, number(damping));
  // Boxes of cubes have the faces and the volume that theory speaks of.
  if (body != BeamBody::neck) recipe.settings.set("tetrahedra.method", "grid");
  Progress progress(false);
  const auto asset = Asset::fromMemory(bake(recipe, progress).package);
  if (!asset) {
    throw ToolError(ExitCode::system, std::string(nameOf(body)), "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  return *asset;
}

BeamResult measureBeam(const BeamCase& one) {
  const auto asset = beamPackage(one.body, one.poisson, one.package_pins, 0);
  const formats::PackageView& package = asset->package();
  const PackageSolid solid = packageSolid(package);
  const Faces faces = facesOf(one.body, solid);
  BeamResult result;
  result.given = one;
  result.material = materialOf(package, one.body, one.poisson);
  HeldCase held;
  if (one.package_pins) {
    held = heldCase(solid, package, HoldScene::pins);
  } else {
    held.regions.resize(1);
    held.regions[0].vertices = faces.held;
  }
  const Vector3d down = one.body == BeamBody::neck ? Vector3d(Vector3d::UnitX()) : Vector3d(-Vector3d::UnitY());
  held.gravity = kEarth * down;
  const double target = one.body == BeamBody::neck ? kNeckTarget * solid.diagonal : 0;
  const ReferenceShape reference =
      referenceShape(solid, std::vector<ElasticMaterial>(solid.pieces, result.material), held, target);
  PlayOptions play;
  play.rate_hz = one.rate_hz;
  play.rest_speed = kRestSpeed * solid.diagonal;
  const PlayedShape played = playHeld(asset, solid, held, reference, play);
  result.vertices = std::uint32_t(solid.rest.size());
  for (const HeldRegion& region : held.regions) result.held += std::uint32_t(region.vertices.size());
  result.gravity = reference.gravity.norm();
  result.sag = meanAlong(faces.far, played.displacement, down);
  result.elements = meanAlong(faces.far, reference.displacement, down);
  const auto density = double(package.info().density);
  if (one.body == BeamBody::beam) result.theory = beamTheory(result.material, density, result.gravity);
  if (one.body == BeamBody::box && one.poisson == 0) result.theory = density * kEarth / (2 * result.material.young);
  result.score = scoreOf(reference.compared, played.displacement, reference.displacement);
  result.rest_seconds = played.rest_seconds;
  result.speed = played.speed / solid.diagonal;
  result.microseconds = played.microseconds;
  return result;
}

std::vector<BeamCase> beamCases() {
  std::vector<BeamCase> cases;
  for (const bool package_pins : {false, true}) {
    for (const double poisson : {0.0, 0.3}) {
      for (const double rate : kRates) cases.push_back({BeamBody::beam, poisson, rate, package_pins});
    }
  }
  for (const bool package_pins : {false, true}) {
    for (const double poisson : {0.0, 0.3}) cases.push_back({BeamBody::box, poisson, 60, package_pins});
  }
  for (const bool package_pins : {false, true}) {
    for (const double rate : {60.0, 240.0}) cases.push_back({BeamBody::neck, 0.3, rate, package_pins});
  }
  return cases;
}

Swing swingOf(const std::vector<double>& way, double seconds) {
  std::vector<double> crossings, turns;
  double turn = 0;
  for (std::size_t i = 0; i < way.size(); ++i) {
    if (i > 0 && way[i - 1] * way[i] <= 0 && way[i - 1] != way[i]) {
      turns.push_back(turn);
      if (turns.back() < kSmallestTurn * turns.front()) break;
      crossings.push_back(seconds * (double(i) - way[i] / (way[i] - way[i - 1])));
      turn = 0;
    }
    turn = std::max(turn, std::abs(way[i]));
  }
  Swing swing;
  if (crossings.size() < 3) return swing;
  swing.frequency_hz = double(crossings.size() - 1) / (2 * (crossings.back() - crossings.front()));
  // The first turning point is where it was let go; of the others each is half a period after the one before.
  const auto halves = double(crossings.size() - 1);
  const double decrement = std::log(turns[0] / turns[crossings.size() - 1]) / halves;
  swing.damping_ratio = decrement / std::hypot(std::numbers::pi, decrement);
  return swing;
}

SwingResult measureSwing(const SwingCase& one) {
  const auto asset = beamPackage(BeamBody::beam, 0, false, one.damping);
  const PackageSolid solid = packageSolid(asset->package());
  const Faces faces = facesOf(BeamBody::beam, solid);
  SwingResult result;
  result.given = one;
  ElasticSolid elastic{solid.rest, solid.tetrahedra, {}, {}};
  elastic.prescribed.resize(solid.rest.size());
  for (const std::uint32_t v : faces.held) elastic.prescribed[v] = solid.rest[v];
  result.elements_hz = lowestFrequency(elastic, {materialOf(asset->package(), BeamBody::beam, 0)}, solid.masses);
  result.authored_ratio = one.damping / (4 * std::numbers::pi * result.elements_hz);
  WorldSettings settings;
  settings.gravity = {0, float(-kSwingGravity), 0};
  World world(settings);
  const auto body = world.addBody(asset);
  if (!body) throw ToolError(ExitCode::system, "", body.reason(), "Free some memory.");
  const auto set = world.addPinSet(*body, faces.held);
  if (!set) throw ToolError(ExitCode::system, "", set.reason(), "This is a fault of the study: please report it.");
  const auto height = [&] {
    double sum = 0;
    for (const std::uint32_t v : faces.far) sum += double(world.positions(*body)[v][1]) - solid.rest[v][1];
    return sum / double(faces.far.size());
  };
  const double rest = height();
  const auto steps = [&](double seconds) { return int(std::lround(seconds * one.rate_hz)); };
  for (int i = 0; i < steps(kSettleSeconds); ++i) world.step(float(1 / one.rate_hz));
  world.settings().gravity = {0, 0, 0};
  if (!one.world_damping) {
    world.settings().damping = 0;
    world.settings().deformation_damping_ratio = 0;
    world.settings().support_damping = 0;
  }
  std::vector<double> way = {height() - rest};
  for (int i = 0; i < steps(kSwingSeconds); ++i) {
    world.step(float(1 / one.rate_hz));
    way.push_back(height() - rest);
  }
  const Swing swing = swingOf(way, 1 / one.rate_hz);
  result.frequency_hz = swing.frequency_hz;
  result.damping_ratio = swing.damping_ratio;
  for (std::size_t i = way.size() - std::size_t(steps(1)); i < way.size(); ++i) {
    result.end = std::max(result.end, std::abs(way[i] / way.front()));
  }
  return result;
}

std::vector<SwingCase> swingCases() {
  std::vector<SwingCase> cases;
  for (const double rate : kRates) cases.push_back({rate, 0, false});
  for (const double rate : kRates) cases.push_back({rate, kAuthoredDamping, false});
  for (const double rate : kRates) cases.push_back({rate, 0, true});
  return cases;
}

nlohmann::ordered_json beamJson(const std::vector<BeamResult>& beams, const std::vector<SwingResult>& swings) {
  using Json = nlohmann::ordered_json;
  Json json = {{"study", "beam"}, {"rest", Json::array()}, {"swings", Json::array()}};
  for (const BeamResult& r : beams) {
    json["rest"].push_back({{"body", nameOf(r.given.body)},
                            {"poisson", r.given.poisson},
                            {"rate_hz", r.given.rate_hz},
                            {"held_by", r.given.package_pins ? "recipe" : "pin set"},
                            {"vertices", r.vertices},
                            {"held_vertices", r.held},
                            {"young", r.material.young},
                            {"gravity", r.gravity},
                            {"sag_metres", r.sag},
                            {"elements_metres", r.elements},
                            {"theory_metres", r.theory > 0 ? Json(r.theory) : Json()},
                            {"error_rms", r.score.rms},
                            {"error_max", r.score.largest},
                            {"way", r.score.way},
                            {"rest_seconds", r.rest_seconds < 0 ? Json() : Json(r.rest_seconds)},
                            {"rms_speed", r.speed},
                            {"microseconds_per_step", r.microseconds}});
  }
  for (const SwingResult& r : swings) {
    json["swings"].push_back({{"rate_hz", r.given.rate_hz},
                              {"authored_damping", r.given.damping},
                              {"world_damping", r.given.world_damping},
                              {"elements_hz", r.elements_hz},
                              {"frequency_hz", r.frequency_hz > 0 ? Json(r.frequency_hz) : Json()},
                              {"damping_ratio", r.frequency_hz > 0 ? Json(r.damping_ratio) : Json()},
                              {"authored_ratio", r.authored_ratio},
                              {"end", r.end}});
  }
  return json;
}

std::string beamText(const std::vector<BeamResult>& beams, const std::vector<SwingResult>& swings) {
  std::string text =
      "body    nu  held by  steps/s   sag, mm  / theory  / elements  error,%  most, %  rest, s  speed, 1/s  us/step\n";
  for (const BeamResult& r : beams) {
    const std::string theory = r.theory > 0 ? line("%8.3f", r.sag / r.theory) : "-";
    const std::string rest = r.rest_seconds >= 0 ? line("%.2f", r.rest_seconds) : "never";
    text += line("%-4s  %4.2g  %-7s  %7.0f  %8.2f  %8s  %10.3f  %7.1f  %7.1f  %7s  %10.1e  %7.0f\n",
                 nameOf(r.given.body).data(), r.given.poisson, r.given.package_pins ? "recipe" : "pin set",
                 r.given.rate_hz, 1000 * r.sag, theory.c_str(), r.sag / r.elements, 100 * r.score.rms,
                 100 * r.score.largest, rest.c_str(), r.speed, r.microseconds);
  }
  text +=
      "theory: Timoshenko's beam, the box's own weight; what the recipe holds is not the face alone. elements: finite "
      "elements on the package's tetrahedra, the same vertices held.\n\n"
      "the beam let go: steps/s  authored damping, 1/s  the world's      Hz  / elements  damping ratio  authored  left "
      "after 4 s\n";
  for (const SwingResult& r : swings) {
    const bool swings_at_all = r.frequency_hz > 0;
    text += line("%24.0f  %21.3g  %11s  %6s  %10s  %13s  %8.4f  %14.4f\n", r.given.rate_hz, r.given.damping,
                 r.given.world_damping ? "default" : "none", swings_at_all ? line("%.3f", r.frequency_hz).c_str() : "-",
                 swings_at_all ? line("%.3f", r.frequency_hz / r.elements_hz).c_str() : "-",
                 swings_at_all ? line("%.4f", r.damping_ratio).c_str() : "creeps", r.authored_ratio, r.end);
  }
  return text;
}

}  // namespace sinew::tools
