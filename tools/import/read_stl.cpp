// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cstring>
#include <map>

#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

static_assert(std::endian::native == std::endian::little, "STL is read in place");

constexpr std::size_t kHeaderBytes = 84;
constexpr std::size_t kTriangleBytes = 50;

void addVertex(RawMesh& mesh, const Eigen::Vector3d& p) {
  const std::size_t number = mesh.points.size();
  if (!p.allFinite())
    throw ReadError("vertex " + std::to_string(number % 3) + " of triangle " + std::to_string(number / 3) +
                        " has a coordinate that is not a finite number",
                    "Repair that triangle in the program that made the file.");
  mesh.points.push_back(p);
  mesh.vertex_point.push_back(std::uint32_t(number));
  mesh.corners.push_back(std::uint32_t(number));
}

void readBinary(std::string_view bytes, std::uint32_t count, RawMesh& mesh) {
  mesh.points.reserve(std::size_t(count) * 3);
  for (std::uint32_t t = 0; t < count; ++t) {
    std::array<float, 12> numbers{};  // normal, then three points
    std::memcpy(numbers.data(), bytes.data() + kHeaderBytes + t * kTriangleBytes, sizeof numbers);
    for (std::size_t k = 3; k < 12; k += 3)
      addVertex(mesh, Eigen::Vector3d(double(numbers[k]), double(numbers[k + 1]), double(numbers[k + 2])));
    mesh.face_size.push_back(3);
  }
}

std::string lowerCase(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) c = c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return lower;
}

// Keywords of any case. Returns whether the last solid is ended: else the file may have been cut off.
bool readText(std::string_view text, const std::string& stem, RawMesh& mesh) {
  TextCursor cursor(text);
  std::uint32_t part = kNoIndex;
  std::map<std::string, std::uint32_t> part_by_name;
  bool ended = false, in_facet = false;
  while (!cursor.atEnd()) {
    const std::string key = lowerCase(cursor.wordAnywhere());
    const std::string place = " (line " + std::to_string(cursor.line()) + ")";
    if (key == "solid") {
      const std::string_view rest = cursor.lineRest();
      const std::string name = rest.empty() ? stem : std::string(rest);
      const auto [at, fresh] = part_by_name.try_emplace(name, std::uint32_t(mesh.parts.size()));
      if (fresh) mesh.parts.push_back({name, kNoIndex});
      part = at->second;
      ended = false;
    } else if (key == "facet") {
      in_facet = true;
    } else if (key == "vertex") {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) {
        const auto value = parseNumber(cursor.word());
        if (!value) throw ReadError("has a vertex that is no three numbers" + place);
        p[k] = *value;
      }
      addVertex(mesh, p);
    } else if (key == "endloop") {
      if (mesh.points.size() != 3 * (mesh.face_size.size() + 1))
        throw ReadError("has a facet that is no triangle" + place);
      if (part == kNoIndex) throw ReadError("has a facet outside a solid" + place);
      mesh.face_size.push_back(3);
      mesh.face_part.push_back(part);
      in_facet = false;
    } else if (key == "endsolid") {
      cursor.nextLine();
      ended = true;
    }  // normal and its numbers, outer, loop, endfacet: nothing to learn
  }
  if (in_facet || mesh.points.size() != 3 * mesh.face_size.size())
    throw ReadError("ends within a facet (line " + std::to_string(cursor.line()) + ")");
  return ended;
}

// What text that is no STL looks like; empty where it cannot be told.
std::string otherFormat(std::string_view text) {
  if (text.starts_with("ply\n") || text.starts_with("ply\r")) return "PLY";
  TextCursor cursor(text);
  for (std::size_t points = 0; !cursor.atEnd(); cursor.nextLine()) {
    const std::string_view key = cursor.word();
    if (key == "OFF" || key == "COFF" || key == "NOFF") return "OFF";
    if (key == "v" && parseNumber(cursor.word()) && ++points == 3) return "OBJ";
  }
  return "";
}

}  // namespace

RawScene readStl(std::string_view bytes, const std::string& stem) {
  RawScene scene;
  RawMesh mesh;
  mesh.name = stem;
  std::uint32_t count = 0;
  if (bytes.size() >= kHeaderBytes) std::memcpy(&count, bytes.data() + 80, sizeof count);
  const std::uint64_t promised = kHeaderBytes + std::uint64_t(count) * kTriangleBytes;
  // Many binary files begin with "solid" too, so the size decides first, and text has no zero bytes.
  const std::string start = lowerCase(bytes.substr(0, 4096));
  const bool text = start.find('\0') == start.npos;
  const bool says_text = text && start.substr(0, 512).find("solid") != start.npos && start.find("facet") != start.npos;
  if (bytes.size() >= kHeaderBytes && (bytes.size() == promised || (!says_text && bytes.size() > promised))) {
    mesh.parts.push_back({stem, kNoIndex});
    readBinary(bytes, count, mesh);
    if (bytes.size() > promised)
      scene.findings.push_back({"trailing-bytes",
                                Severity::warning,
                                std::to_string(bytes.size() - promised) + " bytes after the last triangle were ignored",
                                bytes.size() - promised,
                                "",
                                {},
                                "",
                                "Export the file again if triangles are missing."});
  } else if (says_text || (text && start.starts_with("solid"))) {
    if (!readText(bytes, stem, mesh))
      scene.findings.push_back({"unended-solid",
                                Severity::warning,
                                "the text ends without endsolid: the file may have been cut off",
                                1,
                                "",
                                {},
                                "",
                                "Export the file again if triangles are missing."});
  } else if (const std::string other = text ? otherFormat(std::string_view(bytes).substr(0, 65536)) : "";
             !other.empty()) {
    throw ReadError("is no STL: it looks like " + other + " text", "Rename it to end in ." + lowerCase(other) + ".");
  } else if (bytes.size() < kHeaderBytes) {
    throw ReadError("is no STL: it is neither text nor long enough for a binary header");
  } else if (text) {
    throw ReadError("is no STL: it is text without facets", "Rename it to what it is, or export it again.");
  } else {
    throw ReadError("promises " + std::to_string(count) + " triangles but holds " +
                    std::to_string((bytes.size() - kHeaderBytes) / kTriangleBytes));
  }
  scene.meshes.push_back(std::move(mesh));
  return scene;
}

}  // namespace sinew::tools
