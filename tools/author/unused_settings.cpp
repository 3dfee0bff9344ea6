// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/unused_settings.h"

#include <algorithm>
#include <array>

#include "tools/core/text.h"

namespace sinew::tools {
namespace {

// Settings that act on automatic clusters alone; on authored ones alone.
constexpr std::array<std::string_view, 3> kOfAutomatic = {"clusters.method", "clusters.grid", "clusters.size"};
constexpr std::string_view kOfAuthored = "clusters.soften_metres";

std::string valueOf(Settings& settings, std::string_view key) {
  for (const auto& d : Settings::declarations(settings)) {
    if (d.key == key) return valueText(settings, d);
  }
  return "";
}

/// Which of a cluster's frequencies counts, where a setting is another one (docs/settings.md, clusters.mode); else "".
std::string whyFrequencyIsUnused(Settings& settings, std::string_view key) {
  const ClusterOptions& o = settings.clusters;
  const std::array<std::pair<std::string_view, double>, 3> all = {
      {{"clusters.stretch_hz", o.stretch_hz}, {"clusters.bend_hz", o.bend_hz}, {"clusters.twist_hz", o.twist_hz}}};
  const auto own = std::find_if(all.begin(), all.end(), [&](const auto& each) { return each.first == key; });
  if (own == all.end() || settings.attachment.method == AttachmentMethod::clusters) return "";
  if (o.mode == formats::ClusterMode::rigid) return "a rigid cluster does not deform";
  if (o.mode == formats::ClusterMode::linear) {
    return key == "clusters.stretch_hz" ? "" : "of a linear cluster stretch_hz alone counts";
  }
  const double lowest = std::min({o.stretch_hz, o.bend_hz, o.twist_hz});
  if (!(own->second > lowest)) return "";
  return "of a quadratic cluster the lowest of its three frequencies counts, " + rounded(lowest) + " Hz";
}

std::string whyUnused(Settings& settings, const Settings::Declaration& d) {
  if (!d.needs_key.empty() && valueOf(settings, d.needs_key) != d.needs_value) {
    return "it is of " + std::string(d.needs_key) + " = " + std::string(d.needs_value);
  }
  return whyFrequencyIsUnused(settings, d.key);
}

}  // namespace

std::optional<Finding> unusedSettings(const Settings& given, std::span<const RecipeCluster> clusters, bool automatic) {
  Settings settings = given;
  Settings defaults;
  // Settings of clusters: those of all, where some are automatic, and each authored one's.
  struct User {
    Settings settings;
    const RecipeCluster* cluster;
  };
  std::vector<User> users;
  if (automatic || clusters.empty()) users.push_back({settings, nullptr});
  for (const RecipeCluster& cluster : clusters) {
    users.push_back({settings, &cluster});
    for (const auto& [key, value] : cluster.settings) users.back().settings.setJson(key, value);
  }
  std::vector<std::string> unused;
  for (const auto& d : Settings::declarations(settings)) {
    if (valueText(settings, d) == valueOf(defaults, d.key)) continue;
    std::string why;
    if (std::find(kOfAutomatic.begin(), kOfAutomatic.end(), d.key) != kOfAutomatic.end() && !clusters.empty() &&
        !automatic) {
      why = "all clusters are the recipe's";
    } else if (d.key == kOfAuthored && clusters.empty()) {
      why = "no cluster is the recipe's";
    } else if (d.of_cluster || !d.needs_key.empty()) {
      const auto own = [&](const User& user) {
        return user.cluster != nullptr && std::any_of(user.cluster->settings.begin(), user.cluster->settings.end(),
                                                      [&](const auto& entry) { return entry.first == d.key; });
      };
      if (d.of_cluster && std::all_of(users.begin(), users.end(), own)) {
        why = "every cluster has its own";
      } else {
        // By all that go by it.
        for (User& user : users) {
          if (d.of_cluster && own(user)) continue;
          why = whyUnused(user.settings, d);
          if (why.empty()) break;
        }
      }
    }
    if (!why.empty()) unused.push_back(std::string(d.key) + " (" + why + ")");
  }
  // Of one cluster.
  for (User& user : users) {
    if (user.cluster == nullptr) continue;
    for (const auto& [key, value] : user.cluster->settings) {
      for (const auto& d : Settings::declarations(user.settings)) {
        if (d.key != key || valueText(user.settings, d) == valueOf(settings, d.key)) continue;
        const std::string why = whyUnused(user.settings, d);
        if (!why.empty()) unused.push_back(user.cluster->name + ": " + std::string(d.key) + " (" + why + ")");
      }
    }
  }
  if (unused.empty()) return std::nullopt;
  Finding finding;
  finding.id = "settings-unused";
  finding.count = unused.size();
  finding.message = counted(unused.size(), "setting says", "settings say") + " nothing with this recipe";
  for (const std::string& each : unused) finding.place += (finding.place.empty() ? "" : ", ") + each;
  finding.cure = "Leave it out, or set what it belongs to.";
  return finding;
}

}  // namespace sinew::tools
