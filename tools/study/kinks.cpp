// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/kinks.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <utility>

#include "sinew/formats/identity.h"
#include "tools/core/error.h"
#include "tools/study/row_picture.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr double kDegrees = 180 / std::numbers::pi;
constexpr float kBelongs = 0.5F;

std::uint32_t maskOf(const formats::PackageView& package, const std::string& mask, const std::string& file) {
  std::vector<std::string> names;
  for (std::uint32_t m = 0; m < package.masks().size(); ++m) {
    names.emplace_back(package.text(package.masks()[m].name));
    if (names.back() == mask) return m;
  }
  const std::string near = nearestName(mask, names);
  throw ToolError(ExitCode::bad_input, file, "has no mask '" + mask + "'",
                  near.empty() ? "Give its recipe one under masks." : "Did you mean " + near + "?");
}

// Two faces with a common edge of welded points.
struct FacePair {
  std::uint32_t a, b;
  std::array<std::uint32_t, 2> edge;  // visual vertices
};

std::vector<FacePair> facePairs(const formats::PackageView& package, std::optional<std::uint32_t> mask) {
  struct First {
    std::uint32_t face;
    std::array<std::uint32_t, 2> edge;
  };
  std::map<std::pair<std::uint32_t, std::uint32_t>, First> first;
  std::vector<FacePair> pairs;
  const auto point = [&](std::uint32_t v) {
    return package.visualIdentity().empty() ? v : package.visualIdentity()[v].welded;
  };
  for (std::uint32_t t = 0; t < package.visualTriangles().size(); ++t) {
    const auto& c = package.visualTriangles()[t];
    const auto inside = [&](std::uint32_t v) { return formats::maskWeight(package, *mask, v) > kBelongs; };
    if (mask && !std::all_of(c.begin(), c.end(), inside)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::array<std::uint32_t, 2> edge = {c[k], c[(k + 1) % 3]};
      const auto [at, fresh] = first.try_emplace(std::minmax({point(edge[0]), point(edge[1])}), First{t, edge});
      if (!fresh) pairs.push_back({at->second.face, t, edge});
    }
  }
  return pairs;
}

Kink sharpest(const formats::PackageView& package, const std::vector<FacePair>& pairs,
              const std::vector<Eigen::Vector3f>& positions) {
  const auto normal = [&](std::uint32_t t) {
    const auto& c = package.visualTriangles()[t];
    const auto x = [&](std::size_t k) { return Vector3d(positions[c[k]].cast<double>()); };
    return Vector3d((x(1) - x(0)).cross(x(2) - x(0)));
  };
  const FacePair* worst = &pairs.front();
  double largest = 0;
  for (const FacePair& pair : pairs) {
    const Vector3d u = normal(pair.a);
    const Vector3d v = normal(pair.b);
    const double angle = std::atan2(u.cross(v).norm(), u.dot(v));
    if (angle <= largest) continue;
    largest = angle;
    worst = &pair;
  }
  Kink kink;
  kink.degrees = largest * kDegrees;
  for (std::size_t k = 0; k < 3; ++k) {
    kink.place[k] = package.info().origin[k];
    for (const std::uint32_t v : worst->edge) kink.place[k] += 0.5 * double(package.visualPositions()[v][k]);
  }
  return kink;
}

// A mask's limb: its middle, and where its length runs, which is the axis along which it is longest at rest.
struct Limb {
  Vector3d middle, axis;
};

Limb limbOf(const formats::PackageView& package, std::uint32_t mask, const Shape& rest, const Shape& shape) {
  const formats::Mask& range = package.masks()[mask];
  const auto weights = package.maskWeights().subspan(range.first, range.count);
  const auto middleOf = [&](const Shape& of) {
    Vector3d sum = Vector3d::Zero();
    double total = 1e-30;
    for (const auto& w : weights) {
      sum += double(w.weight) * of.positions[w.vertex].cast<double>();
      total += double(w.weight);
    }
    return Vector3d(sum / total);
  };
  const Vector3d rest_middle = middleOf(rest);
  const Vector3d middle = middleOf(shape);
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d moved = Eigen::Matrix3d::Zero();
  for (const auto& w : weights) {
    const Vector3d at_rest = rest.positions[w.vertex].cast<double>() - rest_middle;
    spread += double(w.weight) * at_rest * at_rest.transpose();
    moved += double(w.weight) * (shape.positions[w.vertex].cast<double>() - middle) * at_rest.transpose();
  }
  // The line through the middles of its sections, by least squares; a sheared section does not turn it.
  return {middle, moved * Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2)};
}

