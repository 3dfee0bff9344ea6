// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "sinew/formats/package.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// `inspect --json` of a package; the keys are the command line's contract.
nlohmann::ordered_json inspectPackage(const formats::PackageView& package);

/// `inspect --vertex --json`: what a vertex is, and what hangs on it. \param asked "source:1234", "visual:7",
/// "welded:7", "physical:7"; "MESH:1234" is a source vertex as the artist counts within one mesh. Throws ToolError
/// (usage) where `asked` is none of these or there is no such vertex. \param file for messages.
nlohmann::ordered_json inspectVertex(const formats::PackageView& package, const std::string& file,
                                     const std::string& asked);

/// `inspect --name --json`: every group, mask, cluster, pin set, channel, mesh and piece of that name with its
/// vertices. Throws ToolError(usage), naming the nearest name, where there is none.
nlohmann::ordered_json inspectName(const formats::PackageView& package, const std::string& file,
                                   const std::string& name);

/// `inspect --json` of a source.
nlohmann::ordered_json inspectSource(const VisualMesh& mesh, const Topology& topology);

}  // namespace sinew::tools
