// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/field.h"

#include <tbb/parallel_invoke.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "runtime/geometry/symmetric_eigen.h"
#include "tools/field/answers.h"
#include "tools/field/cubature.h"
#include "tools/field/dense.h"
#include "tools/field/elastic.h"
#include "tools/field/modes.h"
#include "tools/field/residual.h"

namespace sinew::tools {
namespace field {
namespace {

using Eigen::MatrixX3d;

// Modes by function; each gives three scalar ones.
constexpr double kModesByFunction = 0.4;
// Weight of answers to loads at places, against modes as answers to loads of that size.
constexpr double kPlaceWeight = 5;
// Edges' patches touch twice as many vertices as tetrahedra: from so many on, the factor takes too long.
constexpr std::size_t kMostForEdges = 10000;
// Weight of answers to known loads and of what pin sets' motions leave, against modes: these are surely asked for.
constexpr double kKnownWeight = 10;
// Of the work that each known load does on the piece the space may lack so much, until it has so many functions.
constexpr double kKnownLack = 0.05;
constexpr Index kMostFunctions = 64;
// How near to the spectrum's own shape damping stays, against the modes' frequencies.
constexpr double kDampingTie = 0.003;

double hertz(double lambda) { return std::sqrt(std::max(0.0, lambda)) / (2 * std::numbers::pi); }

MatrixXd joined(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd result(a.rows(), a.cols() + b.cols());
  result << a, b;
  return result;
}

Index modeCount(const FieldOptions& options) {
  return std::max<Index>(4, Index(std::lround(kModesByFunction * double(options.functions))));
}

MatrixXd knownLoads(const FieldInput& input) {
  MatrixXd forces(3 * Index(input.positions.size()), Index(input.loads.size()));
  for (std::size_t l = 0; l < input.loads.size(); ++l) forces.col(Index(l)) = input.loads[l];
  return forces;
}

// Products of vector fields with functions, by axis: 3f x c -> 3k x c.
MatrixXd coordinates(const MatrixXd& functions, const MatrixXd& fields) {
  MatrixXd result(3 * functions.cols(), fields.cols());
  for (Index a = 0; a < 3; ++a)
    result(Eigen::seqN(a, functions.cols(), 3), Eigen::all) = innerProducts(functions, axisOf(fields, a));
  return result;
}

// Loads that surely act, and the piece's answers: 3f x c on nodes.
struct Known {
  MatrixXd forces, answers;

