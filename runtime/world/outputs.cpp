// SPDX-License-Identifier: MIT
//
// Outputs of a world, to be drawn.
#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <new>

#include "runtime/contact/firmness.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/kernels/kernels.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::Body;

namespace {

// Whether a stream can be written; an unwanted one can.
template <class Stream>
bool streamIsSound(const Stream& stream, std::uint32_t least_stride) {
  return stream.data == nullptr || (stream.stride >= least_stride && stream.stride % 4 == 0);
}

// Marks the bodies that a call draws, so that none is drawn twice.
class Listed {
 public:
  explicit Listed(std::pmr::memory_resource* memory) : items_(memory) {}
  ~Listed() {
    for (const Item& item : items_) item.body->listed = false;
  }
  Listed(const Listed&) = delete;
  Listed& operator=(const Listed&) = delete;

  struct Item {
    Body* body;
    const VisualOutput* output;
  };
  const internal::Array<Item>& items() const { return items_; }
  /// False where the body is there, or in the list of another thread. May throw.
  bool add(Body& body, const VisualOutput& output) {
    items_.push_back({&body, &output});
    const bool there = body.listed.exchange(true);
    if (there) items_.truncate(items_.size() - 1);
    return !there;
  }

 private:
  internal::Array<Item> items_;
};

VertexRun allOf(const Body& body) { return {0, std::uint32_t(body.package().visualPositions().size())}; }

// Numbers of the vertices that may lie in a collider, by runs: those below a plane, or below the top of its box, with
// what floats round. May throw.
class Below {
 public:
  Below(const internal::Collider& collider, const internal::Pose& pose, const Body& body, const StridedFloat3& places,
        std::pmr::memory_resource* memory)
      : places_{reinterpret_cast<std::byte*>(places.data), places.stride}, found_(memory) {
    const bool plane = collider.shape.isPlane();
    const Eigen::Vector3d up =
        plane ? Eigen::Vector3d(pose.rotation * collider.shape.half()) : Eigen::Vector3d::UnitY();
    const double level = plane ? collider.shape.radius() + up.dot(pose.position) : collider.bounds().max()[1];
    // Of the body, not of the places: a sub-mesh leaves the caller's first ones as they are.
    const double far = std::abs(level) + Eigen::Map<const Eigen::Vector3f>(body.x[0].data()).cast<double>().lpNorm<1>();
    const double size = 2 * double(body.package().info().diagonal);
    plane_ = {float(up[0]), float(up[1]), float(up[2]), float(level + kRounding * (far + size))};
  }

  std::span<const std::uint32_t> in(std::uint32_t begin, std::uint32_t end) {
    found_.resize(end > begin ? end - begin : 0);
    if (found_.empty()) return {};
    return {found_.data(), internal::kernels().attach.below(places_, begin, end, plane_.data(), found_.data())};
  }

 private:
  static constexpr double kRounding = 1e-6;  // of a place's coordinates
  internal::OutputStream places_;
  std::array<float, 4> plane_;
  internal::Array<std::uint32_t> found_;
};

// Contact points are some of the surface: what lies between them is deeper by no more than what rests is.
double pressedInto(const Body& body, std::uint32_t collider) {
  float depth = 0;
  for (const internal::Piece& piece : body.pieces) {
    for (const internal::TouchingPoint& point : piece.state.touching) {
      if (point.collider == collider) depth = std::max(depth, point.depth);
    }
  }
  return double(depth) + internal::kPressedIn * double(body.package().info().diagonal);
}

/// Of the body's points that touch a collider the one nearest to a place; null: none. All in its coordinates.
const internal::TouchingPoint* touchingNear(const Body& body, std::uint32_t collider, const Eigen::Vector3d& place) {
  const internal::TouchingPoint* nearest = nullptr;
  double least2 = std::numeric_limits<double>::infinity();
  for (const internal::Piece& piece : body.pieces) {
    for (const internal::TouchingPoint& point : piece.state.touching) {
      if (point.collider != collider || point.point >= internal::kColliderPoint) continue;
      const double apart2 = (Eigen::Map<const Eigen::Vector3d>(point.anchor.data()) - place).squaredNorm();
      if (apart2 < least2) nearest = &point, least2 = apart2;
    }
  }
  return nearest;
}

}  // namespace

void World::visualVertices(BodyId id, const VisualOutput& output) const {
  const Impl::Presence presence(*impl_, "visualVertices", Impl::As::draws);
  const Body* body = presence.seen(id);
  if (body == nullptr) return;
  const VertexRun all = allOf(*body);
  impl_->writeVisual("visualVertices", *body, {&all, 1}, output);
}

void World::visualVertices(std::span<const BodyOutput> outputs) const {
  constexpr const char* kCall = "visualVertices";
  const Impl::Presence presence(*impl_, kCall, Impl::As::draws);
  if (!presence) return;
  impl_->guarded(kCall, false, [&] {
    Listed listed(impl_->memory);
    for (const BodyOutput& each : outputs) {
      Body* body = presence.find(each.body);
      if (body == nullptr || !impl_->isSound(kCall, each.output)) continue;
      if (!listed.add(*body, each.output)) {
        impl_->tell(LogSeverity::error,
                    "%s: body %u is given twice, or in the list of another thread; its first output is written", kCall,
                    body->id);
      }
    }
    const std::uint32_t count = std::uint32_t(listed.items().size());
    JobSystem* const outer = count > 1 ? impl_->jobs : nullptr;
    std::atomic<bool> failed{false};
    const auto work = [&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t i = begin; i < end; ++i) {
        const Listed::Item& item = listed.items()[i];
        try {
          impl_->showDrawn(*item.body);
          const VertexRun all = allOf(*item.body);
          impl_->draw(*item.body, {&all, 1}, *item.output, outer == nullptr ? impl_->jobs : nullptr);
        } catch (...) {
          failed = true;
        }
      }
    };
    if (outer == nullptr) {
      work(0, count);
    } else {
      outer->parallelFor(count, 1, work);
    }
    if (failed) throw std::bad_alloc();
    return true;
  });
}

