// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/pins.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <map>

#include "tools/import/visual_mesh.h"

namespace sinew::tools {
namespace {

// Vertices that a set holds less than this lie in its falloff: where two sets meet, one of them has to yield there.
constexpr double kMeant = 0.5;

std::string listed(std::span<const PinWeights> sets, std::span<const std::uint32_t> which) {
  std::string text;
  for (std::size_t i = 0; i < which.size(); ++i) {
    text += (i == 0 ? "'" : i + 1 == which.size() ? " and '" : ", '") + sets[which[i]].name + "'";
  }
  return text;
}

}  // namespace

std::vector<std::uint32_t> pinHolders(std::span<const PinWeights> sets) {
  std::vector<std::uint32_t> holders(sets.empty() ? 0 : sets[0].weights.size(), formats::kNone);
  for (std::uint32_t s = 0; s < sets.size(); ++s) {
    for (std::size_t v = 0; v < holders.size(); ++v) {
      const double weight = sets[s].weights[v];
      if (weight < kMinimumPin) continue;
      if (holders[v] == formats::kNone || weight > sets[holders[v]].weights[v]) holders[v] = s;
    }
  }
  return holders;
}

std::vector<std::uint32_t> rigidHolders(std::span<const double> shares, std::span<const std::uint32_t> holders,
                                        std::span<const double> weights) {
  std::vector<std::uint32_t> sets;
  for (const double least : {kMeant, 0.0}) {
    for (std::size_t v = 0; v < holders.size(); ++v) {
      if (holders[v] != formats::kNone && weights[v] >= least && shares[v] > 1 - kNoShare) sets.push_back(holders[v]);
    }
    if (!sets.empty()) break;
  }
  std::sort(sets.begin(), sets.end());
  sets.erase(std::unique(sets.begin(), sets.end()), sets.end());
  return sets;
}

std::vector<Finding> judgePins(std::span<const PinWeights> sets, std::span<const RigidShares> clusters,
                               const std::string& vertices) {
  std::vector<Finding> findings;
  const std::vector<std::uint32_t> holders = pinHolders(sets);
  std::vector<double> weights(holders.size(), 0);
  for (std::size_t v = 0; v < holders.size(); ++v) {
    if (holders[v] != formats::kNone) weights[v] = sets[holders[v]].weights[v];
  }
  std::vector<std::uint32_t> mover = holders;  // the set that each vertex moves with
  std::vector<std::uint32_t> rigid_in(holders.size(), formats::kNone);
  for (std::uint32_t c = 0; c < clusters.size(); ++c) {
    const std::vector<std::uint32_t> by = rigidHolders(clusters[c].shares, holders, weights);
    if (by.size() == 1) {
      for (std::size_t v = 0; v < holders.size(); ++v) {
        if (weights[v] >= 1 || holders[v] == by[0] || !(clusters[c].shares[v] > 1 - kNoShare)) continue;
        mover[v] = by[0];
        rigid_in[v] = c;
      }
    }
    if (by.size() < 2) continue;
    const std::string what = "the rigid cluster '" + clusters[c].name + "' is held by pins " + listed(sets, by) +
                             ": it moves with none of them as a whole, and bends between them";
    const char* const cure = "Let one set hold it, or make a rigid cluster for each.";
    findings.push_back({"cluster-held-by-several", Severity::warning, what, by.size(), "", {}, clusters[c].name, cure});
  }
  for (std::uint32_t s = 0; s < sets.size(); ++s) {
    std::size_t selected = 0;
    std::size_t moved = 0;
    std::map<std::string, std::array<std::size_t, 2>> why;  // counts of all, and of meant ones
    std::size_t meant = 0;
    double firmest = 0;
    for (std::size_t v = 0; v < holders.size(); ++v) {
      const double weight = sets[s].weights[v];
      if (weight < kMinimumPin) continue;
      ++selected;
      moved += mover[v] == s ? 1U : 0U;
      firmest = std::max(firmest, mover[v] == s ? weight : 0.0);
      if (mover[v] == s) continue;
      const std::string other = "pins '" + sets[mover[v]].name + "'";
      std::array<std::size_t, 2>& counts =
          why[rigid_in[v] == formats::kNone
                  ? "are held as firmly or firmer by " + other
                  : "belong to the rigid cluster '" + clusters[rigid_in[v]].name + "', which " + other + " hold"];
      ++counts[0];
      if (weight < kMeant) continue;
      ++counts[1];
      ++meant;
    }
    if (moved > 0 && firmest < kMeant) {
      char text[120];
      std::snprintf(text, sizeof text, "' hold none of their %zu %s vertices firmly: the largest weight is %.2g",
                    selected, vertices.c_str(), firmest);
      findings.push_back({"pins-loose",
                          Severity::warning,
                          "pins '" + sets[s].name + text,
                          selected,
                          "",
                          {},
                          sets[s].name,
                          "What weighs less than 1 follows as springs do. Select more, or raise tetrahedra.vertices."});
    }
    if (moved > 0 && meant == 0) continue;
    const bool nothing = moved == 0;
    Finding finding;
    finding.id = nothing ? "pins-hold-nothing" : "pins-overruled";
    finding.count = nothing ? selected : meant;
    finding.place = sets[s].name;
    finding.message = "pins '" + sets[s].name + "' ";
    if (sets[s].rides) {
      finding.message += "hold nothing: all that they select rides along with others (parts)";
      finding.cure = "It has no tetrahedra of its own and moves with what carries it: pin that, or remove the part.";
    } else if (selected == 0) {
      finding.message += "hold nothing: no " + vertices + " vertex hangs on what they select";
      finding.cure = "Select more, or raise tetrahedra.vertices.";
    } else {
      finding.message += nothing ? "move none" : "do not move " + std::to_string(meant);
      finding.message += " of the " + std::to_string(selected) + " " + vertices + " vertices that they select";
      std::string separator = ": ";
      for (const auto& [reason, counts] : why) {
        const std::size_t count = counts[nothing ? 0 : 1];
        if (count == 0) continue;
        finding.message.append(separator).append(std::to_string(count)).append(" ").append(reason);
        separator = "; ";
      }
      finding.cure =
          "Take these vertices out of the other pins or out of the cluster (minus), or hold them with weight 1.";
    }
    findings.push_back(finding);
  }
  return findings;
}

}  // namespace sinew::tools
