// SPDX-License-Identifier: MIT
//
// Rows on goals, docs/method.md §6. An impulse Λ (kg m) at a point with rest offset q~ in cluster c, which owns `share`
// of it, moves the cluster's centre by share Λ / M and its moment A_pq by share Λ q~^T / (M radius): exactly what the
// same displacement of the vertex would have done before matching. So feet carry a body however little they weigh, and
// every force passes through the match: it turns, tips and deforms the body as the match deems right.
#include "runtime/contact/solve.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>

#include "runtime/clusters/goal.h"
#include "runtime/clusters/match.h"
#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

// Rows give way by this part of their own response. Rows that contradict one another (a dented sole pressed flat, pins
// set apart) then share the error instead of driving their impulses without bound.
constexpr float kRelativeCompliance = 1e-1F;
// Many pins on few clusters are nearly redundant: stiffer than this, the sweeps of one pass leave an error that the
// warm start carries on and that grows (87 pins on a spider of nine clusters; sixty sweeps converge, and agree).
constexpr float kHoldCompliance = 1e-1F;
// From passes this short on, s, the compliance of held points grows as passes shorten: a chain of links hung by 80
// vertices picked up a swing in passes of 1 ms, and needs twice as much there to lose it.
constexpr float kShortPass = 1.0F / 240;

// What a held point remembers of its impulse. Pins may ask for more than limits allow (an L-bar drawn to twice its
// length by its ends): impulses that are all remembered then swing to and fro and grow.
constexpr float kRememberedHold = 0.8F;

// Move of a point, diagonals, that one relaxation of a row may cause.
constexpr float kLargestMove = 0.25F;

// A part whose rows are further off than this, in diagonals, is first moved there as a whole.
constexpr float kFarOff = 0.25F;

// What a row reaches: a vertex, the corners of a tetrahedron, or the clusters that a visual vertex hangs on.
struct Reach {
  struct Point {
    const void* uses;  // cluster and share each: ClusterUse, or what an attachment says in the same bytes
    std::size_t count;
    float weight;
    const Vec3* rest;
  };
  std::array<Point, 4> points;
  std::size_t count = 0;

  void add(const void* uses, std::size_t use_count, float weight, const Vec3& rest) {
    points[count++] = {uses, use_count, weight, &rest};
  }
};
static_assert(sizeof(ClusterUse) == sizeof(formats::ClusterAttachment) &&
              offsetof(ClusterUse, cluster) == offsetof(formats::ClusterAttachment, cluster) &&
              offsetof(ClusterUse, share) == offsetof(formats::ClusterAttachment, weight));

[[gnu::noinline]] void findReach(const Body& body, const Row& row, Reach& reach) {
  const formats::PackageView& package = body.package();
  const auto add_vertex = [&](std::uint32_t vertex, float weight) {
    const auto uses = body.rest().usesOf(vertex);
    reach.add(uses.data(), uses.size(), weight, package.physicalVertices()[vertex].rest_position);
  };
  if (row.point == RowPoint::physical_vertex) {
    add_vertex(row.index, 1.0F);
  } else if (!package.barycentric().empty()) {
    const formats::BarycentricAttachment& attachment = package.barycentric()[row.index];
    const auto& corners = package.tetrahedra()[attachment.tetrahedron].vertex;
    const auto& w = attachment.weight;
    for (std::size_t k = 0; k < 4; ++k) add_vertex(corners[k], k < 3 ? w[k] : 1.0F - w[0] - w[1] - w[2]);
  } else if (!package.clusterAttachmentRanges().empty()) {
    const formats::ClusterAttachmentRange range = package.clusterAttachmentRanges()[row.index];
    reach.add(package.clusterAttachments().data() + range.first, range.count, 1.0F,
              package.visualPositions()[row.index]);
  }
}