  VectorXd work() const { return forces.cwiseProduct(answers).colwise().sum().transpose(); }
};

// The first columns of `functions`: at least `count`, and as many as known loads take to do their work on the space.
// The Cholesky factor of the whole has those of all its leading parts.
// @param have other functions of the space; all n x ..
MatrixXd enough(const Elastic& elastic, const MatrixXd& have, const MatrixXd& functions, const Known& known,
                Index count) {
  if (known.forces.cols() == 0 || functions.cols() <= count) {
    return functions.leftCols(std::min(count, functions.cols()));
  }
  const MatrixXd nodes = nodeRows(elastic, joined(have, functions));
  MatrixXd stiffness = reducedStiffness(elastic, nodes);
  stiffness.diagonal().array() += 1e-9 * stiffness.diagonal().mean();
  MatrixXd met = coordinates(nodes, known.forces);
  DenseCholesky(std::move(stiffness)).solveLower(met);
  VectorXd lacks = known.work();
  const VectorXd least = kKnownLack * lacks;
  for (Index j = 0; j < nodes.cols(); ++j) {
    if (j >= have.cols() + count && (lacks.array() <= least.array()).all()) return functions.leftCols(j - have.cols());
    lacks -= met.middleRows<3>(3 * j).colwise().squaredNorm().transpose();
  }
  return functions;
}

// 1, X, Y, Z on vertices, M-orthonormal; less than four columns where the piece is flat. Each row is the monomials'
// times one matrix: an orthonormal basis over the roots of the masses would have its rounding divided by the root of a
// vertex's own, and cells thinner than that would not be at rest.
MatrixXd affine(const Elastic& elastic) {
  const VectorXd root = elastic.mass.cwiseSqrt();
  MatrixXd monomials = MatrixXd::Ones(elastic.mass.size(), 4);
  const Eigen::RowVector3d centre = (elastic.mass.transpose() * elastic.positions) / elastic.mass.sum();
  monomials.rightCols(3) = elastic.positions.rowwise() - centre;
  const double size = monomials.rightCols(3).cwiseAbs().maxCoeff();
  if (size > 0) monomials.rightCols(3) /= size;
  Eigen::ColPivHouseholderQR<MatrixXd> qr(root.asDiagonal() * monomials);
  qr.setThreshold(1e-13);
  MatrixXd values = (monomials * qr.colsPermutation()).leftCols(qr.rank());
  qr.matrixR()
      .topLeftCorner(qr.rank(), qr.rank())
      .triangularView<Eigen::Upper>()
      .solveInPlace<Eigen::OnTheRight>(values);
  DenseCholesky(innerProducts(values, elastic.mass, values)).divide(values);
  return values;
}

// Turns M-orthonormal functions so that they diagonalize K_s; stiffness ascends, the largest value is positive.
MatrixXd diagonalized(const Elastic& elastic, const MatrixXd& values, VectorXd& stiffness) {
  stiffness.resize(0);
  if (values.cols() == 0) return values;
  const MatrixXd nodes = nodeRows(elastic, values);
  const MatrixXd energy = innerProducts(nodes, product(elastic.scalar, nodes));
  const geometry::SymmetricEigen eigen = geometry::symmetricEigen(symmetric(energy));
  stiffness = eigen.values.cwiseMax(0.0);
  MatrixXd result = product(values, eigen.vectors);
  for (Index j = 0; j < result.cols(); ++j) {
    Index most = 0;
    result.col(j).cwiseAbs().maxCoeff(&most);
    if (result(most, j) < 0) result.col(j) *= -1;
  }
  return result;
}

// Adds the samples, the energy of which stands for that of all patches.
// @param loads those of the input or none, 3f x c on nodes
void addSamples(const Elastic& elastic, const FieldInput& input, const FieldOptions& options,
                const MatrixXd& orthonormal, const MatrixXd& loads, FieldSpace& space) {
  const MatrixXd nodes = nodeRows(elastic, space.values);
  const Index driven = space.driven_count;
  const MatrixXd met = coordinates(nodes.rightCols(nodes.cols() - driven), loads);
  const MatrixXd dual = space.values.transpose() * (elastic.mass.asDiagonal() * (space.values * orthonormal));
  const auto wanted = std::size_t(std::ceil(options.samples_per_function * double(space.values.cols())));
  const VectorXd reaches = Eigen::Map<const VectorXd>(input.reaches.data(), Index(input.reaches.size()));
  const Samples samples = chooseSamples(
      elastic, {nodes, orthonormal, dual, space.one, space.rest, driven, space.tethers, met, reaches}, wanted);
  space.least_eigenvalue = samples.least_eigenvalue;
  for (std::size_t s = 0; s < samples.patch.size(); ++s) {
    const Patch& patch = elastic.patches[samples.patch[s]];
    space.samples.push_back({patch.at, samples.volume[s], patch.mu, patch.lambda,
                             samples.gradients.middleRows<3>(3 * Index(s)).transpose(), patch.number});
  }
}

}  // namespace

MatrixXd sampledStiffness(const FieldSpace& space) {
  const Index k = space.values.cols() - space.driven_count, count = Index(space.samples.size());
  std::array<MatrixXd, 3> g;  // slopes along an axis: a row a sample
  VectorXd mu(count), lambda(count);
  g.fill(MatrixXd(count, k));
  for (Index i = 0; i < count; ++i) {
    const FieldSample& s = space.samples[std::size_t(i)];
    mu[i] = s.volume * s.mu;
    lambda[i] = s.volume * s.lambda;
    for (std::size_t a = 0; a < 3; ++a) g[a].row(i) = s.gradients.bottomRows(k).col(Index(a)).transpose();
  }
  MatrixXd result(3 * k, 3 * k), all_axes = MatrixXd::Zero(k, k);
  for (const MatrixXd& along : g) all_axes += innerProducts(along, mu, along);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      MatrixXd block = innerProducts(g[b], mu, g[a]);
      block += innerProducts(g[a], lambda, g[b]);
      if (a == b) block += all_axes;
      result(Eigen::seqN(Index(a), k, 3), Eigen::seqN(Index(b), k, 3)) = block;
    }
  }
  return result;
}

