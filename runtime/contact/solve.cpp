// SPDX-License-Identifier: MIT
//
// Rows on goals, docs/method.md §6. An impulse Λ (kg m) at a point with rest offset q~ in cluster c, which owns `share`
// of it, moves the cluster's centre by share Λ / M and its moment A_pq by share Λ q~^T / (M radius): exactly what the
// same displacement of the vertex would have done before matching. So feet carry a body however little they weigh, and
// every force passes through the match: it turns, tips and deforms the body as the match deems right.
#include "runtime/contact/solve.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "runtime/clusters/goal.h"
#include "runtime/clusters/match.h"

namespace sinew::internal {
namespace {

// Rows give way by this part of their own response. Rows that contradict one another (a dented sole pressed flat, pins
// set apart) then share the error instead of driving their impulses without bound.
constexpr float kRelativeCompliance = 1e-1F;
// Many pins on few clusters are nearly redundant: stiffer than this, the sweeps of one pass leave an error that the
// warm start carries on and that grows (87 pins on a spider of nine clusters; sixty sweeps converge, and agree).
constexpr float kHoldCompliance = 1e-1F;

// Turn of a cluster, radians, and move of a point, diagonals, that one relaxation of a row may cause.
constexpr float kLargestTurn = 0.5F;
constexpr float kLargestMove = 0.25F;

// A part whose rows are further off than this, in diagonals, is first moved there as a whole.
constexpr float kFarOff = 0.25F;

// Where a row touches a cluster, calls visit(cluster index, coefficient, rest position).
template <class Visit>
void forEachTerm(const Body& body, const Row& row, const Visit& visit) {
  const formats::PackageView& package = body.package();
  const auto at_vertex = [&](std::uint32_t vertex, float weight) {
    const Vector3 rest = asVector(package.physicalVertices()[vertex].rest_position);
    for (const ClusterUse& use : body.rest().usesOf(vertex)) visit(use.cluster, weight * use.share, rest);
  };
  if (row.point == RowPoint::physical_vertex) {
    at_vertex(row.index, 1.0F);
  } else if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& attachment = package.barycentric()[row.index];
    const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
    const auto& w = attachment.weight;
    at_vertex(corners[0], w[0]);
    at_vertex(corners[1], w[1]);
    at_vertex(corners[2], w[2]);
    at_vertex(corners[3], 1.0F - w[0] - w[1] - w[2]);
  } else if (!package.clusterAttachmentRanges().empty()) {
    const formats::ClusterAttachmentRange range = package.clusterAttachmentRanges()[row.index];
    const Vector3 rest = asVector(package.visualPositions()[row.index]);
    for (const formats::ClusterAttachment& attachment :
         package.clusterAttachments().subspan(range.first, range.count)) {
      visit(attachment.cluster, attachment.weight, rest);
    }
  }
}

Vector3 pointOf(const Body& body, const Row& row) {
  Vector3 point = Vector3::Zero();
  forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vector3& rest) {
    point += coefficient * clusterGoal(body.package().clusters()[c], body.rest().clusters[c], body.frames[c], rest);
  });
  return point;
}

// Masses here are relative to the body's, and impulses with them: those of a body of 1e9 m have no squares in float.
float relativeMass(const Body& body, const formats::Cluster& cluster) {
  return cluster.mass / body.package().info().total_mass;
}

// \param shift the impulse over the cluster's mass, metres.
template <int N>
void pushMoments(const formats::Cluster& cluster, const ClusterRest& rest, const Vector3& shift,
                 const Vector3& position, ClusterFrame& frame) {
  const Monomials<N> q = monomials<N>(restOffset(cluster, position)) - rest.mean.head<N>();
  frame.center += shift;
  frame.a_pq.leftCols<N>() += (shift / cluster.radius) * q.transpose();
}

void pushMoments(const formats::Cluster& cluster, const ClusterRest& rest, const Vector3& shift,
                 const Vector3& position, ClusterFrame& frame) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    pushMoments<9>(cluster, rest, shift, position, frame);
  } else {
    pushMoments<3>(cluster, rest, shift, position, frame);
  }
}

// The same with the frame's F following to first order, so that later rows of the sweep see it.
template <int N>
void push(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
          const ClusterResponse& response, const Vector3& shift, const Vector3& position, ClusterFrame& frame) {
  const Monomials<N> q = monomials<N>(restOffset(cluster, position)) - rest.mean.head<N>();
  const Vector3 scaled = shift / cluster.radius;
  frame.center += shift;
  frame.a_pq.leftCols<N>() += scaled * q.transpose();
  const Vector3 arm = geometry::rotationMatrix(frame.rotation) * q.template head<3>();
  Vector3 turn = response.inertia_inverse * arm.cross(scaled);
  // First order holds for small turns only.
  const float angle = turn.norm();
  if (angle > kLargestTurn) turn *= kLargestTurn / angle;
  for (int k = 0; k < N; ++k) frame.f.col(k) += turn.cross(response.lever.col(k));
  if (stiffness.deforms) {
    const Monomials<N> sq = stiffness.s.topLeftCorner<N, N>() * q;
    frame.f.leftCols<N>() += scaled * sq.transpose();
  }
}

