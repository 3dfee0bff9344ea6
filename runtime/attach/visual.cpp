// SPDX-License-Identifier: MIT
#include "runtime/attach/visual.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "runtime/attach/cluster_frames.h"
#include "runtime/attach/visual_constants.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

// Elements a job is worth: about ten microseconds each.
constexpr std::uint32_t kVisualGrain = 4096, kPhysicalGrain = 1024, kClusterGrain = 4;

// The records of a package as kernels know them: same bytes, other names.
static_assert(sizeof(BlendTerm) == sizeof(formats::ClusterAttachment));
static_assert(sizeof(BlendRun) == sizeof(formats::ClusterAttachmentRange));
static_assert(sizeof(formats::PhysicalVertex) == 4 * sizeof(float) && sizeof(Vec3) == 3 * sizeof(float));

template <class Work>
void parallel(JobSystem* jobs, std::uint32_t count, std::uint32_t grain, const Work& work) {
  if (jobs == nullptr || count <= grain) {
    if (count > 0) work(0U, count);
    return;
  }
  jobs->parallelFor(count, grain, [&work](std::uint32_t begin, std::uint32_t end) { work(begin, end); });
}

template <class Stream>
OutputStream asOutput(const Stream& stream) {
  return {reinterpret_cast<std::byte*>(stream.data), stream.stride};
}

void fillFrames(const Body& body, std::span<const Vec3> positions, Array<SlotFrame>& frames, JobSystem* jobs) {
  const VisualConstants& visual = body.asset->visualConstants();
  frames.resize(visual.corners.size());
  parallel(jobs, std::uint32_t(frames.size()), kPhysicalGrain, [&](std::uint32_t begin, std::uint32_t end) {
    kernels().attach.slot_frames(positions.data()->data(), visual.corners.data(), frames.data(), begin, end);
  });
}

bool hangsOnTetrahedra(const Body& body) { return !body.package().barycentric().empty(); }

const float* floats(std::span<const formats::Float3> v) { return v.empty() ? nullptr : v.data()->data(); }

const BlendTerm* terms(std::span<const formats::ClusterAttachment> v) {
  return reinterpret_cast<const BlendTerm*>(v.data());
}

const BlendRun* runsOf(const formats::PackageView& package) {
  return reinterpret_cast<const BlendRun*>(package.clusterAttachmentRanges().data());
}

}  // namespace

ClusterColumns clusterColumns(const Body& body, std::span<const ClusterRest> rest, std::uint32_t index) {
  const formats::Cluster& cluster = body.package().clusters()[index];
  const ClusterFrame frame = fitCluster(body.package(), rest, body.positions(), index);
  ClusterColumns result = {};
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  const int columns = quadratic ? 9 : 3;
  Columns<9> f = Columns<9>::Zero();
  for (int k = 0; k < 3 * columns; ++k) f.data()[k] = cluster.radius * frame.f.data()[k];
  const Vector3 start = frame.center - timesColumn(f, rest[index].mean);
  std::copy(start.data(), start.data() + 3, result.column[0]);
  for (int k = 0; k < columns; ++k) std::copy(f.col(k).data(), f.col(k).data() + 3, result.column[k + 1]);
  std::copy(cluster.rest_center.begin(), cluster.rest_center.end(), result.center);
  result.inverse_radius = 1.0F / cluster.radius;
  result.quadratic = quadratic ? 1 : 0;
  return result;
}

void keepHistory(Body& body) {
  if (!body.settings.keep_previous) return;
  History& history = body.history;
  history.positions.resize(body.vertices().size());
  std::copy_n(body.x.begin(), history.positions.size(), history.positions.begin());
  if (body.package().visualPositions().empty() || hangsOnTetrahedra(body)) return;
  const std::span<const ClusterRest> rest = body.asset->clusterConstants();
  history.columns.resize(rest.size());
  for (std::uint32_t c = 0; c < history.columns.size(); ++c) history.columns[c] = clusterColumns(body, rest, c);
}

bool boundsOf(std::span<const Vec3> positions, Bounds& result) {
  constexpr float huge = std::numeric_limits<float>::max();
  result = {{huge, huge, huge}, {-huge, -huge, -huge}};
  if (!positions.empty()) {
    kernels().attach.bounds(positions.data()->data(), std::uint32_t(positions.size()), result.low.data(),
                            result.high.data());
  }
  if (result.low[0] <= result.high[0]) return true;
  result = {};
  return false;
}