namespace {

// Of samples and tethers.
MatrixXd restStiffness(const FieldSpace& space) {
  MatrixXd result = sampledStiffness(space);
  const Index k = space.values.cols() - space.driven_count;
  for (Index a = 0; a < 3 && space.tethers.size() > 0; ++a)
    result(Eigen::seqN(a, k, 3), Eigen::seqN(a, k, 3)) += space.tethers.bottomRightCorner(k, k);
  return result;
}

geometry::SymmetricEigen restModes(const FieldSpace& space) { return geometry::symmetricEigen(restStiffness(space)); }

// Rms difference of the space's static answers from those of all patches, over their rms: one number a load.
// @param forces 3n x c
VectorXd staticErrors(const Elastic& elastic, const FieldSpace& space, const Answers& answers, const MatrixXd& forces) {
  const Index k = space.values.cols() - space.driven_count;
  const MatrixXd functions = space.values.rightCols(k), nodes = nodeRows(elastic, functions);
  const VectorXd mass = byAxis(elastic.node_mass);
  MatrixXd stiffness = restStiffness(space), loads = coordinates(functions, forces);
  // Rigid motions do not count: a stiff spring holds what the space has of them.
  if (answers.rigid().cols() > 0) {
    const MatrixXd rigid = coordinates(nodes, mass.asDiagonal() * answers.rigid());
    loads -= product(rigid, innerProducts(rigid, loads));
    stiffness += stiffness.diagonal().mean() * product(rigid, rigid.transpose());
  }
  const MatrixXd z = Eigen::LDLT<MatrixXd>(stiffness).solve(loads);
  const MatrixXd right = answers.to(onNodes(elastic, forces));
  VectorXd off = VectorXd::Zero(forces.cols()), size = off;
  for (Index a = 0; a < 3; ++a) {
    const MatrixXd u = axisOf(right, a);
    off += (product(nodes, axisOf(z, a)) - u).cwiseAbs2().transpose() * elastic.node_mass;
    size += u.cwiseAbs2().transpose() * elastic.node_mass;
  }
  return (size.array() > 0).select(off.array() / size.array(), 0.0).sqrt();
}

void addErrors(const Elastic& elastic, const Answers& answers, FieldSpace& space) {
  const VectorXd patches = staticErrors(elastic, space, answers, testLoads(elastic));
  space.static_error = std::sqrt(patches.squaredNorm() / double(patches.size()));
  if (answers.rigid().cols() > 0) return;
  space.gravity_error = staticErrors(elastic, space, answers, gravityLoads(elastic)).maxCoeff();
  space.static_error = std::max(space.static_error, space.gravity_error);
}

// The first of the space's modes that is none of a rigid body's.
Index firstElastic(const VectorXd& lambda, const FieldSpace& space) {
  Index first = 0;
  while (first < lambda.size() && !(hertz(lambda[first]) > 0.5 * space.lowest_hz)) ++first;
  return first;
}

// Decay by function, so that each mode of the space decays at its own frequency as well as such a table can: with s_ij
// the share of function j in the energy of mode i, sum_j s_ij d_j = f_i in least squares of relative errors, d >= 0,
// near c sqrt(w). The lowest mode is exact.
//
// @param modes restModes()
void addDamping(const geometry::SymmetricEigen& modes, FieldSpace& space) {
  space.damping_hz = VectorXd::Zero(space.values.cols());
  const Index k = space.values.cols() - space.driven_count;
  if (k == 0 || space.samples.empty()) return;
  const VectorXd shape = space.stiffness.tail(k).cwiseSqrt();
  const Index count = modes.values.size(), first = firstElastic(modes.values, space);
  if (first == count || !(space.lowest_hz > 0) || !(shape.maxCoeff() > 0)) return;
  MatrixXd rates(count - first, k);  // relative: of c sqrt(w)
  for (Index i = first; i < count; ++i) {
    for (Index j = 0; j < k; ++j) {
      rates(i - first, j) = modes.vectors.col(i).segment<3>(3 * j).squaredNorm() * shape[j] / hertz(modes.values[i]);
    }
  }
  const VectorXd sum = rates.rowwise().sum();
  const double scale = sum.sum() / sum.squaredNorm();
  rates *= scale;
  MatrixXd normal = innerProducts(rates, rates);
  const double tie = kDampingTie * normal.diagonal().mean();
  const VectorXd target = rates.colwise().sum().transpose().array() + tie;
  normal.diagonal().array() += tie;
  VectorXd d = VectorXd::Ones(k);
  for (int sweep = 0; sweep < 200; ++sweep) {
    for (Index j = 0; j < k; ++j) d[j] = std::max(0.0, d[j] + (target[j] - normal.col(j).dot(d)) / normal(j, j));
  }
  const double lowest = rates.row(0).dot(d);
  if (lowest > 0) space.damping_hz.tail(k) = scale / lowest * shape.cwiseProduct(d);
}

/// The free field's functions, and what the rest of it is made from.
struct FreeFunctions {
  FieldSpace space;
  std::optional<Answers> answers;
  Known known;
};

FreeFunctions freeFunctions(const Elastic& elastic, const FieldInput& input, const FieldOptions& options) {
  const std::vector<bool> none(std::size_t(elastic.nodes()), false);
  const Index k = Index(options.functions);
  FreeFunctions result;
  auto& [space, answers, known] = result;
  MatrixXd functions = affine(elastic);
  known.forces = MatrixXd(3 * elastic.nodes(), 0);
  if (!elastic.patches.empty()) {
    answers.emplace(elastic, none, modeCount(options));
    space.lowest_hz = hertz(answers->lowestLambda());
    // Where pin sets hold the piece its loads are for the held field.
    const bool held = std::any_of(input.held.begin(), input.held.end(), [](const auto& set) { return !set.empty(); });
    known.forces = onNodes(elastic, held ? MatrixXd(3 * elastic.mass.size(), 0) : knownLoads(input));
    known.answers = answers->to(known.forces);
    space.compliance = known.work();
    MatrixXd columns = MatrixXd::Identity(elastic.nodes(), elastic.nodes() > k ? 0 : elastic.nodes());
    if (elastic.nodes() > k) {
      columns = joined(answers->weighedModes(),
                       kPlaceWeight * answers->weighedAnswers(onNodes(elastic, placeLoads(elastic))));
      columns = splitByAxis(joined(columns, kKnownWeight * answers->equal(known.answers)));
    }
    const Index most = std::min(known.forces.cols() == 0 ? k : std::max(k, kMostFunctions), elastic.nodes());
    const MatrixXd all = leading(product(elastic.extend, columns), elastic.mass, functions, most - functions.cols());
    functions = joined(functions, enough(elastic, functions, all, known, k - functions.cols()));
  }
  space.values = diagonalized(elastic, functions, space.stiffness);
  space.one = space.values.transpose() * elastic.mass;
  space.rest = innerProducts(space.values, elastic.mass, elastic.positions);
  return result;
}

void complete(const Elastic& elastic, const FieldInput& input, const FieldOptions& options, FreeFunctions& free) {
  FieldSpace& space = free.space;
  const Index k = space.values.cols();
  tbb::parallel_invoke(
      [&] {
        addSamples(elastic, input, options, MatrixXd::Identity(k, k), free.known.forces, space);
        addDamping(restModes(space), space);
        if (free.answers) addErrors(elastic, *free.answers, space);
      },
      [&] {
        if (free.answers) addResidual(elastic, *free.answers, Index(options.residual_modes), space);
      });
}

// Which pin set holds what; sets without vertices do not count.
struct Holds {
  std::vector<std::uint32_t> sets;  // into FieldInput::held
  std::vector<Index> of_vertex;     // into sets, or -1
  std::vector<Index> of_node;
  std::vector<bool> fixed;  // nodes

