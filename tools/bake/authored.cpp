// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/bake/authored.h"

#include <algorithm>
#include <map>

#include "tools/author/pins.h"
#include "tools/author/unused_settings.h"
#include "tools/bake/parts.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;

// One that is held more than this is held exactly: a mean of ones may round to less.
constexpr double kExactPin = 0.999;

// More than this of a vertex is most of it.
constexpr double kMost = 0.5;

double factorAt(const RecipeFactor& factor, double weight) {
  return 1 + std::clamp(weight, 0.0, 1.0) * (factor.value - 1);
}

Vector3d centerOf(const VisualMesh& mesh, const VisualWeights& weights) {
  Vector3d sum = Vector3d::Zero();
  double total = 0;
  for (std::size_t v = 0; v < weights.size(); ++v) {
    sum += weights[v] * mesh.positions[v];
    total += weights[v];
  }
  return sum / total;
}

Vector3d fibreOf(const RecipeCluster& cluster, const VisualWeights& origin, const VisualWeights& insertion,
                 const ClusterSource& source, const WeightTransfer& transfer, const VisualMesh& mesh) {
  if (cluster.fibre) return cluster.fibre->normalized();
  if (!origin.empty() && !insertion.empty()) {
    const Vector3d along = centerOf(mesh, insertion) - centerOf(mesh, origin);
    if (along.norm() > 0) return along.normalized();
  }
  return longestAxis(transfer.physical(), transfer.graph(), source);
}

void addChannels(const AuthoredWeights& authored, const WeightTransfer& transfer,
                 const std::vector<ClusterSource>& sources, const VisualMesh& mesh, formats::PackageContent& content,
                 std::vector<Finding>& findings) {
  std::map<std::string, std::uint32_t> channels;
  for (const RecipeCluster& cluster : authored.clusters) {
    if (cluster.channel.empty() || channels.contains(cluster.channel)) continue;
    channels.emplace(cluster.channel, std::uint32_t(content.channels.size()));
    content.channels.push_back({content.addText(cluster.channel)});
  }
  if (channels.empty()) return;
  if (content.mechanics.empty()) content.mechanics.assign(content.clusters.size(), formats::kPlainMechanics);
  for (std::size_t c = 0; c < sources.size(); ++c) {
    const std::uint32_t number = sources[c].recipe_cluster;
    if (number == formats::kNone || authored.clusters[number].channel.empty()) continue;
    const RecipeCluster& cluster = authored.clusters[number];
    const Vector3d fibre =
        fibreOf(cluster, authored.origins[number], authored.insertions[number], sources[c], transfer, mesh);
    if (!(fibre.norm() > 0)) {
      findings.push_back({"cluster-no-fibre",
                          Severity::warning,
                          "cluster " + sources[c].name + " has a channel but no direction to contract in",
                          1,
                          "",
                          {},
                          sources[c].name,
                          "Give it a fibre, or more physical vertices."});
      continue;
    }
    formats::ClusterMechanics& mechanics = content.mechanics[c];
    for (int k = 0; k < 3; ++k) mechanics.fibre[std::size_t(k)] = float(fibre[k]);
    mechanics.channel = channels.at(cluster.channel);
    mechanics.contraction = float(cluster.contraction);
  }
}

// Takes what rides along out of a selection: no tetrahedra hang there. \return whether nothing is left.
bool withoutRiders(VisualWeights& weights, std::span<const std::uint8_t> rides) {
  for (std::size_t v = 0; v < rides.size(); ++v) {
    if (rides[v] != 0) weights[v] = 0;
  }
  return std::none_of(weights.begin(), weights.end(), [](double w) { return w > 0; });
}

// The pin sets of a recipe: its own, and the origins of its muscles.
std::vector<PinWeights> pinWeights(const Recipe& recipe, const AuthoredWeights& authored) {
  std::vector<PinWeights> sets;
  for (std::size_t p = 0; p < recipe.pins.size(); ++p) sets.push_back({recipe.pins[p].name, authored.pins[p]});
  for (std::size_t c = 0; c < authored.clusters.size(); ++c) {
    if (!authored.origins[c].empty()) sets.push_back({authored.clusters[c].name + ".origin", authored.origins[c]});
  }
  for (PinWeights& set : sets) set.rides = withoutRiders(set.weights, authored.rides);
  return sets;
}

