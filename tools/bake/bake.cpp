// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/bake.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <new>
#include <numeric>
#include <span>
#include <string>

#include "runtime/geometry/rounded.h"
#include "sinew/formats/package.h"
#include "tools/author/regions.h"
#include "tools/bake/fields.h"
#include "tools/bake/findings_json.h"
#include "tools/bake/leave_out.h"
#include "tools/bake/stages.h"
#include "tools/bake/suggest_parts.h"
#include "tools/core/error.h"
#include "tools/import/import.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using nlohmann::ordered_json;

// A package as a reader has it, in aligned memory.
struct Opened {
  explicit Opened(std::span<const std::byte> package)
      : memory(static_cast<std::byte*>(::operator new(package.size(), std::align_val_t(formats::kSectionAlignment))),
               [](std::byte* p) { ::operator delete(p, std::align_val_t(formats::kSectionAlignment)); }) {
    std::memcpy(memory.get(), package.data(), package.size());
    refusal = formats::PackageView::open({memory.get(), package.size()}, view).reason;
  }
  std::unique_ptr<std::byte, void (*)(std::byte*)> memory;
  formats::PackageView view;
  std::string refusal;  // empty if it opens: what passes here is what every user will load
};

void moveToOrigin(const Vector3d& origin, VisualMesh& mesh) {
  for (Vector3d& x : mesh.positions) x = geometry::roundedToFloat(x - origin);
  for (Vector3d& x : mesh.welded_positions) x = geometry::roundedToFloat(x - origin);
  mesh.bounds_min = geometry::roundedToFloat(mesh.bounds_min - origin);
  mesh.bounds_max = geometry::roundedToFloat(mesh.bounds_max - origin);
}

// The package's bounds are the model's: a reader takes what is more than a diagonal outside them for damage.
void refuseFarVertices(const VisualMesh& mesh, const PhysicalMesh& physical) {
  double farthest = 0;
  for (const Vector3d& x : physical.positions) {
    farthest = std::max({farthest, (mesh.bounds_min - x).maxCoeff(), (x - mesh.bounds_max).maxCoeff()});
  }
  if (farthest <= 0.999 * mesh.diagonal) return;
  char text[128];
  std::snprintf(text, sizeof text, "its tetrahedra reach %.3g m beyond a model whose diagonal is %.3g m", farthest,
                mesh.diagonal);
  throw ToolError(ExitCode::bad_input, mesh.file, text, "Lower tetrahedra.thickness, or the recipe's factors of it.");
}

Solid fillSource(const Recipe& recipe, ImportedSource source, StageCache& cache, Progress& progress) {
  Solid solid;
  solid.host = withoutParts(source.mesh, source.parts);
  solid.topology = source.parts.empty() ? source.topology : analyzeTopology(solid.host);
  TetrahedraOptions filling = recipe.settings.tetrahedra;
  filling.shell_factors = shellFactors(recipe, source.authored, source.mesh);
  solid.key = tetrahedraKey(solid.host, filling);
  PhysicalMesh& physical = solid.physical;
  physical =
      cache.get("tetrahedra", solid.key, [&] { return tetrahedralize(solid.host, solid.topology, filling, progress); });
  solid.source = std::move(source);
  VisualMesh& mesh = solid.source.mesh;
  solid.origin = 0.5 * (mesh.bounds_min + mesh.bounds_max);
  moveToOrigin(solid.origin, mesh);
  moveToOrigin(solid.origin, solid.host);
  for (Vector3d& x : physical.positions) x = geometry::roundedToFloat(x - solid.origin);
  physical.quality = measureQuality(physical.positions, physical.tetrahedra);
  if (physical.quality.inverted > 0) {
    throw ToolError(ExitCode::bad_input, mesh.file,
                    "something in it is too small or too thin for its distance from the rest: " +
                        std::to_string(physical.quality.inverted) +
                        " tetrahedra turn over when rounded to single precision",
                    "Bake far parts as files of their own; make a shell thicker (tetrahedra.thickness).");
  }
  refuseFarVertices(mesh, physical);
  for (const std::vector<Finding>* more : {&mesh.findings, &physical.findings, &solid.source.findings})
    solid.findings.insert(solid.findings.end(), more->begin(), more->end());
  return solid;
}

