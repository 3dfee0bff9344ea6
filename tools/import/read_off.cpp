// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "tools/core/text.h"
#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

std::string place(const TextCursor& cursor) { return " (line " + std::to_string(cursor.line()) + ")"; }

/// Moves to the next word that is no comment.
void skipToContent(TextCursor& cursor) {
  while (!cursor.atEnd() && (cursor.atLineEnd() || cursor.rest().front() == '#')) cursor.nextLine();
}

// The next numbers of this line or, where `anywhere`, of the text.
std::vector<double> numbersOf(TextCursor& cursor, std::size_t most, bool anywhere) {
  std::vector<double> numbers;
  while (numbers.size() < most) {
    if (anywhere) skipToContent(cursor);
    const std::string_view word = cursor.wordBeforeComment();
    if (word.empty()) break;
    const auto value = parseNumber(word);
    if (!value) throw noNumber("", word, place(cursor));
    numbers.push_back(*value);
  }
  return numbers;
}

struct Header {
  bool uv = false, color = false, normal = false;
  std::string count;  ///< of vertices, where it has grown on the first word
};

// The first word: ST, C, N in any order (MeshLab writes NCOFF) and OFF, in any case. Some files lack it, and in some no
// blank parts it from the first count (ModelNet's "OFF490 518 0").
Header takeHeader(TextCursor& cursor, std::vector<Finding>& findings) {
  skipToContent(cursor);
  TextCursor behind = cursor;
  std::string word = lowerCase(behind.wordBeforeComment());
  const auto odd = [&](const std::string& what) {
    findings.push_back({"unknown-header", Severity::warning, what, 1, "", {}, "", "Let its first line say OFF."});
  };
  if (word.find_first_not_of("0123456789") == word.npos && !word.empty()) {
    odd("the file begins with a count and not with OFF; it is read as if it did");
    return {};
  }
  Header header;
  const std::size_t at = word.find("off");
  if (at == word.npos || word.find_first_not_of("0123456789", at + 3) != word.npos)
    throw ReadError("is no OFF: its first word is not OFF");
  header.count = word.substr(at + 3);
  if (!header.count.empty()) odd("no blank parts OFF from the first count; it is read as if one did");
  word.resize(at);
  const auto take = [&](std::string_view mark) {
    const std::size_t found = word.find(mark);
    if (found != word.npos) word.erase(found, mark.size());
    return found != word.npos;
  };
  header.uv = take("st");
  header.color = take("c");
  header.normal = take("n");
  if (!word.empty()) throw ReadError("is an OFF of four or more dimensions, which is not supported");
  cursor = behind;
  skipToContent(cursor);
  if (cursor.rest().starts_with("BINARY"))
    throw ReadError("is a binary OFF, which is not supported", "Export it as text.");
  return header;
}

std::uint64_t count(TextCursor& cursor, const char* of, std::string word = "") {
  if (word.empty()) {
    skipToContent(cursor);
    word = cursor.wordBeforeComment();
  }
  const auto value = parseInteger(word);
  if (!value || *value < 0) throw ReadError(std::string("has no proper number of ") + of + place(cursor));
  // An entry takes at least two characters.
  if (std::uint64_t(*value) > cursor.rest().size())
    throw ReadError("promises " + std::to_string(*value) + " " + of + ", more than the file holds" + place(cursor));
  return std::uint64_t(*value);
}

// How many words are left of this line.
std::size_t wordsLeft(TextCursor cursor) {
  std::size_t n = 0;
  while (!cursor.wordBeforeComment().empty()) ++n;
  return n;
}

}  // namespace