std::vector<RigidShares> rigidShares(const std::vector<ClusterSource>& sources,
                                     const formats::PackageContent& content) {
  std::vector<RigidShares> rigid;
  for (std::size_t c = 0; c < sources.size(); ++c) {
    const formats::Cluster& cluster = content.clusters[c];
    if (cluster.mode != formats::ClusterMode::rigid) continue;
    rigid.push_back({sources[c].name, std::vector<double>(content.physical_vertices.size(), 0)});
    for (std::uint32_t m = cluster.first_member; m < cluster.first_member + cluster.member_count; ++m) {
      rigid.back().shares[content.memberships[m].vertex] += double(content.memberships[m].share);
    }
  }
  return rigid;
}

void addPins(const Recipe& recipe, const AuthoredWeights& authored, const WeightTransfer& transfer,
             const std::vector<ClusterSource>& sources, formats::PackageContent& content,
             std::vector<Finding>& findings) {
  std::vector<PinWeights> sets = pinWeights(recipe, authored);
  if (sets.empty()) return;
  for (PinWeights& set : sets) {
    const bool shaded = std::any_of(set.weights.begin(), set.weights.end(), [](double w) { return w > 0 && w < 1; });
    set.weights = transfer(set.weights);
    // A weight below 1 is a spring of its own frequency (docs/method.md §2), which stiff flesh bends: where the
    // selection has no shades, none come in by carrying it over to vertices that are mostly in it.
    for (double& weight : set.weights) {
      if (weight > (shaded ? kExactPin : kMost)) weight = 1;
    }
  }
  const std::vector<std::uint32_t> holders = pinHolders(sets);
  content.pin_weights.assign(content.physical_vertices.size(), 0);
  for (std::uint32_t s = 0; s < sets.size(); ++s) {
    const RecipePins given = s < recipe.pins.size() ? recipe.pins[s] : RecipePins{};
    const auto first = std::uint32_t(content.pin_set_vertices.size());
    for (std::uint32_t v = 0; v < holders.size(); ++v) {
      if (holders[v] != s) continue;
      content.pin_weights[v] = float(sets[s].weights[v]);
      content.pin_set_vertices.push_back(v);
    }
    const auto count = std::uint32_t(content.pin_set_vertices.size()) - first;
    content.pin_sets.push_back(
        {content.addText(sets[s].name), content.addText(given.target), given.method, first, count, 0});
  }
  const std::vector<Finding> found = judgePins(sets, rigidShares(sources, content), "physical");
  findings.insert(findings.end(), found.begin(), found.end());
}

// Carrier of a part: a cluster, a set of pins, a mask, or a selection.
VisualWeights hostWeights(const Recipe& recipe, const RecipePart& part, const AuthoredWeights& authored,
                          Selections& selections) {
  if (part.to.json.is_null()) return {};
  if (!part.to.json.is_string()) return selections.evaluate(part.to);
  const auto name = part.to.json.get<std::string>();
  std::vector<std::string> known;
  for (std::size_t c = 0; c < authored.clusters.size(); ++c) {
    if (authored.clusters[c].name == name) return authored.cluster_weights[c];
    known.push_back(authored.clusters[c].name);
  }
  for (std::size_t p = 0; p < recipe.pins.size(); ++p) {
    if (recipe.pins[p].name == name) return authored.pins[p];
    known.push_back(recipe.pins[p].name);
  }
  if (recipe.mask(name) != nullptr) return selections.evaluate(part.to);
  for (const auto& mask : recipe.masks) known.push_back(mask.first);
  recipe.text->fail(
      part.to.pointer, "there is no cluster, set of pins or mask '" + name + "' to carry part " + part.name,
      known.empty() ? "Leave `to` out: what is nearest carries it." : "Did you mean " + nearestName(name, known) + "?");
}

void addMasks(const Recipe& recipe, const AuthoredWeights& authored, formats::PackageContent& content) {
  for (std::size_t m = 0; m < recipe.masks.size(); ++m) {
    const auto first = std::uint32_t(content.mask_weights.size());
    for (std::uint32_t v = 0; v < authored.masks[m].size(); ++v) {
      const auto weight = float(std::min(authored.masks[m][v], 1.0));
      if (weight > 0) content.mask_weights.push_back({v, weight});
    }
    content.masks.push_back(
        {content.addText(recipe.masks[m].first), first, std::uint32_t(content.mask_weights.size()) - first});
  }
}