  Holds(const Elastic& elastic, const FieldInput& input) : of_vertex(std::size_t(elastic.mass.size()), -1) {
    for (std::uint32_t p = 0; p < input.held.size(); ++p) {
      if (input.held[p].empty()) continue;
      for (const auto v : input.held[p]) of_vertex[v] = Index(sets.size());
      sets.push_back(p);
    }
    for (const auto v : elastic.vertex_of) {
      of_node.push_back(of_vertex[v]);
      fixed.push_back(of_node.back() >= 0);
    }
  }

  // Of FieldInput::held, among sets with vertices.
  Index placeOf(std::uint32_t set) const { return std::lower_bound(sets.begin(), sets.end(), set) - sets.begin(); }
};

double strengthOf(const FieldTether& tether, double scale) { return tether.strength + tether.absolute / scale; }

// 1 on one pin set, 0 on the others, harmonic under K_s between: f x sets, a partition of unity.
MatrixXd partition(const Elastic& elastic, const FieldInput& input, const Holds& holds, double scale) {
  MatrixXd result = MatrixXd::Zero(elastic.nodes(), Index(holds.sets.size()));
  if (result.cols() == 1) return MatrixXd::Ones(elastic.nodes(), 1);
  std::vector<int> place(holds.fixed.size(), -1);
  std::vector<Index> inner;
  for (std::size_t i = 0; i < holds.fixed.size(); ++i) {
    if (holds.fixed[i]) {
      result(Index(i), holds.of_node[i]) = 1;
    } else {
      place[i] = int(inner.size());
      inner.push_back(Index(i));
    }
  }
  if (!inner.empty()) {
    std::vector<Eigen::Triplet<double>> entries;
    // Nodes joined to no pin set take 0.
    const double regular = 1e-12 * elastic.scalar.diagonal().mean();
    for (std::size_t j = 0; j < inner.size(); ++j) {
      entries.emplace_back(int(j), int(j), regular);
      for (Sparse::InnerIterator it(elastic.scalar, inner[j]); it; ++it) {
        const int r = place[std::size_t(it.row())];
        if (r >= 0) entries.emplace_back(r, int(j), it.value());
      }
    }
    Sparse matrix(Index(inner.size()), Index(inner.size()));
    matrix.setFromTriplets(entries.begin(), entries.end());
    MatrixXd pull = -product(elastic.scalar, result);
    for (const FieldTether& tether : input.tethers) {
      for (decltype(elastic.extend)::InnerIterator it(elastic.extend, Index(tether.vertex)); it; ++it) {
        pull(it.col(), holds.placeOf(tether.held)) += it.value() * strengthOf(tether, scale);
      }
    }
    const MatrixXd inside = firmFactor(matrix)->solve(pull(inner, Eigen::all));
    result(inner, Eigen::all) = inside;
  }
  result.col(0) += (1 - result.rowwise().sum().array()).matrix();
  return result;
}

// w_p, w_p X, w_p Y, w_p Z of each pin set on vertices: n x 4 sets.
MatrixXd drivenFunctions(const Elastic& elastic, const Holds& holds, const MatrixXd& share, FieldSpace& space) {
  MatrixXd on_vertices = product(elastic.extend, share);
  for (Index v = 0; v < on_vertices.rows(); ++v) {
    const Index p = holds.of_vertex[std::size_t(v)];
    if (p >= 0) on_vertices.row(v) = Eigen::RowVectorXd::Unit(on_vertices.cols(), p);
  }
  MatrixXd result(on_vertices.rows(), 4 * on_vertices.cols());
  for (Index p = 0; p < on_vertices.cols(); ++p) {
    result.col(4 * p) = on_vertices.col(p);
    for (Index a = 0; a < 3; ++a) result.col(4 * p + 1 + a) = on_vertices.col(p).cwiseProduct(elastic.positions.col(a));
    for (std::uint32_t m = 0; m < 4; ++m) {
      space.pin_set.push_back(holds.sets[std::size_t(p)]);
      space.monomial.push_back(m);
    }
  }
  space.driven_count = std::uint32_t(result.cols());
  return result;
}

// Answers to what is known to act on a held piece: its loads, its weight and, where there are several pin sets, what an
// affine motion of one set leaves between the driven functions and the right answer.
Known knownAnswers(const Elastic& elastic, const FieldInput& input, const Holds& holds, const Answers& answers,
                   const MatrixXd& share, double scale) {
  MatrixXd forces = joined(onNodes(elastic, knownLoads(input)), onNodes(elastic, gravityLoads(elastic)));
  for (Index p = 1; p < share.cols(); ++p) {
    MatrixXd pulled = MatrixXd::Zero(3 * elastic.nodes(), 12);
    for (Index i = 0; i < elastic.nodes(); ++i) {
      const auto x = elastic.positions.row(elastic.vertex_of[std::size_t(i)]);
      for (Index a = 0; a < 3; ++a) {
        pulled(3 * i + a, 4 * a) = share(i, p);
        pulled.row(3 * i + a).segment<3>(4 * a + 1) = share(i, p) * x;
      }
    }
    pulled = -product(elastic.stiffness, pulled);
    for (const FieldTether& tether : input.tethers) {
      if (holds.placeOf(tether.held) != p) continue;
      const Eigen::RowVector4d monomials(1, elastic.positions(tether.vertex, 0), elastic.positions(tether.vertex, 1),
                                         elastic.positions(tether.vertex, 2));
      for (decltype(elastic.extend)::InnerIterator it(elastic.extend, Index(tether.vertex)); it; ++it) {
        const double strength = it.value() * strengthOf(tether, scale);
        for (Index a = 0; a < 3; ++a) pulled.row(3 * it.col() + a).segment<4>(4 * a) += strength * monomials;
      }
    }
    forces = joined(forces, pulled);
  }
  return {forces, answers.to(forces)};
}

// Motions with the pins fixed, as scalar columns on nodes: modes, and answers to loads; known ones of the same energy.
MatrixXd interiorColumns(const Elastic& elastic, const Answers& answers, const Known& known) {
  const VectorXd work = known.work();
  const VectorXd scale = (work.array() > 0).select(kKnownWeight * work.array().rsqrt(), 0.0);
  MatrixXd columns = joined(answers.weighedModes(), answers.weighedAnswers(onNodes(elastic, placeLoads(elastic))));
  const double lowest = answers.lowestLambda();
  if (lowest > 0) columns *= 1 / std::sqrt(lowest);
  return splitByAxis(joined(columns, known.answers * scale.asDiagonal()));
}

// Combinations of columns on nodes, those of most energy K_s first: in mass, what is left of a thin shell's answers
// would stretch it.
MatrixXd byEnergy(const Elastic& elastic, const MatrixXd& columns, Index count) {
  const geometry::SymmetricEigen gram =
      geometry::symmetricEigen(innerProducts(columns, product(elastic.scalar, columns)));
  const VectorXd& energy = gram.values;
  Index kept = 0;
  while (kept < std::min(count, energy.size()) && energy[energy.size() - 1 - kept] > 1e-11 * energy[energy.size() - 1])
    ++kept;
  return product(columns, gram.vectors.rightCols(kept).rowwise().reverse());
}

// Combinations of functions that are M-orthonormal; functions that others make up give none.
MatrixXd orthonormalCombinations(const MatrixXd& values, const VectorXd& mass) {
  VectorXd scale = (values.cwiseAbs2().transpose() * mass).cwiseSqrt();
  // X of a pin set at X = 0 is rounding alone: a combination of it would be noise times 1e16.
  scale = (scale.array() > 1e-12 * scale.maxCoeff()).select(scale.cwiseInverse(), 0.0).eval();
  const MatrixXd gram = scale.asDiagonal() * innerProducts(values, mass, values) * scale.asDiagonal();
  const geometry::SymmetricEigen eigen = geometry::symmetricEigen(gram);
  Index kept = 0;
  while (kept < gram.cols() && eigen.values[gram.cols() - 1 - kept] > 1e-10 * eigen.values[gram.cols() - 1]) ++kept;
  return scale.asDiagonal() * eigen.vectors.rightCols(kept) *
         eigen.values.tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
}

// Functions on nodes as such on vertices that are 0 on all pin sets.
MatrixXd vanishing(const Elastic& elastic, const Holds& holds, const MatrixXd& on_nodes) {
  MatrixXd result = product(elastic.extend, on_nodes);
  for (Index v = 0; v < result.rows(); ++v) {
    if (holds.of_vertex[std::size_t(v)] >= 0) result.row(v).setZero();
  }
  return result;
}

// Takes the interior functions' part out of the driven ones, which changes nothing on pin sets, and joins them.
void join(const Elastic& elastic, const MatrixXd& driven, const MatrixXd& interior, const VectorXd& stiffness,
          FieldSpace& space) {
  const Index outside = driven.cols(), inside = interior.cols(), all = outside + inside;
  space.values = driven;
  space.stiffness = VectorXd::Zero(all);
  space.one = VectorXd::Zero(all);
  space.rest = MatrixX3d::Zero(all, 3);
  for (Index p = 0; p < outside; p += 4) {
    space.one[p] = 1;
    space.rest.middleRows<3>(p + 1).setIdentity();
  }
  if (inside == 0) return;
  const MatrixXd weighted = elastic.mass.asDiagonal() * interior;
  space.values = joined(driven - product(interior, innerProducts(weighted, driven)), interior);
  space.stiffness.tail(inside) = stiffness;
  space.one.tail(inside) = weighted.colwise().sum().transpose();
  space.rest.bottomRows(inside) = innerProducts(weighted, elastic.positions);
}

// The piece without the patches that one pin set holds whole: they never strain. All of it where nothing else is left.
Elastic straining(const Elastic& elastic, const Holds& holds) {
  Elastic result = elastic;
  std::erase_if(result.patches, [&](const Patch& p) {
    const Index set = holds.of_node[elastic.node[p.first]];
    for (std::uint32_t i = p.first; i < p.first + p.count; ++i) {
      if (set < 0 || holds.of_node[elastic.node[i]] != set) return false;
    }
    return true;
  });
  if (result.patches.empty()) return elastic;
  if (result.patches.size() < elastic.patches.size()) addStiffness(result);
  return result;
}

// The piece with its tethers, their far ends fixed.
Elastic tethered(Elastic elastic, const FieldInput& input, double scale) {
  for (const FieldTether& tether : input.tethers) {
    for (decltype(elastic.extend)::InnerIterator it(elastic.extend, Index(tether.vertex)); it; ++it) {
      const double strength = it.value() * strengthOf(tether, scale);
      elastic.scalar.coeffRef(it.col(), it.col()) += strength;
      for (Index a = 0; a < 3; ++a) elastic.stiffness.coeffRef(3 * it.col() + a, 3 * it.col() + a) += strength;
    }
  }
  return elastic;
}

// Of each tether: how far its vertex is from where its set would hold it, phi_j - w_p {1, X, Y, Z}.
MatrixXd tetherEnergy(const Elastic& elastic, const FieldInput& input, const Holds& holds, const MatrixXd& values,
                      double scale) {
  MatrixXd result = MatrixXd::Zero(values.cols(), values.cols());
  for (const FieldTether& tether : input.tethers) {
    VectorXd row = values.row(tether.vertex);
    const Index first = 4 * holds.placeOf(tether.held);
    row[first] -= 1;
    row.segment<3>(first + 1) -= elastic.positions.row(tether.vertex).transpose();
    result.selfadjointView<Eigen::Lower>().rankUpdate(row, strengthOf(tether, scale));
  }
  return result.selfadjointView<Eigen::Lower>();
}

// Fixed interface (Craig and Bampton 1968): driven functions, and modes and answers with the pins fixed.
// @param scale what Young's moduli will be multiplied with
FieldSpace heldSpace(const Elastic& whole, const FieldInput& input, const FieldOptions& options, double scale) {
  const Holds holds(whole, input);
  const Elastic untethered = straining(whole, holds), elastic = tethered(untethered, input, scale);
  const MatrixXd share = partition(elastic, input, holds, scale);
  FieldSpace space;
  const MatrixXd driven = drivenFunctions(elastic, holds, share, space);
  const auto unheld = Index(std::count(holds.fixed.begin(), holds.fixed.end(), false));
  std::optional<Answers> answers;
  if (unheld > 0 && !elastic.patches.empty()) answers.emplace(elastic, holds.fixed, modeCount(options));
  MatrixXd interior(elastic.mass.size(), 0);
  VectorXd stiffness;
  Known known = {MatrixXd(3 * elastic.nodes(), 0), {}};
  if (answers) {
    space.lowest_hz = hertz(answers->lowestLambda());
    known = knownAnswers(elastic, input, holds, *answers, share, scale);
    space.compliance = known.work().head(Index(input.loads.size()));
    const Index k = Index(options.functions), most = input.loads.empty() ? k : std::max(k, kMostFunctions);
    if (unheld > k) {
      const MatrixXd columns = byEnergy(elastic, interiorColumns(elastic, *answers, known), std::min(most, unheld));
      const MatrixXd all = inOrder(vanishing(elastic, holds, columns), elastic.mass);
      interior = enough(elastic, interior, all, known, k);
    } else {
      const MatrixXd every = vanishing(elastic, holds, MatrixXd::Identity(elastic.nodes(), elastic.nodes()));
      interior = leading(every, elastic.mass, interior, unheld);
    }
    interior = diagonalized(elastic, interior, stiffness);
  }
  join(elastic, driven, interior, stiffness, space);
  if (!input.tethers.empty()) space.tethers = tetherEnergy(elastic, input, holds, space.values, scale);
  const MatrixXd loads = known.forces.leftCols(std::min(known.forces.cols(), Index(input.loads.size())));
  addSamples(untethered, input, options, orthonormalCombinations(space.values, elastic.mass), loads, space);
  addDamping(restModes(space), space);
  if (answers && interior.cols() > 0) addErrors(elastic, *answers, space);
  return space;
}

void scaleYoung(FieldSpace& space, double scale) {
  space.young_scale = scale;
  space.stiffness *= scale;
  space.lowest_hz *= std::sqrt(scale);
  space.damping_hz *= std::sqrt(scale);
  space.tethers *= scale;
  space.compliance /= scale;
  space.residual_modes /= std::sqrt(scale);
  space.residual_locals /= scale;
  for (FieldSample& s : space.samples) {
    s.mu *= scale;
    s.lambda *= scale;
  }
}

FieldElement elementOf(const FieldInput& input, const FieldOptions& options) {
  const bool edges = options.element == FieldElement::edges && input.positions.size() <= kMostForEdges;
  return edges ? FieldElement::edges : FieldElement::tetrahedra;
}

// The samples, tethers and what follows from them, of new materials. Values of all elements change in the ratio of the
// samples'. \param loads 3n x c
void reweigh(const Elastic& elastic, const FieldInput& input, const MatrixXd& loads, FieldSpace& space) {
  space.residual_modes.resize(0, 0);
  space.residual_locals.resize(0);
  const Index driven = space.driven_count, k = space.values.cols() - driven;
  const geometry::SymmetricEigen old = restModes(space);
  const Index first = firstElastic(old.values, space);
  VectorXd scalar_before = VectorXd::Zero(k), scalar = scalar_before;  // of the samples
  for (FieldSample& s : space.samples) {
    const VectorXd size2 = s.volume * s.gradients.bottomRows(k).rowwise().squaredNorm();
    scalar_before += (2 * s.mu + s.lambda) * size2;
    s.mu = elastic.patches[s.patch].mu;
    s.lambda = elastic.patches[s.patch].lambda;
    scalar += (2 * s.mu + s.lambda) * size2;
  }
  space.stiffness.tail(k).array() *= (scalar_before.array() > 0).select(scalar.array() / scalar_before.array(), 1.0);
  space.tethers.resize(0, 0);
  if (driven > 0 && !input.tethers.empty()) {
    space.tethers = tetherEnergy(elastic, input, Holds(elastic, input), space.values, space.young_scale);
  }
  if (first == old.values.size()) {  // nothing strains
    space.compliance.setZero(space.compliance.size() == 0 ? 0 : loads.cols());
    return;
  }
  const geometry::SymmetricEigen modes = restModes(space);
  space.lowest_hz *= std::sqrt(modes.values[first] / old.values[first]);
  const MatrixXd met = coordinates(space.values.rightCols(k), loads);
  const auto workOf = [&](const geometry::SymmetricEigen& of) {
    const Index count = of.values.size() - first;
    const MatrixXd along = innerProducts(of.vectors.rightCols(count), met);
    return VectorXd((of.values.tail(count).cwiseInverse().asDiagonal() * along.cwiseAbs2()).colwise().sum());
  };
  // Of each load, or where they are others than before of all together; 1 where the functions met nothing.
  const VectorXd before = workOf(old);
  const double all = before.sum() > 0 && space.compliance.size() > 0 ? space.compliance.mean() / before.mean() : 1;
  VectorXd share = VectorXd::Constant(before.size(), all);
  if (space.compliance.size() == before.size()) {
    share = (before.array() > 0).select(space.compliance.array() / before.array(), 1.0);
  }
  space.compliance = workOf(modes).cwiseProduct(share);
  addDamping(modes, space);
}

}  // namespace
}  // namespace field

