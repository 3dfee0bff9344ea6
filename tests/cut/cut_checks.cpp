// SPDX-License-Identifier: MIT
#include "tests/cut/cut_checks.h"

#include <Eigen/Geometry>
#include <cmath>
#include <map>

namespace sinew::test {
namespace {

using Eigen::Vector3d;

Vector3d asVector(const std::array<float, 3>& v) { return {double(v[0]), double(v[1]), double(v[2])}; }

double massOf(const formats::PackageView& package) {
  double sum = 0;
  for (const formats::PhysicalVertex& v : package.physicalVertices()) sum += double(v.mass);
  return sum;
}

}  // namespace

SurfaceState surfaceOf(const formats::PackageView& package) {
  std::vector<std::uint32_t> point(package.visualPositions().size());
  std::map<formats::Float3, std::uint32_t> places;
  for (std::uint32_t v = 0; v < point.size(); ++v) {
    point[v] = package.visualIdentity().empty() ? places.try_emplace(package.visualPositions()[v], v).first->second
                                                : package.visualIdentity()[v].welded;
  }
  SurfaceState state;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::pair<int, int>> edges;  // net, all
  const Vector3d origin = point.empty() ? Vector3d::Zero() : asVector(package.visualPositions()[0]);
  for (const formats::Triangle& t : package.visualTriangles()) {
    std::array<Vector3d, 3> at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = asVector(package.visualPositions()[t[k]]) - origin;
    const double part = at[0].dot(at[1].cross(at[2])) / 6;
    state.volume += part;
    state.absolute += std::abs(part);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = point[t[k]], b = point[t[(k + 1) % 3]];
      if (a == b) continue;
      auto& [net, all] = edges[{std::min(a, b), std::max(a, b)}];
      net += a < b ? 1 : -1;
      ++all;
    }
  }
  for (const auto& [edge, count] : edges) {
    state.open += std::size_t(std::abs(count.first));
    state.odd += count.second != 2 ? 1U : 0U;
  }
  return state;
}

std::string faultOfCut(const Asset& whole, const CutResult& cut, CutErrors& errors, std::size_t least_parts) {
  const SurfaceState before = surfaceOf(whole.package());
  const bool closed = before.open == 0;
  double volume = 0, mass = 0;
  Vector3d moment = Vector3d::Zero(), whole_moment = Vector3d::Zero();
  for (const formats::PhysicalVertex& v : whole.package().physicalVertices()) {
    whole_moment += double(v.mass) * asVector(v.rest_position);
  }
  if (cut.parts.size() < least_parts) return "too few parts";
  for (std::size_t p = 0; p < cut.parts.size(); ++p) {
    const CutPart& part = cut.parts[p];
    const formats::PackageView& package = part.asset->package();
    const std::string name = "part " + std::to_string(p) + ": ";
    const SurfaceState state = surfaceOf(package);
    if (closed && state.open > 0) return name + std::to_string(state.open) + " open edges";
    if (closed && before.odd == 0 && state.odd > 0 && cut.rough_loops == 0) {
      return name + std::to_string(state.odd) + " edges that are not of two triangles";
    }
    if (const std::string fault = faultOfHolds(package); !fault.empty()) return name + fault;
    volume += state.volume;
    mass += part.mass;
    if (std::abs(massOf(package) - part.mass) > 1e-6 * part.mass) return name + "its mass is another";
    for (const formats::PhysicalVertex& v : package.physicalVertices()) {
      moment += double(v.mass) * asVector(v.rest_position);
    }
    if (package.visualPositions().size() != part.visual.size() || part.physical.size() != part.own.size() ||
        part.physical.size() != package.physicalVertices().size()) {
      return name + "lists of wrong length";
    }
    const auto positions = whole.package().visualPositions();
    for (std::size_t v = 0; v < part.visual.size(); ++v) {
      const CutOrigin& from = part.visual[v];
      if (from.a == formats::kNone) continue;
      const Vector3d a = asVector(positions[from.a]), b = asVector(positions[from.b]);
      const Vector3d c = from.c == formats::kNone ? a : asVector(positions[from.c]);
      const Vector3d off =
          a + double(from.t) * (b - a) + double(from.s) * (c - a) - asVector(package.visualPositions()[v]);
      if (off.norm() > 1e-4 * double(whole.package().info().diagonal))
        return name + "a vertex is not where it comes from";
    }
  }
  const double whole_mass = massOf(whole.package());
  errors.mass = std::abs(mass - whole_mass) / whole_mass;
  errors.center = (moment - whole_moment).norm() / whole_mass / double(whole.package().info().diagonal);
  if (errors.mass > 1e-7) return "masses do not add up: " + std::to_string(errors.mass);
  if (errors.center > 1e-6) return "centre of mass moved";
  if (closed) {
    errors.volume = std::abs(volume - before.volume) / std::max(1e-300, std::abs(before.volume));
    if (errors.volume > 1e-4) return "volumes do not add up: " + std::to_string(errors.volume);
  }
  return {};
}