void addColors(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh,
               formats::PackageContent& content) {
  if (recipe.colors.empty()) return;
  std::vector<std::array<float, 4>> colors = mesh.colors;
  if (colors.empty()) colors.assign(mesh.positions.size(), {1, 1, 1, 1});
  for (std::size_t i = 0; i < recipe.colors.size(); ++i) {
    for (std::size_t v = 0; v < colors.size(); ++v) {
      const auto weight = float(std::clamp(authored.colors[i][v], 0.0, 1.0));
      for (std::size_t k = 0; k < 3; ++k) colors[v][k] += weight * (float(recipe.colors[i].color[k]) - colors[v][k]);
    }
  }
  content.visual_colors = packedColors(colors);
}

void sayUnusedSettings(const Recipe& recipe, const AuthoredWeights& authored, const Topology& topology,
                       const VisualMesh& mesh, std::vector<Finding>& findings) {
  // A loose part that no cluster touches may become a piece of automatic clusters.
  std::vector<std::uint8_t> touched(topology.parts.size(), 0);
  for (const VisualWeights& weights : authored.cluster_weights) {
    for (std::size_t p = 0; p < touched.size(); ++p) {
      for (const std::uint32_t t : topology.parts[p].triangles) {
        for (const std::uint32_t v : mesh.triangles[t]) {
          if (weights[v] > 0) touched[p] = 1;
        }
      }
    }
  }
  const bool automatic = std::find(touched.begin(), touched.end(), 0) != touched.end();
  if (const auto unused = unusedSettings(recipe.settings, authored.clusters, automatic)) findings.push_back(*unused);
}

}  // namespace

std::vector<formats::Color8> packedColors(std::span<const std::array<float, 4>> colors) {
  std::vector<formats::Color8> packed(colors.size());
  for (std::size_t v = 0; v < colors.size(); ++v) {
    for (std::size_t k = 0; k < 4; ++k)
      packed[v][k] = std::uint8_t(std::lround(std::clamp(colors[v][k], 0.0F, 1.0F) * 255));
  }
  return packed;
}

AuthoredWeights evaluateRecipe(const Recipe& recipe, const VisualMesh& mesh, const Topology& topology,
                               const std::vector<ClusterMesh>& cluster_meshes, std::vector<Finding>& findings) {
  AuthoredWeights authored;
  authored.clusters = withClusterMeshes(recipe, cluster_meshes);
  findings.insert(findings.end(), recipe.migrated.begin(), recipe.migrated.end());
  if (authored.clusters.empty() && recipe.pins.empty() && recipe.stiffness.empty() && recipe.thickness.empty() &&
      recipe.colors.empty() && recipe.parts.empty() && recipe.masks.empty()) {
    sayUnusedSettings(recipe, authored, topology, mesh, findings);
    return authored;
  }
  Selections selections(recipe, mesh, topology, cluster_meshes, findings);
  authored.cluster_weights = selections.clusters();
  sayUnusedSettings(recipe, authored, topology, mesh, findings);
  const auto evaluate = [&](const SelectionText& s) {
    return s.json.is_null() ? VisualWeights{} : selections.evaluate(s);
  };
  for (const RecipeCluster& cluster : authored.clusters) {
    authored.origins.push_back(evaluate(cluster.origin));
    authored.insertions.push_back(evaluate(cluster.insertion));
  }
  for (const RecipePins& pins : recipe.pins) authored.pins.push_back(evaluate(pins.from));
  for (const RecipeFactor& stiffness : recipe.stiffness) authored.stiffness.push_back(evaluate(stiffness.from));
  for (const RecipeFactor& thickness : recipe.thickness) authored.thickness.push_back(evaluate(thickness.from));
  for (const RecipeColor& color : recipe.colors) authored.colors.push_back(evaluate(color.from));
  for (const RecipePart& part : recipe.parts) {
    authored.parts.push_back(evaluate(part.from));
    authored.part_hosts.push_back(hostWeights(recipe, part, authored, selections));
  }
  authored.rides = ridingVertices(authored.parts, mesh, topology);
  for (const auto& [name, mask] : recipe.masks) authored.masks.push_back(selections.weights({name, mask.pointer}));
  return authored;
}

