// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "sinew/runtime/asset.h"

namespace sinew::tools {

/// A mesh of tests/assets/models with a half-space in which a pin set holds it.
struct BenchMesh {
  const char* name;
  const char* file;
  std::array<double, 3> pin_from, pin_normal;  ///< in the file's coordinates
};
inline constexpr BenchMesh kSpot = {"spot", "spot_textured.glb", {0, 0.8, 0}, {0, 1, 0}};
inline constexpr BenchMesh kHead = {"head", "makehuman_head.obj", {0, 5.65, 0}, {0, -1, 0}};

/// The name of that pin set.
inline constexpr const char* kBenchPins = "held";

struct MeshBakeOptions {
  std::uint32_t vertices = 1500;  ///< physical ones wanted
  std::uint32_t grid = 0;         ///< clusters along each axis; 0: as the bake chooses
  const char* mode = nullptr;     ///< clusters.mode; null: the default
  bool pinned = false;            ///< with the pin set
  std::uint32_t levels = 0;       ///< field.levels
};

/// The package of a mesh by default settings but for these. Throws ToolError where the mesh cannot be baked.
std::shared_ptr<const Asset> bakeMesh(const std::filesystem::path& models, const BenchMesh& mesh,
                                      const MeshBakeOptions& options);

/// "1512 physical vertices, 18 clusters, 32 functions, 128 samples", of the free field.
std::string sizesOf(const Asset& asset);

/// The visual surface with vertices at the same place made one.
struct ClosedSurface {
  std::vector<float> vertices;  ///< x, y, z
  std::vector<int> triangles;
};
ClosedSurface surfaceOf(const Asset& asset);

}  // namespace sinew::tools
