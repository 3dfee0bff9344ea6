// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/field/field.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>

#include "tools/field/cubature.h"
#include "tools/field/elastic.h"
#include "tools/field/modes.h"

namespace sinew::tools {
namespace field {
namespace {
static double ENV(const char* n, double d) { const char* e = getenv(n); return e ? atof(e) : d; }

using Eigen::MatrixX3d;

// Modes by function: lower ones are split by axis and weighed by their compliance (docs/method.md).
constexpr double kModesByFunction = 0.4;
// Weight of an answer to a generic load against that of the lowest mode.
constexpr double kGenericWeight = 0.3;
// Weight of an answer to a load that is known.
constexpr double kKnownWeight = 1;
constexpr int kGenericPlaces = 10;
// Radius of a patch of generic load, of the piece's diagonal.
constexpr double kPatchRadius = 0.06;
// Below so much of the highest of the lowest modes an eigenvalue is a motion without resistance.
constexpr double kNoResistance = 1e-6;

struct Piece {
  Elastic elastic;
  double diagonal = 0;
  double shift = 0;  // 1/s^2: small against the elastic modes
};

MatrixXd onAxes(const Eigen::Ref<const MatrixXd>& motions) {  // 3f x m -> f x 3m
  MatrixXd result(motions.rows() / 3, 3 * motions.cols());
  for (Index j = 0; j < motions.cols(); ++j) {
    for (Index a = 0; a < 3; ++a) result.col(3 * j + a) = motions(Eigen::seqN(a, result.rows(), 3), j);
  }
  return result;
}

// Places spread over the surface: each the farthest from those before.
std::vector<std::uint32_t> farPlaces(const Elastic& elastic, int count) {
  std::vector<std::uint32_t> places;
  VectorXd distance = VectorXd::Constant(elastic.positions.rows(), 1e300);
  Eigen::RowVector3d from = (elastic.mass.transpose() * elastic.positions) / elastic.mass.sum();
  for (int p = 0; p < count && !elastic.surface.empty(); ++p) {
    std::uint32_t best = elastic.surface.front();
    for (const auto v : elastic.surface) {
      distance[v] = p == 1 ? (elastic.positions.row(v) - from).norm()
                           : std::min(distance[v], (elastic.positions.row(v) - from).norm());
      if (distance[v] > distance[best]) best = v;
    }
    places.push_back(best);
    from = elastic.positions.row(best);
  }
  return places;
}

// Forces of unit acceleration around places, along each axis: 3n x 3 places.
MatrixXd patchLoads(const Piece& piece, const std::vector<std::uint32_t>& places, double radius) {
  const Elastic& elastic = piece.elastic;
  MatrixXd forces = MatrixXd::Zero(3 * elastic.mass.size(), 3 * Index(places.size()));
  for (std::size_t p = 0; p < places.size(); ++p) {
    for (Index v = 0; v < elastic.mass.size(); ++v) {
      const double far = (elastic.positions.row(v) - elastic.positions.row(places[p])).norm() / (radius * piece.diagonal);
      for (Index a = 0; a < 3; ++a) forces(3 * v + a, 3 * Index(p) + a) = elastic.mass[v] * std::exp(-far * far);
    }
  }
  return forces;
}

// Forces on vertices as forces on nodes: extend^T by axis.
MatrixXd onNodes(const Elastic& elastic, const MatrixXd& forces) {
  MatrixXd result = MatrixXd::Zero(3 * elastic.nodes(), forces.cols());
  for (Index v = 0; v < elastic.mass.size(); ++v) {
    for (decltype(elastic.extend)::InnerIterator it(elastic.extend, v); it; ++it) {
      result.middleRows(3 * it.col(), 3) += it.value() * forces.middleRows(3 * v, 3);
    }
  }
  return result;
}

MatrixXd loadMatrix(const FieldInput& input) {
  MatrixXd forces(3 * Index(input.positions.size()), Index(input.loads.size()));
  for (std::size_t l = 0; l < input.loads.size(); ++l) forces.col(Index(l)) = input.loads[l];
  return forces;
}

// Columns scaled to one kinetic size, times a weight.
MatrixXd weighed(MatrixXd answers, const VectorXd& mass, double weight) {
  for (Index j = 0; j < answers.cols(); ++j) {
    const double size = std::sqrt((mass.array() * answers.col(j).array().square()).sum());
    answers.col(j) *= size > 0 ? weight / size : 0;
  }
  return answers;
}

// M-orthonormal basis of 1, X, Y, Z on vertices; less than 4 columns where the piece is flat.
MatrixXd affine(const Elastic& elastic) {
  MatrixXd monomials(elastic.mass.size(), 4);
  monomials.col(0).setOnes();
  const Eigen::RowVector3d centre = (elastic.mass.transpose() * elastic.positions) / elastic.mass.sum();
  monomials.rightCols(3) = elastic.positions.rowwise() - centre;
  monomials.rightCols(3) /= std::max(1e-300, monomials.rightCols(3).cwiseAbs().maxCoeff());
  return leading(monomials, elastic.mass, MatrixXd(monomials.rows(), 0), 4);
}

MatrixXd nodeRows(const Elastic& elastic, const MatrixXd& values) {
  MatrixXd result(elastic.nodes(), values.cols());
  for (Index i = 0; i < result.rows(); ++i) result.row(i) = values.row(elastic.vertex_of[std::size_t(i)]);
  return result;
}

// Turns M-orthonormal functions so that they diagonalize K_s; stiffness ascends.
MatrixXd diagonalized(const Elastic& elastic, const MatrixXd& values, VectorXd& stiffness) {
  const MatrixXd nodes = nodeRows(elastic, values);
  const MatrixXd energy = nodes.transpose() * (elastic.scalar * nodes);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(MatrixXd(0.5 * (energy + energy.transpose())));
  stiffness = eigen.eigenvalues().cwiseMax(0.0);
  MatrixXd result = values * eigen.eigenvectors();
  for (Index j = 0; j < result.cols(); ++j) {
    Index most = 0;
    result.col(j).cwiseAbs().maxCoeff(&most);
    if (result(most, j) < 0) result.col(j) *= -1;
  }
  return result;
}

Piece prepare(const FieldInput& input, const FieldOptions& options) {
  Piece piece{assemble(input, options.element), 0, 0};
  const Elastic& elastic = piece.elastic;
  piece.diagonal = (elastic.positions.colwise().maxCoeff() - elastic.positions.colwise().minCoeff()).norm();
  if (!elastic.patches.empty()) piece.shift = 1e-6 * elastic.stiffness.diagonal().sum() / (3 * elastic.node_mass.sum());
  return piece;
}

Index firstElastic(const Modes& modes) {
  Index first = 0;
  while (first < modes.lambda.size() && modes.lambda[first] <= kNoResistance * modes.lambda[modes.lambda.size() - 1]) ++first;
  return first;
}

struct Solved {
  std::unique_ptr<Solver> solver;
  Modes modes;
};

// The shift keeps the factor regular and must be small against the lowest elastic mode, which is not known before.
Solved solveModes(const Piece& piece, const std::vector<bool>& fixed, const MatrixXd& without, Index count) {
  Solved result;
  double shift = piece.shift;
  for (int round = 0; round < 3; ++round) {
    result.solver = std::make_unique<Solver>(piece.elastic, fixed, shift);
    result.modes = lowestModes(piece.elastic, *result.solver, fixed, without, count);
    const Index first = firstElastic(result.modes);
    if (first == result.modes.lambda.size() || shift < 0.2 * result.modes.lambda[first]) break;
    shift = 0.01 * result.modes.lambda[first];
  }
  return result;
}

double hertz(double lambda) { return std::sqrt(std::max(0.0, lambda)) / (2 * std::numbers::pi); }

// Modes times 1/lambda against the lowest elastic one, split by axis, on nodes.
MatrixXd weighedModes(const Modes& modes) {
  const Index first = std::min(firstElastic(modes), modes.lambda.size() - 1);
  MatrixXd scaled = modes.vectors;
  for (Index j = 0; j < scaled.cols(); ++j) scaled.col(j) *= modes.lambda[first] / std::max(modes.lambda[j], modes.lambda[first]);
  return onAxes(scaled);
}

MatrixXd joined(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd result(a.rows(), a.cols() + b.cols());
  result << a, b;
  return result;
}

// Static answers in a space of functions against the answers of all elements: rms of the difference over rms.
// @param answers 3f x c, what is right @param forces 3n x c
VectorXd staticErrors(const Piece& piece, const FieldSpace& space, Index first, const MatrixXd& forces,
                      const MatrixXd& answers, const MatrixXd& without) {
  const Index k = space.values.cols() - first, f = piece.elastic.nodes();
  MatrixXd hessian = MatrixXd::Zero(3 * k, 3 * k);
  for (const FieldSample& s : space.samples) {
    const MatrixX3d g = s.gradients.bottomRows(k);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        MatrixXd block = s.volume * (s.mu * g.col(b) * g.col(a).transpose() + s.lambda * g.col(a) * g.col(b).transpose());
        if (a == b) block += s.volume * s.mu * g * g.transpose();
        hessian(Eigen::seqN(a, k, 3), Eigen::seqN(b, k, 3)) += block;
      }
    }
  }
  const MatrixXd phi = space.values.rightCols(k), nodes = nodeRows(piece.elastic, phi);
  const VectorXd mass = byAxis(piece.elastic.node_mass);
  MatrixXd loads(3 * k, forces.cols());
  for (Index a = 0; a < 3; ++a) {
    loads(Eigen::seqN(a, k, 3), Eigen::all) =
        phi.transpose() * axisOf(forces, a);
  }
  // Rigid motions are left out: a stiff spring on what the space has of them.
  MatrixXd rigid(3 * k, without.cols());
  for (Index a = 0; a < 3; ++a) {
    rigid(Eigen::seqN(a, k, 3), Eigen::all) =
        nodes.transpose() * piece.elastic.node_mass.asDiagonal() * axisOf(without, a);
  }
  loads -= rigid * (rigid.transpose() * loads);
  hessian += hessian.diagonal().mean() * rigid * rigid.transpose();
  const MatrixXd z = Eigen::LDLT<MatrixXd>(hessian).solve(loads);
  VectorXd errors(forces.cols());
  MatrixXd moved(3 * f, forces.cols());
  for (Index a = 0; a < 3; ++a) moved(Eigen::seqN(a, f, 3), Eigen::all) = nodes * axisOf(z, a);
  const MatrixXd off = moved - answers;
  for (Index c = 0; c < errors.size(); ++c) {
    const double size = (mass.array() * answers.col(c).array().square()).sum();
    errors[c] = size > 0 ? std::sqrt((mass.array() * off.col(c).array().square()).sum() / size) : 0;
  }
  return errors;
}

// Loads that no function was made for: on patches of a quarter of the diagonal around random places of the surface.
MatrixXd testLoads(const Piece& piece) {
  Random random(7);
  constexpr int kLoads = 8;
  std::vector<std::uint32_t> places;
  MatrixXd forces(3 * piece.elastic.mass.size(), kLoads);
  for (int l = 0; l < kLoads; ++l) {
    const auto& surface = piece.elastic.surface;
    const auto place = surface[std::size_t(random.below(surface.size()))];
    const Vector3d direction = Vector3d(random.unit(), random.unit(), random.unit()).normalized();
    forces.col(l) = patchLoads(piece, {place}, 0.25) * direction;
  }
  return forces;
}

// Samples of a space that is finished otherwise; the whole rest Hessian is checked.
void addSamples(const Piece& piece, const FieldOptions& options, const MatrixXd& orthonormal, FieldSpace& space) {
  const MatrixXd nodes = nodeRows(piece.elastic, space.values);
  const auto wanted = std::size_t(std::ceil(options.samples_per_function * double(space.values.cols())));
  const Cubature cubature = chooseSamples(piece.elastic, nodes, orthonormal, space.rest, space.driven_count, wanted);
  space.least_eigenvalue = cubature.least_eigenvalue;
  for (std::size_t s = 0; s < cubature.patch.size(); ++s) {
    const Patch& patch = piece.elastic.patches[cubature.patch[s]];
    FieldSample sample;
    sample.at = patch.at;
    sample.volume = cubature.volume[s];
    sample.mu = patch.mu;
    sample.lambda = patch.lambda;
    sample.gradients = gradientsOf(piece.elastic, nodes, cubature.patch[s], 1).transpose();
    space.samples.push_back(std::move(sample));
  }
}

// Decay by function: c sqrt(w), c so that the lowest mode decays at its own frequency.
void addDamping(const Modes& modes, const Piece& piece, FieldSpace& space) {
  const Index k = space.values.cols();
  space.damping_hz = VectorXd::Zero(k);
  const Index first = firstElastic(modes);
  if (first >= modes.lambda.size()) return;
  const MatrixXd nodes = nodeRows(piece.elastic, space.values);
  const MatrixXd mode = onAxes(modes.vectors.col(first));
  const MatrixXd shares = nodes.transpose() * piece.elastic.node_mass.asDiagonal() * mode;
  const VectorXd energy = shares.rowwise().squaredNorm() / shares.squaredNorm();
  VectorXd rate = space.stiffness.cwiseSqrt();
  const double lowest = energy.dot(rate);
  if (lowest > 0) space.damping_hz = rate * hertz(modes.lambda[first]) / lowest;
}

void scaleYoung(FieldSpace& space, double scale) {
  space.young_scale = scale;
  space.stiffness *= scale;
  space.lowest_hz *= std::sqrt(scale);
  space.damping_hz *= std::sqrt(scale);
  for (FieldSample& s : space.samples) s.mu *= scale, s.lambda *= scale;
}

FieldSpace freeSpace(const Piece& piece, const FieldInput& input, const FieldOptions& options) {
  const Elastic& elastic = piece.elastic;
  const Index k = Index(options.functions), n = elastic.mass.size();
  FieldSpace space;
  const MatrixXd low = affine(elastic);
  const MatrixXd rigid = rigidMotions(elastic);
  const std::vector<bool> none(std::size_t(elastic.nodes()), false);
  Modes modes{MatrixXd(3 * elastic.nodes(), 0), VectorXd()};
  MatrixXd test, answers;
  MatrixXd functions = low;
  const VectorXd mass = byAxis(elastic.node_mass);
  if (!elastic.patches.empty()) {
    const Index wanted = std::max<Index>(4, Index(std::lround(ENV("RATIO",kModesByFunction) * double(k))));
    const Solved solved = solveModes(piece, none, rigid, wanted);
    const Solver& solver = *solved.solver;
    modes = solved.modes;
    // Inertia relief: a free body answers to a force without its rigid part; two refinements take the shift out.
    const auto answer = [&](const MatrixXd& forces) {
      MatrixXd f = onNodes(elastic, forces);
      f -= (mass.asDiagonal() * (rigid * (rigid.transpose() * f))).eval();
      MatrixXd u = solver.solve(f);
      for (int i = 0; i < 2; ++i) u += solver.solve(f - elastic.stiffness * u);
      u -= (rigid * (rigid.transpose() * (mass.asDiagonal() * u))).eval();
      return u;
    };
    if (elastic.nodes() > k) {
      MatrixXd loads = patchLoads(piece, farPlaces(elastic, int(ENV("PLACES",kGenericPlaces))), ENV("RADIUS",kPatchRadius));
      if (ENV("MONO", 0) > 0) {
        const auto places = farPlaces(elastic, int(ENV("PLACES", kGenericPlaces)));
        MatrixXd more(loads.rows(), 4 * loads.cols());
        for (Index p = 0; p < Index(places.size()); ++p) for (Index m = 0; m < 4; ++m) for (Index a = 0; a < 3; ++a) for (Index v = 0; v < n; ++v) for (Index b = 0; b < 3; ++b)
          more(3 * v + b, 12 * p + 3 * m + a) = loads(3 * v + b, 3 * p + a) * (m == 0 ? 1 : ENV("MONO", 1) * (elastic.positions(v, m - 1) - elastic.positions(places[std::size_t(p)], m - 1)) / (ENV("RADIUS", kPatchRadius) * piece.diagonal));
        loads = more;
      }
      if (ENV("NAT", 0) > 0) {
        const VectorXd im = byAxis(elastic.mass).cwiseSqrt().cwiseInverse();
        for (Index c = 0; c < loads.cols(); ++c) loads.col(c) /= (im.asDiagonal() * loads.col(c)).norm();
      }
      MatrixXd generic = answer(loads);
      const MatrixXd known = answer(loadMatrix(input));
      MatrixXd columns = weighedModes(modes);
      columns = joined(columns, onAxes(ENV("NAT", 0) > 0 ? MatrixXd(generic * (modes.lambda[0] * ENV("GEN", 1))) : weighed(generic, mass, ENV("GEN",kGenericWeight))));
      columns = joined(columns, onAxes(weighed(known, mass, kKnownWeight)));
      functions = joined(low, leading(elastic.extend * columns, elastic.mass, low, k - low.cols()));
    } else {
      const MatrixXd every = elastic.extend * MatrixXd::Identity(elastic.nodes(), elastic.nodes());
      functions = joined(low, leading(every, elastic.mass, low, elastic.nodes() - low.cols()));
    }
    test = testLoads(piece);
    answers = answer(test);
  }
  space.values = diagonalized(elastic, functions, space.stiffness);
  space.one = space.values.transpose() * elastic.mass;
  space.rest = space.values.transpose() * elastic.mass.asDiagonal() * elastic.positions;
  addSamples(piece, options, MatrixXd::Identity(space.values.cols(), space.values.cols()), space);
  addDamping(modes, piece, space);
  const Index first = firstElastic(modes);
  if (first < modes.lambda.size()) space.lowest_hz = hertz(modes.lambda[first]);
  if (test.cols() > 0) space.static_error = std::sqrt(staticErrors(piece, space, 0, test, answers, rigid).squaredNorm() / double(test.cols()));
  (void)n;
  return space;
}

// 1 on one pin set, 0 on the others, harmonic under K_s between: f x sets, a partition of unity.
MatrixXd partition(const Elastic& elastic, const std::vector<int>& set_of, Index sets) {
  const Index f = elastic.nodes();
  MatrixXd result = MatrixXd::Zero(f, sets);
  std::vector<Index> place(std::size_t(f), -1), inner;
  for (Index i = 0; i < f; ++i) {
    if (set_of[std::size_t(i)] >= 0) {
      result(i, set_of[std::size_t(i)]) = 1;
    } else {
      place[std::size_t(i)] = Index(inner.size());
      inner.push_back(i);
    }
  }
  std::vector<Eigen::Triplet<double>> entries;
  const double regular = 1e-12 * elastic.scalar.diagonal().mean();
  for (const Index j : inner) {
    for (Sparse::InnerIterator it(elastic.scalar, j); it; ++it) {
      const Index r = place[std::size_t(it.row())];
      if (r >= 0) entries.emplace_back(int(r), int(place[std::size_t(j)]), it.value() + (it.row() == j ? regular : 0));
    }
  }
  Sparse matrix(Index(inner.size()), Index(inner.size()));
  matrix.setFromTriplets(entries.begin(), entries.end());
  const MatrixXd pull = -(elastic.scalar * result);
  MatrixXd right(Index(inner.size()), sets);
  for (std::size_t i = 0; i < inner.size(); ++i) right.row(Index(i)) = pull.row(inner[i]);
  const Eigen::SimplicialLDLT<Sparse> factor(matrix);
  const MatrixXd inside = factor.solve(right);
  for (std::size_t i = 0; i < inner.size(); ++i) result.row(inner[i]) = inside.row(Index(i));
  result.col(0) += (1 - result.rowwise().sum().array()).matrix();
  return result;
}

FieldSpace heldSpace(const Piece& piece, const FieldInput& input, const FieldOptions& options) {
  const Elastic& elastic = piece.elastic;
  const Index n = elastic.mass.size(), f = elastic.nodes(), k = Index(options.functions);
  FieldSpace space;
  // Which set holds what.
  std::vector<int> vertex_set(std::size_t(n), -1), node_set(std::size_t(f), -1);
  std::vector<std::uint32_t> sets;
  for (std::uint32_t p = 0; p < input.held.size(); ++p) {
    if (input.held[p].empty()) continue;
    for (const auto v : input.held[p]) vertex_set[v] = int(sets.size());
    sets.push_back(p);
  }
  std::vector<bool> fixed(std::size_t(f), false);
  for (Index i = 0; i < f; ++i) {
    node_set[std::size_t(i)] = vertex_set[elastic.vertex_of[std::size_t(i)]];
    fixed[std::size_t(i)] = node_set[std::size_t(i)] >= 0;
  }
  const auto set_count = Index(sets.size());
  MatrixXd share = MatrixXd::Ones(f, 1);
  if (set_count > 1) share = partition(elastic, node_set, set_count);
  MatrixXd on_vertices = elastic.extend * share;
  for (Index v = 0; v < n; ++v) {
    if (vertex_set[std::size_t(v)] < 0) continue;
    on_vertices.row(v).setZero();
    on_vertices(v, vertex_set[std::size_t(v)]) = 1;
  }
  MatrixXd driven(n, 4 * set_count);
  for (Index p = 0; p < set_count; ++p) {
    driven.col(4 * p) = on_vertices.col(p);
    for (Index a = 0; a < 3; ++a) driven.col(4 * p + 1 + a) = on_vertices.col(p).cwiseProduct(elastic.positions.col(a));
    for (std::uint32_t m = 0; m < 4; ++m) {
      space.pin_set.push_back(sets[std::size_t(p)]);
      space.monomial.push_back(m);
    }
  }
  space.driven_count = std::uint32_t(driven.cols());
  const auto inside = [&](const MatrixXd& on_nodes) {
    MatrixXd values = elastic.extend * on_nodes;
    for (Index v = 0; v < n; ++v) {
      if (vertex_set[std::size_t(v)] >= 0) values.row(v).setZero();
    }
    return values;
  };
  MatrixXd interior(n, 0), answers;
  Modes modes{MatrixXd(3 * f, 0), VectorXd()};
  const VectorXd mass = byAxis(elastic.node_mass);
  MatrixXd gravity(3 * n, 3);
  for (Index v = 0; v < n; ++v) gravity.middleRows(3 * v, 3) = elastic.mass[v] * Eigen::Matrix3d::Identity();
  const Index unheld = Index(std::count(fixed.begin(), fixed.end(), false));
  if (unheld > 0 && !elastic.patches.empty()) {
    const Index wanted = std::max<Index>(4, Index(std::lround(ENV("RATIO",kModesByFunction) * double(k))));
    const Solved solved = solveModes(piece, fixed, MatrixXd(3 * f, 0), wanted);
    const Solver& solver = *solved.solver;
    modes = solved.modes;
    const VectorXd movable = byAxis(VectorXd::NullaryExpr(f, [&](Index i) { return fixed[std::size_t(i)] ? 0.0 : 1.0; }));
    const auto answer = [&](const MatrixXd& forces) {
      MatrixXd u = solver.solve(forces);
      for (int i = 0; i < 2; ++i) u += solver.solve(forces - movable.asDiagonal() * (elastic.stiffness * u));
      return u;
    };
    answers = answer(onNodes(elastic, gravity));
    if (unheld > k) {
      MatrixXd columns = weighedModes(modes);
      columns = joined(columns, onAxes(weighed(answers, mass, 1)));
      columns = joined(columns, onAxes(weighed(answer(onNodes(elastic, loadMatrix(input))), mass, kKnownWeight)));
      if (set_count > 1) {
        MatrixXd pulled(3 * f, 6 * (set_count - 1));
        const MatrixXd rigid = rigidMotions(elastic);
        for (Index p = 1; p < set_count; ++p) pulled.middleCols(6 * (p - 1), rigid.cols()) = byAxis(share.col(p)).asDiagonal() * rigid;
        columns = joined(columns, onAxes(weighed(answer(-(elastic.stiffness * pulled)), mass, 1)));
      }
      interior = leading(inside(columns), elastic.mass, interior, k);
    } else {
      interior = leading(inside(MatrixXd::Identity(f, f)), elastic.mass, interior, unheld);
    }
  }
  VectorXd stiffness;
  interior = diagonalized(elastic, interior, stiffness);
  const MatrixXd weighted = elastic.mass.asDiagonal() * interior;
  space.values = joined(driven - interior * (weighted.transpose() * driven), interior);
  space.stiffness = VectorXd::Zero(space.values.cols());
  space.stiffness.tail(interior.cols()) = stiffness;
  space.one = VectorXd::Zero(space.values.cols());
  space.rest = MatrixX3d::Zero(space.values.cols(), 3);
  for (Index p = 0; p < set_count; ++p) {
    space.one[4 * p] = 1;
    space.rest.middleRows(4 * p + 1, 3).setIdentity();
  }
  space.one.tail(interior.cols()) = weighted.transpose() * VectorXd::Ones(n);
  space.rest.bottomRows(interior.cols()) = weighted.transpose() * elastic.positions;
  // Orthonormal combinations of all functions, for the fit.
  const Eigen::SelfAdjointEigenSolver<MatrixXd> gram(MatrixXd(space.values.transpose() * elastic.mass.asDiagonal() * space.values));
  const Index all = gram.eigenvalues().size();
  Index kept = 0;
  while (kept < all && gram.eigenvalues()[all - 1 - kept] > 1e-10 * gram.eigenvalues()[all - 1]) ++kept;
  const MatrixXd orthonormal = gram.eigenvectors().rightCols(kept) * gram.eigenvalues().tail(kept).cwiseSqrt().cwiseInverse().asDiagonal();
  addSamples(piece, options, orthonormal, space);
  addDamping(modes, piece, space);
  space.damping_hz.head(space.driven_count).setZero();
  const Index first = firstElastic(modes);
  if (first < modes.lambda.size()) space.lowest_hz = hertz(modes.lambda[first]);
  if (answers.cols() > 0 && interior.cols() > 0) {
    space.gravity_error = staticErrors(piece, space, space.driven_count, gravity, answers, MatrixXd(3 * f, 0)).maxCoeff();
    space.static_error = space.gravity_error;
  }
  return space;
}

}  // namespace
}  // namespace field

Fields makeFields(const FieldInput& input, const FieldOptions& options) {
  const field::Piece piece = field::prepare(input, options);
  Fields fields;
  fields.free = field::freeSpace(piece, input, options);
  const bool held = std::any_of(input.held.begin(), input.held.end(), [](const auto& set) { return !set.empty(); });
  if (held) fields.held = field::heldSpace(piece, input, options);
  if (options.lowest_hz > 0 && fields.free.lowest_hz > 0) {
    const double scale = std::pow(options.lowest_hz / fields.free.lowest_hz, 2);
    field::scaleYoung(fields.free, scale);
    if (fields.held) field::scaleYoung(*fields.held, scale);
  }
  return fields;
}

}  // namespace sinew::tools
