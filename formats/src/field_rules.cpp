// SPDX-License-Identifier: MIT
#include "value_rules.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <span>
#include <vector>

#include "value_tests.h"

namespace sinew::formats {
namespace {

constexpr std::uint32_t kMostFunctions = 1024, kMostResidualModes = 256;
/// Of the matrices that the runtime makes of fibres: 256 MB.
constexpr std::size_t kMostFibreEntries = std::size_t(1) << 26;
// Of 1, of the diagonal, of the mass: what sums of rounded numbers may be off.
constexpr float kTolerance = 1e-3F;
// Of a tether's diagonal: what a thousand rounded numbers may take from an eigenvalue.
constexpr double kDefinite = 1e-4;

/// to += factor * from.
void add(Lanes& to, float factor, const Lanes& from) {
  for (std::size_t l = 0; l < 8; ++l) to[l] += factor * from[l];
}

/// Largest magnitude so far. A NaN does not show here, but in every sum.
void takeLargest(Lanes& largest, const Lanes& values) {
  for (std::size_t l = 0; l < 8; ++l) {
    const float size = std::fabs(values[l]);
    largest[l] = largest[l] < size ? size : largest[l];
  }
}

bool hasCluster(const PieceRange& piece, std::uint32_t cluster) {
  return cluster >= piece.first_cluster && cluster - piece.first_cluster < piece.cluster_count;
}

/// A place that a field is evaluated at: PVTX (weight: mass) and FPNT (weight: area).
struct Place {
  std::array<float, 3> at;
  float weight;
};
static_assert(sizeof(Place) == sizeof(PhysicalVertex) && sizeof(Place) == sizeof(FieldPoint));
static_assert(offsetof(Place, weight) == offsetof(PhysicalVertex, mass) &&
              offsetof(Place, weight) == offsetof(FieldPoint, area));

class FieldRules {
 public:
  FieldRules(const PackageView& view, const Reach& reach, Refusal& refuse)
      : view_(view), reach_(reach), refuse_(refuse) {}

  bool hold() {
    for (index_ = 0; index_ < view_.allFields().size(); ++index_) {
      if (!checkRecord() || !checkRuns() || !checkFunctions() || !checkSamples() || !checkVertices() ||
          !checkPoints() || !checkModes()) {
        return false;
      }
    }
    if (!view_.allFields().empty() && pieces_ != view_.pieces().size()) {
      return refuse_(section::fields, "a piece without its free field");
    }
    if (!view_.allFields().empty() && view_.allFields().size() % view_.fields().size() != 0) {
      return refuse_(section::fields, "a level that does not have all fields");
    }
    for (std::size_t r = 0; r < ends_.size(); ++r) {
      if (ends_[r] != view_.sectionData(kRuns[r].id).count) {
        return refuse_(kRuns[r].id, "has elements of no field");
      }
    }
    return checkFibres() && checkTethers() && checkResiduals() && checkDistances();
  }

 private:
  const Field& field() const { return view_.allFields()[index_]; }

  bool refuse(const char* what) { return refuse_(section::fields, index_, what); }

  bool checkRecord() {
    const Field& f = field();
    if (f.held > 1) return refuse("held is not 0 or 1");
    if (f.level > 0) {
      const std::size_t whole = view_.fields().size();
      if (whole == 0 || index_ < whole || f.level != index_ / whole) return refuse("level is not the next one");
      const Field& finer = view_.allFields()[index_ - whole];
      if (f.piece != finer.piece || f.held != finer.held || f.driven_count != finer.driven_count ||
          f.point_count != finer.point_count || f.function_count > finer.function_count) {
        return refuse(
            "is not of the piece, the pins and as many contact points as that of the level before, or has more "
            "functions");
      }
    } else if (index_ >= view_.fields().size()) {
      return refuse("of level 0 behind others");
    } else if (f.held == 0) {
      if (f.piece != pieces_ || f.piece >= view_.pieces().size()) return refuse("not the free field of the next piece");
      ++pieces_;
    } else if (index_ == 0 || view_.allFields()[index_ - 1].held != 0 ||
               view_.allFields()[index_ - 1].piece != f.piece) {
      return refuse("held, but not behind the free field of its piece");
    }
    if (f.function_count == 0 || f.function_count > kMostFunctions)
      return refuse("function_count is outside 1 to 1024");
    if (f.held == 0 ? f.driven_count != 0
                    : f.driven_count == 0 || f.driven_count % 4 != 0 || f.driven_count > f.function_count) {
      return refuse("driven_count is not a multiple of 4 within its functions: above 0 if it is held, else 0");
    }
    if (f.pack_count == 0) return refuse("has no samples");
    if ((negativeOrBeyond(f.lowest_hz) | negativeOrBeyond(f.static_error) | beyond(f.least_eigenvalue)) != 0) {
      return refuse("lowest_hz, static_error or least_eigenvalue is negative, not finite or above 1e18");
    }
    return true;
  }

