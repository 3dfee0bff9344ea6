// SPDX-License-Identifier: MIT
#include "runtime/solver/minimize.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "runtime/kernels/friction.h"
#include "runtime/solver/for_each.h"
#include "runtime/solver/rigid_coupling.h"

namespace sinew::internal {
namespace {

/// Times that a step is cut before the matrix of the shape at hand is made: that costs as much as ten tries.
constexpr std::uint32_t kCuts = 2;
/// Pairs of an island, beside those of its pieces: its vectors are long.
constexpr std::uint32_t kPairs = 3;
/// A direction shorter than this part of the way from the prediction changes nothing that can be seen.
constexpr double kSettled = 1e-3;
/// The same where springs alone hold a piece, whose momentum nothing puts right: what is left over in each step is as
/// large a part of gravity for the whole of a swing.
constexpr double kSettledHeld = 1e-4;
/// Of the inertia m d / h^2, d the way from the prediction: the force that contacts may leave over on the whole. Firm
/// ones, kappa h^2 / m of which may be thousands, have all of their load and friction on a way shorter than kSettled d.
constexpr double kBalanced = 1e-2;
/// Rounding of shapes in floats, of their size.
constexpr double kRounding = 3e-7;
/// Squared frequencies of most elastic modes are below this times the lowest one's.
constexpr double kRough = 30;
/// Part of what the slope promises that a step must bring (Armijo's condition).
constexpr double kSufficient = 1e-4;
/// Rounding of energies that are sums of floats, relative.
constexpr double kEnergyNoise = 4e-6;
/// Of Coulomb's bound, sum kappa |u| <= sum mu_f N (docs/method.md §4): what slid in the last step begins at it, but
/// for what loads have changed since.
constexpr float kAtBound = 0.99F;

using Four = Eigen::Array4f;

/// Functions of a field whose lanes, 24 floats each, and places are on the stack: what one piece after the other uses
/// stays in the cache.
constexpr std::uint32_t kOnStack = 64;

}  // namespace

MinimizeScratch::MinimizeScratch(std::pmr::memory_resource* memory)
    : base(memory),
      offset(memory),
      shape(memory),
      x(memory),
      d(memory),
      old(memory),
      next(memory),
      gradient(memory),
      next_gradient(memory),
      direction(memory),
      residual(memory),
      springs(memory),
      pairs(kPairs, memory),
      rigid(memory),
      lanes(memory),
      parts(memory),
      quaternions(memory),
      squeezed(memory),
      samples(memory),
      holds(memory),
      contacts(memory),
      rows(memory),
      prediction(memory),
      predicted_velocity(memory),
      external(memory),
      forces(memory),
      spinning(memory),
      tumbling(memory) {}

void MinimizeScratch::reserve(const Field& field, std::size_t contact_count) {
  const auto grow = [](auto& array, std::size_t count) {
    if (array.size() < count) array.resize(count);
  };
  const std::size_t k = field.k;
  grow(x, 4 * k + 8);
  for (Array<float>* array : {&base, &offset, &shape, &d, &old, &next, &gradient, &next_gradient, &direction, &residual,
                              &spinning, &tumbling}) {
    grow(*array, 4 * k);
  }
  grow(springs, k * k);
  grow(lanes, 24 * k);
  grow(parts, 3 * k + 8);
  grow(quaternions, 32 * std::size_t(field.pack_count));
  grow(squeezed, 8 * std::size_t(field.pack_count));
  grow(samples, kStiffnessScratch * std::size_t(field.pack_count));
  rigid.reserve(1, 0);
  contacts.reserve(contact_count);
  grow(rows, contact_count * k);
  for (Array<Vector3d>* array : {&prediction, &predicted_velocity, &external, &forces}) grow(*array, k);
}

void MinimizeScratch::reserveVectors(std::size_t size) {
  for (Array<float>* array : {&base, &d, &next, &gradient, &next_gradient, &direction}) {
    if (array->size() < size) array->resize(size);
  }
  pairs.reserve(size);
}

namespace {

Eigen::Vector3f slideOf(const Push& push) { return push.slide + (push.way - push.normal.dot(push.way) * push.normal); }

/// Force of friction under a load.
PushForce rubForce(const Push& push, float load) {
  const Eigen::Vector3f slide = slideOf(push);
  const auto rub = baseline::rubOf(double(push.kappa), double(push.friction), double(slide.norm()), double(load));
  return {float(rub.scale) * slide, rub.energy};
}

float loadOf(const Push& push) { return push.kappa * std::max(0.0F, -gapOf(push)); }

/// Friction takes the load at the push's way. \return change of its force: none where it sticks
/// under both.
PushForce pressAnew(Push& push) {
  const float load = loadOf(push), before = std::exchange(push.pressed, load);
  if (!(load > 0) || push.kappa * slideOf(push).norm() <= push.friction * std::min(before, load)) return {};
  PushForce change = rubForce(push, load);
  const PushForce old = rubForce(push, before);
  change.pull -= old.pull;
  change.energy -= old.energy;
  return change;
}

void addTo(float* rows, const float* row, const Four& pull, std::uint32_t k) {
  for (std::uint32_t j = 0; j < k; ++j) Four::Map(rows + 4 * j) += row[j] * pull;
}

Four padded(const Eigen::Vector3f& v) { return {v[0], v[1], v[2], 0}; }

}  // namespace

PushForce pushForce(const Push& push) {
  const float gap = gapOf(push);
  if (!(gap < 0)) return {};
  PushForce force = rubForce(push, push.pressed);
  force.pull += push.kappa * gap * push.normal;
  force.energy += 0.5 * double(push.kappa) * double(gap) * double(gap);
  return force;
}

void damp(Push& push, double c, double h, const Eigen::Vector3f& before) {
  const double kappa = double(push.kappa) + c / h;
  push.lag = float(c / (h * kappa)) * before;
  push.kappa = float(kappa);
  const float along = push.normal.dot(push.lag);
  push.gap -= along;
  push.slide -= push.lag - along * push.normal;
}

// Their pull at the prediction is in scratch.residual.
double Objective::held(const float* d, float* gradient) const {
  const std::uint32_t k = field->k, stride = field->stride;
  const float* const r = holds_rotation.data();
  float *const local = scratch->x.data(), *const pull = scratch->parts.data();
  for (std::uint32_t j = 0; j < k; ++j) {
    for (std::uint32_t c = 0; c < 3; ++c) {
      local[3 * j + c] = r[3 * c] * d[4 * j] + (r[3 * c + 1] * d[4 * j + 1] + r[3 * c + 2] * d[4 * j + 2]);
    }
  }
  std::fill(local + field->unknowns(), local + stride, 0.0F);
  // Four rows at once, as in symmetric().
  double total = 0;
  const std::uint32_t n = field->unknowns();
  for (std::uint32_t first = 0; first < n; first += 4) {
    std::array<Four, 4> sum;
    sum.fill(Four::Zero());
    const std::uint32_t count = std::min(4U, n - first);
    for (std::uint32_t j = 0; j < stride; j += 4) {
      const Four way = Four::Map(local + j);
      for (std::uint32_t row = 0; row < 4; ++row) {
        sum[row] += Four::Map(holds + std::size_t(stride) * (first + std::min(row, count - 1)) + j) * way;
      }
    }
    for (std::uint32_t row = 0; row < count; ++row) {
      pull[first + row] = stiffness * ((sum[row][0] + sum[row][1]) + (sum[row][2] + sum[row][3]));
      total += double(local[first + row]) * double(pull[first + row]);
    }
  }
  for (std::uint32_t j = 0; gradient != nullptr && j < k; ++j) {
    const float* const p = pull + 3 * j;
    for (std::uint32_t c = 0; c < 3; ++c) gradient[4 * j + c] += r[c] * p[0] + (r[3 + c] * p[1] + r[6 + c] * p[2]);
  }
  return 0.5 * total;
}

namespace {

// d . residual + 1/2 sum M_ij d_i . d_j and its gradient, of the rows from `first` on.
// \param matrix symmetric, k x k. \param residual, d, gradient k x 4; gradient may be null
double symmetric(const float* matrix, const float* residual, const float* d, std::uint32_t k, std::uint32_t first,
                 float* gradient) {
  double total = 0;
  // Four rows at once: a row alone waits for its own sums.
  constexpr std::uint32_t kRows = 4;
  for (; first < k; first += kRows) {
    const std::uint32_t count = std::min(kRows, k - first);
    const float* row[kRows];
    for (std::uint32_t r = 0; r < kRows; ++r) row[r] = matrix + std::size_t(k) * (first + std::min(r, count - 1));
    Four pull0 = Four::Zero(), pull1 = pull0, pull2 = pull0, pull3 = pull0;
    for (std::uint32_t i = 0; i < k; ++i) {
      const Four way = Four::Map(d + 4 * i);
      pull0 += row[0][i] * way;
      pull1 += row[1][i] * way;
      pull2 += row[2][i] * way;
      pull3 += row[3][i] * way;
    }
    const std::array<Four, kRows> pull = {pull0, pull1, pull2, pull3};
    for (std::uint32_t r = 0; r < count; ++r) {
      const std::uint32_t j = first + r;
      for (std::uint32_t c = 0; c < 3; ++c) {
        total += double(d[4 * j + c]) * double(residual[4 * j + c] + 0.5F * pull[r][c]);
        if (gradient != nullptr) gradient[4 * j + c] += residual[4 * j + c] + pull[r][c];
      }
    }
  }
  return total;
}

}  // namespace

double Objective::external(const float* d, float* gradient) const {
  const std::uint32_t k = field->k;
  double total = 0;
  if (has_springs) {
    total += symmetric(scratch->springs.data(), scratch->residual.data(), d, k, field->driven, gradient);
  }
  if (holds != nullptr) total += held(d, gradient);
  const std::uint32_t driven = field->driven;
  for (Contact& contact : scratch->contacts) {
    contact.way = wayOf(contact.phi, d);
    const PushForce force = pushForce(contact);
    total += force.energy;
    if (gradient == nullptr || force.pull.isZero(0)) continue;
    addTo(gradient + 4 * driven, contact.phi + driven, padded(rotation.transpose() * force.pull), k - driven);
  }
  return total;
}

double Objective::rub(float* gradient) const {
  const std::uint32_t k = field->k, driven = field->driven;
  double total = 0;
  for (Contact& contact : scratch->contacts) {
    const PushForce change = pressAnew(contact);
    total += change.energy;
    if (change.pull.isZero(0)) continue;
    addTo(gradient + 4 * driven, contact.phi + driven, padded(rotation.transpose() * change.pull), k - driven);
  }
  return total;
}

double Objective::besideElastic(const float* d, float* gradient) const {
  const float inertia = float(1 / (h * h));
  Eigen::Array4d squared = Eigen::Array4d::Zero();
  for (std::uint32_t i = 4 * field->driven; i < 4 * field->k; i += 4) {
    Four way = Four::Map(d + i);
    if (has_offset) way += Four::Map(scratch->offset.data() + i);
    squared += way.cast<double>().square();
    if (gradient != nullptr) Four::Map(gradient + i) += inertia * way;
  }
  double total = 0.5 / (h * h) * ((squared[0] + squared[1]) + squared[2]) + external(d, gradient);
  if (!momentum.isZero(0)) total += turning(d, gradient);
  return total;
}

double Objective::turning(const float* d, float* gradient) const {
  using Wide = Eigen::Array4d;
  const float *const arms = scratch->spinning.data(), *const tumbling = scratch->tumbling.data();
  Wide x = Wide::Zero(), y = x, z = x, mean = x, tumbled = x;
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const Four way = Four::Map(d + 4 * j);
    const Wide arm = Four::Map(arms + 4 * j).cast<double>() + way.cast<double>();
    x += arm[0] * arm;
    y += arm[1] * arm;
    z += arm[2] * arm;
    mean += field->oneOf(j) * arm;
    tumbled += (Four::Map(tumbling + 4 * j) * way).cast<double>();
  }
  mean /= field->ones;
  Matrix3d moment = -field->ones * mean.matrix().head<3>() * mean.matrix().head<3>().transpose();
  moment.col(0) += x.matrix().head<3>();
  moment.col(1) += y.matrix().head<3>();
  moment.col(2) += z.matrix().head<3>();
  const Vector3d omega = inertiaFrom(moment).inverse() * momentum;
  const double total = 0.5 * momentum.dot(omega) + ((tumbled[0] + tumbled[1]) + tumbled[2]);
  if (gradient == nullptr) return total;
  const Matrix3d out = omega.squaredNorm() * Matrix3d::Identity() - omega * omega.transpose();
  std::array<Wide, 3> columns;
  for (int c = 0; c < 3; ++c) columns[std::size_t(c)] << out.col(c).array(), 0;
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const Wide arm =
        Four::Map(arms + 4 * j).cast<double>() + Four::Map(d + 4 * j).cast<double>() - field->oneOf(j) * mean;
    const Wide pull = arm[0] * columns[0] + arm[1] * columns[1] + arm[2] * columns[2];
    Four::Map(gradient + 4 * j) += (Four::Map(tumbling + 4 * j).cast<double>() - pull).cast<float>();
  }
  return total;
}

