// SPDX-License-Identifier: MIT
#include "runtime/clusters/match.h"

#include <algorithm>

#include "runtime/kernels/kernels.h"

namespace sinew::internal {
namespace {

// Eq. 11: turns F so that the match exerts no torque: A_pq F^T becomes symmetric.
template <int N>
void removeTorque(Columns<N>& f, const Columns<N>& a_pq) {
  const Matrix3 turn = geometry::nearestRotation(a_pq * f.transpose());
  f = (turn * f).eval();
}

// Eq. 5, 8: [R S 0] plus the elastic answer to A_pq - R S M, with S the rest shape's own deformation.
template <int N>
Columns<N> deform(const Matrix3& r, const Columns<N>& a_pq, const ClusterRest& rest, const ClusterStiffness& stiffness,
                  const MatchExtras& extras) {
  const Matrix3 rest_linear = extras.shape != nullptr ? Matrix3(r * *extras.shape) : r;
  Columns<N> f = Columns<N>::Zero();
  f.template leftCols<3>() = rest_linear;
  if (!stiffness.deforms) return f;
  Columns<N> deviation = a_pq - rest_linear * rest.moment.leftCols<N>();
  // Implicit damping: what was left of the deformation a pass ago pulls towards itself (eq. 8d).
  if (extras.previous != nullptr) deviation += extras.damping_passes * (r * extras.previous->leftCols<N>());
  if (extras.modes != nullptr) {
    const Columns<N> local = r.transpose() * deviation;
    constexpr int kCount = 3 * N;
    const auto vectors = extras.modes->vectors.topLeftCorner<kCount, kCount>();
    const Eigen::Map<const Eigen::Matrix<float, kCount, 1>> flat(local.data());
    const Eigen::Matrix<float, kCount, 1> amplitude =
        (vectors.transpose() * flat).cwiseProduct(extras.kept->head<kCount>());
    const Eigen::Matrix<float, kCount, 1> answer = vectors * amplitude;
    f += r * Eigen::Map<const Columns<N>>(answer.data());
    return f;
  }
  f.noalias() += deviation * stiffness.s.topLeftCorner<N, N>();
  return f;
}

// What the kernel did, again for a cluster with mechanics. \param lost the moments do not say how the cluster is
// turned; frame.rotation is the part's then. \return whether the motion of its vertices has to be stopped.
template <int N>
bool match(const ClusterRest& rest, const ClusterStiffness& stiffness, const MatchExtras& extras, bool lost,
           ClusterFrame& frame) {
  const Columns<N> a_pq = frame.a_pq.leftCols<N>();
  if (extras.shape != nullptr && !lost) {
    // Of the deformed rest shape S q: R is nearest to A_pq S^T.
    geometry::nearestRotation(a_pq.template leftCols<3>() * extras.shape->transpose(), frame.rotation);
  }
  const Matrix3 r = geometry::rotationMatrix(frame.rotation);
  Columns<N> f = deform<N>(r, a_pq, rest, stiffness, extras);
  Limited limited = Limited::nothing;
  if (stiffness.deforms) limited = applyGoalLimits<N>(*extras.limits, r, extras.shape, f);
  if (!lost && (limited != Limited::nothing || stiffness.mixes_classes)) removeTorque<N>(f, a_pq);
  frame.f.leftCols<N>() = f;
  return limited == Limited::guarded || lost;
}

// Whether the kernel has done all: frequencies, limits and volume by principal stretches.
bool isPlain(const MatchExtras& extras) {
  return extras.limits == nullptr ||
         (extras.modes == nullptr && extras.shape == nullptr && extras.damping_passes == 0 &&
          (extras.limits->limit == formats::LimitMethod::none ||
           extras.limits->limit == formats::LimitMethod::principal) &&
          extras.limits->volume != formats::VolumeMethod::cube_root);
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
      const bool lost = block.lost[c % 8] != 0;
      const ClusterStiffness& stiffness = body.stiffness->clusters[c];
      limited = cluster.mode == formats::ClusterMode::quadratic
                    ? match<9>(rest.clusters[c], stiffness, extras, lost, frame)
                    : match<3>(rest.clusters[c], stiffness, extras, lost, frame);
    }
    if (pinned) limited |= body.fits[body.fit_of[c]].match(cluster, rest.clusters[c], extras, frame);
    storeFrame(frame, body.blocks, c);
    block.limited[c % 8] = limited ? -1 : 0;
  }
}

}  // namespace sinew::internal