void World::visualSubMesh(BodyId id, std::uint32_t sub_mesh, const VisualOutput& output) const {
  const Impl::Presence presence(*impl_, "visualSubMesh", Impl::As::draws);
  const Body* body = presence.seen(id);
  if (body == nullptr) return;
  if (sub_mesh >= body->package().subMeshes().size()) {
    impl_->tell(LogSeverity::error, "visualSubMesh: body %u has no sub-mesh %u", id.value, sub_mesh);
    return;
  }
  impl_->guarded("visualSubMesh", false, [&] {
    impl_->writeVisual("visualSubMesh", *body, body->asset->subMeshVertices(sub_mesh), output);
    return true;
  });
}

void World::Impl::liftFromColliders(const Body& body, std::span<const VertexRun> runs, const StridedFloat3& out) const {
  if (out.data == nullptr) return;
  internal::Array<std::uint32_t> ids(memory);
  findTouched(body, ids);
  for (const std::uint32_t id : ids) {
    const internal::Collider* const collider = colliderOf(id);
    if (collider == nullptr) continue;
    const double deepest = pressedInto(body, id);
    const internal::Pose pose(internal::between(collider->before, collider->at, shown));
    const bool plane = collider->shape.isPlane();
    Below below(*collider, pose, body, out, memory);
    for (const VertexRun& run : runs) {
      for (const std::uint32_t v : below.in(run.first, std::min(run.first + run.count, out.count))) {
        float* const x = reinterpret_cast<float*>(reinterpret_cast<std::byte*>(out.data) + std::size_t(out.stride) * v);
        const Eigen::Vector3d at = Eigen::Map<const Eigen::Vector3f>(x).cast<double>();
        if (!plane && !collider->bounds().contains(at)) continue;
        const Eigen::Vector3d local = pose.toLocal(at);
        internal::NearPlace near = collider->shape.near(local, deepest);
        if (!(near.distance < 0 && near.distance > -deepest)) continue;
        const internal::TouchingPoint* const touch = plane ? nullptr : touchingNear(body, id, local);
        if (touch != nullptr) {
          // Out of the side that the body touches, of a thin shape.
          const Eigen::Map<const Eigen::Vector3d> normal(touch->normal.data()), anchor(touch->anchor.data());
          if (near.normal.dot(normal) < 0) {
            near = {normal.dot(local - anchor) + double(touch->floor - touch->depth), normal};
            if (!(near.distance < 0 && near.distance > -deepest)) continue;
          }
        }
        const Eigen::Vector3d out_of = at - near.distance * (pose.rotation * near.normal);
        for (std::size_t c = 0; c < 3; ++c) x[c] = float(out_of[int(c)]);
      }
    }
  }
}

bool World::Impl::isSound(const char* call, const VisualOutput& output) const {
  if (streamIsSound(output.positions, 12) && streamIsSound(output.normals, 12) && streamIsSound(output.tangents, 16) &&
      streamIsSound(output.previous_positions, 12)) {
    return true;
  }
  tell(LogSeverity::error, "%s: a stride must be a multiple of 4 and hold its element (12 bytes; tangents 16)", call);
  return false;
}

void World::Impl::draw(const Body& body, std::span<const VertexRun> runs, const VisualOutput& output,
                       JobSystem* with) const {
  if (body.package().visualPositions().empty()) return;
  VisualOutput wanted = output;
  const bool copies = wanted.previous_positions.data != nullptr && !body.settings.keep_previous;
  if (copies) wanted.previous_positions.data = nullptr;
  internal::VisualPool::Lease scratch(visual, body);
  scratch->write(body, runs, wanted, with);
  liftFromColliders(body, runs, wanted.positions);
  if (copies) {
    VisualOutput again;
    again.positions = output.previous_positions;
    scratch->write(body, runs, again, with);
  }
  scratch.keep();
}

void World::Impl::writeVisual(const char* call, const Body& body, std::span<const VertexRun> runs,
                              const VisualOutput& output) const {
  if (!isSound(call, output)) return;
  guarded(call, false, [&] {
    draw(body, runs, output, jobs);
    return true;
  });
}

Bounds World::physicalBounds(BodyId id) const {
  Bounds bounds;
  const Impl::Presence presence(*impl_, "physicalBounds", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body != nullptr) internal::boundsOf({body->x.data(), body->vertices().size()}, bounds);
  return bounds;
}

Bounds World::visualBounds(BodyId id) const {
  Bounds bounds;
  {
    const Impl::Presence presence(*impl_, "visualBounds", Impl::As::draws);
    const Body* body = presence.seen(id);
    if (body == nullptr) return bounds;
    if (!body->package().visualPositions().empty()) {
      impl_->guarded("visualBounds", false, [&] {
        internal::VisualPool::Lease scratch(impl_->visual, *body);
        const bool finite = scratch->bounds(*body, impl_->jobs, bounds);
        scratch.keep();
        return finite;
      });
      return bounds;
    }
  }
  return physicalBounds(id);
}

}  // namespace sinew