void Objective::spin(const Vector3d& angular, const Vector3d& velocity) {
  if (!(h * h * velocity.squaredNorm() > kRounding)) return;
  momentum = rotation.cast<double>().transpose() * angular;
  float *const arms = scratch->spinning.data(), *const tumbling = scratch->tumbling.data();
  const auto armOf = [&](std::uint32_t j) { return Eigen::Map<const Eigen::Vector3f>(arms + 4 * j).cast<double>(); };
  Matrix3d moment = Matrix3d::Zero();
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const Vector3d arm = Eigen::Map<const Eigen::Vector3f>(scratch->shape.data() + 4 * j).cast<double>() +
                         field->restOf(j) - field->oneOf(j) * field->rest_center;
    moment += arm * arm.transpose();
    Four::Map(arms + 4 * j) = padded(arm.cast<float>());
  }
  const Matrix3d inverse = inertiaFrom(moment).inverse();
  const Vector3d omega = inverse * momentum;
  Vector3d torque = Vector3d::Zero();
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const Vector3d arm = armOf(j);
    torque += arm.cross(omega.cross(arm.cross(omega)));
  }
  const Vector3d tumbles = inverse * torque;
  for (std::uint32_t j = 0; j < field->k; ++j) {
    Four::Map(tumbling + 4 * j) = padded(tumbles.cross(Vector3d(armOf(j))).cast<float>());
  }
}

