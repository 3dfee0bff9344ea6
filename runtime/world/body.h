// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/clusters/frame.h"
#include "runtime/clusters/mechanics.h"
#include "runtime/clusters/pin_fit.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/contact/row.h"
#include "runtime/load/rest_constants.h"
#include "sinew/runtime/asset.h"
#include "sinew/runtime/settings.h"

namespace sinew::internal {

/// A physical vertex held at a place.
struct Pin {
  std::uint32_t vertex;
  Vec3 target;  ///< metres, world
};

/// A vertex of a pin set.
struct PinnedVertex {
  std::uint32_t vertex;
  float weight;     ///< 0..1; 1 = exact
  Vec3 local = {};  ///< place in the set's transform, metres
};

/// Vertices attached to a rigid transform.
struct PinSet {
  std::uint32_t id = 0;
  PinMethod method = PinMethod::constrained_fit;
  RigidTransform at;      ///< where it is in this pass
  RigidTransform target;  ///< where it is at the end of the step
  std::vector<PinnedVertex> vertices;
  // Reactions of the step's passes; means are taken over `passes`.
  Eigen::Vector3d force_sum = Eigen::Vector3d::Zero(), torque_sum = Eigen::Vector3d::Zero();
  std::uint32_t passes = 0;
  bool first_pass = true;  ///< the next pass is the first of a step
};

/// A spring between a visual vertex and a target.
struct Pick {
  std::uint32_t id;
  std::uint32_t visual_vertex;
  Vec3 target;
  float frequency_hz;
  Vec3 force = {};  ///< of the last pass, N: where the next one starts from
};

/// State of one body. Constants stay in the asset.
struct Body {
  Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings);

  const formats::PackageView& package() const { return asset->package(); }
  const RestConstants& rest() const { return asset->constants(); }
  std::span<const formats::PhysicalVertex> vertices() const { return package().physicalVertices(); }

  /// Back to the rest shape at the place it was added; nothing held.
  void reset();
  /// Matches every cluster to the current positions (R, and F as the match sees them), as after a new state was set.
  void matchPositions();

  std::shared_ptr<const Asset> asset;
  BodySettings settings;

  // By physical vertex.
  std::vector<Vec3> x;      ///< positions at the start of the pass, metres
  std::vector<Vec3> v;      ///< velocities, m/s
  std::vector<Vec3> y;      ///< predicted, then matched positions
  std::vector<Vec3> force;  ///< of contact or pin in the last pass, N: where the next one starts from
  std::vector<std::uint8_t> pinned;

  // By cluster.
  std::vector<ClusterFrame> frames;
  std::vector<ClusterStiffness> stiffness;
  float stiffness_step = 0;  ///< pass length that `stiffness` holds for, s; 0 = none yet

  std::vector<Pin> pins;  ///< vertices ascending
  std::vector<Pick> picks;
  std::vector<PinSet> pin_sets;
  std::vector<PinFit> fits;           ///< clusters that a pin set reaches, ascending
  std::vector<std::uint32_t> fit_of;  ///< cluster -> fits, formats::kNone; empty without fits
  MechanicsState mechanics;

  // Scratch of the constraint solver, sized once for the worst case so that a step never allocates.
  std::vector<Row> rows;
  std::vector<ClusterResponse> responses;

  std::uint32_t repaired = 0;  ///< vertices whose state was not finite in the last step

  // Scratch of the attachment: cofactors of the deformation gradient by physical vertex, valid if `fresh`.
  mutable std::vector<Matrix3> cofactors;
  mutable bool cofactors_fresh = false;
};

}  // namespace sinew::internal
