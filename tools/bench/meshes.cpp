// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bench/meshes.h"

#include <map>

#include "tools/bake/bake.h"
#include "tools/core/error.h"

namespace sinew::tools {

std::shared_ptr<const Asset> bakeMesh(const std::filesystem::path& models, const BenchMesh& mesh,
                                      const MeshBakeOptions& options) {
  Recipe recipe = recipeFor(models / mesh.file);
  recipe.settings.set("tetrahedra.vertices", std::to_string(options.vertices));
  if (options.grid > 0) {
    const std::string side = std::to_string(options.grid);
    recipe.settings.set("clusters.grid", "[" + side + "," + side + "," + side + "]");
  }
  if (options.mode != nullptr) recipe.settings.set("clusters.mode", options.mode);
  if (options.levels > 0) recipe.settings.set("field.levels", std::to_string(options.levels));
  if (options.pinned) {
    RecipePins pins;
    pins.name = kBenchPins;
    pins.from.json = {{"half_space", mesh.pin_from}, {"normal", mesh.pin_normal}};
    recipe.pins.push_back(pins);
  }
  Progress progress(false);
  auto asset = Asset::fromMemory(bake(recipe, progress).package);
  if (!asset) {
    throw ToolError(ExitCode::system, mesh.name, "the baked package does not load: " + asset.reason(),
                    "This is a fault of sinew: please report it.");
  }
  return *asset;
}

std::string sizesOf(const Asset& asset) {
  const formats::PackageView& package = asset.package();
  std::uint32_t functions = 0, packs = 0;
  for (const formats::Field& field : package.fields()) {
    if (field.held != 0) continue;
    functions += field.function_count;
    packs += field.pack_count;
  }
  return std::to_string(package.physicalVertices().size()) + " physical vertices, " +
         std::to_string(package.clusters().size()) + " clusters, " + std::to_string(functions) + " functions, " +
         std::to_string(8 * packs) + " samples";
}

ClosedSurface surfaceOf(const Asset& asset) {
  const formats::PackageView& package = asset.package();
  ClosedSurface surface;
  std::map<formats::Float3, int> numbers;
  std::vector<int> number;
  for (const formats::Float3& x : package.visualPositions()) {
    const auto [place, added] = numbers.try_emplace(x, int(numbers.size()));
    if (added) surface.vertices.insert(surface.vertices.end(), x.begin(), x.end());
    number.push_back(place->second);
  }
  for (const formats::Triangle& triangle : package.visualTriangles()) {
    const std::array<int, 3> t = {number[triangle[0]], number[triangle[1]], number[triangle[2]]};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    surface.triangles.insert(surface.triangles.end(), t.begin(), t.end());
  }
  return surface;
}

}  // namespace sinew::tools
