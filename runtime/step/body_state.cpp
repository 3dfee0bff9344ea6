// SPDX-License-Identifier: MIT
#include "runtime/step/body_state.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/contact/contacts.h"
#include "runtime/geometry/rotation.h"
#include "runtime/geometry/smoothstep.h"
#include "runtime/interact/pin_sets.h"
#include "runtime/solver/holds.h"
#include "runtime/solver/plasticity.h"
#include "runtime/step/rigid.h"

namespace sinew::internal {
namespace {

/// The four vertices that carry a rigid part: as their rest shape, turned and moved to where they are.
void stiffen(Body& body, const formats::Cluster& cluster) {
  std::array<std::uint32_t, 4> corner = {};
  std::size_t found = 0;
  for (const formats::Membership& member :
       body.package().memberships().subspan(cluster.first_member, cluster.member_count)) {
    if (member.share > 0 && found < 4) corner[found++] = member.vertex;
  }
  if (found < 4) return;
  Vector3 rest_middle = Vector3::Zero(), middle = Vector3::Zero();
  for (const std::uint32_t v : corner) {
    rest_middle += 0.25F * asVector(body.vertices()[v].rest_position);
    middle += 0.25F * asVector(body.x[v]);
  }
  Matrix3 moment = Matrix3::Zero();
  for (const std::uint32_t v : corner) {
    moment += Vector3(asVector(body.x[v]) - middle) *
              Vector3(asVector(body.vertices()[v].rest_position) - rest_middle).transpose();
  }
  const Matrix3 rotation = geometry::nearestRotation(moment);
  for (const std::uint32_t v : corner) {
    body.x[v] = asArray(middle + rotation * (asVector(body.vertices()[v].rest_position) - rest_middle));
  }
}

/// How long what a change of level has lost is drawn, s.
constexpr double kFadeSeconds = 0.3;

/// Adds what the last change of level has lost. \param part as of refresh(). \pre body.shape are the coefficients drawn
void drawFaded(Body& body, const Piece& piece, double part, const Vector3d& center, std::uint32_t count) {
  const Field& field = piece.field();
  const double left = (body.fade_left + (1 - part) * (body.fade_before - body.fade_left)) / kFadeSeconds;
  const float weight = float(geometry::smoothstep(left));
  const ConstCoefficientMap z(body.shape.data()->data(), Eigen::Index(field.k), 3);
  const Matrix3 turned = weight * rotationOf(field, z, center).cast<float>();
  for (std::uint32_t v = field.first_vertex; v < field.first_vertex + count; ++v) {
    body.x[v] = asArray(Vector3(asVector(body.x[v]) + turned * asVector(body.faded[v])));
  }
}

void resizeState(Piece& piece) {
  const std::size_t k = piece.field().k;
  for (Array<Vector3d>* array : piece.state.vectors()) array->resize(k);
  piece.springs_firm = -1;
  piece.system.h = 0;
}

/// There was no step before.
void standStill(PieceState& state) {
  std::copy(state.z.begin(), state.z.end(), state.z_before.begin());
  std::copy(state.v.begin(), state.v.end(), state.v_before.begin());
  state.turn.setZero();
  state.h_before = 0;
  state.endImpact();
}

/// Adds what the functions lack where the piece is held and picked, to its first vertices. \pre body.shape are the
/// coefficients drawn
void drawGive(Body& body, const Piece& piece, double part, const Vector3d& center, std::uint32_t count) {
  const Field& field = piece.field();
  const ConstCoefficientMap z(body.shape.data()->data(), Eigen::Index(field.k), 3);
  const Matrix3d of_piece = rotationOf(field, z, center);
  const RigidPlace place = placeOfHolds(body, piece, part, {of_piece, center - of_piece * field.rest_center});
  const std::span<Vec3> x(body.x.data() + field.first_vertex, count);
  body.amplitudes.resize(field.residual_modes);
  if (piece.holds.count > 0) {
    findWays(body, piece, z, place, part, body.ways);
    findAmplitudes(piece, body.ways, body.amplitudes);
    giveWay(field, body.amplitudes, place.turned, body.field_values, x, [](std::uint32_t) { return 1.0F; });
  }
  if (findPickAmplitudes(body, piece, z, place.turned, body.amplitudes) == 0) return;
  giveWay(field, body.amplitudes, place.turned, body.field_values, x, PickWindow(body, piece));
}

}  // namespace

void restPiece(const Body& body, Piece& piece) {
  resizeState(piece);
  const Field& field = piece.field();
  Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(body.settings.rotation[std::size_t(i)]);
  const Vector3d position = asVector(body.settings.position).cast<double>();
  PieceState& state = piece.state;
  for (std::uint32_t j = 0; j < field.k; ++j) {
    state.z[j] = rotation * field.restOf(j) + field.oneOf(j) * position;
    state.v[j].setZero();
  }
  standStill(state);
  state.elastic = state.budget = piece.fibres.empty() ? 0 : -1;
  state.touching.clear();
  resetPlasticity(field, state.plastic);
  invertPlasticity(state.plastic, piece.rest_change);
}

namespace {

/// to += factor from, n numbers each.
void addTimes(float factor, const float* from, float* to, std::size_t n) {
  std::size_t i = 0;
  for (; i + 4 <= n; i += 4) Eigen::Array4f::Map(to + i) += factor * Eigen::Array4f::Map(from + i);
  for (; i < n; ++i) to[i] += factor * from[i];
}

/// S of 1/2 sum S_ij z_i . z_j: a tension in proportion to the stretch, a / (1 - a gamma) of that of full activation,
/// so that a cluster of contraction gamma activated to a shortens by a gamma.
void makeFibres(const Body& body, float stiffness, Piece& piece) {
  const Field& field = piece.field();
  const std::size_t k = field.k;
  piece.fibres.clear();
  for (const FibreStiffness& fibre : field.fibres) {
    const formats::ClusterMechanics& mechanics = body.package().mechanics()[fibre.cluster];
    const float activation = body.activation[mechanics.channel];
    if (!(activation > 0)) continue;
    const float factor = stiffness * activation / (1 - activation * mechanics.contraction);
    if (piece.fibres.empty()) {
      piece.fibres.resize(k * k);
      piece.fibre_pull.resize(4 * k);
      std::fill(piece.fibres.begin(), piece.fibres.end(), 0.0F);
      std::fill(piece.fibre_pull.begin(), piece.fibre_pull.end(), 0.0F);
      piece.fibre_energy = 0;
    }
    addTimes(factor, fibre.pull, piece.fibre_pull.data(), 4 * k);
    piece.fibre_energy += double(factor) * fibre.energy;
    const float* from = fibre.matrix;
    for (std::size_t row = 0; row < k; ++row, from += row) {
      addTimes(factor, from, piece.fibres.data() + k * row, row + 1);
    }
  }
  for (std::size_t row = 0; row < k && !piece.fibres.empty(); ++row) {
    for (std::size_t column = 0; column < row; ++column) {
      piece.fibres[k * column + row] = piece.fibres[k * row + column];
    }
  }
}

}  // namespace

void updateFibres(Body& body, bool changed) {
  for (Piece& piece : body.pieces) {
    if (piece.field().fibres.empty() && piece.fibres.empty()) continue;
    piece.fibres_changed = true;
    if (changed) piece.state.elastic = piece.state.budget = -1;
  }
}

void makeFibres(Body& body) {
  const float stiffness = body.settings.stiffness_scale * body.settings.stiffness_scale;
  for (Piece& piece : body.pieces) {
    if (std::exchange(piece.fibres_changed, false)) makeFibres(body, stiffness, piece);
  }
}

void refresh(Body& body, double part, Asked what) {
  const bool all = what == Asked::all;
  if (!body.outdated && body.shown == part && (body.whole || !all)) return;
  body.outdated = false;
  body.shown = part;
  body.whole = all;
  const double left = 1 - part;
  for (const Piece& piece : body.pieces) {
    const Field& field = piece.field();
    const std::uint32_t count = all ? field.vertex_count : field.drawn_count, blocks = (count + 7) / 8;
    Array<float>&coefficients = body.coefficients, &out = body.field_values;
    coefficients.resize(4 * std::size_t(field.k));
    out.resize(24 * std::size_t(blocks));
    const PieceState& state = piece.state;
    const Vector3d now = meanOf(field, piece.z());
    const Vector3d before = meanOf(field, {state.z_before.data()->data(), Eigen::Index(field.k), 3});
    const Vector3d center = left * before + part * now;
    const Matrix3d onward = turnBy(part * state.turn), back = turnBy(-left * state.turn);
    body.shape.resize(field.k);
    for (const bool moving : {false, true}) {
      if (moving && !all) break;
      for (std::uint32_t j = 0; j < field.k; ++j) {
        const double one = field.oneOf(j);
        const Vector3d row = moving ? Vector3d(left * state.v_before[j] + part * state.v[j])
                                    : Vector3d(left * (onward * (state.z_before[j] - one * before)) +
                                               part * (back * (state.z[j] - one * now)));
        for (std::uint32_t c = 0; c < 3; ++c) coefficients[4 * j + c] = float(row[int(c)]);
        if (!moving) body.shape[j] = row + one * center;
      }
      kernels().field_values({field.k, blocks, field.values, coefficients.data(), out.data()});
      Array<Vec3>& to = moving ? body.v : body.x;
      for (std::uint32_t i = 0; i < count; ++i) {
        for (std::size_t c = 0; c < 3; ++c) {
          const float value = out[24 * (i / 8) + 8 * c + i % 8];
          to[field.first_vertex + i][c] = moving ? value : float(double(value) + center[int(c)]);
        }
      }
    }
    const bool gives = piece.holds.count > 0 || (!body.picks.empty() && field.residual_modes > 0);
    if (gives && piece.springs_firm >= 0) drawGive(body, piece, part, center, count);
    if (body.fade_before > 0) drawFaded(body, piece, part, center, count);
  }
  // A rigid rider keeps its shape.
  for (const formats::AttachedPart& rider : body.package().parts()) {
    if (rider.cluster != formats::kNone) stiffen(body, body.package().clusters()[rider.cluster]);
  }
  // Held vertices are drawn at their holds: springs leave the local give to the vertex itself.
  for (const Pin& pin : body.pins) {
    body.x[pin.vertex] = asArray(Vector3(float(left) * asVector(pin.before) + float(part) * asVector(pin.at)));
  }
  for (const PinSet& set : body.pin_sets) {
    const RigidTransform at = between(set.before, set.at, part);
    for (const PinnedVertex& vertex : set.vertices) {
      const auto to = asVector(body.x[vertex.vertex]);
      const Vector3 place = placeOf(at, vertex.local).cast<float>();
      body.x[vertex.vertex] = asArray(to + vertex.weight * (place - to));
    }
  }
}

void project(Body& body, bool touching) {
  for (Piece& piece : body.pieces) {
    const Field& field = piece.field();
    PieceState& state = piece.state;
    resizeState(piece);
    Vector3d center = Vector3d::Zero();
    double mass = 0;
    for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
      const double m = double(body.vertices()[field.first_vertex + i].mass);
      center += m * asVector(body.x[field.first_vertex + i]).cast<double>();
      mass += m;
    }
    center /= mass;
    for (const bool moving : {false, true}) {
      Array<Vector3d>& to = moving ? state.v : state.z;
      std::fill(to.begin(), to.end(), Vector3d::Zero());
      if (field.driven > 0) {
        // The pin sets prescribe these.
        for (std::uint32_t j = 0; j < field.driven && !moving; ++j) {
          for (const PinSet& set : body.pin_sets) {
            if (set.source != field.functions[j].pin_set) continue;
            const std::uint32_t monomial = field.functions[j].monomial;
            for (std::size_t c = 0; c < 3; ++c) {
              to[j][int(c)] = double(monomial == 0 ? set.at.position[c] : set.at.rotation[3 * c + monomial - 1]);
            }
            if (monomial == 0) to[j] -= center;
          }
        }
      }
      // The functions are orthonormal but for rounding: a second round takes what the first has left.
      Array<Vector3d>& more = body.shape;
      for (int round = 0; round < 2; ++round) {
        more.resize(field.k);
        std::fill(more.begin(), more.end(), Vector3d::Zero());
        for (std::uint32_t i = 0; i < field.vertex_count; ++i) {
          const std::uint32_t vertex = field.first_vertex + i;
          Vector3d left = asVector(moving ? body.v[vertex] : body.x[vertex]).cast<double>();
          if (!left.allFinite()) continue;
          if (!moving) left -= center;
          for (std::uint32_t j = 0; j < field.k; ++j) left -= double(field.valueAt(i, j)) * to[j];
          left *= double(body.vertices()[vertex].mass);
          for (std::uint32_t j = field.driven; j < field.k; ++j) more[j] += double(field.valueAt(i, j)) * left;
        }
        for (std::uint32_t j = field.driven; j < field.k; ++j) to[j] += more[j];
      }
      if (moving) continue;
      for (std::uint32_t j = 0; j < field.k; ++j) to[j] += field.oneOf(j) * center;
    }
    standStill(state);
    state.elastic = -1;
    state.budget = -1;
    if (!touching) state.touching.clear();
  }
  body.outdated = true;
}

