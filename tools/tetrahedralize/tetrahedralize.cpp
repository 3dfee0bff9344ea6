// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/tetrahedralize/tetrahedralize.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <numeric>
#include <optional>

#include "tools/core/error.h"
#include "tools/tetrahedralize/delaunay.h"
#include "tools/tetrahedralize/fill.h"
#include "tools/tetrahedralize/piece_findings.h"
#include "tools/tetrahedralize/pieces.h"
#include "tools/tetrahedralize/shell.h"
#include "tools/tetrahedralize/split.h"

namespace sinew::tools {
namespace {

using Eigen::Vector3d;
using geometry::TetMesh;

constexpr std::uint32_t kLeastVertices = 12;  // of a piece: the source's smallest cages have as many
// Limits of `auto` on stuffing.
constexpr std::uint32_t kLeastBudget = 64;  // below this every method overshoots
constexpr double kLeastRatio = 0.85, kMostRatio = 1.15, kMostUncovered = 0.005;
// A volume further off than this is reported.
constexpr double kReportedRatio = 0.1;
// Of filling a piece anew: for what splitting shows, and for its number of vertices.
constexpr int kRounds = 5;
constexpr std::size_t kNamedPieces = 6;

void parallelFor(std::size_t count, std::size_t grain, const std::function<void(std::size_t, std::size_t)>& piece) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, std::max<std::size_t>(grain, 1)),
                    [&](const tbb::blocked_range<std::size_t>& range) { piece(range.begin(), range.end()); });
}

std::string text(const char* format, double value) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

// The same remark about several pieces is one finding.
struct Remark {
  std::string id;
  Severity severity;
  std::string about;  // "was filled by grid"
  std::string cure;
  std::vector<std::string> pieces;  // name and detail of each
};

class Remarks {
 public:
  void add(const std::string& id, Severity severity, const std::string& about, const std::string& piece,
           const std::string& cure) {
    auto at = std::find_if(list_.begin(), list_.end(), [&](const Remark& r) { return r.id == id && r.about == about; });
    if (at == list_.end()) at = list_.insert(list_.end(), {id, severity, about, cure, {}});
    at->pieces.push_back(piece);
  }
  void report(std::vector<Finding>& findings) const {
    for (const Remark& r : list_) {
      Finding f;
      f.id = r.id;
      f.severity = r.severity;
      f.count = r.pieces.size();
      f.message = std::to_string(r.pieces.size()) + (r.pieces.size() == 1 ? " piece " : " pieces ") + r.about + ": ";
      for (std::size_t i = 0; i < r.pieces.size() && i < kNamedPieces; ++i)
        f.message += (i > 0 ? "; " : "") + r.pieces[i];
      if (r.pieces.size() > kNamedPieces) {
        f.message += "; and " + std::to_string(r.pieces.size() - kNamedPieces) + " more";
      }
      f.message += ".";
      f.place = r.pieces.front();
      f.cure = r.cure;
      findings.push_back(std::move(f));
    }
  }

 private:
  std::vector<Remark> list_;
};

// Shares the wanted vertices among the pieces: by the mean of surface and volume^(2/3), each at least a small cage.
std::vector<std::uint32_t> shareVertices(const std::vector<SolidPiece>& pieces, std::uint32_t target) {
  std::vector<double> weight(pieces.size());
  for (std::size_t b = 0; b < pieces.size(); ++b) {
    const double from_volume = 6 * std::pow(std::max(pieces[b].volume, 0.0), 2.0 / 3.0);
    weight[b] = pieces[b].encloses ? std::sqrt(from_volume * pieces[b].area) : pieces[b].area;
  }
  std::vector<std::uint32_t> share(pieces.size(), 0);
  // Pieces that would fall below the least get it; the others share what remains.
  double left = target;
  std::vector<char> least(pieces.size(), 0);
  for (bool again = true; again;) {
    again = false;
    double sum = 0;
    for (std::size_t b = 0; b < pieces.size(); ++b) sum += least[b] != 0 ? 0 : weight[b];
    for (std::size_t b = 0; b < pieces.size(); ++b) {
      if (least[b] != 0) continue;
      const double wanted = sum > 0 ? left * weight[b] / sum : 0;
      if (wanted >= kLeastVertices) {
        share[b] = std::uint32_t(wanted);
        continue;
      }
      least[b] = 1;
      share[b] = kLeastVertices;
      left = std::max(0.0, left - kLeastVertices);
      again = true;
      break;
    }
  }
  return share;
}

