// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <memory_resource>
#include <mutex>
#include <span>

#include "runtime/kernels/attach_layout.h"
#include "runtime/memory/array.h"
#include "runtime/world/body.h"
#include "sinew/runtime/output.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// Intermediate results of outputs of one body: kept until a body moves or another one is asked for.
class VisualScratch {
 public:
  explicit VisualScratch(std::pmr::memory_resource* memory);

  /// Drops the results. To be called whenever a body changes.
  void invalidate() { body_ = nullptr; }
  bool isOf(const Body& body) const { return body_ == &body; }

  /// Writes runs of visual vertices.
  void write(const Body& body, std::span<const VertexRun> runs, const VisualOutput& output, JobSystem* jobs);

  /// Box around all visual vertices; false where none is finite.
  bool bounds(const Body& body, JobSystem* jobs, Bounds& result);

 private:
  void prepare(const Body& body, bool positions, bool previous, bool normals, bool tangents, JobSystem* jobs);
  void writeRange(const Body& body, const VisualOutput& output, std::uint32_t begin, std::uint32_t end) const;

  const Body* body_ = nullptr;
  bool has_frames_ = false, has_previous_ = false, has_columns_ = false, has_cofactors_ = false, has_gradients_ = false;
  Array<SlotFrame> frames_, previous_frames_;  ///< by slot of the attachment
  Array<ClusterColumns> columns_;              ///< by cluster
  Array<PaddedMatrix> slot_gradients_;         ///< by slot
  Array<PaddedMatrix> cofactors_, gradients_;  ///< by physical vertex
};

/// The scratch of a world's outputs: one for each call that runs at the same time.
class VisualPool {
 public:
  explicit VisualPool(std::pmr::memory_resource* memory) : memory_(memory), first_(memory) {}
  ~VisualPool();
  VisualPool(const VisualPool&) = delete;
  VisualPool& operator=(const VisualPool&) = delete;

  /// To be called whenever a body changes, while no output runs.
  void invalidate();

 private:
  struct Slot {
    explicit Slot(std::pmr::memory_resource* memory) : scratch(memory) {}
    VisualScratch scratch;
    bool taken = false;
    Slot* next = nullptr;
  };

 public:
  /// A scratch for as long as an output runs, with results of its body if there are any.
  class Lease {
   public:
    /// May throw.
    Lease(VisualPool& pool, const Body& body);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    VisualScratch* operator->() const { return &slot_->scratch; }
    /// The scratch holds a whole result; without this call it is forgotten.
    void keep() { whole_ = true; }

   private:
    VisualPool& pool_;
    Slot* slot_ = nullptr;
    bool whole_ = false;
  };

 private:
  std::pmr::memory_resource* memory_;
  std::mutex mutex_;
  Slot first_;  // of a list: one slot for each call that ran at the same time as others
};

/// Notes where a body is, before a step; nothing unless it keeps its history.
void keepHistory(Body& body);

/// A cluster's goal transform as the kernels want it.
ClusterColumns clusterColumns(const Body& body, std::span<const ClusterRest> rest, std::uint32_t cluster);

/// Least and largest coordinates of the positions; false where there are none.
bool boundsOf(std::span<const Vec3> positions, Bounds& result);

}  // namespace sinew::internal
