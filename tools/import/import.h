// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "tools/core/progress.h"
#include "tools/core/range.h"
#include "tools/import/visual_mesh.h"

namespace sinew::tools {

/// Legal values of ImportOptions' texts.
bool isImportUnit(const std::string& text);
bool isImportUp(const std::string& text);
bool isImportFront(const std::string& text);

struct ImportOptions {
  std::string unit = "auto";     ///< "auto", a unit of tools/core/units.h, or metres per unit as a number
  std::string up = "auto";       ///< "auto", "y", "z"
  std::string front = "auto";    ///< "auto" or a signed axis; only what looks at the model asks for it
  double weld_tolerance = 1e-6;  ///< of the bounding-box diagonal; 0 = exactly equal positions only
  double crease_degrees = 60;    ///< where the source has no normals: edges sharper than this are hard; 180 = none
  bool keep_stray = false;       ///< false: at most 1 % of the area, far from all the rest, is left out with a warning
  std::uint32_t memory_megabytes = 1500;  ///< bound on the child process
  double seconds = 15;                    ///< bound on the child's processor time; on the clock four times that
  std::filesystem::path worker;           ///< the sinew program; empty = the running program's own file

  // Legal values; settings are declared by them.
  static constexpr Range<double> kWeld = {0, 1e-2}, kCrease = {0, 180}, kSeconds = {0.1, 86400};
  static constexpr Range<std::uint32_t> kMegabytes = {64, 1000000};
};

/// Reads an artist's file in a child process and checks all that it gives back.
/// Formats: OBJ, PLY, STL, OFF, glTF, GLB, FBX, DAE, OGRE .mesh and .mesh.xml (by extension, then by content).
/// Throws ToolError(bad_input) for a file that is missing, unsupported, broken, too large for the bounds, or without
/// faces; (system) where the machine fails. Seams are recorded, never cracked.
VisualMesh importVisualMesh(const std::filesystem::path& file, const ImportOptions& options, Progress& progress);

/// Whether the name has the ending of one of these formats, in any case of letters.
bool isMeshName(const std::filesystem::path& file);

/// The child's side: reads `file`, writes its serialized scene to file descriptor `output`. Called by main() for
/// `sinew --import-worker FILE FORMAT FD MEGABYTES SECONDS` (the last two bound itself). Returns the exit code, or ends
/// the process.
int runImportWorker(int argument_count, char** arguments);

}  // namespace sinew::tools