struct Choice {
  FilledPiece filled;
  TetrahedraMethod method = TetrahedraMethod::grid;
  std::vector<std::uint32_t> home;  // of a shell: per position of the piece
};

// The middle of a triangle, in the source's metres.
std::string pointText(const SolidPiece& piece, std::uint32_t triangle) {
  Vector3d middle = piece.center;
  for (const std::uint32_t v : piece.triangles[triangle]) middle += piece.positions[v] / 3;
  return "(" + text("%.4g", middle.x()) + ", " + text("%.4g", middle.y()) + ", " + text("%.4g", middle.z()) + ")";
}

// Cure of a piece that a method cannot fill: what has no volume need not be filled.
std::string otherMethod(const SolidPiece& piece, const char* methods, const char* other) {
  const char* const shell = piece.balanced ? "" : ", tetrahedra.method=shell for an open garment or sheet";
  return std::string("Set tetrahedra.method=") + methods + shell + ", or " + other + ".";
}

double volumeRatio(const SolidPiece& piece, const FilledPiece& filled) {
  return piece.volume > 0 ? filled.volume / piece.volume : 1;
}

// Why stuffing does not serve, or nothing if it does.
std::string complaint(const SolidPiece& piece, const FilledPiece& filled) {
  if (filled.mesh.tetrahedra.empty()) return "all of it is thinner than a cell of stuffing";
  const double ratio = volumeRatio(piece, filled);
  if (filled.components > 1) return "stuffing breaks it into " + std::to_string(filled.components) + " components";
  if (filled.uncovered > kMostUncovered) {
    return "stuffing loses thin features, " + text("%.1f", 100 * filled.uncovered) + " % of the surface";
  }
  if (ratio < kLeastRatio || ratio > kMostRatio) {
    return "stuffing has " + text("%.2f", ratio) + " times its volume";
  }
  return "";
}