RawScene readOff(std::string_view text, const std::string& stem) {
  TextCursor cursor(text);
  RawScene scene;
  const auto [uv, color, normal, first_count] = takeHeader(cursor, scene.findings);
  RawMesh mesh;
  mesh.name = stem;
  mesh.parts.push_back({stem, formats::kNone});
  const std::uint64_t vertices = count(cursor, "vertices", first_count);
  const std::uint64_t faces = count(cursor, "faces");
  // The number of edges, which many files leave out or get wrong: on this line, or alone on the next.
  if (wordsLeft(cursor) == 0) {
    skipToContent(cursor);
    if (wordsLeft(cursor) == 1) cursor.nextLine();
  } else {
    cursor.wordBeforeComment();
  }
  skipToContent(cursor);
  const std::size_t needed = 3 + (normal ? 3U : 0U);
  const std::size_t whole = needed + (color ? 4U : 0U) + (uv ? 2U : 0U);
  // A line is a vertex or a face, with what else it has at its end, unless the first is none.
  const std::size_t words = wordsLeft(cursor);
  const bool anywhere = words < needed || words > needed + 6;
  mesh.points.reserve(vertices);
  const auto next = [&] {
    if (!anywhere) cursor.nextLine();
  };
  for (std::uint64_t i = 0; i < vertices; ++i, next()) {
    skipToContent(cursor);
    const std::vector<double> n = numbersOf(cursor, anywhere ? whole : 16, anywhere);
    if (n.size() < needed)
      throw ReadError("vertex " + std::to_string(i) +
                      (cursor.atEnd() && n.empty() ? " is missing: the file ends too early"
                                                   : " has too few numbers" + place(cursor)));
    mesh.points.emplace_back(n[0], n[1], n[2]);
    if (!mesh.points.back().allFinite())
      throw ReadError("vertex " + std::to_string(i) + place(cursor) + " has a coordinate that is not a finite number",
                      "Repair that vertex in the program that made the file.");
    mesh.vertex_point.push_back(std::uint32_t(i));
    if (normal) mesh.normals.push_back(Eigen::Vector3d(n[3], n[4], n[5]).cast<float>());
    const std::size_t left = n.size() - needed - (uv && n.size() >= needed + 2 ? 2 : 0);
    if (color) {
      std::array<float, 4> c = {0, 0, 0, 0};
      if (left >= 3) {
        c[3] = 1;
        for (std::size_t k = 0; k < std::min<std::size_t>(left, 4); ++k) c[k] = float(n[needed + k]);
      }
      mesh.colors.push_back(c);
    }
    if (uv)
      mesh.uvs.push_back(n.size() >= needed + 2 ? Eigen::Vector2f(float(n[n.size() - 2]), float(n[n.size() - 1]))
                                                : Eigen::Vector2f(0, 0));
  }
  colorsFromBytes(mesh.colors);
  const auto word = [&] {
    if (anywhere) skipToContent(cursor);
    return cursor.wordBeforeComment();
  };
  std::uint64_t small = 0;
  for (std::uint64_t i = 0; i < faces; ++i, next()) {
    skipToContent(cursor);
    if (cursor.atEnd())
      throw ReadError("face " + std::to_string(i) + " of " + std::to_string(faces) +
                      " is missing: the file ends too early");
    const auto size = parseInteger(word());
    if (!size || *size < 0)
      throw ReadError("face " + std::to_string(i) + " has no proper number of corners" + place(cursor));
    const std::size_t start = mesh.corners.size();
    for (std::int64_t k = 0; k < *size; ++k) {
      const std::string_view corner = word();
      const auto index = parseInteger(corner);
      if (!index || *index < 0 || std::uint64_t(*index) >= vertices)
        throw ReadError("face " + std::to_string(i) +
                        (corner.empty() ? " has fewer corners than it says"
                                        : " names vertex " + std::string(corner.substr(0, 20)) + " of " +
                                              std::to_string(vertices)) +
                        place(cursor));
      mesh.corners.push_back(std::uint32_t(*index));
    }
    if (*size < 3) {
      mesh.corners.resize(start);
      ++small;
    }
    mesh.face_size.push_back(*size < 3 ? 0 : std::uint32_t(*size));
  }
  if (small > 0)
    scene.findings.push_back({"degenerate-faces",
                              Severity::warning,
                              std::to_string(small) + " faces with fewer than three corners were left out",
                              small,
                              "",
                              {},
                              "",
                              "Remove them in the program that made the file."});
  scene.meshes.push_back(std::move(mesh));
  return scene;
}

}  // namespace sinew::tools
