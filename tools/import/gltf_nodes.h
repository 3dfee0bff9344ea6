// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/import/gltf_text.h"
#include "tools/import/raw_scene.h"

namespace sinew::tools {

/// The hierarchy of nodes.
struct GltfNodes {
  GltfValue values{nullptr, "/nodes"};
  std::vector<Eigen::Matrix4d> global;  ///< of each node: to the scene
  std::vector<std::uint32_t> number;    ///< of each node: into RawScene::nodes; formats::kNone: not in the file's scene
  std::vector<std::uint32_t> order;     ///< the scene's nodes, parents first
  std::size_t zero_rotations = 0;       ///< nodes with a rotation of four zeros; taken as none

  std::string name(std::uint32_t node) const;
};

/// \param top of the JSON; stays.
/// \param scene receives its nodes.
GltfNodes gltfNodes(const GltfValue& top, RawScene& scene);

}  // namespace sinew::tools
