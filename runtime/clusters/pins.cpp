// SPDX-License-Identifier: MIT
#include "runtime/clusters/pins.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "runtime/clusters/goal.h"

namespace sinew::internal {
namespace {

// Written out: it is done for every pinned vertex, twice a pass.
Vector3 placeOf(const RigidTransform& at, const Vec3& local) {
  const Mat3& r = at.rotation;
  const auto row = [&](std::size_t k) {
    return r[3 * k] * local[0] + r[3 * k + 1] * local[1] + r[3 * k + 2] * local[2] + at.position[k];
  };
  return {row(0), row(1), row(2)};
}

bool isHeldByRows(const PinSet& set) { return set.method == PinMethod::hold; }

void addRow(Body& body, std::uint32_t vertex, const Vector3& target, float weight, float pass_seconds) {
  Row row;
  row.kind = RowKind::hold;
  row.point = RowPoint::physical_vertex;
  row.index = vertex;
  row.target = target;
  row.weight = weight;
  row.impulse = pass_seconds * pass_seconds * asVector(body.force[vertex]);
  body.rows.push_back(row);
}

// A force on the body at a place, N, over the pass; the reaction on the owner is its opposite.
void addForce(PinSet& set, const Eigen::Vector3d& f, const Vector3& place) {
  set.force_sum -= f;
  set.torque_sum -= (place - asVector(set.at.position)).cast<double>().cross(f);
}

}  // namespace

RigidTransform betweenTransforms(const RigidTransform& from, const RigidTransform& to, float part) {
  if (part >= 1) return to;
  RigidTransform result;
  asVector(result.position) = asVector(from.position) + part * (asVector(to.position) - asVector(from.position));
  const Eigen::Quaternionf a(asMatrix(from.rotation)), b(asMatrix(to.rotation));
  const Matrix3 rotation = a.slerp(part, b).normalized().toRotationMatrix();
  for (int k = 0; k < 9; ++k) result.rotation[std::size_t(k)] = rotation(k / 3, k % 3);
  return result;
}

namespace {

// Whether the vertices of a set count as held.
void setHeld(Body& body, const PinSet& set, bool held) {
  for (const PinnedVertex& vertex : set.vertices) {
    body.pinned[vertex.vertex] = held ? 1 : 0;
    body.force[vertex.vertex] = {};
  }
}

}  // namespace

// Fits are remade as a whole: sets come and go rarely. Where memory runs out, the body keeps those that it had.
void rebuildFits(Body& body) {
  std::pmr::memory_resource* const memory = body.fits.memory();
  struct Reached {
    std::uint32_t cluster;
    PinPoint point;
  };
  Array<Reached> reached(memory);
  for (std::uint32_t s = 0; s < body.pin_sets.size(); ++s) {
    const PinSet& set = body.pin_sets[s];
    if (isHeldByRows(set)) continue;
    for (std::uint32_t item = 0; item < set.vertices.size(); ++item) {
      const PinnedVertex& vertex = set.vertices[item];
      for (const ClusterUse& use : body.rest().usesOf(vertex.vertex)) {
        const formats::Cluster& cluster = body.package().clusters()[use.cluster];
        const float mu = use.share * body.vertices()[vertex.vertex].mass / cluster.mass;
        reached.push_back({use.cluster, {vertex.vertex, s, item, vertex.weight, mu, asVector(vertex.local)}});
      }
    }
  }
  // By cluster, and as they come, which is by set and item.
  Array<std::uint64_t> order(reached.size(), memory);
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = (std::uint64_t(reached[k].cluster) << 32) | k;
  sortAscending(order);
  OwningArray<PinFit> fits(memory);
  Array<std::uint32_t> fit_of(memory);
  Array<PinPoint> points(memory);
  if (!reached.empty()) fit_of.resize(body.clusterCount(), formats::kNone);
  for (std::size_t k = 0; k < order.size();) {
    const std::uint32_t cluster = std::uint32_t(order[k] >> 32);
    PinMethod method = PinMethod::infinite_mass;
    points.clear();
    for (; k < order.size() && order[k] >> 32 == cluster; ++k) {
      const PinPoint& point = reached[std::uint32_t(order[k])].point;
      method = std::max(method, body.pin_sets[point.set].method);
      points.push_back(point);
    }
    fit_of[cluster] = std::uint32_t(fits.size());
    fits.emplace_back(body.package(), cluster, method, points, memory);
  }
  body.fits.swap(fits);
  body.fit_of.swap(fit_of);
}

void addPinSet(Body& body, PinSet&& set) {
  const Matrix3 rotation = asMatrix(set.at.rotation);
  for (PinnedVertex& vertex : set.vertices) {
    const Vector3 arm = asVector(body.x[vertex.vertex]) - asVector(set.at.position);
    vertex.local = asArray(rotation.transpose() * arm);
  }
  body.pin_sets.push_back(std::move(set));
  try {
    rebuildFits(body);
  } catch (...) {
    body.pin_sets.pop_back();
    throw;
  }
  setHeld(body, body.pin_sets.back(), true);
}

void setPackagePins(Body& body, std::uint32_t& next_id) {
  const formats::PackageView& package = body.package();
  const auto weights = package.pinWeights();
  OwningArray<PinSet> sets(body.pin_sets.memory());
  Array<std::uint8_t> held(body.pin_sets.memory());
  const std::size_t count = body.settings.package_pins ? package.pinSets().size() : 0;
  if (count > 0) held.resize(body.vertexCount());
  for (std::uint32_t s = 0; s < count; ++s) {
    const formats::PinSet& source = package.pinSets()[s];
    PinSet set(body.pin_sets.memory());
    set.source = s;
    set.method = PinMethod(source.method);
    set.at = set.target = {body.settings.position, body.settings.rotation};
    for (const std::uint32_t vertex : package.pinSetVertices().subspan(source.first, source.count)) {
      const float weight = weights.empty() ? 1.0F : weights[vertex];
      if (!(weight > 0) || held[vertex] != 0) continue;
      set.vertices.push_back({vertex, weight, body.vertices()[vertex].rest_position});
      held[vertex] = 1;
    }
    if (set.vertices.empty()) continue;
    set.id = next_id + std::uint32_t(sets.size());
    sets.push_back(std::move(set));
  }
  body.pin_sets.swap(sets);
  try {
    rebuildFits(body);
  } catch (...) {
    body.pin_sets.swap(sets);
    throw;
  }
  next_id += std::uint32_t(body.pin_sets.size());
}

void removePinSets(Body& body) {
  for (const PinSet& set : body.pin_sets) setHeld(body, set, false);
  body.pin_sets.clear();
  body.fits.clear();
  body.fit_of.clear();
}

void removePinSet(Body& body, std::size_t index) {
  PinSet removed = std::move(body.pin_sets[index]);
  body.pin_sets.erase(index);
  try {
    rebuildFits(body);
  } catch (...) {
    body.pin_sets.insert(index, std::move(removed));  // there is room
    throw;
  }
  setHeld(body, removed, false);
  body.centers_known = false;
}

void addPinRows(Body& body, float pass_seconds, std::uint32_t passes_left) {
  for (const Pin& pin : body.pins) {
    addRow(body, pin.vertex, pinPosition(asVector(body.x[pin.vertex]), asVector(pin.target), passes_left), 1,
           pass_seconds);
  }
  for (const PinSet& set : body.pin_sets) {
    if (!isHeldByRows(set)) continue;
    for (const PinnedVertex& vertex : set.vertices) {
      addRow(body, vertex.vertex, placeOf(set.at, vertex.local), vertex.weight, pass_seconds);
    }
  }
}

void placePins(Body& body, float pass_seconds, std::uint32_t passes_left) {
  for (PinSet& set : body.pin_sets) {
    if (set.first_pass) {
      set.first_pass = false;
      set.force_sum.setZero();
      set.torque_sum.setZero();
      set.passes = 0;
    }
    set.at = betweenTransforms(set.at, set.target, 1.0F / float(passes_left));
    ++set.passes;
    if (passes_left == 1) set.first_pass = true;
    if (isHeldByRows(set)) continue;
    for (const PinnedVertex& vertex : set.vertices) {
      if (vertex.weight < 1) continue;
      auto y = asVector(body.y[vertex.vertex]);
      const Vector3 place = placeOf(set.at, vertex.local);
      const double mass = double(body.vertices()[vertex.vertex].mass), h = double(pass_seconds);
      addForce(set, mass / (h * h) * (place - y).cast<double>(), place);
      y = place;
    }
  }
  for (PinFit& fit : body.fits) {
    fit.prepare(body.package(), body.rest(), body.settings.stiffness_scale, pass_seconds);
    for (PinFit::Group& group : fit.groups()) {
      const RigidTransform& at = body.pin_sets[group.set].at;
      group.rotation = widened(asMatrix(at.rotation));
      group.place = placeOf(at, asArray(group.mean));
    }
  }
}

void beginPinFits(Body& body) {
  for (PinFit& fit : body.fits) {
    const ClusterBlock& block = body.blocks[fit.cluster() / 8];
    for (int k = 0; k < 3; ++k) fit.momentCenter()[k] = block.center[k][fit.cluster() % 8];
  }
}

void holdPins(Body& body, float pass_seconds, std::uint32_t passes_left) {
  for (const Pin& pin : body.pins) {
    const Vector3 start = asVector(body.x[pin.vertex]);
    const Vector3 end = pinPosition(start, asVector(pin.target), passes_left);
    asVector(body.y[pin.vertex]) = end;
    asVector(body.v[pin.vertex]) = (end - start) / pass_seconds;
  }
  const float to_force = 1.0F / (pass_seconds * pass_seconds);
  for (const PinFit& fit : body.fits) {
    // What the fit did to the cluster as a whole: the goals' force and torque, Σ mu (g - y) and Σ mu y x (g - y).
    const formats::Cluster& cluster = body.package().clusters()[fit.cluster()];
    const ClusterFrame frame = loadFrame(body.blocks, fit.cluster());
    const double scale =
        double(to_force) * double(cluster.mass) * double(body.stiffness->clusters[fit.cluster()].alpha);
    const Eigen::Vector3d force = scale * (frame.center - fit.momentCenter()).cast<double>();
    Eigen::Vector3d torque = Eigen::Vector3d::Zero();
    const int columns = cluster.mode == formats::ClusterMode::quadratic ? 9 : 3;
    for (int k = 0; k < columns; ++k) {
      torque += frame.a_pq.col(k).cast<double>().cross(frame.f.col(k).cast<double>());
    }
    torque *= scale * double(cluster.radius) * double(cluster.radius);
    for (const PinFit::Group& group : fit.groups()) {
      PinSet& set = body.pin_sets[group.set];
      const double part = double(group.count) / double(fit.pointCount());
      const Eigen::Vector3d arm = (fit.momentCenter() - asVector(set.at.position)).cast<double>();
      set.force_sum -= part * force;
      set.torque_sum -= part * (torque + arm.cross(force));
    }
  }
  for (PinSet& set : body.pin_sets) {
    for (const PinnedVertex& vertex : set.vertices) {
      auto y = asVector(body.y[vertex.vertex]);
      const Vector3 start = asVector(body.x[vertex.vertex]), place = placeOf(set.at, vertex.local);
      if (isHeldByRows(set)) {
        const float part = body.rest().masses[vertex.vertex];
        const Vector3 acceleration =
            asVector(body.force[vertex.vertex]) + vertex.weight * part * to_force * (place - y);
        addForce(set, double(body.package().info().total_mass) * acceleration.cast<double>(), place);
        y = vertex.weight < 1 ? Vector3(y + vertex.weight * (place - y)) : place;
      } else if (vertex.weight >= 1) {
        y = place;
      } else {
        continue;
      }
      asVector(body.v[vertex.vertex]) = (y - start) / pass_seconds;
    }
  }
}

void finishMatch(Body& body, float pass_seconds) {
  MechanicsState& state = body.mechanics;
  if (state.shapes.empty() && state.previous.empty()) return;
  for (std::uint32_t c = 0; c < body.clusterCount(); ++c) {
    const formats::Cluster& cluster = body.package().clusters()[c];
    const formats::ClusterMechanics& mechanics = body.package().mechanics()[c];
    if (cluster.mode == formats::ClusterMode::rigid) continue;
    const ClusterFrame frame = loadFrame(body.blocks, c);
    const Matrix3 r = geometry::rotationMatrix(frame.rotation);
    if (!state.previous.empty()) body.rememberDeformation(c);
    if (!state.shapes.empty() && body.blocks[c / 8].limited[c % 8] == 0 &&
        updatePlasticity(mechanics, r, frame.f.leftCols<3>(), pass_seconds, state.shapes[c])) {
      state.updateShape(body.package(), c);
    }
  }
}

}  // namespace sinew::internal
