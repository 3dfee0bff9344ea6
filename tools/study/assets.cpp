// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/study/assets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

constexpr std::array<std::string_view, kHoldSceneCount> kNames = {"hang",    "lean",  "cantilever", "press",
                                                                  "squeeze", "twist", "pins"};
constexpr double kEnd = 0.1, kRear = 0.25;
constexpr double kPress = 0.2, kSqueeze = 0.05;         // of the height
constexpr double kTwist = 60 * std::numbers::pi / 180;  // radians
constexpr float kHeldWhole = 0.999F;

// The vertices of an end of an axis. \param share of the length.
HeldRegion endOf(const PackageSolid& solid, const SolidExtent& extent, Eigen::Index axis, double share, bool high) {
  const double depth = share * (extent.high[axis] - extent.low[axis]);
  HeldRegion region;
  for (std::uint32_t v = 0; v < solid.rest.size(); ++v) {
    const double x = solid.rest[v][axis];
    const bool in = high ? x >= extent.high[axis] - depth : x <= extent.low[axis] + depth;
    if (in && solid.kept[v] != 0) region.vertices.push_back(v);
  }
  return region;
}

// Whether the reference holds a vertex too: only at a pin weight of kHeldWhole.
bool heldWhole(const formats::PackageView& package, std::uint32_t vertex) {
  return package.pinWeights().empty() || package.pinWeights()[vertex] >= kHeldWhole;
}

std::vector<HeldRegion> pinnedRegions(const formats::PackageView& package) {
  std::vector<HeldRegion> regions;
  std::vector<std::uint8_t> taken(package.physicalVertices().size(), 0);
  for (const formats::PinSet& set : package.pinSets()) {
    HeldRegion region;
    for (const std::uint32_t v : package.pinSetVertices().subspan(set.first, set.count)) {
      if (taken[v] == 0 && heldWhole(package, v)) region.vertices.push_back(v);
      taken[v] = 1;
    }
    if (!region.vertices.empty()) regions.push_back(std::move(region));
  }
  return regions;
}

// The doubt about a row, in a few words, for text and JSON.
std::string noteOf(const AssetsRow& row) {
  std::string note;
  const auto add = [&](const std::string& text) { note += (note.empty() ? "" : "; ") + text; };
  if (!row.exists) return "nothing is held in this scene";
  if (row.material.source == StiffnessSource::none) add("no material");
  if (row.material.source != StiffnessSource::none && row.material.stiffest > 1.01 * row.material.softest) {
    add("of several materials, judged by their mean");
  }
  if (row.left_out > 0) add(std::to_string(row.left_out) + " loose tetrahedra left out");
  if (row.pieces_idle > 0) add(std::to_string(row.pieces_idle) + " pieces not held");
  if (row.held_in_part > 0) add(std::to_string(row.held_in_part) + " vertices held in part are free in the reference");
  if (!row.on_target) add("no gravity gives the displacement asked for");
  if (!row.stable) add("reference unstable");
  if (row.residual > 1e-4) add("reference not converged");
  if (!row.finite) add("NOT FINITE");
  return note;
}

AssetsRow measureOne(const NamedAsset& asset, const PackageSolid& solid, const std::vector<PieceMaterial>& materials,
                     HoldScene scene, double target, const AssetsOptions& options) {
  AssetsRow row;
  row.package = asset.name;
  row.scene = scene;
  row.target = target;
  row.left_out = solid.left_out;
  const HeldCase held = heldCase(solid, asset.asset->package(), scene);
  std::vector<ElasticMaterial> elastic;
  for (const PieceMaterial& m : materials) elastic.push_back(m.material);
  ReferenceShape reference;
  if (!held.regions.empty()) {
    reference = referenceShape(solid, elastic, held, target * solid.diagonal);
  }
  row.exists = !reference.compared.empty();
  if (!row.exists) return row;
  std::vector<std::uint8_t> compared(solid.pieces, 0);
  for (const std::uint32_t v : reference.compared) compared[solid.piece[v]] = 1;
  row.pieces_idle = std::uint32_t(std::count(compared.begin(), compared.end(), 0));
  row.material = materials[solid.piece[reference.compared.front()]];
  row.gravity = reference.gravity.norm();
  row.reference_rms = reference.rms / solid.diagonal;
  row.reference_largest = reference.largest / solid.diagonal;
  row.reference_tetrahedra = reference.tetrahedra;
  row.stable = reference.stable;
  row.on_target = reference.on_target;
  row.residual = reference.residual;
  if (held.package_pins) {
    for (const std::uint32_t v : asset.asset->package().pinSetVertices()) {
      if (!heldWhole(asset.asset->package(), v)) ++row.held_in_part;
    }
  }
  for (const HeldRegion& region : held.regions) row.held += std::uint32_t(region.vertices.size());
  row.compared = std::uint32_t(reference.compared.size());
  PlayOptions play;
  play.rate_hz = options.rate_hz;
  play.seconds = options.seconds;
  play.solver = options.solver;
  play.rest_speed = options.rest_speed * solid.diagonal;
  const PlayedShape played = playHeld(asset.asset, solid, held, reference, play);
  row.score = scoreOf(reference.compared, played.displacement, reference.displacement);
  row.rest_seconds = played.rest_seconds;
  row.speed = played.speed / solid.diagonal;
  row.microseconds = played.microseconds;
  row.finite = played.finite;
  return row;
}

}  // namespace