  struct Run {
    std::uint32_t id;
    const char* what;
  };
  static constexpr std::array<Run, 7> kRuns = {{
      {section::field_functions, "its run of FFUN does not start where the one before ends, or reaches too far"},
      {section::field_packs, "its run of FPAK does not start where the one before ends, or reaches too far"},
      {section::field_gradients, "its run of FGRD does not start where the one before ends, or reaches too far"},
      {section::field_values, "its run of FVAL does not start where the one before ends, or reaches too far"},
      {section::field_points, "its run of FPNT does not start where the one before ends, or reaches too far"},
      {section::field_point_values, "its run of FPTV does not start where the one before ends, or reaches too far"},
      {section::field_modes, "its run of FMOD does not start where the one before ends, or reaches too far"},
  }};

  bool checkRuns() {
    const Field& f = field();
    const std::uint64_t k = f.function_count, vertices = view_.pieces()[f.piece].vertex_count, points = f.point_count;
    const std::uint64_t unknowns = 3 * (k - f.driven_count);
    const std::array<std::uint64_t, 7> firsts = {f.first_function, f.first_pack,        f.first_gradient, f.first_value,
                                                 f.first_point,    f.first_point_value, f.first_mode};
    const std::array<std::uint64_t, 7> counts = {k,
                                                 f.pack_count,
                                                 3 * k * f.pack_count,
                                                 k * ((vertices + 7) / 8),
                                                 points,
                                                 k * ((points + 7) / 8),
                                                 (unknowns + 1) * ((unknowns + 7) / 8)};
    for (std::size_t r = 0; r < kRuns.size(); ++r) {
      if (firsts[r] != ends_[r] || counts[r] > view_.sectionData(kRuns[r].id).count - ends_[r]) {
        return refuse(kRuns[r].what);
      }
      ends_[r] += counts[r];
    }
    functions_ = view_.fieldFunctions().subspan(f.first_function, f.function_count);
    return true;
  }

  bool checkFunctions() {
    std::uint32_t set = 0;
    for (std::uint32_t j = 0; j < functions_.size(); ++j) {
      const FieldFunction& function = functions_[j];
      const auto bad = [&](const char* what) {
        return refuse_(section::field_functions, field().first_function + j, what);
      };
      if ((negativeOrBeyond(function.stiffness) | negativeOrBeyond(function.damping_hz) |
           negativeOrBeyond(function.decay) | beyond(function.one) | beyond(function.rest)) != 0) {
        return bad("stiffness, damping_hz or decay is negative, or a number is not finite or above 1e18");
      }
      if (j >= field().driven_count) {
        if (function.pin_set != kNone || function.monomial != 0) return bad("is not driven, but names what drives it");
        continue;
      }
      if (function.monomial != j % 4) return bad("the monomials of driven functions are not 0, 1, 2, 3 in turn");
      if (j % 4 == 0 ? function.pin_set >= view_.pinSets().size() || function.pin_set < set : function.pin_set != set) {
        return bad("driven by no pin set of section PSET, or these are not ascending, four functions each");
      }
      const auto is = [j](std::size_t monomial) { return float(j % 4 == monomial); };
      if (function.one != is(0) || function.rest != std::array{is(1), is(2), is(3)}) {
        return bad("one and rest of a driven function are not those of 1, X, Y or Z");
      }
      if (field().level > 0) {
        const Field& finer = view_.allFields()[index_ - view_.fields().size()];
        if (function.pin_set != view_.fieldFunctions()[finer.first_function + j].pin_set) {
          return bad("driven by another pin set than on the level before");
        }
      }
      set = function.pin_set + unsigned(j % 4 == 3);
    }
    return true;
  }