bool chooseFields(Body& body) {
  bool changed = false;
  for (Piece& piece : body.pieces) {
    bool held = piece.fixed != nullptr;
    if (held) {
      for (std::uint32_t j = 0; j < piece.fixed->driven; ++j) {
        const std::uint32_t source = piece.fixed->functions[j].pin_set;
        held = held && std::any_of(body.pin_sets.begin(), body.pin_sets.end(),
                                   [source](const PinSet& set) { return set.source == source; });
      }
    }
    piece.springs_firm = -1;
    piece.system.h = 0;
    if (held == piece.state.held) continue;
    const Field& before = piece.field();
    piece.state.held = held;
    movePlasticity(before, piece.field(), piece.state.plastic);
    invertPlasticity(piece.state.plastic, piece.rest_change);
    changed = true;
  }
  if (changed) updateFibres(body);
  return changed;
}

void useLevel(const Body& body, Piece& piece, std::uint32_t level) {
  const std::uint32_t number = piece.free->piece;
  piece.free = fieldOf(body.rest().fields, number, false, level);
  piece.fixed = fieldOf(body.rest().fields, number, true, level);
  findReach(*piece.free, piece.reach_free);
  if (piece.fixed != nullptr) findReach(*piece.fixed, piece.reach_fixed);
  piece.springs_firm = -1;
  piece.system.h = 0;
}