// The fit of a pinned cluster; null for others.
PinFit* fitOf(Body& body, std::uint32_t cluster) {
  const bool none = body.fit_of.empty() || body.fit_of[cluster] == formats::kNone;
  return none ? nullptr : &body.fits[body.fit_of[cluster]];
}
const PinFit* fitOf(const Body& body, std::uint32_t cluster) {
  const bool none = body.fit_of.empty() || body.fit_of[cluster] == formats::kNone;
  return none ? nullptr : &body.fits[body.fit_of[cluster]];
}

// The same for a pinned cluster: its goals answer as the pins let them.
void pushPinned(const formats::Cluster& cluster, const ClusterRest& rest, const Vector3& shift, const Vector3& position,
                PinFit& fit, ClusterFrame& frame) {
  Monomials<9> columns;
  const float center = fit.response(fit.basisAt(cluster, position), columns);
  frame.center += center * shift;
  frame.f += (shift / cluster.radius) * columns.transpose();
  // The moments take the whole impulse: the fit sees it when the cluster is matched again.
  fit.momentCenter() += shift;
  const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
  const Vector3 q = restOffset(cluster, position);
  if (quadratic) {
    frame.a_pq += (shift / cluster.radius) * (monomials<9>(q) - rest.mean).transpose();
  } else {
    frame.a_pq.leftCols<3>() += (shift / cluster.radius) * (q - rest.mean.head<3>()).transpose();
  }
}

void push(Body& body, const Row& row, const Vector3& impulse) {
  forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vector3& position) {
    const formats::Cluster& cluster = body.package().clusters()[c];
    const ClusterRest& rest = body.rest().clusters[c];
    const Vector3 part = (coefficient / relativeMass(body, cluster)) * impulse;
    if (PinFit* fit = fitOf(body, c)) {
      pushPinned(cluster, rest, part, position, *fit, body.frames[c]);
      return;
    }
    if (cluster.mode == formats::ClusterMode::quadratic) {
      push<9>(cluster, rest, body.stiffness->clusters[c], body.responses[c], part, position, body.frames[c]);
    } else {
      push<3>(cluster, rest, body.stiffness->clusters[c], body.responses[c], part, position, body.frames[c]);
    }
  });
}

// How R turns under a torque: the inverse of the derivative of the polar decomposition, J = tr(S) 1 - S with
// S = sym(R^T A_pq) in place of the rigid inertia. Where the cluster is collapsed or mirrored J says nothing useful and
// the rest shape's stands in.
void updateResponse(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                    const ClusterFrame& frame, ClusterResponse& response) {
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const int n = cluster.mode == formats::ClusterMode::quadratic ? 9 : 3;
  response.lever.setZero();
  response.lever.leftCols<3>() = r;
  if (stiffness.deforms) {
    if (n == 9) {
      response.lever -= r * rest.moment * stiffness.s;
    } else {
      response.lever.leftCols<3>() -= r * rest.moment.leftCols<3>() * stiffness.s.topLeftCorner<3, 3>();
    }
  }
  const Matrix3 c = r.transpose() * frame.a_pq.leftCols<3>();
  const Matrix3 s = 0.5F * (c + c.transpose());
  const float trace = rest.moment.leftCols<3>().trace();
  const Matrix3 j = (s.trace() + 1e-3F * trace) * Matrix3::Identity() - s;
  // J - J_rest/4 positive definite, by Sylvester's minors.
  const Matrix3 margin = j - 0.25F * (trace * Matrix3::Identity() - rest.moment.leftCols<3>());
  const bool sound =
      margin(0, 0) > 0 && margin(0, 0) * margin(1, 1) - margin(0, 1) * margin(1, 0) > 0 && margin.determinant() > 0;
  const Matrix3 inverse = sound ? Matrix3(j.inverse()) : rest.inertia_inverse;
  response.inertia_inverse = r * inverse * r.transpose();
}

