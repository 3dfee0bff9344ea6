// SPDX-License-Identifier: MIT
//
// Bodies that move in fields, one energy for each piece (docs/method.md).
#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/contact/contacts.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/solver/holds.h"
#include "runtime/solver/plasticity.h"
#include "runtime/solver/springs.h"
#include "runtime/step/body_state.h"
#include "runtime/step/rigid.h"
#include "runtime/step/world_step.h"
#include "runtime/world/body.h"

namespace sinew::internal {
namespace {

constexpr std::uint32_t kHeld = 1, kLeaning = 2, kStays = 4, kRests = 8;  ///< of SavedPiece::flags

/// A PieceState without its arrays, which follow: z, v, z_before, v_before, z_rest, touching, plastic, pairs.
struct SavedPiece {
  std::uint32_t flags, functions, touching, plastic;
  std::uint64_t level;
  double h_before, elastic, budget, lost;
  std::array<double, 3> turn, omega, rebound;
  double pairs_h;
  std::uint64_t pairs;
};

std::size_t arrayBytes(const SavedPiece& saved) {
  return PieceState::kVectors * std::size_t(saved.functions) * sizeof(Vector3d) +
         saved.touching * sizeof(TouchingPoint) + saved.plastic * sizeof(float) +
         saved.pairs * Pairs::savedBytes(4 * saved.functions);
}

/// Pairs that the next step may use.
std::uint32_t pairsOf(const PieceState& state) {
  return state.h_before > 0 && state.pairs.fresh() ? state.pairs.count() : 0;
}

SavedPiece savedOf(const Piece& piece) {
  const PieceState& state = piece.state;
  SavedPiece saved = {(state.held ? kHeld : 0U) | (state.leaning ? kLeaning : 0U) | (state.stays ? kStays : 0U) |
                          (state.rests ? kRests : 0U),
                      std::uint32_t(state.z.size()),
                      std::uint32_t(state.touching.size()),
                      std::uint32_t(state.plastic.size()),
                      piece.free->level,
                      state.h_before,
                      state.elastic,
                      state.budget,
                      state.lost,
                      {state.turn[0], state.turn[1], state.turn[2]},
                      {state.omega[0], state.omega[1], state.omega[2]},
                      {state.rebound[0], state.rebound[1], state.rebound[2]},
                      0,
                      pairsOf(state)};
  if (saved.pairs > 0) saved.pairs_h = state.pairs_h;
  return saved;
}

class CoupledSolver final : public BodySolver {
 public:
  CoupledSolver(Body& body, std::pmr::memory_resource* memory) : body_(body) {
    std::uint32_t most_functions = 0, most_vertices = 0, most_modes = 0;
    for (std::uint32_t p = 0; p < body.package().pieces().size(); ++p) {
      const Field *const free = fieldOf(body.rest().fields, p, false), *const fixed =
                                                                           fieldOf(body.rest().fields, p, true);
      Piece& piece = body.pieces.emplace_back(free, fixed, memory);
      const std::size_t k = std::max(free->k, fixed != nullptr ? fixed->k : 0U);
      for (Array<Vector3d>* array : piece.state.vectors()) {
        array->reserve(k);
      }
      piece.state.touching.reserve(kMostContacts);
      piece.system.points.reserve(kMostContacts);
      piece.system.factor.reserve(3 * k * (3 * k + 7));
      piece.state.pairs.reserve(4 * k);
      piece.springs.reserve(k * k);
      if (!free->fibres.empty() || (fixed != nullptr && !fixed->fibres.empty())) {
        piece.fibres.reserve(k * k);
        piece.fibre_pull.reserve(4 * k);
      }
      piece.row.reserve(k);
      findReach(*free, piece.reach_free);
      if (fixed != nullptr) findReach(*fixed, piece.reach_fixed);
      most_functions = std::max(most_functions, std::uint32_t(k));
      most_vertices = std::max(most_vertices, free->vertex_count);
      most_modes = std::max(most_modes, free->residual_modes);
    }
    for (Piece& piece : body.pieces) {
      if (levelOf(body) > 0) useLevel(body, piece, levelOf(body));
    }
    body.shape.reserve(most_functions);
    body.amplitudes.reserve(most_modes);
    body.coefficients.reserve(4 * std::size_t(most_functions));
    body.field_values.reserve(24 * ((std::size_t(most_vertices) + 7) / 8));
  }

