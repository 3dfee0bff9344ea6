// SPDX-License-Identifier: MIT
//
// What a world hands back to be drawn.
#include <algorithm>

#include "runtime/world/world_impl.h"

namespace sinew {

using internal::Body;

namespace {

// Whether a stream can be written; an unwanted one can.
template <class Stream>
bool streamIsSound(const Stream& stream, std::uint32_t least_stride) {
  return stream.data == nullptr || (stream.stride >= least_stride && stream.stride % 4 == 0);
}

// What lies deeper below the ground has not been pressed there. Diagonals.
constexpr float kPressedIn = 0.02F;

bool isSound(const VisualOutput& output) {
  return streamIsSound(output.positions, 12) && streamIsSound(output.normals, 12) &&
         streamIsSound(output.tangents, 16) && streamIsSound(output.previous_positions, 12);
}

}  // namespace

void World::visualVertices(BodyId id, const VisualOutput& output) const {
  const Body* body = impl_->seen(id, "visualVertices", impl_->shown);
  if (body == nullptr) return;
  const VertexRun all = {0, std::uint32_t(body->package().visualPositions().size())};
  impl_->writeVisual("visualVertices", *body, {&all, 1}, output);
}

void World::visualSubMesh(BodyId id, std::uint32_t sub_mesh, const VisualOutput& output) const {
  const Body* body = impl_->seen(id, "visualSubMesh", impl_->shown);
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

void World::Impl::liftFromGround(const Body& body, std::span<const VertexRun> runs, const StridedFloat3& out) const {
  const GroundPlane& ground = settings.ground;
  if (!ground.enabled || out.data == nullptr || !body.solver->touchesGround()) return;
  const Vec3& n = ground.normal;
  const float deepest = kPressedIn * body.package().info().diagonal;
  for (const VertexRun& run : runs) {
    for (std::uint32_t v = run.first; v < std::min(run.first + run.count, out.count); ++v) {
      float* const x = reinterpret_cast<float*>(reinterpret_cast<std::byte*>(out.data) + std::size_t(out.stride) * v);
      const float height = n[0] * x[0] + (n[1] * x[1] + n[2] * x[2]) - ground.offset;
      if (!(height < 0 && height > -deepest)) continue;
      for (std::size_t c = 0; c < 3; ++c) x[c] -= height * n[c];
    }
  }
}

void World::Impl::writeVisual(const char* call, const Body& body, std::span<const VertexRun> runs,
                              const VisualOutput& output) const {
  if (body.package().visualPositions().empty()) return;
  if (!isSound(output)) {
    tell(LogSeverity::error, "%s: a stride must be a multiple of 4 and hold its element (12 bytes; tangents 16)", call);
    return;
  }
  VisualOutput wanted = output;
  const bool copies = wanted.previous_positions.data != nullptr && !body.settings.keep_previous;
  if (copies) wanted.previous_positions.data = nullptr;
  const bool written = guarded(call, false, [&] {
    visual.write(body, runs, wanted, jobs);
    liftFromGround(body, runs, wanted.positions);
    if (copies) {
      VisualOutput again;
      again.positions = output.previous_positions;
      visual.write(body, runs, again, jobs);
    }
    return true;
  });
  if (!written) visual.invalidate();
}

Bounds World::physicalBounds(BodyId id) const {
  Bounds bounds;
  const Body* body = impl_->seen(id, "physicalBounds");
  if (body != nullptr) internal::boundsOf({body->x.data(), body->vertices().size()}, bounds);
  return bounds;
}

Bounds World::visualBounds(BodyId id) const {
  const Body* body = impl_->seen(id, "visualBounds", impl_->shown);
  Bounds bounds;
  if (body == nullptr) return bounds;
  if (body->package().visualPositions().empty()) return physicalBounds(id);
  impl_->guarded("visualBounds", false, [&] { return impl_->visual.bounds(*body, impl_->jobs, bounds); });
  return bounds;
}

}  // namespace sinew
