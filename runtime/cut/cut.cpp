// SPDX-License-Identifier: MIT
#include "sinew/runtime/cut.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <new>
#include <string>

#include "runtime/cut/content.h"
#include "runtime/cut/crossing.h"
#include "runtime/cut/distances.h"
#include "runtime/cut/parts.h"
#include "runtime/cut/section.h"
#include "runtime/cut/sides.h"
#include "runtime/cut/slit.h"
#include "runtime/cut/surface.h"
#include "runtime/solver/for_each.h"

namespace sinew {
namespace {

using Clock = std::chrono::steady_clock;

/// Parts that are too small go back to the other side so often; then they join what is largest.
constexpr int kMostRounds = 4;

constexpr const char* kNoMemory = "out of memory";

bool isFinite(const Vec3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

/// Adds the time since the last lap.
class Watch {
 public:
  void lap(double& to) {
    const Clock::time_point now = Clock::now();
    to += std::chrono::duration<double, std::milli>(now - last_).count();
    last_ = now;
  }

 private:
  Clock::time_point last_ = Clock::now();
};

const char* faultOf(const formats::PackageView& package, std::span<const Vec3> positions, const CutPlane& plane,
                    const CutSettings& settings) {
  if (positions.size() != package.physicalVertices().size()) return "as many positions as physical vertices are needed";
  for (const Vec3& x : positions) {
    if (!isFinite(x) || std::abs(x[0]) > formats::kMostMetres || std::abs(x[1]) > formats::kMostMetres ||
        std::abs(x[2]) > formats::kMostMetres) {
      return "a position is no number, or too far away";
    }
  }
  const double length = cutting::asVector(plane.normal).norm();
  if (plane.corners && !std::all_of(plane.corners->begin(), plane.corners->end(), isFinite))
    return "a corner is no number";
  if (!isFinite(plane.point) || !isFinite(plane.normal) || !(length > 1e-12)) return "the plane is none";
  if (!(settings.spacing >= 0) || !(settings.least_part >= 0 && settings.least_part <= 0.5F)) {
    return "spacing is below 0, or least_part outside 0 to 0.5";
  }
  for (const float c : settings.section_color) {
    if (!(c >= 0 && c <= 1)) return "section_color is outside 0 to 1";
  }
  if (package.visualTriangles().empty() || package.tetrahedra().empty()) {
    return "the package has no visual triangles or no tetrahedra";
  }
  if (package.barycentric().empty()) return "the visual mesh hangs on clusters, not on tetrahedra";
  if (package.fields().empty()) return "the package has no fields";
  return nullptr;
}

/// Pieces of which one part has all, and the plane passes through nothing.
std::vector<std::uint8_t> wholePieces(const formats::PackageView& package, const cutting::Partition& partition) {
  std::vector<std::uint8_t> whole(package.pieces().size(), 1);
  for (std::size_t b = 0; b < whole.size(); ++b) {
    const formats::PieceRange& range = package.pieces()[b];
    std::size_t parts = 0;
    for (const cutting::PartMesh& part : partition.parts) {
      const auto low = std::lower_bound(part.vertices.begin(), part.vertices.end(), range.first_vertex);
      parts += low != part.vertices.end() && *low < range.first_vertex + range.vertex_count ? 1U : 0U;
    }
    const bool opened = std::any_of(partition.gaps.begin(), partition.gaps.end(), [&](const cutting::Gap& gap) {
      return gap.tetrahedron - range.first_tetrahedron < range.tetrahedron_count;
    });
    whole[b] = parts == 1 && !opened ? 1 : 0;
  }
  return whole;
}

/// Of nodes.
std::vector<std::uint32_t> piecesOf(const formats::PackageView& package, std::span<const cutting::Hung> nodes) {
  std::vector<std::uint32_t> result;
  result.reserve(nodes.size());
  for (const cutting::Hung& node : nodes) result.push_back(cutting::pieceOf(package, node.tetrahedron));
  return result;
}

struct MadePart {
  CutPart part;
  double fields_ms = 0, packages_ms = 0;
  std::string fault;
};

/// Of bytes that are written once, where they stay.
Result<std::shared_ptr<const Asset>> assetOf(const formats::PackageContent& content) {
  static constexpr auto kAlignment = std::align_val_t(formats::kSectionAlignment);
  std::shared_ptr<std::byte> memory;
  std::size_t bytes = 0;
  formats::writePackage(content, [&](std::size_t count) {
    memory.reset(static_cast<std::byte*>(::operator new(count, kAlignment)),
                 [](std::byte* p) { ::operator delete(p, kAlignment); });
    bytes = count;
    return memory.get();
  });
  return Asset::inPlace({memory.get(), bytes}, memory);
}

/// Throws nothing: it may run in a job.
MadePart makePart(const cutting::Cut& cut, std::uint32_t number) {
  MadePart made;
  try {
    Watch watch;
    const cutting::PartMesh& mesh = cut.partition.parts[number];
    cutting::PartContent content = cutting::makeContent(cut, number);
    const auto asset = assetOf(content.content);
    if (!asset) {
      made.fault = "a part is no package: " + asset.reason();
      return made;
    }
    made.part.asset = *asset;
    made.part.above = mesh.side > 0;
    made.part.visual = std::move(content.visual);
    made.part.physical = mesh.vertices;
    made.part.own = mesh.own;
    for (const float m : mesh.masses) made.part.mass += double(m);
    made.part.volume = content.volume;
    made.fields_ms = content.fields_ms;
    watch.lap(made.packages_ms);
    made.packages_ms -= made.fields_ms;
  } catch (const std::bad_alloc&) {
    made.fault = kNoMemory;  // short: it fits into the string itself
  }
  return made;
}

Result<CutResult> cutSound(const formats::PackageView& package, std::span<const Vec3> positions, const CutPlane& plane,
                           const CutSettings& settings) {
  CutResult result;
  Watch watch;
  const std::optional<cutting::PlaneFrame> frame = cutting::frameOf(plane);
  if (!frame) return Error{"the corners are of no convex quadrilateral"};
  cutting::Sides sides = cutting::findSides(package, positions, *frame);
  const bool is_slit = frame->outline.has_value();
  watch.lap(result.times.sides);
  const bool closes = settings.close_open_surfaces || package.info().source_volume >= 0;
  for (int round = 0; round <= kMostRounds; ++round) {
    cutting::Surface surface = is_slit ? cutting::clipSlit(package, sides) : cutting::clipSurface(package, sides);
    watch.lap(result.times.surface);
    const cutting::Crossing crossing(package, sides);
    const auto locate = [&](const cutting::Vector3d& at, std::uint32_t piece) { return crossing.at(at, piece); };
    if (is_slit && closes) cutting::endSlit(surface, sides.plane, double(settings.spacing), locate);
    const std::vector<cutting::Hung> nodes = crossing.hang(surface);
    cutting::Section section;
    if (closes) {
      section = cutting::closeSection(surface, piecesOf(package, nodes), sides.plane, double(settings.spacing), locate);
    }
    watch.lap(result.times.section);
    const cutting::Partition partition =
        is_slit ? cutting::openSlit(package, surface, section, nodes, double(settings.least_part), sides)
                : cutting::findParts(package, surface, section, nodes, double(settings.least_part),
                                     round == kMostRounds, sides);
    watch.lap(result.times.parts);
    if (partition.again) continue;
    const std::vector<std::uint8_t> whole = wholePieces(package, partition);
    if (is_slit && (surface.vertices.empty() || partition.gaps.empty())) {
      return Error{surface.vertices.empty() ? "the quadrilateral meets nothing"
                                            : "the quadrilateral passes through no tetrahedron"};
    }
    if (!is_slit && (partition.parts.size() < 2 || std::find(whole.begin(), whole.end(), 0) == whole.end())) {
      return Error{surface.vertices.empty() ? "the plane meets nothing, or only grazes it"
                                            : "the plane leaves what it cuts in one part"};
    }
    std::vector<cutting::Nearest> nearest(package.fields().size());
    std::vector<std::vector<std::uint32_t>> node_tetrahedra(package.distanceGrids().size());
    std::atomic<bool> has_memory = true;
    internal::forEach(settings.jobs, std::uint32_t(nearest.size() + node_tetrahedra.size()), 1, [&](std::uint32_t i) {
      try {
        if (i < nearest.size()) {
          const formats::Field& field = package.fields()[i];
          if (whole[field.piece] == 0) nearest[i] = cutting::findNearest(package, field);
        } else {
          const formats::DistanceGrid& grid = package.distanceGrids()[i - nearest.size()];
          if (whole[grid.piece] == 0) {
            node_tetrahedra[i - nearest.size()] = cutting::nodeTetrahedra(package, sides, grid);
          }
        }
      } catch (const std::bad_alloc&) {
        has_memory = false;
      }
    });
    if (!has_memory) return Error{kNoMemory};
    watch.lap(result.times.packages);
    const cutting::Cut cut = {package, settings,  sides, surface,         section,
                              nodes,   partition, whole, node_tetrahedra, nearest};
    result.open_edges = std::uint32_t(closes ? section.open : surface.rim.size());
    for (const cutting::Polygon& polygon : section.polygons) result.rough_loops += polygon.plain ? 0U : 1U;
    std::vector<MadePart> made(partition.parts.size());
    internal::forEach(settings.jobs, std::uint32_t(made.size()), 1,
                      [&](std::uint32_t p) { made[p] = makePart(cut, p); });
    for (MadePart& part : made) {
      if (!part.fault.empty()) return Error{part.fault};
      result.parts.push_back(std::move(part.part));
      result.times.fields += part.fields_ms;
      result.times.packages += part.packages_ms;
    }
    return result;
  }
  return Error{"the plane leaves nothing but parts that are too small"};
}

}  // namespace

CutPlane boundedPlane(const std::array<Vec3, 4>& corners) {
  CutPlane plane;
  const auto at = [&](std::size_t i) { return cutting::asVector(corners[i]); };
  const cutting::Vector3d middle = (at(0) + at(1) + at(2) + at(3)) / 4;
  cutting::Vector3d normal = (at(2) - at(0)).cross(at(3) - at(1));
  if (normal.norm() > 0) normal.normalize();
  for (std::size_t a = 0; a < 3; ++a) {
    plane.point[a] = float(middle[int(a)]);
    plane.normal[a] = float(normal[int(a)]);
  }
  plane.corners = corners;
  return plane;
}

Result<CutResult> cutAsset(const Asset& asset, std::span<const Vec3> positions, const CutPlane& plane,
                           const CutSettings& settings) {
  const formats::PackageView& package = asset.package();
  if (const char* fault = faultOf(package, positions, plane, settings); fault != nullptr) return Error{fault};
  try {
    return cutSound(package, positions, plane, settings);
  } catch (const std::bad_alloc&) {
    return Error{kNoMemory};
  }
}

}  // namespace sinew
