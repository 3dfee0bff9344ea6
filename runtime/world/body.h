// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <memory_resource>
#include <span>
#include <vector>

#include "runtime/attach/history.h"
#include "runtime/clusters/frame.h"
#include "runtime/clusters/mechanics.h"
#include "runtime/clusters/pin_fit.h"
#include "runtime/clusters/stiffness.h"
#include "runtime/contact/row.h"
#include "runtime/load/rest_constants.h"
#include "runtime/memory/array.h"
#include "runtime/solver/piece.h"
#include "runtime/step/motion.h"
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
  std::uint32_t source = formats::kNone;  ///< element of the package's PSET; none: the game's own
  PinMethod method = PinMethod::constrained_fit;
  RigidTransform at;      ///< where it is in this pass
  RigidTransform target;  ///< where it is at the end of the step
  Array<PinnedVertex> vertices;
  // Reactions of the step's passes; means are taken over `passes`.
  Eigen::Vector3d force_sum = Eigen::Vector3d::Zero(), torque_sum = Eigen::Vector3d::Zero();
  std::uint32_t passes = 0;
  bool first_pass = true;  ///< the next pass is the first of a step

  explicit PinSet(std::pmr::memory_resource* memory) : vertices(memory) {}
  PinSet(PinSet&& other) noexcept = default;
  PinSet& operator=(PinSet&& other) = delete;
  PinSet(const PinSet&) = delete;
  PinSet& operator=(const PinSet&) = delete;
  ~PinSet() = default;
};

/// A spring between a visual vertex and a target.
struct Pick {
  std::uint32_t id;
  std::uint32_t visual_vertex;
  Vec3 target;
  float frequency_hz;
  Vec3 force = {};  ///< of the last pass over the body's mass, m/s²: where the next one starts from
};

/// Vertices of a chunk, at most.
inline constexpr std::uint32_t kVerticesPerChunk = 512;

/// A run of a body's vertices that one job handles; never spans two parts. Its bounds depend on the package only, so
/// sums over chunks come out the same for any number of threads.
struct VertexChunk {
  std::uint32_t part;  ///< into Body::parts
  std::uint32_t begin, end;
  std::uint32_t first_use_block;  ///< into RestConstants::use_blocks
  std::uint32_t repaired = 0;
  std::array<double, 7> center = {};  ///< scratch: mass, Σ m x, Σ m v
  MotionLanes sums = {};              ///< scratch
};

/// One separate part (BODY record) of a body, with what a pass finds of it.
struct Part {
  /// How far the rows of a pass are from where they ask the part to be.
  struct Pull {
    Vector3 held = Vector3::Zero();    ///< Σ of the errors of what is held, metres
    float holds = 0;                   ///< how many those are
    float farthest = 0;                ///< of those, metres
    Vector3 normal = Vector3::Zero();  ///< of the deepest contact
    float depth = 0;                   ///< of it, metres
  };

  std::uint32_t first_vertex = 0, vertex_count = 0;
  std::uint32_t first_chunk = 0, chunk_count = 0;
  std::uint32_t first_cluster = 0, cluster_count = 0;
  /// Centre of mass and its velocity (near them while the part is held). Sums are taken about this moving point, so
  /// that neither distance nor speed costs them digits.
  Eigen::Vector3d reference = Eigen::Vector3d::Zero(), moving = Eigen::Vector3d::Zero();
  /// Angular momentum about the centre over the body's mass, m²/s, that is faster than passes can follow. Between steps
  /// the velocities hold it too.
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();
  MotionSums before;          ///< of the predicted motion: its momentum is to stay
  RigidMotion lacking;        ///< what is to be added after all
  Pull pull;                  ///< of this pass
  RigidMotion found, wanted;  ///< of v = (y - x) / h, and with the momentum that it should have
  bool uneven = false;        ///< its heaviest vertex weighs more than a hundred times its lightest
  float turned_seconds = 0;   ///< for so long some of its neighbouring clusters have been turned against each other
  bool turned = false;        ///< they were in this step
  bool tangled = false;       ///< neighbouring clusters are turned against each other: it goes back as one
  bool free = true;           ///< no row of this pass touches the part
  bool shifted = false;       ///< bringNear() moved it in this pass
  bool stopped = false;       ///< a cluster was stopped by the guard or a limit in this pass
  bool limited = false;       ///< so it was, or the part turned far: its momentum is set right twice
};

/// Memory that begins at a cache line: kernels read and write whole lines of vertices.
class LineMemory : public std::pmr::memory_resource {
 public:
  explicit LineMemory(std::pmr::memory_resource* upstream) : upstream_(upstream) {}

 private:
  static constexpr std::size_t kLine = 64;
  void* do_allocate(std::size_t bytes, std::size_t alignment) override {
    return upstream_->allocate(bytes, std::max(alignment, kLine));
  }
  void do_deallocate(void* place, std::size_t bytes, std::size_t alignment) override {
    upstream_->deallocate(place, bytes, std::max(alignment, kLine));
  }
  bool do_is_equal(const std::pmr::memory_resource& other) const noexcept override { return this == &other; }

  std::pmr::memory_resource* upstream_;
};

/// What a pass writes and nobody reads after it: lent to a body by its world, so that many bodies share it, in cache.
struct PassScratch {
  /// \param lines for arrays that kernels read in whole lines; outlives this.
  explicit PassScratch(LineMemory* lines) : y(lines), slots(lines) {}