// A piece that encloses nothing, or that is to be hollow.
Choice fillSheet(const SolidPiece& piece, TetrahedraMethod wanted, std::uint32_t target,
                 const TetrahedraOptions& options, double rounding, const std::string& file, Remarks& remarks) {
  Choice choice;
  if (wanted == TetrahedraMethod::grid) {
    remarks.add("tetrahedra-method", Severity::info, "enclosed nothing and became a layer of grid cells", piece.title,
                "");
    choice.filled = fillWithGrid(piece, target, parallelFor);
    return choice;
  }
  ShellOutcome outcome;
  std::vector<double> factors;
  for (std::size_t p = 0; p < piece.points.size() && !options.shell_factors.empty(); ++p) {
    factors.push_back(options.shell_factors[piece.points[p]]);
  }
  choice.filled = fillWithShell(piece, target, options.shell_thickness, factors, rounding, outcome);
  const std::string place = piece.points.empty() ? "" : " near " + pointText(piece, outcome.triangle);
  if (!choice.filled.mesh.tetrahedra.empty()) {
    choice.method = TetrahedraMethod::shell;
    choice.home = std::move(outcome.home);
    std::string detail = text("%.3g", outcome.thickness) + " m thick on average";
    if (outcome.thinned > 0) detail += ", thinner at " + std::to_string(outcome.thinned) + " vertices of creases";
    if (outcome.parts > 1) detail += ", of " + std::to_string(outcome.parts) + " parts tied to one another";
    if (outcome.cut > 0) {
      remarks.add(
          "tetrahedra-fold", Severity::info,
          "had folds, where a face lies back on its neighbour: the shell is cut apart there",
          piece.title + " (" + std::to_string(outcome.cut) + (outcome.cut == 1 ? " vertex" : " vertices") + place + ")",
          "Pull the faces apart there if the shell is to hang together across the fold.");
    }
    const bool other = wanted == TetrahedraMethod::stuffing || wanted == TetrahedraMethod::delaunay;
    remarks.add("tetrahedra-method", other ? Severity::warning : Severity::info,
                piece.encloses ? "became a hollow shell" : "enclosed nothing and became a shell",
                piece.title + " (" + detail + ")",
                other ? "Give the surface a volume, or close it, for other methods." : "");
    return choice;
  }
  if (wanted == TetrahedraMethod::shell) {
    throw ToolError(ExitCode::bad_input, file, "piece '" + piece.title + "' " + outcome.reason + place,
                    "Repair it there, change tetrahedra.thickness, or set tetrahedra.method=grid.");
  }
  remarks.add("tetrahedra-method", Severity::warning,
              "enclosed nothing and became a layer of grid cells because a shell was not possible",
              piece.title + " (" + outcome.reason + place + ")",
              "Repair it there for a shell that follows the surface.");
  choice.filled = fillWithGrid(piece, target, parallelFor);
  return choice;
}

Choice fillPiece(const SolidPiece& piece, const TetrahedraOptions& options, TetrahedraMethod wanted,
                 std::uint32_t target, const std::vector<std::uint32_t>& thin, bool crosses_itself, double rounding,
                 const std::string& file, Remarks& remarks) {
  if (!piece.encloses || wanted == TetrahedraMethod::shell) {
    return fillSheet(piece, wanted, target, options, rounding, file, remarks);
  }
  Choice choice;
  if (wanted == TetrahedraMethod::grid) {
    choice.filled = fillWithGrid(piece, target, parallelFor);
    return choice;
  }
  if (wanted == TetrahedraMethod::delaunay) {
    DelaunayOutcome outcome;
    choice.filled = fillWithDelaunay(piece, target, crosses_itself, parallelFor, outcome);
    if (!choice.filled.mesh.tetrahedra.empty()) {
      choice.method = TetrahedraMethod::delaunay;
      remarks.add("tetrahedra-method", Severity::info, "filled by delaunay",
                  piece.title + (outcome.note.empty() ? "" : " (" + outcome.note + ")"), "");
      if (choice.filled.uncovered > kMostUncovered) {
        remarks.add("tetrahedra-thin", Severity::warning, "lost something to delaunay",
                    piece.title + " (" + text("%.1f", 100 * choice.filled.uncovered) + " % of the surface)",
                    "Raise tetrahedra.vertices, or set tetrahedra.method=auto.");
      }
      return choice;
    }
    if (!outcome.only_angles) {
      throw ToolError(ExitCode::bad_input, file,
                      "delaunay cannot fill piece '" + piece.title + "' (" + outcome.reason + ")",
                      otherMethod(piece, "auto", "repair what sinew check reports"));
    }
    remarks.add("tetrahedra-delaunay", Severity::warning, "too flat for delaunay, filled as by auto instead",
                piece.title + " (" + outcome.reason + ")",
                "Change tetrahedra.vertices, or set tetrahedra.method=auto.");
    return fillPiece(piece, options, TetrahedraMethod::automatic, target, thin, crosses_itself, rounding, file,
                     remarks);
  }
  choice.filled = fillWithStuffing(piece, target, thin, parallelFor);
  choice.method = TetrahedraMethod::stuffing;
  const std::string fault = complaint(piece, choice.filled);
  if (wanted == TetrahedraMethod::automatic) {
    FilledPiece grid;
    // A long thin piece (a wire) forces the lattice far below the spacing that the budget allows.
    const std::size_t count = choice.filled.mesh.positions.size();
    const bool too_many = target >= kLeastBudget && count > 2 * std::size_t(target);
    if (!fault.empty() || too_many) grid = fillWithGrid(piece, target, parallelFor);
    const bool grid_saves = too_many && !grid.mesh.tetrahedra.empty() && 2 * grid.mesh.positions.size() < count;
    // Thin all over, a piece gets too much volume either way: then the lesser evil.
    const bool stays =
        !grid_saves && (fault.empty() || (choice.filled.components == 1 && choice.filled.uncovered <= kMostUncovered &&
                                          std::abs(std::log(volumeRatio(piece, choice.filled))) <
                                              std::abs(std::log(volumeRatio(piece, grid)))));
    std::string detail = fault;
    if (grid_saves)
      detail += (detail.empty() ? "" : ", ") + std::string("stuffing needs ") + std::to_string(count) + " vertices";
    if (!fault.empty() && stays) detail += ", grid " + text("%.2f", volumeRatio(piece, grid));
    if (stays && choice.filled.thickened > 0) {
      detail += (detail.empty() ? "" : "; ") + text("%.1f", 100 * choice.filled.thickened) +
                " % of the surface is thin and was thickened to a cell";
    }
    if (!stays) {
      choice.filled = std::move(grid);
      choice.method = TetrahedraMethod::grid;
    }
    remarks.add("tetrahedra-method", Severity::info, stays ? "filled by stuffing" : "filled by grid",
                piece.title + (detail.empty() ? "" : " (" + detail + ")"), "");
    return choice;
  }
  if (choice.filled.mesh.tetrahedra.empty()) {
    throw ToolError(ExitCode::bad_input, file, "stuffing finds nothing of piece '" + piece.title + "' (" + fault + ")",
                    otherMethod(piece, "grid", "raise tetrahedra.vertices"));
  }
  if (!fault.empty()) {
    remarks.add("tetrahedra-thin", Severity::warning, "lost something to stuffing", piece.title + " (" + fault + ")",
                "Raise tetrahedra.vertices, or set tetrahedra.method=grid or auto.");
  }
  return choice;
}