void Objective::setFrame(std::span<const Vector3d> x, const Vector3d& center, const Matrix3d& turned) {
  rotation = turned.cast<float>();
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const double one = field->oneOf(j);
    const Vector3d local =
        turned.transpose() * Vector3d(x[j] - one * center) - (field->restOf(j) - one * field->rest_center);
    for (std::uint32_t c = 0; c < 3; ++c) scratch->shape[4 * j + c] = float(local[int(c)]);
    scratch->shape[4 * j + 3] = 0;
  }
  for (std::uint32_t p = 0; p < field->pack_count; ++p) {
    std::fill_n(scratch->quaternions.data() + 32 * p, 8, 1.0F);
    std::fill_n(scratch->quaternions.data() + 32 * p + 8, 24, 0.0F);
  }
}

void Objective::placeAt(const float* d, float* x) const {
  for (std::uint32_t j = 0; j < 4 * field->k; j += 4) {
    Four::Map(x + j) = Four::Map(scratch->shape.data() + j) + Four::Map(d + j);
  }
}

Eigen::Vector3f Objective::wayOf(const float* row, const float* d) const {
  return rotation * sumOfRows(row, d, field->k).matrix().head<3>();
}

double Objective::elastic(const float* d, float* gradient, bool mark) const {
  float places[4 * kOnStack];
  float* const x = field->k <= kOnStack ? places : scratch->x.data();
  placeAt(d, x);
  FieldEnergyArguments arguments = {};
  arguments.functions = field->k;
  arguments.pack_count = field->pack_count;
  arguments.packs = field->packs;
  arguments.gradients = field->gradients;
  arguments.stiffness = stiffness;
  arguments.coefficients = x;
  arguments.mark = mark;
  arguments.quaternions = scratch->quaternions.data();
  arguments.squeezed = scratch->squeezed.data();
  float lanes[24 * kOnStack];
  arguments.lanes = field->k <= kOnStack ? lanes : scratch->lanes.data();
  arguments.gradient = gradient;
  arguments.rest_change = rest_change;
  arguments.limits = field->limits;
  double energy = kernels().field_energy(arguments);
  if (fibres != nullptr) {
    energy +=
        fibres->fibre_energy + symmetric(fibres->fibres.data(), fibres->fibre_pull.data(), x, field->k, 0, gradient);
  }
  return energy;
}

