// SPDX-License-Identifier: MIT
//
// The state of a whole world as bytes.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "runtime/interact/pin_sets.h"
#include "runtime/world/world_impl.h"
#include "sinew/formats/checksum.h"

namespace sinew {

using internal::Body;
using internal::Collider;
using internal::Piece;

namespace {

constexpr std::array<char, 4> kMagic = {'S', 'N', 'W', 'W'};
constexpr std::uint32_t kVersion = 5;

struct Header {
  std::array<char, 4> magic;
  std::uint32_t version;
  std::uint64_t bytes;     ///< of all, this header included
  std::uint64_t checksum;  ///< of all, with this field as 0
  std::uint32_t bodies, colliders, touching;
  std::uint32_t next_body, next_pick, next_pin_set, next_collider, reserved;
  double left_over, shown;
};

/// WorldSettings without flags of a byte.
struct SavedSettings {
  Vec3 gravity, normal;
  float offset, friction;
  std::uint32_t ground, collisions, iterations, most_substeps;
  std::array<float, 8> rates;
  Vec3 wind;
  float restitution;
  std::uint32_t report_contacts;
};

SavedSettings saved(const WorldSettings& s) {
  return {
      s.gravity,
      s.ground.normal,
      s.ground.offset,
      s.ground.friction,
      s.ground.enabled ? 1U : 0U,
      s.collisions ? 1U : 0U,
      s.iterations,
      s.most_substeps,
      {s.sleep_seconds, s.damping, s.deformation_damping_ratio, s.support_damping, s.substep_seconds, s.air_density},
      s.wind,
      s.ground.restitution,
      s.report_contacts ? 1U : 0U};
}

WorldSettings restored(const SavedSettings& s) {
  WorldSettings r;
  r.gravity = s.gravity;
  r.ground = {s.ground != 0, s.normal, s.offset, s.friction, s.restitution};
  r.report_contacts = s.report_contacts != 0;
  r.collisions = s.collisions != 0;
  r.iterations = s.iterations;
  r.most_substeps = s.most_substeps;
  r.sleep_seconds = s.rates[0];
  r.damping = s.rates[1];
  r.deformation_damping_ratio = s.rates[2];
  r.support_damping = s.rates[3];
  r.substep_seconds = s.rates[4];
  r.air_density = s.rates[5];
  r.wind = s.wind;
  return r;
}

/// A body without what follows it: state, touched, touches, factors.
struct SavedBody {
  std::uint64_t package, state_bytes;
  double touches_in;  ///< Body's, s
  std::uint32_t id, sleeps_with;
  Activity activity;
  std::uint32_t touched, touches;
  std::uint32_t in_fields, keep_previous, package_pins, layers, can_touch, self_contact, level;
  Vec3 position;
  Mat3 rotation;
  float stiffness_scale, friction, gravity_scale, drag, support_damping, reserved;
};

struct SavedTouch {
  std::uint32_t collider;
  float speed;
  std::array<double, 13> values;  ///< impulse, torque, place, push, load
};

/// The factor of a piece that touches others: steps share it while the same points touch, though their rows change.
struct SavedFactor {
  double h;
  std::uint32_t points, floats;
};

std::size_t floatsOfFactor(const internal::Field& field) { return std::size_t(field.unknowns()) * field.stride; }

struct SavedCollider {
  std::uint32_t id, kind, positions, triangles;  ///< of a height field: heights, columns
  std::array<float, 4> numbers;                  ///< of its shape
  ColliderSettings settings;
  RigidTransform before, at, target;
  std::array<double, 6> reaction;
};

class Writer {
 public:
  explicit Writer(std::byte* to) : to_(to) {}
  template <class T>
  void put(const T* values, std::size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (to_ != nullptr && count > 0) std::memcpy(to_ + size, values, count * sizeof(T));
    size += count * sizeof(T);
  }
  template <class T>
  void put(const T& value) {
    put(&value, 1);
  }
  std::byte* at() const { return to_ != nullptr ? to_ + size : nullptr; }

  std::size_t size = 0;