void endFade(Body& body) {
  if (!(body.fade_before > 0)) return;
  body.fade_left = body.fade_before = 0;
  body.outdated = true;
  refresh(body, 1, Asked::all);
}

std::uint32_t levelOf(const Body& body) { return std::min(body.settings.level, body.asset->levels() - 1); }

void changeLevel(Body& body) {
  refresh(body, 1, Asked::all);
  body.faded.resize(body.x.size());
  std::copy(body.x.begin(), body.x.end(), body.faded.begin());
  endFade(body);
  for (Piece& piece : body.pieces) {
    const Field& before = piece.field();
    useLevel(body, piece, levelOf(body));
    movePlasticity(before, piece.field(), piece.state.plastic);
    invertPlasticity(piece.state.plastic, piece.rest_change);
  }
  updateFibres(body);
  project(body, true);
  refresh(body, 1, Asked::all);
  for (const Piece& piece : body.pieces) {
    const Field& field = piece.field();
    const Matrix3 back = rotationOf(field, piece.z(), meanOf(field, piece.z())).transpose().cast<float>();
    for (std::uint32_t v = field.first_vertex; v < field.first_vertex + field.vertex_count; ++v) {
      body.faded[v] = asArray(Vector3(back * (asVector(body.faded[v]) - asVector(body.x[v]))));
    }
  }
  body.fade_left = body.fade_before = kFadeSeconds;
  body.outdated = true;
}

