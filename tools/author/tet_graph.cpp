// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/tet_graph.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <queue>
#include <tuple>

namespace sinew::tools {

TetGraph makeTetGraph(const PhysicalMesh& mesh) {
  // Ends by vertex, each as often as tetrahedra have the edge.
  std::vector<std::uint32_t> begin(mesh.positions.size() + 1, 0);
  for (const auto& tet : mesh.tetrahedra) {
    for (const std::uint32_t v : tet) begin[v + 1] += 3;
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::uint32_t> ends(begin.back()), at(begin.begin(), begin.end() - 1);
  for (const auto& tet : mesh.tetrahedra) {
    for (const std::uint32_t a : tet) {
      for (const std::uint32_t b : tet) {
        if (a != b) ends[at[a]++] = b;
      }
    }
  }
  TetGraph graph;
  graph.first.reserve(begin.size());
  graph.first.push_back(0);
  for (std::uint32_t a = 0; a < mesh.positions.size(); ++a) {
    const auto first = ends.begin() + begin[a], last = ends.begin() + begin[a + 1];
    std::sort(first, last);
    graph.neighbour.insert(graph.neighbour.end(), first, std::unique(first, last));
    graph.first.push_back(std::uint32_t(graph.neighbour.size()));
    for (std::size_t i = graph.length.size(); i < graph.neighbour.size(); ++i) {
      graph.length.push_back((mesh.positions[a] - mesh.positions[graph.neighbour[i]]).norm());
    }
  }
  for (const PhysicalPiece& body : mesh.pieces) {
    const std::uint32_t from = graph.first[body.first_vertex];
    const std::uint32_t to = graph.first[body.first_vertex + body.vertex_count];
    const double sum = std::accumulate(graph.length.begin() + from, graph.length.begin() + to, 0.0);
    graph.mean_edge.push_back(to > from ? sum / (to - from) : 0);
  }
  return graph;
}

namespace {

TetDistances spread(const TetGraph& graph, std::span<const std::pair<double, std::uint32_t>> sources, double limit,
                    std::span<const std::uint8_t> inside) {
  const std::size_t count = graph.first.size() - 1;
  TetDistances result{std::vector<double>(count, std::numeric_limits<double>::infinity()),
                      std::vector<std::uint32_t>(count, formats::kNone)};
  using Entry = std::tuple<double, std::uint32_t, std::uint32_t>;  // distance, source, vertex
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> front;
  const auto offer = [&](double d, std::uint32_t source, std::uint32_t v) {
    if (d > limit || !(std::tie(d, source) < std::tie(result.distance[v], result.nearest[v]))) return;
    result.distance[v] = d;
    result.nearest[v] = source;
    front.emplace(d, source, v);
  };
  for (const auto& [d, s] : sources) offer(d, s, s);
  while (!front.empty()) {
    const auto [d, source, v] = front.top();
    front.pop();
    if (d > result.distance[v] || source != result.nearest[v]) continue;
    for (std::uint32_t e = graph.first[v]; e < graph.first[v + 1]; ++e) {
      const std::uint32_t n = graph.neighbour[e];
      if (inside.empty() || inside[n] != 0) offer(d + graph.length[e], source, n);
    }
  }
  return result;
}

}  // namespace

TetDistances tetDistances(const TetGraph& graph, std::span<const std::uint32_t> sources, double limit,
                          std::span<const std::uint8_t> inside) {
  std::vector<std::pair<double, std::uint32_t>> places;
  places.reserve(sources.size());
  for (const std::uint32_t s : sources) places.emplace_back(0.0, s);
  return spread(graph, places, limit, inside);
}

TetDistances tetDistances(const TetGraph& graph, std::span<const double> start, double limit) {
  std::vector<std::pair<double, std::uint32_t>> places;
  for (std::uint32_t v = 0; v < start.size(); ++v) {
    if (start[v] <= limit) places.emplace_back(start[v], v);
  }
  return spread(graph, places, limit, {});
}

}  // namespace sinew::tools