// Numbers the vertices of each piece anew: first its surface's carriers, which alone are needed to draw it.
void drawnFirst(const VisualMesh& host, const std::vector<TetrahedronPlace>& places, PhysicalMesh& physical) {
  std::vector<char> drawn(physical.positions.size(), 0);
  for (const Triangle& t : host.triangles) {
    for (const std::uint32_t visual : t) {
      for (const std::uint32_t v : physical.tetrahedra[places[visual].tetrahedron]) drawn[v] = 1;
    }
  }
  std::vector<std::uint32_t> order(physical.positions.size()), number(order.size());
  std::iota(order.begin(), order.end(), 0U);
  for (const PhysicalPiece& piece : physical.pieces) {
    const auto first = order.begin() + piece.first_vertex;
    std::stable_partition(first, first + piece.vertex_count, [&](std::uint32_t v) { return drawn[v] != 0; });
  }
  const std::vector<Vector3d> before = physical.positions;
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    number[order[i]] = i;
    physical.positions[i] = before[order[i]];
  }
  for (auto& corners : physical.tetrahedra) {
    for (std::uint32_t& v : corners) v = number[v];
  }
}

Placed placeSource(const Solid& solid, StageCache& cache) {
  const std::vector<RidingPart>& parts = solid.source.parts;
  Placed placed{solid.physical, {}, {}};
  placed.places =
      cache.get("places", solid.key, [&] { return placeVisualVertices(solid.host, solid.topology, solid.physical); });
  followHost(parts, solid.host, solid.physical, placed.places);
  drawnFirst(solid.host, placed.places, placed.physical);
  placed.riders = joinRigidParts(parts, solid.host, placed.physical, placed.places);
  return placed;
}

Clustered clusterSource(const Settings& settings, const Solid& solid, const Placed& placed) {
  Clustered clustered{WeightTransfer(solid.host, placed.physical, placed.places), {}, solid.findings};
  std::vector<ClusterSource>& clusters = clustered.clusters;
  const AuthoredWeights& authored = solid.source.authored;
  clusters = authored.clusters.empty() ? automaticClusters(placed.physical, settings.clusters, {}, clustered.findings)
                                       : authoredClusters(clustered.transfer, authored.clusters,
                                                          authored.cluster_weights, settings, clustered.findings);
  for (ClusterSource& rider : riderClusters(solid.source.parts, placed.riders, clustered.transfer))
    clusters.push_back(std::move(rider));
  const auto by_piece = [](const ClusterSource& a, const ClusterSource& b) { return a.piece < b.piece; };
  std::stable_sort(clusters.begin(), clusters.end(), by_piece);
  return clustered;
}

// The package's bytes, which open. \param fields of the report: what is left out of the package is said there.
std::vector<std::byte> openingPackage(formats::PackageContent& content, const std::string& file, ordered_json& fields,
                                      std::vector<Finding>& findings) {
  std::vector<std::byte> package = formats::writePackage(content);
  std::string refusal = Opened(package).refusal;
  if (!refusal.empty() && !content.fields.empty()) {
    // Sizes at which numbers of fields leave their bounds, and pieces thinner than rounding: clusters move those. A
    // sheet bends (thickness / size)^4 as stiffly as it stretches across, of which doubles hold 2e-16: a thousandth of
    // that is right from 1/1500 on.
    constexpr double kBends = 1.0 / 1500;
    char least[32];
    std::snprintf(least, sizeof least, "%.2g m", kBends * double(content.info.diagonal));
    removeFields(content);
    fields = {{"left_out", refusal}};
    findings.push_back({"no-fields",
                        Severity::warning,
                        "the package has no fields, which the default solver moves a body by (" + refusal + ")",
                        1,
                        "",
                        {},
                        "",
                        "A sheet of this size bends from a thickness of about " + std::string(least) +
                            " on: raise tetrahedra.thickness. Or simulate it with --solver report."});
    package = formats::writePackage(content);
    refusal = Opened(package).refusal;
  }
  if (refusal.empty()) return package;
  throw ToolError(ExitCode::system, file, "the baked package does not pass its own check: " + refusal,
                  "This is a fault of sinew: please report it with the file.");
}