std::string faultOfHolds(const formats::PackageView& package) {
  const auto weighs = [&](std::uint32_t v) { return package.pinWeights().empty() ? 1.0F : package.pinWeights()[v]; };
  for (const formats::Field& field : package.fields()) {
    if (field.held == 0) continue;
    const std::uint32_t first = package.pieces()[field.piece].first_vertex, k = field.function_count;
    for (std::uint32_t s = 0; s < package.pinSets().size(); ++s) {
      const formats::PinSet& set = package.pinSets()[s];
      for (const std::uint32_t v : package.pinSetVertices().subspan(set.first, set.count)) {
        const std::uint32_t i = v - first;
        if (i >= package.pieces()[field.piece].vertex_count || weighs(v) < 1) continue;
        const formats::Float3& x = package.physicalVertices()[v].rest_position;
        for (std::uint32_t j = 0; j < k; ++j) {
          const formats::FieldFunction& function = package.fieldFunctions()[field.first_function + j];
          const float value = package.fieldValues()[field.first_value + k * (i / 8) + j][i % 8];
          const float wanted = function.pin_set != s ? 0 : function.monomial == 0 ? 1 : x[function.monomial - 1];
          // Free functions are of size 1 / sqrt(kg), driven ones of size 1 and m.
          if (std::abs(value - wanted) > 1e-4F * std::max(1.0F, package.info().diagonal)) {
            return "function " + std::to_string(j) + " moves vertex " + std::to_string(v) + ", which is held, by " +
                   std::to_string(value) + ", not " + std::to_string(wanted);
          }
        }
      }
    }
  }
  return {};
}

CutPlane randomPlane(std::span<const Vec3> positions, std::uint64_t seed) {
  const auto next = [&seed] {
    std::uint64_t z = (seed += 0x9e3779b97f4a7c15U);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
    return double((z ^ (z >> 31)) >> 11) * 0x1p-53;
  };
  seed = seed * 0xd1342543de82ef95U + 1;
  Vector3d normal;
  do {
    for (int a = 0; a < 3; ++a) normal[a] = 2 * next() - 1;
  } while (normal.squaredNorm() > 1 || normal.squaredNorm() < 1e-3);
  // Now and then along an axis, and through a vertex: where planes are degenerate.
  const double kind = next();
  if (kind < 0.2) normal = Vector3d::Unit(int(kind * 15));
  normal.normalize();
  double low = 1e300, high = -1e300;
  for (const Vec3& x : positions) {
    low = std::min(low, asVector(x).dot(normal));
    high = std::max(high, asVector(x).dot(normal));
  }
  Vector3d point = (low + (0.02 + 0.96 * next()) * (high - low)) * normal;
  if (next() < 0.15) point = asVector(positions[std::size_t(next() * double(positions.size()))]);
  CutPlane plane;
  for (int a = 0; a < 3; ++a) {
    plane.point[std::size_t(a)] = float(point[a]);
    plane.normal[std::size_t(a)] = float(normal[a]);
  }
  return plane;
}

CutPlane randomSlit(std::span<const Vec3> positions, std::uint64_t seed) {
  const CutPlane plane = randomPlane(positions, seed);
  const auto next = [&seed] {
    seed = seed * 6364136223846793005U + 1442695040888963407U;
    return double(seed >> 11) * 0x1p-53;
  };
  for (int i = 0; i < 4; ++i) next();
  Vector3d low = Vector3d::Constant(1e300), high = -low;
  for (const Vec3& x : positions) {
    low = low.cwiseMin(asVector(x));
    high = high.cwiseMax(asVector(x));
  }
  const Vector3d normal = asVector(plane.normal).normalized(), right = normal.unitOrthogonal();
  const Vector3d up = normal.cross(right);
  // Around a vertex: every quadrilateral meets something, many end within.
  const Vector3d vertex = asVector(positions[std::size_t(next() * double(positions.size()))]);
  const Vector3d middle = vertex - (vertex - asVector(plane.point)).dot(normal) * normal;
  const double size = (high - low).norm() * (0.05 + 0.6 * next()), turn = 6.283 * next();
  std::array<Vec3, 4> corners = {};
  for (std::size_t i = 0; i < 4; ++i) {
    const double angle = turn + (double(i) + 0.6 * next()) * 1.5707;
    const Vector3d at = middle + size * (std::cos(angle) * right + std::sin(angle) * up);
    for (int a = 0; a < 3; ++a) corners[i][std::size_t(a)] = float(at[a]);
  }
  return boundedPlane(corners);
}

std::vector<Vec3> restOf(const Asset& asset) {
  std::vector<Vec3> rest;
  for (const formats::PhysicalVertex& v : asset.package().physicalVertices()) rest.push_back(v.rest_position);
  return rest;
}

}  // namespace sinew::test
