// SPDX-License-Identifier: GPL-3.0-or-later
//
// `sinew inspect --vertex` and `--name`.
#include "sinew/formats/identity.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "tools/author/json_text.h"
#include "tools/bake/inspect.h"
#include "tools/core/error.h"

namespace sinew::tools {
namespace {

using formats::PackageView;
using formats::VertexKind;
using nlohmann::ordered_json;

constexpr std::array<std::pair<std::string_view, VertexKind>, 4> kKinds = {{{"source", VertexKind::source},
                                                                            {"visual", VertexKind::visual},
                                                                            {"welded", VertexKind::welded},
                                                                            {"physical", VertexKind::physical}}};

[[noreturn]] void usage(const std::string& file, const std::string& what, const std::string& cure) {
  throw ToolError(ExitCode::usage, file, what, cure);
}

struct Asked {
  VertexKind kind = VertexKind::source;
  std::uint32_t number = 0;
};

std::vector<std::string> meshNames(const PackageView& package) {
  std::vector<std::string> names;
  for (const auto& mesh : package.sourceMeshes()) names.emplace_back(package.text(mesh.name));
  return names;
}

Asked askedFor(const PackageView& package, const std::string& file, const std::string& text) {
  const std::size_t colon = text.rfind(':');
  const std::string kind = text.substr(0, colon);
  const std::string digits = colon == std::string::npos ? "" : text.substr(colon + 1);
  Asked asked;
  const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), asked.number);
  if (digits.empty() || parsed.ec != std::errc() || parsed.ptr != digits.data() + digits.size()) {
    usage(file, "'" + text + "' names no vertex", "Write it as in source:1234, visual:7, welded:7 or physical:7.");
  }
  for (const auto& [name, value] : kKinds) {
    if (kind == name) {
      asked.kind = value;
      return asked;
    }
  }
  for (const auto& mesh : package.sourceMeshes()) {
    if (package.text(mesh.name) != kind) continue;
    if (asked.number >= mesh.source_vertex_count) {
      std::string what = "mesh '";
      what.append(kind).append("' has no vertex ").append(digits);
      usage(file, what, "It has " + std::to_string(mesh.source_vertex_count) + ", counted from 0.");
    }
    asked.number += mesh.first_source_vertex;
    return asked;
  }
  std::vector<std::string> names = meshNames(package);
  for (const auto& [name, value] : kKinds) names.emplace_back(name);
  usage(file, "there is no kind of vertex, and no mesh, named '" + kind + "'",
        "Did you mean " + nearestName(kind, names) + "?");
}

std::size_t countOf(const PackageView& package, VertexKind kind) {
  switch (kind) {
    case VertexKind::source:
      return package.sourceIdentity().size();
    case VertexKind::visual:
      return package.visualPositions().size();
    case VertexKind::physical:
      return package.physicalVertices().size();
    case VertexKind::welded:
      break;
  }
  std::size_t count = 0;
  for (const auto& v : package.visualIdentity()) count = std::max<std::size_t>(count, v.welded + std::size_t{1});
  return count;
}

ordered_json place(const PackageView& package, const formats::Float3& x) {
  ordered_json json = ordered_json::array();
  for (std::size_t k = 0; k < 3; ++k) json.push_back(package.info().origin[k] + double(x[k]));
  return json;
}

ordered_json sourceJson(const PackageView& package, std::uint32_t v) {
  ordered_json json = {{"vertex", v}};
  if (const auto at = formats::sourcePlace(package, v)) {
    json["mesh"] = at->mesh;
    json["vertex_in_mesh"] = at->vertex;
  }
  return json;
}

ordered_json visualJson(const PackageView& package, std::uint32_t v) {
  ordered_json json = {{"vertex", v}};
  if (!package.visualIdentity().empty()) {
    json["source"] = package.visualIdentity()[v].source_vertex;
    json["welded"] = package.visualIdentity()[v].welded;
  }
  json["position"] = place(package, package.visualPositions()[v]);
  if (const auto hold = formats::tetrahedronOf(package, v)) {
    json["attachment"] = {{"tetrahedron", hold->tetrahedron}, {"physical", hold->physical}, {"weights", hold->weight}};
  } else {
    const auto range = package.clusterAttachmentRanges()[v];
    json["attachment"] = {{"clusters", ordered_json::array()}, {"weights", ordered_json::array()}};
    for (const auto& a : package.clusterAttachments().subspan(range.first, range.count)) {
      json["attachment"]["clusters"].push_back(package.text(package.clusters()[a.cluster].name));
      json["attachment"]["weights"].push_back(a.weight);
    }
  }
  json["groups"] = ordered_json::array();
  for (const auto& group : package.groups()) {
    const auto members = package.groupVertices().subspan(group.first, group.count);
    if (std::binary_search(members.begin(), members.end(), v)) json["groups"].push_back(package.text(group.name));
  }
  json["masks"] = ordered_json::array();
  for (std::uint32_t m = 0; m < package.masks().size(); ++m) {
    const float weight = formats::maskWeight(package, m, v);
    if (weight > 0) json["masks"].push_back({{"name", package.text(package.masks()[m].name)}, {"weight", weight}});
  }
  return json;
}

