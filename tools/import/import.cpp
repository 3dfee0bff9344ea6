// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/import.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <string_view>

#include "tools/core/error.h"
#include "tools/core/text.h"
#include "tools/core/units.h"
#include "tools/import/assemble.h"
#include "tools/import/import_process.h"

namespace sinew::tools {
namespace {

constexpr std::string_view kFormats[] = {"obj", "ply", "stl", "off", "gltf", "glb", "fbx", "dae", "mesh"};
constexpr const char* kFormatList = "OBJ, PLY, STL, OFF, glTF, GLB, FBX, DAE and OGRE .mesh or .mesh.xml";

/// The format that the name ends with; empty where it is none of kFormats.
std::string formatByName(const std::filesystem::path& file) {
  const std::string extension = lowerCase(file.extension().string());
  if (lowerCase(file.filename().string()).ends_with(".mesh.xml")) return "mesh";
  for (const std::string_view format : kFormats)
    if (extension.size() == format.size() + 1 && extension.ends_with(format)) return std::string(format);
  return "";
}

/// Unmistakable first bytes; empty where the content does not tell.
std::string formatByContent(std::string_view head) {
  if (head.starts_with("glTF")) return "glb";
  if (head.starts_with("ply\n") || head.starts_with("ply\r")) return "ply";
  if (head.starts_with("Kaydara FBX Binary")) return "fbx";
  if (head.find("<COLLADA") != head.npos) return "dae";
  if (head.substr(0, 80).find("[MeshSerializer_v") != head.npos) return "mesh";
  return "";
}

/// Whether it begins like UTF-16 of mostly Latin letters, with or without a byte order mark.
bool isUtf16(std::string_view head) {
  if (head.size() < 4) return false;
  const bool marked = head.starts_with("\xFF\xFE") || head.starts_with("\xFE\xFF");
  if (marked) return (head[2] == 0) != (head[3] == 0);
  return head.substr(0, 2) == std::string_view("<\0", 2) || head.substr(0, 2) == std::string_view("\0<", 2);
}

/// Checks what can be known before a child is started. \return the format.
std::string probe(const std::filesystem::path& file, const ImportOptions& options) {
  const std::string name = file.string();
  const auto bad = [&](const std::string& what, const std::string& cure) {
    return ToolError(ExitCode::bad_input, name, what, cure);
  };
  // O_NONBLOCK: a named pipe must not hold the program before it is refused.
  const int fd = open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (fd < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) throw bad("there is no such file", "Check the name.");
    throw bad(std::string("cannot be opened (") + std::strerror(error) + ")", "Check the file's permissions.");
  }
  struct stat facts {};
  char head[1024] = {};
  const bool known = fstat(fd, &facts) == 0;
  const ssize_t held = known && S_ISREG(facts.st_mode) ? read(fd, head, sizeof head) : 0;
  const int error = errno;
  close(fd);
  if (!known || held < 0) throw bad(std::string("cannot be read (") + std::strerror(error) + ")", "Check the disk.");
  if (S_ISDIR(facts.st_mode)) throw bad("is a folder", "Name the mesh file in it.");
  if (!S_ISREG(facts.st_mode)) throw bad("is no regular file", "Copy it into one.");
  if (facts.st_size == 0) throw bad("is empty", "Export it again.");

  std::string format = formatByName(file);
  const std::string content = formatByContent({head, std::size_t(held)});
  if (format.empty()) format = content;
  // A GLB named .gltf and the like: the content knows better, but only among what shares a reader.
  if (format == "gltf" && content == "glb") format = "glb";
  const std::string extension = file.extension().string();
  if (format.empty())
    throw bad(extension.empty() ? "has no extension, so its format is unknown"
                                : "has the unsupported format \"" + lowerCase(extension.substr(1)) + "\"",
              std::string("Supported are ") + kFormatList + "; export it as one of these.");
  if (format != "glb" && format != "fbx" && format != "mesh" && isUtf16({head, std::size_t(held)}))
    throw bad("is text in UTF-16", "Save it as UTF-8: iconv -f UTF-16 -t UTF-8 does it, and so do most text editors.");
  if (format == "mesh" &&
      std::string_view(head, std::size_t(held)).find("MeshVersionFormatted") != std::string_view::npos)
    throw bad("is a mesh of MEDIT (as of Gmsh, TetGen, Mmg), not of OGRE", "Export its surface as OBJ, PLY or STL.");
  // A reader holds the file and the scene that it makes of it at the same time.
  const std::uint64_t most = (std::uint64_t(options.memory_megabytes) << 20) / 2;
  if (std::uint64_t(facts.st_size) > most)
    throw bad("is " + std::to_string(std::uint64_t(facts.st_size) >> 20) + " MB, more than the " +
                  std::to_string(most >> 20) + " MB that the bound on memory allows",
              "Allow more with --set import.memory_mb=" +
                  std::to_string((std::uint64_t(facts.st_size) >> 20) * 3 + 500) + ".");
  return format;
}

void checkOptions(const ImportOptions& options) {
  const auto bad = [](const std::string& what, const std::string& cure) {
    return ToolError(ExitCode::usage, "", what, cure);
  };
  if (!isImportUnit(options.unit))
    throw bad("the unit \"" + options.unit + "\" is unknown",
              "Use auto, " + lengthUnitNames(", ") + ", or metres per unit as a number.");
  if (!isImportUp(options.up)) throw bad("the up axis \"" + options.up + "\" is unknown", "Use auto, y or z.");
  if (!isImportFront(options.front))
    throw bad("the front \"" + options.front + "\" is unknown", "Use auto, x, -x, y, -y, z or -z.");
  const auto within = [&]<class Number>(const char* what, Number value, const Range<Number>& legal, const char* unit) {
    if (!legal.holds(value))
      throw bad("the " + std::string(what) + " is out of range",
                "Use " + exactText(legal.least) + " to " + exactText(legal.most) + unit);
  };
  within("weld tolerance", options.weld_tolerance, ImportOptions::kWeld, " diagonals.");
  within("crease angle", options.crease_degrees, ImportOptions::kCrease, " degrees.");
  within("bound on the import's memory", options.memory_megabytes, ImportOptions::kMegabytes, " MB.");
  within("bound on the import's time", options.seconds, ImportOptions::kSeconds, " s.");
}

}  // namespace

bool isImportUnit(const std::string& text) { return text == "auto" || metresPerUnit(text) > 0; }

bool isImportFront(const std::string& text) {
  return text == "auto" || text == "x" || text == "-x" || text == "y" || text == "-y" || text == "z" || text == "-z";
}
bool isImportUp(const std::string& text) { return text == "auto" || text == "y" || text == "z"; }

bool isMeshName(const std::filesystem::path& file) { return !formatByName(file).empty(); }

VisualMesh importVisualMesh(const std::filesystem::path& file, const ImportOptions& options, Progress& progress) {
  checkOptions(options);
  const std::string format = probe(file, options);
  RawScene scene = readInChild(file, format, options, progress);
  progress.fraction(0.5);
  try {
    return assembleVisualMesh(std::move(scene), file, format, options);
  } catch (const std::bad_alloc&) {
    throw ToolError(ExitCode::system, file.string(), "there is not enough memory for this mesh",
                    "Close other programs or reduce the mesh.");
  }
}

}  // namespace sinew::tools