Matrix3 crossMatrix(const Vector3& v) {
  Matrix3 m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

// W: how the row's point answers to its own impulse (rows of one cluster do not see the others here; Gauss-Seidel
// does).
Matrix3 ownResponse(const Body& body, const Row& row) {
  Matrix3 w = Matrix3::Zero();
  forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vector3& position) {
    const formats::Cluster& cluster = body.package().clusters()[c];
    const ClusterRest& rest = body.rest().clusters[c];
    if (const PinFit* fit = fitOf(body, c)) {
      const PinFit::Basis b = fit->basisAt(cluster, position);
      w += (coefficient * coefficient * fit->ownResponse(b) / relativeMass(body, cluster)) * Matrix3::Identity();
      return;
    }
    const ClusterResponse& response = body.responses[c];
    const Vector3 q = restOffset(cluster, position);
    const Matrix3 r = geometry::rotationMatrix(body.frames[c].rotation);
    const Vector3 arm = r * (q - rest.mean.head<3>());
    float deformation = 0;
    Vector3 lever;
    if (cluster.mode == formats::ClusterMode::quadratic) {
      const Monomials<9> monomial = monomials<9>(q) - rest.mean;
      lever = response.lever * monomial;
      if (body.stiffness->clusters[c].deforms) deformation = monomial.dot(body.stiffness->clusters[c].s * monomial);
    } else {
      const Vector3 monomial = q - rest.mean.head<3>();
      lever = response.lever.leftCols<3>() * monomial;
      if (body.stiffness->clusters[c].deforms)
        deformation = monomial.dot(body.stiffness->clusters[c].s.topLeftCorner<3, 3>() * monomial);
    }
    const Matrix3 turning = crossMatrix(lever) * response.inertia_inverse * crossMatrix(arm).transpose();
    w += (coefficient * coefficient / relativeMass(body, cluster)) *
         ((1.0F + deformation) * Matrix3::Identity() + 0.5F * (turning + turning.transpose()));
  });
  return w;
}

void prepareRow(const Body& body, Row& row, float pass_seconds) {
  const Matrix3 w = ownResponse(body, row);
  const float mean = w.trace() / 3.0F;
  row.compliance = (row.kind == RowKind::hold ? kHoldCompliance : kRelativeCompliance) * mean;
  if (row.weight < 1) row.compliance /= std::max(row.weight, 1e-3F);
  if (row.kind == RowKind::contact) {
    row.normal_response = row.normal.dot(w * row.normal) + row.compliance;
    row.tangent_response = w.trace() - row.normal.dot(w * row.normal) + row.compliance;
    return;
  }
  if (row.point == RowPoint::visual_vertex) {
    // A critically damped spring of frequency f on the mass it feels, 1/mean, implicit: eq. 12.
    const Pick& pick = body.picks[row.pick];
    const float phase = 6.2831853F * pick.frequency_hz * pass_seconds;
    row.compliance = mean / (phase * phase + 2.0F * phase);
    const Vector3 now = row.target;  // where the point is at the start of the pass; addPickRows put it there
    row.target = (asVector(pick.target) * phase + 2.0F * now) / (phase + 2.0F);
  }
  // Scaled for the inverse: cubes of small numbers are none.
  row.inverse_response = ((w + row.compliance * Matrix3::Identity()) / mean).inverse() / mean;
}

// One row of a sweep. \return how far its point moved, metres.
float relax(Body& body, Row& row) {
  const Vector3 error = row.target - pointOf(body, row) - row.compliance * row.impulse;
  Vector3 change;
  if (row.kind == RowKind::hold) {
    change = row.inverse_response * error;
  } else {
    const float pressed = row.normal.dot(row.impulse);
    const float normal_error = row.normal.dot(error);
    const float push_normal = std::max(0.0F, pressed + normal_error / row.normal_response);
    const Vector3 old_tangent = row.impulse - pressed * row.normal;
    Vector3 tangent = old_tangent + (error - normal_error * row.normal) / row.tangent_response;
    const float limit = row.friction * push_normal;
    const float length = tangent.norm();
    if (length > limit) tangent *= length > 0 ? limit / length : 0.0F;
    change = (push_normal - pressed) * row.normal + (tangent - old_tangent);
  }
  if (!change.allFinite() || change.isZero(0)) return 0;
  // One relaxation moves its point no further than this: what is far off comes in over several.
  const float moved = row.kind == RowKind::contact ? change.norm() * row.normal_response : error.norm();
  const float most = kLargestMove * body.package().info().diagonal;
  if (moved > most) change *= most / moved;
  row.impulse += change;
  push(body, row, change);
  return std::min(moved, most);
}

// Visits the clusters that some row reaches.
template <class Visit>
void forEachUsedCluster(const Body& body, const Visit& visit) {
  for (std::uint32_t c = 0; c < body.responses.size(); ++c) {
    if (body.responses[c].used) visit(c);
  }
}

void loadUsedFrames(Body& body) {
  forEachUsedCluster(body, [&](std::uint32_t c) { body.frames[c] = loadFrame(body.blocks, c); });
}
void storeUsedFrames(Body& body) {
  forEachUsedCluster(body, [&](std::uint32_t c) { storeFrame(body.frames[c], body.blocks, c); });
}