void Objective::stiffnessAt(const float* d, float* matrix) const {
  placeAt(d, scratch->x.data());
  FieldStiffnessArguments arguments = {};
  arguments.functions = field->k;
  arguments.pack_count = field->pack_count;
  arguments.driven = field->driven;
  arguments.stride = field->stride;
  arguments.packs = field->packs;
  arguments.gradients = field->gradients;
  arguments.stiffness = stiffness;
  arguments.coefficients = scratch->x.data();
  arguments.squeezed = scratch->squeezed.data();
  arguments.rest_change = rest_change;
  arguments.limits = field->limits;
  arguments.scratch = scratch->samples.data();
  arguments.matrix = matrix;
  kernels().field_stiffness(arguments);
  if (fibres == nullptr) return;
  for (std::uint32_t i = field->driven; i < field->k; ++i) {
    addRow(*field, i, fibres->fibres.data() + std::size_t(field->k) * i, matrix);
  }
}

Objective::Value Objective::at(const float* d, float* gradient, bool mark) const {
  Value value;
  value.elastic = elastic(d, gradient, mark);
  value.total = value.elastic + besideElastic(d, gradient);
  return value;
}

void Objective::press(const float* d) const {
  for (Contact& contact : scratch->contacts) {
    contact.way = wayOf(contact.phi, d);
    contact.pressed = loadOf(contact);
  }
}