  /// The samples: in each, the gradients must make 1 of the rest places, or there is stress at rest.
  bool checkSamples() {
    const Field& f = field();
    const std::size_t k = functions_.size();
    bool any = false;
    for (std::uint32_t p = f.first_pack; p < f.first_pack + f.pack_count; ++p) {
      const FieldPack& pack = view_.fieldPacks()[p];
      unsigned bad = 0;
      for (std::size_t l = 0; l < 8; ++l) {
        bad |= negativeOrBeyond(pack.volume[l]) | negativeOrBeyond(pack.mu[l]) | negativeOrBeyond(pack.lambda[l]);
        const unsigned away =
            reach_.beyond(pack.at[0][l], 0) | reach_.beyond(pack.at[1][l], 1) | reach_.beyond(pack.at[2][l], 2);
        bad |= unsigned(pack.volume[l] > 0) & away;
      }
      if (bad != 0) {
        return refuse_(section::field_packs, p,
                       "a volume, mu or lambda is negative, not finite or above 1e18, or a place more than a diagonal "
                       "outside the bounds of section INFO");
      }
      for (const float volume : pack.volume) any = any || volume > 0;
      const PieceRange& piece = view_.pieces()[f.piece];
      for (const std::uint32_t cluster : pack.cluster) {
        if (cluster != kNone && (view_.mechanics().empty() || !hasCluster(piece, cluster))) {
          return refuse_(section::field_packs, p, "names a cluster of another piece, or one without mechanics");
        }
      }
      const std::size_t first = f.first_gradient + 3 * k * (p - f.first_pack);
      const Lanes* const gradients = view_.fieldGradients().data() + first;
      Lanes largest = {};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        Lanes one = {}, x = {}, y = {}, z = {};
        for (std::size_t j = 0; j < k; ++j) {
          const Lanes& g = gradients[3 * j + axis];
          const FieldFunction& function = functions_[j];
          add(one, function.one, g);
          add(x, function.rest[0], g);
          add(y, function.rest[1], g);
          add(z, function.rest[2], g);
          takeLargest(largest, g);
        }
        const float diagonal = view_.info().diagonal;
        std::array<Lanes, 3> deformation = {x, y, z};
        for (std::size_t l = 0; l < 8; ++l) {
          deformation[axis][l] -= pack.volume[l] > 0 ? 1.0F : 0.0F;
          bad |= unsigned(!(std::fabs(one[l]) * diagonal <= kTolerance));
          for (std::size_t row = 0; row < 3; ++row) {
            bad |= unsigned(!(std::fabs(deformation[row][l]) <= kTolerance));
          }
        }
      }
      for (std::size_t l = 0; l < 8; ++l) {
        bad |= unsigned(!(largest[l] <= (pack.volume[l] > 0 ? kMostNumber : 0.0F)));
      }
      if (bad != 0) {
        return refuse_(section::field_gradients, first,
                       "the gradients of its eight samples do not give 1 at rest, or are above 1e18, or not 0 where a "
                       "sample has no volume");
      }
      for (std::size_t l = 0; l < 8; ++l) {
        if (pack.volume[l] > 0) continue;
        if (pack.mu[l] != 0 || pack.lambda[l] != 0 || pack.at[0][l] != 0 || pack.at[1][l] != 0 || pack.at[2][l] != 0 ||
            pack.cluster[l] != kNone) {
          return refuse_(section::field_packs, p, "a number that is not 0, or a cluster, in a sample without volume");
        }
      }
    }
    return any || refuse("its samples have no volume");
  }