// How many there are whose tetrahedra share no vertex.
std::uint32_t componentsOf(const PhysicalMesh& mesh, const PhysicalPiece& piece) {
  TetMesh one;
  one.positions.assign(mesh.positions.begin() + piece.first_vertex,
                       mesh.positions.begin() + piece.first_vertex + piece.vertex_count);
  for (std::uint32_t t = 0; t < piece.tetrahedron_count; ++t) {
    one.tetrahedra.push_back(mesh.tetrahedra[piece.first_tetrahedron + t]);
    for (std::uint32_t& v : one.tetrahedra.back()) v -= piece.first_vertex;
  }
  std::vector<std::uint32_t> component;
  return geometry::connectedComponents(one, geometry::JoinedBy::vertices, component);
}

// The last gate: what leaves this stage is sound, whichever way it was made.
void validate(const PhysicalMesh& mesh, const std::string& file) {
  const auto fail = [&](const std::string& what) {
    throw ToolError(ExitCode::bad_input, file, "the tetrahedra came out wrong: " + what,
                    "Set another tetrahedra.method or tetrahedra.vertices, and report this file.");
  };
  for (const PhysicalPiece& piece : mesh.pieces) {
    if (piece.tetrahedron_count == 0) fail("piece '" + piece.name + "' has none");
    std::vector<char> used(piece.vertex_count, 0);
    for (std::uint32_t t = piece.first_tetrahedron; t < piece.first_tetrahedron + piece.tetrahedron_count; ++t) {
      for (const std::uint32_t v : mesh.tetrahedra[t]) {
        if (v < piece.first_vertex || v >= piece.first_vertex + piece.vertex_count)
          fail("an index is out of its piece");
        used[v - piece.first_vertex] = 1;
      }
    }
    if (std::find(used.begin(), used.end(), char(0)) != used.end()) fail("a vertex is unused");
    if (const std::uint32_t components = componentsOf(mesh, piece); components > 1) {
      throw ToolError(ExitCode::bad_input, file,
                      "the tetrahedra of piece '" + piece.name + "' are " + std::to_string(components) +
                          " components that would fall apart",
                      "Set tetrahedra.method=grid, which joins them, or raise tetrahedra.vertices.");
    }
  }
  for (const Vector3d& p : mesh.positions) {
    if (!p.allFinite()) fail("a position is not finite");
  }
  if (mesh.quality.inverted > 0) fail(std::to_string(mesh.quality.inverted) + " are inverted or flat");
}

}  // namespace