ordered_json physicalJson(const PackageView& package, std::uint32_t v) {
  const formats::PhysicalVertex& vertex = package.physicalVertices()[v];
  ordered_json json = {{"vertex", v}, {"position", place(package, vertex.rest_position)}, {"mass", vertex.mass}};
  json["clusters"] = ordered_json::array();
  for (const auto& cluster : package.clusters()) {
    const auto members = package.memberships().subspan(cluster.first_member, cluster.member_count);
    const auto at = std::lower_bound(members.begin(), members.end(), v,
                                     [](const formats::Membership& m, std::uint32_t w) { return m.vertex < w; });
    if (at == members.end() || at->vertex != v) continue;
    json["clusters"].push_back({{"name", package.text(cluster.name)}, {"share", at->share}});
  }
  json["pin_sets"] = ordered_json::array();
  for (const auto& set : package.pinSets()) {
    const auto held = package.pinSetVertices().subspan(set.first, set.count);
    if (std::binary_search(held.begin(), held.end(), v)) json["pin_sets"].push_back(package.text(set.name));
  }
  return json;
}

}  // namespace

ordered_json inspectVertex(const PackageView& package, const std::string& file, const std::string& text) {
  const Asked asked = askedFor(package, file, text);
  const auto visual = formats::visualVerticesOf(package, asked.kind, asked.number);
  if (!visual) {
    const std::size_t count = countOf(package, asked.kind);
    usage(file, "there is no vertex " + text,
          count == 0 ? "The package was baked without them: add identity to package.needs."
                     : "There are " + std::to_string(count) + ", counted from 0.");
  }
  std::vector<std::uint32_t> sources;
  std::vector<std::uint32_t> physical;
  if (asked.kind == VertexKind::source) sources.push_back(asked.number);
  if (asked.kind == VertexKind::physical) physical.push_back(asked.number);
  for (const std::uint32_t v : *visual) {
    if (asked.kind != VertexKind::source && !package.visualIdentity().empty()) {
      sources.push_back(package.visualIdentity()[v].source_vertex);
    }
    if (asked.kind == VertexKind::physical) continue;
    if (const auto hold = formats::tetrahedronOf(package, v)) {
      physical.insert(physical.end(), hold->physical.begin(), hold->physical.end());
    }
  }
  const auto listed = [](std::vector<std::uint32_t>& numbers, const auto& record) {
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    ordered_json json = ordered_json::array();
    for (const std::uint32_t v : numbers) json.push_back(record(v));
    return json;
  };
  ordered_json json = {{"asked", text}};
  json["source"] = listed(sources, [&](std::uint32_t v) { return sourceJson(package, v); });
  json["visual"] = ordered_json::array();
  for (const std::uint32_t v : *visual) json["visual"].push_back(visualJson(package, v));
  json["physical"] = listed(physical, [&](std::uint32_t v) { return physicalJson(package, v); });
  return json;
}

ordered_json inspectName(const PackageView& package, const std::string& file, const std::string& name) {
  ordered_json json = {{"asked", name}};
  std::vector<std::string> known;
  const auto each = [&](const char* kind, const auto& items, const auto& record) {
    for (const auto& item : items) {
      known.emplace_back(package.text(item.name));
      if (known.back() == name) json[kind].push_back(record(item));
    }
  };
  const auto run = [](std::uint32_t first, std::uint32_t count) {
    return ordered_json{{"first", first}, {"count", count}};
  };
  each("groups", package.groups(), [&](const formats::Group& g) {
    return ordered_json{{"visual", package.groupVertices().subspan(g.first, g.count)}};
  });
  each("masks", package.masks(), [&](const formats::Mask& m) {
    ordered_json record = {{"visual", ordered_json::array()}, {"weights", ordered_json::array()}};
    for (const auto& w : package.maskWeights().subspan(m.first, m.count)) {
      record["visual"].push_back(w.vertex);
      record["weights"].push_back(w.weight);
    }
    return record;
  });
  each("clusters", package.clusters(), [&](const formats::Cluster& c) {
    ordered_json record = {{"number", &c - package.clusters().data()},
                           {"piece", package.text(package.pieces()[c.piece].name)},
                           {"physical", ordered_json::array()},
                           {"shares", ordered_json::array()}};
    for (const auto& m : package.memberships().subspan(c.first_member, c.member_count)) {
      record["physical"].push_back(m.vertex);
      record["shares"].push_back(m.share);
    }
    return record;
  });
  each("pin_sets", package.pinSets(), [&](const formats::PinSet& s) {
    return ordered_json{{"number", &s - package.pinSets().data()},
                        {"target", package.text(s.target)},
                        {"physical", package.pinSetVertices().subspan(s.first, s.count)}};
  });
  each("channels", package.channels(), [&](const formats::ActivationChannel& channel) {
    const auto number = std::uint32_t(&channel - package.channels().data());
    ordered_json record = {{"number", number}, {"clusters", ordered_json::array()}};
    for (std::size_t c = 0; c < package.mechanics().size(); ++c) {
      if (package.mechanics()[c].channel == number) {
        record["clusters"].push_back(package.text(package.clusters()[c].name));
      }
    }
    return record;
  });
  each("pieces", package.pieces(), [&](const formats::PieceRange& b) {
    return ordered_json{{"physical", run(b.first_vertex, b.vertex_count)},
                        {"clusters", run(b.first_cluster, b.cluster_count)}};
  });
  each("source_meshes", package.sourceMeshes(), [&](const formats::SourceMesh& m) {
    return ordered_json{{"source", run(m.first_source_vertex, m.source_vertex_count)}};
  });
  if (json.size() == 1) {
    usage(file, "nothing is named '" + name + "'",
          known.empty() ? "It has no names." : "Did you mean " + nearestName(name, known) + "?");
  }
  return json;
}

}  // namespace sinew::tools
