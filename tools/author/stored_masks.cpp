// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/author/stored_masks.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>

#include "runtime/geometry/triangle_bvh.h"
#include "tools/core/text.h"

namespace sinew::tools {
namespace {

using Json = nlohmann::ordered_json;

// Of the diagonal: the same point but for rounding; near enough to be meant.
constexpr double kSame = 1e-4;
constexpr double kNear = 0.02;
constexpr std::size_t kPerLine = 12;

void writeNumbers(std::string& out, const std::vector<std::string>& numbers) {
  out += "[";
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    out += i == 0 ? "" : i % kPerLine == 0 ? ",\n" : ", ";
    out += numbers[i];
  }
  out += "]";
}

std::vector<Eigen::Vector3d> readPoints(const JsonText& text, const Json& json) {
  const auto wrong = [&](const std::string& pointer) {
    text.fail(pointer, "must be a list of numbers, three each point", "Write [x, y, z, x, y, z, ...].");
  };
  if (!json.is_array() || json.empty() || json.size() % 3 != 0) wrong("/points");
  std::vector<Eigen::Vector3d> points(json.size() / 3);
  for (std::size_t i = 0; i < json.size(); ++i) {
    if (!json[i].is_number()) wrong(childPointer("/points", i));
    points[i / 3][Eigen::Index(i % 3)] = json[i].get<double>();
  }
  return points;
}

}  // namespace

std::string storedMasksText(const VisualMesh& mesh, const std::vector<StoredMask>& masks) {
  std::vector<std::string> numbers;
  for (const Eigen::Vector3d& x : mesh.welded_positions) {
    for (int k = 0; k < 3; ++k) numbers.push_back(rounded(x[k], 7));
  }
  std::string out = "{\"sinew_masks\": 1,\n\"points\": ";
  writeNumbers(out, numbers);
  out += ",\n\"masks\": {";
  for (std::size_t m = 0; m < masks.size(); ++m) {
    out += (m == 0 ? "\n" : ",\n") + Json(masks[m].name).dump() + ": {\"points\": ";
    numbers.clear();
    std::vector<std::string> weights;
    for (std::size_t p = 0; p < masks[m].weights.size(); ++p) {
      if (!(masks[m].weights[p] > 0)) continue;
      numbers.push_back(std::to_string(p));
      weights.push_back(rounded(std::fmin(masks[m].weights[p], 1.0), 7));
    }
    writeNumbers(out, numbers);
    out += ",\n\"weights\": ";
    writeNumbers(out, weights);
    out += "}";
  }
  return out + "}}\n";
}

std::pair<bool, StoredWeights> readStoredMask(const std::filesystem::path& file, const std::string& name,
                                              const VisualMesh& mesh, std::vector<std::string>& names) {
  const JsonText text = JsonText::read(file.string());
  const Json& json = text.json();
  if (!json.is_object() || !json.contains("sinew_masks") || !json.contains("points") || !json.contains("masks") ||
      !json["masks"].is_object()) {
    text.fail("", "is no mask file", "It is what sinew author RECIPE transfer writes: see docs/recipe-format.md.");
  }
  if (json["sinew_masks"] != 1) {
    text.fail("/sinew_masks", "is a mask file of version " + json["sinew_masks"].dump() + ", this program reads 1",
              "Use the version of sinew that wrote it.");
  }
  const std::vector<Eigen::Vector3d> points = readPoints(text, json["points"]);
  names.clear();
  for (const auto& [key, value] : json["masks"].items()) names.push_back(key);
  if (!json["masks"].contains(name)) return {false, {}};
  const Json& mask = json["masks"][name];
  const std::string pointer = childPointer("/masks", name);
  if (!mask.is_object() || !mask.contains("points") || !mask.contains("weights") || !mask["points"].is_array() ||
      !mask["weights"].is_array() || mask["points"].size() != mask["weights"].size()) {
    text.fail(pointer, "must have points and as many weights", R"(Write {"points": [0, 7], "weights": [1, 0.5]}.)");
  }
  std::vector<double> of_point(points.size(), 0);
  for (std::size_t i = 0; i < mask["points"].size(); ++i) {
    const Json& p = mask["points"][i];
    const Json& w = mask["weights"][i];
    if (!p.is_number_unsigned() || p.get<std::uint64_t>() >= points.size()) {
      text.fail(childPointer(childPointer(pointer, "points"), i), "is no point", "Give the number of one, from 0.");
    }
    if (!w.is_number() || w.get<double>() < 0 || w.get<double>() > 1) {
      text.fail(childPointer(childPointer(pointer, "weights"), i), "is no weight", "Give a number 0 .. 1.");
    }
    of_point[p.get<std::size_t>()] = w.get<double>();
  }
  // A tree of triangles that are points.
  std::vector<geometry::Triangle> single(points.size());
  for (std::uint32_t p = 0; p < points.size(); ++p) single[p] = {p, p, p};
  const geometry::TriangleBvh tree(points, single);
  StoredWeights result;
  std::vector<double> welded(mesh.welded_positions.size(), 0);
  for (std::size_t p = 0; p < welded.size(); ++p) {
    const auto hit = tree.closest(mesh.welded_positions[p], kNear * mesh.diagonal);
    if (hit.triangle == formats::kNone) {
      ++result.unknown;
      continue;
    }
    welded[p] = of_point[hit.triangle];
    if (hit.squared_distance > kSame * kSame * mesh.diagonal * mesh.diagonal) ++result.moved;
  }
  for (const std::uint32_t p : mesh.welded) result.weights.push_back(welded[p]);
  return {true, std::move(result)};
}

}  // namespace sinew::tools
