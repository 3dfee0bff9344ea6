// SPDX-License-Identifier: MIT
//
// The state of a body as a whole: saved, restored, moved elsewhere.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "runtime/clusters/pins.h"
#include "runtime/geometry/rotation.h"
#include "runtime/world/world_impl.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;
using internal::ClusterBlock;
using internal::operator*;

namespace {

constexpr std::array<char, 4> kStateMagic = {'S', 'N', 'W', 'B'};
constexpr std::uint32_t kStateVersion = 6;

struct StateHeader {
  std::array<char, 4> magic;
  std::uint32_t version;
  std::uint64_t package;  ///< Asset::checksum()
  std::uint64_t bytes;    ///< of all, this header included
  std::uint32_t vertices, blocks, pins, picks;
  std::uint32_t history_positions, history_columns;
  std::uint32_t repaired;
  std::uint32_t shapes, dampings, channels;  ///< of MechanicsState
  std::uint32_t pin_sets, pinned_vertices;
  std::uint32_t centers_known;
  float pass_seconds;         ///< Body::pass_seconds
  std::uint64_t piece_bytes;  ///< of the pieces, behind all else
};
static_assert(sizeof(StateHeader) == 88);

/// A PinSet without its vertices, which follow behind all sets.
struct SavedPinSet {
  std::uint32_t id;
  PinMethod method;
  RigidTransform at, target;
  std::uint32_t passes, first_pass, vertices, source;
  std::array<double, 3> force_sum, torque_sum;
};

/// The moving point about which a part's motion is summed, and its fast spin.
struct SavedCenter {
  std::array<double, 3> reference, moving, spin;
  float turned_seconds;
  std::uint32_t tangled;
};

/// A PieceState without its arrays, which follow: z, v, those of one step earlier, what touches.
struct SavedPiece {
  std::uint32_t held, functions, touching, reserved;
  double h_before, elastic, budget;
  std::array<double, 3> turn, omega;
};

constexpr std::size_t kShapeFloats = 18, kDampingFloats = 27;

// Ids of picks and pin sets in a saved state are below this: new ones must not run out behind them.
constexpr std::uint32_t kMostIds = 0xFFFF0000U;

template <class T>
std::size_t bytesOf(std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T>);
  return count * sizeof(T);
}

std::size_t pieceBytes(std::size_t functions, std::size_t touching) {
  return sizeof(SavedPiece) + bytesOf<std::array<double, 3>>(4 * functions) +
         bytesOf<internal::TouchingPoint>(touching);
}

StateHeader headerOf(const Body& body) {
  StateHeader header = {};
  header.magic = kStateMagic;
  header.version = kStateVersion;
  header.package = body.asset->checksum();
  header.vertices = body.vertexCount();
  header.blocks = std::uint32_t(body.blocks.size());
  header.pins = std::uint32_t(body.pins.size());
  header.picks = std::uint32_t(body.picks.size());
  header.history_positions = std::uint32_t(body.history.positions.size());
  header.history_columns = std::uint32_t(body.history.columns.size());
  header.repaired = body.repaired;
  header.centers_known = body.centers_known ? 1 : 0;
  header.pass_seconds = body.pass_seconds;
  header.shapes = std::uint32_t(body.mechanics.shapes.size());
  header.dampings = std::uint32_t(body.mechanics.previous.size());
  header.channels = std::uint32_t(body.mechanics.activation.size());
  header.pin_sets = std::uint32_t(body.pin_sets.size());
  for (const internal::PinSet& set : body.pin_sets) header.pinned_vertices += std::uint32_t(set.vertices.size());
  for (const internal::Piece& piece : body.pieces) {
    header.piece_bytes += pieceBytes(piece.state.z.size(), piece.state.touching.size());
  }
  return header;
}

// Sizes are bounded by 2^32 records of under 2 KB each: no overflow.
std::size_t totalBytes(const StateHeader& h, const Body& body) {
  return h.piece_bytes + sizeof h + bytesOf<SavedCenter>(body.parts.size()) + 3 * bytesOf<Vec3>(h.vertices) +
         bytesOf<ClusterBlock>(h.blocks) + bytesOf<internal::Pin>(h.pins) + bytesOf<internal::Pick>(h.picks) +
         bytesOf<Vec3>(h.history_positions) + bytesOf<internal::ClusterColumns>(h.history_columns) +
         bytesOf<float>(kShapeFloats * std::size_t(h.shapes) + kDampingFloats * std::size_t(h.dampings) + h.channels) +
         bytesOf<SavedPinSet>(h.pin_sets) + bytesOf<internal::PinnedVertex>(h.pinned_vertices);
}