  /// The functions at places, eight by eight: they must give 1 and the rest places. norms_: the sums of weight phi^2.
  bool checkPlaces(std::uint32_t id, std::size_t first, std::span<const Lanes> all, const void* places,
                   std::size_t count) {
    const std::size_t k = functions_.size();
    norms_.assign(k, Lanes{});
    const float near = kTolerance * view_.info().diagonal;
    for (std::size_t done = 0; done < count; done += 8) {
      Lanes weight = {}, wanted_one = {}, largest = {}, one = {}, x = {}, y = {}, z = {};
      std::array<Lanes, 3> wanted = {};
      const std::size_t live = std::min<std::size_t>(8, count - done);
      for (std::size_t l = 0; l < live; ++l) {
        Place place;
        std::memcpy(&place, static_cast<const std::byte*>(places) + sizeof place * (done + l), sizeof place);
        for (std::size_t axis = 0; axis < 3; ++axis) wanted[axis][l] = place.at[axis];
        weight[l] = place.weight;
        wanted_one[l] = 1;
      }
      const std::size_t element = first + k * (done / 8);
      const Lanes* const values = all.data() + element;
      for (std::size_t j = 0; j < k; ++j) {
        const Lanes& phi = values[j];
        const FieldFunction& function = functions_[j];
        add(one, function.one, phi);
        add(x, function.rest[0], phi);
        add(y, function.rest[1], phi);
        add(z, function.rest[2], phi);
        takeLargest(largest, phi);
        Lanes& norm = norms_[j];
        for (std::size_t l = 0; l < 8; ++l) norm[l] += weight[l] * phi[l] * phi[l];
      }
      unsigned bad = 0;
      const std::array<Lanes, 3> sum = {x, y, z};
      for (std::size_t l = 0; l < 8; ++l) {
        bad |= unsigned(!(std::fabs(one[l] - wanted_one[l]) <= kTolerance)) |
               unsigned(!(largest[l] <= wanted_one[l] * kMostNumber));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          bad |= unsigned(!(std::fabs(sum[axis][l] - wanted[axis][l]) <= near));
        }
      }
      if (bad != 0) {
        return refuse_(id, element,
                       "the functions at its eight places do not give 1 and the rest places, or are above 1e18, or not "
                       "0 behind the last");
      }
    }
    return true;
  }

  bool checkVertices() {
    const Field& f = field();
    const PieceRange& piece = view_.pieces()[f.piece];
    const auto vertices = view_.physicalVertices().subspan(piece.first_vertex, piece.vertex_count);
    if (!checkPlaces(section::field_values, f.first_value, view_.fieldValues(), vertices.data(), vertices.size())) {
      return false;
    }
    for (std::size_t j = f.driven_count; j < functions_.size(); ++j) {
      double norm = 0;
      for (const float part : norms_[j]) norm += double(part);
      if (!(std::abs(norm - 1) <= double(kTolerance))) {
        return refuse_(section::field_functions, f.first_function + j,
                       "the sum of mass phi^2 over the vertices of its piece is not 1");
      }
    }
    return f.held != 0 || carriesMass(vertices) ||
           refuse("mass, centre or moments of its piece are not those that its functions carry");
  }