 private:
  std::byte* to_;
};

/// Hands out values; what lies beyond the end makes it fail, and is 0.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> from) : from_(from) {}
  std::span<const std::byte> bytes(std::uint64_t count) {
    if (count > from_.size()) {
      failed = true;
      count = 0;
    }
    const auto result = from_.first(std::size_t(count));
    from_ = from_.subspan(std::size_t(count));
    return result;
  }
  template <class T>
  T get() {
    T value = {};
    const auto from = bytes(sizeof(T));
    if (!from.empty()) std::memcpy(&value, from.data(), sizeof value);
    return value;
  }
  template <class T>
  void get(internal::Array<T>& to, std::uint64_t count) {
    const auto from = bytes(count * sizeof(T));
    to.resize(from.size() / sizeof(T));
    if (!from.empty()) std::memcpy(to.data(), from.data(), from.size());
  }
  bool done() const { return !failed && from_.empty(); }

  bool failed = false;

 private:
  std::span<const std::byte> from_;
};

SavedCollider saved(const Collider& collider, const ColliderShape& shape) {
  SavedCollider s = {};
  s.id = collider.id;
  s.kind = std::uint32_t(shape.index());
  if (const auto* plane = std::get_if<PlaneShape>(&shape)) {
    s.numbers = {plane->normal[0], plane->normal[1], plane->normal[2], plane->offset};
  } else if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    s.numbers[0] = sphere->radius;
  } else if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) {
    s.numbers = {capsule->radius, capsule->half_length};
  } else if (const auto* box = std::get_if<BoxShape>(&shape)) {
    s.numbers = {box->half_size[0], box->half_size[1], box->half_size[2]};
  } else if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
    s.positions = std::uint32_t(mesh->positions.size());
    s.triangles = std::uint32_t(mesh->triangles.size());
  } else if (const auto* field = std::get_if<HeightFieldShape>(&shape)) {
    s.positions = std::uint32_t(field->heights.size());
    s.triangles = field->columns;
    s.numbers[0] = field->cell;
  }
  s.settings = collider.settings;
  s.before = collider.before;
  s.at = collider.at;
  s.target = collider.target;
  for (std::size_t k = 0; k < 3; ++k) {
    s.reaction[k] = collider.impulse[int(k)];
    s.reaction[3 + k] = collider.torque[int(k)];
  }
  return s;
}

bool isSound(const SavedBody& s) {
  BodySettings settings;
  settings.friction = s.friction;
  settings.gravity_scale = s.gravity_scale;
  settings.drag = s.drag;
  settings.support_damping = s.support_damping;
  return s.activity <= Activity::disabled && internal::faultOf(settings) == nullptr && s.stiffness_scale >= 0 &&
         s.stiffness_scale <= 1e6F && internal::isProper({s.position, s.rotation});
}

}  // namespace

std::size_t World::Impl::writeSnapshot(const World& world, std::byte* to) const {
  Writer out(to);
  Header header = {kMagic,
                   kVersion,
                   0,
                   0,
                   std::uint32_t(bodies.size()),
                   std::uint32_t(colliders.size()),
                   std::uint32_t(together.touching.size()),
                   next_body,
                   next_pick,
                   next_pin_set,
                   next_collider,
                   0,
                   left_over,
                   shown};
  out.put(header);
  out.put(saved(settings));
  out.put(saved(acting));
  for (const internal::BodyPointer& body : bodies) {
    const BodySettings& s = body->settings;
    const std::uint64_t state_bytes = world.stateBytes({body->id});
    out.put(SavedBody{body->asset->checksum(),
                      state_bytes,
                      body->touches_in,
                      body->id,
                      body->sleeps_with,
                      body->activity,
                      std::uint32_t(body->touched.size()),
                      std::uint32_t(body->touches.size()),
                      s.solver == nullptr ? 1U : 0U,
                      s.keep_previous ? 1U : 0U,
                      s.package_pins ? 1U : 0U,
                      s.layers,
                      s.touches,
                      s.self_contact ? 1U : 0U,
                      s.level,
                      s.position,
                      s.rotation,
                      s.stiffness_scale,
                      s.friction,
                      s.gravity_scale,
                      s.drag,
                      s.support_damping,
                      0});
    if (to != nullptr) world.saveState({body->id}, {out.at(), std::size_t(state_bytes)});
    out.size += std::size_t(state_bytes);
    out.put(body->touched.data(), body->touched.size());
    for (const internal::ColliderTouch& t : body->touches) {
      SavedTouch saved_touch = {t.collider, t.speed, {}};
      double* at = saved_touch.values.data();
      for (const Eigen::Vector3d* v : {&t.impulse, &t.torque, &t.place, &t.push}) at = std::copy_n(v->data(), 3, at);
      *at = t.load;
      out.put(saved_touch);
    }
    for (const Piece& piece : body->pieces) {
      const internal::SystemFactor& factor = piece.system;
      const bool kept = factor.h > 0 && settings.collisions && !factor.points.empty();
      out.put(SavedFactor{kept ? factor.h : 0, kept ? std::uint32_t(factor.points.size()) : 0,
                          kept ? std::uint32_t(factor.factor.size()) : 0});
      if (!kept) continue;
      out.put(factor.points.data(), factor.points.size());
      out.put(factor.factor.data(), factor.factor.size());
    }
  }
  for (const Collider& collider : colliders) {
    const ColliderShape shape = collider.shape.source();
    out.put(saved(collider, shape));
    if (const auto* mesh = std::get_if<MeshShape>(&shape)) {
      out.put(mesh->positions.data(), mesh->positions.size());
      out.put(mesh->triangles.data(), mesh->triangles.size());
    } else if (const auto* field = std::get_if<HeightFieldShape>(&shape)) {
      out.put(field->heights.data(), field->heights.size());
    }
  }
  out.put(together.touching.data(), together.touching.size());
  if (to != nullptr) {
    header.bytes = out.size;
    std::memcpy(to, &header, sizeof header);
    header.checksum = formats::checksum(std::span<const std::byte>(to, out.size));
    std::memcpy(to, &header, sizeof header);
  }
  return out.size;
}

