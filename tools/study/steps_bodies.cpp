// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/steps_bodies.h"

#include <stdlib.h>

#include <Eigen/Core>
#include <cmath>
#include <fstream>
#include <numbers>
#include <utility>

#include "tools/bake/bake.h"
#include "tools/core/error.h"
#include "tools/study/packages.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr double kTetrahedronHz = 10;  // as a bake's default

/// Faces with any number of corners, outward counter-clockwise.
struct Faces {
  std::vector<Vector3d> points;
  std::vector<std::vector<std::size_t>> faces;
};

void addBox(const Vector3d& low, const Vector3d& high, Faces& mesh) {
  const std::size_t first = mesh.points.size();
  for (int corner = 0; corner < 8; ++corner) {
    mesh.points.emplace_back((corner & 1) != 0 ? high[0] : low[0], (corner & 2) != 0 ? high[1] : low[1],
                             (corner & 4) != 0 ? high[2] : low[2]);
  }
  for (const auto& face :
       {std::array<std::size_t, 4>{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    std::vector<std::size_t> corners;
    for (const std::size_t corner : face) corners.push_back(first + corner);
    mesh.faces.push_back(corners);
  }
}

/// (radius, along) pairs turned about an axis, closed by a flat face at each end. \param across a right-handed pair of
/// directions with `axis`: across[0] x across[1] = axis.
void addTurned(const std::vector<std::pair<double, double>>& profile, const Vector3d& origin,
               const std::array<Vector3d, 2>& across, const Vector3d& axis, std::size_t sides, Faces& mesh) {
  const std::size_t first = mesh.points.size();
  for (const auto& [radius, along] : profile) {
    for (std::size_t k = 0; k < sides; ++k) {
      // Half a side on: a flat one lies below.
      const double angle = 2 * std::numbers::pi * (double(k) + 0.5) / double(sides);
      mesh.points.emplace_back(origin + along * axis +
                               radius * (std::cos(angle) * across[0] + std::sin(angle) * across[1]));
    }
  }
  std::vector<std::size_t> lower, upper;
  for (std::size_t k = 0; k < sides; ++k) {
    lower.push_back(first + sides - 1 - k);
    upper.push_back(first + (profile.size() - 1) * sides + k);
  }
  mesh.faces.push_back(lower);
  mesh.faces.push_back(upper);
  for (std::size_t ring = 0; ring + 1 < profile.size(); ++ring) {
    for (std::size_t k = 0; k < sides; ++k) {
      const std::size_t a = first + ring * sides + k, b = first + ring * sides + (k + 1) % sides;
      mesh.faces.push_back({a, b, b + sides, a + sides});
    }
  }
}

const Vector3d kX = Vector3d::UnitX(), kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

Faces neckMesh() {
  constexpr double kBall = 0.22, kNeck = 0.05, kPlate = 0.4, kTop = 0.1, kMiddle = 0.62;
  std::vector<std::pair<double, double>> profile = {{kPlate, 0}, {kPlate, kTop}, {kNeck, kTop}};
  const double begin = std::asin(kNeck / kBall);
  for (int k = 0; k <= 8; ++k) {
    const double angle = begin + (std::numbers::pi - 2 * begin) * k / 8;
    profile.emplace_back(kBall * std::sin(angle), kMiddle - kBall * std::cos(angle));
  }
  Faces mesh;
  addTurned(profile, Vector3d::Zero(), {kZ, kX}, kY, 16, mesh);
  return mesh;
}

Faces sheetMesh() {
  constexpr std::size_t kCells = 12;
  Faces mesh;
  for (std::size_t i = 0; i <= kCells; ++i) {
    for (std::size_t j = 0; j <= kCells; ++j) mesh.points.emplace_back(double(i) / kCells, 0, double(j) / kCells);
  }
  for (std::size_t i = 0; i < kCells; ++i) {
    for (std::size_t j = 0; j < kCells; ++j) {
      const std::size_t at = i * (kCells + 1) + j;
      mesh.faces.push_back({at, at + 1, at + kCells + 2, at + kCells + 1});
    }
  }
  return mesh;
}

/// A folder that goes with its content.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "sinew-steps-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      throw ToolError(ExitCode::system, name, "cannot be made", "Set TMPDIR to a folder that can be written.");
    }
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

StepsBody baked(const std::string& name, const Faces& mesh, const std::string& vertices,
                const std::filesystem::path& folder, const std::filesystem::path& worker) {
  const std::filesystem::path file = folder / (name + ".obj");
  {
    std::ofstream obj(file);
    obj.precision(17);
    for (const Vector3d& x : mesh.points) obj << "v " << x[0] << ' ' << x[1] << ' ' << x[2] << '\n';
    for (const auto& face : mesh.faces) {
      obj << 'f';
      for (const std::size_t corner : face) obj << ' ' << corner + 1;
      obj << '\n';
    }
    obj.close();
    if (!obj) throw ToolError(ExitCode::system, file.string(), "cannot be written", "Make room on the disk.");
  }
  Recipe recipe = recipeFor(file);
  recipe.settings.import.worker = worker;
  recipe.settings.set("tetrahedra.vertices", vertices);
  Progress progress(false);
  const BakeResult result = bake(recipe, progress);
  const auto asset = Asset::fromMemory(result.package);
  if (!asset) {
    throw ToolError(ExitCode::system, name, "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  return {name, *asset};
}

}  // namespace

std::vector<StepsBody> builtInStepsBodies(const std::filesystem::path& worker) {
  const Folder folder;
  std::vector<StepsBody> bodies;
  const auto add = [&](const std::string& name, const Faces& mesh, const std::string& vertices) {
    bodies.push_back(baked(name, mesh, vertices, folder.path(), worker));
  };
  Faces box, beam, uneven, rope;
  addBox({0, 0, 0}, {1, 0.8, 0.6}, box);
  add("box", box, "300");
  addBox({0, 0, 0}, {2, 0.2, 0.2}, beam);
  add("beam", beam, "300");
  add("neck", neckMesh(), "400");
  addBox({0, 0, 0}, {1, 1, 1}, uneven);
  addBox({1.3, 0, 0.4}, {1.4, 0.1, 0.5}, uneven);
  add("uneven", uneven, "400");
  add("sheet", sheetMesh(), "300");
  addTurned({{0.02, 0}, {0.02, 2}}, {0, 0.02 * std::cos(std::numbers::pi / 8), 0}, {kY, kZ}, kX, 8, rope);
  add("rope", rope, "300");
  bodies.push_back({"tetrahedron", tetrahedronPackage({.frequency_hz = kTetrahedronHz, .surface = true})});
  return bodies;
}

}  // namespace sinew::tools