TetrahedraQuality measureQuality(const std::vector<Vector3d>& positions,
                                 const std::vector<std::array<std::uint32_t, 4>>& tetrahedra) {
  TetrahedraQuality quality;
  if (tetrahedra.empty()) return quality;
  quality.min_dihedral_deg = 180;
  for (const auto& t : tetrahedra) {
    const Vector3d &a = positions[t[0]], &b = positions[t[1]], &c = positions[t[2]], &d = positions[t[3]];
    // Not "> 0": NaN counts as inverted too.
    if (!(geometry::signedVolume6(a, b, c, d) > 0)) ++quality.inverted;
    const auto range = geometry::dihedralRange(a, b, c, d);
    quality.min_dihedral_deg = std::min(quality.min_dihedral_deg, range[0]);
    quality.max_dihedral_deg = std::max(quality.max_dihedral_deg, range[1]);
  }
  return quality;
}

PhysicalMesh tetrahedralize(const VisualMesh& mesh, const Topology& topology, const TetrahedraOptions& options,
                            Progress& progress) {
  PieceSet set = findPieces(mesh, topology, options.join_distance * mesh.diagonal, parallelFor);
  if (set.pieces.empty()) {
    throw ToolError(ExitCode::bad_input, mesh.file, kNoArea, kNoAreaCure);
  }
  PhysicalMesh result;
  result.part_piece = set.part_piece;
  result.home.assign(mesh.welded_positions.size(), formats::kNone);
  // Only delaunay works on the surface itself.
  std::vector<char> crosses_itself(set.pieces.size(), 0);
  if (options.method == TetrahedraMethod::delaunay) {
    constexpr std::size_t kMostPairs = 100000;
    const auto pairs = findSelfIntersections(mesh, topology, kMostPairs, false);
    for (const auto& pair : pairs) {
      const std::uint32_t part = topology.part_of_triangle[pair.first];
      if (part != formats::kNone) crosses_itself[set.part_piece[part]] = 1;
    }
    if (pairs.size() >= kMostPairs) std::fill(crosses_itself.begin(), crosses_itself.end(), char(1));
  }
  const std::vector<std::uint32_t> share = shareVertices(set.pieces, options.target_vertices);
  // Of a coordinate, to a float, half a diagonal from the package's origin: at most half of the last place.
  const double rounding = 0x1p-25 * mesh.diagonal;
  Remarks remarks;
  for (std::size_t b = 0; b < set.pieces.size(); ++b) {
    const SolidPiece& piece = set.pieces[b];
    progress.fraction(double(b) / double(set.pieces.size()));
    Choice choice;
    SplitMesh split;
    const Remarks before = remarks;
    std::uint32_t target = share[b];
    TetrahedraMethod method = options.method;
    std::vector<std::uint32_t> thin;
    for (int round = 0; round < kRounds; ++round) {
      // A shell was not possible at the wanted number, or stuffing lost to the grid: with fewer vertices it would
      // again.
      const bool grid = method == TetrahedraMethod::automatic && choice.method == TetrahedraMethod::grid;
      if (round > 0 && (!piece.encloses || grid)) {
        choice.filled = fillWithGrid(piece, target, parallelFor);
      } else {
        remarks = before;
        choice = fillPiece(piece, options, method, target, thin, crosses_itself[b] != 0, rounding, mesh.file, remarks);
      }
      if (choice.method == TetrahedraMethod::shell) {
        split.home = choice.home;
        break;
      }
      geometry::sortForLocality(choice.filled.mesh);
      if (choice.method == TetrahedraMethod::delaunay) break;
      split = splitAtGaps(piece, choice.filled.mesh,
                          std::max(options.join_distance * mesh.diagonal, mesh.weld_tolerance), parallelFor);
      choice.filled.mesh = split.mesh;
      choice.filled.volume = split.volume;
      if (choice.method == TetrahedraMethod::stuffing) {
        const std::size_t known = thin.size();
        const std::vector<std::uint32_t> joints = trianglesAtJoints(piece, split.mesh, choice.filled.spacing);
        std::vector<std::uint32_t> all;
        std::set_union(thin.begin(), thin.end(), joints.begin(), joints.end(), std::back_inserter(all));
        thin = std::move(all);
        if (thin.size() > known) continue;
      }
      if (method != options.method) {
        remarks.add("tetrahedra-method", Severity::info, "filled by grid",
                    piece.title + " (stuffing holds thin parts only across gaps)", "");
      }
      // Parts joined only across a gap, thinner than a cell elsewhere: a cage loses nothing.
      if (options.method == TetrahedraMethod::automatic && choice.method == TetrahedraMethod::stuffing &&
          split.joined > 0) {
        method = TetrahedraMethod::grid;
        continue;
      }
      // Splitting adds vertices that the lattice did not count: once more with fewer where they are many.
      const double count = double(split.mesh.positions.size());
      if (count < 1.2 * share[b] || split.vertices < 0.1 * share[b]) break;
      target = std::max(kLeastVertices, std::uint32_t(target * share[b] / count));
    }
    const TetMesh& tets = choice.filled.mesh;
    const bool solid = piece.encloses && choice.method != TetrahedraMethod::shell;
    const std::vector<double> fill =
        solid ? fillFractions(piece, tets, split.inside, parallelFor) : std::vector<double>(tets.tetrahedra.size(), 1);

    PhysicalPiece physical;
    physical.name = piece.name;
    physical.method = choice.method;
    physical.parts = piece.parts;
    physical.first_vertex = static_cast<std::uint32_t>(result.positions.size());
    physical.vertex_count = static_cast<std::uint32_t>(tets.positions.size());
    physical.first_tetrahedron = static_cast<std::uint32_t>(result.tetrahedra.size());
    physical.tetrahedron_count = static_cast<std::uint32_t>(tets.tetrahedra.size());
    physical.tie_count = choice.filled.ties;
    physical.volume = choice.filled.volume;
    physical.source_volume = solid ? piece.volume : -1;
    for (const Vector3d& p : tets.positions) result.positions.emplace_back(p + piece.center);
    for (auto t : tets.tetrahedra) {
      for (std::uint32_t& v : t) v += physical.first_vertex;
      result.tetrahedra.push_back(t);
    }
    result.fill.insert(result.fill.end(), fill.begin(), fill.end());

    const double ratio = solid ? volumeRatio(piece, choice.filled) : 1;
    if (std::abs(ratio - 1) > kReportedRatio) {
      remarks.add("tetrahedra-volume", Severity::warning, "whose tetrahedra do not have the volume of the source",
                  piece.title + " (" + text("%.2f", ratio) + " times)",
                  "Masses are made from the source's volume all the same; raise tetrahedra.vertices for a closer fit.");
    }
    if (choice.filled.bridges > 0) {
      remarks.add("tetrahedra-bridged", Severity::warning, "had parts joined by cells outside the surface",
                  piece.title + " (" + std::to_string(choice.filled.bridges) + " cells)",
                  "Lower tetrahedra.join to make the parts pieces of their own, or connect them in the source.");
    }
    if (split.cells > 0) {
      remarks.add("tetrahedra-split", Severity::info, "had cells split along gaps narrower than they are",
                  piece.title + " (" + std::to_string(split.cells) + " cells, " + std::to_string(split.vertices) +
                      " vertices more)",
                  "");
    }
    if (!split.doubtful.empty()) {
      remarks.add("tetrahedra-overlap", Severity::info,
                  "had sheets that pierce each other: each was taken for a surface of its own",
                  piece.title + " (" + std::to_string(split.doubtful.size()) + " cells)",
                  "Move them apart, or join them by faces, where sinew check reports self-intersections.");
    }
    for (std::size_t p = 0; p < split.home.size(); ++p) {
      if (split.home[p] != formats::kNone) result.home[piece.points[p]] = physical.first_tetrahedron + split.home[p];
    }
    result.pieces.push_back(std::move(physical));
  }
  progress.fraction(1);
  remarks.report(result.findings);
  const std::vector<Finding> about = pieceFindings(mesh, topology, set, options.join_distance * mesh.diagonal);
  result.findings.insert(result.findings.end(), about.begin(), about.end());
  const auto reportAttached = [&](const std::vector<std::uint32_t>& parts, const char* id, const std::string& one,
                                  const std::string& many, const char* cure) {
    if (parts.empty()) return;
    Finding f;
    f.id = id;
    f.severity = Severity::info;
    f.count = parts.size();
    f.message = std::to_string(f.count) + " " + (f.count == 1 ? one : many);
    f.place_kind = "face";
    for (const std::uint32_t p : parts) {
      if (f.places.size() == Finding::kMaxPlaces) break;
      f.places.push_back(mesh.triangle_face[topology.parts[p].triangles.front()]);
    }
    f.cure = cure;
    result.findings.push_back(std::move(f));
  };
  reportAttached(set.attached_sheets, "tetrahedra-loose-sheets",
                 "loose sheet that encloses nothing moves with the nearest piece",
                 "loose sheets that enclose nothing move with the nearest piece",
                 "Close them or give them a thickness if they are to be pieces of their own.");
  reportAttached(set.attached_solids, "tetrahedra-small-parts", "small part close to a much larger one moves with it",
                 "small parts close to a much larger one move with it",
                 "Bake them as files of their own if they are to fall by themselves.");
  const auto isShell = [](const PhysicalPiece& piece) { return piece.method == TetrahedraMethod::shell; };
  if (!options.shell_factors.empty() && std::none_of(result.pieces.begin(), result.pieces.end(), isShell)) {
    Finding f;
    f.id = "thickness-unused";
    f.count = 1;
    f.message = "the recipe's thickness changes nothing: no piece is a shell";
    f.cure = "Set tetrahedra.method to shell, or remove the key thickness.";
    result.findings.push_back(std::move(f));
  }
  const double count = double(result.positions.size());
  if (count > 1.35 * options.target_vertices || count < 0.65 * options.target_vertices) {
    Finding f;
    f.id = "tetrahedra-count";
    f.severity = Severity::info;
    f.count = result.positions.size();
    f.message = std::to_string(f.count) + " physical vertices instead of the " +
                std::to_string(options.target_vertices) + " wanted: " + std::to_string(result.pieces.size()) +
                (result.pieces.size() == 1 ? " piece" : " pieces") + " of this shape cannot be cut closer to that.";
    f.cure = "Set tetrahedra.vertices to what the pieces need, or join pieces with tetrahedra.join.";
    result.findings.push_back(std::move(f));
  }
  result.quality = measureQuality(result.positions, result.tetrahedra);
  validate(result, mesh.file);
  return result;
}

}  // namespace sinew::tools
