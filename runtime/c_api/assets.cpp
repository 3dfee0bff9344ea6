// SPDX-License-Identifier: MIT
//
// The C interface over asset.h. Nothing is decided here.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>

#include "runtime/c_api/handles.h"
#include "runtime/c_api/structs.h"
#include "sinew/runtime/asset.h"

struct sinew_asset {
  std::shared_ptr<const sinew::Asset> asset;
};

namespace sinew::handles {

sinew_asset* handleOf(std::shared_ptr<const Asset> asset) { return new sinew_asset{std::move(asset)}; }
std::shared_ptr<const Asset> assetOf(const sinew_asset* asset) { return asset->asset; }

}  // namespace sinew::handles

namespace {

using sinew::handles::failNull;
using sinew::handles::guarded;
using sinew::handles::tellFailure;
using sinew::handles::writeStruct;

sinew_status finishLoad(const sinew::Result<std::shared_ptr<const sinew::Asset>>& loaded, sinew_asset** asset) {
  if (!loaded) return tellFailure(SINEW_ERROR_PACKAGE, loaded.reason());
  *asset = sinew::handles::handleOf(*loaded);
  return SINEW_OK;
}

}  // namespace

extern "C" {

sinew_status sinew_asset_load(const char* path, sinew_asset** asset) {
  if (path == nullptr || asset == nullptr) return failNull("sinew_asset_load");
  return guarded("sinew_asset_load", [&] { return finishLoad(sinew::Asset::load(path), asset); });
}

sinew_status sinew_asset_from_memory(const void* bytes, size_t size, sinew_asset** asset) {
  if (bytes == nullptr || asset == nullptr) return failNull("sinew_asset_from_memory");
  return guarded("sinew_asset_from_memory", [&] {
    return finishLoad(sinew::Asset::fromMemory({static_cast<const std::byte*>(bytes), size}), asset);
  });
}

sinew_status sinew_asset_in_place(const void* bytes, size_t size, sinew_asset** asset) {
  if (bytes == nullptr || asset == nullptr) return failNull("sinew_asset_in_place");
  if (reinterpret_cast<std::uintptr_t>(bytes) % sinew::formats::kSectionAlignment != 0) {
    return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_asset_in_place: the address of the bytes is not a multiple of 64");
  }
  return guarded("sinew_asset_in_place", [&] {
    return finishLoad(sinew::Asset::inPlace({static_cast<const std::byte*>(bytes), size}), asset);
  });
}

void sinew_asset_release(sinew_asset* asset) { delete asset; }

sinew_status sinew_asset_prepare_drawing(const sinew_asset* asset) {
  if (asset == nullptr) return failNull("sinew_asset_prepare_drawing");
  return guarded("sinew_asset_prepare_drawing", [&] {
    asset->asset->prepareDrawing();
    return SINEW_OK;
  });
}

sinew_status sinew_asset_get_info(const sinew_asset* asset, sinew_asset_info* info) {
  if (asset == nullptr || info == nullptr) return failNull("sinew_asset_get_info");
  const sinew::formats::PackageView& package = asset->asset->package();
  const sinew::formats::PackageInfo& from = package.info();
  sinew_asset_info result = {};
  result.pieces = std::uint32_t(package.pieces().size());
  result.physical_vertices = std::uint32_t(package.physicalVertices().size());
  result.tetrahedra = std::uint32_t(package.tetrahedra().size());
  result.clusters = std::uint32_t(package.clusters().size());
  result.memberships = std::uint32_t(package.memberships().size());
  result.visual_vertices = std::uint32_t(package.visualPositions().size());
  result.visual_triangles = std::uint32_t(package.visualTriangles().size());
  result.sub_meshes = std::uint32_t(package.subMeshes().size());
  result.diagonal = from.diagonal;
  std::copy(from.bounds_min.begin(), from.bounds_min.end(), result.bounds_min);
  std::copy(from.bounds_max.begin(), from.bounds_max.end(), result.bounds_max);
  result.total_mass = from.total_mass;
  std::copy(from.origin.begin(), from.origin.end(), result.origin);
  result.levels = asset->asset->levels();
  writeStruct(result, info, info->struct_size);
  return SINEW_OK;
}

sinew_status sinew_asset_section(const sinew_asset* asset, uint32_t id, const void** data, uint32_t* count,
                                 uint32_t* bytes_each) {
  if (asset == nullptr || data == nullptr || count == nullptr || bytes_each == nullptr) {
    return failNull("sinew_asset_section");
  }
  const sinew::formats::SectionData section = asset->asset->package().sectionData(id);
  *data = section.data;
  *count = std::uint32_t(section.count);
  *bytes_each = section.bytes_each;
  return SINEW_OK;
}

sinew_status sinew_asset_sub_mesh_runs(const sinew_asset* asset, uint32_t sub_mesh, const uint32_t** runs,
                                       uint32_t* count) {
  if (asset == nullptr || runs == nullptr || count == nullptr) return failNull("sinew_asset_sub_mesh_runs");
  if (sub_mesh >= asset->asset->package().subMeshes().size()) {
    return tellFailure(SINEW_ERROR_ARGUMENT, "sinew_asset_sub_mesh_runs: no such sub-mesh");
  }
  return guarded("sinew_asset_sub_mesh_runs", [&] {
    static_assert(sizeof(sinew::VertexRun) == 2 * sizeof(uint32_t));
    const std::span<const sinew::VertexRun> found = asset->asset->subMeshVertices(sub_mesh);
    *runs = found.empty() ? nullptr : &found.data()->first;
    *count = std::uint32_t(found.size());
    return SINEW_OK;
  });
}

}  // extern "C"