void Objective::precondition(float* g) const {
  const std::uint32_t k = field->k, driven = field->driven;
  // Rows of three: the padding of each is where the next one goes, or spare.
  float rows[3 * kOnStack + 8];
  float* const local = k <= kOnStack ? rows : scratch->x.data();
  for (std::uint32_t j = driven; j < k; ++j) Four::Map(local + 3 * (j - driven)) = Four::Map(g + 4 * j);
  std::fill_n(local + 3 * (k - driven), 8, 0.0F);
  if (system != nullptr) {
    kernels().solve({field->unknowns(), field->stride, const_cast<float*>(system), local});
  } else {
    float lanes[24 * kOnStack];
    kernels().field_modes({field->unknowns(), field->modes, float(1 / (h * h)), stiffness,
                           k <= kOnStack ? lanes : scratch->lanes.data(), local});
  }
  for (std::uint32_t j = driven; j < k; ++j) {
    Four row = Four::Map(local + 3 * (j - driven));
    row[3] = 0;
    Four::Map(g + 4 * j) = row;
  }
}

double Objective::heldByContacts(const float* direction, bool carrying) const {
  double held = 0;
  for (const Contact& contact : scratch->contacts) {
    if (gapOf(contact) < 0 || (carrying && !contact.carries)) continue;
    held += double(contact.firm) * double(wayOf(contact.phi, direction).squaredNorm());
  }
  return held;
}

double Objective::fallen2(const float* gradient) const {
  if (has_springs || holds != nullptr || field->driven > 0) return 0;
  Eigen::Vector3d pull = Eigen::Vector3d::Zero();
  double mass = 0;
  for (std::uint32_t j = 0; j < field->k; ++j) {
    const double one = field->oneOf(j);
    pull += one * Eigen::Map<const Eigen::Vector3f>(gradient + 4 * j).cast<double>();
    mass += one * one;
  }
  const double least = isPushed() ? kSettled / kBalanced : 1;
  return least * least * (h * h * h * h) * pull.squaredNorm() / mass;
}

bool Objective::isPushed() const {
  const auto& contacts = scratch->contacts;
  return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return gapOf(c) < 0; });
}

double Objective::settled2(double way2) const {
  const double moves = kRounding * std::min(1.0, h * h * roughStiffness());
  const double part = has_springs && field->driven == 0 ? kSettledHeld : kSettled;
  return part * part * way2 + moves * moves * field->second_moment;
}

double Objective::roughStiffness() const {
  const double omega = 2 * M_PI * double(field->lowest_hz);
  return kRough * double(stiffness) * omega * omega;
}

// Touches first, each once, then what each piece has of them: in an order that no thread changes.
Objective::Value Minimand::at(const float* d, float* gradient, bool mark) const {
  if (isAlone()) return pieces[0]->at(d, gradient, mark);
  Objective::Value value;
  value.total = lanes->evaluate(d, first, jobs);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    float* const own = gradient != nullptr ? gradient + first[i] : nullptr;
    values[i] = pieces[i]->at(d + first[i], own, mark);
    if (own != nullptr) lanes->addPulls(i, own);
  });
  for (const Objective::Value& one : values) {
    value.total += one.total;
    value.elastic += one.elastic;
  }
  return value;
}

void Minimand::comeTo() const {
  for (std::size_t i = 0; i < elastic.size(); ++i) elastic[i] = values[i].elastic;
}

double Minimand::besideElastic(const float* d) const {
  double total = lanes->evaluate(d, first, jobs);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob,
          [&](std::uint32_t i) { values[i].total = pieces[i]->besideElastic(d + first[i], nullptr); });
  for (const Objective::Value& one : values) total += one.total;
  return total;
}

double Minimand::rub(float* gradient) const {
  if (isAlone()) return pieces[0]->rub(gradient);
  double total = lanes->rub(jobs);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    values[i].total = pieces[i]->rub(gradient + first[i]);
    lanes->addPulls(i, gradient + first[i]);
  });
  for (const Objective::Value& one : values) total += one.total;
  return total;
}

void Minimand::press(const float* d) const {
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) { pieces[i]->press(d + first[i]); });
  if (lanes != nullptr) lanes->place(d, first, true, jobs);
}