  void reserve(SolverScratch& scratch) const override {
    for (Piece& piece : body_.pieces) {
      if (piece.springs_firm < 0) reserveHolds(body_, piece);
      scratch.pieces.reserve(piece);
    }
  }
  void rest() override {
    body_.fade_left = body_.fade_before = 0;
    chooseFields(body_);
    updateFibres(body_);
    makeFibres(body_);
    for (Piece& piece : body_.pieces) restPiece(body_, piece);
    body_.setCurrent();
  }
  void step(const StepWorld& world, double seconds, SolverScratch& scratch) override {
    stepPieces(body_, world, seconds, scratch.pieces);
  }
  void refresh(double part, Asked what) override { internal::refresh(body_, part, what); }
  void beginStep(double seconds) override {
    if (!body_.pieces.empty() && body_.pieces[0].free->level != levelOf(body_)) changeLevel(body_);
    passFade(body_, seconds);
    makeFibres(body_);
  }
  void takeState() override {
    body_.fade_left = body_.fade_before = 0;
    project(body_);
    internal::refresh(body_, 1, Asked::all);
  }
  void holdsChanged() override {
    endFade(body_);
    if (chooseFields(body_)) project(body_);
    // A two-step formula does not reach across what came or went: it would keep a part of its force.
    for (Piece& piece : body_.pieces) piece.state.h_before = 0;
  }
  void activationChanged() override { updateFibres(body_); }
  Eigen::Matrix3f restShape(std::uint32_t cluster) const override {
    const formats::PackageView& package = body_.package();
    if (package.mechanics().empty()) return Eigen::Matrix3f::Identity();
    const Piece& piece = body_.pieces[package.clusters()[cluster].piece];
    const formats::ClusterMechanics& mechanics = package.mechanics()[cluster];
    const float active = mechanics.channel == formats::kNone ? 0.0F : body_.activation[mechanics.channel];
    return activationStretch(mechanics, active) * plasticShapeOf(piece.field(), cluster, piece.state.plastic);
  }
  BodyEnergy energy(SolverScratch& scratch) override {
    makeFibres(body_);
    return {kineticEnergy(body_), elasticEnergy(body_, scratch.pieces)};
  }

  void push(const PickedPoint& point, const Vector3d& impulse) override {
    const double whole = double(body_.package().info().total_mass);
    change([&](const Field& field, std::uint32_t j, const Vector3d&) {
      const double part = point.weight[0] != 0 ? valueAt(field, point, j) : field.oneOf(j) / whole;
      return Vector3d(part * impulse);
    });
  }

  WholeMotion motion() const override {
    WholeMotion whole;
    for (const Piece& piece : body_.pieces) {
      whole.mass += piece.field().mass;
      whole.center += piece.field().mass * meanOf(piece.field(), piece.z());
      whole.velocity += piece.field().mass * meanOf(piece.field(), piece.v());
    }
    whole.center /= whole.mass;
    whole.velocity /= whole.mass;
    Matrix3d inertia = Matrix3d::Zero();
    Vector3d spin = Vector3d::Zero();
    for (const Piece& piece : body_.pieces) {
      inertia += inertiaOf(piece.field(), piece.z(), whole.center);
      spin += angularMomentum(piece.field(), piece.z(), piece.v(), whole.center, whole.velocity);
    }
    whole.angular_velocity = solved(inertia, spin);
    return whole;
  }

  void addMotion(const Vector3d& linear, const Vector3d& angular, const Vector3d& about) override {
    change([&](const Field& field, std::uint32_t j, const Vector3d& z) {
      const double one = field.oneOf(j);
      return Vector3d(one * linear + angular.cross(Vector3d(z - one * about)));
    });
  }

  void move(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation) override {
    for (Piece& piece : body_.pieces) {
      PieceState& state = piece.state;
      for (std::uint32_t j = 0; j < state.z.size(); ++j) {
        const double one = piece.field().oneOf(j);
        for (auto* array : {&state.z, &state.z_before, &state.z_rest}) {
          (*array)[j] = rotation * (*array)[j] + one * translation;
        }
        for (auto* array : {&state.v, &state.v_before}) (*array)[j] = rotation * (*array)[j];
      }
      state.turn = rotation * state.turn;
      state.omega = rotation * state.omega;
      state.rebound = rotation * state.rebound;
      for (TouchingPoint& point : state.touching) {
        if (point.collider != kGroundCollider.value) continue;  // theirs go with the colliders
        Eigen::Map<Eigen::Vector3d> anchor(point.anchor.data());
        anchor = rotation * anchor + translation;
      }
    }
    body_.outdated = true;
  }

  std::size_t stateBytes() const override {
    std::size_t bytes = 0;
    for (const Piece& piece : body_.pieces) {
      bytes += sizeof(SavedPiece) + arrayBytes(savedOf(piece));
    }
    return bytes;
  }

  void save(std::span<std::byte> bytes) const override {
    std::byte* at = bytes.data();
    const auto put = [&at](const void* from, std::size_t size) {
      if (size > 0) std::memcpy(at, from, size);
      at += size;
    };
    for (const Piece& piece : body_.pieces) {
      const PieceState& state = piece.state;
      const SavedPiece saved = savedOf(piece);
      put(&saved, sizeof saved);
      for (const auto* array : state.vectors()) {
        put(array->data(), array->size() * sizeof(Vector3d));
      }
      put(state.touching.data(), state.touching.size() * sizeof(TouchingPoint));
      put(state.plastic.data(), state.plastic.size() * sizeof(float));
      state.pairs.save(std::uint32_t(saved.pairs), at);
      at += saved.pairs * Pairs::savedBytes(4 * saved.functions);
    }
  }

