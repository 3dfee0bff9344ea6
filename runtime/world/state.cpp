// SPDX-License-Identifier: MIT
//
// The state of a body as a whole: saved, restored, moved elsewhere.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "runtime/geometry/rotation.h"
#include "runtime/solver/cluster_solver.h"
#include "runtime/world/world_impl.h"
#include "sinew/formats/checksum.h"

namespace sinew {

using internal::asArray;
using internal::asVector;
using internal::Body;

namespace {

constexpr std::array<char, 4> kStateMagic = {'S', 'N', 'W', 'B'};
constexpr std::uint32_t kStateVersion = 20;

struct StateHeader {
  std::array<char, 4> magic;
  std::uint32_t version;
  std::uint64_t package;  ///< Asset::checksum()
  std::uint64_t bytes;    ///< of all, this header included
  std::uint32_t vertices, pins, picks;
  std::uint32_t history_positions, history_columns;
  std::uint32_t repaired;
  std::uint32_t channels, pin_sets, pinned_vertices, asleep;
  std::uint32_t forces, reserved;
  double still;                ///< Body::still, s
  std::uint64_t solver_bytes;  ///< of the solver, behind all else
  std::uint64_t checksum;      ///< of all, with this field as 0
};
static_assert(sizeof(StateHeader) == 96);

/// XXH3 as in packages. \param bytes of a whole state, header first.
std::uint64_t checksumOf(std::span<const std::byte> bytes) {
  StateHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  header.checksum = 0;
  return formats::checksum(std::as_bytes(std::span{&header, 1}), bytes.subspan(sizeof header));
}

/// A PinSet without its vertices, which follow behind all sets.
struct SavedPinSet {
  std::uint32_t id;
  PinMethod method;
  RigidTransform before, at, target;
  std::uint32_t vertices, source;
  std::array<double, 3> force_sum, torque_sum;
};

// Ids of picks and pin sets in a saved state are below this: new ones must not run out behind them.
constexpr std::uint32_t kMostIds = 0xFFFF0000U;

template <class T>
std::size_t bytesOf(std::size_t count) {
  static_assert(std::is_trivially_copyable_v<T>);
  return count * sizeof(T);
}

StateHeader headerOf(const Body& body) {
  StateHeader header = {};
  header.magic = kStateMagic;
  header.version = kStateVersion;
  header.package = body.asset->checksum();
  header.vertices = body.vertexCount();
  header.pins = std::uint32_t(body.pins.size());
  header.picks = std::uint32_t(body.picks.size());
  header.history_positions = std::uint32_t(body.history.positions.size());
  header.history_columns = std::uint32_t(body.history.columns.size());
  header.repaired = body.repaired;
  header.channels = std::uint32_t(body.activation.size());
  header.pin_sets = std::uint32_t(body.pin_sets.size());
  for (const internal::PinSet& set : body.pin_sets) header.pinned_vertices += std::uint32_t(set.vertices.size());
  header.asleep = body.asleep() && body.activity == Activity::active ? 1 : 0;
  header.forces = std::uint32_t(body.forces.size());
  header.still = body.still;
  header.solver_bytes = body.solver->stateBytes();
  return header;
}

// Sizes are bounded by 2^32 records of under 2 KB each: no overflow.
std::size_t totalBytes(const StateHeader& h) {
  return h.solver_bytes + sizeof h + 2 * bytesOf<Vec3>(h.vertices) + bytesOf<internal::Pin>(h.pins) +
         bytesOf<internal::Pick>(h.picks) + bytesOf<internal::PointForce>(h.forces) +
         bytesOf<Vec3>(h.history_positions) + bytesOf<internal::ClusterColumns>(h.history_columns) +
         bytesOf<float>(h.channels) + bytesOf<SavedPinSet>(h.pin_sets) +
         bytesOf<internal::PinnedVertex>(h.pinned_vertices);
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

/// \param least number of points that it must be one of: 1, or 0 where it may stand for all of the body.
bool isSound(const internal::PickedPoint& point, std::uint32_t vertices, std::size_t least) {
  double sum = 0;
  std::size_t count = 0;
  for (; count < point.weight.size() && point.weight[count] != 0; ++count) {
    if (!std::isfinite(point.weight[count]) || point.vertex[count] >= vertices) return false;
    sum += point.weight[count];
  }
  return count >= least && (count == 0 || std::abs(sum - 1) < 1e-2);
}

bool allFinite(const float* values, std::size_t count) {
  return std::all_of(values, values + count, [](float value) { return std::isfinite(value); });
}

}  // namespace

const char* internal::faultOfState(std::span<const std::byte> bytes, const Body& body) {
  if (bytes.size() < sizeof(StateHeader)) return "too few bytes for a saved state";
  StateHeader h;
  std::memcpy(&h, bytes.data(), sizeof h);
  if (h.magic != kStateMagic) return "these bytes are no saved state";
  if (h.version != kStateVersion) return "saved by another version of the library";
  if (h.package != body.asset->checksum() || h.vertices != body.vertexCount()) {
    return "saved from a body of another package";
  }
  const bool columns = h.history_columns == 0 || h.history_columns == body.clusterCount();
  if (h.asleep > 1 || !(h.still >= 0) || h.channels != body.activation.size() || h.pinned_vertices > h.vertices ||
      h.pin_sets > h.pinned_vertices || h.pins > h.vertices ||
      (h.history_positions != 0 && h.history_positions != h.vertices) || !columns || h.solver_bytes > h.bytes ||
      h.bytes != totalBytes(h)) {
    return "the saved state is damaged";
  }
  if (bytes.size() < h.bytes) return "the saved state is cut short";
  if (checksumOf(bytes.first(h.bytes)) != h.checksum) return "the saved state is damaged (its checksum does not match)";
  if (!body.solver->accepts(bytes.subspan(h.bytes - h.solver_bytes, h.solver_bytes))) {
    return "the saved state is damaged, or another solver's";
  }

  Reader reader(bytes.data() + sizeof h);
  bool sound = true;
  for (std::uint32_t i = 0; i < 2 * h.vertices; ++i) sound &= allFinite(reader.get<Vec3>().data(), 3);
  std::uint32_t next = 0;
  for (std::uint32_t i = 0; i < h.pins; ++i) {
    const auto pin = reader.get<internal::Pin>();
    sound &= pin.vertex >= next && pin.vertex < h.vertices && allFinite(pin.before.data(), 3) &&
             allFinite(pin.at.data(), 3) && allFinite(pin.target.data(), 3);
    next = pin.vertex + 1;
  }
  const std::size_t visual_count = body.package().visualPositions().size();
  for (std::uint32_t i = 0; i < h.picks; ++i) {
    const auto pick = reader.get<internal::Pick>();
    const std::size_t most = pick.at.physical != 0 ? h.vertices : visual_count;
    for (std::size_t c = 0; c < 3; ++c) sound &= pick.at.weight[c] == 0 || pick.at.vertex[c] < most;
    sound &= pick.id < kMostIds && pick.locked <= 1 && isSound(pick.point, h.vertices, 1) &&
             allFinite(pick.at.weight.data(), 3) && allFinite(pick.target.data(), 3) && pick.frequency_hz >= 0.1F &&
             pick.frequency_hz <= 100.0F && pick.most_force >= 0;
  }
  for (std::uint32_t i = 0; i < h.forces; ++i) {
    const auto force = reader.get<internal::PointForce>();
    sound &= isSound(force.point, h.vertices, 0) && allFinite(force.force.data(), 3);
  }
  for (std::uint32_t i = 0; i < h.history_positions; ++i) reader.get<Vec3>();
  for (std::uint32_t i = 0; i < h.history_columns; ++i) reader.get<internal::ClusterColumns>();
  for (std::size_t i = 0; i < h.channels; ++i) sound &= std::isfinite(reader.get<float>());
  std::uint64_t pinned = 0;
  for (std::uint32_t i = 0; i < h.pin_sets; ++i) {
    const auto set = reader.get<SavedPinSet>();
    sound &= set.id < kMostIds && internal::isProper(set.before) && internal::isProper(set.at) &&
             internal::isProper(set.target) && set.method <= PinMethod::constrained_fit && set.vertices > 0 &&
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

std::size_t World::stateBytes(BodyId id) const {
  const Impl::Presence presence(*impl_, "stateBytes", Impl::As::reads);
  const Body* body = presence.seen(id);
  return body != nullptr ? totalBytes(headerOf(*body)) : 0;
}

std::size_t World::saveState(BodyId id, std::span<std::byte> bytes) const {
  const Impl::Presence presence(*impl_, "saveState", Impl::As::reads);
  const Body* body = presence.seen(id);
  if (body == nullptr) return 0;
  StateHeader header = headerOf(*body);
  header.bytes = totalBytes(header);
  if (bytes.size() < header.bytes) return 0;
  Writer writer(bytes.data());
  writer.put(&header, 1);
  writer.put(body->x.data(), header.vertices);
  writer.put(body->v.data(), header.vertices);
  writer.put(body->pins.data(), header.pins);
  writer.put(body->picks.data(), header.picks);
  writer.put(body->forces.data(), header.forces);
  writer.put(body->history.positions.data(), header.history_positions);
  writer.put(body->history.columns.data(), header.history_columns);
  writer.put(body->activation.data(), header.channels);
  for (const internal::PinSet& set : body->pin_sets) {
    SavedPinSet saved = {};
    saved.id = set.id;
    saved.source = set.source;
    saved.method = set.method;
    saved.before = set.before;
    saved.at = set.at;
    saved.target = set.target;
    saved.vertices = std::uint32_t(set.vertices.size());
    std::copy(set.force_sum.data(), set.force_sum.data() + 3, saved.force_sum.begin());
    std::copy(set.torque_sum.data(), set.torque_sum.data() + 3, saved.torque_sum.begin());
    writer.put(&saved, 1);
  }
  for (const internal::PinSet& set : body->pin_sets) writer.put(set.vertices.data(), set.vertices.size());
  body->solver->save(bytes.subspan(header.bytes - header.solver_bytes, header.solver_bytes));
  header.checksum = checksumOf(bytes.first(header.bytes));
  std::memcpy(bytes.data(), &header, sizeof header);
  return header.bytes;
}

Result<std::size_t> World::restoreState(BodyId id, std::span<const std::byte> bytes) {
  const Impl::Presence presence(*impl_, "restoreState", Impl::As::changes);
  if (!presence) return presence.refusal();
  Body* body = presence.find(id);
  if (body == nullptr) return Error{"restoreState: no such body"};
  if (const char* fault = internal::faultOfState(bytes, *body); *fault != '\0')
    return impl_->refuse("restoreState: %s", fault);
  StateHeader header;
  Reader reader(bytes.data());
  reader.get(&header, 1);
  // Memory first, so that a failure leaves the body as it was.
  internal::OwningArray<internal::PinSet> sets(impl_->memory);
  const bool reserved = impl_->guarded("restoreState", false, [&] {
    body->pins.reserve(header.pins);
    body->picks.reserve(header.picks);
    body->forces.resize(header.forces);
    if (body->settings.keep_previous) keepHistory(*body);
    Reader tail(bytes.data() + header.bytes - header.solver_bytes -
                bytesOf<internal::PinnedVertex>(header.pinned_vertices) - bytesOf<SavedPinSet>(header.pin_sets));
    for (std::uint32_t i = 0; i < header.pin_sets; ++i) {
      const auto saved = tail.get<SavedPinSet>();
      internal::PinSet& set = sets.emplace_back(impl_->memory);
      set.vertices.resize(saved.vertices);
      set.id = formats::kNone;  // none yet, and none of another's
      set.source = saved.source;
      set.method = saved.method;
      set.before = saved.before;
      set.at = saved.at;
      set.target = saved.target;
      std::copy(saved.force_sum.begin(), saved.force_sum.end(), set.force_sum.data());
      std::copy(saved.torque_sum.begin(), saved.torque_sum.end(), set.torque_sum.data());
    }
    for (internal::PinSet& set : sets) tail.get(set.vertices.data(), set.vertices.size());
    body->pin_sets.swap(sets);
    return true;
  });
  if (!reserved) return Error{"restoreState: out of memory"};
  impl_->displaced(*body);
  reader.get(body->x.data(), header.vertices);
  reader.get(body->v.data(), header.vertices);
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
  reader.get(body->forces.data(), header.forces);
  body->still = header.still;
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
  reader.get(body->activation.data(), header.channels);
  for (internal::PinSet& set : body->pin_sets) {
    const auto saved = reader.get<SavedPinSet>();
    set.id = impl_->findPinSet({saved.id}).first != nullptr ? impl_->next_pin_set : saved.id;
    impl_->next_pin_set = std::max(impl_->next_pin_set, set.id + 1);
  }
  for (const internal::PinSet& set : body->pin_sets) {
    for (const internal::PinnedVertex& vertex : set.vertices) body->pinned[vertex.vertex] = 1;
  }
  body->solver->restore(bytes.subspan(header.bytes - header.solver_bytes, header.solver_bytes));
  if (header.asleep != 0) {
    impl_->guarded("restoreState", false, [&] {
      internal::fallAsleep(*body, body->id);
      return true;
    });
  }
  return std::size_t(header.bytes);
}

void World::teleport(BodyId id, const Mat3& rotation, Vec3 translation) {
  const Impl::Presence presence(*impl_, "teleport", Impl::As::changes);
  Body* body = presence.find(id);
  if (body == nullptr) return;
  if (!internal::isProper(rotation) || !internal::stateIsUsable(translation, {})) {
    impl_->tell(LogSeverity::error, "teleport: not a proper rotation and a translation within 1e15 m");
    return;
  }
  impl_->displaced(*body);
  geometry::Quaternion turn = geometry::kIdentityQuaternion;
  geometry::nearestRotation(internal::asMatrix(rotation), turn);
  impl_->move(*body,
              Eigen::Quaterniond(double(turn[0]), double(turn[1]), double(turn[2]), double(turn[3]))
                  .normalized()
                  .toRotationMatrix(),
              asVector(translation).cast<double>());
}

void World::snapToPins(BodyId id) {
  const Impl::Presence presence(*impl_, "snapToPins", Impl::As::changes);
  if (Body* body = presence.find(id)) impl_->snapToPins(*body);
}

// Of places with turns the nearest rigid motion (Kabsch 1976); the turns decide where the places lie on a line.
void World::Impl::snapToPins(Body& body) {
  double weight = 0;
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
  Eigen::Matrix3d both = Eigen::Matrix3d::Zero();
  bool moved = false;
  const double size2 = double(body.package().info().diagonal) * double(body.package().info().diagonal);
  const auto add = [&](const Eigen::Vector3d& was, const Eigen::Vector3d& goes, double w) {
    weight += w;
    from += w * was;
    to += w * goes;
    both += w * goes * was.transpose();
  };
  for (const internal::Pin& pin : body.pins) {
    moved = moved || pin.at != pin.target;
    add(asVector(pin.at).cast<double>(), asVector(pin.target).cast<double>(), 1);
  }
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  for (const internal::PinSet& set : body.pin_sets) {
    moved = moved || set.at.position != set.target.position || set.at.rotation != set.target.rotation;
    const internal::Pose was(set.at), goes(set.target);
    for (const internal::PinnedVertex& vertex : set.vertices) {
      const Eigen::Vector3d local = asVector(vertex.local).cast<double>();
      add(was.toWorld(local), goes.toWorld(local), double(vertex.weight));
    }
    turns += goes.rotation * was.rotation.transpose();
  }
  if (!moved || !(weight > 0)) return;
  from /= weight;
  to /= weight;
  both = both / weight - to * from.transpose() + 1e-6 * size2 * (turns + 1e-6 * Eigen::Matrix3d::Identity());
  const Eigen::Matrix3d r = geometry::nearestRotation(both);
  guarded("snapToPins", false, [&] {
    internal::Array<RigidTransform> targets(memory);
    for (const internal::PinSet& set : body.pin_sets) targets.push_back(set.target);
    internal::Array<Vec3> places(memory);
    for (const internal::Pin& pin : body.pins) places.push_back(pin.target);
    displaced(body);
    move(body, r, to - r * from);
    for (std::size_t i = 0; i < targets.size(); ++i) body.pin_sets[i].target = targets[i];
    for (std::size_t i = 0; i < places.size(); ++i) body.pins[i].target = places[i];
    return true;
  });
}

void World::Impl::move(Body& body, const Eigen::Matrix3d& r, const Eigen::Vector3d& t) {
  const auto rotate = [&](float* p, std::ptrdiff_t stride) {
    const Eigen::Vector3d turned = r * Eigen::Vector3d(double(p[0]), double(p[stride]), double(p[2 * stride]));
    for (int k = 0; k < 3; ++k) p[k * stride] = float(turned[k]);
  };
  const auto move = [&](float* p) {
    const Eigen::Vector3d moved = r * Eigen::Vector3d(double(p[0]), double(p[1]), double(p[2])) + t;
    for (int k = 0; k < 3; ++k) p[k] = float(moved[k]);
  };
  for (internal::Pin& pin : body.pins) {
    for (Vec3* place : {&pin.before, &pin.at, &pin.target}) move(place->data());
  }
  for (internal::Pick& pick : body.picks) move(pick.target.data());
  for (internal::PinSet& set : body.pin_sets) {
    for (RigidTransform* transform : {&set.before, &set.at, &set.target}) {
      move(transform->position.data());
      for (std::size_t column = 0; column < 3; ++column) rotate(&transform->rotation[column], 3);
    }
    set.force_sum = r * set.force_sum;
    set.torque_sum = r * set.torque_sum;
  }
  body.solver->move(r, t);
  for (Vec3& previous : body.history.positions) move(previous.data());
  for (internal::ClusterColumns& columns : body.history.columns) {
    move(columns.column[0]);
    for (std::size_t k = 1; k < 10; ++k) rotate(columns.column[k], 1);
  }
}

}  // namespace sinew