class Writer {
 public:
  explicit Writer(std::byte* to) : at_(to) {}
  template <class T>
  void put(const T* values, std::size_t count) {
    if (count > 0) std::memcpy(at_, values, bytesOf<T>(count));
    at_ += bytesOf<T>(count);
  }

 private:
  std::byte* at_;
};

// Hands out values from bytes of any alignment, one after the other.
class Reader {
 public:
  explicit Reader(const std::byte* from) : at_(from) {}
  template <class T>
  void get(T* values, std::size_t count) {
    if (count > 0) std::memcpy(values, at_, bytesOf<T>(count));
    at_ += bytesOf<T>(count);
  }
  template <class T>
  T get() {
    T value;
    get(&value, 1);
    return value;
  }

 private:
  const std::byte* at_;
};

bool allFinite(const float* values, std::size_t count) {
  return std::all_of(values, values + count, [](float value) { return std::isfinite(value); });
}

bool isSound(const ClusterBlock& block) {
  return allFinite(block.center[0], 3 * 8) && allFinite(block.rotation[0], 4 * 8) &&
         allFinite(block.part_rotation[0], 4 * 8) && allFinite(block.a_pq[0], 27 * 8) && allFinite(block.f[0], 27 * 8);
}

// Reads the pieces of a saved state into those of a body, or with `only_check` into nothing. \return whether they are
// sound.
bool readPieces(Body& body, std::span<const std::byte> bytes, bool only_check) {
  Reader reader(bytes.data());
  std::size_t left = bytes.size();
  for (internal::Piece& piece : body.pieces) {
    if (left < sizeof(SavedPiece)) return false;
    const auto saved = reader.get<SavedPiece>();
    const internal::Field* field = saved.held != 0 ? piece.fixed : piece.free;
    if (field == nullptr || saved.functions != field->k || saved.touching > internal::kMostContacts || saved.held > 1 ||
        saved.reserved != 0 || !(saved.h_before >= 0 && std::isfinite(saved.h_before))) {
      return false;
    }
    const std::size_t size = pieceBytes(saved.functions, saved.touching);
    if (left < size) return false;
    left -= size;
    internal::PieceState& state = piece.state;
    if (!only_check) {
      state.held = saved.held != 0;
      state.h_before = saved.h_before;
      state.elastic = saved.elastic;
      state.budget = saved.budget;
      state.turn = {saved.turn[0], saved.turn[1], saved.turn[2]};
      state.omega = {saved.omega[0], saved.omega[1], saved.omega[2]};
      state.touching.clear();
      piece.springs_firm = -1;
      piece.whole_h = 0;
    }
    for (auto* array : {&state.z, &state.v, &state.z_before, &state.v_before}) {
      if (!only_check) array->resize(saved.functions);
      for (std::uint32_t j = 0; j < saved.functions; ++j) {
        const auto row = reader.get<std::array<double, 3>>();  // any: what is lost a step puts right
        if (!only_check) (*array)[j] = {row[0], row[1], row[2]};
      }
    }
    std::uint32_t next = 0;
    for (std::uint32_t t = 0; t < saved.touching; ++t) {
      const auto point = reader.get<internal::TouchingPoint>();
      if (point.point < next || point.point >= field->points.size()) return false;
      next = point.point + 1;
      if (!only_check) state.touching.push_back(point);
    }
  }
  return left == 0;
}