void Minimand::precondition(float* g) const {
  if (rigid != nullptr) rigid->take(*this, g);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    if (!own_pairs.empty()) own_pairs[i]->reduce(g + first[i]);
    std::fill_n(g + first[i], 4 * pieces[i]->field->driven, 0.0F);
    pieces[i]->precondition(g + first[i]);
    if (!own_pairs.empty()) own_pairs[i]->expand(g + first[i]);
  });
  if (rigid != nullptr) rigid->give(*this, g);
}

void Minimand::takeOwn(const float* from, const float* to, const float* gradient, const float* next_gradient) const {
  if (own_pairs.empty()) return;
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    const std::uint32_t at = first[i];
    Pairs& own = *own_pairs[i];
    own.propose(from + at, to + at, gradient + at, next_gradient + at, 0, 4 * pieces[i]->field->k);
    lanes->addBends(i, own.nextOffset(), own.nextChange());
    own.keep();
  });
  lanes->pullOn(jobs);
}

bool Minimand::hasFriction() const {
  const auto slows = [](const Push& push) { return push.friction > 0; };
  const auto rubs = [&slows](const Objective* piece) {
    const auto& contacts = piece->scratch->contacts;
    return std::any_of(contacts.begin(), contacts.end(), slows);
  };
  return (lanes != nullptr && lanes->hasFriction()) || std::any_of(pieces.begin(), pieces.end(), rubs);
}

double Minimand::heldByContacts(const float* direction) const {
  if (isAlone()) return pieces[0]->heldByContacts(direction);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    const Objective& piece = *pieces[i];
    double& held = values[i].total;
    const bool freed = rigid->frees(i);
    held = piece.heldByContacts(direction + first[i], freed);
    for (const TouchRow& row : piece.touch_rows) {
      if (pushes(row) || (freed && !touches[row.touch].carries)) continue;
      held += double(row.firm) * double(piece.wayOf(row.phi, direction + first[i]).squaredNorm());
    }
  });
  double held = 0;
  for (const Objective::Value& one : values) held += one.total;
  return held;
}

double Minimand::settled2(std::uint32_t piece, const float* d) const {
  return pieces[piece]->settled2(dot(d + first[piece], d + first[piece], 4 * pieces[piece]->field->k));
}

double Minimand::unsettled2(const float* direction, const float* d) const {
  const auto of = [&](std::uint32_t i) {
    const float* const way = direction + first[i];
    return dot(way, way, 4 * pieces[i]->field->k) / settled2(i, d);
  };
  if (isAlone()) return of(0);
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) { values[i].total = of(i); });
  double most = 0;
  for (const Objective::Value& one : values) most = std::max(most, one.total);
  return most;
}

double Minimand::fallen2(const float* gradient, const float* d) const {
  if (isAlone()) return pieces[0]->fallen2(gradient) / settled2(0, d);
  double most = 0;
  for (std::uint32_t i = 0; i < pieces.size(); ++i) {
    if (pieces[i]->isPushed()) continue;
    const auto rows = pieces[i]->touch_rows;
    if (std::any_of(rows.begin(), rows.end(), [this](const TouchRow& row) { return pushes(row); })) continue;
    most = std::max(most, pieces[i]->fallen2(gradient + first[i]) / settled2(i, d));
  }
  return most;
}

// Of a convex energy E(b) - E(a) <= grad E(b) . (b - a): what raises it turned its slope round.
bool Minimand::renew(const float* d, const float* next_gradient, const float* direction, bool pushing_only) const {
  if (lanes != nullptr) lanes->place(d, first, false, jobs);
  bool some = false;
  for (std::size_t i = 0; i < pieces.size() && !pushing_only; ++i) {
    Objective& piece = *pieces[i];
    const float* const way = direction + first[i];
    piece.renews = !piece.renewed && dot(next_gradient + first[i], way, 4 * piece.field->k) < 0;
    some = some || piece.renews;
  }
  // Not convex: any may have.
  for (Objective* piece : pieces) piece->renews = !pushing_only && (some ? piece->renews : !piece->renewed);
  const auto renews = [&](std::uint32_t piece) { return piece < pieces.size() && pieces[piece]->renews; };
  for (TouchLink& touch : touches) {
    const bool counts = pushing_only ? pushes(touch) : renews(touch.a) || renews(touch.b) || touch.firm > 0;
    const float firm = counts ? touch.kappa : 0;
    if (firm == touch.firm) continue;
    touch.firm = firm;
    for (const std::uint32_t piece : {touch.a, touch.b}) {
      if (piece < pieces.size()) pieces[piece]->renews = true;
    }
  }
  some = false;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    Objective& piece = *pieces[i];
    for (Contact& contact : piece.scratch->contacts) {
      contact.way = piece.wayOf(contact.phi, d + first[i]);
      const bool counts = pushing_only ? gapOf(contact) < 0 : piece.renews || contact.firm > 0;
      const float firm = counts ? contact.kappa : 0;
      piece.renews = piece.renews || firm != contact.firm;
      contact.firm = firm;
    }
    some = some || piece.renews;
  }
  if (!some) return false;
  forEach(jobs, std::uint32_t(pieces.size()), kPiecesAJob, [&](std::uint32_t i) {
    Objective& piece = *pieces[i];
    if (!piece.renews) return;
    piece.renewed = true;
    if (!own_pairs.empty()) own_pairs[i]->clear();
    for (TouchRow& row : piece.touch_rows) row.firm = touches[row.touch].firm;
    useSystemAt(piece, *systems[i], d + first[i]);
  });
  if (rigid != nullptr) rigid->make(*this, true);
  return true;
}