  /// Grows to what a body of so many vertices and blocks of eight members needs.
  void reserve(std::size_t vertices, std::size_t member_blocks) {
    if (y.size() <= vertices) y.resize(vertices + 1);
    if (slots.size() <= 8 * member_blocks) slots.resize(8 * member_blocks + 1);
  }

  Array<Vec3> y;
  Array<std::array<float, 4>> slots;
};

/// State of one body. Constants stay in the asset.
struct Body {
  /// At rest at its place; reset() is due before anything else is asked of it.
  /// \param memory all that the body keeps comes from there.
  Body(std::shared_ptr<const Asset> source, const BodySettings& body_settings, std::shared_ptr<StiffnessSet> shared,
       std::pmr::memory_resource* memory);

  /// Takes a scratch, reserved for it, until giveBack().
  void take(PassScratch& scratch);
  void giveBack();

  /// The part that a vertex belongs to.
  Part& partOf(std::uint32_t vertex);

  const formats::PackageView& package() const { return asset->package(); }
  const RestConstants& rest() const { return asset->constants(); }
  std::span<const formats::PhysicalVertex> vertices() const { return package().physicalVertices(); }
  std::uint32_t vertexCount() const { return std::uint32_t(vertices().size()); }
  std::uint32_t clusterCount() const { return std::uint32_t(package().clusters().size()); }

  /// Back to the rest shape at the place it was added; nothing held but by its pin sets. \param scratch reserved for
  /// this body.
  void reset(PassScratch& scratch);
  /// Whether no vertex can be put right by what its clusters want: some of them are nowhere themselves.
  bool isLost() const;
  /// A lost body: at rest at the place it was added; what holds it stays. \param scratch reserved for this body.
  void recover(PassScratch& scratch);
  /// Matches every cluster to the current positions (R, and F as the match sees them), as after a new state was set.
  /// \param scratch reserved for this body.
  void matchPositions(PassScratch& scratch);
  /// Keeps what a cluster's goals deform, for its own damping in the next pass (docs/method.md eq. 16).
  void rememberDeformation(std::uint32_t cluster);
  /// Where its clusters last wanted a physical vertex: Σ share g, metres.
  Vector3 blendedGoal(std::uint32_t vertex) const;

  std::uint32_t id = 0;  ///< BodyId
  std::shared_ptr<const Asset> asset;
  BodySettings settings;
  LineMemory lines;  ///< where the arrays by vertex and membership live

  // By physical vertex, and one more: kernels read triples as 16 bytes.
  Array<Vec3> x;  ///< positions at the start of the pass, metres
  Array<Vec3> v;  ///< velocities, m/s
  /// Of contact or pin in the last pass, over the body's mass, m/s²: where the next one starts from.
  Array<Vec3> force;
  Array<std::uint8_t> pinned;

  // Lent between take() and giveBack(), empty otherwise.
  std::span<Vec3> y;  ///< predicted, then matched positions; one more, as x
  /// By membership, padded: what its cluster asks of a vertex; zero behind the last.
  std::span<std::array<float, 4>> slots;

  Array<ClusterBlock> blocks;  ///< by cluster, eight each

  std::shared_ptr<StiffnessSet> stiffness;  ///< shared by the bodies of a world with the same asset and scale

  Array<Pin> pins;  ///< vertices ascending
  Array<Pick> picks;
  OwningArray<PinSet> pin_sets;
  OwningArray<PinFit> fits;     ///< clusters that a pin set reaches, ascending
  Array<std::uint32_t> fit_of;  ///< cluster -> fits, formats::kNone; empty without fits
  MechanicsState mechanics;

  // The body's work, cut for jobs.
  Array<VertexChunk> chunks;
  Array<Part> parts;
  bool centers_known = false;  ///< Part::reference and moving are those of x and v; not after a state from outside
  float pass_seconds = 0;      ///< length of the passes of the last step: spins are looked at for it

  /// Of a body that moves in fields (sections FELD): its pieces, in the package's order. x and v are made from their
  /// coefficients when somebody asks.
  OwningArray<Piece> pieces;
  bool outdated = false;         ///< x and v are not those of the pieces
  bool frames_outdated = false;  ///< blocks are not those of x
  Array<float> coefficients, field_values;
  Array<Vector3d> residuals;

  // Scratch of the solver of rows: lent by the world for the time of a step, empty otherwise.
  Array<Row> rows;
  Array<ClusterFrame> frames;  ///< copies of the clusters that rows reach
  Array<ClusterResponse> responses;
  Array<SolverRow> solver_rows;  ///< `rows` as the sweeps see them
  Array<RowTerm> terms;
  Array<ClusterAnswer> answers;  ///< by cluster

  std::uint32_t repaired = 0;  ///< vertices whose state was not finite in the last step

  History history;  ///< for motion vectors

 private:
  void placeAtRest(PassScratch& scratch);
};

/// Gives a body back to the memory resource it was made in.
struct BodyRelease {
  std::pmr::memory_resource* memory = nullptr;
  void operator()(Body* body) const {
    body->~Body();
    memory->deallocate(body, sizeof(Body), alignof(Body));
  }
};
using BodyPointer = std::unique_ptr<Body, BodyRelease>;

/// Bodies of a world, ids ascending.
using BodyList = OwningArray<BodyPointer>;

/// Whether a vertex can be stepped: position and velocity finite and below 1e15 m, 1e17 m/s.
bool stateIsUsable(const Vec3& x, const Vec3& v);

}  // namespace sinew::internal
