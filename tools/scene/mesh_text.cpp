// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/scene/mesh_text.h"

#include <Eigen/Core>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

#include "tools/scene/measure.h"

namespace sinew::tools {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The source's axes, as columns, in a world of y up (docs/conventions.md).
Matrix3d sourceAxes(const formats::PackageView& package) {
  const auto settings = nlohmann::json::parse(package.text(package.info().settings_json), nullptr, false);
  std::string up = "y";
  if (settings.is_object() && settings.contains("import.up") && settings["import.up"].is_string())
    up = settings["import.up"].get<std::string>();
  Matrix3d axes = Matrix3d::Identity();
  if (up == "z") axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  if (up == "x") axes << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  return axes;
}

}  // namespace

std::string meshText(const Scene& scene, ExportFrame frame) {
  const World& world = scene.world();
  const formats::PackageView& first = scene.assets().front()->package();
  // x_source = axes^T (R^T (x - p) + origin) / unit, R and p of where the scene has put the first body.
  Matrix3d turn = Matrix3d::Identity();
  Vector3d from = Vector3d::Zero();
  Vector3d to = Vector3d(scene.fileOrigin().data());
  double scale = 1;
  std::string text = "# deformed visual meshes, metres, y up, written by sinew simulate\n";
  if (frame == ExportFrame::source) {
    text = "# deformed visual meshes, in the source's unit and axes, written by sinew simulate\n";
    const RigidTransform& placed = scene.placement();
    Matrix3d rotation;
    for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = double(placed.rotation[std::size_t(i)]);
    const Matrix3d axes = sourceAxes(first);
    turn = axes.transpose() * rotation.transpose();
    for (int k = 0; k < 3; ++k) from[k] = double(placed.position[std::size_t(k)]);
    const auto& origin = first.info().origin;
    to = axes.transpose() * Vector3d(origin[0], origin[1], origin[2]);
    scale = 1 / first.info().metres_per_unit;
  }
  std::array<char, 128> line{};
  const auto add = [&](const char* format, auto... values) {
    std::snprintf(line.data(), line.size(), format, values...);
    text += line.data();
  };
  const auto vector = [](const Vec3& x) { return Vector3d(double(x[0]), double(x[1]), double(x[2])); };
  unsigned before = 0, uvs_before = 0;
  for (std::size_t body = 0; body < scene.bodies().size(); ++body) {
    const BodyId id = scene.bodies()[body];
    const formats::PackageView& package = world.asset(id).package();
    const std::vector<Vec3> positions = visualPositions(world, id);
    std::vector<Vec3> normals(positions.size());
    if (!normals.empty()) {
      world.visualVertices(id, {}, {normals[0].data(), sizeof(Vec3), std::uint32_t(normals.size())});
    }
    if (scene.bodies().size() > 1) add("o body_%zu\n", body + 1);
    for (const Vec3& position : positions) {
      const Vector3d x = scale * (turn * (vector(position) - from) + to);
      add("v %.9g %.9g %.9g\n", x[0], x[1], x[2]);
    }
    for (const auto& uv : package.visualUvs()) add("vt %.9g %.9g\n", double(uv[0]), double(uv[1]));
    for (const Vec3& normal : normals) {
      const Vector3d n = turn * vector(normal);
      add("vn %.6g %.6g %.6g\n", n[0], n[1], n[2]);
    }
    for (const auto& t : package.visualTriangles()) {
      text += 'f';
      for (const std::uint32_t corner : t) {
        const unsigned at = before + corner + 1, uv = uvs_before + corner + 1;
        package.visualUvs().empty() ? add(" %u//%u", at, at) : add(" %u/%u/%u", at, uv, at);
      }
      text += '\n';
    }
    before += unsigned(positions.size());
    uvs_before += unsigned(package.visualUvs().size());
  }
  return text;
}

}  // namespace sinew::tools
