// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <nlohmann/json.hpp>

#include "sinew/formats/package.h"
#include "tools/import/topology.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// `inspect --json` of a package; the keys are fixed by docs/package-format.md and the command line's contract.
nlohmann::ordered_json inspectPackage(const formats::PackageView& package);

/// `inspect --json` of a source.
nlohmann::ordered_json inspectSource(const VisualMesh& mesh, const Topology& topology);

}  // namespace sinew::tools