VisualScratch::VisualScratch(std::pmr::memory_resource* memory)
    : frames_(memory),
      previous_frames_(memory),
      columns_(memory),
      slot_gradients_(memory),
      cofactors_(memory),
      gradients_(memory) {}

void VisualScratch::prepare(const Body& body, bool positions, bool previous, bool normals, bool tangents,
                            JobSystem* jobs) {
  if (body_ != &body) {
    body_ = &body;
    has_frames_ = has_previous_ = has_columns_ = has_cofactors_ = has_gradients_ = false;
  }
  const formats::PackageView& package = body.package();
  const std::uint32_t vertex_count = std::uint32_t(package.physicalVertices().size());
  const bool tetrahedra = hangsOnTetrahedra(body), directions = normals || tangents;
  if (tetrahedra && (positions || directions) && !has_frames_) {
    fillFrames(body, body.positions(), frames_, jobs);
    has_frames_ = true;
  }
  if (tetrahedra && previous && !has_previous_) {
    fillFrames(body, body.history.positions, previous_frames_, jobs);
    has_previous_ = true;
  }
  if (!tetrahedra && !has_columns_) {
    const std::span<const ClusterRest> rest = body.asset->clusterConstants();
    columns_.resize(rest.size());
    parallel(jobs, std::uint32_t(columns_.size()), kClusterGrain, [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t c = begin; c < end; ++c) columns_[c] = clusterColumns(body, rest, c);
    });
    has_columns_ = true;
  }
  if (!tetrahedra) return;
  const bool cofactors = directions && !has_cofactors_, gradients = tangents && !has_gradients_;
  if (!cofactors && !gradients) return;
  const VisualConstants& visual = body.asset->visualConstants();
  slot_gradients_.resize(visual.inverses.size());
  parallel(jobs, std::uint32_t(visual.inverses.size()), kPhysicalGrain, [&](std::uint32_t begin, std::uint32_t end) {
    kernels().attach.slot_gradients(frames_.data(), visual.inverses.data(), slot_gradients_.data(), begin, end);
  });
  if (cofactors) cofactors_.resize(vertex_count);
  if (gradients) gradients_.resize(vertex_count);
  parallel(jobs, vertex_count, kPhysicalGrain, [&](std::uint32_t begin, std::uint32_t end) {
    kernels().attach.gradients(visual.slots_at.data(), visual.slot_terms.data(), slot_gradients_.data(),
                               gradients ? gradients_.data() : nullptr, cofactors ? cofactors_.data() : nullptr, begin,
                               end);
  });
  has_cofactors_ = true;
  has_gradients_ |= gradients;
}

void VisualScratch::writeRange(const Body& body, const VisualOutput& output, std::uint32_t begin,
                               std::uint32_t end) const {
  const formats::PackageView& package = body.package();
  const AttachKernels& kernel = kernels().attach;
  const auto write_positions = [&](const StridedFloat3& out, const SlotFrame* frames, const ClusterColumns* columns) {
    const std::uint32_t stop = std::min(end, out.count);
    if (out.data == nullptr || begin >= stop) return;
    if (hangsOnTetrahedra(body)) {
      kernel.attached_positions(body.asset->visualConstants().records.data(), frames, begin, stop, asOutput(out));
    } else {
      kernel.blended_positions(floats(package.visualPositions()), runsOf(package), terms(package.clusterAttachments()),
                               columns, begin, stop, asOutput(out));
    }
  };
  write_positions(output.positions, frames_.data(), columns_.data());
  write_positions(output.previous_positions, previous_frames_.data(), body.history.columns.data());

  const auto write_directions = [&](std::uint32_t first, std::uint32_t stop, const OutputStream& normals,
                                    const OutputStream& tangents) {
    if (first >= stop || (normals.data == nullptr && tangents.data == nullptr)) return;
    const float* rest_normals = floats(body.asset->restNormals());
    const float* rest_tangents = tangents.data != nullptr ? body.asset->restTangents().data()->data() : nullptr;
    if (hangsOnTetrahedra(body)) {
      const VisualConstants& visual = body.asset->visualConstants();
      kernel.attached_directions(visual.directionRecords().data(), visual.corners.data(), cofactors_.data(),
                                 gradients_.data(), rest_normals, rest_tangents, first, stop, normals, tangents);
    } else {
      kernel.blended_directions(floats(package.visualPositions()), runsOf(package), terms(package.clusterAttachments()),
                                columns_.data(), rest_normals, rest_tangents, first, stop, normals, tangents);
    }
  };
  // The two streams may end at different vertices.
  const OutputStream normals = asOutput(output.normals), tangents = asOutput(output.tangents), none = {nullptr, 0};
  const std::uint32_t normals_end = normals.data != nullptr ? std::min(end, output.normals.count) : 0;
  const std::uint32_t tangents_end = tangents.data != nullptr ? std::min(end, output.tangents.count) : 0;
  const std::uint32_t both_end = std::max(begin, std::min(normals_end, tangents_end));
  write_directions(begin, both_end, normals, tangents);
  write_directions(both_end, normals_end, normals, none);
  write_directions(both_end, tangents_end, none, tangents);
}