double bendOf(Limb from, Limb to) {
  const Vector3d on = to.middle - from.middle;
  if (from.axis.dot(on) < 0) from.axis = -from.axis;
  if (to.axis.dot(on) < 0) to.axis = -to.axis;
  return std::atan2(from.axis.cross(to.axis).norm(), from.axis.dot(to.axis)) * kDegrees;
}

}  // namespace

KinkResult measureKinks(std::shared_ptr<const Asset> asset, const std::string& name, const KinkOptions& options) {
  const formats::PackageView& package = asset->package();
  std::optional<std::uint32_t> mask;
  if (!options.mask.empty()) mask = maskOf(package, options.mask, name);
  const std::vector<FacePair> pairs = facePairs(package, mask);
  if (pairs.empty()) {
    throw ToolError(ExitCode::bad_input, name, "no two neighbouring faces to measure",
                    mask ? "Make the mask larger." : "Bake it from a source with faces.");
  }
  KinkResult result;
  result.name = name;
  SceneOptions scene_options;
  scene_options.solver = options.solver;
  scene_options.iterations = options.iterations;
  scene_options.scene = options.scene;
  Scene scene(asset, scene_options);
  captureShape(scene, result.rest_shape);
  while (scene.time() + 0.5 * double(scene_options.step_seconds) < options.scene.seconds()) scene.step();
  captureShape(scene, result.posed_shape);
  result.rest = sharpest(package, pairs, result.rest_shape.positions);
  result.posed = sharpest(package, pairs, result.posed_shape.positions);
  result.ratio = result.posed.degrees / std::max(result.rest.degrees, 1e-9);
  if (!options.arms[0].empty()) {
    const std::array<std::uint32_t, 2> arms = {maskOf(package, options.arms[0], name),
                                               maskOf(package, options.arms[1], name)};
    const auto bend = [&](const Shape& shape) {
      return bendOf(limbOf(package, arms[0], result.rest_shape, shape),
                    limbOf(package, arms[1], result.rest_shape, shape));
    };
    result.rest_bend = bend(result.rest_shape);
    result.posed_bend = bend(result.posed_shape);
  }
  result.asset = std::move(asset);
  return result;
}

nlohmann::ordered_json kinksJson(const std::vector<KinkResult>& results, const KinkOptions& options) {
  nlohmann::ordered_json json = {{"study", "kinks"}, {"scene", options.scene.name()}, {"mask", options.mask}};
  json["results"] = nlohmann::ordered_json::array();
  for (const KinkResult& r : results) {
    nlohmann::ordered_json row = {{"package", r.name},
                                  {"rest_degrees", r.rest.degrees},
                                  {"rest_place", r.rest.place},
                                  {"posed_degrees", r.posed.degrees},
                                  {"posed_place", r.posed.place},
                                  {"ratio", r.ratio}};
    if (r.rest_bend) {
      row["rest_bend_degrees"] = *r.rest_bend;
      row["posed_bend_degrees"] = *r.posed_bend;
    }
    json["results"].push_back(std::move(row));
  }
  return json;
}

std::string kinksText(const std::vector<KinkResult>& results) {
  std::string text;
  for (const KinkResult& r : results) {
    std::array<char, 256> line{};
    std::snprintf(line.data(), line.size(), ": sharpest edge %.1f degrees at rest, %.1f posed (%.2f) at %.3f %.3f %.3f",
                  r.rest.degrees, r.posed.degrees, r.ratio, r.posed.place[0], r.posed.place[1], r.posed.place[2]);
    text += r.name + line.data();
    if (r.rest_bend) {
      std::snprintf(line.data(), line.size(), "; arms %.1f degrees apart from straight at rest, %.1f posed",
                    *r.rest_bend, *r.posed_bend);
      text += line.data();
    }
    text += "\n";
  }
  return text;
}

Image kinksPicture(const std::vector<KinkResult>& results, const KinkOptions& options) {
  std::vector<RowPicture> row;
  const auto add = [&](const KinkResult& r, const Shape& shape, const std::string& name, const Kink& kink) {
    std::array<char, 64> degrees{};
    std::snprintf(degrees.data(), degrees.size(), ": sharpest edge %.1f degrees", kink.degrees);
    row.push_back({r.asset, shape, name + degrees.data()});
  };
  add(results.front(), results.front().rest_shape, "at rest", results.front().rest);
  for (const KinkResult& r : results) {
    add(r, r.posed_shape, std::filesystem::path(r.name).stem().string(), r.posed);
  }
  Camera camera = viewCamera(ViewName::three_quarter);
  if (options.scene.script && options.scene.script->view) {
    camera.yaw = float(options.scene.script->view->yaw);
    camera.pitch = float(options.scene.script->view->pitch);
  }
  return drawRow(row, camera, {});
}

}  // namespace sinew::tools