SolidExtent extentOf(const PackageSolid& solid) {
  SolidExtent extent{Vector3d::Constant(1e300), Vector3d::Constant(-1e300)};
  for (std::size_t v = 0; v < solid.rest.size(); ++v) {
    if (solid.kept[v] == 0) continue;
    extent.low = extent.low.cwiseMin(solid.rest[v]);
    extent.high = extent.high.cwiseMax(solid.rest[v]);
  }
  return extent;
}

std::string_view nameOf(HoldScene scene) { return kNames[std::size_t(scene)]; }

std::optional<HoldScene> holdSceneOf(std::string_view name) {
  const auto* at = std::find(kNames.begin(), kNames.end(), name);
  if (at == kNames.end()) return {};
  return HoldScene(at - kNames.begin());
}

HeldCase heldCase(const PackageSolid& solid, const formats::PackageView& package, HoldScene scene,
                  const SolidExtent& extent) {
  const Vector3d size = extent.high - extent.low;
  HeldCase held;
  switch (scene) {
    case HoldScene::hang:
      held.regions = {endOf(solid, extent, 1, kEnd, true)};
      held.gravity = -Vector3d::UnitY();
      break;
    case HoldScene::lean:
      held.regions = {endOf(solid, extent, 1, kEnd, false)};
      held.gravity = Vector3d::UnitX();
      break;
    case HoldScene::cantilever:
      held.regions = {endOf(solid, extent, size[0] > size[2] ? 0 : 2, kRear, false)};
      held.gravity = -Vector3d::UnitY();
      break;
    case HoldScene::press:
    case HoldScene::squeeze:
      held.regions = {endOf(solid, extent, 1, kEnd, false), endOf(solid, extent, 1, kEnd, true)};
      held.regions[1].shift = -(scene == HoldScene::press ? kPress : kSqueeze) * size[1] * Vector3d::UnitY();
      break;
    case HoldScene::twist: {
      Eigen::Index axis = 0;
      size.maxCoeff(&axis);
      held.regions = {endOf(solid, extent, axis, kEnd, false), endOf(solid, extent, axis, kEnd, true)};
      held.regions[1].turn = kTwist;
      held.regions[1].axis = Vector3d::Unit(axis);
      held.regions[1].about = 0.5 * (extent.low + extent.high);
      break;
    }
    case HoldScene::pins:
      held.regions = pinnedRegions(package);
      held.gravity = -Vector3d::UnitY();
      held.package_pins = true;
      break;
  }
  return held;
}

std::vector<AssetsRow> measureAssets(const std::vector<NamedAsset>& assets, const AssetsOptions& options,
                                     const std::function<void(double)>& progress) {
  std::vector<AssetsRow> rows;
  std::size_t done = 0;
  for (const NamedAsset& asset : assets) {
    if (asset.asset->package().tetrahedra().empty()) {
      throw ToolError(ExitCode::bad_input, asset.name, "has no tetrahedra: there is nothing to compare it with",
                      "Bake it from a closed surface.");
    }
    const PackageSolid solid = packageSolid(asset.asset->package());
    std::vector<PieceMaterial> materials = materialsOf(asset.asset->package());
    for (PieceMaterial& m : materials) {
      if (options.young || options.poisson) m.source = StiffnessSource::given;
      if (options.young) m.material.young = m.softest = m.stiffest = *options.young;
      if (options.poisson) m.material.poisson = *options.poisson;
    }
    for (const HoldScene scene : options.scenes) {
      const HeldCase held = heldCase(solid, asset.asset->package(), scene);
      const bool pulled = held.gravity.norm() > 0;
      for (const double target : pulled ? options.targets : std::vector<double>{0}) {
        rows.push_back(measureOne(asset, solid, materials, scene, target, options));
      }
      ++done;
      progress(double(done) / double(assets.size() * options.scenes.size()));
    }
  }
  return rows;
}