namespace {

/// Whether a direction stays short without what holds it but does not push: along it the curvature is slope - held, not
/// slope, so that the minimum lies at slope / (slope - held) times its length; and as a whole it goes by what no
/// contact balances.
bool staysShort(double squared_length, double most, double slope, double held, double fallen2, bool pushed = false) {
  if ((held > 0 || pushed) && fallen2 > most) return false;
  const double left = 1 - held / slope;
  return left > 0 && squared_length <= left * left * most;
}

}  // namespace

bool isSettled(const Objective& objective, const float* d, const float* gradient) {
  float* const direction = objective.scratch->direction.data();
  const std::uint32_t first = 4 * objective.field->driven, n = 4 * objective.field->k - first;
  std::copy_n(gradient + first, n, direction + first);
  std::fill_n(direction, first, 0.0F);
  objective.precondition(direction);
  return staysShort(dot(direction + first, direction + first, n), objective.settled2(dot(d + first, d + first, n)),
                    dot(gradient + first, direction + first, n), objective.heldByContacts(direction),
                    objective.fallen2(gradient), objective.isPushed());
}

namespace {

/// Whether a piece slides as a whole: its contacts, where last evaluated, hold it by all that friction allows.
bool slides(const Objective& objective) {
  float held = 0, most = 0;
  bool pushes = false;
  for (const Contact& contact : objective.scratch->contacts) {
    const float bound = contact.friction * contact.pressed;
    held += std::min(contact.kappa * slideOf(contact).norm(), bound);
    most += bound;
    pushes = pushes || contact.pressed > 0;
  }
  return pushes && held >= kAtBound * most && objective.field->driven == 0;
}

constexpr std::uint32_t kOnly = 0;

/// A piece as a Minimand of its own. \param pieces what it refers to.
Minimand aloneIn(Objective* const* piece) {
  Minimand minimand;
  minimand.pieces = {piece, 1};
  minimand.first = {&kOnly, 1};
  minimand.order = {&kOnly, 1};
  minimand.size = 4 * (*piece)->field->k;
  minimand.vectors = (*piece)->scratch;
  return minimand;
}

}  // namespace

Objective::Value minimize(Objective& objective, SystemFactor& system, Pairs& pairs, std::uint32_t iterations,
                          Objective::Value value) {
  Objective* const piece = &objective;
  SystemFactor* const systems[] = {&system};
  Minimand minimand = aloneIn(&piece);
  minimand.systems = systems;
  return minimize(minimand, pairs, iterations, value);
}

bool maySlide(const Objective& objective) {
  const auto& contacts = objective.scratch->contacts;
  return objective.field->driven == 0 &&
         std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return heldAcross(c) < 1; });
}

void slide(Objective& objective, const float* d, const float* gradient, float* to) {
  Objective* const piece = &objective;
  const Minimand minimand = aloneIn(&piece);
  RigidCoupling& rigid = objective.scratch->rigid;
  rigid.make(minimand, true);
  rigid.take(minimand, gradient);
  std::fill_n(to, minimand.size, 0.0F);
  rigid.giveAlone(minimand, to);
  for (std::uint32_t i = 0; i < minimand.size; i += 4) Four::Map(to + i) = Four::Map(d + i) - Four::Map(to + i);
}

