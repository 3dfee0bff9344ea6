// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "sinew/formats/package.h"
#include "sinew/runtime/result.h"

namespace sinew {

namespace internal {
struct RestConstants;
}

/// A loaded package: the constants that all bodies made from it share. Immutable, so safe to use from many threads.
class Asset {
 public:
  /// Opens and checks a package file (memory-mapped, used in place). The reason names the file and the fault.
  static Result<std::shared_ptr<const Asset>> load(const std::string& path);

  /// The same from memory; copies only when `bytes` is not 64-byte aligned, else `bytes` must outlive the asset.
  static Result<std::shared_ptr<const Asset>> fromMemory(std::span<const std::byte> bytes);

  const formats::PackageView& package() const { return view_; }

  /// For the runtime itself: constants made at load.
  const internal::RestConstants& constants() const { return *constants_; }

  ~Asset();
  Asset(const Asset&) = delete;
  Asset& operator=(const Asset&) = delete;

 private:
  Asset();
  static Result<std::shared_ptr<const Asset>> open(std::shared_ptr<Asset> asset, std::span<const std::byte> bytes,
                                                   const std::string& prefix);
  formats::PackageView view_;
  void* memory_ = nullptr;  // mapped or owned bytes, released by the destructor
  std::size_t bytes_ = 0;
  std::unique_ptr<const internal::RestConstants> constants_;
  bool mapped_ = false;
};

}  // namespace sinew