// Where a row touches a cluster, calls visit(cluster index, coefficient, rest position).
template <class Visit>
void forEachTerm(const Body& body, const Row& row, const Visit& visit) {
  Reach reach;
  findReach(body, row, reach);
  for (std::size_t p = 0; p < reach.count; ++p) {
    const Reach::Point& point = reach.points[p];
    for (std::size_t i = 0; i < point.count; ++i) {
      ClusterUse use;
      std::memcpy(&use, static_cast<const std::byte*>(point.uses) + i * sizeof use, sizeof use);
      visit(use.cluster, point.weight * use.share, *point.rest);
    }
  }
}

Vector3 pointOf(const Body& body, const Row& row) {
  Vector3 point = Vector3::Zero();
  forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vec3& rest) {
    addGoal(body.package().clusters()[c], body.rest().clusters[c], body.frames[c], rest, coefficient, point);
  });
  return point;
}

// Masses here are relative to the body's, and impulses with them: those of a body of 1e9 m have no squares in float.
float relativeMass(const Body& body, const formats::Cluster& cluster) {
  return cluster.mass / body.package().info().total_mass;
}

// \param shift the impulse over the cluster's mass, metres.
template <int N>
void pushMoments(const formats::Cluster& cluster, const ClusterRest& rest, const Vector3& shift, const Vec3& position,
                 ClusterFrame& frame) {
  const Monomials<N> q = monomials<N>(restOffset(cluster, asVector(position))) - rest.mean.head<N>();
  frame.center += shift;
  frame.a_pq.leftCols<N>() += (shift / cluster.radius) * q.transpose();
}

void pushMoments(const formats::Cluster& cluster, const ClusterRest& rest, const Vector3& shift, const Vec3& position,
                 ClusterFrame& frame) {
  if (cluster.mode == formats::ClusterMode::quadratic) {
    pushMoments<9>(cluster, rest, shift, position, frame);
  } else {
    pushMoments<3>(cluster, rest, shift, position, frame);
  }
}

// The fit of a pinned cluster; null for others.
const PinFit* fitOf(const Body& body, std::uint32_t cluster) {
  const bool none = body.fit_of.empty() || body.fit_of[cluster] == formats::kNone;
  return none ? nullptr : &body.fits[body.fit_of[cluster]];
}