nlohmann::ordered_json assetsJson(const std::vector<AssetsRow>& rows, const AssetsOptions& options) {
  nlohmann::ordered_json json = {{"study", "assets"},
                                 {"rate_hz", options.rate_hz},
                                 {"seconds", options.seconds},
                                 {"rest_speed", options.rest_speed}};
  json["results"] = nlohmann::ordered_json::array();
  for (const AssetsRow& row : rows) {
    nlohmann::ordered_json one = {{"package", row.package}, {"scene", nameOf(row.scene)}, {"exists", row.exists}};
    if (row.exists) {
      one["target"] = row.target;
      one["material"] = {{"source", nameOf(row.material.source)},
                         {"young", row.material.material.young},
                         {"poisson", row.material.material.poisson},
                         {"softest", row.material.softest},
                         {"stiffest", row.material.stiffest}};
      one["gravity"] = row.gravity;
      one["held_vertices"] = row.held;
      one["held_in_part"] = row.held_in_part;
      one["compared_vertices"] = row.compared;
      one["pieces_not_held"] = row.pieces_idle;
      one["tetrahedra_left_out"] = row.left_out;
      one["reference"] = {{"tetrahedra", row.reference_tetrahedra},
                          {"rms_displacement", row.reference_rms},
                          {"largest_displacement", row.reference_largest},
                          {"residual", row.residual},
                          {"stable", row.stable},
                          {"on_target", row.on_target}};
      one["error_rms"] = row.score.rms;
      one["error_max"] = row.score.largest;
      one["way"] = row.score.way;
      one["rest_seconds"] = row.rest_seconds < 0 ? nlohmann::ordered_json() : nlohmann::ordered_json(row.rest_seconds);
      one["rms_speed"] = row.speed;
      one["microseconds_per_step"] = row.microseconds;
      one["finite"] = row.finite;
      one["note"] = noteOf(row);
    }
    json["results"].push_back(std::move(one));
  }
  return json;
}

std::string assetsText(const std::vector<AssetsRow>& rows) {
  std::size_t widest = 7;
  for (const AssetsRow& row : rows) widest = std::max(widest, row.package.size());
  const int width = int(widest);
  std::array<char, 512> line{};
  std::snprintf(line.data(), line.size(), "%-*s  %-10s  %9s  %8s  %-14s  %7s  %7s  %6s  %7s  %10s  %7s\n", width,
                "package", "scene", "moved, %", "E, Pa", "g, m/s2", "error,%", "most, %", "way", "rest, s",
                "speed, 1/s", "us/step");
  std::string text = line.data();
  for (const AssetsRow& row : rows) {
    const std::string note = noteOf(row);
    if (!row.exists) {
      std::snprintf(line.data(), line.size(), "%-*s  %-10s  %s\n", width, row.package.c_str(), nameOf(row.scene).data(),
                    note.c_str());
      text += line.data();
      continue;
    }
    std::array<char, 32> gravity{}, rest{};
    std::snprintf(gravity.data(), gravity.size(), row.gravity > 0 ? "%.4g" : "-", row.gravity);
    std::snprintf(rest.data(), rest.size(), row.rest_seconds >= 0 ? "%.2f" : "never", row.rest_seconds);
    std::snprintf(line.data(), line.size(),
                  "%-*s  %-10s  %9.2f  %8.2g  %-14s  %7.1f  %7.1f  %6.3f  %7s  %10.1e  %7.0f%s%s\n", width,
                  row.package.c_str(), nameOf(row.scene).data(), 100 * row.reference_rms, row.material.material.young,
                  gravity.data(), 100 * row.score.rms, 100 * row.score.largest, row.score.way, rest.data(), row.speed,
                  row.microseconds, note.empty() ? "" : "  ", note.c_str());
    text += line.data();
  }
  return text +
         "moved: rms displacement of the reference, of the diagonal. error: rms difference, of that (a body that does "
         "not "
         "move: 100).\nmost: largest difference, of the largest displacement. way: how far it went along the "
         "reference's "
         "way. speed: rms at the end, diagonals/s.\n";
}

}  // namespace sinew::tools