// Why saved bytes cannot be restored into a body; empty if they can.
const char* faultOf(std::span<const std::byte> bytes, Body& body) {
  if (bytes.size() < sizeof(StateHeader)) return "too few bytes for a saved state";
  StateHeader h;
  std::memcpy(&h, bytes.data(), sizeof h);
  if (h.magic != kStateMagic) return "these bytes are no saved state";
  if (h.version != kStateVersion) return "saved by another version of the library";
  if (h.package != body.asset->checksum() || h.vertices != body.vertexCount() || h.blocks != body.blocks.size()) {
    return "saved from a body of another package";
  }
  const internal::MechanicsState& mechanics = body.mechanics;
  if (h.shapes != mechanics.shapes.size() || h.dampings != mechanics.previous.size() ||
      h.channels != mechanics.activation.size() || h.pinned_vertices > h.vertices || h.pin_sets > h.pinned_vertices) {
    return "the saved state is damaged";
  }
  const bool columns = h.history_columns == 0 || h.history_columns == body.clusterCount();
  if (h.pins > h.vertices || (h.history_positions != 0 && h.history_positions != h.vertices) || !columns ||
      h.centers_known > 1 || !(h.pass_seconds >= 0 && std::isfinite(h.pass_seconds)) ||
      h.bytes != totalBytes(h, body)) {
    return "the saved state is damaged";
  }
  if (bytes.size() < h.bytes) return "the saved state is cut short";
  if (!readPieces(body, bytes.subspan(h.bytes - h.piece_bytes, h.piece_bytes), true))
    return "the saved state is damaged";

  Reader reader(bytes.data() + sizeof h);
  bool sound = true;
  for (std::size_t i = 0; i < body.parts.size(); ++i) {
    const auto center = reader.get<SavedCenter>();
    for (std::size_t k = 0; k < 3; ++k) {
      sound &= std::isfinite(center.reference[k]) && std::isfinite(center.moving[k]) && std::isfinite(center.spin[k]);
    }
    sound &= center.tangled <= 1 && std::isfinite(center.turned_seconds);
  }
  for (std::uint32_t i = 0; i < 2 * h.vertices; ++i) reader.get<Vec3>();  // any: what is lost a step puts right
  for (std::uint32_t i = 0; i < h.vertices; ++i) sound &= allFinite(reader.get<Vec3>().data(), 3);
  for (std::uint32_t i = 0; i < h.blocks; ++i) sound &= isSound(reader.get<ClusterBlock>());
  std::uint32_t next = 0;
  for (std::uint32_t i = 0; i < h.pins; ++i) {
    const auto pin = reader.get<internal::Pin>();
    sound &= pin.vertex >= next && pin.vertex < h.vertices && allFinite(pin.target.data(), 3);
    next = pin.vertex + 1;
  }
  const std::size_t visual_count = body.package().visualPositions().size();
  for (std::uint32_t i = 0; i < h.picks; ++i) {
    const auto pick = reader.get<internal::Pick>();
    sound &= pick.id < kMostIds && pick.visual_vertex < visual_count && allFinite(pick.target.data(), 3) &&
             allFinite(pick.force.data(), 3) && pick.frequency_hz >= 0.1F && pick.frequency_hz <= 100.0F;
  }
  for (std::uint32_t i = 0; i < h.history_positions; ++i) reader.get<Vec3>();
  for (std::uint32_t i = 0; i < h.history_columns; ++i) reader.get<internal::ClusterColumns>();
  const std::size_t mechanics_floats =
      kShapeFloats * std::size_t(h.shapes) + kDampingFloats * std::size_t(h.dampings) + h.channels;
  for (std::size_t i = 0; i < mechanics_floats; ++i) sound &= std::isfinite(reader.get<float>());
  std::uint64_t pinned = 0;
  for (std::uint32_t i = 0; i < h.pin_sets; ++i) {
    const auto set = reader.get<SavedPinSet>();
    sound &= set.id < kMostIds && internal::isProper(set.at) && internal::isProper(set.target) &&
             set.method <= PinMethod::constrained_fit && set.vertices > 0 &&
             (set.source == formats::kNone || set.source < body.package().pinSets().size());
    pinned += set.vertices;
  }
  sound &= pinned == h.pinned_vertices;
  for (std::uint32_t i = 0; i < h.pinned_vertices; ++i) {
    const auto vertex = reader.get<internal::PinnedVertex>();
    sound &= vertex.vertex < h.vertices && vertex.weight > 0 && vertex.weight <= 1 && allFinite(vertex.local.data(), 3);
  }
  return sound ? "" : "the saved state is damaged";
}

}  // namespace