// How R turns under a torque: the inverse of the derivative of the polar decomposition, J = tr(S) 1 - S with
// S = sym(R^T A_pq) in place of the rigid inertia. Where the cluster is collapsed or mirrored J says nothing useful and
// the rest shape's stands in.
void updateResponse(const formats::Cluster& cluster, const ClusterRest& rest, const ClusterStiffness& stiffness,
                    const ClusterFrame& frame, ClusterResponse& response) {
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const int n = cluster.mode == formats::ClusterMode::quadratic ? 9 : 3;
  response.rotation = r;
  response.lever.setZero();
  response.lever.leftCols<3>() = r;
  if (stiffness.deforms) {
    if (n == 9) {
      response.lever -= timesSymmetric(r * rest.moment, stiffness.s);
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
      margin(0, 0) > 0 && margin(0, 0) * margin(1, 1) - margin(0, 1) * margin(1, 0) > 0 && determinantOf(margin) > 0;
  const Matrix3 inverse = sound ? inverseOf(j) : rest.inertia_inverse;
  response.inertia_inverse = r * inverse * r.transpose();
}

Matrix3 crossMatrix(const Vector3& v) {
  Matrix3 m = Matrix3::Zero();
  m(1, 0) = v[2];
  m(2, 0) = -v[1];
  m(2, 1) = v[0];
  return m - m.transpose();
}

void copy(const Vector3& from, float* to) { std::copy(from.data(), from.data() + 3, to); }

// Appends the terms of a row. \return W: how its point answers to its own impulse (rows of one cluster do not see the
// others here; Gauss-Seidel does).
Matrix3 addTerms(Body& body, const Row& row) {
  Matrix3 w = Matrix3::Zero();
  forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vec3& position) {
    if (coefficient == 0) return;
    const formats::Cluster& cluster = body.package().clusters()[c];
    const ClusterRest& rest = body.rest().clusters[c];
    RowTerm& term = body.terms.add();
    term.cluster = c;
    term.coefficient = coefficient;
    term.scale = coefficient / relativeMass(body, cluster);
    term.answer = 1;
    const Vector3 offset = restOffset(cluster, asVector(position));
    Monomials<9> q = monomials<9>(offset) - rest.mean;
    if (cluster.mode != formats::ClusterMode::quadratic) q.tail<6>().setZero();
    Eigen::Map<Monomials<9>> in(term.in), out(term.out);
    if (const PinFit* fit = fitOf(body, c)) {
      const PinFit::Basis basis = fit->basisAt(cluster, asVector(position));
      Monomials<9> columns = Monomials<9>::Zero();
      term.answer = fit->response(basis, columns);
      in = columns / cluster.radius;
      out = coefficient * cluster.radius * q;
      w += coefficient * term.scale * fit->ownResponse(basis) * Matrix3::Identity();
    } else {
      const ClusterResponse& response = body.responses[c];
      const ClusterStiffness& stiffness = body.stiffness->clusters[c];
      const Vector3 arm = response.rotation * q.head<3>();
      const Vector3 lever = timesColumn(response.lever, q);
      in = q / cluster.radius;
      float deformation = 0;
      if (stiffness.deforms) {
        const Monomials<9> sq = stiffness.s.lazyProduct(q);
        deformation = q.dot(sq);
        out = coefficient * cluster.radius * sq;
      }
      copy(arm / cluster.radius, term.arm);
      copy(coefficient * cluster.radius * lever, term.lever);
      const Matrix3 turning = crossMatrix(lever) * response.inertia_inverse * crossMatrix(arm).transpose();
      w += coefficient * term.scale *
           ((1.0F + deformation) * Matrix3::Identity() + 0.5F * (turning + turning.transpose()));
    }
  });
  return w;
}

