// SPDX-License-Identifier: GPL-3.0-or-later
#include <bit>
#include <cstring>
#include <map>

#include "tools/core/text.h"
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

// Returns how many facets carry a colour, as Materialise and VisCAM have them in the attribute bytes.
std::uint32_t readBinary(std::string_view bytes, std::uint32_t count, RawMesh& mesh) {
  std::uint32_t colored = 0;
  mesh.points.reserve(std::size_t(count) * 3);
  for (std::uint32_t t = 0; t < count; ++t) {
    std::array<float, 12> numbers{};  // normal, then three points
    std::memcpy(numbers.data(), bytes.data() + kHeaderBytes + t * kTriangleBytes, sizeof numbers);
    for (std::size_t k = 3; k < 12; k += 3)
      addVertex(mesh, Eigen::Vector3d(double(numbers[k]), double(numbers[k + 1]), double(numbers[k + 2])));
    mesh.face_size.push_back(3);
    colored += bytes[kHeaderBytes + t * kTriangleBytes + 48] != 0 || bytes[kHeaderBytes + t * kTriangleBytes + 49] != 0;
  }
  return colored;
}

// Keywords of any case. Returns whether the last solid is ended: else the file may have been cut off.
bool readText(std::string_view text, const std::string& stem, RawMesh& mesh) {
  TextCursor cursor(text);
  std::uint32_t part = formats::kNone;
  std::map<std::string, std::uint32_t> part_by_name;
  bool ended = false, in_facet = false;
  const auto begin = [&](std::string_view rest) {
    const std::string name = rest.empty() ? stem : std::string(rest);
    const auto [at, fresh] = part_by_name.try_emplace(name, std::uint32_t(mesh.parts.size()));
    if (fresh) mesh.parts.push_back({name, formats::kNone});
    part = at->second;
    ended = false;
  };
  while (!cursor.atEnd()) {
    std::string key = lowerCase(cursor.wordAnywhere());
    if (key == "end") key += lowerCase(cursor.word());  // some write "end facet"
    const std::string place = " (line " + std::to_string(cursor.line()) + ")";
    if (key == "solid") {
      begin(cursor.lineRest());
    } else if (key == "facet") {
      in_facet = true;
    } else if (key == "vertex") {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) {
        const std::string_view word = cursor.word();
        const auto value = parseNumber(word);
        if (word.empty()) throw ReadError("has a vertex that is no three numbers" + place);
        if (!value) throw noNumber("a vertex", word, place);
        p[k] = *value;
      }
      addVertex(mesh, p);
    } else if (key == "endloop") {
      if (mesh.points.size() != 3 * (mesh.face_size.size() + 1))
        throw ReadError("has a facet that is no triangle" + place);
      if (part == formats::kNone) begin("");
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

}  // namespace

RawScene readStl(std::string_view bytes, const std::string& stem) {
  RawScene scene;
  RawMesh mesh;
  mesh.name = stem;
  std::uint32_t count = 0;
  if (bytes.size() >= kHeaderBytes) std::memcpy(&count, bytes.data() + 80, sizeof count);
  // Many binary files begin with "solid" too, so the size decides first, and text has no zero bytes.
  const std::string start = lowerCase(bytes.substr(0, 65536));
  const bool text = start.substr(0, 4096).find('\0') == start.npos;
  const bool says_text = text && start.find("facet") != start.npos && start.find("vertex") != start.npos;
  const std::size_t body = bytes.size() - std::min(bytes.size(), kHeaderBytes);
  if (count == 0 && !says_text && body > 0 && body % kTriangleBytes == 0) {
    // A writer of streams may never come back to the header.
    count = std::uint32_t(body / kTriangleBytes);
    scene.findings.push_back({"uncounted-triangles",
                              Severity::warning,
                              "the header counts no triangles; all " + std::to_string(count) + " that follow are read",
                              count,
                              "",
                              {},
                              "",
                              "Export the file again if triangles are missing."});
  }
  const std::uint64_t promised = kHeaderBytes + std::uint64_t(count) * kTriangleBytes;
  if (bytes.size() >= kHeaderBytes && (bytes.size() == promised || (!says_text && bytes.size() > promised))) {
    mesh.parts.push_back({stem, formats::kNone});
    if (const std::uint32_t colored = readBinary(bytes, count, mesh); colored > 0)
      scene.findings.push_back({"dropped-colors",
                                Severity::info,
                                "the colours of " + counted(colored, "facet", "facets") + " were left out",
                                colored,
                                "",
                                {},
                                "",
                                ""});
    if (bytes.size() > promised)
      scene.findings.push_back(trailingBytes(bytes.size() - promised, "triangle", "triangles"));
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
  } else if (const std::string other = text ? formatOfText(bytes) : ""; !other.empty() && other != "STL") {
    throw looksLike(other, "STL");
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