void VisualScratch::write(const Body& body, std::span<const VertexRun> runs, const VisualOutput& output,
                          JobSystem* jobs) {
  const bool positions = output.positions.data != nullptr, previous = output.previous_positions.data != nullptr;
  const bool normals = output.normals.data != nullptr, tangents = output.tangents.data != nullptr;
  if (!positions && !previous && !normals && !tangents) return;
  prepare(body, positions, previous, normals, tangents, jobs);
  if (tangents) static_cast<void>(body.asset->restTangents());  // made here, not by the first job
  for (const VertexRun& run : runs) {
    parallel(jobs, run.count, kVisualGrain, [&](std::uint32_t begin, std::uint32_t end) {
      writeRange(body, output, run.first + begin, run.first + end);
    });
  }
}

VisualPool::~VisualPool() {
  for (Slot* slot = first_.next; slot != nullptr;) {
    Slot* const next = slot->next;
    slot->~Slot();
    memory_->deallocate(slot, sizeof(Slot), alignof(Slot));
    slot = next;
  }
}

void VisualPool::invalidate() {
  for (Slot* slot = &first_; slot != nullptr; slot = slot->next) slot->scratch.invalidate();
}

VisualPool::Lease::Lease(VisualPool& pool, const Body& body) : pool_(pool) {
  const std::lock_guard lock(pool.mutex_);
  for (Slot* slot = &pool.first_; slot != nullptr; slot = slot->next) {
    if (slot->taken) continue;
    if (slot_ == nullptr || slot->scratch.isOf(body)) slot_ = slot;
  }
  if (slot_ == nullptr) {
    slot_ = new (pool.memory_->allocate(sizeof(Slot), alignof(Slot))) Slot(pool.memory_);
    slot_->next = std::exchange(pool.first_.next, slot_);
  }
  slot_->taken = true;
}

VisualPool::Lease::~Lease() {
  const std::lock_guard lock(pool_.mutex_);
  if (!whole_) slot_->scratch.invalidate();
  slot_->taken = false;
}

bool VisualScratch::bounds(const Body& body, JobSystem* jobs, Bounds& result) {
  prepare(body, true, false, false, false, jobs);
  constexpr std::uint32_t kBatch = 256;
  std::array<Vec3, kBatch> batch;
  constexpr float huge = std::numeric_limits<float>::max();
  result = {{huge, huge, huge}, {-huge, -huge, -huge}};
  const std::uint32_t count = std::uint32_t(body.package().visualPositions().size());
  for (std::uint32_t begin = 0; begin < count; begin += kBatch) {
    const std::uint32_t end = std::min(count, begin + kBatch);
    // Inputs shifted instead of the output: element 0 of the batch is vertex `begin`.
    const OutputStream out = {reinterpret_cast<std::byte*>(batch.data()), sizeof(Vec3)};
    const formats::PackageView& package = body.package();
    if (hangsOnTetrahedra(body)) {
      const AttachmentRecord* records = body.asset->visualConstants().records.data() + begin;
      kernels().attach.attached_positions(records, frames_.data(), 0, end - begin, out);
    } else {
      kernels().attach.blended_positions(floats(package.visualPositions()) + 3 * std::size_t(begin),
                                         runsOf(package) + begin, terms(package.clusterAttachments()), columns_.data(),
                                         0, end - begin, out);
    }
    kernels().attach.bounds(batch[0].data(), end - begin, result.low.data(), result.high.data());
  }
  if (result.low[0] <= result.high[0]) return true;
  result = {};
  return false;
}

}  // namespace sinew::internal