std::size_t World::stateBytes(BodyId id) const {
  const Body* body = impl_->drawn(id, "stateBytes");
  return body != nullptr ? totalBytes(headerOf(*body), *body) : 0;
}

std::size_t World::saveState(BodyId id, std::span<std::byte> bytes) const {
  const Body* body = impl_->drawn(id, "saveState");
  if (body == nullptr) return 0;
  StateHeader header = headerOf(*body);
  header.bytes = totalBytes(header, *body);
  if (bytes.size() < header.bytes) return 0;
  Writer writer(bytes.data());
  writer.put(&header, 1);
  for (const internal::Part& part : body->parts) {
    SavedCenter saved;
    std::copy(part.reference.data(), part.reference.data() + 3, saved.reference.begin());
    std::copy(part.moving.data(), part.moving.data() + 3, saved.moving.begin());
    std::copy(part.spin.data(), part.spin.data() + 3, saved.spin.begin());
    saved.turned_seconds = part.turned_seconds;
    saved.tangled = part.tangled ? 1 : 0;
    writer.put(&saved, 1);
  }
  writer.put(body->x.data(), header.vertices);
  writer.put(body->v.data(), header.vertices);
  writer.put(body->force.data(), header.vertices);
  writer.put(body->blocks.data(), header.blocks);
  writer.put(body->pins.data(), header.pins);
  writer.put(body->picks.data(), header.picks);
  writer.put(body->history.positions.data(), header.history_positions);
  writer.put(body->history.columns.data(), header.history_columns);
  for (const internal::ShapeState& shape : body->mechanics.shapes) {
    writer.put(shape.plastic.data(), 9);
    writer.put(shape.shape.data(), 9);
  }
  for (const auto& previous : body->mechanics.previous) writer.put(previous.data(), kDampingFloats);
  writer.put(body->mechanics.activation.data(), header.channels);
  for (const internal::PinSet& set : body->pin_sets) {
    SavedPinSet saved = {};
    saved.id = set.id;
    saved.source = set.source;
    saved.method = set.method;
    saved.at = set.at;
    saved.target = set.target;
    saved.passes = set.passes;
    saved.first_pass = set.first_pass ? 1 : 0;
    saved.vertices = std::uint32_t(set.vertices.size());
    std::copy(set.force_sum.data(), set.force_sum.data() + 3, saved.force_sum.begin());
    std::copy(set.torque_sum.data(), set.torque_sum.data() + 3, saved.torque_sum.begin());
    writer.put(&saved, 1);
  }
  for (const internal::PinSet& set : body->pin_sets) writer.put(set.vertices.data(), set.vertices.size());
  for (const internal::Piece& piece : body->pieces) {
    const internal::PieceState& state = piece.state;
    const SavedPiece saved = {state.held ? 1U : 0U,
                              std::uint32_t(state.z.size()),
                              std::uint32_t(state.touching.size()),
                              0,
                              state.h_before,
                              state.elastic,
                              state.budget,
                              {state.turn[0], state.turn[1], state.turn[2]},
                              {state.omega[0], state.omega[1], state.omega[2]}};
    writer.put(&saved, 1);
    for (const auto* array : {&state.z, &state.v, &state.z_before, &state.v_before}) {
      writer.put(reinterpret_cast<const std::array<double, 3>*>(array->data()), array->size());
    }
    writer.put(state.touching.data(), state.touching.size());
  }
  return header.bytes;
}