std::size_t World::snapshotBytes() const {
  Impl::Presence presence(*impl_, "snapshotBytes", Impl::As::reads);
  if (!presence) return 0;
  presence.lend();
  return impl_->writeSnapshot(*this, nullptr);
}

std::size_t World::saveSnapshot(std::span<std::byte> bytes) const {
  Impl::Presence presence(*impl_, "saveSnapshot", Impl::As::reads);
  if (!presence) return 0;
  presence.lend();
  return bytes.size() < snapshotBytes() ? 0 : impl_->writeSnapshot(*this, bytes.data());
}

Result<std::size_t> World::restoreSnapshot(std::span<const std::byte> bytes,
                                           std::span<const std::shared_ptr<const Asset>> assets) {
  Impl::Presence presence(*impl_, "restoreSnapshot", Impl::As::changes);
  if (!presence) return presence.refusal();
  presence.lend();
  Header header = {};
  if (bytes.size() < sizeof header) return impl_->refuse("restoreSnapshot: too few bytes for a snapshot");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.magic != kMagic) return impl_->refuse("restoreSnapshot: these bytes are no snapshot");
  if (header.version != kVersion) return impl_->refuse("restoreSnapshot: saved by another version of the library");
  if (header.bytes < sizeof header || header.bytes > bytes.size()) {
    return impl_->refuse("restoreSnapshot: the snapshot is cut short");
  }
  bytes = bytes.first(std::size_t(header.bytes));
  Header unsealed = header;
  unsealed.checksum = 0;
  if (formats::checksum(std::as_bytes(std::span{&unsealed, 1}), bytes.subspan(sizeof header)) != header.checksum) {
    return impl_->refuse("restoreSnapshot: the snapshot is damaged (its checksum does not match)");
  }
  return impl_->guarded(
      "restoreSnapshot", Result<std::size_t>(Error{"restoreSnapshot: out of memory"}), [&]() -> Result<std::size_t> {
        std::pmr::memory_resource* const memory = impl_->memory;
        Reader in(bytes.subspan(sizeof header));
        const auto settings = in.get<SavedSettings>(), acting = in.get<SavedSettings>();
        bool sound = std::isfinite(header.left_over) && header.left_over >= 0 && header.shown >= 0 && header.shown <= 1;
        // Bodies: present ones, or new ones. Nothing changes before all is known to be sound.
        struct Part {
          SavedBody body;
          std::span<const std::byte> state, touched, touches, factors;
        };
        internal::BodyList made(memory);
        std::vector<Part> parts;
        std::uint32_t next = 0;
        for (std::uint32_t b = 0; b < header.bodies && sound && !in.failed; ++b) {
          Part part = {in.get<SavedBody>(), {}, {}, {}, {}};
          const SavedBody& s = part.body;
          sound = !in.failed && isSound(s) && s.id >= next && s.id < header.next_body;
          if (!sound) break;
          next = s.id + 1;
          Body* body = impl_->find(BodyId{s.id});
          if (body == nullptr || body->asset->checksum() != s.package) {
            const auto same = [&s](const auto& asset) { return asset != nullptr && asset->checksum() == s.package; };
            const auto found = std::find_if(assets.begin(), assets.end(), same);
            std::shared_ptr<const Asset> asset = found != assets.end() ? *found : nullptr;
            for (const internal::BodyPointer& other : impl_->bodies) {
              if (asset == nullptr && same(other->asset)) asset = other->asset;
            }
            if (asset == nullptr) {
              return impl_->refuse("restoreSnapshot: body %u is gone, and its package is not among the assets", s.id);
            }
            const SolverFactory& solver = internal::coupledSolver();
            if (s.in_fields != 1 || solver.faultOf(*asset) != nullptr) {
              return impl_->refuse("restoreSnapshot: body %u is gone, and does not move in fields", s.id);
            }
            made.push_back(internal::makeBody(std::move(asset), {}, solver, memory));
            body = made[made.size() - 1].get();
            body->id = s.id;
            body->reset();
          }
          part.state = in.bytes(s.state_bytes);
          if (in.failed || *internal::faultOfState(part.state, *body) != '\0') sound = false;
          part.touched = in.bytes(std::uint64_t(s.touched) * sizeof(std::uint32_t));
          part.touches = in.bytes(std::uint64_t(s.touches) * sizeof(SavedTouch));
          Reader factors = in;
          std::size_t factor_bytes = 0;
          for (const Piece& piece : body->pieces) {
            const auto factor = factors.get<SavedFactor>();
            const auto& fields = body->rest().fields;  // of all levels
            const bool fits = std::any_of(fields.begin(), fields.end(), [&](const internal::Field& f) {
              return f.piece == piece.free->piece && factor.floats == floatsOfFactor(f);
            });
            sound = sound && std::isfinite(factor.h) && factor.h >= 0 &&
                    (factor.h == 0 ? factor.floats == 0 && factor.points == 0 : fits);
            const std::uint64_t size = std::uint64_t(factor.points) * sizeof(internal::SystemFactor::Point) +
                                       std::uint64_t(factor.floats) * sizeof(float);
            factors.bytes(size);
            factor_bytes += sizeof factor + std::size_t(size);
            sound = sound && !factors.failed;
            if (!sound) break;
          }
          part.factors = in.bytes(sound ? factor_bytes : 0);
          parts.push_back(part);
        }
        internal::OwningArray<Collider> colliders(memory);
        next = kGroundCollider.value + 1;
        for (std::uint32_t c = 0; c < header.colliders && sound && !in.failed; ++c) {
          const auto s = in.get<SavedCollider>();
          internal::Array<Vec3> positions(memory);
          internal::Array<formats::Triangle> triangles(memory);
          internal::Array<float> heights(memory);
          ColliderShape shape = SphereShape{s.numbers[0]};
          switch (s.kind) {
            case 0:
              shape = PlaneShape{{s.numbers[0], s.numbers[1], s.numbers[2]}, s.numbers[3]};
              break;
            case 1:
              break;
            case 2:
              shape = CapsuleShape{s.numbers[0], s.numbers[1]};
              break;
            case 3:
              shape = BoxShape{{s.numbers[0], s.numbers[1], s.numbers[2]}};
              break;
            case 5:
              in.get(positions, s.positions);
              in.get(triangles, s.triangles);
              shape = MeshShape{{positions.data(), positions.size()}, {triangles.data(), triangles.size()}};
              break;
            case 6:
              in.get(heights, s.positions);
              shape = HeightFieldShape{{heights.data(), heights.size()}, s.triangles, s.numbers[0]};
              break;
            default:
              sound = false;
          }
          const ColliderSettings& given = s.settings;
          sound = sound && !in.failed && s.id >= next && s.id < header.next_collider &&
                  internal::Shape::faultOf(shape) == nullptr && internal::isProper(s.before) &&
                  internal::isProper(s.at) && internal::isProper(s.target) && internal::faultOf(given) == nullptr;
          if (!sound) break;
          next = s.id + 1;
          Collider& collider = colliders.emplace_back(s.id, shape, given, memory);
          collider.goTo(s.before, s.at, s.target);
          for (std::size_t k = 0; k < 3; ++k) {
            collider.impulse[Eigen::Index(k)] = s.reaction[k];
            collider.torque[Eigen::Index(k)] = s.reaction[3 + k];
          }
        }
        internal::Array<internal::TouchMemory> touching(memory);
        in.get(touching, header.touching);
        if (!sound || !in.done()) return impl_->refuse("restoreSnapshot: the snapshot is damaged");

        internal::BodyList bodies(memory);
        for (std::size_t b = 0; b < parts.size(); ++b) bodies.emplace_back();  // memory first
        // Ids ascend in all three.
        for (std::size_t b = 0, fresh = 0, old = 0; b < parts.size(); ++b) {
          const std::uint32_t id = parts[b].body.id;
          if (fresh < made.size() && made[fresh]->id == id) {
            bodies[b] = std::move(made[fresh++]);
            continue;
          }
          while (impl_->bodies[old]->id != id) ++old;
          bodies[b] = std::move(impl_->bodies[old++]);
        }
        impl_->bodies.swap(bodies);
        impl_->colliders.swap(colliders);
        impl_->events.clear();
        impl_->contact_sums.clear();
        impl_->contacts.clear();
        impl_->visual.invalidate();
        // Ids are free for their saved owners.
        for (const internal::BodyPointer& body : impl_->bodies) {
          body->picks.clear();
          internal::removePinSets(*body);
          body->activity = Activity::active;
          body->sleeps_with = formats::kNone;
        }
        bool whole = true;
        for (std::size_t b = 0; b < parts.size(); ++b) {
          const SavedBody& s = parts[b].body;
          Body& body = *impl_->bodies[b];
          const SolverFactory* const solver = body.settings.solver;
          body.settings = {};
          body.settings.position = s.position;
          body.settings.rotation = s.rotation;
          body.settings.stiffness_scale = s.stiffness_scale;
          body.settings.keep_previous = s.keep_previous != 0;
          body.settings.friction = s.friction;
          body.settings.layers = s.layers;
          body.settings.touches = s.can_touch;
          body.settings.self_contact = s.self_contact != 0;
          body.settings.gravity_scale = s.gravity_scale;
          body.settings.drag = s.drag;
          body.settings.support_damping = s.support_damping;
          body.settings.level = s.level;
          body.settings.package_pins = s.package_pins != 0;
          body.settings.solver = solver;
          whole = bool(restoreState({s.id}, parts[b].state)) && whole;
        }
        for (std::size_t b = 0; b < parts.size(); ++b) {
          const SavedBody& s = parts[b].body;
          Body& body = *impl_->bodies[b];
          body.activity = s.activity;
          body.sleeps_with = s.sleeps_with;
          Reader(parts[b].touched).get(body.touched, s.touched);
          body.touches.clear();
          body.touches_in = s.touches_in;
          Reader touches(parts[b].touches), factors(parts[b].factors);
          for (std::uint32_t t = 0; t < s.touches; ++t) {
            const auto from = touches.get<SavedTouch>();
            const auto at = [&](std::size_t k) {
              return Eigen::Vector3d(from.values[k], from.values[k + 1], from.values[k + 2]);
            };
            if (impl_->colliderOf(from.collider) == nullptr) continue;
            body.touches.push_back({from.collider, at(0), at(3), at(6), from.values[12], at(9), from.speed});
          }
          for (Piece& piece : body.pieces) {
            const auto factor = factors.get<SavedFactor>();
            factors.get(piece.system.points, factor.points);
            factors.get(piece.system.factor, factor.floats);
            piece.system.h = factor.floats == floatsOfFactor(piece.field()) ? factor.h : 0;
          }
        }
        impl_->together.touching.swap(touching);
        impl_->findTouching();
        impl_->settings = restored(settings);
        impl_->acting = restored(acting);
        impl_->next_body = header.next_body;
        impl_->next_pick = header.next_pick;
        impl_->next_pin_set = header.next_pin_set;
        impl_->next_collider = header.next_collider;
        impl_->left_over = header.left_over;
        impl_->shown = header.shown;
        if (!whole) return Error{"restoreSnapshot: out of memory"};
        return std::size_t(header.bytes);
      });
}

}  // namespace sinew
