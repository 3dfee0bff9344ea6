// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>

#include "tools/import/readers.h"
#include "tools/import/text_cursor.h"

namespace sinew::tools {
namespace {

std::string place(const TextCursor& cursor) { return " (line " + std::to_string(cursor.line()) + ")"; }

/// Moves to the next line that holds more than blanks and a comment.
void skipToContent(TextCursor& cursor) {
  while (!cursor.atEnd() && (cursor.atLineEnd() || cursor.rest().front() == '#')) cursor.nextLine();
}

// The next word of this line; empty at its end. A comment may follow a number at once and ends the line.
std::string_view wordOf(TextCursor& cursor) {
  const std::string_view word = cursor.word();
  const std::size_t at = word.find('#');
  const bool is_nan = at != word.npos && (word.substr(at).starts_with("#IN") || word.substr(at).starts_with("#QNAN") ||
                                          word.substr(at).starts_with("#SNAN"));  // as MSVC's printf writes it
  if (at == word.npos || is_nan) return word;
  cursor.lineRest();
  return word.substr(0, at);
}

std::vector<double> lineNumbers(TextCursor& cursor, std::size_t most) {
  std::vector<double> numbers;
  while (numbers.size() < most) {
    const std::string_view word = wordOf(cursor);
    if (word.empty()) break;
    const auto value = parseNumber(word);
    if (!value)
      throw ReadError("has \"" + std::string(word.substr(0, 40)) + "\" where a number belongs" + place(cursor));
    numbers.push_back(*value);
  }
  return numbers;
}

std::uint64_t count(TextCursor& cursor, const char* of) {
  skipToContent(cursor);
  const auto value = parseInteger(wordOf(cursor));
  if (!value || *value < 0) throw ReadError(std::string("has no proper number of ") + of + place(cursor));
  // An entry takes at least two characters.
  if (std::uint64_t(*value) > cursor.rest().size())
    throw ReadError("promises " + std::to_string(*value) + " " + of + ", more than the file holds" + place(cursor));
  return std::uint64_t(*value);
}

}  // namespace

RawScene readOff(std::string_view text, const std::string& stem) {
  TextCursor cursor(text);
  skipToContent(cursor);
  std::string_view header = wordOf(cursor);
  if (!header.ends_with("OFF")) throw ReadError("is no OFF: its first word is not OFF");
  header.remove_suffix(3);
  bool uv = false;
  bool color = false;
  bool normal = false;
  if (header.starts_with("ST")) uv = true, header.remove_prefix(2);
  if (header.starts_with("C")) color = true, header.remove_prefix(1);
  if (header.starts_with("N")) normal = true, header.remove_prefix(1);
  if (!header.empty()) throw ReadError("is an OFF of four or more dimensions, which is not supported");
  skipToContent(cursor);
  if (cursor.rest().starts_with("BINARY"))
    throw ReadError("is a binary OFF, which is not supported", "Export it as text.");

  RawScene scene;
  RawMesh mesh;
  mesh.name = stem;
  mesh.parts.push_back({stem, kNoIndex});
  const std::uint64_t vertices = count(cursor, "vertices");
  const std::uint64_t faces = count(cursor, "faces");
  cursor.nextLine();  // the number of edges, which many files leave out or get wrong
  const std::size_t needed = 3 + (normal ? 3U : 0U);
  mesh.points.reserve(vertices);
  for (std::uint64_t i = 0; i < vertices; ++i, cursor.nextLine()) {
    skipToContent(cursor);
    const std::vector<double> n = lineNumbers(cursor, 16);
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
        // Colours are 0..255 where any number is beyond 1, else 0..1.
        const std::size_t channels = std::min<std::size_t>(left, 4);
        const double scale =
            *std::max_element(n.begin() + std::ptrdiff_t(needed), n.begin() + std::ptrdiff_t(needed + channels)) > 1
                ? 255
                : 1;
        c[3] = 1;
        for (std::size_t k = 0; k < channels; ++k) c[k] = float(n[needed + k] / scale);
      }
      mesh.colors.push_back(c);
    }
    if (uv)
      mesh.uvs.push_back(n.size() >= needed + 2 ? Eigen::Vector2f(float(n[n.size() - 2]), float(n[n.size() - 1]))
                                                : Eigen::Vector2f(0, 0));
  }
  std::uint64_t small = 0;
  for (std::uint64_t i = 0; i < faces; ++i, cursor.nextLine()) {
    skipToContent(cursor);
    if (cursor.atEnd())
      throw ReadError("face " + std::to_string(i) + " of " + std::to_string(faces) +
                      " is missing: the file ends too early");
    const auto size = parseInteger(wordOf(cursor));
    if (!size || *size < 0)
      throw ReadError("face " + std::to_string(i) + " has no proper number of corners" + place(cursor));
    const std::size_t start = mesh.corners.size();
    for (std::int64_t k = 0; k < *size; ++k) {
      const std::string_view word = wordOf(cursor);
      const auto index = parseInteger(word);
      if (!index || *index < 0 || std::uint64_t(*index) >= vertices)
        throw ReadError("face " + std::to_string(i) +
                        (word.empty()
                             ? " has fewer corners than it says"
                             : " names vertex " + std::string(word.substr(0, 20)) + " of " + std::to_string(vertices)) +
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
