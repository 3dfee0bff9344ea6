// SPDX-License-Identifier: GPL-3.0-or-later
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "runtime/geometry/smoothstep.h"
#include "tools/author/mask_image.h"
#include "tools/author/selection_kinds.h"
#include "tools/author/strokes.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using Json = nlohmann::ordered_json;
using Place = SelectionPlace;

// A mask is looked at this finely for regions that share UV space.
constexpr int kOverlapCells = 256;

// 1 up to the edge, falling to 0 over `falloff` outside.
double ramp(double outside, double falloff) {
  if (outside <= 0) return 1;
  return falloff > 0 ? geometry::smoothstep(1 - outside / falloff) : 0;
}

// Where distant triangles lie on the same painted place, a mask selects them all: mirrored halves, repeated parts.
void reportSharedUv(const SelectionSource& source, const Place& place, const MaskImage& mask,
                    const std::vector<std::uint8_t>& meant, bool up) {
  std::vector<std::uint32_t> owner(std::size_t(kOverlapCells) * kOverlapCells, formats::kNone);
  std::vector<std::uint8_t> shared(owner.size(), 0);
  std::size_t covered = 0;
  std::size_t overlapping = 0;
  const auto center = [&](std::uint32_t t) {
    const Triangle& c = source.mesh.triangles[t];
    return Vector3d((source.mesh.positions[c[0]] + source.mesh.positions[c[1]] + source.mesh.positions[c[2]]) / 3);
  };
  for (std::uint32_t t = 0; t < source.mesh.triangles.size(); ++t) {
    if (meant[t] == 0) continue;
    std::array<Eigen::Vector2d, 3> uv;
    for (std::size_t k = 0; k < 3; ++k)
      uv[k] = source.mesh.uvs[source.mesh.triangles[t][k]].cast<double>() * kOverlapCells;
    const Eigen::Vector2d low = uv[0].cwiseMin(uv[1]).cwiseMin(uv[2]);
    const Eigen::Vector2d high = uv[0].cwiseMax(uv[1]).cwiseMax(uv[2]);
    if (!((high - low).maxCoeff() < kOverlapCells)) continue;  // it wraps the whole picture: no island
    const auto cross = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a[0] * b[1] - a[1] * b[0]; };
    for (double y = std::ceil(low[1] - 0.5) + 0.5; y < high[1]; ++y) {
      for (double x = std::ceil(low[0] - 0.5) + 0.5; x < high[0]; ++x) {
        const Eigen::Vector2d p(x, y);
        int positive = 0;
        int negative = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const double side = cross(uv[(k + 1) % 3] - uv[k], p - uv[k]);
          (side >= 0 ? positive : negative) += 1;
        }
        if (positive != 0 && negative != 0) continue;
        const double v = y / kOverlapCells;
        if (mask.sample(x / kOverlapCells, up ? v : 1 - v) < 0.5) continue;
        const auto wrap = [](double i) {
          return std::size_t((int(std::floor(i)) % kOverlapCells + kOverlapCells) % kOverlapCells);
        };
        const std::size_t cell = wrap(y) * kOverlapCells + wrap(x);
        if (owner[cell] == formats::kNone) {
          owner[cell] = t;
          ++covered;
        } else if (shared[cell] == 0 && (center(owner[cell]) - center(t)).norm() > 0.05 * source.mesh.diagonal) {
          shared[cell] = 1;
          ++overlapping;
        }
      }
    }
  }
  if (overlapping * 50 <= covered) return;
  Finding finding;
  finding.id = "mask-uv-shared";
  finding.count = overlapping;
  finding.message = "mask " + place.value.get<std::string>() + " selects several places that share its UV space (" +
                    std::to_string(100 * overlapping / covered) + " % of it)";
  finding.place = place.pointer.substr(1);
  finding.cure = "If only one is meant, say which: {\"and\": [{\"image\": ...}, {\"half_space\": ...}]}.";
  source.findings.push_back(finding);
}