void passFade(Body& body, double seconds) {
  body.fade_before = body.fade_left;
  body.fade_left = std::max(0.0, body.fade_left - seconds);
  if (body.fade_before > 0) body.outdated = true;
}

double kineticEnergy(const Body& body) {
  double energy = 0;
  for (const Piece& piece : body.pieces) {
    for (const Vector3d& row : piece.state.v) energy += 0.5 * row.squaredNorm();
  }
  return energy;
}

double elasticEnergy(Body& body, PieceScratch& scratch) {
  double energy = 0;
  for (Piece& piece : body.pieces) {
    const Field& field = piece.field();
    MinimizeScratch& s = scratch.minimize;
    scratch.reserve(piece);
    const Vector3d center = meanOf(field, std::as_const(piece).z());
    Objective objective;
    objective.field = &field;
    objective.h = 1;
    objective.stiffness = body.settings.stiffness_scale * body.settings.stiffness_scale;
    objective.scratch = &s;
    setMaterial(piece, objective);
    s.contacts.clear();
    std::fill_n(s.d.begin(), 4 * field.k, 0.0F);
    objective.setFrame({piece.state.z.data(), field.k}, center, rotationOf(field, std::as_const(piece).z(), center));
    energy += objective.elastic(s.d.data(), s.next_gradient.data(), true);
  }
  return energy;
}

}  // namespace sinew::internal