// Bytes of 16-bit numbers instead of a package's, where a reader takes them. \return what the report says.
ordered_json packNumbers(formats::PackageContent& content, std::vector<std::byte>& package,
                         std::vector<Finding>& findings) {
  PackedPackage packed = packedPackage(content);
  if (!packed.refusal.empty()) {
    findings.push_back({"not-packed",
                        Severity::warning,
                        "numbers of 16 bits are too coarse for this body (" + packed.refusal + "): they have 32",
                        1,
                        "",
                        {},
                        "",
                        "Nothing is wrong with the package; add exact to package.needs and this is not tried."});
    return {{"packed", false}};
  }
  ordered_json said = {{"packed", true},
                       {"bytes_exact", package.size()},
                       {"drawn_difference", drawnDifference(Opened(package).view, Opened(packed.bytes).view)}};
  package = std::move(packed.bytes);
  return said;
}

BakeResult bakeSource(const Recipe& recipe, ImportedSource source, Progress& progress, StageCache* cache,
                      bool with_fields, bool draft) {
  StageCache no_cache{{}};
  StageCache& kept = cache == nullptr ? no_cache : *cache;
  progress.stage("tetrahedra");
  const Solid solid = fillSource(recipe, std::move(source), kept, progress);
  progress.stage("clusters");
  const Placed placed = placeSource(solid, kept);
  const Clustered clustered = clusterSource(recipe.settings, solid, placed);
  Content content = contentOf(recipe, solid, placed, clustered, progress);
  ordered_json fields;
  if (with_fields) {
    progress.stage("fields");
    fields = addFields(recipe.settings, content.package, cache, draft);
  }
  progress.stage("package");
  BakeResult result;
  Needs needs = Needs::parse(recipe.settings.package.needs).value_or(Needs::all());
  std::vector<LeftUnseen> unseen;
  if (needs.isAutomatic()) {
    const std::vector<std::byte> whole =
        openingPackage(content.package, solid.source.mesh.file, fields, content.findings);
    const Opened opened(whole);
    needs = narrowed(needs, opened.view, !recipe.clusters.empty(), unseen);
  }
  if (needs != Needs::all()) leaveOut(content.package, needs);
  result.package = openingPackage(content.package, solid.source.mesh.file, fields, content.findings);
  ordered_json left_out = {{"needs", needs.text()}};
  if (!needs.has(Need::exact)) left_out.update(packNumbers(content.package, result.package, content.findings));
  for (const LeftUnseen& left : unseen) {
    left_out["unseen"].push_back({{"need", kNeedDeclarations[std::size_t(left.need)].name},
                                  {"bytes", left.bytes},
                                  {"change", left.change.most},
                                  {"bound", left.change.unseen},
                                  {"unit", left.change.unit}});
  }
  result.findings = content.findings;
  result.report = reportOf(recipe.settings, solid, placed, content, fields, result.package.size());
  result.report["left_out"] = left_out;
  progress.finish();
  return result;
}

}  // namespace

ImportedSource importSource(const Recipe& recipe, Progress& progress) {
  progress.stage("import");
  ImportedSource source;
  source.mesh = importVisualMesh(recipe.source, recipe.settings.import, progress);
  const std::vector<ClusterMesh> cluster_meshes = takeClusterMeshes(source.mesh);
  progress.stage("topology");
  source.topology = analyzeTopology(source.mesh);
  source.authored = evaluateRecipe(recipe, source.mesh, source.topology, cluster_meshes, source.findings);
  source.parts = findParts(recipe, source.authored, source.mesh, source.topology, source.findings);
  if (source.parts.empty()) {
    const std::vector<Finding> suggested = suggestParts(source.mesh, source.topology);
    source.findings.insert(source.findings.end(), suggested.begin(), suggested.end());
  }
  return source;
}

BakeResult bake(const Recipe& recipe, Progress& progress, StageCache* cache, bool draft) {
  return bakeSource(recipe, importSource(recipe, progress), progress, cache, true, draft);
}

std::vector<Finding> rehearseBake(const Recipe& recipe, ImportedSource source, Progress& progress, StageCache* cache) {
  try {
    BakeResult result = bakeSource(recipe, std::move(source), progress, cache, false, false);
    std::vector<Finding>& findings = result.findings;
    std::erase_if(findings, [](const Finding& finding) { return finding.severity == Severity::info; });
    return findings;
  } catch (const ToolError& error) {
    if (error.code() == ExitCode::system) throw;
    return {{"bake-refused", Severity::error, error.problem(), 1, "", {}, "", error.cure()}};
  }
}

}  // namespace sinew::tools
