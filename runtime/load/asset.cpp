// SPDX-License-Identifier: MIT
#include "sinew/runtime/asset.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <new>

#include "runtime/attach/visual_constants.h"
#include "runtime/load/mapped_file.h"
#include "runtime/load/rest_constants.h"

namespace sinew {

struct Asset::Lazy {
  std::once_flag clusters_made, visual_made, tangents_made;
  internal::Array<internal::ClusterRest> clusters;
  internal::VisualConstants visual;
  internal::Array<std::array<float, 4>> tangents;
};

Asset::Asset() : lazy_(std::make_unique<Lazy>()) {}

Asset::~Asset() {
  if (memory_ == nullptr) return;
  if (mapped_) {
    internal::unmapFile(memory_, bytes_);
  } else {
    ::operator delete(memory_, std::align_val_t(formats::kSectionAlignment));
  }
}

namespace {

// Compiled once, for whatever is to be made.
void makeOnce(std::once_flag& made, void (*make)(const Asset&), const Asset& asset) {
  std::call_once(made, make, asset);
}

Error faultOf(const std::string& path, const char* fault) {
  std::string reason = path;
  reason.append(": ").append(fault);
  return Error{std::move(reason)};
}

}  // namespace

Result<std::shared_ptr<const Asset>> Asset::load(const std::string& path) try {
  std::shared_ptr<Asset> asset(new Asset);
  const internal::MappedFile file = internal::mapFile(path);
  if (file.reason != nullptr) return faultOf(path, file.reason);
  asset->memory_ = file.data;
  asset->bytes_ = file.bytes;
  asset->mapped_ = file.mapped;
  Result<std::shared_ptr<const Asset>> opened =
      open(std::move(asset), {static_cast<const std::byte*>(file.data), file.bytes});
  if (!opened) return faultOf(path, opened.reason().c_str());
  return opened;
} catch (const std::bad_alloc&) {
  return faultOf(path, "out of memory");
}

Result<std::shared_ptr<const Asset>> Asset::fromMemory(std::span<const std::byte> bytes) try {
  std::shared_ptr<Asset> asset(new Asset);
  asset->memory_ = ::operator new(bytes.size(), std::align_val_t(formats::kSectionAlignment));
  asset->bytes_ = bytes.size();
  std::span<std::byte> copy(static_cast<std::byte*>(asset->memory_), bytes.size());
  std::copy(bytes.begin(), bytes.end(), copy.begin());
  return open(std::move(asset), copy);
} catch (const std::bad_alloc&) {
  return Error{"out of memory"};
}

Result<std::shared_ptr<const Asset>> Asset::inPlace(std::span<const std::byte> bytes,
                                                    std::shared_ptr<const void> owner) try {
  std::shared_ptr<Asset> asset(new Asset);
  asset->owner_ = std::move(owner);
  return open(std::move(asset), bytes);
} catch (const std::bad_alloc&) {
  return Error{"out of memory"};
}

Result<std::shared_ptr<const Asset>> Asset::open(std::shared_ptr<Asset> asset, std::span<const std::byte> bytes) {
  formats::PackageError error = formats::PackageView::open(bytes, asset->view_);
  if (!error.reason.empty()) return Error{std::move(error.reason)};
  formats::Header header;
  std::memcpy(&header, bytes.data(), sizeof header);
  asset->checksum_ = header.checksum;
  asset->constants_ = std::make_unique<const internal::RestConstants>(internal::makeRestConstants(asset->view_));
  return std::shared_ptr<const Asset>(std::move(asset));
}

std::span<const internal::ClusterRest> Asset::clusterConstants() const {
  const auto make = [](const Asset& asset) { asset.lazy_->clusters = internal::makeClusterConstants(asset.view_); };
  makeOnce(lazy_->clusters_made, make, *this);
  return lazy_->clusters;
}

const internal::VisualConstants& Asset::visualConstants() const {
  const auto make = [](const Asset& asset) { asset.lazy_->visual = internal::makeVisualConstants(asset.view_); };
  makeOnce(lazy_->visual_made, make, *this);
  return lazy_->visual;
}

std::span<const Vec3> Asset::restNormals() const {
  return view_.visualNormals().empty() ? std::span<const Vec3>(visualConstants().made_normals) : view_.visualNormals();
}

std::span<const std::array<float, 4>> Asset::restTangents() const {
  const auto make = [](const Asset& asset) {
    asset.lazy_->tangents = internal::makeTangents(asset.view_, asset.restNormals());
  };
  makeOnce(lazy_->tangents_made, make, *this);
  return lazy_->tangents;
}

void Asset::prepareDrawing() const { (void)visualConstants(); }

std::uint32_t Asset::levels() const {
  return view_.allFields().empty() ? 1 : std::uint32_t(view_.allFields().back().level) + 1;
}

std::span<const VertexRun> Asset::subMeshVertices(std::uint32_t sub_mesh) const {
  return sub_mesh < view_.subMeshes().size() ? visualConstants().runsOf(sub_mesh) : std::span<const VertexRun>();
}

}  // namespace sinew