std::vector<Finding> judgePins(const Recipe& recipe, const AuthoredWeights& authored) {
  const std::vector<PinWeights> sets = pinWeights(recipe, authored);
  if (sets.empty()) return {};
  std::vector<double> whole(sets[0].weights.size(), 0);
  for (const VisualWeights& weights : authored.cluster_weights) {
    for (std::size_t v = 0; v < whole.size(); ++v) whole[v] += weights[v];
  }
  std::vector<RigidShares> rigid;
  for (std::size_t c = 0; c < authored.clusters.size(); ++c) {
    if (optionsOf(authored.clusters[c], recipe.settings).mode != formats::ClusterMode::rigid) continue;
    rigid.push_back({authored.clusters[c].name, authored.cluster_weights[c]});
    for (std::size_t v = 0; v < whole.size(); ++v) rigid.back().shares[v] /= std::max(whole[v], kMinimumPin);
  }
  return judgePins(sets, rigid, "visual");
}

std::vector<Finding> checkNewSelections(const Recipe& before, const Recipe& after, const VisualMesh& mesh,
                                        const Topology& topology, const std::vector<ClusterMesh>& cluster_meshes) {
  std::vector<Finding> findings;
  Selections selections(after, mesh, topology, cluster_meshes, findings);
  std::vector<VisualWeights> parts;
  for (const RecipePart& part : after.parts) parts.push_back(selections.evaluate(part.from));
  const std::vector<std::uint8_t> rides = ridingVertices(parts, mesh, topology);
  for (const SelectionText& selection : newSelections(before, after)) {
    if (usesRest(after, selection.json)) {
      selections.clusters();
      continue;
    }
    VisualWeights weights = selections.evaluate(selection);
    const bool holds = selection.pointer.starts_with("/clusters") || selection.pointer.starts_with("/pins");
    if (holds && withoutRiders(weights, rides)) {
      after.text->fail(
          selection.pointer, "the selection has only what rides along with others (parts)",
          "It has no tetrahedra of its own and moves with what carries it: select that, or remove the part.");
    }
  }
  if (!after.pins.empty()) {
    const std::vector<Finding> judged =
        judgePins(after, evaluateRecipe(after, mesh, topology, cluster_meshes, findings));
    findings.insert(findings.end(), judged.begin(), judged.end());
  }
  return findings;
}

std::vector<double> shellFactors(const Recipe& recipe, const AuthoredWeights& authored, const VisualMesh& mesh) {
  std::vector<double> factors(recipe.thickness.empty() ? 0 : mesh.welded_positions.size(), 1);
  for (std::size_t i = 0; i < recipe.thickness.size(); ++i) {
    // Visual vertices of one point have one weight.
    std::vector<double> weights(factors.size(), 0);
    for (std::size_t v = 0; v < mesh.welded.size(); ++v) weights[mesh.welded[v]] = authored.thickness[i][v];
    for (std::size_t p = 0; p < factors.size(); ++p) factors[p] *= factorAt(recipe.thickness[i], weights[p]);
  }
  return factors;
}

void addAuthored(const Recipe& recipe, const AuthoredWeights& authored, const WeightTransfer& transfer,
                 const std::vector<ClusterSource>& sources, const VisualMesh& mesh, formats::PackageContent& content,
                 std::vector<Finding>& findings) {
  addChannels(authored, transfer, sources, mesh, content, findings);
  addPins(recipe, authored, transfer, sources, content, findings);
  addMasks(recipe, authored, content);
  addColors(recipe, authored, mesh, content);
  if (recipe.stiffness.empty()) return;
  content.vertex_stiffness.assign(content.physical_vertices.size(), 1);
  for (std::size_t s = 0; s < recipe.stiffness.size(); ++s) {
    const std::vector<double> weights = transfer(authored.stiffness[s]);
    for (std::size_t v = 0; v < weights.size(); ++v) {
      content.vertex_stiffness[v] *= float(factorAt(recipe.stiffness[s], weights[v]));
    }
  }
}

}  // namespace sinew::tools