Objective::Value minimize(Minimand& minimand, Pairs& pairs, std::uint32_t iterations, Objective::Value value) {
  MinimizeScratch& s = *minimand.vectors;
  // Pins decide the driven coefficients: precondition() leaves them where they are.
  const std::uint32_t n = minimand.size;
  JobSystem* const jobs = minimand.jobs;
  float *const d = s.d.data(), *const gradient = s.gradient.data(), *const direction = s.direction.data();
  float* const trial = s.next.data();
  const float* const next_gradient = s.next_gradient.data();
  bool carried = pairs.count() > 0;  // from a step before: of another shape where they lead astray
  bool renewed = false;              // matrices are those of this shape
  for (Objective* piece : minimand.pieces) piece->renewed = false;
  const bool has_friction = minimand.hasFriction();
  float scale = 1;  // of the inverse of the first matrix: what had to be cut was too soft
  const auto all = [&](const auto& visit) {
    visit(pairs);
    for (Pairs* own : minimand.own_pairs) visit(*own);
  };
  const auto clear = [&] { all([](Pairs& some) { some.clear(); }); };
  if (minimand.lanes != nullptr) minimand.lanes->pullOn(jobs);
  // First matrices hold across what pushes: what slides as a whole goes its way at once.
  const bool is_alone = minimand.rigid == nullptr;
  const auto findSlides = [&] {
    if (!is_alone || (minimand.rigid == nullptr && !slides(*minimand.pieces[0]))) return;
    minimand.rigid = &s.rigid;
    s.rigid.make(minimand, true);
  };
  findSlides();
  double energy_noise = 0;
  for (const Objective* piece : minimand.pieces) {
    energy_noise += kRounding * kRounding * piece->roughStiffness() * piece->field->second_moment;
  }
  for (std::uint32_t iteration = 0; iteration < iterations;) {
    std::copy_n(gradient, n, direction);
    pairs.reduce(direction, jobs);
    minimand.precondition(direction);
    for (std::uint32_t i = 0; scale != 1 && i < n; i += 4) Four::Map(direction + i) *= scale;
    pairs.expand(direction, jobs);
    double slope = dot(gradient, direction, n, jobs);
    if (!(slope > 0)) {
      std::uint32_t count = 0;
      all([&count](const Pairs& some) { count += some.count(); });
      if (count == 0) break;
      clear();
      continue;
    }
    // The way a scaled matrix leaves is longer where the first one was right.
    const double most = double(scale) * double(scale), length2 = minimand.unsettled2(direction, d);
    const double fallen2 = length2 <= most ? minimand.fallen2(gradient, d) : 0;
    const bool settled = length2 <= most && !(is_alone && fallen2 > most && minimand.pieces[0]->isPushed());
    if (settled && (renewed || staysShort(length2, most, slope, minimand.heldByContacts(direction), fallen2))) break;
    float part = 1;
    bool taken = false;
    Objective::Value next;
    for (std::uint32_t tries = 0; tries < 6 && !taken && !settled; ++tries) {
      for (std::uint32_t i = 0; i < n; i += 4) {
        Four::Map(trial + i) = Four::Map(d + i) - part * Four::Map(direction + i);
      }
      next = minimand.at(s.next.data(), s.next_gradient.data(), false);
      const double noise = kEnergyNoise * (std::abs(value.elastic) + std::abs(next.elastic)) + energy_noise;
      const double wanted = value.total - kSufficient * double(part) * slope;
      // Where energies say nothing any more slopes do (Hager and Zhang 2005, the approximate Wolfe condition).
      taken = next.total <= wanted - noise ||
              (next.total <= wanted + noise && dot(next_gradient, direction, n, jobs) >= (2 * kSufficient - 1) * slope);
      if (taken) break;
      if (carried) break;
      part *= tries == 0 ? 0.5F : 0.25F;
      // Another shape's stiffness is no guide here.
      if (!renewed && tries == kCuts) break;
    }
    if (!taken && carried) {
      pairs.clear();
      carried = false;
      continue;
    }
    ++iteration;
    if (!taken) {
      if (!minimand.renew(d, next_gradient, direction, settled)) break;
      renewed = true;
      pairs.clear();
      scale = 1;
      continue;
    }
    for (std::size_t i = 0; renewed && i < minimand.pieces.size(); ++i) minimand.pieces[i]->renewed = false;
    renewed = carried = false;
    scale *= part;
    minimand.comeTo();
    pairs.take(d, trial, gradient, next_gradient, jobs);
    minimand.takeOwn(d, trial, gradient, next_gradient);
    std::copy_n(trial, n, d);
    std::copy_n(s.next_gradient.data(), n, s.gradient.data());
    value = next;
    // Friction's bound follows the load: the objective of the next iteration is another one.
    if (has_friction) value.total += minimand.rub(gradient);
    findSlides();
  }
  return value;
}

}  // namespace sinew::internal
