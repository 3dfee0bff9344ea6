// SPDX-License-Identifier: MIT
#include "runtime/clusters/match.h"

#include <algorithm>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

// The answer of elastic modes to a deviation, both in the cluster's own frame: Σ v kept (v . deviation).
// \param columns 3 or 9; the others of the result are zero. \param kept_by_all not null: what every mode keeps, turns
// too, of a cluster whose rotation is its part's.
Columns<9> elasticAnswer(const MatchExtras& extras, int columns, const Columns<9>& deviation,
                         const float* kept_by_all) {
  Columns<9> answer = Columns<9>::Zero();
  for (int k = 0; k < 3 * columns; ++k) {
    const Eigen::Map<const Columns<9>> mode(extras.modes->vectors.col(k).data());
    const float kept = kept_by_all != nullptr ? *kept_by_all : (*extras.kept)[k];
    answer += (kept * mode.cwiseProduct(deviation).sum()) * mode;
  }
  return answer;
}

// What the kernel did, again for a cluster with mechanics (eq. 5, 8, 10, 11), with S the rest shape's own deformation:
// F = [R S 0] plus the elastic answer to A_pq - R S M. It differs from kernels/match.h in what a kernel has no lanes
// for: S, elastic modes, damping, and the limits that blend. Columns 3.. are zero in a linear cluster.
// \param lost the moments do not say how the cluster is turned; frame.rotation is the part's then.
// \param tangled its part goes back as one, through itself.
// \return whether the motion of its vertices has to be stopped.
bool match(const ClusterRest& rest, const ClusterStiffness& stiffness, const MatchExtras& extras, bool quadratic,
           bool lost, bool tangled, ClusterFrame& frame) {
  Columns<9> a_pq = frame.a_pq;
  if (!quadratic) a_pq.rightCols<6>().setZero();
  if (extras.shape != nullptr && !lost) {
    // Of the deformed rest shape S q: R is nearest to A_pq S^T.
    geometry::nearestRotation(a_pq.leftCols<3>() * extras.shape->transpose(), frame.rotation);
  }
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  const Matrix3 rest_linear = extras.shape != nullptr ? Matrix3(r * *extras.shape) : r;
  Columns<9> f = Columns<9>::Zero();
  f.leftCols<3>() = rest_linear;
  const bool stiff = stiffness.kept < 0.5F;
  const GoalLimits limits = tangled ? limitsTangled() : *extras.limits;
  const bool keeps_volume = limits.volume != formats::VolumeMethod::none;
  const Matrix3 rest_moment = rest_linear * rest.moment.leftCols<3>();
  Limited limited = Limited::nothing;
  if (stiffness.deforms) {
    Columns<9> deviation = a_pq - rest_linear * rest.moment;
    // Implicit damping: what was left of the deformation a pass ago pulls towards itself (eq. 8d).
    // The frame of what is lost is not the one that remembers: it is not damped in this pass, also where S is.
    if (extras.previous != nullptr && !lost) {
      deviation += extras.damping_passes * (r * *extras.previous);
    } else if (lost && extras.modes == nullptr) {
      deviation *= 1.0F + extras.damping_passes;
    }
    const auto answer_to = [&](const Columns<9>& load) -> Columns<9> {
      if (extras.modes == nullptr) return timesSymmetric(load, stiffness.s);
      return r * elasticAnswer(extras, quadratic ? 9 : 3, r.transpose() * load, lost ? &stiffness.kept : nullptr);
    };
    f += answer_to(deviation);
    if (keeps_volume) {
      Columns<9> unit_pressure = Columns<9>::Zero();
      unit_pressure.leftCols<3>() = cofactor(f.leftCols<3>());
      const Columns<9> answer = answer_to(unit_pressure);
      f += volumePressure(f.leftCols<3>(), answer.leftCols<3>(), stiffness.volume_ease) * answer;
    }
    limited = applyGoalLimits(limits, stiff && !tangled, stiffness.margin, r, extras.shape, f);
  }
  if (!lost && (limited != Limited::nothing || keeps_volume || stiffness.mixes_classes)) {
    // Eq. 11: turned so that the match exerts no torque: A_pq F^T becomes symmetric.
    f = geometry::nearestRotation(timesTransposed(a_pq, f)) * f;
  }
  frame.f = f;
  const float stretched = kTorn * std::max(extras.limits->largest, kLargestStretch);
  const bool torn = a_pq.leftCols<3>().squaredNorm() > stretched * stretched * rest_moment.squaredNorm();
  return limited == Limited::stopped || ((lost || torn) && stiff);
}

// Whether the kernel has done all: frequencies, volume, limits by principal stretches.
bool isPlain(const MatchExtras& extras) {
  return extras.limits == nullptr ||
         (extras.modes == nullptr && extras.shape == nullptr && extras.damping_passes == 0 &&
          (extras.limits->limit == formats::LimitMethod::none ||
           extras.limits->limit == formats::LimitMethod::principal) &&
          (extras.limits->volume != formats::VolumeMethod::cube_root ||
           extras.limits->limit == formats::LimitMethod::none));
}

}  // namespace

void matchBlocks(Body& body, std::uint32_t begin, std::uint32_t end, float pass_seconds) {
  const RestConstants& rest = body.rest();
  kernels().match(rest.blocks.data() + begin, body.stiffness->blocks.data() + begin, body.blocks.data() + begin,
                  end - begin);
  if (rest.mechanics.limits.empty() && body.fits.empty()) return;
  const std::uint32_t last = std::min(8 * end, body.clusterCount());
  for (std::uint32_t c = 8 * begin; c < last; ++c) {
    ClusterBlock& block = body.blocks[c / 8];
    const MatchExtras extras =
        matchExtras(rest.mechanics, body.mechanics, body.stiffness->kept, body.package(), c, pass_seconds);
    const bool pinned = !body.fit_of.empty() && body.fit_of[c] != formats::kNone;
    if (!pinned && isPlain(extras)) continue;
    const formats::Cluster& cluster = body.package().clusters()[c];
    ClusterFrame frame = loadFrame(body.blocks, c);
    bool limited = block.limited[c % 8] != 0;
    if (!isPlain(extras)) {
      const bool lost = block.lost[c % 8] != 0, tangled = block.tangled[c % 8] != 0;
      const ClusterStiffness& stiffness = body.stiffness->clusters[c];
      const bool quadratic = cluster.mode == formats::ClusterMode::quadratic;
      limited = match(rest.clusters[c], stiffness, extras, quadratic, lost, tangled, frame);
    }
    if (pinned) limited |= body.fits[body.fit_of[c]].match(cluster, rest.clusters[c], extras, frame);
    storeFrame(frame, body.blocks, c);
    block.limited[c % 8] = limited ? -1 : 0;
  }
}

}  // namespace sinew::internal