// Matches the clusters again that rows reach (and those that share a block with one: from the same moments, to the
// same end).
void matchUsedBlocks(Body& body, float pass_seconds) {
  const std::uint32_t count = body.clusterCount();
  for (std::uint32_t b = 0; 8 * b < count; ++b) {
    bool used = false;
    for (std::uint32_t c = 8 * b; c < std::min(count, 8 * b + 8); ++c) used |= body.responses[c].used;
    if (used) matchBlocks(body, b, b + 1, pass_seconds);
  }
}

}  // namespace

void bringNear(Body& body, float pass_seconds) {
  const float far_off = kFarOff * body.package().info().diagonal;
  for (const Part& part : body.parts) {
    // How far the rows are from where they ask the part to be: the deepest contact, the mean of what is held.
    Vector3 held = Vector3::Zero(), normal = Vector3::Zero();
    float holds = 0, depth = 0, farthest = 0;
    for (const Row& row : body.rows) {
      if (row.point != RowPoint::physical_vertex || row.index - part.first_vertex >= part.vertex_count) continue;
      const Vector3 error = row.target - asVector(body.y[row.index]);
      if (row.kind == RowKind::hold) {
        held += error;
        holds += 1;
        farthest = std::max(farthest, error.norm());
      } else if (row.normal.dot(error) > depth) {
        depth = row.normal.dot(error);
        normal = row.normal;
      }
    }
    Vector3 shift = Vector3::Zero();
    if (holds > 0) {
      if (farthest > far_off) shift = held / holds;
    } else if (depth > far_off) {
      // Not further than the part as a whole goes down in this pass: its fall is stopped, it is not thrown up.
      float mass = 0, fall = 0;
      for (std::uint32_t i = part.first_vertex; i < part.first_vertex + part.vertex_count; ++i) {
        mass += body.rest().masses[i];
        fall += body.rest().masses[i] * normal.dot(asVector(body.x[i]) - asVector(body.y[i]));
      }
      shift = std::clamp(fall / mass, 0.0F, depth) * normal;
    }
    if (!shift.allFinite() || shift.isZero(0)) continue;
    for (std::uint32_t i = part.first_vertex; i < part.first_vertex + part.vertex_count; ++i) {
      asVector(body.y[i]) += shift;
      asVector(body.v[i]) += shift / pass_seconds;
      body.force[i] = {};
    }
    for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
      for (int k = 0; k < 3; ++k) body.blocks[c / 8].center[k][c % 8] += shift[k];
    }
    for (Row& row : body.rows) {
      if (row.point != RowPoint::physical_vertex || row.index - part.first_vertex < part.vertex_count) {
        row.impulse.setZero();
      }
    }
  }
}

void warmStartRows(Body& body) {
  for (ClusterResponse& response : body.responses) response.used = false;
  for (const Row& row : body.rows) {
    forEachTerm(body, row, [&](std::uint32_t c, float, const Vector3&) { body.responses[c].used = true; });
  }
  loadUsedFrames(body);
  for (const Row& row : body.rows) {
    if (row.impulse.isZero(0)) continue;
    forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vector3& position) {
      const formats::Cluster& cluster = body.package().clusters()[c];
      pushMoments(cluster, body.rest().clusters[c], (coefficient / relativeMass(body, cluster)) * row.impulse, position,
                  body.frames[c]);
    });
  }
  storeUsedFrames(body);
}

void solveRows(Body& body, float pass_seconds, const RowSolverSettings& settings) {
  loadUsedFrames(body);
  forEachUsedCluster(body, [&](std::uint32_t c) {
    updateResponse(body.package().clusters()[c], body.rest().clusters[c], body.stiffness->clusters[c], body.frames[c],
                   body.responses[c]);
  });
  for (Row& row : body.rows) prepareRow(body, row, pass_seconds);

  for (std::uint32_t round = 0; round < settings.rounds; ++round) {
    for (std::uint32_t sweep = 0; sweep < settings.sweeps; ++sweep) {
      float moved = 0;
      for (Row& row : body.rows) moved = std::max(moved, relax(body, row));
      if (moved < settings.tolerance * body.package().info().diagonal) break;
    }
    storeUsedFrames(body);
    matchUsedBlocks(body, pass_seconds);
    loadUsedFrames(body);
  }

  const float to_force = 1.0F / (pass_seconds * pass_seconds);
  for (const Row& row : body.rows) {
    Vec3& remembered = row.point == RowPoint::physical_vertex ? body.force[row.index] : body.picks[row.pick].force;
    remembered = asArray(to_force * row.impulse);
  }
}

}  // namespace sinew::internal