Result<std::size_t> World::restoreState(BodyId id, std::span<const std::byte> bytes) {
  Body* body = impl_->find(id, "restoreState");
  if (body == nullptr) return Error{"restoreState: no such body"};
  if (const char* fault = faultOf(bytes, *body); *fault != '\0') return impl_->refuse("restoreState: %s", fault);
  StateHeader header;
  Reader reader(bytes.data());
  reader.get(&header, 1);
  // Memory first, so that a failure leaves the body as it was.
  internal::OwningArray<internal::PinSet> sets(impl_->memory);
  const bool reserved = impl_->guarded("restoreState", false, [&] {
    body->pins.reserve(header.pins);
    body->picks.reserve(header.picks);
    if (body->settings.keep_previous) keepHistory(*body);
    Reader tail(bytes.data() + header.bytes - header.piece_bytes -
                bytesOf<internal::PinnedVertex>(header.pinned_vertices) - bytesOf<SavedPinSet>(header.pin_sets));
    for (std::uint32_t i = 0; i < header.pin_sets; ++i) {
      const auto saved = tail.get<SavedPinSet>();
      internal::PinSet& set = sets.emplace_back(impl_->memory);
      set.vertices.resize(saved.vertices);
      set.id = formats::kNone;  // none yet, and none of another's
      set.source = saved.source;
      set.method = saved.method;
      set.at = saved.at;
      set.target = saved.target;
      set.passes = saved.passes;
      set.first_pass = saved.first_pass != 0;
      std::copy(saved.force_sum.begin(), saved.force_sum.end(), set.force_sum.data());
      std::copy(saved.torque_sum.begin(), saved.torque_sum.end(), set.torque_sum.data());
    }
    for (internal::PinSet& set : sets) tail.get(set.vertices.data(), set.vertices.size());
    body->pin_sets.swap(sets);
    try {
      internal::rebuildFits(*body);
    } catch (...) {
      body->pin_sets.swap(sets);
      throw;
    }
    return true;
  });
  if (!reserved) return Error{"restoreState: out of memory"};
  impl_->changed(*body);
  body->centers_known = header.centers_known != 0;
  body->pass_seconds = header.pass_seconds;
  for (internal::Part& part : body->parts) {
    const auto saved = reader.get<SavedCenter>();
    std::copy(saved.reference.begin(), saved.reference.end(), part.reference.data());
    std::copy(saved.moving.begin(), saved.moving.end(), part.moving.data());
    std::copy(saved.spin.begin(), saved.spin.end(), part.spin.data());
    part.turned_seconds = saved.turned_seconds;
    part.tangled = saved.tangled != 0;
  }
  reader.get(body->x.data(), header.vertices);
  reader.get(body->v.data(), header.vertices);
  reader.get(body->force.data(), header.vertices);
  reader.get(body->blocks.data(), header.blocks);
  body->pins.resize(header.pins);
  reader.get(body->pins.data(), header.pins);
  std::fill(body->pinned.begin(), body->pinned.end(), std::uint8_t(0));
  for (const internal::Pin& pin : body->pins) body->pinned[pin.vertex] = 1;
  body->picks.clear();
  for (std::uint32_t i = 0; i < header.picks; ++i) {
    auto pick = reader.get<internal::Pick>();
    if (impl_->findPick({pick.id}).first != nullptr) pick.id = impl_->next_pick;
    impl_->next_pick = std::max(impl_->next_pick, pick.id + 1);
    body->picks.push_back(pick);
  }
  body->repaired = header.repaired;
  if (body->settings.keep_previous) keepHistory(*body);  // where the saved body kept none
  for (std::uint32_t i = 0; i < header.history_positions; ++i) {
    const Vec3 previous = reader.get<Vec3>();
    if (body->settings.keep_previous) body->history.positions[i] = previous;
  }
  for (std::uint32_t i = 0; i < header.history_columns; ++i) {
    const auto columns = reader.get<internal::ClusterColumns>();
    if (i < body->history.columns.size()) body->history.columns[i] = columns;
  }
  for (internal::ShapeState& shape : body->mechanics.shapes) {
    reader.get(shape.plastic.data(), 9);
    reader.get(shape.shape.data(), 9);
  }
  for (auto& previous : body->mechanics.previous) reader.get(previous.data(), kDampingFloats);
  reader.get(body->mechanics.activation.data(), header.channels);
  for (internal::PinSet& set : body->pin_sets) {
    const auto saved = reader.get<SavedPinSet>();
    set.id = impl_->findPinSet({saved.id}).first != nullptr ? impl_->next_pin_set : saved.id;
    impl_->next_pin_set = std::max(impl_->next_pin_set, set.id + 1);
  }
  for (const internal::PinSet& set : body->pin_sets) {
    for (const internal::PinnedVertex& vertex : set.vertices) body->pinned[vertex.vertex] = 1;
  }
  readPieces(*body, bytes.subspan(header.bytes - header.piece_bytes, header.piece_bytes), false);
  body->outdated = body->frames_outdated = false;  // they came along
  impl_->growScratch();
  return std::size_t(header.bytes);
}