VisualWeights image(const SelectionSource& source, const Place& place) {
  if (source.mesh.uvs.empty()) {
    source.fail(place.value_pointer, "the source has no UV coordinates, so a picture cannot lie on it",
                "Unwrap it and export with UVs, or use another selection.");
  }
  const auto file = source.recipe.file(place.value.get<std::string>(), place.value_pointer);
  source.requireFile(file, place.value_pointer);
  MaskImageOptions options;
  options.channel = place.text("channel");
  if (const Json key = place.get("key"); key.is_array()) {
    const Vector3d rgb = pointOf(key);
    options.key = {rgb[0], rgb[1], rgb[2]};
  }
  options.tolerance = place.number("tolerance");
  if (const Json threshold = place.get("threshold"); threshold.is_number()) options.threshold = threshold.get<double>();
  options.close = int(place.number("close"));
  options.specks = int(place.number("specks"));
  options.feather = place.number("feather");
  const MaskImage mask = readMaskImage(file, options);
  const bool up = place.text("v") == "up";
  std::vector<std::uint8_t> meant(source.mesh.triangles.size(), 1);
  if (const Json material = place.get("material"); material.is_string()) {
    std::vector<std::string> names;
    for (const MaterialSource& m : source.mesh.materials) names.push_back(m.name);
    const Json& pattern = place.json["material"];
    const Place named{place.kind, place.json, pattern, place.pointer, childPointer(place.pointer, "material")};
    const auto found = source.matching(named, names, "material");
    for (const SubMeshSource& sub : source.mesh.sub_meshes) {
      const bool is_meant = std::binary_search(found.begin(), found.end(), std::size_t(sub.material));
      std::fill_n(meant.begin() + std::ptrdiff_t(sub.first_triangle), sub.triangle_count, is_meant ? 1 : 0);
    }
  }
  // Sampled up to a texel inside each triangle of a vertex, and averaged: an island's edge often lies right on the
  // edge of what was painted.
  VisualWeights sum(source.count(), 0);
  std::vector<std::uint32_t> samples(source.count(), 0);
  const Eigen::Vector2d texel(1.0 / mask.width, 1.0 / mask.height);
  for (std::size_t t = 0; t < source.mesh.triangles.size(); ++t) {
    if (meant[t] == 0) continue;
    const Triangle& c = source.mesh.triangles[t];
    const Eigen::Vector2d center = (source.mesh.uvs[c[0]].cast<double>() + source.mesh.uvs[c[1]].cast<double>() +
                                    source.mesh.uvs[c[2]].cast<double>()) /
                                   3;
    for (const std::uint32_t v : c) {
      const Eigen::Vector2d uv = source.mesh.uvs[v].cast<double>();
      Eigen::Vector2d inwards = (center - uv) / 3;
      inwards *= std::min(1.0, 1 / std::max(1e-12, inwards.cwiseQuotient(texel).cwiseAbs().maxCoeff()));
      const Eigen::Vector2d s = uv + inwards;
      sum[v] += mask.sample(s[0], up ? s[1] : 1 - s[1]);
      ++samples[v];
    }
  }
  VisualWeights weights(source.count(), 0);
  for (std::size_t v = 0; v < source.count(); ++v) {
    if (samples[v] > 0) weights[v] = std::clamp(sum[v] / samples[v], 0.0, 1.0);
  }
  reportSharedUv(source, place, mask, meant, up);
  return source.joined(weights);
}

VisualWeights shape(const SelectionSource& source, const Place& place) {
  const double falloff = place.number("falloff");
  const std::string_view kind = place.kind.name;
  VisualWeights weights(source.count());
  Vector3d a = Vector3d::Zero();
  Vector3d b = Vector3d::Zero();
  double radius = 0;
  if (kind == "box" || kind == "capsule") {
    a = pointOf(place.value[0]);
    b = pointOf(place.value[1]);
    if (kind == "box") {
      const Vector3d low = a.cwiseMin(b);
      b = a.cwiseMax(b);
      a = low;
    }
  } else {
    a = pointOf(place.value);
  }
  if (kind == "sphere" || kind == "capsule") radius = place.number("radius");
  if (kind == "half_space") {
    b = pointOf(place.json["normal"]);
    if (!(b.norm() > 0)) {
      source.fail(childPointer(place.pointer, "normal"), "a plane needs a normal that is not zero",
                  "Give [0, 1, 0], say.");
    }
    b.normalize();
  }
  for (std::size_t v = 0; v < source.count(); ++v) {
    const Vector3d& x = source.mesh.positions[v];
    double outside = 0;
    if (kind == "box") {
      outside = (a - x).cwiseMax(x - b).cwiseMax(0.0).norm();
    } else if (kind == "sphere") {
      outside = (x - a).norm() - radius;
    } else if (kind == "capsule") {
      const double s = std::clamp((x - a).dot(b - a) / std::max((b - a).squaredNorm(), 1e-300), 0.0, 1.0);
      outside = (x - a - s * (b - a)).norm() - radius;
    } else {
      outside = (a - x).dot(b);
    }
    weights[v] = ramp(outside, falloff);
  }
  return weights;
}

VisualWeights disc(const SelectionSource& source, const Place& place) {
  const SurfacePoint center = source.surface.nearest(pointOf(place.value));
  std::vector<double> points = source.surface.distancesFrom({&center, 1});
  for (double& w : points) w = ramp(w - place.number("radius"), place.number("falloff"));
  return source.onVertices(points);
}

VisualWeights strokes(const SelectionSource& source, const Place& place) {
  const auto file = source.recipe.file(place.value.get<std::string>(), place.value_pointer);
  source.requireFile(file, place.value_pointer);
  std::vector<double> painted(source.mesh.welded_positions.size(), 0);
  if (const Json over = place.get("over"); !over.is_null())
    painted = source.onPoints(source.other(over, childPointer(place.pointer, "over")));
  StrokeBrush brush(source.surface);
  std::size_t off = 0;
  for (const Stroke& stroke : readStrokes(file)) {
    brush.begin(stroke, std::move(painted));
    brush.addAll(stroke);
    brush.advance();
    off += brush.off();
    painted = brush.takeWeights();
  }
  if (off > 0) {
    Finding finding;
    finding.id = "strokes-off-surface";
    finding.count = off;
    finding.message = std::to_string(off) + " points of " + file.filename().string() +
                      " lie further than 5 % of the diagonal from the surface";
    finding.place = place.pointer.substr(1);
    finding.cure = "Check that the strokes are in metres, y up, and were made on this source.";
    source.findings.push_back(finding);
  }
  return source.onVertices(painted);
}

}  // namespace

const std::map<std::string_view, SelectionMethod>& placedSelections() {
  static const std::map<std::string_view, SelectionMethod> methods = {
      {"image", image},      {"box", shape}, {"sphere", shape},    {"capsule", shape},
      {"half_space", shape}, {"disc", disc}, {"strokes", strokes},
  };
  return methods;
}

}  // namespace sinew::tools