  bool accepts(std::span<const std::byte> bytes) const override {
    for (const Piece& piece : body_.pieces) {
      SavedPiece saved;
      if (bytes.size() < sizeof saved) return false;
      std::memcpy(&saved, bytes.data(), sizeof saved);
      const auto level = std::uint32_t(std::min<std::uint64_t>(saved.level, formats::kNone));
      const Field* const field = fieldOf(body_.rest().fields, piece.free->piece, (saved.flags & kHeld) != 0, level);
      if (field == nullptr || saved.functions != field->k || saved.touching > mostTouching(*field) ||
          saved.flags > (kHeld | kLeaning | kStays | kRests) ||
          saved.plastic != (field->plastic ? 72 * field->pack_count : 0) ||
          !(saved.h_before >= 0 && std::isfinite(saved.h_before)) || saved.pairs > PieceState::kPairs ||
          (saved.pairs > 0 && !(saved.pairs_h > 0)) || bytes.size() - sizeof saved < arrayBytes(saved)) {
        return false;
      }
      const std::byte* at =
          bytes.data() + sizeof saved + PieceState::kVectors * std::size_t(saved.functions) * sizeof(Vector3d);
      std::uint64_t next = 0;
      for (std::uint32_t t = 0; t < saved.touching; ++t, at += sizeof(TouchingPoint)) {
        TouchingPoint point;
        std::memcpy(&point, at, sizeof point);
        const std::uint64_t place = std::uint64_t(point.collider) << 32 | point.point;
        if (place < next || (point.point >= field->points.size() && point.point < kColliderPoint) ||
            !(point.floor <= 0)) {
          return false;
        }
        next = place + 1;
      }
      for (std::uint32_t i = 0; i < saved.plastic; ++i, at += sizeof(float)) {
        float value = 0;
        std::memcpy(&value, at, sizeof value);
        if (!std::isfinite(value)) return false;
      }
      bytes = bytes.subspan(sizeof saved + arrayBytes(saved));
    }
    return bytes.empty();
  }

  void restore(std::span<const std::byte> bytes) override {
    const std::byte* at = bytes.data();
    const auto get = [&at](void* to, std::size_t size) {
      if (size > 0) std::memcpy(to, at, size);
      at += size;
    };
    for (Piece& piece : body_.pieces) {
      PieceState& state = piece.state;
      SavedPiece saved;
      get(&saved, sizeof saved);
      if (saved.level != piece.free->level) useLevel(body_, piece, std::uint32_t(saved.level));
      state.held = (saved.flags & kHeld) != 0;
      state.leaning = (saved.flags & kLeaning) != 0;
      state.stays = (saved.flags & kStays) != 0;
      state.rests = (saved.flags & kRests) != 0;
      state.h_before = saved.h_before;
      state.elastic = saved.elastic;
      state.budget = saved.budget;
      state.lost = saved.lost;
      state.turn = {saved.turn[0], saved.turn[1], saved.turn[2]};
      state.omega = {saved.omega[0], saved.omega[1], saved.omega[2]};
      state.rebound = {saved.rebound[0], saved.rebound[1], saved.rebound[2]};
      piece.springs_firm = -1;
      piece.system.h = 0;
      for (auto* array : state.vectors()) {
        array->resize(saved.functions);
        get(array->data(), saved.functions * sizeof(Vector3d));  // any numbers: what is lost a step puts right
      }
      state.touching.resize(saved.touching);
      get(state.touching.data(), saved.touching * sizeof(TouchingPoint));
      state.plastic.resize(saved.plastic);
      get(state.plastic.data(), saved.plastic * sizeof(float));
      invertPlasticity(state.plastic, piece.rest_change);
      state.pairs_h = saved.pairs_h;
      state.pairs.restore(4 * saved.functions, std::uint32_t(saved.pairs), at);
      at += saved.pairs * Pairs::savedBytes(4 * saved.functions);
    }
    updateFibres(body_, false);
    body_.fade_left = body_.fade_before = 0;
    body_.setCurrent();
  }

 private:
  /// Adds added(field, j, z_j) to the velocities that no pin set prescribes: something acted, and there is no step
  /// before.
  template <class Added>
  void change(const Added& added) {
    for (Piece& piece : body_.pieces) {
      PieceState& state = piece.state;
      const Field& field = piece.field();
      for (std::uint32_t j = field.driven; j < field.k; ++j) state.v[j] += added(field, j, state.z[j]);
      state.h_before = 0;
      state.budget = -1;
    }
    body_.outdated = true;
  }

  Body& body_;
};

class CoupledFactory final : public SolverFactory {
 public:
  const char* faultOf(const Asset& asset) const override {
    const RestConstants& rest = asset.constants();
    for (std::uint32_t p = 0; p < asset.package().pieces().size(); ++p) {
      if (fieldOf(rest.fields, p, false) == nullptr) {
        return "this package has no fields (baked by an older version, with field.functions=0, or too thin for its "
               "size, of which bake warns): bake it again, or use the report's solver";
      }
    }
    return nullptr;
  }
  SolverPointer make(Body& body, std::pmr::memory_resource* memory) const override {
    return makeSolver<CoupledSolver>(memory, body, memory);
  }
};

}  // namespace

const SolverFactory& coupledSolver() {
  static const CoupledFactory factory;
  return factory;
}

}  // namespace sinew::internal
