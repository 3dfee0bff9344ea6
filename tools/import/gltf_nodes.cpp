// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/gltf_nodes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

namespace sinew::tools {
namespace {

using nlohmann::json;

Eigen::Matrix4d localTransform(const GltfValue& node, std::size_t& zero_rotations) {
  if (node.get("matrix")) {
    const auto m = node.numbers<16>("matrix", {});
    Eigen::Matrix4d out;
    for (int k = 0; k < 16; ++k) out(k % 4, k / 4) = m[std::size_t(k)];
    if (std::abs(out(3, 0)) + std::abs(out(3, 1)) + std::abs(out(3, 2)) + std::abs(out(3, 3) - 1) > 1e-6)
      node.get("matrix").fail("a node's matrix is no affine one");
    out.row(3) << 0, 0, 0, 1;
    return out;
  }
  const auto t = node.numbers<3>("translation", {0, 0, 0});
  const auto r = node.numbers<4>("rotation", {0, 0, 0, 1});
  const auto s = node.numbers<3>("scale", {1, 1, 1});
  Eigen::Quaterniond q(r[3], r[0], r[1], r[2]);
  if (q.norm() < 1e-12) {
    ++zero_rotations;
    q.setIdentity();
  }
  q.normalize();
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = q.toRotationMatrix() * Eigen::Vector3d(s[0], s[1], s[2]).asDiagonal();
  out.topRightCorner<3, 1>() << t[0], t[1], t[2];
  return out;
}

/// The entry of a list at the top that `user` names.
GltfValue entry(const GltfValue& top, const char* list, const GltfValue& user) {
  const GltfValue values = top.get(list);
  const std::uint64_t index = user.integer();
  if (index >= values.size())
    user.fail("names entry " + std::to_string(index) + " of the " + std::to_string(values.size()) + " " + list);
  return values.at(index);
}

/// The node's extras; what mesh, primitives and materials carry goes below "mesh", "primitives" and "materials".
std::string properties(const GltfValue& top, const GltfValue& node) {
  json out = json::object();
  const GltfValue extras = node.get("extras");
  if (extras) {
    if (extras.raw().is_object()) {
      out = extras.raw();
    } else {
      out["extras"] = extras.raw();
    }
  }
  if (const GltfValue index = node.get("mesh")) {
    const GltfValue mesh = entry(top, "meshes", index);
    if (const GltfValue own = mesh.get("extras")) out["mesh"] = own.raw();
    const GltfValue primitives = mesh.get("primitives");
    json list = json::array();
    json materials = json::object();
    bool any = false;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      const GltfValue own = primitives.at(p).get("extras");
      any = any || own;
      list.push_back(own ? own.raw() : json::object());
      if (const GltfValue material = primitives.at(p).get("material")) {
        const GltfValue source = entry(top, "materials", material);
        if (const GltfValue its = source.get("extras"))
          materials[source.text("name", "material " + std::to_string(material.integer()))] = its.raw();
      }
    }
    if (any) out["primitives"] = list;
    if (!materials.empty()) out["materials"] = materials;
  }
  return out.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace

std::string GltfNodes::name(std::uint32_t node) const {
  const std::string given = values.at(node).text("name", "");
  return given.empty() ? "node " + std::to_string(node) : given;
}

GltfNodes gltfNodes(const GltfValue& top, RawScene& scene) {
  GltfNodes nodes;
  nodes.values = top.get("nodes");
  const std::size_t count = nodes.values.size();
  std::vector<std::uint32_t> parent(count, formats::kNone);
  std::vector<Eigen::Matrix4d> local(count);
  for (std::uint32_t n = 0; n < count; ++n) {
    const GltfValue node = nodes.values.at(n);
    local[n] = localTransform(node, nodes.zero_rotations);
    const GltfValue children = node.get("children");
    for (std::size_t k = 0; k < children.size(); ++k) {
      const std::uint64_t child = children.at(k).index("node", count);
      if (parent[child] != formats::kNone)
        children.at(k).fail("node " + std::to_string(child) + " hangs on two nodes, or on one twice");
      parent[child] = n;
    }
  }
  // Every node has at most one parent by now, so a walk over parents that takes more steps than nodes is a cycle.
  nodes.global.resize(count);
  std::vector<std::uint8_t> done(count, 0);
  for (std::uint32_t n = 0; n < count; ++n) {
    std::vector<std::uint32_t> chain;
    std::uint32_t at = n;
    while (at != formats::kNone && done[at] == 0) {
      if (chain.size() >= count) nodes.values.at(n).fail("nodes form a cycle");
      chain.push_back(at);
      at = parent[at];
    }
    for (auto it = chain.rbegin(); it != chain.rend(); ++it) {
      nodes.global[*it] =
          parent[*it] == formats::kNone ? local[*it] : Eigen::Matrix4d(nodes.global[parent[*it]] * local[*it]);
      done[*it] = 1;
    }
  }
  // The scene's nodes, parents first.
  std::vector<std::uint32_t> stack;
  const GltfValue scenes = top.get("scenes");
  if (const GltfValue chosen = top.get("scene"); chosen || scenes.size() > 0) {
    const std::uint64_t index = chosen ? chosen.index("scene", scenes.size()) : 0;
    const GltfValue roots = scenes.at(index).get("nodes");
    for (std::size_t k = 0; k < roots.size(); ++k) {
      stack.push_back(std::uint32_t(roots.at(k).index("node", count)));
    }
  } else {
    for (std::uint32_t n = 0; n < count; ++n)
      if (parent[n] == formats::kNone) stack.push_back(n);
  }
  std::reverse(stack.begin(), stack.end());
  nodes.number.assign(count, formats::kNone);
  while (!stack.empty()) {
    const std::uint32_t n = stack.back();
    stack.pop_back();
    if (nodes.number[n] != formats::kNone) continue;  // named twice as a root, or a root below another
    nodes.number[n] = std::uint32_t(scene.nodes.size());
    nodes.order.push_back(n);
    const GltfValue node = nodes.values.at(n);
    RawNode raw;
    raw.name = nodes.name(n);
    raw.parent = parent[n] == formats::kNone ? formats::kNone : nodes.number[parent[n]];
    raw.properties_json = properties(top, node);
    scene.nodes.push_back(std::move(raw));
    const GltfValue children = node.get("children");
    for (std::size_t k = children.size(); k-- > 0;) stack.push_back(std::uint32_t(children.at(k).integer()));
  }
  return nodes;
}

}  // namespace sinew::tools
