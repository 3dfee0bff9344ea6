// SPDX-License-Identifier: MIT
//
// The whole of a simulation: load an Asset, add bodies of it to a World, step, read visual vertices.
// samples/hello_runtime shows it in one page.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "sinew/runtime/asset.h"
#include "sinew/runtime/result.h"
#include "sinew/runtime/settings.h"

namespace sinew {

/// Names a body of one world; never reused within it.
struct BodyId {
  std::uint32_t value = 0xffffffffU;
  bool operator==(const BodyId&) const = default;
};

/// Names a pick (a spring between a point of a body and a target).
struct PickId {
  std::uint32_t value = 0xffffffffU;
  bool operator==(const PickId&) const = default;
};

/// Where the caller wants a stream of vectors: `count` elements, `stride` bytes apart (>= 12, a multiple of 4).
struct StridedFloat3 {
  float* data = nullptr;
  std::uint32_t stride = 12;
  std::uint32_t count = 0;
};

/// Bodies that step together. Not thread-safe; different worlds are independent. Same input, same state, bit for bit,
/// for any job system. No call throws but for lack of memory; step() does not allocate after the first one.
class World {
 public:
  explicit World(const WorldSettings& settings = {}, JobSystem* jobs = nullptr);
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  WorldSettings& settings();
  const WorldSettings& settings() const;

  /// Adds an instance of a package, at rest. A package with several separate bodies (BODY) is one Body here; its parts
  /// are matched and fall independently.
  Result<BodyId> addBody(std::shared_ptr<const Asset> asset, const BodySettings& settings = {});
  void removeBody(BodyId body);
  /// Back to the state in which it was added; pins and picks are let go.
  void resetBody(BodyId body);

  const Asset& asset(BodyId body) const;

  /// Advances all bodies. \param seconds step length, > 0 and finite (1e-5 .. 1 s is tested); other values do nothing.
  void step(float seconds);

  /// Positions (metres, world) and velocities (m/s) of the physical vertices, in the package's order.
  std::span<const Vec3> positions(BodyId body) const;
  std::span<const Vec3> velocities(BodyId body) const;
  /// Vertices whose position or velocity was not finite (or beyond 1e15 m, 1e17 m/s) when the last step began. They
  /// were put where their clusters had last wanted them, at rest; the rest of the body is not affected.
  std::uint32_t repairedVertices(BodyId body) const;
  /// Sets the whole state; sizes must equal the vertex count. Velocities may be empty (zero).
  void setState(BodyId body, std::span<const Vec3> positions, std::span<const Vec3> velocities);

  /// Holds a physical vertex at a place until unpinned; call again to move it. \param target metres, world.
  void pin(BodyId body, std::uint32_t vertex, Vec3 target);
  void unpin(BodyId body, std::uint32_t vertex);
  void unpinAll(BodyId body);

  /// Starts pulling the point that visual vertex `visual_vertex` is attached to towards `target`.
  /// \param frequency_hz of the spring for the part of the body it moves; 0.1 .. 100, critically damped.
  PickId pick(BodyId body, std::uint32_t visual_vertex, Vec3 target, float frequency_hz = 4.0F);
  void movePick(PickId pick, Vec3 target);
  void releasePick(PickId pick);

  /// Writes deformed visual positions (metres, world) and unit normals; either may be empty (data == nullptr). Counts
  /// smaller than the mesh write the first vertices only. Normals follow the cofactor of the deformation gradient.
  void visualVertices(BodyId body, StridedFloat3 positions, StridedFloat3 normals) const;

  /// Rigid motion that best maps the rest shape onto the current one (mass-weighted): x ~ rotation * X + translation.
  void rigidMotion(BodyId body, Mat3& rotation, Vec3& translation) const;

  /// Goal transform of a cluster for overlays: its current centre (metres, world) and linear part.
  void clusterFrame(BodyId body, std::uint32_t cluster, Vec3& center, Mat3& linear) const;

  /// Milliseconds per phase of the last step, if WorldSettings::measure_phases asked for it (bodies that were stepped
  /// side by side are left out); names are static strings.
  struct Phase {
    const char* name;
    double milliseconds;
  };
  std::span<const Phase> lastStepPhases() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sinew