void addSolverRow(Body& body, const Row& row, float pass_seconds) {
  SolverRow& result = body.solver_rows.add();
  result.first_term = std::uint32_t(body.terms.size());
  const Matrix3 w = addTerms(body, row);
  result.term_count = std::uint32_t(body.terms.size()) - result.first_term;
  const float mean = w.trace() / 3.0F;
  const float hold_compliance = kHoldCompliance * std::clamp(kShortPass / pass_seconds, 1.0F, 10.0F);
  result.compliance = (row.kind == RowKind::hold ? hold_compliance : kRelativeCompliance) * mean;
  if (row.weight < 1) result.compliance /= std::max(row.weight, 1e-3F);
  Vector3 target = row.target;
  if (row.kind == RowKind::contact) {
    result.contact = 1;
    result.friction = row.friction;
    copy(row.normal, result.normal);
    const float along = row.normal.dot(w * row.normal);
    result.normal_response = along + result.compliance;
    result.tangent_response = w.trace() - along + result.compliance;
    // Friction has its bound and needs none from compliance: only what it changes by gives way. A tenth of all of it
    // was a slip in every pass, and bodies crept down slopes and walked about.
    target += result.compliance * (row.impulse - row.normal * row.normal.dot(row.impulse));
  } else {
    if (row.point == RowPoint::visual_vertex) {
      // A critically damped spring of frequency f on the mass it feels, 1/mean, implicit: eq. 12. The row's target is
      // where the point is at the start of the pass.
      const Pick& pick = body.picks[row.pick];
      const float phase = 6.2831853F * pick.frequency_hz * pass_seconds;
      result.compliance = mean / (phase * phase + 2.0F * phase);
      target = (asVector(pick.target) * phase + 2.0F * row.target) / (phase + 2.0F);
    }
    // Scaled for the inverse: cubes of small numbers are none.
    const Matrix3 inverse = inverseOf(Matrix3((w + result.compliance * Matrix3::Identity()) / mean)) / mean;
    for (int k = 0; k < 3; ++k) copy(inverse.col(k), result.inverse_response[k]);
  }
  copy(target, result.target);
  copy(row.impulse, result.impulse);
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

// Matches the clusters again that rows reach (and those that share two blocks with one: from the same moments, to the
// same end).
void matchUsedBlocks(Body& body, float pass_seconds) {
  const std::uint32_t count = body.clusterCount(), blocks = std::uint32_t(body.blocks.size());
  for (std::uint32_t b = 0; b < blocks; b += 2) {
    bool used = false;
    for (std::uint32_t c = 8 * b; c < std::min(count, 8 * b + 16); ++c) used |= body.responses[c].used;
    if (used) matchBlocks(body, b, std::min(b + 2, blocks), pass_seconds);
  }
}

// Before a round: nothing answered yet, and where the frames put the points.
void beginRound(Body& body) {
  forEachUsedCluster(body, [&](std::uint32_t c) {
    ClusterAnswer& answer = body.answers[c];
    answer = {};
    answer.columns = body.package().clusters()[c].mode == formats::ClusterMode::quadratic ? 9 : 3;
    if (fitOf(body, c) != nullptr) return;  // answers as its pins let it
    for (int k = 0; k < 3; ++k) copy(body.responses[c].inertia_inverse.col(k), answer.inertia_inverse[k]);
  });
  for (std::size_t i = 0; i < body.rows.size(); ++i) copy(pointOf(body, body.rows[i]), body.solver_rows[i].base);
}

// After a round: the impulses' share of each cluster's moments.
void endRound(Body& body) {
  forEachUsedCluster(body, [&](std::uint32_t c) {
    const ClusterAnswer& answer = body.answers[c];
    ClusterFrame& frame = body.frames[c];
    frame.center += Eigen::Map<const Vector3>(answer.center);
    if (fitOf(body, c) != nullptr) return;
    for (std::uint32_t k = 0; k < answer.columns; ++k) {
      frame.a_pq.col(Eigen::Index(k)) += Eigen::Map<const Vector3>(answer.column[k]);
    }
  });
  for (std::size_t i = 0; i < body.rows.size(); ++i) {
    Row& row = body.rows[i];
    const Vector3 impulse = Eigen::Map<const Vector3>(body.solver_rows[i].impulse) - row.impulse;
    row.impulse += impulse;
    if (body.fits.empty()) continue;
    // Where pins hold a cluster the moments take the whole impulse: the fit sees it when the cluster is matched again.
    forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vec3& position) {
      if (fitOf(body, c) == nullptr) return;
      const formats::Cluster& cluster = body.package().clusters()[c];
      const Vector3 shift = (coefficient / relativeMass(body, cluster)) * impulse;
      const Vector3 center = body.frames[c].center;
      pushMoments(cluster, body.rest().clusters[c], shift, position, body.frames[c]);
      body.frames[c].center = center;
      body.fits[body.fit_of[c]].momentCenter() += shift;
    });
  }
}

}  // namespace

[[gnu::cold]] std::size_t mostTerms(const Body& body) {
  std::size_t count = body.package().memberships().size();
  for (const Pick& pick : body.picks) {
    Row row;
    row.point = RowPoint::visual_vertex;
    row.index = pick.visual_vertex;
    forEachTerm(body, row, [&](std::uint32_t, float, const Vec3&) { ++count; });
  }
  return count;
}

Vec3& rememberedForce(Body& body, const Row& row) {
  return row.point == RowPoint::physical_vertex ? body.force[row.index] : body.picks[row.pick].force;
}

