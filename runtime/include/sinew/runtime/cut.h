// SPDX-License-Identifier: MIT
//
// Cuts a body along a plane (library sinew::cut): its parts are packages made in memory, and bodies of them that go on
// as it moved. Only programs that cut link it. docs/runtime.md shows its use, docs/method.md §6 how it works.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "sinew/runtime/asset.h"
#include "sinew/runtime/export.h"
#include "sinew/runtime/result.h"
#include "sinew/runtime/settings.h"
#include "sinew/runtime/world.h"

namespace sinew {

/// Points x with normal . (x - point) > 0 are above.
struct CutPlane {
  Vec3 point = {0, 0, 0};   ///< of the plane, metres, world
  Vec3 normal = {0, 1, 0};  ///< any length but 0
  /// Where the plane ends: corners of a convex quadrilateral in order around it, metres, world; what is off the plane
  /// counts where it is nearest to it. None: the plane has no end.
  std::optional<std::array<Vec3, 4>> corners = std::nullopt;
};

/// The quadrilateral as a plane that ends: through the middle of the corners, across both diagonals, looking to where
/// they turn counter-clockwise. Corners on one line give a normal of length 0, which cuts refuse.
SINEW_API CutPlane boundedPlane(const std::array<Vec3, 4>& corners);

/// How a cut is made.
struct CutSettings {
  /// Of points inside the section, m, >= 0. 0: the mean length of the edges of its rim, or more, so that a
  /// polygon of it has about 1,000 points at most. Infinity: no such points.
  float spacing = 0;
  /// Parts of less than this share of the body's mass stay with what they would be cut from, 0 .. 0.5.
  float least_part = 1e-4F;
  /// Of the section's material: linear red, green, blue, alpha, each 0 .. 1.
  std::array<float, 4> section_color = {0.75F, 0.25F, 0.2F, 1};
  /// Whether loops of the rim are closed also where the package's surface is open (PackageInfo::source_volume below 0),
  /// as that of a sheet.
  bool close_open_surfaces = false;
  /// Whether parts hold the package's pictures (TEXB): a game that has them saves the copies.
  bool keep_textures = true;
  /// Makes parts side by side; null: the calling thread (cutBody(): the world's). They are the same for any.
  JobSystem* jobs = nullptr;
};

/// Where a visual vertex of a part comes from: at a + t (b - a) + s (c - a) of visual vertices of the body that was
/// cut.
struct CutOrigin {
  std::uint32_t a = formats::kNone;  ///< kNone: inside the section
  std::uint32_t b = formats::kNone;  ///< a itself: it is that vertex, or one of the section where it is
  float t = 0;                       ///< from a to b, 0 .. 1
  std::uint32_t c = formats::kNone;  ///< kNone: on the edge a b; else where a bounded plane ends within a triangle
  float s = 0;                       ///< from a to c, 0 .. 1
};

/// A part of a body that was cut.
struct CutPart {
  /// Its package. Sub-meshes are those of the body, then one named "section" of what closes it; pieces that the plane
  /// does not meet are as they were. Pieces that were cut have a free field, and a held one where the part has pin sets
  /// of it; not where rigid clusters of these share vertices with others: there the sets hold by springs.
  std::shared_ptr<const Asset> asset;
  bool above = false;                   ///< on which side of the plane; false too where it lies on both
  std::vector<CutOrigin> visual;        ///< of each visual vertex
  std::vector<std::uint32_t> physical;  ///< of each physical vertex: that of the body, ascending; twice beside a slit
  /// Of each physical vertex: 1 where it lies on the part's side. 0: a copy that carries what the part has of
  /// tetrahedra that the plane passes through; nothing is pinned there.
  std::vector<std::uint8_t> own;
  double mass = 0;    ///< kg. The sum over the parts is that of the body to the rounding of the vertices' masses
  double volume = 0;  ///< m^3, that the visual surface encloses at rest
};

/// Time that a cut took, ms, by stage.
struct CutTimes {
  double sides = 0;     ///< where everything lies against the plane
  double surface = 0;   ///< clipping of triangles
  double section = 0;   ///< loops, polygons, triangulation
  double parts = 0;     ///< what hangs together, masses
  double fields = 0;    ///< functions, samples and modes of the parts, the sum over threads
  double packages = 0;  ///< all else of them, their check, and what is found for all of them, the sum over threads
  double bodies = 0;    ///< cutBody(): bodies and their state
};

struct CutResult {
  /// At least two: below first, then above, each by its first physical vertex. Of a bounded plane at least one.
  std::vector<CutPart> parts;
  /// Edges of the rim in no loop, and ways of the rim over holes of the surface: there parts are open as the body was.
  std::uint32_t open_edges = 0;
  std::uint32_t rough_loops = 0;  ///< loops that cross themselves or each other: closed, by triangles that may overlap
  CutTimes times;
};

/// Cuts an asset as a body of it lies.
///
/// A bounded plane leaves a slit: its faces are sections that meet where the plane ends within the body, and may open
/// from there on. Severed matter is a part of its own.
/// An edge is cut where it crosses the plane now. Closed surfaces stay closed, and manifold where they were; volumes at
/// rest of the parts sum to that of the whole. Deterministic; allocates by operator new.
/// Reasons for refusal: the plane meets nothing, or only grazes it (CutSettings::least_part); a bounded one passes
/// through no tetrahedron, or its corners are of no convex quadrilateral; no visual mesh on tetrahedra or no fields;
/// arguments that are no numbers; memory. \param positions of all physical vertices, metres, world.
SINEW_API Result<CutResult> cutAsset(const Asset& asset, std::span<const Vec3> positions, const CutPlane& plane,
                                     const CutSettings& settings = {});

/// Successor of a pin set or pick of a body that was cut.
template <class Id>
struct CutHeir {
  Id before, now;
  BodyId body;
};

struct CutBodies {
  std::vector<BodyId> bodies;  ///< of `cut.parts`
  CutResult cut;
  std::vector<CutHeir<PinSetId>> pin_sets;  ///< one for each part that has vertices of it
  std::vector<CutHeir<PickId>> picks;       ///< those whose visual vertex is still there
};

/// Cuts a body of a world: the parts take its place, with its settings, positions, velocities, pins, pin sets, picks,
/// activation, plastic shapes and what touches colliders. Linear and angular momentum are kept to the rounding of
/// floats. On refusal the body stays as it was. Not during a step. Cuts of cuts are no different.
SINEW_API Result<CutBodies> cutBody(World& world, BodyId body, const CutPlane& plane, const CutSettings& settings = {});

}  // namespace sinew