void World::teleport(BodyId id, const Mat3& rotation, Vec3 translation) {
  Body* body = impl_->drawn(id, "teleport");
  if (body == nullptr) return;
  if (!internal::isProper(rotation) || !internal::stateIsUsable(translation, {})) {
    impl_->tell(LogSeverity::error, "teleport: not a proper rotation and a translation within 1e15 m");
    return;
  }
  impl_->changed(*body);
  body->centers_known = false;
  geometry::Quaternion turn = geometry::kIdentityQuaternion;
  geometry::nearestRotation(internal::asMatrix(rotation), turn);
  const Eigen::Quaterniond q =
      Eigen::Quaterniond(double(turn[0]), double(turn[1]), double(turn[2]), double(turn[3])).normalized();
  const Eigen::Matrix3d r = q.toRotationMatrix();
  const Eigen::Vector3d t = asVector(translation).cast<double>();
  const auto move = [&](float* p, std::ptrdiff_t stride) {
    const Eigen::Vector3d moved = r * Eigen::Vector3d(double(p[0]), double(p[stride]), double(p[2 * stride])) + t;
    for (int k = 0; k < 3; ++k) p[k * stride] = float(moved[k]);
  };
  const auto rotate = [&](float* p, std::ptrdiff_t stride) {
    const Eigen::Vector3d turned = r * Eigen::Vector3d(double(p[0]), double(p[stride]), double(p[2 * stride]));
    for (int k = 0; k < 3; ++k) p[k * stride] = float(turned[k]);
  };
  const auto turn_quaternion = [&](float* p, std::ptrdiff_t stride) {
    const Eigen::Quaterniond turned =
        (q * Eigen::Quaterniond(double(p[0]), double(p[stride]), double(p[2 * stride]), double(p[3 * stride])))
            .normalized();
    p[0] = float(turned.w());
    p[stride] = float(turned.x());
    p[2 * stride] = float(turned.y());
    p[3 * stride] = float(turned.z());
  };
  for (std::uint32_t i = 0; i < body->vertexCount(); ++i) {
    move(body->x[i].data(), 1);
    rotate(body->v[i].data(), 1);
    rotate(body->force[i].data(), 1);
  }
  for (ClusterBlock& block : body->blocks) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      move(&block.center[0][lane], 8);
      turn_quaternion(&block.rotation[0][lane], 8);
      turn_quaternion(&block.part_rotation[0][lane], 8);
      for (std::size_t column = 0; column < 9; ++column) {
        rotate(&block.a_pq[3 * column][lane], 8);
        rotate(&block.f[3 * column][lane], 8);
      }
    }
  }
  for (internal::Pin& pin : body->pins) move(pin.target.data(), 1);
  for (internal::Pick& pick : body->picks) {
    move(pick.target.data(), 1);
    rotate(pick.force.data(), 1);
  }
  for (internal::PinSet& set : body->pin_sets) {
    for (RigidTransform* transform : {&set.at, &set.target}) {
      move(transform->position.data(), 1);
      for (std::size_t column = 0; column < 3; ++column) rotate(&transform->rotation[column], 3);
    }
    set.force_sum = r * set.force_sum;
    set.torque_sum = r * set.torque_sum;
  }
  for (internal::Piece& piece : body->pieces) {
    internal::PieceState& state = piece.state;
    for (std::uint32_t j = 0; j < state.z.size(); ++j) {
      const double one = double(piece.field().functions[j].one);
      for (auto* array : {&state.z, &state.z_before}) (*array)[j] = r * (*array)[j] + one * t;
      for (auto* array : {&state.v, &state.v_before}) (*array)[j] = r * (*array)[j];
    }
    state.turn = r * state.turn;
    state.omega = r * state.omega;
    for (internal::TouchingPoint& point : state.touching) {
      Eigen::Map<Eigen::Vector3d> anchor(point.anchor.data());
      anchor = r * anchor + t;
    }
  }
  body->outdated = body->frames_outdated = !body->pieces.empty();
  for (Vec3& previous : body->history.positions) move(previous.data(), 1);
  for (internal::ClusterColumns& columns : body->history.columns) {
    move(columns.column[0], 1);
    for (std::size_t k = 1; k < 10; ++k) rotate(columns.column[k], 1);
  }
}

}  // namespace sinew