Fields makeFields(const FieldInput& input, const FieldOptions& options) {
  Fields fields;
  if (input.positions.empty()) return fields;
  const field::Elastic elastic = field::assemble(input, field::elementOf(input, options));
  field::FreeFunctions free = field::freeFunctions(elastic, input, options);
  const bool held = std::any_of(input.held.begin(), input.held.end(), [](const auto& set) { return !set.empty(); });
  const bool scaled = options.lowest_hz > 0 && free.space.lowest_hz > 0;
  const double scale = scaled ? std::pow(options.lowest_hz / free.space.lowest_hz, 2) : 1;
  tbb::parallel_invoke([&] { field::complete(elastic, input, options, free); },
                       [&] {
                         if (held) fields.held = field::heldSpace(elastic, input, options, scale);
                       });
  fields.free = std::move(free.space);
  if (scaled) {
    field::scaleYoung(fields.free, scale);
    if (fields.held) field::scaleYoung(*fields.held, scale);
  }
  return fields;
}

Fields reweighed(const Fields& before, const FieldInput& input, const FieldOptions& options) {
  Fields fields = before;
  if (input.positions.empty()) return fields;
  const field::Elastic elastic = field::assemblePatches(input, field::elementOf(input, options));
  const Eigen::MatrixXd loads = field::knownLoads(input);
  fields.free.young_scale = 1;
  field::reweigh(elastic, input, fields.held ? loads.leftCols(0) : loads, fields.free);
  const bool scaled = options.lowest_hz > 0 && fields.free.lowest_hz > 0;
  const double scale = scaled ? std::pow(options.lowest_hz / fields.free.lowest_hz, 2) : 1;
  if (fields.held) {
    fields.held->young_scale = scale;
    field::reweigh(elastic, input, loads, *fields.held);
  }
  if (scaled) {
    field::scaleYoung(fields.free, scale);
    if (fields.held) field::scaleYoung(*fields.held, scale);
  }
  return fields;
}

}  // namespace sinew::tools