[[gnu::cold]] void bringNear(Body& body, float pass_seconds) {
  const float far_off = kFarOff * body.package().info().diagonal;
  for (Part& part : body.parts) {
    part.pull = {};
    part.shifted = false;
  }
  for (const Row& row : body.rows) {
    if (row.point != RowPoint::physical_vertex) continue;
    Part::Pull& pull = body.partOf(row.index).pull;
    const Vector3 error = row.target - asVector(body.y[row.index]);
    if (row.kind == RowKind::hold) {
      pull.held += error;
      pull.holds += 1;
      pull.farthest = std::max(pull.farthest, error.norm());
    } else if (row.normal.dot(error) > pull.depth) {
      pull.depth = row.normal.dot(error);
      pull.normal = row.normal;
    }
  }
  bool any_shifted = false;
  for (Part& part : body.parts) {
    const Part::Pull& pull = part.pull;
    Vector3 shift = Vector3::Zero();
    if (pull.holds > 0) {
      if (pull.farthest > far_off) shift = pull.held / pull.holds;
    } else if (pull.depth > far_off) {
      // Not further than the part as a whole goes down in this pass: its fall is stopped, it is not thrown up.
      float mass = 0, fall = 0;
      for (std::uint32_t i = part.first_vertex; i < part.first_vertex + part.vertex_count; ++i) {
        mass += body.rest().masses[i];
        fall += body.rest().masses[i] * pull.normal.dot(asVector(body.x[i]) - asVector(body.y[i]));
      }
      shift = std::clamp(fall / mass, 0.0F, pull.depth) * pull.normal;
    }
    if (!shift.allFinite() || shift.isZero(0)) continue;
    part.shifted = any_shifted = true;
    for (std::uint32_t i = part.first_vertex; i < part.first_vertex + part.vertex_count; ++i) {
      asVector(body.y[i]) += shift;
      asVector(body.v[i]) += shift / pass_seconds;
      body.force[i] = {};
    }
    for (std::uint32_t c = part.first_cluster; c < part.first_cluster + part.cluster_count; ++c) {
      for (int k = 0; k < 3; ++k) body.blocks[c / 8].center[k][c % 8] += shift[k];
    }
  }
  for (Row& row : body.rows) {
    if (!any_shifted) break;
    if (row.point != RowPoint::physical_vertex || body.partOf(row.index).shifted) row.impulse.setZero();
  }
}

void warmStartRows(Body& body) {
  for (ClusterResponse& response : body.responses) response.used = false;
  for (Row& row : body.rows) {
    if (row.kind == RowKind::hold) row.impulse *= kRememberedHold;
    forEachTerm(body, row, [&](std::uint32_t c, float, const Vec3&) { body.responses[c].used = true; });
  }
  loadUsedFrames(body);
  for (const Row& row : body.rows) {
    if (row.impulse.isZero(0)) continue;
    forEachTerm(body, row, [&](std::uint32_t c, float coefficient, const Vec3& position) {
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
  body.solver_rows.clear();
  body.terms.clear();
  for (const Row& row : body.rows) addSolverRow(body, row, pass_seconds);

  const float diagonal = body.package().info().diagonal;
  const bool held = std::any_of(body.rows.begin(), body.rows.end(), [](const Row& row) {
    return row.kind == RowKind::hold && row.point == RowPoint::physical_vertex;
  });
  const std::uint32_t rounds = held ? settings.held_rounds : settings.rounds;
  for (std::uint32_t round = 0; round < rounds; ++round) {
    beginRound(body);
    for (std::uint32_t sweep = 0; sweep < settings.sweeps; ++sweep) {
      const float moved = kernels().relax_rows(body.solver_rows.data(), std::uint32_t(body.solver_rows.size()),
                                               body.terms.data(), body.answers.data(), kLargestMove * diagonal);
      if (moved < settings.tolerance * diagonal) break;
    }
    endRound(body);
    storeUsedFrames(body);
    matchUsedBlocks(body, pass_seconds);
    if (round + 1 < rounds) loadUsedFrames(body);
  }

  const float to_force = 1.0F / (pass_seconds * pass_seconds);
  for (const Row& row : body.rows) {
    rememberedForce(body, row) = asArray(to_force * row.impulse);
  }
}

}  // namespace sinew::internal
