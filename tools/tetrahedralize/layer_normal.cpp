// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/layer_normal.h"

namespace sinew::tools {
namespace {

// Steps until one says so. step(normal, bound): no unit vector has a least cosine above the bound, by duality: the
// normal is a positive combination of the given ones, of weights that add up to 1 / bound.
template <typename Step>
void descend(std::span<const Eigen::Vector3d> normals, int steps, const Step& step) {
  if (normals.empty()) return;
  Eigen::Vector3d n = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& m : normals) n += m;
  double weights = double(normals.size()), length = n.norm();
  if (length == 0) {
    n = normals.front();
    weights = length = 1;
  }
  for (int i = 1;; ++i) {
    n /= length;
    weights /= length;
    LayerNormal here{n, 2};
    const Eigen::Vector3d* worst = &normals.front();
    for (const Eigen::Vector3d& m : normals) {
      const double cosine = n.dot(m);
      if (cosine >= here.least) continue;
      here.least = cosine;
      worst = &m;
    }
    if (step(here, 1 / weights) || i == steps) return;
    const double share = 1.0 / (i + 1);
    n += share * (*worst - n);
    weights += share * (1 - weights);
    length = n.norm();
    if (length == 0) return;
  }
}

}  // namespace

LayerNormal layerNormal(std::span<const Eigen::Vector3d> normals) {
  LayerNormal best;
  descend(normals, 200, [&](const LayerNormal& here, double /*bound*/) {
    if (here.least > best.least) best = here;
    return false;
  });
  return best;
}

bool leansOver(std::span<const Eigen::Vector3d> normals, double cosine) {
  bool over = true;
  descend(normals, 20, [&](const LayerNormal& here, double bound) {
    over = here.least < cosine;
    return !over || bound < cosine;
  });
  return over;
}

}  // namespace sinew::tools