  // Sums over the functions of the free field that are sums over the vertices where the functions are orthonormal: its
  // momentum and its spin. About the first vertex: far from the origin the squares would drown in rounding.
  bool carriesMass(std::span<const PhysicalVertex> vertices) const {
    const std::array<float, 3>& origin = vertices.front().rest_position;
    using Moments = std::array<double, 10>;  // of 1 X Y Z: 11 1X XX 1Y XY YY ...
    const auto take = [](Moments& sums, double weight, const std::array<double, 4>& of) {
      std::size_t at = 0;
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b <= a; ++b) sums[at++] += weight * of[a] * of[b];
      }
    };
    Moments carried = {}, wanted = {};
    for (const FieldFunction& function : functions_) {
      std::array<double, 4> of = {double(function.one), 0, 0, 0};
      for (std::size_t axis = 0; axis < 3; ++axis)
        of[axis + 1] = double(function.rest[axis]) - of[0] * double(origin[axis]);
      take(carried, 1, of);
    }
    for (const PhysicalVertex& v : vertices) {
      std::array<double, 4> of = {1, 0, 0, 0};
      for (std::size_t axis = 0; axis < 3; ++axis) of[axis + 1] = double(v.rest_position[axis]) - double(origin[axis]);
      take(wanted, double(v.mass), of);
    }
    const double diagonal = double(view_.info().diagonal), near = double(kTolerance) * wanted[0];
    bool good = true;
    std::size_t at = 0;
    for (std::size_t a = 0; a < 4; ++a) {
      for (std::size_t b = 0; b <= a; ++b, ++at) {
        const double unit = (a > 0 ? diagonal : 1) * (b > 0 ? diagonal : 1);
        good = good && std::abs(carried[at] - wanted[at]) <= near * unit;
      }
    }
    return good;
  }

  bool checkPoints() {
    const Field& f = field();
    const auto points = view_.fieldPoints().subspan(f.first_point, f.point_count);
    if (f.level > 0 && !points.empty()) {
      const Field& finer = view_.allFields()[index_ - view_.fields().size()];
      if (std::memcmp(points.data(), &view_.fieldPoints()[finer.first_point], points.size_bytes()) != 0) {
        return refuse("its contact points are not those of the level before");
      }
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (reach_.beyond(points[i].at) != 0 || !(points[i].area > 0) || !(points[i].area <= kMostNumber)) {
        return refuse_(
            section::field_points, f.first_point + i,
            "area is not above 0 to 1e18, or the place is more than a diagonal outside the bounds of section INFO");
      }
    }
    return checkPlaces(section::field_point_values, f.first_point_value, view_.fieldPointValues(), points.data(),
                       points.size());
  }

  /// The modes, eight by eight: of norm 1 each, or the solver gets nowhere.
  bool checkModes() {
    const std::size_t unknowns = 3 * (functions_.size() - field().driven_count);
    for (std::size_t done = 0; done < unknowns; done += 8) {
      const std::size_t element = field().first_mode + (unknowns + 1) * (done / 8);
      const Lanes* const lanes = view_.fieldModes().data() + element;
      const std::size_t live = std::min<std::size_t>(8, unknowns - done);
      Lanes norm = {}, largest = {};
      for (std::size_t i = 1; i <= unknowns; ++i) {
        takeLargest(largest, lanes[i]);
        for (std::size_t l = 0; l < 8; ++l) norm[l] += lanes[i][l] * lanes[i][l];
      }
      unsigned bad = 0;
      for (std::size_t l = 0; l < live; ++l) {
        bad |= negativeOrBeyond(lanes[0][l]) | unsigned(!(std::fabs(norm[l] - 1) <= kTolerance));
      }
      for (std::size_t l = live; l < 8; ++l) {
        bad |= unsigned(lanes[0][l] != 0) | unsigned(norm[l] != 0) | unsigned(largest[l] != 0);
      }
      if (bad != 0) {
        return refuse_(section::field_modes, element,
                       "a mode of its eight is not of norm 1, its square of a frequency is negative, not finite or "
                       "above 1e18, or a lane behind the last is not 0");
      }
    }
    return true;
  }

  /// Fibres in the order of their fields and clusters. At rest a fibre is neither stretched nor turned: its values give
  /// its direction.
  bool checkFibres() {
    std::size_t values = 0, entries = 0;
    for (std::size_t i = 0; i < view_.fieldFibres().size(); ++i) {
      const FieldFibre& fibre = view_.fieldFibres()[i];
      const auto bad = [&](const char* what) { return refuse_(section::field_fibres, i, what); };
      if (fibre.field >= view_.allFields().size()) return bad("names a field that is not there");
      const Field& f = view_.allFields()[fibre.field];
      const PieceRange& piece = view_.pieces()[f.piece];
      if (view_.mechanics().empty() || !hasCluster(piece, fibre.cluster) ||
          view_.mechanics()[fibre.cluster].channel == kNone ||
          view_.mechanics()[fibre.cluster].fibre == std::array<float, 3>{}) {
        return bad("names a cluster of another piece, or one without a fibre that something activates");
      }
      if (i > 0) {
        const FieldFibre& last = view_.fieldFibres()[i - 1];
        if (fibre.field < last.field || (fibre.field == last.field && fibre.cluster < last.cluster)) {
          return bad("fibres are not ascending by field and cluster");
        }
      }
      const std::size_t k = f.function_count;
      if (i == 0 || fibre.field != view_.fieldFibres()[i - 1].field ||
          fibre.cluster != view_.fieldFibres()[i - 1].cluster) {
        entries += k * (k + 1) / 2;
      }
      if (entries > kMostFibreEntries) return bad("k (k + 1) / 2 over activated clusters and fields is above 67108864");
      if (negativeOrBeyond(fibre.tension) != 0) return bad("tension is negative, not finite or above 1e18");
      if (fibre.first_value != values || f.function_count > view_.fieldFibreValues().size() - values) {
        return bad("its run of FFBV does not start where the one before ends, or reaches too far");
      }
      std::array<float, 4> sum = {};
      for (std::size_t j = 0; j < f.function_count; ++j) {
        const float value = view_.fieldFibreValues()[values + j];
        const FieldFunction& function = view_.fieldFunctions()[f.first_function + j];
        if ((beyond(value) | beyond(fibre.tension * value * value)) != 0)
          return bad("a value, or its square times the tension, is not finite or above 1e18");
        sum[3] += value * function.one * view_.info().diagonal;
        for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += value * function.rest[axis];
      }
      const std::array<float, 3>& fibre_at_rest = view_.mechanics()[fibre.cluster].fibre;
      unsigned off = unsigned(!(std::fabs(sum[3]) <= kTolerance));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        off |= unsigned(!(std::fabs(sum[axis] - fibre_at_rest[axis]) <= kTolerance));
      }
      if (off != 0) return bad("its values do not give the cluster's fibre at rest");
      values += f.function_count;
    }
    return values == view_.fieldFibreValues().size() ||
           refuse_(section::field_fibre_values, "has elements of no fibre");
  }

  bool checkResiduals() {
    std::size_t values = 0, locals = 0;
    const auto residuals = view_.fieldResiduals();
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      const FieldResidual& residual = residuals[i];
      const auto bad = [&](const char* what) { return refuse_(section::field_residuals, i, what); };
      if (residual.field >= view_.allFields().size() || view_.allFields()[residual.field].held != 0 ||
          (i > 0 && residual.field <= residuals[i - 1].field)) {
        return bad("names a field that is not there, or held, or fields are not ascending");
      }
      if (residual.mode_count == 0 || residual.mode_count > kMostResidualModes) return bad("has no modes or above 256");
      if (!(residual.scale > 0) || beyond(residual.scale) != 0) return bad("scale is not above 0 and at most 1e18");
      const std::size_t vertices = view_.pieces()[view_.allFields()[residual.field].piece].vertex_count;
      const std::size_t count = 24 * ((vertices + 7) / 8) * residual.mode_count;
      if (residual.first_value != values || count > view_.fieldResidualValues().size() - values) {
        return bad("its run of FRSV does not start where the one before ends, or reaches too far");
      }
      if (residual.first_local != locals || vertices > view_.fieldResidualLocals().size() - locals) {
        return bad("its run of FRSL does not start where the one before ends, or reaches too far");
      }
      for (const float local : view_.fieldResidualLocals().subspan(locals, vertices)) {
        if (!(local > 0) || beyond(local) != 0) return bad("a value of FRSL is not above 0 and at most 1e18");
      }
      values += count;
      locals += vertices;
    }
    if (locals != view_.fieldResidualLocals().size()) {
      return refuse_(section::field_residual_locals, "has elements of no field");
    }
    return values == view_.fieldResidualValues().size() ||
           refuse_(section::field_residual_values, "has elements of no field");
  }

  bool checkDistances() {
    std::size_t values = 0;
    const auto grids = view_.distanceGrids();
    for (std::size_t i = 0; i < grids.size(); ++i) {
      const DistanceGrid& grid = grids[i];
      const auto bad = [&](const char* what) { return refuse_(section::distance_grids, i, what); };
      if (grid.piece >= view_.pieces().size() || (i > 0 && grid.piece <= grids[i - 1].piece)) {
        return bad("names a piece that there is not, or not in their order");
      }
      std::size_t count = 1;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (grid.nodes[axis] < 2 || grid.nodes[axis] > kMostDistanceNodes)
          return bad("has fewer than 2 or more than 256 nodes along an axis");
        if (reach_.beyond(grid.origin[axis], axis) != 0) return bad("origin is too far from the bounds");
        count *= grid.nodes[axis];
      }
      if (!(grid.spacing > 0 && grid.spacing <= view_.info().diagonal) ||
          !(grid.unit > 0 && grid.unit <= grid.spacing)) {
        return bad("spacing is not above 0 and at most the diagonal, or unit not above 0 and at most spacing");
      }
      if (grid.first_value != values || count > view_.distanceValues().size() - values) {
        return bad("its run of DVAL does not start where the one before ends, or reaches too far");
      }
      values += count;
    }
    return values == view_.distanceValues().size() || refuse_(section::distance_values, "has elements of no grid");
  }

  /// Tethers pull at nothing at rest, nor where all is moved or stretched alike. T = sum kappa r r^T: where its terms
  /// cancel, as in a piece that is symmetric, a value is rounding alone, so what a pull is measured by is the diagonal.
  bool checkTethers() {
    std::size_t values = 0;
    for (std::size_t i = 0; i < view_.fieldTethers().size(); ++i) {
      const FieldTethers& tethers = view_.fieldTethers()[i];
      const auto bad = [&](const char* what) { return refuse_(section::field_tethers, i, what); };
      if (tethers.field >= view_.allFields().size() || view_.allFields()[tethers.field].held == 0 ||
          (i > 0 && tethers.field <= view_.fieldTethers()[i - 1].field)) {
        return bad("names a field that is not there, or not held, or fields are not ascending");
      }
      const Field& f = view_.allFields()[tethers.field];
      const std::size_t k = f.function_count;
      if (tethers.first_value != values || k * k > view_.fieldTetherValues().size() - values) {
        return bad("its run of FTHV does not start where the one before ends, or reaches too far");
      }
      const float* const t = view_.fieldTetherValues().data() + values;
      const auto functions = view_.fieldFunctions().subspan(f.first_function, k);
      roots_.resize(k);
      for (std::size_t a = 0; a < k; ++a) {
        for (std::size_t b = 0; b < k; ++b) {
          if (beyond(t[k * a + b]) != 0 || t[k * a + b] != t[k * b + a])
            return bad("a value is not finite, above 1e18 or not symmetric");
        }
        if (t[k * a + a] < 0) return bad("a value on the diagonal is negative");
        roots_[a] = std::sqrt(double(t[k * a + a]));
      }
      for (std::size_t a = 0; a < k; ++a) {
        std::array<double, 4> sum = {}, size = {};
        for (std::size_t b = 0; b < k; ++b) {
          const double value = double(t[k * a + b]), most = std::max(std::abs(value), roots_[a] * roots_[b]);
          for (std::size_t n = 0; n < 4; ++n) {
            const double of = double(n == 3 ? functions[b].one : functions[b].rest[n]);
            sum[n] += value * of;
            size[n] += most * std::abs(of);
          }
        }
        for (std::size_t n = 0; n < 4; ++n) {
          if (!(std::abs(sum[n]) <= double(kTolerance) * size[n])) return bad("its values pull at the rest shape");
        }
      }
      if (!isPositive(t, k)) return bad("its values are not positive semidefinite");
      values += k * k;
    }
    return values == view_.fieldTetherValues().size() ||
           refuse_(section::field_tether_values, "has elements of no field");
  }

  /// Whether a symmetric matrix, scaled to a diagonal of ones, has a Cholesky factor where each of these is larger by
  /// kDefinite, so that no eigenvalue is less than that below 0. roots_: of its diagonal.
  bool isPositive(const float* t, std::size_t k) {
    factor_.resize(k * k);
    for (std::size_t a = 0; a < k; ++a) {
      for (std::size_t b = 0; b <= a; ++b) {
        const double scale = roots_[a] * roots_[b], value = double(t[k * a + b]);
        if (scale == 0 && value != 0) return false;
        double rest = scale == 0 ? 0.0 : value / scale;
        if (a == b) rest += kDefinite;
        for (std::size_t c = 0; c < b; ++c) rest -= factor_[k * a + c] * factor_[k * b + c];
        if (a == b && !(rest > 0)) return false;
        factor_[k * a + b] = a == b ? std::sqrt(rest) : rest / factor_[k * b + b];
      }
    }
    return true;
  }

  const PackageView& view_;
  const Reach& reach_;
  Refusal& refuse_;
  std::size_t index_ = 0;     // of the field
  std::uint32_t pieces_ = 0;  // whose free fields were seen
  std::array<std::uint64_t, 7> ends_ = {};
  std::span<const FieldFunction> functions_;
  std::vector<Lanes> norms_;
  std::vector<double> roots_;   // of the diagonal of tethers
  std::vector<double> factor_;  // of tethers
};

}  // namespace

bool checkFields(const PackageView& view, const Reach& reach, Refusal& refuse) {
  return FieldRules(view, reach, refuse).hold();
}

}  // namespace sinew::formats
